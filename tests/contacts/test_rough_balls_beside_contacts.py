"""Sleeves and balls with dry friction beside contacts: impulses in impacts, and what slides on from there.

The independent integration is of the moment about the ball, or along and about the sleeve, by SciPy, with friction of
the load that Newton's law gives. An impact has the velocities w+ and impulses P of the contact at which momentum is
kept, the contact rests, and friction is its limit against w+.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, least_squares
from scipy.spatial.transform import Rotation

import redundax as rx

G, UP = 9.81, np.array([0.0, 0.0, 1.0])
ROD, ROUGH, BALL = 1.5, 0.3, 0.03  # kg, coefficient of friction, m
INERTIA = np.array([0.02, 0.03, 0.045])
CENTRE, TIP = np.array([0.25, 0.05, -0.02]), np.array([0.5, 0.02, 0.03])


def friction_at(residual):
    """The friction that its own load allows."""
    return brentq(residual, 0.0, 1e4, xtol=1e-15, rtol=8.9e-16)


class Pendulum:
    """A rod on a rough ball at the origin, whose tip may rest on a plane; all in its own frame."""

    inertia = np.diag(INERTIA) + ROD * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE))

    def accelerations(self, up, w, rests):
        """Rates of the angular velocity, and the load of the tip."""
        spin = np.cross(w, np.cross(w, np.array([CENTRE, TIP])))
        gyroscopic, slides = np.cross(w, self.inertia @ w), w / np.linalg.norm(w)

        def given(friction):
            load = np.cross(CENTRE, -ROD * G * up) - gyroscopic - friction * slides
            free, by_tip = np.linalg.solve(self.inertia, np.array([load, np.cross(TIP, up)]).T).T
            push = -(np.cross(free, TIP) + spin[1]) @ up / (np.cross(by_tip, TIP) @ up) if rests else 0.0
            return free + push * by_tip, push

        def residual(friction):
            rate, push = given(friction)
            force = ROD * (np.cross(rate, CENTRE) + spin[0] + G * up) - push * up
            return ROUGH * BALL * np.linalg.norm(force) - friction

        return given(friction_at(residual))

    def struck(self, up, w):
        """The angular velocity after the tip has struck."""

        def residual(x):
            after, push = x[:3], x[3]
            force = ROD * np.cross(after - w, CENTRE) - push * up
            rubs = ROUGH * BALL * np.linalg.norm(force) * after / np.linalg.norm(after)
            kept = self.inertia @ (after - w) - push * np.cross(TIP, up) + rubs
            return [*kept, np.cross(after, TIP) @ up]

        by_tip = np.linalg.solve(self.inertia, np.cross(TIP, up))
        push = -np.cross(w, TIP) @ up / (np.cross(by_tip, TIP) @ up)
        tight = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
        return least_squares(residual, [*(w + push * by_tip), push], **tight).x[:3]

    def motion(self, turn, w, times):
        """When the tip strikes, and angular velocities at times."""

        def rates(rests):
            def of(_, y):
                up, w = y[:3], y[3:6]
                return [*np.cross(up, w), *self.accelerations(up, w, rests)[0]]

            return of

        def height(_, y):
            return y[:3] @ TIP - TIP[2]

        height.terminal, options = True, {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853", "dense_output": True}
        falls = solve_ivp(rates(False), (0.0, times[-1]), [*(turn.T @ UP), *w], events=height, **options)
        strikes, end = falls.t[-1], falls.y[:, -1]
        after = [*end[:3], *self.struck(end[:3], end[3:])]
        assert self.accelerations(np.array(after[:3]), np.array(after[3:]), True)[1] > 0
        rests = solve_ivp(rates(True), (strikes, times[-1]), after, **options)
        return strikes, np.array([(falls if t <= strikes else rests).sol(t)[3:] for t in times])


@pytest.mark.slow
def test_a_pendulum_on_a_rough_ball_strikes_a_plane_as_its_slip_has_turned_about():
    """The direction of its slip turns by more than a right angle before the tip strikes."""
    rod = rx.spatial.Body("rod", ROD, inertia=tuple(INERTIA), centre=tuple(CENTRE))
    ball = rx.spatial.Spherical("ball", rod, "ground", (0.0, 0.0, 0.0), ball_radius=BALL, friction=rx.Coulomb(ROUGH))
    stop = rx.spatial.PointOnPlane("stop", rod, "ground", tuple(TIP), (0, 0, 1), one_sided=True)
    mechanism = rx.Mechanism([rod], [ball, stop], gravity=(0.0, 0.0, -G))
    quaternion = np.array([1.0, 0.03456, -0.35, 0.16433])
    turn = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    w = np.array([0.99131, -1.30316, 0.90536])
    q = jnp.array([*(turn @ CENTRE), *(quaternion / np.linalg.norm(quaternion))])
    state = rx.assemble(mechanism, q, rates=dict(zip(("rod.phi_x", "rod.phi_y", "rod.phi_z"), w, strict=True)))
    times = np.linspace(0.0, 0.4, 81)
    strikes, truth = Pendulum().motion(turn, w, times)
    before = truth[times < strikes]
    assert before[-1] @ before[0] < 0
    motion = rx.simulate(mechanism, state, 0.4, ts=times, rtol=1e-11)
    np.testing.assert_allclose(motion.impacts.t[0], strikes, rtol=1e-9)
    np.testing.assert_allclose(motion.qd[:, 3:], truth, rtol=0, atol=1e-8)


ARM, SPIN, ECCENTRIC, ARM_TIP = 2.0, 0.03, 0.05, 0.12  # kg, kg m^2, m from the axis
SHAFT, SLEEVE, DRY = 0.02, 0.1, 0.25  # m, m, coefficient of friction


class Arm:
    """An arm on a vertical sleeve that falls onto a stop as it turns."""

    inertia = SPIN + ARM * ECCENTRIC**2

    def limit(self, radial, across, couple):
        """Friction of both ends, given the force towards the centre of mass, that across, and the couple."""
        ends = np.hypot(radial / 2 + couple / SLEEVE, across / 2), np.hypot(radial / 2 - couple / SLEEVE, across / 2)
        return DRY * sum(ends)

    def accelerations(self, speed, w, rests):
        """Along the sleeve and about it."""
        along, about = np.array([speed, SHAFT * w]) / np.hypot(speed, SHAFT * w)

        def given(friction):
            turn, push = -SHAFT * friction * about / self.inertia, ARM * G + friction * along if rests else 0.0
            return 0.0 if rests else -G - friction * along / ARM, turn, push

        def residual(friction):
            rise, turn, push = given(friction)
            couple = ARM * ECCENTRIC * (rise + G) - ARM_TIP * push
            return self.limit(-ARM * ECCENTRIC * w**2, ARM * ECCENTRIC * turn, couple) - friction

        return given(friction_at(residual))[:2]

    def motion(self, height, w):
        """When it strikes and when it has stopped, and speeds about the sleeve at times."""
        options = {"rtol": 1e-12, "atol": 1e-14, "method": "DOP853", "dense_output": True, "max_step": 0.05}

        def lands(_, y):
            return y[0]

        def stops(_, y):
            return y[2] - 1e-12

        lands.terminal = stops.terminal = True
        begin = 1e-12  # not without slip along
        start = [height, -G * begin, w]
        falls = solve_ivp(
            lambda _, y: [y[1], *self.accelerations(*y[1:], False)], (begin, 1.0), start, events=lands, **options
        )
        strikes, (_, speed, before) = falls.t[-1], falls.y[:, -1]

        def residual(change):
            couple = (ECCENTRIC - ARM_TIP) * ARM * speed
            return self.inertia * change + SHAFT * self.limit(0.0, ARM * ECCENTRIC * change, couple)

        after = before + brentq(residual, -before, 0.0, xtol=1e-15, rtol=8.9e-16)
        rests = solve_ivp(
            lambda _, y: [0.0, *self.accelerations(0.0, y[2], True)],
            (strikes, 9.0),
            [0.0, 0.0, after],
            events=stops,
            **options,
        )
        stop = rests.t[-1]

        def at(t):
            return falls.sol(max(t, begin))[2] if t <= strikes else rests.sol(t)[2] if t < stop else 0.0

        return strikes, stop, at


@pytest.mark.slow
def test_an_arm_on_a_rough_sleeve_falls_onto_a_stop_turns_on_it_and_comes_to_rest():
    arm = rx.spatial.Body("arm", ARM, inertia=(0.01, 0.02, SPIN), centre=(ECCENTRIC, 0.0, 0.0))
    rubs = {"shaft_radius": SHAFT, "bearing_length": SLEEVE, "friction": rx.Coulomb(DRY)}
    sleeve = rx.spatial.Cylindrical("sleeve", arm, "ground", (0.0, 0.0, 0.0), (0, 0, 1), **rubs)
    stop = rx.spatial.PointOnPlane("stop", arm, "ground", (ARM_TIP, 0.0, 0.0), (0, 0, 1), one_sided=True)
    mechanism = rx.Mechanism([arm], [sleeve, stop], gravity=(0.0, 0.0, -G))
    strikes, stops, at = Arm().motion(0.05, 4.0)
    end = 1.2 * stops
    state = rx.assemble(mechanism, rx.assemble(mechanism).q.at[2].add(0.05), rates={"sleeve.angle": 4.0})
    motion = rx.simulate(mechanism, state, end, ts=np.linspace(0.0, end, 61), rtol=1e-11)
    np.testing.assert_allclose(motion.impacts.t[0], strikes, rtol=1e-9)
    np.testing.assert_allclose(motion.qd[:, 5], [at(t) for t in np.asarray(motion.t)], rtol=0, atol=1e-8)
    assert 0 < strikes < stops


@pytest.mark.slow
def test_an_arm_slides_along_its_rough_sleeve_as_a_stop_keeps_it_from_turning():
    """Friction about the sleeve is none but rounding, which is no size of it. The sleeve bears what the stop, gravity
    and inertia leave, and its friction is that of both ends."""
    mass, inertia = 1.0989586538263592, (0.04434829358576432, 0.03561646656072007, 0.03165449835996233)
    centre = np.array([0.14093139578785793, 0.01917802361038562, 0.04329628864537394])
    radius, length, mu = 0.03901443878919744, 0.1244803979695714, 0.252
    tip, apart = np.array([0.22967345, -0.39407917, 0.33683506]), 0.012184714757718384
    normal = np.array([0.99877065, 0.04957009, 0.0])
    normal /= np.linalg.norm(normal)
    gravity = np.array([3.971427820792628, -3.755553417322187, -8.146145075670699])
    arm = rx.spatial.Body("arm", mass, inertia=inertia, centre=tuple(centre))
    rubs = {"shaft_radius": radius, "bearing_length": length, "friction": rx.Coulomb(mu)}
    sleeve = rx.spatial.Cylindrical("sleeve", arm, "ground", (0.0, 0.0, 0.0), (0, 0, 1), **rubs)
    on = {"on_i": rx.spatial.Placement(tip, normal), "on_j": rx.spatial.Placement(tip - apart * normal, normal)}
    mechanism = rx.Mechanism(
        [arm], [sleeve, rx.spatial.PointOnPlane("stop", arm, "ground", **on, one_sided=True)], gravity=tuple(gravity)
    )

    def turned(angle):
        return Rotation.from_rotvec([0.0, 0.0, angle])

    angle = brentq(lambda a: (turned(a).apply(tip) - tip) @ normal + apart, -0.031, -0.029, xtol=1e-16)
    out, at, weight = turned(angle).apply(centre), turned(angle).apply(tip), mass * gravity
    carried = -np.cross(out, weight)[2] / np.cross(at, normal)[2]

    def lacks(friction):
        force = (friction + weight[2]) * UP - weight  # of inertia, as it falls, and what bears the weight
        couple = np.cross(UP, np.cross(out, force) - carried * np.cross(at, normal)) / length
        across = (force - carried * normal) / 2
        return mu * sum(np.linalg.norm((across + end * couple)[:2]) for end in (1, -1)) - friction

    falls = (friction_at(lacks) + weight[2]) / mass
    state = rx.State(
        [*(out + 0.0217 * UP), np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)], [0.0, 0.0, -0.2, 0.0, 0.0, 0.0]
    )
    motion = rx.simulate(mechanism, state, 0.02, ts=np.linspace(0.0, 0.02, 21), rtol=1e-10)
    np.testing.assert_allclose(motion.qd[:, 2], -0.2 + falls * np.asarray(motion.t), rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion["stop.axial"], carried, rtol=1e-9)
    assert carried > 0
