"""All solutions of the frictional equations, their contraction, and Newton's open iteration, to 50 digits.

With R_i = b_i + S_i tau the force of revolute i under a closure, tau_i = -mu_rho_i |R_i| sgn(omega_i) implies

    tau_i^2 - mu_rho_i^2 |b_i + S_i tau|^2 = 0,      i = 1 .. p:

p quadratics with at most 2^p isolated complex solutions, counted with their multiplicity and those at infinity. A
total-degree homotopy follows every one of them from y_i = +-1,

    H(y, s) = (1 - s) c (y_i^2 - y_0^2) + s f_i(y_0, y),   a . (y_0, y) = 1,   s from 0 to 1,

in homogeneous coordinates tau = scale y / y_0 and with random complex c and a, so that no path meets a singular point
on its way but with probability zero, and none runs away. The real ends with tau_i sgn(omega_i) <= 0 are the
solutions; Newton's method at 50 digits polishes them.
"""

import numpy as np
from mpmath import mp

from . import exact
from .exact import exactly


@exactly
def reduced(mechanism: exact.Mechanism, compliance=None, misfit=None) -> tuple:
    """Multipliers without friction (m, 1) and by unit friction moments (m, f) under a closure."""
    _, multipliers = mechanism.responses
    base = exact.close(mechanism.selfstress, multipliers[:, 0], compliance, misfit)
    return base, exact.close(mechanism.selfstress, multipliers[:, 1:], compliance)


def contraction(mechanism: exact.Mechanism, compliance=None) -> float:
    """Spectral radius of Gamma_ij = mu_rho_i |dR_i / dtau_j|: below 1 there is one solution, and (27) finds it."""
    _, slope = reduced(mechanism, compliance)
    forces = exact.floats(slope)[: 2 * len(mechanism.revolutes)].reshape(-1, 2, slope.cols)
    gains = np.array([float(joint.mu_rho) for joint in mechanism.revolutes])
    gamma = gains[:, None] * np.hypot(forces[:, 0], forces[:, 1])
    return float(np.max(np.abs(np.linalg.eigvals(gamma))))


@exactly
def solutions(mechanism: exact.Mechanism, compliance=None, misfit=None, seed: int = 0) -> list[exact.Solution]:
    """Every solution of the frictional equations under a closure, ordered by the moment of the first joint."""
    base, slope = reduced(mechanism, compliance, misfit)
    rubbing = [row for row, joint in enumerate(mechanism.revolutes) if joint.mu_rho]
    forces = exact.floats(slope)[: 2 * len(mechanism.revolutes)].reshape(-1, 2, slope.cols)[rubbing][:, :, rubbing]
    offset = exact.floats(base)[: 2 * len(mechanism.revolutes)].reshape(-1, 2)[rubbing]
    gains = np.array([float(mechanism.revolutes[row].mu_rho) for row in rubbing])
    senses = np.array([mechanism.senses[row] for row in rubbing])
    found = []
    for tau in _real_roots(gains[:, None] * offset, gains[:, None, None] * forces, senses, seed):
        start = np.zeros(len(mechanism.revolutes))
        start[rubbing] = tau
        try:
            solution = exact.solve(mechanism, compliance, misfit, start=tuple(map(float, start)))
        except RuntimeError:
            continue  # a real point of the quadratics near a fold, but not a root
        wrong = any(t * s > 0 for t, s in zip(solution.friction, mechanism.senses, strict=True))
        if not wrong and not any(_same(solution, other) for other in found):
            found.append(solution)
    return sorted(found, key=lambda solution: float(solution.friction[0]))


# Relative distance from the real axis, and beyond zero, of ends that Newton's method at 50 digits may decide on.
_LOOSE = 1e-2


def _same(one: exact.Solution, other: exact.Solution) -> bool:
    return mp.norm(one.friction - other.friction) <= mp.mpf(10) ** -20 * (mp.norm(one.friction) + mp.mpf(10) ** -300)


def _real_roots(offset: np.ndarray, forces: np.ndarray, senses: np.ndarray, seed: int) -> list[np.ndarray]:
    """Real tau with the right sign from all paths; `offset` (p, 2) and `forces` (p, 2, p) have mu_rho in them."""
    scale = np.max(np.abs(offset)) / max(1.0, np.max(np.abs(forces), initial=0.0)) or 1.0
    ends = all_roots(offset / scale, forces, seed)
    with np.errstate(all="ignore"):
        roots = ends[:, 1:] / ends[:, :1]
    near = np.isfinite(roots).all(axis=1) & (np.abs(ends[:, 0]) > 1e-9 * np.max(np.abs(ends), axis=1))
    roots = roots[near]
    size = np.max(np.abs(roots), axis=1, initial=0.0)
    real = np.max(np.abs(roots.imag), axis=1, initial=0.0) <= _LOOSE * size
    signed = (roots.real * senses <= _LOOSE * size[:, None]).all(axis=1)
    return [scale * root for root in roots[real & signed].real]


def all_roots(offset: np.ndarray, forces: np.ndarray, seed: int = 0) -> np.ndarray:
    """Ends (2^p, 1 + p) of all paths to y_i^2 = |offset_i y_0 + forces_i y|^2, in homogeneous coordinates (y_0, y)."""
    count = len(offset)
    rng = np.random.default_rng(seed)
    turn = np.exp(2j * np.pi * rng.uniform(size=count))
    patch = rng.normal(size=1 + count) + 1j * rng.normal(size=1 + count)
    columns = np.concatenate([offset[:, :, None], forces], axis=2).astype(complex)  # (p, 2, 1 + p)
    signs = 1.0 - 2.0 * ((np.arange(2**count)[:, None] >> np.arange(count)) & 1)
    start = np.concatenate([np.ones((2**count, 1)), signs], axis=1).astype(complex)
    return _follow(_Homotopy(turn, patch, columns), start / (start @ patch)[:, None])


class _Homotopy:
    """H(y, s) and its derivatives for a batch of points (b, 1 + p), each at its own s."""

    def __init__(self, turn: np.ndarray, patch: np.ndarray, columns: np.ndarray):
        self.turn, self.patch, self.columns = turn, patch, columns
        self.weight = 1 / np.maximum(1.0, np.max(np.abs(columns), axis=(1, 2))) ** 2  # of the equations f_i

    def parts(self, y: np.ndarray) -> tuple:
        """Start and end system (b, p) and their derivatives (b, p, 1 + p)."""
        forces = np.einsum("ick,bk->bic", self.columns, y)
        start = y[:, 1:] ** 2 - y[:, :1] ** 2
        end = self.weight * (y[:, 1:] ** 2 - np.sum(forces**2, axis=2))
        count = len(self.turn)
        square = np.zeros((len(y), count, 1 + count), complex)
        square[:, np.arange(count), 1 + np.arange(count)] = 2 * y[:, 1:]
        start_slope = square.copy()
        start_slope[:, :, 0] = -2 * y[:, :1]
        end_slope = self.weight[:, None] * (square - 2 * np.einsum("bic,ick->bik", forces, self.columns))
        return start, end, start_slope, end_slope

    def value(self, y: np.ndarray, s: np.ndarray) -> tuple:
        """H with the patch (b, 1 + p), its derivative by y, and that by s."""
        start, end, start_slope, end_slope = self.parts(y)
        s = s[:, None]
        value = np.concatenate([(1 - s) * self.turn * start + s * end, (y @ self.patch - 1)[:, None]], axis=1)
        slope = (1 - s)[:, :, None] * self.turn[:, None] * start_slope + s[:, :, None] * end_slope
        patch = np.broadcast_to(self.patch, (len(y), 1, len(self.patch)))
        rate = np.concatenate([end - self.turn * start, np.zeros((len(y), 1))], axis=1)
        return value, np.concatenate([slope, patch], axis=1), rate

    def tangent(self, y: np.ndarray, s: np.ndarray) -> np.ndarray:
        """dy/ds."""
        _, slope, rate = self.value(y, s)
        return -_solve(slope, rate)

    def corrected(self, y: np.ndarray, s: np.ndarray, steps: int) -> tuple:
        """After some Newton steps, and the size of the last one."""
        step = np.zeros_like(y)
        for _ in range(steps):
            value, slope, _ = self.value(y, s)
            step = _solve(slope, value)
            y = y - step
        return y, np.max(np.abs(step), axis=1) / np.max(np.abs(y), axis=1)


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Linear systems of a batch; singular ones give something large instead of an error."""
    try:
        return np.linalg.solve(matrix, right[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        noise = 1e-14 * np.max(np.abs(matrix), axis=(1, 2), keepdims=True) * np.eye(matrix.shape[1])
        return np.linalg.solve(matrix + noise, right[:, :, None])[:, :, 0]


def _follow(homotopy: _Homotopy, y: np.ndarray) -> np.ndarray:
    """Runge-Kutta predictor and Newton corrector, every path with its own step."""
    s, step = np.zeros(len(y)), np.full(len(y), 0.01)
    for _ in range(4000):
        going = np.flatnonzero((s < 1) & (step > 1e-13))
        if not going.size:
            break
        h = np.minimum(step[going], 1 - s[going])
        here, there = y[going], s[going]
        k1 = homotopy.tangent(here, there)
        k2 = homotopy.tangent(here + h[:, None] / 2 * k1, there + h / 2)
        k3 = homotopy.tangent(here + h[:, None] / 2 * k2, there + h / 2)
        k4 = homotopy.tangent(here + h[:, None] * k3, there + h)
        guess = here + h[:, None] / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        ahead, last = homotopy.corrected(guess, there + h, 3)
        moved = np.max(np.abs(ahead - guess), axis=1) / np.max(np.abs(ahead), axis=1)
        good = (last < 1e-9) & (moved < 1e-4)
        y[going[good]], s[going[good]] = ahead[good], (there + h)[good]
        step[going] = np.where(good, np.where(moved < 1e-6, 2 * step[going], step[going]), step[going] / 2)
    return homotopy.corrected(y, np.ones(len(y)), 5)[0]


# Newton's open iteration (38) ---------------------------------------------------------------


@exactly
def open_newton(mechanism: exact.Mechanism, x0, steps: int = 60) -> exact.Solution:
    """End point of x <- x - Gx^+ G from x0 = [qdd; lam], at 50 digits.

    Gx = [[M, Phi_q^T - F_lam], [Phi_q, 0]] has the left null vectors V = [0; N], so that Gx^+ G =
    Gx^T (Gx Gx^T + V V^T)^-1 G for G orthogonal to V. Where |R| = 0 the slope of |R| is taken as 0.
    """
    n, m = mechanism.n, mechanism.m
    jac, basis = mechanism.jacobian, mechanism.selfstress
    null = mp.zeros(n + m, basis.cols)
    null[n:, :] = basis
    x = mp.matrix(list(exact.exact(tuple(x0))))
    for _ in range(steps):
        tau, slope = mechanism.law(x[n:])
        matrix = mp.zeros(n + m)
        matrix[:n, :n], matrix[n:, :n] = mechanism.mass_matrix, jac
        matrix[:n, n:] = jac.T - mechanism.distribution * slope
        motion = mechanism.mass_matrix * x[:n] + jac.T * x[n:] - mechanism.load - mechanism.distribution * tau
        residual = mp.matrix([*motion, *(jac * x[:n] - mechanism.gamma)])
        step = matrix.T * exact.solve_columns(matrix * matrix.T + null * null.T, residual)
        x -= step
        if mp.norm(step) <= mp.mpf(10) ** -40 * (1 + mp.norm(x)):
            return exact.Solution(x[:n], x[n:], mechanism.law(x[n:])[0])
    raise RuntimeError("Newton's open iteration does not converge")
