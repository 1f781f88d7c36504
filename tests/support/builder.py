"""redundax's mechanisms of a description, see `truth.description`."""

from collections.abc import Sequence
from typing import Any

from truth.description import GROUND, Joint, Load, Parameters, Structure

import redundax as rx


def friction_of(joint: Joint, own: dict) -> Any:
    """The model of friction that a description states."""
    if joint.friction == "coulomb":
        return rx.Coulomb(own["coefficient"], own["preload"])
    return rx.ConstantFriction(own["size"]) if joint.friction else None


def _name(body: int) -> str:
    return rx.GROUND if body == GROUND else f"body {body + 1}"


def _joint(name: str, joint: Joint, own: dict, friction: Any) -> Any:
    ends = name, _name(joint.i), _name(joint.j)
    points = own.get("point_i"), own.get("point_j")
    if joint.kind == "revolute":
        return rx.Revolute(*ends, *points, 1.0, friction)
    if joint.kind == "translational":
        guide = own["normal"], own["angle"], own["guide_length"]
        return rx.Translational(*ends, *points, *guide, friction)
    if joint.kind == "pin":
        return rx.PinInSlot(*ends, *points, own["normal"], friction)
    if joint.kind == "fixed":
        return rx.Fixed(*ends, *points, own["angle"])
    if joint.kind == "gear":
        return rx.AngleCoupling(*ends, own["ratio"], own["angle"])
    law = rx.Polynomial(own["coefficients"])
    return rx.AngleDriver(*ends, law) if joint.kind == "angle" else rx.DistanceDriver(*ends, *points, law)


def _load(load: Load, own: dict, length: Any) -> Any:
    i, j, k = _name(load.i), _name(load.j), load.number
    if load.kind == "spring":
        points = own["point_i"][k], own["point_j"][k]
        return rx.SpringDamper(i, j, *points, own["stiffness"][k], own["free"][k] * length, own["damping"][k])
    if load.kind == "torsion":
        size = length**2
        return rx.TorsionSpring(i, j, own["stiffness"][k] * size, own["free"][k], own["damping"][k] * size)
    return rx.AppliedForce(i, own["force"][k], own["point_i"][k], own["moment"][k], follows=load.kind == "follower")


def build(
    structure: Structure, parameters: Parameters, names: Sequence[str] = (), friction: Sequence | None = None
) -> rx.Mechanism:
    """Bodies, joints and loads in their order; of one sample, whose numbers may be traced.

    Joints are called `names`, or by their places; `friction` takes the place of what the description states.
    """
    numbers = zip(structure.joints, parameters.joints, strict=True)
    laws = [friction_of(*joint) for joint in numbers] if friction is None else friction
    names = names or [f"joint {k}" for k in range(len(structure.joints))]
    joints = zip(names, structure.joints, parameters.joints, laws, strict=True)
    inertial = zip(structure.bodies, parameters.mass, parameters.inertia, strict=True)
    raw = parameters.raw
    return rx.Mechanism(
        [rx.Body(_name(body), mass, inertia) for body, mass, inertia in inertial],
        [_joint(*joint) for joint in joints],
        loads=[_load(load, raw, raw.get("length")) for load in structure.loads],
        gravity=raw["gravity"],
    )
