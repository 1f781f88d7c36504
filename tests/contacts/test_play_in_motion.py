"""Play in motions: a sledge on three supports that rub, against trial of all sides and SciPy."""

import itertools
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from sliding import check_slide

import redundax as rx

PLACES, MASS, HIGH, MU = (-0.5, 0.1, 0.6), 2.0, 0.2, 0.3
SOFT, MISFIT, PLAY = (1e-6, 2e-6, 1.5e-6), (3e-5, -2e-5, 1e-5), (4e-5, 2e-5, 6e-5)
ALONG = 1.0


def pushed(t):
    """Force across and moment."""
    return -30.0 * np.cos(6.0 * t), 8.0 * np.sin(9.0 * t)


def sledge(mu):
    """It slides along x on supports that hold it both ways, below its centre, under a force and a moment of time."""
    feet = [
        rx.PinInSlot(f"s{k}", "sledge", "ground", (x, -HIGH), (x, -HIGH), (0.0, 1.0), mu and rx.Coulomb(mu))
        for k, x in enumerate(PLACES)
    ]

    def wrench(i, j, t, p):
        force = jnp.stack([ALONG + 0.0 * t, -30.0 * jnp.cos(6.0 * t)])
        return rx.Wrench(force, 8.0 * jnp.sin(9.0 * t)), rx.Wrench(0.0 * force, 0.0 * t)

    return rx.Mechanism([rx.Body("sledge", MASS, 0.3)], feet, loads=[rx.LoadFunction("sledge", wrench)])


def closure(mechanism, play=PLAY):
    figures = enumerate(zip(SOFT, MISFIT, strict=True))
    soft = [rx.JointCompliance(f"s{k}", w, misfit=(0.0, d, 0.0)) for k, (w, d) in figures]
    return rx.ElasticJoints(mechanism, soft, play={f"s{k}": c for k, c in enumerate(play)})


def start(speed=2.0):
    return rx.State(jnp.zeros(3), jnp.array([speed, 0.0, 0.0]))


def enumerated(t, mu, play=PLAY):
    """Loads at the one set of sides that fits: w N + d - h - x phi = -c n where one carries, within c elsewhere."""
    (across, moment), x, found = pushed(t), np.array(PLACES), []
    soft, misfit, play = map(np.array, (SOFT, MISFIT, play))
    for side in itertools.product((-1.0, 0.0, 1.0), repeat=3):
        n = np.array(side)
        matrix, right = np.zeros((5, 5)), np.zeros(5)
        matrix[:3, :3] = np.diag(np.where(n != 0, soft, 1.0))
        matrix[:3, 3] = -1.0 * (n != 0)
        matrix[:3, 4] = -x * (n != 0)
        right[:3] = np.where(n != 0, -misfit - play * n, 0.0)
        matrix[3, :3], right[3] = 1.0, -across
        matrix[4, :3], right[4] = x - HIGH * mu * n, -moment  # friction -mu |N| below the centre turns it
        if np.linalg.cond(matrix / np.abs(matrix).max(axis=1)[:, None]) > 1e12:
            continue
        loads, (height, turn) = np.split(np.linalg.solve(matrix, right), [3])
        gap = height + x * turn - misfit
        if np.all(np.where(n != 0, loads * n > 0, np.abs(gap) <= play)):
            found.append(loads)
    (loads,) = found
    return loads


def test_small_loads_cross_wide_clearances():
    """Where a load changes its sign its joint goes from one side to the other, however small the load is."""
    mechanism = sledge(MU)
    joints = closure(mechanism)
    turns: Any = brentq(lambda t: enumerated(t, MU)[0], 0.2940, 0.2941, xtol=1e-15)
    for apart in (-1e-6, 1e-5, 1e-7, 1e-9):
        t = turns + apart
        solution = rx.solve(mechanism, rx.State(start().q, start().qd, t), closure=joints)
        np.testing.assert_allclose(solution.multipliers, enumerated(t, MU), rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_sledge_with_play_slides_to_a_stop():
    """Its friction reads the loads that play leaves, which change sides several times on the way."""
    mechanism = sledge(MU)
    motion = rx.simulate(mechanism, start(), 1.0, closure=closure(mechanism), ts=np.linspace(0, 1, 21), rtol=1e-10)
    slides = check_slide(motion, lambda t: (ALONG - MU * np.sum(np.abs(enumerated(t, MU)))) / MASS)
    for k in np.flatnonzero(slides):
        np.testing.assert_allclose(motion.multipliers[k], enumerated(float(motion.t[k]), MU), rtol=1e-9, atol=1e-9)
    sides = {tuple(np.sign(loads)) for loads in np.asarray(motion.multipliers[slides])}
    assert len(sides) > 3 and any(0.0 in side for side in sides)


@pytest.mark.slow
def test_derivatives_by_play_pass_changes_of_sides():
    """Of the speed: those of friction, which are the same until a support comes to a side or leaves it."""
    mechanism, end, few = sledge(MU), 0.45, 1e-6

    def speed(part):
        joints = closure(mechanism, [part * c for c in PLAY])
        run = rx.simulate(mechanism, start(), end, closure=joints, ts=[end], adjoint=diffrax.ForwardMode())
        return run.qd[0, 0]

    def sides(t):
        return tuple(np.sign(enumerated(t, MU)))

    def slope(t):
        one, other = (np.abs(enumerated(t, MU, [x * c for c in PLAY])).sum() for x in (1 + few, 1 - few))
        return -MU * (one - other) / (2 * few) / MASS

    at = [0.0]
    for begin, stop in itertools.pairwise(np.linspace(0.0, end, 301)):
        if sides(begin) != sides(stop):
            at.append(brentq(lambda t, b=begin: 0.5 - (sides(t) != sides(b)), begin, stop, xtol=1e-14))
    at.append(end)
    assert len(at) == 6
    expected = sum(slope((a + b) / 2) * (b - a) for a, b in itertools.pairwise(at))
    found = jax.jvp(speed, (1.0,), (1.0,))[1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-8)


@pytest.mark.slow
def test_loads_of_motions_with_play_in_batches_and_their_derivatives():
    mechanism, ts = sledge(None), np.linspace(0.0, 0.5, 6)

    def loads(part):
        joints = closure(mechanism, [part * c for c in PLAY])
        forward = diffrax.ForwardMode()
        return rx.simulate(mechanism, start(), 0.5, closure=joints, ts=ts, throw=False, adjoint=forward).multipliers

    value, slope = jax.jit(lambda part: jax.jvp(loads, (part,), (jnp.ones(()),)))(jnp.ones(()))
    np.testing.assert_allclose(value, [enumerated(t, 0.0) for t in ts], rtol=1e-9, atol=1e-10)
    states = [rx.State(start().q + jnp.array([2 * t + t**2 / 4, 0, 0]), start().qd, t) for t in ts]
    for side in (-1, 1):  # linear between changes of sides
        joints = closure(mechanism, [(1 + side * 1e-4) * c for c in PLAY])
        beside = [rx.solve(mechanism, state, closure=joints).multipliers for state in states]
        np.testing.assert_allclose(slope, (np.array(beside) - value) / (side * 1e-4), rtol=1e-6, atol=1e-7)


def sledge_in_space(grows):
    """The same on points on a plane, which could rub either way, between walls; its pull grows after 0.3 s."""
    body = rx.spatial.Body("sledge", MASS, inertia=(0.2, 0.3, 0.4), centre=(0.0, 0.0, HIGH))
    feet = [
        rx.spatial.PointOnPlane(f"s{k}", body, "ground", (x, 0.0, 0.0), (0, 0, 1), friction=rx.Coulomb(MU))
        for k, x in enumerate(PLACES)
    ]
    places = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0), "c": (0.0, 0.0, 1.0)}
    walls = [rx.spatial.PointOnPlane(name, body, "ground", at, (0, 1, 0)) for name, at in places.items()]

    def wrench(i, j, t, p):
        along = ALONG + grows * jnp.maximum(t - 0.3, 0.0) ** 2
        force = jnp.stack([along, 0.0 * t, -30.0 * jnp.cos(6.0 * t)])
        moment = jnp.stack([0.0 * t, HIGH * along - 8.0 * jnp.sin(9.0 * t), 0.0 * t])
        return rx.spatial.Wrench(force, moment), rx.spatial.Wrench(0.0 * force, 0.0 * moment)

    mechanism = rx.Mechanism([body], [*feet, *walls], loads=[rx.spatial.LoadFunction("sledge", wrench)])
    figures = enumerate(zip(SOFT, MISFIT, strict=True))
    soft = [rx.spatial.JointCompliance(f"s{k}", w, misfit=(0, 0, d, 0, 0, 0)) for k, (w, d) in figures]
    soft += [rx.spatial.JointCompliance(name, 1e-6) for name in places]
    return mechanism, rx.ElasticJoints(mechanism, soft, play={f"s{k}": c for k, c in enumerate(PLAY)})


@pytest.mark.slow
def test_a_sledge_with_play_in_space_slides_to_a_stop():
    mechanism, joints = sledge_in_space(0.0)
    begin = rx.assemble(mechanism, rates={"sledge.x": 2.0})
    motion = rx.simulate(mechanism, begin, 1.0, closure=joints, ts=np.linspace(0, 1, 21), rtol=1e-10)
    slides = check_slide(motion, lambda t: (ALONG - MU * np.sum(np.abs(enumerated(t, MU)))) / MASS)
    for k in np.flatnonzero(slides):
        np.testing.assert_allclose(-motion.multipliers[k, :3], enumerated(float(motion.t[k]), MU), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_sledge_with_play_in_space_is_let_go_by_a_pull_that_grows():
    """It rests until the pull is mu times all loads."""

    def acceleration(t):
        return (ALONG + 60.0 * max(t - 0.3, 0.0) ** 2 - MU * np.sum(np.abs(enumerated(t, MU)))) / MASS

    mechanism, joints = sledge_in_space(60.0)
    ts = np.linspace(0, 1, 21)
    motion = rx.simulate(mechanism, rx.assemble(mechanism), 1.0, closure=joints, ts=ts, rtol=1e-10)
    assert max(acceleration(t) for t in np.linspace(0.0, 0.6, 601)) < 0 < acceleration(0.65)
    goes: Any = brentq(acceleration, 0.6, 0.65, xtol=1e-15)
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 1e-3, "dense_output": True}
    run = solve_ivp(lambda t, _: [acceleration(t)], (goes, 1.0), [0.0], **exact)
    speeds = [run.sol(max(t, goes))[0] for t in ts]
    np.testing.assert_allclose(motion.qd[:, 0], speeds, rtol=0, atol=2e-9)
