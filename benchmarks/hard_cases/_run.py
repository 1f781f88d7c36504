"""Runs cases over routes and precisions, and judges every line."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby

import jax
import numpy as np

from ._case import Case, difference, equations_near, neighbours, perturbed
from ._library import Outcome, build
from ._routes import ROUTES, Route, Truth, in_batch
from ._truth import bound, per_kind, scales

DTYPES = {"float64": 2.0**-52, "float32": 2.0**-23}
ALLOWED = 10.0
DETERMINED = 0.1
MANY = 24


@dataclass(frozen=True)
class Line:
    """One case on one route in one precision: errors and bounds per kind, and the verdict."""

    family: str
    case: str
    route: str
    dtype: str
    errors: dict[str, float]
    bounds: dict[str, float]
    ratio: float
    strict: float
    solutions: int
    rank: int
    rank_found: int
    sharpness: float
    contraction: float
    well_posed: bool
    gap: float
    result: str
    verdict: str
    seconds: float


def run(
    cases: Iterable[Case],
    dtypes: Sequence[str] = tuple(DTYPES),
    routes: Sequence[str] = tuple(ROUTES),
    draws: int = 3,
) -> Iterator[Line]:
    """All lines of the cases, family by family."""
    for _, group in groupby(cases, key=lambda case: case.family):
        family = list(group)
        for dtype in dtypes:
            with jax.enable_x64(dtype == "float64"):
                built = [build(case) for case in family]
                batch = _in_batches(family, built) if "vmap" in routes else {}
                for case, (system, state) in zip(family, built, strict=True):
                    for name in (name for name in case.routes if name in routes):
                        found = batch[case] if name == "vmap" else ROUTES[name].run(case, system, state)
                        for one in _complete(case, ROUTES[name], found) if isinstance(found, list) else [found]:
                            yield judged(case, ROUTES[name], dtype, one, draws)


def _complete(case: Case, route: Route, found: list[Outcome]) -> list[Outcome]:
    """The solutions found, and one more outcome if there are fewer or more than the exact ones."""
    wanted = len(_truths(case, route.truth))
    none = {part: np.full(len(kinds), np.nan) for part, kinds in case.kinds.items()}
    if len(found) > wanted:
        return [*found, Outcome(none, case.exact.rank, "", np.nan, np.nan)]
    if len(found) < wanted or not wanted:
        message = f"{len(found)} of {wanted} solutions found"
        return [*found, Outcome(none, case.exact.rank, message, np.nan, np.nan)]
    return found


def _in_batches(cases: Sequence[Case], built: Sequence[tuple]) -> dict[Case, Outcome]:
    """The vmapped route: cases of the same structure go together."""
    groups: dict = {}
    for case, pair in zip(cases, built, strict=True):
        if "vmap" in case.routes:
            leaves, tree = jax.tree.flatten((pair[0].anonymous, pair[1]))
            key = tree, tuple(np.shape(leaf) for leaf in leaves), case.sense
            groups.setdefault(key, []).append((case, pair))
    found = {}
    for group in groups.values():
        together = [case for case, _ in group]
        found |= dict(zip(together, in_batch(together, [pair for _, pair in group]), strict=True))
    return found


@cache
def _truths(case: Case, truth: Truth) -> list[dict]:
    return [] if case.unsolvable else truth.answers(case, case.exact, case.parameters)


@cache
def _bounds(case: Case, chosen: Truth, number: int, eps: float, count: int) -> tuple[dict, dict, dict]:
    """Scales of one of the answers, its bound by the parameters, and that by the equations (7)."""
    answer = _truths(case, chosen)[number]
    kinds, near, size = chosen.kinds(case), chosen.near(case), max(eps, case.size)
    scale = scales(case, answer, kinds)
    if chosen.derivative:
        rng = np.random.default_rng(0)
        around = [[(perturbed(case.path.parameters, eps, rng), case.exact) for _ in range(count)], []]
    else:
        around = [neighbours(case, size, count), equations_near(case, size, count)]
    return scale, *(bound(eps, group, answer, scale, kinds, near) for group in around)


def judged(case: Case, route: Route, dtype: str, found: Outcome, draws: int) -> Line:
    """The line of one outcome, measured against the nearest of the exact answers.

    The bound is a least upper one, and the largest change over few neighbours falls short of it: what exceeds that is
    measured against many.
    """
    truths = _truths(case, route.truth)
    ratio, strict, errors, limit = _measured(case, route, dtype, found, draws)
    if ratio > ALLOWED and truths and not found.result:
        ratio, strict, errors, limit = _measured(case, route, dtype, found, MANY)
    posed = case.well_posed and max(limit.values(), default=0.0) <= DETERMINED
    return Line(
        family=case.family,
        case=case.name,
        route=route.name,
        dtype=dtype,
        errors=errors,
        bounds=limit,
        ratio=ratio,
        strict=strict,
        solutions=len(truths),
        rank=case.exact.rank,
        rank_found=found.rank,
        sharpness=case.sharpness,
        contraction=case.contraction,
        well_posed=posed,
        gap=found.gap,
        result=found.result,
        verdict=verdict(case, found, ratio, posed, bool(truths), DTYPES[dtype]),
        seconds=found.seconds,
    )


def _measured(case: Case, route: Route, dtype: str, found: Outcome, draws: int) -> tuple[float, float, dict, dict]:
    """Error over bound, the same by the parameters alone, errors and bounds per kind."""
    choices = []
    for number, answer in enumerate(_truths(case, route.truth)):
        scale, *limits = _bounds(case, route.truth, number, DTYPES[dtype], draws)
        errors = per_kind(difference(answer, _as_given(found, answer)), scale, route.truth.kinds(case))
        limit = {kind: max(limit[kind] for limit in limits) for kind in errors}
        choices.append((_ratio(errors, limit), _ratio(errors, limits[0]), errors, limit))
    return min(choices, key=lambda choice: choice[0], default=(np.inf, np.inf, {}, {}))


def _leaves_out(found: Outcome) -> bool:
    """Whether loads have no value beside accelerations that do, as at singular positions."""
    lost = {part: np.isnan(np.asarray(values, float)) for part, values in found.values.items()}
    return lost["multipliers"].any() and not lost["acceleration"].any()


def _as_given(found: Outcome, answer: dict) -> dict:
    """What was found, with the true values of loads that are left out."""
    if not _leaves_out(found):
        return found.values
    loads = [
        true if np.isnan(x) else x for x, true in zip(found.values["multipliers"], answer["multipliers"], strict=True)
    ]
    return {**found.values, "multipliers": loads}


def _ratio(errors: dict[str, float], limit: dict[str, float]) -> float:
    """Largest error over its bound; no number is infinitely wrong."""
    return max(np.inf if np.isinf(error) else error / limit[kind] for kind, error in errors.items())


def verdict(case: Case, found: Outcome, ratio: float, posed: bool, solvable: bool, eps: float) -> str:
    """`ok`, `flagged`, `false flag` or `SILENT WRONG`, see the package.

    Where sigma_r / sigma_1 is below 10 eps, the rank is not in the data. Loads that are left out are a flag where the
    case is not well posed and what is given is right.
    """
    right = solvable and ratio <= ALLOWED
    if found.result:
        return "false flag" if posed and solvable else "flagged"
    if _leaves_out(found):
        return "flagged" if right and not posed else "SILENT WRONG"
    decidable = case.sharpness > ALLOWED * eps
    return "ok" if right and (found.rank == case.exact.rank or not decidable) else "SILENT WRONG"
