"""Scaled variables, in which lengths and angles compare.

    K = D^-1 Phi_q S,   S = diag(1 for linear, 1/L for angular coordinates),   D = row norms of Phi_q S,

with L a length of the mechanism that carries the length unit. A row that is rounding beside the others of its kind
counts as zero and is measured against them. Velocities, accelerations and displacements are S
times the scaled ones, multipliers D^-1 times. Derivatives treat the scales as constants, because no result
depends on them.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from .._sparse._symbolic import Symbolic
from .._system._system import AbstractSystem
from .._tools._by_number import sum_few
from .._tools._numbers import known, or_one, stop_gradient, take, xp
from ._kinematics import Model

# Radius of curvature beside a mechanism's usual size beyond which rows are straight where contacts have gaps: within
# that size their Jacobian is the same to a tenth. Coordinates do not enter, so that no shift of the origin counts.
_CURVED = 10.0


class Scaling(NamedTuple):
    """S, shape (n,), and D, shape (m,); the length L, which turns angles to lengths; and the size of the mechanism.

    The size is how far a radian, in the units of angles, moves a point at L.
    """

    coordinates: Float[Array, " n"]
    rows: Float[Array, " m"]
    length: Float[Array, ""]
    size: Float[Array, ""]

    def violations(self, values: Float[Array, "*times m"]) -> Float[Array, "*times m"]:
        """Values of constraints relative to the size of the mechanism; those of contacts are minus their gaps."""
        return values / self.rows / self.size

    def scaled(self, jacobian: Float[Array, "m n"]) -> Float[Array, "m n"]:
        """K of Phi_q."""
        return jacobian * self.coordinates / self.rows[:, None]


def largest_violation(dtype: DTypeLike) -> float:
    """How far off the manifold a state may be, relative to the size of the mechanism: 1e-6 in float64."""
    return float(xp.finfo(dtype).eps) ** 0.375


def scaling(system: AbstractSystem, model: Model) -> Scaling:
    """The scales of a system from its figures at a state."""
    model = stop_gradient(model)
    jacobian, length = model.jacobian, _length(system, model)
    columns = xp.where(system.coordinates.angular, 1 / length, 1.0).astype(jacobian.dtype)
    return scales_of(system, xp.linalg.norm(jacobian * columns, axis=1), columns, length)


def sparse_scaling(
    system: AbstractSystem,
    slopes: Float[Array, "m w s"],
    masses: Float[Array, "bodies s s"],
    turned: Float[Array, " m"],
) -> Scaling:
    """The same of a large system, by bodies."""
    slopes, masses, turned = stop_gradient((slopes, masses, turned))
    symbolic, angular = cast(Symbolic, system.symbolic), xp.asarray(system.coordinates.angular)
    turning = take(angular, symbolic.columns)
    turns, square = turning[symbolic.body], slopes**2
    parts = tuple(sum_few(sum_few(xp.where(mask, square, 0.0))) for mask in (~turns, turns))
    diagonal = xp.diagonal(masses, axis1=1, axis2=2)
    inertia, heft = (xp.sum(xp.where(mask, diagonal, 0.0)) for mask in (turning, ~turning))
    length = length_of(system, lambda mask: tuple(xp.sum(part[mask]) for part in parts), turned, (inertia, heft))
    norms = xp.sqrt(parts[0] + parts[1] / length**2)
    columns = xp.where(system.coordinates.angular, 1 / length, 1.0).astype(norms.dtype)
    return scales_of(system, norms, columns, length)


def scales_of(
    system: AbstractSystem, norms: Float[Array, " m"], columns: Float[Array, " n"], length: Float[Array, ""]
) -> Scaling:
    """The scales of rows of these norms, angles as lengths."""
    rows = system.rows.angular
    largest = xp.where(rows, *(xp.max(norms * mask, initial=0.0) for mask in (rows, ~rows)))
    largest = or_one(largest)
    floor = 100 * xp.finfo(norms.dtype).eps * largest
    return Scaling(
        columns, xp.where(norms > floor, norms, largest), length, length * known(system.radian).astype(length.dtype)
    )


def _length(system: AbstractSystem, model: Model) -> Float[Array, ""]:
    square, angular = model.jacobian**2, system.coordinates.angular
    if not angular.any():
        usual, radian = (known(x).astype(square.dtype) for x in (system.length, system.radian))
        if system.has_length:
            return usual / radian
        radius = _radius(xp.sum(square, axis=1), model.turned)
        bends = radius <= _CURVED * usual if system.names.one_sided else xp.isfinite(radius)
        return xp.where(bends, radius, usual) / radian

    def parts(rows: np.ndarray) -> tuple[Array, Array]:
        return xp.sum(square[rows][:, ~angular]), xp.sum(square[rows][:, angular])

    mass = xp.diagonal(model.mass)
    return length_of(system, parts, model.turned, (xp.sum(mass[angular]), xp.sum(mass[~angular])))


def length_of(
    system: AbstractSystem,
    parts: Callable[[np.ndarray], tuple[Array, ...]],
    turned: Array,
    amounts: tuple[Array, Array],
) -> Float[Array, ""]:
    """A length of the mechanism: how far angular coordinates move force-type rows.

    It is |(Phi_phi, Phi'')| / |Phi_r| over the force-type rows, Eq. (15), where Phi'' is their second derivative, times
    a radian, as all bodies turn: it sees the arms that point along the constraint, which Phi_phi does not. Where these
    rows do not have both parts it is |Ups_phi| / |Ups_r| over the moment-type rows, where nothing has both the radius
    of gyration of all masses, and without that 1. Without angular coordinates it is the radius of the paths. Arms that
    are rounding beside the length before are none.

    `parts` are |Phi_r|^2 and |Phi_phi|^2 of some rows, `amounts` all inertia and all mass.
    """
    moment, (inertia, heft) = system.rows.angular, amounts
    some = (inertia > 0) & (heft > 0)
    length = xp.where(some, xp.sqrt(inertia / xp.where(some, heft, 1.0)), 1.0).astype(turned.dtype)
    bends = xp.sum((known(system.radian).astype(turned.dtype) * turned[~moment]) ** 2)
    for mask, extra in ((moment, 0.0), (~moment, bends)):  # the last that has both parts wins
        linear_part, angular_part = parts(mask)
        angular_part = angular_part + extra
        both = (linear_part > 0) & (angular_part > xp.finfo(turned.dtype).eps ** 1.5 * length**2 * linear_part)
        length = xp.where(both, xp.sqrt(angular_part / xp.where(both, linear_part, 1.0)), length)
    return length


def _radius(square: Array, bends: Array) -> Float[Array, ""]:
    """Radius of curvature of the rows, |Phi_r| / |Phi''|, infinite of straight ones: how far off them the Jacobian
    turns by a radian."""
    curvature = xp.sqrt(xp.mean(xp.where(square > 0, bends**2 / or_one(square), 0.0)))
    return xp.where(curvature > 0, 1 / or_one(curvature), xp.inf)
