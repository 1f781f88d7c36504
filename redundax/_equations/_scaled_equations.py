"""The solution of (7) in scaled variables, and what it leaves and reaches."""

from jaxtyping import Array, Float

from .._tools._numbers import or_one, xp
from ._evidence import ratio


def residual_of(
    matrix: Float[Array, "r n"],
    mass: Float[Array, "n n"],
    wanted: tuple[Float[Array, " n"], Float[Array, " r"]],
    found: tuple[Float[Array, " n"], Float[Array, " r"]],
    centripetal: Float[Array, ""],
) -> Float[Array, ""]:
    """Largest residual of both blocks of (7), relative to their terms, and to the accelerations without constraints."""
    (force, gamma), (a, mu) = wanted, found
    return xp.maximum(
        ratio(gamma - matrix @ a, gamma, a, centripetal, _unconstrained(mass, force)),
        ratio(force - mass @ a - matrix.T @ mu, force, mass @ a, mu, mass * centripetal),
    )


def reached_by(
    mass: Float[Array, "n n"], force: Float[Array, " n"], a: Float[Array, " n"], size: Float[Array, ""]
) -> Float[Array, ""]:
    """The velocity that accelerations, or those without constraints, reach over the size of the mechanism."""
    return xp.sqrt(size * (xp.max(xp.abs(a)) + _unconstrained(mass, force)))


def _unconstrained(mass: Float[Array, "n n"], force: Float[Array, " n"]) -> Float[Array, ""]:
    """The size of accelerations without constraints, of the mean inertia; none without inertia."""
    inertia = xp.sum(xp.diagonal(mass)) / force.size
    return xp.where(inertia > 0, xp.max(xp.abs(force)) / or_one(inertia), 0.0)


def refined(
    matrix: Float[Array, "r n"],
    mass: Float[Array, "n n"],
    inverse: Float[Array, "n r"],
    response: Float[Array, "n n"],
    wanted: tuple[Float[Array, "n ..."], Float[Array, "r ..."]],
) -> tuple[Float[Array, "n ..."], Float[Array, "r ..."]]:
    """Accelerations and multipliers of forces and gamma, after one step of iterative refinement."""

    def once(force: Array, gamma: Array) -> tuple[Array, Array]:
        particular = inverse @ gamma
        a = particular + response @ (force - mass @ particular)
        return a, inverse.T @ (force - mass @ a)

    force, gamma = wanted
    a, mu = once(force, gamma)
    da, dmu = once(force - mass @ a - matrix.T @ mu, gamma - matrix @ a)
    return a + da, mu + dmu
