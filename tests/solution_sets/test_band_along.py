"""Bands along a path against closed forms: drives that raise, hold and lower, and loads that grow until it slips."""

import json
from functools import cache

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest

import redundax as rx

matplotlib.use("Agg")
G = 9.81


# A block that is drawn up an incline ------------------------------------------------------------

ANGLE, MU, MASS = 0.3, 0.2, 3.0
TIMES = np.array([0.5, 1.0, 1.5, 2.5, 3.5, 4.0, 4.5])  # up until 2, at rest until 3, down again


def there_and_back(start, end, stop=2.0, go=3.0):
    """A value that goes to the end at constant rate, stops and comes back."""
    return lambda t: jnp.interp(t, jnp.array([0.0, stop, go, go + stop]), jnp.array([start, end, end, start]))


@cache
def drawn_block():
    """A rope pulls the block up the incline; it is 4 m long at first, and 3 m at the top."""
    along = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    guide = {"normal": (-along[1], along[0]), "friction": rx.Coulomb(MU), "guide_length": 0.1}
    rope = there_and_back(4.0, 3.0)
    mechanism = rx.Mechanism(
        [rx.Body("block", MASS, 0.1)],
        [
            rx.Translational("K", "block", "ground", (0.0, 0.0), (0.0, 0.0), **guide),
            rx.DistanceDriver("rope", "block", "ground", (0.0, 0.0), tuple(4.0 * along), rope),
        ],
        gravity=(0.0, -G),
        units=rx.units.Units(),
    )
    away = [4.0 - float(rope(t)) for t in TIMES]
    rates = [-0.5 if t > 3 else 0.5 if t < 2 else 0.0 for t in TIMES]
    states = [rx.State([*(s * along), 0.0], [*(v * along), 0.0], t) for s, v, t in zip(away, rates, TIMES, strict=True)]
    return mechanism, states


@cache
def drawn_path():
    return rx.band_along(*drawn_block(), ["rope.distance", "tau K"], rx.MinimumNorm())


@pytest.mark.slow
def test_the_rope_of_an_incline_has_hysteresis():
    """Its force is m g (sin a + mu cos a) upwards, m g (sin a - mu cos a) downwards, and between them at rest."""
    path = drawn_path()
    weight, rub = MASS * G * np.sin(ANGLE), MU * MASS * G * np.cos(ANGLE)
    assert path.motion == ("moves",) * 3 + ("rests",) + ("moves",) * 3
    assert path.stands == (None,) * 3 + ("yes",) + (None,) * 3
    lower = [weight + rub] * 3 + [weight - rub] + [weight - rub] * 3
    upper = [weight + rub] * 3 + [weight + rub] + [weight - rub] * 3
    np.testing.assert_allclose(path.lower[:, 0], lower, rtol=1e-11)
    np.testing.assert_allclose(path.upper[:, 0], upper, rtol=1e-11)
    np.testing.assert_allclose(path.outer_upper[:, 0], upper, rtol=1e-6)
    assert path.exact.all()


@pytest.mark.slow
def test_states_in_one_array_are_the_same():
    mechanism, states = drawn_block()
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *states, rx.State([np.nan] * 3, [0.0] * 3, 9.0))
    path = rx.band_along(mechanism, stacked, ["rope.distance", "tau K"], rx.MinimumNorm())
    np.testing.assert_array_equal(path.lower, drawn_path().lower)
    np.testing.assert_array_equal(path.t, TIMES)


def test_words_and_data_of_a_path():
    path = drawn_path()
    text = str(path)
    assert text.startswith("7 states from t = 0.5 to 4.5")
    assert "block.x increases  t = 0.5 to 1.5" in text and "block.x decreases  t = 3.5 to 4.5" in text
    assert text.count("rests") == 2 and "rope.distance, N" in text
    assert max(map(len, text.split("\n"))) <= 100
    data = json.loads(json.dumps(path.to_dict()))
    assert data["upper"][3][0] == path.upper[3, 0] and data["bands"][0]["sense"] == [1.0]


def test_the_picture_of_a_path_tells_the_directions_apart(tmp_path):
    path = drawn_path()
    figure = rx.plot.band_along(path, ["rope.distance"], against="block.x")
    figure.savefig(tmp_path / "path.png")
    (axes,), (legend,) = figure.axes, figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["block.x increases", "rests", "block.x decreases"]
    assert axes.get_xlabel() == "block.x, m" and axes.get_ylabel() == "N"
    lines = {line.get_label(): line for line in axes.get_lines()}
    np.testing.assert_array_equal(lines["block.x decreases"].get_xdata(), path.q[4:, 0])
    np.testing.assert_array_equal(lines["block.x decreases"].get_ydata(), path.lower[4:, 0])
    assert lines["block.x increases"].get_color() != lines["block.x decreases"].get_color()
    assert len(rx.plot.band_along(path).axes) == 2
    with pytest.raises(rx.RedundaxError, match="`against` must"):
        rx.plot.band_along(path, against="block.z")


# A scissor lift ---------------------------------------------------------------------------------

ARM, LOAD, SLOW = 1.0, 3000.0, 1e-6


def lift(friction, radius=0.02):
    """Two scissors side by side under a platform, twice redundant; a screw draws the foot of the first together.

    All arms have no mass and are at the angle phi, so that the platform is ARM sin phi above the floor.
    """
    pin, slot = {"pin_radius": radius, "friction": friction}, {"normal": (0.0, 1.0)}
    bodies, joints = [rx.Body("platform", 1.0, 1.0)], []
    for k, x in enumerate((-1.0, 0.2)):
        bodies += [rx.Body(f"rise {k}", 0.0, 0.0), rx.Body(f"fall {k}", 0.0, 0.0)]
        joints += [
            rx.Revolute(f"F{k}", f"rise {k}", "ground", (-ARM / 2, 0.0), (x, 0.0), **pin),
            rx.Revolute(f"M{k}", f"fall {k}", f"rise {k}", (0.0, 0.0), (0.0, 0.0), **pin),
            rx.Revolute(f"H{k}", f"fall {k}", "platform", (-ARM / 2, 0.0), (x, 0.0), **pin),
            rx.PinInSlot(f"foot {k}", f"fall {k}", "ground", (ARM / 2, 0.0), (x, 0.0), **slot),
            rx.PinInSlot(f"head {k}", f"rise {k}", "platform", (ARM / 2, 0.0), (x, 0.0), **slot),
        ]
    law = there_and_back(ARM * np.cos(0.6), ARM * np.cos(0.6) - 2 * SLOW)
    joints.append(rx.DistanceDriver("screw", "fall 0", "ground", (ARM / 2, 0.0), (-1.0, 0.0), law))
    loads = [rx.AppliedForce("platform", force=(0.0, -LOAD), point=(0.3, 0.0))]
    mechanism = rx.Mechanism(bodies, joints, loads=loads)
    states = []
    for t, rate in ((1.0, 1.0), (2.5, 0.0), (4.0, -1.0)):
        phi = np.arccos(float(law(t)) / ARM)
        states.append(lift_state(phi, rate * SLOW / (ARM * np.sin(phi)), t))
    return mechanism, states


def lift_state(phi, rate, t):
    c, s = ARM / 2 * np.cos(phi), ARM / 2 * np.sin(phi)
    q, qd = [0.0, 2 * s], [0.0, 2 * c * rate]
    for x in (-1.0, 0.2):
        q += [x + c, s] * 2
        qd += [-s * rate, c * rate] * 2
    return rx.State([*q, 0.0, *[phi, -phi] * 2], [*qd, 0.0, *[rate, -rate] * 2], t)


NAMES = ["screw.distance", "F0.y", "tau F0"]


@pytest.mark.slow
def test_the_screw_of_a_lift_with_tight_pins_has_hysteresis():
    """Power: F d|x|/dt = W dy/dt + M sum |relative rates|; those are 2 of pins M, 1 of F and H, for each scissor."""
    moment = 0.02 * 400.0
    mechanism, states = lift(rx.ConstantFriction(400.0))
    box = rx.AmplitudeBox({name: (-800.0, 800.0) for name in rx.analyze(mechanism, states[1]).pivots})
    path = rx.band_along(mechanism, states, NAMES, box)
    force = []
    for state in states:
        phi = float(state.q[11])
        by_weight, by_pins = LOAD / np.tan(phi), 2 * (1 + 2 + 1) * moment / (ARM * np.sin(phi))
        force.append((by_weight + by_pins, by_weight - by_pins))
    up, rest, down = force
    np.testing.assert_allclose(path.lower[:, 0], [up[0], rest[1], down[1]], rtol=1e-6)  # it accelerates a little
    np.testing.assert_allclose(path.upper[:, 0], [up[0], rest[0], down[1]], rtol=1e-6)
    assert path.stands[1] == "yes" and path.motion == ("moves", "rests", "moves")
    assert np.all(path.exact[1])


@pytest.mark.slow
def test_a_lift_at_rest_may_carry_all_that_it_carries_as_it_rises_and_falls():
    """Friction in proportion to loads: that of a slow motion is one of those which are possible at rest."""
    mechanism, states = lift(rx.Coulomb(0.2))
    box = rx.AmplitudeBox({name: (-500.0, 500.0) for name in rx.analyze(mechanism, states[1]).pivots})
    up, rest, down = rx.band_along(mechanism, states, NAMES, box, samples=32).bands
    for moving in (up, down):
        span = 1e-3 * (rest.upper - rest.lower)  # the states lie 1e-6 m apart
        assert not moving.empty
        assert np.all(rest.lower - span <= moving.lower) and np.all(moving.upper <= rest.upper + span)
    assert down.upper[0] < up.lower[0]


# A path of loads --------------------------------------------------------------------------------


def lifted(_, own, t, rate):
    return rx.Wrench(jnp.zeros(2), jnp.zeros(())), own.wrench(jnp.stack([jnp.zeros_like(t), rate * t]), jnp.zeros(2))


@pytest.mark.slow
def test_a_load_that_grows_lets_go_at_its_limit():
    """A block between two walls that push with 60 N at most is pulled up, ever more."""
    mu, weight, most, rate = 0.3, 2.0 * G, 60.0, 12.0
    wall = {"normal": (1.0, 0.0), "friction": rx.Coulomb(mu)}
    at = ("block", "ground", (0.0, 0.0), (0.0, 0.0))
    joints = [rx.Translational("L", *at, guide_length=0.2, **wall), rx.PinInSlot("R", *at, **wall)]
    load = rx.LoadFunction("ground", lifted, "block", rate)
    mechanism = rx.Mechanism([rx.Body("block", 2.0, 0.1)], joints, loads=[load], gravity=(0.0, -G))
    box = rx.AmplitudeBox({"L.perpendicular": (-most, most)})
    limit = rx.limit_load(mechanism, rx.State(jnp.zeros(3), jnp.zeros(3)), {"block.y": rate}, box)
    assert limit.upper == pytest.approx((weight + 2 * mu * most) / rate, rel=1e-12)
    times = limit.upper * np.array([0.0, 0.5, 0.99, 1.01, 1.2])
    path = rx.band_along(mechanism, [rx.State(np.zeros(3), np.zeros(3), t) for t in times], "tau L", box)
    assert path.stands == ("yes",) * 3 + ("no",) * 2 and path.motion == ("rests",) * 5
    pull = rate * times[:3] - weight  # both frictions, which count downwards
    np.testing.assert_allclose(path.lower[:3, 0], np.maximum(-mu * most, pull - mu * most), rtol=1e-9)
    np.testing.assert_allclose(path.upper[:3, 0], np.minimum(mu * most, pull + mu * most), rtol=1e-9)
    assert np.isnan(path.upper[3:]).all()
    assert f"CANNOT STAND (proved) at t = {times[3]:.6g}, {times[4]:.6g}." in str(path)
    (legend,) = rx.plot.band_along(path).legends
    assert [text.get_text() for text in legend.get_texts()] == ["rests", "cannot stand"]


# What has no band, or rests in part --------------------------------------------------------------


@pytest.mark.slow
def test_blocks_of_which_one_slides():
    """On the level floor both rub with mu m g where they slide, and with nothing where nothing pushes them."""
    guide = {"normal": (0.0, 1.0), "friction": rx.Coulomb(MU), "guide_length": 0.1}
    bodies = [rx.Body(name, MASS, 0.1) for name in ("left", "right")]
    joints = [rx.Translational(body.name[0], body.name, "ground", (0.0, 0.0), (0.0, 0.0), **guide) for body in bodies]
    mechanism = rx.Mechanism(bodies, joints, gravity=(0.0, -G))
    states = [
        rx.State([0.1 * t, 0, 1, 0, 0, 0], [v, 0, w, 0, 0, 0], t) for t, v, w in ((0, 1, 0), (1, -1, 0), (2, 0, 0))
    ]
    path = rx.band_along(mechanism, states, ["tau l", "tau r"], rx.MinimumNorm())
    assert path.motion == ("partly", "partly", "rests") and path.stands == ("yes",) * 3
    size = MU * MASS * G
    np.testing.assert_allclose(path.lower[:, 0], [-size, size, 0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(path.upper[:, 0], [-size, size, 0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(path.upper[:, 1], 0, atol=1e-9)
    words = [word for word, _ in path.runs(path.leading)]
    assert words == ["left.x increases, partly at rest", "left.x decreases, partly at rest", "rests"]


@pytest.mark.slow
def test_a_stage_that_moves_is_not_at_rest():
    """Its sleeves slide and do not turn; of two blocks on one rail the pin between them cannot."""
    carriage, sleeve = rx.spatial.Body("stage", MASS, (0.1, 0.1, 0.1)), {"shaft_radius": 0.01, "bearing_length": 0.1}
    rods = [
        rx.spatial.Cylindrical(
            name, carriage, "ground", point=(0, y, 0), axis=(1, 0, 0), friction=rx.Coulomb(MU), **sleeve
        )
        for name, y in (("l", 0.1), ("r", -0.1))
    ]
    stage = rx.Mechanism([carriage], rods, gravity=(0, 0, -G))
    guide = {"normal": (0.0, 1.0), "friction": rx.Coulomb(MU), "guide_length": 0.1}
    blocks = [rx.Body(name, MASS, 0.1) for name in ("left", "right")]
    joints = [rx.Translational(block.name[0], block.name, "ground", (0, 0), (0, 0), **guide) for block in blocks]
    pin = rx.Revolute("pin", "left", "right", (0, 0), (0, 0), friction=rx.Coulomb(MU), pin_radius=0.01)
    rail = rx.Mechanism(blocks, [*joints, pin], gravity=(0.0, -G))
    sliding = rx.assemble(stage, rates={"stage.x": 0.2}), rx.State(np.zeros(6), [0.2, 0.0, 0.2, 0.0, 0.0, 0.0])
    for mechanism, state, load in zip((stage, rail), sliding, ("l.radial_1", "tau l"), strict=True):
        path = rx.band_along(mechanism, [state], load, rx.MinimumNorm())
        assert path.motion == ("moves",) and path.runs(path.leading)[0][0].endswith("increases")


@pytest.mark.slow
def test_states_without_solution_are_told():
    """Friction this large jams the paper's mechanism in motion."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.15)
    states = [mechanism.state(phi=np.pi / 4, rate=rate, t=rate) for rate in (1.0, 2.0)]
    path = rx.band_along(mechanism, states, "A.x", rx.AmplitudeBox({"A.x": (-40.0, 40.0)}), samples=8, starts=1)
    assert np.isnan(path.lower).all() and path.stands == (None, None)
    assert "NO SOLUTION within the bounds was found at t = 1, 2." in str(path)
    (legend,) = rx.plot.band_along(path).legends
    assert "no solution" in [text.get_text() for text in legend.get_texts()]


def test_a_state_that_fails_is_named():
    mechanism, states = drawn_block()
    bad = rx.State(states[1].q + 0.1, states[1].qd, states[1].t)
    with pytest.raises(rx.NoSolutionError) as caught:
        rx.band_along(mechanism, [states[0], bad], "tau K", rx.MinimumNorm())
    assert caught.value.__notes__ == ["This is state 1 of the path, at t = 1."]
    with pytest.raises(rx.RedundaxError, match="has none"):
        rx.band_along(mechanism, [], "tau K", rx.MinimumNorm())


@pytest.mark.slow
def test_states_after_the_first_compile_nothing(programs):
    mechanism, states = drawn_block()
    rx.band_along(mechanism, [states[0], states[3]], "tau K", rx.MinimumNorm())
    assert programs
    programs.clear()
    rx.band_along(mechanism, [*states[1:3], states[4]], "tau K", rx.MinimumNorm())
    assert not programs
