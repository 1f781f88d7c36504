"""Loads as arrows: forces to scale, moments as circular arrows with their values.

Force and moment are those of the joint on its body i. An arrow starts at the joint and is |force| * scale long.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..._bodies._reactions import moment_about
from ._labels import PATIENCE, Label, around
from ._pen import Pen, across
from ._scene import Scene
from ._style import APPLIED, ARROW_Z, LOAD, STRESS, TURN, dark, quantity

LONGEST = 62.0  # points, of the longest arrow unless a scale is given
_FIXED = 32.0  # points, of an arrow that is not to scale
_SMALLEST = 1e-4  # of the largest load; what is below is rounding or cannot be seen


@dataclasses.dataclass(frozen=True)
class Look:
    """How loads of one kind are drawn, and what the key calls them."""

    gid: str
    fill: str
    edge: str
    text: str


LOADS = Look("load", LOAD, "white", "joint load on the named body; friction is not drawn")
SMOOTH = dataclasses.replace(LOADS, text="joint load on the named body")
STRESSES = Look("self-stress", "white", STRESS, "self-stress on the named body")
FORCES = Look("applied", APPLIED, "white", "")


class InSpace(NamedTuple):
    """Where a load acts, its force and its moment, global components (3,)."""

    start: np.ndarray
    force: np.ndarray
    moment: np.ndarray


_NOT = InSpace(np.zeros(3), np.zeros(3), np.zeros(3))


@dataclasses.dataclass(frozen=True)
class Arrow:
    """Force (2,) as the picture shows it and moment, in space |moment|, on a body at the place `at` of the picture.

    A pure moment may be shown at `spot`. `in_space` is the whole load of a spatial mechanism.
    """

    name: str
    body: str
    at: np.ndarray
    spot: np.ndarray
    force: np.ndarray
    moment: float
    in_space: InSpace = _NOT

    @property
    def size(self) -> float:
        """|force|, of which the picture may show a part."""
        return float(max(np.hypot(*self.force), np.linalg.norm(self.in_space.force)))


@dataclasses.dataclass
class Arrows:
    """Loads of one look; `scale` is the length of an arrow in data units for a force of 1, None where not to scale.

    `longest_moment` is that to which the longest arrow of a moment belongs, of all times, where moments are to scale.
    """

    look: Look
    arrows: list[Arrow]
    scale: float | None = None
    longest_moment: float | None = None

    def largest_moment(self) -> float:
        """Largest moment."""
        return self.longest_moment or max((abs(each.moment) for each in self.arrows), default=0.0)

    def largest(self) -> float:
        """Largest force."""
        return max((each.size for each in self.arrows), default=0.0)

    def vector(self, each: Arrow, point: float) -> np.ndarray:
        """The arrow of a force in data units."""
        if self.scale is not None:
            return each.force * self.scale
        return each.force / max(each.size, 1e-300) * _FIXED * point


def on_bodies(scene: Scene, wrenches: list[tuple[np.ndarray, np.ndarray]]) -> list[Arrow]:
    """Loads of the joints on their bodies i, without rounding."""
    out = []
    for joint in scene.joints:
        force, moment = (part[joint.member] for part in wrenches[joint.group])
        body = scene.names[joint.i] if joint.i < scene.ground else "ground"
        about = float(moment_about(moment, force, joint.loaded_at - scene.centres[joint.i]))
        out.append(Arrow(joint.name, body, joint.loaded_at, joint.spot, force, about))
    size = float(np.ptp(scene.points(), axis=0).max()) or 1.0
    least = _SMALLEST * max((max(a.size, abs(a.moment) / size) for a in out), default=0.0)
    found = []
    for each in out:
        force = kept(each.force, least)
        moment = each.moment if abs(each.moment) > least * size else 0.0
        if np.any(force) or moment:
            found.append(dataclasses.replace(each, force=force, moment=moment))
    return found


def kept(values: np.ndarray, least: float) -> np.ndarray:
    """Values with 0 for those that are not larger than `least`."""
    return np.where(np.abs(values) > least, values, 0.0)


def draw_arrows(pen: Pen, scene: Scene, groups: list[Arrows]) -> list[Label]:
    """Draw all loads and return the labels with their values."""
    labels: list[Label] = []
    drawn: list[tuple[np.ndarray, np.ndarray]] = []
    turns: list[np.ndarray] = []
    guides = [joint.on_i for joint in scene.joints if joint.axis is not None]
    force, moment = scene.units.of("force"), scene.units.of("moment")
    for group in groups:
        look = group.look
        style = {"fill": look.fill, "edge": look.edge, "linewidth": line_width(look)}
        for number, each in enumerate(group.arrows):
            name, text = each.name or str(number), value_text(each)
            if np.any(each.force):
                vector = group.vector(each, pen.point)
                tail = beside(pen, each.at, vector, drawn)
                pen.arrow(tail, tail + vector, z=ARROW_Z, gid=f"{look.gid} force {name}", **style)
                labels.append(at_tip(pen, tail, vector, each, look, text.format(quantity(each.size, force))))
            if each.moment:
                at = each.at if np.any(each.force) else each.spot
                radius = TURN + 6.0 * _near(at, turns, 4.0 * pen.point) + 6.0 * (_near(at, guides, pen.point) > 0)
                turns.append(at)
                pen.turn(at, radius, each.moment > 0, z=ARROW_Z + 0.1, gid=f"{look.gid} moment {name}", **style)
                labels.append(_at_turn(pen, at, radius, each, look, text.format(quantity(each.moment, moment))))
    return labels


def _near(at: np.ndarray, places: list[np.ndarray], distance: float) -> int:
    """How many places are nearer than a distance."""
    return int(np.sum(np.hypot(*(np.array(places).reshape(-1, 2) - at).T) < distance))


def value_text(each: Arrow) -> str:
    """What stands beside an arrow."""
    return (f"{each.name}: " if each.name else "") + "{}" + (f" on {each.body}" if each.body else "")


def line_width(look: Look) -> float:
    """Width of an arrow's edge, points."""
    return 1.2 if look.fill == "white" else 0.6


def _colour(look: Look) -> str:
    return dark(look.edge if look.fill == "white" else look.fill, 0.8)


def beside(pen: Pen, at: np.ndarray, vector: np.ndarray, drawn: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The tail of an arrow: the joint, or beside it where the arrow would lie on other ones."""
    length = np.hypot(*vector)
    unit = vector / length
    places, others = np.array(drawn).reshape(-1, 2, 2).swapaxes(0, 1)
    ends = (places - at) @ unit, (places + others - at) @ unit
    overlaps = (np.maximum(*ends) > 2.0 * pen.point) & (np.minimum(*ends) < length - 2.0 * pen.point)
    aligned = np.abs(others @ unit) > 0.97 * np.hypot(*others.T)
    covered = overlaps & aligned & (np.abs((places - at) @ across(unit)) < 4.0 * pen.point)
    drawn.append((at, vector))
    return at + across(unit) * 6.0 * pen.point * np.sum(covered)


def at_tip(pen: Pen, tail: np.ndarray, vector: np.ndarray, each: Arrow, look: Look, text: str) -> Label:
    """The value at the arrow's tip, or beside its shaft."""
    beyond = around(pen, tail + vector, 2.0, vector)
    side = across(vector) / np.hypot(*vector)
    shaft = [tail + share * vector + sign * 3.0 * pen.point * side for share in (0.8, 0.5) for sign in (1, -1)]
    normals, costs = np.array([side, -side, side, -side]), np.array([4.0, 4.0, 6.0, 6.0])
    places = [np.concatenate(pair) for pair in zip(beyond, (np.array(shaft), normals, costs), strict=True)]
    gid = f"{look.gid} force value {each.name}"
    return Label(text, gid, *places, colour=_colour(look), rank=2, patience=PATIENCE)


def _at_turn(pen: Pen, at: np.ndarray, radius: float, each: Arrow, look: Look, text: str) -> Label:
    gid = f"{look.gid} moment value {each.name}"
    return Label(text, gid, *around(pen, at, radius + 4.0), colour=_colour(look), rank=2, patience=PATIENCE)
