"""The mechanism in space of a description: its bodies, joints, loops and loads

The reference pose is that of the description, where all joints are closed.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypedDict

import numpy as np
from jaxtyping import Array
from numpy.polynomial import Polynomial

from .._bodies._body import GROUND
from .._bodies._coupler import Coupler, Stop
from .._bodies._friction_model import ConstantFriction
from .._bodies._joints import AbstractJoint
from .._bodies._loads import AbstractLoad
from .._bodies._mechanism import Mechanism
from .._bodies._space._body import Body
from .._bodies._space._joints._distance import Cable, Distance, Span
from .._bodies._space._joints._drivers import AngleDriver, TravelDriver
from .._bodies._space._joints._gear import Gear
from .._bodies._space._joints._orientation import AngleOfAxes, NoRotation
from .._bodies._space._joints._pairs import (
    ConstantVelocity,
    Cylindrical,
    Fixed,
    Free,
    ParallelAxes,
    Planar,
    PointOnLine,
    PointOnPlane,
    Prismatic,
    Revolute,
    Spherical,
)
from .._bodies._space._joints._rolled import Rack, Thread
from .._bodies._space._joints._universal import Universal
from .._bodies._space._loads._applied import AppliedForce
from .._bodies._space._placement import Placement
from .._bodies._space._rotation import as_quaternion
from .._bodies._speed_driver import SpeedDriver
from .._system._names import index_of
from .._system._units import ready_units
from .._tools._errors import RedundaxError
from .._tools._numbers import Numeric
from ._description import Description, End, Joint, Loop, Term, Tie
from ._joint_loads import armature, carried_armature, joint_loads
from ._kinds import coordinates_of
from ._loop_rows import ROLLED, count_of, teeth_of
from ._tree import Tree

_KINDS: dict[str, Callable[..., AbstractJoint]] = {
    "hinge": Revolute,
    "slide": Prismatic,
    "ball": Spherical,
    "connect": Spherical,
    "weld": Fixed,
    "fixed joint": Fixed,
    "cylindrical joint": Cylindrical,
    "universal joint": Universal,
    "planar joint": Planar,
    "point-on-line joint": PointOnLine,
    "point-on-plane joint": PointOnPlane,
    "parallel-axes joint": ParallelAxes,
    "constant-velocity joint": ConstantVelocity,
    "no-rotation joint": NoRotation,
}


class Added(NamedTuple):
    """Parts that a file does not have."""

    joints: Sequence[AbstractJoint] = ()
    couplers: Sequence[Coupler | Stop | SpeedDriver] = ()
    loads: Sequence[AbstractLoad] = ()


class _Held(TypedDict):
    """What constructors of joints between two ends take."""

    name: str
    i: str
    j: str
    on_i: Placement
    on_j: Placement


class _Apart(TypedDict):
    """What constructors of distances take."""

    name: str
    i: str
    j: str
    on_i: Array
    on_j: Array
    distance: float


def mechanism_of(
    described: Description,
    *,
    driven: bool = False,
    stopped: bool = False,
    added: Added = Added(),  # noqa: B008 (it is frozen)
    rubbing: Mapping[str, object] = MappingProxyType({}),
) -> tuple[Mechanism, list[str]]:
    """The mechanism, with or without the file's motions by laws of time and the limits of its joints as stops, with
    parts that are `added`, and joints that are `rubbing` as arguments of their constructors say; and
    what of its joints is left out, a line each."""
    bodies = {body.name: body for body in bodies_of(described)}
    loads, notes = joint_loads(described, {GROUND: GROUND, **bodies})
    for number, point, force in described.lifts:
        body = described.bodies[number]
        loads.append(AppliedForce(body.name, force, on_i=body.axes.T @ (point - body.position)))
    rubs = _checked_rubbing(described, rubbing)
    joints: list[AbstractJoint] = [_joint(described, joint, rubs.get(joint.name)) for joint in described.joints]
    joints += [_loop(described, loop, rubs.get(loop.name, {})) for loop in described.loops]
    couplers: list[Coupler | Stop | SpeedDriver] = [
        Coupler(tie.name, _sum(described, tie.first), _sum(described, tie.second), polynomial=_counted(tie))
        for tie in described.ties
        if tie.second
    ]
    tied = [term for tie in described.ties if tie.second for term, _ in (*tie.first, *tie.second)]
    spans = {term.name: term for term in tied if isinstance(term, Loop)}
    joints += [Span(**_apart(described, name, term)) for name, term in spans.items()]
    couplers += list(_stops(described)) if stopped else []
    joints += [Cable(**_apart(described, f"stop of {each.name}", each)) for each in described.cables if stopped]
    joints += [_lock(described, tie) for tie in described.ties if not tie.second]
    joints += [_driver(described, *motor) for motor in described.motors if driven]
    weightless = [
        described.child(joint)
        for joint in described.joints
        if not described.is_between(joint) and not described.body(joint.child).mass
    ]
    if weightless:
        notes.append(f"bodies without mass in the file: {', '.join(weightless)}; what they carry is found all the same")
    mechanism = Mechanism(
        list(bodies.values()),
        [*joints, *added.joints],
        couplers=[*couplers, *added.couplers],
        loads=[*loads, *added.loads],
        armature=armature(described),
        gravity=described.gravity,
        units=ready_units("SI"),
    )
    return mechanism, notes


def _sum(described: Description, terms: Sequence[Term]) -> str | dict[str, float]:
    """Coordinates that are tied and their weights; of a single one the name."""
    found = {}
    for term, weight in terms:
        part = term if isinstance(term, Loop) else described.joints[term]
        coordinate = "distance" if isinstance(term, Loop) else coordinates_of(part.kind)[0]
        found[f"{part.name}.{coordinate}"] = weight
    return next(iter(found)) if [*found.values()] == [1.0] else found


def _counted(tie: Tie) -> np.ndarray:
    """The polynomial of a tie, of coordinates of a mechanism: distances count from 0."""
    one, other = (
        sum(weight * term.value for term, weight in terms if isinstance(term, Loop))
        for terms in (tie.first, tie.second)
    )
    if not one and not other:
        return tie.polynomial
    shifted = Polynomial(tie.polynomial)(Polynomial([-other, 1.0])) + one
    return np.pad(shifted.coef, (0, max(0, 2 - shifted.coef.size)))


def position_of(tree: Tree, mechanism: Mechanism, positions: np.ndarray) -> np.ndarray:
    """Coordinates q of the mechanism at positions of the joints."""
    poses, place = tree.at(positions), {body.name: k for k, body in enumerate(tree.description.bodies)}
    centres = dict(zip(mechanism.names.bodies, np.asarray(mechanism.frame.centres(mechanism.body)), strict=True))
    points, turns = [], []
    for name, centre in centres.items():
        body, k = tree.description.bodies[place[name]], place[name]
        points.append(poses.turns[k] @ (body.position + body.axes @ centre) + poses.shifts[k])
        turns.append(as_quaternion("orientation", poses.turns[k] @ body.axes))
    return np.concatenate([np.ravel(points), *turns])


def bodies_of(described: Description) -> Iterator[Body]:
    """The moving bodies, in the order of joints."""
    for joint in described.joints:
        body = described.body(joint.child)
        inertia, rotor = body.inertia, carried_armature(described, joint)
        where = {
            "centre": body.axes.T @ (body.centre - body.position),
            "position": body.position,
            "orientation": body.axes,
        }
        with warnings.catch_warnings():
            if rotor is not None:
                warnings.simplefilter("ignore", UserWarning)  # no body has the inertia of one with a geared rotor
                inertia = inertia + rotor
            yield Body(body.name, body.mass, body.axes.T @ inertia @ body.axes, **where)


def placed(described: Description, end: End) -> Placement:
    """Where an end is on its body."""
    body = described.body(end)
    axes = body.axes.T @ end.axes
    return Placement(body.axes.T @ (end.point - body.position), axes[:, 2], axes[:, 0])


def _held(described: Description, name: str, i: End, j: End) -> _Held:
    return {
        "name": name,
        "i": described.body(i).name,
        "j": described.body(j).name,
        "on_i": placed(described, i),
        "on_j": placed(described, j),
    }


def _joint(described: Description, joint: Joint, given: Mapping[str, object] | None) -> AbstractJoint:
    if joint.kind == "free":
        return Free(joint.name, described.child(joint), described.parent(joint))
    rubs: dict[str, object] = {"friction": ConstantFriction(joint.friction)} if joint.friction else {}
    if rubs and joint.kind == "hinge":  # no load changes it: its moment is the force at a radius of 1 m
        rubs["pin_radius"] = 1.0
    return _pair(_held(described, joint.name, joint.child, joint.parent), joint.kind, rubs if given is None else given)


def _pair(held: _Held, kind: str, rubs: Mapping[str, object]) -> AbstractJoint:
    try:
        return _KINDS[kind](**held, **rubs)
    except TypeError as error:
        raise RedundaxError(
            f"Argument `friction` must hold arguments of `rx.spatial.{_KINDS[kind].__name__}` for '{held['name']}', "
            f"but holds {', '.join(rubs)}: {error}."
        ) from error


def _checked_rubbing(described: Description, rubbing: Mapping[str, object]) -> dict[str, Mapping[str, object]]:
    """The arguments of joints that rub; refused where they are not by the names of joints that can."""
    kinds = {each.name: each.kind for each in (*described.joints, *described.loops)}
    parts = rubbing if isinstance(rubbing, Mapping) else {}
    found = {name: given for name, given in parts.items() if isinstance(given, Mapping)}
    if not isinstance(rubbing, Mapping) or len(found) < len(parts):
        raise RedundaxError(
            f"Argument `friction` must hold arguments of joints by their names, but is {rubbing!r}. Write "
            '{"guide": {"friction": rx.Coulomb(0.1), "guide_length": 0.08}}, say.'
        )
    for name in rubbing:
        index_of("friction", name, list(kinds), " of joints")
        if kinds[name] not in _KINDS:
            raise RedundaxError(
                f"Argument `friction` must name joints that can rub, but '{name}' is a {kinds[name]}. Leave it out."
            )
    return found


def _loop(described: Description, loop: Loop, rubs: Mapping[str, object]) -> AbstractJoint:
    first = loop.first
    if loop.kind == "distance joint":
        return Distance(**_apart(described, loop.name, loop))
    if loop.kind == "angle joint":
        return AngleOfAxes(**_held(described, loop.name, loop.second, first), angle=loop.value)
    if loop.kind == "gear joint":
        return Gear(**_held(described, loop.name, loop.second, first), teeth=teeth_of(loop))
    if loop.kind in ROLLED:
        kind = Rack if loop.kind == "rack joint" else Thread
        return kind(**_held(described, loop.name, loop.second, first), radius=loop.value)
    if loop.kind == "point-on-plane joint":
        first = first._replace(point=first.point + loop.value * first.axes[:, 2])
    return _pair(_held(described, loop.name, loop.second, first), loop.kind, rubs)


def _apart(described: Description, name: str, loop: Loop) -> _Apart:
    held = _held(described, name, loop.second, loop.first)
    on_i, on_j = held["on_i"].point, held["on_j"].point
    return {"name": name, "i": held["i"], "j": held["j"], "on_i": on_i, "on_j": on_j, "distance": loop.value}


def _driver(
    described: Description, name: str, number: int, coordinate: int, law: Callable[[Numeric], Numeric] | float
) -> AngleDriver | TravelDriver:
    """What moves a joint, by its number, in one of its coordinates."""
    joint = described.joints[number]
    held = _held(described, name, joint.child, joint.parent)
    is_turn = coordinates_of(joint.kind)[coordinate] == "angle"
    return AngleDriver(**held, angle=law) if is_turn else TravelDriver(**held, travel=law)


def limited(described: Description) -> Iterator[tuple[Joint | Loop, str, float]]:
    """Hinges and slides that have limits, their coordinates of the mechanism, and where the file counts these as in the
    reference pose, from which the mechanism counts them."""
    for part in (*described.joints, *described.loops):
        if part.limits and part.kind in ("hinge", "slide"):
            is_loop = isinstance(part, Loop)
            now = count_of(part, part.first[1:], part.second[1:]) if is_loop else float(part.reference[0])
            yield part, f"{part.name}.{coordinates_of(part.kind)[0]}", now


def _stops(described: Description) -> Iterator[Stop]:
    """Limits of hinges and slides."""
    for part, coordinate, now in limited(described):
        low, high = (limit - now for limit in part.limits or ())
        if part.kind == "hinge" and 2 * np.pi <= high - low < np.inf:  # angles are counted from -pi to pi
            continue
        ends, most = {"least": low, "most": high}, np.pi if part.kind == "hinge" else np.inf
        given = {end: at for end, at in ends.items() if abs(at) < most}
        if given:
            yield Stop(f"stop of {part.name}", coordinate, **given)


def _lock(described: Description, tie: Tie) -> AbstractJoint:
    """What holds a hinge, a slide or a distance at a displacement."""
    term, at = tie.first[0][0], float(tie.polynomial[0])
    if isinstance(term, Loop):
        return Distance(**_apart(described, tie.name, term._replace(value=term.value + at)))
    return _driver(described, tie.name, term, 0, at)
