"""Pins that are too large for their mechanism, as where a radius is in mm and points are in m."""

import itertools
from collections.abc import Sequence

import numpy as np

from .._tools._module import is_concrete
from .._tools._words import warn
from ._body import GROUND
from ._friction_model import Coulomb, Dahl, LuGre, RegularisedCoulomb, Stribeck
from ._joints import AbstractJoint, AbstractRubbingJoint

_LARGE = 0.25  # of the largest distance of joints: rods beside pins are longer by far


def warn_of_large_pins(joints: Sequence[AbstractJoint]) -> None:
    """Ask about friction radii, mu times that of a pin, that compare with the distances of joints."""
    radii = {joint.name: radius for joint in joints if (radius := _friction_radius(joint)) is not None}
    size = _size(joints) if radii else 0.0
    large = [f"{radius:.4g} in '{name}'" for name, radius in radii.items() if radius > _LARGE * size]
    if size > 0 and large:
        warn(
            f"Friction acts at a radius, mu times `pin_radius`, of {', '.join(large)}, beside a largest distance of "
            f"joints of {size:.4g}. Is `pin_radius` in the length unit of the points?"
        )


def _friction_radius(joint: AbstractJoint) -> float | None:
    """Coefficient times radius of a pin; None where there is none or it is not known yet."""
    if not isinstance(joint, AbstractRubbingJoint) or (radius := joint.pin()) is None:
        return None
    match joint.friction:
        case Coulomb(mu=coefficient) | RegularisedCoulomb(mu=coefficient) | Dahl(mu=coefficient):
            numbers = (coefficient, radius)
        case Stribeck(static=coefficient) | LuGre(static=coefficient):
            numbers = (coefficient, radius)
        case _:
            return None
    return float(np.prod([np.asarray(x) for x in numbers])) if all(map(is_concrete, numbers)) else None


def _size(joints: Sequence[AbstractJoint]) -> float:
    """Largest distance between points of joints on a body, and from its centre of mass; 0 where none is known."""
    points: dict[str, list[np.ndarray]] = {}
    for joint in joints:
        for body, point in ((joint.i, joint.point_on("i")), (joint.j, joint.point_on("j"))):
            if point is not None and is_concrete(point):
                own = points.setdefault(body, [] if body == GROUND else [np.zeros(point.shape)])
                own.append(np.asarray(point))
    pairs = [pair for own in points.values() for pair in itertools.combinations(own, 2)]
    return max((float(np.linalg.norm(a - b)) for a, b in pairs), default=0.0)
