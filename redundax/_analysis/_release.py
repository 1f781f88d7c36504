"""Which directions within joints to release so that nothing is redundant and no degree of freedom is added.

Releasing k directions d_s, each a combination of the rows of one joint, removes all redundancy and leaves the rank
iff the matrix N_S with rows d_s^T N is regular: only then every self-stress state needs a released direction. Its
determinant, with N orthonormal and free of units, ranks the choices: the larger, the farther is the released mechanism
from a position where it gains a motion. Within one joint and kind of row the directions are the principal ones of N.
"""

import dataclasses
import itertools

import numpy as np

_MOST_CHOICES = 20000
_LISTED = 8


@dataclasses.dataclass(frozen=True)
class Release:
    """Directions to release together.

    - `directions`: for each the joint's name and its rows with their share of the direction, which has length 1.
    - `determinant`: |det N_S|, from 0 to 1; the larger, the better.

    ??? example

        ```python
        best = rx.analyze(mechanism, state).releases[0]
        print(best)  # L (+1 L.angle): 0.605
        ```
    """

    directions: tuple[tuple[str, dict[str, float]], ...]
    determinant: float

    def __str__(self) -> str:
        parts = [
            f"{joint} ({', '.join(f'{share:+.3g} {row}' for row, share in rows.items())})"
            for joint, rows in self.directions
        ]
        return f"{' and '.join(parts)}: {self.determinant:.3f}"


def releases(basis: np.ndarray, rows: tuple[str, ...], kinds: tuple[str, ...]) -> tuple[Release, ...]:
    """The best releases, best first.

    - `basis`: orthonormal basis N of the self-stress states in scaled multipliers, shape (m, k).
    - `rows`, `kinds`: names "joint.row" and kinds of the rows.
    """
    count = basis.shape[1]
    candidates = _candidates(basis, rows, kinds)
    if not count or len(candidates) < count:
        return ()
    order = sorted(candidates, key=lambda item: -_rank(np.linalg.norm(item[2])))
    while _choices(len(order), count) > _MOST_CHOICES:
        order.pop()
    found = []
    for chosen in itertools.combinations(order, count):
        size = abs(float(np.linalg.det(np.stack([vector for _, _, vector in chosen]))))
        if size > 1e-6:
            found.append(Release(tuple((joint, shares) for joint, shares, _ in chosen), size))
    return tuple(sorted(found, key=lambda item: -_rank(item.determinant))[:_LISTED])


def _rank(size: float | np.floating) -> float:
    """What choices are sorted by: sizes that differ by rounding are equal, so that units do not change the order."""
    return round(float(size), 9)


def determinant(
    directions: tuple[tuple[str, dict[str, float]], ...], basis: np.ndarray, rows: tuple[str, ...]
) -> float:
    """|det N_S| of directions for an orthonormal basis N of the self-stress."""
    shares = np.array([[part.get(row, 0.0) for row in rows] for _, part in directions])
    return abs(float(np.linalg.det(shares @ basis)))


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
