"""The motion of a mechanism as a moving picture, with joint loads as arrows to one scale

The limits of the axes and the scale of the arrows are those that all frames need.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import jax
import numpy as np

from ..._bodies._mechanism import Mechanism
from ..._motion._trajectory import Trajectory
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers
from ._arguments import check, loads_of, positions
from ._arrows import FORCES, LOADS, Arrow, Arrows, applied_arrows, draw_arrows
from ._camera import Camera
from ._draw import camera_of, framed, joint_labels, legible, new_axes, smaller
from ._key import draw_key
from ._labels import place
from ._paint import dress, paint
from ._pen import Pen
from ._scene import Scene, scene
from ._style import FONT, LABEL_Z

if TYPE_CHECKING:
    import matplotlib.artist
    from matplotlib.animation import FuncAnimation
    from matplotlib.figure import Figure

_STRIP = 18.0  # points above the mechanism for the time


class Moment(NamedTuple):
    """What there is to see at a time."""

    t: float
    stage: Scene
    groups: list[Arrows]

    def of(self, gid: str) -> list[Arrow]:
        """Arrows of a kind."""
        return [arrow for group in self.groups if group.look.gid == gid for arrow in group.arrows]


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
    frames = moments_of(mechanism, trajectory, loads, lambda states: camera_of(mechanism, states, view, shapes))
    figure = Figure()  # without a window, whose idle drawing would do every frame twice
    update = _painter(figure, frames, names, scale)
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
    return checked_path(path, ".gif", ".html")


def checked_path(path: str | Path | None, *endings: str) -> Path | None:
    """A file that can be written, if there is one."""
    target = None if path is None else Path(path)
    if target is not None and (target.suffix not in endings or not target.resolve().parent.is_dir()):
        raise RedundaxError(
            f"Argument `path` must end in {' or '.join(endings)} and lie in a folder that exists, but is {path}. Leave "
            "it out to write no file."
        )
    return target


def moments_of(
    mechanism: Mechanism, trajectory: Trajectory, loads: bool, camera: Callable[[list[State]], Camera]
) -> list[Moment]:
    """Those times that the motion got to, with joint loads where they are asked for and known."""
    numbers = np.flatnonzero(np.all(np.isfinite(trajectory.q), axis=1))
    states = [jax.tree.map(lambda x, k=k: x[k], trajectory.states) for k in numbers]
    seen, out = camera(states), []
    for state, lam in zip(states, np.asarray(trajectory.multipliers, float)[numbers], strict=True):
        stage = scene(mechanism, state, seen)
        known = loads and np.all(np.isfinite(lam))
        given = [loads_of(stage, mechanism, state, lam)] if known else []
        out.append(Moment(float(state.t), stage, [applied_arrows(stage), *given]))
    return out


def _painter(
    figure: "Figure", frames: list[Moment], names: bool, scale: float | None
) -> Callable[[int], list["matplotlib.artist.Artist"]]:
    """Axes that fit all frames, and the function that draws one of them."""

    def sized(figsize: tuple[float, float]) -> "Figure":
        figure.set_size_inches(*figsize)
        return figure

    points, stage = np.concatenate([frame.stage.points for frame in frames]), frames[0].stage
    named, view = dataclasses.replace(LOADS, text="joint load"), stage.camera.view
    loads, applied = (
        Arrows(look, [arrow for frame in frames for arrow in frame.of(look.gid)], view) for look in (named, FORCES)
    )
    for every in (loads, applied):
        every.longest_moment = every.largest_moment()
    groups = [loads] if loads.arrows else []
    axes = new_axes(sized, points, stage, groups, _STRIP)
    point, head = framed(axes, points, stage, [*groups, applied], scale, _STRIP)
    small, shows_names = smaller(stage.spacing, point), names and legible(stage, point)
    draw_key(Pen(axes, point), groups, stage)
    left, ceiling = axes.get_xlim()[0], axes.get_ylim()[1] - head * point
    at = (left + 8.0 * point, ceiling + 0.5 * _STRIP * point)
    clock = axes.text(*at, "", fontsize=FONT, va="center", zorder=LABEL_Z, gid="time")
    still = Pen(axes, point * small, small)
    dress(still, stage, points, ceiling)
    fixed = set(axes.get_children())

    def update(number: int) -> list["matplotlib.artist.Artist"]:
        for drawn in set(axes.get_children()) - fixed:
            drawn.remove()
        frame, pen = frames[number], still
        clock.set_text(f"t = {frame.t:.3f} {stage.units.of('time')}".rstrip())
        shown = [dataclasses.replace(every, arrows=frame.of(every.look.gid)) for every in (loads, applied)]
        paint(pen, frame.stage)
        draw_arrows(pen, frame.stage, shown)
        place(pen, joint_labels(pen, frame.stage, {}) if shows_names else [], ceiling)
        return []

    return update
