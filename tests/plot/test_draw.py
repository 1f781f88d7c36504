"""Pictures: every mechanism draws, names stay apart, and arrows are as long and point as the loads say."""

import itertools
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from jaxtyping import Array, Float
from matplotlib.figure import Figure
from mechanisms import CASES, MORE

import redundax as rx
from redundax.plot._draw import draw
from redundax.plot._draw._arrows import joint_arrows
from redundax.plot._draw._labels import _BLACK, _Ink
from redundax.plot._draw._pen import Pen
from redundax.plot._draw._scene import scene

matplotlib.use("Agg")
X, Y = np.array([1.0, 0.0]), np.array([0.0, 1.0])


@pytest.fixture
def axes():
    """Axes without pyplot."""
    return Figure(figsize=(8, 6), dpi=100).add_subplot()


class Load(NamedTuple):
    """A load in the plane, in which all of it lies."""

    body: str
    at: np.ndarray
    force: np.ndarray
    moment: float

    @property
    def size(self) -> float:
        return float(np.hypot(*self.force))


def loads_of(mechanism: rx.Mechanism, state: rx.State, multipliers) -> dict[str, Load]:
    """Loads on the bodies i as they are drawn, by the joint's name."""
    found = joint_arrows(scene(mechanism, state), mechanism, state, np.asarray(multipliers, float))
    assert not any(np.any(each.moment[:2]) or each.force[2] or each.at[2] for each in found)
    return {each.name: Load(each.body, each.at[:2], each.force[:2], float(each.moment[2])) for each in found}


def artists(axes, start: str) -> dict:
    """Artists whose group id starts so, by the rest of it."""
    found = [artist for artist in axes.get_children() if (artist.get_gid() or "").startswith(start)]
    return {artist.get_gid().removeprefix(start): artist for artist in found}


def arrow(patch) -> np.ndarray:
    """Tip less tail of a straight arrow."""
    corners = patch.get_xy()
    return corners[3] - (corners[0] + corners[6]) / 2


def texts(axes) -> dict:
    """Boxes of all texts on the axes, in pixels, by what they say."""
    axes.figure.draw_without_rendering()
    return {(text.get_text(), k): text.get_window_extent() for k, text in enumerate(axes.texts)}


def overlapping(axes) -> list:
    return [
        (one[0], other[0])
        for (one, a), (other, b) in itertools.combinations(texts(axes).items(), 2)
        if min(a.x1, b.x1) > max(a.x0, b.x0) and min(a.y1, b.y1) > max(a.y0, b.y0)
    ]


# The registry -------------------------------------------------------------------------------


CROWDED = pytest.param("six four-bars", marks=pytest.mark.slow)


@pytest.mark.parametrize("loads", ["most", *(pytest.param(k, marks=pytest.mark.slow) for k in ("none", "fewer"))])
@pytest.mark.parametrize("name", [*(name for name in CASES if name not in MORE), CROWDED])
def test_registry_draws(name, loads):
    """The mechanism alone, with loads of its joints, and with a self-stress beside them."""
    case = CASES[name]
    given = {} if loads == "none" else {"multipliers": np.linspace(-1.0, 1.0, case.m)}
    if loads == "most" and case.redundancy:
        given["self_stress"] = 0
    axes = Figure(figsize=(9, 6), dpi=100).add_subplot()
    assert draw(case.smooth, case.state, axes=axes, **given) is axes
    assert overlapping(axes) == []
    shown = {part for text in axes.texts for part in text.get_text().split(", ")}
    assert shown >= {*case.smooth.names.bodies, *itertools.chain(*case.smooth.names.joints)}
    window = axes.get_window_extent()
    for box in texts(axes).values():
        assert box.x0 >= window.x0 - 1 and box.x1 <= window.x1 + 1
        assert box.y0 >= window.y0 - 1 and box.y1 <= window.y1 + 1


@pytest.mark.parametrize("phi", [np.pi / 4, 0.2, 2.0])
def test_new_figure_holds_everything(phi):
    from matplotlib import pyplot

    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=phi, rate=1.0)
    axes = draw(mechanism, state, self_stress=0, multipliers=rx.solve(mechanism, state).multipliers)
    assert axes.get_xlabel() == "x (m)" and axes.get_ylabel() == "y (m)"
    lower, upper = np.array([axes.get_xlim(), axes.get_ylim()]).T
    for patch in axes.patches:
        assert np.all(patch.get_xy() > lower) and np.all(patch.get_xy() < upper)
    # Equal scales, as the box was drawn: one metre is as long along x as along y.
    window = axes.get_window_extent()
    assert np.isclose(window.width / (upper - lower)[0], window.height / (upper - lower)[1], rtol=1e-6)
    assert overlapping(axes) == []
    pyplot.close(axes.figure)


def test_names_can_be_left_out(axes):
    case = CASES["three cranks"]
    draw(case.smooth, case.state, axes=axes, names=False)
    assert {text.get_gid() for text in axes.texts} <= {"key"}


def test_tick_labels_of_a_small_mechanism_keep_apart():
    """A rod of 2 mm in metres, upright, so that the axis below it is short."""
    from matplotlib import pyplot

    pins = [rx.Revolute(name, "rod", rx.GROUND, *2 * [(0.0, y)]) for name, y in (("A", 0.0), ("B", 2e-3))]
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 1.0)], pins)
    axes = draw(mechanism, rx.State(np.zeros(3), np.zeros(3)))
    axes.figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in axes.get_xticklabels() if label.get_text()]
    assert len(boxes) > 3
    assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))
    pyplot.close(axes.figure)


def test_many_loops_keep_names_apart(axes):
    mechanism = rx.mechanisms.n_four_bar(16)
    draw(mechanism, mechanism.state(1.0), axes=axes)
    assert overlapping(axes) == []
    assert len(artists(axes, "joint name ")) == 34


def test_subplots_with_a_layout_engine():
    figure = Figure(figsize=(9, 6), dpi=100, layout="constrained")
    for axes, name in zip(figure.subplots(1, 2).ravel(), CASES, strict=False):
        draw(CASES[name].smooth, CASES[name].state, axes=axes, multipliers=np.ones(CASES[name].m))
        assert overlapping(axes) == []


# Directions and lengths ---------------------------------------------------------------------


def crossed() -> tuple[rx.Mechanism, rx.State]:
    """A turned block on a slanted guide of a turned carrier, with a pin, a driver, a rod and a weld."""
    carrier, block, arm, weld = 0.3, 0.3 + 0.2, -1.0, 0.0
    bodies = [rx.Body(name, 1.0, 0.1) for name in ("carrier", "block", "arm", "weld")]
    joints = [
        rx.Revolute("A", "carrier", rx.GROUND, (-0.4, 0.1), (0.0, 0.0)),
        rx.Translational("T", "block", "carrier", (0.1, 0.05), (0.0, 0.2), (0.6, 0.8), angle=0.2),
        rx.Revolute("B", "arm", "block", (-0.3, 0.0), (0.0, 0.0)),
        rx.AngleDriver("M", "arm", "block", rx.Polynomial([0.0])),
        rx.DistanceDriver("D", "arm", rx.GROUND, (0.3, 0.0), (2.0, 0.0), rx.Polynomial([1.0])),
        rx.Fixed("F", "weld", "arm", (0.1, 0.0), (0.1, 0.1)),
    ]
    q = [0.4, 0.1, 0.9, 0.5, 1.2, 0.2, 1.5, 0.6, carrier, block, arm, weld]
    return rx.Mechanism(bodies, joints, units=rx.units.Units()), rx.State(q, np.zeros(12))


def test_loads_by_hand():
    mechanism, state = crossed()
    lam = {
        "A.x": 3.0, "A.y": -4.0, "T.perpendicular": 5.0, "B.x": 1.0, "B.y": 2.0, "D.distance": 7.0,
        "F.x": -2.0, "F.y": 6.0, "T.angle": 0.5, "M.angle": -0.25, "F.angle": 0.75,
    }  # fmt: skip
    assert set(lam) == set(mechanism.rows.labels)
    loads = loads_of(mechanism, state, [lam[row] for row in mechanism.rows.labels])

    def turned(x, y, angle):
        return np.array([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])

    rod = np.array([1.2, 0.2]) + turned(0.3, 0.0, -1.0) - [2.0, 0.0]
    expected = {
        "A": ("carrier", [-3.0, 4.0], 0.0, np.array([0.4, 0.1]) + turned(-0.4, 0.1, 0.3)),
        "T": ("block", 5.0 * turned(0.6, 0.8, 0.3), -0.5, np.array([0.9, 0.5]) + turned(0.1, 0.05, 0.5)),
        "B": ("arm", [-1.0, -2.0], 0.0, np.array([1.2, 0.2]) + turned(-0.3, 0.0, -1.0)),
        "M": ("arm", [0.0, 0.0], 0.25, np.array([1.2, 0.2])),
        # A tension pulls the arm towards the ground's point.
        "D": ("arm", -7.0 * rod / np.hypot(*rod), 0.0, np.array([1.2, 0.2]) + turned(0.3, 0.0, -1.0)),
        "F": ("weld", [2.0, -6.0], -0.75, np.array([1.6, 0.6])),
    }
    for name, (body, force, moment, at) in expected.items():
        load = loads[name]
        assert load.body == body
        np.testing.assert_allclose(load.force, force, atol=1e-12)
        np.testing.assert_allclose(load.moment, moment, atol=1e-12)
        np.testing.assert_allclose(load.at, at, atol=1e-12)


def test_loads_are_the_constraint_force():
    """On a body that is i of all its joints, the drawn loads add up to its part of -Phi_q^T lam."""
    case = CASES["carriage, three guides"]
    mechanism, state = case.smooth, case.state
    lam = np.linspace(1.0, 2.0, case.m)
    loads = loads_of(mechanism, state, lam).values()
    slope = -jnp.array(lam) @ eqx.filter_jit(_jacobian)(mechanism, state)
    force = sum(load.force for load in loads)
    arms = [load.at - np.asarray(state.q[:2]) for load in loads]
    moment = sum(a[0] * f.force[1] - a[1] * f.force[0] + f.moment for a, f in zip(arms, loads, strict=True))
    np.testing.assert_allclose([*force, moment], slope, rtol=1e-10)


def _jacobian(mechanism, state):
    import jax

    return jax.jacfwd(lambda q: mechanism.constraint(q, state.t))(state.q)


def test_arrows_are_to_scale(axes):
    case = CASES["wojtyra2020"]
    lam = rx.solve(case.smooth, case.state).multipliers
    loads = loads_of(case.smooth, case.state, lam)
    draw(case.smooth, case.state, axes=axes, multipliers=lam, scale=2e-3)
    drawn = artists(axes, "load force ")
    drawn = {name: arrow(patch) for name, patch in drawn.items() if not name.startswith("value")}
    assert set(drawn) == {name for name, load in loads.items() if np.any(load.force)}
    for name, vector in drawn.items():
        np.testing.assert_allclose(vector, 2e-3 * loads[name].force, rtol=1e-9)
    assert set(artists(axes, "load moment value ")) == {"K", "L"}


def test_scale_of_its_own_keeps_proportions(axes):
    case = CASES["wojtyra2020"]
    lam = rx.solve(case.smooth, case.state).multipliers
    loads = loads_of(case.smooth, case.state, lam)
    draw(case.smooth, case.state, axes=axes, multipliers=lam, self_stress=0)
    sizes = {name: np.hypot(*arrow(patch)) / loads[name].size for name, patch in _forces(axes, "load").items()}
    np.testing.assert_allclose(list(sizes.values()), next(iter(sizes.values())), rtol=1e-9)
    (key,) = (patch for patch in axes.patches if patch.get_gid() == "load key")
    newtons = float(next(t.get_text() for t in axes.texts if "joint load" in t.get_text()).split()[0])
    np.testing.assert_allclose(np.hypot(*arrow(key)) / newtons, next(iter(sizes.values())), rtol=1e-9)


def test_the_key_tells_that_friction_is_not_drawn_where_there_is_some():
    for rubbing, words in ((None, "joint load on the named body"), (0.02, "joint load on the named body; friction is")):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=rubbing)
        axes = draw(mechanism, mechanism.state(0.6), axes=Figure((9, 6)).add_subplot(), multipliers=np.ones(12))
        (key,) = (text.get_text() for text in axes.texts if "joint load" in text.get_text())
        assert key.partition(": ")[2].removesuffix(" not drawn") == words


def _forces(axes, look: str) -> dict:
    return {name: patch for name, patch in artists(axes, f"{look} force ").items() if not name.startswith("value")}


@pytest.mark.parametrize(("push", "common"), [(1.0, True), (3.0, True), (1e4, False)])
def test_a_large_applied_force_leaves_room_for_the_mechanism(axes, push, common):
    joints = [
        rx.Revolute("A", "a", rx.GROUND, (-0.5, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "a", rx.GROUND, *2 * [(0.5, 0.0)]),
    ]
    pushed = rx.Mechanism([rx.Body("a", 1.0, 0.1)], joints, loads=[rx.AppliedForce("a", (push, 0.0))])
    draw(pushed, rx.State([0.5, 0.0, 0.0], np.zeros(3)), axes=axes, multipliers=[1.0, 0.0, 0.5, 0.0])
    (force,), loads = _forces(axes, "applied").values(), _forces(axes, "load")
    ratio = np.hypot(*arrow(force)) / np.hypot(*arrow(loads["A"]))
    assert (ratio == pytest.approx(push)) == common
    assert np.ptp(axes.get_xlim()) < 2.0


def test_moments_turn_as_they_act(axes):
    mechanism, state = crossed()
    lam = np.array([1.0 if row == "M.angle" else 0.0 for row in mechanism.rows.labels])
    draw(mechanism, state, axes=axes, multipliers=-lam)
    other = draw(mechanism, state, axes=Figure().add_subplot(), multipliers=lam)
    for picture, sense in ((axes, 1.0), (other, -1.0)):
        corners = artists(picture, "load moment ")["M"].get_xy()[:41]
        middle = corners.mean(axis=0)
        area = np.sum(np.diff(corners - middle, axis=0)[:, 1] * (corners - middle)[:-1, 0])
        area -= np.sum(np.diff(corners - middle, axis=0)[:, 0] * (corners - middle)[:-1, 1])
        assert np.sign(area) == sense  # counterclockwise where the moment on body i, -lam, is positive
        assert artists(picture, "load moment value ")["M"].get_text() == "M: 1 N m on arm"


def press() -> tuple[rx.Mechanism, rx.State]:
    """A ram between two guides, whose rails and moments leave little room for values, below a crank and a rod."""
    c, s = 0.1 * np.cos(0.6), 0.1 * np.sin(0.6)
    phi = np.arctan2(-np.sqrt(0.25 - 4 * c**2), -2 * c)
    q = [c, s, c, 2 * s + 0.25 * np.sin(phi), 0.0, 2 * s + 0.5 * np.sin(phi) - 0.1, 0.6, phi, 0.0]
    ground, guide = rx.GROUND, {"normal": (1.0, 0.0), "guide_length": 0.08}
    joints = [
        rx.Revolute("O", "crank", ground, (-0.1, 0.0), (0.0, 0.0)),
        rx.Revolute("P", "rod", "crank", (-0.25, 0.0), (0.1, 0.0)),
        rx.Revolute("Q", "ram", "rod", (0.0, 0.1), (0.25, 0.0)),
        rx.Translational("L", "ram", ground, (-0.3, 0.0), (-0.3, 0.0), **guide),
        rx.Translational("R", "ram", ground, (0.3, 0.0), (0.3, 0.0), **guide),
    ]
    bodies = [rx.Body(name, 1.0, 0.1) for name in ("crank", "rod", "ram")]
    return rx.Mechanism(bodies, joints, gravity=(0.0, -9.81), units=rx.units.SI), rx.State(q, np.zeros(9))


def test_every_load_of_a_press_has_its_value_and_owner():
    from matplotlib import pyplot

    mechanism, state = press()
    assert np.abs(mechanism.constraint(state.q, state.t)).max() < 1e-12
    forces = {"O.x": 6.7, "O.y": -21.4, "P.x": 3.4, "P.y": 25.9, "Q.x": 11.0, "Q.y": 20.5}
    lam = forces | {f"{guide}.{row}": load for guide in "LR" for row, load in (("perpendicular", 5.5), ("angle", 0.55))}
    axes = draw(mechanism, state, multipliers=[lam[row] for row in mechanism.rows.labels])
    values = artists(axes, "load force value ") | {
        f"{k} turn": v for k, v in artists(axes, "load moment value ").items()
    }
    assert {name: text.get_text().split()[0] for name, text in values.items()} == {
        **{name: f"{name}:" for name in "OPQLR"}, "L turn": "L:", "R turn": "R:"
    }  # fmt: skip
    assert values["R"].get_text() == "R: 5.5 N on ram"
    pyplot.close(axes.figure)


def test_self_stress_by_index_and_by_vector():
    case = CASES["doubled four-bar"]
    by_index = draw(case.smooth, case.state, axes=Figure().add_subplot(), self_stress=0)
    stress = rx.analyze(case.smooth, case.state).self_stress[0]
    by_vector = draw(case.smooth, case.state, axes=Figure().add_subplot(), self_stress=stress)
    for name, patch in _forces(by_index, "self-stress").items():
        np.testing.assert_allclose(patch.get_xy(), _forces(by_vector, "self-stress")[name].get_xy())
    assert _forces(by_index, "self-stress")


# Other kinds --------------------------------------------------------------------------------


class Rod(rx.AbstractJoint):
    """A joint that the library does not know."""

    row_kinds: ClassVar = (("length", "force"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=jnp.asarray)
    point_j: Float[Array, "2"] = eqx.field(converter=jnp.asarray)

    def residual(self, i, j, t):
        gap = i.point(self.point_i) - j.point(self.point_j)
        return jnp.stack([(gap @ gap - 0.04) / 2])


class Parallel(rx.AbstractJoint):
    """Another, without points."""

    row_kinds: ClassVar = (("angle", "moment"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)

    def residual(self, i, j, t):
        return jnp.stack([i.phi - j.phi])


def everything() -> tuple[rx.Mechanism, rx.State]:
    """One of each kind of joint and load, not assembled."""
    ground = rx.GROUND
    names = ("wheel", "gear", "arm", "tip", "shuttle", "beam", "float")
    joints = [
        rx.Revolute("A", "wheel", ground, (0.0, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "gear", ground, (0.0, 0.0), (0.6, 0.0)),
        rx.AngleCoupling("G", "wheel", "gear", 2.0),
        rx.AngleCoupling("belt", "gear", "wheel", -0.5),
        rx.AngleDriver("drive", "gear", ground, rx.Polynomial([0.3])),
        rx.Revolute("C", "arm", ground, (-0.4, 0.0), (1.4, 0.0)),
        rx.PinInSlot("S", "tip", "arm", (-0.1, 0.0), (0.0, 0.0), (0.0, 1.0)),
        rx.Translational("T", "tip", ground, (0.2, 0.0), (2.0, 0.3), (0.0, 1.0), guide_length=0.2),
        rx.DistanceDriver("cyl", "arm", ground, (0.4, 0.0), (1.4, 0.9), rx.Polynomial([0.5])),
        rx.Fixed("F", "beam", ground, (-0.3, 0.0), (0.0, 0.8)),
        rx.Fixed("F2", "shuttle", "beam", (-0.1, 0.0), (0.3, 0.0)),
        rx.PinInSlot("P", "float", ground, (0.0, 0.0), (0.8, 1.0), (0.0, 1.0)),
        rx.Revolute("R", ground, "float", (1.0, 1.1), (0.0, 0.1)),
        Rod("rod", "float", "shuttle", (0.1, 0.0), (0.1, 0.0)),
        Parallel("same", "float", "tip"),
    ]
    loads = [
        rx.SpringDamper("beam", "wheel", (0.0, 0.0), (0.1, 0.1), stiffness=10.0),
        rx.SpringDamper("arm", ground, (0.1, 0.0), (1.9, -0.3), stiffness=0.0, damping=3.0),
        rx.TorsionSpring("arm", ground, stiffness=3.0),
        rx.AppliedForce("shuttle", force=(0.0, -20.0), point=(0.1, 0.0)),
        rx.AppliedForce("float", moment=-3.0),
        rx.LoadFunction(
            "gear", lambda i, j, t, p: (rx.Wrench(p * i.pose.r, p), rx.Wrench(-p * i.pose.r, -p)), parameters=2.0
        ),
    ]
    q = [0, 0, 0.6, 0, 1.4 + 0.4 * np.cos(0.4), 0.4 * np.sin(0.4), 1.9, 0.3, 0.7, 0.8, 0.3, 0.8, 1.0, 1.0]
    bodies = [rx.Body(name, 1.0, 0.1) for name in names]
    mechanism = rx.Mechanism(bodies, joints, loads=loads, gravity=(-3.0, -9.0), units=rx.units.Units())
    return mechanism, rx.State([*q, 0.2, 0.1, 0.4, 0.0, 0.0, 0.0, 0.0], np.zeros(21))


def gears() -> tuple[rx.Mechanism, rx.State]:
    """A pinion between a rack and a ring, which are the ground, and a wheel."""
    joints = [
        rx.Revolute("P", "pinion", rx.GROUND, (0.0, 0.0), (0.0, 0.0)),
        rx.Revolute("W", "wheel", rx.GROUND, (0.0, 0.0), (0.6, 0.0)),
        rx.GearPair("pair", "pinion", "wheel", (0.0, 0.0), (0.0, 0.0), (20, 40), 0.02),
        rx.GearPair("ring", "pinion", rx.GROUND, (0.0, 0.0), (0.0, 0.8), (20, -100), 0.02),
        rx.RackAndPinion("rack", "pinion", rx.GROUND, (0.0, 0.0), (-0.3, 0.0), (1.0, 0.0), 20, 0.02, flank=-1),
    ]
    bodies = [rx.Body(name, 1.0, 0.1) for name in ("pinion", "wheel")]
    return rx.Mechanism(bodies, joints), rx.State([0.0, 0.0, 0.6, 0.0, 0.0, 0.0], np.zeros(6))


def test_gears_draw_and_their_loads_are_at_the_pitch_points(axes):
    """At 0.2 from the pinion's axis; the line of action leans by 20 degrees from the tangent there."""
    mechanism, state = gears()
    lam = np.array([0.0 if label[0] in "PW" else 5.0 for label in mechanism.rows.labels])
    draw(mechanism, state, axes=axes, multipliers=lam)
    assert overlapping(axes) == []
    c, s = np.cos(np.pi / 9), np.sin(np.pi / 9)
    places = {"pair": [0.2, 0.0], "ring": [0.0, -0.2], "rack": [-0.2, 0.0]}
    # Away from the wheel and the rack, and into the ring
    forces = {"pair": [-s, c], "ring": [c, s], "rack": [s, c]}
    found = loads_of(mechanism, state, lam)
    assert found.keys() == places.keys()
    for name, each in found.items():
        np.testing.assert_allclose(each.at, places[name], atol=1e-12)
        np.testing.assert_allclose(each.force, 5.0 * np.array(forces[name]), atol=1e-12)
        assert each.moment == 0.0  # the force passes through the pitch point


def test_every_kind_draws(axes):
    mechanism, state = everything()
    lam = np.linspace(-3.0, 5.0, len(mechanism.rows))
    draw(mechanism, state, axes=axes, multipliers=lam)
    assert overlapping(axes) == []
    assert set(artists(axes, "body ")) >= set(mechanism.names.bodies)
    assert {text.get_text() for text in axes.texts} >= {"3 N m", "g = 9.49 m/s²"}
    lower, upper = np.array([axes.get_xlim(), axes.get_ylim()]).T
    for patch in axes.patches:
        assert np.all(patch.get_xy() > lower) and np.all(patch.get_xy() < upper)


def test_own_joint_pulls_along_its_line():
    mechanism, state = everything()
    lam = np.array([2.0 if row == "rod.length" else 0.0 for row in mechanism.rows.labels])
    rod = loads_of(mechanism, state, lam)["rod"]
    gap = np.array([1.1, 1.0]) - np.array([0.8, 0.8])
    np.testing.assert_allclose(rod.force, -2.0 * gap, atol=1e-12)
    np.testing.assert_allclose(rod.moment, 0.0, atol=1e-12)


def test_one_body_alone(axes):
    mechanism = rx.Mechanism([rx.Body("b", 1.0, 1.0)], [rx.Revolute("A", "b", rx.GROUND, (0.0, 0.0), (0.0, 0.0))])
    draw(mechanism, rx.State(np.zeros(3), np.zeros(3)), axes=axes, multipliers=[0.0, 0.0])
    assert np.all(np.isfinite(axes.get_xlim()))


# Errors -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"multipliers": np.ones(3)}, "Argument `multipliers` must have one entry for each of the 12 rows, but has 3."),
        ({"self_stress": [1.0]}, "Argument `self_stress` must have one entry for each of the 12 rows, but has 1."),
        ({"multipliers": np.ones((12, 2))}, "the 12 rows, but has shape"),
        ({"multipliers": np.full(12, np.nan)}, "must be finite, but its entry 'A.x' is nan"),
        ({"self_stress": 1}, "Argument `self_stress` must be an index below 1"),
        ({"scale": 0.0}, "Argument `scale` must be positive"),
    ],
)
def test_errors_name_argument_and_fix(given, message, axes):
    case = CASES["wojtyra2020"]
    with pytest.raises(rx.RedundaxError, match=message):
        draw(case.smooth, case.state, axes=axes, **given)
    assert not axes.patches


def test_wrong_state_and_mechanism(axes):
    case = CASES["wojtyra2020"]
    with pytest.raises(rx.RedundaxError, match="Argument `state` must have q of shape"):
        draw(case.smooth, rx.State(np.zeros(3), np.zeros(3)), axes=axes)
    with pytest.raises(rx.RedundaxError, match="must have finite coordinates"):
        draw(case.smooth, rx.State(np.full(12, np.nan), np.zeros(12)), axes=axes)
    with pytest.raises(rx.RedundaxError, match="must have its names, but is anonymous"):
        draw(case.smooth.anonymous, case.state, axes=axes)


@pytest.mark.slow
def test_float32(float32, axes):
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.8, rate=1.0)
    draw(mechanism, state, axes=axes, multipliers=rx.solve(mechanism, state).multipliers, self_stress=0)
    assert overlapping(axes) == []


def test_what_a_text_covers_is_the_ink_below_it():
    """A black square of 20 points and a grey one as light as a body, on axes of 360 by 216 points."""
    axes = Figure(figsize=(5, 3), dpi=144).add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, 360), ylim=(0, 216))
    axes.set_axis_off()
    pen = Pen(axes, 1.0)
    for x, fill in ((100.0, "black"), (200.0, "#DDDDDD")):
        pen.polygon(x + np.array([[0, 0], [20, 0], [20, 20], [0, 20]]) * 1.0, fill, "none")
    ink = _Ink(pen, np.zeros(2), np.array([360.0, 216.0]))
    found = ink.below(np.array([[110.0, 110.0], [125.0, 105.0], [210.0, 210.0], [50.0, 50.0]]), np.array([20.0, 10.0]))
    np.testing.assert_allclose(found, [200.0 * _BLACK, 50.0 * _BLACK, 0.0, 0.0], rtol=0.05, atol=1e-9)


def test_joints_at_one_place_but_for_rounding_are_named():
    bodies = [rx.Body(name, 1.0, 0.1) for name in ("r1", "r2")]
    pins = [rx.Revolute(f"P{k}", body.name, "ground", (-0.3, -0.1), (0.1, 0.2)) for k, body in enumerate(bodies)]
    mechanism = rx.Mechanism(bodies, pins)
    state = rx.assemble(mechanism, {"r1.x": 0.4, "r1.y": 0.3, "r2.x": 0.4, "r2.y": 0.4, "r2.phi": 0.7})
    axes = draw(mechanism, state, axes=Figure(figsize=(6, 4)).add_subplot())
    assert {"P0, P1", "r1", "r2"} <= {text.get_text() for text in axes.texts}


@pytest.mark.slow
def test_where_joints_are_nearer_than_texts_none_is_named():
    few, many = (rx.mechanisms.n_four_bar(loops) for loops in (30, 300))
    for mechanism, named in ((few, True), (many, False)):
        axes = draw(mechanism, mechanism.state(0.8), axes=Figure(figsize=(9, 3)).add_subplot())
        assert bool(artists(axes, "joint name ")) == named
        assert len(artists(axes, "body crank ")) == len([name for name in mechanism.names.bodies if "crank" in name])
