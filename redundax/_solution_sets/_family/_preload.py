"""The preload that is assumed where none is given, and the pick of minimum norm that no unit changes.

    f_i = lam_i  of force-type rows,   f_i = lam_i / a_i  of moment-type rows      a moment as a force at the arm a
    |z| max |f(s)| <= F = max |f(lam)|,   lam of least |f|

The arm is the length of the joint's guide, else the length L of the mechanism. F and arms carry units, so that the
amplitudes z of a state s are the same self-stress in all of them.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np

from ..._bodies._mechanism import Mechanism
from ..._closures._closure import AbstractClosure, MinimumNorm
from ..._equations._factorisation import Factorisation
from ..._system._system import AbstractSystem
from ..._system._units import Units
from ...units._rescaled import Rescaled

_ROUNDING = 1e-9  # of the applied loads, below which joint loads are none


@dataclasses.dataclass(frozen=True)
class Preload:
    """A bound `load` on self-stress as a force, where moments count at the `arms`, shape (m,), 1 of force-type rows.

    `found` says what sets it: "joint load", "applied load", or nothing where there is no load at all. `length` is that
    of the mechanism, `units` those of force and length, "" where none are stated.
    """

    load: float
    arms: np.ndarray
    length: float
    found: str
    units: tuple[str, str]

    def axes(self, stress: np.ndarray, samples: int) -> tuple[np.ndarray, ...]:
        """Amplitudes along each of the states (k, m); several states share the samples, each has about its root."""
        each = samples if len(stress) == 1 else max(2, 2 * round(samples**0.5 / 2) + 1)
        return tuple(np.linspace(-1, 1, each) * self.load / np.abs(row / self.arms).max() for row in stress)

    def __str__(self) -> str:
        figures = zip((self.load, self.length), self.units, strict=True)
        force, length = (f"{figure:.4g} {unit}".rstrip() for figure, unit in figures)
        size = f"as large as the largest {self.found} without friction, {force}" if self.found else f"of {force}"
        return (
            f"This assumes a preload {size}, where a moment counts as a force at the length of its guide, or else at "
            f"{length}, a length of the mechanism. It is no bound: give the preload that you know."
        )


def preload(system: AbstractSystem, factor: Factorisation, stress: np.ndarray) -> Preload:
    """The assumed preload, given all self-stress states (k, m)."""
    length, units = float(factor.length), (system.names.units.of("force"), system.names.units.of("linear"))
    arms = np.where(system.rows.angular, _arms(system, length), 1.0)
    lam, states = np.asarray(factor.multipliers) / arms, stress / arms
    joint = np.abs(lam - states.T @ (np.linalg.pinv(states.T) @ lam)).max(initial=0.0)
    applied = np.abs(np.asarray(factor.load) / np.where(system.coordinates.angular, length, 1.0)).max(initial=0.0)
    if joint > _ROUNDING * applied:
        return Preload(float(joint), arms, length, "joint load", units)
    return Preload(float(applied) or 1.0, arms, length, "applied load" if applied else "", units)


def _arms(system: AbstractSystem, length: float) -> np.ndarray:
    """Arms (m,) at which the rows' multipliers would be moments, given a length of the mechanism."""
    if isinstance(system, Rescaled):
        factor = float(system.units.length / system.units.angle)
        return factor * _arms(system.inner, length / factor)
    if not isinstance(system, Mechanism):
        return np.full(len(system.rows), length)
    each = []
    for stack in system.joints:
        shape = len(stack.i), len(stack.element.row_kinds)
        guide = stack.element.moment_arm()
        guide = np.zeros(1) if guide is None else np.asarray(guide, float)
        each.append(jnp.broadcast_to(jnp.where(guide > 0, guide, length).reshape(-1, 1), shape))
    return np.asarray(system.of_rows(each, length))


def unit_free_norm(factor: Factorisation) -> MinimumNorm:
    """Minimum norm in units in which the length of the mechanism is 1."""
    return MinimumNorm(units=Units(length=1 / factor.length))


def in_words(closure: AbstractClosure) -> str:
    """What a closure picks."""
    if not isinstance(closure, MinimumNorm):
        return f"the solution of {type(closure).__name__}"
    other = "" if closure.units is None else f" with lengths in units of {1 / float(closure.units.length):.4g}"
    return f"the minimum norm{other}{'' if closure.h is None else ' with h'}"
