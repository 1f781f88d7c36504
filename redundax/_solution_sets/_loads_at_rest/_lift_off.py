"""Which contacts lose their load, in which order, as a load grows.

Without friction all is affine in the amount s of the load as long as the same contacts carry,

    lam = lam_0 + s lam_1,   qdd = a_0 + s a_1,   lam nearest in the closure's compliance,

so the amount at which the next contact changes is a quotient: where the load of one that carries, the strain of one
that touches or the acceleration of one that lifts passes zero. The active set a little beyond says what all do from
there on.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..._analysis._outputs import plain
from ..._bodies._loads import AbstractLoad
from ..._closures._closure import AbstractClosure, Elasticity, MinimumNorm, check_closure, elasticity, without_rows
from ..._equations._factorisation import Factorisation, factorised
from ..._equations._scaling import Scaling, largest_violation
from ..._solve._contacts import ActiveSet, Asked, active_set, contacts_at, strains
from ..._solve._solve import solve
from ..._system._contact import Contact, code_of, words
from ..._system._names import ByName
from ..._system._results import RESULTS
from ..._system._state import State
from ..._system._system import AbstractSystem, check_system_at
from ..._tools._errors import NoSolutionError, RedundaxError
from ..._tools._json import JSON
from ..._tools._numbers import Numeric, as_numbers, or_one, xp
from ..._tools._questions import question
from ..._tools._table import text_of
from ._added_load import added_load, load_in_words, named_load

_MINIMUM_NORM = MinimumNorm()
_BEYOND = 1e-6  # of the amounts: how far beyond a change it is asked what contacts do
_FLAT = 1e-9  # of the largest change of its kind: one that is rounding
_MOST = 8  # changes of each contact, more than which go round in circles
_LIFTS, _TOUCHES = code_of(Contact.lifts), code_of(Contact.touches)


@dataclasses.dataclass(frozen=True)
class LiftOff:
    """What contacts do as a load grows, until one lifts. `str()` gives a page, `to_dict()` data.

    - `load`, `units`: the load of amount 1, by name of coordinate, and the units of its forces and moments.
    - `amounts`: those at which contacts change, in order, shape (changes,).
    - `contacts`: what each does, by name, from no load on and from each of these amounts on; one more than there are.
    - `loads`: the multiplier of each, by name, without the load and at each of these amounts.
    - `tips`: the amount from which a contact lifts, so that it no longer stands: the last of `amounts`; infinite where
      none does, however large the load.
    - `closure`: the name of its class.

    ??? example

        ```python
        top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
        corners = {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
        feet = [
            rx.spatial.PointOnPlane(name, top, "ground", (*at, 0.0), one_sided=True) for name, at in corners.items()
        ]
        table = rx.Mechanism([top], feet, gravity=(0.0, 0.0, -9.81))
        legs = rx.ElasticJoints(table, {"f1": 1e-6, "f2": 2e-6, "f3": 1e-6, "f4": 1e-6})  # m/N
        push = rx.spatial.AppliedForce(top, force=(0.0, 0.0, -1.0), point=(0.6, 0.4, 0.7))
        found = rx.lift_off(table, rx.assemble(table), push, legs)
        found.first, found.first_amount  # the foot that loses its load first, and at which push
        ```
    """

    load: dict[str, float]
    units: tuple[str, ...]
    amounts: np.ndarray
    contacts: tuple[dict[str, str], ...]
    loads: tuple[dict[str, float], ...]
    tips: float
    closure: str

    @property
    def first(self) -> tuple[str, ...]:
        """Names of the contacts that lose their load first, of several at once all; none where none does."""
        return next((gone for k in range(len(self.amounts)) if (gone := self._unloaded(k))), ())

    @property
    def first_amount(self) -> float:
        """The amount at which they do; infinite where none does. At smaller ones of `amounts` others gain load."""
        return next((float(amount) for k, amount in enumerate(self.amounts) if self._unloaded(k)), np.inf)

    def _unloaded(self, k: int) -> tuple[str, ...]:
        """Those that lose their load at a change."""
        before, after = self.contacts[k : k + 2]
        return tuple(name for name, does in after.items() if before[name] == "carries" != does)

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; infinities become None."""
        return {field.name: plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def __str__(self) -> str:
        lines = [load_in_words(self.load, self.units), f"{self.closure}", f"At 0: {self._loads(0)}"]
        for k, amount in enumerate(self.amounts):
            before, after = self.contacts[k : k + 2]
            changed = [f"{name} {does}" for name, does in after.items() if does != before[name]]
            lines.append(f"From {amount:.6g}: {', '.join(changed)}; {self._loads(k + 1)}")
        lines += ["No contact lifts, however large it is"] * bool(np.isinf(self.tips))
        return text_of(lines)

    def _loads(self, k: int) -> str:
        """Of the contacts that carry from an amount on."""
        carried = [name for name, does in self.contacts[k].items() if does == "carries"]
        return ", ".join(f"{name} {self.loads[k][name]:.6g}" for name in carried) or "none carries"


class _Solution(NamedTuple):
    """Accelerations and multipliers at an amount."""

    acceleration: Numeric
    multipliers: Numeric
    result: RESULTS


class _Set(NamedTuple):
    """The equations of the contacts that are kept: the load of amount 1, and qdd and lam without it and by it."""

    factor: Factorisation
    closure: Elasticity
    force: Numeric
    acceleration: Numeric
    multipliers: Numeric
    found: bool

    def at(self, amount: float) -> _Solution:
        of = np.array([1.0, amount])
        return _Solution(self.acceleration @ of, self.multipliers @ of, as_numbers(RESULTS.successful))


@question
def lift_off(
    system: AbstractSystem, state: State, load: ByName | AbstractLoad, closure: AbstractClosure = _MINIMUM_NORM
) -> LiftOff:
    """Which contact lifts first as a load grows, and at which amount: all changes of contacts from none of it on, until
    one lifts and the mechanism tips.

    `limit_load` tells where it tips, whatever contacts are made of. Which of them lose their load before that depends
    on their stiffness and misfits, of which the closure is.

    ??? example

        ```python
        top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
        corners = {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
        feet = [
            rx.spatial.PointOnPlane(name, top, "ground", (*at, 0.0), one_sided=True) for name, at in corners.items()
        ]
        table = rx.Mechanism([top], feet, gravity=(0.0, 0.0, -9.81))
        legs = rx.ElasticJoints(table, {"f1": 1e-6, "f2": 2e-6, "f3": 1e-6, "f4": 1e-6})  # m/N
        push = rx.spatial.AppliedForce(top, force=(0.0, 0.0, -1.0), point=(0.6, 0.4, 0.7))
        found = rx.lift_off(table, rx.assemble(table), push, legs)
        print(found)
        ```

    **Arguments:**

    - `system`, `state`: concrete values; not inside `jit` or `vmap`. With one-sided contacts and without friction.
    - `load`: as of `limit_load`, beside the loads that there are. Those of the other sign are a call of their own.
    - `closure`: the loads that it picks, without play.

    **Returns:** a `types.LiftOff`.

    **Raises:** `ValueError` where there are no contacts, or friction or play; `RuntimeError` as `solve`.
    """
    check_system_at(system, state)
    check_closure(closure)
    _check(system, closure)
    force = added_load(system, state, load)
    begins = solve(system, state, closure=closure)
    course = _course(system, state, elasticity(closure, system, state), force, np.asarray(begins.contact))
    names, rows, (named, units) = system.names, list(system.names.one_sided), named_load(system, force)
    return LiftOff(
        load=named,
        units=units,
        amounts=np.array(course.amounts),
        contacts=tuple({name: str(does) for name, does in words(codes, names).items()} for codes in course.contacts),
        loads=tuple(dict(zip(names.contacts, own[rows].tolist(), strict=True)) for own in course.multipliers),
        tips=course.tips,
        closure=type(closure).__name__,
    )


class _Course(NamedTuple):
    """Amounts at which contacts change; what they do and multipliers, without the load and from each; and from which on
    one lifts."""

    amounts: list[float]
    contacts: list[Numeric]
    multipliers: list[Numeric]
    tips: float


def _course(system: AbstractSystem, state: State, chosen: Elasticity, force: Numeric, contacts: Numeric) -> _Course:
    """All changes until one lifts, from what contacts do without the load."""
    rows, (closed, at) = np.array(system.names.one_sided), contacts_at(system, state)
    sets, taken = dict[bytes, _Set](), largest_violation(state.qd.dtype)

    def of_rows(kept: Numeric) -> _Set:
        key = kept.tobytes()
        if key not in sets:
            sets[key] = _solved(system.opened(kept), state, without_rows(chosen, kept), force)
        return sets[key]

    def from_on(amount: float) -> ActiveSet:
        def of_set(_: object, __: object, ___: object, kept: Numeric) -> tuple:
            own = of_rows(kept)
            return own.factor, own.at(amount), own.closure, np.bool_(own.found)

        active = active_set(system, state, chosen, of_set, Asked(closed, closed, at, xp.zeros((), bool), taken))
        if not active.settled:
            raise NoSolutionError(RESULTS[RESULTS.contacts_undecided])
        return active

    def loads_at(active: ActiveSet, amount: float) -> Numeric:
        loads = of_rows(active.kept).at(amount).multipliers
        return np.where(np.abs(loads) < _FLAT * np.abs(loads).max(initial=0.0), 0.0, loads)

    lifted = [name for name, code in zip(system.names.contacts, contacts, strict=True) if code == _LIFTS]
    if lifted:
        raise NoSolutionError(
            f"Contacts lift without the load, {', '.join(lifted)}, so that it does not stand. Take away what tips it."
        )
    of_all = of_rows(np.ones(len(system.rows), bool)).factor
    scale = float(np.abs(as_numbers(of_all.load)).max(initial=0.0)) / or_one(float(np.abs(force).max(initial=0.0)))
    course, following = _Course([], [contacts], [loads_at(from_on(0.0), 0.0)], np.inf), 0.0
    for _ in range(_MOST * rows.size):
        amount = following + _BEYOND * or_one(max(following, scale))
        active = from_on(amount)
        does = np.asarray(active.contacts)
        if np.any(does != course.contacts[-1]):
            course.amounts.append(following)
            course.contacts.append(does)
            course.multipliers.append(loads_at(active, following))
        if np.any(does == _LIFTS):
            return course._replace(tips=following)
        own = of_rows(active.kept)
        start, slope = np.where(closed, _margins(own, active, at, rows, chosen), 0.0)
        falls = slope < -_FLAT
        ends = [*(-start[falls] / slope[falls]), _together_until(own, active, at, rows, chosen)]
        following = max(float(np.min(ends)), following)
        if np.isinf(following):
            return course
    raise NoSolutionError(RESULTS[RESULTS.contacts_undecided])


def _check(system: AbstractSystem, closure: AbstractClosure) -> None:
    if not system.names.one_sided:
        raise RedundaxError(
            "Argument `system` must have one-sided contacts, but has none. Give joints `one_sided=True`; what those "
            "that hold both ways carry under a load `solve` tells."
        )
    if system.friction:
        raise RedundaxError(
            "Argument `system` must have no friction, but has: joints that rub hold loads within limits, not one. Ask "
            "`limit_load`, or hold parts by joints without friction."
        )
    if closure.clearances(system) is not None:
        raise RedundaxError("Argument `closure` must have no play, but has. Leave it out; `solve` takes it.")


def _solved(system: AbstractSystem, state: State, chosen: Elasticity, force: Numeric) -> _Set:
    factor = factorised(system, state, None)
    pick, definiteness = factor.close(chosen.compliance)
    gamma = xp.stack([factor.gamma, xp.zeros_like(factor.gamma)], axis=1)
    a, lam = factor.respond(xp.stack([factor.load, force], axis=1), gamma)
    lam = pick(lam) + xp.stack([pick.caused(chosen.misfit), xp.zeros_like(factor.gamma)], axis=1)
    return _Set(factor, chosen, force, a, lam, bool(definiteness.is_yes) and bool(np.isfinite(lam).all()))


def _margins(
    own: _Set, active: ActiveSet, at: tuple[Numeric, Numeric, Scaling], rows: Numeric, closure: Elasticity
) -> Numeric:
    """What contacts have left until they change, without the load and by its amount 1, shape (2, c), relative to what
    the load does: loads of those that carry, strains of those that touch, accelerations by which others lift."""
    (jacobian, gamma, scales), mass = at, np.diagonal(own.factor.mass)
    loads = scales.rows[:, None] * own.multipliers
    bent = _bent(own, closure)
    strain = np.stack([strains(rows, active.kept, jacobian, own.factor, one)[0] for one in bent.T])
    away = (np.stack([gamma, np.zeros_like(gamma)], axis=1) - jacobian @ own.acceleration) / scales.rows[:, None]
    free = np.abs(jacobian) @ np.where(mass > 0, np.abs(own.force) / or_one(mass), 0.0) / scales.rows
    least = _FLAT * np.abs(own.force * scales.coordinates).max(initial=0.0)  # of loads: less is rounding
    gives = least * np.abs(closure.compliance / scales.rows).max()
    parts = (loads[rows].T, loads, least), (strain, bent, gives), (away[rows].T, free[:, None], 0.0)
    carries, touches, lifts = (part / or_one(max(np.abs(size[:, -1]).max(), small)) for part, size, small in parts)
    return np.where(active.kept[rows], carries, np.where(np.asarray(active.decided), touches, lifts))


def _together_until(
    own: _Set, active: ActiveSet, at: tuple[Numeric, Numeric, Scaling], rows: Numeric, closure: Elasticity
) -> float:
    """Up to which amount those that touch, and could move by themselves, do so without load: as long as some
    displacement w that the others leave free keeps all of them apart, strain_0 + s strain_1 + F w >= 0."""
    touch = ~active.kept[rows] & ~np.asarray(active.decided) & (np.asarray(active.contacts) == _TOUCHES)
    if not touch.any():
        return np.inf
    bent = _bent(own, closure)
    (start, free), (slope, _) = (strains(rows, active.kept, at[0], own.factor, one) for one in bent.T)
    size, per = or_one(np.abs(bent[:, 0]).max()), or_one(np.abs(bent[:, 1]).max())
    columns = free[touch] / or_one(np.abs(free[touch]).max())
    from scipy.optimize import linprog  # here, because its import takes a second

    found = linprog(
        [-1.0, *np.zeros(columns.shape[1])],
        A_ub=-np.column_stack([slope[touch] / per, columns]),
        b_ub=start[touch] / size,
        bounds=[(0, None), *[(None, None)] * columns.shape[1]],
    )
    return float(found.x[0]) * size / per if found.status == 0 else np.inf if found.status == 3 else 0.0


def _bent(own: _Set, closure: Elasticity) -> Numeric:
    """What all rows give way, without the load and by its amount 1."""
    return closure.compliance @ own.multipliers - np.stack([closure.misfit, np.zeros_like(closure.misfit)], axis=1)
