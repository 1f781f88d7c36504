"""The outputs that a band is asked for, as y = Y [qdd; lam; tau] + y_0."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..._analysis._analyze import Report
from ..._analysis._outputs import evaluated, joint_accelerations
from ..._analysis._outputs import outputs as named_outputs
from ..._analysis._verdict import Verdict
from ..._system._names import index_of
from ..._system._state import State
from ..._system._system import AbstractSystem
from ..._tools._errors import RedundaxError
from ..._tools._module import names_in
from .._solution_set import SolutionSet


class Wanted(NamedTuple):
    """Names and kinds of outputs y = matrix [qdd; lam; tau] + offset, and which are proved unique.

    The first `asked` were asked for; rows of teeth follow.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    matrix: np.ndarray
    offset: np.ndarray
    unique: np.ndarray
    asked: int


def wanted_outputs(system: AbstractSystem, state: State, outputs: Sequence[str] | str | None, report: Report) -> Wanted:
    """Those of these names, all accelerations of coordinates where there are none."""
    known, unknowns, joints = named_outputs(system, state), system.names.unknowns, system.names.joint_coordinates
    names = known["acceleration"][0] if outputs is None else names_in("outputs", outputs)
    if not names:
        raise RedundaxError(
            "Argument `outputs` must hold names of outputs, but holds none. Give None for all accelerations."
        )
    asked = len(names)
    if not report.undetermined:
        names = [*names, *(system.rows.labels[row] for row in system.names.pushing)]
    kinds = dict(zip(unknowns.labels, unknowns.kinds, strict=True))
    moving = {f"{label}''": kind for label, kind in zip(joints.labels, joints.kinds, strict=True)}
    labels = [*(name for group, _ in known.values() for name in group), *moving]
    kinds |= moving | dict(zip(system.names.reactions.labels, system.names.reactions.kinds, strict=True))
    places = [index_of("outputs", name, labels, " of outputs") for name in names]
    judged = [
        one.with_friction in (Verdict.UNIQUE, Verdict.ZERO) for group in report.verdicts.values() for one in group
    ]
    matrix, offset = np.concatenate([matrix for _, matrix in known.values()]), np.zeros(len(labels))
    if any(name in moving for name in names):
        slopes, bends = joint_accelerations(system, state)
        offset[len(matrix) :] = bends
        matrix = np.concatenate([matrix, slopes])
        n = len(system.coordinates)
        judged += [all(itertools.compress(judged[:n], slope[:n])) for slope in slopes]
    chosen = matrix[places], offset[places], np.array(judged)[places]
    return Wanted(tuple(names), tuple(kinds[name] for name in names), *chosen, asked)


def check_values(names: tuple[str, ...], matrix: np.ndarray, solutions: SolutionSet) -> None:
    """Refuse outputs that have no value at a singular position."""
    lost = np.isnan(evaluated(matrix, solutions.shown(np.zeros(matrix.shape[1]))))
    if lost.any():
        none = ", ".join(name for name, gone in zip(names, lost, strict=True) if gone)
        raise RedundaxError(
            f"Argument `outputs` must have values at this state, but it is at a singular position where {none} have "
            "none: they are unbounded beside it, or their limit is not known. Leave them out, or move the state."
        )
