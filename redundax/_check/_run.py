"""The stored run of a model as a log: loads of joints as columns, and the motion by poses of bodies"""

import numpy as np

from .._bodies._mechanism import Mechanism
from .._bodies._space._rotation import as_quaternion, rotation
from .._models._series import ReactionSeries, Series
from .._tools._errors import RedundaxError
from ._log import Figure, Log
from ._motion import Path, moving, nearest


def of_series(system: Mechanism, series: Series) -> tuple[Log, Path]:
    """Its loads as columns, and its motion, closed."""
    if missing := [name for name in system.names.bodies if name not in series.bodies]:
        raise RedundaxError(
            f"Argument `log` must have positions of all bodies, but not of '{missing[0]}'. Run it again."
        )
    q, qd = states_of(system, series)
    closed, scale = nearest(system, series.times, q)
    centres = 3 * len(system.names.bodies)
    apart = float(np.abs(closed - q)[:, :centres].max(initial=0.0))
    names, figures, unused = system.names.joint_names, [], []
    for name, reaction in series.reactions.items():
        if name in names:
            figures += _figures(system, name, names.index(name), reaction, _points(system, closed, reaction))
        else:
            unused.append(name)
    if not figures:
        raise RedundaxError("Argument `log` must have the loads of a joint, but has none. Run it again.")
    log = Log(series.times, {}, {}, {}, tuple(figures), {}, tuple(unused))
    return log, moving(system, scale, log, closed, ([], np.zeros(0, int), []), apart, qd)


def states_of(system: Mechanism, series: Series) -> tuple[np.ndarray, np.ndarray]:
    """Positions q and velocities; 0 where those are not stored."""
    points, turns, speeds, spins = [], [], [], []
    for name, centre in zip(system.names.bodies, np.asarray(system.frame.centres(system.body)), strict=True):
        body = series.bodies[name]
        arm, none = np.einsum("tij,j->ti", body.axes, centre), np.zeros_like(body.position)
        spin = none if body.angular_velocity is None else body.angular_velocity
        points.append(body.position + arm)
        turns.append(np.stack([as_quaternion("log", each) for each in body.axes]))
        speeds.append((none if body.velocity is None else body.velocity) + np.cross(spin, arm))
        spins.append(np.einsum("tji,tj->ti", body.axes, spin))
    return np.concatenate([*points, *turns], axis=1), np.concatenate([*speeds, *spins], axis=1)


def _points(system: Mechanism, q: np.ndarray, reaction: ReactionSeries) -> np.ndarray:
    """Where the point of a reaction is, global, (times, 3)."""
    bodies = system.names.bodies
    if reaction.on not in bodies:
        return np.broadcast_to(reaction.point, (len(q), 3))
    k, count = bodies.index(reaction.on), len(bodies)
    arm = reaction.point - np.asarray(system.frame.centres(system.body))[k]
    axes = rotation(q[:, 3 * count + 4 * k : 3 * count + 4 * k + 4])
    return q[:, 3 * k : 3 * k + 3] + np.einsum("tij,j->ti", axes, arm)


def _figures(system: Mechanism, name: str, joint: int, reaction: ReactionSeries, point: np.ndarray) -> list[Figure]:
    is_other = not system.names.reactions.labels[6 * joint].endswith(f" on {reaction.on}")
    return [
        Figure(f"{name} {part} {axis} on {reaction.on}", joint, part, k, is_other, values[:, k], point)
        for part, values in (("force", reaction.force), ("moment", reaction.moment))
        for k, axis in enumerate("xyz")
    ]
