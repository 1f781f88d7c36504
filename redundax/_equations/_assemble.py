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

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int

from .._system._axis import Axis, join
from .._system._names import ByName, Names, index_of, vector
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._chunks import alike, with_derivative_of
from .._tools._compilation import compiled
from .._tools._errors import RedundaxError
from .._tools._module import (
    as_float,
    check_position,
    floats,
    is_concrete,
    numpy_of,
    on_device,
    replace_fields,
    stop_gradient,
)
from .._tools._no_answer import nan_where
from ._guess import ask_for_radians, check_finite
from ._kinematics import second_order, velocity
from ._misfit import Misfit, misfit_of, tell, tolerance
from ._pseudoinverse import (
    DensePseudoinverse,
    SparsePseudoinverse,
    SparseRows,
    dense_pseudoinverse,
    sparse_pseudoinverse,
    sparse_rows,
)
from ._scaling import Scaling, scaling_at
from ._sparse_descent import sparse_descent
from ._unmet import check_rows, no_position, no_velocity

_POLISHING_STEPS, _PASSES = 4, 3


def assemble(
    system: AbstractSystem,
    q: ByName | None = None,
    qd: ByName = 0.0,
    t: ArrayLike = 0.0,
    *,
    positions: Mapping[str, ArrayLike] | None = None,
    rates: Mapping[str, ArrayLike] | None = None,
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
    dtype, labels = jnp.result_type(q, qd, *own), _axis(system.names).labels
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
    xp = numpy_of(numbers, positions, rates)  # NumPy, which compiles nothing, where all is known
    finite = xp.all(xp.stack([xp.all(xp.isfinite(value)) for value in numbers.values()]))
    guess = xp.where(finite, q, xp.nan), xp.broadcast_to(qd, (n,)), t
    given = (xp.stack([xp.zeros(()), *map(floats, values.values())])[1:] for values in (positions, rates))
    q, qd, t, at, rate = (on_device(xp.asarray(value, dtype)) for value in (*guess, *given))
    held, driven = (on_device(np.array(indices, int)) for indices in (held, driven))
    q = system.start(q, t)
    state, off, slow = _assemble(system.anonymous, State(q, qd, t), held, at, driven, rate)
    if is_concrete(off.refused) and is_concrete(slow.refused):
        off, slow = jax.device_get((off, slow))
        if off.refused and throw is not False:
            raise no_position(system, check_rows(system, q, t), off, tuple(positions))
        if slow.refused and throw is not False:
            raise no_velocity(system.names, slow, tuple(rates))
        tell("position", off, (*system.rows.labels, *(f"{name} as given" for name in positions)))
        if not off.beyond.any():  # what the position misses the velocity does too
            tell("velocity", slow, (*system.rows.labels, *(f"{name} as given" for name in rates)))
    return state


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
    whole = 2 * jnp.pi * system.radian
    turns = jnp.where(jnp.asarray(_axis(system.names).angular)[held], jnp.round(gap / whole), 0.0)
    return gap - whole * turns


def _given(system: AbstractSystem, q: Array, t: Array, held: Array) -> Array:
    """Values of the coordinates that are held, of those of `_axis`."""
    if not held.size:
        return jnp.zeros(0, q.dtype)
    none = jnp.zeros(len(system.coordinates), q.dtype)
    own = q if q.shape == none.shape else none  # of another chart no coordinate is held
    return jnp.concatenate([own, system.joint_coordinates.positions(State(q, none, t))])[held]


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
    qd, slow = _velocity(system, State(q, guess.qd, guess.t), driven, rates)
    return State(nan_where(off.refused, q), nan_where(off.refused | slow.refused, qd), guess.t), off, slow


@compiled
@with_derivative_of(_assembled, failed=lambda found: found[1].refused)
def _assemble(*arguments: Any) -> tuple[State, Misfit, Misfit]:
    return alike(_assembled(*arguments), eqx.filter(arguments, eqx.is_array))


class _Closing(eqx.Module):
    """The position problem: scaled residual r(d) of rows and held coordinates at q [+] S d."""

    system: AbstractSystem
    guess: State
    held: Int[Array, " h"]
    positions: Float[Array, " h"]
    scale: Scaling
    row_scale: Float[Array, " rows"]

    def moved(self, q: Array, d: Array) -> Array:
        """q [+] S d."""
        return self.system.retract(q, self.scale.coordinates * d)

    def residual(self, d: Array) -> Array:
        return self.residual_at(self.moved(self.guess.q, d))

    def residual_at(self, q: Array) -> Array:
        given = _given(self.system, q, self.guess.t, self.held)
        given = _beside(self.system, given, self.positions, self.held)
        return jnp.concatenate([self.system.constraint(q, self.guess.t), given]) / self.row_scale

    def rows(self, q: Array) -> SparseRows:
        """K of a large mechanism, at a position."""
        given = _given_rows(self.system, State(q, self.guess.qd, self.guess.t), self.held)
        given = given * self.scale.coordinates / self.row_scale[len(self.scale.rows) :, None]
        return sparse_rows(self.system, q, self.guess.t, self.scale, given)

    def inverse(self, d: Array) -> DensePseudoinverse | SparsePseudoinverse:
        """K^+ of the residual."""
        violation = jnp.max(jnp.abs(self.residual(d))) / self.scale.size
        if self.system.plan is None:
            return dense_pseudoinverse(jax.jacfwd(self.residual)(d), violation)
        return sparse_pseudoinverse(self.rows(self.moved(self.guess.q, d)), violation)


class _Closed(NamedTuple):
    """A displacement, the size of the last step to it, and the least singular value that the steps inverted."""

    d: Float[Array, " n"]
    step: Float[Array, ""]
    weakest: Float[Array, ""]


def _descent(closing: _Closing) -> Float[Array, " n"]:
    """A displacement to where the residual is least."""
    import optimistix as optx  # here, as its import takes time that few need

    size, start = closing.scale.size, jnp.zeros_like(closing.guess.qd)
    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    found = optx.least_squares(lambda d, _: closing.residual(d) / size, solver, start, max_steps=500, throw=False)
    return found.value


def _closing(system: AbstractSystem, guess: State, held: Array, positions: Array) -> _Closing:
    scale = scaling_at(system, guess)
    row_scale = jnp.concatenate([scale.rows, _held_scale(system, held, scale)])
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
        return replace_fields(closing, guess=State(_carried(guess.q, system, reached), guess.qd, guess.t))
    if system.adds:
        return closing

    def moved(_: Array, q: Array) -> Array:
        closing = stop_gradient(_closing(system, State(q, guess.qd, guess.t), held, positions))
        return closing.moved(q, _descent(closing))

    q = jax.lax.fori_loop(0, _PASSES, moved, guess.q)
    return _closing(system, State(q, guess.qd, guess.t), held, positions)


@eqx.filter_custom_jvp
def _carried(guess: Array, system: AbstractSystem, reached: Array) -> Array:
    """The position reached; its derivative is that of the guess, velocity by velocity."""
    return reached


@_carried.def_jvp
def _carried_jvp(primals: tuple, tangents: tuple) -> tuple:
    (guess, system, reached), (change, *_) = primals, tangents
    if change is None or system.adds:
        return reached, change
    rate = velocity(system, guess, change)
    zero, one = jnp.zeros((), reached.dtype), jnp.ones((), reached.dtype)
    return reached, jax.jvp(lambda s: system.retract(reached, s * rate), (zero,), (one,))[1]


@eqx.filter_custom_jvp
def _closed(closing: _Closing) -> _Closed:
    """A displacement d with K^+ r(d) = 0; its derivative is dd = -K^+ dr, the smallest that keeps it so."""
    begins = closing.system.adds and closing.system.plan is None  # else it is at its end
    d = _descent(closing) if begins else jnp.zeros_like(closing.guess.qd)

    def polished(_: Array, carry: _Closed) -> _Closed:
        inverse = closing.inverse(carry.d)
        step = -inverse(closing.residual(carry.d))
        return _Closed(carry.d + step, jnp.max(jnp.abs(step)), jnp.minimum(carry.weakest, inverse.kept))

    infinite = jnp.full((), jnp.inf, d.dtype)
    return jax.lax.fori_loop(0, _POLISHING_STEPS, polished, _Closed(d, infinite, infinite))


@_closed.def_jvp
def _closed_jvp(primals: tuple, tangents: tuple) -> tuple:
    closed = _closed(*primals)
    _, change = eqx.filter_jvp(lambda closing: closing.residual(closed.d), primals, tangents)
    moved = None if change is None else -primals[0].inverse(closed.d)(change)  # None where nothing in r moves
    none = jnp.zeros_like(closed.step)
    return closed, eqx.tree_at(lambda closed: closed.d, _Closed(none, none, none), moved)


def _position(system: AbstractSystem, guess: State, held: Array, positions: Array) -> tuple[Array, Misfit]:
    closing = _begun(system, guess, held, positions)
    d, step, weakest = _closed(closing)
    left = jnp.abs(closing.residual(d))
    settled = step <= jnp.maximum(jnp.max(left / closing.scale.size), tolerance(d))
    scale = closing.row_scale * closing.scale.size
    misfit = misfit_of(left * closing.row_scale, scale, settled, weakest, tolerance(d))
    return closing.moved(closing.guess.q, d), misfit


def _velocity(system: AbstractSystem, state: State, driven: Array, rates: Array) -> tuple[Array, Misfit]:
    motion, _, turned = second_order(system, state)
    scale = scaling_at(system, state, turned)
    row_scale = jnp.concatenate([scale.rows, _held_scale(system, driven, scale)])
    slopes = _given_rows(system, state, driven)
    misfit = jnp.concatenate([motion.rate, slopes @ state.qd - rates]) / row_scale
    slopes = slopes * scale.coordinates / row_scale[len(scale.rows) :, None]
    drift = jnp.max(jnp.abs(motion.value) / scale.rows) / scale.size
    if system.plan is None:
        own = system.jacobian(state.q, state.t) * scale.coordinates / scale.rows[:, None]
        inverse = dense_pseudoinverse(jnp.concatenate([own, slopes]), drift)
    else:
        inverse = sparse_pseudoinverse(sparse_rows(system, state.q, state.t, scale, slopes), drift)
    change = -inverse(misfit)
    guess = state.qd / scale.coordinates
    found = guess + change
    given = (jnp.max(jnp.abs(guess)) + jnp.max(jnp.abs(misfit))) / jnp.minimum(inverse.kept, 1.0)
    rests = jnp.max(jnp.abs(found)) <= 10 * found.size * jnp.finfo(found.dtype).eps * given
    found = found - jnp.where(rests, stop_gradient(found), 0.0)  # the rounding of none, which has no direction
    qd = scale.coordinates * found
    speed = jnp.max(jnp.abs(found)) + jnp.max(jnp.abs(misfit))
    left = jnp.abs(misfit + inverse.times(change))
    size = row_scale * jnp.where(speed > 0, speed, 1.0)
    return qd, misfit_of(left * row_scale, size, jnp.asarray(True), jnp.asarray(jnp.inf), tolerance(qd))


def _given_rows(system: AbstractSystem, state: State, which: Array) -> Float[Array, "h n"]:
    """How given values, of those of `_axis`, change with the coordinates."""
    still = jnp.zeros_like(state.qd)
    if not which.size:
        return jnp.zeros((0, still.size), still.dtype)
    derivative = jax.jacfwd if system.plan is None else jax.jacrev  # of many coordinates few are given
    slopes = derivative(lambda d: _given(system, system.retract(state.q, d), state.t, which))(still)
    own = which[:, None] == jnp.arange(still.size)  # of another chart too, whose positions are none of these
    return jnp.where((which < still.size)[:, None], own.astype(still.dtype), slopes)


def _held_scale(system: AbstractSystem, held: Array, scale: Scaling) -> Array:
    return jnp.where(jnp.asarray(_axis(system.names).angular)[held], 1 / scale.length, 1.0)
