"""A spatial mechanism as one page that any browser turns, zooms and plays, by plotly

Each body, joint and load is a mesh of its own, which shows its name or value where it is pointed at.
"""

import itertools
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._motion._trajectory import Trajectory
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers
from ..._tools._optional import optional
from ._animate import Moment, check_motion, checked_path, moments_of
from ._arguments import check, check_state, load_groups
from ._arrows import MOMENT, applied_arrows
from ._camera import Camera
from ._draw import camera_of
from ._scene import Scene, scene, spacing
from ._solids import Solid, arrow
from ._style import INK, quantity
from ._symbols import solids

if TYPE_CHECKING:
    from plotly.basedatatypes import BaseTraceType
    from plotly.graph_objects import Figure

Json: TypeAlias = "str | float | bool | Sequence[Json] | Mapping[str, Json] | None"  # what plotly takes

_ACROSS = 420.0  # points of print that the mechanism is across
_LETTER, _LINE = 7.0, 14.0  # points, of a name
_LONGEST, _SHORTEST = 70.0, 14.0  # points, of arrows that no `scale` is given for
_ROOM = (3.4, 2.0)  # across and upright, of what a page shows from the camera's distance
_COLOURS = {"self-stress": "#0072B2", "load": "#D55E00", "applied": INK}


def html(
    mechanism: Mechanism,
    motion: State | Trajectory,
    path: str | Path | None = None,
    *,
    self_stress: int | ArrayLike | Sequence[float] | None = None,
    multipliers: ArrayLike | Sequence[float] | None = None,
    report: Report | Collection[str] | None = None,
    loads: bool = True,
    names: bool = True,
    scale: float | None = None,
    view: Sequence[float] | None = None,
    shapes: Mapping[str, Numbers] | None = None,
) -> "Figure":
    """A spatial mechanism as one HTML page to turn, zoom and play. Needs plotly: `pip install "redundax[html]"`.

    The page holds all that it needs and opens without a network; it is some 5 MB. Parts show their names, and arrows
    their values, where they are pointed at. It looks as with `draw`, and a motion has a slider of its times.

    ??? example

        ```python
        door = rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
        hinge = rx.spatial.Revolute("hinge", door, "ground", point=(0.0, 0.0, 0.2), axis=(0.0, 0.0, 1.0))
        mechanism = rx.Mechanism([door], [hinge], gravity=(0.0, 0.0, -9.81))
        state = rx.assemble(mechanism, rates={"hinge.angle": 1.0})
        rx.plot.html(mechanism, rx.simulate(mechanism, state, 1.0), "door.html")
        ```

    **Arguments:**

    - `mechanism`: a spatial one; `rx.plot.animate` writes pages of planar ones.
    - `motion`: a state, or a trajectory of `rx.simulate`, of which each time is a frame.
    - `path`: a file ".html"; none is written if not given.
    - `self_stress`, `multipliers`: at a state, as in `draw`.
    - `loads`: whether the joint loads of a trajectory are drawn.
    - `report`, `names`, `scale`, `view`, `shapes`: as in `draw`.

    **Returns:** a `plotly.graph_objects.Figure`, which notebooks show.

    **Raises:** `ValueError` for arguments that do not fit; `ImportError` without plotly.
    """
    plotly = optional("plotly.graph_objects", "html")
    _check(mechanism, motion, scale)
    target = checked_path(path, ".html")

    def camera(states: list[State]) -> Camera:
        return camera_of(mechanism, states, view, shapes, report)

    if isinstance(motion, State):
        stage = scene(mechanism, motion, camera([motion]))
        groups = [applied_arrows(stage), *load_groups(stage, mechanism, motion, self_stress, multipliers)]
        moments = [Moment(float(motion.t), stage, groups)]
    else:
        moments = moments_of(mechanism, motion, loads, camera)
    point = _point(moments[0].stage)
    _set_scales(moments, point, scale)
    least = 0.0 if scale else _SHORTEST * point
    traces = [_traces(plotly, moment, point, least) for moment in moments]
    meshes = len(traces[0])
    if names:
        shown = _with_room(moments[0].stage, point)
        traces = [[*own, *_names(plotly, moment.stage, shown)] for own, moment in zip(traces, moments, strict=True)]
    figure = plotly.Figure(traces[0], layout=_layout(moments, point))
    if names:
        figure.update_layout(updatemenus=[_choice_of_names(meshes)])
    if len(moments) > 1:
        labels = [f"{moment.t:.3f}" for moment in moments]
        figure.frames = [plotly.Frame(data=data, name=label) for data, label in zip(traces, labels, strict=True)]
        player, sliders = _player(labels, moments)
        figure.update_layout(updatemenus=[*figure.layout.updatemenus, player], sliders=sliders)
    if target is not None:
        figure.write_html(target, include_plotlyjs=True, config={"displaylogo": False}, auto_play=False)
    return figure


def _check(mechanism: Mechanism, motion: State | Trajectory, scale: float | None) -> None:
    check(mechanism, scale)
    if mechanism.frame.word != "spatial":
        raise RedundaxError(
            "Argument `mechanism` must be of `rx.spatial` bodies, but is planar. Use `rx.plot.animate`, which writes "
            "HTML of planar motions."
        )
    check_state(mechanism, motion) if isinstance(motion, State) else check_motion(mechanism, motion)


def _point(stage: Scene) -> float:
    """Size of a point of print in the model, smaller where joints are dense."""
    size = float(np.linalg.norm(np.ptp(stage.space_points, axis=0))) or 1.0
    apart = spacing(np.array([joint.place for joint in stage.joints]), stage.space_points)
    return min(size / _ACROSS, max(apart / 45.0, size / 1500.0))


def _set_scales(moments: list[Moment], point: float, scale: float | None) -> None:
    """One scale for all arrows of a kind at all times."""
    for gid in _COLOURS:
        groups = [group for moment in moments for group in moment.groups if group.look.gid == gid]
        largest = max((group.largest() for group in groups), default=0.0)
        moment = max((group.largest_moment() for group in groups), default=0.0)
        for group in groups:
            group.longest_moment = moment
            group.scale = scale or (_LONGEST * point / largest if largest else None)


def _traces(plotly: ModuleType, moment: Moment, point: float, least: float) -> "list[BaseTraceType]":
    """Meshes, the same number of them at all times."""
    parts: dict[tuple[str, str, float], list[Solid]] = {}
    for solid in solids(moment.stage, point):
        parts.setdefault((solid.name, solid.colour, solid.opacity), []).append(solid)
    out = [_mesh(plotly, given, *key) for key, given in parts.items()]
    return [*out, *(_loads(plotly, moment, gid, point, least) for gid in _COLOURS)]


def _texts(stage: Scene) -> list[tuple[np.ndarray, str, str]]:
    """Places, names and their sides: of joints, and of bodies at the centre of mass."""
    joints = [(joint.place, joint.name, "top right") for joint in stage.joints]
    bodies = zip(stage.names, stage.centres, strict=False)
    return [*joints, *((centre, f"<i>{name}</i>", "bottom left") for name, centre in bodies)]


def _with_room(stage: Scene, point: float) -> list[int]:
    """Names that cover no other one as the page opens: joints first."""
    boxes: list[np.ndarray] = []
    shown = []
    for number, (place, name, side) in enumerate(_texts(stage)):
        size = np.array([_LETTER * len(name.removeprefix("<i>").removesuffix("</i>")), _LINE])
        corner = stage.camera.view.axes[:2] @ place / point - (0.0 if side == "top right" else size)
        box = np.array([corner, corner + size])
        if not any((box[0] < other[1]).all() and (other[0] < box[1]).all() for other in boxes):
            boxes.append(box)
            shown.append(number)
    return shown


def _names(plotly: ModuleType, stage: Scene, shown: list[int]) -> "list[BaseTraceType]":
    """Names that have room, and all, of which a button shows either."""
    texts = _texts(stage)

    def trace(some: list[int], visible: bool) -> "BaseTraceType":
        places, words, sides = zip(*(texts[number] for number in some), strict=True)
        x, y, z = np.array(places).T
        look = {"mode": "text", "hoverinfo": "skip", "showlegend": False, "visible": visible}
        return plotly.Scatter3d(x=x, y=y, z=z, text=words, textposition=sides, textfont={"size": 12}, **look)

    return [trace(shown, True), trace(list(range(len(texts))), False)]


def _choice_of_names(first: int) -> dict[str, Json]:
    """Buttons; without names a part still shows its own where it is pointed at."""
    ways = {"names": [True, False], "all names": [False, True], "no names": [False, False]}
    buttons = [
        {"label": label, "method": "restyle", "args": [{"visible": visible}, [first, first + 1]]}
        for label, visible in ways.items()
    ]
    place = {"x": 0.0, "y": 0.0, "xanchor": "left", "yanchor": "bottom", "pad": {"l": 10, "b": 10}}
    return {"type": "buttons", "direction": "left", "buttons": buttons, **place}


def _loads(plotly: ModuleType, moment: Moment, gid: str, point: float, least: float) -> "BaseTraceType":
    """All arrows of a kind as one mesh, whose corners show what they are; none is shorter than the `least`."""
    made: list[Solid] = []
    stage = moment.stage
    force, couple = stage.units.of("force"), stage.units.of("moment")
    for group in moment.groups:
        largest = group.largest_moment()
        for each in group.arrows if group.look.gid == gid else ():
            where = f" {each.name} on {each.body}" if each.body else ""
            given = [(each.force * (group.scale or 0.0), 1, quantity(each.size, force))] if each.size else []
            if each.turn:
                given.append((each.moment / largest * MOMENT * point, 2, quantity(each.turn, couple)))
            for vector, heads, value in given:
                length = float(np.linalg.norm(vector))
                tip = each.at + vector * max(1.0, least / length if length else 1.0)
                made += arrow(each.at, tip, 3.0 * point, _COLOURS[gid], heads=heads, name=f"{value}{where}")
    if not made:  # a mesh that shows nothing, as plotly wants one of each at all times
        made = [Solid(np.tile(stage.centres[0], (3, 1)), ((0, 1, 2),), _COLOURS[gid])]
    return _mesh(plotly, made, gid, _COLOURS[gid], 1.0, [solid.name for solid in made for _ in solid.corners])


def _mesh(
    plotly: ModuleType, given: list[Solid], name: str, colour: str, opacity: float, texts: list[str] | None = None
) -> "BaseTraceType":
    counts = np.cumsum([0, *(len(solid.corners) for solid in given)])
    corners = np.concatenate([solid.corners for solid in given]).astype(np.float32)
    triangles = [solid.triangles() + first for solid, first in zip(given, counts[:-1], strict=True)]
    i, j, k = np.concatenate(triangles).astype(np.int32).T
    return plotly.Mesh3d(
        x=corners[:, 0],
        y=corners[:, 1],
        z=corners[:, 2],
        i=i,
        j=j,
        k=k,
        name=name,
        color=colour,
        opacity=opacity,
        flatshading=True,
        hovertext=texts if texts is not None else name.partition(" ")[2],
        hoverinfo="text",
        lighting={"ambient": 0.6, "diffuse": 0.6, "specular": 0.1},
    )


def _layout(moments: list[Moment], point: float) -> dict[str, Json]:
    stage = moments[0].stage
    every = np.concatenate([moment.stage.space_points for moment in moments])
    tips = [
        each.at + each.force * (group.scale or 0.0)
        for moment in moments
        for group in moment.groups
        for each in group.arrows
    ]
    every = np.concatenate([every, np.array(tips).reshape(-1, 3)])
    low, high = every.min(axis=0) - 40.0 * point, every.max(axis=0) + 40.0 * point
    share, unit = (high - low) / (high - low).max(), stage.units.of("linear")
    axes = {
        f"{axis}axis": {
            "title": {"text": f"{axis} ({unit})" if unit else axis},
            "range": [low[k], high[k]],
            "nticks": int(2 + 5 * share[k]),
            "showbackground": False,  # walls would hide the ends of long names
            "gridcolor": "#dddddd",
        }
        for k, axis in enumerate("xyz")
    }
    towards, up = 1.8 * stage.camera.view.axes[2], np.eye(3)[stage.camera.view.vertical]
    camera = {
        "eye": dict(zip("xyz", towards.tolist(), strict=True)),
        "up": dict(zip("xyz", up.tolist(), strict=True)),
        "projection": {"type": "orthographic"},
    }
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * share
    across, upright = np.ptp(corners @ stage.camera.view.axes[:2].T, axis=0)
    sides = share * min(_ROOM[0] / across, _ROOM[1] / upright)
    return {
        "scene": {
            **axes,
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", sides.tolist(), strict=True)),
            "camera": camera,
            "uirevision": "kept",
        },
        "margin": {"l": 0, "r": 0, "t": 40, "b": 0},
        "annotations": _key(moments),
        "showlegend": False,
    }


def _key(moments: list[Moment]) -> list[dict[str, Json]]:
    """What the arrows are, and how much the longest of each kind is."""
    force, lines = moments[0].stage.units.of("force"), []
    for gid, colour in _COLOURS.items():
        groups = [group for moment in moments for group in moment.groups if group.look.gid == gid]
        largest = max((group.largest() for group in groups), default=0.0)
        if largest:
            text = groups[0].look.text or "applied force"
            told = f"{text}: the longest is {quantity(largest, force)}, short ones are drawn longer"
            lines.append(f'<span style="color:{colour}">{told}</span>')
    text = "<br>".join(lines)
    place = {"x": 0.01, "y": 1.0, "xref": "paper", "yref": "paper", "showarrow": False, "align": "left"}
    return [{**place, "text": text, "xanchor": "left", "yanchor": "bottom"}] if lines else []


def _player(labels: list[str], moments: list[Moment]) -> tuple[dict[str, Json], list[dict[str, Json]]]:
    """Buttons and the slider; the motion plays in its own time."""
    step = 1000.0 * (moments[-1].t - moments[0].t) / (len(moments) - 1)
    still = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    play = {"frame": {"duration": max(step, 10.0), "redraw": True}, "fromcurrent": True, "transition": {"duration": 0}}
    unit = moments[0].stage.units.of("time")
    steps = [{"args": [[label], still], "label": label, "method": "animate"} for label in labels]
    current = {"prefix": "t = ", "suffix": f" {unit}" if unit else ""}
    buttons = [
        {"label": "Play", "method": "animate", "args": [None, play]},
        {"label": "Stop", "method": "animate", "args": [[None], still]},
    ]
    menu = {"type": "buttons", "buttons": buttons, "x": 0.0, "y": 0.0, "xanchor": "left", "yanchor": "top"}
    menu |= {"direction": "left", "pad": {"t": 30, "l": 10}}
    slider = {"steps": steps, "currentvalue": current, "x": 0.15, "len": 0.82, "pad": {"t": 20, "b": 10}}
    return menu, [slider]
