"""Assembly: a guessed position and velocity projected onto the constraint manifold.

    Phi(q [+] d, t) = 0 with small d,   Phi_q qd = -Phi_t with small change of qd            (2), (3)

Levenberg-Marquardt finds the position in the scaled variables of `_scaling`, in which lengths and angles compare;
Newton steps d = -K^+ Phi at the decided rank finish it to rounding. The last of them carries the derivative:
geometry moves q by the smallest displacement that keeps the mechanism closed.
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int

from ._kinematics import second_order
from ._module import Numbers, as_float, known
from ._rank import split
from ._scaling import Scaling, scaling
from ._state import State
from ._system import AbstractSystem

_POLISHING_STEPS = 4


def assemble(
    system: AbstractSystem,
    q: Numbers,
    qd: Numbers = 0.0,
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
        closed = rx.assemble(mechanism, guess, positions={"1.phi": 0.8}, rates={"1.phi": 1.0})
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`.
    - `q`, `qd`: guessed coordinates and velocities; a number for `qd` stands for all.
    - `t`: time.
    - `positions`, `rates`: values that named coordinates must take, such as `{"crank.phi": 0.5}`.
    - `throw`: whether to raise an error where no state is found; by default outside of `jit` and `vmap`.

    **Returns:** a `State`, NaN where none is found.

    **Raises:** `RuntimeError` that names the rows that cannot be met.
    """
    n = len(system.coordinates)
    positions, rates = dict(positions or {}), dict(rates or {})
    q, qd, t = as_float(q), jnp.broadcast_to(as_float(qd), (n,)), as_float(t)
    dtype = jnp.result_type(q, qd)
    held = [_index(system, "positions", name) for name in positions]
    driven = [_index(system, "rates", name) for name in rates]
    if held and q.shape != (n,):
        raise ValueError(
            f"Argument `positions` needs a chart with one coordinate for each of the {n} velocities, but `q` has "
            f"shape {q.shape}. Leave them out and give `q` itself."
        )
    state, off, slow = _assemble(
        system.anonymous(),
        State(q.astype(dtype), qd.astype(dtype), t.astype(dtype)),
        jnp.asarray(np.array(held, int)),
        jnp.stack([jnp.zeros(()), *(as_float(x) for x in positions.values())])[1:].astype(dtype),
        jnp.asarray(np.array(driven, int)),
        jnp.stack([jnp.zeros(()), *(as_float(x) for x in rates.values())])[1:].astype(dtype),
    )
    if throw is False or (throw is None and not known(off)):
        return state
    for what, failed, names in (("position", off, positions), ("velocity", slow, rates)):
        m, labels = len(system.rows), (*system.rows.labels, *(f"{name} as given" for name in names))
        failing = [k for k in (*range(m, len(labels)), *range(m)) if failed[k]]
        if failing:
            raise RuntimeError(
                f"No {what} satisfies the constraints near the guess. What cannot be met together: "
                f"{', '.join(labels[k] for k in failing)}. Give a better guess, or change given values or lengths."
            )
    return state


def _index(system: AbstractSystem, argument: str, name: str) -> int:
    if name not in system.coordinates.labels:
        raise ValueError(
            f"Argument `{argument}` must name coordinates of the system, but holds '{name}'. "
            f"They are {', '.join(system.coordinates.labels)}."
        )
    return system.coordinates.labels.index(name)


@eqx.filter_jit
def _assemble(
    system: AbstractSystem,
    guess: State,
    held: Int[Array, " h"],
    positions: Float[Array, " h"],
    driven: Int[Array, " d"],
    rates: Float[Array, " d"],
) -> tuple[State, Array, Array]:
    """State, and masks of the rows not met by its position, shape (m + h,), and velocity, shape (m + d,)."""
    q, off = _position(system, guess, held, positions)
    qd, slow = _velocity(system, State(q, guess.qd, guess.t), driven, rates)
    failed = jnp.any(off) | jnp.any(slow)
    return State(jnp.where(failed, jnp.nan, q), jnp.where(failed, jnp.nan, qd), guess.t), off, slow


class _Closing(eqx.Module):
    """The position problem: scaled residual r(d) of rows and held coordinates at q [+] S d."""

    system: AbstractSystem
    guess: State
    held: Int[Array, " h"]
    positions: Float[Array, " h"]
    scale: Scaling
    row_scale: Float[Array, " rows"]

    def residual(self, d: Array) -> Array:
        q = self.system.retract(self.guess.q, self.scale.coordinates * d)
        given = q[self.held] - self.positions if self.held.size else self.positions
        rows = jnp.concatenate([self.system.constraint(q, self.guess.t), given])
        return rows / self.row_scale / self.scale.size

    def inverse(self, d: Array) -> Array:
        """K^+ of the residual at the decided rank."""
        parts, _ = split(jax.jacfwd(self.residual)(d), jnp.max(jnp.abs(self.residual(d))), None)
        return parts.inverse


@eqx.filter_custom_jvp
def _closed(closing: _Closing) -> Float[Array, " n"]:
    """A displacement d with r(d) = 0; its derivative is dd = -K^+ dr, the smallest that keeps r at 0."""
    start = jnp.zeros_like(closing.guess.qd)
    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    d = optx.least_squares(lambda d, _: closing.residual(d), solver, start, max_steps=500, throw=False).value
    for _ in range(_POLISHING_STEPS):
        d = d - closing.inverse(d) @ closing.residual(d)
    return d


@_closed.def_jvp
def _closed_jvp(primals: tuple, tangents: tuple) -> tuple[Array, Array]:
    d = _closed(*primals)
    _, change = eqx.filter_jvp(lambda closing: closing.residual(d), primals, tangents)
    return d, -primals[0].inverse(d) @ change


def _position(system: AbstractSystem, guess: State, held: Array, positions: Array) -> tuple[Array, Array]:
    scale = scaling(system, guess, system.jacobian(guess.q, guess.t))
    row_scale = jnp.concatenate([scale.rows, _held_scale(system, held, scale)])
    closing = _Closing(system, guess, held, positions, scale, row_scale)
    d = _closed(closing)
    return system.retract(guess.q, scale.coordinates * d), ~(jnp.abs(closing.residual(d)) <= _tolerance(d))


def _velocity(system: AbstractSystem, state: State, driven: Array, rates: Array) -> tuple[Array, Array]:
    matrix = system.jacobian(state.q, state.t)
    motion, _, turned = second_order(system, state)
    scale = scaling(system, state, matrix, turned)
    row_scale = jnp.concatenate([scale.rows, _held_scale(system, driven, scale)])
    rows = jnp.concatenate([matrix, jnp.eye(state.qd.size, dtype=matrix.dtype)[driven]])
    misfit = jnp.concatenate([motion.rate, state.qd[driven] - rates]) / row_scale
    rows = rows * scale.coordinates / row_scale[:, None]
    drift = jnp.max(jnp.abs(motion.value) / scale.rows) / scale.size
    parts, _ = split(rows, drift, None)
    change = -parts.inverse @ misfit
    qd = state.qd + scale.coordinates * change
    speed = jnp.max(jnp.abs(qd / scale.coordinates)) + jnp.max(jnp.abs(misfit))
    return qd, ~(jnp.abs(misfit + rows @ change) <= _tolerance(qd) * speed)


def _held_scale(system: AbstractSystem, held: Array, scale: Scaling) -> Array:
    return jnp.where(jnp.asarray(system.coordinates.angular)[held], 1 / scale.length, 1.0)


def _tolerance(d: Array) -> float:
    return 1000 * d.size * float(jnp.finfo(d.dtype).eps)
