"""Radau IIA with three stages: collocation of order 5, stiffly accurate and L-stable, for one vector.

    Z_i = h sum_j a_ij f(t + c_j h, y + Z_j),   y_1 = y + Z_3

Its stages are of order 3: springs and dampers as stiff as constraints leave it an order that methods of one implicit
stage at a time lose. Newton's method takes the Jacobian J at the beginning of the step, so that its first iteration is
the solution of the linear equations there. The error, of order 3, is filtered by (gamma / h - J)^-1.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd edition, Springer 1996, section IV.8.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ._scalars import Flag, Scalar

_ROOT = 6**0.5
STAGES = (4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0
_WEIGHTS = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)
_INVERSE = np.linalg.inv(_WEIGHTS)
_GAMMA = 3 + 3 ** (2 / 3) - 3 ** (1 / 3)  # the real eigenvalue of the inverse
_ERROR = np.array([-13 - 7 * _ROOT, -13 + 7 * _ROOT, -1.0]) / 3
# Newton's iterations at most, the part of the tolerance that they may leave, and the contraction by which they settle.
_NEWTON, _LEFT, _CONTRACTION = 10, 1e-3, 0.3
# Errors by the tolerance of steps that are taken and refused for that.
_TAKEN, _REFUSED = 0.3, 16.0


def weights_at(nodes: tuple[float, ...], s: Scalar) -> Float[Array, " nodes"]:
    """Weights at s of the values at nodes, by which a polynomial passes through them."""
    return jnp.stack([jnp.prod(jnp.stack([(s - b) / (a - b) for b in nodes if b != a])) for a in nodes])


class Collocation(diffrax.AbstractLocalInterpolation):
    """The polynomial through the beginning of a step and its stages, of any tree of arrays."""

    t0: Scalar
    t1: Scalar
    values: PyTree

    def evaluate(self, t0: Scalar, t1: Scalar | None = None, left: bool = True) -> PyTree:
        if t1 is not None:
            return jax.tree.map(lambda a, b: a - b, self.evaluate(t1), self.evaluate(t0))
        s = (t0 - self.t0) / jnp.where(self.t1 > self.t0, self.t1 - self.t0, 1.0)
        weights = weights_at((0.0, *STAGES), s)
        return jax.tree.map(lambda x: jnp.tensordot(weights.astype(x.dtype), x, 1), self.values)


class RadauSteps(diffrax.AbstractAdaptiveSolver):
    """Steps for one vector free of units; `tolerance` is that of a step."""

    tolerance: Scalar
    term_structure = diffrax.AbstractTerm
    interpolation_cls = Collocation

    def order(self, terms: PyTree) -> int:
        return 5

    def error_order(self, terms: PyTree) -> int:
        return 4

    def func(self, terms: PyTree, t0: Scalar, y0: PyTree, args: PyTree) -> Array:
        return terms.vf(t0, y0, args)

    def init(self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree) -> None:
        return None

    def step(
        self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree, solver_state: PyTree, made_jump: Flag
    ) -> tuple[Array, Array, dict[str, Array], None, diffrax.RESULTS]:
        h, m, dtype = t1 - t0, y0.size, y0.dtype
        inverse, places, one = jnp.asarray(_INVERSE, dtype), jnp.asarray(STAGES, dtype), jnp.eye(m, dtype=dtype)
        first, along = jax.linearize(lambda y: terms.vf(t0, y, True), y0)
        slope = jax.vmap(along, out_axes=1)(one)
        newton = jax.scipy.linalg.lu_factor(jnp.kron(inverse / h, one) - jnp.kron(jnp.eye(3, dtype=dtype), slope))

        def size_of(change: Array) -> Array:
            return jax.lax.stop_gradient(jnp.sqrt(jnp.mean(change**2))) / self.tolerance

        def nearer(now: tuple[Array, ...]) -> tuple[Array, ...]:
            stages, before, _, largest = now
            rates = jax.vmap(lambda c, z: terms.vf(t0 + c * h, y0 + z, False))(places, stages)
            change = jax.scipy.linalg.lu_solve(newton, (rates - inverse @ stages / h).ravel()).reshape(3, m)
            size = size_of(change)
            rounding = size < 100 * jnp.finfo(dtype).eps / self.tolerance
            rate = jnp.where(rounding, 0.0, size / before)
            left = jnp.where(rate < 1, size * rate / (1 - jnp.minimum(rate, 0.999)), jnp.inf)
            return stages + change, size, left, jnp.maximum(largest, rate)

        linear = jax.scipy.linalg.lu_solve(newton, jnp.tile(first, 3)).reshape(3, m)
        start = linear, size_of(linear), jnp.full((), jnp.inf, dtype), jnp.zeros((), dtype)
        stages, _, left, rate = jax.lax.fori_loop(
            0, _NEWTON, lambda _, now: jax.lax.cond(now[2] > _LEFT, nearer, lambda now: now, now), start
        )
        error = jnp.linalg.solve(_GAMMA / h * one - slope, first + jnp.asarray(_ERROR, dtype) @ stages / h)
        # The error is at least what brings the next step to a contraction by which Newton's method settles.
        own, least = size_of(error), (rate / _CONTRACTION) ** 2  # about by the square of the step
        least = jnp.where(left <= _LEFT, jnp.minimum(least, _TAKEN), _REFUSED)
        error = jnp.where(jnp.isfinite(own), error * jnp.maximum(1.0, least / jnp.where(own > 0, own, 1.0)), jnp.inf)
        values = y0 + jnp.concatenate([jnp.zeros((1, m), dtype), stages])
        return values[3], error, {"values": values}, None, diffrax.RESULTS.successful
