"""Numbers of random mechanisms, by construction on the constraint manifold.

Bodies are put at random poses first; the points, axes and laws of motion of their joints follow from the poses, so that
every position is exact to rounding. The velocity is a random element of the null space of the constraints without
drives, and the drives are given its rates. So a drive that is there twice is consistent too.

`Raw` numbers are independent of each other. Everything is derived from them by `derive`, in floats for whole batches or
in 50 digits for one sample (`Arithmetic`), so that the same mechanism exists in both.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from truth.description import DRIVES, GROUND, Parameters, Structure
from truth.equations import Equations, Poses, evaluate

Raw = dict[str, np.ndarray]


@dataclass(frozen=True)
class Arithmetic:
    """Numbers to compute with: functions of arrays, and the projection onto a null space of known rank."""

    number: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    sin: Callable[[Any], Any]
    sqrt: Callable[[Any], Any]
    onto_null: Callable[[Any, Any, int], Any]


def _onto_null(jacobian: np.ndarray, vector: np.ndarray, rank: int) -> np.ndarray:
    """Projection of each vector onto the null space of its Jacobian, done twice to take out rounding."""
    if rank == vector.shape[1]:
        return np.zeros_like(vector)
    v = np.linalg.svd(jacobian)[2][:, :rank]
    for _ in range(2):
        vector = vector - (v.swapaxes(-1, -2) @ (v @ vector[..., None]))[..., 0]
    return vector


FLOATS = Arithmetic(lambda x: np.asarray(x, float), np.cos, np.sin, np.sqrt, _onto_null)


@dataclass(frozen=True)
class Scales:
    """How the numbers of a batch are spread, as powers of ten: units of length, mass and time, masses among bodies,
    compliances among joints; and the friction coefficients at most."""

    length: float = 2.0
    mass: float = 2.0
    time: float = 1.0
    masses: float = 0.5
    compliances: float = 1.0
    friction: float = 0.1


def raw_numbers(structure: Structure, size: int, rng: np.random.Generator, scales: Scales = Scales()) -> Raw:
    """Independent numbers of a batch; half of it has the minimum-norm closure, and half of it no preloads."""
    bodies, joints, loads = len(structure.bodies), structure.numbers, max(len(structure.loads), 1)

    def power(spread: float, *shape: int) -> np.ndarray:
        return 10 ** rng.uniform(-spread, spread, (size, *shape))

    def normal(*shape: int) -> np.ndarray:
        return rng.normal(size=(size, *shape))

    length, mass, time = power(scales.length), power(scales.mass), power(scales.time)
    force = mass * length / time**2
    long, heavy, strong = length[:, None], mass[:, None], force[:, None]
    physical = rng.uniform(size=(size, 1, 1)) < 0.5
    soft = power(scales.compliances, joints, 3) * (long / strong)[..., None]
    soft[:, :, 2] /= length[:, None] ** 2
    pull = normal(joints, 3) * soft * strong[..., None]
    pull[:, :, 2] *= long
    return {
        "length": length,
        "time": time,
        "mass": heavy * power(scales.masses, bodies),
        "inertia": heavy * long**2 * power(scales.masses, bodies) / 3,
        "gravity": normal(2) * (length / time**2)[:, None],
        "r": normal(bodies, 2) * long[..., None],
        "phi": rng.uniform(-np.pi, np.pi, (size, bodies)),
        "speed": normal(3 * bodies) / time[:, None],
        "t": rng.uniform(-1, 1, size) * time,
        "anchor": normal(joints, 2) * long[..., None],
        "other": normal(joints, 2) * long[..., None],
        "slide": normal(joints) * long,
        "theta": rng.uniform(-np.pi, np.pi, (size, joints)),
        "ratio": rng.uniform(0.3, 3, (size, joints)) * rng.choice([-1, 1], (size, joints)),
        "push": normal(joints),
        "link": normal(max(structure.links, 1), 2) * long[..., None],
        "guide": long * power(0.5, joints),
        "mu": scales.friction * rng.uniform(size=(size, joints)),
        "preload": strong * rng.uniform(size=(size, joints)) * (rng.uniform(size=(size, 1)) < 0.5),
        "constant": scales.friction * strong * rng.uniform(size=(size, joints)),
        "force": normal(loads, 2) * strong[..., None],
        "moment": normal(loads) * strong * long,
        "point_i": normal(loads, 2) * long[..., None],
        "point_j": normal(loads, 2) * long[..., None],
        "stiffness": strong / long * power(0.5, loads),
        "damping": strong / long * time[:, None] * power(0.5, loads) / 3,
        "free": rng.uniform(size=(size, loads)),
        "compliance": np.where(physical, soft, 1.0),
        "misfit": np.where(physical, pull, 0.0),
    }


def derive(structure: Structure, raw: Raw, real: Arithmetic = FLOATS) -> tuple[Parameters, Poses, Equations]:
    """Parameters of the joints and loads, the state on the manifold, and everything evaluated at it."""
    raw = {name: real.number(value) for name, value in raw.items()}
    place = [*structure.bodies]
    poses = Poses(raw["r"][:, place], raw["phi"][:, place], raw["t"], real)
    still = np.zeros_like(raw["speed"])
    parameters = _assembled(structure, raw, poses)
    resting = evaluate(structure, parameters, poses, still)
    drives = [row for row, (k, _, _) in enumerate(structure.rows) if structure.joints[k].kind in DRIVES]
    own = [row for row in range(structure.m) if row not in drives]
    scale = _coordinate_scale(structure, raw["length"])
    wanted = raw["speed"][:, _coordinates(structure)]
    distinct = {structure.joints[structure.rows[row][0]].number for row in drives}
    scaled = resting.jacobian[:, own] * scale[:, None, :] * _row_scale(structure, raw["length"])[:, own, None]
    qd = scale * real.onto_null(scaled, wanted, structure.rank - len(distinct))
    parameters = _driven(structure, raw, parameters, poses, (resting.jacobian @ qd[..., None])[..., 0])
    return parameters, poses, evaluate(structure, parameters, poses, qd)


def _coordinates(structure: Structure) -> list[int]:
    """Where the coordinates of the bodies in their order stand among those of the bodies by number."""
    count = len(structure.bodies)
    return [2 * b + c for b in structure.bodies for c in range(2)] + [2 * count + b for b in structure.bodies]


def _coordinate_scale(structure: Structure, length: Any) -> Any:
    """S: length for linear and 1 for angular coordinates, (batch, n)."""
    count = len(structure.bodies)
    one = np.ones_like(length)
    return np.stack([length] * (2 * count) + [one] * count, axis=1)


def _row_scale(structure: Structure, length: Any) -> Any:
    """1 / length for force-type and 1 for moment-type rows, (batch, m)."""
    one = np.ones_like(length)
    return np.stack([one / length if kind == "force" else one for *_, kind in structure.rows], axis=1)


def _assembled(structure: Structure, raw: Raw, poses: Poses) -> Parameters:
    """Points, axes and angles that fit the poses; laws of motion that stand still."""
    real, joints, place = poses.real, [], {body: k for k, body in enumerate((*structure.bodies, GROUND))}
    for joint in structure.joints:
        i, j, own = place[joint.i], place[joint.j], joint.number
        anchor = poses.point(j, raw["anchor"][:, own]) if joint.link is None else None
        if anchor is None:  # cranks: the point on the parent is common to both joints, the second is a link away
            first = _parent(structure, joint)
            anchor = poses.point(place[first.j], raw["anchor"][:, own]) + raw["link"][:, joint.link]
        theta = raw["theta"][:, joint.parallel]
        normal = np.stack([real.cos(theta), real.sin(theta)], axis=-1)
        along = poses.rotate(j, np.stack([-normal[:, 1], normal[:, 0]], axis=-1))
        slotted = joint.kind in ("translational", "pin")
        other = anchor + raw["slide"][:, own, None] * along if slotted else anchor
        if joint.kind in ("distance", "rod"):
            other = poses.point(j, raw["other"][:, own])
        gap = anchor - other
        length = real.sqrt(gap[:, 0] ** 2 + gap[:, 1] ** 2)
        turn = poses.phi[:, i] - poses.phi[:, j]
        start = length if joint.kind in ("distance", "rod") else turn
        zero = np.zeros_like(start)
        joints.append(
            {
                "point_i": poses.local(i, anchor),
                "point_j": poses.local(j, other),
                "normal": normal,
                "angle": poses.phi[:, i] + raw["ratio"][:, own] * poses.phi[:, j] if joint.kind == "gear" else turn,
                "ratio": raw["ratio"][:, own],
                "guide_length": raw["guide"][:, own],
                "coefficients": np.stack([start, zero, zero], axis=-1),
                "coefficient": raw["mu"][:, own] * (raw["length"] if joint.kind == "revolute" else 1),
                "preload": raw["preload"][:, own] * real.number(joint.share),
                "size": raw["constant"][:, own]
                * real.number(joint.share)
                * (raw["length"] if joint.kind == "revolute" else 1),
            }
        )
    return Parameters(raw, tuple(joints), raw["mass"][:, [*structure.bodies]], raw["inertia"][:, [*structure.bodies]])


def _parent(structure: Structure, joint: Any) -> Any:
    """The joint of the same crank with the parent of its platform."""
    return next(x for x in structure.joints if x.number == joint.number and x.link is None)


def _driven(structure: Structure, raw: Raw, parameters: Parameters, poses: Poses, rates: Any) -> Parameters:
    """The parameters with laws of motion that have the rates of the rows at the time t, and pushes."""
    joints, t = list(parameters.joints), poses.t
    for row, (k, _, kind) in enumerate(structure.rows):
        joint, old = structure.joints[k], parameters.joints[k]
        if joint.kind not in DRIVES:
            continue
        size = raw["length"] / raw["time"] ** 2 if kind == "force" else 1 / raw["time"] ** 2
        second = raw["push"][:, joint.number] * size
        first = rates[:, row] - 2 * second * t
        start = old["coefficients"][:, 0] - first * t - second * t**2
        joints[k] = {**old, "coefficients": np.stack([start, first, second], axis=-1)}
    return Parameters(raw, tuple(joints), parameters.mass, parameters.inertia)
