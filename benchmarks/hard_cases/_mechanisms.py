"""Exact mechanisms as functions of their parameters, so that perturbed ones keep their redundancy.

A parameter set is a dictionary of 50-digit numbers. Whatever the numbers are, the assembly closes, the velocity is
admissible and the rank is the one that the builder states.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any

from mpmath import mp
from truth import exact
from truth.exact import Body, Driver, Mechanism, Revolute, Translational, exactly

ZERO = mp.mpf(0)
ORIGIN = (ZERO, ZERO)
Parameters = Mapping[str, Any]


def _bodies(p: Parameters) -> tuple:
    loads = p.get("loads") or ((ZERO, ZERO, ZERO),) * len(p["mass"])
    return tuple(Body(*item) for item in zip(p["mass"], p["inertia"], loads, strict=True))


@exactly
def wojtyra(p: Parameters) -> Mechanism:
    """The paper's mechanism: n = m = 12, rank 11, whatever half the crank, the arm of the coupler and the angle are."""
    half, arm, phi, rate, mu = p["half"], p["arm"], p["phi"], p["rate"], p["mu_rho"]
    x, y = half * mp.cos(phi), half * mp.sin(phi)
    vx, vy = -rate * y, rate * x
    ends = (half, ZERO), (-half, ZERO)
    return Mechanism(
        name="wojtyra2020",
        bodies=_bodies(p),
        revolutes=(
            Revolute("A", 1, 0, ends[1], ORIGIN, mu[0]),
            Revolute("B", 2, 1, (-arm, ZERO), ends[0], mu[1]),
            Revolute("C", 3, 2, ends[0], (arm, ZERO), mu[2]),
            Revolute("D", 3, 0, ends[1], (2 * arm, ZERO), mu[3]),
        ),
        translationals=(
            Translational("K", 4, 0, ORIGIN, (arm, ZERO), exact.exact((1, 0)), ZERO),
            Translational("L", 4, 2, ORIGIN, ORIGIN, exact.exact((0, 1)), ZERO),
        ),
        drivers=(),
        gravity=(ZERO, -p["gravity"]),
        q=(x, y, 2 * x + arm, 2 * y, x + 2 * arm, y, arm, 2 * y, phi, ZERO, phi, ZERO),
        qd=(vx, vy, 2 * vx, 2 * vy, vx, vy, ZERO, 2 * vy, rate, ZERO, rate, ZERO),
        rank=11,
    )


@exactly
def wojtyra_parameters(**changes) -> dict:
    """Data of the paper's Tables 1 and 5."""
    unit = mp.mpf(1) / 10
    given = {
        "half": unit * mp.sqrt(2),
        "arm": 4 * unit,
        "phi": mp.pi / 4,
        "rate": mp.mpf(1),
        "gravity": mp.mpf(10),
        "mass": exact.exact((3, 9, 3, 9)),
        "inertia": tuple(m * c * unit**2 / 3 for m, c in zip((3, 9, 3, 9), (2, 16) * 2, strict=True)),
        "mu_rho": exact.exact(("1/50",) * 4),
    }
    return {**given, **{name: exact.exact(value) for name, value in changes.items()}}


@exactly
def cranks(p: Parameters, flat: bool = False, drivers: int = 0) -> Mechanism:
    """A coupler on parallel cranks, the first `drivers` of them driven with the acceleration `law`.

    Rank 3 N + 2, one less where it is flat, one more where it is driven, if only by one driver.
    """
    length, phi, rate = p["length"], p["phi"], p["rate"]
    pivots = tuple(accumulate((ZERO, *p["gaps"])))
    count, half, middle = len(pivots), length / 2, pivots[-1] / 2
    x, y = length * mp.cos(phi), length * mp.sin(phi)
    centres = [item for pivot in pivots for item in (pivot + x / 2, y / 2)]
    mu, law, t = p["mu_rho"], p.get("law", ZERO), p.get("t", ZERO)
    course = phi - rate * t + law * t**2 / 2, rate - law * t, law
    return Mechanism(
        name="cranks",
        bodies=_bodies(p),
        revolutes=(
            *(Revolute(f"A{c + 1}", c + 1, 0, (-half, ZERO), (pivots[c], ZERO), mu[c]) for c in range(count)),
            *(
                Revolute(f"B{c + 1}", count + 1, c + 1, (pivots[c] - middle, ZERO), (half, ZERO), mu[count + c])
                for c in range(count)
            ),
        ),
        translationals=(),
        drivers=tuple(Driver(f"M{c + 1}", c + 1, 0, *course) for c in range(drivers)),
        gravity=(ZERO, -p["gravity"]),
        q=(*centres, middle + x, y, *(phi,) * count, ZERO),
        qd=(*(-rate * y / 2, rate * x / 2) * count, -rate * y, rate * x, *(rate,) * count, ZERO),
        rank=3 * count + 2 - flat + bool(drivers),
        t=t,
    )


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
    return {name: exact.exact(value) for name, value in given.items()}


@exactly
def four_bar(p: Parameters) -> Mechanism | None:
    """Four lengths that perturbations may change one by one, None if they do not close: n = 9, m = 8 of full rank."""
    a, b, c, d, phi, rate = (p[name] for name in ("crank", "coupler", "rocker", "ground", "phi", "rate"))
    x, y = a * mp.cos(phi), a * mp.sin(phi)
    reach = mp.hypot(d - x, y)
    opening = (b**2 + reach**2 - c**2) / (2 * b * reach)
    if abs(opening) > 1:
        return None
    tilt = mp.atan2(-y, d - x) + mp.acos(opening)
    u, v = b * mp.cos(tilt), b * mp.sin(tilt)
    r, s = x + u - d, y + v
    across = u * s - v * r
    w2, w3 = rate * -(x * s - y * r) / across, rate * (u * y - v * x) / across
    ends = [((-size / 2, ZERO), (size / 2, ZERO)) for size in (a, b, c)]
    mu = p["mu_rho"]
    return Mechanism(
        name="four_bar",
        bodies=_bodies(p),
        revolutes=(
            Revolute("A", 1, 0, ends[0][0], ORIGIN, mu[0]),
            Revolute("B", 2, 1, ends[1][0], ends[0][1], mu[1]),
            Revolute("C", 3, 2, ends[2][1], ends[1][1], mu[2]),
            Revolute("D", 3, 0, ends[2][0], (d, ZERO), mu[3]),
        ),
        translationals=(),
        drivers=(),
        gravity=(ZERO, -p["gravity"]),
        q=(x / 2, y / 2, x + u / 2, y + v / 2, d + r / 2, s / 2, phi, tilt, mp.atan2(s, r)),
        qd=(
            -rate * y / 2,
            rate * x / 2,
            -rate * y - w2 * v / 2,
            rate * x + w2 * u / 2,
            -w3 * s / 2,
            w3 * r / 2,
            rate,
            w2,
            w3,
        ),
        rank=8,
    )


@exactly
def carriage(p: Parameters) -> Mechanism:
    """One body on parallel guides: n = 3, rank 2, k = 2 (guides - 1)."""
    angle, places = p["angle"], p["places"]
    c, s = mp.cos(angle), mp.sin(angle)
    return Mechanism(
        name="carriage",
        bodies=_bodies(p),
        revolutes=(),
        translationals=tuple(
            Translational(f"K{k}", 1, 0, place, (-place[1] * s, place[1] * c), (-s, c), angle)
            for k, place in enumerate(places, 1)
        ),
        drivers=(),
        gravity=(ZERO, -p["gravity"]),
        q=(p["travel"] * c, p["travel"] * s, angle),
        qd=(p["rate"] * c, p["rate"] * s, ZERO),
        rank=2,
    )


def carriage_parameters(guides: int) -> dict:
    """Guides at unequal places along (3/5, 4/5), a force off the centre."""
    return {
        name: exact.exact(value)
        for name, value in {
            "angle": "927/1000",
            "travel": "1/2",
            "rate": "7/10",
            "gravity": "10",
            "places": tuple((f"{(7 * k) % 5 - 2}/10", f"{3 * k - guides}/20") for k in range(guides)),
            "mass": ("5/2",),
            "inertia": ("1/8",),
            "loads": (("5", "-2", "3/10"),),
        }.items()
    }


# Linear systems -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Linear:
    """Phi(q, t) = [J; T J] q - [c; T c] t^2 / 2 at q = 0, qd = 0, t = 0: dependent rows are combinations T."""

    mass: tuple
    load_: tuple
    free: tuple
    combinations: tuple
    free_gamma: tuple
    revolutes: tuple = ()

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.mass)

    @property
    def m(self) -> int:
        """Number of constraint rows."""
        return self.rank + len(self.combinations)

    @property
    def rank(self) -> int:
        """Number of independent rows."""
        return len(self.free)

    @property
    def kinds(self) -> tuple:
        """Kinds of the rows."""
        return ("force",) * self.m

    @cached_property
    @exactly
    def mass_matrix(self):
        """M (n, n)."""
        return mp.diag(list(self.mass))

    @cached_property
    @exactly
    def load(self):
        """Q (n, 1)."""
        return mp.matrix(list(self.load_))

    @cached_property
    @exactly
    def jacobian(self):
        """Phi_q (m, n)."""
        return self._with_combinations(mp.matrix([list(row) for row in self.free]))

    @cached_property
    @exactly
    def gamma(self):
        """gamma (m, 1)."""
        return self._with_combinations(mp.matrix(list(self.free_gamma)))

    def _with_combinations(self, rows):
        whole = mp.zeros(self.m, rows.cols)
        whole[: self.rank, :] = rows
        if self.combinations:
            whole[self.rank :, :] = mp.matrix([list(row) for row in self.combinations]) * rows
        return whole

    @property
    def distribution(self):
        """No friction."""
        return mp.zeros(self.n, 0)

    @cached_property
    def selfstress(self):
        """N (m, k)."""
        return exact.selfstress(self.jacobian, self.rank)

    @cached_property
    def responses(self) -> tuple:
        """Particular accelerations and multipliers."""
        return exact.responses(self)

    def solve(self, compliance=None, misfit=None, friction=True, start=None) -> exact.Solution:
        """The solution under a closure."""
        return exact.solve(self, compliance, misfit, friction, start)


def linear(p: Parameters) -> Linear:
    """A linear system from its parameters."""
    return Linear(p["mass"], p["load"], p["free"], p["combinations"], p["gamma"])


Builder = Callable[[Parameters], Mechanism | Linear | None]
