"""The one description of mechanisms in tests, fuzzing and benchmarks: what is joined to what, and the numbers apart.

Numbers are arrays with a leading batch axis, floats or 50 digits. `equations.evaluate` writes the equations of a
description by hand, `exact` solves them to 50 digits, and `registry` and `fuzzing.library` build redundax's.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

GROUND = -1
KINDS = ("revolute", "translational", "pin", "fixed", "gear", "angle", "distance", "rod")
FRICTION = (None, "coulomb", "constant")
ROWS = {
    "revolute": ("force", "force"),
    "translational": ("force", "moment"),
    "pin": ("force",),
    "fixed": ("force", "force", "moment"),
    "gear": ("moment",),
    "angle": ("moment",),
    "distance": ("force",),
    "rod": ("force",),
    "mesh": ("force",),
}
DRIVES = ("angle", "distance")


@dataclass(frozen=True)
class Joint:
    """A joint between the bodies i and j.

    - `number`: which random numbers it has; copies share them.
    - `parallel`: whose direction it has, its own `number` or that of another.
    - `link`: which of the vectors common to parallel cranks leads from the point drawn to the joint, or None.
    - `share`: factor of its load-independent friction and of its stiffness.
    """

    kind: str
    i: int
    j: int
    number: int
    parallel: int
    friction: str | None = None
    link: int | None = None
    share: float = 1.0

    @property
    def key(self) -> tuple[int, int]:
        """Joints of one key are stacked together, with one model of friction."""
        return KINDS.index("distance" if self.kind == "rod" else self.kind), FRICTION.index(self.friction)


@dataclass(frozen=True)
class Load:
    """A force, a force that follows the body, a spring or a torsion spring; `number` is that of its numbers."""

    kind: str
    i: int
    j: int
    number: int


@dataclass(frozen=True)
class Structure:
    """Bodies, joints and loads without their numbers; `bodies` are the numbers of the bodies, in order."""

    bodies: tuple[int, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    redundancy: int
    links: int = 0

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.bodies)

    @property
    def rows(self) -> list[tuple[int, int, str]]:
        """(place of the joint, place in the joint, kind) of every row, force-type rows first."""
        every = [(k, c, kind) for k, joint in enumerate(self.joints) for c, kind in enumerate(ROWS[joint.kind])]
        return [row for wanted in ("force", "moment") for row in every if row[2] == wanted]

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return len(self.rows)

    @property
    def rank(self) -> int:
        """Rank of the constraint Jacobian at generic poses."""
        return self.m - self.redundancy

    @property
    def frictional(self) -> list[int]:
        """Places of the joints with friction."""
        return [k for k, joint in enumerate(self.joints) if joint.friction]

    @property
    def numbers(self) -> int:
        """How many joints have numbers of their own."""
        return 1 + max(joint.number for joint in self.joints)


class Parameters(NamedTuple):
    """Random numbers as drawn, parameters of every joint, masses and moments of inertia of the bodies in order."""

    raw: dict[str, Any]
    joints: tuple[dict[str, Any], ...]
    mass: Any
    inertia: Any
