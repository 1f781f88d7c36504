"""Rigid bodies: what those of all mechanisms have, and planar ones."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from .._tools._errors import RedundaxError
from .._tools._module import check_kind, figure, is_concrete
from ._frame import AbstractBody, AbstractFrame
from ._plane import PLANE

GROUND = "ground"


def name_of(body: AbstractBody | str) -> str:
    """The name of a body that is given by it or by itself."""
    if not isinstance(body, str):
        check_kind("i` or `j", body, AbstractBody, "a body or its name", 'Give the `Body`, "ground" or a name.')
        return body.name
    return body


class Body(AbstractBody):
    """A planar rigid body with its local frame at the centre of mass, Eq. (1).

    ??? example

        ```python
        rx.Body("lever", mass=2.0, inertia=0.03)
        ```

    **Arguments:**

    - `name`: any word but "ground".
    - `mass`: kg.
    - `inertia`: moment of inertia about the centre of mass, kg m^2.
    """

    name: str = eqx.field(static=True)
    mass: Float[Array, ""] = eqx.field(converter=figure("mass"))
    inertia: Float[Array, ""] = eqx.field(converter=figure("inertia"))

    def __check_init__(self) -> None:
        check_amount("mass", self.name, self.mass)
        check_amount("inertia", self.name, self.inertia)

    @property
    def frame(self) -> AbstractFrame:
        return PLANE


def check_amount(argument: str, name: str, value: Array) -> None:
    """Refuse a mass or moment of inertia that is no number or negative."""
    if value.shape != ():
        raise RedundaxError(
            f"Argument `{argument}` of body '{name}' must be a number, but has shape {value.shape}. "
            "Make one `Body` for each."
        )
    if is_concrete(value) and np.asarray(value) < 0:
        raise RedundaxError(
            f"Argument `{argument}` of body '{name}' must not be negative, but is {float(value)}. Zero is allowed "
            "where the constraints leave the coordinate no freedom of its own, condition (14)."
        )
