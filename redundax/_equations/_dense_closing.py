"""The position problem of an assembly with dense matrices

Levenberg-Marquardt finds where Newton steps begin. In space d turns a body by less than half a turn: passes of it, each
about the position that the one before found, take it farther, and Newton steps finish from there.
"""

from typing import NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._numbers import Numeric, fori_loop, of_model, stop_gradient, take, while_loop, xp
from ._closing import AbstractClosing, Along, beside, with_own
from ._kinematics import model_at
from ._pseudoinverse import DensePseudoinverse, dense_pseudoinverse
from ._scaling import Scaling, scaling

_PASSES = 3
_DESCENT_STEPS, _SETTLED = 500, 1e-8  # at most, and relative changes that end it: Newton steps that follow square them
_LEAST_DAMPING, _MOST_DAMPING = 1e-10, 1e20  # less leaves redundant rows no factor; at the most no step descends


@of_model
def closing_at(system: AbstractSystem, q: Numeric, d: Numeric, t: Numeric) -> tuple[Numeric, Numeric, Numeric]:
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


class DenseClosing(AbstractClosing):
    """The position problem of dense matrices."""

    def linearised(self, d: Array) -> tuple[Array, Array]:
        """The residual at q [+] S d and its slope."""
        m, step = len(self.system.rows), self.scale.coordinates * d
        which = xp.concatenate([np.arange(m), m + self.held])
        _, values, slopes = closing_at(self.system, self.guess.q, step, self.guess.t)
        values, slopes = take(values, which), take(slopes, which)
        given = beside(self.system, values[m:], self.positions, self.held)
        residual = xp.concatenate([values[:m], given]) / self.row_scale
        return residual, slopes * self.scale.coordinates / self.row_scale[:, None]

    @staticmethod
    def scaling(system: AbstractSystem, state: State) -> Scaling:
        return scaling(system, model_at(system, state))

    def begun(self) -> Self:
        if self.system.adds:
            return self

        def moved(_: Numeric, q: Array) -> Array:
            guess = replace_fields(self.guess, q=q)
            still = stop_gradient(self.of(self.system, guess, self.held, self.positions))
            return replace_fields(still, guess=guess).moved(_descent(still))  # whose derivative is that of q

        q = fori_loop(0, _PASSES, moved, self.guess.q)
        return self.of(self.system, replace_fields(self.guess, q=q), self.held, self.positions)

    def start(self) -> Array:
        return _descent(self) if self.system.adds else xp.zeros_like(self.guess.qd)  # passes are at its end

    def moved(self, d: Array) -> Array:
        step = self.scale.coordinates * d
        return self.guess.q + step if self.system.adds else closing_at(self.system, self.guess.q, step, self.guess.t)[0]

    def residual(self, d: Array) -> Array:
        return self.linearised(d)[0]

    def inverse(self, d: Array) -> DensePseudoinverse:
        residual, slopes = self.linearised(d)
        return dense_pseudoinverse(slopes, xp.max(xp.abs(residual)) / self.scale.size)

    @classmethod
    def along(cls, system: AbstractSystem, state: State, driven: Array) -> Along:
        model = model_at(system, state)
        scale = scaling(system, model)

        def inverse(slopes: Array, violation: Array) -> DensePseudoinverse:
            return dense_pseudoinverse(xp.concatenate([scale.scaled(model.jacobian), slopes]), violation)

        still = xp.zeros_like(state.qd)
        slopes = xp.zeros((0, still.size), still.dtype)
        if driven.size:
            every = closing_at(system, state.q, still, state.t)[2]
            slopes = with_own(driven, take(every[len(system.rows) :], driven))
        return Along(model.motion, scale, slopes, inverse)


class _Descent(NamedTuple):
    """u = d / size, the residual there and its slope, the damping, the number of steps, and whether it is the end."""

    u: Float[Array, " n"]
    residual: Float[Array, " rows"]
    slope: Float[Array, "rows n"]
    damping: Float[Array, ""]
    steps: Int[Array, ""]
    ended: Bool[Array, ""]


def _descent(closing: DenseClosing) -> Float[Array, " n"]:
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
