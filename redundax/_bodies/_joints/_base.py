"""What a planar joint is. Body i comes first; either body may be the ground.

A joint states its residual for two poses; mechanisms stack joints of one kind and evaluate them together. The
multipliers of its force-type rows are joint forces, those of its moment-type rows joint moments: the force on the
bodies is -Phi_q^T lam.
"""

import abc
from typing import ClassVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._body import Pose
from .._friction_model import AbstractFrictionModel
from .._stack import AbstractBetweenBodies

Row = tuple[str, str]


class AbstractJoint(AbstractBetweenBodies):
    """A joint between the bodies i and j.

    A new kind of joint gives `row_kinds`, the name and kind ("force" or "moment") of each of its rows, force-type
    first, and `residual`; and in `pushing` the names of rows whose contacts can only push, with positive multipliers.

    ??? example

        ```python
        import equinox as eqx

        class SameHeight(rx.AbstractJoint):  # of the origins of both bodies
            row_kinds = (("y", "force"),)
            name: str = eqx.field(static=True)
            i: str = eqx.field(static=True)
            j: str = eqx.field(static=True)

            def residual(self, i, j, t):
                return (i.r - j.r)[1:]

        SameHeight("rail", "carriage", "ground")
        ```
    """

    row_kinds: eqx.AbstractClassVar[tuple[Row, ...]]
    pushing: ClassVar[tuple[str, ...]] = ()
    name: eqx.AbstractVar[str]

    @abc.abstractmethod
    def residual(self, i: Pose, j: Pose, t: Float[Array, ""]) -> Float[Array, " rows"]:
        """Constraint residual, one entry for each of `row_kinds`."""

    def jacobian(self, i: Pose, j: Pose, t: Float[Array, ""]) -> Float[Array, "rows 6"]:
        """Derivatives of the residual by x, y and phi of body i, then of body j; the poses with axes."""

        def along(rate_i: Pose, rate_j: Pose) -> Array:
            return jax.jvp(lambda i, j: self.residual(i, j, t), (i, j), (rate_i, rate_j))[1]

        none_i, none_j = jax.tree.map(jnp.zeros_like, (i, j))
        by_i = jax.vmap(lambda rate: along(rate, none_j), out_axes=1)(_unit_rates(i))
        by_j = jax.vmap(lambda rate: along(none_i, rate), out_axes=1)(_unit_rates(j))
        return jnp.concatenate([by_i, by_j], axis=1)


def _unit_rates(pose: Pose) -> Pose:
    """Rates of a pose with axes as x, y and phi change, stacked."""
    r, phi = jnp.eye(3, 2, dtype=pose.r.dtype), jnp.eye(3, dtype=pose.r.dtype)[2]
    along, across = cast(tuple[Array, Array], pose.axes)
    return Pose(r, phi, (phi[:, None] * across, -phi[:, None] * along))


class AbstractFrictionalJoint(AbstractJoint):
    """A joint with one slip coordinate and a normal load, so that it can have friction."""

    slip_kind: eqx.AbstractClassVar[str]
    friction: eqx.AbstractVar[AbstractFrictionModel | None]

    def __check_init__(self) -> None:
        if self.friction is not None and not isinstance(self.friction, AbstractFrictionModel):
            raise ValueError(
                f"Argument `friction` of joint '{self.name}' must be a friction model, but is {self.friction!r}. "
                "Give `rx.Coulomb` with this coefficient, say."
            )

    @property
    def law(self) -> AbstractFrictionModel | None:
        """Friction as force or moment that does work on the joint's coordinate."""
        return self.friction

    @property
    def coordinate(self) -> str:
        """What its coordinate is called: "angle" or "travel", as in "name.angle"."""
        return "angle" if self.slip_kind == "angular" else "travel"

    @abc.abstractmethod
    def slip(self, i: Pose, j: Pose) -> Float[Array, ""]:
        """The joint's coordinate: displacement of body i relative to body j; "linear" or "angular" by `slip_kind`."""

    @abc.abstractmethod
    def normal_load(self, multipliers: Float[Array, " rows"]) -> Float[Array, ""]:
        """Size of the load that presses the sliding surfaces together, N: a seminorm of the multipliers."""
