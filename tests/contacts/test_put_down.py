"""Parts that a driver puts down on a contact, or takes off it, however softly: loads are those of `solve` from then on.

A weight of 3 kg on a driver along the vertical, above a foot: once it lies, driver and foot share all loads half by
half, as equally compliant. A force presses on it by 30 (t - 0.6) N.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

WEIGHT = 3 * 9.81


def cycloid(s):
    s = jnp.clip(s, 0.0, 1.0)
    return s - jnp.sin(2 * jnp.pi * s) / (2 * jnp.pi)


def power(k):
    return lambda t: 0.05 * jnp.maximum(1 - t / 0.5, 0.0) ** k


def soft(k, size=1.0):
    return lambda t: size * jnp.maximum(t - 0.1, 0.0) ** k


def lowered(law):
    return rx.System(
        lambda q, t, p: jnp.stack([q[0] - law(t), -q[0]]),
        mass=jnp.array([3.0]),
        load=lambda q, qd, t, p: jnp.stack([-WEIGHT - 30 * jnp.maximum(t - 0.6, 0.0)]),
        coordinates=["linear"],
        rows="force",
        m=2,
        length=1.0,
        one_sided=[1],
    )


def presses(motion):
    return WEIGHT + 30 * np.maximum(np.asarray(motion.t) - 0.6, 0.0)


@pytest.mark.parametrize(
    "law",
    [
        lambda t: 0.05 * (1 - cycloid((t - 0.1) / 0.4)),
        pytest.param(power(2), marks=pytest.mark.slow),  # whose acceleration jumps
        pytest.param(power(3), marks=pytest.mark.slow),
        pytest.param(power(5), marks=pytest.mark.slow),
    ],
)
def test_a_weight_that_a_driver_puts_down_without_speed_lies_on_the_foot(law):
    system = lowered(law)
    start = rx.assemble(system, jnp.array([0.05]))
    motion = rx.simulate(system, start, 1.0)
    lies, loads = np.asarray(motion.t) > 0.505, presses(motion)
    assert set(motion.contacts["1"][lies]) == {"carries"} and set(motion.contacts["1"][~lies][:-1]) == {"open"}
    np.testing.assert_allclose(motion.multipliers[lies], np.outer(loads[lies], [-0.5, 0.5]), rtol=1e-9)
    np.testing.assert_allclose(motion.q[:, 0], law(motion.t), rtol=0, atol=1e-10)
    assert motion.impacts.t.size == 0 and motion.stats.phases == 2
    there = rx.solve(system, rx.State(motion.q[-1], motion.qd[-1], motion.t[-1]))
    assert there.contacts == {"1": "carries"}
    np.testing.assert_allclose(motion.multipliers[-1], there.multipliers, rtol=1e-12)


@pytest.mark.parametrize(
    "law",
    [
        soft(4),
        pytest.param(soft(6), marks=pytest.mark.slow),
        pytest.param(soft(4, 1e-4), marks=pytest.mark.slow),
        pytest.param(lambda t: 0.05 * cycloid((t - 0.1) / 5.0), marks=pytest.mark.slow),
        pytest.param(soft(6, 0.01), marks=pytest.mark.slow),
    ],
)
def test_a_driver_that_sets_off_softly_takes_the_weight_off_its_foot(law):
    """And bears m (g + s'') alone, from where s'' is 2e-8 of g on."""
    system = lowered(law)
    motion = rx.simulate(system, rx.State(jnp.zeros(1), jnp.zeros(1)), 1.0)
    times = np.asarray(motion.t)
    words = motion.contacts["1"]
    assert set(words[times < 0.1]) == {"carries"} and set(words[times > 0.14]) == {"open"}
    np.testing.assert_allclose(motion.q[:, 0], law(times), rtol=0, atol=1e-10)
    flies, bend = times > 0.14, 1e-4
    second = (law(times + bend) - 2 * law(times) + law(times - bend)) / bend**2
    bears = presses(motion) + 3 * second
    np.testing.assert_allclose(-motion.multipliers[flies, 0], bears[flies], rtol=1e-6)
    np.testing.assert_array_equal(motion.multipliers[flies, 1], 0.0)


@pytest.mark.parametrize(
    ("feet", "law"),
    [
        (1, rx.Cycloidal(0.5, move=2.0)),
        pytest.param(1, rx.Cycloidal(0.5, move=10.0), marks=pytest.mark.slow),
        pytest.param(2, rx.Cycloidal(0.5, move=2.0), marks=pytest.mark.slow),
        pytest.param(2, rx.Cycloidal(0.5, move=10.0), marks=pytest.mark.slow),
        pytest.param(2, rx.Cycloidal(0.5, move=0.2), marks=pytest.mark.slow),
        pytest.param(2, lambda t: 0.5 * (t / 4.0) ** 6, marks=pytest.mark.slow),
        pytest.param(2, rx.Trapezoid(0.5, speed=0.5, acceleration=1.0), marks=pytest.mark.slow),
    ],
)
def test_a_lift_on_parallel_arms_sets_off_from_its_feet(feet, law):
    """Its torque is (M l^2 + 2 (J + m l^2 / 4)) th'' + g l (M + m) cos th, from where feet have opened."""
    length, angle, heavy, light, inertia = 0.5, np.deg2rad(20), 40.0, 4.0, 0.083
    x, y = length * np.cos(angle), length * np.sin(angle)
    arms = [rx.Body(name, light, inertia) for name in ("left", "right")]
    joints = [rx.Revolute(f"{n}0", n, "ground", (-0.25, 0.0), (at, 0.0)) for n, at in (("left", 0.0), ("right", 0.8))]
    joints += [rx.Revolute(f"{n}1", n, "table", (0.25, 0.0), (at, 0.0)) for n, at in (("left", -0.4), ("right", 0.4))]
    stands = [
        rx.PinInSlot(f"foot{at}", "table", "ground", (at, -0.2), (0.0, y - 0.2), (0.0, 1.0), one_sided=True)
        for at in (-0.3, 0.5)[:feet]
    ]
    motor = rx.AngleDriver("motor", "left", "ground", lambda t: angle + law(t))
    mechanism = rx.Mechanism([*arms, rx.Body("table", heavy, 4.0)], [*joints, *stands, motor], gravity=(0.0, -9.81))
    guess = {"left.phi": angle, "right.phi": angle, "table.x": x + 0.4, "table.y": y}
    motion = rx.simulate(mechanism, rx.assemble(mechanism, guess), 1.0, ts=jnp.linspace(0.0, 1.0, 11))
    turned, along = np.asarray([law(t) for t in motion.t]), jnp.ones(())
    second = np.asarray([jax.jvp(lambda t: jax.jvp(law, (t,), (along,))[1], (t,), (along,))[1] for t in motion.t])
    carried = (heavy * length**2 + 2 * (inertia + light * length**2 / 4)) * second
    carried += 9.81 * length * (heavy + light) * np.cos(angle + turned)
    for words in motion.contacts.values():
        assert set(words[2:]) == {"open"}  # by t^6 the feet are 6e-11 m apart at 0.1 s
    np.testing.assert_allclose(-motion.multipliers[2:, -1], carried[2:], rtol=1e-7)
    np.testing.assert_allclose(motion.q[:, 6], angle + turned, rtol=0, atol=1e-8)
    assert motion.impacts.t.size == 0


def test_a_driver_that_touches_the_foot_and_rises_again_leaves_it_open():
    system = lowered(lambda t: 0.05 * (1 - t / 0.5) ** 2)
    motion = rx.simulate(system, rx.State(jnp.array([0.05]), jnp.array([-0.2])), 1.0)
    assert set(motion.contacts["1"]) == {"open"} and motion.stats.phases == 1
    np.testing.assert_allclose(-motion.multipliers[:, 0], presses(motion) + 3 * 0.4, rtol=1e-9)


@pytest.mark.slow
def test_rough_feet_that_guides_leave_no_slip_have_no_friction_of_rounding():
    """A block on two feet, level and held sideways: each bears half of all."""
    block = rx.Body("block", 3.0, 0.1)
    rough = {"friction": rx.Coulomb(0.5), "one_sided": True}
    feet = [rx.PinInSlot(f"f{x}", "block", "ground", (x, 0.0), (0.0, 0.0), (0.0, 1.0), **rough) for x in (-0.3, 0.3)]
    held = [
        rx.PinInSlot("guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0)),
        rx.AngleDriver("level", "block", "ground", 0.0),
    ]

    def press(i, j, t, p):
        return i.wrench(jnp.stack([0.0 * t, -30 * jnp.maximum(t - 0.6, 0.0)]), i.pose.r), j.wrench(*[jnp.zeros(2)] * 2)

    loads = [rx.LoadFunction("block", press)]
    mechanism = rx.Mechanism([block], [*feet, *held], loads=loads, gravity=(0.0, -9.81))
    motion = rx.simulate(mechanism, rx.assemble(mechanism, {}), 1.0)
    np.testing.assert_allclose(motion.multipliers[:, :2], np.outer(presses(motion), [0.5, 0.5]), rtol=1e-9)
    np.testing.assert_allclose(motion.friction, 0.0, atol=1e-9)
