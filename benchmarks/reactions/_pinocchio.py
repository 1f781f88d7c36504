"""Pinocchio: a tree in joint coordinates, loops by its constrained dynamics with proximal steps, loads by `rnea`

Its loops are points and frames: a hinge that closes a loop is two points on its axis, as for MuJoCo.
"""

from collections.abc import Iterator

import numpy as np
import pinocchio

from ._cases import GRAVITY, GROUND, Case, axes_along, floats, hung

_HALF = 0.05  # m: of two points that stand for a hinge
_CLOSING = {"hinge": (_HALF, -_HALF), "ball": (0.0,)}


def answer(case: Case) -> dict[str, np.ndarray] | None:
    """Loads on body i about the point of the joint; of a case with joints that it does not have, None."""
    hanging, closing = hung(case)
    kinds = {name: case.joints[name].kind for name in case.joints}
    if any(kinds[name] not in _CLOSING for name in closing) or any(kinds[name] == "fixed" for name in hanging.values()):
        return None
    model = pinocchio.Model()
    model.gravity.linear = floats(GRAVITY)
    numbers, axes, at = {GROUND: 0}, {0: np.eye(3)}, {0: np.zeros(3)}
    for body in _depth_first(case, hanging, GROUND):
        joint = case.joints[hanging[body]]
        above, own = numbers[joint.j], axes_along(joint.axis)
        place = pinocchio.SE3(axes[above].T @ own, axes[above].T @ (floats(joint.point) - at[above]))
        number = model.addJoint(above, _moving(joint.kind), place, body)
        numbers[body], axes[number], at[number] = number, own, floats(joint.point)
        weight = case.bodies[body]
        inertia = own.T @ np.diag(floats(weight.inertia)) @ own
        centre = own.T @ (floats(weight.centre) - at[number])
        model.appendBodyToJoint(
            number, pinocchio.Inertia(float(weight.mass), centre, inertia), pinocchio.SE3.Identity()
        )
    loops, datas, owners = pinocchio.StdVec_RigidConstraintModel(), pinocchio.StdVec_RigidConstraintData(), []
    for name in closing:
        joint = case.joints[name]
        for along in _CLOSING[joint.kind]:
            point, pair = floats(joint.point) + along * floats(joint.axis), (numbers[joint.i], numbers[joint.j])
            places = [pinocchio.SE3(axes[k].T, axes[k].T @ (point - at[k])) for k in pair]
            kind, frame = pinocchio.ContactType.CONTACT_3D, pinocchio.ReferenceFrame.LOCAL
            loops.append(pinocchio.RigidConstraintModel(kind, model, pair[0], places[0], pair[1], places[1], frame))
            owners.append((name, point))
    data, still = model.createData(), np.zeros(model.nv)
    for each in loops:
        datas.append(each.createData())
    pinocchio.initConstraintDynamics(model, data, loops, datas)
    settings = pinocchio.ProximalSettings(1e-12, 1e-12, 1e-6, 200)
    q = pinocchio.neutral(model)
    a = pinocchio.constraintDynamics(model, data, q, still, still, loops, datas, settings)
    found = {name: np.zeros(6) for name in case.joints}
    pushes = [pinocchio.Force.Zero() for _ in range(model.njoints)]
    for own, (name, point) in zip(datas, owners, strict=True):
        force = own.contact_force.linear  # on joint1, in global axes as the frames of the loop are
        joint = case.joints[name]
        for body, sign in ((joint.i, 1.0), (joint.j, -1.0)):
            k = numbers[body]
            local = axes[k].T @ (sign * force)
            pushes[k] += pinocchio.Force(local, np.cross(axes[k].T @ (point - at[k]), local))
        found[name] += np.concatenate([force, np.cross(point - floats(joint.point), force)])
    pinocchio.rnea(model, data, q, still, a, pushes)
    for body, name in hanging.items():
        k = numbers[body]
        found[name] = np.concatenate([axes[k] @ data.f[k].linear, axes[k] @ data.f[k].angular])
    return found


def _depth_first(case: Case, hanging: dict[str, str], above: str) -> Iterator[str]:
    """Bodies that hang on one, each before those on it: Pinocchio's matrices take all of a branch to be numbered
    together, and are wrong without a word where they are not."""
    for body, joint in hanging.items():
        if case.joints[joint].j == above:
            yield body
            yield from _depth_first(case, hanging, body)


def _moving(kind: str):
    """A joint along or about z."""
    if kind == "cylindrical":
        both = pinocchio.JointModelComposite(pinocchio.JointModelPZ())
        both.addJoint(pinocchio.JointModelRZ())
        return both
    return {
        "hinge": pinocchio.JointModelRZ,
        "slide": pinocchio.JointModelPZ,
        "ball": pinocchio.JointModelSpherical,
    }[kind]()
