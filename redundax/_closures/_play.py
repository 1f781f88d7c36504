"""Play of joints: by how much a pin is smaller than its hole, as part of a closure.

A joint with play c carries nothing until its parts have moved by c, and then as one whose misfit is c less along its
load: its loads cost c |lam| of energy. Pins, sleeves and balls have it in all directions alike, c |lam_xy|.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._mechanism import Mechanism
from .._system._names import index_of
from .._system._units import Units
from .._tools._errors import RedundaxError
from .._tools._module import as_float, check_kind, finite, not_negative
from .._tools._numbers import entries_set, take, xp
from .._tools._value import AbstractModule
from .._tools._words import warn

_ROUND = ({"x", "y"}, {"radial_1", "radial_2"})  # rows of pins and sleeves, which have play in a disc


class Play(AbstractModule):
    """Clearances c of groups of rows, m or rad, and the rows of each."""

    clearance: Float[Array, " g"]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)

    def of_rows(self, m: int) -> Float[Array, " m"]:
        """c of each row, 0 where there is none."""
        out = xp.zeros(m, self.clearance.dtype)
        for k, rows in enumerate(self.rows):
            out = entries_set(out, np.array(rows), take(self.clearance, np.full(len(rows), k)))
        return out

    def together(self, m: int) -> np.ndarray:
        """Which rows have their play together, shape (m, m); those without play are alone."""
        group = np.arange(m)
        for rows in self.rows:
            group[list(rows)] = rows[0]
        return group[:, None] == group


def play_of(mechanism: Mechanism, given: Mapping[str, ArrayLike] | None, units: Units) -> Play | None:
    """That of joints and rows by name, in the units of the mechanism; None where there is none."""
    if not given:
        return None
    check_kind("play", given, Mapping, "clearances by name", 'Give {"A": 20e-6} by name of joint or row.')
    rows, clearances = [], []
    for name, clearance in given.items():
        own, value = _rows(mechanism, name), as_float(clearance, "play")
        if value.shape != ():
            raise RedundaxError(
                f"Argument `play` must have one number for '{name}', but has {value.shape}. Give its clearance from "
                "the middle to either side."
            )
        finite("play", value, f"'{name}'")
        not_negative("play", value)
        taken = {row for each in rows for row in each} & set(own)
        if taken:
            raise RedundaxError(
                f"Argument `play` must name each row once, but names {mechanism.rows.labels[min(taken)]} twice. "
                "Name the joint, or its rows."
            )
        is_angle = mechanism.rows.kinds[own[0]] == "moment"
        rows.append(own)
        clearances.append(value / (units.angle if is_angle else units.length))
    return Play(xp.stack(clearances), tuple(rows))


def _rows(mechanism: Mechanism, name: str) -> tuple[int, ...]:
    """The rows that have their play together, by the name of a joint or of one of them."""
    labels, kinds = mechanism.rows.labels, mechanism.rows.kinds
    if name in labels:
        return (labels.index(name),)
    index_of("play", name, (*mechanism.names.joint_names, *labels), " of joints and rows")
    own = [k for k, label in enumerate(labels) if label.rpartition(".")[0] == name]
    if len(own) == 1 or all(kinds[k] == "force" for k in own):
        return tuple(own)
    if found := round_rows(labels, name):
        return found
    raise RedundaxError(
        f"Argument `play` names joint '{name}', which has play in no disc. Name its rows instead: "
        f"{', '.join(labels[k] for k in own)}."
    )


def round_rows(labels: Sequence[str], name: str) -> tuple[int, ...]:
    """The two rows of a pin or sleeve across its axis; none of another joint."""
    for parts in _ROUND:
        found = tuple(k for k, label in enumerate(labels) if label in {f"{name}.{part}" for part in parts})
        if len(found) == len(parts):
            return found
    return ()


def warn_of_idle_play(play: Play, redundant: np.ndarray, labels: Sequence[str]) -> None:
    """Tell which play changes no load, given the rows whose loads are not unique."""
    idle = [rows for rows in play.rows if not np.any(redundant[list(rows)])]
    if idle:
        names = [labels[rows[0]] if len(rows) == 1 else labels[rows[0]].rpartition(".")[0] for rows in idle]
        loads = "its loads are" if len(idle) == 1 else "their loads are"
        warn(f"Play of {', '.join(names)} changes no load: {loads} unique.")


T = TypeVar("T")


def without_play(closure: T) -> T:
    """The same closure of joints that fit."""
    return jax.tree.map(lambda x: None if isinstance(x, Play) else x, closure, is_leaf=lambda x: isinstance(x, Play))


def refuse_play(play: Play | None, call: str = "this call", instead: str = "`solve` does") -> None:
    """Refuse the play of a closure, for a call that would leave it out."""
    if play is not None:
        raise RedundaxError(
            f"Argument `closure` has play, which {call} does not take; {instead}. "
            "Give it without `play`, or with its bounds as misfits."
        )
