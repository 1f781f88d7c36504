"""The truth is true: finite differences, residuals, closed forms, the paper's printed digits."""

import numpy as np
import pytest
from mpmath import mp

from . import exact, paper, scenes

ANGLE = np.pi / 4
every_mechanism = pytest.mark.parametrize(
    "mechanism", [make() for make in scenes.MECHANISMS.values()], ids=scenes.MECHANISMS
)


def state(u=1.0, phi=ANGLE, rate=1.0):
    p = paper.Parameters(u=u)
    return p, *paper.configuration(p, phi, rate)


def anywhere(mechanism):
    """A state off the constraint manifold: (q, qd) moved by irregular amounts."""
    shift = [exact.exact(f"{(7 * i * i + 3 * i + 5) % 19 - 9}/23") for i in range(mechanism.n)]
    q = tuple(a + b for a, b in zip(mechanism.q, shift, strict=True))
    qd = tuple(a - 3 * b for a, b in zip(mechanism.qd, reversed(shift), strict=True))
    return q, qd


def irregular(count, scale=1):
    """A tuple of exact numbers without a pattern."""
    return exact.exact(tuple(f"{(11 * i * i + 5 * i + 2) % 17 - 8}/{7 * scale}" for i in range(count)))


def close(a, b, tol):
    return np.max(np.abs(np.asarray(a) - np.asarray(b))) <= tol * (1 + np.max(np.abs(b)))


# exact.py: kinematics -----------------------------------------------------------------------


@every_mechanism
@mp.workdps(exact.DIGITS)
def test_exact_state_is_on_the_manifold(mechanism):
    velocity = mechanism.jacobian * mp.matrix(list(mechanism.qd))
    assert mp.norm(exact.constraints(mechanism, mechanism.q, mechanism.t)) < 1e-48
    assert mp.norm(velocity + exact.time_rate(mechanism, mechanism.t)) < 1e-48
    assert mp.norm(mechanism.selfstress.T * mechanism.gamma) < 1e-47
    assert len(mechanism.kinds) == mechanism.m == mechanism.jacobian.rows
    assert mechanism.k > 0


@every_mechanism
@mp.workdps(exact.DIGITS)
def test_exact_jacobian_and_gamma_by_differences(mechanism):
    q, qd = anywhere(mechanism)
    t, step = mechanism.t + 1, mp.mpf(10) ** -16
    jac = exact.jacobian(mechanism, q)
    for column in range(mechanism.n):
        ends = []
        for sign in (1, -1):
            moved = list(q)
            moved[column] += sign * step
            ends.append(exact.constraints(mechanism, moved, t))
        assert mp.norm((ends[0] - ends[1]) / (2 * step) - jac[:, column]) < 1e-30

    def along(s):
        moved = [a + s * b for a, b in zip(q, qd, strict=True)]
        return exact.constraints(mechanism, moved, t + s)

    rate = (along(step) - along(-step)) / (2 * step)
    assert mp.norm(rate - jac * mp.matrix(list(qd)) - exact.time_rate(mechanism, t)) < 1e-28
    step = mp.mpf(10) ** -12
    bend = (along(step) - 2 * along(0) + along(-step)) / step**2
    assert mp.norm(bend + exact.gamma(mechanism, q, qd)) < 1e-20


# exact.py: linear algebra and solutions -----------------------------------------------------


@every_mechanism
@mp.workdps(exact.DIGITS)
def test_exact_selfstress_and_rank(mechanism):
    basis, projector = mechanism.selfstress, mechanism.projector
    assert (basis.rows, basis.cols) == (mechanism.m, mechanism.k)
    assert mp.norm(mechanism.jacobian.T * basis) < 1e-48
    assert mp.norm(basis.T * basis - mp.eye(mechanism.k)) < 1e-48
    assert mp.norm(projector * projector - projector) < 1e-48
    for wrong in (-1, 1):
        with pytest.raises(ValueError, match="rank is"):
            exact.independent_rows(mechanism.jacobian, mechanism.rank + wrong)


@every_mechanism
@pytest.mark.parametrize("friction", [False, True])
@mp.workdps(exact.DIGITS)
def test_exact_solution_residuals_and_closure(mechanism, friction):
    m = mechanism.m
    root = mp.matrix([list(irregular(m + row)[row:]) for row in range(m)])
    joint_scale = mp.norm(root) ** 2
    full = root * root.T / joint_scale + mp.eye(m)
    diagonal = [mp.mpf(10) ** (row % 5 - 2) for row in range(m)]
    for compliance, misfit, matrix in (
        (None, None, mp.eye(m)),
        (None, irregular(m), mp.eye(m)),
        (diagonal, irregular(m, 10), mp.diag(diagonal)),
        (full, irregular(m), full),
    ):
        solution = mechanism.solve(compliance, misfit, friction)
        assert max(exact.residuals(mechanism, solution, friction)) < 1e-45
        gap = matrix * solution.multipliers
        if misfit is not None:
            gap -= mp.matrix(list(misfit))
        assert mp.norm(mechanism.selfstress.T * gap) < 1e-45


@mp.workdps(exact.DIGITS)
def test_exact_accelerations_in_closed_form():
    # Carriage: the axial force over the mass.
    mechanism = scenes.two_guides()
    body, axis = mechanism.bodies[0], exact.exact(("3/5", "4/5"))
    pull = sum(axis[c] * (body.load[c] + body.mass * mechanism.gravity[c]) for c in range(2))
    expected = mp.matrix([axis[0] * pull / body.mass, axis[1] * pull / body.mass, 0])
    assert mp.norm(mechanism.solve().acceleration - expected) < 1e-47

    # Parallelogram: one equation of motion, cranks about their pivots and a translated coupler.
    mechanism = scenes.parallelogram()
    cranks, coupler = mechanism.bodies[:3], mechanism.bodies[3]
    half, (c, s) = exact.exact("1/4"), exact.exact(("3/5", "4/5"))
    inertia = sum(b.inertia + b.mass * half**2 for b in cranks) + coupler.mass * 4 * half**2
    weight = half * mechanism.gravity[1] * c * (sum(b.mass for b in cranks) + 2 * coupler.mass)
    push = 2 * half * (coupler.load[1] * c - coupler.load[0] * s)
    alpha = mechanism.solve(friction=False).acceleration[8]
    assert abs(alpha - (weight + push) / inertia) < 1e-47

    # Slider-crank: the acceleration is kinematic; the slider by differentiating
    # x = a cos phi + sqrt(b^2 - a^2 sin^2 phi).
    mechanism = scenes.driven_slider_crank()
    driver, a, b = mechanism.drivers[0], exact.exact("1/4"), exact.exact("13/25")

    def slider(t):
        phi = driver.start + driver.speed * t + driver.acceleration * t**2 / 2
        return a * mp.cos(phi) + mp.sqrt(b**2 - a**2 * mp.sin(phi) ** 2)

    assert abs(slider(mechanism.t) - mechanism.q[4]) < 1e-48
    assert abs(mp.diff(slider, mechanism.t, 1) - mechanism.qd[4]) < 1e-40
    for friction in (False, True):
        solution = mechanism.solve(friction=friction)
        assert abs(mp.diff(slider, mechanism.t, 2) - solution.acceleration[4]) < 1e-35


@mp.workdps(exact.DIGITS)
def test_exact_accelerations_of_the_paper_in_closed_form():
    # One degree of freedom: bodies 2 and 4 rise by 2 h sin phi, body 2 also moves along x.
    mechanism = scenes.wojtyra2020()
    m1, m2, m3, m4 = (body.mass for body in mechanism.bodies)
    j1, _, j3, _ = (body.inertia for body in mechanism.bodies)
    phi, rate = mechanism.q[8], mechanism.qd[8]
    h, g = mp.sqrt(2) / 10, -mechanism.gravity[1]
    c, s = mp.cos(phi), mp.sin(phi)
    inertia = j1 + j3 + (m1 + m3) * h**2 + 4 * h**2 * (m2 + m4 * c**2)
    force = -g * h * c * (m1 + m3 + 2 * m2 + 2 * m4) + 4 * h**2 * m4 * c * s * rate**2
    assert abs(mechanism.solve(friction=False).acceleration[8] - force / inertia) < 1e-46


def test_exact_uniqueness_of_multipliers():
    unique = {name: make().unique for name, make in scenes.MECHANISMS.items()}
    assert [row for row, flag in enumerate(unique["wojtyra2020"]) if flag] == [8, 9]
    assert not any(unique["parallelogram"]) and not any(unique["carriage"])
    assert [row for row, flag in enumerate(unique["slider_crank"]) if not flag] == [6, 7, 8, 9]


@mp.workdps(exact.DIGITS)
def test_exact_physical_closure_is_free_of_units():
    base = scenes.wojtyra2020()
    forces = [kind == "force" for kind in base.kinds]
    compliance = [mp.mpf(row + 1) / (10 if force else 3) for row, force in enumerate(forces)]
    misfit = irregular(base.m)
    reference = base.solve(compliance, misfit)
    for u in exact.exact((10, "1/1000")):
        lengths = [u if force else 1 for force in forces]
        solution = scenes.wojtyra2020(u=u).solve(
            [w if force else w / u**2 for w, force in zip(compliance, forces, strict=True)],
            [d * length for d, length in zip(misfit, lengths, strict=True)],
        )
        for row in range(base.m):
            scaled = reference.multipliers[row] * (u if forces[row] else u**2)
            assert abs(solution.multipliers[row] - scaled) <= 1e-40 * abs(scaled)
        assert abs(solution.acceleration[8] / reference.acceleration[8] - 1) < 1e-40


# paper.py -----------------------------------------------------------------------------------


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("phi", [-2.0, 0.3, ANGLE, 2.5])
def test_paper_configuration_closes(u, phi):
    p, q, qd = state(u, phi, -1.7)
    assert np.max(np.abs(paper.constraints(p, q))) < 1e-15 * (1 + u)
    assert np.max(np.abs(paper.jacobian(p, q) @ qd)) < 1e-15 * (1 + u)
    ends = [paper.configuration(p, phi + s, -1.7)[0] for s in (1e-6, -1e-6)]
    assert close((ends[0] - ends[1]) / 2e-6 * -1.7, qd, 1e-8)


def test_paper_configuration_is_table_1():
    _, q, _ = state()
    printed = [0.1, 0.1, 0.6, 0.2, 0.9, 0.1, 0.4, 0.2, ANGLE, 0, ANGLE, 0]
    assert close(q, printed, 1e-15)


def test_paper_formulas_hold_off_the_manifold():
    mechanism = scenes.wojtyra2020()
    q, qd = anywhere(mechanism)
    p, q_float, qd_float = paper.Parameters(), exact.floats(q), exact.floats(qd)
    values = paper.constraints(p, q_float)
    assert np.linalg.norm(values) > 1
    assert close(values, exact.floats(exact.constraints(mechanism, q, mp.mpf(0))), 1e-14)
    assert close(paper.jacobian(p, q_float), exact.floats(exact.jacobian(mechanism, q)), 1e-14)
    gamma = exact.floats(exact.gamma(mechanism, q, qd))
    assert close(paper.gamma(p, q_float, qd_float), gamma, 1e-14)

    ends = [[paper.constraints(p, q_float + s * e) for s in (1e-6, -1e-6)] for e in np.eye(12)]
    differences = np.stack([(a - b) / 2e-6 for a, b in ends], axis=1)
    assert close(paper.jacobian(p, q_float), differences, 1e-9)
    lines = [paper.constraints(p, q_float + s * qd_float) for s in (1e-4, 0, -1e-4)]
    assert close(-(lines[0] - 2 * lines[1] + lines[2]) / 1e-8, gamma, 1e-5)


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
def test_paper_matrices_against_exact(u):
    p, q, qd = state(u)
    mechanism = scenes.wojtyra2020(u=exact.exact(str(u)))
    assert close(q, exact.floats(mechanism.q), 1e-15)
    assert close(qd, exact.floats(mechanism.qd), 1e-15)
    assert close(paper.mass(p), exact.floats(mechanism.mass_matrix), 1e-15)
    assert close(paper.load(p), exact.floats(mechanism.load), 1e-15)
    assert close(paper.DISTRIBUTION, exact.floats(mechanism.distribution), 0)
    assert close(paper.jacobian(p, q), exact.floats(mechanism.jacobian), 1e-14)
    assert tuple(paper.senses(qd)) == mechanism.senses


@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
def test_paper_pseudoinverse(u):
    p, q, _ = state(u)
    a, inverse = paper.matrix(p, q), paper.pseudoinverse_block(p, q)
    assert close(inverse, paper.pinv_drop_one(a), 1e-11)
    for left, right in ((a @ inverse @ a, a), (inverse @ a @ inverse, inverse)):
        assert close(left, right, 1e-11)
    for product in (a @ inverse, inverse @ a):
        assert close(product, product.T, 1e-11)
    corner = exact.floats(scenes.wojtyra2020(u=exact.exact(str(u))).projector)
    assert close(
        np.eye(24) - inverse @ a,
        np.block([[np.zeros((12, 24))], [np.zeros((12, 12)), corner]]),
        1e-11,
    )


def test_paper_friction_jacobian():
    p, _, qd = state()
    lam = exact.floats(irregular(12))
    ends = [[paper.friction(p, lam + s * e, qd)[1] for s in (1e-6, -1e-6)] for e in np.eye(12)]
    differences = np.stack([(a - b) / 2e-6 for a, b in ends], axis=1)
    assert close(paper.friction_jacobian(p, lam, qd), differences, 1e-9)


@pytest.mark.parametrize(("phi", "rate"), [(ANGLE, 1.0), (0.4, -2.5), (2.2, 3.0)])
@pytest.mark.parametrize("u", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("h", [0.0, 50.0])
def test_paper_solutions_against_exact(phi, rate, u, h):
    p, q, qd = state(u, phi, rate)
    u_exact = exact.exact(str(u))
    mechanism = scenes.wojtyra2020(None if phi == ANGLE else phi, rate, u_exact)
    misfit = None if h == 0 else [h] * 12
    for x, friction in (
        (paper.solve(p, q, qd, h), False),
        (paper.fixed_point(p, q, qd, h)[-1], True),
    ):
        solution = mechanism.solve(None, misfit, friction)
        assert close(x[:12], exact.floats(solution.acceleration), 1e-11)
        assert close(x[12:], exact.floats(solution.multipliers), 1e-11)
    assert close(paper.friction(p, x[12:], qd)[0], exact.floats(solution.friction), 1e-11)


@pytest.mark.parametrize("row", paper.TABLE2, ids=lambda row: f"u={row.u} h={row.start}")
def test_paper_table_2(row):
    p, q, qd = state(row.u)
    error = np.abs(paper.solve(p, q, qd, row.start) - row.values()) / row.half_digit()
    assert np.max(error) <= 1


@pytest.mark.parametrize("row", paper.TABLE3, ids=lambda row: f"u={row.u} h={row.start}")
def test_paper_table_3(row):
    p, q, qd = state(row.u)
    x = paper.fixed_point(p, q, qd, row.start)[-1]
    error = np.abs([*x, *paper.friction(p, x[12:], qd)[0]] - row.values()) / row.half_digit()
    if row.u == 10:
        assert 1 < error[21] < 1.1  # L perp: 220.54, printed 220
        assert 1 < error[14] < 1.01  # B x: -410.502, printed -410
        error[[14, 21]] = 0
    assert np.max(error) <= 1


@pytest.mark.parametrize("row", paper.TABLE4, ids=lambda row: f"u={row.u} x0={row.start}")
def test_paper_newton_and_table_4(row):
    p, q, qd = state(row.u)
    mechanism = scenes.wojtyra2020(u=exact.exact(str(row.u)))
    x = paper.newton(p, q, qd, row.start)[-1]
    # A solution of (25) is the one whose misfit, under unit compliance, are its own multipliers.
    solution = mechanism.solve(None, [float(item) for item in x[12:]])
    assert close(x[:12], exact.floats(solution.acceleration), 1e-11)
    assert close(x[12:], exact.floats(solution.multipliers), 1e-11)
    # The printed row is another solution within the rounding of the print: the one that has
    # the printed moment in guide K, anywhere within its rounding (a closure with compliance
    # and misfit in that row alone).
    ends = []
    for side in (-1, 1):
        moment = row.values()[22] + side * row.half_digit()[22]
        solution = mechanism.solve([0] * 10 + [1, 0], [0] * 10 + [moment, 0])
        parts = (solution.acceleration, solution.multipliers, solution.friction)
        ends.append(np.concatenate([exact.floats(part) for part in parts]))
    slack = row.half_digit() * (1 + 1e-6)
    if row.u == 10:
        slack[21] *= 1.1  # L perp: 220.54, printed 220
    assert np.all(row.values() >= np.minimum(*ends) - slack)
    assert np.all(row.values() <= np.maximum(*ends) + slack)
    # Newton's method ends elsewhere.
    assert not np.minimum(*ends)[22] <= x[22] <= np.maximum(*ends)[22]


def test_newton_converges_quadratically():
    p, q, qd = state()
    sizes = [np.linalg.norm(paper.residual(p, q, qd, x)) for x in paper.newton(p, q, qd, 1.0)]
    assert sizes[-1] < 1e-12 < sizes[-3] and len(sizes) < 10
