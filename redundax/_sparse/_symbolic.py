"""Symbolic factorisation, what the pattern of a mechanism alone decides: where the entries of its Jacobian go, and the
order of elimination.

The Jacobian B is held as slopes, shape (m, w, s): each row by the s velocities of at most w moving bodies. Its product
S = B M^-1 B^T has entries where two rows share a body. They are summed straight into the fronts, dense matrices of
the own and the border rows of each front of `_tree`; fronts of one height are padded to one shape.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Array, Bool, UInt

from .._tools._module import on_device
from .._tools._value import AbstractModule
from ._tree import Front, tree


class Level(AbstractModule):
    """The fronts of one height.

    - `pad`: whether a place among own rows is no row, shape (fronts, p).
    - `border`: places of the border after this level's own ones, beyond the last for none, shape (fronts, q).
    - `source`, `target`: what fronts below leave for these, among all that these leave, and where it goes.
    """

    pad: Bool[Array, "fronts p"]
    border: UInt[Array, "fronts q"]
    source: UInt[Array, " updates"]
    target: UInt[Array, " updates"]


class Symbolic(AbstractModule):
    """The symbolic factorisation: pattern and order of elimination.

    - `source`: where each row finds its slopes by moving bodies among those that joints give, beyond the last for
      none, shape (m, w).
    - `body`: that of each, for none the first of the row, shape (m, w).
    - `columns`: velocities of each body, shape (bodies, s).
    - `first`, `second`, `place`: pairs of slopes, counted row by row, that give an entry of S, and where it goes,
      shape (pairs,).
    - `mates`: the rows of the joint of each row, itself first, m for none, shape (m, j).
    - `beside`: where the entries of a row with its mates go, as `place`, beyond the last for none or said twice.
    - `own`, `position`: the rows owned by all fronts, level by level, m for none; and where each row is among them.
    - `levels`: from the leaves to the roots.
    - `massless`: which bodies lack mass or inertia, shape (bodies,); `None` if none do.
    """

    source: UInt[Array, "m w"]
    body: UInt[Array, "m w"]
    columns: UInt[Array, "bodies s"]
    first: UInt[Array, " pairs"]
    second: UInt[Array, " pairs"]
    place: UInt[Array, " pairs"]
    mates: UInt[Array, "m j"]
    beside: UInt[Array, "m j"]
    own: UInt[Array, " places"]
    position: UInt[Array, " m"]
    levels: tuple[Level, ...]
    massless: Bool[Array, " bodies"] | None

    @property
    def size(self) -> int:
        """Entries of all fronts."""
        shapes = ((*level.pad.shape[-2:], level.border.shape[-1]) for level in self.levels)
        return sum(fronts * (p + border) ** 2 for fronts, p, border in shapes)


def symbolic(
    joints: Sequence[np.ndarray],
    slopes: tuple[np.ndarray, np.ndarray],
    columns: np.ndarray,
    massless: Sequence[bool] = (),
) -> Symbolic:
    """That of the rows of each joint, the row and the body of each slope, the ground last, `columns`, and which bodies
    lack mass."""
    m = sum(rows.size for rows in joints)
    source = _by_row(slopes[0], slopes[1] < len(columns), m)
    used = np.flatnonzero(source < slopes[0].size)
    row, body = (each[source.ravel()[used]] for each in slopes)
    owner = np.empty(m, int)
    mates = np.full((m, max(rows.size for rows in joints)), m)
    for joint, rows in enumerate(joints):
        owner[rows] = joint
        for k, own in enumerate(rows):
            mates[own, : rows.size] = np.roll(rows, -k)
    bodies: list[set[int]] = [set() for _ in joints]
    for joint, other in zip(owner[row].tolist(), body.tolist(), strict=True):
        bodies[joint].add(other)
    fronts = tree([sorted(each) for each in bodies], [rows.size for rows in joints])
    layout = _Layout(fronts, joints, m)
    first, second = _pairs(row, body, layout.order)
    return Symbolic(
        source=_indices(source),
        body=_indices(np.append(slopes[1], 0)[np.where(source < slopes[0].size, source, source[:, :1])]),
        columns=_indices(columns),
        first=_indices(used[first]),
        second=_indices(used[second]),
        place=_indices(layout.places(row[first], row[second])),
        mates=_indices(mates),
        beside=_indices(layout.beside(mates)),
        own=_indices(layout.padded),
        position=_indices(layout.position[:-1]),
        levels=layout.levels(),
        massless=on_device(np.array(massless)) if any(massless) else None,
    )


class _Layout:
    """Where rows and entries of S are in the fronts, laid out level by level, front by front.

    - `front`, `order`: the front that eliminates each row, and when.
    - `padded`, `position`: rows in that order with the padding, m for none, and where each row is.
    """

    def __init__(self, fronts: Sequence[Front], joints: Sequence[np.ndarray], m: int):
        self.m, self.parent = m, np.array([front.parent for front in fronts])
        self.own, self.border = (
            [np.concatenate([joints[k] for k in part] or [np.zeros(0, int)]) for part in parts]
            for parts in zip(*(front[:2] for front in fronts), strict=True)
        )
        level = np.array([front.level for front in fronts])
        self.groups = [np.flatnonzero(level == height) for height in range(level.max() + 1)]
        self.front, self.order = np.empty(m, int), np.empty(m, int)
        self.front[np.concatenate(self.own)] = np.repeat(np.arange(len(fronts)), [rows.size for rows in self.own])
        self.order[np.concatenate(self.own)] = np.arange(m)
        self._lay_out()
        self.padded = np.concatenate([_padded(self.own, group, m).ravel() for group in self.groups])
        self.position = np.full(m + 1, self.padded.size)
        self.position[self.padded] = np.arange(self.padded.size)
        self.position[m] = self.padded.size

    def _lay_out(self) -> None:
        """Where each front begins and how wide it is; and where its rows are in it, own ones, then border."""
        self.begin, self.wide = np.zeros(len(self.own), int), np.zeros(len(self.own), int)
        self.size, keys, local = 0, [], []
        for group in self.groups:
            p, q = (max(part[k].size for k in group) for part in (self.own, self.border))
            self.wide[group] = p + q
            self.begin[group] = self.size + np.arange(group.size) * (p + q) ** 2
            self.size += group.size * (p + q) ** 2
            for k in group:
                keys.append(k * (self.m + 1) + np.concatenate([self.own[k], self.border[k]]))
                local.append(np.concatenate([np.arange(self.own[k].size), p + np.arange(self.border[k].size)]))
        sorting = np.argsort(np.concatenate(keys))
        self.keys, self.local = np.concatenate(keys)[sorting], np.concatenate(local)[sorting]

    def within(self, front: np.ndarray | int, row: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Where the entry of two rows is in a front, below its diagonal."""
        one, two = (self.local[np.searchsorted(self.keys, front * (self.m + 1) + each)] for each in (row, other))
        return self.begin[front] + np.maximum(one, two) * self.wide[front] + np.minimum(one, two)

    def places(self, row: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Where the entry of two rows is in the front that eliminates one of them first."""
        first = np.where(self.order[row] < self.order[other], row, other)
        return self.within(self.front[first], row, other)

    def beside(self, mates: np.ndarray) -> np.ndarray:
        """Where the entries of rows with their mates are, each said once."""
        row = np.broadcast_to(np.arange(self.m)[:, None], mates.shape)
        once = mates <= row
        places = np.full(mates.shape, self.size)
        places[once] = self.places(row[once], mates[once])
        return places

    def levels(self) -> tuple[Level, ...]:
        """All levels, with what moves up to each."""
        source, target, above = self._moves()
        level_of = np.concatenate([np.full(group.size, height) for height, group in enumerate(self.groups)])
        level_of = level_of[np.argsort(np.concatenate(self.groups))]
        found, after = [], 0
        for height, group in enumerate(self.groups):
            own, border = (_padded(part, group, self.m) for part in (self.own, self.border))
            after += own.size
            here = level_of[above] == height
            moved = _indices(source[here]), _indices(target[here] - self.begin[group[0]])
            found.append(Level(on_device(own == self.m), _indices(self.position[border] - after), *moved))
        return tuple(found)

    def _moves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What all fronts leave: where it is among that, where it goes, and into which front."""
        parts, left = [(np.zeros(0, int),) * 3], 0
        for group in self.groups:
            q = max(self.border[k].size for k in group)
            for at, k in enumerate(group):
                border = self.border[k]
                i, j = np.tril_indices(border.size)
                above = np.full(i.size, self.parent[k])
                parts.append((left + at * q * q + i * q + j, self.within(above, border[i], border[j]), above))
            left += group.size * q * q
        source, target, above = (np.concatenate(each) for each in zip(*parts, strict=True))
        return source, target, above


def _padded(parts: Sequence[np.ndarray], group: np.ndarray, none: int) -> np.ndarray:
    """Some of the parts, one below the other."""
    out = np.full((group.size, max(parts[k].size for k in group)), none)
    for at, k in enumerate(group):
        out[at, : parts[k].size] = parts[k]
    return out


def _by_row(row: np.ndarray, moves: np.ndarray, m: int) -> np.ndarray:
    """The slopes of each row that move, the number of all for none."""
    moving = np.flatnonzero(moves)
    moving = moving[np.argsort(row[moving], kind="stable")]
    parts = np.split(moving, np.searchsorted(row[moving], np.arange(1, m)))
    return _padded(parts, np.arange(m), row.size)


def _pairs(row: np.ndarray, body: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of slopes of one body, those of two rows once, the later row first."""
    grouped, count = np.argsort(body, kind="stable"), np.bincount(body)
    start, partners = np.cumsum(count) - count, count[body[grouped]]
    first = np.repeat(grouped, partners)
    offset = np.arange(first.size) - np.repeat(np.cumsum(partners) - partners, partners)
    second = grouped[start[body[first]] + offset]
    kept = order[row[first]] >= order[row[second]]
    return first[kept], second[kept]


def _indices(values: np.ndarray) -> Array:
    return on_device(np.asarray(values, np.uint32))  # without sign, they count from the front and need no test of it
