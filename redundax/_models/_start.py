"""Where a model begins: the position of its file, where all displacements of joints are 0, or a keyframe, closed

The first is taken that closes by least steps and is within the limits of joints; failing that the first that closes.
"""

from typing import NamedTuple

import numpy as np

from .._tools._errors import RedundaxError
from ._tree import OPEN, Tree


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


def start(tree: Tree, keyframe: str | None) -> Start:
    """Where to begin; at a keyframe if it is named."""
    keys = tree.description.keyframes
    if keyframe is not None and keyframe not in keys:
        there = f"It has {', '.join(keys)}." if keys else "It has none that gives positions to all joints."
        raise RedundaxError(f"Argument `keyframe` names '{keyframe}', which is no keyframe of the file. {there}")
    own = {"": tree.reference.copy(), **keys}
    given = own if keyframe is None else {keyframe: own[keyframe]}
    found: list[Start] = []
    for name, positions in given.items():
        closed, left = tree.closed(positions, only_near=True)
        if left <= OPEN:
            found.append(Start(name, positions, closed, left, True, outside(tree, closed)))
            if not found[-1].outside:
                return found[-1]
    if found:
        return found[0]
    name, positions = next(iter(given.items()))
    closed, left = tree.closed(positions)
    return Start(name, positions, closed, left, False, outside(tree, closed))


def outside(tree: Tree, positions: np.ndarray) -> tuple[Limit, ...]:
    """Limits of joints that a position is beyond, by more than the digits of a file."""
    found = list[Limit]()
    at = {part.name: float(count) for part, count in zip(tree.limited, tree.counts(positions), strict=True)}
    for joint, place in zip(tree.joints, tree.places, strict=True):
        if joint.kind == "ball" and joint.limits:
            turn = positions[place]
            at[joint.name] = 2 * float(np.arctan2(np.linalg.norm(turn[1:]), abs(turn[0])))
    for part in (*tree.joints, *tree.loops):
        if part.limits and part.name in at:
            (low, high), own, slack = part.limits, at[part.name], tree.slack(part)
            if not low - slack <= own <= high + slack:
                found.append(Limit(part.name, own, low if own < low else high))
    return tuple(found)
