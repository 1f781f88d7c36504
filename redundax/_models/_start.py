"""Where a model begins: the position of its file, where all displacements of joints are 0, or a keyframe, closed

The first is taken that closes by least steps and is within the limits of joints; failing that the first that closes.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._optional import optional
from ._plan import Plan
from ._tree import DIGITS, OPEN, Tree


class Limit(NamedTuple):
    """A limit of a joint, and where the joint is, rad or m as the file counts; of a ball how far it is turned."""

    joint: str
    position: float
    limit: float


class Start(NamedTuple):
    """A position that closes the loops of a model.

    - `keyframe`: the name of that of the file, or "" for its own position; `given`: that position as it is written.
    - `positions`, `left`: as `Tree.closed` has them; `is_near`: whether least steps led there.
    - `outside`: limits that it is beyond.
    """

    keyframe: str
    given: np.ndarray
    positions: np.ndarray
    left: float
    is_near: bool
    outside: tuple[Limit, ...]


def keyframes(model: Any) -> dict[str, np.ndarray]:
    """Positions of joints that the keyframes of a model give, by their names."""
    mujoco, found = optional("mujoco", "models"), {}
    for key in range(model.nkey):
        found[model.key(key).name] = positions = model.key_qpos[key].copy()
        mujoco.mj_normalizeQuat(model, positions)
    return found


def start(plan: Plan, keys: dict[str, np.ndarray], keyframe: str | None) -> Start:
    """Where to begin; at a keyframe if it is named."""
    if keyframe is not None and keyframe not in keys:
        there = f"It has {', '.join(keys)}." if keys else "It has none that gives positions to all joints."
        raise RedundaxError(f"Argument `keyframe` names '{keyframe}', which is no keyframe of the file. {there}")
    own = {"": plan.model.qpos0.copy(), **keys}
    given = own if keyframe is None else {keyframe: own[keyframe]}
    found: list[Start] = []
    for name, positions in given.items():
        closed, left = plan.tree.closed(positions, only_near=True)
        if left <= OPEN:
            found.append(Start(name, positions, closed, left, True, outside(plan, closed)))
            if not found[-1].outside:
                return found[-1]
    if found:
        return found[0]
    name, positions = next(iter(given.items()))
    closed, left = plan.tree.closed(positions)
    return Start(name, positions, closed, left, False, outside(plan, closed))


def outside(plan: Plan, positions: np.ndarray) -> tuple[Limit, ...]:
    """Limits of joints that a position is beyond, by more than the digits of a file."""
    return tuple(Limit(*each) for each in _outside(plan.tree, plan.joint_names, positions))


def _outside(tree: Tree, names: list[str], positions: np.ndarray) -> Iterator[tuple[str, float, float]]:
    model, scale = tree.model, tree.scale()
    for joint in np.flatnonzero(model.jnt_limited).tolist():
        kind, place = tree.joint_kind(joint), int(model.jnt_qposadr[joint])
        low, high = model.jnt_range[joint].tolist()
        at, slack = float(positions[place]), DIGITS * float(scale[model.jnt_dofadr[joint]])
        if kind == "ball":
            turned = 2 * float(np.arctan2(np.linalg.norm(positions[place + 1 : place + 4]), abs(at)))
            low, at = -np.inf, turned
        if kind != "free" and not low - slack <= at <= high + slack:
            yield names[joint], at, low if at < low else high
