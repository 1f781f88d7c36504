"""Freedoms that turn a part between others and move nothing else, as a rod between two balls has one

With N the motions of the model, so that the velocities V N of all bodies are orthonormal, a body b moves alone iff 1 is
a singular value of V_b N, and spins if that motion turns it about a line and moves no drive. So may two that a joint
joins, and that turn as one. What hangs on one other body alone, as a door or the hand of an arm, is left out: its
motion is what it is for.
"""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from ._tree import Tree

_REST = 1e-6  # velocities beside the largest: the digits of a file


def spins(tree: Tree, positions: np.ndarray, freedom: int) -> tuple[tuple[str, ...], ...]:
    """Names of the bodies that spin, one or two together for each such freedom, at positions of known freedom."""
    if not freedom or not tree.loops:
        return ()
    motion = tree.scale[:, None] * tree.motion(positions, freedom)[0]
    movers, poses = tree.movers, tree.at(positions)
    moved = np.array([np.concatenate(tree.velocities_at(poses, body, np.zeros(3))) for body in movers])  # at the origin
    moved[:, :3] /= tree.size
    _, sizes, ways = np.linalg.svd((moved @ motion).reshape(-1, freedom), full_matrices=False)
    motion = motion @ ways.T / sizes  # so that the velocities of all bodies are orthonormal
    moved, driven, joined = moved @ motion, tree.drives(positions)[1] @ motion, _joined(tree)
    found: list[tuple[int, ...]] = []
    for some in [*((k,) for k in range(len(moved))), *_pairs(movers, joined)]:
        if any(set(each) & set(some) for each in found) or len(_beside({movers[k] for k in some}, joined)) < 2:
            continue
        _, shares, ways = np.linalg.svd(moved[list(some)].reshape(-1, freedom), full_matrices=False)
        alone = ways[shares**2 > 1 - _REST**2]
        if len(alone) == 1 and _is_turn(moved[list(some)] @ alone[0], driven @ alone[0]):
            found.append(some)
    return tuple(tuple(tree.description.bodies[movers[k]].name for k in some) for some in sorted(found))


def _is_turn(moved: np.ndarray, driven: np.ndarray) -> bool:
    """Whether bodies turn together about a line, and no drive moves."""
    (along, turn), size = np.split(moved[0], 2), float(np.linalg.norm(moved[0]))
    alike = np.abs(moved - moved[0]).max() <= _REST * size
    is_turn = float(np.linalg.norm(turn)) > _REST * size and abs(float(along @ turn)) <= _REST * size**2
    return bool(alike and is_turn and np.abs(driven).max(initial=0.0) <= _REST)


def _joined(tree: Tree) -> list[tuple[int, int]]:
    """Bodies that joints and loops join, by their numbers; what floats is joined to nothing."""
    carrier: dict[int, int] = {}  # of bodies between joints of one body, that body
    for joint in reversed(tree.joints):
        if tree.description.is_between(joint):
            child = next(each.child.body for each in tree.joints if each.parent.body == joint.child.body)
            carrier[joint.child.body] = carrier.get(child, child)
    held = [(joint.child.body, joint.parent.body) for joint in tree.joints if joint.kind != "free"]
    held += [(loop.first.body, loop.second.body) for loop in tree.loops]
    return [pair for pair in ((carrier.get(a, a), carrier.get(b, b)) for a, b in held) if pair[0] != pair[1]]


def _pairs(movers: Sequence[int], joined: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
    """Movers that are joined, by their places among these."""
    place = {body: k for k, body in enumerate(movers)}
    pairs = ((place[one], place[other]) for one, other in joined if one in place and other in place)
    return list(dict.fromkeys((min(pair), max(pair)) for pair in pairs))


def _beside(own: set[int], joined: Iterable[tuple[int, int]]) -> set[int]:
    """Other bodies that some are joined to."""
    ends = itertools.chain.from_iterable(pair for pair in joined if own & set(pair))
    return set(ends) - own
