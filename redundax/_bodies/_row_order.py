"""The order of the rows of a mechanism: force-type rows of all joints, then their moment-type rows, Eq. (61)."""

from collections.abc import Sequence

import numpy as np

from .._system._axis import Axis
from .._tools._errors import RedundaxError
from ._coupler import CoupledRow
from ._joints import AbstractJoint
from ._speed_driver import SpeedRow

AnyRows = AbstractJoint | CoupledRow | SpeedRow


def pushing_rows(joints: Sequence[AnyRows], rows: Axis) -> tuple[int, ...]:
    """Rows whose contacts push alone."""
    return tuple(rows.labels.index(f"{joint.name}.{row}") for joint in joints for row in joint.pushing)


def velocity_rows(joints: Sequence[AnyRows], rows: Axis) -> tuple[int, ...]:
    """Rows that constrain velocities alone."""
    return tuple(rows.labels.index(f"{joint.name}.{row}") for joint in joints for row in joint.velocity_rows)


def tied_rows(joints: Sequence[AnyRows], rows: Axis) -> tuple[tuple[int, ...], ...]:
    """Of each row whose contact pushes alone the rows of velocity of its joint, which open with it."""
    found = []
    for joint in joints:
        if joint.velocity_rows and len(joint.pushing) != 1:
            raise RedundaxError(
                f"Argument `one_sided` of joint '{joint.name}' must be left out, or it must have one row that pushes, "
                f"with which its rows of velocity open, but it has {len(joint.pushing)}. Name one in `pushing`."
            )
        found += [velocity_rows([joint], rows)] * len(joint.pushing)
    return tuple(found)


def ordered_rows(
    joints: Sequence[AnyRows], groups: Sequence[Sequence[int]]
) -> tuple[Axis, np.ndarray, list[np.ndarray]]:
    """The rows, force-type first and in the order of the joints; and where the rows come from and go to.

    The residuals of all kinds of joints, one after the other, are taken in the order `source`, shape (m,); the rows
    of the members of each kind are `places`, shape (members, rows) each.
    """
    flat = [(k, column) for group in groups for k in group for column in range(len(joints[k].row_kinds))]
    given = sorted(range(len(flat)), key=lambda position: flat[position])
    kinds = [joints[k].row_kinds[column][1] for k, column in flat]
    source = [p for wanted in ("force", "moment") for p in given if kinds[p] == wanted]
    row_of = {flat[position]: row for row, position in enumerate(source)}
    places = [np.array([[row_of[k, c] for c in range(len(joints[k].row_kinds))] for k in group]) for group in groups]
    names = tuple(f"{joints[k].name}.{joints[k].row_kinds[column][0]}" for k, column in row_of)
    return Axis(names, tuple(kinds[p] for p in source)), np.array(source), places
