"""What a file of a model says, whatever its format: bodies, joints, loops, drives, and what of it was left out

Points and axes are global, in the reference pose, in which all joints are closed at their `reference` positions. Bodies
that a file fixes to each other are one; between two joints of a body sits a body without mass. So body k hangs on joint
k - 1, parents come before children, and body 0 is the ground. What closes the loops of that tree is a `Loop`, and what
ties displacements of joints to each other a `Tie`.
"""

import dataclasses
from collections.abc import Callable, Container, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._tools._numbers import Numeric
from ._kinds import KINDS
from ._series import Series

WITHOUT = "; the figures are without it"
CLOSING = "closing of "  # a joint of the tree, which begins a note that it moved a body


@dataclasses.dataclass(frozen=True, eq=False)
class Body:
    """A body: where its frame is, its mass, kg, its centre and its inertia about that, kg m^2."""

    name: str
    position: np.ndarray
    axes: np.ndarray
    mass: float
    centre: np.ndarray
    inertia: np.ndarray

    @staticmethod
    def massless(name: str, position: np.ndarray, axes: np.ndarray) -> "Body":
        """One that weighs nothing."""
        return Body(name, position, axes, 0.0, position, np.zeros((3, 3)))


class End(NamedTuple):
    """What a joint holds of a body: its number, a point, and axes of which z is the joint's own."""

    body: int
    point: np.ndarray
    axes: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Joint:
    """A joint that a body hangs on.

    - `kind`: one of `KINDS` that a body may hang on.
    - `reference`, `rest`: positions, as the file counts them, in the reference pose and where its spring is free.
    - `limits`: the least and the largest position of a hinge or slide, or of a ball how far it turns; None if any.
    - `stiffness`, `damping`, `armature`, `friction`: of the spring, the damper, the rotor and dry friction, SI.
    - `untaken`: what else acts in it, which has no words here.
    """

    name: str
    kind: str
    child: End
    parent: End
    reference: np.ndarray
    rest: np.ndarray
    limits: tuple[float, float] | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    armature: float = 0.0
    friction: float = 0.0
    untaken: tuple[str, ...] = ()


class Loop(NamedTuple):
    """Two bodies that a joint of a kind closes to a loop: at a point ("connect"), wholly ("weld"), or as joints do.

    - `value`: what the kind counts from, m or rad: a distance, an offset, an angle.
    - `limits`: of a hinge or slide the least and the largest position of the second end as the first sees it; None if
      any.
    """

    name: str
    kind: str
    first: End
    second: End
    value: float = 0.0
    limits: tuple[float, float] | None = None


Term = tuple[int | Loop, float]


class Tie(NamedTuple):
    """A sum of displacements of joints as a polynomial of that of others, as numbers of joints and weights; of no
    others a number. In place of a joint may stand a distance of two points, as a loop of kind "distance joint", and
    its displacement from the value of that."""

    name: str
    first: tuple[Term, ...]
    second: tuple[Term, ...]
    polynomial: np.ndarray


class Motor(NamedTuple):
    """A drive of a joint by a law of time: its name, the number of the joint, which of its displacements it gives, and
    what that is, rad or m, as a function of t in s."""

    name: str
    joint: int
    coordinate: int
    law: Callable[[Numeric], Numeric]


class Place(NamedTuple):
    """Where a file has a joint, as its format counts; and whether something else of the file acts in the joint, which
    one that leaves more free would not take."""

    at: Any
    is_used: bool = False


@dataclasses.dataclass(frozen=True, eq=False)
class Description:
    """A model as its file has it.

    - `drives`: their names; `rates`: their rates by the velocities of the joints at positions of these, (drives, nv).
    - `motors`: those that the file drives by laws of time.
    - `points`: that tell how large it is, (points, 3); `keyframes`: positions of all joints, by name.
    - `notes`: what was left out, a line each; `is_soft`: whether the program of the format makes springs of loops.
    - `cables`: what two bodies cannot be farther apart than, as loops of kind "distance joint".
    - `lifts`: constant forces that carry weight, N: the number of the body, the point of it, and the force.
    - `series`: what a program has stored of a run; `origin`: what the format itself keeps of the file, as places of
      joints by their names.
    """

    format: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    loops: tuple[Loop, ...]
    ties: tuple[Tie, ...]
    gravity: tuple[float, float, float]
    drives: tuple[str, ...]
    rates: Callable[[np.ndarray], np.ndarray]
    points: np.ndarray
    keyframes: dict[str, np.ndarray]
    notes: tuple[str, ...]
    is_soft: bool = False
    motors: tuple[Motor, ...] = ()
    cables: tuple[Loop, ...] = ()
    lifts: tuple[tuple[int, np.ndarray, np.ndarray], ...] = ()
    series: Series | None = None
    origin: Any = None

    def body(self, end: End) -> Body:
        """The body that an end is on."""
        return self.bodies[end.body]

    def child(self, joint: Joint) -> str:
        """The name of the body that hangs on a joint."""
        return self.bodies[joint.child.body].name

    def parent(self, joint: Joint) -> str:
        """The name of the body that a joint hangs on."""
        return self.bodies[joint.parent.body].name

    def is_between(self, joint: Joint) -> bool:
        """Whether the body on a joint is one without mass between two joints of a body of the file."""
        return self.child(joint).endswith(f" after {joint.name}")

    def weight_on(self, joint: Joint) -> float:
        """The mass that hangs on a joint, kg."""
        hung = {joint.child.body}
        for each in self.joints:
            if each.parent.body in hung:
                hung.add(each.child.body)
        return float(sum(self.bodies[body].mass for body in hung))


def drive_rates(joints: Sequence[Joint], coordinates: Sequence[tuple[int, int]]) -> np.ndarray:
    """Rates of coordinates of joints, by numbers of both, by the velocities of all joints, (drives, nv)."""
    starts = np.cumsum([0, *(KINDS[joint.kind].sizes[1] for joint in joints)])
    return np.eye(starts[-1])[np.array([starts[joint] + coordinate for joint, coordinate in coordinates], int)]


def unique(names: list[str], taken: Container[str]) -> list[str]:
    """The names, with a number after those that occur before."""
    found: list[str] = []
    for name in names:
        number, own = 1, name
        while own in found or own in taken:
            number += 1
            own = f"{name} ({number})"
        found.append(own)
    return found


def missing_of(notes: list[str] | tuple[str, ...]) -> list[str]:
    """Of what is left out, that which constrains."""
    return [note.partition(" is left out")[0] for note in notes if note.endswith(WITHOUT)]
