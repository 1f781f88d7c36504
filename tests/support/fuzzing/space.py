"""Random mechanisms in space: trees and loops of joints of all kinds, closed at the pose at which they are given.

What they should do is worked out in NumPy, from values of the constraints alone and from Newton's and Euler's laws.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

import redundax as rx
from redundax import spatial

KINDS = (
    "Revolute",
    "Prismatic",
    "Cylindrical",
    "Spherical",
    "Planar",
    "Screw",
    "Fixed",
    "PointOnLine",
    "PointOnPlane",
    "ParallelAxes",
    "ConstantVelocity",
    "Universal",
    "Distance",
)
_COAXIAL = ("Revolute", "Cylindrical")
_STEP, _BEND = 5e-4, 1e-4  # of differences


@dataclass(frozen=True)
class Structure:
    """Kind and bodies of each joint, -1 for the ground, and which joint it shares the axis of, if any."""

    bodies: int
    joints: tuple[tuple[str, int, int, int | None], ...]


def draw(rng: np.random.Generator, bodies: int) -> Structure:
    """A tree, a joint that closes a loop, and a second joint on the axis of one of the hinges and sleeves."""
    joints: list[tuple[str, int, int, int | None]] = []
    for body in range(bodies):
        joints.append((str(rng.choice(KINDS)), body, int(rng.integers(-1, body)), None))
    first, second = sorted(rng.choice(bodies + 1, 2, replace=False) - 1)
    joints.append((str(rng.choice(KINDS)), int(second), int(first), None))
    hinges = [k for k, joint in enumerate(joints) if joint[0] in _COAXIAL]
    if hinges:
        twin = int(rng.choice(hinges))
        joints.append((*joints[twin][:3], twin))
    return Structure(bodies, tuple(joints))


def build(structure: Structure, rng: np.random.Generator) -> tuple[rx.Mechanism, np.ndarray]:
    """A mechanism with random numbers, and its position."""
    bodies = []
    for b in range(structure.bodies):
        root = rng.normal(size=(3, 3))
        inertia = root @ root.T + np.eye(3)
        inertia = np.trace(inertia) * np.eye(3) - inertia  # of a body: no value above the sum of the others
        turn = rng.normal(size=4)
        centre, position = 0.3 * rng.normal(size=(2, 3))
        mass = float(np.exp(rng.normal()))
        bodies.append(
            spatial.Body(f"body {b}", mass, 0.1 * inertia, centre=centre, position=position + b, orientation=turn)
        )
    placed: list[tuple] = []
    joints = []
    for k, (kind, i, j, shared) in enumerate(structure.joints):
        point, axis, mark = rng.normal(size=(3, 3))
        if shared is not None:
            axis = placed[shared][1]
            point = placed[shared][0] + axis
        placed.append((point, axis))
        ends = (f"joint {k}", bodies[i], rx.GROUND if j < 0 else bodies[j], point)
        if kind == "Universal":
            joints.append(spatial.Universal(*ends, axis, np.cross(axis, mark)))
        elif kind == "Distance":
            joints.append(spatial.Distance(*ends, point + axis))
        elif kind == "Screw":
            joints.append(spatial.Screw(*ends, axis, mark, pitch=0.5))
        else:
            joints.append(getattr(spatial, kind)(*ends, axis, mark))
    mechanism = rx.Mechanism(bodies, joints, gravity=rng.normal(size=3) * 5)
    return mechanism, np.asarray(mechanism.reference)


class Differences:
    """The equations (7) of a mechanism at a position by differences: Jacobian, a velocity, gamma, accelerations."""

    def __init__(self, mechanism: rx.Mechanism, q: np.ndarray, push: np.ndarray):
        self.mechanism, self.q, n = mechanism, jnp.asarray(q), len(mechanism.coordinates)
        rows = jax.vmap(self._rows)
        near, far = (np.asarray(rows(s * np.eye(n)) - rows(-s * np.eye(n))) / (2 * s) for s in (_STEP, 2 * _STEP))
        self.jacobian = ((4 * near - far) / 3).T  # of fourth order
        _, sigma, vt = np.linalg.svd(self.jacobian)
        self.rank = int(np.sum(sigma > 1e-5 * sigma[0]))
        beside = sigma[self.rank] / sigma[0] if self.rank < sigma.size else 0.0
        self.clear = sigma[self.rank - 1] > 1e-3 * sigma[0] and beside < 1e-8
        self.velocity = vt[self.rank :].T @ (vt[self.rank :] @ push)
        rate = self.velocity
        bends = np.asarray(rows(_BEND * np.stack([rate, 0 * rate, -rate])))
        self.gamma = -(bends[0] - 2 * bends[1] + bends[2]) / _BEND**2

    def _rows(self, d):
        return self.mechanism.constraint(self.mechanism.retract(self.q, d), jnp.zeros(()))

    def acceleration(self, load: np.ndarray) -> np.ndarray:
        """By least squares of the whole matrix of (7)."""
        mass, n = np.asarray(self.mechanism.mass(self.q, jnp.zeros(()))), self.velocity.size
        zero = np.zeros((self.gamma.size,) * 2)
        matrix = np.block([[mass, self.jacobian.T], [self.jacobian, zero]])
        right = np.concatenate([load, self.gamma])
        return np.linalg.lstsq(matrix, right, rcond=1e-6)[0][:n]


@dataclass(frozen=True)
class Kinematics:
    """Axes R, centres, inertias, masses, velocities and spins in global components of all bodies, the ground last."""

    axes: np.ndarray
    centre: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def of_point(self, body: int, point: np.ndarray) -> np.ndarray:
        """Velocity of the point of a body that is there."""
        return self.velocity[body] + np.cross(self.spin[body], point - self.centre[body])


def kinematics(q: np.ndarray, qd: np.ndarray) -> Kinematics:
    """Of a position and velocity."""
    count = len(q) // 7
    turns = [_matrix(p) for p in q[3 * count :].reshape(count, 4)] + [np.eye(3)]
    spins = [r @ w for r, w in zip(turns, qd[3 * count :].reshape(count, 3), strict=False)] + [np.zeros(3)]
    ground = np.zeros((1, 3))
    centres, velocities = (np.concatenate([x[: 3 * count].reshape(count, 3), ground]) for x in (q, qd))
    return Kinematics(np.array(turns), centres, velocities, np.array(spins))


def _matrix(p: np.ndarray) -> np.ndarray:
    w, v = p[0], p[1:]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * (w * skew + skew @ skew) / (p @ p)
