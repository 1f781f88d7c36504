"""Driving constraints and laws of motion

    phi_i - phi_j - f(t) = 0,   |r_i + R_i s_i - r_j - R_j s_j| - f(t) = 0                    (2)

The multiplier is minus the driving moment on body i, or the tension between the two points.
"""

from collections.abc import Callable
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._tools._module import Numbers, as_float, as_functions, as_vector, floats, safe_norm, tracing
from .._body import Pose
from ._base import AbstractJoint, Row


def _law(value: Callable[[Array], Array] | Numbers) -> Callable[[Array], Array]:
    """A function of time; a number stands for one that is constant."""
    if callable(value):
        return as_functions(value)
    number = floats(value)
    if number.shape:
        raise ValueError(
            f"Argument `angle` or `distance` of a driver must be a function of time or a number, but has shape "
            f"{number.shape}. Give coefficients as `rx.Polynomial`."
        )
    return Polynomial(number[None])


def _check_law(argument: str, name: str, law: Callable[[Array], Array]) -> None:
    """Refuse a law that cannot be traced or gives anything but a number."""
    with tracing(argument):
        given = jax.eval_shape(law, jax.ShapeDtypeStruct((), jnp.result_type(float)))
    shapes = [leaf.shape for leaf in jax.tree.leaves(given)]
    if shapes != [()]:
        raise ValueError(
            f"Argument `{argument}` of the driver '{name}' must give a number at a time, but gives {shapes or None}. "
            "Give a function of time, a number, or `rx.Polynomial`."
        )


class AngleDriver(AbstractJoint):
    """Driving constraint (2), phi_i - phi_j = f(t). Its multiplier is minus the driving moment on body i, N m.

    ??? example

        ```python
        rx.AngleDriver("motor", "crank", "ground", rx.Polynomial([0.5, 2.0]))  # phi = 0.5 + 2 t
        ```

    **Arguments:**

    - `name`: the row is called "name.angle".
    - `i`, `j`: names of the bodies, or "ground".
    - `angle`: number, or function of time in jax.numpy, rad; `Polynomial` for one with parameters that compile nothing
      new.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("angle", "moment"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    angle: Callable[[Array], Array] = eqx.field(converter=_law)

    def __check_init__(self) -> None:
        _check_law("angle", self.name, self.angle)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([i.phi - j.phi - self.angle(t)])


class DistanceDriver(AbstractJoint):
    """Driving constraint (2) on the distance of two points; with a constant law a massless rod.

    Its multiplier is the tension that holds the points together, N.

    ??? example

        ```python
        rx.DistanceDriver("rod", "lever", "ground", (0.2, 0.0), (0.0, 1.0), 0.6)
        ```

    **Arguments:**

    - `name`: the row is called "name.distance".
    - `i`, `j`: names of the bodies, or "ground".
    - `point_i`, `point_j`: the points in the local frames, m; they must not coincide.
    - `distance`: number, or function of time in jax.numpy, m; `Polynomial` for one with parameters that compile
      nothing new.
    """

    row_kinds: ClassVar[tuple[Row, ...]] = (("distance", "force"),)
    name: str = eqx.field(static=True)
    i: str = eqx.field(static=True)
    j: str = eqx.field(static=True)
    point_i: Float[Array, "2"] = eqx.field(converter=as_vector)
    point_j: Float[Array, "2"] = eqx.field(converter=as_vector)
    distance: Callable[[Array], Array] = eqx.field(converter=_law)

    def __check_init__(self) -> None:
        _check_law("distance", self.name, self.distance)

    def residual(self, i: Pose, j: Pose, t: Array) -> Array:
        return jnp.stack([safe_norm(i.point(self.point_i) - j.point(self.point_j)) - self.distance(t)])


class Polynomial(eqx.Module):
    """c0 + c1 t + c2 t^2 + ..., a law of motion whose coefficients are differentiable.

    ??? example

        ```python
        law = rx.Polynomial([0.5, 2.0])
        law(jnp.array(1.5))  # 0.5 + 2 * 1.5 = 3.5
        ```

    **Arguments:**

    - `coefficients`: shape (degree + 1,), lowest power first.
    """

    coefficients: Float[Array, " terms"] = eqx.field(converter=as_float)

    def __call__(self, t: Float[Array, ""]) -> Float[Array, ""]:
        return jnp.polyval(self.coefficients[::-1], t)
