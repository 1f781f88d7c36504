"""Contacts that only push: closed ones hold, and their multipliers are not negative."""

from typing import NamedTuple

import numpy as np

from .._analysis._report import Report
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solve._contacts import as_held
from .._system._contact import Contact, rows_that_hold
from .._system._state import State
from .._system._system import AbstractSystem


class Held(NamedTuple):
    """A system whose closed contacts hold both ways, its factorisation, and the rows of these contacts."""

    system: AbstractSystem
    factor: Factorisation
    pushing: tuple[int, ...]


def held(system: AbstractSystem, state: State, report: Report) -> Held:
    """The system of a report without the contacts that are open or lift."""
    closed = np.array([report.contacts[name] not in (Contact.open, Contact.lifts) for name in system.names.contacts])
    rows, kept = np.array(system.names.one_sided, int), rows_that_hold(system.names, closed, closed)
    system, factor = dense_at(as_held(system, kept), state, None, None)
    return Held(system, factor, tuple(rows[closed].tolist()))
