"""Which directions within joints to release so that nothing is redundant and no degree of freedom is added.

Releasing k directions d_s, each a combination of the rows of one joint, removes all redundancy and leaves the rank
iff the matrix N_S with rows d_s^T N is regular: only then every self-stress state needs a released direction. Its
determinant, with N orthonormal and free of units, ranks the choices: the larger, the farther is the released mechanism
from a position where it gains a motion. Within one joint and kind of row the directions are the principal ones of N.

Directions of which no self-stress needs two are independent groups, whose determinants multiply: where there are too
many choices to look at all, each group is looked through by itself, and the best choices of all are made of its best.
"""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

_MOST_CHOICES = 20000
_MOST_WORK = 10**9  # multiplications of a search among more choices, seconds
_AT_ONCE = 2**20  # numbers in matrices whose determinants are taken together, 8 MiB
_LISTED = 6
_LEAST = 1e-6  # of the best determinant: a choice below adds a freedom, or as good as does
_APART = 1e-9  # products of directions that are rounding: no self-stress needs both


@dataclasses.dataclass(frozen=True)
class Release:
    """Directions to release together.

    - `directions`: for each the joint's name and its rows with their share of the direction, which has length 1.
    - `determinant`: |det N_S|, from 0 to 1; the larger, the better.

    ??? example

        ```python
        best = rx.analyze(mechanism, state).releases[0]
        print(best)  # L.angle: 0.605
        ```
    """

    directions: tuple[tuple[str, dict[str, float]], ...]
    determinant: float

    def __str__(self) -> str:
        """Directions joint by joint: of several rows of one joint its name stands once."""
        joints: dict[str, list[str]] = {}
        for joint, shares in self.directions:
            joints.setdefault(joint, []).append(_direction(joint, shares))
        size = f"{self.determinant:.3f}" if self.determinant >= 1e-3 else f"{self.determinant:.1e}"
        return f"{' and '.join(_together(*each) for each in joints.items())}: {size}"


def _together(joint: str, directions: list[str]) -> str:
    """One direction as it is, several as rows of the joint."""
    if len(directions) == 1:
        return directions[0]
    return f"{joint} ({', '.join(direction.removeprefix(f'{joint}.') for direction in directions)})"


def _direction(joint: str, shares: dict[str, float]) -> str:
    """A row, or the combination of rows of a joint."""
    if len(shares) == 1:
        return next(iter(shares))
    return f"{joint} ({', '.join(f'{share:+.3g} {row}' for row, share in shares.items())})"


def releases(
    basis: np.ndarray, rows: tuple[str, ...], kinds: tuple[str, ...], *, by_row: bool = False, most: int = _LISTED
) -> tuple[Release, ...]:
    """The best releases, a few, best first.

    - `basis`: orthonormal basis N of the self-stress states in scaled multipliers, shape (m, k).
    - `rows`, `kinds`: names "joint.row" and kinds of the rows.
    - `by_row`: whether rows are directions that can be built, as along the axes of a joint; else the principal
      directions of N within each joint are offered.
    - `most`: how many.
    """
    count = basis.shape[1]
    candidates = _rows(basis, rows) if by_row else _candidates(basis, rows, kinds)
    if not count or len(candidates) < count:
        return ()
    order = sorted(candidates, key=lambda item: -_rank(np.linalg.norm(item[2])))
    vectors, joints = np.stack([vector for _, _, vector in order]), [joint for joint, _, _ in order]
    if _choices(len(order), count) <= _MOST_CHOICES:
        best = _best(vectors, count, joints, most)
    else:
        best = [(1.0, ())]
        for group in _independent(vectors):
            own = _within(vectors[group])
            pairs = itertools.product(best, _best(own, own.shape[1], [joints[k] for k in group], most))
            best = [(size * by, (*pick, *group[list(more)])) for (size, pick), (by, more) in pairs]
            best = sorted(best, key=lambda item: -_rank(item[0]))[:most]
    place = {id(candidate): k for k, candidate in enumerate(candidates)}
    picks = ((size, sorted((order[k] for k in pick), key=lambda each: place[id(each)])) for size, pick in best)
    return tuple(Release(tuple(each[:2] for each in pick), size) for size, pick in picks)


def _best(vectors: np.ndarray, count: int, joints: list[str], most: int) -> list[tuple[float, Sequence[int]]]:
    """The best choices of as many rows as columns, with their determinants."""
    if _choices(len(vectors), count) <= _MOST_CHOICES:
        chosen = list(itertools.combinations(range(len(vectors)), count))
    else:
        starts = max(_MOST_WORK // (len(vectors) * count**2), most)
        chosen = list({_exchanged(vectors, _greedy(vectors, first)) for first in range(min(len(vectors), starts))})
    step = max(_AT_ONCE // count**2, 1)
    parts = (chosen[start : start + step] for start in range(0, len(chosen), step))
    sizes = np.concatenate([np.abs(np.linalg.det(vectors[np.array(part)])) for part in parts])

    def rank(item: tuple[float, Sequence[int]]) -> tuple[float, int]:
        size, pick = item
        return -_rank(size), len({joints[k] for k in pick})  # of equals those in few joints first

    best = sorted(zip(sizes.tolist(), chosen, strict=True), key=rank)[:most]
    return [(size, pick) for size, pick in best if size > _LEAST * best[0][0]]


def _independent(vectors: np.ndarray) -> list[np.ndarray]:
    """Groups of rows, those of one orthogonal to those of all others; of columns that are orthonormal.

    What is left over, rows next to zero, spans no direction.
    """
    linked, left, groups = np.abs(vectors @ vectors.T) > _APART, np.ones(len(vectors), bool), []
    while left.any():
        group = np.arange(len(vectors)) == np.argmax(left)
        while (more := linked[group].any(axis=0) | group).sum() > group.sum():
            group = more
        groups.append(np.flatnonzero(group))
        left &= ~group
    return [group for group in groups if np.linalg.norm(vectors[group], 2) > 0.5]


def _within(vectors: np.ndarray) -> np.ndarray:
    """The rows of a group by an orthonormal basis of what they span: each direction of it has singular value 1."""
    axes, sizes, _ = np.linalg.svd(vectors, full_matrices=False)
    kept = sizes > 0.5
    return axes[:, kept] * sizes[kept]


def _greedy(vectors: np.ndarray, first: int) -> list[int]:
    """As many rows as columns, from the first on each the farthest from the span of those before."""
    left, picked = vectors.copy(), [first]
    for _ in range(vectors.shape[1] - 1):
        along = left[picked[-1]] / np.linalg.norm(left[picked[-1]])
        left = left - np.outer(left @ along, along)
        picked.append(int(np.argmax(np.round(np.linalg.norm(left, axis=1), 9))))
    return picked


def _exchanged(vectors: np.ndarray, picked: list[int]) -> tuple[int, ...]:
    """The rows after exchanges of one for another that enlarge the determinant, by a factor of more than rounding."""
    for _ in range(100):
        if np.linalg.matrix_rank(vectors[picked]) < len(picked):
            break
        gains = np.abs(vectors @ np.linalg.inv(vectors[picked]))  # of every row in the place of each that is picked
        row, place = np.unravel_index(np.argmax(np.round(gains, 9)), gains.shape)
        if gains[row, place] < 1 + 1e-6:
            break
        picked[place] = int(row)
    return tuple(sorted(picked))


def _rank(size: float | np.floating) -> float:
    """What choices are sorted by: sizes that differ by rounding are equal, so that units do not change the order."""
    return float(f"{size:.9g}")


def determinant(
    directions: tuple[tuple[str, dict[str, float]], ...], basis: np.ndarray, rows: tuple[str, ...]
) -> float:
    """|det N_S| of directions for an orthonormal basis N of the self-stress."""
    shares = np.array([[part.get(row, 0.0) for row in rows] for _, part in directions])
    return abs(float(np.linalg.det(shares @ basis)))


def _rows(basis: np.ndarray, rows: tuple[str, ...]) -> list[tuple[str, dict, np.ndarray]]:
    return [
        (row.rpartition(".")[0] or row, {row: 1.0}, basis[k])
        for k, row in enumerate(rows)
        if np.linalg.norm(basis[k]) > 1e-6
    ]


def _candidates(basis: np.ndarray, rows: tuple[str, ...], kinds: tuple[str, ...]) -> list[tuple[str, dict, np.ndarray]]:
    blocks: dict[tuple[str, str], list[int]] = {}
    for k, (row, kind) in enumerate(zip(rows, kinds, strict=True)):
        blocks.setdefault((row.rpartition(".")[0] or row, kind), []).append(k)
    out = []
    for (joint, _), members in blocks.items():
        directions, sizes, _ = np.linalg.svd(basis[members], full_matrices=False)
        for direction, size in zip(directions.T, sizes, strict=True):
            if size > 1e-6:
                direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
                shares = {
                    rows[k]: float(share) for k, share in zip(members, direction, strict=True) if abs(share) > 1e-9
                }
                out.append((joint, shares, direction @ basis[members]))
    return out


def _choices(number: int, count: int) -> float:
    return float(np.prod([(number - k) / (k + 1) for k in range(count)]))
