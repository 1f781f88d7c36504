"""Dahl and LuGre friction against closed forms and separately written scalar equations."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_stick_slip import crank
from truth.bristles import GRAVITY, LUGRE, SPEED, block, pulled

import redundax as rx

slow = pytest.mark.slow


@slow
@pytest.mark.parametrize(
    ("stiffness", "damping", "solver"), [(1e3, 5.0, None), (1e5, 50.0, None), (1e5, 50.0, rx.Radau())]
)
def test_a_pulled_block_stops_and_goes_as_the_scalar_equations_do(stiffness, damping, solver):
    """Twice in 6 s it breaks loose; with short bristles the equations are stiff."""
    values = {**LUGRE, "stiffness": stiffness, "damping": damping}
    times = np.linspace(0, 6, 25)
    x, v, z, tau = pulled(times, **values)
    assert v.max() > SPEED and (np.abs(v) < 0.1 * SPEED).sum() > 5
    run = rx.simulate(*block(rx.LuGre(**values)), 6.0, ts=times, solver=solver)
    np.testing.assert_allclose(run.q[:, 0], x, rtol=0, atol=2e-8)
    np.testing.assert_allclose(run.memory[0][:, 0], z, rtol=0, atol=2e-8 * 0.3 / stiffness * 100)
    np.testing.assert_allclose(run.friction[:, 0], tau, rtol=0, atol=1e-4)
    assert run.stats.steps < 2000 and run.stats.energy_error < 1e-6
    again = jax.tree.map(lambda x: x[4], run.states)  # from 1 s on
    rest = rx.simulate(block(rx.LuGre(**values))[0], again, 6.0, ts=times[4:], solver=solver)
    np.testing.assert_allclose(rest.q[:, 0], x[4:], rtol=0, atol=5e-8)


MU, BRISTLES, REACH = 0.3, 60.0, 0.02


def to_and_fro(t):
    """Position of a block that is moved to and fro."""
    return REACH * jnp.sin(t)


def dahl(t):
    """tau / N as the block is moved: exponentials between the reversals at pi / 2 and 3 pi / 2."""
    shift, last, share = np.sin(t) * REACH, 0.0, 0.0
    for turn, sign in ((np.pi / 2, 1.0), (3 * np.pi / 2, -1.0), (np.inf, 1.0)):
        there = min(t, turn)
        x = REACH * np.sin(there)
        share = sign * MU + (share - sign * MU) * np.exp(-BRISTLES * abs(x - last) / MU)
        last = x
        if t <= turn:
            break
    assert last == shift
    return -share


def by_function(mu):
    """The block as functions, held by a driver, with the bristles of one's own."""

    def force(loads, rate, sense, memory, state, p):
        return -jnp.abs(loads[:1]) * BRISTLES * memory["z"]

    def bend(rate, memory, state, p):
        return {"z": rate - BRISTLES * jnp.abs(rate) * memory["z"] / p}

    friction = rx.Friction(
        lambda q, t, p: q[:1], force, [0], ["linear"], mu, memory={"z": jnp.full(1, MU / BRISTLES)}, memory_rate=bend
    )
    return rx.System(
        lambda q, t, p: jnp.stack([q[1], q[0] - to_and_fro(t)]),
        jnp.ones(2),
        lambda q, qd, t, p: jnp.stack([0.0, -GRAVITY]),
        friction=friction,
    )


@slow
def test_hysteresis_before_slip_is_that_of_the_closed_form():
    times = np.linspace(0.0, 6.0, 25)
    run = rx.simulate(by_function(MU), rx.State([0.0, 0.0], [REACH, 0.0]), 6.0, ts=times)
    np.testing.assert_allclose(run.friction[:, 0], [GRAVITY * dahl(t) for t in times], rtol=0, atol=1e-6)
    assert np.ptp(run.friction) > 1.9 * MU * GRAVITY


@slow
@pytest.mark.parametrize("way", ["reverse", "forward"])
def test_the_derivative_passes_the_bristles(way):
    """d tau / d mu at t = 1, of tau = -mu N (1 - exp(-stiffness x / mu))."""

    def tau(mu, adjoint=None):
        run = rx.simulate(by_function(mu), rx.State([0.0, 0.0], [REACH, 0.0]), 1.0, ts=[1.0], adjoint=adjoint)
        return run.friction[0, 0]

    bent = BRISTLES * REACH * np.sin(1.0) / MU
    truth = -GRAVITY * (1 - np.exp(-bent) * (1 + bent))
    found = jax.grad(tau)(MU) if way == "reverse" else jax.jacfwd(lambda mu: tau(mu, diffrax.ForwardMode()))(MU)
    np.testing.assert_allclose(found, truth, rtol=1e-6)


@slow
def test_derivatives_pass_bristles_that_turn_round():
    """Off by 1.5e-4: what the bristles do bends where the slip turns. The truth is that of the scalar equations."""
    stiffness, spring, mass, load, rate, end = 300.0, 300.0, 2.0, 30.0, 1.0, 0.6

    def moved(mu):
        def pull(q, qd, t, p):
            return jnp.stack([-spring * q[0], -load + 0.0 * t])

        def bend(slip, memory, state, p):
            return slip - stiffness * jnp.abs(slip) * memory / p

        def force(loads, slip, sense, memory, state, p):
            return -jnp.abs(loads[:1]) * stiffness * memory

        rubs = rx.Friction(
            lambda q, t, p: q[:1], force, [0], ["linear"], mu, memory=jnp.full(1, 1e-3), memory_rate=bend
        )
        block = rx.System(lambda q, t, p: q[1:], mass * jnp.ones(2), pull, friction=rubs)
        start = rx.State(jnp.zeros(2), jnp.array([rate, 0.0]))
        run = rx.simulate(block, start, end, ts=[end], adjoint=diffrax.ForwardMode())
        return jnp.stack([run.q[0, 0], run.qd[0, 0]])

    def truth(mu):
        def slope(t, y):
            force = -spring * y[0] - load * stiffness * y[2]
            return [y[1], force / mass, y[1] - stiffness * abs(y[1]) * y[2] / mu]

        def turns(t, y):
            return way * y[1] if t > begin + 1e-7 else 1.0

        turns.terminal = True
        begin, y, way = 0.0, np.array([0.0, rate, 0.0]), 1.0
        while begin < end:
            run = solve_ivp(slope, (begin, end), y, "DOP853", events=turns, rtol=1e-12, atol=1e-13)
            begin, y, way = run.t[-1], run.y[:, -1], -way
        return y[:2]

    few = 1e-3
    near, far = (truth(MU + k * few) - truth(MU - k * few) for k in (1, 2))
    value, slope = jax.jvp(moved, (MU,), (1.0,))
    np.testing.assert_allclose(value, truth(MU), rtol=0, atol=1e-8)
    np.testing.assert_allclose(slope, (8 * near - far) / (12 * few), rtol=3e-6)


def bristled(model):
    """The paper's mechanism with a friction model in its revolutes."""
    l, h = 0.1, 0.1 * np.sqrt(2)  # noqa: E741 (the paper's letter)
    bodies = [rx.Body(str(k + 1), m, m * l**2 * c) for k, (m, c) in enumerate([(3, 2 / 3), (9, 16 / 3)] * 2)]
    joints = [
        rx.Revolute("A", "1", "ground", (-h, 0.0), (0.0, 0.0), pin_radius=1.0, friction=model),
        rx.Revolute("B", "2", "1", (-4 * l, 0.0), (h, 0.0), pin_radius=1.0, friction=model),
        rx.Revolute("C", "3", "2", (h, 0.0), (4 * l, 0.0), pin_radius=1.0, friction=model),
        rx.Revolute("D", "3", "ground", (-h, 0.0), (8 * l, 0.0), pin_radius=1.0, friction=model),
        rx.Translational("K", "4", "ground", (0.0, 0.0), (4 * l, 0.0), (1.0, 0.0)),
        rx.Translational("L", "4", "2", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    ]
    return rx.Mechanism(bodies, joints, gravity=(0.0, -10.0))


@slow
def test_the_papers_mechanism_comes_to_rest_on_its_bristles():
    """Where Coulomb friction lets it stick, to the deflection of the bristles; nothing stops the motion."""
    angle, events = crank(0.02, 10.0)
    end = events[-1] + 0.5
    state = rx.mechanisms.wojtyra2020().state(jnp.pi / 4, rate=1.0)
    model = rx.LuGre(0.02, 0.02, velocity=0.1, stiffness=20.0, damping=0.005)
    run = rx.simulate(bristled(model), state, end, ts=np.linspace(0.0, end, 11))
    assert run.result == rx.RESULTS.successful
    assert np.abs(run.qd[-1]).max() < 0.02
    np.testing.assert_allclose(run.q[-1, 8], angle, rtol=0, atol=5e-3)
    assert max(run.stats.position_violation, run.stats.velocity_violation) < 1e-13
    assert run.stats.energy_error < 1e-6
    weights = np.abs(run.friction[-1]) / np.hypot(run.multipliers[-1, 0:8:2], run.multipliers[-1, 1:8:2])
    np.testing.assert_allclose(weights, 20.0 * np.abs(run.memory[0][-1]), rtol=0, atol=1e-4)


@slow
def test_friction_with_a_memory_in_other_units():
    """Bristles bent by hand: the law at a state, in metres and in millimetres."""
    system, state = block(rx.LuGre(**LUGRE))
    state = rx.State(state.q, jnp.array([0.02, 0.0, 0.0]), 0.3, (jnp.array([1e-4]),))
    solution = rx.solve(system, state)
    rate = 0.02 - 1e3 * 0.02 * 1e-4 / (0.2 + 0.1 * np.exp(-4.0))
    np.testing.assert_allclose(solution.friction, -25.0 * (1e3 * 1e-4 + 5 * rate + 0.4 * 0.02), rtol=1e-12)
    units = rx.units.Units(length=1000.0, time=1e3)
    there = rx.solve(rx.units.in_units(system, units), rx.units.state_in_units(state, system, units))
    there = rx.units.solution_from_units(there, system, units)
    np.testing.assert_allclose(there.friction, solution.friction, rtol=1e-12)
    np.testing.assert_allclose(there.acceleration, solution.acceleration, rtol=0, atol=1e-12)
    none = rx.solve(system, rx.State(state.q, jnp.zeros(3)))
    assert none.friction == 0.0 and none.stats.contraction == 0.0


def test_errors():
    with pytest.raises(rx.RedundaxError, match="`stiffness` must be positive"):
        rx.Dahl(0.1, stiffness=0.0)
    with pytest.raises(rx.RedundaxError, match="`memory_rate` must be given together"):
        rx.Friction(lambda q, t, p: q, lambda *_: 0.0, [0], ["linear"], memory=jnp.ones(1))
    system, state = block(rx.LuGre(**LUGRE))
    with pytest.raises(rx.RedundaxError, match="memory for each of 1 friction groups, but has 2"):
        rx.solve(system, rx.State(state.q, state.qd, memory=(None, None)))
