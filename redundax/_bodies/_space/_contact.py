"""How the loads of a bearing or guide press its surfaces together

    at both ends    N = |N_1| + |N_2| + share |F_axial| + |M_twist| / R_twist,   N_1,2 = F / 2 +- (z x M) / L
    additive        N = |F| + |M| / L + share |F_axial| + |M_twist| / R_twist

with the force F and the moment M square to the axis z, at the joint's point on body i: the middle of the bearing or
guide. At both ends N is that of the plane where the load is planar; the additive one is that of industrial programs.
"""

import abc
import functools
import operator
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._tools._module import safe_norm
from ..._tools._value import AbstractModule

_COUPLE = np.array([[-1, 1], [1, -1]])  # forces at both ends, columns, by moments about y and x over their distance


class ContactLoad(NamedTuple):
    """Loads of a joint along its own axes, at its point: zero where it holds nothing.

    - `radial`, `axial`: forces square to and along the axis, N.
    - `bend`, `twist`: moments likewise, N m.

    ??? example

        ```python
        rx.spatial.ContactLoad(jnp.array([30.0, 40.0]), jnp.array(0.0), jnp.zeros(2), jnp.array(0.0))
        ```
    """

    radial: Float[Array, "2"]
    axial: Float[Array, ""]
    bend: Float[Array, "2"]
    twist: Float[Array, ""]


class ContactSize(NamedTuple):
    """What a contact needs to know of a joint, as far as it was given.

    - `length`: L, m.
    - `share`: normal load by unit axial force.
    - `twist_radius`: R_twist, m.

    ??? example

        ```python
        rx.spatial.ContactSize(length=jnp.array(0.05))
        ```
    """

    length: Array | None = None
    share: Array | None = None
    twist_radius: Array | None = None


class AbstractContact(AbstractModule):
    """A law for the normal load of a joint in space, by which friction models know it.

    A new one gives `normal_load`, and `largest_change` if a bound is known. `is_seminorm` says that the normal load is
    a seminorm of the loads: that is a bound too, and proofs of loads at rest rest on it.

    ??? example

        ```python
        import jax.numpy as jnp

        class OnRollers(rx.spatial.AbstractContact):  # which feel no moment
            def normal_load(self, load, size):
                return jnp.sum(jnp.abs(load.radial))

            def largest_change(self, change, size):  # of the normal load, at any loads
                return jnp.sum(jnp.abs(change.radial))

        OnRollers()
        ```
    """

    is_seminorm: ClassVar[bool] = False

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms that need a size: among "axial", "bend" and "twist"."""
        return ()

    @abc.abstractmethod
    def normal_load(self, load: ContactLoad, size: ContactSize) -> Float[Array, ""]:
        """Size of the load that presses the surfaces together, N."""

    def largest_change(self, change: ContactLoad, size: ContactSize) -> Float[Array, ""]:
        """Bound of the change of the normal load by a change of loads, at any loads; infinite where none is known."""
        if self.is_seminorm:
            return self.normal_load(change, size)
        return jnp.where(sum(jnp.sum(jnp.abs(part)) for part in change) > 0, jnp.inf, 0.0)


class AbstractTerms(AbstractContact):
    """A contact whose normal load is a sum of terms, of which some may be left out."""

    is_seminorm: ClassVar[bool] = True
    radial: bool = eqx.field(static=True, default=True)
    axial: bool = eqx.field(static=True, default=True)
    bend: bool = eqx.field(static=True, default=True)
    twist: bool = eqx.field(static=True, default=True)

    @property
    def terms(self) -> tuple[str, ...]:
        return tuple(term for term in ("axial", "bend", "twist") if getattr(self, term))

    def total(self, load: ContactLoad, size: ContactSize, *across: Array) -> Array:
        """Sum of terms of the load square to the axis, and of those of axial force and twisting moment."""
        terms = list(across)
        if self.axial and size.share is not None:
            terms.append(size.share * jnp.abs(load.axial))
        if self.twist and size.twist_radius is not None:
            terms.append(jnp.abs(load.twist) / size.twist_radius)
        return functools.reduce(operator.add, terms) if terms else jnp.zeros_like(load.axial)


class EndContacts(AbstractTerms):
    """Contact at both ends of a bearing or guide, which a moment presses to opposite sides: |N_1| + |N_2|.

    ??? example

        ```python
        rx.spatial.EndContacts(axial=False)  # an axial force that rubs nowhere
        ```

    **Arguments:**

    - `radial`, `axial`, `bend`, `twist`: whether these loads press.
    """

    def normal_load(self, load: ContactLoad, size: ContactSize) -> Array:
        half = load.radial / 2 if self.radial else jnp.zeros_like(load.radial)
        if not self.bend or size.length is None:
            return self.total(load, size, 2 * safe_norm(half))
        couple = load.bend[::-1, None] * (_COUPLE.astype(half.dtype) / size.length)
        return self.total(load, size, *safe_norm(half[:, None] + couple))


class AdditiveContact(AbstractTerms):
    """The sum of the sizes of force and moment, as in industrial programs: |F| + |M| / L.

    That is a revolute's mu (R_pin |F_radial| + R_arm |F_axial| + R_pin / L_bend |M_bend|), with R_arm its
    `thrust_radius` and L_bend its `bearing_length`, and a slider's mu (|F| + |M_bend| / L + |M_twist| / R_twist). A
    moment alone presses as in `EndContacts` of twice the length.

    ??? example

        ```python
        rx.spatial.AdditiveContact(twist=False)
        ```

    **Arguments:** as of `EndContacts`.
    """

    def normal_load(self, load: ContactLoad, size: ContactSize) -> Array:
        radial = [safe_norm(load.radial)] if self.radial else []
        bend = [safe_norm(load.bend) / size.length] if self.bend and size.length is not None else []
        return self.total(load, size, *radial, *bend)
