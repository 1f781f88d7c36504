"""Exudyn: rigid bodies in redundant coordinates, joints by the axes that they lock, a hundred steps of 1e-6 s

By default its solver stops at a singular Jacobian; that of `EigenDense` may ignore it, as its manual says for
redundant constraints. What it prints as torque are the multipliers of its equations of angles: a hinge that alone
carries a weight shows that (a, b) is the moment (b, -a), and of a slide or a fixed joint (a, b, c) is (a, -b, -c).
`turned` prints it so.
"""

from functools import partial

import exudyn
import numpy as np
from exudyn.utilities import (
    GenericJoint,
    MarkerBodyRigid,
    ObjectGround,
    PrismaticJointX,
    RevoluteJointZ,
    RigidBodyInertia,
    SphericalJoint,
)

from ._cases import GRAVITY, GROUND, Case, axes_along, floats

_JOINTS = {
    "hinge": RevoluteJointZ,
    "slide": PrismaticJointX,
    "ball": SphericalJoint,
    "cylindrical": partial(GenericJoint, constrainedAxes=[1, 1, 0, 1, 1, 0]),
    "fixed": partial(GenericJoint, constrainedAxes=[1] * 6),
}
_STEP, _STEPS = 1e-6, 100  # s; the index-3 integrator rings at first


def turned(case: Case) -> dict[str, np.ndarray] | None:
    """The same with moments as components along the axes of the joints."""
    return answer(case, as_printed=False)


def answer(case: Case, *, as_printed: bool = True) -> dict[str, np.ndarray] | None:
    """Forces and moments of the joints after the last step, in global axes."""
    mbs = exudyn.SystemContainer().AddSystem()
    bodies = {GROUND: mbs.AddObject(ObjectGround())}
    for name, body in case.bodies.items():
        inertia = RigidBodyInertia(mass=float(body.mass), inertiaTensor=np.diag(floats(body.inertia)))
        place = floats(body.centre).tolist()
        bodies[name] = mbs.CreateRigidBody(inertia=inertia, referencePosition=place, gravity=floats(GRAVITY).tolist())
    joints, frames = {}, {}
    for name, joint in case.joints.items():
        markers = [_marker(mbs, bodies, case, body, floats(joint.point)) for body in (joint.i, joint.j)]
        axes = axes_along(joint.axis)
        frames[name] = axes = axes[:, [2, 0, 1]] if joint.kind == "slide" else axes
        held: dict = {"markerNumbers": markers}  # loads are those on the first
        if joint.kind == "ball":
            frames[name] = np.eye(3)
        else:
            held |= {"rotationMarker0": axes, "rotationMarker1": axes}
        joints[name] = mbs.AddObject(_JOINTS[joint.kind](**held))
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = _STEPS, _STEPS * _STEP
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolverType = exudyn.LinearSolverType.EigenDense
    settings.linearSolverSettings.ignoreSingularJacobian = True
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.5
    try:
        mbs.SolveDynamic(settings)
    except Exception:
        return None
    found = {}
    for name, joint in case.joints.items():
        if joint.kind == "ball":
            force = mbs.GetObjectOutput(joints[name], exudyn.OutputVariableType.Force)
            found[name] = np.concatenate([force, np.zeros(3)])
            continue
        force = mbs.GetObjectOutput(joints[name], exudyn.OutputVariableType.ForceLocal)
        moment = mbs.GetObjectOutput(joints[name], exudyn.OutputVariableType.TorqueLocal)
        if not as_printed:
            a, b, c = moment
            moment = np.array([b, -a, c] if joint.kind in ("hinge", "cylindrical") else [a, -b, -c])
        found[name] = np.concatenate([frames[name] @ force, frames[name] @ moment])
    return found


def _marker(mbs, bodies: dict, case: Case, body: str, point: np.ndarray):
    at = point if body == GROUND else point - floats(case.bodies[body].centre)
    return mbs.AddMarker(MarkerBodyRigid(bodyNumber=bodies[body], localPosition=at.tolist()))
