"""Which one-sided contacts carry: an active set of rows outside, the equations (7), (25) inside.

A one-sided row has a gap -Phi, and a multiplier p that pushes. Where it is closed and at rest relative to it,

    0 <= p   _|_   gamma - Phi_q qdd >= 0,

which is Gauss' principle: accelerations are unique for regular mass without friction. Among several redundant
contacts the closure (W, d) decides as stiff joints do: the loads are nearest in its compliance among those that push,

    minimum over lam of lam^T W lam / 2 - d^T lam,   p >= 0,

whose conditions are 0 <= p _|_ s >= 0 with s = W lam - d - Phi_q u, u the displacement at which the closed rows have
none. A row that does not push is left out of Phi, and all else is solved as it is. Rows change one at a time (Murty's
principal pivoting, which ends at the one answer that there is without friction; with it sets may go round, and none is
where it begins once more). Rows that are held where they would
pull may jam with friction as no contact does: of a set without solution the loads of one sweep say which row does not
push, of each row once.

Rows of velocity may be tied to a contact, as those of a wheel: they hold while it carries or touches, however large
their force, and are left out where it lifts or is open. That is friction without bound, with which there may be no
answer and several.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._closures._closure import Elasticity, without_rows
from .._equations._factorisation import Factorisation, factorised
from .._equations._gaps import model_of_all
from .._equations._kinematics import Model
from .._equations._scaling import Scaling, largest_violation, scaling
from .._system._contact import Contact, code_of, rows_that_hold
from .._system._results import RESULTS, differs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import Numeric, or_one, stop_gradient, take, while_loop, xp

CLEAR = 1e-9  # a share of the largest force or acceleration that is a sign, and no rounding of a solve
OUTSIDE = 1e-6  # a part of a row that is outside the others: far above rounding of a projector, far below a lever arm


class ActiveSet(NamedTuple):
    """Which rows are kept, how many changed, whether they are final, what each contact does, as a number, and which
    contacts move with the rows that are kept."""

    kept: Bool[Array, " m"]
    changes: Int[Array, ""]
    settled: Bool[Array, ""]
    contacts: Int[Array, " c"] | None
    decided: Bool[Array, " c"] | None


def all_kept(m: int) -> ActiveSet:
    """That of a system without contacts."""
    return ActiveSet(xp.ones(m, bool), xp.zeros((), int), xp.ones((), bool), None, None)


def with_rows(elasticity: Elasticity, kept: Bool[Array, " m"], of_all: Elasticity) -> Elasticity:
    """The closure of the rows that are kept, and that of all beside them."""
    pairs = zip((kept[:, None] & kept, kept), elasticity, of_all, strict=True)
    return Elasticity(*(xp.where(both, own, other) for both, own, other in pairs))


def as_held(system: AbstractSystem, kept: Bool[Numeric, " m"]) -> AbstractSystem:
    """The system whose kept contacts hold both ways, and whose others are open."""
    names = dataclasses.replace(system.names, pushing=(), one_sided=())
    return replace_fields(system, _names=names).opened(xp.asarray(kept))


class _Step(NamedTuple):
    """The active set on its way: contacts whose row is kept, those whose tied rows are, and those left out of sets that
    had no solution; and whether sets went round."""

    loaded: Bool[Array, " c"]
    rolling: Bool[Array, " c"]
    parted: Bool[Array, " c"]
    went_round: Bool[Array, ""]
    changes: Int[Array, ""]
    goes_on: Bool[Array, ""]
    settled: Bool[Array, ""]
    contacts: Int[Array, " c"]
    decided: Bool[Array, " c"]


class Asked(NamedTuple):
    """What is asked of an active set, if not that of accelerations at rest relative to what is closed.

    - `closed`: which contacts are.
    - `loaded`: those that it begins with.
    - `at`: Phi_q, what Phi_q x is, of closed rows at most, and the scales of all rows.
    - `lets_go`: whether what touches without load, and no other row holds, is open from there on, with what is tied.
    - `taken`: share of accelerations by which others take a contact away beyond rounding.
    """

    closed: Bool[Array, " c"]
    loaded: Bool[Array, " c"]
    at: tuple[Array, Array, Scaling]
    lets_go: Bool[Array, ""]
    taken: Float[Array, ""] | float


@runtime_checkable
class Solved(Protocol):
    """What a solve gives: accelerations and multipliers, and how it ended."""

    @property
    def acceleration(self) -> Array: ...
    @property
    def multipliers(self) -> Array: ...
    @property
    def result(self) -> RESULTS: ...


S = TypeVar("S")


def of_rows(
    solved: Callable[..., tuple[S, Elasticity, Array]],
    done: dict[bytes, tuple[Factorisation, S, Elasticity, Array]] | None,
) -> Callable[..., tuple[Factorisation, S, Elasticity, Array]]:
    """The factorisation of the rows that are kept and what `solved(opened, state, factor, elasticity, ...)` gives with
    it: the solution, the closure that it has, and whether that is found. Where friction has no solution, one sweep may
    stand in its place. Of known numbers each set is solved once, and `done` holds those that are."""

    def of_set(
        system: AbstractSystem, state: State, elasticity: Elasticity, kept: Numeric, *more: PyTree
    ) -> tuple[Factorisation, S, Elasticity, Array]:
        key = b"" if done is None else kept.tobytes()
        if done and key in done:
            return done[key]
        opened = system.opened(kept) if system.names.one_sided else system
        factor = factorised(opened, state, None)
        found = factor, *solved(opened, state, factor, without_rows(elasticity, kept), *more)
        if done is not None:
            done[key] = found
        return found

    return of_set


def active_set(
    system: AbstractSystem,
    state: State,
    elasticity: Elasticity,
    of_set: Callable[..., tuple[Factorisation, Solved, Elasticity, Array]],
    asked: Asked | None = None,
) -> ActiveSet:
    """The rows that are kept, by `of_rows`. It has no derivatives: those of a solution are at a fixed active set."""
    system, state, elasticity, asked = stop_gradient((system, state, elasticity, asked))
    names = system.names
    rows, has_tied = np.array(names.one_sided), np.array([bool(tied) for tied in names.tied] or [False])
    if asked is None:
        closed, at = contacts_at(system, state)
        asked = Asked(closed, closed, at, xp.zeros((), bool), largest_violation(state.qd.dtype))
    closed, at = asked.closed, asked.at
    half = 4 * rows.size + 4

    def body(step: _Step) -> _Step:
        kept = rows_that_hold(names, step.loaded, step.rolling)
        factor, solution, bent, found = of_set(system, state, elasticity, kept)
        bent = with_rows(bent, kept, elasticity)
        wrong, contradicts, does, decided = signs(rows, closed, kept, at, (factor, solution, bent), asked.taken)
        jams = ~differs(solution.result, RESULTS.no_solution_found) & ~contradicts
        wrong = xp.where(jams & ~(step.loaded & ~step.parted), -1.0, wrong)
        # The worst first; then the first, which cannot go round in circles without friction; from none the last.
        first, last = xp.argmax(wrong > 0), rows.size - 1 - xp.argmax(wrong[::-1] > 0)
        place = xp.where(step.changes < 2 * rows.size, xp.argmax(wrong), xp.where(step.changes < half, first, last))
        flip = (xp.asarray(np.arange(rows.size)) == place) & xp.any(wrong > 0)
        went_round = step.went_round | (xp.any(flip) & (step.changes == half - 1))
        again = (step.changes < half) & xp.where(xp.any(flip), went_round, jams)  # from none
        loaded = (step.loaded ^ flip) & ~again
        # What is tied goes with its row as that changes, and, where none does, stays with contacts that touch.
        touching = (does == code_of(Contact.touches)) | (does == code_of(Contact.carries))
        touching = touching & (~asked.lets_go | step.loaded | decided)
        rolling = xp.where(xp.any(flip), xp.where(flip, loaded, step.rolling), touching) & xp.asarray(has_tied) & ~again
        failed = (~found | differs(solution.result, RESULTS.successful)) & ~contradicts & ~jams
        settled = (~xp.any(flip | (rolling ^ step.rolling)) & ~again) | failed
        changes = xp.where(again & ~settled, half, step.changes + xp.where(settled, 0, 1))
        loaded, rolling = xp.where(settled, step.loaded, loaded), xp.where(settled, step.rolling, rolling)
        parted = (step.parted | (flip & jams)) & ~again
        goes_on, settled = ~settled & (changes < 2 * half), settled & ~(went_round & jams)
        return _Step(loaded, rolling, parted, went_round, changes, goes_on, settled, does, decided)

    start = asked.loaded, xp.where(asked.lets_go, asked.loaded, closed) & xp.asarray(has_tied)
    none, yes = xp.zeros((), int), xp.ones((), bool)
    begin = _Step(*start, closed & ~closed, ~yes, none, yes, ~yes, xp.zeros(rows.size, int), closed)
    end = while_loop(lambda step: step.goes_on, body, begin)
    kept = rows_that_hold(names, end.loaded, end.rolling)
    return stop_gradient(ActiveSet(kept, end.changes, end.settled, end.contacts, end.decided))


def contacts_at(system: AbstractSystem, state: State) -> tuple[Bool[Array, " c"], tuple[Array, Array, Scaling]]:
    """Which contacts are closed at a state and at rest relative to it; Phi_q, gamma and the scales of all rows."""
    model = model_of_all(system, state)
    scales = scaling(system, model)
    closed = take(_closed(model, scales, state), np.array(system.names.one_sided))
    return closed, (model.jacobian, model.motion.gamma, scales)


def have_no_gap(model: Model, scales: Scaling) -> Bool[Array, " m"]:
    """Which rows have none but what a state may be off the constraints: one decision of `solve` and of motions."""
    value = scales.violations(model.motion.value)
    return value > -largest_violation(value.dtype)


def _closed(model: Model, scales: Scaling, state: State) -> Bool[Array, " m"]:
    """Which rows have neither a gap nor a velocity that opens one, relative to velocities and to those that loads cause
    over the size of the mechanism: what is left of a motion that has come to rest opens none."""
    tolerance, mass = largest_violation(state.qd.dtype), xp.diagonal(model.mass)
    pulled = xp.where(mass > 0, model.load / or_one(mass), 0.0)
    reach, speed = (xp.max(xp.abs(x / scales.coordinates), initial=0.0) for x in (pulled, state.qd))
    speed = speed + xp.sqrt(reach * scales.size)
    return have_no_gap(model, scales) & (model.motion.rate / scales.rows >= -tolerance * speed)


class Signs(NamedTuple):
    """What a set of rows says of contacts.

    - `wrong`: relative and positive where they must change.
    - `contradicts`: whether others take some away that are kept, which are the wrong ones then.
    - `does`: what each does, as a number.
    - `decided`: which move with the rows that are kept.
    """

    wrong: Float[Array, " c"]
    contradicts: Bool[Array, ""]
    does: Int[Array, " c"]
    decided: Bool[Array, " c"]


def signs(
    rows: np.ndarray,
    closed: Bool[Array, " c"],
    all_kept: Bool[Array, " m"],
    at: tuple[Array, Array, Scaling],
    found: tuple[Factorisation, Solved, Elasticity],
    taken: Float[Array, ""] | float | None = None,
) -> Signs:
    """Those of contacts; `at` is Phi_q, gamma and the scales, `found` the factorisation, solution and closure of the
    rows that are kept.

    Where others take away a contact that is kept, rows that give way a little would have forces beyond all others,
    along P gamma.
    """
    (jacobian, gamma, scales), (factor, solution, elasticity) = at, found
    kept, size = take(all_kept, rows), size_along(at, factor, solution)
    force = scales.rows * solution.multipliers
    force = take(force, rows) / or_one(xp.max(xp.abs(force)))
    into = (jacobian @ solution.acceleration - gamma) / scales.rows  # how the rows close
    into = take(into, rows) / or_one(size)
    bent = elasticity.compliance @ solution.multipliers - elasticity.misfit
    strain, free = strains(rows, all_kept, jacobian, factor, bent)
    strain = strain / or_one(xp.max(xp.abs(bent)))
    turned = take(xp.linalg.norm(jacobian * factor.scaling.coordinates, axis=1), rows)
    decided = xp.linalg.norm(free, axis=1) / or_one(turned) < OUTSIDE  # by the other rows: it moves with them
    # Positions may be off by as much, and what they prescribe is.
    taken = largest_violation(into.dtype) if taken is None else taken
    together = decided & (into > -taken)  # else these take it away, however little they give
    pulls, closes = -force, xp.where(together, xp.maximum(into, -strain), into)
    wrong = xp.where(closed, xp.where(kept, pulls, closes), -1.0)
    carries, lifts = kept & (force > CLEAR), ~kept & (into < -CLEAR)
    opened, lifted, touching, loaded = map(code_of, Contact)
    code = xp.where(carries, loaded, xp.where(lifts, lifted, touching))
    # `solve` has none where it refuses the contradiction.
    size = xp.where(xp.isfinite(size), size, size_along(at, factor, factor))
    off = take(contradicted(all_kept, at, factor), rows) / or_one(size)
    off = xp.where(closed & kept & (off > taken), off, -1.0)
    contradicts = xp.any(off > 0)
    wrong = xp.where(contradicts, off, xp.where(wrong > CLEAR, wrong, -1.0))
    return Signs(wrong, contradicts, xp.where(closed, code, opened), decided)


def contradicted(
    kept: Bool[Array, " m"], at: tuple[Array, Array, Scaling], factor: Factorisation
) -> Float[Array, " m"]:
    """The part of gamma that no acceleration meets, P gamma, of rows that are kept."""
    (_, gamma, scales), own = at, factor.scaling
    return own.rows / scales.rows * (factor.split.stress @ xp.where(kept, gamma / own.rows, 0.0))


def size_along(
    at: tuple[Array, Array, Scaling], factor: Factorisation, solution: Solved | Factorisation
) -> Float[Array, ""]:
    """The largest sum of the parts of an acceleration along a row, which may cancel in it."""
    jacobian, gamma, scales = at
    pulled, mass = xp.abs(jacobian).T @ xp.abs(solution.multipliers), xp.diagonal(factor.mass)
    parts = xp.abs(solution.acceleration) + xp.where(mass > 0, pulled / or_one(mass), 0.0)
    return xp.max((xp.abs(jacobian) @ parts + xp.abs(gamma)) / scales.rows)


def strains(
    rows: np.ndarray,
    all_kept: Bool[Array, " m"],
    jacobian: Float[Array, "m n"],
    factor: Factorisation,
    bent: Float[Array, " m"],
) -> tuple[Float[Array, " c"], Float[Array, "c n"]]:
    """What is left between contacts beside what gives way of the rows that are kept, negative where it closes, `bent`
    being W lam - d of all; and by how much each closes as what these leave free moves."""
    own = factor.scaling
    u = own.coordinates * (factor.split.inverse @ (xp.where(all_kept, bent, 0.0) / own.rows))
    return take(bent - jacobian @ u, rows), take((jacobian * own.coordinates) @ factor.split.motion, rows)
