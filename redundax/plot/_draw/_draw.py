"""A mechanism at a state as a picture, with self-stress and joint loads as arrows to scale

load of a joint on its body i = -(d Phi / d pose_i)^T lam,   length of an arrow = scale * |force|
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._solve._solution import Solution
from ..._system._state import State
from ..._tools._module import Numbers
from ._arguments import check, check_state, idle_contacts, load_groups
from ._arrows import FORCES, LOADS, LONGEST, Arrows
from ._artists import artist_of, not_unique
from ._key import draw_key, key_height
from ._labels import Label, around, place
from ._pen import Pen
from ._stage import Artist, Stage
from ._style import BLOCK, INK, LOAD, PIN, body_colour, dark

if TYPE_CHECKING:
    import matplotlib.axes

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

    In the plane, bodies are rounded bars or plates spanned by their joints and centre of mass. Circles are revolute
    joints, blocks between rails translational ones, dark pins in white slots pin-in-slot joints, above a line where
    they are one-sided, black squares fixed joints, M a driven angle, a cylinder a driven distance, diamonds joints of
    other kinds; hatching is the ground. The arrow of a
    joint starts at the joint and is what the joint does to its **body i**: -lam for a revolute joint, +lam along the
    normal for a translational one, and in general -(d residual / d pose_i)^T lam, moments about the joint's point on
    body i. Moments are circular arrows, counterclockwise where positive, with their values. Loads below 1e-4
    of the largest are left out, and so are values and, in very dense pictures, names that would cover other ones; where
    more than a hundred joints are nearer than 4 points of print to each other, all names and values are.
    Applied forces are black, to the scale of `multipliers` where these are given and not four times smaller.
    Gears in mesh are their pitch circles with the line of action; their arrow starts at the pitch point. Couplings of
    angles look like gears, or belts where both bodies turn in the same sense; neither's force is there.

    In space, the picture is a parallel projection: lengths along an axis are to scale, and arrows in a corner say by
    how much. Bodies are bars, plates or hulls of the same points, or the `shapes` given. Cylinders are revolute joints,
    on a shaft cylindrical ones; blocks on rails are prismatic, balls spherical, crosses universal joints, dark cubes
    fixed ones, octahedra those of other kinds; grey pyramids stand on the ground. Arrows start at the joint's point and
    are what the joint does to its body i, or to body j where i is the ground, as in
    `solution["top force x on door"]`; they look shorter as they point towards the viewer, where they are rings with a
    dot, or away, with a cross. Moments are arrows with two heads by the right-hand rule, to a scale of their own, with
    their values.

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
      and in space joints are green where it is and red where not.
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
    artist = artist_of(mechanism, [state], view=view, shapes=shapes, not_unique=not_unique(report))
    stage = artist.scene(mechanism, state)
    loads = multipliers.multipliers if isinstance(multipliers, Solution) else multipliers
    groups = load_groups(artist, stage, mechanism, state, self_stress, loads)
    applied = Arrows(FORCES, artist.applied(stage))
    if axes is None:
        from matplotlib import pyplot

        axes = new_axes(artist, pyplot.figure, stage.points(), stage, groups)
    point, head = framed(artist, axes, stage.points(), stage, [*groups, applied], scale)
    small = smaller(stage.spacing, point)
    pen = Pen(axes, point * small, small)
    ceiling = axes.get_ylim()[1] - head * point
    artist.surround(pen, stage, stage.points(), ceiling)
    outlines, values = artist.paint(pen, stage, [*groups, applied])
    draw_key(Pen(axes, point), groups, stage)
    if not legible(stage, point):
        return axes
    said = idle_contacts(mechanism, state, multipliers) if isinstance(multipliers, Solution) else {}
    named = [*joint_labels(pen, stage, not_unique(report), said), *_body_labels(pen, stage, outlines)] if names else []
    place(pen, [*named, *values], ceiling)
    return axes


def new_axes(
    artist: Artist, make: Callable[..., Any], points: np.ndarray, stage: Stage, groups: list[Arrows], strip: float = 0.0
) -> "matplotlib.axes.Axes":
    """Axes of a figure that is made in a size that suits the points, with a strip of some points of print for more."""
    left, lower, right, upper = artist.margins
    spread = np.ptp(points, axis=0)
    point = min(max(*(spread / _ROOM)), stage.spacing / (1.4 * _SPACING)) or 1.0
    reach = 1.2 * LONGEST if groups else 0.0
    head = key_height(groups, stage, np.inf) + strip
    wanted = spread / point + 2 * _pad(groups) + reach + [left + right, head + lower + upper]
    width, height = np.clip(wanted, *_SIZES)
    figure = make(figsize=(width / 72.0, height / 72.0))
    return figure.add_axes((left / width, lower / height, 1 - (left + right) / width, 1 - (lower + upper) / height))


def framed(
    artist: Artist,
    axes: Any,
    points: np.ndarray,
    stage: Stage,
    groups: list[Arrows],
    scale: float | None,
    strip: float = 0.0,
) -> tuple[float, float]:
    """Axes set so that points and arrows fit: size of a point of print in data units, points of the key above."""
    artist.dress(axes, stage)
    room = _room(axes)
    head = key_height(groups[:-1], stage, float(room[0])) + strip
    return _frame(axes, points, stage.spacing, groups, room, head, scale), head


def _pad(groups: list[Arrows]) -> np.ndarray:
    return _PAD + (_WIDER if groups else 0.0)


def smaller(spacing: float, point: float) -> float:
    """Factor for all symbols where joints, at their usual spacing, are near to each other on paper."""
    return float(np.clip(spacing / (_SPACING * point), 0.4, 1.0))


def legible(stage: Stage, point: float) -> bool:
    """Whether joints are few, or far enough from each other on paper for texts to belong to one."""
    return len(stage.joints) <= _FEW or stage.spacing >= _LEGIBLE * point


def _room(axes: Any) -> np.ndarray:
    """Width and height of the axes in points."""
    if axes.figure.get_layout_engine() is not None:
        axes.figure.draw_without_rendering()
    window = axes.get_window_extent()
    return np.array([window.width, window.height]) * 72.0 / axes.figure.dpi


def _frame(
    axes: Any,
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
        tips = [a.at + g.vector(a, point) for g in groups for a in g.arrows if np.any(a.force)]
        every = np.array([*points, *tips])
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


def joint_labels(
    pen: Pen, stage: Stage, not_unique: frozenset[str] | None = None, said: Mapping[str, str] | None = None
) -> list[Label]:
    """One label for all joints at a place, with what is said of them; red with a question mark where a load is not
    unique."""
    doubtful, labels = not_unique or frozenset(), []
    said = said or {}
    spots = np.array([joint.spot for joint in stage.joints]).reshape(-1, 2)
    left = np.ones(len(spots), bool)
    for first, spot in enumerate(spots):
        here = left & left[first] & (np.hypot(*(spots - spot).T) < 2.0 * pen.point)
        left &= ~here
        found = [stage.joints[k] for k in np.flatnonzero(here).tolist()]
        names = [joint.name for joint in found if joint.name]
        if not names:
            continue
        wide = max(PIN + 2.5 if joint.axis is None else BLOCK[1] / 2 + 4.0 for joint in found)
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


def _body_labels(pen: Pen, stage: Stage, outlines: list[np.ndarray]) -> list[Label]:
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
                inside=stage.joint_points(body).mean(axis=0, keepdims=True),
                colour=dark(body_colour(body, stage.ground), 0.5),
                style="italic",
                rank=1,
            )
        )
    return labels
