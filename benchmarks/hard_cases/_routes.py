"""The routes of the library: how each is called, and what it should have given.

decided       rank from the spectrum, minimum norm, default solver
declared      the same with the rank declared
compliance    closure of given compliance and misfit
fixed point   minimum norm by fixed-point iteration
from x0       minimum norm, default solver from x0 = 0
newton        minimum norm by Newton's method from the solution without friction
open newton   no closure, Newton (38) from x0
factorize     `factorize` alone: accelerations, minimum-norm multipliers by the projector
vmap          `decided` under jit and vmap over all cases of the same structure
in units      the system in other units, turned back
units         minimum norm in other units by `MinimumNorm(units=)`
enumerate     every solution by `frictional_solutions`, a line for each and one if some are missing
forward       derivatives of `decided` by every parameter, `jax.jacfwd`
reverse       the same by `jax.jacrev`
"""

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from truth import exact, friction
from truth.scenes import Parameters

import redundax as rx

from ._case import Case, Exact, parts_of
from ._derivative import differentiated, exact_derivative
from ._library import Outcome, outcome, result_name, senses
from ._truth import answer_near, answers, factors

Run = Callable[[Case, rx.AbstractSystem, rx.State], Outcome | list[Outcome]]


@dataclass(frozen=True)
class Truth:
    """What a route should have given: routes that should give the same share it."""

    closure: str = "minimum norm"
    open: bool = False
    derivative: bool = False

    def kinds(self, case: Case) -> dict[str, np.ndarray]:
        """Kinds of the entries of its answers."""
        return {part: np.tile(kinds, case.path.count if self.derivative else 1) for part, kinds in case.kinds.items()}

    def answers(self, case: Case, mechanism: Exact, parameters: Parameters) -> list[dict]:
        """All exact answers of the route."""
        if self.derivative:
            return [exact_derivative(case.path, case.path.parameters, case.friction)]
        if self.open:
            return [parts_of(friction.open_newton(mechanism, [exact.exact(case.x0)] * (mechanism.n + mechanism.m)))]
        return answers(case, mechanism, parameters, self.closure)

    def near(self, case: Case) -> Callable[[Exact, Parameters, dict], dict | None]:
        """The answer of a neighbouring mechanism."""
        if self.derivative:
            return lambda mechanism, parameters, answer: exact_derivative(case.path, parameters, case.friction)
        if self.open:
            return lambda mechanism, parameters, answer: self.answers(case, mechanism, parameters)[0]
        return lambda mechanism, parameters, answer: answer_near(case, mechanism, parameters, self.closure, answer)


@dataclass(frozen=True)
class Route:
    """How to run a case and what the answers are."""

    name: str
    run: Run
    truth: Truth = Truth()


def timed(call: Callable, repeats: int = 3) -> tuple:
    """The value of a call and the shortest time of some after the first, which may compile."""
    value = jax.block_until_ready(call())
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - start)
    return value, min(seconds)


def solving(options: Callable[[Case], dict]) -> Run:
    """A route through `solve`."""

    def run(case: Case, system: rx.AbstractSystem, state: rx.State) -> Outcome:
        arguments = {"sense": senses(case), "throw": False, **options(case)}
        return outcome(*timed(lambda: rx.solve(system, state, **arguments)))

    return run


def compliance(case: Case) -> dict:
    """The closure of the case."""
    parameters = case.parameters
    return {"closure": rx.Compliance(exact.floats(parameters["compliance"]), exact.floats(parameters["misfit"]))}


def rank(case: Case) -> dict:
    """The true rank."""
    return {"rank": case.exact.rank}


def start(case: Case) -> dict:
    """x0 for Newton's open iteration."""
    return {"closure": None, "x0": case.x0, "solver": rx.Newton()}


def other_units(case: Case) -> dict:
    """The norm in other units."""
    return {"closure": rx.MinimumNorm(units=rx.units.Units(**case.units))}


@eqx.filter_jit
def _factorised(system: rx.AbstractSystem, state: rx.State) -> tuple:
    factor = rx.factorize(system, state)
    stress = factor.self_stress
    return factor.acceleration, factor.multipliers - stress @ factor.multipliers, factor.spectrum, factor.result


def factorised(case: Case, system: rx.AbstractSystem, state: rx.State) -> Outcome:
    """Accelerations of `factorize`, and its multipliers less their self-stress P lam."""
    system = system.anonymous
    (acceleration, multipliers, found, result), seconds = timed(lambda: _factorised(system, state))
    values = {"acceleration": acceleration, "multipliers": multipliers, "friction": np.zeros(0)}
    values = {part: np.asarray(value, np.float64) for part, value in values.items()}
    return Outcome(values, int(found.rank), result_name(result), seconds, float(found.gap))


def in_units(case: Case, system: rx.AbstractSystem, state: rx.State) -> Outcome:
    """Solved in other units and turned back here."""
    units = rx.units.Units(**case.units)
    there, then = rx.units.in_units(system, units), rx.units.state_in_units(state, system, units)
    found = solving(lambda case: {})(case, there, then)
    factor, kinds = factors(case.units), case.kinds
    values = {
        part: entries / np.array([factor[kind] for kind in kinds[part].tolist()])
        for part, entries in found.values.items()
    }
    return dataclasses.replace(found, values=values)


def in_batch(cases: Sequence[Case], built: Sequence[tuple]) -> list[Outcome]:
    """All cases of the same structure in one call."""
    whole = [(system.anonymous, state, senses(case)) for case, (system, state) in zip(cases, built, strict=True)]
    parts = [eqx.partition(one, eqx.is_array) for one in whole]
    stack = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(arrays for arrays, _ in parts))

    def solve(arrays):
        system, state, sense = eqx.combine(arrays, parts[0][1])
        return rx.solve(system, state, sense=sense, throw=False)

    run = jax.jit(jax.vmap(solve))
    solution, seconds = timed(lambda: run(stack))
    solution = jax.tree.map(np.asarray, solution)  # NumPy indexes without compiling
    rows = [jax.tree.map(lambda leaf, row=row: leaf[row], solution) for row in range(len(cases))]
    return [outcome(row, seconds / len(cases)) for row in rows]


def enumerated(case: Case, system: rx.AbstractSystem, state: rx.State) -> list[Outcome]:
    """Every solution that the search finds."""
    start = time.perf_counter()
    found = rx.frictional_solutions(system, state, sense=senses(case))
    return [outcome(solution, time.perf_counter() - start) for solution in found]


def _alone(case: Case, system: rx.AbstractSystem, state: rx.State) -> Outcome:
    return in_batch([case], [(system, state)])[0]


ROUTES = {
    route.name: route
    for route in (
        Route("decided", solving(lambda case: {})),
        Route("declared", solving(rank)),
        Route("compliance", solving(compliance), truth=Truth(closure="compliance")),
        Route("fixed point", solving(lambda case: {"solver": rx.FixedPoint()})),
        Route("newton", solving(lambda case: {"solver": rx.Newton()})),
        Route("from x0", solving(lambda case: {"x0": case.x0})),
        Route("open newton", solving(start), truth=Truth(open=True)),
        Route("factorize", factorised),
        Route("vmap", _alone),
        Route("in units", in_units, truth=Truth(closure="units")),
        Route("units", solving(other_units), truth=Truth(closure="units")),
        Route("enumerate", enumerated),
        Route("forward", differentiated(jax.jacfwd), truth=Truth(derivative=True)),
        Route("reverse", differentiated(jax.jacrev), truth=Truth(derivative=True)),
    )
}
QUICK = ("decided", "compliance", "fixed point", "forward", "reverse")
