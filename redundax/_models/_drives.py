"""Which forces of drives a given motion determines

With N the motions that the loops leave, in the velocities of the joints, and D the rates of the drives by these, drives
with forces u hold the model as it is iff N^T D^T u = 0 alone. So the force of a drive is unique iff its entry is 0 in
every u of the left null space of D N, whose dimension is by how many the drives are more than the freedoms they move.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from .._tools._json import JSON
from ._tree import Tree

_LEAST, _MOST = 1e-9, 1e-3  # rounding of D N, of rows of length 1; misfit above it tells nothing


@dataclasses.dataclass(frozen=True)
class Drives:
    """Drives of a model at a position.

    - `names`; `loose`: those whose force a motion does not determine; `locked`: those of them that move nothing.
    - `dead`: those that are so at this position alone, where they move nothing or the same as others.
    - `turns`: dead points on the way of the joints: the drive, its joint, and where that turns back, rad or m.
    - `redundancy`: by how many they are more than the freedoms they move; `idle`: freedoms that none of them moves.
    - `is_decided`: whether both are clear.
    """

    names: tuple[str, ...]
    loose: tuple[str, ...]
    redundancy: int
    idle: int
    is_decided: bool
    dead: tuple[str, ...] = ()
    locked: tuple[str, ...] = ()
    turns: tuple[tuple[str, str, float], ...] = ()

    def to_dict(self) -> dict[str, JSON]:
        """As data."""
        unique = [name for name in self.names if name not in self.loose]
        return {
            "names": list(self.names),
            "unique": unique,
            "not_unique": list(self.loose),
            "moving_nothing": list(self.locked),
            "dead_point_here": list(self.dead),
            "dead_points_on_the_way": [{"drive": drive, "joint": joint, "at": at} for drive, joint, at in self.turns],
            "redundancy": self.redundancy,
            "freedoms_without_drive": self.idle,
            "decided": self.is_decided,
        }


def drives_at(tree: Tree, positions: np.ndarray, freedom: int, left: float = 0.0) -> Drives:
    """The drives of a model at positions of its joints, where its freedom is known and its loops miss by `left`."""
    names, rates = tree.drives(positions)
    if not names or not freedom:
        return Drives(names, names, len(names), freedom, True, locked=names)
    motion, kept = tree.motion(positions, freedom)
    scaled = rates * tree.scale
    lengths = np.linalg.norm(scaled, axis=1, keepdims=True)
    moved = scaled / np.where(lengths, lengths, 1.0) @ motion
    basis, values, _ = np.linalg.svd(moved)
    blur = min(max(_LEAST, 100 * left / kept), _MOST)
    rank = int(np.sum(values > blur))
    idle = basis[:, rank:]
    loose = tuple(name for name, entries in zip(names, idle, strict=True) if np.linalg.norm(entries) > 10 * blur)
    is_decided = not np.any((values > blur) & (values < 10 * blur))
    locked = tuple(name for name, rates in zip(names, moved, strict=True) if np.linalg.norm(rates) <= blur)
    return Drives(names, loose, len(names) - rank, freedom - rank, is_decided, locked=locked)


def turning(
    tree: Tree, positions: np.ndarray, turns: Sequence[tuple[str, float]], freedom: int
) -> tuple[tuple[str, str, float], ...]:
    """Where the only drive of the only motion moves one joint that turns back: its name, the joint, and where."""
    names, rates = tree.drives(positions)
    if len(names) != 1 or freedom != 1:
        return ()
    (dofs,) = np.nonzero(rates[0])
    driven = {tree.joints[int(tree.joint_of_dof[dof])].name for dof in dofs} if len(dofs) == 1 else set()
    return tuple((names[0], joint, at) for joint, at in turns if joint in driven)
