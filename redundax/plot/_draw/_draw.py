"""A mechanism at a state as a picture, with self-stress and joint loads as arrows to scale

load of a joint = its reaction (`_joint_coordinates`),   length of an arrow = scale * |force|
"""

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._bodies._plane import Plane
from ..._solve._solution import Solution
from ..._system._state import State
from ..._tools._module import Numbers
from ._arguments import check, check_state, idle_contacts, load_groups
from ._arrows import LOADS, LONGEST, Arrows, applied_arrows, draw_arrows
from ._camera import PLANE, Camera, best_view, checked_shapes, not_unique, refuse_in_plane
from ._key import draw_key, key_height
from ._labels import Label, around, place
from ._paint import dress, paint
from ._pen import Pen
from ._scene import Scene, scene
from ._stands import stand_sides
from ._style import INK, LOAD, body_colour, dark

if TYPE_CHECKING:
    import matplotlib.axes
    from matplotlib.figure import Figure

_MARGINS = {True: (54.0, 40.0, 14.0, 10.0), False: (8.0, 8.0, 8.0, 8.0)}  # points of new axes, with ticks in the plane
_PIN, _GUIDE = 6.7, 11.0  # points from a joint to its name, clear of its symbol
_PAD = np.array([34.0, 34.0])  # points between the mechanism and the edge of the axes
_WIDER = np.array([26.0, 0.0])  # points more for values of loads
_ROOM = np.array([330.0, 280.0])  # points, of the mechanism in a new figure unless it is dense
_SPACING = 40.0  # points between joints, below which symbols are drawn smaller
_FEW, _LEGIBLE = 100, 4.0  # joints, and points between more of them below which nothing is named
_COMPARABLE = 4.0  # applied forces over joint loads, above which they have no common scale
_SIZES = (380.0, 200.0), (930.0, 620.0)  # points, least and largest width and height of a new figure


def draw(
    mechanism: Mechanism,
    state: State,
    *,
    axes: "matplotlib.axes.Axes | None" = None,
    self_stress: int | ArrayLike | Sequence[float] | None = None,
    multipliers: ArrayLike | Sequence[float] | Solution | None = None,
    report: Report | Collection[str] | None = None,
    names: bool = True,
    scale: float | None = None,
    view: Sequence[float] | None = None,
    shapes: Mapping[str, Numbers] | None = None,
) -> "matplotlib.axes.Axes":
    """Draw a mechanism at a state, and joint loads as arrows. Needs matplotlib.

    Bodies are bars, plates or hulls spanned by their joints and centre of mass, or the `shapes` given. Joints are drawn
    by what they lock: circles, in space cylinders, are revolute joints; blocks on rails translational ones, a ball
    there is a pin in a slot, one on a plate is one-sided; dark squares or cubes are fixed joints, balls spherical ones,
    crosses universal ones, cylinders on a shaft cylindrical ones. M is a driven angle, a cylinder on a rod a driven
    distance, octahedra are joints of other kinds; hatching, or grey pyramids, is the ground. Gears in mesh are their
    pitch circles with the line of action; couplings of angles look like gears, or belts where both bodies turn in the
    same sense.

    The arrow of a joint is what the joint does to its **body i**, or to body j where i is the ground, as in
    `solution["top force x on door"]`: it starts at the joint's point there, that of teeth at the pitch point. Moments
    are about that point, with their values: arrows with two heads by the right-hand rule, to a scale of their own, and
    circular ones where they turn about the line of sight, as in the plane. Forces along it are rings with a dot, or
    with a cross where they point away. Loads below 1e-4 of the largest are left out, and so are values and, in very
    dense pictures, names that would cover other ones; where more than a hundred joints are nearer than 4 points of
    print to each other, all names and values are. Applied forces are black, to the scale of `multipliers` where these
    are given and not four times smaller.

    A plane is seen along z. A picture in space is a parallel projection: lengths along an axis are to scale, and arrows
    in a corner say by how much.

    ??? example

        ```python
        axes = rx.plot.draw(mechanism, state, multipliers=rx.solve(mechanism, state).multipliers)
        axes.figure.savefig("loads.png")
        ```

    **Arguments:**

    - `mechanism`, `state`: concrete values; labels have the units that the mechanism states.
    - `axes`: matplotlib axes to draw on, whose limits are set; those of a new pyplot figure if not given.
    - `self_stress`: a self-stress state as open arrows: its values (m,), or its index in
      `analyze(mechanism, state).self_stress`.
    - `multipliers`: lam, shape (m,), as filled arrows; or a solution, of which one-sided contacts that do not carry
      are told beside their names: "f1 lifts", "f2 touches", "f3 open by 0.001 m".
    - `report`: of `rx.analyze`, or the names of joints whose load is not unique: these are red, with a question mark,
      and others green.
    - `names`: whether joints and bodies are named.
    - `scale`: length of the arrows on the drawing for a force of 1; by default the longest arrow of either
      kind has a fixed length on paper. A key states it.
    - `view`: in space, elevation and azimuth from which it is seen, degrees; by default such that joints do not hide
      each other. The vertical is the axis nearest to gravity, z without it.
    - `shapes`: in space, the corners (corners, 3) of bodies by name, in their local frames; their convex hull is drawn.

    **Returns:** the axes. Artists have telling group ids: "body 2", "load force A", "self-stress moment K", ...
    """
    check(mechanism, scale)
    check_state(mechanism, state)
    shown = scene(mechanism, state, camera_of(mechanism, [state], view, shapes, report))
    loads = multipliers.multipliers if isinstance(multipliers, Solution) else multipliers
    groups = load_groups(shown, mechanism, state, self_stress, loads)
    arrows = [*groups, applied_arrows(shown)]
    if axes is None:
        from matplotlib import pyplot

        axes = new_axes(pyplot.figure, shown.points, shown, groups)
    point, head = framed(axes, shown.points, shown, arrows, scale)
    small = smaller(shown.spacing, point)
    pen = Pen(axes, point * small, small)
    ceiling = axes.get_ylim()[1] - head * point
    dress(pen, shown, shown.points, ceiling)
    outlines, values = paint(pen, shown), draw_arrows(pen, shown, arrows)
    draw_key(Pen(axes, point), groups, shown)
    if not legible(shown, point):
        return axes
    said = idle_contacts(mechanism, state, multipliers) if isinstance(multipliers, Solution) else {}
    named = [*joint_labels(pen, shown, said), *_body_labels(pen, shown, outlines)] if names else []
    place(pen, [*named, *values], ceiling)
    return axes


def camera_of(
    mechanism: Mechanism,
    states: Sequence[State],
    view: Sequence[float] | None = None,
    shapes: Mapping[str, Numbers] | None = None,
    report: Report | Collection[str] | None = None,
) -> Camera:
    """The view on a mechanism at these states; in space all have the same, and the same stands, that suit the first."""
    if isinstance(mechanism.frame, Plane):
        refuse_in_plane(view, shapes)
        return Camera(PLANE, not_unique=not_unique(report))
    shares, places = (0.0, 0.35, 0.65), []
    for state in states[:: len(states) // 6 + 1]:
        found = scene(mechanism, state)
        within = [span.mean(axis=0) + share * (span - span.mean(axis=0)) for span in found.spans for share in shares]
        places.append(np.concatenate([[joint.place for joint in found.joints], *within]))
    seen = best_view(places, np.asarray(mechanism.gravity, float), view)
    camera = Camera(seen, checked_shapes(mechanism, shapes or {}), not_unique(report))
    return dataclasses.replace(camera, sides=stand_sides(scene(mechanism, states[0], camera)))


def new_axes(
    make: Callable[..., "Figure"], points: np.ndarray, stage: Scene, groups: list[Arrows], strip: float = 0.0
) -> "matplotlib.axes.Axes":
    """Axes of a figure that is made in a size that suits the points, with a strip of some points of print for more."""
    left, lower, right, upper = _MARGINS[stage.is_flat]
    spread = np.ptp(points, axis=0)
    point = min(max(*(spread / _ROOM)), stage.spacing / (1.4 * _SPACING)) or 1.0
    reach = 1.2 * LONGEST if groups else 0.0
    head = key_height(groups, stage, np.inf) + strip
    wanted = spread / point + 2 * _pad(groups) + reach + [left + right, head + lower + upper]
    width, height = np.clip(wanted, *_SIZES)
    figure = make(figsize=(width / 72.0, height / 72.0))
    return figure.add_axes((left / width, lower / height, 1 - (left + right) / width, 1 - (lower + upper) / height))


def framed(
    axes: "matplotlib.axes.Axes",
    points: np.ndarray,
    stage: Scene,
    groups: list[Arrows],
    scale: float | None,
    strip: float = 0.0,
) -> tuple[float, float]:
    """Axes set so that points and arrows fit: size of a point of print in data units, points of the key above."""
    if stage.is_flat:
        unit = stage.units.of("linear")
        axes.set(**{f"{x}label": f"{x} ({unit})" if unit else x for x in "xy"})
        axes.ticklabel_format(scilimits=(-3, 5))
        axes.spines[["top", "right"]].set_visible(False)
    else:
        axes.set_axis_off()
    room = _room(axes)
    head = key_height(groups[:-1], stage, float(room[0])) + strip
    return _frame(axes, points, stage.spacing, groups, room, head, scale), head


def _pad(groups: list[Arrows]) -> np.ndarray:
    return _PAD + (_WIDER if groups else 0.0)


def smaller(spacing: float, point: float) -> float:
    """Factor for all symbols where joints, at their usual spacing, are near to each other on paper."""
    return float(np.clip(spacing / (_SPACING * point), 0.4, 1.0))


def legible(stage: Scene, point: float) -> bool:
    """Whether joints are few, or far enough from each other on paper for texts to belong to one."""
    return len(stage.joints) <= _FEW or stage.spacing >= _LEGIBLE * point


def _room(axes: "matplotlib.axes.Axes") -> np.ndarray:
    """Width and height of the axes in points."""
    figure = axes.get_figure(root=True)
    if figure is not None and figure.get_layout_engine() is not None:
        figure.draw_without_rendering()
    window = axes.get_window_extent()
    return np.array([window.width, window.height]) * 72.0 / axes.figure.dpi


def _frame(
    axes: "matplotlib.axes.Axes",
    points: np.ndarray,
    spacing: float,
    groups: list[Arrows],
    room: np.ndarray,
    head: float,
    scale: float | None,
) -> float:
    """Set the limits so that all fits, and the arrows' scales; the size of a point of print in data units."""
    inner = np.maximum(room - 2 * np.minimum(_pad(groups[:-1]), 0.15 * room) - [0.0, head], 0.1 * room)
    point = 0.0
    size = float(np.ptp(points, axis=0).max())
    low, high = points.min(axis=0), points.max(axis=0)
    for _ in range(12):  # arrows have lengths on paper, so the frame depends on itself
        point = max(*((high - low) / inner), 0.1 * size / inner.max()) or 1.0 / inner.max()
        _set_scales(groups, min(LONGEST, 0.25 * room.min()) * smaller(spacing, point) * point, scale)
        every = np.array([*points, *(tip for group in groups for tip in group.tips(point))])
        low, high = every.min(axis=0), every.max(axis=0)
    middle = (low + high) / 2 + [0.0, head / 2 * point]
    axes.set_xlim(middle[0] - room[0] / 2 * point, middle[0] + room[0] / 2 * point)
    axes.set_ylim(middle[1] - room[1] / 2 * point, middle[1] + room[1] / 2 * point)
    axes.set_aspect("equal", adjustable="box")
    return float(point)


def _set_scales(groups: list[Arrows], longest: float, scale: float | None) -> None:
    """Scales of all groups; applied forces, the last group, share that of joint loads of their size or have none."""
    *loads, applied = groups
    for group in loads:
        shared = group.look.gid == LOADS.gid and applied.largest() <= _COMPARABLE * group.largest()
        largest = max(group.largest(), applied.largest() * shared)
        if scale is not None:
            group.scale = scale
        elif largest > 0:
            group.scale = longest / largest
        if shared:
            applied.scale = group.scale


def joint_labels(pen: Pen, stage: Scene, said: Mapping[str, str]) -> list[Label]:
    """One label for all joints at a place, with what is said of them; red with a question mark where a load is not
    unique."""
    doubtful, spots, labels = stage.camera.not_unique or frozenset(), stage.spots, []
    left = np.ones(len(spots), bool)
    for first, spot in enumerate(spots):
        here = left & left[first] & (np.hypot(*(spots - spot).T) < 2.0 * pen.point)
        left &= ~here
        found = [stage.joints[k] for k in np.flatnonzero(here).tolist()]
        names = [joint.name for joint in found if joint.name]
        if not names:
            continue
        wide = max(_GUIDE if joint.slides else _PIN for joint in found)
        labels.append(
            Label(
                ", ".join(f"{name}{'?' * (name in doubtful)}{said.get(name, '')}" for name in names),
                f"joint name {found[0].name}",
                *around(pen, spot, wide),
                weight="bold",
                colour=dark(LOAD, 0.8) if doubtful.intersection(names) else INK,
            )
        )
    return labels


def _body_labels(pen: Pen, stage: Scene, outlines: list[np.ndarray]) -> list[Label]:
    labels = []
    for body, (name, outline) in enumerate(zip(stage.names, outlines, strict=True)):
        middle = (outline.min(axis=0) + outline.max(axis=0)) / 2
        edges = np.roll(outline, -1, axis=0) - outline
        lengths = np.hypot(*edges.T)
        parts = [outline[:, None] + share * edges[:, None] for share in (0.5, 0.3, 0.7, 0.15, 0.85)]
        anchors = np.concatenate(parts, axis=1).reshape(-1, 2)
        normals = np.repeat(np.stack([edges[:, 1], -edges[:, 0]], axis=1) / lengths[:, None], len(parts), axis=0)
        away = np.hypot(*(anchors - middle).T) / pen.point
        order = np.argsort(away, kind="stable")[:80]
        labels.append(
            Label(
                name,
                f"body name {name}",
                anchors[order],
                normals[order],
                0.35 * away[order],
                inside=stage.flat(stage.spans[body]).mean(axis=0, keepdims=True),
                colour=dark(body_colour(body, stage.ground), 0.5),
                style="italic",
                rank=1,
            )
        )
    return labels
