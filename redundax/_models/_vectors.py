"""Vectors and rotations of known numbers, for what is computed thousands of times"""

import numpy as np

from .._bodies._space._rotation import NEAR_X, product, quaternion

_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def axes_of(z: np.ndarray) -> np.ndarray:
    """Axes of which z is one and x is as of a `Placement` without a mark, in double precision whatever JAX computes
    in."""
    other = np.eye(3)[int(abs(z[0]) > NEAR_X)]
    x = other - (other @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b, which NumPy's own takes ten times as long for."""
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


def about_fixed_axes(angles: np.ndarray) -> np.ndarray:
    """Axes turned about the fixed x, then y, then z, by angles in rad: roll, pitch and yaw."""
    (a, b, c), (p, q, r) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    return np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]]) @ about_y @ about_x


def about_z(axes: np.ndarray) -> float:
    """The angle about z by which axes are turned that have, or nearly have, the z of those in which they are given."""
    return float(np.arctan2(axes[1, 0] - axes[0, 1], axes[0, 0] + axes[1, 1]))


def turned(own: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A quaternion turned by a rotation vector about its own axes, of length 1."""
    angle = float(np.linalg.norm(vector))
    found = product(own, np.sinc(angle / (2 * np.pi)) / 2 * vector, np.cos(angle / 2))
    return found / np.linalg.norm(found)


def vector_of(turn: np.ndarray) -> np.ndarray:
    """Rotation vector of a quaternion, of at most half a turn, or of a rotation matrix."""
    own = turn if turn.shape == (4,) else quaternion(turn)
    own = own if own[0] >= 0 else -own
    sine = float(np.linalg.norm(own[1:]))
    return own[1:] * (2 * np.arctan2(sine, own[0]) / sine if sine else 2.0)
