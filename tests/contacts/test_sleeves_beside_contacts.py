"""Two parallel sleeves, one redundant, beside contacts: closed forms of one sliding mass, and quadrature.

Equal sleeves share a side force and a moment half by half, and rub with mu max(|F|, 2 |T| / L) of the whole of both.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import redundax as rx

G, MASS, MU, LENGTH, WEIGHT = 9.81, 10.0, 0.1, 0.08, 98.1
PLACES = {"L": -0.3, "R": 0.3}  # m, of both sleeves


def pulse(t):
    return 200.0 * jnp.sin(jnp.pi * jnp.clip(t / 0.5, 0.0, 1.0)) ** 2


def flat(i, j, t, p):
    return rx.Wrench(jnp.stack([0.0 * t, pulse(t)]), 0.0 * t), rx.Wrench(jnp.zeros(2), 0.0 * t)


def in_space(i, j, t, p):
    none = jnp.zeros(3)
    return rx.spatial.Wrench(jnp.stack([0.0 * t, 0.0 * t, pulse(t)]), none), rx.spatial.Wrench(none, none)


def ram(push, others=(), loads=()):
    """A ram on two vertical sleeves that rub, pushed to the side, above a foot beside its middle; and its closure."""
    rubs = {"normal": (1.0, 0.0), "guide_length": LENGTH, "friction": rx.Coulomb(MU)}
    sleeves = [rx.Translational(name, "ram", "ground", (x, 0.0), (x, 0.0), **rubs) for name, x in PLACES.items()]
    foot = rx.PinInSlot("foot", "ram", "ground", (0.1, -0.2), (0.0, -0.2), (0.0, 1.0), one_sided=True)
    loads = [rx.AppliedForce("ram", (push, 0.0)), *loads]
    bodies = [rx.Body("ram", MASS, 0.3)]
    machine = rx.Mechanism(bodies, [*sleeves, foot, *others], loads=loads, gravity=(0.0, -G))
    soft = {"L": (1e-8, 1e-6), "R": (1e-8, 1e-6), "foot": 1e-7} | {joint.name: 1e-7 for joint in others}
    return machine, rx.ElasticJoints(machine, soft)


def ram_in_space(push):
    body = rx.spatial.Body("ram", MASS, inertia=(0.3, 0.3, 0.3))
    rubs = {"guide_length": LENGTH, "twist_radius": 0.03, "friction": rx.Coulomb(MU)}
    sleeves = [rx.spatial.Prismatic(n, body, "ground", (x, 0, 0), (0, 0, 1), **rubs) for n, x in PLACES.items()]
    foot = rx.spatial.PointOnPlane("foot", body, "ground", (0.1, 0.0, -0.2), (0, 0, 1), one_sided=True)
    loads = [rx.spatial.AppliedForce(body, (push, 0.0, 0.0)), rx.spatial.LoadFunction("ram", in_space)]
    machine = rx.Mechanism([body], [*sleeves, foot], loads=loads, gravity=(0.0, 0.0, -G))
    return machine, rx.ElasticJoints(machine, {"L": (1e-8, 1e-6), "R": (1e-8, 1e-6), "foot": 1e-7})


@pytest.mark.slow
def test_a_driver_lifts_a_ram_off_its_foot_and_puts_it_down():
    """Cycloids: the foot opens and closes as they begin and end, and the driver bears m (g + y'') and the friction."""
    law, push = rx.Cycloidal(0.3, move=0.4, begin=0.1, dwell=0.1), 50.0
    drive = rx.DistanceDriver("lift", "ram", "ground", (0.0, 0.0), (0.0, 2.0), 2.0 - law)
    machine, closure = ram(push, others=[drive])
    motion = rx.simulate(machine, rx.assemble(machine, {}), 1.2, closure=closure)
    times, one = np.asarray(motion.t), jnp.ones(())
    heights, second = (
        np.array([float(of(jnp.asarray(t))) for t in times])
        for of in (law, lambda t: jax.jvp(lambda t: jax.jvp(law, (t,), (one,))[1], (t,), (one,))[1])
    )
    np.testing.assert_allclose(motion["ram.y"], heights, rtol=0, atol=1e-12)
    assert motion.impacts.t.size == 0
    lies = (times < 0.1) | (times > 1.0 + 1e-9)
    flies = (times > 0.104) & (times < 0.996)
    assert set(motion.contacts["foot"][lies]) == {"carries"} and set(motion.contacts["foot"][flies]) == {"open"}
    speeds = np.asarray(motion["ram.y'"])
    moves = flies & (np.abs(speeds) > 1e-6)
    bears = MASS * (G + second) + MU * push * np.sign(speeds)
    np.testing.assert_allclose(motion["lift.distance"][moves], bears[moves], rtol=1e-10)
    both = np.asarray(motion["lift.distance"] + motion["foot.perpendicular"])
    np.testing.assert_allclose(both[times < 0.09], WEIGHT, rtol=1e-12)


def thrown_up(rub, restitution, times):
    """A mass that 100 (1 - cos 4 pi t) N until 0.5 s throws off its foot against friction: when it begins, its heights,
    and times and speeds of two landings."""
    begins, w = brentq(lambda t: 100 * (1 - np.cos(4 * np.pi * t)) - WEIGHT - rub, 0.05, 0.25, xtol=1e-15), 4 * np.pi
    up, down = G + rub / MASS, G - rub / MASS

    def pushed(t):
        since, wave = t - begins, np.cos(w * t) - np.cos(w * begins) + w * np.sin(w * begins) * (t - begins)
        return (100 * wave / w**2 + (100 - WEIGHT - rub) * since**2 / 2) / MASS

    rate = (-100 / w * (np.sin(w * 0.5) - np.sin(w * begins)) + (100 - WEIGHT - rub) * (0.5 - begins)) / MASS
    heights = np.where((times > begins) & (times <= 0.5), pushed(times), 0.0)
    at, height, landings = 0.5, pushed(0.5), []
    for _ in range(2):
        top, peak = at + rate / up, height + rate**2 / (2 * up)
        speed = np.sqrt(2 * down * peak)
        lands = top + speed / down
        rises, falls = (times > at) & (times <= top), (times > top) & (times <= lands)
        heights = np.where(rises, height + rate * (times - at) - up * (times - at) ** 2 / 2, heights)
        heights = np.where(falls, peak - down * (times - top) ** 2 / 2, heights)
        landings.append((lands, speed))
        at, height, rate = lands, 0.0, restitution * speed
    return begins, heights, np.array(landings).T


@pytest.mark.slow
@pytest.mark.parametrize("make", [ram, ram_in_space])
def test_a_load_throws_a_ram_off_its_foot_and_sleeves_rub_in_the_impact(make):
    """Sleeves hold it until the load is beyond weight and friction, though the foot opens at the weight. The foot's
    impulse P bends both sleeves, which rub with mu 2 (0.1 P) / L against it: P (1 - 0.25) = m v (1 + e)."""
    push, restitution, end = 200.0, 0.5, 0.95
    machine, closure = make(push) if make is ram_in_space else make(push, loads=[rx.LoadFunction("ram", flat)])
    start = rx.assemble(machine) if make is ram_in_space else rx.assemble(machine, {})
    motion = rx.simulate(machine, start, end, closure=closure, restitution=restitution, rtol=1e-10)
    times = np.asarray(motion.t)
    begins, heights, (lands, speeds) = thrown_up(MU * push, restitution, times)
    found = np.asarray(motion["ram.z" if make is ram_in_space else "ram.y"])
    told = times < lands[-1]
    np.testing.assert_allclose(found[told], heights[told], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found[times < begins], 0.0, atol=1e-15)
    np.testing.assert_allclose(motion.impacts.t, lands, rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.impacts.energy, MASS / 2 * speeds**2 * (1 - restitution**2), rtol=1e-7)
    share = 1 - MU * 2 * 0.1 / LENGTH
    np.testing.assert_allclose(motion.impacts.impulses[:, 0], MASS * speeds * (1 + restitution) / share, rtol=1e-7)
    opens = brentq(lambda t: float(pulse(t)) - WEIGHT, 0.05, 0.25)
    assert set(motion.contacts["foot"][times < opens - 1e-9]) == {"carries"}
    assert set(motion.contacts["foot"][times > opens + 1e-9]) == {"open"}


SOFT, TURNS, FOOT, AT = 1e-8, 1e-6, 2e-8, 0.5  # m/N, rad/(N m), m/N; place of a foot


def bending(t):
    return 60.0 * jnp.sin(6.0 * t)


def pulled(i, j, t, p):
    return rx.Wrench(jnp.stack([p + 0.0 * t, 0.0 * t]), bending(t)), rx.Wrench(jnp.zeros(2), 0.0 * t)


def sled_loads(t):
    """Sleeves' forces and moments and the foot's load, of least energy, which pushes; the foot rubs 0.2 m below."""
    foot = 0.0
    for _ in range(100):
        for closed in (1, 0):
            rows = np.array([[1.0, 1.0, 0.0, 0.0, 1.0], [-0.3, 0.3, 1.0, 1.0, AT]])[:, : 4 + closed]
            soft = np.diag([SOFT, SOFT, TURNS, TURNS, FOOT])[: 4 + closed, : 4 + closed]
            right = [WEIGHT, -float(bending(t)) + 0.2 * 0.3 * foot]
            both = np.block([[soft, rows.T], [rows, np.zeros((2, 2))]])
            loads = np.linalg.solve(both, [*np.zeros(4 + closed), *right])[: 4 + closed]
            if not closed or loads[4] > 0:
                break
        last, foot = foot, loads[4] if closed else 0.0
        if abs(foot - last) < 1e-13 * WEIGHT:
            break
    presses = [max(abs(loads[k]), 2 * abs(loads[2 + k]) / LENGTH) for k in range(2)]
    kinks = (foot > 0, *np.sign(loads[:4]), *(abs(loads[k]) > 2 * abs(loads[2 + k]) / LENGTH for k in range(2)))
    return foot, MU * sum(presses) + 0.3 * foot, kinks


@pytest.mark.slow
def test_a_foot_that_only_the_closure_loads_comes_and_goes_as_a_sled_runs():
    """Both sleeves hold the sled; a moment of time loads the foot beside them and lets it go, and both rub."""
    rubs = {"normal": (0.0, 1.0), "guide_length": LENGTH, "friction": rx.Coulomb(MU)}
    sleeves = [rx.Translational(n, "sled", "ground", (x, 0.0), (0.0, 0.0), **rubs) for n, x in PLACES.items()]
    rough = {"friction": rx.Coulomb(0.3), "one_sided": True}
    foot = rx.PinInSlot("foot", "sled", "ground", (AT, -0.2), (0.0, -0.2), (0.0, 1.0), **rough)
    loads = [rx.LoadFunction("sled", pulled, parameters=30.0)]
    sled = rx.Mechanism([rx.Body("sled", MASS, 0.3)], [*sleeves, foot], loads=loads, gravity=(0.0, -G))
    closure = rx.ElasticJoints(sled, {"L": (SOFT, TURNS), "R": (SOFT, TURNS), "foot": FOOT})
    motion = rx.simulate(sled, rx.assemble(sled, {}, rates={"sled.x": 0.5}), 2.0, closure=closure, rtol=1e-11)
    times = np.asarray(motion.t)
    truth = np.array([sled_loads(t)[0] for t in times])
    np.testing.assert_allclose(motion["foot.perpendicular"], truth, rtol=0, atol=1e-9)
    assert set(motion.contacts["foot"][truth > 1e-6]) == {"carries"}
    assert set(motion.contacts["foot"][truth == 0]) == {"touches"} and np.sum(truth == 0) > 30
    cuts = set(np.linspace(0.0, 2.0, 41))
    for low, high in itertools.pairwise(np.linspace(0.0, 2.0, 401)):
        first = sled_loads(low)[2]
        if first != sled_loads(high)[2]:
            for _ in range(45):
                middle = (low + high) / 2
                low, high = (middle, high) if sled_loads(middle)[2] == first else (low, middle)
            cuts.add(high)
    x, v, (nodes, weights) = 0.0, 0.5, np.polynomial.legendre.leggauss(8)
    for low, high in itertools.pairwise(sorted(cuts)):
        half = (high - low) / 2
        at = low + half * (nodes + 1)
        change = half * weights * np.array([(30.0 - sled_loads(t)[1]) / MASS for t in at])
        x, v = x + 2 * half * v + (high - at) @ change, v + change.sum()
    np.testing.assert_allclose([motion["sled.x"][-1], motion["sled.x'"][-1]], [x, v], rtol=0, atol=1e-9)
