"""Errors of unsuccessful results, with the names of the rows or joints that they are about."""

from typing import Any, Protocol, TypeVar, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._system._contact import Contact, code_of
from .._system._names import by_joint
from .._system._pushing import warn_of_pulling
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError
from .._tools._module import is_concrete
from .._tools._numbers import stop_gradient
from ._factorisation import Factorisation, factorised
from ._gaps import overlaps
from ._kinematics import along_motion, explicit_gamma, slip_motion
from ._response import AbstractSolvedFactorisation

Out = TypeVar("Out", bound=Any)
_NEAREST = 3  # contacts, at most, that are named where a motion ends


def thrown(
    out: Out,
    throw: bool | None,
    system: AbstractSystem,
    state: State,
    factor: AbstractSolvedFactorisation | None,
    *good: RESULTS,
    end: Array | None = None,
) -> Out:
    """What has a `result`, which is an error unless it is among the good ones; `throw` is that of `solve`, and `end`
    the time that a motion got to.

    Of teeth that pull in a good one a warning tells the caller's caller.
    """
    traced = not all(map(is_concrete, jax.tree.leaves(out.result)))
    if throw is False or (throw is None and traced):
        return out
    if traced:
        return out.result.error_if(out, jnp.all(jnp.stack([out.result != one for one in good])))
    if not is_one_of(out.result, *good):
        out, system, state, factor, end = stop_gradient((out, system, state, factor, end))  # known, but differentiated
        told = culprits(system, state, factor, out.result)
        if end is not None and end > state.t:
            told = f" The motion got to t = {end:.6g}: with `throw=False` it is given up to there, and NaN beyond."
        if out.result == RESULTS.step_too_small:
            near, bound = out.stats.nearest_singularity, out.stats.contraction
            told = f" Here `nearest_singularity` is {near:.2g} and `contraction` {bound:.2g}.{told}"
        if end is not None and is_one_of(out.result, RESULTS.step_too_small, RESULTS.contacts_undecided):
            told += _about_to_change(system, out)
        raise NoSolutionError(RESULTS[out.result] + told)
    warn_of_pulling(out.names, out.multipliers)
    return out


def culprits(system: AbstractSystem, state: State, factor: AbstractSolvedFactorisation | None, result: RESULTS) -> str:
    """A sentence with the names, on concrete values, or nothing where names do not help or nothing is factorised."""
    if factor is None:
        return ""
    if result == RESULTS.violated_constraints:
        value, apart = _apart(system, state)
        return _rows(system, np.where(apart, 0.0, value), "Violated rows")
    if result == RESULTS.inadmissible_velocity:
        rate = np.where(_apart(system, state)[1], 0.0, np.asarray(along_motion(system, state).rate))
        rates = _rows(system, rate, "Rows with the largest rates")
        if factor.local:  # which leaves out the self-stress of here alone
            factor = factorised(system, state, factor.spectrum.rank)
        return rates or _rows(system, np.asarray(factor.contradicting(factor.gamma)), "N^T gamma in rows")
    if result == RESULTS.inconsistent_constraints:
        return _rows(system, np.asarray(explicit_gamma(system, state)), "Rows that prescribe an acceleration")
    if result == RESULTS.indeterminate_acceleration and isinstance(factor, Factorisation):
        return f" Free without mass: {', '.join(_massless(system, factor))}."
    if result == RESULTS.indeterminate_closure:
        rows = np.flatnonzero(~np.asarray(factor.unique_multipliers))
        return f" Rows in self-stress: {by_joint([system.rows.labels[k] for k in rows])}."
    if result == RESULTS.ambiguous_rank:
        spectrum = factor.spectrum
        near = [f"{value:.1e}" for value in np.asarray(spectrum.singular_values)[-3:]]
        return f" Smallest singular values: {', '.join(near)}; tolerance {float(spectrum.tolerance):.1e}." + (
            " In float32 singular values below about 1e-4 of the largest cannot be told from rounding: use float64, "
            "jax.config.update('jax_enable_x64', True), before the mechanism is built."
            if state.qd.dtype == np.float32
            else ""
        )
    if result == RESULTS.singular_position and system.velocity_rows:
        return " Rows of velocity have no second derivative of a position, so that with them no velocity is asked."
    if result in (RESULTS.friction_at_rest, RESULTS.ambiguous_rest):
        slips = system.slips
        rate = slip_motion(system, state)[0] * np.where(slips.angular, factor.length, 1.0)
        resting, labels = np.asarray(~factor.motion_of(rate).is_yes), slips.labels
        return f" At rest: {', '.join(label for label, rests in zip(labels, resting, strict=True) if rests)}."
    return ""


@runtime_checkable
class Motion(Protocol):
    """What is read of a motion, each with an axis for times in front."""

    @property
    def states(self) -> State: ...
    @property
    def qd(self) -> Array: ...
    @property
    def multipliers(self) -> Array: ...
    @property
    def contact(self) -> Array | None: ...


def _about_to_change(system: AbstractSystem, motion: Motion) -> str:
    """Contacts that are nearest to closing or opening at the last time that a motion is given at, the nearest first."""
    known = np.flatnonzero(np.isfinite(np.asarray(motion.qd)).all(axis=1))
    if motion.contact is None or not known.size:
        return ""
    last = known[-1]
    state = jax.tree.map(lambda x: x[last], motion.states)
    loads = np.asarray(motion.multipliers)[known][:, list(system.names.one_sided)]
    most = np.fmax.reduce(loads, axis=0, initial=np.finfo(loads.dtype).tiny)
    left_out = np.asarray(motion.contact)[last] == code_of(Contact.open)
    part = np.where(left_out, np.abs(np.asarray(overlaps(system, state))), loads[-1] / most)
    whole = np.where(left_out, "the size of the mechanism apart", "its largest load")
    words = [
        f"{system.names.contacts[k]} ({part[k]:.1e} of {whole[k]})"
        for k in np.argsort(part)[:_NEAREST]
        if np.isfinite(part[k])  # loads at rest are not known
    ]
    return f" Nearest to closing or opening at t = {state.t:.6g}: {', '.join(words)}." if words else ""


def _apart(system: AbstractSystem, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Phi, and which rows are of contacts that have a gap."""
    value, contacts = np.asarray(along_motion(system, state).value), list(system.names.one_sided)
    return value, np.isin(np.arange(value.size), contacts) & (value < 0)


def _massless(system: AbstractSystem, factor: Factorisation) -> list[str]:
    """Coordinates of the motions that meet the constraints and have no mass."""
    scale = np.where(system.coordinates.angular, 1 / float(factor.length), 1.0)
    mass = np.asarray(factor.mass) * scale[:, None] * scale
    rows = [np.asarray(factor.jacobian) * scale, mass / max(np.abs(mass).max(), np.finfo(mass.dtype).tiny)]
    values, vectors = np.linalg.eigh(sum(part.T @ part for part in rows))
    free = np.abs(vectors[:, values <= max(1e-12 * values[-1], values[0])]).max(axis=1)
    return [name for name, size in zip(system.coordinates.labels, free, strict=True) if size > 0.1 * free.max()]


def _rows(system: AbstractSystem, values: np.ndarray, what: str) -> str:
    """Rows within a factor of 10 of the largest of their kind, where that is more than rounding."""
    size, angular = np.abs(values), system.rows.angular
    large = np.zeros(size.size, bool)
    for kind in (angular, ~angular):
        largest = size[kind].max(initial=0.0)
        large |= kind & (size > max(0.1 * largest, 1e-9 * size.max(), 1e-12))
    names = [f"{system.rows.labels[k]} ({values[k]:.2g})" for k in np.flatnonzero(large)]
    return f" {what}: {', '.join(names)}." if names else ""
