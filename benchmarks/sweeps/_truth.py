"""The exact answers, [qdd; lam; tau] at 50 digits, and their derivatives."""

import functools
from collections.abc import Callable

import numpy as np
from truth import exact, friction, scenes


def _numbers(solution: exact.Solution) -> list:
    return [*solution.acceleration, *solution.multipliers, *solution.friction]


def _mechanism(length: float = 0.1, mu_rho: float = 0.02) -> exact.Mechanism:
    return scenes.wojtyra(scenes.wojtyra_parameters(length, mu_rho=(mu_rho,) * 4))


@exact.exactly
def _at_h(mechanism: exact.Mechanism, h: float) -> list:
    return _numbers(mechanism.solve(misfit=[h] * mechanism.m))


@exact.exactly
def _of_h(h: float) -> list:
    return _at_h(_mechanism(), h)


@exact.exactly
def _of_mu_rho(mu_rho: float) -> list:
    return _numbers(_mechanism(mu_rho=mu_rho).solve())


@exact.exactly
def _of_length(length: float) -> list:
    return _numbers(_mechanism(length).solve())


@exact.exactly
def _of_length_without_friction(length: float) -> list:
    return _numbers(_mechanism(length).solve(friction=False))


@exact.exactly
def _of_u(u: float) -> list:
    return _numbers(scenes.wojtyra2020(u=u).solve(friction=False))


@exact.exactly
def _of_x0(x0: float) -> list:
    return _numbers(friction.open_newton(scenes.wojtyra2020(), [x0] * 24))


def _as_floats(function: Callable) -> Callable[[float], np.ndarray]:
    return functools.cache(lambda value: exact.floats(tuple(function(value))))


h, mu_rho, length, length_without_friction, u, x0 = map(
    _as_floats, (_of_h, _of_mu_rho, _of_length, _of_length_without_friction, _of_u, _of_x0)
)


def over_h(mechanism: exact.Mechanism) -> Callable[[float], np.ndarray]:
    """The answer of a mechanism at h."""
    return _as_floats(functools.partial(_at_h, mechanism))


def slope(name: str) -> Callable[[float], np.ndarray]:
    """The derivative with respect to `h`, `mu_rho` or `length`, by a central difference of 1e-15 at 50 digits."""
    function = {"h": _of_h, "mu_rho": _of_mu_rho, "length": _of_length}[name]

    @exact.exactly
    def difference(value: float) -> list:
        step = exact.mp.mpf(10) ** -15
        pairs = zip(function(exact.exact(value) + step), function(exact.exact(value) - step), strict=True)
        return [(after - before) / (2 * step) for after, before in pairs]

    return _as_floats(difference)
