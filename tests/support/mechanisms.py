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

from mpmath import mp
from truth import exact
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
    - `truth`: the same as exact data; takes mu_rho.
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
        return self.truth(exact.exact(self.friction.get("mu_rho", 0)))


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


def _turn(direction, vector) -> tuple:
    (c, s), (x, y) = direction, vector
    return (c * x - s * y, s * x + c * y)


def _angle(direction):
    return mp.atan2(direction[1], direction[0])


def _rod(mass, length) -> exact.Body:
    return exact.Body(mass, mass * length**2 / 12)


def numbers(value, count: int) -> tuple:
    value = exact.exact(value)
    return value if isinstance(value, tuple) else (value,) * count


def _joined(poses, rates) -> dict:
    """q and qd from (x, y, angle) of every body and the rates of these."""
    return {
        name: tuple(x for body in bodies for x in body[:2]) + tuple(body[2] for body in bodies)
        for name, bodies in (("q", poses), ("qd", rates))
    }


# Rows of parallel cranks --------------------------------------------------------------------


@dataclass(frozen=True)
class _Row:
    """Cranks of length l along `direction`, from pivots on the x axis, all at one rate."""

    pivots: tuple
    length: object
    direction: tuple
    rate: object

    @property
    def arm(self) -> tuple:
        return tuple(self.length * x for x in self.direction)

    def poses(self, centres) -> dict:
        """q and qd of the cranks and of couplers, whose centres lie at (x, 0) plus an arm."""
        (x, y), phi, w = self.arm, _angle(self.direction), self.rate
        cranks = [(p + x / 2, y / 2, phi) for p in self.pivots]
        couplers = [(c + x, y, ZERO) for c in centres]
        return _joined(
            [*cranks, *couplers],
            [(-w * y / 2, w * x / 2, w)] * len(cranks) + [(-w * y, w * x, ZERO)] * len(couplers),
        )

    def ground(self, mu_rho) -> list:
        half = self.length / 2
        return [
            exact.Revolute(f"A{c}", c, 0, (-half, ZERO), (x, ZERO), own)
            for c, (x, own) in enumerate(zip(self.pivots, mu_rho, strict=True), 1)
        ]

    def pin(self, name, coupler, crank, x, mu_rho) -> exact.Revolute:
        return exact.Revolute(name, coupler, crank, (x, ZERO), (self.length / 2, ZERO), mu_rho)


def _axial(forces: Mapping, row: _Row) -> dict:
    """Self-stress of cranks that push with the given forces."""
    return {
        f"{joint}{crank}.{axis}": force * row.direction[axis == "y"]
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
    gaps = exact.exact(spacing)
    pivots = tuple(accumulate((ZERO, *gaps)))
    count = len(pivots)
    parameters["rods" if make is rx.mechanisms.swing else "cranks"] = count
    row = _Row(pivots, length, exact.exact(direction), rate)
    masses, top = numbers(crank_mass, count), exact.exact(coupler_mass)
    t, drivers = (exact.exact("3/10"), exact.exact(law)) if law else (ZERO, ())
    if law:
        speed, acceleration = drivers
        row = _Row(pivots, length, row.direction, speed + acceleration * t)
        drivers = (_angle(row.direction) - speed * t - acceleration * t**2 / 2, speed, acceleration)

    @exactly
    def truth(mu_rho):
        friction = numbers(mu_rho, 2 * count)
        upper = [
            row.pin(f"B{c + 1}", count + 1, c + 1, pivots[c] - pivots[-1] / 2, friction[count + c])
            for c in range(count)
        ]
        return exact.Mechanism(
            name=make.__name__,
            bodies=(*(_rod(mass, length) for mass in masses), _rod(top, pivots[-1])),
            revolutes=(*row.ground(friction[:count]), *upper),
            translationals=(),
            drivers=tuple(exact.Driver(f"M{c + 1}", c + 1, 0, *drivers) for c in range(count)) if law else (),
            gravity=(ZERO, -gravity),
            rank=3 * count + (3 if law else 2),
            t=t,
            **row.poses([pivots[-1] / 2]),
        )

    states = []
    for c in range(2, count):
        first = (pivots[c] - pivots[1]) / (pivots[1] - pivots[0])
        states.append(_axial({1: first, 2: -1 - first, c + 1: mp.mpf(1)}, row))
    if law:
        moment = length * row.direction[1]
        for c in range(2, count + 1):
            push = {f"{joint}{crank}.x": sign for joint in "AB" for crank, sign in ((1, 1), (c, -1))}
            states.append({**push, "M1.angle": -moment, f"M{c}.angle": moment})
    inertia = sum(mass * length**2 / 3 for mass in masses) + top * length**2
    stiffness = gravity * length * (sum(masses) / 2 + top) / inertia
    at = _angle(row.direction)
    return Case(
        make=make,
        parameters=parameters,
        friction={"mu_rho": mu_rho},
        coordinate="crank 1.phi",
        at=at,
        rate=row.rate,
        n=3 * count + 3,
        m=(5 if law else 4) * count,
        rank=3 * count + (3 if law else 2),
        truth=truth,
        self_stress=tuple(states),
        acceleration=drivers[2] if law else -stiffness * row.direction[0],
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
    row = _Row(tuple(accumulate((ZERO, *gaps))), length, exact.exact(("8/17", "15/17")), rate)
    inertia = sum(masses) * length**2 / 3 + sum(couplers) * length**2
    stiffness = gravity * length * (sum(masses) / 2 + sum(couplers)) / inertia
    at, counts = _angle(row.direction), {"n": 6 * loops + 3, "m": 6 * loops + 2, "rank": 6 * loops + 2}

    @exactly
    def truth(mu_rho):
        upper = []
        for c, gap in enumerate(gaps):
            body = loops + 2 + c
            upper += [
                row.pin(f"B{c + 1}", body, c + 1, -gap / 2, mu_rho),
                row.pin(f"C{c + 1}", body, c + 2, gap / 2, mu_rho),
            ]
        rods = zip((*masses, *couplers), (*(length for _ in masses), *gaps), strict=True)
        return exact.Mechanism(
            name="n_four_bar",
            bodies=tuple(_rod(mass, size) for mass, size in rods),
            revolutes=(*row.ground((mu_rho,) * (loops + 1)), *upper),
            translationals=(),
            drivers=(),
            gravity=(ZERO, -gravity),
            rank=6 * loops + 2,
            **row.poses([pivot + gap / 2 for pivot, gap in zip(row.pivots, gaps, strict=False)]),
        )

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
        acceleration=-stiffness * row.direction[0],
        motion=released(at, stiffness),
    )


# Four-bar -----------------------------------------------------------------------------------


@exactly
def four_bar(crossed: bool = False, coupler_mass=("1/2", "3/4")) -> Case:
    """Crank, coupler and rocker along 3-4-5, 5-12-13 and 8-15-17 directions."""
    if crossed:
        lengths = a, b, c, d = exact.exact(("1/4", "1/2", "17/75", "167/300"))
        directions = exact.exact((("3/5", "4/5"), ("3/5", "-4/5"), ("-8/17", "-15/17")))
    else:
        lengths = a, b, c, d = exact.exact(("1/4", "13/25", "34/75", "5/12"))
        directions = exact.exact((("3/5", "4/5"), ("12/13", "5/13"), ("8/17", "15/17")))
    masses = exact.exact(("3/2", "2", *coupler_mass))  # crank, rocker, couplers
    gravity, rate = exact.exact(("10", "3"))
    first, second, third = (tuple(length * x for x in e) for length, e in zip(lengths, directions, strict=False))
    pin = (first[0] + second[0], first[1] + second[1])
    # a w1 t1 + b w2 t2 = c w3 t3 with t the normal of e, multiplied with e3 and with e2
    across = [_turn((ZERO, mp.mpf(1)), e) for e in directions]
    w2 = -rate * a * _dot(across[0], directions[2]) / (b * _dot(across[1], directions[2]))
    w3 = rate * a * _dot(across[0], directions[1]) / (c * _dot(across[2], directions[1]))
    rates = rate, w2, w3
    velocity = [tuple(w * size * x for x in t) for w, size, t in zip(rates, lengths, across, strict=False)]
    middle = [first[k] + second[k] / 2 for k in range(2)], [velocity[0][k] + velocity[1][k] / 2 for k in range(2)]
    poses = _joined(
        [
            (first[0] / 2, first[1] / 2, _angle(first)),
            (pin[0] - third[0] / 2, pin[1] - third[1] / 2, _angle(third)),
            *[(*middle[0], _angle(second))] * 2,
        ],
        [
            (velocity[0][0] / 2, velocity[0][1] / 2, rate),
            (velocity[2][0] / 2, velocity[2][1] / 2, w3),
            *[(*middle[1], w2)] * 2,
        ],
    )

    @exactly
    def truth(mu_rho):
        half = [(length / 2, ZERO) for length in (a, b, c)]
        back = [(-length / 2, ZERO) for length in (a, b, c)]
        return exact.Mechanism(
            name="doubled_four_bar",
            bodies=(_rod(masses[0], a), _rod(masses[1], c), _rod(masses[2], b), _rod(masses[3], b)),
            revolutes=(
                exact.Revolute("A", 1, 0, back[0], ORIGIN, mu_rho),
                exact.Revolute("D", 2, 0, back[2], (d, ZERO), mu_rho),
                exact.Revolute("B1", 3, 1, back[1], half[0], mu_rho),
                exact.Revolute("C1", 3, 2, half[1], half[2], mu_rho),
                exact.Revolute("B2", 4, 1, back[1], half[0], mu_rho),
                exact.Revolute("C2", 4, 2, half[1], half[2], mu_rho),
            ),
            translationals=(),
            drivers=(),
            gravity=(ZERO, -gravity),
            rank=11,
            **poses,
        )

    def path(phi):
        """Law of cosines: b^2 + f^2 - c^2 = 2 b f cos of the angle at B between coupler and diagonal f."""
        x, y = a * mp.cos(phi), a * mp.sin(phi)
        f = mp.hypot(d - x, y)
        opening = mp.acos((b**2 + f**2 - c**2) / (2 * b * f))
        tilt = mp.atan2(-y, d - x) + (-opening if crossed else opening)
        u, v = b * mp.cos(tilt), b * mp.sin(tilt)
        rods = [(x / 2, y / 2, phi), ((x + u + d) / 2, (y + v) / 2, mp.atan2(y + v, x + u - d))]
        rods += [(x + u / 2, y + v / 2, tilt)] * 2
        return [(mass, mass * size**2 / 12, *rod) for mass, size, rod in zip(masses, (a, c, b, b), rods, strict=True)]

    at, e = _angle(first), directions[1]
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


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1]


# Guides -------------------------------------------------------------------------------------


def _guides(body: int, count: int, gauge, offset, direction) -> tuple:
    normal = (-direction[1], direction[0])
    spread = [mp.mpf(k) / (count - 1) - mp.mpf(1) / 2 for k in range(count)] if count > 1 else [ZERO]
    return tuple(
        exact.Translational(
            f"K{k + 1}",
            body,
            0,
            (offset * x, gauge * x),
            tuple(gauge * x * part for part in normal),
            normal,
            _angle(direction),
        )
        for k, x in enumerate(spread)
    )


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
    crank, rod = (a * 3 / 5, a * 4 / 5), (b * 12 / 13, -b * 5 / 13)
    w2 = -rate * crank[0] / rod[0]
    pin_rate, rod_rate = (-rate * crank[1], rate * crank[0]), (-w2 * rod[1], w2 * rod[0])
    poses = _joined(
        [
            (crank[0] / 2, crank[1] / 2, _angle(crank)),
            (crank[0] + rod[0] / 2, crank[1] / 2, _angle(rod)),
            (crank[0] + rod[0], ZERO, ZERO),
        ],
        [
            (pin_rate[0] / 2, pin_rate[1] / 2, rate),
            (pin_rate[0] + rod_rate[0] / 2, pin_rate[1] / 2, w2),
            (pin_rate[0] + rod_rate[0], ZERO, ZERO),
        ],
    )

    @exactly
    def truth(mu_rho):
        return exact.Mechanism(
            name="slider_crank",
            bodies=(_rod(masses[0], a), _rod(masses[1], b), exact.Body(masses[2], inertia, (force, ZERO, ZERO))),
            revolutes=(
                exact.Revolute("A", 1, 0, (-a / 2, ZERO), ORIGIN, mu_rho),
                exact.Revolute("B", 2, 1, (-b / 2, ZERO), (a / 2, ZERO), mu_rho),
                exact.Revolute("C", 3, 2, ORIGIN, (b / 2, ZERO), mu_rho),
            ),
            translationals=_guides(3, guides, gauge, ZERO, (mp.mpf(1), ZERO)),
            drivers=(),
            gravity=(ZERO, -gravity),
            rank=8,
            **poses,
        )

    def path(phi):
        x, y = a * mp.cos(phi), a * mp.sin(phi)
        reach = mp.sqrt(b**2 - y**2)
        return [
            (masses[0], masses[0] * a**2 / 12, x / 2, y / 2, phi),
            (masses[1], masses[1] * b**2 / 12, x + reach / 2, y / 2, -mp.asin(y / b)),
            (masses[2], inertia, x + reach, ZERO, ZERO),
        ]

    at = _angle(crank)
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
    arm = _turn(direction, point)

    @exactly
    def truth(_):
        load = (*force, arm[0] * force[1] - arm[1] * force[0])
        return exact.Mechanism(
            name="carriage",
            bodies=(exact.Body(mass, inertia, load),),
            revolutes=(),
            translationals=_guides(1, guides, gauge, offset, direction),
            drivers=(),
            gravity=(ZERO, -gravity),
            q=(at * direction[0], at * direction[1], _angle(direction)),
            qd=(rate * direction[0], rate * direction[1], ZERO),
            rank=2,
        )

    acceleration = (_dot(force, direction) - mass * gravity * direction[1]) / mass
    return Case(
        make=rx.mechanisms.carriage,
        parameters={
            "guides": guides,
            "gauge": gauge,
            "offset": offset,
            "angle": _angle(direction),
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
        truth=lambda _: exact.wojtyra2020(),
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
}
