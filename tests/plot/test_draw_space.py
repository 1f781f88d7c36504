"""Pictures in space: joints where they are, arrows as long and aslant as the loads say, names apart, pages that need
nothing else."""

import functools
import io
import itertools
import json
import re
import sys

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

import redundax as rx
from redundax.plot._draw._camera import Camera, View, best_view
from redundax.plot._draw._scene import scene
from redundax.plot._draw._solids import arrow, ball, box, cone, hull_solids, ring, rod
from redundax.plot._draw._symbols import solids
from redundax.plot._page._pictures import drawing

matplotlib.use("Agg")
pytestmark = pytest.mark.filterwarnings("ignore:Animation was deleted")
space = rx.spatial
HEIGHTS = {"bottom": 0.2, "middle": 1.0, "top": 1.8}
VIEW = (20.0, -50.0)
LEAF = np.array(list(itertools.product((0.0, 1.0), (-0.02, 0.02), (0.0, 2.0))))  # corners of the door


def door(names=tuple(HEIGHTS), **options) -> tuple[rx.Mechanism, rx.State]:
    leaf = space.Body("door", 20.0, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
    hinges = [space.Revolute(name, leaf, "ground", (0.0, 0.0, HEIGHTS[name]), (0.0, 0.0, 1.0)) for name in names]
    mechanism = rx.Mechanism([leaf], hinges, gravity=(0.0, 0.0, -9.81), units=rx.units.SI, **options)
    return mechanism, rx.State(mechanism.reference, np.zeros(6))


def bar(name: str, start, end) -> space.Body:
    start, end = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(end - start))
    x = (end - start) / length
    y = np.cross([0.0, 0.0, 1.0], x)
    axes = np.stack([x, y, np.cross(x, y)], axis=1)
    return space.Body(name, 1.0, (1e-3, 0.1, 0.1), centre=(length / 2, 0, 0), position=start, orientation=axes)


def four_bar() -> tuple[rx.Mechanism, rx.State]:
    places = [(0.0, 0.0, 0.0), (0.2, 0.3, 0.0), (0.9, 0.45, 0.0), (0.8, 0.0, 0.0)]
    bars = [
        bar(name, *ends) for name, ends in zip(("crank", "coupler", "rocker"), itertools.pairwise(places), strict=True)
    ]
    pairs = zip("ABCD", [*bars, bars[2]], ["ground", *bars[:2], "ground"], places, strict=True)
    joints = [space.Revolute(name, i, j, place, (0.0, 0.0, 1.0)) for name, i, j, place in pairs]
    mechanism = rx.Mechanism(bars, joints, gravity=(0.0, -9.81, 0.0), units=rx.units.SI)
    return mechanism, rx.assemble(mechanism, rates={"A.angle": 2.0})


def everything() -> tuple[rx.Mechanism, rx.State]:
    """One body for each kind of joint, in rows."""
    kinds = ("Revolute", "Prismatic", "Cylindrical", "Spherical", "Planar", "Fixed", "PointOnLine", "PointOnPlane")
    kinds = (*kinds, "ParallelAxes", "ConstantVelocity", "Screw", "Universal")
    bodies = [
        space.Body(f"b{k}", 1.0, (0.1, 0.1, 0.1), centre=(0.15, 0, 0.25), position=(0.8 * (k % 4), 0.9 * (k // 4), 0))
        for k in range(len(kinds))
    ]
    joints = []
    for kind, body in zip(kinds, bodies, strict=True):
        options = {"pitch": 0.1} if kind == "Screw" else {}
        along = {} if kind == "Universal" else {"axis": (1.0, 0, 0) if kind == "Prismatic" else (0, 0, 1.0)}
        joints.append(getattr(space, kind)(kind, body, "ground", body.position, **along, **options))
    joints += [
        space.Distance("rod", bodies[0], bodies[1], (0.15, 0.0, 0.25), (0.95, 0.0, 0.25)),
        space.AngleDriver("motor", bodies[2], "ground", (1.6, 0.0, 0.0), angle=0.0),
        space.TravelDriver("piston", bodies[4], "ground", (0.15, 0.9, 0.25), (1.0, 0.0, 0.0), travel=0.0),
        space.Gear(
            "mesh", bodies[8], bodies[9], (0.0, 1.8, 0.0), (0, 0, 1), (0.8, 1.8, 0.0), (0, 0, 1), teeth=(20, 30)
        ),
        OwnKind("own", "b10", "b11"),
    ]
    loads = [
        space.AppliedForce(bodies[5], force=(0.0, 0.0, -30.0), moment=(5.0, 0.0, 0.0), point=(0.95, 0.9, 0.25)),
        space.SpringDamper(bodies[6], bodies[7], (1.75, 0.9, 0.25), (2.55, 0.9, 0.25), stiffness=10.0),
        space.SpringDamper(bodies[11], "ground", (2.55, 1.8, 0.25), (2.9, 1.8, 0.25), stiffness=0.0, damping=2.0),
        space.TorsionSpring(bodies[0], "ground", axis=(0.0, 0.0, 1.0), stiffness=3.0),
        space.Bushing(bodies[3], "ground", point=(2.4, 0.0, 0.0), translation=100.0),
    ]
    mechanism = rx.Mechanism(bodies, joints, loads=loads)
    return mechanism, rx.State(mechanism.reference, np.zeros(6 * len(bodies)))


class OwnKind(space.AbstractJoint):
    """A joint that the library does not know, without points."""

    row_kinds = (("z", "force"),)
    name: str
    i: str
    j: str

    def residual(self, i, j, t):
        return (i.r - j.r)[2:]


def turned(angle: float) -> np.ndarray:
    """Corners of the door at an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return LEAF @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def seen(p, view=VIEW) -> np.ndarray:
    """Where a point is on the picture: the camera turns by the azimuth about z and is lifted by the elevation."""
    e, a = np.radians(view)
    x, y, z = np.moveaxis(np.asarray(p, float), -1, 0)
    forward = x * np.cos(a) + y * np.sin(a)
    return np.stack([y * np.cos(a) - x * np.sin(a), z * np.cos(e) - forward * np.sin(e)], axis=-1)


def artists(axes, start: str) -> dict:
    found = [artist for artist in axes.get_children() if (artist.get_gid() or "").startswith(start)]
    return {artist.get_gid().removeprefix(start): artist for artist in found}


def ends(patch) -> tuple[np.ndarray, np.ndarray]:
    """Tail and tip of a straight arrow."""
    corners = patch.get_xy()
    return (corners[0] + corners[6]) / 2, corners[3]


def boxes(axes) -> list:
    axes.figure.draw_without_rendering()
    return [(text.get_text(), text.get_window_extent()) for text in axes.texts if text.get_text()]


def overlapping(axes) -> list:
    return [
        (one, other)
        for (one, a), (other, b) in itertools.combinations(boxes(axes), 2)
        if min(a.x1, b.x1) > max(a.x0, b.x0) and min(a.y1, b.y1) > max(a.y0, b.y0)
    ]


def vector(solution, what: str) -> np.ndarray:
    return np.array([float(solution[what.format(axis)]) for axis in "xyz"])


@pytest.fixture(scope="module")
def loads():
    """The door as drawn from a given view to a given scale, and the solution."""
    mechanism, state = door()
    solution = rx.solve(mechanism, state)
    axes = Figure(figsize=(8, 8), dpi=100).add_subplot()
    rx.plot.draw(mechanism, state, axes=axes, multipliers=solution.multipliers, scale=4e-3, view=VIEW)
    return axes, solution


# Where things are ----------------------------------------------------------------------------


def test_forces_start_at_the_joints_and_are_projected_to_scale(loads):
    axes, solution = loads
    found = artists(axes, "load force ")
    for name, height in HEIGHTS.items():
        tail, tip = ends(found[name])
        np.testing.assert_allclose(tail, seen([0.0, 0.0, height]), atol=1e-9)
        np.testing.assert_allclose(
            tip - tail, 4e-3 * seen(vector(solution, name + " force {} on door")), rtol=1e-6, atol=1e-9
        )


def test_moments_are_along_their_axes_by_the_right_hand_rule(loads):
    axes, solution = loads
    found, sizes = artists(axes, "load moment "), {}
    for name in HEIGHTS:
        moment = vector(solution, name + " moment {} on door")
        line = np.diff(found[name].get_xydata(), axis=0)[0]
        across = seen(moment)
        assert line @ across == pytest.approx(np.hypot(*line) * np.hypot(*across), rel=1e-9)
        sizes[name] = np.hypot(*line) / np.hypot(*across)
    assert max(sizes.values()) == pytest.approx(min(sizes.values()), rel=1e-9)


def test_values_are_the_sizes_in_space(loads):
    axes, solution = loads
    said = {text for text, _ in boxes(axes)}
    for name in HEIGHTS:
        force, moment = (
            np.linalg.norm(vector(solution, f"{name} {what} {{}} on door")) for what in ("force", "moment")
        )
        assert f"{name}: {force:.3g} N on door" in said
        assert f"{name}: {moment:.3g} N m on door" in said


def test_axes_are_equal_and_their_arrows_to_scale(loads):
    axes, _ = loads
    window = axes.get_window_extent()
    assert window.width / np.ptp(axes.get_xlim()) == pytest.approx(window.height / np.ptp(axes.get_ylim()), rel=1e-6)
    length = float(re.fullmatch(r"axes: (\S+) m", artists(axes, "axis ")["length"].get_text())[1])
    for name, direction in zip("xyz", np.eye(3), strict=True):
        arrows = [part for part in axes.patches if part.get_gid() == f"axis {name}"]
        tail, tip = ends(arrows[0])
        np.testing.assert_allclose(tip - tail, seen(length * direction), atol=1e-12)


def test_a_load_towards_the_viewer_is_a_ring():
    """A body pulled along x, seen along x."""
    leaf = space.Body("leaf", 1.0, (0.1, 0.1, 0.1), centre=(0.0, 0.5, 0.0))
    mechanism = rx.Mechanism([leaf], [space.Spherical("ball", leaf, "ground", (0.0, 0.0, 0.0))])
    state = rx.State(mechanism.reference, np.zeros(6))
    rows = {row: k for k, row in enumerate(mechanism.rows.labels)}
    for sense, lines in ((1.0, 0), (-1.0, 2)):
        lam = np.zeros(3)
        lam[rows["ball.radial_1"]], lam[rows["ball.radial_2"]], lam[rows["ball.axial"]] = _pull(mechanism, state, sense)
        axes = rx.plot.draw(mechanism, state, axes=Figure().add_subplot(), multipliers=lam, view=(0.0, 0.0))
        shape = artists(axes, "load force ")["ball"]
        assert len(shape.get_xy()) > 40  # a circle
        centre = shape.get_xy()[:-1].mean(axis=0)
        np.testing.assert_allclose(centre, [0.0, 0.0], atol=1e-6)
        crosses = [line for line in axes.lines if np.allclose(line.get_xydata().mean(axis=0), centre, atol=1e-9)]
        assert len(crosses) == lines


def _pull(mechanism, state, sense: float) -> np.ndarray:
    """Multipliers of the ball joint for which it pulls the body along x."""
    by_row = -np.asarray(mechanism.jacobian(state.q, state.t))[:, :3].T
    return np.linalg.solve(by_row, [sense, 0.0, 0.0])


def test_applied_loads_are_where_they_act():
    """One at its point, one by a function, about the centre of mass of its body."""
    leaf = space.Body("leaf", 1.0, (0.1, 0.1, 0.1), centre=(0.0, 0.5, 0.0))
    force, moment = np.array([3.0, 4.0, 0.0]), np.array([0.0, 0.0, 2.0])
    here = space.AppliedForce(leaf, force=force, point=(0.2, 0.7, 0.1))
    pull = space.Wrench(jnp.array(force), jnp.array(np.cross([0.0, 0.5, 0.0], force) + moment))
    there = space.LoadFunction("leaf", lambda i, j, t, p: (p, space.Wrench(0 * p.force, 0 * p.force)), parameters=pull)
    mechanism = rx.Mechanism(
        [leaf], [space.Spherical("ball", leaf, "ground", (0, 0, 0))], loads=[here, there], units=rx.units.SI
    )
    state = rx.State(mechanism.reference, np.zeros(6))
    lam = _pull(mechanism, state, 5.0)
    axes = rx.plot.draw(mechanism, state, axes=Figure().add_subplot(), multipliers=lam, view=VIEW, scale=0.01)
    found = artists(axes, "applied ")
    for name, at in (("force 0", [0.2, 0.7, 0.1]), ("force 1", [0.0, 0.5, 0.0])):
        tail, tip = ends(found[name])
        np.testing.assert_allclose(tail, seen(at), atol=1e-6)
        np.testing.assert_allclose(tip - tail, 0.01 * seen(force), atol=1e-9)
    assert "moment 1" in found and "moment 0" not in found
    assert {"5 N", "2 N m"} <= {text for text, _ in boxes(axes)}


def ready(name: str):
    """A ready mechanism at its reference pose."""
    mechanism = getattr(rx.mechanisms, name)()
    return mechanism, rx.State(mechanism.reference, np.zeros(len(mechanism.coordinates)))


READY = [functools.partial(ready, name) for name in ("bricard", "sarrus", "double_cardan")]


@pytest.mark.slow
@pytest.mark.parametrize("build", [door, four_bar, everything, *READY])
def test_names_stay_apart_and_inside(build):
    mechanism, state = build()
    lam = np.linspace(-1.0, 1.0, len(mechanism.rows))
    for given in ({}, {"multipliers": lam}):
        axes = rx.plot.draw(mechanism, state, axes=Figure(figsize=(9, 7), dpi=100).add_subplot(), **given)
        assert overlapping(axes) == []
        window = axes.get_window_extent()
        for _, box_ in boxes(axes):
            assert box_.x0 >= window.x0 - 1 and box_.x1 <= window.x1 + 1
            assert box_.y0 >= window.y0 - 1 and box_.y1 <= window.y1 + 1
        shown = {part for text, _ in boxes(axes) for part in text.split(", ")}
        assert shown >= {*mechanism.names.bodies, *itertools.chain(*mechanism.names.joints)}


def test_new_figure_holds_everything():
    from matplotlib import pyplot

    mechanism, state = four_bar()
    axes = rx.plot.draw(mechanism, state, self_stress=0)
    lower, upper = np.array([axes.get_xlim(), axes.get_ylim()]).T
    (drawn,) = axes.collections
    every = np.concatenate([path.vertices for path in drawn.get_paths()])
    assert np.all(every > lower) and np.all(every < upper)
    assert overlapping(axes) == []
    pyplot.close(axes.figure)


# What is drawn -------------------------------------------------------------------------------


def scene_of(mechanism, state, **options):
    return scene(mechanism, state, Camera(View(*VIEW), **options))


def test_symbols_sit_at_the_joints_along_their_axes():
    mechanism, _ = four_bar()
    q = np.asarray(rx.assemble(mechanism, positions={"A.angle": 0.4}).q)
    moved = rx.State(q, np.zeros(18))
    made = solids(scene_of(mechanism, moved), 1e-3)
    elbow = [solid for solid in made if solid.name == "joint B"]
    crank = np.hypot(0.2, 0.3)
    start = np.arctan2(0.3, 0.2) + 0.4
    place = crank * np.array([np.cos(start), np.sin(start), 0.0])
    for solid in elbow:
        np.testing.assert_allclose(solid.corners.mean(axis=0), place, atol=1e-8)
        long = np.ptp(solid.corners, axis=0)
        assert long[2] > 1.5 * max(long[:2])


def test_joints_have_the_colour_of_the_verdict():
    """Of two doors in one mechanism one hangs on one hinge, whose load is unique, the other on two."""
    one, other = (
        space.Body(name, 20.0, (6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0), position=(x, 0.0, 0.0))
        for name, x in (("one", 0.0), ("other", 2.0))
    )
    places = {"single": (one, 0.0, 1.0), "low": (other, 2.0, 0.5), "high": (other, 2.0, 1.5)}
    hinges = [space.Revolute(name, body, "ground", (x, 0, z), (0, 0, 1)) for name, (body, x, z) in places.items()]
    mechanism = rx.Mechanism([one, other], hinges, gravity=(0.0, 0.0, -9.81))
    state = rx.State(mechanism.reference, np.zeros(12))
    report = rx.analyze(mechanism, state)
    axes = rx.plot.draw(mechanism, state, axes=Figure().add_subplot(), report=report)
    names = {text: part.get_color() for text, part in ((part.get_text(), part) for part in axes.texts)}
    assert {"single", "low?", "high?"} <= names.keys()
    assert names["low?"] == names["high?"] != names["single"]
    made = solids(scene_of(mechanism, state, not_unique=frozenset({"low", "high"})), 1e-3)
    hue = {name: next(to_rgb(s.colour) for s in made if s.name == f"joint {name}") for name in places}
    assert hue["low"] == hue["high"]
    assert hue["low"][0] > hue["low"][1] and hue["single"][1] > hue["single"][0]  # red and green
    case = rx.mechanisms.parallelogram(3)
    flat = case.state(0.5)
    drawn = rx.plot.draw(case, flat, axes=Figure().add_subplot(), report=["A1"])
    assert {"A1?", "A2"} <= {text.get_text() for text in drawn.texts}
    shown = {tuple(fill[:3]) for part in drawn.collections for fill in part.get_facecolor()}
    assert {hue["low"], hue["single"]} <= shown


def test_shapes_are_drawn_in_the_frame_of_the_body():
    mechanism, _ = door()
    state = rx.assemble(mechanism, positions={"top.angle": 0.5})
    made = solids(scene_of(mechanism, state, shapes={"door": LEAF}), 1e-3)
    (hull,) = (solid for solid in made if solid.name == "body door" and solid.opacity < 1)
    np.testing.assert_allclose(hull.corners, turned(0.5), atol=1e-8)
    assert sum(solid.name == "body door" for solid in made) == 1 + 12  # and the edges of a box


@pytest.mark.parametrize(
    "made",
    [
        box(np.ones(3), np.eye(3), (1.0, 2.0, 3.0), "#000000"),
        rod(np.zeros(3), np.array([0.3, 0.4, 2.0]), 0.1, "#000000"),
        cone(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.4, 0.1, "#000000"),
        ball(np.ones(3), 0.5, "#000000"),
        ball(np.ones(3), 0.5, "#000000", steps=2),
        hull_solids(np.array(list(itertools.product((0.0, 1.0), repeat=3))), 0.01, "#000000", "#000000", "")[0],
    ],
)
def test_faces_of_solids_close(made):
    """The areas of a closed surface, as vectors along the outward normals, add up to nothing, and hold a volume."""
    area, volume = np.zeros(3), 0.0
    for face, normal in zip(made.faces, made.normals(), strict=True):
        corners = made.corners[list(face)]
        area += normal * _area(corners)
        volume += _area(corners) * (normal @ corners[0]) / 3
    np.testing.assert_allclose(area, 0.0, atol=1e-12)
    assert volume > 1e-3
    fans = made.corners[made.triangles()]
    total = np.linalg.norm(np.cross(fans[:, 1] - fans[:, 0], fans[:, 2] - fans[:, 0]), axis=1).sum() / 2
    assert total == pytest.approx(sum(_area(made.corners[list(face)]) for face in made.faces), rel=1e-12)


def _area(corners: np.ndarray) -> float:
    """Of a flat convex polygon."""
    sides = corners[1:] - corners[0]
    return float(np.linalg.norm(np.cross(sides[:-1], sides[1:]), axis=1).sum() / 2)


def test_arrows_end_at_their_tips():
    tail, tip = np.array([0.1, 0.2, 0.3]), np.array([0.4, -0.6, 1.5])
    along = (tip - tail) / np.linalg.norm(tip - tail)
    for heads in (1, 2):
        reach = (
            np.concatenate([solid.corners for solid in arrow(tail, tip, 0.05, "#000000", heads=heads)]) - tail
        ) @ along
        assert reach.max() == pytest.approx(np.linalg.norm(tip - tail)) and reach.min() == pytest.approx(0.0, abs=1e-12)
    assert len(ring(tail, along, 0.3, 0.01, "#000000")) == 36


@pytest.mark.parametrize("teeth", [(20, 30), (20, -80)])
def test_pitch_circles_touch(teeth):
    """On the line of centres, between them where the teeth are external, and with radii as the numbers of teeth."""
    bodies = [space.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in ("a", "b")]
    gear = space.Gear("mesh", *bodies, (0, 0, 0), (0, 0, 1), (0.3, 0.4, 0.1), (0, 0, 1), teeth=teeth)
    mechanism = rx.Mechanism(bodies, [gear])
    (joint,) = scene_of(mechanism, rx.State(mechanism.reference, np.zeros(12))).joints
    (p, _, r, _), (q, _, other, _) = joint.mesh.circles
    assert r / other == pytest.approx(abs(teeth[0] / teeth[1]))
    assert np.linalg.norm(p - q) == pytest.approx(r + other if teeth[1] > 0 else other - r)
    np.testing.assert_allclose(q, [0.3, 0.4, 0.0], atol=1e-12)


def test_bevel_wheels_meet_at_one_point():
    bodies = [space.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in ("a", "b")]
    gear = space.Gear("mesh", *bodies, (0, 0, -0.3), (0, 0, 1), (-0.2, 0, 0), (1, 0, 0), teeth=(40, 60))
    mechanism = rx.Mechanism(bodies, [gear])
    (joint,) = scene_of(mechanism, rx.State(mechanism.reference, np.zeros(12))).joints
    (p, _, r, _), (q, _, other, _) = joint.mesh.circles
    # Axes that are square to each other: each wheel reaches as far from its axis as the other is from the apex.
    np.testing.assert_allclose([*p, *q], [0, 0, -0.3, -0.2, 0, 0], atol=1e-12)
    assert r == pytest.approx(0.3 * 40 / 60) and other == pytest.approx(0.2 * 60 / 40)
    points = scene_of(mechanism, rx.State(mechanism.reference, np.zeros(12))).space_points  # that a picture holds
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [[-0.2, -0.3, -0.3], [0.2, 0.3, 0.3]])


# Views ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("vertical", [0, 1, 2])
def test_views_are_right_handed_and_upright(vertical):
    view = View(25.0, 40.0, vertical)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1.0)
    up = view.flat(np.eye(3)[vertical])
    np.testing.assert_allclose(up, [0.0, np.cos(np.radians(25.0))], atol=1e-12)
    if vertical == 2:
        points = np.random.default_rng(3).normal(size=(5, 3))
        np.testing.assert_allclose(view.flat(points), seen(points, (25.0, 40.0)), atol=1e-12)


@pytest.mark.parametrize("normal", np.eye(3))
def test_the_view_chosen_is_not_along_a_plane_of_joints(normal):
    rng = np.random.default_rng(7)
    points = rng.normal(size=(6, 3))
    points -= np.outer(points @ normal, normal)
    view = best_view([points], np.array([0.0, 0.0, -9.81]))
    sizes = np.linalg.svd(view.flat(points - points.mean(axis=0)), compute_uv=False)
    assert abs(view.axes[2] @ normal) > 0.3
    assert sizes[1] > 0.15 * sizes[0]


# Motions and pages ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def motion():
    mechanism, _ = door(("top",))
    turning = rx.assemble(mechanism, rates={"top.angle": 1.0})
    return mechanism, rx.simulate(mechanism, turning, 0.4, ts=np.linspace(0.0, 0.4, 3))


@pytest.mark.slow
def test_frames_have_one_view_and_keep_what_stands(motion):
    film = rx.plot.animate(*motion)
    limits, fixed = set(), []
    for number in range(3):
        film._func(number)
        (axes,) = film._fig.axes
        limits.add((*axes.get_xlim(), *axes.get_ylim()))
        fixed.append([part.get_xy() for part in axes.patches if str(part.get_gid()).startswith("axis")])
        assert f"t = {0.2 * number:.3f} s" in {text.get_text() for text in axes.texts}
        assert overlapping(axes) == []
        assert len(axes.collections) == 1
    assert len(limits) == 1
    for one in fixed[1:]:
        np.testing.assert_array_equal(np.concatenate(one), np.concatenate(fixed[0]))


@pytest.mark.slow
def test_a_page_needs_nothing_else_and_has_a_frame_for_each_time(motion, tmp_path):
    mechanism, trajectory = motion
    figure = rx.plot.html(mechanism, trajectory, tmp_path / "door.html", shapes={"door": LEAF})
    assert [frame.name for frame in figure.frames] == ["0.000", "0.200", "0.400"]
    assert [step.label for step in figure.layout.sliders[0].steps] == ["0.000", "0.200", "0.400"]
    page = (tmp_path / "door.html").read_text(encoding="utf-8")
    assert re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)\s*=", page) == []
    data, layout = arguments_of(page, "Plotly.newPlot(", 2)
    assert {trace.get("name") for trace in data} == {trace.name for trace in figure.data} and "scene" in layout
    (frames,) = arguments_of(page, "Plotly.addFrames(", 1)
    assert [(frame["name"], len(frame["data"])) for frame in frames] == [(f.name, len(f.data)) for f in figure.frames]
    for number, frame in enumerate(figure.frames):
        plate = next(trace for trace in frame.data if trace.name == "body door" and trace.opacity < 1)
        found = np.stack([plate.x, plate.y, plate.z], axis=1)
        np.testing.assert_allclose(found, turned(float(trajectory["top.angle"][number])), atol=1e-6)


def arguments_of(page: str, call: str, count: int) -> list:
    """Arguments of a call in the script of a page after the first, each by a strict parser of JSON."""
    at, found = page.index(",", page.rindex(call)), []  # the first is the name of the place on the page
    for _ in range(count):
        at = re.compile(r"[\s,]*").match(page, at).end()
        value, at = json.JSONDecoder(parse_constant=pytest.fail).raw_decode(page, at)
        found.append(value)
    return found


def test_arrows_of_a_page_are_to_scale():
    mechanism, state = door()
    solution = rx.solve(mechanism, state)
    figure = rx.plot.html(mechanism, state, multipliers=solution.multipliers, scale=4e-3, view=(25.0, -40.0))
    assert figure.frames == ()
    mesh = next(trace for trace in figure.data if trace.name == "load")
    corners = np.stack([mesh.x, mesh.y, mesh.z], axis=1)
    for name, height in HEIGHTS.items():
        force = vector(solution, name + " force {} on door")
        said = f"{np.linalg.norm(force):.3g} N {name} on door"
        own = corners[[text == said for text in mesh.hovertext]] - [0.0, 0.0, height]
        along = force / np.linalg.norm(force)
        assert (own @ along).max() == pytest.approx(4e-3 * np.linalg.norm(force), rel=1e-5)
    scene = figure.layout.scene
    sides = np.array([np.ptp(scene[f"{axis}axis"].range) / scene.aspectratio[axis] for axis in "xyz"])
    np.testing.assert_allclose(sides, sides[0])  # one scale for all axes
    e, a = np.radians([25.0, -40.0])  # the door stands 2 m high, and fills most of a page
    assert 1.2 < scene.aspectratio.z * np.cos(e) < 2.0
    assert figure.layout.scene.xaxis.title.text == "x (m)"
    assert all(scene[f"{axis}axis"].showbackground is False for axis in "xyz")  # walls hide the ends of names
    names, every = (trace for trace in figure.data if getattr(trace, "mode", None) == "text")
    assert names.visible and not every.visible and set(names.text) <= set(every.text)
    sides = dict(zip(names.text, names.textposition, strict=True))
    assert {sides[name] for name in HEIGHTS} == {"top right"} and sides["<i>door</i>"] == "bottom left"
    eye, (e, a) = figure.layout.scene.camera.eye, np.radians([25.0, -40.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    np.testing.assert_allclose([eye.x, eye.y, eye.z] / np.linalg.norm([eye.x, eye.y, eye.z]), towards, atol=1e-12)


def test_reports_have_a_picture():
    mechanism, state = door(("bottom", "top"))
    (picture,) = drawing(mechanism, state, "Loads", multipliers=np.ones(10))
    with Image.open(io.BytesIO(picture.png)) as shown:
        assert shown.format == "PNG" and min(shown.size) > 300
        assert len(np.unique(np.asarray(shown.convert("RGB")).reshape(-1, 3), axis=0)) > 50
    assert "question mark" not in picture.caption
    (judged,) = drawing(mechanism, state, "Loads", rx.analyze(mechanism, state), multipliers=np.ones(10))
    assert "question mark" in judged.caption and judged.png != picture.png


# Errors --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"view": (1.0, 2.0, 3.0)}, "Argument `view` must be elevation and azimuth"),
        ({"shapes": {"gate": np.zeros((3, 3))}}, "for 'gate' there is no such body among door"),
        ({"shapes": {"door": np.zeros((3, 2))}}, "for 'door' has shape"),
        ({"multipliers": np.ones(3)}, "must have one entry for each of the 15 rows, but has 3"),
        ({"self_stress": 10}, "must be an index below 10"),
    ],
)
def test_errors_name_argument_and_fix(given, message):
    mechanism, state = door()
    with pytest.raises(rx.RedundaxError, match=message):
        rx.plot.draw(mechanism, state, axes=Figure().add_subplot(), **given)


def test_what_is_for_the_other_kind_is_refused(tmp_path):
    flat, spatial = rx.mechanisms.parallelogram(3), door()
    with pytest.raises(rx.RedundaxError, match="Argument `view` must be left out for a planar mechanism"):
        rx.plot.draw(flat, flat.state(0.5), view=(20.0, 30.0))
    with pytest.raises(rx.RedundaxError, match=r"must be of `rx.spatial` bodies, but is planar"):
        rx.plot.html(flat, flat.state(0.5))
    with pytest.raises(rx.RedundaxError, match=r"Argument `path` must end in .html"):
        rx.plot.html(*spatial, tmp_path / "door.gif")
    with pytest.raises(rx.RedundaxError, match="Argument `state` must have q of shape"):
        rx.plot.draw(spatial[0], rx.State(np.zeros(6), np.zeros(6)))


def test_the_extra_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    with pytest.raises(ImportError, match=r'needs the package plotly: pip install "redundax\[html\]"'):
        rx.plot.html(*door())
