"""Bricard's mechanism in space, 30 coordinates and 30 rows of rank 29: one solve, and a batch of states.

NumPy is given B = Phi_q M^-1/2, gamma and f = M^-1/2 Q of each state, and takes the pseudoinverse of B:

    qdd = M^-1/2 (B^+ gamma + f - B^+ B f).

The truth are the accelerations of the centres of bars by the one freedom, without constraints.
"""

import jax
import jax.numpy as jnp
import numpy as np
from truth import bricard as truth

import redundax as rx

from .._devices import batched, placed
from ._measure import Program, Row, compare

_RCOND = 1e-10
_CENTRES = {"centres": slice(0, 15)}
_START = -np.pi / 2  # of the angle from bar to bar, where that of the joint is 0


def bricard(size: int) -> list[Row]:
    """One call, and a batch of states."""
    mechanism = rx.mechanisms.bricard()
    turns = np.linspace(0.05, 0.9, size)
    states = _states(mechanism, turns)
    first = jax.tree.map(lambda x: x[0], states)

    def solve(state: rx.State) -> list[jax.Array]:
        solution = rx.solve(mechanism, state)
        return [solution.acceleration, solution.multipliers]

    one, many, given = jax.jit(solve), batched(solve), jax.tree.map(placed, states)
    numpy_one, numpy_many = (_equations(mechanism, states, count) for count in (1, min(size, 2000)))
    calls = [
        Program("NumPy, pinv of B", lambda: _peer(*numpy_one), turns[:1], _truth, _rows),
        Program("redundax, eager", lambda: solve(first), turns[:1], _truth, _row),
        Program("redundax, compiled", lambda: one(first), turns[:1], _truth, _row),
    ]
    batches = [
        Program("NumPy, batched pinv of B", lambda: _peer(*numpy_many), turns[: len(numpy_many[0])], _truth, _rows),
        Program("redundax, all", lambda: many(given), turns, _truth, lambda found, k: _rows(found[0], k)),
    ]
    return [
        *compare("space, one call", calls, repeats=101, kinds=_CENTRES),
        *compare(f"space, {size:,} states", batches, repeats=3, kinds=_CENTRES),
    ]


def _states(mechanism: rx.Mechanism, turns: np.ndarray) -> rx.State:
    """States at turns of the first joint, at 1 rad/s of it."""

    def at(turn: jax.Array) -> rx.State:
        return rx.assemble(mechanism, positions={"A.angle": turn}, rates={"A.angle": 1.0})

    return jax.block_until_ready(jax.jit(jax.vmap(at))(turns))


def _equations(mechanism: rx.Mechanism, states: rx.State, count: int) -> tuple[np.ndarray, ...]:
    """B, gamma, f and M^-1/2 of the first states."""

    def of_one(state: rx.State) -> tuple[jax.Array, jax.Array, jax.Array]:
        factor = rx.factorize(mechanism, state)
        return factor.jacobian, factor.gamma, mechanism.load(state)

    few = jax.tree.map(lambda x: x[:count], states)
    rows, gamma, force = map(np.asarray, jax.jit(jax.vmap(of_one))(few))
    root = 1 / np.sqrt(np.diag(np.asarray(mechanism.mass(few.q[0], jnp.zeros(())))))
    return rows * root, gamma, force * root, root


def _peer(rows: np.ndarray, gamma: np.ndarray, force: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Accelerations of all states."""
    inverse = np.linalg.pinv(rows, rcond=_RCOND)
    off = gamma - np.einsum("sij,sj->si", rows, force)
    return root * (np.einsum("sij,sj->si", inverse, off) + force)


def _truth(turn: float) -> np.ndarray:
    return np.asarray(truth.accelerations(_START + turn, 1.0)).ravel()


def _rows(found: np.ndarray, samples: np.ndarray) -> np.ndarray:
    return np.asarray(found)[samples, :15]


def _row(found: list, samples: np.ndarray) -> np.ndarray:
    return _rows(np.asarray(found[0])[None], samples)
