"""Parts that several mechanisms share: uniform rods, rows of cranks, parallel guides.

rod      J = m l^2 / 12 about its middle, along the x axis of its frame
crank    rod from the ground point (X_c, 0), joint A_c, to its tip, at the angle phi
guide    body point (x_k, y_k) on the line y = y_k of the guides' frame
"""

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import ParamSpec, TypedDict, TypeVar

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND, Body
from .._bodies._friction_model import Coulomb
from .._bodies._joints import Revolute, Translational
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_kind, floats, numpy_of, one_number

P = ParamSpec("P")
T = TypeVar("T")


_ONE, _MANY = (ArrayLike, ArrayLike | None), (Numbers, Numbers | None)


def checked(factory: Callable[P, T]) -> Callable[P, T]:
    """The same, which refuses by name what is no number, whole number or truth value, and several numbers for one."""
    kinds = {name: each.annotation for name, each in inspect.signature(factory).parameters.items()}

    @functools.wraps(factory)
    def made(*args: P.args, **named: P.kwargs) -> T:
        for name, value in (*zip(kinds, args, strict=False), *named.items()):
            kind = kinds.get(name)
            if kind in _ONE + _MANY and not (value is None and kind in (_ONE[1], _MANY[1])):
                number = floats(value, name)
                if kind in _ONE:
                    one_number(name, number)
            elif kind is int:
                check_kind(name, value, int | np.integer, "a whole number", "Give an integer.")
            elif kind is bool:
                check_kind(name, value, bool | np.bool_, "True or False", "Give one of them.")
        return factory(*args, **named)

    return made


def at_least(name: str, value: int, least: int, fix: str) -> None:
    """Refuse a count below `least`."""
    if value < least:
        raise RedundaxError(f"Argument `{name}` must be at least {least}, but is {value}. {fix}")


def several(name: str, value: Numbers) -> Float[np.ndarray | Array, " count"]:
    """Numbers in a row, refused if there is one alone or if they are in a table."""
    array = floats(value, name)
    if array.ndim != 1:
        raise RedundaxError(f"Argument `{name}` must be a list of numbers, but has shape {array.shape}. Give a list.")
    return array


def each(name: str, value: Numbers, count: int, what: str) -> Float[np.ndarray | Array, " count"]:
    """One number for each of `count` parts; a single number stands for all."""
    array = floats(value)
    if array.shape not in ((), (count,)):
        raise RedundaxError(
            f"Argument `{name}` must be a number or have {count} entries, one for each {what}, but has shape "
            f"{array.shape}. Give one number for all, or that many."
        )
    return numpy_of(array).broadcast_to(array, (count,))


def coulomb(name: str, coefficient: Numbers | None, count: int) -> list[Coulomb | None]:
    """Friction of `count` joints from one coefficient or one for each; none without."""
    if coefficient is None:
        return [None] * count
    return [Coulomb(value) for value in each(name, coefficient, count, "joint")]


class Rubbing(TypedDict):
    """What makes a revolute rub."""

    pin_radius: float | None
    friction: Coulomb | None


def rubbing(name: str, mu_rho: Numbers | None, count: int) -> list[Rubbing]:
    """The same for revolutes, where only coefficient times pin radius is known: a radius of 1 m."""
    return [{"pin_radius": None if own is None else 1.0, "friction": own} for own in coulomb(name, mu_rho, count)]


def point(x: ArrayLike, y: ArrayLike = 0.0) -> Float[np.ndarray | Array, "2"]:
    """The point (x, y)."""
    return numpy_of(x, y).stack([floats(x), floats(y)])


def in_a_row(gaps: Float[np.ndarray | Array, " gaps"]) -> Float[np.ndarray | Array, " gaps+1"]:
    """Places on a line with these distances, the first at 0."""
    return numpy_of(gaps).cumsum(numpy_of(gaps).append(0 * gaps[:1], gaps))


def uniform_rod(name: str, mass: ArrayLike, length: ArrayLike) -> Body:
    """A uniform slender rod; without mass it has no inertia either."""
    mass, length = floats(mass), floats(length)
    return Body(name, mass, mass * length**2 / 12)


def uniform_disc(name: str, mass: ArrayLike, radius: ArrayLike) -> Body:
    """A uniform disc."""
    mass, radius = floats(mass), floats(radius)
    return Body(name, mass, mass * radius**2 / 2)


def spread(count: int) -> Float[np.ndarray, " count"]:
    """Angles of so many equal parts around an axis, the first at 0."""
    return 2 * np.pi * np.arange(count) / count


def pivoted_cranks(
    pivots: Float[np.ndarray | Array, " cranks"],
    length: ArrayLike,
    mass: Float[np.ndarray | Array, " cranks"],
    friction: Sequence[Rubbing],
) -> tuple[list[Body], list[Revolute]]:
    """Equal rods "crank 1", "crank 2", ... on ground revolutes A1, A2, ... at the points (X_c, 0)."""
    length = floats(length)
    bodies = [uniform_rod(f"crank {c}", mass[c - 1], length) for c in range(1, len(friction) + 1)]
    joints = [
        Revolute(f"A{c}", body.name, GROUND, point_i=point(-length / 2), point_j=point(pivots[c - 1]), **own)
        for c, (body, own) in enumerate(zip(bodies, friction, strict=True), 1)
    ]
    return bodies, joints


def crank_poses(
    pivots: Float[Array, " cranks"], length: Float[Array, ""], phi: Float[Array, ""]
) -> tuple[Float[Array, "cranks 2"], Float[Array, "cranks 2"]]:
    """Centres and tips of parallel cranks at the angle phi."""
    arm = length * jnp.stack([jnp.cos(phi), jnp.sin(phi)])
    base = jnp.stack([pivots, jnp.zeros_like(pivots)], axis=1)
    return base + arm / 2, base + arm


def parallel_guides(
    body: str,
    count: int,
    gauge: ArrayLike,
    offset: ArrayLike,
    angle: ArrayLike,
    mu: Numbers | None,
    guide_length: ArrayLike | None,
) -> list[Translational]:
    """Parallel ground guides K1, K2, ... of one body, spread over `gauge` across and `offset` along them."""
    angle = floats(angle)
    numpy = numpy_of(angle)
    normal = numpy.stack([-numpy.sin(angle), numpy.cos(angle)])
    spread = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
    x, y = floats(offset) * spread, floats(gauge) * spread
    return [
        Translational(
            f"K{k + 1}",
            body,
            GROUND,
            point_i=point(x[k], y[k]),
            point_j=y[k] * normal,
            normal=normal,
            angle=angle,
            guide_length=guide_length,
            friction=friction,
        )
        for k, friction in enumerate(coulomb("mu", mu, count))
    ]
