"""Assembly: a guessed position and velocity projected onto the constraint manifold.

    Phi(q [+] d, t) = 0 with small d,   Phi_q qd = -Phi_t with small change of qd            (2), (3)

Levenberg-Marquardt finds the position in the scaled variables of `_scaling`, in which lengths and angles compare;
Newton steps d = -K^+ Phi at the decided rank finish it to rounding. The last of them carries the derivative:
geometry moves q by the smallest displacement that keeps the mechanism closed.

Points of few digits leave a misfit where constraints are redundant. The steps then end at K^T Phi = 0, as near as the
points allow: the rank is that of a tolerance above the misfit, so no step closes it along a direction that only the
rounding of the points constrains.

Of a large mechanism the factor of a sparse matrix makes these steps (`_sparse_descent`, `_pseudoinverse`).

In space d turns a body by less than half a turn. Passes of Levenberg-Marquardt, each about the position that the one
before found, take it farther, and Newton steps finish from there.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._system._axis import Axis, join
from .._system._contact import rows_that_hold
from .._system._names import ByName, Names, index_of, vector
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._chunks import alike, with_derivative_of
from .._tools._compilation import compiled
from .._tools._errors import RedundaxError
from .._tools._module import as_float, check_position, floats, is_concrete, numpy_of, on_device, replace_fields
from .._tools._no_answer import nan_where
from .._tools._numbers import (
    computed,
    custom_jvp,
    fori_loop,
    known,
    of_model,
    on_numbers,
    stop_gradient,
    take,
    while_loop,
    xp,
)
from .._tools._value import AbstractModule
from ._guess import ask_for_radians, check_finite
from ._kinematics import along_motion, model_at, velocity
from ._misfit import Misfit, misfit_of, tell, tolerance
from ._pseudoinverse import (
    DensePseudoinverse,
    SparsePseudoinverse,
    SparseRows,
    dense_pseudoinverse,
    sparse_pseudoinverse,
    sparse_rows,
)
from ._scaling import Scaling, largest_violation, scaling, scaling_at
from ._sparse_descent import sparse_descent
from ._unmet import check_rows, no_position, no_velocity

_POLISHING_STEPS, _PASSES = 4, 3
_DESCENT_STEPS, _SETTLED = 500, 1e-8  # at most, and relative changes that end it: Newton steps that follow square them
_LEAST_DAMPING, _MOST_DAMPING = 1e-10, 1e20  # less leaves redundant rows no factor; at the most no step descends


def assemble(
    system: AbstractSystem,
    q: ByName | None = None,
    qd: ByName = 0.0,
    t: ArrayLike = 0.0,
    *,
    positions: Mapping[str, ArrayLike] | None = None,
    rates: Mapping[str, ArrayLike] | None = None,
    closed: Sequence[str] | str = (),
    throw: bool | None = None,
) -> State:
    """The state on the constraint manifold (2), (3) nearest to a guess.

    ??? example

        ```python
        guess = state.q + 0.01
        closed = rx.assemble(mechanism, guess, positions={"1.phi": 0.8}, rates={"A.angle": 1.0})
        pin = rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
        rx.assemble(rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [pin]), {"rod.x": 0.5})  # all else is guessed as 0
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`.
    - `q`, `qd`: guessed coordinates and velocities, as vectors or by name, as in `{"crank.phi": 0.5}`, 0 for those not
      named; a number for `qd` stands for all. Their order is that of `State`. A mechanism in space starts from the
      reference poses of its bodies if `q` is not given, which has no names there.
    - `t`: time.
    - `positions`, `rates`: values that named coordinates must take, such as `{"crank.phi": 0.5}`, those of joints too,
      such as `{"K.travel": 0.02}`. Rates have the same names, or those of results, as in `{"crank.phi'": 1.0}`.
    - `closed`: names of one-sided contacts to close. Others with a gap at the guess stay open, unless they would
      overlap; those without one stay closed.
    - `throw`: whether to raise an error where no state is found; by default outside of `jit` and `vmap`.

    **Returns:** a `State`. Where no position is found it is NaN, and where no velocity is found that is; `state.result`
    says which, sample by sample under `jit` and `vmap`. Derivatives are NaN there too, unless a sample is masked by its
    result, as of `solve`. Redundant constraints on points of few digits cannot be met exactly: the state then meets
    them as nearly as they allow, by least squares and as far as `solve` takes it, and outside of `jit` and `vmap` a
    warning tells the largest misfit, which is that of `solve`'s `stats.violation`.

    **Raises:** `RuntimeError` that names the rows that cannot be met.
    """
    check_system(system)
    n = len(system.coordinates)
    positions, rates = dict(positions or {}), dict(_without_prime("rates", rates or {}))
    q = system.reference if q is None else q
    if isinstance(q, Mapping) and len(system.names.centres):
        raise RedundaxError(
            "Argument `q` must be a vector in space, where positions of bodies have no names, but is given by name. "
            "Leave it out to start from the reference poses, and give coordinates of joints as `positions`."
        )
    q = vector("q", q, system.coordinates, " of coordinates") if isinstance(q, Mapping) else as_float(q)
    qd, t = vector("qd", _without_prime("qd", qd), system.coordinates, " of coordinates"), as_float(t)
    own = {x.dtype for x in jax.tree.leaves(system) if eqx.is_inexact_array(x)}
    dtype, labels = xp.result_type(q, qd, *own), _axis(system.names).labels
    held = [index_of("positions", name, labels, " of coordinates") for name in positions]
    driven = [index_of("rates", name, labels, " of coordinates") for name in rates]
    if system.adds:
        check_position(q, n)
    elif any(index < n for index in held) and q.shape != (n,):
        wrong = next(name for name, index in zip(positions, held, strict=True) if index < n)
        raise RedundaxError(
            f"Argument `positions` must name coordinates of joints, as positions of bodies have no names in space, but "
            f"holds {wrong!r}. There are {', '.join(system.names.joint_coordinates.labels) or 'none'}."
        )
    numbers = {"q": q, "qd": qd, "t": t}
    if throw is not False:
        check_finite(system.coordinates.labels, **numbers, positions=positions, rates=rates)
    angles = {name for name, angular in zip(labels, _axis(system.names).angular.tolist(), strict=True) if angular}
    ask_for_radians(angles, system.coordinates.labels if system.adds else (), q, positions)
    np_ = numpy_of(numbers, positions, rates)  # NumPy, which compiles nothing, where all is known
    finite = np_.all(np_.stack([np_.all(np_.isfinite(value)) for value in numbers.values()]))
    guess = np_.where(finite, q, np_.nan), np_.broadcast_to(qd, (n,)), t
    given = (np_.stack([np_.zeros(()), *map(floats, values.values())])[1:] for values in (positions, rates))
    q, qd, t, at, rate = (on_device(np_.asarray(value, dtype)) for value in (*guess, *given))
    held, driven = (on_device(np.array(indices, int)) for indices in (held, driven))
    given = State(system.start(q, t), qd, t), held, at, driven, rate
    run = _assemble if system.plan is None else _assemble_large
    bare = system.anonymous.without_friction
    if system.names.one_sided:
        bare = bare.opened(_rows_that_hold(system.names, bare, run, given, closed))
    state, off, slow = run(bare, *given)
    if is_concrete(off.refused) and is_concrete(slow.refused):
        off, slow = jax.device_get(stop_gradient((off, slow)))
        if off.refused and throw is not False:
            raise no_position(system, check_rows(system, q, t), off, tuple(positions))
        if slow.refused and throw is not False:
            raise no_velocity(system.names, slow, tuple(rates))
        tell("position", off, (*system.rows.labels, *(f"{name} as given" for name in positions)))
        if not off.beyond.any():  # what the position misses the velocity does too
            tell("velocity", slow, (*system.rows.labels, *(f"{name} as given" for name in rates)))
    return state


@computed
def _rows_that_hold(
    names: Names, system: AbstractSystem, run: Any, given: tuple, closed: Sequence[str]
) -> Bool[Array, " m"]:
    """The rows that hold: all but contacts with a gap at the guess that stay open. No derivatives."""
    system, (start, *others) = stop_gradient((system, given))
    rows, known_names = np.array(names.one_sided), names.contacts
    wanted = np.isin(known_names, _checked(closed, known_names))
    tolerance = largest_violation(start.qd.dtype)

    whole = system.opened(xp.ones(len(system.rows), bool))  # one program for all sets of rows

    def closing(state: State) -> Array:
        model = model_at(whole, state)
        scales = scaling(system, model)
        return take(model.motion.value / scales.rows, rows) / scales.size

    def body(kept: tuple[Array, Array]) -> tuple[Array, Array]:
        reached = closing(run(system.opened(rows_that_hold(names, kept[0], kept[0])), start, *others)[0])
        more = kept[0] | (reached > tolerance)
        return more, xp.any(more & ~kept[0])

    begins = closing(start)
    most = tolerance if wanted.any() else np.inf  # those that are wanted may push the others out
    first = xp.asarray(wanted) | ((begins > -tolerance) & (begins <= most))
    kept, _ = while_loop(lambda kept: kept[1], body, (first, xp.ones((), bool)))
    return rows_that_hold(names, kept, kept)


def _checked(closed: Sequence[str], contacts: tuple[str, ...]) -> Sequence[str]:
    """Names of contacts."""
    for name in [closed] if isinstance(closed, str) else closed:
        index_of("closed", name, contacts, " of one-sided contacts")
    return [closed] if isinstance(closed, str) else closed


def _without_prime(argument: str, given: Any) -> Any:
    """Rates by the names of coordinates, as they are given or with the prime that results have."""
    if not isinstance(given, Mapping):
        return given
    names = [str(name).removesuffix("'") for name in given]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RedundaxError(
            f"Argument `{argument}` must name each rate once, but holds {twice[0]} twice. Leave one out."
        )
    return dict(zip(names, given.values(), strict=True))


def _axis(names: Names) -> Axis:
    """What can be given: coordinates, and those of joints."""
    return join([names.coordinates, names.joint_coordinates])


def _beside(system: AbstractSystem, given: Array, wanted: Array, held: Array) -> Array:
    """How far held coordinates are from what they must be: an angle in space to the nearest turn."""
    gap = given - wanted
    if system.adds or not held.size:
        return gap
    whole = 2 * xp.pi * known(system.radian).astype(gap.dtype)
    turns = xp.where(take(_axis(system.names).angular, held), xp.round(gap / whole), 0.0)
    return gap - whole * turns


def _given(system: AbstractSystem, q: Array, t: Array, held: Array) -> Array:
    """Values of the coordinates that are held, of those of `_axis`."""
    if not held.size:
        return xp.zeros(0, q.dtype)
    none = xp.zeros(len(system.coordinates), q.dtype)
    own = q if q.shape == none.shape else none  # of another chart no coordinate is held
    return xp.concatenate([own, system.joint_coordinates.positions(State(q, none, t))])[held]


def _assembled(
    system: AbstractSystem,
    guess: State,
    held: Int[Array, " h"],
    positions: Float[Array, " h"],
    driven: Int[Array, " d"],
    rates: Float[Array, " d"],
) -> tuple[State, Misfit, Misfit]:
    """State, and the misfits of its position and of its velocity."""
    q, off = _position(system, guess, held, positions)
    qd, slow = _velocity(system, replace_fields(guess, q=q), driven, rates)
    found = replace_fields(guess, q=nan_where(off.refused, q), qd=nan_where(off.refused | slow.refused, qd))
    return found, off, slow


@with_derivative_of(_assembled, failed=lambda found: found[1].refused)
def _assembled_each(*arguments: Any) -> tuple[State, Misfit, Misfit]:
    return alike(_assembled(*arguments), eqx.filter(arguments, eqx.is_array))


_assemble, _assemble_large = on_numbers(_assembled_each), compiled(_assembled_each)


@of_model
def closing_at(system: AbstractSystem, q: Array, d: Array, t: Array) -> tuple[Array, Array, Array]:
    """q [+] d, and there Phi and all coordinates that can be given, with their slopes by d."""
    none = jnp.zeros(len(system.coordinates), q.dtype)

    def values(d: Array) -> tuple[Array, tuple[Array, Array]]:
        at = system.retract(q, d)
        own = at if at.shape == none.shape else none
        joints = system.joint_coordinates.positions(State(at, none, t))
        found = jnp.concatenate([system.constraint(at, t), own, joints])
        return found, (found, at)

    slopes, (found, at) = jax.jacfwd(values, has_aux=True)(d)
    return at, found, slopes


class _Closing(AbstractModule):
    """The position problem: scaled residual r(d) of rows and held coordinates at q [+] S d."""

    system: AbstractSystem
    guess: State
    held: Int[Array, " h"]
    positions: Float[Array, " h"]
    scale: Scaling
    row_scale: Float[Array, " rows"]

    def linearised(self, d: Array) -> tuple[Array, Array]:
        """The residual at q [+] S d and its slope, of dense matrices."""
        m, step = len(self.system.rows), self.scale.coordinates * d
        which = xp.concatenate([np.arange(m), m + self.held])
        _, values, slopes = closing_at(self.system, self.guess.q, step, self.guess.t)
        values, slopes = take(values, which), take(slopes, which)
        given = _beside(self.system, values[m:], self.positions, self.held)
        residual = xp.concatenate([values[:m], given]) / self.row_scale
        return residual, slopes * self.scale.coordinates / self.row_scale[:, None]

    def moved(self, q: Array, d: Array) -> Array:
        """q [+] S d."""
        step = self.scale.coordinates * d
        if self.system.adds:
            return q + step
        if self.system.plan is not None:
            return self.system.retract(q, step)
        return closing_at(self.system, q, step, self.guess.t)[0]

    def residual(self, d: Array) -> Array:
        """r(d)."""
        if self.system.plan is None:
            return self.linearised(d)[0]
        return self.residual_at(self.moved(self.guess.q, d))

    def residual_at(self, q: Array) -> Array:
        """The same of a large mechanism, at a position."""
        given = _given(self.system, q, self.guess.t, self.held)
        given = _beside(self.system, given, self.positions, self.held)
        return xp.concatenate([self.system.constraint(q, self.guess.t), given]) / self.row_scale

    def rows(self, q: Array) -> SparseRows:
        """K of a large mechanism, at a position."""
        given = _given_rows(self.system, replace_fields(self.guess, q=q), self.held)
        given = given * self.scale.coordinates / self.row_scale[len(self.scale.rows) :, None]
        return sparse_rows(self.system, q, self.guess.t, self.scale, given)

    def inverse(self, d: Array) -> DensePseudoinverse | SparsePseudoinverse:
        """K^+ of the residual."""
        if self.system.plan is None:
            residual, slopes = self.linearised(d)
            return dense_pseudoinverse(slopes, xp.max(xp.abs(residual)) / self.scale.size)
        violation = xp.max(xp.abs(self.residual(d))) / self.scale.size
        return sparse_pseudoinverse(self.rows(self.moved(self.guess.q, d)), violation)


class _Closed(NamedTuple):
    """A displacement, the size of the last step to it, and the least singular value that the steps inverted."""

    d: Float[Array, " n"]
    step: Float[Array, ""]
    weakest: Float[Array, ""]


class _Descent(NamedTuple):
    """u = d / size, the residual there and its slope, the damping, the number of steps, and whether it is the end."""

    u: Float[Array, " n"]
    residual: Float[Array, " rows"]
    slope: Float[Array, "rows n"]
    damping: Float[Array, ""]
    steps: Int[Array, ""]
    ended: Bool[Array, ""]


def _descent(closing: _Closing) -> Float[Array, " n"]:
    """A displacement to where the residual is least, by the method of Levenberg and Marquardt,

        (J^T J + s I) du = -J^T r,

    where the damping s falls after steps that lower |r|^2 as J says, and grows after others.
    """
    size, one = closing.scale.size, xp.eye(closing.guess.qd.size, dtype=closing.guess.qd.dtype)

    def at(u: Array) -> tuple[Array, Array]:
        residual, slope = closing.linearised(size * u)
        return residual / size, slope

    def step(now: _Descent) -> _Descent:
        u, residual, slope, damping, steps, _ = now
        change = -xp.linalg.solve(slope.T @ slope + damping * one, slope.T @ residual)
        ahead, its_slope = at(u + change)
        square, less = xp.sum(residual**2), xp.sum(residual**2) - xp.sum(ahead**2)
        said = square - xp.sum((residual + slope @ change) ** 2)
        good, better = less > 0, less > 0.01 * said
        small = xp.all(xp.abs(change) <= _SETTLED * (1 + xp.abs(u))) & (xp.abs(less) <= _SETTLED * (1 + square))
        damping = xp.where(less > 0.9 * said, damping / 4, xp.where(better, damping, damping * 4))
        return _Descent(
            u=xp.where(good, u + change, u),
            residual=xp.where(good, ahead, residual),
            slope=xp.where(good, its_slope, slope),
            damping=xp.maximum(damping, _LEAST_DAMPING),
            steps=steps + 1,
            ended=small | ~(damping < _MOST_DAMPING) | ~xp.isfinite(square),
        )

    start = xp.zeros_like(closing.guess.qd)
    begin = _Descent(start, *at(start), xp.ones_like(size), xp.zeros((), int), size != size)
    return size * while_loop(lambda now: ~now.ended & (now.steps < _DESCENT_STEPS), step, begin).u


def _closing(system: AbstractSystem, guess: State, held: Array, positions: Array) -> _Closing:
    scale = scaling_at(system, guess)
    row_scale = xp.concatenate([scale.rows, _held_scale(system, held, scale)])
    return _Closing(system, guess, held, positions, scale, row_scale)


def _begun(system: AbstractSystem, guess: State, held: Array, positions: Array) -> _Closing:
    """The position problem about where Newton steps begin.

    That is the end of the descent of a large mechanism, and of the passes in space; elsewhere the guess, from which
    a displacement reaches as far.
    """
    closing = _closing(system, guess, held, positions)
    if system.plan is not None:
        still = stop_gradient(closing)
        size = still.scale.size
        reached = sparse_descent(
            still.guess.q,
            lambda q: still.residual_at(q) / size,
            still.rows,
            lambda q, d: still.moved(q, size * d),
        )
        return replace_fields(closing, guess=replace_fields(guess, q=_carried(guess.q, system, reached)))
    if system.adds:
        return closing

    def moved(_: Any, q: Array) -> Array:
        closing = stop_gradient(_closing(system, replace_fields(guess, q=q), held, positions))
        return closing.moved(q, _descent(closing))

    q = fori_loop(0, _PASSES, moved, guess.q)
    return _closing(system, replace_fields(guess, q=q), held, positions)


@partial(custom_jvp, make=eqx.filter_custom_jvp)
def _carried(guess: Array, system: AbstractSystem, reached: Array) -> Array:
    """The position reached; its derivative is that of the guess, velocity by velocity."""
    return reached


@_carried.def_jvp
def _carried_jvp(primals: tuple, tangents: tuple) -> tuple:
    (guess, system, reached), (change, *_) = primals, tangents
    if change is None or system.adds:
        return reached, change
    rate = velocity(system, guess, change)
    zero, one = xp.zeros((), reached.dtype), xp.ones((), reached.dtype)
    return reached, jax.jvp(lambda s: system.retract(reached, s * rate), (zero,), (one,))[1]


@partial(custom_jvp, make=eqx.filter_custom_jvp)
def _closed(closing: _Closing) -> _Closed:
    """A displacement d with K^+ r(d) = 0; its derivative is dd = -K^+ dr, the smallest that keeps it so."""
    begins = closing.system.adds and closing.system.plan is None  # else it is at its end
    d = _descent(closing) if begins else xp.zeros_like(closing.guess.qd)

    def polished(_: Any, carry: _Closed) -> _Closed:
        inverse = closing.inverse(carry.d)
        step = -inverse(closing.residual(carry.d))
        return _Closed(carry.d + step, xp.max(xp.abs(step)), xp.minimum(carry.weakest, inverse.kept))

    infinite = xp.full((), xp.inf, d.dtype)
    return fori_loop(0, _POLISHING_STEPS, polished, _Closed(d, infinite, infinite))


@_closed.def_jvp
def _closed_jvp(primals: tuple, tangents: tuple) -> tuple:
    closed = _closed(*primals)
    _, change = eqx.filter_jvp(lambda closing: closing.residual(closed.d), primals, tangents)
    moved = None if change is None else -primals[0].inverse(closed.d)(change)  # None where nothing in r moves
    none = xp.zeros_like(closed.step)
    return closed, eqx.tree_at(lambda closed: closed.d, _Closed(none, none, none), moved)


def _position(system: AbstractSystem, guess: State, held: Array, positions: Array) -> tuple[Array, Misfit]:
    closing = _begun(system, guess, held, positions)
    d, step, weakest = _closed(closing)
    left = xp.abs(closing.residual(d))
    settled = step <= xp.maximum(xp.max(left / closing.scale.size), tolerance(d))
    scale = closing.row_scale * closing.scale.size
    misfit = misfit_of(left * closing.row_scale, scale, settled, weakest, tolerance(d))
    return closing.moved(closing.guess.q, d), misfit


def _velocity(system: AbstractSystem, state: State, driven: Array, rates: Array) -> tuple[Array, Misfit]:
    if system.plan is None:
        model = model_at(system, state)
        motion, scale = model.motion, scaling(system, model)
        own = model.jacobian * scale.coordinates / scale.rows[:, None]
    else:
        motion, scale, own = along_motion(system, state), scaling_at(system, state), None
    row_scale = xp.concatenate([scale.rows, _held_scale(system, driven, scale)])
    slopes = _given_rows(system, state, driven)
    misfit = xp.concatenate([motion.rate, slopes @ state.qd - rates]) / row_scale
    slopes = slopes * scale.coordinates / row_scale[len(scale.rows) :, None]
    drift = xp.max(xp.abs(motion.value) / scale.rows) / scale.size
    if own is not None:
        inverse = dense_pseudoinverse(xp.concatenate([own, slopes]), drift)
    else:
        inverse = sparse_pseudoinverse(sparse_rows(system, state.q, state.t, scale, slopes), drift)
    change = -inverse(misfit)
    guess = state.qd / scale.coordinates
    found = guess + change
    given = (xp.max(xp.abs(guess)) + xp.max(xp.abs(misfit))) / xp.minimum(inverse.kept, 1.0)
    rests = xp.max(xp.abs(found)) <= 10 * found.size * xp.finfo(found.dtype).eps * given
    found = found - xp.where(rests, stop_gradient(found), 0.0)  # the rounding of none, which has no direction
    qd = scale.coordinates * found
    speed = xp.max(xp.abs(found)) + xp.max(xp.abs(misfit))
    left = xp.abs(misfit + inverse.times(change))
    size = row_scale * xp.where(speed > 0, speed, 1.0)
    return qd, misfit_of(left * row_scale, size, xp.asarray(True), xp.asarray(xp.inf), tolerance(qd))


def _given_rows(system: AbstractSystem, state: State, which: Array) -> Float[Array, "h n"]:
    """How given values, of those of `_axis`, change with the coordinates."""
    still = xp.zeros_like(state.qd)
    if not which.size:
        return xp.zeros((0, still.size), still.dtype)
    if system.plan is None:
        slopes = take(closing_at(system, state.q, still, state.t)[2][len(system.rows) :], which)
    else:
        slopes = jax.jacrev(lambda d: _given(system, system.retract(state.q, d), state.t, which))(still)
    own = which[:, None] == xp.arange(still.size)  # of another chart too, whose positions are none of these
    return xp.where((which < still.size)[:, None], own.astype(still.dtype), slopes)


def _held_scale(system: AbstractSystem, held: Array, scale: Scaling) -> Array:
    return xp.where(take(_axis(system.names).angular, held), 1 / scale.length, 1.0)
