"""Random mechanisms as `rx.Mechanism`, built and solved in batches by redundax."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from builder import build
from truth.description import Parameters, Structure
from truth.equations import Equations, Poses

import redundax as rx

NAMES = (
    "successful",
    "violated_constraints",
    "inadmissible_velocity",
    "inconsistent_constraints",
    "ambiguous_rank",
    "indeterminate_acceleration",
    "indeterminate_closure",
    "unsolved",
    "not_finite",
    "friction_at_rest",
    "no_contraction",
    "no_solution_found",
    "max_steps_reached",
    "diverged",
)


@dataclass(frozen=True)
class Problem:
    """A batch of random mechanisms at their states, with a compliance and a misfit (batch, m) for every row."""

    structure: Structure
    parameters: Parameters
    poses: Poses
    equations: Equations
    compliance: np.ndarray
    misfit: np.ndarray

    @property
    def state(self) -> rx.State:
        """The states of the batch."""
        return rx.State(self.poses.q, self.equations.qd, self.poses.t)


@dataclass(frozen=True)
class Answers:
    """What redundax says of a batch; `tau` in the order of the joints, `result` as places in `NAMES`."""

    acceleration: np.ndarray
    multipliers: np.ndarray
    tau: np.ndarray
    result: np.ndarray
    rank: np.ndarray
    contraction: np.ndarray
    spectrum: np.ndarray

    @property
    def successful(self) -> np.ndarray:
        """Which samples have numbers."""
        return self.result == 0

    @classmethod
    def of(cls, solution: rx.types.Solution, tau_order: Sequence[int]) -> "Answers":
        """Answers from a batched solution and the places of its slips."""
        result = np.argmax([np.asarray(solution.result == getattr(rx.RESULTS, name)) for name in NAMES], axis=0)
        stats = solution.stats
        return cls(
            np.asarray(solution.acceleration),
            np.asarray(solution.multipliers),
            np.asarray(solution.friction)[:, tau_order],
            result,
            np.asarray(stats.rank),
            np.asarray(stats.contraction),
            np.asarray(stats.spectrum.singular_values),
        )


_LOADS = ("force", "moment", "point_i", "point_j", "stiffness", "damping", "free", "gravity", "length")


def mechanisms(structure: Structure, parameters: Parameters) -> rx.Mechanism:
    """One `rx.Mechanism` whose floating-point arrays have a leading batch axis."""
    raw = {name: parameters.raw[name] for name in _LOADS}
    numbers = jax.tree.map(jnp.asarray, (raw, parameters.joints, parameters.mass, parameters.inertia))
    batch = eqx.filter_vmap(lambda *numbers: build(structure, Parameters(*numbers)))(*numbers)
    return jax.tree.map(lambda x: x if eqx.is_inexact_array(x) or not eqx.is_array(x) else x[0], batch)


@eqx.filter_jit
def _solve(mechanism: rx.Mechanism, state: rx.State, W: Any, d: Any, units: rx.units.Units | None) -> rx.types.Solution:
    numbers, rest = eqx.partition(mechanism, eqx.is_inexact_array)

    def one(numbers: Any, state: rx.State, W: Any, d: Any, units: rx.units.Units | None) -> rx.types.Solution:
        system = eqx.combine(numbers, rest)
        if units is None:
            return rx.solve(system, state, closure=rx.Compliance(W, d), throw=False)
        scale = units.of(system.rows)
        closure = rx.Compliance(scale**2 * W / units.energy, scale * d)
        other = rx.units.state_in_units(state, system, units)
        return rx.units.solution_from_units(
            rx.solve(rx.units.in_units(system, units), other, closure=closure, throw=False), system, units
        )

    return jax.vmap(one)(numbers, state, W, d, units)


def solve(problem: Problem, units: rx.units.Units | None = None) -> Answers:
    """The answers of redundax, computed in other units if some are given (batched)."""
    mechanism = mechanisms(problem.structure, problem.parameters)
    slips = [name for group in mechanism.friction for name in group.slips.names or ()]
    order = [slips.index(f"joint {k}") for k in problem.structure.frictional]
    closure = jnp.asarray(problem.compliance), jnp.asarray(problem.misfit)
    solution = _solve(mechanism.anonymous, problem.state, *closure, units)
    return Answers.of(solution, order)


@eqx.filter_jit
def _inverse(mechanism: rx.Mechanism, state: rx.State) -> tuple[Any, Any, Any]:
    numbers, rest = eqx.partition(mechanism, eqx.is_inexact_array)

    def one(numbers: Any, state: rx.State) -> tuple[Any, Any, Any]:
        factor = rx.factorize(eqx.combine(numbers, rest), state)
        return factor.self_stress, *factor.respond(jnp.eye(state.qd.size))

    return jax.vmap(one)(numbers, state)


def inverse(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P, and the accelerations and multipliers that unit forces cause, the columns of A^+ but for self-stress."""
    mechanism = mechanisms(problem.structure, problem.parameters).anonymous
    stress, acceleration, multipliers = (np.asarray(x) for x in _inverse(mechanism, problem.state))
    return stress, acceleration, multipliers
