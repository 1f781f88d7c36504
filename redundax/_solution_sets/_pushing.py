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
from .._system._contact import Contact, refuse_declared, rows_closed
from .._system._names import ByName
from .._system._state import State
from .._system._system import AbstractSystem

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
    lifting: bool = False,
) -> tuple[Held, Report]:
    """The same, and the report of the system; with `lifting` with the contacts that lift, which other loads close."""
    if system.names.one_sided:
        report = analyze(system, state, closure=closure, sense=sense)
        at = _closed(system, state, report, rank, factor, lifting=lifting)
        if lifting and Contact.lifts in report.contacts.values():
            report = analyze(at.system, state, closure=closure, sense=sense, factor=at.factor)
        return at, report
    at = held(system, state, rank, factor)
    return at, analyze(at.system, state, closure=closure, sense=sense, factor=at.factor)


def _closed(
    system: AbstractSystem,
    state: State,
    report: Report,
    rank: ArrayLike | None,
    factor: Factorisation | None,
    *,
    lifting: bool = False,
) -> Held:
    names, contacts = system.names, report.contacts
    refuse_declared(names, rank=rank, factor=factor)
    if lifting:
        contacts = {name: Contact.touches if does == Contact.lifts else does for name, does in contacts.items()}
    closed, kept = rows_closed(names, contacts)
    rows = np.array(names.one_sided, int)[closed]
    return Held(*dense_at(as_held(system, kept), state, None, None), tuple(rows.tolist()))


def pulling_rows(
    multipliers: Float[np.ndarray, "solutions m"], pushing: tuple[int, ...]
) -> Bool[np.ndarray, "solutions c"]:
    """Which contacts would pull in solutions."""
    size = np.abs(np.nan_to_num(multipliers)).max(axis=1, initial=0.0)
    return multipliers[:, list(pushing)] < -_PULLS * size[:, None]
