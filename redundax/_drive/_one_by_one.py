"""Times of a driven motion that are asked of `solve` one by one: what a batch leaves open, joints with play, and
contacts that would pull where they are held.

Where laws decide the motion by themselves contacts come and go with it, and push where they are closed. Else those that
are closed at the start are held both ways along the motion, which is right as long as all of them push. Where one would
pull it opens: either others keep it closed and carry its share, or it lifts, and the laws no longer say how its parts
move. Contacts that are open are left out until one would be reached.
"""

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from .._closures._closure import AbstractClosure
from .._equations._gaps import model_of_all, overlaps
from .._equations._scaling import largest_violation
from .._solve._contacts import CLEAR, contacts_at
from .._solve._solution import Solution
from .._solve._solve import solve
from .._system._contact import LEFT_OUT, UNKNOWN, Contact, code_of, rows_that_hold
from .._system._driven import Driven
from .._system._names import Names
from .._system._pushing import pulls_of
from .._system._results import RESULTS, result_codes
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError
from .._tools._module import on_device, replace_fields
from .._tools._numbers import as_arrays, as_program, computed, tolerance_of
from .._tools._waiting import telling_of
from ._along import Path, between, instant, scaled
from ._run import Run
from ._senses import Senses, never_slip

_RESTS = 1e-9, 1e3  # of the largest acceleration, at least so many roundings: none


class Held(NamedTuple):
    """The names of a system, and which of its contacts hold both ways along a motion; others are left out."""

    names: Names
    contacts: Bool[np.ndarray, " contacts"]

    @property
    def rows(self) -> tuple[int, ...]:
        """The one-sided rows that hold."""
        return tuple(itertools.compress(self.names.one_sided, self.contacts))

    @property
    def open_rows(self) -> tuple[int, ...]:
        """Those that are left out."""
        return tuple(itertools.compress(self.names.one_sided, ~self.contacts))


def as_closed(system: AbstractSystem, held: Held) -> AbstractSystem:
    """The system with these contacts alone, which are told where they pull."""
    names = held.names
    if not names.one_sided:
        return system
    if not held.contacts.all():
        system = system.opened(on_device(rows_that_hold(names, held.contacts, held.contacts)))
    pushing = tuple(sorted({*names.pushing, *held.rows} - {*held.open_rows}))
    return _named(system, dataclasses.replace(names, pushing=pushing, one_sided=(), tied=()))


def none_held(system: AbstractSystem) -> Held:
    """A motion along which no contact holds."""
    return Held(system.names, np.zeros(len(system.names.one_sided), bool))


def held_at(system: AbstractSystem, start: State) -> Held:
    """One along which those hold that are closed at its start."""
    return Held(system.names, np.asarray(_gaps(system, start)) <= 0)


@computed
def _gaps(system: AbstractSystem, state: State) -> Float[Array, " contacts"]:
    """Gaps beyond what closed contacts have by rounding, relative to the size of the system."""
    return -overlaps(system, state) - largest_violation(state.q.dtype)


def until_reached(system: AbstractSystem, held: Held, path: Path, throw: bool | None) -> tuple[Path, tuple[str, ...]]:
    """A motion up to where a contact that is open at its start would be reached, and words on that."""
    open_rows = list(held.open_rows)
    if not open_rows:
        return path, ()

    def over(path: Path) -> Float[np.ndarray, "times rows"]:
        at = np.asarray(_constraints(system.anonymous, jnp.asarray(path.q), path.t))[:, open_rows]
        return at / np.asarray(path.scale.rows)[open_rows] / float(path.scale.size)

    limit = largest_violation(path.q.dtype)
    finer, k = _first_beyond(path, over, limit)
    if k is None:
        return path, ()
    reached = [system.rows.labels[row] for row, far in zip(open_rows, over(finer)[k], strict=True) if far > limit]

    def is_reached(finer: Path) -> Callable[[int], bool]:
        far = over(finer)
        return lambda j: bool(np.any(far[j] > 0))

    t = instant(finer, k, is_reached) if k else float(np.asarray(path.t)[0])
    said = f"Contacts are reached at t = {t:.6g}: {', '.join(reached)}."
    if throw is not False:
        raise NoSolutionError(
            f"{said} End the motion before. With `throw=False` it is given up to there, and NaN beyond."
        )
    return path._replace(q=jnp.where((np.asarray(path.t) < t)[:, None], path.q, jnp.nan)), (said,)


def _first_beyond(
    path: Path, over: Callable[[Path], Float[np.ndarray, "times rows"]], limit: float
) -> tuple[Path, int | None]:
    """The first time at which contacts are gone into, None if there is none, and the path it is a time of: a finer one
    where that is between two times only, as may be where overlaps rise and fall again, and tangents pass the limit."""
    t, far = np.asarray(path.t), over(path)
    beyond = (far > limit).any(axis=1)
    last = int(np.argmax(beyond)) if beyond.any() else None
    if len(t) > 1:
        rates = np.gradient(far, t, axis=0, edge_order=2 if len(t) > 2 else 1)
        (a, b), (c, d) = (far[:-1], far[1:]), (rates[:-1], rates[1:])
        rises = (c > 0) & (d < 0)
        meet = (b - a - d * np.diff(t)[:, None]) / np.where(rises, c - d, 1.0)
        looked_at = np.any(rises & (a + c * meet > limit), axis=1)[:last]
        for k in np.flatnonzero(looked_at).tolist():
            finer = between(path, path.q[k], t[k], t[k + 1])
            within = (over(finer) > limit).any(axis=1)
            if within.any():
                return finer, int(np.argmax(within))
    return path, last


def driven_by(path: Path, base: AbstractSystem) -> AbstractSystem:
    """A system with the drives of a motion."""
    return replace_fields(path.system, base=base) if isinstance(path.system, Driven) else base


class Touching(NamedTuple):
    """Contacts that are closed at some times of a motion that laws decide by themselves: these, the motion with them
    held, and when that is."""

    held: Held
    path: Path
    at: Bool[np.ndarray, " times"]


def touching(system: AbstractSystem, start: State, path: Path, run: Run) -> tuple[Touching, ...]:
    """Which contacts of a system are closed when, on the path that laws give without them."""
    at, found = (jnp.asarray(x) for x in (run.q, run.qd, run.t)), []
    closed = np.asarray(_closed(system.anonymous, *at))
    for own in np.unique(closed[closed.any(axis=1)], axis=0):
        held = Held(system.names, own)
        with_these = driven_by(path, as_closed(system.whole, held))
        again = path._replace(system=with_these, scale=scaled(with_these, start)[0])
        found.append(Touching(held, again, (closed == own).all(axis=1)))
    return tuple(found)


def with_codes(run: Run, system: AbstractSystem) -> Run:
    """A run with what its contacts do, and no rounding of a load where they are open."""
    rows, lam = list(system.names.one_sided), np.array(run.multipliers)
    closed = np.asarray(_closed(system.anonymous, *(jnp.asarray(x) for x in (run.q, run.qd, run.t))))
    carries = lam[:, rows] > CLEAR * np.abs(lam).max(axis=1, keepdims=True)
    codes = np.where(
        closed, np.where(carries, *map(code_of, (Contact.carries, Contact.touches))), code_of(Contact.open)
    )
    answered = np.isfinite(lam).all(axis=1, keepdims=True)
    lam[:, rows] = np.where(closed | ~answered, lam[:, rows], 0.0)
    return replace_fields(run, multipliers=lam, contact=np.where(answered, codes, UNKNOWN))


@as_program
def _closed(system: AbstractSystem, q: Array, qd: Array, t: Array) -> Bool[Array, "times contacts"]:
    """Those at rest relative to what is closed; where a motion ends as it strikes one, that is still open."""

    def of_one(q: Array, qd: Array, t: Array) -> Bool[Array, " contacts"]:
        state = State(q, qd, t)
        closed, (_, _, scales) = contacts_at(system, state)
        rate = model_of_all(system, state).motion.rate / scales.rows
        strikes = rate > largest_violation(rate.dtype) * jnp.max(jnp.abs(state.qd / scales.coordinates))
        return closed & ~strikes[np.array(system.names.one_sided)]

    return jax.vmap(of_one)(q, qd, t)


@as_program
def _constraints(system: AbstractSystem, q: Array, t: Array) -> Float[Array, "times m"]:
    return jax.vmap(system.constraint)(q, t)


def _named(system: AbstractSystem, names: Names) -> AbstractSystem:
    """A system without drives by other names, or with them."""
    if isinstance(system, Driven):
        return replace_fields(system, base=_named(system.base, names))
    return replace_fields(system, _names=names)


class Batch(NamedTuple):
    """What a batch answers: a run, at which of its times that is right, and the senses of slip."""

    run: Run
    good: Bool[Array, " times"]
    senses: Senses


def asked_again(
    path: Path,
    held: Held,
    closure: AbstractClosure,
    batch: Batch,
    ask: Callable[[Path], Batch] | None,
    throw: bool | None,
    times: Bool[np.ndarray, " times"],
) -> Run:
    """A run with answers where the batch, with contacts held, has none: contacts open there.

    - `ask`: gives the batch of a path; None where contacts may lift.
    - `times`: which of them are asked; others are not.
    """
    (run, good, senses), system = batch, cast(AbstractSystem, batch.run.system)
    before = {name: np.array(getattr(run.before, name)) for name in ("multipliers", "friction")}
    arrays = {name: np.array(getattr(run, name)) for name in (*before, "acceleration")}
    system = _without_friction(system, itertools.compress(system.slips.labels, never_slip(system, senses)))
    if held.rows:
        system = _named(system, held.names)
        for lam in (arrays["multipliers"], before["multipliers"]):
            good = good & ~pulls_of(lam, held.rows, system.rows.angular).any(axis=-1)
    if closure.clearances(system) is not None:
        good, run = np.zeros_like(good), replace_fields(run, stays=np.full_like(run.stays, np.nan))
    codes, t, remarks = np.full(len(good), result_codes()["successful"]), np.asarray(run.t), run.remarks

    def lifts(finer: Path) -> Callable[[int], bool]:
        there = cast(Callable[[Path], Batch], ask)(finer)
        return lambda j: bool(_lifting(held, _solutions(system, there, j, closure)[1]))

    for k in _told(np.flatnonzero(~good & times).tolist(), len(good)):
        codes[k], found = _solutions(system, batch, k, closure)
        lifting = _lifting(held, found)
        if lifting and ask is not None:
            said = _in_words(lifting, instant(path, k, lifts) if k else t[0])
            if throw is not False:
                raise NoSolutionError(
                    f"{said} {_remedy(run, k)}. With `throw=False` the motion up to there is given, and NaN beyond."
                )
            codes[k:], remarks = result_codes()["no_position"], (*remarks, said)
            for array in (*arrays.values(), *before.values()):
                array[k:] = np.nan
            break
        for side, into in enumerate((arrays, before)):
            for name, array in into.items():
                array[k] = np.nan if found is None else np.asarray(getattr(found[side], name))
    result = jax.tree.map(lambda _: codes, RESULTS.successful)
    before = replace_fields(run.before, **before)
    return replace_fields(run, **arrays, before=before, result=result, remarks=remarks)


def _without_friction(system: AbstractSystem, slips: Iterable[str]) -> AbstractSystem:
    """A system without friction of joints, by the labels of their slips, where these have names."""
    names = {name for label in slips for name in (label, label.rpartition(".")[0])}
    joints = names.intersection(system.names.joint_names)
    return system.rubbing(dict.fromkeys(joints, 0.0)) if joints else system


def _told(times: list[int], count: int) -> Iterator[int]:
    """Times that are asked one by one, of which it is told where they take long."""
    with telling_of(f"`solve` at {len(times)} of {count} times, one by one; fewer `ts` take less"):
        yield from times


def with_contacts(run: Run, own: Run, touch: Touching) -> Run:
    """A run of a motion without contacts, with what is so with them where they are closed. Where none of them pushes
    drives are as determined as without."""
    lam = np.abs(np.asarray(own.multipliers))
    pushes = ~(lam[:, list(touch.held.rows)] <= CLEAR * lam.max(axis=1, keepdims=True)).all(axis=1)  # NaN, too

    def chosen(at: np.ndarray, *names: str) -> dict[str, PyTree]:
        def put(a: Array, b: Array) -> np.ndarray:
            return np.where(at.reshape(-1, *[1] * (np.ndim(a) - 1)), a, b)

        return {name: jax.tree.map(put, getattr(own, name), getattr(run, name)) for name in names}

    loads = chosen(touch.at, "multipliers", "friction", "acceleration", "before", "result")
    told = chosen(touch.at & pushes, "determined", "determined_without_friction", "stays")
    return replace_fields(run, **loads, **told)


def _solutions(
    system: AbstractSystem, batch: Batch, k: int, closure: AbstractClosure
) -> tuple[int, tuple[Solution, Solution] | None]:
    """How a time ends, and its solutions after and before."""
    run, senses = batch.run, batch.senses.both[k]
    if not np.all(np.isfinite(run.q[k])):
        return result_codes()["no_position"], None
    state = as_arrays(State(run.q[k], run.qd[k], np.asarray(run.t)[k]))
    ways = senses[:1] if np.array_equal(*senses) else senses
    found = [solve(system, state, closure=closure, sense=jnp.asarray(sense), throw=False) for sense in ways]
    return max(int(jax.tree.leaves(one.result)[0]) for one in found), (found[0], found[-1])


def _lifting(held: Held, found: tuple[Solution, Solution] | None) -> tuple[str, ...]:
    """Contacts that open and stay so in one of the solutions."""
    if found is None or not held.rows:
        return ()
    left = np.any([np.isin(np.asarray(one.contact), LEFT_OUT) for one in found], axis=0)
    return tuple(itertools.compress(held.names.contacts, left & held.contacts))


def _in_words(lifting: tuple[str, ...], t: float) -> str:
    return (
        f"Contacts lift at t = {t:.6g}: {', '.join(lifting)}. They could only pull there, and the laws no longer say "
        "how their parts move."
    )


def _remedy(run: Run, k: int) -> str:
    """What keeps contacts closed: where all rests, no slower motion does."""
    sizes = np.abs(np.asarray(run.acceleration)).max(axis=1)
    rests = not np.any(run.qd[k]) and not sizes[k] > tolerance_of(_RESTS, sizes) * np.nanmax(sizes, initial=0.0)
    return "Press them together" if rests else "Press them together, or move more slowly"
