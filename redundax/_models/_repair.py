"""Which changes of a file take off redundancy, add no motion, and come near none along the motion if that can be

With N an orthonormal basis of the self-stress, freeing the rows R adds no motion iff N_R has full rank, and

    margin = |det N_R N_R^T|^(1 / 2|R|)

is 0 where the copy could move, and at most 1. It is looked at wherever the motion of the joints led; where no changes
stay clear of 0 all along, those are taken that do at the first position, and said to move freely elsewhere. Of changes
that are made one after the other, N of what those before leave is N times the null space of their N_R.
"""

import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .._analysis._release import Release, releases
from .._tools._errors import RedundaxError
from ._audit import Audit, Group
from ._choice import LEAST, USABLE, Choice, Repair
from ._edit import Changed, Edit
from ._edit_asmt import asmt_change, asmt_moves
from ._edit_mjcf import mjcf_change, mjcf_moves
from ._edit_sdf import sdf_change, sdf_moves
from ._edit_urdf import urdf_change, urdf_moves
from ._edit_usd import usd_change, usd_moves
from ._model import Model
from ._stress import Along, Stress
from ._travel import Travel

_REST = 1e-9  # of unit rows: what no choice of rows can free
_GOOD = 0.1
_BETWEEN = 4  # positions looked at for each that was walked to
_NEAR = 1e-4  # of a singular position, where self-stress is not clear
_TURNED = 0.7  # least cosine of self-stress at neighbouring positions


class Language(NamedTuple):
    """What a kind of file can say: its moves, its copies with changes, and what it has no words for."""

    name: str
    moves: Callable[[Model], list[Edit]]
    change: Callable[[Model, Sequence[Edit], pathlib.Path], Changed]
    lacks: str

    def lines(self, model: Model, edit: Edit) -> list[str]:
        """What to write where; nothing for what stands in an included file."""
        try:
            return self.change(model, [edit], model.path).lines
        except RedundaxError:
            return []


def _no_copy(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """What a format does in which nothing can be changed."""
    raise RedundaxError(
        f"Argument `file`: '{file}' would be {model.described.format}, of which no copies are written. Leave it out."
    )


_NONE = Language("", lambda model: [], _no_copy, "")
_LANGUAGES = (
    Language("MJCF", mjcf_moves, mjcf_change, "it cannot free single directions of a connect or weld"),
    Language("URDF", urdf_moves, urdf_change, "it knows ball joints in place of hinges, and 3d loops"),
    Language(
        "SDF", sdf_moves, sdf_change, "it knows ball and universal joints in place of hinges, and none that slide"
    ),
    Language("ASMT", asmt_moves, asmt_change, "it has no joint that frees a single tilt"),
    Language("USD", usd_moves, usd_change, "no joint of it that is read frees a single tilt"),
)


WRITTEN = tuple(each.name for each in _LANGUAGES)


def language(model: Model) -> Language:
    """That of the file of a model; one without a name and words where no copies of its format are written."""
    return next((each for each in _LANGUAGES if each.name == model.described.format), _NONE)


def along(model: Model, found: Audit, at: np.ndarray, travel: Travel | None) -> Along:
    """The self-stress at the position `at` of the joints, where `found` is regular, and along the motion."""
    look = found.regular
    stress = Stress(model.tree, found.rows, look.scales)
    bases, places = [stress.basis(at, look.redundancy)], [("", 0.0)]
    for way in travel.ways if travel and look.redundancy else ():
        last: tuple[np.ndarray, float] | None = None
        for where, positions, kept in zip(way.at, way.positions, way.kept, strict=True):
            if kept < _NEAR:
                last = None
                continue
            basis = stress.basis(positions, look.redundancy)
            for share, between in _between(last[0], basis) if last else ((1.0, basis),):
                bases.append(between)
                places.append((way.joint, float(where if not last else last[1] + share * (where - last[1]))))
            last = bases[-1], float(where)
    return Along(np.array(bases), places)


def _between(before: np.ndarray, after: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
    """Bases on the way from one position to the next, as shares of it; of those that turn much the last alone."""
    left, cosines, right = np.linalg.svd(after.T @ before)
    turned = after @ left @ right
    shares = np.arange(1, _BETWEEN + 1) / _BETWEEN if cosines.min(initial=1.0) > _TURNED else (1.0,)
    yield from ((float(share), (1 - share) * before + share * turned) for share in shares)


def repairs(model: Model, found: Audit, way: Along) -> tuple[Repair, ...]:
    """For dependent groups that no change couples: what to change."""
    moves, place = language(model).moves(model), {row: k for k, row in enumerate(found.rows)}
    blocks = [[place[row] for row in move.rows] for move in moves]
    first = _picked(way, moves, blocks)
    out = []
    for groups in _coupled(found.groups, [moves[k] for k in first]):
        rows = tuple(row for group in groups for row in group.rows)
        inside = [k for k, move in enumerate(moves) if set(move.rows) <= set(rows)]
        mine = [k for k in first if k in inside]
        taken = _choice(way, moves, blocks, mine)
        tries = ([k for k in inside if k not in without] for without in (mine, mine[:1]) if mine)
        others = (_choice(way, moves, blocks, _picked(way, moves, blocks, only, by_margin=True)) for only in tries)
        other = next((each for each in others if len(each.rows) == len(taken.rows) and each.is_usable), None)
        redundancy = sum(group.redundancy for group in groups)
        freed = [k for edit in mine for k in blocks[edit]]
        rest = _rest(found, way.freed(freed).bases[0], rows) if len(taken.rows) < redundancy else ()
        choices = tuple(each for each in (taken, other) if each and each.edits)
        sayable = tuple(moves[k].rows for k in inside)
        out.append(Repair(redundancy, rows, choices, rest, sayable))
    return tuple(out)


def _rest(found: Audit, basis: np.ndarray, rows: Sequence[str]) -> tuple[str, ...]:
    own = [k for k, row in enumerate(found.rows) if row in rows]
    left, sizes, _ = np.linalg.svd(basis[own], full_matrices=False)
    best = releases(left[:, sizes > LEAST], tuple(found.rows[k] for k in own), ("",) * len(own), by_row=True)
    return tuple(row for _, shares in best[0].directions for row in shares) if best else ()


def _coupled(groups: Sequence[Group], edits: Sequence[Edit]) -> list[list[Group]]:
    """Groups, those together that changes of one joint or loop are of, or that are of the same joints."""
    alike: dict[tuple[str, ...], list[Group]] = {}
    for group in groups:
        alike.setdefault(tuple(dict.fromkeys(row.rpartition(".")[0] for row in group.rows)), []).append(group)
    sets = list(alike.values())
    for name in dict.fromkeys(edit.name for edit in edits):
        rows = {row for edit in edits if edit.name == name for row in edit.rows}
        touched = [some for some in sets if any(rows & set(group.rows) for group in some)]
        place = sets.index(touched[0])
        sets = [some for some in sets if some not in touched]
        sets.insert(place, [group for some in touched for group in some])
    return sets


def _choice(way: Along, moves: Sequence[Edit], blocks: Sequence[list[int]], picks: Sequence[int]) -> Choice:
    margins = way.margins([row for k in picks for row in blocks[k]])
    worst = int(np.argmin(margins))
    return Choice(tuple(moves[k] for k in sorted(picks)), float(margins[worst]), way.places[worst])


def best_of(found: Audit, way: Along, moves: Sequence[Edit]) -> Choice:
    """Of these moves those that take off most, as `repairs` has them."""
    place = {row: k for k, row in enumerate(found.rows)}
    blocks = [[place[row] for row in move.rows] for move in moves]
    return _choice(way, moves, blocks, _picked(way, moves, blocks))


def _picked(
    way: Along,
    moves: Sequence[Edit],
    blocks: Sequence[list[int]],
    only: Sequence[int] | None = None,
    *,
    by_margin: bool = False,
) -> list[int]:
    """Moves that take off most: those that stay clear of a motion, else those that add none here.

    Loops go first, then the joints that carry least, so that what is heavy stays in joints that are rigid.
    """
    allowed = range(len(moves)) if only is None else only

    def key(k: int, margin: float) -> tuple:
        first = 0.0 if by_margin else moves[k].weight
        return margin < _GOOD, first, -len(blocks[k]) if moves[k].weight < 0 else 0, -round(margin, 9)

    def size(picks: Sequence[int]) -> int:
        return sum(len(blocks[k]) for k in picks)

    def becomes(k: int) -> str:
        return moves[k].name if moves[k].how == "become" else ""

    def fits(k: int, picks: Sequence[int]) -> bool:  # a joint becomes one kind
        return not becomes(k) or becomes(k) not in map(becomes, picks)

    best: list[int] = []
    for bases, least in ((way, USABLE), (Along(way.bases[:1], way.places), LEAST)):
        if best:
            break
        worst = bases.worsts([blocks[k] for k in allowed])
        usable = [k for k, margin in zip(allowed, worst, strict=True) if margin > least]  # others free no more of it
        rows = sorted({row for k in usable for row in blocks[k]})
        own = {k: [rows.index(row) for row in blocks[k]] for k in usable}
        mine = bases.only(rows)
        best = _greedy(mine, own, least, key, fits, [])
        for start in usable if size(best) < np.linalg.matrix_rank(mine.bases[0], tol=_REST) else ():
            best = max(best, _greedy(mine, own, least, key, fits, [start]), key=size)
    return best


def _greedy(
    way: Along,
    blocks: Mapping[int, list[int]],
    least: float,
    key: Callable[[int, float], tuple],
    fits: Callable[[int, Sequence[int]], bool],
    picks: list[int],
) -> list[int]:
    left, picks = way.freed([row for k in picks for row in blocks[k]]), list(picks)
    while left.bases.shape[2]:
        others = [k for k in blocks if k not in picks and fits(k, picks)]
        worst = dict(zip(others, left.worsts([blocks[k] for k in others]), strict=True))
        usable = [k for k, margin in worst.items() if margin > least]
        if not usable:
            break
        best = min(usable, key=lambda k: key(k, worst[k]))
        picks.append(best)
        left = left.freed(blocks[best])
    return picks


def ranked(way: Along, found: Sequence[Release], rows: Sequence[str]) -> tuple[tuple[Release, float], ...]:
    """Releases with their least margin along the motion, those first that stay clear of a further motion."""
    place = {row: k for k, row in enumerate(rows)}
    margins = [way.worst([place[row] for _, shares in each.directions for row in shares]) for each in found]
    order = sorted(range(len(found)), key=lambda k: (margins[k] <= USABLE, -round(margins[k], 9)))
    return tuple((found[k], margins[k]) for k in order)
