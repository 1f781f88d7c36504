"""Rows of velocity that a user writes and of a skate: closed forms, singular positions, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

import redundax as rx

MASS, INERTIA, AHEAD = 2.0, 0.3, 0.4
TURNED = MASS * AHEAD**2 + INERTIA


def knife(q, qd, t, p):
    """The velocity of the blade's point, `p` behind the centre of mass, across the blade."""
    across = jnp.stack([-jnp.sin(q[2]), jnp.cos(q[2])])
    return (across @ qd[:2] - p * qd[2])[None]


def written(ahead=AHEAD):
    kinds = ["linear", "linear", "angular"]
    return rx.System(
        None, jnp.array([MASS, MASS, INERTIA]), parameters=ahead, velocity_constraints=knife, coordinates=kinds
    )


def sleigh_state(u, w, phi, system=None):
    """At the speed u along the blade and the turn w."""
    along, across = np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
    return rx.State(np.array([0.1, -0.2, phi]), np.array([*(u * along + AHEAD * w * across), w]))


@pytest.mark.parametrize("make", [written, rx.mechanisms.skate], ids=["system", "joint"])
def test_sleigh_has_the_accelerations_and_the_force_of_chaplygin(make):
    u, w, phi = 1.3, 0.7, 0.4
    found = rx.solve(make(), sleigh_state(u, w, phi))
    across = np.array([-np.sin(phi), np.cos(phi)])
    turn = -MASS * AHEAD * u * w / TURNED
    expected = (u * w + AHEAD * turn) * across
    # along the blade its point has u' = a w^2, from which the centre of mass ahead of it falls back by as much
    np.testing.assert_allclose(found.acceleration, [*expected, turn], rtol=0, atol=1e-13)
    force = MASS * INERTIA * u * w / TURNED
    assert abs(abs(float(found.multipliers[0])) - force) < 1e-13
    if make is not written:
        assert abs(float(found["blade.across"]) - force) < 1e-13
        reaction = [float(found[f"blade force {axis} on sleigh"]) for axis in "xy"]
        np.testing.assert_allclose(reaction, force * across, rtol=0, atol=1e-13)


def test_rank_and_velocities_are_of_all_rows_and_positions_are_free():
    system = written()
    state = rx.assemble(system, [3.0, -4.0, 0.4], [1.0, 0.2, 0.7])
    np.testing.assert_array_equal(state.q, [3.0, -4.0, 0.4])
    assert abs(float(knife(state.q, state.qd, 0.0, AHEAD)[0])) < 1e-15
    report = rx.analyze(system, state)
    assert (report.rank, report.redundancy, report.freedom, report.holonomic_rank) == (1, 0, 2, 0)
    assert report.velocity_rows == ("0",)
    assert "without them 0 redundant, 3 degrees of freedom; with them 0 more redundant, 1 less" in " ".join(
        str(report).split()
    )


@pytest.mark.slow
def test_derivatives_by_the_place_of_the_blade():
    u, w = 1.3, 0.7
    turn = lambda ahead: rx.solve(written(ahead), _state_by(ahead, u, w)).acceleration[2]  # noqa: E731
    slope = (MASS * AHEAD**2 - INERTIA) * MASS * u * w / TURNED**2
    assert abs(float(jax.grad(turn)(AHEAD)) - slope) < 1e-12
    many = jax.vmap(turn)(jnp.array([0.2, 0.4]))
    expected = [-MASS * a * u * w / (INERTIA + MASS * a**2) for a in (0.2, 0.4)]
    np.testing.assert_allclose(many, expected, rtol=1e-13)


def _state_by(ahead, u, w):
    return rx.State(jnp.zeros(3), jnp.stack([u + 0.0 * ahead, ahead * w, w + 0.0 * ahead]))


def test_sleigh_moves_as_its_closed_form():
    """u = U tanh(tau), w = U / k sech(tau), tau = a U t / k^2 + c, phi = k / a * 2 atan(tanh(tau / 2)) + const."""
    mp.mp.dps = 30
    u0, w0, end = mp.mpf("-0.8"), mp.mpf("0.9"), mp.mpf(3)
    a, k = mp.mpf(AHEAD), mp.sqrt(mp.mpf(TURNED) / MASS)
    size = mp.sqrt(u0**2 + k**2 * w0**2)
    tau = lambda t: a * size / k**2 * t + mp.atanh(u0 / size)  # noqa: E731
    turned = lambda t: k / a * 2 * (mp.atan(mp.tanh(tau(t) / 2)) - mp.atan(mp.tanh(tau(0) / 2)))  # noqa: E731
    x, y = (mp.quad(lambda t, f=f: size * mp.tanh(tau(t)) * f(turned(t)), [0, 1, 2, end]) for f in (mp.cos, mp.sin))
    phi = turned(end)
    centre = [x + a * mp.cos(phi) - a, y + a * mp.sin(phi)]
    speed, rate = size * mp.tanh(tau(end)), size / k / mp.cosh(tau(end))
    sleigh = rx.mechanisms.skate()
    start = rx.State(jnp.zeros(3), jnp.array([float(u0), AHEAD * float(w0), float(w0)]))
    motion = rx.simulate(sleigh, start, float(end), rtol=1e-12)
    q, qd = (np.asarray(x)[-1] for x in (motion.states.q, motion.states.qd))
    np.testing.assert_allclose(q, [float(x) for x in (*centre, phi)], rtol=0, atol=1e-9)
    own = qd[:2] @ [np.cos(q[2]), np.sin(q[2])], qd[2]
    np.testing.assert_allclose(own, [float(speed), float(rate)], rtol=0, atol=1e-9)
    assert float(motion.stats.energy_error) < 1e-9
    assert float(motion.stats.velocity_violation) < 1e-12


def test_baumgarte_holds_the_velocity_by_its_velocity_term():
    """Off by d, the row falls as exp(-2 alpha t), whatever beta is."""
    start = sleigh_state(1.0, 0.5, 0.0)
    start = rx.State(start.q, start.qd + np.array([0.0, 1e-7, 0.0]))
    stabilised = rx.simulate(written(), start, 0.5, rtol=1e-10, stabilisation=rx.Baumgarte(alpha=2.0, beta=9.0))
    q, qd = stabilised.states.q[-1], stabilised.states.qd[-1]
    left = float(knife(q, qd, 0.0, AHEAD)[0])
    assert abs(left / (1e-7 * np.exp(-2.0)) - 1) < 1e-3


def test_a_rate_of_time_is_prescribed_and_its_work_is_counted():
    """A mass whose velocity is 2 t: the acceleration is 2, the force 2 m, and the work m v^2 / 2."""
    system = rx.System(
        None, jnp.array([3.0]), velocity_constraints=lambda q, qd, t, p: qd - 2 * t, load=lambda q, qd, t, p: -5.0 * qd
    )
    found = rx.solve(system, rx.State([0.0], [0.8], 0.4))
    np.testing.assert_allclose(found.acceleration, [2.0], rtol=1e-14)
    np.testing.assert_allclose(found.multipliers, [-(6.0 + 4.0)], rtol=1e-14)
    motion = rx.simulate(system, rx.State([0.0], [0.0]), 1.0, rtol=1e-10)
    np.testing.assert_allclose(motion.states.q[-1], [1.0], rtol=1e-10)
    assert float(motion.stats.energy_error) < 1e-9


def test_rows_that_agree_at_one_position_only_are_singular_there():
    """z' = 0 and z' + x y' - y x' = 0 are one row where x = y = 0, and bend along no velocity there."""
    system = rx.System(
        None,
        jnp.ones(3),
        velocity_constraints=lambda q, qd, t, p: jnp.stack([qd[2], qd[2] + q[0] * qd[1] - q[1] * qd[0]]),
    )
    for qd in ([0.0, 0.0, 0.0], [1.0, 0.3, 0.0]):
        report = rx.analyze(system, rx.State(jnp.zeros(3), jnp.array(qd)))
        assert report.redundancy == 1 and report.singular_position and report.local_self_stress == 1
    beside = rx.analyze(system, rx.assemble(system, [0.1, 0.2, 0.0]))
    assert beside.redundancy == 0 and not beside.singular_position


def test_two_blades_of_an_axle_that_steer_alone_are_singular_straight_on_and_refused():
    def blades(q, qd, t, p):  # x, y, phi, and the steering of the left and of the right
        rows = []
        for side, steer in ((0.5, q[3]), (-0.5, q[4])):
            angle = q[2] + steer
            arm = side * jnp.stack([-jnp.sin(q[2]), jnp.cos(q[2])])
            point = qd[:2] + qd[2] * jnp.stack([-arm[1], arm[0]])
            rows.append(point @ jnp.stack([-jnp.sin(angle), jnp.cos(angle)]))
        return jnp.stack(rows)

    kinds = ["linear"] * 2 + ["angular"] * 3
    system = rx.System(None, jnp.array([5.0, 5.0, 1.0, 0.1, 0.1]), velocity_constraints=blades, coordinates=kinds)
    straight = rx.State(jnp.zeros(5), jnp.array([1.0, 0.0, 0.0, 0.0, 0.0]))
    assert rx.analyze(system, straight).singular_position
    with pytest.raises(rx.NoSolutionError, match=r"position is singular.*Rows of velocity"):
        rx.solve(system, straight)
    fixed = rx.System(
        lambda q, t, p: q[3:], jnp.array([5.0, 5.0, 1.0, 0.1, 0.1]), velocity_constraints=blades, coordinates=kinds
    )
    report = rx.analyze(fixed, straight)  # where they do not steer, one repeats the other for good
    assert not report.singular_position and (report.redundancy, report.holonomic_redundancy) == (1, 0)


class Skid(rx.AbstractJoint):
    """The origin of body i moves along its own x alone."""

    row_kinds = (("across", "force"),)
    velocity_rows = ("across",)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)

    def residual(self, i, j, t):
        return jnp.zeros(1)

    def rolled(self, i, j, from_i, from_j):
        return (from_i.rotate(jnp.array([0.0, 1.0])) @ (i.r - from_i.r))[None]


def test_a_joint_of_your_own_may_have_rows_of_velocity():
    """m u w presses on a skate under the centre of mass."""
    mechanism = rx.Mechanism([rx.Body("sleigh", MASS, INERTIA)], [Skid("skid", "sleigh", "ground")])
    state = rx.assemble(mechanism, [0.0, 0.0, 0.4], [np.cos(0.4), np.sin(0.4), 0.7])
    found = rx.solve(mechanism, state)
    np.testing.assert_allclose(found.acceleration, [-0.7 * np.sin(0.4), 0.7 * np.cos(0.4), 0.0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.multipliers, [-MASS * 0.7], rtol=1e-13)

    class Misnamed(Skid):
        velocity_rows = ("along",)

    with pytest.raises(rx.RedundaxError, match="`velocity_rows` of Misnamed must hold names of its rows"):
        Misnamed("skid", "sleigh", "ground")


def test_what_is_no_row_of_velocity_is_refused():
    with pytest.raises(rx.RedundaxError, match=r"must be affine in the velocity, A.* but entry 1 is not"):
        rx.System(None, jnp.ones(2), velocity_constraints=lambda q, qd, t, p: jnp.stack([qd[0], qd[0] * qd[1]]))
    with pytest.raises(rx.RedundaxError, match="must return a vector"):
        rx.System(None, jnp.ones(2), velocity_constraints=lambda q, qd, t, p: qd[0])
    with pytest.raises(rx.RedundaxError, match="the 1 rows of `constraint` and then of the 1 of"):
        rx.System(lambda q, t, p: q[:1], jnp.ones(2), velocity_constraints=lambda q, qd, t, p: qd[:1], rows=["force"])
    with pytest.raises(rx.RedundaxError, match="must hold no rows of `velocity_constraints`"):
        rx.System(None, jnp.ones(2), velocity_constraints=lambda q, qd, t, p: qd[:1], one_sided=[0])
    with pytest.raises(rx.RedundaxError, match="where a `retraction` is given"):
        rx.System(None, jnp.ones(2), velocity_constraints=lambda q, qd, t, p: qd[:1], retraction=lambda q, d: q + d)
    with pytest.raises(rx.RedundaxError, match="Sparse matrices take no rows of velocity"):
        rx.mechanisms.skate().sparse()


def test_in_other_units_and_in_single_precision():
    sleigh, state = rx.mechanisms.skate(), sleigh_state(1.3, 0.7, 0.4)
    found, units = rx.solve(sleigh, state), rx.units.Units(length=1000.0, time=60.0)
    there = rx.units.in_units(sleigh, units), rx.units.state_in_units(state, sleigh, units)
    back = rx.units.solution_from_units(rx.solve(*there), sleigh, units)
    np.testing.assert_allclose(back.acceleration, found.acceleration, rtol=1e-12)
    np.testing.assert_allclose(back.multipliers, found.multipliers, rtol=1e-12)
    single = jax.tree.map(lambda x: x.astype(jnp.float32) if x.dtype == jnp.float64 else x, (sleigh, state))
    rows = single[0].velocity_constraint(single[1].q, single[1].qd, single[1].t)
    assert rows.dtype == rx.solve(*single).multipliers.dtype == jnp.float32
    np.testing.assert_allclose(rx.solve(*single).multipliers, found.multipliers, rtol=1e-5)


def test_a_model_without_such_rows_never_asks_for_them(monkeypatch):
    def asked(*_):
        raise AssertionError("rows of velocity were asked for")

    monkeypatch.setattr(rx.Mechanism, "velocity_constraint", asked)
    linkage = rx.mechanisms.parallelogram()
    state = linkage.state(0.7, rate=1.0)
    assert rx.analyze(linkage, state).velocity_rows == ()
