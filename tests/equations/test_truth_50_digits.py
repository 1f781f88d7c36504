"""Accelerations, multipliers and friction against mpmath at 50 digits, on exact geometry.

Errors are the largest of each kind over the largest true entry of that kind; a run of this file
prints them: `python tests/test_truth_50_digits.py`.
"""

import dataclasses
from fractions import Fraction
from functools import cache

import jax
import numpy as np
import pytest
import registry
from truth import exact, scenes

import redundax as rx

# In millimetres forces times lengths are 2e7 and the minimum-norm moments 35, so that one rounding of the former,
# as in evaluating Phi_q^T lam, is this much of the latter.
TOLERANCE = {"wojtyra2020 in mm": 2e7 / 35 * np.finfo(float).eps}
SOLVERS = {"newton": rx.Newton, "fixed point": rx.FixedPoint}
pytestmark = pytest.mark.filterwarnings("ignore:Argument `(W|misfit)` looks")  # numbers of all sizes


# Closures as exact data ---------------------------------------------------------------------


def irregular(count: int, scale: int = 1) -> tuple:
    """Numbers without a pattern, from -1 to 1 before scaling."""
    return exact.exact(tuple(Fraction((11 * i * i + 5 * i + 2) % 17 - 8, 8) * scale for i in range(count)))


def spread(count: int) -> tuple:
    """Compliances from 1e-6 to 1."""
    return exact.exact(tuple(Fraction(10) ** -((4 * i + 1) % 7) for i in range(count)))


@exact.exactly
def diagonal(numbers: tuple):
    return exact.mp.diag(list(numbers))


@exact.exactly
def coupled(count: int):
    """A full compliance matrix: 2 I + v v^T."""
    v = exact.mp.matrix(list(irregular(count)))
    return v * v.T + 2 * exact.mp.eye(count)


# name -> (W or None, d or None) for m rows
CLOSURES = {
    "minimum norm": lambda m: (None, None),
    "h": lambda m: (None, irregular(m, 20)),
    "compliance": lambda m: (diagonal(spread(m)), irregular(m)),
    "coupled compliance": lambda m: (coupled(m), irregular(m, 30)),
}


def closure_of(name: str, n: int, m: int) -> rx.AbstractClosure:
    """The library's closure for the exact one; the first n entries of h must not matter."""
    compliance, misfit = CLOSURES[name](m)
    if compliance is None:
        h = np.full(n + m, 7.0)
        h[n:] = 0.0 if misfit is None else exact.floats(misfit)
        return rx.MinimumNorm(h)
    return rx.Compliance(exact.floats(compliance), exact.floats(misfit))


# Mechanisms beside those of the registry ----------------------------------------------------


def light(mechanism: exact.Mechanism, factor) -> exact.Mechanism:
    """All bodies but the first lighter by a factor; 0 makes the mass matrix singular."""
    first, *rest = mechanism.bodies
    rest = [dataclasses.replace(body, mass=body.mass * factor, inertia=body.inertia * factor) for body in rest]
    return dataclasses.replace(mechanism, bodies=(first, *rest))


VARIANTS = {
    **registry.MECHANISMS,
    "wojtyra2020 at 2.2": cache(lambda: scenes.wojtyra2020(phi="11/5", rate="-3/2")),
    "wojtyra2020 in mm": cache(lambda: scenes.wojtyra2020(u=1000)),
    "wojtyra2020, light": cache(lambda: light(scenes.wojtyra2020(), exact.exact("1/100000000"))),
    "wojtyra2020, massless": cache(lambda: light(scenes.wojtyra2020(), 0)),
    "slider_crank, massless": cache(lambda: light(scenes.driven_slider_crank(), 0)),
}


@cache
def truth_of(name: str, closure: str, friction: bool) -> exact.Solution:
    mechanism = VARIANTS[name]()
    return mechanism.solve(*CLOSURES[closure](mechanism.m), friction=friction)


def errors(name: str, closure: str, solver: str | None) -> dict[str, float]:
    """Relative errors per kind; `solver` None is without friction."""
    mechanism = VARIANTS[name]()
    truth = truth_of(name, closure, solver is not None)
    system, state = registry.build(mechanism, registry.coulomb if solver else None)
    solution = rx.solve(
        system,
        state,
        closure=closure_of(closure, mechanism.n, mechanism.m),
        solver=SOLVERS[solver or "newton"](),
        throw=False,
    )
    assert solution.result == rx.RESULTS.successful, rx.RESULTS[solution.result]
    values = [truth.acceleration, truth.multipliers, truth.friction]
    parts = [exact.floats(part) if part.rows else np.zeros(0) for part in values]
    return registry.errors_of(solution, (*parts[:2], parts[2] if solver else parts[2][:0]), system)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("name", VARIANTS)
def test_without_friction(name, closure, record_property):
    found = errors(name, closure, None)
    record_property("errors", found)
    assert max(found.values()) <= TOLERANCE.get(name, 1e-13), found


def rubbing():
    """All with Newton's method; the paper's mechanism with the fixed point too, and others if slow."""
    for name in VARIANTS:
        if name != "carriage":
            yield name, "newton"
            slow = () if name.startswith("wojtyra2020") else pytest.mark.slow
            yield pytest.param(name, "fixed point", marks=slow)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize(("name", "solver"), [*rubbing()])
def test_with_friction(name, closure, solver, record_property):
    found = errors(name, closure, solver)
    record_property("errors", found)
    assert max(found.values()) <= TOLERANCE.get(name, 1e-13), found


def main() -> None:
    """Print the errors of every mechanism, closure and solver."""
    jax.config.update("jax_enable_x64", True)
    for name in VARIANTS:
        for closure in CLOSURES:
            for solver in (None, *SOLVERS) if name != "carriage" else (None,):
                try:
                    found = errors(name, closure, solver)
                    line = "  ".join(f"{kind} {error:.0e}" for kind, error in found.items())
                except AssertionError as reason:
                    line = str(reason)[:100]
                print(f"{name:24s}{closure:20s}{solver or 'no friction':13s}{line}", flush=True)


if __name__ == "__main__":
    main()
