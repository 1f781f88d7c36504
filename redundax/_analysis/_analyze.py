"""What is unique at a state, and what is not.

    A multiplier is unique without friction if its row of N is zero                        (13)
    Accelerations are unique without friction if rank [M Phi_q^T] = n                      (14)
    and with load-dependent friction do not depend on the self-stress if every law reads
    unique multipliers only                                                                (33)

`_verdict` says how far that goes for each output with friction, and what is proved.
Here values are concrete, so the self-stress states appear as a basis: reduced to echelon form, in which each
state has the entry 1 in a row where all others have 0.
"""

from functools import cache, partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

from .._bodies._joints import AngleCoupling
from .._bodies._mechanism import Mechanism
from .._closures._closure import AbstractClosure, MinimumNorm, check_closure, constant, elasticity, without_rows
from .._closures._play import without_play
from .._equations._culprits import culprits
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._equations._rank import Spectrum, Split, split
from .._solve._contacts import as_held
from .._solve._solution import Solution
from .._solve._solve import solve
from .._system._contact import LEFT_OUT, rows_that_hold
from .._system._names import ByName, senses
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._numbers import on_numbers, xp
from .._tools._questions import question
from ._others import other_solutions
from ._outputs import outputs
from ._position import local_self_stress, unique_only_here
from ._pushing_ranges import pushing_ranges
from ._release import Release, releases
from ._report import Report
from ._verdict import Family, Judged, family, judge

_MINIMUM_NORM = MinimumNorm()


@partial(on_numbers, jit=False)
@question
def analyze(
    system: AbstractSystem,
    state: State,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
) -> Report:
    """Rank, self-stress and uniqueness of a system at a state: (13), (14), with friction (33).

    ??? example

        ```python
        report = rx.analyze(mechanism, state)
        print(report)  # a page; report.redundancy is 1, report.self_stress has shape (1, 12)
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`, where `factorize` gives the same as arrays.
    - `closure`, `sense`: as in `solve`; verdicts with friction start from its solution, and `spectral_radius` is that
      of the closure, both without its play.
    - `rank`: declared rank of the constraint Jacobian; decided from its spectrum if not given.
    - `factor`: what `factorize` gave at this state, where it is there already.
    """
    check_system_at(system, state)
    check_closure(closure)
    one_sided = np.array(system.names.one_sided, int)
    pushed, out = None, np.zeros(len(system.rows), bool)
    if one_sided.size:
        pushed, factor = solve(system, state, closure=closure, sense=sense, throw=False), None
        closed = ~np.isin(np.asarray(pushed.contact), LEFT_OUT)
        out = ~np.asarray(rows_that_hold(system.names, closed, closed))
        system = as_held(system, ~out)
    closure = without_play(closure)  # which makes no load unique
    if out.any():  # what is left out is coupled with nothing, nor loaded by a misfit
        closure = constant(without_rows(elasticity(closure, system, state), xp.asarray(~out)))
    system, factor = dense_at(system, state, rank, factor)
    found = _kept(jax.device_get(_evidence(factor)), ~out)
    lost = _undetermined(system, state, factor, closure)
    singular, decided = bool(found.singular_position), bool(found.local)
    local, here = _position(system.anonymous, state, factor, found)
    rows, unique = np.array(system.rows.labels), found.unique_multipliers & (decided or not singular)
    reads = np.unique(np.concatenate([np.zeros(0, int), *(np.ravel(group.rows) for group in system.friction)]))
    redundancy = rows.size - int(found.spectrum.rank) - int(out.sum())
    stress = _echelon(found.split.stress, found.row_scale, redundancy - int(found.local), ~found.in_self_stress)
    groups, kinds = _groups(stress), system.rows.kinds
    figures, result, pulling = None, found.result, ()
    if is_one_of(result, RESULTS.successful):
        figures, solution = _family(system, state, factor, closure, stress, sense)
        result, pulling = solution.result, solution.pulling
    if pushed is not None and is_one_of(pushed.result, RESULTS.contacts_undecided):
        figures, result = None, pushed.result
    ranges = {}
    if pushed is not None and not system.friction and is_one_of(pushed.result, RESULTS.successful):
        ranges = _ranges(system, state, np.asarray(pushed.multipliers), stress, one_sided[~out[one_sided]])
    figures = None if is_one_of(result, RESULTS.not_finite, RESULTS.unbounded_friction) else figures
    return Report(
        coordinates=system.coordinates.labels,
        rows=system.rows.labels,
        velocity_rows=tuple(str(rows[row]) for row in system.velocity_rows),
        rank=int(found.spectrum.rank),
        holonomic_rank=int(_rank_without(factor, system.velocity_rows)),
        redundancy=redundancy,
        freedom=len(system.coordinates) - int(found.spectrum.rank),
        singular_values=found.spectrum.singular_values,
        gap=float(found.spectrum.gap),
        tolerance=float(found.spectrum.tolerance),
        self_stress=stress,
        groups=tuple(tuple(str(rows[k]) for k in group) for group in groups),
        unit_dependent=tuple(str(rows[k]) for group in groups if len({kinds[k] for k in group}) > 1 for k in group),
        unique_multipliers=tuple(str(name) for name in rows[unique]),
        unique_only_here=tuple(str(name) for name in rows[here]),
        singular_position=singular,
        local_self_stress=local,
        lost_digits=float(found.lost_digits),
        undetermined=tuple(str(name) for name in rows[lost]),
        unique_accelerations=bool(found.determinate) and (decided or not singular),
        at_rest=_rests(result, figures),
        verdicts={} if figures is None else _verdicts(system, state, figures, result),
        spectral_radius=figures.radius if system.friction and figures is not None else None,
        releases=() if figures is None else _releases(system, orthonormal(found.row_scale, stress)),
        friction_reads=tuple(str(rows[row]) for row in reads if not unique[row]),
        couplings=_couplings(system),
        pulling=pulling if pushed is None else (),
        contacts={} if pushed is None else {name: str(word) for name, word in pushed.contacts.items()},
        ranges=ranges,
        length=float(factor.length),
        units=str(system.names.units),
        problem="" if figures is not None else RESULTS[result] + culprits(system, state, factor, result),
    )


def _kept(found: Any, kept: np.ndarray) -> Any:
    """The evidence without contacts that lift: rows of zeros, whose loads are zero."""
    if kept.all():
        return found
    split = found.split._replace(stress=np.where(kept[:, None] & kept, found.split.stress, 0.0))
    return found._replace(
        split=split, in_self_stress=found.in_self_stress & kept, unique_multipliers=found.unique_multipliers | ~kept
    )


def _ranges(
    system: AbstractSystem, state: State, multipliers: np.ndarray, stress: np.ndarray, pushing: np.ndarray
) -> dict[str, tuple[float, float]]:
    """What pushing alone leaves of multipliers and of reactions."""
    n, m = len(system.coordinates), len(system.rows)
    found = outputs(system, state)
    names = [name for kind in ("multiplier", "reaction") for name in found.get(kind, ([],))[0]]
    matrix = np.concatenate([found[kind][1][:, n : n + m] for kind in ("multiplier", "reaction") if kind in found])
    return pushing_ranges(names, matrix, multipliers, stress.T, pushing)


@on_numbers
def _rank_without(factor: Factorisation, rows: tuple[int, ...]) -> Array:
    """The rank without some rows."""
    if not rows:
        return factor.spectrum.rank
    kept = ~np.isin(np.arange(factor.scaled.shape[0]), rows)
    return split(xp.where(kept[:, None], factor.scaled, 0.0), factor.violation.position, None)[1].rank


class _Evidence(NamedTuple):
    """What the report takes from a `Factorisation`."""

    spectrum: Spectrum
    result: RESULTS
    determinate: Array
    local: Array | int
    split: Split
    in_self_stress: Array
    unique_multipliers: Array
    singular_position: Array
    lost_digits: Array
    row_scale: Array


@on_numbers
def _evidence(factor: Factorisation) -> _Evidence:
    return _Evidence(*(getattr(factor, name) for name in _Evidence._fields))


def _position(system: AbstractSystem, state: State, factor: Factorisation, found: _Evidence) -> tuple[int, np.ndarray]:
    """How many self-stress states are there here alone, and which multipliers are unique here alone, (m,)."""
    if not found.singular_position:
        return 0, unique_only_here(system, state, factor, np.asarray(found.unique_multipliers))
    return int(found.local) or local_self_stress(system, state, factor), np.zeros(len(found.row_scale), bool)


def _undetermined(system: AbstractSystem, state: State, factor: Factorisation, closure: AbstractClosure) -> np.ndarray:
    """Which multipliers have no value at a singular position, (m,); where nothing decides, none is told apart."""
    found = factor.undetermined(elasticity(closure, system, state).compliance) if factor.branch else None
    return np.zeros(len(system.rows), bool) if found is None or not factor.local else np.asarray(found)


def _family(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    closure: AbstractClosure,
    stress: np.ndarray,
    sense: ByName | None,
) -> tuple[Family, Solution]:
    """The family through the closure's solution, and that solution."""
    solution = solve(system, state, closure=closure, sense=sense, factor=factor, throw=False)
    slips = senses(system.slips, sense)
    others = partial(other_solutions, system, state, factor, solution, stress, slips)
    chosen = elasticity(closure, system, state)
    return family(system, state, factor, chosen, stress.T, solution, cache(others), slips), solution


def _verdicts(system: AbstractSystem, state: State, figures: Family, result: RESULTS) -> dict[str, tuple[Judged, ...]]:
    how = {"solved": is_one_of(result, RESULTS.successful), "at_rest": _rests(result, figures)}
    return {kind: tuple(judge(figures, *output, **how)) for kind, output in outputs(system, state).items()}


def _rests(result: RESULTS, figures: Family | None) -> bool:
    resting = is_one_of(result, RESULTS.friction_at_rest, RESULTS.ambiguous_rest)
    return resting or (figures is not None and bool(figures.rests))


def _releases(system: AbstractSystem, basis: np.ndarray) -> tuple[Release, ...]:
    """Rows of joints in space are along their own axes, so that they can be released one by one."""
    by_row = isinstance(system, Mechanism) and not system.adds
    return releases(basis, system.rows.labels, system.rows.kinds, by_row=by_row)


def _couplings(system: AbstractSystem) -> tuple[str, ...]:
    if not isinstance(system, Mechanism):
        return ()
    stacks = zip(system.joints, system.names.joints, strict=True)
    return tuple(name for stack, names in stacks if isinstance(stack.element, AngleCoupling) for name in names)


def _groups(stress: np.ndarray) -> list[np.ndarray]:
    """Rows coupled by self-stress states, group by group."""
    groups: list[set[int]] = []
    for state in stress:
        joined = set(np.flatnonzero(state).tolist())
        for group in [group for group in groups if group & joined]:
            groups.remove(group)
            joined |= group
        groups.append(joined)
    return [np.array(sorted(group)) for group in sorted(groups, key=min)]


def orthonormal(row_scale: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Orthonormal basis (m, k) of the self-stress in scaled multipliers, free of units."""
    return np.linalg.qr(stress.T * np.asarray(row_scale)[:, None])[0]


def _echelon(projector: np.ndarray, row_scale: np.ndarray, k: int, unique: np.ndarray) -> np.ndarray:
    """Basis of the self-stress in reduced echelon form, shape (k, m), given the projector of scaled multipliers."""
    vectors, pivots = np.linalg.eigh(projector)[1][:, len(projector) - k :].T if k else 0.0 * projector[:0], []
    for state in range(k):
        size = np.abs(vectors[state:]).max(axis=0)
        pivot = int(np.argmax(size > 0.1 * size.max()))
        row = state + int(np.argmax(np.abs(vectors[state:, pivot])))
        vectors[[state, row]] = vectors[[row, state]]
        vectors[state] /= vectors[state, pivot]
        pivots.append(pivot)
        others = np.arange(k) != state
        vectors[others] -= vectors[others, pivot][:, None] * vectors[state]
    vectors[:, unique] = 0.0
    noise = 1e3 * np.finfo(vectors.dtype).eps * np.abs(vectors).max(axis=1, keepdims=True, initial=0.0)
    states = np.where(np.abs(vectors) > noise, vectors, 0.0) / row_scale
    return states / states[np.arange(k), pivots][:, None]
