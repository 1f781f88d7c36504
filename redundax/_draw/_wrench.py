"""Force and moment of a joint on its body i, whatever the joint; and of an applied load

    force = -(d Phi / d r_i)^T lam,   moment about the body's origin = -(d Phi / d phi_i)^T lam

the part of -Phi_q^T lam that belongs to body i: -lam for a revolute joint, +lam along the normal and -lam about the
point of contact for a translational one. The moment about another point p is that about r_i less (p - r_i) x force.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .._body import Pose, poses
from .._joints import AbstractJoint
from .._loads import Motion, Wrench
from .._mechanism import Mechanism
from .._state import State


def joint_wrenches(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each stack of joints the forces (size, 2), N, and moments about r_i (size,), N m, on the bodies i."""
    body = poses(state.q)
    out = []
    for stack, rows in zip(mechanism.joints, _rows(mechanism), strict=True):
        own = jnp.asarray(multipliers[rows], body.r.dtype)
        slope = eqx.filter_vmap(lambda joint, i, j, lam: _slope(joint, body[i], body[j], state.t, lam))(
            stack.element, stack.i, stack.j, own
        )
        out.append((-np.asarray(slope.r, float), -np.asarray(slope.phi, float)))
    return out


def load_wrenches(stack: Any, state: State) -> tuple[Wrench, Wrench]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    body, rate = poses(state.q), poses(state.qd)
    return eqx.filter_vmap(
        lambda load, i, j: load.wrenches(Motion(body[i], rate[i]), Motion(body[j], rate[j]), state.t)
    )(stack.element, stack.i, stack.j)


def moved(moment: float, force: np.ndarray, arm: np.ndarray) -> float:
    """The moment of a wrench about a point at `arm` from where it is known."""
    return float(moment - arm[0] * force[1] + arm[1] * force[0])


def _slope(joint: AbstractJoint, i: Pose, j: Pose, t: Array, multipliers: Array) -> Pose:
    return jax.grad(lambda pose: multipliers @ joint.residual(pose, j, t))(i)


def _rows(mechanism: Mechanism) -> list[np.ndarray]:
    """Row indices of the joints of each stack, (size, rows)."""
    place = {name: row for row, name in enumerate(mechanism.rows.labels)}
    return [
        np.array([[place[f"{name}.{row}"] for row, _ in stack.element.row_kinds] for name in names])
        for stack, names in zip(mechanism.joints, mechanism.joint_names, strict=True)
    ]
