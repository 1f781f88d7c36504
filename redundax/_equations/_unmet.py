"""Why an assembly found no state: rows that contradict each other, or those farthest off at the guess.

What is left at the nearest position is a combination of rows that no displacement changes, K^T r = 0: where two rows
contradict each other it has these two alone. Where a mechanism closes by redundant rows one slip spreads over all of
them, and what was off at the guess tells more.
"""

from collections.abc import Sequence
from typing import SupportsIndex

import numpy as np
from jaxtyping import Array

from .._system._names import Names
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError
from .._tools._numbers import Numeric
from ._misfit import Misfit

_CONTRADICTING = 3  # rows at most that are told to contradict each other
_LISTED = 4
_PART = 1e-3  # of the largest misfit, below which one is what rounding and stopping of a descent leave
_NEARLY = 0.1  # of the largest misfit at the guess, below which a row is told by number alone


def check_rows(system: AbstractSystem, q: Array, t: Array) -> np.ndarray:
    """Residuals of all rows at the guess; an error names those that have no value there."""
    values = np.asarray(system.constraint(q, t))
    lost = [name for name, value in zip(system.rows.labels, values, strict=True) if not np.isfinite(value)]
    if lost:
        raise NoSolutionError(
            f"No position is found, as rows have no value at the guess: {', '.join(lost)}. Give another guess; of a "
            "joint whose axes on both bodies are opposite, turn one round."
        )
    return values


def no_position(
    system: AbstractSystem, residual: np.ndarray, off: Misfit, given: Sequence[str], shut: Sequence[str]
) -> NoSolutionError:
    """The error where no position is found, from the residual at the guess and what the nearest position misses; `shut`
    are contacts that are held closed."""
    rows, head = _Rows(system.names, given, 0), "No position satisfies the constraints near the guess."
    held = f" Held closed: {', '.join(shut)}. Give a contact that is to open a gap at the guess." if shut else ""
    contradiction = rows.contradiction(off, "position")
    if contradiction:
        return NoSolutionError(f"{head} {contradiction}{held}")
    most = int(np.argmax(off.relative))
    missed = np.flatnonzero(off.relative > _PART * off.relative[most])
    change = f", or change `positions` ({', '.join(given)})" if given else ""
    farthest, told = rows.at_guess(np.abs(residual), off)
    joints = "this joint" if told <= 1 else "these joints"
    advice = system.doubt or (
        f" If the guess is good, check the points and axes of {joints}; else give a better one{change}."
    )
    return NoSolutionError(
        f"{head} {farthest} The nearest position found misses {missed.size} "
        f"row{'s' if missed.size > 1 else ''}, {rows.off(most, off.size[most])} the most.{advice}{held}"
    )


def no_velocity(names: Names, slow: Misfit, given: Sequence[str]) -> NoSolutionError:
    """The error where no velocity is found."""
    rows, head = _Rows(names, given, 1), "No velocity satisfies the constraints at this position."
    contradiction = rows.contradiction(slow, "velocity")
    if contradiction:
        return NoSolutionError(f"{head} {contradiction}")
    order = [k for k in np.argsort(-slow.relative, kind="stable") if slow.beyond[k]]
    more = f" and {len(order) - _LISTED} more" if len(order) > _LISTED else ""
    return NoSolutionError(
        f"{head} The nearest one misses {', '.join(rows.off(k, slow.size[k]) for k in order[:_LISTED])}{more}. Change "
        "`rates`, or what drivers ask for."
    )


class _Rows:
    """Rows and given values in words; `rates` says how often they are differentiated by time."""

    def __init__(self, names: Names, given: Sequence[str], rates: int):
        self.names, self.rates = names, rates
        self.labels = (*names.rows.labels, *(f"{name} as given" for name in given))
        coordinates = {
            **dict(zip(names.coordinates.labels, names.coordinates.angular.tolist(), strict=True)),
            **dict(zip(names.joint_coordinates.labels, names.joint_coordinates.angular.tolist(), strict=True)),
        }
        self.angular = (*names.rows.angular.tolist(), *(coordinates[name] for name in given))

    def off(self, k: SupportsIndex, size: Numeric, *, where: bool = False) -> str:
        """By how much a row is off, as in "B.x by 0.02 m"; and between which bodies."""
        unit = self.names.units.of("angular" if self.angular[k] else "linear", self.rates)
        bodies = self.names.bodies_at(self.labels[k]) if where else ()
        shown = f"{size:.2g}" if size < 100 else f"{size:.0f}"
        return f"{self.labels[k]} by {shown}{unit and f' {unit}'}{f' ({bodies[0]} on {bodies[1]})' if bodies else ''}"

    def at_guess(self, size: np.ndarray, off: Misfit) -> tuple[str, int]:
        """Which rows are farthest off at the guess, and how many are met there; of how many joints these are."""
        relative = size / off.scale[: size.size]
        order = np.argsort(-relative, kind="stable")
        largest = relative[order[0]]
        if largest <= _PART * np.max(off.relative):
            return "All rows are met at the guess.", 0
        first = [k for k in order[:_LISTED] if relative[k] > _NEARLY * largest]
        rest, met = size.size - len(first), int(np.sum(relative <= _PART * largest))
        others = f"; {'all' if met == rest else f'{met} of the'} {rest} others are met there" if met else ""
        joints = {self.labels[k].rpartition(".")[0] for k in first}
        words = ", ".join(self.off(k, size[k], where=True) for k in first)
        return f"Farthest off at the guess: {words}{others}.", len(joints)

    def contradiction(self, misfit: Misfit, what: str) -> str:
        """Rows that alone are left, which cannot be met together; "" where there are more."""
        found = np.flatnonzero(misfit.relative > _PART * np.max(misfit.relative))
        if not 0 < found.size <= _CONTRADICTING or not np.all(np.isfinite(misfit.relative)):
            return ""
        named = [self.labels[k] for k in found]
        both = {1: "cannot be met", 2: "cannot both be met"}.get(found.size, "cannot all be met")
        sizes = ", ".join(self.off(k, misfit.size[k]) for k in found)
        change = "Change it." if found.size == 1 else "Leave one of them out, or change what it asks for."
        return f"{_listed(named)} {both}: the nearest {what} misses {sizes}. {change}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
