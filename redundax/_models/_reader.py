"""What readers of files share whose parts are held together by joints: refusals, numbers, notes and the description"""

import abc
import pathlib
from collections.abc import Mapping, Sequence

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._words import short
from ._assembly import NOWHERE, Assembly, Frame, Held
from ._content import numbers_in, refusal
from ._description import WITHOUT, Description, Motor, Place, Tie, drive_rates, unique
from ._series import Series

LARGEST = 1e30  # of a number of a file, in its units
_NOTHING = 0.0, np.zeros(3), np.zeros((3, 3))  # what weighs nothing


class AbstractReader(abc.ABC):
    """A file that is being read: its parts, of which 0 is the ground, where they are, and the mass, centre and inertia
    of each in its frame; those that gravity leaves alone; and notes of what is left out."""

    form = ""

    def __init__(self, path: pathlib.Path):
        self._path = path
        self._notes: list[str] = []
        self._parts: list[str] = []
        self._poses, self._weights = [NOWHERE], [_NOTHING]
        self._carried: list[int] = []
        self._begin(path)

    @abc.abstractmethod
    def _begin(self, path: pathlib.Path) -> None:
        """Read the parts of a file."""

    def _refuse(self, why: str) -> RedundaxError:
        return refusal(self._path, why)

    def _leave_out(self, what: str, why: str, *, constrains: bool = True) -> None:
        """Note something that is left out."""
        self._notes.append(f"{what} is left out: {why}{WITHOUT if constrains else ''}")

    def _add(self, name: str, pose: Frame, weight: tuple[float, np.ndarray, np.ndarray] = _NOTHING) -> int:
        """A part more, and its number."""
        self._parts.append(name)
        self._poses.append(pose)
        self._weights.append(weight)
        return len(self._parts)

    def _numbers(self, text: str | None, count: int, where: str, largest: float = LARGEST) -> np.ndarray:
        """Numbers of a text; `where` it stands."""
        found = numbers_in(text, count, largest)
        if found is None:
            raise self._refuse(f"must have {count} numbers in {where}, but has {short(text)}. Correct it")
        return found

    def _assembled(self, held: Sequence[Held]) -> Assembly:
        """The parts as joints hold them."""
        found = Assembly(self._parts, self._poses, held)
        self._notes += found.notes
        return found

    def _described(
        self,
        assembly: Assembly,
        gravity: Sequence[float] | np.ndarray,
        driven: Sequence[tuple[str, int, int]] = (),
        shapes: int = 0,
        *,
        ties: tuple[Tie, ...] = (),
        motors: tuple[Motor, ...] = (),
        series: Series | None = None,
        origin: Mapping[str, Place] | None = None,
    ) -> Description:
        """The description of parts that joints hold; `driven`: names of drives, and the numbers of their joints and
        coordinates; `shapes`: how many are left out."""
        bodies, joints = assembly.bodies(self._weights), tuple(assembly.joints)
        rates = drive_rates(joints, [drive[1:] for drive in driven])
        self._notes += [f"contact of {shapes} shape{'s' * (shapes > 1)}"] if shapes else []
        x, y, z = map(float, gravity)
        carried = [assembly.ends[part] for part in self._carried]
        return Description(
            self.form,
            bodies,
            joints,
            assembly.loops(),
            ties,
            (x, y, z),
            tuple(name for name, _, _ in driven),
            lambda positions: rates,
            np.array([body.centre for body in bodies] + [joint.child.point for joint in joints]),
            {},
            tuple(self._notes),
            motors=motors,
            lifts=tuple((k, bodies[k].centre, -bodies[k].mass * np.array([x, y, z])) for k in carried),
            series=series,
            origin=origin,
        )


def named(held: Sequence[Held]) -> list[Held]:
    """The same with a name of its own each."""
    names = unique([each.name for each in held], ())
    return [each._replace(name=name) for each, name in zip(held, names, strict=True)]
