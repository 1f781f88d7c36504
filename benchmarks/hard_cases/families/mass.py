"""Singular mass matrices with and without condition (14), and constraints that contradict each other.

Massless bodies are harmless where the constraints give every motion some mass. Two drivers of one motion whose
accelerations differ by a relative amount have no solution: from 1e-3 on that must be said, below it the difference
counts as one of the inputs.
"""

import dataclasses
from functools import partial

from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import carriage, carriage_parameters, cranks, cranks_parameters

from .._case import Case
from .._linear import linear
from ._common import closed, linkage, paper

FAMILY = "mass"
SMOOTH = ("decided", "declared", "compliance", "factorize", "vmap")
SHORT = ("decided", "compliance", "factorize")
RUBBING = ("decided", "compliance", "fixed point", "vmap")
CLASHES = ("1e-14", "1e-12", "1e-10", "1e-8", "1e-6", "1e-3", "1e-1", "1")


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    return [*massless(), *free_and_massless(), *clashing(CLASHES[::3] if quick else CLASHES)]


def massless() -> list[Case]:
    """Bodies without mass and inertia where (14) holds, and with next to none."""
    found = []
    for name, factor in (("massless", "0"), ("nearly massless", "1e-12")):
        light = exact.exact(factor)
        rods = {"mass": (*(light,) * 3, exact.exact(4)), "inertia": (*(light,) * 3, exact.exact("1/5"))}
        base = paper(FAMILY, "", ()).parameters
        bodies = {key: (base[key][0], *(x * light for x in base[key][1:])) for key in ("mass", "inertia")}
        found += [
            linkage(FAMILY, f"{name} cranks", SMOOTH, **rods),
            linkage(FAMILY, f"{name} cranks, friction", RUBBING, friction=True, **rods),
            paper(FAMILY, f"{name} bodies", SMOOTH, friction=False, **bodies),
            paper(FAMILY, f"{name} bodies, friction", RUBBING, **bodies),
        ]
    return found


def free_and_massless() -> list[Case]:
    """A motion without mass: (14) fails, and no acceleration is the answer."""
    parameters = carriage_parameters(3) | {"mass": (mp.mpf(0),)}
    given = {
        "mass": (2, 0, 0, 1, 1, 1),
        "load": (1, 4, 3, 0, 0, -1),
        "free": ((1, -1, 0, 0, 0, 0), (0, 0, 0, 1, 1, 0)),
        "combinations": ((-2, 0), (0, 1), (1, 1)),
        "gamma": ("1/2", "-1/3"),
    }
    system = {name: exact.exact(value) for name, value in given.items()}
    two = {**system, "mass": tuple(map(exact.exact, (2, 0, 0, 1, 0, 0)))}
    return [
        Case(FAMILY, "massless carriage", carriage, closed(parameters, 6), SHORT, unsolvable=True),
        Case(FAMILY, "a coordinate without mass", linear, closed(system, 5), SHORT, unsolvable=True),
        Case(FAMILY, "motions without mass beside others", linear, closed(two, 5), SHORT, unsolvable=True),
        *(
            Case(FAMILY, f"a coordinate with mass {mass}", linear, closed(_weighted(system, mass), 5), SHORT)
            for mass in ("1e-8", "1e-12")
        ),
    ]


def _weighted(system: dict, mass: str) -> dict:
    return {**system, "mass": (*system["mass"][:2], exact.exact(mass), *system["mass"][3:])}


def clashing(sizes: tuple[str, ...]) -> list[Case]:
    """Three cranks, all driven, the second with another acceleration."""
    parameters = closed(cranks_parameters(3, law="-5/2", t="3/10"), 15)
    build = partial(cranks, drivers=3)
    found = [Case(FAMILY, "drivers agree", build, parameters, SHORT)]
    for size in sizes:
        options = {"size": float(size), "unsolvable": float(size) >= 1e-3, "refused": True}
        disturb = partial(clash, size=size)
        found.append(Case(FAMILY, f"drivers differ by {size}", build, parameters, SHORT, disturb=disturb, **options))
    return found


@exactly
def clash(mechanism: exact.Mechanism, size: str) -> exact.Mechanism:
    """The second driver with another acceleration, the same position and velocity at this time."""
    first, second, *rest = mechanism.drivers
    t, more = mechanism.t, second.acceleration * exact.exact(size)
    second = dataclasses.replace(
        second,
        start=second.start + more * t**2 / 2,
        speed=second.speed - more * t,
        acceleration=second.acceleration + more,
    )
    return dataclasses.replace(mechanism, drivers=(first, second, *rest))
