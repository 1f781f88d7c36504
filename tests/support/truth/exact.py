"""Overconstrained planar mechanisms with exact geometry, solved to 50 digits.

    M qdd + Phi_q^T lam = Q + E tau,   Phi_q qdd = gamma,   Phi_q^T N = 0,   N^T N = I
    lam = lam_p + N (N^T W N)^-1 N^T (d - W lam_p),   tau_J = -mu_rho_J |R_J| sgn(omega_J)

lam_p is any particular solution (here: zero on the dependent rows), W a compliance of the
constraint rows and d a misfit; W = I, d = 0 is the minimum-norm solution. The redundancy is
permanent by construction, so the rank is known and the dependent rows vanish to 50 digits.
Arithmetic on the results keeps its digits only inside `mp.workdps(DIGITS)`.

Conventions: body 0 is the ground; coordinates are x, y of all bodies, then all angles; rows
are force-type (revolutes x, y, then the normal rows of translational joints, then teeth), then
moment-type (angle rows of translational joints, then drivers). The constraint force is
-Phi_q^T lam; a joint's moment of friction acts with +tau on body i and -tau on body j;
omega = phid_i - phid_j; R_J is the pair of multipliers of revolute J. Units are SI.

    revolute       r_i + R_i s_i - r_j - R_j s_j
    translational  (r_j + R_j s_j - r_i - R_i s_i)^T R_j v_j   and   phi_i - phi_j - psi
    driver         phi_i - phi_j - (start + speed t + acceleration t^2 / 2)
"""

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from mpmath import mp

from .description import GROUND, Joint, Load, Parameters, Structure
from .equations import Equations, Poses, evaluate, friction_law

DIGITS = 50
exactly = mp.workdps(DIGITS)
DIGITAL = SimpleNamespace(**{name: np.frompyfunc(getattr(mp, name), 1, 1) for name in ("cos", "sin", "sqrt")})


@exactly
def exact(x):
    """A number, string, Fraction or nested sequence of them as mpf of 50 digits."""
    if isinstance(x, (tuple, list)):
        return tuple(exact(item) for item in x)
    if isinstance(x, str):
        x = Fraction(x)
    if isinstance(x, Fraction):
        return mp.mpf(x.numerator) / x.denominator
    return mp.mpf(x)


def floats(x) -> np.ndarray:
    """An mp number, matrix or nested sequence as a float64 array; columns become vectors."""
    if isinstance(x, mp.matrix):
        array = np.array([float(item) for item in x]).reshape(x.rows, x.cols)
        return array[:, 0] if x.cols == 1 else array
    if isinstance(x, (tuple, list)):
        return np.array([floats(item) for item in x])
    return np.float64(float(x))


# Data of a mechanism ------------------------------------------------------------------------


@dataclass(frozen=True)
class Body:
    """Mass, moment of inertia and constant applied load (fx, fy, moment), global frame."""

    mass: object
    inertia: object
    load: tuple = (0, 0, 0)


@dataclass(frozen=True)
class Revolute:
    """Common point s_i on body i and s_j on body j; mu_rho is a length."""

    name: str
    i: int
    j: int
    s_i: tuple
    s_j: tuple
    mu_rho: object = 0
    kind, friction = "revolute", "coulomb"

    @property
    def numbers(self) -> dict:
        """As in a description."""
        return {"point_i": self.s_i, "point_j": self.s_j, "coefficient": self.mu_rho, "preload": 0}


@dataclass(frozen=True)
class Translational:
    """Axis through s_j on body j with unit normal v_j (frame of j), through s_i on body i; `length` for mu != 0."""

    name: str
    i: int
    j: int
    s_i: tuple
    s_j: tuple
    v_j: tuple
    psi: object = 0
    mu: object = 0
    length: object = 1
    kind = "translational"

    @property
    def friction(self) -> str | None:
        """Coulomb's, if there is any."""
        return "coulomb" if self.mu else None

    @property
    def numbers(self) -> dict:
        """As in a description."""
        points = {"point_i": self.s_i, "point_j": self.s_j, "normal": self.v_j, "angle": self.psi}
        return {**points, "coefficient": self.mu, "preload": 0, "guide_length": self.length}


@dataclass(frozen=True)
class Driver:
    """Prescribed relative angle phi_i - phi_j = start + speed t + acceleration t^2 / 2."""

    name: str
    i: int
    j: int
    start: object
    speed: object
    acceleration: object
    kind, friction = "angle", None

    @property
    def numbers(self) -> dict:
        """As in a description."""
        return {"coefficients": (self.start, self.speed, exact(self.acceleration) / 2)}


@dataclass(frozen=True)
class Solution:
    """Acceleration (n, 1), multipliers (m, 1), and moments and forces tau of what slips (f, 1)."""

    acceleration: object
    multipliers: object
    friction: object


class AbstractExact:
    """Solutions of equations (25) with 50 digits, of known rank.

    A class has `mass_matrix` (n, n), `load` (n, 1), `distribution` E (n, f), `jacobian` (m, n), `gamma` (m, 1),
    `kinds` of the rows, `rank`, and with friction `law`.
    """

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return self.mass_matrix.rows

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return len(self.kinds)

    @property
    def k(self) -> int:
        """Number of redundant constraints."""
        return self.m - self.rank

    @cached_property
    def selfstress(self):
        """N (m, k), orthonormal, Phi_q^T N = 0."""
        return selfstress(self.jacobian, self.rank)

    @cached_property
    @exactly
    def projector(self):
        """P = N N^T (m, m)."""
        return self.selfstress * self.selfstress.T

    @cached_property
    def unique(self) -> tuple:
        """For every row, whether its multiplier is unique without friction (13)."""
        return tuple(all(abs(item) < mp.mpf(10) ** -40 for item in row) for row in self.selfstress.tolist())

    @cached_property
    def responses(self) -> tuple:
        """Accelerations (n, 1 + f) and multipliers (m, 1 + f), particular ones, to load and to unit friction."""
        return responses(self)

    def solve(self, compliance=None, misfit=None, friction=True, start=None) -> Solution:
        """Acceleration, multipliers and friction under a closure: see `solve` below."""
        return solve(self, compliance, misfit, friction, start)


class AbstractDescribed(AbstractExact):
    """Those of a description: `structure`, `parameters` and `equations` of a batch of one."""

    @property
    def kinds(self) -> tuple:
        """'force' or 'moment' for every row."""
        return tuple(kind for *_, kind in self.structure.rows)

    @cached_property
    def senses(self) -> tuple:
        """Signs of the slip rates."""
        return tuple(int(mp.sign(rate)) for rate in self.equations.slip_rate[0])

    @cached_property
    @exactly
    def mass_matrix(self):
        """M (n, n)."""
        return mp.diag(self.equations.mass[0].tolist())

    @cached_property
    @exactly
    def load(self):
        """Q (n, 1): gravity and the applied loads."""
        return _column(self.equations.load)

    @cached_property
    @exactly
    def distribution(self):
        """E (n, f): generalised force of unit friction moments and forces."""
        e = self.equations.direction[0]
        return mp.matrix(e.tolist()) if e.size else mp.zeros(*e.shape)

    @cached_property
    @exactly
    def jacobian(self):
        """Phi_q (m, n) at the state."""
        return mp.matrix(self.equations.jacobian[0].tolist())

    @cached_property
    @exactly
    def gamma(self):
        """gamma (m, 1) at the state."""
        return _column(self.equations.gamma)

    @exactly
    def law(self, multipliers) -> tuple:
        """tau (f, 1) for multipliers (m, 1), and its derivative (f, m)."""
        lam, senses = np.array([[*multipliers]], dtype=object), np.array([self.senses], dtype=object)
        tau, slope, _ = friction_law(self.structure, self.parameters, senses, lam, DIGITAL.sqrt)
        return _column(tau), mp.matrix(slope[0].tolist())


@dataclass(frozen=True, eq=False)
class Sample(AbstractDescribed):
    """A description of one sample whose equations are there already."""

    structure: Structure
    parameters: Parameters
    equations: Equations

    @property
    def rank(self) -> int:
        """Rank of Phi_q by construction."""
        return self.structure.rank


@dataclass(frozen=True, eq=False)
class Mechanism(AbstractDescribed):
    """A mechanism in one state (q, qd, t), every number an mpf of 50 digits.

    `rank` is the rank of Phi_q by construction.
    """

    bodies: tuple
    revolutes: tuple
    translationals: tuple
    drivers: tuple
    gravity: tuple
    q: tuple
    qd: tuple
    rank: int
    t: object = field(default_factory=mp.mpf)
    meshes: tuple = ()

    @property
    def slips(self) -> tuple:
        """What slips: all revolutes, then the translational joints with friction."""
        return tuple(joint for joint in self.joints if joint.friction)

    @property
    def joints(self) -> tuple:
        """All joints, in the order of the rows."""
        return (*self.revolutes, *self.translationals, *self.meshes, *self.drivers)

    @cached_property
    def structure(self) -> Structure:
        """What is joined to what."""
        joints = (
            Joint(joint.kind, joint.i - 1, joint.j - 1, k, k, joint.friction) for k, joint in enumerate(self.joints)
        )
        bodies = tuple(range(len(self.bodies)))
        loads = tuple(Load("force", body, GROUND, body) for body in bodies if any(self.bodies[body].load))
        whole = Structure(bodies, tuple(joints), loads, 0)
        return replace(whole, redundancy=whole.m - self.rank)

    @cached_property
    def parameters(self) -> Parameters:
        """The numbers."""
        loads = [body.load for body in self.bodies]
        raw = {
            "gravity": self.gravity,
            "force": tuple(load[:2] for load in loads),
            "moment": tuple(load[2] for load in loads),
            "point_i": ((0, 0),) * len(loads),
        }
        return Parameters(
            {name: _one(value) for name, value in raw.items()},
            tuple({name: _one(value) for name, value in joint.numbers.items()} for joint in self.joints),
            _one(tuple(body.mass for body in self.bodies)),
            _one(tuple(body.inertia for body in self.bodies)),
        )

    @exactly
    def at(self, q, qd, t) -> Equations:
        """The equations at a position, velocity and time."""
        q, count = _one(tuple(q)), 2 * len(self.bodies)
        poses = Poses(q[:, :count].reshape(1, -1, 2), q[:, count:], _one(t), DIGITAL)
        return evaluate(self.structure, self.parameters, poses, _one(tuple(qd)))

    @cached_property
    def equations(self) -> Equations:
        """The equations at the state."""
        return self.at(self.q, self.qd, self.t)


def _one(x) -> np.ndarray:
    """A batch of one."""
    return np.array([x], dtype=object)


def _column(batch):
    """The vector of a batch of one."""
    return mp.matrix(batch[0].tolist()) if batch.size else mp.zeros(0, 1)


# What the equations are at other places ------------------------------------------------------


@exactly
def constraints(mechanism: Mechanism, q, t):
    """Phi(q, t) (m, 1)."""
    return _column(mechanism.at(q, mechanism.qd, t).value)


@exactly
def jacobian(mechanism: Mechanism, q):
    """Phi_q (m, n) at any q, also off the constraint manifold."""
    return mp.matrix(mechanism.at(q, mechanism.qd, mechanism.t).jacobian[0].tolist())


@exactly
def time_rate(mechanism: Mechanism, t):
    """Phi_t (m, 1)."""
    return _column(mechanism.at(mechanism.q, mechanism.qd, t).explicit)


@exactly
def gamma(mechanism: Mechanism, q, qd):
    """gamma (m, 1) = minus the second derivative of Phi(q + s qd, t + s), any q and qd."""
    return _column(mechanism.at(q, qd, mechanism.t).gamma)


# Linear algebra with a known rank -----------------------------------------------------------


@exactly
def independent_rows(jac, rank: int) -> list[int]:
    """`rank` independent rows of `jac`, found by elimination with complete pivoting.

    Refuses a rank that the matrix does not have: a pivot below 1e-25, or a remainder above
    1e-40.
    """
    if rank > min(jac.rows, jac.cols):
        raise ValueError(f"rank is below {rank}")
    a = jac.tolist()
    rows, columns = list(range(jac.rows)), list(range(jac.cols))
    chosen = []
    for _ in range(rank):
        row, column = max(((i, j) for i in rows for j in columns), key=lambda p: abs(a[p[0]][p[1]]))
        if abs(a[row][column]) < mp.mpf(10) ** -25:
            raise ValueError(f"rank is below {rank}")
        rows.remove(row)
        columns.remove(column)
        chosen.append(row)
        for i in rows:
            factor = a[i][column] / a[row][column]
            for j in columns:
                a[i][j] -= factor * a[row][j]
    if any(abs(a[i][j]) > mp.mpf(10) ** -40 for i in rows for j in columns):
        raise ValueError(f"rank is above {rank}")
    return sorted(chosen)


def _take(a, rows):
    """Rows of a matrix."""
    return mp.matrix([[a[row, column] for column in range(a.cols)] for row in rows])


@mp.workdps(DIGITS + 30)
def solve_columns(a, b):
    """a^-1 b for a matrix b of any width, by elimination with pivots that are large in their row.

    On arrays, whose entries take a third of the time that those of `mp.matrix` take, and with digits to spare: beside a
    singular position 40 are lost.
    """
    if not a.rows or not b.cols:
        return mp.zeros(a.rows, b.cols)
    left, right = (np.array(each.tolist(), dtype=object) for each in (a, b))
    sizes, least = np.abs(left).max(axis=1), mp.mnorm(a, 1) * mp.mpf(10) ** -DIGITS
    for j in range(len(left)):
        pivot = j + int(np.argmax(np.abs(left[j:, j]) / sizes[j:]))
        for each in (left, right, sizes):
            each[[j, pivot]] = each[[pivot, j]]
        if abs(left[j, j]) <= least:
            raise ZeroDivisionError("matrix is numerically singular")
        below = j + 1 + np.flatnonzero(left[j + 1 :, j] != 0)
        factors = (left[below, j] / left[j, j])[:, None]
        left[below, j + 1 :] -= factors * left[j, j + 1 :]
        right[below] -= factors * right[j]
    for j in reversed(range(len(left))):
        right[j] = (right[j] - left[j, j + 1 :] @ right[j + 1 :]) / left[j, j]
    return mp.matrix(right.tolist())


@exactly
def selfstress(jac, rank: int):
    """N (m, k): orthonormal basis of the null space of jac^T.

    The dependent rows are combinations of the independent ones, J_D = T J_I, so the columns
    of [-T^T; I] are self-stress states; Gram-Schmidt, done twice, makes them orthonormal.
    """
    rows = independent_rows(jac, rank)
    if rank == jac.rows:
        return mp.zeros(rank, 0)
    dependent = [row for row in range(jac.rows) if row not in rows]
    free, rest = _take(jac, rows), _take(jac, dependent)
    coefficients = solve_columns(free * free.T, free * rest.T)
    basis = mp.zeros(jac.rows, len(dependent))
    for column, row in enumerate(dependent):
        basis[row, column] = 1
        for place, other in enumerate(rows):
            basis[other, column] = -coefficients[place, column]
    for column in list(range(basis.cols)) * 2:
        vector = basis[:, column]
        for other in range(column):
            overlap = basis[:, other].T * vector
            vector -= overlap[0] * basis[:, other]
        basis[:, column] = vector / mp.norm(vector)
    return basis


@exactly
def particular(mass, jac, force, gamma_, rank: int) -> tuple:
    """Accelerations and multipliers for the columns of `force` (n, c) and `gamma_` (m, c).

    Solves with the independent rows alone; the dependent rows carry no multiplier.
    """
    rows = independent_rows(jac, rank)
    free, n = _take(jac, rows), mass.rows
    a = mp.zeros(n + rank)
    for i in range(n):
        for other in range(n):
            a[i, other] = mass[i, other]
        for place in range(rank):
            a[i, n + place] = a[n + place, i] = free[place, i]
    right = mp.zeros(n + rank, force.cols)
    for column in range(force.cols):
        for i in range(n):
            right[i, column] = force[i, column]
        for place, row in enumerate(rows):
            right[n + place, column] = gamma_[row, column]
    x = solve_columns(a, right)
    multipliers = mp.zeros(jac.rows, force.cols)
    for place, row in enumerate(rows):
        for column in range(force.cols):
            multipliers[row, column] = x[n + place, column]
    return x[:n, :], multipliers


@exactly
def close(basis, multipliers, compliance=None, misfit=None):
    """lam = lam_p + N z, z = (N^T W N)^-1 N^T (d - W lam_p), for every column of lam_p.

    `compliance` is (m, m), a sequence of m diagonal entries, or None for the identity;
    `misfit` is (m, 1) or a sequence, or None for zero.
    """
    if not basis.cols:
        return multipliers
    if compliance is None:
        compliance = mp.eye(basis.rows)
    elif not isinstance(compliance, mp.matrix):
        compliance = mp.diag(list(exact(tuple(compliance))))
    right = -compliance * multipliers
    if misfit is not None:
        if not isinstance(misfit, mp.matrix):
            misfit = mp.matrix(list(exact(tuple(misfit))))
        for column in range(right.cols):
            right[:, column] = right[:, column] + misfit
    z = solve_columns(basis.T * compliance * basis, basis.T * right)
    return multipliers + basis * z


# Friction -----------------------------------------------------------------------------------


def _column_join(left, right):
    """[left right]."""
    joined = mp.zeros(left.rows, left.cols + right.cols)
    for column in range(left.cols):
        joined[:, column] = left[:, column]
    for column in range(right.cols):
        joined[:, left.cols + column] = right[:, column]
    return joined


def _newton(mechanism: AbstractExact, base, slope, tau):
    """tau = law(base + slope tau) by Newton's method with the exact derivative."""
    for _ in range(60):
        value, derivative = mechanism.law(base + slope * tau)
        step = solve_columns(mp.eye(tau.rows) - derivative * slope, tau - value)
        tau = tau - step
        if mp.norm(step) <= mp.mpf(10) ** -35 * (1 + mp.norm(tau)):
            return tau
    raise RuntimeError("Newton's method for the friction moments does not converge")


@exactly
def responses(mechanism: AbstractExact) -> tuple:
    """Particular accelerations and multipliers: the first column to load, the others to unit friction."""
    force = _column_join(mechanism.load, mechanism.distribution)
    gamma_ = _column_join(mechanism.gamma, mp.zeros(mechanism.m, mechanism.distribution.cols))
    return particular(mechanism.mass_matrix, mechanism.jacobian, force, gamma_, mechanism.rank)


@exactly
def solve(mechanism: AbstractExact, compliance=None, misfit=None, friction=True, start=None) -> Solution:
    """The solution under the closure (W, d); `close` says what the arguments may be.

    With friction the moments tau solve tau = law(lam(tau)), lam(tau) being affine: a fixed
    point from `start` (zero) to about 1e-6, then Newton's method. With `start` given,
    Newton's method at once, so that isolated solutions can be told apart by it. The paper's
    h is misfit = h_lam with the identity as compliance.
    """
    basis, count = mechanism.selfstress, mechanism.distribution.cols
    acceleration, multipliers = mechanism.responses
    base = close(basis, multipliers[:, 0], compliance, misfit)
    slope = mp.zeros(mechanism.m, count)
    tau = mp.zeros(count, 1)
    if count and friction:
        slope = close(basis, multipliers[:, 1:], compliance)
        if start is not None:
            tau = mp.matrix(list(exact(tuple(start))))
        for _ in range(200 if start is None else 0):
            old, tau = tau, mechanism.law(base + slope * tau)[0]
            if mp.norm(tau - old) <= mp.mpf(10) ** -6 * mp.norm(tau):
                break
        tau = _newton(mechanism, base, slope, tau)
    qdd = acceleration[:, 0]
    return Solution(
        qdd + acceleration[:, 1:] * tau if count else qdd,
        base + slope * tau if count else base,
        tau,
    )


@exactly
def residuals(mechanism: Mechanism, solution: Solution, friction=True) -> tuple:
    """Largest entries of M qdd + Phi_q^T lam - Q - E tau, Phi_q qdd - gamma, tau - law."""
    qdd, lam, tau = solution.acceleration, solution.multipliers, solution.friction
    motion = mechanism.mass_matrix * qdd + mechanism.jacobian.T * lam - mechanism.load
    gap = tau - mechanism.law(lam)[0] if friction else mp.zeros(0, 1)
    if mechanism.slips:
        motion -= mechanism.distribution * tau
    kinematic = mechanism.jacobian * qdd - mechanism.gamma
    return tuple(max((abs(item) for item in part), default=0) for part in (motion, kinematic, gap))
