"""Singular positions: refused by name by every call, and beside them right or refused.

Six mechanisms of one degree of freedom whose motion through the position is known in closed form: their coordinate
phi drives all bodies by q = pose(phi), so that with T(phi) = sum (m x'^2 + J turn'^2) / 2 over phi'^2 / 2 and V(phi)

    phi'' = -(T' phi'^2 / 2 + V') / T        in 50 digits, at any distance from the position.
"""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import redundax as rx

R = rx.RESULTS
GRAVITY = 9.81


@dataclass(frozen=True)
class Case:
    """Bodies (mass, inertia), joints, the place of every body over phi as (x, y, turn), and the singular phi."""

    bodies: dict[str, tuple[float, float]]
    joints: tuple
    pose: object
    phi: object  # of mp, as float

    def state(self, phi, rate):
        """State at phi, exact to the last digit, at the rate."""
        places = np.array([[float(v) for v in place] for place in self.pose(mp, phi)])
        rates = np.array(
            [
                [float(mp.diff(lambda s, k=k, c=c: self.pose(mp, s)[k][c], phi) * rate) for c in range(3)]
                for k in range(len(places))
            ]
        )
        return rx.State(*(np.concatenate([x[:, :2].ravel(), x[:, 2]]) for x in (places, rates)))

    def mechanism(self, friction=None):
        pins = {"pin_radius": 1.0, "friction": friction}
        joints = [make(**pins) if make.func is rx.Revolute else make() for make in self.joints]
        return rx.Mechanism([rx.Body(n, *mj) for n, mj in self.bodies.items()], joints, gravity=(0.0, -GRAVITY))

    def acceleration(self, phi, rate):
        """phi'' in 50 digits."""

        def inertia(s):
            slopes = [
                [mp.diff(lambda u, k=k, c=c: self.pose(mp, u)[k][c], s) for c in range(3)]
                for k in range(len(self.bodies))
            ]
            return sum(
                m * (x**2 + y**2) + j * t**2 for (m, j), (x, y, t) in zip(self.bodies.values(), slopes, strict=True)
            )

        def height(s):
            return sum(
                m * mp.mpf(GRAVITY) * place[1]
                for (m, _), place in zip(self.bodies.values(), self.pose(mp, s), strict=True)
            )

        return -(mp.diff(inertia, phi) * rate**2 / 2 + mp.diff(height, phi)) / inertia(phi)


def cranks(count, spacing=0.8, a=0.3):
    """Equal cranks on one coupler, flat at phi = 0."""
    bodies = {f"crank {k}": (1.0 + k, 0.01) for k in range(count)} | {"coupler": (2.0, 0.1)}
    joints = []
    for k in range(count):
        joints += [
            partial(rx.Revolute, f"A{k}", f"crank {k}", rx.GROUND, (-a / 2, 0.0), (k * spacing, 0.0)),
            partial(rx.Revolute, f"B{k}", "coupler", f"crank {k}", (k * spacing, 0.0), (a / 2, 0.0)),
        ]

    def pose(m, phi):
        x, y = a * m.cos(phi), a * m.sin(phi)
        return [(x / 2 + k * spacing, y / 2, phi) for k in range(count)] + [(x, y, 0 * phi)]

    return Case(bodies, tuple(joints), pose, 0.0)


def folding_slider(a=0.4):
    """Crank and rod of one length: where the crank stands across, the slider is at its pivot."""
    bodies = {"crank": (1.0, 0.02), "rod": (1.5, 0.03), "slider": (2.0, 0.05)}
    joints = (
        partial(rx.Revolute, "O", "crank", rx.GROUND, (-a / 2, 0.0), (0.0, 0.0)),
        partial(rx.Revolute, "P", "rod", "crank", (-a / 2, 0.0), (a / 2, 0.0)),
        partial(rx.Revolute, "Q", "slider", "rod", (0.0, 0.0), (a / 2, 0.0)),
        partial(rx.Translational, "S", "slider", rx.GROUND, (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    )

    def pose(m, phi):
        x, y = a * m.cos(phi), a * m.sin(phi)
        return [(x / 2, y / 2, phi), (3 * x / 2, y / 2, -phi), (2 * x, 0 * x, 0 * x)]

    return Case(bodies, joints, pose, float(np.pi / 2))


def folding_kite(a=0.3, b=0.7):
    """A four-bar of two pairs of equal lengths, whose coupler and rocker turn as one about a resting crank."""
    bodies = {"crank": (1.0, 0.02), "coupler": (1.5, 0.03), "rocker": (2.0, 0.05)}
    joints = (
        partial(rx.Revolute, "O", "crank", rx.GROUND, (-a / 2, 0.0), (0.0, 0.0)),
        partial(rx.Revolute, "P", "coupler", "crank", (-b / 2, 0.0), (a / 2, 0.0)),
        partial(rx.Revolute, "Q", "rocker", "coupler", (b / 2, 0.0), (b / 2, 0.0)),
        partial(rx.Revolute, "R", "rocker", rx.GROUND, (-b / 2, 0.0), (a, 0.0)),
    )

    def pose(m, phi):  # the crank rests at (a, 0); coupler and rocker lie on each other, at the angle phi
        x, y = b * m.cos(phi), b * m.sin(phi)
        return [(a / 2 + 0 * x, 0 * x, 0 * x), (a + x / 2, y / 2, phi), (a + x / 2, y / 2, phi)]

    return Case(bodies, joints, pose, 0.0)


CASES = {
    "flat parallelogram": cranks(2),
    "flat, three cranks": cranks(3),
    "flat, long coupler": cranks(2, spacing=5.0),
    "flat, short cranks": cranks(2, a=0.02),
    "folding slider": folding_slider(),
    "folding kite": folding_kite(),
}
every_case = pytest.mark.parametrize("name", CASES)


@every_case
def test_accelerations_beside_are_right_or_refused(name):
    case, rate, refused = CASES[name], 1.1, 0
    system = case.mechanism()
    solve = jax.jit(lambda q, qd: rx.solve(system, rx.State(q, qd)))
    distances = [0.0, *(10.0**-k for k in range(16, 0, -1))]
    with mp.workdps(50):
        for s in distances:
            phi = (mp.pi / 2 if name == "folding slider" else mp.mpf(0)) + mp.mpf(s)
            state = case.state(phi, mp.mpf(rate))
            solution = solve(state.q, state.qd)
            if solution.result != R.successful:
                refused += 1
                assert np.all(np.isnan(solution.acceleration))
                assert s < 1e-9, f"refused at {s}: {rx.RESULTS[solution.result]}"
                continue
            exact = float(case.acceleration(phi, mp.mpf(rate)))
            found = float(solution.acceleration[2 * len(case.bodies) + (1 if name == "folding kite" else 0)])
            told = 1e-15 * 10 ** float(solution.stats.lost_digits)
            assert abs(found - exact) <= (1e-9 + 10 * told) * (abs(exact) + rate**2), f"at {s}: {found}, not {exact}"
    assert refused >= 2


@every_case
def test_the_position_itself_is_refused_with_its_name(name):
    case = CASES[name]
    with mp.workdps(30):
        state = case.state(mp.mpf(case.phi), mp.mpf(1.1))
        rest = rx.State(state.q, 0 * state.qd)
    system, rubbing = case.mechanism(), case.mechanism(rx.Coulomb(0.001))
    for mechanism in (system, rubbing):
        with pytest.raises(RuntimeError, match="position is singular"):
            rx.solve(mechanism, state)
    assert rx.solve(system, rest, throw=False).result == R.singular_position
    report = rx.analyze(system, state)
    assert report.singular_position
    assert report.local_self_stress >= 1
    assert "SINGULAR POSITION" in str(report)
    assert not report.unique_accelerations
    assert report.unique_multipliers == ()
    assert report.verdicts == {}
    pivot = report.pivots[0]
    for call in (
        lambda: rx.band(system, state, None, rx.AmplitudeBox({pivot: (-1.0, 1.0)})),
        lambda: rx.solution_family(rubbing, state),
        lambda: rx.frictional_solutions(rubbing, state),
        lambda: rx.sticking(rubbing, rest, rx.MinimumNorm()),
        lambda: rx.simulate(system, state, 0.1),
    ):
        with pytest.raises(RuntimeError, match="position is singular"):
            call()


def test_batches_studies_and_derivatives_refuse_it():
    case = CASES["flat parallelogram"]
    system = case.mechanism()
    with mp.workdps(30):
        states = [case.state(mp.mpf(phi), mp.mpf(1.1)) for phi in (0.3, 0.0, 0.7)]
    q, qd = (jnp.stack([getattr(state, name) for state in states]) for name in ("q", "qd"))

    def run(q, qd):
        return rx.solve(system, rx.State(q, qd))

    solution = jax.vmap(run)(q, qd)
    assert list(solution.result == R.successful) == [True, False, True]
    assert bool((solution.result == R.singular_position)[1])
    assert np.array_equal(np.isnan(solution.acceleration).any(axis=1), [False, True, False])
    slope = jax.vmap(jax.jacfwd(lambda qd, q: run(q, qd).acceleration))(qd, q)
    assert np.array_equal(np.isnan(slope).any(axis=(1, 2)), [False, True, False])
    gradient = jax.grad(lambda qd: jnp.nansum(jax.jit(jax.vmap(run))(q, qd).acceleration))(qd)
    assert np.all(np.isfinite(gradient))  # a bad sample leaves the gradient of its neighbours alone
    assert np.all(gradient[1] == 0)
    found = rx.study(run, {"q": q, "qd": qd}, system=system)
    assert np.array_equal(np.isnan(np.asarray(found["acceleration"])).any(axis=1), [False, True, False])


def test_a_rank_that_changes_with_time_is_singular():
    """Rows y and y + t x: at t = 0 they are one, beside it two."""
    system = rx.System(lambda q, t, p: jnp.stack([q[1], q[1] + t * q[0]]), jnp.ones(2))
    at_zero = rx.solve(system, rx.State([0.0, 0.0], [0.0, 0.0]), throw=False)
    assert at_zero.result == R.singular_position
    later = rx.solve(system, rx.State([0.0, 0.0], [0.0, 0.0], 0.5))
    np.testing.assert_allclose(later.acceleration, 0.0, atol=1e-15)


def test_lost_digits_tell_how_near_it_is():
    case, system = CASES["flat parallelogram"], CASES["flat parallelogram"].mechanism()
    with mp.workdps(30):
        near, far = (case.state(mp.mpf(phi), mp.mpf(1.0)) for phi in (1e-8, 0.5))
    assert 8.0 <= float(rx.solve(system, near).stats.lost_digits) <= 9.5
    assert float(rx.solve(system, far).stats.lost_digits) <= 2.0
    assert "NEAR A SINGULAR POSITION" in str(rx.analyze(system, near))
    assert "SINGULAR POSITION" not in str(rx.analyze(system, far))
