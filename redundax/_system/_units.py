"""Change of physical units, Eqs. (15) and (16).

Where the numbers of lengths grow by the factor u (u = 1000 from metres to millimetres), linear coordinates
grow by u, masses stay, moments of inertia grow by u^2, forces by u, moments by u^2, and the blocks of the
Jacobian change as in (16). Angle, mass and time units change in the same way. With s the factor of a row's
own unit and e that of energy, a multiplier grows by e / s, since multiplier times row is work.

A change of units changes no physics, but the minimum norm of the multipliers is not a physical quantity: the
pick made in other units is the pick made in these units with compliance S^2 and misfit S h, where S holds
the factors of the multipliers. So a sweep over units needs one factorisation only.
"""

import equinox as eqx
from jaxtyping import Array, Float

from .._tools._module import as_float, numpy_of
from ._axis import Axis


class Units(eqx.Module):
    """Factors by which the numbers of lengths, angles, masses and times grow; 1 leaves a unit as it is.

    `Units(length=1000.0)` turns metres into millimetres.

    ??? example

        ```python
        rx.Units(length=1000.0)  # from metres to millimetres
        rx.Units(length=1000.0, mass=0.001)  # and from kilograms to tonnes: forces stay in newtons
        ```
    """

    length: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)
    angle: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)
    mass: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)
    time: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)

    @property
    def energy(self) -> Float[Array, ""]:
        """Factor of energies."""
        mass, length, time = map(numpy_of(self).asarray, (self.mass, self.length, self.time))
        return as_float(mass * (length / time) ** 2)

    def of(self, axis: Axis) -> Float[Array, " axis"]:
        """Factors of coordinates, constraint rows or slips: length for linear and force-type, else angle."""
        return as_float(numpy_of(self).where(axis.angular, self.angle, self.length))

    def of_force(self, axis: Axis) -> Float[Array, " axis"]:
        """Factors of the forces and moments that do work on an axis: multipliers, friction, generalised forces."""
        energy, own = map(numpy_of(self).asarray, (self.energy, self.of(axis)))
        return as_float(energy / own)
