"""What a joint in space is, and one that sits at a point and axis of both bodies.

It is a function of the placement of body i as that of body j sees it, in the axes on body j. Its multipliers are minus
the force and moment on body i; rows of turns have the relative angular velocity omega as their rate where the joint is
closed, so that these multipliers are moments; that of `ConstantVelocity`, whose shafts are at an angle, has omega .
(z_i + z_j) / (1 + z_i . z_j).
"""

import abc
from collections.abc import Callable, Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...._tools._errors import RedundaxError
from ...._tools._module import Numbers, replace_fields
from ..._frame import AbstractFrame
from ..._friction_model import AbstractFrictionModel
from ..._joints import AbstractJoint as AbstractAnyJoint
from ..._joints._base import Row
from ..._joints._components import values
from .._body import Body
from .._frame import SPACE
from .._placement import Placement, at_reference, placed
from .._pose import Pose
from ._components import FREE, LOCKED
from ._relative import Relative


class AbstractJoint(AbstractAnyJoint[Pose]):
    """A joint between the bodies i and j in space.

    A new kind of joint gives `row_kinds`, the name and kind ("force" or "moment") of each of its rows, force-type
    first, and `residual`.

    ??? example

        ```python
        import equinox as eqx

        class SameHeight(rx.spatial.AbstractJoint):  # of the origins of both bodies
            row_kinds = (("z", "force"),)
            name: str = eqx.field(static=True)
            i: str = eqx.field(static=True)
            j: str = eqx.field(static=True)

            def residual(self, i, j, t):
                return (i.r - j.r)[2:]

        SameHeight("rail", "carriage", "ground")
        ```
    """

    frame: ClassVar[AbstractFrame] = SPACE

    @abc.abstractmethod
    def residual(self, i: Pose, j: Pose, t: Float[Array, ""]) -> Float[Array, " rows"]:
        """Constraint residual, one entry for each of `row_kinds`."""


class AbstractJointOfPlacements(AbstractJoint):
    """A joint with a point and axes, z the one that is given, on both bodies."""

    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "3"]
    axes_i: Float[Array, "3 3"]
    point_j: Float[Array, "3"]
    axes_j: Float[Array, "3 3"]

    def place_both(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        given: Sequence[Placement | None],
        own: Sequence[Placement | None],
    ) -> None:
        """Set the fields of a joint that is being made, with a global placement for each body."""
        self.name, (self.i, self.j, on_i, on_j) = name, placed(name, i, j, given, own)
        (self.point_i, self.axes_i), (self.point_j, self.axes_j) = ((on.point, on.axes) for on in (on_i, on_j))


class AbstractPlacedJoint(AbstractJointOfPlacements):
    """A joint that sits at a point and axis of both bodies.

    A new kind of joint gives `row_kinds`. Rows called radial_1, radial_2, axial, bend_1, bend_2 and twist lock these
    components of the pose of body i as body j sees it; a joint with other rows gives `residual` too, from `relative`.
    In `coordinate_kinds` it may name what it leaves free: angle, travel, travel_1 and travel_2. Where its axes may turn
    on both bodies alike and it constrains the same, `free_axes` says so, for `rx.misfit`: "across" for any turn about
    z, "all" for any turn.

    ??? example

        ```python
        class BallInSlot(rx.spatial.AbstractPlacedJoint):  # it does not turn about the axis along which it slides
            row_kinds = (("radial_1", "force"), ("radial_2", "force"), ("twist", "moment"))
            coordinate_kinds = (("travel", "linear"),)

        here, there = rx.spatial.Placement((0, 0, 0)), rx.spatial.Placement((0, 0, 1))
        BallInSlot("ball", "carriage", "ground", on_i=here, on_j=there)
        ```

    **Arguments:**

    - `name`: rows are called by it, as in "name.axial".
    - `i`, `j`: the bodies, or "ground"; their names do where `on_i` and `on_j` are given.
    - `point`: global, m, at the reference pose of the bodies.
    - `axis`: direction of the joint's axis, z, likewise; (0, 0, 1) if not given.
    - `mark`: direction whose part square to the axis is x of the joint, likewise; if not given as of
      a `Placement`.
    - `on_i`, `on_j`: in place of `point` and `axis` the `Placement` on each body.
    - `friction`: none is known of joints of this kind.
    """

    coordinate_kinds: ClassVar[tuple[Row, ...]] = ()

    def __init__(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        point: Numbers | None = None,
        axis: Numbers | None = None,
        mark: Numbers | None = None,
        *,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
        friction: AbstractFrictionModel | None = None,
    ):
        refuse_friction(name, friction)
        self.place(name, i, j, at_reference(name, point, axis, mark), on_i, on_j)

    def place(
        self,
        name: str,
        i: Body | str,
        j: Body | str,
        given: Placement | None,
        on_i: Placement | None = None,
        on_j: Placement | None = None,
    ) -> None:
        """The same of a joint at one place."""
        self.place_both(name, i, j, (given, given), (on_i, on_j))

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return values(LOCKED, self.row_kinds, f"a `{type(self).__name__}`", self.relative(i, j))

    def coordinates(self, i: Pose, j: Pose) -> Array:
        return values(FREE, self.coordinate_kinds, f"a `{type(self).__name__}`", self.relative(i, j))

    def directions(self) -> dict[str, Array]:
        return {} if self.free_axes == "all" else {"i": self.axes_i[..., 2], "j": self.axes_j[..., 2]}

    def relative(self, i: Pose, j: Pose) -> Relative:
        """The placement on body i as that on body j sees it."""
        return Relative.between(self, i, j) if i.seen is None else i.seen

    def relatives(self, i: Pose, j: Pose) -> tuple[Relative, Relative, Relative]:
        """That, its rate and the rate of this, from poses with theirs."""
        return Relative.along(self, i, j)

    def by_velocities(
        self, function: Callable[[Pose, Pose], Array], i: Pose, j: Pose
    ) -> Float[Array, "values columns"]:
        seen, rates = Relative.moved(self, i, j)
        none = jax.tree.map(jnp.zeros_like, i.unit_rates())
        by_i, by_j = (
            jax.tree.map(lambda *parts: jnp.concatenate(parts), *pair)
            for pair in ((i.unit_rates(), none), (none, j.unit_rates()))
        )
        both = replace_fields(i, seen=seen), j
        each = jax.vmap(lambda *rate: jax.jvp(function, both, rate)[1], out_axes=1)
        return each(replace_fields(by_i, seen=rates), by_j)


def refuse_friction(name: str, friction: object) -> None:
    """Friction of joints that know none."""
    if friction is not None:
        raise RedundaxError(
            f"Argument `friction` of joint '{name}' must be left out, but is {type(friction).__name__}: joints of its "
            "kind know none. Revolutes, sliders, screws, sleeves, balls, plates, points on planes and crosses do. Give "
            "one of these, or a force of the velocity by `rx.spatial.LoadFunction`."
        )
