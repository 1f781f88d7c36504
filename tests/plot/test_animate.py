"""Moving pictures: their frames, their scale, and what they refuse."""

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from PIL import Image
from test_draw import overlapping

import redundax as rx

matplotlib.use("Agg")
pytestmark = pytest.mark.filterwarnings("ignore:Animation was deleted")
TIMES = np.linspace(0.0, 0.6, 7)


@pytest.fixture(scope="module")
def motion():
    mechanism = rx.mechanisms.parallelogram(3)
    return mechanism, rx.simulate(mechanism, mechanism.state(0.5, rate=1.0), 0.6, ts=TIMES)


def shown(film, number):
    """The axes with a frame, and the arrows in them by name."""
    film._func(number)
    (axes,) = film._fig.axes
    return axes, {
        part.get_gid(): part.get_xy() for part in axes.patches if str(part.get_gid()).startswith("load force")
    }


def texts(axes):
    return [text.get_text() for text in axes.texts if text.get_visible()]


@pytest.mark.slow
def test_a_gif_has_all_frames_at_their_rate(motion, tmp_path):
    film = rx.plot.animate(*motion, tmp_path / "crank.gif", fps=10)
    with Image.open(tmp_path / "crank.gif") as picture:
        assert picture.n_frames == TIMES.size
        assert picture.info["duration"] == 100  # ms
        width, height = film._fig.get_size_inches() * film._fig.dpi
        assert abs(picture.width - width) < 2 and abs(picture.height - height) < 2


@pytest.mark.slow
def test_frames_have_one_scale_and_no_text_on_another(motion):
    mechanism, trajectory = motion
    film = rx.plot.animate(mechanism, trajectory)
    limits, ratios = set(), []
    for number, t in enumerate(TIMES):
        axes, arrows = shown(film, number)
        limits.add((*axes.get_xlim(), *axes.get_ylim()))
        assert f"t = {t:.3f} s" in texts(axes)
        assert set(texts(axes)) >= {"A1", "A2", "A3", "B1", "B2", "B3"}
        assert not overlapping(axes)
        assert len(axes.get_children()) < 150  # the last frame is gone
        rows = {name: k for k, name in enumerate(mechanism.rows.names)}
        for joint in ("A1", "B2"):
            force = np.hypot(*(trajectory.multipliers[number, rows[f"{joint}.{way}"]] for way in "xy"))
            arrow = arrows.get(f"load force {joint}")
            if arrow is not None:
                ratios.append(np.hypot(*(arrow[3] - (arrow[0] + arrow[-2]) / 2)) / force)
    assert len(limits) == 1
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)
    assert len(ratios) > TIMES.size
    low, high = np.array(axes.get_xlim()), np.array(axes.get_ylim())
    assert np.all(trajectory.q[:, :6:2] > low[0]) and np.all(trajectory.q[:, 1:6:2] < high[1])


@pytest.mark.slow
def test_html_and_a_motion_without_loads(motion, tmp_path):
    mechanism, trajectory = motion
    multipliers = trajectory.multipliers.at[2:].set(np.nan)  # as at rest
    q = trajectory.q.at[4:].set(np.nan)  # as after a failure
    part = eqx.tree_at(lambda motion: (motion.q, motion.multipliers), trajectory, (q, multipliers))
    film = rx.plot.animate(mechanism, part, tmp_path / "crank.html")
    page = (tmp_path / "crank.html").read_text()
    assert page.count("data:image/png") == 4
    assert "<script" in page
    assert shown(film, 0)[1] and not shown(film, 2)[1]
    bare = rx.plot.animate(mechanism, part, loads=False, names=False)
    axes, arrows = shown(bare, 0)
    assert not arrows and not {"A1", "B1"} & set(texts(axes))


def lost(trajectory):
    return jax.tree.map(lambda x: x if x.dtype == int else jnp.nan * x, trajectory)


def at_once(trajectory):
    return jax.tree.map(lambda x: x[0] if x.ndim else x, trajectory)


@pytest.mark.slow  # a motion is compiled for it
@pytest.mark.parametrize(
    ("change", "given", "message"),
    [
        (None, {"fps": 0}, r"Argument `fps` must be positive"),
        (None, {"path": "film.mp4"}, r"Argument `path` must end in .gif or .html and lie in a folder that exists"),
        (None, {"scale": -1.0}, r"Argument `scale` must be positive"),
        (lost, {}, r"Argument `trajectory` must have at least one position that is finite"),
        (at_once, {}, r"Argument `trajectory` must be one motion of the mechanism, with q of shape \(times, 12\)"),
    ],
)
def test_errors_name_argument_and_fix(motion, change, given, message):
    mechanism, trajectory = motion
    if change is not None:
        trajectory = change(trajectory)
    with pytest.raises(rx.RedundaxError, match=message):
        rx.plot.animate(mechanism, trajectory, **given)
