"""Laws of motion that drivers prescribe, as functions of time."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._tools._errors import RedundaxError
from .._tools._functions import as_functions
from .._tools._module import (
    Numbers,
    check_takes,
    figure,
    finite,
    floats,
    is_concrete,
    is_real,
    part,
    tracing,
)
from .._tools._value import AbstractModule
from .._tools._words import short


def law_of_time(value: Callable[[Array], Array] | Numbers, argument: str) -> Callable[[Array], Array]:
    """A function of time; a number stands for one that is constant."""
    if callable(value):
        return as_functions(value)
    number = floats(value, argument)
    if number.shape:
        raise RedundaxError(
            f"Argument `{argument}` of a driver must be a function of time or a number, but has shape {number.shape}. "
            "Give coefficients as `rx.Polynomial`."
        )
    return Polynomial(number[None])


def check_law(argument: str, name: str, law: Callable[[Array], Array]) -> None:
    """Refuse a law that cannot be traced or gives anything but a number."""
    if isinstance(law, Polynomial):
        finite(argument, law.coefficients, f"the driver '{name}'")
    with part(f"the driver '{name}'"):
        check_takes(argument, law, "t")
        with tracing(argument):
            given = eqx.filter_eval_shape(law, jax.ShapeDtypeStruct((), jnp.result_type(float)))
    if not is_real(given):
        shown = f"an object of the type {type(given).__name__}"
        if given is None or isinstance(given, str | complex):
            shown = short(given)
        elif isinstance(given, jax.ShapeDtypeStruct | np.ndarray | np.generic):
            shown = f"an array of shape {given.shape} and type {given.dtype}"
        raise RedundaxError(
            f"Argument `{argument}` of the driver '{name}' must give a number at a time, but gives {shown}. "
            "Give a function of time, a number, or `rx.Polynomial`."
        )


def check_distance(name: str, law: Callable[[Array], Array]) -> None:
    """Refuse a law that gives no number, and a constant length that no rod has."""
    check_law("distance", name, law)
    if isinstance(law, Polynomial) and law.coefficients.shape == (1,):
        length = law.coefficients[0]
        if is_concrete(length) and not length > 0:
            raise RedundaxError(
                f"Argument `distance` of '{name}' must be positive, but is {float(length):.6g}. Two points that "
                "stay at one place are a pin, or a ball joint in space."
            )


class Polynomial(AbstractModule):
    """c0 + c1 t + c2 t^2 + ..., a law of motion whose coefficients are differentiable.

    ??? example

        ```python
        law = rx.Polynomial([0.5, 2.0])
        law(jnp.array(1.5))  # 0.5 + 2 * 1.5 = 3.5
        ```

    **Arguments:**

    - `coefficients`: shape (degree + 1,), lowest power first.
    """

    coefficients: Float[Array, " terms"] = eqx.field(converter=figure("coefficients"))

    def __check_init__(self) -> None:
        if self.coefficients.ndim != 1 or not self.coefficients.size:
            raise RedundaxError(
                "Argument `coefficients` must be a list of one number or more, lowest power first, but has shape "
                f"{self.coefficients.shape}. Give [0.5, 2.0] for 0.5 + 2 t, say."
            )

    def __call__(self, t: Float[Array, ""]) -> Float[Array, ""]:
        return jnp.polyval(self.coefficients[::-1], t)
