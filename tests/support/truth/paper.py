"""The mechanism of Wojtyra, Pekal, Fraczek (2020), Section 5, by its own formulas.

    M qdd + Phi_q^T lam = Q + F(lam, qd),     Phi_q qdd = gamma                            (25)

Reference: Mech. Mach. Theory 153 (2020) 103999; numbers in brackets are its equations.
Everything here is written for reading, with the full unknown x = [qdd; lam] of 24 entries.

Ordering: q = r1x r1y .. r4x r4y phi1 .. phi4 (60); lam = A x y, B x y, C x y, D x y,
K perp, L perp | K angle, L angle (61). The constraint force on the bodies is -Phi_q^T lam.
Bodies are numbered from 1, body 0 is the ground. Omega = [[0, -1], [1, 0]].
"""

from dataclasses import dataclass

import numpy as np

N_COORDINATES = 12
N_CONSTRAINTS = 12
RANK = 11
OMEGA = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True)
class Parameters:
    """Data of Tables 1 and 5; `u` multiplies the unit of length (10 for decimetres).

    `l`, `g`, `mu_rho` are in metres; the properties below are in the chosen unit.
    """

    l: float = 0.1  # noqa: E741 (the paper's letter)
    m: float = 1.0
    g: float = 10.0
    mu_rho: float = 0.02
    u: float = 1.0

    @property
    def length(self) -> float:
        """l in the chosen unit."""
        return self.u * self.l

    @property
    def half(self) -> float:
        """Half the length of bodies 1 and 3: h of Table 5, equal to l sqrt(2)."""
        return self.length * np.sqrt(2.0)

    @property
    def gravity(self) -> float:
        """g in the chosen unit."""
        return self.u * self.g

    @property
    def pivot(self) -> float:
        """mu_rho (coefficient of friction times pivot radius) in the chosen unit."""
        return self.u * self.mu_rho

    @property
    def masses(self) -> np.ndarray:
        """m1 .. m4 of Table 1."""
        return self.m * np.array([3.0, 9.0, 3.0, 9.0])

    @property
    def inertias(self) -> np.ndarray:
        """J1 .. J4 of Table 1."""
        return self.masses * self.length**2 * np.array([2.0, 16.0, 2.0, 16.0]) / 3.0


# Table 5, geometry of the joints ------------------------------------------------------------


def revolutes(p: Parameters) -> list:
    """Rows A, B, C, D of Table 5 as (i, j, s_i, s_j)."""
    h, l = p.half, p.length  # noqa: E741
    return [
        (1, 0, np.array([-h, 0.0]), np.array([0.0, 0.0])),
        (2, 1, np.array([-4 * l, 0.0]), np.array([h, 0.0])),
        (3, 2, np.array([h, 0.0]), np.array([4 * l, 0.0])),
        (3, 0, np.array([-h, 0.0]), np.array([8 * l, 0.0])),
    ]


def translationals(p: Parameters) -> list:
    """Rows K, L of Table 5 as (i, j, s_i, s_j, v_j, psi)."""
    l = p.length  # noqa: E741
    zero = np.zeros(2)
    return [
        (4, 0, zero, np.array([4 * l, 0.0]), np.array([1.0, 0.0]), 0.0),
        (4, 2, zero, zero, np.array([0.0, 1.0]), 0.0),
    ]


def rotation(phi: float) -> np.ndarray:
    """R(phi) (54)."""
    return np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])


def split(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions r[0..4] and angles phi[0..4] of (60), with the ground's zeros in front."""
    r = np.vstack([np.zeros(2), np.reshape(q[:8], (4, 2))])
    return r, np.concatenate([[0.0], q[8:]])


# Kinematics ---------------------------------------------------------------------------------


def configuration(p: Parameters, phi: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """q and qd for the crank angle `phi` and its rate, for every phi (Table 1 at pi/4).

    Bodies 1 and 3 turn about A and D, body 2 (coupler) and body 4 (on a vertical guide)
    translate.
    """
    l = p.length  # noqa: E741
    arm = p.half * np.array([np.cos(phi), np.sin(phi)])
    arm_rate = rate * OMEGA @ arm
    along = np.array([l, 0.0])
    r = [arm, 2 * arm + 4 * along, arm + 8 * along, [4 * l, 2 * arm[1]]]
    rd = [arm_rate, 2 * arm_rate, arm_rate, [0.0, 2 * arm_rate[1]]]
    q = np.concatenate([*r, [phi, 0.0, phi, 0.0]])
    qd = np.concatenate([*rd, [rate, 0.0, rate, 0.0]])
    return q, qd


def constraints(p: Parameters, q: np.ndarray) -> np.ndarray:
    """Phi(q): (53) and (57), stacked as in (61)."""
    r, phi = split(q)
    force, moment = [], []
    for i, j, s_i, s_j in revolutes(p):
        force.extend(r[i] + rotation(phi[i]) @ s_i - r[j] - rotation(phi[j]) @ s_j)
    for i, j, s_i, s_j, v_j, psi in translationals(p):
        gap = r[j] + rotation(phi[j]) @ s_j - r[i] - rotation(phi[i]) @ s_i
        force.append(gap @ rotation(phi[j]) @ v_j)
        moment.append(phi[i] - phi[j] - psi)
    return np.array(force + moment)


def jacobian(p: Parameters, q: np.ndarray) -> np.ndarray:
    """Phi_q(q): (55) and (58), stacked as in (62); exact at every q.

    The angular entries of (58) hold off the constraint manifold as printed: of
    d/dphi_j = (Omega R_j s_j)^T R_j v + (r_j + R_j s_j - r_i - R_i s_i)^T Omega R_j v
    the two terms with s_j cancel for every q, and
    -(R_j v)^T Omega (r_j - r_i - R_i s_i) is left.
    """
    r, phi = split(q)
    linear, angular = np.zeros((12, 5, 2)), np.zeros((12, 5))
    for row, (i, j, s_i, s_j) in enumerate(revolutes(p)):
        rows = slice(2 * row, 2 * row + 2)
        linear[rows, i] = np.eye(2)
        linear[rows, j] = -np.eye(2)
        angular[rows, i] = OMEGA @ rotation(phi[i]) @ s_i
        angular[rows, j] = -OMEGA @ rotation(phi[j]) @ s_j
    for row, (i, j, s_i, _, v_j, _) in enumerate(translationals(p)):
        normal, arm = rotation(phi[j]) @ v_j, rotation(phi[i]) @ s_i
        linear[8 + row, i] = -normal
        linear[8 + row, j] = normal
        angular[8 + row, i] = -normal @ OMEGA @ arm
        angular[8 + row, j] = -normal @ OMEGA @ (r[j] - r[i] - arm)
        angular[10 + row, i] = 1.0
        angular[10 + row, j] = -1.0
    return np.hstack([linear[:, 1:].reshape(12, 8), angular[:, 1:]])


def gamma(p: Parameters, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """gamma(q, qd) of Phi_q qdd = gamma: (56) and (59), stacked as in (63).

    Exact at every (q, qd), also off the constraint manifold: equal to minus the second
    derivative of Phi(q + s qd) at s = 0. (s_j drops out of (59) as it does of (58).)
    """
    (r, phi), (rd, phid) = split(q), split(qd)
    force = []
    for i, j, s_i, s_j in revolutes(p):
        force.extend(rotation(phi[i]) @ s_i * phid[i] ** 2 - rotation(phi[j]) @ s_j * phid[j] ** 2)
    for i, j, s_i, _, v_j, _ in translationals(p):
        term = 2 * OMEGA @ (rd[j] - rd[i]) * phid[j] + (r[j] - r[i]) * phid[j] ** 2
        term = term - rotation(phi[i]) @ s_i * (phid[j] - phid[i]) ** 2
        force.append(rotation(phi[j]) @ v_j @ term)
    return np.array([*force, 0.0, 0.0])


# Forces -------------------------------------------------------------------------------------


def mass(p: Parameters) -> np.ndarray:
    """M, 12 by 12, diagonal."""
    return np.diag(np.concatenate([np.repeat(p.masses, 2), p.inertias]))


def load(p: Parameters) -> np.ndarray:
    """Q: gravity along -y."""
    weight = np.stack([np.zeros(4), -p.masses * p.gravity], axis=1)
    return np.concatenate([weight.ravel(), np.zeros(4)])


def senses(qd: np.ndarray) -> np.ndarray:
    """sgn(omega_J) with omega_J = phid_i - phid_j of joints A, B, C, D."""
    phid = np.concatenate([[0.0], qd[8:]])
    return np.sign([phid[1] - phid[0], phid[2] - phid[1], phid[3] - phid[2], phid[3] - phid[0]])


# F = DISTRIBUTION tau (42): body i of a joint receives tau, body j receives -tau.
DISTRIBUTION = np.zeros((12, 4))
DISTRIBUTION[8:11] = [[1, -1, 0, 0], [0, 1, -1, 0], [0, 0, 1, 1]]


def friction(p: Parameters, lam: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments tau (4) by (41) and generalised friction force F (12) by (42)."""
    reaction = np.reshape(lam[:8], (4, 2))
    tau = -p.pivot * np.sqrt(np.sum(reaction**2, axis=1)) * senses(qd)
    return tau, DISTRIBUTION @ tau


def friction_jacobian(p: Parameters, lam: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """F_lam, 12 by 12: d tau_J / d R_J = -mu_rho sgn(omega_J) R_J^T / |R_J|, for |R_J| > 0."""
    reaction = np.reshape(lam[:8], (4, 2))
    direction = reaction / np.linalg.norm(reaction, axis=1, keepdims=True)
    tau_lam = np.zeros((4, 12))
    for joint in range(4):
        tau_lam[joint, 2 * joint : 2 * joint + 2] = direction[joint]
    return DISTRIBUTION @ (-p.pivot * senses(qd)[:, None] * tau_lam)


# Solutions ----------------------------------------------------------------------------------


def pinv_drop_one(a: np.ndarray) -> np.ndarray:
    """Moore-Penrose inverse of a matrix known to lack exactly one rank.

    The cut lies between the two smallest singular values, whatever the units; a gap of
    less than eight orders between them is refused.
    """
    s = np.linalg.svd(a, compute_uv=False)
    cut = np.sqrt(s[-1] * s[-2]) / s[0]
    assert s[-1] < 1e-8 * s[-2] and np.sum(s <= cut * s[0]) == 1
    return np.linalg.pinv(a, rcond=cut)


def matrix(p: Parameters, q: np.ndarray) -> np.ndarray:
    """A of (10), 24 by 24."""
    jac = jacobian(p, q)
    return np.block([[mass(p), jac.T], [jac, np.zeros((12, 12))]])


def pseudoinverse_block(p: Parameters, q: np.ndarray) -> np.ndarray:
    """A^+ by the block form (10), through C^+ of the 12 by 12 matrix C."""
    jac, m_inv = jacobian(p, q), np.linalg.inv(mass(p))
    c_pinv = pinv_drop_one(jac @ m_inv @ jac.T)
    corner = m_inv @ jac.T @ c_pinv
    return np.block([[m_inv - corner @ jac @ m_inv, corner], [corner.T, -c_pinv]])


def right_side(p: Parameters, q: np.ndarray, qd: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
    """b(x) = [Q + F(lam); gamma] of (27); without `x`, b of the frictionless mechanism."""
    force = load(p)
    if x is not None:
        force = force + friction(p, x[12:], qd)[1]
    return np.concatenate([force, gamma(p, q, qd)])


def solve(p: Parameters, q: np.ndarray, qd: np.ndarray, h=0.0) -> np.ndarray:
    """x = A^+ b + (I - A^+ A) h without friction (9); `h` a scalar (times ones) or (24,)."""
    a = matrix(p, q)
    a_pinv = pinv_drop_one(a)
    return a_pinv @ right_side(p, q, qd) + (np.eye(24) - a_pinv @ a) @ (h * np.ones(24))


def fixed_point(
    p: Parameters,
    q: np.ndarray,
    qd: np.ndarray,
    h=0.0,
    x0: np.ndarray | None = None,
    tol_load: float = 1e-12,
    tol_step: float = 1e-11,
    max_steps: int = 1000,
) -> list[np.ndarray]:
    """All iterates of x_{i+1} = A^+ b(x_i) + (I - A^+ A) h (27), the last one the solution.

    Two-stage stop: |b(x_i) - b(x_{i-1})| < tol_load and then |x_{i+1} - x_i| < tol_step.
    Starts from the frictionless solution unless `x0` is given.
    """
    a = matrix(p, q)
    a_pinv = pinv_drop_one(a)
    shift = (np.eye(24) - a_pinv @ a) @ (h * np.ones(24))
    iterates = [solve(p, q, qd, h) if x0 is None else x0 * np.ones(24)]
    b_old = None
    for _ in range(max_steps):
        b = right_side(p, q, qd, iterates[-1])
        iterates.append(a_pinv @ b + shift)
        settled = b_old is not None and np.linalg.norm(b - b_old) < tol_load
        if settled and np.linalg.norm(iterates[-1] - iterates[-2]) < tol_step:
            return iterates
        b_old = b
    raise RuntimeError(f"no convergence of (27) in {max_steps} steps")


def residual(p: Parameters, q: np.ndarray, qd: np.ndarray, x: np.ndarray) -> np.ndarray:
    """G(x) (34)."""
    return matrix(p, q) @ x - right_side(p, q, qd, x)


def residual_jacobian(p: Parameters, q: np.ndarray, qd: np.ndarray, x: np.ndarray) -> np.ndarray:
    """G_x(x) (35)."""
    gx = matrix(p, q)
    gx[:12, 12:] -= friction_jacobian(p, x[12:], qd)
    return gx


def newton(
    p: Parameters,
    q: np.ndarray,
    qd: np.ndarray,
    x0,
    tol_residual: float = 1e-12,
    tol_step: float = 1e-10,
    max_steps: int = 100,
) -> list[np.ndarray]:
    """All iterates of x_{i+1} = x_i - G_x(x_i)^+ G(x_i), (36) to (38), the last the solution.

    `x0` is a scalar (times ones) or (24,). Two-stage stop: |G(x_{i+1})| < tol_residual and
    then |s| < tol_step. The pseudoinverse drops exactly one singular value.
    """
    iterates = [x0 * np.ones(24)]
    for _ in range(max_steps):
        x = iterates[-1]
        s = -pinv_drop_one(residual_jacobian(p, q, qd, x)) @ residual(p, q, qd, x)
        iterates.append(x + s)
        settled = np.linalg.norm(residual(p, q, qd, x + s)) < tol_residual
        if settled and np.linalg.norm(s) < tol_step:
            return iterates
    raise RuntimeError(f"no convergence of (38) in {max_steps} steps")


# Printed tables -----------------------------------------------------------------------------


@dataclass(frozen=True)
class PrintedRow:
    """One row of Tables 2 to 4: unit factor, scalar of h (or of x0), digits as printed.

    `x` lists the 24 unknowns in the order of (60) and (61), `tau` the moments of friction.
    """

    u: float
    start: float
    x: str
    tau: str = ""

    def values(self) -> np.ndarray:
        """x and tau as numbers, (24,) or (28,)."""
        return np.array([float(word) for word in (self.x + " " + self.tau).split()])

    def half_digit(self) -> np.ndarray:
        """Half a unit of the last printed digit of every entry: the rounding of the print."""
        words = (self.x + " " + self.tau).split()
        return np.array([0.5 * 10.0 ** -len(word.partition(".")[2]) for word in words])


# Table 2. The two force rows for u = 1 stand swapped in print; here they are put right.
TABLE2 = (
    PrintedRow(
        1,
        0,
        "3.26 -3.46 6.52 -6.92 3.26 -3.46 0.00 -6.92 -33.58 0.0 -33.58 0.00 "
        "-40.1 -48.3 -30.3 -28.7 28.4 26.8 -38.1 -46.4 0.0 27.8 4.79 -4.79",
    ),
    PrintedRow(
        1,
        50,
        "3.26 -3.46 6.52 -6.92 3.26 -3.46 0.00 -6.92 -33.58 0.0 -33.58 0.00 "
        "-18.5 -26.8 -8.7 -7.2 49.9 48.3 -59.7 -68.0 0.0 27.8 22.0 -22.0",
    ),
    PrintedRow(
        10,
        0,
        "32.6 -34.6 65.2 -69.2 32.6 -34.6 0.00 -69.2 -33.58 0.0 -33.58 0.00 "
        "-456 -539 -359 -343 228 212 -326 -409 0.0 278 32.7 -32.7",
    ),
)

# Table 3, fixed point iterations (27) started from the frictionless solution. Two entries of
# the row u = 10 are not the nearest three digits: L perp is 220.542, printed 220 (as in
# Table 4), and B x is -410.502, printed -410.
TABLE3 = (
    PrintedRow(
        1,
        0,
        "3.57 -3.77 7.15 -7.55 3.57 -3.77 0.00 -7.55 -36.75 0.00 -36.75 0.00 "
        "-44.1 -41.6 -33.4 -23.0 31.0 21.2 -41.7 -39.8 0.0 22.1 5.25 -5.25",
        "-1.21 0.81 -0.75 -1.15",
    ),
    PrintedRow(
        1,
        50,
        "3.58 -3.78 7.15 -7.55 3.58 -3.78 0.00 -7.55 -36.75 0.00 -36.75 0.00 "
        "-19.0 -22.8 -8.3 -4.1 56.1 40.0 -66.8 -58.7 0.0 22.0 20.34 -20.34",
        "-0.59 0.18 -1.38 -1.78",
    ),
    PrintedRow(
        1,
        100,
        "3.65 -3.85 7.31 -7.71 3.65 -3.85 0.00 -7.71 -37.53 0.00 -37.53 0.00 "
        "3.6 -1.3 14.6 17.2 80.3 58.5 -91.3 -76.9 0.0 20.6 36.83 -36.83",
        "-0.08 0.45 -1.99 -2.39",
    ),
    PrintedRow(
        10,
        100,
        "35.7 -37.7 71.5 -75.5 35.7 -37.7 0.00 -75.5 -36.75 0.00 -36.75 0.00 "
        "-518 -474 -410 -287 233 154 -340 -341 0.0 220 63.86 -63.86",
        "-140.4 100.2 -55.8 -96.3",
    ),
    PrintedRow(
        0.1,
        100,
        "0.79 -0.81 1.57 -1.61 0.79 -0.81 0.00 -1.61 -79.54 0.00 -79.54 0.00 "
        "40.7 54.6 43.1 55.2 57.2 44.2 -59.6 -44.8 0.0 -5.5 4.15 -4.15",
        "-0.14 0.14 -0.14 -0.15",
    ),
)

# Table 4, Newton's method (38) from x0 = start times ones. Every row is a solution of (25)
# within the rounding of the print, but (35) to (38) started at x0 end elsewhere on the
# one-parameter family of solutions.
TABLE4 = (
    PrintedRow(
        1,
        1,
        "3.57 -3.77 7.15 -7.55 3.57 -3.77 0.00 -7.55 -36.75 0.00 -36.75 0.00 "
        "-42.1 -40.1 -31.4 -21.5 33.0 22.6 -43.7 -41.3 0.0 22.1 6.44 -6.44",
        "-1.16 0.76 -0.80 -1.20",
    ),
    PrintedRow(
        1,
        50,
        "3.58 -3.78 7.15 -7.55 3.58 -3.78 0.00 -7.55 -36.75 0.00 -36.75 0.00 "
        "-18.7 -22.5 -8.0 -3.9 56.4 40.2 -67.1 -58.9 0.0 22.0 20.51 -20.51",
        "-0.59 0.18 -1.39 -1.79",
    ),
    PrintedRow(
        1,
        100,
        "3.64 -3.84 7.28 -7.68 3.64 -3.84 0.00 -7.68 -37.39 0.00 -37.39 0.00 "
        "1.6 -3.6 12.5 14.9 78.0 56.7 -88.9 -75.2 0.0 20.9 35.14 -35.14",
        "-0.08 0.39 -1.93 -2.33",
    ),
    PrintedRow(
        10,
        100,
        "35.7 -37.7 71.5 -75.5 35.7 -37.7 0.00 -75.5 -36.75 0.00 -36.75 0.00 "
        "-516 -473 -409 -286 234 155 -342 -342 0.0 220 71.99 -71.99",
        "-140.0 99.9 -56.2 -96.6",
    ),
    PrintedRow(
        0.1,
        100,
        "0.52 -0.54 1.05 -1.09 0.52 -0.54 0.00 -1.09 -53.32 0.00 -53.32 0.00 "
        "15.6 20.5 17.1 21.8 26.5 20.3 -28.1 -21.7 0.0 -0.8 1.79 -1.79",
        "-0.05 0.06 -0.07 -0.07",
    ),
)
