"""Force and moment of a joint on its body i, whatever the joint; and of an applied load

    force = -(d Phi / d r_i)^T lam,   moment about the body's origin = -(d Phi / d phi_i)^T lam

the part of -Phi_q^T lam that belongs to body i: -lam for a revolute joint, +lam along the normal and -lam about the
point of contact for a translational one. The moment about another point p is that about r_i less (p - r_i) x force;
on body j act the opposite force and the opposite moment about the same point.
"""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from ._body import GROUND, poses
from ._loads import Motion, Wrench
from ._mechanism import Mechanism
from ._state import State


def joint_wrenches(mechanism: Mechanism, state: State, multipliers: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """For each stack of joints the forces (size, 2), N, and moments about r_i (size,), N m, on the bodies i."""
    wrenches = zip(_rows(mechanism), _coefficients(mechanism, state), strict=True)
    found = [np.einsum("swr,sr->sw", by_row, multipliers[rows]) for rows, by_row in wrenches]
    return [(each[:, :2], each[:, 2]) for each in found]


def joint_outputs(mechanism: Mechanism, state: State) -> tuple[list[str], np.ndarray]:
    """Names and coefficients of the multipliers, shape (3 joints, m), of each joint's force (x, y) and moment.

    They act on its body i, or on body j where i is the ground, in global components; the moment is about the joint's
    point on that body, or about the body's origin where it has none.
    """
    body, names, out = poses(state.q), [], []
    bodies = (*mechanism.body_names, GROUND)
    stacks = zip(
        mechanism.joints, mechanism.joint_names, _rows(mechanism), _coefficients(mechanism, state), strict=True
    )
    for stack, joints, rows, by_row in stacks:
        for k, joint in enumerate(joints):
            i, j = stack.i[k], stack.j[k]
            on, sign, local = (j, -1.0, "point_j") if bodies[int(i)] == GROUND else (i, 1.0, "point_i")
            point = getattr(stack.element, local, None)
            about = body[on].r if point is None else body[on].point(point[k])
            force = by_row[k, :2]
            moment = moved(by_row[k, 2], force, np.asarray(about - body[i].r))
            wrench = np.zeros((3, len(mechanism.rows)))
            wrench[:, rows[k]] = sign * np.vstack([force, moment])
            names += [f"{joint} {part} on {bodies[int(on)]}" for part in ("force x", "force y", "moment")]
            out.append(wrench)
    return names, np.concatenate(out)


def load_wrenches(stack: Any, state: State) -> tuple[Wrench, Wrench]:
    """Wrenches of stacked loads on their bodies i and j, moments about the bodies' origins."""
    body, rate = poses(state.q), poses(state.qd)
    return eqx.filter_vmap(
        lambda load, i, j: load.wrenches(Motion(body[i], rate[i]), Motion(body[j], rate[j]), state.t)
    )(stack.element, stack.i, stack.j)


def moved(moment: np.ndarray | float, force: np.ndarray, arm: np.ndarray) -> np.ndarray | float:
    """The moment of a wrench about a point at `arm` from where it is known."""
    return moment - arm[0] * force[1] + arm[1] * force[0]


def _coefficients(mechanism: Mechanism, state: State) -> list[np.ndarray]:
    """Force and moment about r_i on the bodies i by the multipliers of the joint's own rows, (size, 3, rows) each."""
    body, out = poses(state.q), []
    for stack in mechanism.joints:
        slope = eqx.filter_vmap(
            lambda joint, i, j: jax.jacfwd(lambda pose: joint.residual(pose, body[j], state.t))(body[i])
        )(stack.element, stack.i, stack.j)
        by_row = np.concatenate([np.asarray(slope.r), np.asarray(slope.phi)[..., None]], axis=2)
        out.append(-np.swapaxes(by_row, 1, 2).astype(float))
    return out


def _rows(mechanism: Mechanism) -> list[np.ndarray]:
    """Row indices of the joints of each stack, (size, rows)."""
    place = {name: row for row, name in enumerate(mechanism.rows.labels)}
    return [
        np.array([[place[f"{name}.{row}"] for row, _ in stack.element.row_kinds] for name in names])
        for stack, names in zip(mechanism.joints, mechanism.joint_names, strict=True)
    ]
