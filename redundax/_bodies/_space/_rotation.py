"""Rotations by quaternions p = (w, v), of which only the direction counts

    R = E G^T / |p|^2,   E, G = (-v, w I +- [v]x),   p (0, u) = G^T u,   p [+] d = p (1, d/2) / |(1, d/2)|

and p' = p (0, omega) / 2, with the displacement d and the angular velocity omega in body axes. The length of p stays; a
displacement turns by 2 arctan(|d| / 2), so by less than half a turn.
"""

import functools
import operator
from collections.abc import Iterable
from typing import TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._tools._compilation import is_quick
from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers, floats, is_concrete, numpy_of
from ..._tools._numbers import Numeric, is_number

AnyArray: TypeAlias = Array | np.ndarray


def _table(sign: int) -> np.ndarray:
    """What times p gives E or G."""
    table = np.zeros((3, 4, 4))
    one = np.eye(3)
    table[:, 0, 1:], table[:, 1:, 0], table[:, 1:, 1:] = -one, one, sign * np.cross(one, one[:, None])
    return table


_E, _G = _table(1), _table(-1)
NEAR_X = 0.8846  # cosine of 27.8 degrees, an angle that neither whole or half degrees nor small ratios have


def cross(a: Float[AnyArray, "*#some 3"], b: Float[AnyArray, "*#some 3"]) -> Float[Array, "*some 3"]:
    """a x b, which compiles to less than `jnp.cross`."""
    return _next(a * _next(b) - _next(a) * b)


def _next(v: Float[AnyArray, "*some 3"]) -> Float[Array, "*some 3"]:
    """Components y, z and x."""
    return jnp.concatenate([v[..., 1:], v[..., :1]], axis=-1)


def skew(v: Float[Array, "*some 3"]) -> Float[Array, "*some 3 3"]:
    """[v]x, whose rows are those of the unit matrix times v."""
    return cross(np.eye(3, dtype=v.dtype), v[..., None, :])


def times(matrix: Float[AnyArray, "*#some 3 3"], vector: Float[AnyArray, "*#some 3"]) -> Float[Array, "*some 3"]:
    """A v, as `multiplied`."""
    if is_quick():
        return _product(matrix, vector[..., None])[..., 0]
    return _summed(matrix[..., k] * vector[..., k, None] for k in range(3))


def multiplied(
    a: Float[AnyArray, "*#some rows inner"], b: Float[AnyArray, "*#some inner columns"]
) -> Float[Array, "*some rows columns"]:
    """A B as a sum written out, which XLA computes along with what is read and what reads it, as it does no product of
    matrices and no sum over an axis; as a product, which compiles to a tenth, where that is what takes the time."""
    if is_quick():
        return _product(a, b)
    return _summed(a[..., k, None] * b[..., None, k, :] for k in range(a.shape[-1]))


def _product(a: Numeric, b: Numeric) -> Numeric:
    return np.matmul(a, b) if is_number([a, b]) else jnp.matmul(a, b, precision="highest")


def _summed(terms: Iterable[Numeric]) -> Numeric:
    """The sum of terms."""
    return functools.reduce(operator.add, terms)


def about_z(turn: Float[Array, "*some 3 3"]) -> Float[Array, "*some 3 3"]:
    """The rotation about z that is nearest to another; NaN where that turns z by a right angle or more."""
    size = jnp.where(turn[..., 2, 2] > 0, 1 + turn[..., 2, 2], jnp.nan)
    cosine, sine = turn[..., 0, 0] + turn[..., 1, 1], turn[..., 1, 0] - turn[..., 0, 1]
    none = jnp.zeros_like(size)
    x, y = (jnp.stack(part, axis=-1) / size[..., None] for part in ((cosine, sine, none), (-sine, cosine, none)))
    return jnp.stack([x, y, jnp.broadcast_to(np.eye(3, dtype=turn.dtype)[2], x.shape)], axis=-1)


def rotation(p: Float[AnyArray, "*some 4"]) -> Numeric:
    """Rotation matrix R of a quaternion of any length."""
    xp = numpy_of(p)
    p = xp.asarray(p)
    e, g = (_by(table, p) for table in (_E, _G))
    return multiplied(e, xp.swapaxes(g, -1, -2)) / xp.sum(p * p, axis=-1)[..., None, None]


def product(p: Float[AnyArray, "*some 4"], u: Float[AnyArray, "*some 3"], w: AnyArray | float = 1.0) -> Numeric:
    """The quaternion product p (w, u)."""
    return w * p + numpy_of(p, u).sum(_by(_G, p) * u[..., :, None], axis=-2)


def _by(table: np.ndarray, p: Float[AnyArray, "*some size"]) -> Numeric:
    """The matrix that a table of numbers makes of a vector."""
    table = table.astype(p.dtype)
    if is_quick():
        return _product(table.reshape(-1, table.shape[-1]), p[..., None]).reshape(p.shape[:-1] + table.shape[:-1])
    return _summed(table[..., k] * p[..., None, None, k] for k in range(table.shape[-1]))


def turned(p: Float[Array, "*some 4"], d: Float[Array, "*some 3"]) -> Float[Array, "*some 4"]:
    """p [+] d."""
    return product(p, d / 2) / jnp.sqrt(1 + jnp.sum(d * d, axis=-1, keepdims=True) / 4)


def angular_velocity(p: Float[Array, "*some 4"], rate: Float[Array, "*some 4"]) -> Float[Array, "*some 3"]:
    """omega in body axes: 2 conj(p) p' / |p|^2."""
    return 2 * between(p, rate)[..., 1:] / jnp.sum(p * p, axis=-1, keepdims=True)


def between(p: Float[AnyArray, "*some 4"], other: Float[AnyArray, "*some 4"]) -> Numeric:
    """conj(p) p', the turn from one to another."""
    return product(p * np.array([1.0, -1.0, -1.0, -1.0], p.dtype), other[..., 1:], other[..., :1])


def quaternion(matrix: Float[AnyArray, "3 3"]) -> Numeric:
    """The quaternion of a rotation matrix, from the largest of its four entries."""
    xp, (a, b, c) = numpy_of(matrix), matrix
    candidates = xp.stack(
        [
            xp.stack([1 + a[0] + b[1] + c[2], c[1] - b[2], a[2] - c[0], b[0] - a[1]]),
            xp.stack([c[1] - b[2], 1 + a[0] - b[1] - c[2], a[1] + b[0], c[0] + a[2]]),
            xp.stack([a[2] - c[0], a[1] + b[0], 1 - a[0] + b[1] - c[2], b[2] + c[1]]),
            xp.stack([b[0] - a[1], c[0] + a[2], b[2] + c[1], 1 - a[0] - b[1] + c[2]]),
        ]
    )
    best = candidates[xp.argmax(xp.diagonal(candidates))]
    return best / xp.sqrt(xp.sum(best * best))


def as_quaternion(argument: str, value: Numbers) -> Numeric:
    """A unit quaternion (w, x, y, z), given as one of any length or as a rotation matrix."""
    array = floats(value, argument)
    if array.shape == (3, 3):
        xp = numpy_of(array)
        if is_concrete(array) and (
            np.abs(array @ array.T - np.eye(3)).max() > 1e-6 or np.linalg.det(np.asarray(array)) < 0
        ):
            raise RedundaxError(
                f"Argument `{argument}` must be a rotation matrix, but its columns are no right-handed orthonormal "
                "axes. Give the body's axes in global components as columns."
            )
        return quaternion(xp.asarray(array))
    if array.shape != (4,) or (is_concrete(array) and not np.any(np.asarray(array))):
        raise RedundaxError(
            f"Argument `{argument}` must be a quaternion (w, x, y, z) or a rotation matrix (3, 3), but is "
            f"{array.tolist() if is_concrete(array) else array.shape}. Give (1, 0, 0, 0) for none."
        )
    return array / numpy_of(array).sqrt(numpy_of(array).sum(array * array))


def axes_along(argument: str, axis: Numbers, mark: Numbers | None = None) -> Numeric:
    """Right-handed axes as columns: z along an axis, x along the part of a mark square to it.

    Without a mark that is (1, 0, 0), and (0, 1, 0) of axes near it. No rule without a jump is there for all directions.
    """
    axis = floats(axis, argument)
    given = axis if mark is None else floats(mark, "mark")
    xp = numpy_of(axis, given)
    for which, vector in ((argument, axis), ("mark", given)):
        if vector.shape != (3,) or (is_concrete(vector) and not 0 < np.linalg.norm(np.asarray(vector)) < np.inf):
            raise RedundaxError(
                f"Argument `{which}` must have three finite components that are not all zero, but is {vector}. Give a "
                "direction, as in (0, 0, 1)."
            )
    z = axis / xp.sqrt(axis @ axis)
    other = xp.eye(3)[xp.where(xp.abs(z[0]) > NEAR_X, 1, 0)] if mark is None else given
    x = other - (other @ z) * z
    if is_concrete(x) and not np.linalg.norm(np.asarray(x)) > 1e-6 * np.linalg.norm(np.asarray(other)):
        raise RedundaxError(
            f"Argument `mark` must not be along the axis {np.asarray(axis).tolist()}, but is {given}. Give a direction "
            "square to it."
        )
    x = x / xp.sqrt(x @ x)
    return xp.stack([x, xp.cross(z, x), z], axis=-1)
