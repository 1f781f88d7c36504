"""The library's side of a case: systems from exact data, and what a solve ends with."""

import re
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import registry
from truth import exact

import redundax as rx

from ._case import Case, Exact


@dataclass(frozen=True)
class Outcome:
    """What a route gave.

    Parts of the answer, rank found and gap of the spectrum, message of the result (empty if successful), and seconds
    of one solve.
    """

    values: dict[str, np.ndarray]
    rank: int
    result: str
    seconds: float
    gap: float


def build(case: Case) -> tuple[rx.AbstractSystem, rx.State]:
    """System and state of a case in the precision that holds now."""
    given = case.given
    if not isinstance(given, exact.Mechanism):
        return linear_system(given)
    system, state = registry.build(given, registry.coulomb if case.friction else None)
    return system, rx.State(state.q, 0 * state.qd, state.t) if case.sense else state


def linear_system(given: Exact) -> tuple[rx.AbstractSystem, rx.State]:
    """A linear system at its origin."""
    numbers = (given.jacobian, given.gamma, given.mass_matrix, given.load)
    jacobian, gamma, mass, load = (jnp.asarray(exact.floats(x)) for x in numbers)
    parameters = {"jacobian": jacobian, "gamma": gamma, "load": load}
    system = rx.System(linear_constraint, jnp.diagonal(mass), linear_load, parameters, m=given.m)
    return system, rx.State(jnp.zeros(given.n), jnp.zeros(given.n))


def linear_constraint(q, t, p):
    """J q - gamma t^2 / 2."""
    return p["jacobian"] @ q - p["gamma"] * t**2 / 2


def linear_load(q, qd, t, p):
    """A constant load."""
    return p["load"]


def senses(case: Case) -> jax.Array | None:
    """The sense of slip, where the mechanism is at rest."""
    return jnp.asarray([float(sense) for sense in case.given.senses]) if case.sense else None


def result_name(result) -> str:
    """The first clause of the message of a result, "" if it is successful."""
    name = re.split(r"[.:]", rx.RESULTS[jax.tree.map(jnp.asarray, result)])[0]
    return "" if name == "successful" else name


def values_of(solution: rx.types.Solution) -> dict[str, np.ndarray]:
    """The parts of a solution as float64."""
    parts = (solution.acceleration, solution.multipliers, solution.friction)
    return dict(
        zip(("acceleration", "multipliers", "friction"), (np.asarray(x, np.float64) for x in parts), strict=True)
    )


def outcome(solution: rx.types.Solution, seconds: float) -> Outcome:
    """The outcome that a solution is."""
    name, gap = result_name(solution.result), float(solution.stats.spectrum.gap)
    return Outcome(values_of(solution), int(solution.stats.spectrum.rank), name, seconds, gap)
