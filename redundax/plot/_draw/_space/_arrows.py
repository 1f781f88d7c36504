"""Forces in space as arrows to scale, moments as arrows with two heads along their axes

A moment is to a scale of its own, the longest as long on paper as `MOMENT` points, and has its value; it turns as the
fingers of the right hand do with the thumb along the arrow. An arrow that points at the viewer is a ring with a dot,
one that points away a ring with a cross.
"""

import dataclasses

import numpy as np

from ...._bodies._mechanism import Mechanism
from ...._bodies._reactions import reactions
from ...._system._state import State
from .._arrows import Arrow, Arrows, InSpace, Look, at_tip, beside, kept, line_width, value_text
from .._labels import PATIENCE, Label, around
from .._pen import HARD, Pen, arrow
from .._style import ARROW_Z, quantity
from ._scene import SpaceScene

MOMENT = 40.0  # points
_END_ON = 6.0  # points, below which an arrow is a ring
_ASLANT = 0.35  # and its slope to the line of sight


def space_arrow(
    scene: SpaceScene, name: str, body: str, at: np.ndarray, force: np.ndarray, moment: np.ndarray
) -> Arrow:
    """The arrow of a force and a moment on a body at a point, all (3,)."""
    place = scene.view.flat(at)
    size = float(np.linalg.norm(moment))
    return Arrow(name, body, place, place, scene.view.flat(force), size, InSpace(at, force, moment))


def joint_arrows(scene: SpaceScene, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[Arrow]:
    """Loads of the joints on their bodies i, or j where i is the ground, at the joint's point, without rounding."""
    wrenches = reactions(mechanism, state, multipliers).reshape(-1, 2, 3)
    largest = max(float(np.linalg.norm(scene.space_points().max(axis=0) - scene.space_points().min(axis=0))), 1e-300)
    size = float(np.max(np.linalg.norm(wrenches, axis=2) / np.array([1.0, largest]), initial=0.0))
    out = []
    for joint, (force, moment) in zip(scene.joints, wrenches, strict=True):
        force, moment = kept(force, 1e-4 * size), kept(moment, 1e-4 * size * largest)
        if np.any(force) or np.any(moment):
            body, at = (joint.j, joint.on_j) if joint.i == scene.ground else (joint.i, joint.on_i)
            name = scene.names[body] if body < scene.ground else "ground"
            out.append(space_arrow(scene, joint.name, name, at, force, moment))
    return out


def draw_space_arrows(pen: Pen, scene: SpaceScene, groups: list[Arrows]) -> list[Label]:
    """Draw all loads and return the labels with their values."""
    labels: list[Label] = []
    drawn: list[tuple[np.ndarray, np.ndarray]] = []
    units = scene.units.of("force"), scene.units.of("moment")
    for group in groups:
        largest = group.largest_moment()
        for number, each in enumerate(group.arrows):
            name, text = each.name or str(number), value_text(each)
            seen = scene.view.axes @ each.in_space.force, scene.view.axes @ each.in_space.moment
            if each.size:
                vector = group.vector(each, pen.point)
                gid = f"{group.look.gid} force {name}"
                label = text.format(quantity(each.size, units[0]))
                labels.append(_draw(pen, each, vector, seen[0], 1, drawn, group.look, gid, label))
            if each.moment:
                vector = seen[1][:2] / largest * MOMENT * pen.point
                gid = f"{group.look.gid} moment {name}"
                label = text.format(quantity(each.moment, units[1]))
                labels.append(_draw(pen, each, vector, seen[1], 2, drawn, group.look, gid, label))
    return labels


def _draw(
    pen: Pen,
    each: Arrow,
    vector: np.ndarray,
    seen: np.ndarray,
    heads: int,
    drawn: list[tuple[np.ndarray, np.ndarray]],
    look: Look,
    gid: str,
    text: str,
) -> Label:
    """One arrow, or a ring where it points at the viewer or away, and the label with its value."""
    style = {"fill": look.fill, "edge": look.edge, "linewidth": line_width(look)}
    value = f"{gid.rpartition(each.name)[0] if each.name else gid + ' '}value {each.name}"
    towards = seen[2]
    if np.hypot(*vector) < _END_ON * pen.point and np.hypot(*seen[:2]) < _ASLANT * abs(towards):
        pen.circle(
            each.at, 5.0, z=ARROW_Z, gid=gid, **{**style, "fill": "white", "edge": _line(look), "linewidth": 1.6}
        )
        reach = 3.0 * pen.point
        if towards >= 0:
            pen.circle(each.at, 1.6, fill=_line(look), edge="none", z=ARROW_Z + 0.1)
        for slope in (1.0, -1.0) if towards < 0 else ():
            pen.line(each.at + np.outer([-1.0, 1.0], [reach, slope * reach]), _line(look), ARROW_Z + 0.1)
        pen.cover(each.at, 7.0, HARD)
        return Label(text, value, *around(pen, each.at, 8.0), colour=_line(look), rank=2, patience=PATIENCE)
    tail = beside(pen, each.at, vector, drawn)
    tip = tail + vector
    if heads == 2:
        head = min(10.0 * pen.point, 0.4 * float(np.hypot(*vector))) * vector / np.hypot(*vector)
        pen.polygon(arrow(tail, tip - 0.8 * head, 2.4 * pen.point), z=ARROW_Z, **style)
        pen.arrow(tip - head, tip, z=ARROW_Z, gid=f"{gid} head", **style)
        pen.line([tail, tip], "none", gid=gid)
        pen.cover_line(tail, tip, 6.0, HARD)
    else:
        pen.arrow(tail, tip, z=ARROW_Z, gid=gid, **style)
    return dataclasses.replace(at_tip(pen, tail, vector, each, look, text), gid=value)


def _line(look: Look) -> str:
    return look.edge if look.fill == "white" else look.fill
