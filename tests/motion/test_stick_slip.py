"""Motions with friction through reversals to rest, against closed forms and a scalar equation."""

import time
from functools import cache

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from test_simulate import richardson
from truth import paper

import redundax as rx

GRAVITY, STIFFNESS = 10.0, 4.0
slow = pytest.mark.slow


def block(mu: float, x: float = 1.0, force=None) -> tuple[rx.System, rx.State]:
    """A mass of 1 kg on a spring, or under a force, and on a rough guide that stands there twice, released at x."""
    friction = rx.Friction(_along, _rubbing, np.arange(2), ("linear",), mu)
    load = _spring if force is None else lambda q, qd, t, p: jnp.stack([force(t), -GRAVITY])
    return rx.System(_guides, jnp.ones(2), load, friction=friction), rx.State([x, 0.0], [0.0, 0.0])


# By name: blocks of the same functions share their programs.
def _guides(q, t, p):
    return jnp.stack([q[1], 2 * q[1]])


def _spring(q, qd, t, p):
    return jnp.stack([-STIFFNESS * q[0], -GRAVITY])


def _along(q, t, p):
    return q[:1]


def _rubbing(loads, rate, sense, memory, state, p):
    return -p * jnp.abs(loads[0] + 2 * loads[1])[None] * sense


def where(mu, t):
    """Each half period pi / 2 is a cosine about a centre that friction shifts by mu g / k."""
    shift, halves = mu * GRAVITY / STIFFNESS, int(2 * t // np.pi)
    side = (-1) ** halves
    return side * (shift + (1 - (2 * halves + 1) * shift) * np.cos(2 * t - halves * np.pi))


def test_a_block_slips_and_sticks_where_the_closed_form_does():
    """It stops first where the spring is weaker than friction: after four half periods, at x = 0."""
    times = np.linspace(0.0, 8.0, 17)
    run = rx.simulate(*block(0.05), 8.0, ts=times, throw=False)
    assert run.result == rx.RESULTS.stuck
    np.testing.assert_allclose(run.stats.end, 2 * np.pi, rtol=0, atol=1e-7)
    truth = [where(0.05, t) if t < 2 * np.pi else 0.0 for t in times]
    np.testing.assert_allclose(run.q[:, 0], truth, rtol=0, atol=1e-6)  # between steps it is interpolated
    resting = times > 2 * np.pi
    assert np.all(run.qd[resting] == 0.0)
    assert np.all(np.isnan(run.friction[resting]))
    assert run.stats.phases == 4
    stays = rx.simulate(*block(0.05, x=0.1), 8.0, ts=times, throw=False)
    assert stays.result == rx.RESULTS.stuck
    assert stays.stats.end == 0.0
    np.testing.assert_array_equal(stays.q[:, 0], 0.1)


def _there_and_back(wait, t):
    return rx.Trapezoid(0.3, speed=1.0, acceleration=20.0, start=1.0, dwell=0.2)(jnp.maximum(t - wait, 0.0))


@slow
@pytest.mark.parametrize("wait", [0.0, 0.305])
def test_a_driver_that_dwells_sets_off_again_against_friction(wait):
    """It pushes with m a + mu m g against the way. From rest it speeds up between two looks for that, 0.06 s apart."""
    mu, mass, law = 0.2, 3.0, jax.tree_util.Partial(_there_and_back, wait)
    guide = rx.Translational("K", "b", "ground", (0, 0), (0, 0), (0, 1), guide_length=0.1, friction=rx.Coulomb(mu))
    driver = rx.DistanceDriver("d", "b", "ground", (0.0, 0.0), (-1.0, 0.0), law)
    mechanism = rx.Mechanism([rx.Body("b", mass, 0.1)], [guide, driver], gravity=(0.0, -9.81))
    ts = wait + np.array([0.02, 0.2, 0.33, 0.57, 0.7, 0.88])  # each in another part: on, even, slower, and back
    run = rx.simulate(mechanism, rx.assemble(mechanism, {"b.x": 0.0}), 6.0, ts=ts)
    way, change = np.repeat([1.0, -1.0], 3), 20.0 * np.array([1.0, 0.0, -1.0, -1.0, 0.0, 1.0])
    np.testing.assert_allclose(run["d.distance"], -mass * (change + mu * 9.81 * way), rtol=1e-9)


def test_a_block_is_let_go_before_another_stops_in_the_same_step():
    """Friction is 1 N. One slides from 0.99 m/s to its stop at 0.99 s; a force 1.2 N/s t lets the other go at 5/6 s."""
    friction = rx.Friction(lambda q, t, p: q[:2], lambda *given: -given[2], [], ["linear"] * 2)
    pull = lambda q, qd, t, p: jnp.stack([0.0 * t, 1.2 * t, 0.0 * t])  # noqa: E731
    system = rx.System(lambda q, t, p: q[2:], jnp.ones(3), pull, friction=friction)
    run = rx.simulate(system, rx.State(jnp.zeros(3), [0.99, 0.0, 0.0]), 2.0, ts=np.linspace(0.0, 2.0, 21))
    slides, since = np.minimum(run.t, 0.99), np.maximum(run.t - 5 / 6, 0.0)
    np.testing.assert_allclose(run.q[:, 0], 0.99 * slides - slides**2 / 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[:, 1], 0.2 * since**3, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.friction[:, 1], -np.minimum(1.2 * run.t, 1.0), rtol=0, atol=1e-9)


def test_a_block_is_let_go_for_a_moment_while_another_moves_evenly():
    """Under 1.2 N sin w t against 1 N it slips there and back within the one step of what moves evenly, in each half
    of a second by the integral of 1.2 (cos w a - cos w t) / w - (t - a) from a on until that is 0."""
    w = 2 * np.pi
    friction = rx.Friction(lambda q, t, p: q[:1], lambda *given: -given[2], [], ["linear"])
    pull = lambda q, qd, t, p: jnp.stack([1.2 * jnp.sin(w * t), 0.0 * t, 0.0 * t])  # noqa: E731
    system = rx.System(lambda q, t, p: q[2:], jnp.ones(3), pull, friction=friction)
    run = rx.simulate(system, rx.State(jnp.zeros(3), [0.0, 0.3, 0.0]), 1.0, ts=[0.5, 1.0], rtol=1e-10)
    begins = np.arcsin(1 / 1.2) / w
    rate = lambda t: 1.2 * (np.cos(w * begins) - np.cos(w * t)) / w - (t - begins)  # noqa: E731
    way = quad(rate, begins, brentq(rate, begins + 0.1, 0.5))[0]
    np.testing.assert_allclose(run.q[:, 0], [way, 0.0], rtol=0, atol=1e-10)
    assert run.stats.phases == 5


def test_a_block_stands_for_a_moment_within_a_step():
    """Under 20 N/s (t - 1/2 s) + 1 N against 1 N it goes by 10 m/s^3 ((t - 1/2 s)^2 - (0.05 s)^2), which is 0 at
    0.45 s; from there on it stands until 1/2 s."""
    friction = rx.Friction(lambda q, t, p: q[:1], lambda *given: -given[2], [], ["linear"])
    pull = lambda q, qd, t, p: jnp.stack([20 * (t - 0.5) + 1, 0.0 * t])  # noqa: E731
    system = rx.System(lambda q, t, p: q[1:], jnp.ones(2), pull, friction=friction)
    run = rx.simulate(system, rx.State(jnp.zeros(2), [2.475, 0.0]), 1.0, ts=[0.45, 0.48, 1.0])
    stands = 10 / 3 * (0.5**3 - 0.05**3) - 10 * 0.05**2 * 0.45
    np.testing.assert_allclose(run.q[:, 0], [stands, stands, stands + 10 / 3 * 0.5**3], rtol=0, atol=1e-8)


@slow
def test_a_reversal_soon_after_the_start_of_a_long_step(step=300.0):
    """Under 1.5 N - t against 1 N it slips from 0 to 1 s, by t^2 / 4 - t^3 / 6, sticks to 2.5 s, and slips back."""
    system, state = block(0.1, 0.0, lambda t: 1.5 - t)
    run = rx.simulate(system, state, step, ts=[1.0, 2.0, step], rtol=None, dt0=step)
    np.testing.assert_allclose(run.q[:2, 0], 1 / 12, rtol=0, atol=1e-6)  # of positions up to 1e6 m
    np.testing.assert_allclose(run.q[2, 0], 1 / 12 - (step - 2.5) ** 3 / 6, rtol=1e-9)
    assert run.stats.phases == 2


@slow
def test_slip_that_reverses_while_the_motion_goes_on():
    """A slip x^2 / 2 + y on y = 0 reverses at x = 0, where its friction does no work; a slip x has none.

    With friction -+mu |load|, load + g = friction, x'' = x friction: from x = -1 it goes by cosh, from 0 on by sine.
    """
    mu, rate = 0.3, 3.0

    def rubbing(loads, rate, sense, memory, state, p):
        return -jnp.array([mu, 0.0]) * jnp.abs(loads) * sense

    system = rx.System(
        lambda q, t, p: q[1:],
        jnp.ones(2),
        lambda q, qd, t, p: jnp.array([0.0, -GRAVITY]),
        friction=rx.Friction(lambda q, t, p: jnp.stack([q[0] ** 2 / 2 + q[1], q[0]]), rubbing, [0], ["linear"] * 2),
    )
    before, after = np.sqrt(mu * GRAVITY / (1 + mu)), np.sqrt(mu * GRAVITY / (1 - mu))
    at_zero = np.arctanh(before / rate) / before
    late = at_zero + np.array([0.1, 0.3])
    run = rx.simulate(system, rx.State([-1.0, 0.0], [rate, 0.0]), late[1], ts=[at_zero / 2, *late])
    early = -np.cosh(before * at_zero / 2) + rate / before * np.sinh(before * at_zero / 2)
    fast = np.sqrt(rate**2 - before**2) / after
    truth = [early, *(fast * np.sin(after * (late - at_zero)))]
    np.testing.assert_allclose(run.q[:, 0], truth, rtol=0, atol=1e-6)
    assert run.stats.phases == 2


def four_bar(friction: rx.AbstractFrictionModel | None) -> rx.Mechanism:
    """A crank of 0.2, a coupler of 0.5 and a rocker of 0.4 m on a ground of 0.5 m, rods of 2 kg/m."""
    (a, b, c, d), ground = (0.2, 0.5, 0.4, 0.5), "ground"
    rods = [rx.Body(name, 2 * size, size**3 / 6) for name, size in (("crank", a), ("coupler", b), ("rocker", c))]
    pins = [
        ("A", "crank", ground, (-a / 2, 0.0), (0.0, 0.0)),
        ("B", "coupler", "crank", (-b / 2, 0.0), (a / 2, 0.0)),
        ("C", "rocker", "coupler", (c / 2, 0.0), (b / 2, 0.0)),
        ("D", "rocker", ground, (-c / 2, 0.0), (d, 0.0)),
    ]
    return rx.Mechanism(rods, [rx.Revolute(*pin, 1.0, friction) for pin in pins], gravity=(0.0, -9.81))


@slow
def test_a_users_law_moves_as_the_built_in_one():
    """Coulomb friction written by hand, through four reversals of single joints."""
    plain, mu_rho = four_bar(None), 0.002

    def law(loads, rate, sense, memory, state, p):
        return -mu_rho * jnp.linalg.norm(loads, axis=1) * sense

    def slips(q, t, p):
        return jnp.stack([q[6], q[7] - q[6], q[8] - q[7], q[8]])

    user = rx.System(
        lambda q, t, p: plain.constraint(q, t),
        lambda q, t, p: plain.mass(q, t),
        lambda q, qd, t, p: plain.load(rx.State(q, qd, t)),
        coordinates=plain.coordinates,
        rows=plain.rows,
        friction=rx.Friction(slips, law, rows=np.arange(8).reshape(4, 2), kinds=["angular"] * 4),
    )
    guess = [0.05, 0.08, 0.3, 0.3, 0.6, 0.2, 1.0, 0.4, 1.3]
    state = rx.assemble(plain, guess, positions={"crank.phi": 1.0}, rates={"crank.phi": 5.0})
    own, built_in = (rx.simulate(system, state, 1.0) for system in (user, four_bar(rx.Coulomb(mu_rho))))
    assert own.stats.phases == built_in.stats.phases > 4
    np.testing.assert_allclose(own.q, built_in.q, rtol=0, atol=1e-6)
    np.testing.assert_allclose(own.friction, built_in.friction, rtol=0, atol=1e-6)


@slow
def test_a_batch_passes_over_phases_that_no_sample_needs():
    """Of 100,000 phases two are needed: passing over the others takes 0.1 s of the processor, idling 100 s."""
    mu = np.array([0.03, 0.05, 0.08])
    run = jax.jit(jax.vmap(lambda mu: rx.simulate(*block(mu), 2.0, ts=[2.0], max_phases=100_000, throw=False).q[0, 0]))
    np.testing.assert_allclose(run(mu), [where(x, 2.0) for x in mu], rtol=0, atol=1e-7)
    start = time.process_time()
    jax.block_until_ready(run(mu))
    assert time.process_time() - start < 10.0


@slow
def test_the_derivative_across_a_reversal_has_that_of_its_time():
    """A run whose event had no derivative of its own would be off by several percent."""
    h, t = 1e-4, 2.0
    truth = (where(0.05 + h, t) - where(0.05 - h, t)) / (2 * h)

    def end(mu):
        return rx.simulate(*block(mu), t, ts=[t], adjoint=diffrax.ForwardMode(), max_phases=3).q[0, 0]

    np.testing.assert_allclose(jax.jit(jax.jacfwd(end))(0.05), truth, rtol=0, atol=1e-6)


@cache
def crank(mu_rho: float, t1: float) -> tuple[float, list]:
    """Crank angle of the paper's mechanism at t1, or where it sticks, and the events before; (27) phase by phase."""
    parameters = paper.Parameters(mu_rho=mu_rho)

    def acceleration(phi, rate, sense):
        q, qd = paper.configuration(parameters, phi, sense * max(abs(rate), 1e-9))
        return paper.fixed_point(parameters, q, qd)[-1][8]

    def stopped(t, y):
        return y[1]

    stopped.terminal = True
    t, phi, rate, sense, events = 0.0, np.pi / 4, 1.0, 1.0, []
    while True:
        stopped.direction = -sense
        run = solve_ivp(
            lambda t, y, sense=sense: [y[1], acceleration(*y, sense)],
            (t, t1),
            [phi, rate],
            method="DOP853",
            rtol=1e-11,
            atol=1e-12,
            events=stopped,
        )
        t, phi, rate = run.t[-1], run.y[0, -1], 0.0
        if t >= t1:
            return phi, events
        events.append(t)
        sense = -sense
        if acceleration(phi, 0.0, sense) * sense <= 0:
            return phi, events


@slow
def test_the_papers_mechanism_sticks_where_the_scalar_equation_does():
    angle, events = crank(0.02, 10.0)
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    run = rx.simulate(mechanism, mechanism.state(jnp.pi / 4, rate=1.0), 10.0, ts=[1.0, 10.0], throw=False)
    assert run.result == rx.RESULTS.stuck
    assert run.stats.phases == len(events)
    np.testing.assert_allclose(run.stats.end, events[-1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.q[1, 8], angle, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.q[0, 8], crank(0.02, 1.0)[0], rtol=0, atol=1e-7)
    assert run.stats.steps + run.stats.rejected < 500


@slow
def test_many_joints_with_one_freedom_come_to_rest():
    """Six frictions hold one freedom, five of them are left to rounding; `sticking` proves the rest in another way."""
    mechanism = rx.mechanisms.doubled_four_bar(mu_rho=0.005)
    run = rx.simulate(mechanism, mechanism.state(0.9, rate=1.0), 10.0, ts=[10.0], throw=False)
    assert run.result == rx.RESULTS.stuck
    assert run.stats.energy_error < 1e-8
    found = rx.sticking(mechanism, rx.State(run.q[0], run.qd[0], run.t[0]))
    assert (found.verdict, found.proved) == ("must stick", True)


@slow
@pytest.mark.parametrize("way", ["forward", "reverse"])
def test_the_derivative_of_the_papers_motion_with_respect_to_friction(way):
    """d phi_1(0.3 s) / d mu_rho, across the reversal of the crank; the truth is that of the scalar equation."""
    truth = richardson(lambda mu_rho: crank(mu_rho, 0.3)[0], 0.02, 2e-3)

    def angle(mu_rho, **options):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
        return rx.simulate(mechanism, mechanism.state(jnp.pi / 4, rate=1.0), 0.3, ts=[0.3], **options).q[0, 8]

    if way == "reverse":
        found = jax.jit(jax.grad(angle))(0.02)
    else:
        found = jax.jit(jax.jacfwd(lambda mu_rho: angle(mu_rho, adjoint=diffrax.ForwardMode())))(0.02)
    np.testing.assert_allclose(found, truth, rtol=1e-6)


def test_smooth_friction_models():
    """The forces at hand-made rates; with `RegularisedCoulomb` nothing depends on the sense."""
    rate, sense = jnp.asarray(0.3), jnp.ones(())
    smooth = rx.RegularisedCoulomb(0.2, velocity=0.1, preload=1.0)
    assert smooth.force(jnp.asarray(4.0), rate, sense, None) == pytest.approx(-np.tanh(3.0))
    assert smooth.force(jnp.asarray(4.0), rate, -sense, None) == pytest.approx(-np.tanh(3.0))
    stribeck = rx.Stribeck(0.3, 0.2, velocity=0.6, viscous=2.0)
    truth = -(0.2 + 0.1 * np.exp(-0.25)) * 5 - 0.6
    assert stribeck.force(jnp.asarray(5.0), rate, sense, None) == pytest.approx(truth)
