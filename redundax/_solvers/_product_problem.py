"""The frictional equations of a large scene: K is known by its products, one more right-hand side each.

Linear equations are solved by GMRES, roots are found by sweeps and mixing, and contraction is estimated, not bounded.
"""

from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import Array, Bool, Float

from .._tools._krylov import krylov_solution
from .._tools._linear_map import LinearMap, spectral_radius
from .._tools._module import replace_fields
from .._tools._numbers import Numeric, stop_gradient, xp
from .._tools._value import value
from ._friction_problem import AbstractFrictionProblem, FrictionProblem, Law, Sizes
from ._mixing import Mixing


@value
class ProductProblem(AbstractFrictionProblem):
    """The problem by products of K."""

    @classmethod
    def reached(cls, loads: Array, gain: LinearMap, angular: Array, friction: Sizes) -> Array:
        return loads

    def sized_at(self, tau: Array) -> "ProductProblem":
        friction = Sizes.of(xp.abs(stop_gradient(tau)), self.angular_slips)
        return replace_fields(self, friction_sizes=self.friction_sizes.larger(friction))

    def along(self, rho: Float[Array, " l"], change: Float[Array, " p"]) -> Float[Array, " p"]:
        """law'(rho) K change."""
        return jax.jvp(self.law, (rho,), (self.gain @ change,))[1]

    def solution(self, rho: Array, right: Array) -> Array:
        size = self.friction_size
        return size * krylov_solution(lambda y: y - self.along(rho, size * y) / size, right / size)

    def newton(self, rho: Array, tau: Array) -> tuple[Array, Array]:
        residual = tau - self.law(rho)
        return residual, -self.solution(rho, residual)

    def searched(self, search: Callable[[], Any], rtol: Array | None, start: Array, *, near: bool) -> Any:
        return (Mixing(rtol, first=1.0) if near else Mixing(rtol)).run(self, start)

    def contraction(self, rho: Array) -> Float[Array, ""]:
        size = self.friction_size
        return spectral_radius(lambda y: self.along(rho, size * y) / size, size)

    def contraction_anywhere(self) -> Float[Array, ""]:
        return xp.full((), xp.inf, self.rho0.dtype)

    def contraction_on_way(self, rho: Array) -> Float[Array, ""]:
        return self.contraction(rho)


def friction_problem(
    rho0: Float[Numeric, "... l"], gain: Numeric | LinearMap, law: Law, angular_loads: Bool[Numeric, " l"]
) -> AbstractFrictionProblem:
    """The problem of a gain K, a matrix or a map."""
    kind = ProductProblem if isinstance(gain, LinearMap) else FrictionProblem
    return kind.make(rho0, gain, law, angular_loads)
