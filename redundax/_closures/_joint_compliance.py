"""Compliance and misfit of one joint: what those in the plane and in space share, and one in the plane."""

from typing import Any, ClassVar, Self

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._bodies._frame import AbstractFrame
from .._bodies._plane import PLANE
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, as_matrix, check_word, floats, is_concrete, numpy_of, on_device
from .._tools._value import AbstractModule
from ._closure import check_compliance, inverse


class AbstractJointCompliance(AbstractModule):
    """C and v0 of a joint in the displacements v = (shift, turn) of a `space`, the plane or space."""

    space: ClassVar[AbstractFrame]
    joint: str = eqx.field(static=True)
    compliance: Float[Array, "size size"]
    misfit: Float[Array, " size"]
    frame: str | None = eqx.field(static=True)
    point: Float[Array, " axes"] | None

    def __init__(
        self,
        joint: str,
        translation: Numbers = 0.0,
        rotation: Numbers = 0.0,
        *,
        coupling: Numbers | None = None,
        misfit: Numbers | None = None,
        frame: str | None = None,
        point: Numbers | None = None,
    ):
        check_word("joint", joint)
        linear, angular = len(self.space.linear), len(self.space.angular)
        shapes = (linear,) if angular == 1 else (angular, linear), (self.space.size,)
        cross, gap = (
            floats(np.zeros(shape) if value is None else value, name)
            for shape, value, name in zip(shapes, (coupling, misfit), ("coupling", "misfit"), strict=True)
        )
        shifts, turns = (", ".join(names) for names in (self.space.linear, self.space.angular))
        meanings = (f"turns {turns} by forces {shifts}", f"shifts {shifts}, then turns {turns}")
        for name, value, shape, meaning in zip(("coupling", "misfit"), (cross, gap), shapes, meanings, strict=True):
            if value.shape != shape:
                raise RedundaxError(
                    f"Argument `{name}` of joint '{joint}' must have shape {shape}, {meaning}, but has {value.shape}. "
                    "Give all of them, 0 for those that are not there."
                )
        shift = as_matrix("translation", translation, linear, f"joint '{joint}'")
        turn = as_matrix("rotation", rotation, angular, f"joint '{joint}'")
        xp = numpy_of(shift, turn, cross)
        cross = xp.asarray(cross).reshape(angular, linear)
        self.compliance = on_device(xp.block([[shift, cross.T], [cross, turn]]))
        self.joint, self.frame, self.misfit = joint, frame, on_device(gap)
        self.point = None if point is None else self.space.vector("point", point)
        if is_concrete(self.compliance):
            parts = ", ".join((*self.space.linear, *self.space.angular))
            check_compliance(np.asarray(self.compliance), f"The compliance of joint '{joint}' in ({parts})")

    @classmethod
    def from_stiffness(
        cls, joint: str, translation: Numbers = np.inf, rotation: Numbers = np.inf, **options: Any
    ) -> Self:
        """The same from stiffness, N/m and N m/rad, of the shapes of `translation` and `rotation`.

        It is positive, infinite where the joint is rigid; `options` are the other arguments.

        ??? example

            ```python
            rx.JointCompliance.from_stiffness("K", 5e7, 1e6, frame="ground")
            ```
        """
        compliances = inverse(as_float(translation, "translation")), inverse(as_float(rotation, "rotation"))
        return cls(joint, *compliances, **options)


class JointCompliance(AbstractJointCompliance):
    """Compliance and misfit of one joint, in the frame of one of the bodies that it connects.

    Only what the joint holds counts: a revolute joint takes no moment about its pin, so that the angular compliance of
    its seat acts through a reference point beside the pin alone.

    ??? example

        ```python
        pin = rx.JointCompliance("A", translation=1e-8, misfit=(1e-5, 0.0, 0.0))
        guide = rx.JointCompliance("K", translation=2e-8, rotation=1e-6, frame="ground")
        ```

    **Arguments:**

    - `joint`: its name.
    - `translation`: shift by force, m/N: one number, one each along x and y, or a (2, 2) matrix.
    - `rotation`: turn by moment, rad/(N m).
    - `coupling`: turn by force, rad/N, shape (2,); by symmetry also shift by moment. Zero where the reference point is
      the centre of compliance, and if not given.
    - `misfit`: v0, by how much the parts as they are place body i's side of the joint elsewhere than on body j's
      without load: shift in m (2,) and turn in rad, shape (3,).
    - `frame`: name of the body, or "ground", in whose frame all this is given; body i if not given.
    - `point`: reference point in that frame, m; the joint's own point on that body if not given.
    """

    space: ClassVar[AbstractFrame] = PLANE
    __init__ = AbstractJointCompliance.__init__
