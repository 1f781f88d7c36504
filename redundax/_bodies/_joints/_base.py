"""What a joint is. Body i comes first; either body may be the ground.

A joint states its residual for two poses; mechanisms stack joints of one kind and evaluate them together. The
multipliers of its force-type rows are joint forces, those of its moment-type rows joint moments: the force on the
bodies is -Phi_q^T lam.
"""

import abc
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Generic, Literal, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..._tools._errors import RedundaxError
from ..._tools._module import check_kind, figure, part, replace_fields
from .._body import name_of
from .._frame import AbstractFrame, P
from .._friction_model import AbstractFrictionModel
from .._plane import PLANE
from .._pose import Pose
from .._stack import AbstractBetweenBodies, is_of_user

Row = tuple[str, str]


class AbstractJoint(Generic[P], AbstractBetweenBodies):
    """A joint between the planar bodies i and j.

    A new kind of joint gives `row_kinds`, the name and kind ("force" or "moment") of each of its rows, force-type
    first, and `residual`; and in `pushing` the names of rows whose contacts can only push, with positive multipliers.
    Rows that constrain velocities alone are named in `velocity_rows`: `residual` is zero there, `rolled` gives them.

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

    if TYPE_CHECKING:  # for checkers of types, to whom the word of Equinox would make an argument of it
        row_kinds: ClassVar[tuple[Row, ...]]
        name: ClassVar[str]
    else:
        row_kinds: eqx.AbstractClassVar[tuple[Row, ...]]
        name: eqx.AbstractVar[str]
    frame: ClassVar[AbstractFrame] = PLANE
    coordinate_kinds: ClassVar[tuple[Row, ...]] = ()  # names of coordinates of i relative to j: "linear" or "angular"
    pushing: ClassVar[tuple[str, ...]] = ()
    velocity_rows: ClassVar[tuple[str, ...]] = ()
    has_spin: ClassVar[bool] = False  # whether it leaves all turns in space free, which have no coordinate
    free_axes: ClassVar[Literal["none", "across", "all"]] = "none"  # turns of its axes that change no constraint

    def __check_init__(self) -> None:
        if is_of_user(type(self)):
            check_rows(self)

    @abc.abstractmethod
    def residual(self, i: P, j: P, t: Float[Array, ""]) -> Float[Array, " rows"]:
        """Constraint residual, one entry for each of `row_kinds`, from the `Pose` of each body."""

    def jacobian(self, i: P, j: P, t: Float[Array, ""]) -> Float[Array, "rows columns"]:
        """Derivatives of the residual by the velocities of body i, then of body j; the poses with axes."""
        if self.velocity_rows:
            return self.by_velocities(lambda a, b: self.residual(a, b, t) + self.rolled(a, b, i, j), i, j)
        return self.by_velocities(lambda i, j: self.residual(i, j, t), i, j)

    def rolled(self, i: P, j: P, from_i: P, from_j: P) -> Float[Array, " rows"]:
        """What rows of velocity have missed as the bodies came to these poses from others, to first order, and zeros of
        all other rows: its rate, as the poses leave the others, is A qd."""
        raise NotImplementedError

    def by_velocities(self, function: Callable[[P, P], Array], i: P, j: P) -> Float[Array, "values columns"]:
        """Derivatives of a function of the poses of both bodies by the velocities of body i, then of body j."""

        def by(of_one: Callable[[P], Array], pose: P) -> Array:
            return jax.vmap(lambda rate: jax.jvp(of_one, (pose,), (rate,))[1], out_axes=1)(pose.unit_rates())

        return jnp.concatenate([by(lambda i: function(i, j), i), by(lambda j: function(i, j), j)], axis=1)

    def relatives(self, i: P, j: P) -> PyTree:
        """What the pose of body i can have `seen`, its rate and the rate of this, from poses with theirs; or None."""
        return None

    @property
    def one_sided(self) -> bool:
        """Whether its pushing rows open where they would pull."""
        return False

    def directions(self) -> dict[str, Array]:
        """Directions on the bodies "i" and "j" that its rows read, such as axes; a field `normal` is one on body j."""
        normal = getattr(self, "normal", None)
        return {} if normal is None else {"j": normal}

    def moment_arm(self) -> Array | None:
        """Length at which its moments press: the field `guide_length`; None where it has none or where it changes."""
        return getattr(self, "guide_length", None)

    def bare(self) -> Self:
        return replace_fields(self, i="", j="", name="", **dict.fromkeys(self.read_by_law))

    def coordinates(self, i: P, j: P) -> Float[Array, " coordinates"]:
        """Its coordinates, one for each of `coordinate_kinds`, at poses with axes."""
        return jnp.zeros(0)


class AbstractPointJoint(AbstractJoint[Pose]):
    """A joint at a point of each body, in the plane."""

    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True, converter=name_of)
    j: str = eqx.field(static=True, converter=name_of)
    point_i: Float[Array, "2"] = eqx.field(converter=figure("point_i"))
    point_j: Float[Array, "2"] = eqx.field(converter=figure("point_j"))


def check_rows(joint: AbstractJoint) -> None:
    """Refuse rows that have no name and kind, and rows that push or are of velocity but are none."""
    kinds = joint.row_kinds
    pairs = [each for each in kinds if isinstance(each, tuple) and len(each) == 2 and each[1] in ("force", "moment")]
    if not pairs or len(pairs) < len(kinds):
        raise RedundaxError(
            f"`row_kinds` of {type(joint).__name__} must give a name and a kind, 'force' or 'moment', for each row, "
            f'but is {kinds!r}. Write (("y", "force"),) for one row, with both commas.'
        )
    for what, given in (("pushing", joint.pushing), ("velocity_rows", joint.velocity_rows)):
        missing = [name for name in given if name not in dict(pairs)]
        if missing:
            raise RedundaxError(
                f"`{what}` of {type(joint).__name__} must hold names of its rows, but holds {missing[0]!r}. The rows "
                f"are {', '.join(dict(pairs))}."
            )


def check_friction(joint: str, friction: object) -> None:
    """Refuse what is no friction model."""
    if friction is not None:
        with part(f"joint '{joint}'"):
            advice = "Give `rx.Coulomb(0.1)`, say, with the coefficient of these surfaces."
            check_kind("friction", friction, AbstractFrictionModel, "a friction model", advice)
        many = [x.shape for x in jax.tree.leaves(friction) if eqx.is_array(x) and x.shape]
        if many and not is_of_user(type(friction)):
            raise RedundaxError(
                f"Argument `friction` of joint '{joint}' must have a number for each figure, but one has shape "
                f"{many[0]}. Give each joint its own, and use jax.vmap for many values."
            )
