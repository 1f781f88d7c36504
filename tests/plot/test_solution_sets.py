"""Pictures of solution families and motions: one unit on an axis, axes that show what varies, texts that keep apart."""

import itertools

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest

import redundax as rx

matplotlib.use("Agg")
UNITS = {"linear": "mm/s²", "angular": "rad/s²", "force": "N", "moment": "N mm"}
UNITS |= {f"friction {kind}": UNITS[kind] for kind in ("force", "moment")}


def made_up(count: int = 5, share: float = 0.01, amount: float = 2e3) -> rx.types.SolutionFamily:
    """A family with `count` quantities of each kind, of very different sizes, that vary by a share of themselves."""
    z = np.linspace(-amount, amount, 21)
    kinds = [kind for kind in UNITS for _ in range(count)]
    rising = np.linspace(-0.5, 0.5, 21)[:, None] * share
    means = np.array([(-1.0) ** k * 10.0 ** (k % 5) for k in range(len(kinds))])
    values = means * (1.0 + rising * (1.0 + np.arange(len(kinds)) / 100.0))
    return rx.types.SolutionFamily(
        along=("force 0",),
        stress=np.zeros((1, 2 * count)),
        weights=np.zeros((1, 2 * count)),
        offset=np.zeros(1),
        about="",
        axes=(z,),
        assumption="",
        count=np.ones(21, int),
        proved=True,
        z=z[:, None],
        branch=np.zeros(21, int),
        fold=np.zeros(21, bool),
        lost=0,
        names=tuple(f"{kind} {k % count}" for k, kind in enumerate(kinds)),
        kinds=tuple(kinds),
        units=tuple(UNITS[kind] for kind in kinds),
        values=values,
        sizes=np.abs(means),
    )


def apart(labels) -> bool:
    """Whether no two texts that are shown touch."""
    boxes = [label.get_window_extent() for label in labels if label.get_text() and label.get_visible()]
    return not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def inside(figure, artist) -> bool:
    box, whole = artist.get_window_extent(), figure.bbox
    return bool(whole.x0 <= box.x0 and box.x1 <= whole.x1 and whole.y0 <= box.y0 and box.y1 <= whole.y1)


@pytest.mark.parametrize("amount", [2e3, pytest.param(2e-4, marks=pytest.mark.slow)])
def test_every_panel_of_a_family_has_one_unit_and_shows_what_varies(amount):
    """Of 30 quantities that vary by 1 %, half are drawn, some of each kind, each over most of its own axis."""
    figure = rx.plot.family(made_up(amount=amount))
    figure.draw_without_rendering()
    assert len(figure.axes) == 15
    assert figure.get_suptitle() == "the 15 that change most, of 30"
    assert figure.get_supxlabel() == "self-stress added to force 0, N"
    drawn = [axes.get_title().rpartition(" ")[0] for axes in figure.axes]
    assert {kind: drawn.count(kind) >= 2 for kind in UNITS} == dict.fromkeys(UNITS, True)
    for kind, axes in zip(drawn, figure.axes, strict=True):
        assert axes.get_ylabel() == UNITS[kind]
        assert np.ptp(axes.lines[0].get_ydata()) > 0.8 * np.ptp(axes.get_ylim())
        assert len({text.get_text() for text in axes.get_yticklabels()}) == len(axes.get_yticks()) > 2
        assert apart(axes.get_xticklabels()) and apart(axes.get_yticklabels())
        assert axes.get_legend() is None


def test_quantities_that_run_together_share_a_panel():
    """Equal figures of unlike kinds do not."""
    family = made_up(1)
    values = np.repeat(family["force 0"][:, None], 6, axis=1)
    alike = {**vars(family), "values": values, "sizes": np.ones(6), "kinds": ("force",) * 4 + ("moment",) * 2}
    figure = rx.plot.family(rx.types.SolutionFamily(**alike))
    titles = [axes.get_title() for axes in figure.axes]
    assert all("friction\n" not in title for title in titles)  # names are not broken
    assert [title.replace("\n", " ") for title in titles] == [
        "linear 0, angular 0, force 0, moment 0", "friction force 0, friction moment 0"
    ]  # fmt: skip


def test_long_titles_stay_inside():
    """Two moments that run together, over the last of three columns."""
    family, loads = made_up(1), ("L moment on ram", "R moment on ram")
    values, sizes = (array[..., [0, 1, 2, 3, 4, 4]] for array in (family.values, family.sizes))
    alike = {"names": (*family.names[:4], *loads), "kinds": (*family.kinds[:4], "moment", "moment")}
    made = rx.types.SolutionFamily(**{**vars(family), **alike, "values": values, "sizes": sizes})
    figure = rx.plot.family(made, ["linear 0", "angular 0", *loads])
    figure.draw_without_rendering()
    assert [axes.get_title().replace("\n", " ") for axes in figure.axes][2:] == [", ".join(loads)]
    assert all(inside(figure, axes.title) for axes in figure.axes)


@pytest.mark.parametrize("names", [None, ["moment 0", "force 1", "friction force 2"]])
def test_what_is_named_is_drawn(names):
    titles = [axes.get_title() for axes in rx.plot.family(made_up(3 if names else 2), names).axes]
    assert titles == names or (names is None and len(titles) == 12)


def test_nothing_varies():
    (text,) = rx.plot.family(made_up(share=0.0)).texts
    assert text.get_text() == "Nothing varies along the self-stress."


def test_a_narrow_band_beside_wide_ones_has_a_panel_of_its_own():
    """A load of 25 N give or take 50, one of 1, and of 40 give or take 0.1: the last are seen over most of an axis."""
    state, push = rx.State([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), jnp.array([-50.0, 1.0, 80.0])
    wires = rx.Axis(("wide", "other", "one", "narrow", "rest"), ("force",) * 5)
    rows = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0, 0, 1.0]])
    system = rx.System(lambda q, t, p: rows @ q, np.ones(3), lambda q, qd, t, p: push, rows=wires)
    bands = rx.band(system, state, wires.labels, rx.AmplitudeBox({"wide": (-50.0, 50.0), "narrow": (-0.1, 0.1)}))
    panels = rx.plot.band(bands).axes
    assert [[label.get_text() for label in axes.get_yticklabels()] for axes in panels] == [
        ["wide", "other", "one"], ["narrow"], ["rest"]
    ]  # fmt: skip
    for axes in panels:
        assert np.ptp(axes.get_xlim()) < 2.0 * max(bar.get_width() for bar in axes.patches)


@pytest.mark.slow
def test_a_long_legend_of_a_motion_fits():
    """32 joint loads in one panel: their names stay inside of the picture and beside their own panel."""
    cranks = rx.mechanisms.parallelogram(8)
    state = cranks.state(0.5, rate=1.0)
    figure = rx.plot.trajectory(cranks, rx.simulate(cranks, state, 0.02), cranks.rows.labels)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    legend = axes.get_legend()
    assert len(legend.get_texts()) == 32 and apart(legend.get_texts())
    assert inside(figure, legend)
    assert not legend.get_window_extent().overlaps(axes.get_window_extent())
