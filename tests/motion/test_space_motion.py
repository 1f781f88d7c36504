"""Motions in space: closure, energy, a motion in closed form, and derivatives of motions."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import spaces
from scipy.integrate import solve_ivp
from truth import bricard, governor

import redundax as rx

CLOSURE, ENERGY = 1e-13, 1e-8
EVERY = 0.05  # s


def motion_of(mechanism, state, span):
    return rx.simulate(mechanism, state, span, ts=np.arange(0.0, span + EVERY / 2, EVERY))


def keeps_closure_and_energy(mechanism, motion):
    """Constraints and their rates, and kinetic and potential energy worked out from positions and velocities."""
    q, qd = np.asarray(motion.q), np.asarray(motion.qd)
    gaps = jax.vmap(lambda q: mechanism.constraint(q, jnp.zeros(())))(q)
    rates = jax.vmap(lambda q, qd: mechanism.jacobian(q, jnp.zeros(())) @ qd)(q, qd)
    kinetic, potential = spaces.energies(mechanism, q, qd)
    whole = kinetic + potential
    assert np.max(np.abs(gaps)) < CLOSURE
    assert np.max(np.abs(rates)) < CLOSURE * max(1.0, np.max(np.abs(qd)))
    assert motion.stats.energy_error <= ENERGY  # at all steps, of which the end is one
    assert np.abs(whole[-1] - whole[0]) <= ENERGY * np.max(kinetic)
    assert np.max(np.abs(whole - whole[0])) <= 50 * ENERGY * np.max(kinetic)  # between steps


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bricard", "four-bar", "bennett"])
def test_closure_and_energy(name, span=10.0):
    case = spaces.CASES[name]
    start = rx.assemble(case.mechanism) if name == "bricard" else case.state  # benchmark A04 starts at rest
    motion = motion_of(case.mechanism, start, span)
    assert motion.result == rx.RESULTS.successful
    keeps_closure_and_energy(case.mechanism, motion)


@pytest.mark.slow
def test_bricard_moves_as_by_its_one_freedom():
    """Benchmark A04: ends of all bars after 10 s."""
    mechanism = spaces.CASES["bricard"].mechanism
    motion = rx.simulate(mechanism, rx.assemble(mechanism), 10.0, ts=[10.0])
    pose = mechanism.poses(motion.q[-1])
    assert np.max(np.abs((pose.r + pose.axes[:, :, 0])[:5] - bricard.released(np.array([10.0]))[0])) < 1e-8


@pytest.mark.slow
def test_stiff_governor_moves_as_by_its_three_freedoms():
    """Benchmark A05; an explicit method of low order suits springs that only set the length of a step."""
    mechanism, times = spaces.CASES["governor"].mechanism, np.array([0.25, 0.5])
    start = rx.assemble(mechanism, rates={name: governor.SPIN * (name == "axis.angle") for name in GOVERNOR})
    motion = rx.simulate(mechanism, start, 0.5, ts=times, rtol=1e-7, solver=diffrax.Dopri5())
    a, s, _, _, spin = governor.released(times)
    found = (motion["pin 1.angle"], -motion["pin 2.angle"], motion["sleeve.travel"], motion["axis.angle'"])
    for value, truth in zip(found, (a - governor.ANGLE, a - governor.ANGLE, s - governor.L / 2, spin), strict=True):
        assert np.max(np.abs(value - truth)) < 1e-7
    assert motion.stats.energy_error < 1e-5 and motion.stats.position_violation < CLOSURE


@pytest.mark.slow
def test_a_falling_platform_stops_before_it_is_flat():
    """Where its bars lie flat the rank of the Sarrus linkage drops."""
    linkage = spaces.CASES["sarrus"].mechanism
    motion = rx.simulate(linkage, rx.assemble(linkage), 1.0, throw=False)
    end = int(np.sum(np.isfinite(motion["platform.z"]))) - 1
    assert motion.result == rx.RESULTS.step_too_small
    assert motion.stats.nearest_singularity < 1e-2 and motion["platform.z"][end] < 0.1
    assert "nearest singularity" in str(motion)
    with pytest.raises(rx.NoSolutionError, match=r"a singular position is next.* Here `nearest_singularity` is 0\.00"):
        rx.simulate(linkage, rx.assemble(linkage), 1.0)


GOVERNOR = ("axis.angle", "pin 1.angle", "pin 2.angle", "sleeve.travel")


@pytest.mark.slow
def test_leaning_door_swings_as_a_pendulum():
    door, start = rx.mechanisms.door(lean=0.3, width=0.9, thickness=0.05), 1.2
    motion = rx.simulate(door, rx.assemble(door, positions={"hinge 1.angle": start}), 2.0, ts=[1.0, 2.0], rtol=1e-10)
    square = 9.81 * np.sin(0.3) * 0.45 / (0.9**2 / 3 + 0.05**2 / 12)
    true = solve_ivp(
        lambda _, y: [y[1], -square * np.sin(y[0])], (0, 2), [start, 0], "DOP853", [1, 2], rtol=1e-12, atol=1e-13
    )
    assert np.max(np.abs(motion["hinge 1.angle"] - true.y[0])) < 1e-8


@pytest.mark.slow
def test_angles_of_joints_go_on_from_the_first():
    """A door that spins about an upright axis by more than a turn between outputs."""
    door, at, rate = rx.mechanisms.door(lean=0.0, width=0.9, thickness=0.05), 0.5, -9.0
    q = rx.assemble(door, positions={"hinge 1.angle": at}).q
    spin = rate * np.array([-q[1], q[0], 0.0, 0.0, 0.0, 1.0])
    motion = rx.simulate(door, rx.State(q, spin), 2.0, ts=[1.0, 2.0], rtol=1e-10)
    first = at + rate + 2 * np.pi
    assert np.max(np.abs(motion["hinge 1.angle"] - np.array([first, first + rate]))) < 1e-7


@pytest.mark.slow
def test_turns_are_counted_by_accelerations_too_in_any_unit_of_angles(angle=180 / np.pi):
    """A wheel driven by t^3, at times some turns apart; a right angle is 90 degrees."""
    wheel = rx.spatial.Body("wheel", 1.0, (0.1, 0.1, 0.1))
    ends = (wheel, rx.GROUND)
    hinge = rx.spatial.Revolute("h", *ends, point=(0, 0, 0), axis=(0, 0, 1))
    driver = rx.spatial.AngleDriver("d", *ends, (0, 0, 0), (0, 0, 1), angle=lambda t: t**3)
    mechanism, units = rx.Mechanism([wheel], [hinge, driver]), rx.units.Units(angle=angle)
    state = rx.units.state_in_units(rx.assemble(mechanism), mechanism, units)
    motion = rx.simulate(rx.units.in_units(mechanism, units), state, 4.0, ts=[0, 2, 4])
    np.testing.assert_allclose(motion["h.angle"], angle * np.array([0.0, 8.0, 64.0]), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_a_brake_makes_no_turns():
    """A rotor of 2 rad/s that friction stops within 2 ms, long before it is looked at again: v^2 / 2a."""
    rotor = rx.spatial.Body("rotor", 2.0, (0.01, 0.01, 0.01))
    brake = {"pin_radius": 0.05, "friction": rx.ConstantFriction(200.0)}  # N: 10 N m
    hinge = rx.spatial.Revolute(
        "h", rotor, rx.GROUND, (0, 0, 0), (0, 0, 1), bearing_length=0.1, thrust_radius=0.05, **brake
    )
    mechanism = rx.Mechanism([rotor], [hinge])
    motion = rx.simulate(mechanism, rx.assemble(mechanism, rates={"h.angle": 2.0}), 0.5, ts=[0.0, 0.5])
    np.testing.assert_allclose(motion["h.angle"], [0.0, 0.002], rtol=1e-8)


def test_a_spring_makes_no_turns():
    """A rotor that a spring swings by -cos(t), seen after three quarters of a period."""
    rotor = rx.spatial.Body("rotor", 2.0, (0.01, 0.01, 0.01))
    hinge = rx.spatial.Revolute("h", rotor, rx.GROUND, (0, 0, 0), (0, 0, 1))
    spring = rx.spatial.TorsionSpring(rotor, rx.GROUND, (0, 0, 1), stiffness=0.01)
    mechanism, ts = rx.Mechanism([rotor], [hinge], loads=[spring]), np.array([0.0, 1.5 * np.pi])
    motion = rx.simulate(mechanism, rx.assemble(mechanism, positions={"h.angle": -1.0}), 5.0, ts=ts, rtol=1e-10)
    np.testing.assert_allclose(motion["h.angle"], [-1.0, 0.0], atol=1e-7)


@pytest.mark.slow
def test_a_body_tumbles_as_euler_says():
    """A free body, on a bearing that holds nothing of its turning, with an inertia matrix."""
    inertia = np.array([[0.3, 0.02, -0.05], [0.02, 0.4, 0.04], [-0.05, 0.04, 0.5]])
    body = rx.spatial.Body("body", 2.0, inertia)
    mechanism = rx.Mechanism([body], [rx.spatial.Spherical("ball", body, rx.GROUND, point=(0, 0, 0))])
    spin = np.array([1.0, 2.0, -1.5])
    start = rx.State(mechanism.reference, np.append(np.zeros(3), spin))
    motion = rx.simulate(mechanism, start, 5.0, ts=[5.0], rtol=1e-10)
    true = solve_ivp(
        lambda _, w: np.linalg.solve(inertia, -np.cross(w, inertia @ w)), (0, 5), spin, "DOP853", rtol=1e-12, atol=1e-13
    )
    assert np.max(np.abs(motion.qd[-1, 3:] - true.y[:, -1])) < 1e-8


@pytest.mark.slow
def test_derivatives_of_motions_take_the_operations_of_about_two_values():
    """2.1 of them, where times are 2.7 on a quiet machine."""

    def end(length):
        mechanism, forward = rx.mechanisms.bricard(length=length), diffrax.ForwardMode()
        return rx.simulate(mechanism, rx.assemble(mechanism), 1.0, ts=[1.0], throw=False, adjoint=forward).q[-1]

    value, slope, at = jax.jit(end), jax.jit(jax.jacfwd(end)), jnp.asarray(1.0)
    h = 1e-5
    difference = (value(at + h) - value(at - h)) / (2 * h)
    assert np.max(np.abs(slope(at) - difference)) <= 1e-6 * np.max(np.abs(difference))
    lines = [len(function.lower(at).as_text().splitlines()) for function in (slope, value)]
    assert lines[0] <= 2.5 * lines[1]
