"""Mechanisms in space with what is known of each: ready ones, others, and planar ones built of spatial parts."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import redundax as rx
from redundax import spatial

Z = np.array([0.0, 0.0, 1.0])


# Other mechanisms ---------------------------------------------------------------------------


def bar(name: str, start: Sequence[float], end: Sequence[float], mass: float = 1.0) -> spatial.Body:
    """A bar of a little thickness along its x axis, y in the horizontal plane or along x if it is upright."""
    line = np.subtract(end, start).astype(float)
    length = np.linalg.norm(line)
    x = line / length
    y = np.cross(Z, x) if abs(x[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    y = y / np.linalg.norm(y)
    across = mass * length**2 / 12
    axes = np.stack([x, y, np.cross(x, y)], axis=1)
    inertia = (0.01 * across, across, across)
    return spatial.Body(name, mass, inertia, centre=(length / 2, 0, 0), position=start, orientation=axes)


def four_bar() -> rx.Mechanism:
    """A planar four-bar of spatial hinges, in a plane that is no global one."""
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
    a, b, c, d = (tilt @ np.array(p) for p in ((0, 0, 0), (0.2, 0.3, 0), (0.9, 0.45, 0), (0.8, 0, 0)))
    crank, coupler, rocker = bar("crank", a, b), bar("coupler", b, c), bar("rocker", c, d)
    pins = (
        ("A", crank, rx.GROUND, a),
        ("B", coupler, crank, b),
        ("C", coupler, rocker, c),
        ("D", rocker, rx.GROUND, d),
    )
    joints = [spatial.Revolute(name, i, j, point=point, axis=tilt @ Z) for name, i, j, point in pins]
    return rx.Mechanism([crank, coupler, rocker], joints, gravity=(0, -9.81, 0))


def rssr() -> rx.Mechanism:
    """Crank and rocker of skew axes with a rod on ball joints, which spins idly about its line."""
    a, b, c, d = (0, 0, 0), (0, 0.2, 0), (0.7, 0.1, 0.5), (0.8, 0, 0)
    crank, rod, rocker = bar("crank", a, b), bar("rod", b, c), bar("rocker", c, d)
    joints = [
        spatial.Revolute("A", crank, rx.GROUND, point=a, axis=(1, 0, 0)),
        spatial.Spherical("B", rod, crank, point=b),
        spatial.Spherical("C", rod, rocker, point=c),
        spatial.Revolute("D", rocker, rx.GROUND, point=d, axis=(0, 1, 0)),
    ]
    return rx.Mechanism([crank, rod, rocker], joints, gravity=(0, 0, -9.81))


def carriage() -> rx.Mechanism:
    """A carriage on two parallel shafts, a sleeve on each."""
    body = spatial.Body("carriage", 3.0, (0.02, 0.03, 0.04), centre=(0.01, 0.02, -0.03))
    sleeves = [
        spatial.Cylindrical(name, body, rx.GROUND, point=(0, y, 0), axis=(1, 0, 0))
        for name, y in (("L", -0.1), ("R", 0.1))
    ]
    return rx.Mechanism([body], sleeves, gravity=(2.0, 0, -9.81))


# All of them --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Case:
    """A mechanism, the joint coordinate that moves it, its counts, and places of that coordinate."""

    make: Callable[[], rx.Mechanism]
    coordinate: str
    n: int
    m: int
    rank: int
    places: tuple[float, ...] = (0.3, -0.4, 0.8)

    @cached_property
    def mechanism(self) -> rx.Mechanism:
        return self.make()

    @cached_property
    def state(self) -> rx.State:
        return self.at(None)

    def at(self, place: float | None, rate: float = 1.0) -> rx.State:
        """The state at a place, or the reference pose, and a rate."""
        positions = None if place is None else {self.coordinate: place}
        return rx.assemble(self.mechanism, rates={self.coordinate: rate}, positions=positions)


CASES = {
    "door": Case(rx.mechanisms.door, "hinge 1.angle", 6, 15, 5),
    "bennett": Case(rx.mechanisms.bennett, "A.angle", 18, 20, 17),
    "bricard": Case(rx.mechanisms.bricard, "A.angle", 30, 30, 29),
    "sarrus": Case(rx.mechanisms.sarrus, "A1.angle", 30, 30, 29),
    "double cardan": Case(partial(rx.mechanisms.double_cardan, 0.5, 0.3, width=0.2), "inlet.angle", 18, 18, 17),
    "governor": Case(rx.mechanisms.governor, "axis.angle", 24, 20, 20),
    "delta": Case(rx.mechanisms.delta, "shoulder 1.angle", 60, 63, 57),
    "four-bar": Case(four_bar, "A.angle", 18, 20, 17),
    "rssr": Case(rssr, "A.angle", 18, 16, 16),
    "carriage": Case(carriage, "L.travel", 6, 8, 5),
}


# Planar mechanisms in space -----------------------------------------------------------------


def lifted(bodies: Sequence[rx.Body], joints: Sequence, gravity: np.ndarray) -> rx.Mechanism:
    """A planar mechanism of revolutes and translational joints, built of spatial hinges and sliders."""
    mine = [spatial.Body(body.name, body.mass, jnp.stack([body.inertia] * 3)) for body in bodies]
    return rx.Mechanism(mine, [_lifted(joint) for joint in joints], gravity=np.append(gravity, 0.0))


def _lifted(joint) -> spatial.AbstractJoint:
    on_i, on_j = (np.append(point, 0.0) for point in (joint.point_i, joint.point_j))
    if isinstance(joint, rx.Revolute):
        kind, axes = spatial.Revolute, (Z, Z)
    else:
        kind, along, psi = spatial.Prismatic, np.array([joint.normal[1], -joint.normal[0]]), float(joint.angle)
        back = np.array([[np.cos(psi), np.sin(psi)], [-np.sin(psi), np.cos(psi)]])
        axes = np.append(back @ along, 0.0), np.append(along, 0.0)
    mark = Z if kind is spatial.Prismatic else np.array([1.0, 0.0, 0.0])
    places = [spatial.Placement(point, axis, mark) for point, axis in zip((on_i, on_j), axes, strict=True)]
    if kind is spatial.Revolute:  # what a planar load does not press has any size
        rubs = {"pin_radius": joint.pin_radius, "bearing_length": 0.07, "thrust_radius": 0.4}
    else:
        rubs = {"guide_length": joint.guide_length, "twist_radius": 0.03}
    rubs = {"friction": joint.friction, **rubs} if joint.friction is not None else {}
    return kind(joint.name, joint.i, joint.j, on_i=places[0], on_j=places[1], **rubs)


def rods(friction: rx.AbstractFrictionModel) -> tuple[list[rx.Body], list[rx.Revolute]]:
    """Bodies and pins of a planar four-bar of rods of 2 kg/m: crank 0.2, coupler 0.5, rocker 0.4 and ground 0.5 m."""
    (a, b, c, d), ground = (0.2, 0.5, 0.4, 0.5), rx.GROUND
    bodies = [rx.Body(name, 2 * size, size**3 / 6) for name, size in (("crank", a), ("coupler", b), ("rocker", c))]
    pins = [
        ("A", "crank", ground, (-a / 2, 0.0), (0.0, 0.0)),
        ("B", "coupler", "crank", (-b / 2, 0.0), (a / 2, 0.0)),
        ("C", "rocker", "coupler", (c / 2, 0.0), (b / 2, 0.0)),
        ("D", "rocker", ground, (-c / 2, 0.0), (d, 0.0)),
    ]
    return bodies, [rx.Revolute(*pin, 0.01, friction) for pin in pins]


def swinging(mechanism: rx.Mechanism) -> rx.State:
    """A state of the planar mechanism of `rods`, its crank at 5 rad/s."""
    guess = [0.05, 0.08, 0.3, 0.3, 0.6, 0.2, 1.0, 0.4, 1.3]
    return rx.assemble(mechanism, guess, positions={"crank.phi": 1.0}, rates={"crank.phi": 5.0})


def position_in_space(q: np.ndarray) -> np.ndarray:
    """Centres of mass and quaternions of a planar position, (..., 7 bodies)."""
    count = np.shape(q)[-1] // 3
    r, phi = np.asarray(q)[..., : 2 * count], np.asarray(q)[..., 2 * count :]
    flat, zero = r.reshape(*r.shape[:-1], count, 2), np.zeros_like(phi)
    x = np.concatenate([flat, zero[..., None]], axis=-1)
    p = np.stack([np.cos(phi / 2), zero, zero, np.sin(phi / 2)], axis=-1)
    return np.concatenate([x.reshape(*zero.shape[:-1], -1), p.reshape(*zero.shape[:-1], -1)], axis=-1)


def velocity_in_space(qd: np.ndarray) -> np.ndarray:
    """Velocities, or accelerations, of planar ones, (..., 6 bodies)."""
    count = np.shape(qd)[-1] // 3
    v, w = np.asarray(qd)[..., : 2 * count], np.asarray(qd)[..., 2 * count :]
    zero, flat = np.zeros_like(w), v.reshape(*v.shape[:-1], count, 2)
    x, spin = np.concatenate([flat, zero[..., None]], axis=-1), np.stack([zero, zero, w], axis=-1)
    return np.concatenate([x.reshape(*w.shape[:-1], -1), spin.reshape(*w.shape[:-1], -1)], axis=-1)


# Energy and other ways to state the same ----------------------------------------------------


def energies(mechanism: rx.Mechanism, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic and potential energy along a motion under gravity, shape (times,) each."""
    mass, count = np.asarray(mechanism.mass(jnp.asarray(q[0]), jnp.zeros(()))), len(mechanism.names.bodies)
    weight = np.diag(mass)[: 3 * count].reshape(count, 3) * np.asarray(mechanism.gravity)
    kinetic = 0.5 * np.einsum("ti,ij,tj->t", qd, mass, qd)
    return kinetic, -np.asarray(q)[:, : 3 * count] @ weight.ravel()


def parts(mechanism: rx.Mechanism) -> tuple[list[spatial.Body], list[spatial.AbstractPlacedJoint]]:
    """Bodies and joints that make a mechanism of placed joints anew, joints by their placements."""
    names = (*mechanism.names.bodies, rx.GROUND)
    own = eqx.filter(mechanism.body, eqx.is_array)
    bodies = [
        spatial.Body(
            name,
            own.mass[b],
            mechanism.body.inertia[b],
            centre=own.centre[b],
            position=own.position[b],
            orientation=own.orientation[b],
        )
        for b, name in enumerate(names[:-1])
    ]
    joints = []
    for stack, group in zip(mechanism.joints, mechanism.names.joints, strict=True):
        for k, name in enumerate(group):
            e = stack.element
            ends = names[int(stack.i[k])], names[int(stack.j[k])]
            joints.append(joint(type(e), name, *ends, (e.point_i[k], e.axes_i[k]), (e.point_j[k], e.axes_j[k])))
    return bodies, joints


def joint(kind: type, name: str, i: str, j: str, on_i: tuple, on_j: tuple) -> spatial.AbstractPlacedJoint:
    """A joint at points and axes (3, 3) of both bodies."""
    places = [spatial.Placement(point, axes[:, 2], axes[:, 0]) for point, axes in (on_i, on_j)]
    return kind(name, i, j, on_i=places[0], on_j=places[1])
