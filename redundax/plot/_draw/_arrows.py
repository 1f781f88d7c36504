"""Loads as arrows: forces to scale, moments as arrows with two heads along their axes, or circular ones seen end-on

A moment in space is to a scale of its own, the longest as long on paper as `MOMENT` points, and has its value; it turns
as the fingers of the right hand do with the thumb along the arrow. A force that points at the viewer is a ring with a
dot, one that points away a ring with a cross.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..._bodies._loads import AppliedForce
from ..._bodies._mechanism import Mechanism
from ..._bodies._reactions import reactions
from ..._system._state import State
from ._camera import View
from ._labels import PATIENCE, Label, around
from ._pen import Pen, Style, across, arrow
from ._scene import Scene, lifted
from ._style import APPLIED, ARROW_Z, LOAD, STRESS, TURN, dark, quantity

LONGEST = 62.0  # points, of the longest arrow unless a scale is given
MOMENT = 40.0  # points, of the longest arrow of a moment
_FIXED = 32.0  # points, of an arrow that is not to scale
_SMALLEST = 1e-4  # of the largest load; what is below is rounding or cannot be seen
_END_ON = 6.0  # points, below which an arrow is a ring, as its head alone is longer
_ASLANT = 0.35  # and its slope to the line of sight

Places = tuple[np.ndarray, np.ndarray, np.ndarray]  # of a label: anchors, normals and costs


@dataclasses.dataclass(frozen=True)
class Look:
    """How loads of one kind are drawn, and what the key calls them."""

    gid: str
    fill: str
    edge: str
    text: str

    @property
    def style(self) -> Style:
        """Of an arrow's polygon."""
        return {"fill": self.fill, "edge": self.edge, "linewidth": 1.2 if self.fill == "white" else 0.6}

    @property
    def colour(self) -> str:
        """Of lines."""
        return self.edge if self.fill == "white" else self.fill


LOADS = Look("load", LOAD, "white", "joint load on the named body; friction is not drawn")
SMOOTH = dataclasses.replace(LOADS, text="joint load on the named body")
STRESSES = Look("self-stress", "white", STRESS, "self-stress on the named body")
FORCES = Look("applied", APPLIED, "white", "")


@dataclasses.dataclass(frozen=True)
class Arrow:
    """Force and moment on a body at a point, (3,) each; a pure moment may be shown at `spot`."""

    name: str
    body: str
    at: np.ndarray
    spot: np.ndarray
    force: np.ndarray
    moment: np.ndarray

    @property
    def size(self) -> float:
        """|force|."""
        return float(np.linalg.norm(self.force))

    @property
    def turn(self) -> float:
        """|moment|."""
        return float(np.linalg.norm(self.moment))

    @property
    def text(self) -> str:
        """What stands beside it, with a gap for the value."""
        return (f"{self.name}: " if self.name else "") + "{}" + (f" on {self.body}" if self.body else "")


@dataclasses.dataclass
class Arrows:
    """Loads of one look; `scale` is the length of an arrow in data units for a force of 1, None where not to scale.

    `longest_moment` is that to which the longest arrow of a moment belongs, of all times, where moments are to scale.
    """

    look: Look
    arrows: list[Arrow]
    view: View
    scale: float | None = None
    longest_moment: float | None = None

    def largest_moment(self) -> float:
        """Largest moment."""
        return self.longest_moment or max((each.turn for each in self.arrows), default=0.0)

    def largest(self) -> float:
        """Largest force."""
        return max((each.size for each in self.arrows), default=0.0)

    def vector(self, each: Arrow, point: float) -> np.ndarray:
        """The arrow of a force on the picture, in data units."""
        scale = _FIXED * point / max(each.size, 1e-300) if self.scale is None else self.scale
        return self.view.flat(each.force) * scale

    def tips(self, point: float) -> list[np.ndarray]:
        """Where arrows of forces end on the picture."""
        return [self.view.flat(each.at) + self.vector(each, point) for each in self.arrows if each.size]


def joint_arrows(scene: Scene, mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[Arrow]:
    """Loads of the joints on their bodies i, or j where i is the ground, without rounding; of teeth where they touch,
    of others at the joint's point."""
    found = reactions(mechanism, state, multipliers).reshape(len(scene.joints), -1)
    forces, moments = (
        (lifted(found[:, :2]), found[:, 2:] * [0.0, 0.0, 1.0]) if found.shape[1] == 3 else np.split(found, 2, axis=1)
    )
    out = []
    for joint, force, moment in zip(scene.joints, forces, moments, strict=True):
        body, at = (joint.j, joint.on_j) if joint.i == scene.ground else (joint.i, joint.on_i)
        at = at if joint.mesh.pitch is None else joint.place
        name = scene.names[body] if body < scene.ground else "ground"
        out.append(Arrow(joint.name, name, at, joint.place, force, moment - np.cross(at - joint.told, force)))
    size = float(np.linalg.norm(np.ptp(scene.space_points, axis=0))) or 1.0
    least = _SMALLEST * max((max(each.size, each.turn / size) for each in out), default=0.0)
    out = [
        dataclasses.replace(each, force=_kept(each.force, least), moment=_kept(each.moment, least * size))
        for each in out
    ]
    return [each for each in out if each.size or each.turn]


def applied_arrows(scene: Scene) -> Arrows:
    """Forces and moments on single bodies."""
    given = [load for load in scene.loads if load.kind is AppliedForce]
    found = [Arrow("", "", load.on_i, load.on_i, load.force, load.moment) for load in given]
    return Arrows(FORCES, found, scene.camera.view)


def _kept(values: np.ndarray, least: float) -> np.ndarray:
    """Values with 0 for those that are not larger than `least`."""
    return np.where(np.abs(values) > least, values, 0.0)


@dataclasses.dataclass
class _Marks:
    """Arrows drawn so far, with their tails, circular ones, and guides, whose symbols are larger."""

    pen: Pen
    guides: list[np.ndarray]
    drawn: list[tuple[np.ndarray, np.ndarray]] = dataclasses.field(default_factory=list)
    turns: list[np.ndarray] = dataclasses.field(default_factory=list)

    def straight(self, at: np.ndarray, vector: np.ndarray, look: Look, gid: str, heads: int) -> Places:
        """An arrow with one head or two; places for its value at the tip, or beside its shaft."""
        pen, style = self.pen, look.style
        tail = self._beside(at, vector)
        tip = tail + vector
        if heads == 2:
            head = min(10.0 * pen.point, 0.4 * float(np.hypot(*vector))) * vector / np.hypot(*vector)
            pen.polygon(arrow(tail, tip - 0.8 * head, 2.4 * pen.point), z=ARROW_Z, **style)
            pen.arrow(tip - head, tip, style, ARROW_Z, f"{gid} head")
            pen.line([tail, tip], "none", gid=gid)
        else:
            pen.arrow(tail, tip, style, ARROW_Z, gid)
        beyond, side = around(pen, tip, 2.0, vector), across(vector) / np.hypot(*vector)
        shaft = [tail + share * vector + sign * 3.0 * pen.point * side for share in (0.8, 0.5) for sign in (1, -1)]
        normals, costs = np.array([side, -side, side, -side]), np.array([4.0, 4.0, 6.0, 6.0])
        first, second, third = (
            np.concatenate(pair) for pair in zip(beyond, (np.array(shaft), normals, costs), strict=True)
        )
        return first, second, third

    def _beside(self, at: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """The tail of an arrow: the joint, or beside it where the arrow would lie on other ones."""
        length, point = np.hypot(*vector), self.pen.point
        unit = vector / length
        places, others = np.array(self.drawn).reshape(-1, 2, 2).swapaxes(0, 1)
        ends = (places - at) @ unit, (places + others - at) @ unit
        overlaps = (np.maximum(*ends) > 2.0 * point) & (np.minimum(*ends) < length - 2.0 * point)
        aligned = np.abs(others @ unit) > 0.97 * np.hypot(*others.T)
        covered = overlaps & aligned & (np.abs((places - at) @ across(unit)) < 4.0 * point)
        self.drawn.append((at, vector))
        return at + across(unit) * 6.0 * point * np.sum(covered)

    def ring(self, at: np.ndarray, towards: bool, look: Look, gid: str) -> Places:
        """A force along the line of sight."""
        pen, colour, reach = self.pen, look.colour, 3.0 * self.pen.point
        pen.circle(at, 5.0, edge=colour, z=ARROW_Z, gid=gid, linewidth=1.6)
        if towards:
            pen.circle(at, 1.6, fill=colour, edge="none", z=ARROW_Z + 0.1)
        for slope in () if towards else (1.0, -1.0):
            pen.line(at + np.outer([-1.0, 1.0], [reach, slope * reach]), colour, ARROW_Z + 0.1)
        return around(pen, at, 8.0)

    def turn(self, at: np.ndarray, positive: bool, look: Look, gid: str) -> Places:
        """A moment about the line of sight, around those that are there and symbols."""
        radius = TURN + 6.0 * self._near(self.turns, at, 4.0) + 6.0 * (self._near(self.guides, at, 1.0) > 0)
        self.turns.append(at)
        self.pen.turn(at, radius, positive, look.style, ARROW_Z + 0.1, gid)
        return around(self.pen, at, radius + 4.0)

    def _near(self, places: list[np.ndarray], at: np.ndarray, points: float) -> int:
        """How many places are nearer than some points of print."""
        return int(np.sum(np.hypot(*(np.array(places).reshape(-1, 2) - at).T) < points * self.pen.point))


def draw_arrows(pen: Pen, scene: Scene, groups: Sequence[Arrows]) -> list[Label]:
    """Draw all loads and return the labels with their values."""
    labels, view = [], scene.camera.view
    marks = _Marks(pen, [scene.flat(joint.place) for joint in scene.joints if joint.slides])
    for group in groups:
        look, scale = group.look, MOMENT * pen.point / (group.largest_moment() or 1.0)
        for number, each in enumerate(group.arrows):
            for what, load in (("force", each.force), ("moment", each.moment)):
                if not np.any(load):
                    continue
                seen, at = view.axes @ load, view.flat(each.at if each.size else each.spot)
                vector = group.vector(each, pen.point) if what == "force" else scale * seen[:2]
                gid = f"{look.gid} {what} {each.name or number}"
                if np.hypot(*vector) >= _END_ON * pen.point or np.hypot(*seen[:2]) >= _ASLANT * abs(seen[2]):
                    places = marks.straight(at, vector, look, gid, 1 if what == "force" else 2)
                else:
                    places = (marks.ring if what == "force" else marks.turn)(at, bool(seen[2] >= 0), look, gid)
                unit = scene.units.of(what)
                value = each.text.format(quantity(float(np.linalg.norm(load)), unit))
                value = value if unit or what == "force" else f"moment {value}"
                colour, name = dark(look.colour, 0.8), f"{look.gid} {what} value {each.name}"
                labels.append(Label(value, name, *places, colour=colour, rank=2, patience=PATIENCE))
    return labels
