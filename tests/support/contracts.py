"""One sample of every public part, by its class, for laws that hold of all parts of a kind.

`public` finds the parts in the public namespaces; a part without a sample here fails a test. Lower pairs in space need
none: what a point and an axis make is made so. Samples of joints and loads are functions of two bodies and of the unit
`u` of length: each length is `u` times that in metres, and so are the sizes of what rubs. In space both bodies are at
reference poses that close all samples.
"""

import inspect
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

import redundax as rx
from redundax._bodies._joints import AbstractRubbingJoint

rs = rx.spatial
COULOMB = rx.Coulomb(0.2)
HERE = np.array([0.3, -0.2, 0.5])
SQUARE = (1.0, 2.0, -2.0), (0.0, 1.0, 1.0)  # axis and mark, global


def public(kind: type, *rooms: Any) -> dict[str, type]:
    """All public parts of a kind that can be made, by name."""
    found = [(room, name, part) for room in rooms or (rx, rs) for name, part in vars(room).items()]
    return {
        f"{getattr(room, '__name__', 'own')}.{name}": part
        for room, name, part in found
        if inspect.isclass(part) and issubclass(part, kind) and not name.startswith(("Abstract", "_"))
    }


def forgotten(kind: type, samples: dict, *rooms: Any) -> list[str]:
    """Public parts that have no sample."""
    return [name for name, part in public(kind, *rooms).items() if part not in samples]


# ---------------------------------------------------------------------------------------- in space


def bodies(u: float = 1.0) -> tuple[Any, Any]:
    """Two bodies that look somewhere; forces have the same unit whatever that of length."""
    a = rs.Body(
        "a",
        2.0 / u,
        u * np.array([0.3, 0.4, 0.5]),
        centre=u * np.array([0.1, 0.2, -0.1]),
        position=u * np.array([0.4, 0.1, 0.0]),
        orientation=(0.9, 0.1, 0.3, -0.2),
    )
    inertia = u * np.array([[0.3, 0.02, 0.0], [0.02, 0.4, 0.01], [0.0, 0.01, 0.5]])
    return a, rs.Body("b", 1.0 / u, inertia, position=u * np.array([-0.3, 0.2, 0.1]), orientation=(0.7, -0.3, 0.2, 0.5))


def pair(kind: Any) -> Callable:
    """A joint at a point and axis, which rubs if it can; one with arguments of its own is not made so."""
    rubs = {"friction": COULOMB} if issubclass(kind, rx.AbstractFrictionalJoint | AbstractRubbingJoint) else {}
    sizes = kind.surfaces.sizes if rubs else ()

    def made(a: Any, b: Any, u: float) -> Any:
        own = {name: 0.01 * (k + 2) * u for k, name in enumerate(sizes)}
        return kind(kind.__name__, a, b, u * HERE, *SQUARE, **own, **rubs)

    return made


def is_pair(kind: Any) -> bool:
    """Whether a point, axis and mark are all that it needs."""
    wanted = list(inspect.signature(kind).parameters.values())
    needed = [each.name for each in wanted if each.default is each.empty and each.kind is not each.VAR_KEYWORD]
    return needed == ["name", "i", "j"] and [each.name for each in wanted[3:6]] == ["point", "axis", "mark"]


PIN = {"pin_radius": 0.01, "bearing_length": 0.05, "thrust_radius": 0.02}
IN_SPACE = {kind: pair(kind) for kind in public(rs.AbstractPlacedJoint, rs).values() if is_pair(kind)} | {
    rs.Screw: lambda a, b, u: rs.Screw(
        "Screw", a, b, u * HERE, *SQUARE, pitch=0.05 * u, thread_radius=0.01 * u, bearing_length=0.04 * u,
        friction=COULOMB,
    ),
    rs.Universal: lambda a, b, u: rs.Universal(
        "Universal", a, b, u * HERE, (1, 0, 0), (0, 1, 0), friction=COULOMB,
        **{name: u * size for name, size in PIN.items()},
    ),
    rs.Gear: lambda a, b, u: rs.Gear(
        "Gear", a, b, u * HERE, (0, 0, 1), u * (HERE + np.array([0.08, 0, 0])), (0, 0, 1), teeth=(20, 60)
    ),
    rs.Distance: lambda a, b, u: rs.Distance("Distance", a, b, u * HERE, u * (HERE + 0.3)),
    rs.Cable: lambda a, b, u: rs.Cable("Cable", a, b, u * HERE, u * (HERE + 0.3)),
    rs.AngleDriver: lambda a, b, u: rs.AngleDriver("AngleDriver", a, b, u * HERE, *SQUARE, angle=0.0),
    rs.TravelDriver: lambda a, b, u: rs.TravelDriver("TravelDriver", a, b, u * HERE, *SQUARE, travel=0.0),
    rs.Free: lambda a, b, u: rs.Free("Free", a, b),
    rs.Wheel: lambda a, b, u: rs.Wheel("Wheel", a, b, u * HERE, SQUARE[0], radius=0.3 * u, normal=(0.1, 0.2, 1.0)),
    rs.KnifeEdge: lambda a, b, u: rs.KnifeEdge("KnifeEdge", a, b, u * HERE, SQUARE[0], normal=(0.1, 0.2, 1.0)),
}  # fmt: skip


def drag(i: Any, j: Any, t: Any, p: Any) -> tuple[Any, Any]:
    return i.wrench(-p * i.velocity, jnp.zeros(3)), j.wrench(p * i.velocity, jnp.zeros(3))


LOADS_IN_SPACE = {
    rs.AppliedForce: lambda a, b, u: rs.AppliedForce(a, (1, 2, 3), point=u * HERE, moment=(u, 0, -u)),
    rs.SpringDamper: lambda a, b, u: rs.SpringDamper(
        a, b, u * HERE, u * (HERE + 0.3), stiffness=3.0 / u, free_length=0.2 * u, damping=0.3 / u
    ),
    rs.TorsionSpring: lambda a, b, u: rs.TorsionSpring(
        a, b, SQUARE[0], stiffness=2.0 * u, free_angle=0.1, damping=0.2 * u
    ),
    rs.Bushing: lambda a, b, u: rs.Bushing(
        a, b, u * HERE, *SQUARE, translation=np.array([1.0, 2.0, 3.0]) / u, rotation=2.0 * u,
        translation_damping=0.1 / u, rotation_damping=0.2 * u,
    ),
    rs.LoadFunction: lambda a, b, u: rs.LoadFunction(a, drag, b, 1.0 / u),
}  # fmt: skip


def in_space(u: float = 1.0, samples: dict = IN_SPACE) -> rx.Mechanism:
    """All samples between the same two bodies, and all loads."""
    a, b = bodies(u)
    loads = [make(a, b, u) for make in LOADS_IN_SPACE.values()]
    return rx.Mechanism([a, b], [make(a, b, u) for make in samples.values()], loads=loads)


# ------------------------------------------------------------------------------------ in the plane

S, T = np.array([0.2, -0.1]), np.array([-0.1, 0.3])
IN_THE_PLANE = {
    rx.Revolute: lambda u: rx.Revolute("Revolute", "a", "b", u * S, u * T, pin_radius=0.01 * u, friction=COULOMB),
    rx.Translational: lambda u: rx.Translational(
        "Translational", "a", "b", u * S, u * T, (0.6, 0.8), 0.3, guide_length=0.05 * u, friction=COULOMB
    ),
    rx.PinInSlot: lambda u: rx.PinInSlot("PinInSlot", "a", "b", u * S, u * T, (0.6, 0.8), friction=COULOMB),
    rx.Fixed: lambda u: rx.Fixed("Fixed", "a", "b", u * S, u * T, 0.5),
    rx.GearPair: lambda u: rx.GearPair("GearPair", "a", "b", u * S, u * T, (20, 60), 0.002 * u, friction=COULOMB),
    rx.RackAndPinion: lambda u: rx.RackAndPinion(
        "RackAndPinion", "a", "b", u * S, u * T, (0.6, 0.8), 20, 0.002 * u, friction=COULOMB
    ),
    rx.AngleCoupling: lambda u: rx.AngleCoupling("AngleCoupling", "a", "b", 3.0, 0.1),
    rx.AngleDriver: lambda u: rx.AngleDriver("AngleDriver", "a", "b", 0.4),
    rx.DistanceDriver: lambda u: rx.DistanceDriver("DistanceDriver", "a", "b", u * S, u * T, 0.6 * u),
    rx.Cable: lambda u: rx.Cable("Cable", "a", "b", u * S, u * T, 0.6 * u),
    rx.Wheel: lambda u: rx.Wheel("Wheel", "a", "b", u * S, u * T, (0.6, 0.8), 0.3 * u),
    rx.KnifeEdge: lambda u: rx.KnifeEdge("KnifeEdge", "a", "b", u * S, (0.6, 0.8)),
}  # fmt: skip


def planar_drag(i: Any, j: Any, t: Any, p: Any) -> tuple[Any, Any]:
    return i.wrench(-p * i.rate.r, jnp.zeros(2)), j.wrench(p * i.rate.r, jnp.zeros(2))


LOADS_IN_THE_PLANE = {
    rx.AppliedForce: lambda u: rx.AppliedForce("a", (1.0, 2.0), u * S, 0.3 * u),
    rx.SpringDamper: lambda u: rx.SpringDamper("a", "b", u * S, u * T, 2.0 / u, 0.1 * u, 0.4 / u),
    rx.TorsionSpring: lambda u: rx.TorsionSpring("a", "b", 2.0 * u, 0.1, 0.3 * u),
    rx.LoadFunction: lambda u: rx.LoadFunction("a", planar_drag, "b", 1.0 / u),
}  # fmt: skip


def in_the_plane(u: float = 1.0, samples: dict = IN_THE_PLANE) -> rx.Mechanism:
    loads = [make(u) for make in LOADS_IN_THE_PLANE.values()]
    return rx.Mechanism(
        [rx.Body("a", 1.0 / u, 0.1 * u), rx.Body("b", 2.0 / u, 0.2 * u)],
        [make(u) for make in samples.values()],
        loads=loads,
    )


def somewhere(mechanism: rx.Mechanism, u: float = 1.0) -> rx.State:
    """A position a little off the reference pose, and a velocity; the same in each unit of length."""
    random = np.random.default_rng(2)
    scale = np.where(mechanism.coordinates.angular, 1.0, u)
    d, qd = (jnp.asarray(scale * random.normal(size=scale.size)) for _ in range(2))
    start = jnp.zeros(scale.size) if mechanism.adds else mechanism.reference
    return rx.State(mechanism.retract(start, 0.1 * d if not mechanism.adds else 0.5 * d), qd, 0.0)


# ----------------------------------------------------------------------- laws, closures and solvers

LAWS = {
    rx.Coulomb: rx.Coulomb(0.3, preload=2.0),
    rx.RegularisedCoulomb: rx.RegularisedCoulomb(0.3, velocity=0.4, preload=2.0),
    rx.Stribeck: rx.Stribeck(0.4, 0.2, velocity=0.3, viscous=0.5, preload=2.0),
    rx.ConstantFriction: rx.ConstantFriction(3.0),
    rx.Dahl: rx.Dahl(0.3, stiffness=30.0, preload=2.0),
    rx.LuGre: rx.LuGre(0.4, 0.3, velocity=0.3, stiffness=30.0, damping=0.1, viscous=0.05, preload=2.0),
}
CONTACTS = {rs.EndContacts: rs.EndContacts(), rs.AdditiveContact: rs.AdditiveContact()}
SOLVERS = {rx.FixedPoint: rx.FixedPoint(), rx.Newton: rx.Newton(), rx.Continuation: rx.Continuation()}


def _elastic(mechanism: rx.Mechanism) -> rx.ElasticJoints:
    return rx.ElasticJoints(mechanism, {name: (1e-8, 1e-6) for stack in mechanism.names.joints for name in stack})


CLOSURES: dict[type, Callable[[rx.Mechanism], rx.AbstractClosure]] = {
    rx.MinimumNorm: lambda mechanism: rx.MinimumNorm(),
    rx.Compliance: lambda mechanism: rx.Compliance(jnp.full(len(mechanism.rows), 2e-8)),
    rx.ElasticJoints: _elastic,
    rx.AsBuilt: lambda mechanism: rx.AsBuilt(_elastic(mechanism), rx.heated(mechanism, {"2": 30.0}, 1e-5)),
    rx.RowNormalised: lambda mechanism: rx.RowNormalised(),
    rx.UnitConsistent: lambda mechanism: rx.UnitConsistent(),
    rx.LeastNorm: lambda mechanism: rx.LeastNorm({"drive": 10.0}, _elastic(mechanism)),
}
