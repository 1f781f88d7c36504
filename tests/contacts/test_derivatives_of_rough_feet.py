"""Derivatives of tables on rough feet that are let go, slide, turn and stop, against closed forms and differences of
the independent integration of `test_rough_feet_in_motion`, of fourth order."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_rough_feet_in_motion import CORNERS, OBLIQUE, Feet, table

import redundax as rx

pytestmark = pytest.mark.slow


def figures(given, at, times):
    """Place and velocity at times, by coefficient, height, a push (F_x, F_y, M_z) t at the centre, and velocity."""
    mu, height, x, y, turn, *rates = given
    law = jnp.stack([0.0 * mu, x, y, height, turn, 1.0 + 0.0 * mu])
    mechanism = table(at, mu, law, height)
    start = rx.assemble(mechanism, rates=dict(zip(("top.x", "top.y", "top.phi_z"), rates, strict=True)))
    options = {"ts": times, "max_phases": 8, "adjoint": diffrax.ForwardMode(), "throw": False}
    motion = rx.simulate(mechanism, start, times[-1], **options)
    return jnp.concatenate([motion.q[:, :2], motion.qd[:, jnp.array([0, 1, 5])]], axis=1)


def slope_of(truth, given, way):
    """Its derivative along a way, by differences."""
    step = 1e-3
    near, far = (truth(given + k * step * way) - truth(given - k * step * way) for k in (1, 2))
    return (8 * near - far) / (12 * step)


def slid_to_rest(given, times):
    """v t - mu g t^2 / 2 up to v / (mu g), along v."""
    mu, speed = given[0], given[5:7]
    slows = mu * 9.81
    t = np.minimum(times, np.linalg.norm(speed) / slows)[:, None]
    along = speed / np.linalg.norm(speed)
    return np.concatenate([speed * t - slows * t**2 / 2 * along, speed - slows * t * along, 0.0 * t], axis=1)


def turned_to_rest(given, times):
    feet = Feet(OBLIQUE, given[0], height=given[1])

    def stops(t, y):
        return np.linalg.norm(y[3:]) - 1e-6

    stops.terminal, exact = True, {"rtol": 1e-12, "atol": 1e-14, "dense_output": True}
    run = solve_ivp(feet.slope, (0.0, times[-1]), [0, 0, 0, *given[5:]], "DOP853", events=stops, **exact)
    path = [run.sol(t) if t < run.t[-1] else np.append(run.y[:3, -1], np.zeros(3)) for t in times]
    return np.array(path)[:, [0, 1, 3, 4, 5]]


def let_go(given, times):
    return Feet(CORNERS, given[0], given[2:5], given[1], given[1]).slid(times)[:, [0, 1, 3, 4, 5]]


@pytest.mark.parametrize(
    ("truth", "at", "given", "way", "span", "within"),
    [
        (slid_to_rest, CORNERS, (0.4, 0.5, 0, 0, 0, 0.9, 1.2, 0), (0.3, 0, 0, 0, 0, 0.6, 0.8, 0), 0.6, 1e-9),
        (turned_to_rest, OBLIQUE, (0.3, 0.5, 0, 0, 0, 1.0, 0.0, 3.0), (0.2, 0.1, 0, 0, 0, 0.4, 0.5, -1), 0.5, 2e-7),
        (let_go, CORNERS, (0.4, 0.5, 18.0, 24.0, 3.0, 0, 0, 0), (0.1, 0.2, 2, -3, 4, 0, 0, 0), 1.6, 1e-6),
    ],
)
def test_slopes_pass_stops_and_releases(truth, at, given, way, span, within):
    times, given, way = np.linspace(0.0, span, 6), np.array(given, float), np.array(way, float)
    found, slope = jax.jvp(lambda x: figures(x, at, jnp.asarray(times)), (jnp.asarray(given),), (jnp.asarray(way),))
    np.testing.assert_allclose(found, truth(given, times), rtol=0, atol=1e-8)
    want = slope_of(lambda x: truth(x, times), given, way)
    np.testing.assert_allclose(slope, want, rtol=0, atol=within * np.max(np.abs(want)))
