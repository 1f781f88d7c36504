"""Derivatives past instants at which a joint begins to press its other side, where friction bends: closed form."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import redundax as rx

MASS, MU, PULL, SIZE, SPEED, END = 2.0, 0.3, 4.0, 30.0, 2.0, 0.8


def block(forces, given):
    """A block on a guide, under a force along and one across it, of time and figures."""

    def wrench(i, j, t, given):
        force = jnp.stack(forces(t, given))
        return rx.Wrench(force, 0.0 * t), rx.Wrench(0.0 * force, 0.0 * t)

    rubs = {"friction": rx.Coulomb(MU), "guide_length": 0.5}
    guide = rx.Translational("K", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), **rubs)
    loads = [rx.LoadFunction("block", wrench, parameters=given)]
    return rx.Mechanism([rx.Body("block", MASS, 0.3)], [guide], loads=loads)


def slid(shift, rtol, adjoint=None, pull=PULL, speed=SPEED, end=END):
    """How far a block is at the end, and how fast, whose guide bears N = SIZE (cos(6 t + 0.3) + shift)."""
    mechanism = block(lambda t, shift: (pull + 0.0 * t, -SIZE * (jnp.cos(6.0 * t + 0.3) + shift)), shift)
    state = rx.State(jnp.zeros(3), jnp.stack([1.0 * speed, 0.0, 0.0]))
    run = rx.simulate(mechanism, state, end, ts=jnp.stack([end]), rtol=rtol, adjoint=adjoint)
    return jnp.stack([run.q[0, 0], run.qd[0, 0]])


def slopes(shift):
    """Of x and v: those of the integrals of (END - t) v' and v' = (PULL - MU |N|) / MASS; the turns of N move."""
    turns = np.sort([(2 * np.pi * k + side * np.arccos(-shift) - 0.3) / 6 for k in range(3) for side in (-1, 1)])
    at = np.array([0.0, *turns[(turns > 0) & (turns < END)], END])
    sign = np.sign(np.cos(6 * (at[1:] + at[:-1]) / 2 + 0.3) + shift)
    parts = np.array([np.diff(-((END - at) ** 2) / 2), np.diff(at)])
    return -MU * SIZE / MASS * parts @ sign


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-4, 1e-8])
def test_forward_derivatives_pass_reversals_of_a_load(rtol):
    """They were off by 0.05 at 1e-4 and 5e-4 at 1e-8."""
    found = jax.jvp(lambda x: slid(x, rtol, diffrax.ForwardMode()), (0.3,), (1.0,))[1]
    np.testing.assert_allclose(found, slopes(0.3), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_reverse_derivatives_pass_reversals_of_a_load():
    np.testing.assert_allclose(jax.jacrev(lambda x: slid(x, 1e-8))(0.3), slopes(0.3), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_derivatives_of_batches_pass_reversals_each_at_its_own_time():
    shifts = np.array([0.3, 0.1, 0.8])
    found = jax.vmap(jax.jacfwd(lambda x: slid(x, 1e-7, diffrax.ForwardMode())))(shifts)
    np.testing.assert_allclose(found, [slopes(x) for x in shifts], rtol=0, atol=1e-8)


@pytest.mark.slow
def test_second_derivatives_pass_reversals_of_a_load():
    """They were 0 without a word: the instants of reversals move."""
    found = jax.jacfwd(jax.jacfwd(lambda x: slid(x, 1e-8, diffrax.ForwardMode())))(0.3)
    few = 1e-5
    np.testing.assert_allclose(found, (slopes(0.3 + few) - slopes(0.3 - few)) / (2 * few), rtol=0, atol=1e-7)


def turned_back(shift, speed, pull, end):
    """Where the block is that slides forward, stops and is pulled back, past the first reversal of its load."""
    turn, at, x, v, ways = (np.arccos(-shift) - 0.3) / 6, 0.0, 0.0, speed, [1.0]

    def load(t):
        """Integrals of N."""
        once = np.array([np.sin(6 * t + 0.3) / 6 + shift * t, -np.cos(6 * t + 0.3) / 36 + shift * t**2 / 2])
        return SIZE * once

    def then(t):
        side = -MU * ways[0] * np.sign(turn - (at + t) / 2) / MASS
        (one, two), (start, both), left = load(t), load(at), t - at
        gain = pull / MASS
        return np.array([
            x + v * left + gain * left**2 / 2 + side * (two - both - start * left),
            v + gain * left + side * (one - start),
        ])  # fmt: skip

    while at < end:
        until = turn if at < turn else end
        if ways[0] > 0 and then(until)[1] < 0:
            until = brentq(lambda t: then(t)[1], at, until, xtol=1e-15)
            (x, v), ways[0] = then(until), -1.0
            v = 0.0
        else:
            x, v = then(until)
        at = until
    return x


@pytest.mark.slow
def test_derivatives_pass_reversals_just_before_a_stop_and_just_after_one():
    """Off by 1e-5: a step up to an event was not looked at, nor the first one after it."""
    pull, shift, few = -6.0, 0.3, 1e-6
    turn = (np.arccos(-shift) - 0.3) / 6
    stops = MU * SIZE / MASS * ((np.sin(6 * turn + 0.3) - np.sin(0.3)) / 6 + shift * turn) - pull * turn / MASS
    forward = diffrax.ForwardMode()

    @jax.jit
    def slope(speed, end):
        return jax.jvp(lambda x: slid(x, 1e-8, forward, pull, speed, end)[0], (shift,), (1.0,))[1]

    for more in (1e-4, -1e-4, -1e-3):
        speed, end = stops + more, turn + 2e-3
        one, other = (turned_back(x, speed, pull, end) for x in (shift + few, shift - few))
        np.testing.assert_allclose(slope(speed, end), (one - other) / (2 * few), rtol=0, atol=2e-9)


@pytest.mark.slow
@pytest.mark.parametrize("jumps", [[0.4], None])
def test_a_load_that_jumps_is_no_reversal(jumps):
    """It was tried tens of thousands of times, as the tangents of its friction meet late, and `max_steps` ran out."""

    def run(shift):
        mechanism = block(lambda t, x: (PULL + 0.0 * t, x + jnp.where(t < 0.4, -1000.0, 0.1)), shift)
        state = rx.State(jnp.zeros(3), jnp.array([80.0, 0.0, 0.0]))
        forward = diffrax.ForwardMode()
        motion = rx.simulate(mechanism, state, 1.0, ts=[1.0], jump_ts=jumps, adjoint=forward, max_steps=300)
        return motion.qd[0, 0]

    found = jax.jvp(run, (0.0,), (1.0,))[1]
    np.testing.assert_allclose(found, MU / MASS * (0.4 - 0.6), rtol=0, atol=1e-8)


def wrench(force, moment):
    return rx.Wrench(force, moment), rx.Wrench(0.0 * force, 0.0 * moment)


def across(t, shift):
    """SIZE (cos(6 t + 0.3) + shift) down."""
    return jnp.stack([0.0 * t, -SIZE * (jnp.cos(6.0 * t + 0.3) + shift)])


@pytest.mark.slow
def test_derivatives_pass_both_reversals_of_a_guide_with_a_small_moment():
    """Off by 0.02: friction of a step past both is not that of one bend, so that it was none."""
    length = 0.5

    def end(given):
        guide = rx.Translational(
            "K", "block", "ground", (0, 0), (0, 0), (0, 1), friction=rx.Coulomb(MU), guide_length=length
        )
        loads = [rx.LoadFunction("block", lambda i, j, t, p: wrench(across(t, p[0]), p[1] + 0.0 * t), parameters=given)]
        mechanism = rx.Mechanism([rx.Body("block", MASS, 0.3)], [guide], loads=loads)
        state = rx.State(jnp.zeros(3), jnp.array([10.0, 0.0, 0.0]))
        return rx.simulate(mechanism, state, END, ts=[END], rtol=1e-7, adjoint=diffrax.ForwardMode()).qd[0, 0]

    slope = jax.jit(jax.jacfwd(end))
    for moment in (1e-6, 1e-4, 1e-2, 0.1):
        ends = np.array([1.0, -1.0])  # each bears N / 2 + M / length or the other way
        both = [-0.3 - side * 2 * moment / length / SIZE for side in ends]
        turns = np.array(
            [[(way * np.arccos(c) - 0.3 + 2 * np.pi * k) / 6 for k, way in ((0, 1), (1, -1))] for c in both]
        )
        signs = turns[:, 0] - (turns[:, 1] - turns[:, 0]) + END - turns[:, 1]  # integrals of each end's
        want = -MU / MASS * np.array([SIZE / 2 * signs.sum(), ends @ signs / length])
        np.testing.assert_allclose(slope(jnp.array([0.3, moment])), want, rtol=0, atol=1e-7)


@pytest.mark.slow
def test_derivatives_pass_a_rough_foot_that_lifts_and_a_reversal_at_that_instant():
    """Off by 1e-3 and 4e-3: the step to the event told friction just past it. The weight of a third body gives loads a
    size at the instant at which all others are zero."""
    end, mu = 0.5, 0.2
    turn = (np.arccos(-0.3) - 0.3) / 6

    def moved(shifts):
        at, up, rough = (0.0, 0.0), (0.0, 1.0), rx.Coulomb(mu)
        joints = [
            rx.PinInSlot("F", "foot", "ground", at, at, up, friction=rough, one_sided=True),
            rx.PinInSlot("S", "pin", "ground", at, at, up, friction=rough),
        ]
        loads = [
            rx.LoadFunction(name, lambda i, j, t, p: wrench(across(t, p), 0.0 * t), parameters=shift)
            for name, shift in zip(("foot", "pin"), shifts, strict=True)
        ]
        joints.append(rx.PinInSlot("R", "rest", "ground", at, at, up))
        bodies = [rx.Body(name, MASS, 0.3) for name in ("foot", "pin", "rest")]
        loads.append(rx.AppliedForce("rest", force=(0.0, -SIZE)))
        mechanism = rx.Mechanism(bodies, joints, loads=loads)
        rates = [10.0 * (name in ("foot.x", "pin.x")) for name in mechanism.coordinates.labels]
        start = rx.State(jnp.zeros(9), jnp.array(rates))
        options = {"rtol": 1e-7, "max_phases": 3, "adjoint": diffrax.ForwardMode()}
        run = rx.simulate(mechanism, start, end, ts=[end], **options)
        return jnp.stack([run.qd[0, mechanism.coordinates.labels.index(name)] for name in ("foot.x", "pin.x")])

    slope = jax.jit(jax.jacfwd(moved))
    for late in (0.0, 1e-9, -1e-9):
        other = (np.arccos(-0.3 - late) - 0.3) / 6
        want = -mu * SIZE / MASS * np.diag([turn, other - (end - other)])
        np.testing.assert_allclose(slope(jnp.array([0.3, 0.3 + late])), want, rtol=0, atol=1e-7)
