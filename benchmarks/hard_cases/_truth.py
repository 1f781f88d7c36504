"""Exact answers of a case under a closure, and by how much they may be wrong: the bound.

An answer is a dictionary: part -> list of 50-digit numbers.
"""

from collections.abc import Mapping

import numpy as np
from mpmath import mp
from truth import exact, friction
from truth.exact import exactly
from truth.scenes import Parameters

from ._case import Case, Exact, difference, parts_of

CLOSURES = ("minimum norm", "compliance", "units")


@exactly
def closure(case: Case, parameters: Parameters, name: str) -> tuple:
    """W and d of a closure, None for the identity and zero."""
    if name == "minimum norm":
        return None, None
    if name == "compliance":
        return parameters["compliance"], parameters["misfit"]
    factor = factors(case.units)
    return tuple(exact.exact(factor[kind]) ** 2 for kind in case.exact.kinds), None


def factors(units: Mapping[str, float]) -> dict[str, float]:
    """By how much the numbers of each kind of quantity grow in other units, see `redundax.Units`."""
    length, angle, mass, time = (units.get(name, 1.0) for name in ("length", "angle", "mass", "time"))
    energy = mass * (length / time) ** 2
    return {
        "linear": length / time**2,
        "angular": angle / time**2,
        "force": energy / length,
        "moment": energy / angle,
        "friction": energy / angle,
    }


def answers(case: Case, mechanism: Exact, parameters: Parameters, name: str) -> list[dict]:
    """All answers under a closure: none, one, or with friction several."""
    pair = closure(case, parameters, name)
    if not case.friction:
        return [_without_friction(mechanism.solve(*pair, friction=False))]
    if friction.contraction(mechanism, pair[0] and _diagonal(pair[0])) < 0.9:
        return [parts_of(mechanism.solve(*pair))]
    return [parts_of(solution) for solution in friction.solutions(mechanism, pair[0] and _diagonal(pair[0]), pair[1])]


def answer_near(case: Case, mechanism: Exact, parameters: Parameters, name: str, answer: dict) -> dict | None:
    """The answer of a neighbouring mechanism that belongs to `answer`, None if it has none."""
    pair = closure(case, parameters, name)
    if not case.friction:
        return _without_friction(mechanism.solve(*pair, friction=False))
    try:
        return parts_of(mechanism.solve(*pair, start=tuple(answer["friction"])))
    except (RuntimeError, ZeroDivisionError):
        return None


@exactly
def _diagonal(entries: tuple):
    return mp.diag(list(entries))


def _without_friction(solution: exact.Solution) -> dict:
    return {**parts_of(solution), "friction": []}


def scales(case: Case, answer: dict, kinds: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """For each entry the largest true value of its kind.

    Where that vanishes, what the other kind of the part and the length of the mechanism, or the load, make of it.
    """
    length = float(max((abs(x) for x in case.exact.q), default=1)) if isinstance(case.exact, exact.Mechanism) else 1.0
    load = float(max(abs(x) for x in case.exact.load)) or 1.0
    out = {}
    for part, values in answer.items():
        sizes = np.array([float(abs(x)) for x in values])
        own = {kind: np.max(sizes[kinds[part] == kind]) for kind in dict.fromkeys(kinds[part].tolist())}
        other = {"linear": ("angular", length), "angular": ("linear", 1 / length)}
        other |= {"force": ("moment", 1 / length), "moment": ("force", length)}
        scale = np.zeros(len(sizes))
        for kind, size in own.items():
            second, arm = other.get(kind, (kind, 1.0))
            fallback = own.get(second, 0.0) * arm
            scale[kinds[part] == kind] = size if size > 1e-12 * fallback else fallback
        out[part] = np.where(scale > 0, scale, load)
    return out


def per_kind(values: Mapping[str, np.ndarray], scale: Mapping[str, np.ndarray], kinds: Mapping) -> dict[str, float]:
    """Largest relative value of each kind; NaN counts as infinite."""
    out: dict[str, float] = {}
    for part, entries in values.items():
        for kind in dict.fromkeys(kinds[part].tolist()):
            chosen = entries[kinds[part] == kind] / scale[part][kinds[part] == kind]
            out[kind] = float(np.max(np.where(np.isnan(chosen), np.inf, chosen)))
    return out


def bound(eps: float, around: list, answer: dict, scale: Mapping, kinds: Mapping, near) -> dict[str, float]:
    """Largest change of an answer per kind over neighbouring mechanisms, at least eps.

    `near(mechanism, parameters, answer)` is the answer of a neighbour; without one the bound is infinite.
    """
    largest = {kind: eps for part in kinds.values() for kind in dict.fromkeys(part.tolist())}
    for parameters, mechanism in around:
        other = None if mechanism is None else near(mechanism, parameters, answer)
        if other is None:
            return dict.fromkeys(largest, np.inf)
        for kind, change in per_kind(difference(answer, other), scale, kinds).items():
            largest[kind] = max(largest[kind], change)
    return largest
