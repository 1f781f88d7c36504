"""Laws that every answer must satisfy, judged on equations that the library has no part in.

All is measured in scaled variables, forces throughout: with S the length L and 1 for linear and angular coordinates,
D the row norms of Phi_q S, K = D^-1 Phi_q S and w the largest entry of S M S,

    x = [w S^-1 qdd; D lam],    J = [[S M S / w, K^T - E_s law'], [K, P W_s / |W_s|]],    J dx = d(right-hand side).

P projects onto the self-stress states by the rank known by construction. The closure stands in the rows of K because
K qdd and P W lam are orthogonal. J is square and regular where the answer is isolated, and gives the tolerances:

    |residual| <= C (n + m) eps (|J| |x| + |b|),    |error of x| <= C (n + m) eps (|J| |x| + |b|) / sigma_min(J),

with |b| the sum of the absolute values of the terms of the right-hand side and C = 10 for the rounding of sums.
Forces balance less well where singular values are not well separated, by the reach sigma_1 / sigma_r beyond 1000: rows
of the projector onto the self-stress that are rounding, eps sigma_1 / sigma_r, are taken for the zeros that most are.
A law is a ratio of error to tolerance for each sample, at most 1 where it holds, 0 where the result is flagged.
"""

from dataclasses import dataclass

import numpy as np
from truth import equations
from truth.description import Structure
from truth.equations import places_of_rows

from .library import Answers, Problem

_ROUNDINGS = 10
# What the design calls well separated and contracting.
SEPARATED, CONTRACTS = 1e-3, 0.9

Ratios = dict[str, np.ndarray]


def _norm(v: np.ndarray) -> np.ndarray:
    return np.linalg.norm(v, axis=1)


def _times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return (matrix @ vector[..., None])[..., 0]


@dataclass(frozen=True)
class Scaled:
    """A problem in scaled variables; all arrays have a leading batch axis.

    - `coordinates` S, `rows` D, `weight` w, `k` K, `singular_values` of K, `stress` P, `soft` W_s / |W_s|.
    - `unit`: eps times C (n + m).
    """

    problem: Problem
    coordinates: np.ndarray
    rows: np.ndarray
    weight: np.ndarray
    k: np.ndarray
    singular_values: np.ndarray
    stress: np.ndarray
    soft: np.ndarray
    softness: np.ndarray
    unit: float

    @property
    def separated(self) -> np.ndarray:
        """Whether the smallest kept singular value is clear of rounding."""
        sigma = self.singular_values
        return sigma[:, self.problem.structure.rank - 1] > SEPARATED * sigma[:, 0]

    def unknown(self, answers: Answers) -> np.ndarray:
        """x, zero where the result is flagged."""
        motion = self.weight[:, None] * answers.acceleration / self.coordinates
        return np.nan_to_num(np.concatenate([motion, self.rows * answers.multipliers], axis=1))


def scaled(problem: Problem) -> Scaled:
    """The scaled problem."""
    equations, structure = problem.equations, problem.structure
    length, bodies = problem.parameters.raw["length"], len(structure.bodies)
    coordinates = np.concatenate([np.repeat(length[:, None], 2 * bodies, 1), np.ones((len(length), bodies))], axis=1)
    k = equations.jacobian * coordinates[:, None]
    rows = np.linalg.norm(k, axis=2)
    k = k / rows[..., None]
    u, sigma, _ = np.linalg.svd(k, full_matrices=False)
    kept = u[:, :, : structure.rank]
    stress = np.eye(structure.m) - kept @ kept.swapaxes(1, 2)
    soft = problem.compliance / rows**2
    softness = soft.max(axis=1)
    return Scaled(
        problem=problem,
        coordinates=coordinates,
        rows=rows,
        weight=np.max(equations.mass * coordinates**2, axis=1),
        k=k,
        singular_values=sigma,
        stress=stress,
        soft=soft / softness[:, None],
        softness=softness,
        unit=_ROUNDINGS * (structure.n + structure.m) * np.finfo(float).eps,
    )


# Friction by its definition ------------------------------------------------------------------


def friction_law(problem: Problem, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """tau (batch, p), its derivative by the multipliers (batch, p, m), and the largest it can be for their size."""
    sense, sqrt = np.sign(problem.equations.slip_rate), problem.poses.real.sqrt
    return equations.friction_law(problem.structure, problem.parameters, sense, multipliers, sqrt)


def _carried(s: Scaled, first: int, part: np.ndarray) -> np.ndarray:
    """Multipliers that each column of a right-hand side causes, (batch, m, columns), given from a first row on."""
    n, p, m = s.problem.structure.n, len(s.problem.structure.frictional), s.problem.structure.m
    right = np.zeros((len(part), n + m, part.shape[2]))
    right[:, first : first + part.shape[1]] = part
    return np.linalg.solve(jacobian(s, np.zeros((len(part), p, m))), right)[:, n:] / s.rows[..., None]


def by_friction(s: Scaled) -> np.ndarray:
    """Multipliers that unit frictions cause, (batch, m, p)."""
    return _carried(s, 0, s.coordinates[..., None] * s.problem.equations.direction)


def by_misfit(s: Scaled) -> np.ndarray:
    """Multipliers that unit misfits cause, (batch, m, m)."""
    return _carried(s, s.problem.structure.n, s.stress / (s.rows * s.softness[:, None])[:, None])


def contraction(s: Scaled) -> np.ndarray:
    """Spectral radius of Gamma_ij = coefficient_i |d(normal load i) / d tau_j|: below 1 the answer is the only one."""
    structure = s.problem.structure
    count = len(structure.frictional)
    if not count:
        return np.zeros(len(s.rows))
    rows, effect = places_of_rows(structure), by_friction(s)
    gamma = np.zeros((len(effect), count, count))
    for place, k in enumerate(structure.frictional):
        joint, own = structure.joints[k], s.problem.parameters.joints[k]
        if joint.friction == "constant":
            continue
        parts = [effect[:, rows[k, c]] for c in range(2 if joint.kind != "pin" else 1)]
        if joint.kind == "translational":
            couple = parts[1] / own["guide_length"][:, None]
            size = np.abs(parts[0] / 2 + couple) + np.abs(parts[0] / 2 - couple)
        else:
            size = np.sqrt(sum(part**2 for part in parts))
        gamma[:, place] = own["coefficient"][:, None] * size
    return np.max(np.abs(np.linalg.eigvals(gamma)), axis=1)


def jacobian(s: Scaled, slope: np.ndarray) -> np.ndarray:
    """J for a slope of the friction law by the multipliers (batch, p, m)."""
    n, m, batch = s.problem.structure.n, s.problem.structure.m, len(s.rows)
    matrix = np.zeros((batch, n + m, n + m))
    mass = s.problem.equations.mass * s.coordinates**2 / s.weight[:, None]
    matrix[:, range(n), range(n)] = mass
    direction = s.coordinates[..., None] * s.problem.equations.direction
    matrix[:, :n, n:] = s.k.swapaxes(1, 2) - direction @ (slope / s.rows[:, None])
    matrix[:, n:, :n] = s.k
    matrix[:, n:, n:] = s.stress * s.soft[:, None]
    return matrix


# Laws of one answer --------------------------------------------------------------------------


@dataclass(frozen=True)
class Judged:
    """Ratios of error to tolerance of every law, x, the tolerance of its error, and whether a flag would be false."""

    ratios: Ratios
    x: np.ndarray
    tolerance: np.ndarray
    clear: np.ndarray
    condition: np.ndarray


def judge(problem: Problem, answers: Answers) -> Judged:
    """All laws of one batch of answers."""
    s, good = scaled(problem), answers.successful
    x, n = s.unknown(answers), problem.structure.n
    tau, lam = np.nan_to_num(answers.tau), np.nan_to_num(answers.multipliers)
    law, slope, bound = friction_law(problem, lam)
    matrix = jacobian(s, slope)
    sizes = _terms(s, tau)
    sigma = np.linalg.svd(matrix, compute_uv=False)
    whole = sigma[:, 0] * _norm(x) + sum(sizes)
    residual = _times(jacobian(s, np.zeros_like(slope)), x) - _right(s, tau)
    motion, kinematic = residual[:, :n], residual[:, n:]
    along = _times(s.stress, kinematic)
    reach = s.singular_values[:, 0] / s.singular_values[:, problem.structure.rank - 1]
    limit = s.unit * np.where(whole > 0, whole, 1.0)
    ratios = {
        "motion": _norm(motion) / (limit * np.maximum(1.0, SEPARATED * reach)),
        "kinematics": _norm(kinematic - along) / limit,
        "closure": _norm(along) / (limit * reach),
        "rank": np.where(answers.rank == problem.structure.rank, 0.0, np.inf),
        "energy": _energy(s, answers),
    }
    if tau.shape[1]:
        ratios["friction law"] = _friction(s, tau, lam, (law, slope, bound))
        ratios["dissipation"] = np.where(np.all(tau * problem.equations.slip_rate <= 0, axis=1), 0.0, np.inf)
    tolerance = limit / sigma[:, -1]
    clear = s.separated & (contraction(s) < CONTRACTS)
    ratios = {name: np.where(good, ratio, 0.0) for name, ratio in ratios.items()}
    ratios["false flag"] = np.where(clear & ~good, np.inf, 0.0)
    return Judged(ratios, x, tolerance, clear, sigma[:, 0] / sigma[:, -1])


def _right(s: Scaled, tau: np.ndarray) -> np.ndarray:
    equations = s.problem.equations
    force = s.coordinates * (equations.load + _times(equations.direction, tau))
    misfit = s.problem.misfit / s.rows / s.softness[:, None]
    gamma = s.weight[:, None] * equations.gamma / s.rows
    # the self-stress part of gamma is rounding of the velocity; it belongs to no law but that of the flags
    return np.concatenate([force, gamma - _times(s.stress, gamma) + _times(s.stress, misfit)], axis=1)


def _terms(s: Scaled, tau: np.ndarray) -> tuple[np.ndarray, ...]:
    """Sizes of the terms of the right-hand side."""
    equations = s.problem.equations
    return (
        _norm(s.coordinates * equations.load_size),
        _norm(s.coordinates * _times(np.abs(equations.direction), np.abs(tau))),
        _norm(s.weight[:, None] * equations.gamma_size / s.rows),
        _norm(s.problem.misfit / s.rows / s.softness[:, None]),
    )


def _energy(s: Scaled, answers: Answers) -> np.ndarray:
    """d/dt of the kinetic energy = power of loads, friction and drives.

    Rounding leaves rates of the size of all rates in locked bodies too, where loads may be large: sizes are norms.
    """
    equations = s.problem.equations
    inertia = equations.mass * answers.acceleration
    balance = (
        np.sum(inertia * equations.qd, axis=1)
        - equations.power
        - np.sum(answers.tau * equations.slip_rate, axis=1)
        - np.sum(answers.multipliers * equations.explicit, axis=1)
    )
    forces = (
        np.abs(inertia)
        + equations.load_size
        + _times(np.abs(equations.jacobian).swapaxes(1, 2), np.abs(answers.multipliers))
        + _times(np.abs(equations.direction), np.abs(answers.tau))
    )
    size = _norm(equations.qd / s.coordinates) * _norm(s.coordinates * forces)
    return np.abs(balance) / (s.unit * np.where(size > 0, size, 1.0))


def _friction(s: Scaled, tau: np.ndarray, lam: np.ndarray, friction: tuple[np.ndarray, ...]) -> np.ndarray:
    """tau = law(loads), each kind against its largest.

    Loads are sums, of those that load, each misfit and each friction cause: small ones keep the rounding of the terms.
    """
    (law, slope, bound), joints = friction, s.problem.structure.joints
    causes = (by_friction(s), tau), (by_misfit(s), s.problem.misfit)
    rest = lam - sum(_times(effect, cause) for effect, cause in causes)
    terms = np.abs(rest) + sum(_times(np.abs(effect), np.abs(cause)) for effect, cause in causes)
    rounding = np.finfo(float).eps * _times(np.abs(slope), terms)
    unit = max(s.unit, 100 * np.finfo(float).eps)
    angular = np.array([joints[k].kind == "revolute" for k in s.problem.structure.frictional])
    ratios = np.zeros(len(tau))
    for kind in (angular, ~angular):
        if np.any(kind):
            size = unit * np.max(bound[:, kind], axis=1) + _ROUNDINGS * np.max(rounding[:, kind], axis=1)
            error = np.max(np.abs(tau - law)[:, kind], axis=1)
            ratios = np.maximum(ratios, error / np.where(size > 0, size, unit))
    return ratios


def judge_inverse(problem: Problem, stress: np.ndarray, x: np.ndarray, lam: np.ndarray) -> Ratios:
    """Penrose's conditions on P and on the first n columns of A^+, [X; L - P L], in the units of the problem.

    P = P^T = P P, P Phi_q = 0, tr P = k;   X = X^T = X M X, Phi_q X = 0, M X + Phi_q^T L = I.
    Tolerances grow with the condition of A on its range.
    """
    equations, structure = problem.equations, problem.structure
    jac, mass = equations.jacobian, equations.mass
    n, m, batch = structure.n, structure.m, len(jac)
    matrix = np.zeros((batch, n + m, n + m))
    matrix[:, range(n), range(n)] = mass
    matrix[:, :n, n:], matrix[:, n:, :n] = jac.swapaxes(1, 2), jac
    values = np.sort(np.abs(np.linalg.eigvalsh(matrix)), axis=1)
    unit = _ROUNDINGS * (n + m) * np.finfo(float).eps * (values[:, -1] / values[:, structure.redundancy])

    def ratio(error: np.ndarray, *sizes: np.ndarray) -> np.ndarray:
        norm = sum(np.linalg.norm(size, axis=(1, 2)) for size in sizes)
        return np.linalg.norm(error, axis=(1, 2)) / (unit * np.where(norm > 0, norm, 1.0))  # X = 0 where all is locked

    moved, transposed = mass[..., None] * x, x.swapaxes(1, 2)
    carried = jac.swapaxes(1, 2) @ lam
    ones = np.broadcast_to(np.eye(m), stress.shape)
    return {
        "P symmetric": ratio(stress - stress.swapaxes(1, 2), ones),
        "P idempotent": ratio(stress @ stress - stress, ones),
        "P self-stress": ratio(stress @ jac, jac),
        "trace P": np.abs(np.trace(stress, axis1=1, axis2=2) - structure.redundancy) / (unit * m),
        "X symmetric": ratio(x - transposed, x),
        "X generalised inverse": ratio(x @ moved - x, x),
        "X admissible": ratio(jac @ x, np.linalg.norm(jac, axis=(1, 2), keepdims=True) * x),
        "forces carried": ratio(moved + carried - np.eye(n), moved, carried),
    }


# Laws of two answers -------------------------------------------------------------------------


def same_places(structure: Structure, other: Structure) -> tuple[list[int], list[int]]:
    """For every coordinate and row of the structure, its place in the other, which is in another order."""
    bodies = [other.bodies.index(b) for b in structure.bodies]
    coordinates = [2 * b + c for b in bodies for c in range(2)] + [2 * len(bodies) + b for b in bodies]
    free = list(range(len(other.joints)))
    joints = []
    for joint in structure.joints:
        joints.append(next(k for k in free if other.joints[k] == joint))
        free.remove(joints[-1])
    rows = places_of_rows(other)
    return coordinates, [rows[joints[k], part] for k, part, _ in structure.rows]


def moved(answers: Answers, coordinates: list[int], rows: list[int]) -> np.ndarray:
    """Accelerations and multipliers (batch, n + m) of those places."""
    return np.concatenate([answers.acceleration[:, coordinates], answers.multipliers[:, rows]], axis=1)
