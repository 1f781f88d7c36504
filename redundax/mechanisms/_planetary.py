"""Planetary gear set: planets on a carrier between a sun and a ring that stands.

One planet closes the path from the sun to the ring; each one more repeats two constraints and brings one freedom of its
own, k = planets - 1. With numbers of teeth z_r = z_s + 2 z_p, sun angle phi and planet k at the angle theta_k,

    carrier  phi_c = phi z_s / (z_s + z_r),   theta_k = phi_c + 2 pi k / planets
    planet   z_p (phi_k - theta_k) = (z_p + 1) pi - z_s (phi - theta_k)

The teeth of all planets fit where (z_s + z_r) / planets is whole.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND
from .._bodies._joints import GearPair, Revolute
from .._bodies._loads import AppliedForce
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._errors import RedundaxError
from .._tools._module import figure, floats
from .._tools._value import AbstractModule
from ._parts import Numbers, at_least, checked, coulomb, point, rubbing, spread, uniform_disc


class _Pose(AbstractModule):
    """Coordinates at sun angle phi."""

    distance: Float[Array, ""] = eqx.field(converter=figure("distance"))
    sun_teeth: int = eqx.field(static=True)
    planet_teeth: int = eqx.field(static=True)
    planets: int = eqx.field(static=True)

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, "..."]:
        sun, planet = self.sun_teeth, self.planet_teeth
        carrier, places = phi * sun / (2 * (sun + planet)), spread(self.planets)
        angles = carrier + places
        centres = self.distance * jnp.stack([jnp.cos(angles), jnp.sin(angles)], axis=1)
        turned = angles + ((planet + 1) * np.pi - sun * (phi - angles)) / planet
        return jnp.concatenate([jnp.zeros(4), centres.ravel(), jnp.stack([phi, carrier]), turned])


@checked
def planetary(
    planets: int = 3,
    sun_teeth: int = 24,
    planet_teeth: int = 18,
    module: ArrayLike = 0.002,
    sun_mass: ArrayLike = 0.5,
    carrier_mass: ArrayLike = 1.0,
    planet_mass: ArrayLike = 0.3,
    torque: ArrayLike = 10.0,
    load: ArrayLike = 0.0,
    flank: int = 1,
    mu_rho: Numbers | None = None,
    mu: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A planetary gear set with equal planets around, whose ring stands.

    Bodies "sun", "carrier", "planet 1", ..., uniform discs of their pitch radii; revolutes A (sun on the ground at the
    origin), B (carrier there) and C1, ... (planets on the carrier), gear pairs S1, ... (sun with planets) and R1, ...
    (planets with the ring, which is the ground). n = 6 + 3 planets, m = 4 + 4 planets, rank n - 1, k = planets - 1, one
    degree of freedom. How the planets share the load is not unique.

    ??? example

        ```python
        planetary = rx.mechanisms.planetary()
        state = planetary.state(phi=0.3, rate=100.0)
        rx.solve(planetary, state)["S1.teeth"]  # N, a third of what the torque asks for
        ```

    **Arguments:**

    - `planets`: their number, which must divide the number of teeth of sun and ring together.
    - `sun_teeth`, `planet_teeth`: numbers of teeth; the ring has `sun_teeth + 2 planet_teeth`.
    - `module`: m.
    - `sun_mass`, `carrier_mass`, `planet_mass`: kg; of each planet.
    - `torque`, `load`: moments on sun and carrier, N m.
    - `flank`: 1 for the flanks that a positive torque of the sun presses, -1 for the others.
    - `mu_rho`: friction coefficient times pin radius of A, B, C1, ..., m; one number or one for each. None by default.
    - `mu`: friction coefficient of the teeth of S1, R1, S2, ...; one number or one for each. None by default.
    - `gravity`: m/s^2, downwards.

    `state(phi, rate=...)` gives the state at sun angle phi (rad) and sun rate (rad/s).
    """
    at_least("planets", planets, 1, "Give the number of planets.")
    ring_teeth = sun_teeth + 2 * planet_teeth
    if (sun_teeth + ring_teeth) % planets:
        raise RedundaxError(
            f"Argument `planets` must divide the {sun_teeth + ring_teeth} teeth of sun and ring together, but is "
            f"{planets}: else the teeth of the planets do not fit. Change a number of teeth."
        )
    apart = (sun_teeth + planet_teeth) * np.sin(np.pi / planets)  # of neighbours, in modules, tips one beyond the pitch
    if planets > 1 and apart <= planet_teeth + 2:
        raise RedundaxError(
            f"Argument `planets` must leave room between planets of {planet_teeth} teeth around a sun of {sun_teeth}, "
            f"but {planets} overlap. Take fewer, or give the sun more teeth."
        )
    module, gravity = floats(module), floats(gravity)
    radii, distance = (module * sun_teeth / 2, module * planet_teeth / 2), module * (sun_teeth + planet_teeth) / 2
    pins, rubs = rubbing("mu_rho", mu_rho, 2 + planets), coulomb("mu", mu, 2 * planets)
    names, centre = [f"planet {k + 1}" for k in range(planets)], point(0.0)
    bodies = [uniform_disc("sun", sun_mass, radii[0]), uniform_disc("carrier", carrier_mass, distance)]
    bodies += [uniform_disc(name, planet_mass, radii[1]) for name in names]
    revolutes = [
        Revolute("A", "sun", GROUND, point_i=centre, point_j=centre, **pins[0]),
        Revolute("B", "carrier", GROUND, point_i=centre, point_j=centre, **pins[1]),
    ]
    meshes, in_ring = [], np.pi / ring_teeth if planet_teeth % 2 else 0.0
    for k, (name, place) in enumerate(zip(names, spread(planets), strict=True)):
        pin = point(distance * np.cos(place), distance * np.sin(place))
        revolutes.append(Revolute(f"C{k + 1}", name, "carrier", point_i=centre, point_j=pin, **pins[2 + k]))
        axes = {"point_i": centre, "point_j": centre, "module": module}
        inner = {"teeth": (sun_teeth, planet_teeth), "flank": -flank, "friction": rubs[2 * k]}
        outer = {"teeth": (planet_teeth, -ring_teeth), "flank": flank, "friction": rubs[2 * k + 1], "angle_j": in_ring}
        meshes.append(GearPair(f"S{k + 1}", "sun", name, **axes, **inner))
        meshes.append(GearPair(f"R{k + 1}", name, GROUND, **axes, **outer))
    loads = [AppliedForce("sun", moment=torque), AppliedForce("carrier", moment=load)]
    pose = _Pose(distance, sun_teeth, planet_teeth, planets)
    joints = [*revolutes, *meshes]
    return Mechanism(bodies, joints, loads=loads, gravity=point(0.0, -gravity), pose=pose, units=Units())
