"""`rx.mechanisms` with what is known of each in closed form: the registry that their laws run over.

A case has its parameters, and the state in which it is looked at, as exact numbers: strings such as "2/5",
with directions of 3-4-5 kind. From them come the library's mechanism (their floats) and, written out here
without the library, `truth.exact` data of 50 digits, counts and rank, self-stress states, the acceleration of
the independent coordinate, and the motion where it has a closed form.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate

import gears
from mpmath import mp
from truth import exact, scenes
from truth.exact import exactly

import redundax as rx

ZERO = mp.mpf(0)
ORIGIN = (ZERO, ZERO)


@dataclass(frozen=True, eq=False)
class Case:
    """A mechanism of the library in one state.

    - `make`, `parameters`, `friction`: the builder, its arguments, and those that add friction.
    - `coordinate`: name of the independent coordinate, the one that `state` takes.
    - `at`, `rate`, `t`: its value and rate, and the time.
    - `n`, `m`, `rank`: numbers of coordinates and constraints, and rank.
    - `truth`: the same as exact data; takes the friction.
    - `self_stress`: states that span the self-stress, row name to multiplier, with 0 in all other rows.
    - `acceleration`: of the independent coordinate, without friction.
    - `motion`: the independent coordinate as a function of time from rest, or as prescribed, where that is known.
    - `law`: prescribed motion: start, speed and acceleration.
    """

    make: Callable[..., rx.Mechanism]
    parameters: Mapping
    friction: Mapping
    coordinate: str
    at: object
    rate: object
    n: int
    m: int
    rank: int
    truth: Callable[..., exact.Mechanism]
    self_stress: tuple
    acceleration: object
    motion: Callable | None = None
    law: tuple = ()
    t: object = field(default_factory=mp.mpf)

    @property
    def redundancy(self) -> int:
        return self.m - self.rank

    @property
    def freedom(self) -> int:
        return self.n - self.rank

    def arguments(self, friction: bool = False) -> dict:
        """Arguments of `make`, as floats."""
        given = {**self.parameters, **(self.friction if friction else {})}
        arguments = {name: _plain(value) for name, value in given.items()}
        if self.law:
            start, speed, acceleration = self.law
            arguments["angle"] = rx.Polynomial(_plain((start, speed, acceleration / 2)))
        return arguments

    @cached_property
    def smooth(self) -> rx.Mechanism:
        return self.make(**self.arguments())

    @cached_property
    def rubbing(self) -> rx.Mechanism:
        return self.make(**self.arguments(friction=True))

    @cached_property
    def state(self) -> rx.State:
        return self.smooth.state(float(self.at), rate=float(self.rate), t=float(self.t))

    @cached_property
    def exact(self) -> exact.Mechanism:
        return self.truth(**{name: exact.exact(value) for name, value in self.friction.items()})


def _plain(x):
    """Floats of exact numbers; counts and flags stay what they are."""
    if isinstance(x, tuple):
        return [_plain(item) for item in x]
    return x if isinstance(x, int) else float(exact.exact(x))


# Closed forms -------------------------------------------------------------------------------


@exactly
def lagrange(path: Callable, at, rate, gravity, forces: Mapping | None = None):
    """phi'' from p' . (M p'' phi'^2 + M p' phi'' - Q) = 0 for the path p(phi).

    `path` gives (mass, inertia, x, y, angle) of every body, `forces` (fx, fy) at the centres of some.
    """
    total, inertia = ZERO, ZERO
    for b, (mass, moment, *_) in enumerate(path(at)):
        extra = (forces or {}).get(b, ORIGIN)
        applied = (extra[0], extra[1] - mass * gravity, ZERO)
        for c, weight, load in zip((2, 3, 4), (mass, mass, moment), applied, strict=True):
            slope, bend = (mp.diff(lambda phi, b=b, c=c: path(phi)[b][c], at, order) for order in (1, 2))
            total += slope * (load - weight * bend * rate**2)
            inertia += weight * slope**2
    return total / inertia


@exactly
def released(start, frequency_squared) -> Callable:
    """phi(t) of phi'' = -frequency^2 cos phi, released at rest: a pendulum that hangs at -pi/2."""
    k = mp.sin((start + mp.pi / 2) / 2)
    return lambda t: 2 * mp.asin(k * mp.ellipfun("cd", mp.sqrt(frequency_squared) * t, m=k**2)) - mp.pi / 2


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


def _angle(direction):
    return mp.atan2(direction[1], direction[0])


def numbers(value, count: int) -> tuple:
    value = exact.exact(value)
    return value if isinstance(value, tuple) else (value,) * count


# Rows of parallel cranks --------------------------------------------------------------------


def _axial(forces: Mapping, direction: tuple) -> dict:
    """Self-stress of cranks that push with the given forces."""
    return {
        f"{joint}{crank}.{axis}": force * direction[axis == "y"]
        for crank, force in forces.items()
        for joint in "AB"
        for axis in "xy"
    }


@exactly
def _linkage(
    make, names, mu_rho, direction, rate, crank, spacing, crank_mass, coupler_mass, gravity="981/100", law=None
) -> Case:
    """Parallelogram, driven or not, or swing; `names` are those of the builder's arguments."""
    given = (crank, spacing, crank_mass, coupler_mass, gravity)
    parameters = {name: value for name, value in zip(names, given, strict=True) if name}
    length, gravity, rate = exact.exact(crank), exact.exact(gravity), exact.exact(rate)
    gaps, direction = exact.exact(spacing), exact.exact(direction)
    pivots = tuple(accumulate((ZERO, *gaps)))
    count, at = len(pivots), _angle(direction)
    parameters["rods" if make is rx.mechanisms.swing else "cranks"] = count
    masses, top = numbers(crank_mass, count), exact.exact(coupler_mass)
    t, drivers, driven = ZERO, (), {}
    if law:
        t, (speed, acceleration) = exact.exact("3/10"), exact.exact(law)
        rate = speed + acceleration * t
        drivers = (at - speed * t - acceleration * t**2 / 2, speed, acceleration)
        driven = {"law": acceleration, "t": t}

    def truth(mu_rho):
        given = {"length": length, "gaps": gaps, "phi": at, "rate": rate, "gravity": gravity, **driven}
        given |= scenes.rods((*masses, top), (*(length for _ in masses), pivots[-1]))
        return scenes.cranks({**given, "mu_rho": numbers(mu_rho, 2 * count)}, drivers=count if law else 0)

    states = []
    for c in range(2, count):
        first = (pivots[c] - pivots[1]) / (pivots[1] - pivots[0])
        states.append(_axial({1: first, 2: -1 - first, c + 1: mp.mpf(1)}, direction))
    if law:
        moment = length * direction[1]
        for c in range(2, count + 1):
            push = {f"{joint}{crank}.x": sign for joint in "AB" for crank, sign in ((1, 1), (c, -1))}
            states.append({**push, "M1.angle": -moment, f"M{c}.angle": moment})
    inertia = sum(mass * length**2 / 3 for mass in masses) + top * length**2
    stiffness = gravity * length * (sum(masses) / 2 + top) / inertia
    return Case(
        make=make,
        parameters=parameters,
        friction={"mu_rho": mu_rho},
        coordinate="crank 1.phi",
        at=at,
        rate=rate,
        n=3 * count + 3,
        m=(5 if law else 4) * count,
        rank=3 * count + (3 if law else 2),
        truth=truth,
        self_stress=tuple(states),
        acceleration=drivers[2] if law else -stiffness * direction[0],
        motion=(lambda t: drivers[0] + drivers[1] * t + drivers[2] * t**2 / 2) if law else released(at, stiffness),
        law=drivers,
        t=t,
    )


_PARALLELOGRAM = ("crank", "spacing", "crank_mass", "coupler_mass", "gravity")
_SWING = ("length", "spacing", None, "mass", "gravity")


def parallelogram(cranks: int, rate="2") -> Case:
    """Cranks of unequal masses and spacing."""
    spacing, masses = ("2/5", "3/5", "1/4", "1/2"), ("1", "3/2", "2", "1/2", "3/4")
    return _linkage(
        rx.mechanisms.parallelogram,
        _PARALLELOGRAM,
        tuple(f"1/{200 + 40 * c}" for c in range(2 * cranks)),
        ("3/5", "4/5"),
        rate,
        "1/2",
        spacing[: cranks - 1],
        masses[:cranks],
        "4",
    )


def driven(cranks: int) -> Case:
    """Every crank driven at 2 rad/s at first, and slower and slower."""
    return _linkage(
        rx.mechanisms.driven_parallelogram,
        _PARALLELOGRAM,
        "1/250",
        ("-5/13", "12/13"),
        "0",
        "1/2",
        ("2/5", "3/5")[: cranks - 1],
        "1",
        "4",
        law=("2", "-5/2"),
    )


def swing() -> Case:
    """Massless rods that slope to the left of the hanging position, on the way up."""
    return _linkage(
        rx.mechanisms.swing,
        _SWING,
        "1/100",
        ("-3/5", "-4/5"),
        "-3/2",
        "6/5",
        ("1/2", "3/4"),
        "0",
        "5/2",
    )


@exactly
def n_four_bar(loops: int) -> Case:
    """Loops of unequal width and mass."""
    gaps = exact.exact(tuple(f"{5 + c % 3}/5" for c in range(loops)))
    masses = exact.exact(tuple(f"{2 + c % 4}/2" for c in range(loops + 1)))
    couplers = exact.exact(tuple(f"{3 + c % 2}/3" for c in range(loops)))
    length, gravity, rate = exact.exact(("4/5", "981/100", "-3/2"))
    direction = exact.exact(("8/17", "15/17"))
    inertia = sum(masses) * length**2 / 3 + sum(couplers) * length**2
    stiffness = gravity * length * (sum(masses) / 2 + sum(couplers)) / inertia
    at, counts = _angle(direction), {"n": 6 * loops + 3, "m": 6 * loops + 2, "rank": 6 * loops + 2}

    def truth(mu_rho):
        given = {"length": length, "gaps": gaps, "phi": at, "rate": rate, "gravity": gravity, "mu_rho": mu_rho}
        return scenes.n_four_bar(given | scenes.rods((*masses, *couplers), (*(length for _ in masses), *gaps)))

    return Case(
        make=rx.mechanisms.n_four_bar,
        parameters={
            "loops": loops,
            "crank": length,
            "spacing": gaps,
            "crank_mass": masses,
            "coupler_mass": couplers,
            "gravity": gravity,
        },
        friction={"mu_rho": "1/200"},
        coordinate="crank 1.phi",
        at=at,
        rate=rate,
        **counts,
        truth=truth,
        self_stress=(),
        acceleration=-stiffness * direction[0],
        motion=released(at, stiffness),
    )


# Four-bar -----------------------------------------------------------------------------------


@exactly
def four_bar(crossed: bool = False, coupler_mass=("1/2", "3/4")) -> Case:
    """Crank, coupler and rocker along 3-4-5, 5-12-13 and 8-15-17 directions."""
    if crossed:
        lengths, phi, e = ("1/4", "1/2", "17/75", "167/300"), ("3/5", "4/5"), ("3/5", "-4/5")
    else:
        lengths, phi, e = ("1/4", "13/25", "34/75", "5/12"), ("3/5", "4/5"), ("12/13", "5/13")
    lengths, at, e = exact.exact(lengths), _angle(exact.exact(phi)), exact.exact(e)
    a, b, c, _ = lengths
    masses = exact.exact(("3/2", "2", *coupler_mass))  # crank, rocker, couplers
    gravity, rate = exact.exact(("10", "3"))
    rods = scenes.rods(masses, (a, c, b, b))

    def truth(mu_rho):
        given = {"lengths": lengths, "phi": at, "rate": rate, "gravity": gravity, "mu_rho": mu_rho}
        return scenes.doubled_four_bar(given | rods, crossed)

    def path(phi):
        crank, coupler, rocker = scenes.four_bar_poses(lengths, phi, crossed)
        return [(*both, *pose) for *both, pose in zip(*rods.values(), (crank, rocker, coupler, coupler), strict=True)]

    push = {f"{joint}{number}.{axis}" for joint in "BC" for number in "12" for axis in "xy"}
    signs = {"B1": 1, "C1": -1, "B2": -1, "C2": 1}
    return Case(
        make=rx.mechanisms.doubled_four_bar,
        parameters={
            **dict(zip(("crank", "coupler", "rocker", "ground"), lengths, strict=True)),
            "crank_mass": masses[0],
            "coupler_mass": masses[2:],
            "rocker_mass": masses[1],
            "crossed": crossed,
            "gravity": gravity,
        },
        friction={"mu_rho": "1/500"},
        coordinate="crank.phi",
        at=at,
        rate=rate,
        n=12,
        m=12,
        rank=11,
        truth=truth,
        self_stress=({row: signs[row[:2]] * e[row[-1] == "y"] for row in push},),
        acceleration=lagrange(path, at, rate, gravity),
    )


# Guides -------------------------------------------------------------------------------------


def _places(count: int, gauge, offset) -> tuple:
    spread = [mp.mpf(k) / (count - 1) - mp.mpf(1) / 2 for k in range(count)] if count > 1 else [ZERO]
    return tuple((offset * x, gauge * x) for x in spread)


def _guide_stress(count: int, offset) -> tuple:
    """Two guides press against each other, with a moment where the forces are not in line; or twist."""
    states = []
    for k in range(1, count):
        ahead = -offset * k / (count - 1)
        states += [
            {"K1.perpendicular": 1, f"K{k + 1}.perpendicular": -1, "K1.angle": ahead},
            {"K1.angle": 1, f"K{k + 1}.angle": -1},
        ]
    return tuple(states)


@exactly
def slider_crank(guides: int) -> Case:
    """Crank along (3/5, 4/5), rod along (12/13, -5/13), pushed by a force on the slider."""
    a, b, gauge, gravity, rate, force = exact.exact(("1/4", "13/25", "3/25", "981/100", "-4", "-7"))
    masses = exact.exact(("1", "4/5", "6/5"))
    inertia = exact.exact("1/100")
    at, rods = mp.atan2(4, 3), scenes.rods(masses, (a, b, ZERO))
    rods["inertia"] = (*rods["inertia"][:2], inertia)

    def truth(mu_rho, mu, guide_length):
        given = {"crank": a, "rod": b, "phi": at, "rate": rate, "gravity": gravity, "mu_rho": (mu_rho,) * 3}
        given |= {"loads": ((ZERO,) * 3, (ZERO,) * 3, (force, ZERO, ZERO)), "places": _places(guides, gauge, ZERO)}
        given |= {"mu": numbers(mu, guides), "guide_length": guide_length}
        return scenes.slider_crank(given | rods)

    def path(phi):
        return [(*both, *pose) for *both, pose in zip(*rods.values(), scenes.slider_poses(a, b, phi), strict=True)]

    return Case(
        make=rx.mechanisms.slider_crank,
        parameters={
            "guides": guides,
            "crank": a,
            "rod": b,
            "gauge": gauge,
            "crank_mass": masses[0],
            "rod_mass": masses[1],
            "slider_mass": masses[2],
            "slider_inertia": inertia,
            "force": force,
            "gravity": gravity,
        },
        friction={"mu_rho": "1/200", "mu": "1/10", "guide_length": "3/20"},
        coordinate="crank.phi",
        at=at,
        rate=rate,
        n=9,
        m=6 + 2 * guides,
        rank=8,
        truth=truth,
        self_stress=_guide_stress(guides, ZERO),
        acceleration=lagrange(path, at, rate, gravity, {2: (force, ZERO)}),
    )


@exactly
def carriage(guides: int, offset) -> Case:
    """Guides along (3/5, 4/5), a force off the centre."""
    offset, gauge, mass, inertia, gravity = exact.exact((offset, "2/5", "5/2", "1/8", "10"))
    force, point = exact.exact((("5", "-2"), ("1/20", "-3/20")))
    direction, (at, rate) = exact.exact((("3/5", "4/5"), ("1/2", "7/10")))
    angle = _angle(direction)

    @exactly
    def truth(mu, guide_length):
        (c, s), (x, y) = direction, point
        moment = (c * x - s * y) * force[1] - (s * x + c * y) * force[0]
        given = {"angle": angle, "travel": at, "rate": rate, "gravity": gravity, "mass": (mass,), "inertia": (inertia,)}
        given |= {"mu": numbers(mu, guides), "guide_length": guide_length}
        return scenes.carriage({**given, "loads": ((*force, moment),), "places": _places(guides, gauge, offset)})

    acceleration = (_dot(force, direction) - mass * gravity * direction[1]) / mass
    return Case(
        make=rx.mechanisms.carriage,
        parameters={
            "guides": guides,
            "gauge": gauge,
            "offset": offset,
            "angle": angle,
            "mass": mass,
            "inertia": inertia,
            "force": force,
            "at": point,
            "gravity": gravity,
        },
        friction={"mu": tuple(f"{k + 1}/20" for k in range(guides)), "guide_length": "1/5"},
        coordinate="travel",
        at=at,
        rate=rate,
        n=3,
        m=2 * guides,
        rank=2,
        truth=truth,
        self_stress=_guide_stress(guides, offset),
        acceleration=acceleration,
        motion=lambda t: at + acceleration * t**2 / 2,
    )


# The paper's mechanism ----------------------------------------------------------------------


@exactly
def wojtyra2020() -> Case:
    at, rate, unit = mp.pi / 4, mp.mpf(1), exact.exact("1/10")
    half = unit * mp.sqrt(2)

    def path(phi):
        x, y = half * mp.cos(phi), half * mp.sin(phi)
        crank, block = 2 * unit**2, 16 * 3 * unit**2  # 2/3 of 3 unit^2 and 16/3 of 9 unit^2
        return [
            (3, crank, x, y, phi),
            (9, block, 2 * x + 4 * unit, 2 * y, ZERO),
            (3, crank, x + 8 * unit, y, phi),
            (9, block, 4 * unit, 2 * y, ZERO),
        ]

    signs = {"A": 1, "B": 1, "C": 1, "D": -1}  # D has the crank as its body i, as A has, but pushes back
    forces = {
        f"{joint}.{axis}": signs[joint] * of(at) for joint in "ABCD" for axis, of in (("x", mp.cos), ("y", mp.sin))
    }
    return Case(
        make=rx.mechanisms.wojtyra2020,
        parameters={},
        friction={"mu_rho": "1/50"},
        coordinate="1.phi",
        at=at,
        rate=rate,
        n=12,
        m=12,
        rank=11,
        truth=lambda mu_rho: scenes.wojtyra2020(mu_rho=mu_rho),
        self_stress=({**forces, "K.angle": 8 * unit * mp.sin(at), "L.angle": -8 * unit * mp.sin(at)},),
        acceleration=lagrange(path, at, rate, mp.mpf(10)),
    )


CASES: Mapping[str, Case] = {
    "wojtyra2020": wojtyra2020(),
    "two cranks": parallelogram(2),
    "three cranks": parallelogram(3),
    "four cranks": parallelogram(4),
    "driven twice": driven(2),
    "driven three times": driven(3),
    "swing on massless rods": swing(),
    "doubled four-bar": four_bar(),
    "doubled four-bar, crossed": four_bar(crossed=True),
    "doubled four-bar, massless couplers": four_bar(coupler_mass=("0", "0")),
    "two four-bars": n_four_bar(2),
    "six four-bars": n_four_bar(6),
    "slider-crank": slider_crank(1),
    "slider-crank, two guides": slider_crank(2),
    "slider-crank, three guides": slider_crank(3),
    "carriage": carriage(2, "0"),
    "carriage, guides offset": carriage(2, "1/10"),
    "carriage, three guides": carriage(3, "1/10"),
    "planetary set": Case(**gears.planetary(2, 24, 18)),
    "countershaft train": Case(**gears.countershaft_train(2)),
}

# Cases that differ from others by numbers of cranks, loops or guides alone: programs of their own, for slow tests.
MORE = (
    "two cranks",
    "four cranks",
    "driven three times",
    "doubled four-bar, crossed",
    "six four-bars",
    "slider-crank",
    "slider-crank, three guides",
    "carriage",
    "carriage, three guides",
)
