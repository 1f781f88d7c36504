"""Evidence that the equations at a state can be trusted: consistency, motion of joints, and the nature of the position.

    |Phi|, |Phi_q qd + Phi_t|, |P gamma|   are zero at a consistent state,
    P Phi'' along a velocity qd + w        is -P gamma for all motions w where the rank is the same beside the state,

because P Phi_qq[w, w] is P times what the constraints bend along w: a row that depends on others for good bends as they
do. Rows of velocity have no Phi_qq. Of them P A' z along qd + w is zero for all motions z too, which the second
derivative along qd + w alone does not see: there the change of the whole Jacobian is asked.

The same is asked of the weakest constraint u^T Phi, of a small singular value u^T Phi_q v, as if it depended on the
others and v were a motion: beside a singular position it bends along v; if it does not either, it is what points of few
digits make of a row that depends on others. All of it is in the scaled variables of `_scaling`, and none of it has a
derivative.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from .._system._decision import CLEAR, Decision
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import batch_any
from .._tools._numbers import cond, or_one, xp
from .._tools._table import AbstractFigures
from .._tools._value import value
from ._kinematics import change_of_jacobian, second_derivative
from ._rank import Split
from ._scaling import Scaling

_ROUNDING = 10  # roundings of a state, and of what the constraints make of it
_POINTS = 1e-6  # of the size of a mechanism: what points of few digits make of a constraint that depends on others
_BENDS = 100  # times as much they make of its second derivative


@value
class Violation(AbstractFigures):
    """How far the state and the prescribed motion are from being consistent, free of units.

    - `position`: largest |Phi|, relative to the size of the mechanism.
    - `velocity`: largest |Phi_q qd + Phi_t|, relative to the velocity and to what accelerations reach.
    - `acceleration`: largest self-stress component of gamma, |P gamma|, relative to the accelerations.
    - `prescribed`: the same of its explicit part -Phi_tt, which driving constraints alone are answerable for.
    """

    position: Float[Array, ""]
    velocity: Float[Array, ""]
    acceleration: Float[Array, ""]
    prescribed: Float[Array, ""]


class ScaledMotion(NamedTuple):
    """What is known of the motion at a state, in scaled variables.

    - `qd`, `rate`: the velocity, and Phi_q qd + Phi_t.
    - `gamma`, `explicit`: Eq. (5), and its part -Phi_tt.
    - `acceleration`: without friction; `reached`: the velocity that it, or one without constraints, reaches over the
      size of the mechanism, so that rest and reversals are no special case.
    """

    qd: Float[Array, " n"]
    rate: Float[Array, " m"]
    gamma: Float[Array, " m"]
    explicit: Float[Array, " m"]
    acceleration: Float[Array, " n"]
    reached: Float[Array, ""]


def violation_of(motion: ScaledMotion, stress: Float[Array, "m m"], position: Array, size: Array) -> Violation:
    """Consistency of a state whose position violates the constraints by `position`."""
    sizes = motion.gamma, motion.acceleration, xp.max(xp.abs(motion.qd)) ** 2 / size
    return Violation(
        position,
        ratio(motion.rate, motion.qd, motion.reached),
        ratio(stress @ motion.gamma, *sizes),
        ratio(stress @ motion.explicit, *sizes),
    )


def rate_noise(motion: ScaledMotion, kept: Float[Array, ""]) -> Float[Array, ""]:
    """What rounding and violation can make of a slip rate that is zero; more than zero."""
    rounding = 10 * xp.finfo(motion.qd.dtype).eps
    magnified = xp.maximum(10.0, 1 / xp.minimum(kept, 1.0))
    own = rounding * xp.max(xp.abs(motion.qd)) + xp.max(xp.abs(motion.rate))
    noise = magnified * own + rounding * motion.reached
    return or_one(noise)


def singularity_of(
    system: AbstractSystem, state: State, motion: ScaledMotion, parts: Split, position: Array, scales: Scaling
) -> Decision:
    """Whether P Phi'' along the velocity with a motion w added is other than without, -P gamma."""
    found = singularity_by(_along_probe(system, state, motion, parts, scales), motion, parts, position, scales)
    if not system.velocity_rows:
        return found
    way = probe(motion, parts, scales)
    change = scales.scaled(change_of_jacobian(system, state, way, xp.ones_like(state.t)))
    turned = change @ parts.motion
    terms = (
        sum(xp.max(xp.abs(part)) for part in (turned, parts.inverse @ turned)) + _speed(motion, scales) / scales.size
    )
    changed = xp.max(xp.abs(parts.stress @ turned)) / terms
    return Decision(xp.maximum(found.margin, changed / _blur(motion, position)))


def singularity_by(
    bend: Float[Array, " m"], motion: ScaledMotion, parts: Split, position: Array, scales: Scaling
) -> Decision:
    """The same, given D^-1 Phi'' along the `probe`.

    Rounding moves Phi'' itself, the range of P by as much of K^+ Phi'', and a state off the manifold does too.
    """
    changed, _ = _bends(bend, motion, parts, scales)
    return Decision(changed / _blur(motion, position))


def _blur(motion: ScaledMotion, position: Array) -> Array:
    rounding = max(motion.gamma.size, motion.qd.size) * float(xp.finfo(motion.qd.dtype).eps)
    return _ROUNDING * (rounding + position)


def independence_of(
    system: AbstractSystem, state: State, motion: ScaledMotion, parts: Split, kept: Array, scales: Scaling
) -> Decision:
    """Whether the weakest constraint, of the smallest kept singular value, is more than points of few digits make.

    Where no constraint bends along its direction it is as weak everywhere, and not by the rounding of points.
    """
    holds = kept / _POINTS

    def beside() -> Array:
        others = _without_weakest(parts)
        changed, bend = _bends(_along_probe(system, state, motion, others, scales), motion, others, scales)
        found = xp.where(bend < CLEAR * _POINTS, xp.inf, changed / (_BENDS * _POINTS))
        return xp.where(holds < CLEAR, xp.maximum(holds, found), holds)

    return Decision(cond(batch_any(holds < CLEAR), beside, lambda: holds))


def _without_weakest(parts: Split) -> Split:
    """K^+ without its largest singular value, whose vectors alone are the self-stress, and a motion among the others.

    Steps of the power method find them, from the largest column.
    """
    inverse = parts.inverse
    v = inverse[:, xp.argmax(xp.linalg.norm(inverse, axis=0))]
    v = inverse @ (v @ inverse)
    u = v @ inverse
    u = u / xp.linalg.norm(u)
    v = inverse @ u
    size = xp.linalg.norm(v)
    return Split(inverse - xp.outer(v, u), xp.outer(u, u), parts.motion + xp.outer(v / size, v / size))


def probe(motion: ScaledMotion, parts: Split, scales: Scaling) -> Float[Array, " n"]:
    """The velocity with a motion w added.

    A direction of no symmetry sees a quadratic form that is not zero, and where time enters that the rank changes with
    it.
    """
    return scales.coordinates * (motion.qd + _speed(motion, scales) * _uneven(parts.motion, motion.qd))


def _speed(motion: ScaledMotion, scales: Scaling) -> Float[Array, ""]:
    speed = xp.max(xp.abs(motion.qd)) + motion.reached
    return xp.where(speed > 0, speed, scales.size)


def _along_probe(
    system: AbstractSystem, state: State, motion: ScaledMotion, parts: Split, scales: Scaling
) -> Float[Array, " m"]:
    """D^-1 Phi'' along it."""
    return second_derivative(system, state, probe(motion, parts, scales), xp.ones_like(state.t)) / scales.rows


def _bends(bend: Float[Array, " m"], motion: ScaledMotion, parts: Split, scales: Scaling) -> tuple[Array, Array]:
    """What the probe changes of P Phi'', relative to its terms, and of Phi'', to the size."""
    added = bend + motion.gamma
    changed = xp.max(xp.abs(parts.stress @ added))
    terms = sum(xp.max(xp.abs(part)) for part in (bend, motion.gamma, parts.inverse @ bend))
    whole = (2 * _speed(motion, scales)) ** 2 / scales.size
    return changed / (terms + whole), xp.max(xp.abs(added)) / whole


def _uneven(projector: Array, along: Array) -> Array:
    """A direction of no symmetry in the range of a projector, of largest entry 1; zero if it is.

    The column of the largest pivot, added with the sign of what is there, keeps it from being rounding; turned so that
    it does not point against a vector, with which it could cancel.
    """
    numbers, pivot = np.arange(1.0, len(projector) + 1), xp.argmax(xp.diagonal(projector))
    mixed = projector @ xp.asarray(np.cos(numbers**2), projector.dtype)
    mixed = mixed + xp.where(mixed[pivot] < 0, -2.0 * projector[pivot], 2.0 * projector[pivot])
    largest = xp.max(xp.abs(mixed))
    turned = xp.where(mixed @ along < 0, -mixed, mixed)
    return turned / or_one(largest)


def ratio(part: Array, *sizes: Array) -> Array:
    """Largest entry of `part` relative to the sum of the largest of `sizes`, at most 1; 0 if all are 0."""
    largest = xp.max(xp.abs(part))
    whole = sum(xp.max(xp.abs(size)) for size in sizes)
    return xp.where(largest > 0, largest / xp.maximum(largest, whole), largest)
