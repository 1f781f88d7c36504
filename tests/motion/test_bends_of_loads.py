"""Derivatives of motions past instants at which loads that users write bend, as k max(x, 0) of a bumper."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import redundax as rx

slow = pytest.mark.slow
RATE, END = 10.0, 2.0  # rad/s, s


def between_bumpers(gap, rtol, adjoint=None):
    """Where a mass of 1 kg is that flies to and fro between two bumpers of 100 N/m, from the middle at 1 m/s."""

    def load(q, qd, t, gap):
        pressed = jnp.maximum(q[0] - gap, 0.0) + jnp.minimum(q[0] + gap, 0.0)
        return jnp.stack([-(RATE**2) * pressed, 0.0 * pressed])

    guide, mass = lambda q, t, gap: q[1:], lambda q, t, gap: jnp.eye(2)
    system = rx.System(guide, mass, load, n=2, rows="force", parameters=gap)
    start = rx.State(jnp.zeros(2), jnp.array([1.0, 0.0]))
    return rx.simulate(system, start, END, ts=[END], rtol=rtol, adjoint=adjoint).q[0, 0]


def flown(gap):
    t, side = gap, 1.0
    while t + np.pi / RATE < END:
        t, side = t + np.pi / RATE + 2 * gap, -side
    return side * (gap + jnp.sin(RATE * (END - t)) / RATE)


@pytest.mark.parametrize(("rtol", "most"), [(1e-4, 1e-4), (1e-8, 1e-7)])
def test_forward_derivatives_pass_bumpers(rtol, most):
    """Of 1.9 and 0.1 they were off, without a word."""
    out, slope = jax.jvp(lambda gap: between_bumpers(gap, rtol, diffrax.ForwardMode()), (0.03,), (1.0,))
    assert abs(out - flown(0.03)) < most and abs(slope - jax.grad(flown)(0.03)) < most


@slow
def test_reverse_derivatives_pass_bumpers():
    slope = jax.grad(lambda gap: between_bumpers(gap, 1e-8))(0.03)
    np.testing.assert_allclose(slope, jax.grad(flown)(0.03), rtol=1e-7)


@slow
def test_derivatives_by_the_end_of_a_ramp_and_none_of_second_order():
    def ramp(i, j, t, p):
        force = jnp.stack([5.0 * jnp.minimum(t / p["end"], 1.0), 0.0 * t])
        return i.wrench(force, jnp.zeros(2)), j.wrench(jnp.zeros(2), jnp.zeros(2))

    def moved(end):
        guide = rx.Translational("g", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0))
        load = rx.LoadFunction("block", ramp, "ground", {"end": end})
        block = rx.Mechanism([rx.Body("block", 2.0, 0.1)], [guide], loads=[load])
        start = rx.State(jnp.zeros(3), jnp.zeros(3))
        return rx.simulate(block, start, 1.0, ts=[1.0], rtol=1e-5, adjoint=diffrax.ForwardMode()).q[0, 0]

    def truth(end):
        return 2.5 * (end**2 / 6 + end * (1 - end) / 2 + (1 - end) ** 2 / 2)

    np.testing.assert_allclose(jax.jacfwd(moved)(0.37), jax.grad(truth)(0.37), rtol=1e-9)
    assert np.isnan(jax.jacfwd(jax.jacfwd(moved))(0.37))


@slow
@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
def test_no_stage_of_a_step_before_a_bend_is_past_it(rtol):
    """A spring lifts a block off the lower side of its guide, at an instant that depends on the motion.

    Stages, less accurate than the end of a step, passed the bend of |N| before it, and the slope was off by 2e-5.
    """
    stiffness, free, mass, weight, place = 200.0, 0.4, 2.0, 8.0, np.array([0.3, 0.4])

    def moved(mu):
        guide = {"guide_length": 0.2, "friction": rx.Coulomb(mu)}
        joint = rx.Translational("g", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), **guide)
        spring = rx.SpringDamper("block", "ground", (0.0, 0.0), place, stiffness=stiffness, free_length=free)
        block = rx.Mechanism([rx.Body("block", mass, 0.1)], [joint], loads=[spring], gravity=(0.0, -weight / mass))
        start = rx.State(jnp.zeros(3), jnp.array([1.5, 0.0, 0.0]))
        return rx.simulate(block, start, 0.35, ts=[0.35], rtol=rtol, adjoint=diffrax.ForwardMode()).q[0, 0]

    def pulled(x):
        way = place - np.array([x, 0.0])
        return stiffness * (np.hypot(*way) - free) * way / np.hypot(*way)

    def truth(mu):
        t, y, side = 0.0, [0.0, 1.5], np.sign(weight - pulled(0.0)[1])
        while t < 0.35:

            def rates(_, y, side=side):
                along, up = pulled(y[0])
                return [y[1], (along - mu * side * (weight - up)) / mass]

            def turned(t, y):
                return weight - pulled(y[0])[1]

            turned.terminal, turned.direction = True, -side
            end = solve_ivp(rates, (t, 0.35), y, "DOP853", events=turned, rtol=1e-12, atol=1e-13)
            t, y, side = end.t[-1], end.y[:, -1], -side
        return y[0]

    slope = jax.jvp(moved, (0.3,), (1.0,))[1]
    assert abs(slope - (truth(0.3 + 1e-3) - truth(0.3 - 1e-3)) / 2e-3) < 2e-6


@slow
def test_a_large_smooth_load_hides_no_bumper():
    """Off by 0.04: bends were looked for in the size of all loads."""

    def flung(p):
        def load(q, qd, t, p):
            return jnp.stack([-p[0] * jnp.maximum(q[0] - p[1], 0.0), 1e5 * jnp.cos(6.0 * t), 0.0 * t])

        system = rx.System(
            lambda q, t, p: q[2:], jnp.array([2.0, 50.0, 1.0]), load, parameters=p, rows="force", m=1, length=1.0
        )
        start = rx.State(jnp.zeros(3), jnp.array([1.0, 0.0, 0.0]))
        return rx.simulate(system, start, 1.0, ts=[1.0], adjoint=diffrax.ForwardMode()).q[0, 0]

    def truth(p):
        pressed = jnp.pi * jnp.sqrt(2.0 / p[0])
        return 2 * p[1] + pressed - 1.0

    at = jnp.array([100.0, 0.4])
    np.testing.assert_allclose(jax.jacfwd(flung)(at), jax.grad(truth)(at), rtol=1e-6)


def roughening(p):
    """How far a block slides over a floor that is the rougher the further, from a place on."""

    def force(loads, rate, sense, memory, state, p):
        return -p[0] * (1.0 + 3.0 * jnp.maximum(state.q[:1] - p[1], 0.0)) * jnp.abs(loads[:1]) * sense

    rubs = rx.Friction(lambda q, t, p: q[:1], force, [0], ["linear"], p)
    load = lambda q, qd, t, p: jnp.stack([0.0, -20.0])  # noqa: E731
    block = rx.System(lambda q, t, p: q[1:], 2.0 * jnp.ones(2), load, friction=rubs)
    start = rx.State(jnp.zeros(2), jnp.array([2.0, 0.0]))
    return rx.simulate(block, start, 0.4, ts=[0.4], rtol=1e-5, adjoint=diffrax.ForwardMode()).q[0, 0]


@slow
def test_derivatives_pass_friction_that_bends_with_the_place():
    """As that of a slider does that comes out of its guide. It slows down by g mu (1 + 3 (x - a)_+)."""

    def truth(p):
        slows, turn = 10.0 * p[0], jnp.sqrt(30.0 * p[0])
        rate = jnp.sqrt(4.0 - 2 * slows * p[1])
        t = 0.4 - (2.0 - rate) / slows
        return p[1] - 1 / 3 + jnp.cos(turn * t) / 3 + rate / turn * jnp.sin(turn * t)

    at = jnp.array([0.2, 0.3])
    np.testing.assert_allclose(roughening(at), truth(at), rtol=1e-5)
    np.testing.assert_allclose(jax.jacfwd(roughening)(at), jax.grad(truth)(at), rtol=1e-5)


def test_which_friction_of_joints_may_bend():
    def group(length, model):
        ram = rx.spatial.Body("ram", 1.0, inertia=(1.0, 1.0, 1.0))
        rubs = {"guide_length": length, "twist_radius": 0.1, "friction": model}
        guide = rx.spatial.Prismatic("guide", ram, "ground", (0, 0, 0), (1, 0, 0), **rubs)
        return rx.Mechanism([ram], [guide]).friction[0]

    comes_out = rx.spatial.Overlap(slider=(-0.2, 0.2), guide=(-0.2, 0.3))
    assert group(comes_out, rx.Coulomb(0.1)).may_bend and group(0.4, rx.Dahl(0.1, stiffness=1e3)).may_bend
    assert not group(0.4, rx.Coulomb(0.1)).may_bend and not group(0.4, rx.Stribeck(0.2, 0.1, 1e-3)).may_bend
