"""Exact mechanisms of any numbers, on curves that their bodies follow.

    q = pose(s),   qd = rate dq/ds

A parameter set is a dictionary of 50-digit numbers. Whatever the numbers are, the assembly closes, the velocity is
admissible and the rank is the one that the builder states, so that perturbed mechanisms keep their redundancy.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import Any

from mpmath import mp

from .exact import Body, Driver, Mechanism, Revolute, Translational, exact, exactly

ZERO = mp.mpf(0)
ORIGIN = (ZERO, ZERO)
Parameters = Mapping[str, Any]
_STEP_DIGITS, _MORE_DIGITS = 60, 200


@exactly
def on_curve(pose: Callable, s, rate) -> dict:
    """q and qd where the bodies follow (x, y, angle) = pose(s); a difference has more digits than are kept."""
    with mp.workdps(_MORE_DIGITS):
        step = mp.mpf(10) ** -_STEP_DIGITS
        before, here, after = (_coordinates(pose(s + shift)) for shift in (-step, 0, step))
        rates = [rate * (y - x) / (2 * step) for x, y in zip(before, after, strict=True)]
    return {name: tuple(+mp.mpf(x) for x in values) for name, values in (("q", here), ("qd", rates))}


def _coordinates(poses: Sequence) -> tuple:
    return tuple(x for pose in poses for x in pose[:2]) + tuple(pose[2] for pose in poses)


def _mechanism(p: Parameters, pose: Callable, place, rank: int, joints: Sequence, t=ZERO) -> Mechanism:
    """Joints in the order of their kinds."""
    loads = p.get("loads") or ((ZERO, ZERO, ZERO),) * len(p["mass"])
    kinds = (tuple(x for x in joints if isinstance(x, kind)) for kind in (Revolute, Translational, Driver))
    bodies = tuple(Body(*item) for item in zip(p["mass"], p["inertia"], loads, strict=True))
    state = on_curve(pose, place, p["rate"])
    return Mechanism(bodies, *kinds, gravity=(ZERO, -p["gravity"]), rank=rank, t=t, **state)


def _driver(name: str, body: int, p: Parameters) -> Driver:
    """Drives the angle phi at the rate of p and the acceleration `law`, at the time t."""
    law, t = p["law"], p["t"]
    return Driver(name, body, 0, p["phi"] - p["rate"] * t + law * t**2 / 2, p["rate"] - law * t, law)


@exactly
def rods(mass: Sequence, length: Sequence) -> dict:
    """Masses and moments of inertia of uniform rods."""
    return {"mass": tuple(mass), "inertia": tuple(m * size**2 / 12 for m, size in zip(mass, length, strict=True))}


def ends(length) -> tuple:
    """The end points of a rod."""
    return (-length / 2, ZERO), (length / 2, ZERO)


# The paper's mechanism ----------------------------------------------------------------------


@exactly
def wojtyra(p: Parameters) -> Mechanism:
    """The paper's mechanism: n = m = 12, rank 11, whatever half the crank, the arm of the coupler and the angle are."""
    half, arm, mu = p["half"], p["arm"], p["mu_rho"]
    back, front = ends(2 * half)

    def pose(phi):
        x, y = half * mp.cos(phi), half * mp.sin(phi)
        return [(x, y, phi), (2 * x + arm, 2 * y, ZERO), (x + 2 * arm, y, phi), (arm, 2 * y, ZERO)]

    joints = (
        Revolute("A", 1, 0, back, ORIGIN, mu[0]),
        Revolute("B", 2, 1, (-arm, ZERO), front, mu[1]),
        Revolute("C", 3, 2, front, (arm, ZERO), mu[2]),
        Revolute("D", 3, 0, back, (2 * arm, ZERO), mu[3]),
        Translational("K", 4, 0, ORIGIN, (arm, ZERO), exact((1, 0)), ZERO),
        Translational("L", 4, 2, ORIGIN, ORIGIN, exact((0, 1)), ZERO),
    )
    return _mechanism(p, pose, p["phi"], 11, joints)


@exactly
def wojtyra_parameters(length="1/10", m=1, **changes) -> dict:
    """Data of the paper's Tables 1 and 5."""
    length, m = exact((length, m))
    masses = tuple(m * c for c in (3, 9, 3, 9))
    given = {
        "half": length * mp.sqrt(2),
        "arm": 4 * length,
        "phi": mp.pi / 4,
        "rate": mp.mpf(1),
        "gravity": mp.mpf(10),
        "mass": masses,
        "inertia": tuple(x * c * length**2 / 3 for x, c in zip(masses, (2, 16) * 2, strict=True)),
        "mu_rho": exact(("1/50",) * 4),
    }
    return {**given, **{name: exact(value) for name, value in changes.items()}}


@exactly
def wojtyra2020(phi=None, rate=1, u=1, mu_rho="1/50") -> Mechanism:
    """The paper's mechanism (Section 5); phi is pi/4 unless given.

    `u` multiplies the unit of length, as in the tables: lengths, g and mu_rho scale with u, inertias with u^2.
    """
    u, mu_rho = exact((u, mu_rho))
    place = {} if phi is None else {"phi": phi}
    return wojtyra(wojtyra_parameters(u / 10, rate=rate, gravity=10 * u, mu_rho=(u * mu_rho,) * 4, **place))


# Parallel cranks ----------------------------------------------------------------------------


@exactly
def cranks(p: Parameters, flat: bool = False, drivers: int = 0) -> Mechanism:
    """A coupler on parallel cranks, the first `drivers` of them driven with the acceleration `law`.

    `centre` is that of the coupler from its first pin, midway between the outer ones unless given. Rank 3 N + 2, one
    less where it is flat, one more where it is driven, if only by one driver.
    """
    length, mu = p["length"], p["mu_rho"]
    pivots = tuple(accumulate((ZERO, *p["gaps"])))
    count, (back, front) = len(pivots), ends(length)
    across, up = p.get("centre", (pivots[-1] / 2, ZERO))

    def pose(phi):
        x, y = length * mp.cos(phi), length * mp.sin(phi)
        return [*((pivot + x / 2, y / 2, phi) for pivot in pivots), (across + x, up + y, ZERO)]

    joints = (
        *(Revolute(f"A{c + 1}", c + 1, 0, back, (pivots[c], ZERO), mu[c]) for c in range(count)),
        *(
            Revolute(f"B{c + 1}", count + 1, c + 1, (pivots[c] - across, -up), front, mu[count + c])
            for c in range(count)
        ),
        *(_driver(f"M{c + 1}", c + 1, p) for c in range(drivers)),
    )
    return _mechanism(p, pose, p["phi"], 3 * count + 2 - flat + bool(drivers), joints, p.get("t", ZERO))


@exactly
def cranks_parameters(count: int = 3, **changes) -> dict:
    """Cranks of unequal masses and spacing along (3/5, 4/5), a load on the coupler; no friction."""
    given = {
        "length": "1/2",
        "gaps": tuple(f"{5 + c * c % 4}/12" for c in range(count - 1)),
        "phi": mp.atan2(4, 3),
        "rate": 2,
        "gravity": "981/100",
        "mass": (*(f"{2 + c % 3}/2" for c in range(count)), 4),
        "inertia": (*(f"{2 + c % 3}/100" for c in range(count)), "1/5"),
        "loads": (((0, 0, 0),) * count + ((2, -1, "1/3"),)),
        "mu_rho": (0,) * (2 * count),
        **changes,
    }
    return {name: exact(value) for name, value in given.items()}


def parallelogram(rate=2) -> Mechanism:
    """Coupler (body 4) on three cranks: n = 12, m = 12, rank 11, one motion; every revolute has its own friction."""
    return cranks(
        cranks_parameters(
            gaps=("2/5", "3/5"),
            rate=rate,
            mass=("1", "3/2", "2", "4"),
            inertia=("1/50", "3/100", "1/25", "1/5"),
            mu_rho=("1/100", "1/80", "1/200", "1/50", "3/400", "1/160"),
            centre=("9/20", "1/10"),
        )
    )


@exactly
def parallel_cranks(count: int, mu_rho) -> Mechanism:
    """Coupler of 4 kg on `count` rods of 1 kg and 1/2 m, 2/5 m apart, at 1 rad/s; all revolutes have one friction."""
    gaps = exact(("2/5",) * (count - 1))
    masses = rods(exact((1,) * count + (4,)), exact(("1/2",) * count + (sum(gaps),)))
    friction = {"mu_rho": (mu_rho,) * (2 * count), "loads": ((0, 0, 0),) * (count + 1)}
    return cranks(cranks_parameters(count, gaps=gaps, rate=1, gravity=9.81, **masses, **friction))


@exactly
def n_four_bar(p: Parameters) -> Mechanism:
    """Rods on parallel cranks, each between two of them: n = 6 N + 3, m = 6 N + 2 of full rank."""
    length, mu, gaps = p["length"], p["mu_rho"], p["gaps"]
    pivots = tuple(accumulate((ZERO, *gaps)))
    loops, (back, front) = len(gaps), ends(length)

    def pose(phi):
        x, y = length * mp.cos(phi), length * mp.sin(phi)
        couplers = ((pivot + gap / 2 + x, y, ZERO) for pivot, gap in zip(pivots, gaps, strict=False))
        return [*((pivot + x / 2, y / 2, phi) for pivot in pivots), *couplers]

    joints = [Revolute(f"A{c + 1}", c + 1, 0, back, (pivot, ZERO), mu) for c, pivot in enumerate(pivots)]
    for c, gap in enumerate(gaps):
        for name, crank, point in zip("BC", (c + 1, c + 2), ends(gap), strict=True):
            joints.append(Revolute(f"{name}{c + 1}", loops + 2 + c, crank, point, front, mu))
    return _mechanism(p, pose, p["phi"], 6 * loops + 2, joints)


# Four-bar -----------------------------------------------------------------------------------


def four_bar_poses(lengths: Sequence, phi, crossed: bool = False) -> list | None:
    """Poses of crank, coupler and rocker, None if they do not close.

    b^2 + f^2 - c^2 = 2 b f cos of the angle at the crank's end between the coupler and the diagonal f.
    """
    a, b, c, d = lengths
    x, y = a * mp.cos(phi), a * mp.sin(phi)
    reach = mp.hypot(d - x, y)
    opening = (b**2 + reach**2 - c**2) / (2 * b * reach)
    if abs(opening) > 1:
        return None
    tilt = mp.atan2(-y, d - x) + (-1 if crossed else 1) * mp.acos(opening)
    u, v = b * mp.cos(tilt), b * mp.sin(tilt)
    rocker = (x + u + d) / 2, (y + v) / 2, mp.atan2(y + v, x + u - d)
    return [(x / 2, y / 2, phi), (x + u / 2, y + v / 2, tilt), rocker]


@exactly
def four_bar(p: Parameters) -> Mechanism | None:
    """Four lengths that perturbations may change one by one, None if they do not close: n = 9, m = 8 of full rank."""
    *moving, ground = lengths = [p[name] for name in ("crank", "coupler", "rocker", "ground")]
    if four_bar_poses(lengths, p["phi"]) is None:
        return None
    (a, b, c), mu = map(ends, moving), p["mu_rho"]
    joints = (
        Revolute("A", 1, 0, a[0], ORIGIN, mu[0]),
        Revolute("B", 2, 1, b[0], a[1], mu[1]),
        Revolute("C", 3, 2, c[1], b[1], mu[2]),
        Revolute("D", 3, 0, c[0], (ground, ZERO), mu[3]),
    )
    return _mechanism(p, lambda phi: four_bar_poses(lengths, phi), p["phi"], 8, joints)


@exactly
def doubled_four_bar(p: Parameters, crossed: bool = False) -> Mechanism:
    """Crank, rocker and two equal couplers: n = m = 12, rank 11."""
    *moving, ground = p["lengths"]
    (a, b, c), mu = map(ends, moving), p["mu_rho"]

    def pose(phi):
        crank, coupler, rocker = four_bar_poses(p["lengths"], phi, crossed)
        return [crank, rocker, coupler, coupler]

    joints = [Revolute("A", 1, 0, a[0], ORIGIN, mu), Revolute("D", 2, 0, c[0], (ground, ZERO), mu)]
    for k in (1, 2):
        joints += [Revolute(f"B{k}", 2 + k, 1, b[0], a[1], mu), Revolute(f"C{k}", 2 + k, 2, b[1], c[1], mu)]
    return _mechanism(p, pose, p["phi"], 11, joints)


# Guides -------------------------------------------------------------------------------------


def guides(p: Parameters, body: int, angle) -> tuple:
    """Parallel guides through `places` on a body whose origin moves on the line through the ground's.

    `along`: the places of the ground's points on their axes; `mu` and `guide_length`: their friction.
    """
    c, s = mp.cos(angle), mp.sin(angle)
    names = p.get("names") or [f"K{k}" for k, _ in enumerate(p["places"], 1)]
    none = (ZERO,) * len(names)
    numbers = zip(names, p["places"], p.get("along") or none, p.get("mu") or none, strict=True)
    return tuple(
        Translational(
            *(name, body, 0, (x, y), (at * c - y * s, at * s + y * c), (-s, c), angle),
            mu=mu,
            length=p.get("guide_length", 1),
        )
        for name, (x, y), at, mu in numbers
    )


@exactly
def carriage(p: Parameters) -> Mechanism:
    """One body on parallel guides: n = 3, rank 2, k = 2 (guides - 1)."""
    angle = p["angle"]
    c, s = mp.cos(angle), mp.sin(angle)
    joints = guides(p, 1, angle)
    return _mechanism(p, lambda travel: [(travel * c, travel * s, angle)], p["travel"], 2, joints)


def carriage_parameters(count: int, **changes) -> dict:
    """Guides at unequal places along (3/5, 4/5), a force off the centre."""
    given = {
        "angle": "927/1000",
        "travel": "1/2",
        "rate": "7/10",
        "gravity": "10",
        "places": tuple((f"{(7 * k) % 5 - 2}/10", f"{3 * k - count}/20") for k in range(count)),
        "mass": ("5/2",),
        "inertia": ("1/8",),
        "loads": (("5", "-2", "3/10"),),
        **changes,
    }
    return {name: exact(value) for name, value in given.items()}


@exactly
def two_guides() -> Mechanism:
    """A carriage on guides along (3/5, 4/5): n = 3, m = 4, acceleration = (force + weight) . axis / mass."""
    places, along = (("1/5", "1/10"), ("-3/10", "-1/10")), ("41/30", "-1/20")
    parameters = carriage_parameters(2, angle=mp.atan2(4, 3), places=places, along=along)
    return carriage({**parameters, "names": "KL"})


def slider_poses(a, b, phi) -> list:
    """Poses of crank, rod and slider."""
    x, y = a * mp.cos(phi), a * mp.sin(phi)
    reach = mp.sqrt(b**2 - y**2)
    return [(x / 2, y / 2, phi), (x + reach / 2, y / 2, -mp.asin(y / b)), (x + reach, ZERO, ZERO)]


@exactly
def slider_crank(p: Parameters, drivers: int = 0) -> Mechanism:
    """A slider on horizontal guides, the crank driven or not: n = 9, rank 8 + drivers."""
    (a, b), mu = (p["crank"], p["rod"]), p["mu_rho"]
    (back, front), (low, high) = ends(a), ends(b)

    joints = (
        Revolute("A", 1, 0, back, ORIGIN, mu[0]),
        Revolute("B", 2, 1, low, front, mu[1]),
        Revolute("C", 3, 2, ORIGIN, high, mu[2]),
        *guides(p, 3, ZERO),
        *(_driver("M", 1, p) for _ in range(drivers)),
    )
    return _mechanism(p, lambda phi: slider_poses(a, b, phi), p["phi"], 8 + drivers, joints, p.get("t", ZERO))


@exactly
def driven_slider_crank() -> Mechanism:
    """Doubled guide and driven crank: m = 11, rank 9, no freedom; crank along (3/5, 4/5), rod along (12/13, -5/13)."""
    given = {
        "crank": "1/4",
        "rod": "13/25",
        "phi": mp.atan2(4, 3),
        "rate": "5/4",
        "law": "-5/2",
        "t": "3/10",
        "gravity": "981/100",
        "places": (("-1/10", "-1/20"), ("1/10", "1/20")),
        "mass": ("1/2", "4/5", "6/5"),
        "inertia": ("1/300", "1/50", "1/100"),
        "loads": ((0, 0, 0), (0, 0, 0), (-7, 0, "1/5")),
        "mu_rho": ("1/100", "1/125", "1/200"),
    }
    return slider_crank({**{name: exact(value) for name, value in given.items()}, "names": "KL"}, drivers=1)


# Overconstrained mechanisms that the laws run over.
MECHANISMS = {
    "wojtyra2020": wojtyra2020,
    "parallelogram": parallelogram,
    "carriage": two_guides,
    "slider_crank": driven_slider_crank,
}
