"""Contacts that only push: closed ones hold, and their multipliers are not negative."""

from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Bool, Float

from .._analysis._analyze import analyze
from .._analysis._report import Report
from .._closures._closure import AbstractClosure, MinimumNorm
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solve._contacts import as_held
from .._system._contact import Contact, rows_that_hold
from .._system._names import ByName
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError

_MINIMUM_NORM = MinimumNorm()
_PULLS = 1e-9  # of the largest load: more than rounding


class Held(NamedTuple):
    """A system whose closed contacts hold both ways, its factorisation, and the rows of these contacts."""

    system: AbstractSystem
    factor: Factorisation
    pushing: tuple[int, ...]


def held(system: AbstractSystem, state: State, rank: ArrayLike | None, factor: Factorisation | None) -> Held:
    """The system, of one with one-sided contacts that without those that are open or lift."""
    if not system.names.one_sided:
        return Held(*dense_at(system, state, rank, factor), ())
    return _closed(system, state, analyze(system, state), rank, factor)


def analyzed(
    system: AbstractSystem,
    state: State,
    rank: ArrayLike | None,
    factor: Factorisation | None,
    *,
    closure: AbstractClosure = _MINIMUM_NORM,
    sense: ByName | None = None,
) -> tuple[Held, Report]:
    """The same, and the report of the system."""
    if system.names.one_sided:
        report = analyze(system, state, closure=closure, sense=sense)
        return _closed(system, state, report, rank, factor), report
    at = held(system, state, rank, factor)
    return at, analyze(at.system, state, closure=closure, sense=sense, factor=at.factor)


def _closed(
    system: AbstractSystem, state: State, report: Report, rank: ArrayLike | None, factor: Factorisation | None
) -> Held:
    names = system.names
    if rank is not None or factor is not None:
        raise RedundaxError(
            f"Arguments `rank` and `factor` must be left out where contacts are one-sided, "
            f"{', '.join(names.contacts)}: which of them are closed decides both."
        )
    closed = np.array([report.contacts[name] not in (Contact.open, Contact.lifts) for name in names.contacts])
    rows, kept = np.array(names.one_sided, int), rows_that_hold(names, closed, closed)
    return Held(*dense_at(as_held(system, kept), state, None, None), tuple(rows[closed].tolist()))


def pulling_rows(
    multipliers: Float[np.ndarray, "solutions m"], pushing: tuple[int, ...]
) -> Bool[np.ndarray, "solutions c"]:
    """Which contacts would pull in solutions."""
    size = np.abs(np.nan_to_num(multipliers)).max(axis=1, initial=0.0)
    return multipliers[:, list(pushing)] < -_PULLS * size[:, None]
