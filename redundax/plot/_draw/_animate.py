"""The motion of a mechanism as a moving picture, with joint loads as arrows to one scale

The limits of the axes and the scale of the arrows are those that all frames need.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from ..._bodies._mechanism import Mechanism
from ..._motion._trajectory import Trajectory
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers
from ._arguments import check, positions
from ._arrows import FORCES, LOADS, Arrow, Arrows
from ._artists import artist_of
from ._draw import framed, joint_labels, legible, new_axes, smaller
from ._key import draw_key
from ._labels import place
from ._pen import Pen
from ._stage import Artist, Stage
from ._style import FONT, LABEL_Z

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation

_STRIP = 18.0  # points above the mechanism for the time


class _Frame(NamedTuple):
    """A time, what there is to draw at it, and the loads of joints and from outside."""

    t: float
    stage: Stage
    loads: list[Arrow]
    applied: list[Arrow]


def animate(
    mechanism: Mechanism,
    trajectory: Trajectory,
    path: str | Path | None = None,
    *,
    fps: int = 25,
    loads: bool = True,
    names: bool = True,
    scale: float | None = None,
    view: Sequence[float] | None = None,
    shapes: Mapping[str, Numbers] | None = None,
) -> "FuncAnimation":
    """A moving picture of a mechanism, with joint loads as arrows. Needs matplotlib.

    It looks as with `draw`, without values: a key above gives the scale of the arrows of forces, which is one for all
    frames; those of moments only show the sense, and in space the axis. Arrows are left out where multipliers are not
    known, as after the mechanism came to rest by friction.

    ??? example

        ```python
        crank = rx.mechanisms.parallelogram(3)
        times = jnp.arange(0.0, 0.2, 1 / 25)  # one frame each: in real time at 25 frames a second
        motion = rx.simulate(crank, crank.state(0.5, rate=1.0), 0.2, ts=times)
        film = rx.plot.animate(crank, motion, "crank.gif")
        film = rx.plot.animate(crank, motion)  # in a notebook: IPython.display.HTML(film.to_jshtml())
        ```

    **Arguments:**

    - `mechanism`, `trajectory`: as given to and by `simulate`; each of its times is a frame, but for those that the
      motion did not get to.
    - `path`: a file ".gif", or ".html" that any browser plays; none is written if not given.
    - `fps`: frames a second.
    - `loads`: whether joint loads are drawn: what each joint does to its body i, as in `draw`.
    - `names`: whether joints are named.
    - `scale`: length of the arrows on the drawing for a force of 1; by default that of the longest is fixed.
    - `view`, `shapes`: in space, as in `draw`; one view for all frames.

    **Returns:** a `matplotlib.animation.FuncAnimation`, to show or save in other ways.

    **Raises:** `ValueError` for arguments that do not fit, and where the trajectory has no frame.
    """
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.figure import Figure

    check(mechanism, scale)
    target = _checked(mechanism, trajectory, path, fps)
    states = [jax.tree.map(lambda x, k=k: x[k], trajectory.states) for k in finite_times(trajectory)]
    artist = artist_of(mechanism, states, view=view, shapes=shapes)
    frames = _frames(artist, mechanism, trajectory, states, loads)
    figure = Figure()  # without a window, whose idle drawing would do every frame twice
    update = _painter(artist, figure, frames, names, scale)
    film = FuncAnimation(figure, update, len(frames), list, interval=1000.0 / fps, cache_frame_data=False)
    if target is not None and target.suffix == ".gif":
        film.save(target, PillowWriter(fps=fps))  # pyright: ignore[reportArgumentType]
    elif target is not None:
        target.write_text(film.to_jshtml(fps=fps), encoding="utf-8")
    return film


def check_motion(mechanism: Mechanism, trajectory: Trajectory) -> None:
    """Refuse a motion that has no frame of this mechanism."""
    n = positions(mechanism)
    if trajectory.q.ndim != 2 or trajectory.q.shape[1] != n:
        raise RedundaxError(
            f"Argument `trajectory` must be one motion of the mechanism, with q of shape (times, {n}), but has "
            f"{trajectory.q.shape}. Take one of a batch with `jax.tree.map(lambda x: x[0], batch)`."
        )
    if not np.any(np.all(np.isfinite(trajectory.q), axis=1)):
        raise RedundaxError(
            "Argument `trajectory` must have at least one position that is finite, but has none. "
            "Look at the `result` of the motion."
        )


def _checked(mechanism: Mechanism, trajectory: Trajectory, path: str | Path | None, fps: int) -> Path | None:
    check_motion(mechanism, trajectory)
    if not fps > 0:
        raise RedundaxError(f"Argument `fps` must be positive, but is {fps}. Give frames a second: 25, say.")
    target = None if path is None else Path(path)
    if target is not None and (target.suffix not in (".gif", ".html") or not target.resolve().parent.is_dir()):
        raise RedundaxError(
            f"Argument `path` must end in .gif or .html and lie in a folder that exists, but is {path}. "
            "Leave it out to write no file."
        )
    return target


def finite_times(trajectory: Trajectory) -> np.ndarray:
    """Numbers of the times that the motion got to."""
    return np.flatnonzero(np.all(np.isfinite(trajectory.q), axis=1))


def _frames(
    artist: Artist, mechanism: Mechanism, trajectory: Trajectory, states: list[State], loads: bool
) -> list[_Frame]:
    out = []
    for k, state in zip(finite_times(trajectory), states, strict=True):
        stage, lam = artist.scene(mechanism, state), np.asarray(trajectory.multipliers[k], float)
        known = loads and bool(np.all(np.isfinite(lam)))
        arrows = artist.loads(stage, mechanism, state, lam) if known else []
        out.append(_Frame(float(state.t), stage, arrows, artist.applied(stage)))
    return out


def _painter(artist: Artist, figure: Any, frames: list[_Frame], names: bool, scale: float | None) -> Any:
    """Axes that fit all frames, and the function that draws one of them."""

    def sized(figsize: tuple[float, float]) -> Any:
        figure.set_size_inches(*figsize)
        return figure

    points = np.concatenate([frame.stage.points() for frame in frames])
    loads = Arrows(dataclasses.replace(LOADS, text="joint load"), [arrow for frame in frames for arrow in frame.loads])
    loads.longest_moment = loads.largest_moment()
    applied = Arrows(FORCES, [arrow for frame in frames for arrow in frame.applied])
    applied.longest_moment = applied.largest_moment()
    groups = [loads] if loads.arrows else []
    stage = frames[0].stage
    axes = new_axes(artist, sized, points, stage, groups, _STRIP)
    point, head = framed(artist, axes, points, stage, [*groups, applied], scale, _STRIP)
    small, shows_names = smaller(stage.spacing, point), names and legible(stage, point)
    draw_key(Pen(axes, point), groups, stage)
    left, ceiling = axes.get_xlim()[0], axes.get_ylim()[1] - head * point
    at = (left + 8.0 * point, ceiling + 0.5 * _STRIP * point)
    clock = axes.text(*at, "", fontsize=FONT, va="center", zorder=LABEL_Z, gid="time")
    still = Pen(axes, point * small, small)
    artist.surround(still, stage, points, ceiling)
    fixed = set(axes.get_children())

    def update(number: int) -> list[Any]:
        for drawn in set(axes.get_children()) - fixed:
            drawn.remove()
        frame, pen = frames[number], dataclasses.replace(still, boxes=[*still.boxes])
        clock.set_text(f"t = {frame.t:.3f} {stage.units.of('time')}".rstrip())
        shown = [dataclasses.replace(loads, arrows=frame.loads), dataclasses.replace(applied, arrows=frame.applied)]
        artist.paint(pen, frame.stage, shown)
        place(pen, joint_labels(pen, frame.stage) if shows_names else [], ceiling)
        return []

    return update
