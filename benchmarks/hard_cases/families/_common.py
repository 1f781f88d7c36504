"""Numbers without a pattern that several families use."""

from fractions import Fraction
from typing import Any

from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import cranks, cranks_parameters, wojtyra, wojtyra_parameters

from .._case import Case


def irregular(count: int, scale: object = 1) -> tuple:
    """Numbers from -1 to 1, times a scale; none is zero."""
    scale = exact.exact(scale)
    return tuple(scale * exact.exact(Fraction(2 * ((11 * i * i + 5 * i + 2) % 17) - 15, 17)) for i in range(count))


@exactly
def spread(count: int, decades: int = 6) -> tuple:
    """Numbers from 10^-decades to 1."""
    steps = 7
    return tuple(mp.mpf(10) ** (-mp.mpf(decades) * ((4 * i + 1) % steps) / (steps - 1)) for i in range(count))


def closed(parameters: dict, rows: int, decades: int = 6, misfit: object = "1e-3") -> dict:
    """The parameters with a compliance and a misfit of every row."""
    return {**parameters, "compliance": spread(rows, decades), "misfit": irregular(rows, misfit)}


def paper(
    family: str, name: str, routes: tuple[str, ...], *, friction: bool = True, options: dict | None = None, **p: Any
) -> Case:
    """The paper's mechanism with some parameters changed."""
    parameters = closed(wojtyra_parameters(**p), 12)
    return Case(family, name, wojtyra, parameters, routes, friction=friction, **(options or {}))


def linkage(
    family: str,
    name: str,
    routes: tuple[str, ...],
    count: int = 3,
    *,
    friction: bool = False,
    options: dict | None = None,
    **p: Any,
) -> Case:
    """Cranks and a coupler, with some parameters changed."""
    if friction:
        p = {"mu_rho": tuple(f"1/{100 + 20 * c}" for c in range(2 * count)), **p}
    parameters = closed(cranks_parameters(count, **p), 4 * count)
    return Case(family, name, cranks, parameters, routes, friction=friction, **(options or {}))
