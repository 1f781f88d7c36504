"""Problems spoiled on purpose: a solve must flag them, name the reason, and leave the rest of a batch alone."""

import dataclasses
from collections.abc import Callable

import numpy as np
from truth.description import Structure

from .library import NAMES, Problem

Spoil = Callable[[Problem, np.random.Generator], Problem]


def _coordinates(problem: Problem) -> np.ndarray:
    """S: length for linear and 1 for angular coordinates, (batch, n)."""
    length, bodies = problem.parameters.raw["length"], len(problem.structure.bodies)
    return np.concatenate([np.repeat(length[:, None], 2 * bodies, 1), np.ones((len(length), bodies))], axis=1)


def _moved(problem: Problem, q: np.ndarray, qd: np.ndarray) -> Problem:
    """The problem at another position and velocity; its equations stay those of the old position."""
    poses, bodies = problem.poses, len(problem.structure.bodies)
    there = type(poses)(q[:, : 2 * bodies].reshape(len(q), bodies, 2), q[:, 2 * bodies :], poses.t, poses.real)
    return dataclasses.replace(problem, poses=there, equations=dataclasses.replace(problem.equations, qd=qd))


def _off_manifold(problem: Problem, rng: np.random.Generator) -> Problem:
    return drifted(problem, 1e-3, rng)


def drifted(problem: Problem, drift: np.ndarray | float, rng: np.random.Generator) -> Problem:
    """At a position beside the manifold by this part of the length, each sample or all."""
    q = problem.poses.q
    aside = rng.normal(size=q.shape) * np.broadcast_to(drift, len(q))[:, None]
    return _moved(problem, q + _coordinates(problem) * aside, problem.equations.qd)


def _wrong_velocity(problem: Problem, rng: np.random.Generator) -> Problem:
    """A velocity that has a part of the size of all of it across the constraints."""
    scale, qd = _coordinates(problem), problem.equations.qd
    size = np.linalg.norm(qd / scale, axis=1) + 1 / problem.parameters.raw["time"]
    return _moved(problem, problem.poses.q, qd + scale * size[:, None] * rng.normal(size=qd.shape))


def _not_a_number(problem: Problem, rng: np.random.Generator) -> Problem:
    qd = problem.equations.qd.copy()
    qd[range(len(qd)), rng.integers(qd.shape[1], size=len(qd))] = np.nan
    return _moved(problem, problem.poses.q, qd)


def _no_mass(problem: Problem, rng: np.random.Generator) -> Problem:
    """No body has mass."""
    parameters = problem.parameters
    zero = parameters._replace(mass=0 * parameters.mass, inertia=0 * parameters.inertia)
    return dataclasses.replace(problem, parameters=zero)


def _contradictory_drives(problem: Problem, rng: np.random.Generator) -> Problem:
    """Two drives of one coordinate agree in position and speed but not in acceleration."""
    joints, t = list(problem.parameters.joints), problem.poses.t
    k = _copied_drive(problem.structure)
    start, first, second = joints[k]["coefficients"].T
    time = problem.parameters.raw["time"]
    size = np.linalg.norm(problem.equations.qd / _coordinates(problem), axis=1) / time + 1 / time**2
    size = size * (problem.parameters.raw["length"] if problem.structure.joints[k].kind == "distance" else 1)
    law = np.stack([start + size * t**2, first - 2 * size * t, second + size], axis=-1)
    joints[k] = {**joints[k], "coefficients": law}
    return dataclasses.replace(problem, parameters=problem.parameters._replace(joints=tuple(joints)))


def _copied_drive(structure: Structure) -> int | None:
    numbers = [joint.number for joint in structure.joints]
    places = (
        k for k, x in enumerate(structure.joints) if x.kind in ("angle", "distance") and numbers.count(x.number) > 1
    )
    return next(places, None)


# name -> (how, for which structures, results that name the reason)
FAULTS: dict[str, tuple[Spoil, Callable[[Structure], bool], tuple[str, ...]]] = {
    "off the manifold": (_off_manifold, lambda _: True, ("violated_constraints",)),
    "wrong velocity": (_wrong_velocity, lambda _: True, ("inadmissible_velocity",)),
    "not a number": (_not_a_number, lambda _: True, NAMES[1:]),
    "no mass": (_no_mass, lambda s: s.rank < s.n, ("indeterminate_acceleration",)),
    "contradictory drives": (
        _contradictory_drives,
        lambda s: _copied_drive(s) is not None,
        ("inconsistent_constraints",),
    ),
}


def mixed(problem: Problem, spoiled: Problem, on: np.ndarray) -> Problem:
    """The spoiled problem in the samples `on`, the sound one in the others."""

    def pick(good, bad):
        if isinstance(good, np.ndarray):
            return np.where(on.reshape(-1, *[1] * (good.ndim - 1)), bad, good)
        return good

    parameters = problem.parameters._replace(
        joints=tuple(
            {name: pick(a[name], b[name]) for name in a}
            for a, b in zip(problem.parameters.joints, spoiled.parameters.joints, strict=True)
        ),
        mass=pick(problem.parameters.mass, spoiled.parameters.mass),
        inertia=pick(problem.parameters.inertia, spoiled.parameters.inertia),
    )
    moved = _moved(problem, pick(problem.poses.q, spoiled.poses.q), pick(problem.equations.qd, spoiled.equations.qd))
    return dataclasses.replace(moved, parameters=parameters)
