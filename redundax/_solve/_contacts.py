"""Which one-sided contacts carry: an active set of rows outside, the equations (7), (25) inside.

A one-sided row has a gap -Phi, and a multiplier p that pushes. Where it is closed and at rest relative to it,

    0 <= p   _|_   gamma - Phi_q qdd >= 0,

which is Gauss' principle: accelerations are unique for regular mass without friction. Among several redundant
contacts the closure (W, d) decides as stiff joints do: the loads are nearest in its compliance among those that push,

    minimum over lam of lam^T W lam / 2 - d^T lam,   p >= 0,

whose conditions are 0 <= p _|_ s >= 0 with s = W lam - d - Phi_q u, u the displacement at which the closed rows have
none. A row that does not push is left out of Phi, and all else is solved as it is. Rows change one at a time (Murty's
principal pivoting, which ends at the one answer that there is without friction).

Rows of velocity may be tied to a contact, as those of a wheel: they hold while it carries or touches, however large
their force, and are left out where it lifts or is open. That is friction without bound, with which there may be no
answer and several.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._closures._closure import Elasticity
from .._equations._factorisation import Factorisation, factorised
from .._equations._kinematics import Model, model_at
from .._equations._scaling import Scaling, largest_violation, scaling
from .._system._contact import Contact, code_of, rows_that_hold
from .._system._results import RESULTS, differs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import or_one, stop_gradient, take, while_loop, xp

_CLEAR = 1e-9  # a share of the largest force or acceleration that is a sign, and no rounding of a solve
_WITHIN = 1e-6  # a part of a row that is outside the others: far above rounding of a projector, far below a lever arm


class ActiveSet(NamedTuple):
    """Which rows are kept, how many changed, whether they are final, and what each contact does, as a number."""

    kept: Bool[Array, " m"]
    changes: Int[Array, ""]
    settled: Bool[Array, ""]
    contacts: Int[Array, " c"] | None


def all_kept(m: int) -> ActiveSet:
    """That of a system without contacts."""
    return ActiveSet(xp.ones(m, bool), xp.zeros((), int), xp.ones((), bool), None)


def without_rows(elasticity: Elasticity, kept: Bool[Array, " m"]) -> Elasticity:
    """The closure of the other rows: what is left out is coupled with none and fits."""
    compliance, misfit = elasticity
    own = xp.diagonal(compliance)
    alone = xp.where(own > 0, own, 1.0)
    both = kept[:, None] & kept
    return Elasticity(xp.where(both, compliance, xp.diag(xp.where(kept, 0.0, alone))), xp.where(kept, misfit, 0.0))


def with_rows(elasticity: Elasticity, kept: Bool[Array, " m"], of_all: Elasticity) -> Elasticity:
    """The closure of the rows that are kept, and that of all beside them."""
    pairs = zip((kept[:, None] & kept, kept), elasticity, of_all, strict=True)
    return Elasticity(*(xp.where(both, own, other) for both, own, other in pairs))


def as_held(system: AbstractSystem, kept: Any) -> AbstractSystem:
    """The system whose kept contacts hold both ways, and whose others are open."""
    names = dataclasses.replace(system.names, pushing=(), one_sided=())
    return replace_fields(system, _names=names).opened(xp.asarray(kept))


class _Step(NamedTuple):
    """The active set on its way: contacts whose row is kept, and those whose tied rows are."""

    loaded: Bool[Array, " c"]
    rolling: Bool[Array, " c"]
    changes: Int[Array, ""]
    goes_on: Bool[Array, ""]
    settled: Bool[Array, ""]
    contacts: Int[Array, " c"]


def of_rows(
    solved: Callable[..., tuple[Any, Elasticity, Any]], *, known: bool
) -> Callable[..., tuple[Factorisation, Any, Elasticity, Any]]:
    """The factorisation of the rows that are kept and what `solved(opened, state, factor, elasticity, ...)` gives with
    it: the solution, the closure that it has, and whether that is found. Of known numbers each set is solved once."""
    done: dict[bytes, tuple[Factorisation, Any, Elasticity, Any]] = {}

    def of_set(system: AbstractSystem, state: State, elasticity: Elasticity, kept: Any, *more: Any) -> tuple:
        key = kept.tobytes() if known else b""
        if key in done:
            return done[key]
        opened = system.opened(kept) if system.names.one_sided else system
        factor = factorised(opened, state, None)
        found = factor, *solved(opened, state, factor, without_rows(elasticity, kept), *more)
        if known:
            done[key] = found
        return found

    return of_set


def active_set(
    system: AbstractSystem,
    state: State,
    elasticity: Elasticity,
    of_set: Callable[..., tuple[Factorisation, Any, Elasticity, Any]],
) -> ActiveSet:
    """The rows that are kept, by `of_rows`. It has no derivatives: those of a solution are at a fixed active set."""
    system, state, elasticity = stop_gradient((system, state, elasticity))
    names = system.names
    rows, has_tied = np.array(names.one_sided), np.array([bool(tied) for tied in names.tied] or [False])
    every = system.opened(xp.ones(len(system.rows), bool))  # by the program that all sets of rows have
    model = model_at(every.anonymous.without_friction, state)
    scales = scaling(system, model)
    closed = take(_closed(model, scales, state), rows)
    most = 8 * rows.size + 8

    def body(step: _Step) -> _Step:
        kept = rows_that_hold(names, step.loaded, step.rolling)
        factor, solution, bent, found = of_set(system, state, elasticity, kept)
        bent = with_rows(bent, kept, elasticity)
        wrong, does = _signs(rows, closed, kept, (model, scales), factor, solution, bent)
        # The worst first; then the first, which cannot go round in circles.
        place = xp.where(step.changes < 2 * rows.size, xp.argmax(wrong), xp.argmax(wrong > 0))
        flip = (xp.asarray(np.arange(rows.size)) == place) & xp.any(wrong > 0)
        loaded = step.loaded ^ flip
        # What is tied goes with its row as that changes, and, where none does, stays with contacts that touch.
        touching = (does == code_of(Contact.touches)) | (does == code_of(Contact.carries))
        rolling = xp.where(xp.any(flip), xp.where(flip, loaded, step.rolling), touching) & xp.asarray(has_tied)
        failed = ~found | differs(solution.result, RESULTS.successful)
        settled = ~xp.any(flip | (rolling ^ step.rolling)) | failed
        changes = step.changes + xp.where(settled, 0, 1)
        loaded, rolling = xp.where(settled, step.loaded, loaded), xp.where(settled, step.rolling, rolling)
        return _Step(loaded, rolling, changes, ~settled & (changes < most), settled, does)

    start = closed, closed & xp.asarray(has_tied)
    none, yes = xp.zeros((), int), xp.ones((), bool)
    end = while_loop(lambda step: step.goes_on, body, _Step(*start, none, yes, ~yes, xp.zeros(rows.size, int)))
    kept = rows_that_hold(names, end.loaded, end.rolling)
    return stop_gradient(ActiveSet(kept, end.changes, end.settled, end.contacts))


def _closed(model: Model, scales: Scaling, state: State) -> Bool[Array, " m"]:
    """Which rows have neither a gap nor a velocity that opens one."""
    tolerance = largest_violation(state.qd.dtype)
    position = model.motion.value / scales.rows / scales.size
    speed = xp.max(xp.abs(state.qd / scales.coordinates), initial=0.0)
    return (position > -tolerance) & (model.motion.rate / scales.rows >= -tolerance * speed)


def _signs(
    rows: np.ndarray,
    closed: Bool[Array, " c"],
    all_kept: Bool[Array, " m"],
    at: tuple[Model, Scaling],
    factor: Factorisation,
    solution: Any,
    elasticity: Elasticity,
) -> tuple[Float[Array, " c"], Int[Array, " c"]]:
    """How wrong each contact is, relative and positive where it must change; and what it does."""
    model, scales = at
    jacobian, gamma = model.jacobian, model.motion.gamma
    kept = take(all_kept, rows)
    force = scales.rows * solution.multipliers
    force = take(force, rows) / or_one(xp.max(xp.abs(force)))
    a = solution.acceleration
    into = (jacobian @ a - gamma) / scales.rows  # how the rows close
    terms = xp.max((xp.abs(jacobian) @ xp.abs(a) + xp.abs(gamma)) / scales.rows)
    into = take(into, rows) / or_one(terms)
    # s of what is left out, in its own unit: by how much it closes beside the others
    bent = elasticity.compliance @ solution.multipliers - elasticity.misfit
    own = factor.scaling
    u = own.coordinates * (factor.split.inverse @ (xp.where(all_kept, bent, 0.0) / own.rows))
    strain = take(bent - jacobian @ u, rows) / or_one(xp.max(xp.abs(bent)))
    turned = jacobian * own.coordinates
    beyond = xp.linalg.norm(turned @ factor.split.motion, axis=1) / or_one(xp.linalg.norm(turned, axis=1))
    decided = take(beyond, rows) < _WITHIN  # by the other rows: it moves with them
    pulls, closes = -force, xp.where(decided, xp.maximum(into, -strain), into)
    wrong = xp.where(closed, xp.where(kept, pulls, closes), -1.0)
    carries, lifts = kept & (force > _CLEAR), ~kept & (into < -_CLEAR)
    opened, lifted, touching, loaded = map(code_of, Contact)
    code = xp.where(carries, loaded, xp.where(lifts, lifted, touching))
    return xp.where(wrong > _CLEAR, wrong, -1.0), xp.where(closed, code, opened)
