"""Loads with a kink or a jump in time: derivatives after it, against closed forms of sliders at 30 digits."""

import itertools

import diffrax
import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import redundax as rx

GUIDE = (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)
FORWARD = {"adjoint": diffrax.ForwardMode()}


def along_x(force):
    """A load on a body in x, by its motion, time and parameters."""

    def load(i, j, t, p):
        none = 0.0 * t
        return rx.Wrench(jnp.stack([force(i, t, p), none]), none), rx.Wrench(jnp.zeros(2), jnp.zeros(()))

    return load


def slope_of(truth, given, k):
    """The derivative of a closed form by one of its arguments."""
    with mpmath.workdps(30):
        given = [mpmath.mpf(str(x)) for x in given]
        return float(mpmath.diff(lambda x: truth(*given[:k], x, *given[k + 1 :]), given[k], h=mpmath.mpf("1e-10")))


def on_a_spring(load, p, span, **options):
    """Where a slider of 2 kg on a spring of 5 N/m ends."""
    force = along_x(lambda i, t, p: load(t, p) - 5.0 * i.pose.r[0])
    guide, pull = rx.Translational("guide", "b", "ground", *GUIDE), rx.LoadFunction("b", force, parameters=p)
    mechanism = rx.Mechanism([rx.Body("b", 2.0, 0.1)], [guide], loads=[pull])
    return rx.simulate(mechanism, rx.assemble(mechanism, {}), span, ts=[span], **options).q[0, 0]


@pytest.mark.slow
def test_derivatives_by_the_instant_of_a_kink_and_of_a_jump_are_as_accurate_as_others():
    """A force that rises to 3 N/s t_1 and is gone from t_2 on: of a slider on a spring, by the ramps that make it."""

    def load(t, p):
        return jnp.where(t < p[1], 3.0 * jnp.minimum(t, p[0]), 0.0)

    def place(kink, end):
        pull = lambda t: 3 * min(t, kink)  # noqa: E731
        w = mpmath.sqrt(mpmath.mpf(5) / 2)
        return mpmath.quad(lambda t: pull(t) * mpmath.sin(w * (2 - t)) / (2 * w), [0, kink, end])

    found = jax.jacfwd(lambda p: on_a_spring(load, p, 2.0, jump_ts=p[::-1], **FORWARD))(jnp.array([0.7, 1.6]))
    want = [slope_of(place, (0.7, 1.6), k) for k in range(2)]
    np.testing.assert_allclose(found, want, rtol=1e-8)
    pushed = jax.jacfwd(lambda p: on_a_spring(load, p, 2.0, jump_ts=p, **FORWARD))
    assert np.all(np.isnan(pushed(jnp.array([1.0, np.nextafter(1.0, 2.0)]))))  # no step lies between them


@pytest.mark.slow
def test_steps_end_where_laws_of_time_are_not_smooth():
    """A spring pulls a slider along a trapezoid of speed that begins at 0.1 s and speeds up for 0.15 s."""
    begin, ramp, speed, rate, stroke, end = 0.1, 0.15, 0.6, 4.0, 0.3, 1.5
    law = 0.2 - 2.0 * rx.Trapezoid(-stroke / 2, speed / 2, rate / 2, begin=begin)
    force = along_x(lambda i, t, p: p[0] * (p[1](t) - i.pose.r[0]))

    def moved(stiff, **options):
        guide = rx.Translational("guide", "b", "ground", *GUIDE)
        pull = rx.LoadFunction("b", force, parameters=(stiff, law))
        mechanism = rx.Mechanism([rx.Body("b", 5.0, 0.1)], [guide], loads=[pull])
        return rx.simulate(mechanism, rx.assemble(mechanism, {"b.x": 0.2}), end, ts=[end], **options)

    def place(stiff):
        """x'' = w^2 (s - x), so that e = s - x has e'' + w^2 e = s''."""
        on, w = stroke / speed, mpmath.sqrt(stiff / 5)
        boxes = [(begin, rate), (begin + ramp, -rate), (begin + on, -rate), (begin + on + ramp, rate)]
        return mpmath.mpf(0.5) - sum(a * (1 - mpmath.cos(w * (end - t))) / w**2 for t, a in boxes)

    motion = moved(45.0)
    np.testing.assert_allclose(motion["b.x"], [float(place(mpmath.mpf(45)))], rtol=1e-9)
    assert motion.stats.steps + motion.stats.rejected < 40  # of 75 where steps do not end there
    slope = jax.jacfwd(lambda stiff: moved(stiff, **FORWARD)["b.x"][0])(45.0)
    np.testing.assert_allclose(slope, slope_of(place, (45.0,), 0), rtol=1e-7)


@pytest.mark.slow
def test_derivatives_by_the_figures_of_a_law_that_jumps():
    """Of a pendulum whose pivot follows a trapezoid of speed, by its stroke: no step ends at an instant that stays."""
    mass, inertia, arm, gravity, speed, rate, begin, end = 1.0, 0.1, 0.5, 9.81, 0.6, 4.0, 0.1, 1.0

    def swung(stroke):
        law = rx.Trapezoid(stroke, speed, rate, start=1.0, begin=begin)
        joints = [
            rx.Translational("guide", "b", "ground", *GUIDE),
            rx.DistanceDriver("drive", "b", "ground", (0.0, 0.0), (-1.0, 0.0), law),
            rx.Revolute("pivot", "p", "b", (0.0, arm), (0.0, 0.0)),
        ]
        bodies = [rx.Body("b", 3.0, 0.1), rx.Body("p", mass, inertia)]
        mechanism = rx.Mechanism(bodies, joints, gravity=(0.0, -gravity))
        return rx.simulate(mechanism, rx.assemble(mechanism, {"p.y": -arm}), end, ts=[end], **FORWARD)["p.phi"][0]

    def truth(stroke):
        ramp, on = speed / rate, stroke / speed
        ends, y = [0.0, begin, begin + ramp, begin + on, begin + on + ramp, end], [0.0, 0.0]
        for (first, last), a in zip(itertools.pairwise(ends), (0.0, rate, 0.0, -rate, 0.0), strict=True):
            pull = lambda t, y, a=a: (  # noqa: E731
                [y[1], -mass * arm * (gravity * np.sin(y[0]) + a * np.cos(y[0])) / (inertia + mass * arm**2)]
            )
            y = solve_ivp(pull, (first, last), y, "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
        return y[0]

    slope = (truth(0.3 + 1e-5) - truth(0.3 - 1e-5)) / 2e-5
    np.testing.assert_allclose(jax.jacfwd(swung)(0.3), slope, rtol=1e-5)


def test_what_jumps_cannot_be():
    with pytest.raises(ValueError, match=r"`jump_ts` must be a vector of finite times"):
        on_a_spring(lambda t, p: p[0] * t, jnp.ones(1), 0.1, jump_ts=[[0.1, np.nan]])
    without, none = (on_a_spring(lambda t, p: p[0] * t, jnp.ones(1), 0.1, jump_ts=each) for each in (None, []))
    assert none == without


def rubbed(p, **options):
    """Place and velocity of 10 kg on a rough guide, pushed by p_1 sin of time until p_2."""
    push = along_x(lambda i, t, p: p[0] * jnp.sin(jnp.pi * jnp.clip(t - 0.1, 0.0, p[1] - 0.1)))
    guide = rx.Translational("guide", "b", "ground", *GUIDE, friction=rx.Coulomb(p[0]), guide_length=1.0)
    load = rx.LoadFunction("b", push, parameters=p[1:])
    mechanism = rx.Mechanism([rx.Body("b", 10.0, 0.1)], [guide], loads=[load], gravity=(0.0, -9.81))
    start = rx.assemble(mechanism, {})
    motion = rx.simulate(mechanism, start, 2.5, ts=[1.15, 2.3], max_phases=8, throw=False, **FORWARD, **options)
    return jnp.append(motion.q[:, 0], motion.qd[0, 0])


def slid(mu, push, kink):
    """The same: it is let go at mu m g, and stops where its momentum is spent."""
    late, holds, pi = mpmath.mpf("0.1"), mu * mpmath.mpf("98.1"), mpmath.pi
    goes = late + mpmath.asin(holds / push) / pi

    def speed(t):
        past = mpmath.cos(pi * (goes - late)) - mpmath.cos(pi * (min(t, kink) - late))
        level = push * mpmath.sin(pi * (kink - late))
        return (push / pi * past + max(t - kink, 0) * level - holds * (t - goes)) / 10

    stops = mpmath.findroot(speed, 1.6)
    after = mpmath.mpf("1.15")
    return [mpmath.quad(speed, [goes, kink, end]) for end in (after, stops)] + [speed(after)]


@pytest.mark.slow
@pytest.mark.parametrize("jumps", [False, True])
def test_derivatives_after_an_event_pass_a_kink_of_the_load(jumps):
    """By figures that move the event, as accurate as the motion; by the kink itself where its instant is given."""
    given, told = (0.4, 60.0, 1.05), 3 if jumps else 2
    want = np.array([[slope_of(lambda *x, e=entry: slid(*x)[e], given, k) for k in range(told)] for entry in range(3)])
    found = jax.jacfwd(lambda p: rubbed(p, jump_ts=p[2:] if jumps else None))(jnp.array(given))
    within = np.array([1e-7, 1e-7, 1e-8])[:told] * np.abs(want).max(axis=0)
    assert np.all(np.abs(found[:, :told] - want) < within)
