"""Gear train with parallel paths: countershafts around an input and an output shaft on one axis.

The torque divides between the countershafts, and each one beyond the first repeats one constraint, k = shafts - 1. With
numbers of teeth a of the input, b and c of the countershafts and d of the output, and countershaft k at theta_k,

    shaft   b (phi_k - theta_k) = (b + 1) pi - a (phi - theta_k),   output   d phi_o = c (a / b) phi

The gears of a countershaft are turned against each other by what its teeth need to fit at phi = 0.
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
from .._tools._words import short
from ._parts import Numbers, at_least, checked, coulomb, point, rubbing, spread, uniform_disc


class _Pose(AbstractModule):
    """Coordinates at input angle phi."""

    distance: Float[Array, ""] = eqx.field(converter=figure("distance"))
    teeth: tuple[int, int, int, int] = eqx.field(static=True)
    shafts: int = eqx.field(static=True)

    def __call__(self, phi: Float[Array, ""]) -> Float[Array, "..."]:
        a, b, c, d = self.teeth
        places = spread(self.shafts)
        centres = self.distance * np.stack([np.cos(places), np.sin(places)], axis=1)
        turned = _meshed(self.teeth, places) - phi * a / b
        return jnp.concatenate([jnp.zeros(4), centres.ravel(), jnp.stack([phi, phi * a * c / (b * d)]), turned])


def _meshed(teeth: tuple[int, int, int, int], places: np.ndarray) -> np.ndarray:
    """Angles of the countershafts where that of the input is 0."""
    a, b, _, _ = teeth
    return places + (a * places + (b + 1) * np.pi) / b


@checked
def countershaft_train(
    shafts: int = 2,
    teeth: tuple[int, int, int, int] = (20, 40, 24, 36),
    module: ArrayLike = 0.002,
    input_mass: ArrayLike = 1.0,
    output_mass: ArrayLike = 2.0,
    shaft_mass: ArrayLike = 1.5,
    torque: ArrayLike = 10.0,
    load: ArrayLike = 0.0,
    flank: int = 1,
    mu_rho: Numbers | None = None,
    mu: Numbers | None = None,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A gear train whose input drives its output, on the same axis, through equal countershafts around it.

    Bodies "input", "output" and "shaft 1", ..., uniform discs of the radii of their first gears; revolutes A (input), B
    (output) and C1, ... (countershafts) on the ground, gear pairs I1, ... (input with countershafts) and O1, ...
    (countershafts with the output). n = 6 + 3 shafts, m = 4 + 4 shafts, rank n - 1, k = shafts - 1, one degree of
    freedom. How the countershafts share the torque is not unique.

    ??? example

        ```python
        train = rx.mechanisms.countershaft_train(mu=0.05)
        rx.solve(train, train.state(phi=0.3, rate=100.0))["C1 force x on shaft 1"]
        ```

    **Arguments:**

    - `shafts`: their number.
    - `teeth`: numbers of teeth of the input, of the two gears of a countershaft, and of the output.
    - `module`: of input and first gear, m; that of the others follows from the common axis.
    - `input_mass`, `output_mass`, `shaft_mass`: kg; of each countershaft.
    - `torque`, `load`: moments on input and output, N m.
    - `flank`: 1 for the flanks that a positive torque of the input presses, -1 for the others.
    - `mu_rho`: friction coefficient times pin radius of A, B, C1, ..., m; one number or one for each. None by default.
    - `mu`: friction coefficient of the teeth of I1, O1, I2, ...; one number or one for each. None by default.
    - `gravity`: m/s^2, downwards.

    `state(phi, rate=...)` gives the state at input angle phi (rad) and input rate (rad/s).
    """
    at_least("shafts", shafts, 1, "Give the number of countershafts.")
    if np.shape(teeth) != (4,):
        raise RedundaxError(
            f"Argument `teeth` must be four whole numbers, but is {short(teeth)}. Give those of the input, of the two "
            "gears of a countershaft and of the output."
        )
    a, b, c, d = teeth
    module, gravity = floats(module), floats(gravity)
    second, distance = module * (a + b) / (c + d), module * (a + b) / 2
    pins, rubs = rubbing("mu_rho", mu_rho, 2 + shafts), coulomb("mu", mu, 2 * shafts)
    names, centre, places = [f"shaft {k + 1}" for k in range(shafts)], point(0.0), spread(shafts)
    bodies = [uniform_disc("input", input_mass, module * a / 2), uniform_disc("output", output_mass, second * d / 2)]
    bodies += [uniform_disc(name, shaft_mass, module * b / 2) for name in names]
    revolutes = [
        Revolute("A", "input", GROUND, point_i=centre, point_j=centre, **pins[0]),
        Revolute("B", "output", GROUND, point_i=centre, point_j=centre, **pins[1]),
    ]
    meshes, around = [], places + np.pi  # from a countershaft to the axis
    timing = around - _meshed(teeth, places) + (d * around + (d + 1) * np.pi) / c
    for k, (name, place) in enumerate(zip(names, places, strict=True)):
        pin = point(distance * np.cos(place), distance * np.sin(place))
        revolutes.append(Revolute(f"C{k + 1}", name, GROUND, point_i=centre, point_j=pin, **pins[2 + k]))
        axes = {"point_i": centre, "point_j": centre}
        first = {"teeth": (a, b), "module": module, "flank": -flank, "friction": rubs[2 * k]}
        last = {"teeth": (c, d), "module": second, "flank": flank, "friction": rubs[2 * k + 1], "angle_i": timing[k]}
        meshes.append(GearPair(f"I{k + 1}", "input", name, **axes, **first))
        meshes.append(GearPair(f"O{k + 1}", name, "output", **axes, **last))
    loads = [AppliedForce("input", moment=torque), AppliedForce("output", moment=load)]
    pose, joints = _Pose(distance, (a, b, c, d), shafts), [*revolutes, *meshes]
    return Mechanism(bodies, joints, loads=loads, gravity=point(0.0, -gravity), pose=pose, units=Units())
