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

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

import numpy as np
from mpmath import mp

from . import meshes

DIGITS = 50
exactly = mp.workdps(DIGITS)


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


@dataclass(frozen=True)
class Driver:
    """Prescribed relative angle phi_i - phi_j = start + speed t + acceleration t^2 / 2."""

    name: str
    i: int
    j: int
    start: object
    speed: object
    acceleration: object


@dataclass(frozen=True)
class Solution:
    """Acceleration (n, 1), multipliers (m, 1), and moments and forces tau of what slips (f, 1)."""

    acceleration: object
    multipliers: object
    friction: object


@dataclass(frozen=True, eq=False)
class Mechanism:
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
    def n(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.bodies)

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return 2 * len(self.revolutes) + 2 * len(self.translationals) + len(self.drivers) + len(self.meshes)

    @property
    def k(self) -> int:
        """Number of redundant constraints."""
        return self.m - self.rank

    @property
    def kinds(self) -> tuple:
        """'force' or 'moment' for every row."""
        forces = 2 * len(self.revolutes) + len(self.translationals) + len(self.meshes)
        return ("force",) * forces + ("moment",) * (self.m - forces)

    @cached_property
    def slips(self) -> tuple:
        """What slips: all revolutes, then the translational joints with friction."""
        return (*self.revolutes, *(joint for joint in self.translationals if joint.mu))

    @cached_property
    @exactly
    def slip_rates(self):
        """phid_i - phid_j of revolutes, speeds along the axes (f, 1)."""
        return self.distribution.T * mp.matrix(list(self.qd))

    @cached_property
    def senses(self) -> tuple:
        """Signs of the slip rates."""
        return tuple(int(mp.sign(rate)) for rate in self.slip_rates) if self.slips else ()

    # The system's matrices

    @cached_property
    @exactly
    def mass_matrix(self):
        """M (n, n)."""
        linear = [body.mass for body in self.bodies for _ in range(2)]
        return mp.diag(linear + [body.inertia for body in self.bodies])

    @cached_property
    @exactly
    def load(self):
        """Q (n, 1): gravity and the applied loads."""
        linear = [b.mass * self.gravity[c] + b.load[c] for b in self.bodies for c in range(2)]
        return mp.matrix(linear + [b.load[2] for b in self.bodies])

    @cached_property
    @exactly
    def distribution(self):
        """E (n, f): generalised force of unit friction moments and forces."""
        e, angles = mp.zeros(self.n, len(self.slips)), 2 * len(self.bodies) - 1
        for column, joint in enumerate(self.slips):
            for body, sign, force, moment in _friction_on(self, joint):
                if body:
                    e[2 * body - 2, column], e[2 * body - 1, column] = sign * force[0], sign * force[1]
                    e[angles + body, column] = sign * moment
        return e

    @cached_property
    def jacobian(self):
        """Phi_q (m, n) at the state."""
        return jacobian(self, self.q)

    @cached_property
    def gamma(self):
        """gamma (m, 1) at the state."""
        return gamma(self, self.q, self.qd)

    # The self-stress states and the solutions

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


# Kinematics, by hand ------------------------------------------------------------------------


def _split(q) -> tuple:
    """Positions r[0..b] and angles phi[0..b] with the ground's zeros in front."""
    b = len(q) // 3
    zero = mp.mpf(0)
    r = [(zero, zero)] + [(q[2 * body], q[2 * body + 1]) for body in range(b)]
    return r, [zero, *(q[2 * b + body] for body in range(b))]


def _turn(phi, s) -> tuple:
    """R(phi) s."""
    c, d = mp.cos(phi), mp.sin(phi)
    return (c * s[0] - d * s[1], d * s[0] + c * s[1])


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def _omega(a) -> tuple:
    """Omega a, a quarter turn."""
    return (-a[1], a[0])


def _friction_on(mechanism: Mechanism, joint) -> tuple:
    """(body, sign, force, moment) of unit friction on the bodies i and j of a joint.

    The slip along an axis is (r_i + R_i s_i - r_j - R_j s_j)^T u with u = -Omega R_j v_j, whose derivatives they are.
    """
    if isinstance(joint, Revolute):
        return (joint.i, 1, (0, 0), 1), (joint.j, -1, (0, 0), 1)
    r, phi = _split(mechanism.q)
    along = tuple(-x for x in _omega(_turn(phi[joint.j], joint.v_j)))
    arm = _turn(phi[joint.i], joint.s_i)
    reach = [r[joint.i][c] + arm[c] - r[joint.j][c] for c in range(2)]
    return (joint.i, 1, along, _dot(along, _omega(arm))), (joint.j, -1, along, _dot(along, _omega(reach)))


@exactly
def constraints(mechanism: Mechanism, q, t):
    """Phi(q, t) (m, 1)."""
    r, phi = _split(q)
    force, moment = [], []
    for joint in mechanism.revolutes:
        arm_i, arm_j = _turn(phi[joint.i], joint.s_i), _turn(phi[joint.j], joint.s_j)
        force += [r[joint.i][c] + arm_i[c] - r[joint.j][c] - arm_j[c] for c in range(2)]
    for joint in mechanism.translationals:
        arm_i, arm_j = _turn(phi[joint.i], joint.s_i), _turn(phi[joint.j], joint.s_j)
        gap = [r[joint.j][c] + arm_j[c] - r[joint.i][c] - arm_i[c] for c in range(2)]
        force.append(_dot(gap, _turn(phi[joint.j], joint.v_j)))
        moment.append(phi[joint.i] - phi[joint.j] - joint.psi)
    force += [meshes.row(mesh, r, phi) for mesh in mechanism.meshes]
    for joint in mechanism.drivers:
        course = joint.start + joint.speed * t + joint.acceleration * t**2 / 2
        moment.append(phi[joint.i] - phi[joint.j] - course)
    return mp.matrix(force + moment)


@exactly
def jacobian(mechanism: Mechanism, q):
    """Phi_q (m, n) at any q, also off the constraint manifold."""
    r, phi = _split(q)
    b = len(mechanism.bodies)
    jac = mp.zeros(mechanism.m, 3 * b)

    def put(row, body, linear, angular):
        if body:
            jac[row, 2 * body - 2], jac[row, 2 * body - 1] = linear
            jac[row, 2 * b + body - 1] = angular

    row = 0
    for joint in mechanism.revolutes:
        for body, s, sign in ((joint.i, joint.s_i, 1), (joint.j, joint.s_j, -1)):
            spin = _omega(_turn(phi[body], s))
            put(row, body, (sign, 0), sign * spin[0])
            put(row + 1, body, (0, sign), sign * spin[1])
        row += 2
    for joint in mechanism.translationals:
        normal, arm = _turn(phi[joint.j], joint.v_j), _turn(phi[joint.i], joint.s_i)
        reach = [r[joint.j][c] - r[joint.i][c] - arm[c] for c in range(2)]
        put(row, joint.i, (-normal[0], -normal[1]), -_dot(normal, _omega(arm)))
        put(row, joint.j, normal, -_dot(normal, _omega(reach)))
        row += 1
    for mesh in mechanism.meshes:
        for column in range(3 * b):
            unit = _split([mp.mpf(column == other) for other in range(3 * b)])
            jac[row, column] = meshes.along(mesh, (r, phi), unit, 1)
        row += 1
    for joint in (*mechanism.translationals, *mechanism.drivers):
        put(row, joint.i, (0, 0), 1)
        put(row, joint.j, (0, 0), -1)
        row += 1
    return jac


@exactly
def time_rate(mechanism: Mechanism, t):
    """Phi_t (m, 1)."""
    rate = [-(joint.speed + joint.acceleration * t) for joint in mechanism.drivers]
    return mp.matrix([mp.mpf(0)] * (mechanism.m - len(rate)) + rate)


@exactly
def gamma(mechanism: Mechanism, q, qd):
    """gamma (m, 1) = minus the second derivative of Phi(q + s qd, t + s), any q and qd."""
    (r, phi), (rd, phid) = _split(q), _split(qd)
    force = []
    for joint in mechanism.revolutes:
        arm_i, arm_j = _turn(phi[joint.i], joint.s_i), _turn(phi[joint.j], joint.s_j)
        square_i, square_j = phid[joint.i] ** 2, phid[joint.j] ** 2
        force += [arm_i[c] * square_i - arm_j[c] * square_j for c in range(2)]
    for joint in mechanism.translationals:
        i, j = joint.i, joint.j
        normal, arm = _turn(phi[j], joint.v_j), _turn(phi[i], joint.s_i)
        slide = _omega([rd[j][c] - rd[i][c] for c in range(2)])
        term = [
            2 * slide[c] * phid[j] + (r[j][c] - r[i][c]) * phid[j] ** 2 - arm[c] * (phid[j] - phid[i]) ** 2
            for c in range(2)
        ]
        force.append(_dot(normal, term))
    force += [-meshes.along(mesh, (r, phi), (rd, phid), 2) for mesh in mechanism.meshes]
    zeros = [mp.mpf(0)] * len(mechanism.translationals)
    return mp.matrix(force + zeros + [joint.acceleration for joint in mechanism.drivers])


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


@exactly
def solve_columns(a, b):
    """a^-1 b for a matrix b of any width; one factorisation."""
    lu, permutation = mp.LU_decomp(a.copy())
    x = mp.zeros(a.rows, b.cols)
    for column in range(b.cols):
        x[:, column] = mp.U_solve(lu, mp.L_solve(lu, b[:, column], permutation))
    return x


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
        a[i, i] = mass[i, i]
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


def law(mechanism: Mechanism, multipliers) -> tuple:
    """tau (f, 1) for multipliers (m, 1), and its derivatives, {row: slope} of each; those of |x| at 0 are 0.

    A revolute has -mu_rho |R| sgn(omega), an axis -mu (|N1| + |N2|) sgn(v) with N = lam_perp / 2 +- lam_angle / length.
    """
    tau, slopes = mp.zeros(len(mechanism.slips), 1), []
    first = 2 * len(mechanism.revolutes)
    for place, (joint, sense) in enumerate(zip(mechanism.slips, mechanism.senses, strict=True)):
        if isinstance(joint, Revolute):
            gain, rows = -joint.mu_rho * sense, (2 * place, 2 * place + 1)
            force = tuple(multipliers[row] for row in rows)
            size = mp.hypot(*force)
            slopes.append({row: gain * x / size for row, x in zip(rows, force, strict=True) if size})
        else:
            row = first + mechanism.translationals.index(joint)
            gain, rows = -joint.mu * sense, (row, row + len(mechanism.translationals))
            half, couple = multipliers[rows[0]] / 2, multipliers[rows[1]] / joint.length
            ends = half + couple, half - couple
            size, (one, other) = sum(map(abs, ends)), map(mp.sign, ends)
            slopes.append({rows[0]: gain * (one + other) / 2, rows[1]: gain * (one - other) / joint.length})
        tau[place] = gain * size
    return tau, slopes


def _newton(mechanism: Mechanism, base, slope, tau):
    """tau = law(base + slope tau) by Newton's method with the exact derivative."""
    count = len(mechanism.slips)
    for _ in range(60):
        value, slopes = law(mechanism, base + slope * tau)
        derivative = mp.eye(count)
        for row, own in enumerate(slopes):
            for place, factor in own.items():
                for column in range(count):
                    derivative[row, column] -= factor * slope[place, column]
        step = solve_columns(derivative, tau - value)
        tau = tau - step
        if mp.norm(step) <= mp.mpf(10) ** -40 * (1 + mp.norm(tau)):
            return tau
    raise RuntimeError("Newton's method for the friction moments does not converge")


@exactly
def responses(mechanism: Mechanism) -> tuple:
    """Particular accelerations and multipliers: the first column to load, the others to unit friction."""
    force = _column_join(mechanism.load, mechanism.distribution)
    gamma_ = _column_join(mechanism.gamma, mp.zeros(mechanism.m, mechanism.distribution.cols))
    return particular(mechanism.mass_matrix, mechanism.jacobian, force, gamma_, mechanism.rank)


@exactly
def solve(mechanism: Mechanism, compliance=None, misfit=None, friction=True, start=None) -> Solution:
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
            old, tau = tau, law(mechanism, base + slope * tau)[0]
            if mp.norm(tau - old) < mp.mpf(10) ** -6 * mp.norm(tau):
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
    gap = tau - law(mechanism, lam)[0] if friction else mp.zeros(len(mechanism.slips), 1)
    if mechanism.slips:
        motion -= mechanism.distribution * tau
    kinematic = mechanism.jacobian * qdd - mechanism.gamma
    return tuple(max((abs(item) for item in part), default=0) for part in (motion, kinematic, gap))
