"""What can be said of outputs over all solutions at a state: the whole family lam + N z, with or without friction.

An output is a linear function y = Y_a qdd + Y_lam lam + Y_tau tau. With the minimum-norm responses of `_reduced`,
every solution of (25) is

    x = x_0 + X tau + [0; N z],   tau = law(rho0 + K tau + N_R z),   N_R = N[rows],   z in R^k.

Without friction y is unique iff Y_lam N = 0 (13) and accelerations are if (14) holds. With friction call a slip
*touched* by a column of N if its law reads a load with N_R != 0 there, or one that a touched friction moves through K.
Then

- y is zero if all of Y is: joints carry no such load, as a pin carries no moment;
- y is unique (proved) if Y_lam N = 0, no touched friction moves it, and the other friction has one solution, for
  which the spectral radius of Gamma_ij = max |d law_i / d rho| |K_ij| over the untouched slips below 1 suffices;
- y is not unique (proved) if its derivative dy/dz at a solution is not zero,
      dtau/dz = (I - J K)^-1 J N_R,   J = d law / d rho,
  or another solution along a column of N (`_others`) has another y;
- where touched friction moves y but neither shows a change, no change was found, which proves nothing;
- all else is undecided, such as at rest, where Coulomb friction is set-valued, and what reads a multiplier that has no
  value at a singular position.

Each misfit of a compliance, or h, has one solution (proved) where the spectral radius of the whole Gamma, with the K
of that closure, is below 1: the sweep then contracts in a weighted maximum norm.
"""

import dataclasses
import enum
import functools
from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import Array, Float

from .._closures._closure import Elasticity, minimum_norm
from .._equations._factorisation import Factorisation
from .._solve._reduced import reduce
from .._solve._solution import Solution
from .._system._friction import have_sense
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._json import JSON
from .._tools._module import on_device
from .._tools._numbers import on_numbers, xp
from ._outputs import sizes

_STRUCTURAL = 1e-10  # relative size of a coefficient that is rounding
_STATIONARY = 1e-11


class Verdict(enum.Enum):
    """What is known of an output over all solutions.

    `ZERO` is no result of a mechanism's motion or loads: the joint carries no such load at the state, as a pin carries
    no moment. `NO_CHANGE` is no proof: friction that varies with the self-stress reaches the output, but neither the
    derivative nor the other solutions that were looked at change it.

    ??? example

        ```python
        loads = rx.analyze(mechanism, state).verdicts["reaction"]
        [load.name for load in loads if load.with_friction is rx.Verdict.UNIQUE]
        ```
    """

    UNIQUE = "unique (proved)"
    ZERO = "zero (the joint carries none)"
    NO_CHANGE = "no change found"
    NOT_UNIQUE = "not unique"
    UNDECIDED = "undecided"


@dataclasses.dataclass(frozen=True)
class Judged:
    """The verdicts on one output.

    - `name`: of the output.
    - `without_friction`, `with_friction`: the verdicts; the same for a system without friction.
    - `moved_by`: indices of the self-stress states that were found to move it, with friction where there is some.

    ??? example

        ```python
        for judged in rx.analyze(mechanism, state).verdicts["acceleration"]:
            print(judged.name, judged.with_friction.value, judged.moved_by)
        ```
    """

    name: str
    without_friction: Verdict
    with_friction: Verdict
    moved_by: tuple[int, ...]

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data."""
        return {
            "name": self.name,
            "without_friction": self.without_friction.value,
            "with_friction": self.with_friction.value,
            "moved_by": list(self.moved_by),
        }


@dataclasses.dataclass(frozen=True)
class Family:
    """Concrete figures of the family of solutions at a state, as `family` gives them.

    - `kinds`: kinds of qdd, lam and tau.
    - `stress`: N, shape (m, k), and `stress_rows` N_R, shape (l, k), in units of the multipliers.
    - `response`: X = [A; Lam], shape (n + m, p).
    - `slope`: dtau/dz at the solution, shape (p, k), NaN where there is none.
    - `gamma`: Gamma, shape (p, p), of minimum norm, and `closed_gamma` of the closure.
    - `reads`: which slip's law reads which load, shape (p, l).
    - `length`: L of the mechanism, which makes turns and shifts, moments and forces comparable.
    - `rests`: whether a joint rests whose friction some self-stress sets, even if that of the closure does not.
    - `loose`: accelerations that (7) leaves free, shape (n, d), none where (14) holds.
    - `undetermined`: which multipliers have no value at a singular position, shape (m,).
    - `solution`, `others`: [qdd; lam; tau] of the solution, and a function that gives other ones, some for each column
      of N, shape (k, looks, n + m + p); NaN where there is none.
    """

    kinds: tuple[str, ...]
    stress: np.ndarray
    stress_rows: np.ndarray
    response: np.ndarray
    slope: np.ndarray
    gamma: np.ndarray
    closed_gamma: np.ndarray
    reads: np.ndarray
    length: np.ndarray
    rests: np.ndarray
    loose: np.ndarray
    undetermined: np.ndarray
    solution: np.ndarray
    others: Callable[[], np.ndarray]

    @property
    def radius(self) -> float:
        """Spectral radius of Gamma under the closure; infinite where a law has no known bound."""
        return spectral_radius(self.closed_gamma)

    @functools.cached_property
    def touched(self) -> np.ndarray:
        """Which slips' friction can depend on which self-stress state, shape (p, k)."""
        touched = self.reads.astype(float) @ self.stress_rows.astype(bool) > 0
        moves = (self.gamma > _STRUCTURAL * self.gamma.max(initial=0.0)).astype(float)
        while not np.array_equal(more := touched | (moves @ touched > 0), touched):
            touched = more
        return touched

    @functools.cached_property
    def one_untouched(self) -> bool:
        """Whether the friction that no self-stress touches is proved to have one solution."""
        untouched = ~self.touched.any(axis=1)
        return spectral_radius(self.gamma[np.ix_(untouched, untouched)]) < 1


def family(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    chosen: Elasticity,
    stress: np.ndarray,
    solution: Solution,
    others: Callable[[], np.ndarray],
    sense: Array | None,
) -> Family:
    """The figures of the family, given N, a solution, NaN where there is none, and how to find others."""
    given = on_device(stress), solution.friction
    figures = jax.device_get(_figures(system.anonymous, state, factor, chosen, *given, sense))
    mass, jacobian, length, determinate = jax.device_get(
        (factor.mass, factor.jacobian, factor.length, factor.determinate)
    )
    undetermined = factor.undetermined(chosen.compliance)
    return Family(
        system.names.unknowns.kinds,
        **figures,
        length=length,
        undetermined=np.zeros(len(system.rows), bool) if undetermined is None else np.asarray(undetermined),
        loose=_loose(mass, jacobian, bool(determinate)),
        solution=np.concatenate([solution.acceleration, solution.multipliers, solution.friction]),
        others=others,
    )


@on_numbers
def _figures(
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    chosen: Elasticity,
    stress: Array,
    friction: Array,
    sense: Array | None,
) -> dict:
    reduced = reduce(system, state, factor, minimum_norm(stress.shape[0], state.qd.dtype), sense=sense)
    closed = reduce(system, state, factor, chosen, sense=sense)
    rows = stress[reduced.rows]
    out = {"stress": stress, "stress_rows": rows}
    if reduced.problem is None or closed.problem is None:
        nothing = xp.zeros((0, 0))
        none = {"slope": xp.zeros((0, stress.shape[1])), "reads": nothing}
        size = stress.shape[0] + state.qd.size
        none |= {"response": xp.zeros((size, 0)), "gamma": nothing, "closed_gamma": nothing}
        return {**out, **none, "rests": xp.zeros((), bool)}
    law = reduced.problem.law
    slope = law.slope(closed.problem.loads(friction))
    identity = xp.eye(friction.size, dtype=slope.dtype)
    reached = xp.any(law.largest_changes(rows) > 0, axis=1)
    return {
        **out,
        "response": xp.concatenate(reduced.response.unit),
        "slope": xp.linalg.solve(identity - slope @ reduced.problem.gain, _change_of_loads(slope, rows)),
        "gamma": law.largest_changes(reduced.problem.gain),
        "closed_gamma": law.largest_changes(closed.problem.gain),
        "reads": law.largest_changes(xp.eye(reduced.rows.size)) > 0,
        "rests": xp.any(law.is_open & np.array(have_sense(system.friction)) & reached),
    }


def _change_of_loads(slope: Array, rows: Array) -> Float[Array, "p k"]:
    """J N_R; where changes of the loads cancel, as those of |rho_1 + 2 rho_2| along (2, -1), rounding moves nothing."""
    moved = slope @ rows
    return xp.where(xp.abs(moved) > _STATIONARY * (xp.abs(slope) @ xp.abs(rows)), moved, 0.0)


def _loose(mass: np.ndarray, jacobian: np.ndarray, determinate: bool) -> np.ndarray:
    """Basis (n, d) of null [M; Phi_q], rounding removed."""
    n = mass.shape[0]
    if determinate:
        return np.zeros((n, 0))
    stack = np.concatenate([mass / (np.abs(mass).max() or 1.0), jacobian / (np.abs(jacobian).max() or 1.0)])
    _, sigma, vt = np.linalg.svd(stack)
    kept = np.sum(sigma > 1e-8 * sigma[0])
    return np.where(np.abs(vt[kept:].T) > 1e-8, vt[kept:].T, 0.0)


def judge(family: Family, names: list[str], outputs: np.ndarray, *, solved: bool, at_rest: bool) -> list[Judged]:
    """Verdicts on outputs Y = [Y_a, Y_lam, Y_tau], shape (outputs, n + m + p).

    `solved`: whether the family is that through a solution; `at_rest`: whether a joint with friction rests, so that
    its friction is set-valued.
    """
    size = family.response.shape[0]
    n = size - family.stress.shape[0]
    by_multipliers, by_unknowns, by_friction = outputs[:, n:size], outputs[:, :size], outputs[:, size:]
    direct_size = np.abs(by_multipliers) @ sizes(family.stress, family.kinds[n:size], family.length)
    response_size = sizes(family.response, family.kinds[:size], family.length)
    driven_size = np.abs(by_unknowns) @ response_size + np.abs(by_friction)
    direct = _clean(by_multipliers @ family.stress, direct_size)
    driven = _clean(by_unknowns @ family.response + by_friction, driven_size)
    depends = (direct != 0) | ((driven != 0) @ family.touched.astype(float) > 0)
    moving = direct != 0
    if solved:
        terms = direct_size + driven_size @ np.abs(family.slope)
        moving = depends & (np.abs(direct + driven @ family.slope) > _STATIONARY * terms)
        if np.any(depends & ~moving):
            moving |= depends & _differ(family, outputs)
    known = ~np.any(np.abs(outputs[:, :n] @ family.loose) > 0, axis=1)
    lost = np.any(by_multipliers[:, family.undetermined] != 0, axis=1)
    settled = not at_rest and family.one_untouched
    out = []
    for k, name in enumerate(names):
        alone = with_friction = _simple(bool(outputs[k].any()), bool(known[k]), bool(direct[k].any()))
        if lost[k]:
            alone = with_friction = Verdict.UNDECIDED
        elif family.slope.shape[0] and known[k] and alone is not Verdict.ZERO:
            sure = settled or not driven[k].any()
            with_friction = _with_friction(bool(depends[k].any()), bool(sure), solved, bool(moving[k].any()))
        out.append(Judged(name, alone, with_friction, tuple(int(s) for s in np.flatnonzero(moving[k]))))
    return out


def _simple(carried: bool, known: bool, moved: bool) -> Verdict:
    if not carried:
        return Verdict.ZERO
    return Verdict.NOT_UNIQUE if moved or not known else Verdict.UNIQUE


def _with_friction(depends: bool, sure: bool, solved: bool, moving: bool) -> Verdict:
    if not depends:
        return Verdict.UNIQUE if sure else Verdict.UNDECIDED
    if not solved:
        return Verdict.UNDECIDED
    return Verdict.NOT_UNIQUE if moving else Verdict.NO_CHANGE


def _differ(family: Family, outputs: np.ndarray) -> np.ndarray:
    """Which outputs differ between the solution and others along each self-stress state, shape (outputs, k)."""
    others = family.others()
    change = np.nan_to_num(others - family.solution)
    found = np.nan_to_num(np.vstack([family.solution, *others]))
    size = np.abs(outputs) @ sizes(found.T, family.kinds, family.length).max(axis=1)
    moved = np.abs(np.tensordot(outputs, change, axes=(1, 2))).max(axis=2)
    return moved > np.sqrt(np.finfo(found.dtype).eps) * size[:, None]


def _clean(value: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Coefficients with those that are rounding of their terms set to zero."""
    return np.where(np.abs(value) > _STRUCTURAL * terms, value, 0.0)


def spectral_radius(gamma: np.ndarray) -> float:
    """Of Gamma; infinite where a law has no known bound."""
    if not gamma.size:
        return 0.0
    if not np.all(np.isfinite(gamma)):
        return np.inf
    return float(np.max(np.abs(np.linalg.eigvals(gamma))))
