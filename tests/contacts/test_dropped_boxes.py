"""Boxes that are thrown on rough feet, rattle and come to rest: whatever contacts do, the laws hold at all times.

They rattle by impacts whose intervals shrink to nothing: contacts close together with gaps that differ by rounding, and
the friction of feet of one height does all but the same.
"""

import numpy as np
import pytest

import redundax as rx

TIMES = np.linspace(0.0, 1.5, 301)
slow = pytest.mark.slow
WORSE = {2: [0, 1, 9], 3: [8, 15, 38], 4: [1, 5, 18, 34, 44, 56]}


def thrown(seed, count):
    """Feet and their coefficients of friction, and the motion."""
    random = np.random.default_rng(seed)
    feet = np.stack([np.sort(random.uniform(-1, 1, count)), np.full(count, -0.3)], axis=1)
    if seed % 2:
        feet[:, 1] = random.uniform(-0.4, -0.3, count)
    mu = random.uniform(0.05, 0.8, count)
    ahead = {"point_j": (0.0, 0.0), "normal": (0.0, 1.0), "one_sided": True}
    joints = [
        rx.PinInSlot(f"f{k}", "box", "ground", foot, friction=rx.Coulomb(mu[k]), **ahead) for k, foot in enumerate(feet)
    ]
    body = rx.Body("box", random.uniform(1, 5), random.uniform(0.2, 2))
    box = rx.Mechanism([body], joints, gravity=(0.0, -9.81))
    place = np.array([0.0, random.uniform(0.9, 1.5), random.uniform(-0.3, 0.3)])
    start = rx.State(place, np.array([random.uniform(-3, 3), *random.uniform(-1, 1, 2)]))
    run = rx.simulate(box, start, 1.5, ts=TIMES, restitution=random.choice([0.0, 0.3, 0.7]), max_phases=200)
    return feet, mu, run


@slow
@pytest.mark.parametrize(("seed", "count"), [(seed, count) for count, seeds in WORSE.items() for seed in seeds])
def test_laws_hold_whatever_contacts_do(seed, count):
    feet, mu, run = thrown(seed, count)
    (_, y, angle), (u, v, spin) = np.asarray(run.q).T, np.asarray(run.qd).T
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    across, up = c * feet[:, 0] - s * feet[:, 1], s * feet[:, 0] + c * feet[:, 1]
    slip, push, tau = u[:, None] - spin[:, None] * up, np.asarray(run.multipliers), np.asarray(run.friction)
    assert run.stats.energy_error < 1e-7
    assert np.all(y[:, None] + up > -1e-7)
    assert np.all(push > -1e-7)
    assert np.all(np.abs(tau) <= mu * push + 1e-6)
    slides = np.abs(slip) > 1e-5  # what sticks may keep a millionth of the speed before, which dies away
    np.testing.assert_allclose(np.where(slides, tau, 0.0), np.where(slides, -mu * push * np.sign(slip), 0.0), atol=1e-6)
    lifts = (y[:, None] + up > 1e-7) | (v[:, None] + spin[:, None] * across > 1e-6)
    assert np.all(np.where(lifts, push, 0.0) < 1e-7)


@pytest.mark.slow
def test_feet_that_stick_on_a_slope_have_no_more_friction_than_they_can():
    """The lower carries more; half of the pull each, as the least that holds would be, is more than the upper can."""
    slope, mu, mass = 0.3, 0.4, 2.0
    ahead = {"point_j": (0.0, 0.0), "normal": (0.0, 1.0), "friction": rx.Coulomb(mu), "one_sided": True}
    feet = [rx.PinInSlot(name, "box", "ground", (x, -0.5), **ahead) for name, x in (("lower", -0.3), ("upper", 0.3))]
    weight = mass * 9.81 * np.array([np.sin(slope), np.cos(slope)])
    box = rx.Mechanism([rx.Body("box", mass, 0.3)], feet, gravity=tuple(-weight / mass))
    run = rx.simulate(box, rx.State([0.0, 0.5, 0.0], np.zeros(3)), 0.5)
    push = weight[1] / 2 + weight[0] * 0.5 / 0.6 * np.array([1.0, -1.0])
    assert weight[0] / 2 > mu * push[1]
    np.testing.assert_allclose(run.multipliers[-1], push, rtol=1e-9)
    np.testing.assert_allclose(run.friction[-1], [weight[0] - mu * push[1], mu * push[1]], rtol=1e-9)
    np.testing.assert_allclose(run.q[-1], [0.0, 0.5, 0.0], atol=1e-12)
