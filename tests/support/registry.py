"""The systems that the laws are tested on, and how errors are measured.

`MECHANISMS` are the exact mechanisms of `truth.scenes` as `rx.Mechanism`, built from the exact data
alone, with two of `truth.space` beside them; `SYSTEMS` are user-written systems, each a few lines of jnp with its
solution in closed form beside it. Every builder makes its arrays when called, in the precision that holds then.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import builder
import jax
import jax.numpy as jnp
import numpy as np
from truth import exact, scenes, space

import redundax as rx

# Mechanisms from exact data -----------------------------------------------------------------

MECHANISMS = {name: cache(make) for name, make in scenes.MECHANISMS.items()}


def coulomb(joint: exact.Revolute | exact.Translational) -> rx.Coulomb:
    return rx.Coulomb(float(joint.numbers["coefficient"]))


def build(mechanism: exact.Mechanism, friction: Callable | None = None) -> tuple[rx.Mechanism, rx.State]:
    """A mechanism and its state from the floats of exact data; rows and coordinates in its order.

    `friction` gives the model of each joint that slips.
    """
    laws = [friction(joint) if friction and joint.friction else None for joint in mechanism.joints]
    one = jax.tree.map(lambda x: np.asarray(x[0], float), mechanism.parameters)
    names = [joint.name for joint in mechanism.joints]
    state = rx.State(exact.floats(mechanism.q), exact.floats(mechanism.qd), float(mechanism.t))
    return builder.build(mechanism.structure, one, names, laws), state


def in_space(scene: space.Scene, rubs: Mapping | None = None) -> tuple[rx.Mechanism, rx.State]:
    """The library's mechanism of a scene and the state at its pose; `rubs` gives arguments of some joints by kind."""
    bodies = [
        rx.spatial.Body(
            f"body {b}",
            float(body.mass),
            exact.floats(body.inertia),
            centre=exact.floats(body.axes.T * (body.centre - body.origin)),
            position=exact.floats(body.origin),
            orientation=exact.floats(body.axes),
        )
        for b, body in enumerate(scene.bodies)
    ]
    joints = [_joint(joint, bodies, (rubs or {}).get(joint.name, {}).get(joint.kind, {})) for joint in scene.joints]
    mechanism = rx.Mechanism(bodies, joints, gravity=exact.floats(scene.gravity))
    return mechanism, rx.State(mechanism.reference, exact.floats(scene.velocity))


def _joint(joint: space.Joint, bodies: list, rubs: Mapping) -> rx.spatial.AbstractJoint:
    kind = getattr(rx.spatial, joint.kind)
    j = rx.GROUND if joint.j == space.GROUND else bodies[joint.j]
    ends, point = (joint.name, bodies[joint.i], j), exact.floats(joint.point)
    axis, mark = exact.floats(joint.axes)[:, 2], exact.floats(joint.axes)[:, 0]
    if joint.kind == "Universal":
        return kind(*ends, point, exact.floats(joint.axes_i)[:, 2], axis)
    return kind(*ends, point, axis, mark, **rubs)


def pins(mechanism: exact.Mechanism, stress: tuple = ()) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """rho0 (p, 2), K (p, 2, p) and senses (p,) of the pins' friction beside a self-stress, the minimum norm else."""
    responses = mechanism.responses[1]
    count = len(mechanism.revolutes)
    free = exact.close(mechanism.selfstress, responses[:, 0], misfit=stress or None)
    unit = exact.close(mechanism.selfstress, responses[:, 1:])
    rho0, gain = (np.array(part.tolist(), float)[: 2 * count].reshape(count, 2, -1) for part in (free, unit))
    return rho0[:, :, 0], gain, exact.floats(mechanism.senses)


def four_bar(phi=0.0, rates=(1.0, 1.0)) -> tuple[rx.Mechanism, rx.State]:
    """A parallelogram of cranks 1/2 and coupler 1; at phi = 0 it is flat and its rank drops.

    `rates` are those of the two cranks; at phi = 0 all of them satisfy the constraints, but only
    (w, w) and (w, -3 w) continue: -w1^2 / 2 - (w2 - w1)^2 / 4 = -w2^2 / 2 along x.
    """
    bodies = [rx.Body(name, 1.0, 0.1) for name in ("left", "right", "coupler")]
    joints = [
        rx.Revolute("A", "left", rx.GROUND, (-0.25, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "coupler", "left", (-0.5, 0.0), (0.25, 0.0)),
        rx.Revolute("C", "right", "coupler", (0.25, 0.0), (0.5, 0.0)),
        rx.Revolute("D", "right", rx.GROUND, (-0.25, 0.0), (1.0, 0.0)),
    ]
    c, s = np.cos(phi), np.sin(phi)
    left, right = rates
    turn = (right - left) / 2 if phi == 0.0 else 0.0
    q = [c / 4, s / 4, 1 + c / 4, s / 4, 0.5 + c / 2, s / 2, phi, phi, 0.0]
    along, across = np.array([-s, c]) * left, np.array([-s, c]) * right
    qd = [*along / 4, *across / 4, *(along + across) / 4, left, right, turn]
    return rx.Mechanism(bodies, joints, gravity=(0.0, -10.0)), rx.State(q, qd)


# Systems of a user --------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A system in a state, its redundancy, and what is known of its solution in closed form."""

    system: rx.AbstractSystem
    state: rx.State
    redundancy: int
    acceleration: np.ndarray
    friction: np.ndarray


def pendulum() -> Case:
    """A mass on a rod of length 2 at the angle a from below; its constraint stands there twice."""

    def constraint(q, t, p):
        gap = q @ q - p["length"] ** 2
        return jnp.stack([gap, 3 * gap])

    def load(q, qd, t, p):
        return jnp.stack([jnp.zeros_like(t), -p["mass"] * p["gravity"]])

    parameters = {"length": 2.0, "mass": 1.5, "gravity": 9.81}
    system = rx.System(constraint, lambda q, t, p: p["mass"] * jnp.eye(2), load, parameters, n=2, rows="force")
    a, rate = 0.7, -1.3
    outward, along = np.array([np.sin(a), -np.cos(a)]), np.array([np.cos(a), np.sin(a)])
    acceleration = -9.81 * np.sin(a) * along - 2 * rate**2 * outward
    return Case(system, rx.State(2 * outward, 2 * rate * along), 1, acceleration, np.zeros(0))


def bead(mu: float = 0.2) -> Case:
    """A bead on a straight wire that turns with the angle a(t) = t + t^2, and rubs on it.

    The constraint stands there twice, so the wire force is the sum of the multipliers. Along the
    wire r'' - r a'^2 = -g sin a + f / m, across it r a'' + 2 r' a' = -g cos a + N / m.
    """

    def wire(t):
        return jnp.stack([jnp.cos(t + t**2), jnp.sin(t + t**2)])

    def constraint(q, t, p):
        distance = wire(t)[0] * q[1] - wire(t)[1] * q[0]
        return jnp.stack([distance, 2 * distance])

    def slip(q, t, p):
        return (wire(t) @ q)[None]

    def rubbing(loads, rate, sense, memory, state, p):
        return -p * jnp.abs(loads[0] + 2 * loads[1])[None] * sense

    mass, t, r, rate = 0.4, 0.3, 1.2, 0.9
    friction = [rx.Friction(slip, rubbing, np.arange(2), ("linear",), mu)] if mu else []
    system = rx.System(
        constraint,
        mass * jnp.ones(2),
        lambda q, qd, t, p: p,
        mass * jnp.array([0.0, -9.81]),
        friction=friction,
    )
    a, spin = t + t**2, 1 + 2 * t
    along, across = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    acceleration_across = 2 * r + 2 * rate * spin
    normal = mass * (acceleration_across + 9.81 * np.cos(a))
    tau = -mu * abs(normal)
    acceleration_along = -9.81 * np.sin(a) + tau / mass
    return Case(
        system,
        rx.State(r * along, rate * along + r * spin * across, t),
        1,
        acceleration_along * along + acceleration_across * across,
        np.array([tau] if mu else []),
    )


def massless(free: bool = False) -> Case:
    """A mass pulled through a massless slider; with `free`, a massless coordinate is left over."""
    n = 3 if free else 2

    def constraint(q, t, p):
        return jnp.stack([q[0] - q[1], 2 * (q[1] - q[0])])

    system = rx.System(
        constraint,
        jnp.array([2.0, 0.0, 0.0])[:n],
        lambda q, qd, t, p: p[:n],
        jnp.array([1.0, 4.0, 3.0]),
    )
    state = rx.State([0.5, 0.5, 0.5][:n], [0.25, 0.25, 0.25][:n])
    return Case(system, state, 1, np.full(n, 2.5), np.zeros(0))


def contradictory() -> Case:
    """Two drivers of one coordinate that agree at t = 0 in position and speed alone."""
    system = rx.System(lambda q, t, p: jnp.stack([q[0] - t**2, q[0] - 2 * t**2]), jnp.ones(1))
    return Case(system, rx.State([0.0], [0.0]), 1, np.full(1, np.nan), np.zeros(0))


def door(chart: str = "quaternion") -> Case:
    """A body on two coaxial hinges along z (k = 5), in six velocities and a chart of rotations.

    Velocities are those of the centre and the angular velocity, in global axes. Gravity along y
    gives rate'' = m g (c x e_y)_z / J about the hinges.
    """
    names = [f"hinge {k}.{x}" for x in ("x", "y", "z", "tilt x", "tilt y") for k in (1, 2)]
    rows = rx.Axis(tuple(names), ("force",) * 6 + ("moment",) * 4)
    kinds = ("linear",) * 3 + ("angular",) * 3
    matrix, retraction, orientation = _CHARTS[chart]
    centre, heights = np.array([0.4, 0.1, 0.2]), (-0.5, 0.8)

    def constraint(q, t, p):
        turn = matrix(q[3:])
        points = [q[:3] + turn @ (jnp.array([0.0, 0.0, z]) - p["centre"]) for z in heights]
        gaps = jnp.stack([x - jnp.array([0.0, 0.0, z]) for x, z in zip(points, heights, strict=True)])
        return jnp.concatenate([gaps.T.ravel(), jnp.repeat(turn[:2, 2], 2)])

    def mass(q, t, p):
        turn = matrix(q[3:])
        inertia = turn @ p["inertia"] @ turn.T
        zero = jnp.zeros((3, 3), inertia.dtype)
        return jnp.block([[p["mass"] * jnp.eye(3, dtype=zero.dtype), zero], [zero, inertia]])

    def load(q, qd, t, p):
        gyroscopic = jnp.cross(qd[3:], mass(q, t, p)[3:, 3:] @ qd[3:])
        return jnp.concatenate([p["mass"] * p["gravity"], -gyroscopic])

    inertia = np.array([[0.3, 0.02, -0.05], [0.02, 0.4, 0.04], [-0.05, 0.04, 0.5]])
    gravity = np.array([0.0, -9.81, 0.0])
    parameters = {"mass": 2.0, "inertia": inertia, "centre": centre, "gravity": gravity}
    system = rx.System(
        constraint,
        mass,
        load,
        parameters,
        coordinates=rx.Axis(None, kinds),
        rows=rows,
        retraction=lambda q, d: jnp.concatenate([q[:3] + d[:3], retraction(q[3:], d[3:])]),
    )
    angle, rate = 0.6, 1.7
    c, s = np.cos(angle), np.sin(angle)
    r = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ centre
    about_hinges = inertia[2, 2] + 2.0 * (centre[0] ** 2 + centre[1] ** 2)
    alpha = 2.0 * (r[0] * gravity[1] - r[1] * gravity[0]) / about_hinges
    across, inward = np.array([-r[1], r[0], 0.0]), np.array([-r[0], -r[1], 0.0])
    return Case(
        system,
        rx.State([*r, *orientation(angle)], [*rate * across, 0.0, 0.0, rate]),
        5,
        np.array([*(alpha * across + rate**2 * inward), 0.0, 0.0, alpha]),
        np.zeros(0),
    )


def _cross(v):
    zero = jnp.zeros_like(v[0])
    return jnp.array([[zero, -v[2], v[1]], [v[2], zero, -v[0]], [-v[1], v[0], zero]])


def _quaternion_matrix(w):
    v = _cross(w[1:])
    return jnp.eye(3, dtype=w.dtype) + 2 * w[0] * v + 2 * v @ v


def _turned_quaternion(w, d):
    """exp(d / 2) w, with sin and cos as series at small angles: exact to second order at d = 0."""
    square = d @ d / 4
    small = square < 1e-6
    angle = jnp.sqrt(jnp.where(small, 1.0, square))
    real = jnp.where(small, 1 - square / 2 + square**2 / 24, jnp.cos(angle))
    size = jnp.where(small, 1 - square / 6 + square**2 / 120, jnp.sin(angle) / angle)
    vector = size * d / 2
    scalar = real * w[0] - vector @ w[1:]
    rest = real * w[1:] + w[0] * vector + jnp.cross(vector, w[1:])
    return jnp.concatenate([scalar[None], rest])


_CHARTS = {
    "quaternion": (
        _quaternion_matrix,
        _turned_quaternion,
        lambda a: [np.cos(a / 2), 0.0, 0.0, np.sin(a / 2)],
    ),
    "matrix": (
        lambda w: w.reshape(3, 3),
        lambda w, d: (jax.scipy.linalg.expm(_cross(d)) @ w.reshape(3, 3)).ravel(),
        lambda a: [np.cos(a), -np.sin(a), 0.0, np.sin(a), np.cos(a), 0.0, 0.0, 0.0, 1.0],
    ),
}


def _of_exact(make, friction=None) -> Callable[[], Case]:
    def case() -> Case:
        mechanism = make()
        truth = mechanism.solve(friction=friction is not None)
        tau = exact.floats(truth.friction) if friction and mechanism.slips else np.zeros(0)
        acceleration = exact.floats(truth.acceleration)
        return Case(*build(mechanism, friction), mechanism.k, acceleration, tau)

    return case


def _of_space(make: Callable[[], space.Scene]) -> Callable[[], Case]:
    def case() -> Case:
        scene = make()
        acceleration = exact.floats(scene.solve(friction=False).acceleration)
        return Case(*in_space(scene), scene.k, acceleration, np.zeros(0))

    return case


SYSTEMS: Mapping[str, Callable[[], Case]] = {
    "pendulum": pendulum,
    "bead": bead,
    "smooth bead": lambda: bead(mu=0.0),
    "massless": massless,
    "door": door,
}
EVERYTHING: Mapping[str, Callable[[], Case]] = {
    **SYSTEMS,
    "door in space": _of_space(space.door),
    "bennett": _of_space(space.bennett),
    **{name: _of_exact(make) for name, make in MECHANISMS.items()},
    **{f"{name} with friction": _of_exact(make, coulomb) for name, make in MECHANISMS.items() if make().revolutes},
}


@cache
def case(name: str) -> Case:
    """A case of `EVERYTHING` in float64, made once, so that its programs are compiled once."""
    return EVERYTHING[name]()


def solve(system: rx.AbstractSystem, state: rx.State, h=0.0, **options) -> rx.types.Solution:
    """`rx.solve` with the whole h of (9), unless there is another closure.

    As h is always a vector, all tests share one program of a system.
    """
    size = len(system.coordinates) + len(system.rows)
    options.setdefault("closure", rx.MinimumNorm(h * np.ones(size)))
    return rx.solve(system, state, **options)


# Errors -------------------------------------------------------------------------------------


def kinds_of(axis: rx.Axis) -> np.ndarray:
    return np.array(axis.kinds)


def relative_errors(value, truth, kinds) -> dict[str, float]:
    """For each kind, the largest error over the largest true entry of that kind.

    A kind whose true entries vanish is measured against the largest entry of all (in SI units).
    """
    value, truth, kinds = np.asarray(value), np.asarray(truth), np.asarray(kinds)
    if not truth.size:
        return {}
    assert value.shape == truth.shape == kinds.shape
    whole = np.max(np.abs(truth))
    errors = {}
    for kind in dict.fromkeys(kinds.tolist()):
        of_kind = np.max(np.abs(truth[kinds == kind]))
        scale = of_kind if of_kind > 1e-10 * whole else whole or 1.0
        # NaN must not pass for small
        errors[kind] = float(np.max(np.abs(value - truth)[kinds == kind]) / scale)
    return errors


def errors_of(solution: rx.types.Solution, truth: tuple, system: rx.AbstractSystem) -> dict[str, float]:
    """Relative errors per kind of accelerations, multipliers and, with friction, tau."""
    slips = [kind for group in system.friction for kind in group.slips.kinds]
    axes = (kinds_of(system.coordinates), kinds_of(system.rows), [f"tau {kind}" for kind in slips])
    values = (solution.acceleration, solution.multipliers, solution.friction)
    errors = {}
    for value, true, kinds in zip(values, truth, axes, strict=True):
        errors |= relative_errors(value, true, kinds)
    return errors


def agree(value, truth, kinds, tolerance: float) -> bool:
    """Whether every kind of entries is as near to the truth as `tolerance` asks; NaN is not."""
    return all(error <= tolerance for error in relative_errors(value, truth, kinds).values())
