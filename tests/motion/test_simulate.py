"""Motions against closed forms and scalar equations of one degree of freedom."""

import diffrax
import jax
import jax.numpy as jnp
import mechanisms
import numpy as np
import pytest
import registry
from scipy.integrate import solve_ivp
from truth import exact, squeezer

import redundax as rx
from redundax._tools import _interpreted, _numbers

T1 = 2.0
TIMES = np.linspace(0.0, T1, 9)
slow = pytest.mark.slow


def coordinate(case: mechanisms.Case, trajectory: rx.types.Trajectory) -> np.ndarray:
    system = case.smooth
    if case.coordinate == "travel":
        return np.asarray(trajectory.q[:, :2]) @ np.array([0.6, 0.8])
    return np.asarray(trajectory.q)[:, system.coordinates.labels.index(case.coordinate)]


OTHERS = ("two four-bars", "swing on massless rods", "carriage, guides offset", "driven three times")


@pytest.mark.parametrize("name", ["three cranks", *(pytest.param(name, marks=slow) for name in OTHERS)])
def test_motion_has_its_closed_form(name):
    """Three cranks and the four-bars pass their singular positions phi = 0 and -pi on the way."""
    case = mechanisms.CASES[name]
    driven = bool(case.law)
    start = case.state if driven or case.coordinate == "travel" else case.smooth.state(float(case.at), rate=0.0)
    t0 = float(start.t)
    trajectory = rx.simulate(case.smooth, start, t0 + T1, ts=t0 + TIMES)
    truth = exact.floats([case.motion(t0 + t if driven else t) for t in TIMES])
    if case.coordinate == "travel":  # starts with a rate, which the closed form leaves out
        truth = truth + float(case.rate) * TIMES
    np.testing.assert_allclose(coordinate(case, trajectory), truth, rtol=0, atol=1e-6)
    stats = trajectory.stats
    assert trajectory.result == rx.RESULTS.successful
    assert max(stats.position_violation, stats.velocity_violation) <= 1e-13
    assert stats.energy_error <= 1e-8
    again = rx.solve(case.smooth, rx.State(trajectory.q[3], trajectory.qd[3], trajectory.t[3]))
    kinds = registry.kinds_of(case.smooth.coordinates)
    assert registry.agree(trajectory.acceleration[3], again.acceleration, kinds, 1e-9)
    size = np.max(np.abs(np.asarray(again.multipliers)))
    np.testing.assert_allclose(trajectory.multipliers[3], again.multipliers, rtol=0, atol=1e-9 * size)


# A pendulum whose constraint stands there twice: every program below is small


def pendulum(angle, rate, gravity=9.81):
    def constraint(q, t, p):
        gap = q @ q - 1.0
        return jnp.stack([gap, 3 * gap])

    def load(q, qd, t, p):
        return jnp.stack([jnp.zeros_like(t), -p])

    system = rx.System(constraint, jnp.ones(2), load, gravity, rows="force")
    outward = jnp.stack([jnp.sin(angle), -jnp.cos(angle)])
    along = jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    return system, rx.State(outward, rate * along)


def pendulum_truth(angle, rate, gravity=9.81, t1=T1):
    """x and y of the bob at t1, from the scalar equation of the angle."""
    run = solve_ivp(
        lambda t, y: [y[1], -gravity * np.sin(y[0])], (0, t1), [angle, rate], method="DOP853", rtol=1e-13, atol=1e-14
    )
    return np.array([np.sin(run.y[0, -1]), -np.cos(run.y[0, -1])])


def ends(angle, rate, gravity, **options):
    system, state = pendulum(angle, rate, gravity)
    return rx.simulate(system, state, T1, ts=[T1], **options)


def richardson(function, x, h=1e-2):
    def central(h):
        return (function(x + h) - function(x - h)) / (2 * h)

    coarse, middle, fine = central(h), central(h / 2), central(h / 4)
    return (64 * fine - 20 * middle + coarse) / 45


@slow
def test_derivatives_of_the_motion_forward_and_reverse():
    at = (0.7, 1.3, 9.81)
    truth = np.stack(
        [
            richardson(lambda x, k=k: pendulum_truth(*[x if i == k else v for i, v in enumerate(at)]), at[k])
            for k in range(3)
        ],
        axis=1,
    )
    forward = jax.jit(jax.jacfwd(lambda *x: ends(*x, adjoint=diffrax.ForwardMode()).q[0], argnums=(0, 1, 2)))(*at)
    reverse = jax.jit(jax.jacrev(lambda *x: ends(*x).q[0], argnums=(0, 1, 2)))(*at)
    np.testing.assert_allclose(jnp.stack(forward, axis=1), truth, rtol=0, atol=1e-6)
    np.testing.assert_allclose(jnp.stack(reverse, axis=1), truth, rtol=0, atol=1e-6)


def test_a_first_derivative_forward_is_computed_by_numpy(monkeypatch):
    monkeypatch.setattr(_numbers._Traced, "program", property(lambda self: pytest.fail("compiled")))
    monkeypatch.setattr(_interpreted, "_COMPILING", np.inf)
    end, found = jax.jvp(lambda g: ends(0.7, 1.3, g, adjoint=diffrax.ForwardMode()).q[0], (9.81,), (1.0,))
    np.testing.assert_allclose(end, pendulum_truth(0.7, 1.3, 9.81), rtol=0, atol=1e-6)
    truth = richardson(lambda g: pendulum_truth(0.7, 1.3, g), 9.81)
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-6)


@pytest.mark.parametrize("kind", [pytest.param("diagonal", marks=slow), pytest.param("matrix", marks=slow), "function"])
def test_motion_of_every_kind_of_mass(kind):
    """Masses 2 and 2 as a vector, in skew coordinates x = T u as a full matrix, and as a function."""
    turn = jnp.eye(2) if kind == "diagonal" else jnp.array([[1.0, 0.5], [-0.25, 1.0]])
    matrix = 2.0 * turn.T @ turn
    mass = {"diagonal": jnp.full(2, 2.0), "matrix": matrix, "function": lambda q, t, p: matrix}[kind]
    system = rx.System(
        lambda q, t, p: jnp.array([1.0, 3.0]) * (jnp.sum((turn @ q) ** 2) - 1.0),
        mass,
        lambda q, qd, t, p: 2.0 * 9.81 * -turn[1],
        n=2,
        rows="force",
        m=2,
    )
    state = pendulum(0.7, 1.3)[1]
    start = rx.State(jnp.linalg.solve(turn, state.q), jnp.linalg.solve(turn, state.qd))
    end = rx.simulate(system, start, T1, ts=[T1], rtol=1e-10)
    np.testing.assert_allclose(turn @ end.q[0], pendulum_truth(0.7, 1.3), rtol=0, atol=1e-8)


@pytest.mark.slow
def test_a_batch_of_motions_keeps_each_to_itself():
    """One sample starts off the manifold and is NaN; the others do not notice."""
    rates = jnp.array([0.5, 1.0, 2.0])
    system, state = pendulum(0.7, 1.0)
    q = jnp.stack([state.q, 1.1 * state.q, state.q])
    run = jax.jit(jax.vmap(lambda q, qd: rx.simulate(system, rx.State(q, qd), T1, ts=[T1])))
    batch = run(q, rates[:, None] * state.qd)
    assert np.array_equal(batch.result == rx.RESULTS.successful, [True, False, True])
    assert np.array_equal(batch.result == rx.RESULTS.violated_constraints, [False, True, False])
    assert np.all(np.isnan(batch.q[1]))
    for k in (0, 2):
        np.testing.assert_allclose(batch.q[k, 0], pendulum_truth(0.7, float(rates[k])), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("stabilisation", "least", "most"),
    [
        pytest.param(rx.NoStabilisation(), 1e-9, 1e-4, marks=slow),
        pytest.param(rx.Baumgarte(10.0, 10.0), 1e-12, 1e-6, marks=slow),
        (rx.Projection(), 0.0, 1e-15),
    ],
    ids=["none", "Baumgarte", "projection"],
)
def test_drift_is_that_of_the_stabilisation(stabilisation, least, most):
    system, state = pendulum(0.7, 1.3)
    run = rx.simulate(
        system, state, T1, ts=[T1], stabilisation=stabilisation, solver=diffrax.Tsit5(), rtol=None, dt0=0.02
    )
    assert least <= run.stats.position_violation <= most
    assert run.stats.steps == 100
    np.testing.assert_allclose(run.q[0], pendulum_truth(0.7, 1.3), rtol=0, atol=1e-5)


@slow
def test_constant_steps_do_not_end_beside_a_singular_position():
    """Ten thousand steps of a parallelogram that turns through its flat positions thirty times a minute."""
    mechanism = rx.mechanisms.parallelogram(2)
    start = mechanism.state(0.5, rate=8.0)
    options = {"rtol": None, "dt0": 0.01, "solver": diffrax.Dopri5(), "ts": [100.0]}
    run = rx.simulate(mechanism, start, 100.0, **options)
    assert run.stats.velocity_violation < 1e-14
    assert run.stats.energy_error < 1e-6
    assert 10_000 <= run.stats.steps < 10_500


def test_where_a_motion_ends_early_the_rest_is_nan():
    system, state = pendulum(0.7, 1.3)
    run = rx.simulate(system, state, T1, ts=TIMES, max_steps=12, throw=False)
    assert run.result == rx.RESULTS.steps_exhausted
    given = np.isfinite(run.q[:, 0])
    assert 0 < np.sum(given) < TIMES.size
    for t, q in zip(TIMES[given][1:], run.q[given][1:], strict=True):
        np.testing.assert_allclose(q, pendulum_truth(0.7, 1.3, t1=t), rtol=0, atol=1e-6)
    with pytest.raises(
        rx.NoSolutionError, match=rf"max_steps.* got to t = {run.stats.end:.6g}: with `throw=False` it is"
    ):
        rx.simulate(system, state, T1, ts=TIMES, max_steps=12)


def test_a_derivative_of_a_motion_that_ends_early_says_so():
    def end(length):
        run = rx.simulate(*pendulum(length, 1.3), T1, ts=TIMES, max_steps=12, adjoint=diffrax.ForwardMode())
        return run.q[-1, 0]

    with pytest.raises(rx.NoSolutionError, match=r"max_steps.* got to t = \d"):
        jax.jvp(end, (0.7,), (1.0,))


def two_rods(q):
    """Accelerations of a double pendulum of uniform rods, 1 m and 1 kg each, by Lagrange's equations."""
    (a, b), (da, db), g = q[:2], q[2:], 9.81
    mass = np.array([[4 / 3, np.cos(a - b) / 2], [np.cos(a - b) / 2, 1 / 3]])
    bent = np.sin(a - b) / 2 * np.array([-(db**2), da**2])
    return np.linalg.solve(mass, bent - g * np.array([1.5 * np.cos(a), 0.5 * np.cos(b)]))


@slow
def test_a_double_pendulum_swings_as_lagrange_says():
    rods = [rx.Body(name, 1.0, 1 / 12) for name in ("upper", "lower")]
    pins = [
        rx.Revolute("A", "upper", "ground", point_i=(-0.5, 0.0), point_j=(0.0, 0.0)),
        rx.Revolute("B", "lower", "upper", point_i=(-0.5, 0.0), point_j=(0.5, 0.0)),
    ]
    mechanism = rx.Mechanism(rods, pins, gravity=(0.0, -9.81))
    a, b = 0.4, -0.9
    elbow = np.array([np.cos(a), np.sin(a)])
    hand = elbow + np.array([np.cos(b), np.sin(b)]) / 2
    start = rx.State(q=np.array([*elbow / 2, *hand, a, b]), qd=np.zeros(6))
    trajectory = rx.simulate(mechanism, start, T1, ts=TIMES, rtol=1e-10)
    truth = solve_ivp(
        lambda t, q: [*q[2:], *two_rods(q)],
        (0, T1),
        [a, b, 0, 0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-12,
        t_eval=TIMES,
    )
    np.testing.assert_allclose(trajectory.q[:, 4:], truth.y[:2].T, rtol=0, atol=1e-7)
    assert trajectory.stats.energy_error <= 1e-9
    assert trajectory.stats.position_violation <= 1e-13


@slow
def test_the_squeezer_ends_where_it_was_published_to():
    trajectory = rx.simulate(squeezer.mechanism(), squeezer.start(), squeezer.T1, ts=[squeezer.T1])
    np.testing.assert_allclose(squeezer.relative_angles(trajectory.q[0]), squeezer.PUBLISHED, rtol=1e-8)
    assert trajectory.stats.energy_error <= 1e-8


@slow
def test_no_motion_begins_in_a_singular_position():
    mechanism = rx.mechanisms.parallelogram(3)
    with pytest.raises(rx.NoSolutionError, match="position is singular"):
        rx.simulate(mechanism, mechanism.state(0.0, rate=1.0), 1.0)


def test_arguments_that_do_not_fit_are_refused():
    system, state = pendulum(0.7, 1.3)
    with pytest.raises(rx.RedundaxError, match="`dt0`"):
        rx.simulate(system, state, T1, rtol=None)
    with pytest.raises(rx.RedundaxError, match="`rtol`"):
        rx.simulate(system, state, T1, solver=diffrax.Euler())
    with pytest.raises(rx.RedundaxError, match=r"`t1` must be a number.*times of the motion as `ts`"):
        rx.simulate(system, state, jnp.array([0.1, T1]))
    with pytest.raises(rx.RedundaxError, match=r"jax\.vmap"):
        rx.simulate(system, jax.tree.map(lambda x: jnp.stack([x, x]), state), T1)
    for option in ("rtol", "dt0", "max_steps", "max_phases"):
        least = "positive" if option in ("rtol", "dt0") else "a whole number from 1 on"
        with pytest.raises(rx.RedundaxError, match=f"`{option}` must be {least}"):
            rx.simulate(system, state, T1, **{option: 0})


DISORDER = {  # end, and times, from 0
    "backward": (-0.5, [-0.4, -0.2]),
    "end NaN": (np.nan, [0.1, 0.2]),
    "no end": (np.inf, [0.1, 0.2]),
    "time before the start": (0.5, [-0.1, 0.2]),
    "time after the end": (0.5, [0.1, 0.6]),
    "descending": (0.5, [0.4, 0.2]),
    "time NaN": (0.5, [0.1, np.nan]),
}


@pytest.mark.slow
def test_times_that_no_motion_runs_through():
    """Refused by the name of the argument; traced ones end as a result, alone in their batch."""
    system, state = pendulum(0.7, 1.3)
    for name, (t1, ts) in DISORDER.items():
        named = "`t1`" if name in ("backward", "end NaN", "no end") else "`ts`"
        with pytest.raises(rx.RedundaxError, match=named):
            rx.simulate(system, state, t1, ts=ts, throw=False)
    with pytest.raises(rx.RedundaxError, match="one time or more"):
        rx.simulate(system, state, T1, ts=[])
    ends, times = (jnp.asarray(x) for x in zip(*DISORDER.values(), (T1, [0.4, T1]), strict=True))
    run = jax.jit(jax.vmap(lambda t1, ts: rx.simulate(system, state, t1, ts=ts)))(ends, times)
    assert list(run.result == rx.RESULTS.times_out_of_order) == [True] * len(DISORDER) + [False]
    for x in (run.q, run.qd, run.acceleration, run.multipliers):
        assert np.isnan(x[:-1]).all()
    assert list(run.result == rx.RESULTS.successful) == [False] * len(DISORDER) + [True]
    np.testing.assert_allclose(run.q[-1, 1], pendulum_truth(0.7, 1.3), rtol=0, atol=1e-6)


def test_times_that_touch():
    """A motion of no length, times that come twice, and a last one that rounding puts beyond the end."""
    system, state = pendulum(0.7, 1.3)
    for t1, ts in ((0.0, [0.0] * 4), (0.6, [0.0, 0.3, 0.3, 0.1 * 6])):
        run = rx.simulate(system, state, t1, ts=ts)
        assert run.result == rx.RESULTS.successful
        truth = [pendulum_truth(0.7, 1.3, t1=t) if t > 0 else state.q for t in np.asarray(run.t)]
        np.testing.assert_allclose(run.q, truth, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_derivatives_by_the_times_are_velocities():
    """At the end too, where the time touches the end of the motion."""
    system, state = pendulum(0.7, 1.3)

    def moved(ts):
        return rx.simulate(system, state, T1, ts=ts, adjoint=diffrax.ForwardMode()).q

    ts = jnp.array([0.0, 0.5, T1])
    qd = rx.simulate(system, state, T1, ts=ts).qd
    _, slope = jax.jvp(moved, (ts,), (jnp.ones(3),))
    np.testing.assert_allclose(slope, qd, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_the_error_of_energy_of_what_stands_is_that_of_a_motion():
    """It has no kinetic energy but that of rounding, which says nothing."""
    pin = rx.Revolute("A", "rod", "ground", (0.0, 0.4), (0.0, 0.0))
    rod = rx.Mechanism([rx.Body("rod", 1.5, 0.1)], [pin], gravity=(0.0, -9.81))
    hangs = rx.simulate(rod, rx.State(jnp.array([0.0, -0.4, 0.0]), jnp.zeros(3)), 1.0, ts=[1.0])
    assert hangs.stats.energy_error < 1e-12


@pytest.mark.slow
def test_a_number_that_a_load_of_the_user_holds_moves_a_motion():
    """qd = c sin t / 2, in forward mode, where that number is no argument of the motion."""

    def speed(c):
        guide = lambda q, t, p: q[1:]  # noqa: E731
        pull = lambda q, qd, t, p: jnp.stack([c * jnp.cos(t), 0.0 * t])  # noqa: E731
        system = rx.System(mass=jnp.array([2.0, 1.0]), constraint=guide, load=pull)
        start = rx.State(jnp.zeros(2), jnp.zeros(2))
        return rx.simulate(system, start, 0.1, ts=[0.1], adjoint=diffrax.ForwardMode()).qd[0, 0]

    assert jax.jvp(speed, (3.0,), (1.0,))[1] == pytest.approx(np.sin(0.1) / 2, rel=1e-9)
