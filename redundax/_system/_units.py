"""Change of physical units, Eqs. (15) and (16).

Where the numbers of lengths grow by the factor u (u = 1000 from metres to millimetres), linear coordinates
grow by u, masses stay, moments of inertia grow by u^2, forces by u, moments by u^2, and the blocks of the
Jacobian change as in (16). Angle, mass and time units change in the same way. With s the factor of a row's
own unit and e that of energy, a multiplier grows by e / s, since multiplier times row is work.

A change of units changes no physics, but the minimum norm of the multipliers is not a physical quantity: the
pick made in other units is the pick made in these units with compliance S^2 and misfit S h, where S holds
the factors of the multipliers. So a sweep over units needs one factorisation only.
"""

import dataclasses
import math
import re
from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array, Float

from .._tools._errors import RedundaxError
from .._tools._module import as_float, check_kind, figure, is_concrete, numpy_of
from .._tools._table import are_known
from .._tools._value import AbstractModule
from ._axis import Axis

_INCH, _POUND, _GRAVITY = 0.0254, 0.45359237, 9.80665
_LENGTHS = {"m": 1.0, "mm": 1e3, "cm": 1e2, "µm": 1e6, "km": 1e-3, "in": 1 / _INCH, "ft": 1 / (12 * _INCH)}
_ANGLES = {"rad": 1.0, "mrad": 1e3, "°": 180 / math.pi}
_MASSES = {"kg": 1.0, "g": 1e3, "t": 1e-3, "mg": 1e6, "lb": 1 / _POUND}
_MASSES |= {"slug": 12 * _INCH / (_POUND * _GRAVITY), "slinch": _INCH / (_POUND * _GRAVITY)}  # lbf s²/ft, lbf s²/in
_TIMES = {"s": 1.0, "ms": 1e3, "min": 1 / 60, "h": 1 / 3600}
_FORCES = {"N": 1.0, "mN": 1e3, "µN": 1e6, "kN": 1e-3, "MN": 1e-6, "lbf": 1 / (_POUND * _GRAVITY)}
_SYMBOLS = _LENGTHS | _ANGLES | _MASSES | _TIMES | _FORCES | {"deg": _ANGLES["°"], "Nm": 1.0, "Nmm": 1e3, "kNm": 1e-3}
_PART = re.compile(r"([/\s·*]*)([a-zA-Zµ]+|°)?((?:\^?[23]|²|³)?)|(.)")
_RAISED = {"^2": 2.0, "2": 2.0, "²": 2.0, "^3": 3.0, "3": 3.0, "³": 3.0}
_POWERS = ("", "", "²")


class Units(AbstractModule):
    """Factors by which the numbers of lengths, angles, masses and times grow; 1 leaves a unit as it is.

    `Units(length=1000.0)` turns metres into millimetres.

    Ready, as factors from SI: `SI` (m, kg, s, N), `MM_TONNE` (mm, t, s, N), `MM_KG` (mm, kg, s, mN), `MM_KG_MS`
    (mm, kg, ms, kN), `INCH_POUND` (in, slinch = lbf s²/in, s, lbf) and `FOOT_POUND` (ft, slug = lbf s²/ft, s, lbf).

    ??? example

        ```python
        rx.units.Units(length=1000.0)  # from metres to millimetres
        rx.units.Units(length=1000.0, mass=0.001)  # and from kilograms to tonnes: forces stay in newtons
        rx.units.MM_TONNE  # the same
        ```
    """

    length: Float[Array, ""] = eqx.field(converter=figure("length"), default=1.0)
    angle: Float[Array, ""] = eqx.field(converter=figure("angle"), default=1.0)
    mass: Float[Array, ""] = eqx.field(converter=figure("mass"), default=1.0)
    time: Float[Array, ""] = eqx.field(converter=figure("time"), default=1.0)

    @property
    def energy(self) -> Float[Array, ""]:
        """Factor of energies."""
        mass, length, time = map(numpy_of(self).asarray, (self.mass, self.length, self.time))
        return as_float(mass * (length / time) ** 2)

    def of(self, axis: Axis) -> Float[Array, " axis"]:
        """Factors of coordinates, constraint rows or slips: length for linear and force-type, else angle."""
        return as_float(numpy_of(self).where(axis.angular, self.angle, self.length))

    def of_force(self, axis: Axis) -> Float[Array, " axis"]:
        """Factors of the forces and moments that do work on an axis: multipliers, friction, generalised forces."""
        energy, own = map(numpy_of(self).asarray, (self.energy, self.of(axis)))
        return as_float(energy / own)

    def __str__(self) -> str:
        """What figures in SI become."""
        return f"SI to {StatedUnits(1.0).in_units(self)}" if are_known(self) else repr(self)


# Factors from SI of units that go together, so that force is mass times acceleration in them.
_READY = {
    "SI": {},
    "MM_TONNE": {"length": 1e3, "mass": 1e-3},
    "MM_KG": {"length": 1e3},
    "MM_KG_MS": {"length": 1e3, "time": 1e3},
    "INCH_POUND": {"length": _LENGTHS["in"], "mass": _MASSES["slinch"]},
    "FOOT_POUND": {"length": _LENGTHS["ft"], "mass": _MASSES["slug"]},
}


def ready_units(name: str) -> Units:
    """Units that go together, by name, in the precision that is set now."""
    if name not in _READY:
        raise AttributeError(f"`units` has no {name!r}. There are {', '.join(_READY)}.")
    return Units(**_READY[name])


@dataclasses.dataclass(frozen=True)
class StatedUnits:
    """The units that a model states, as plain factors from SI, which can stand beside names; None where it states none.

    Angles are in radians unless a system `in_units` has others.
    """

    length: float | None = None
    angle: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    def of(self, kind: str, rates: int = 0) -> str:
        """The symbol of a unit, as in "mm/s²"; "" where none is stated.

        `kind` is "linear", "angular", "mass", "inertia", "time", "force", "moment", or one of the last two after
        "friction ", and `rates` how often it is differentiated by time.
        """
        if self.length is None:
            return ""
        length, time = _symbol(self.length, _LENGTHS), _symbol(self.time, _TIMES)
        angle, mass = _symbol(self.angle, _ANGLES), _symbol(self.mass, _MASSES)
        force = _name(self.mass * self.length / self.time**2, _FORCES)
        moment = f"{force} {length}" if force else f"{mass} {length}²/{time}²"
        moment += "" if angle == "rad" else f"/{angle}"
        force = force or f"{mass} {length}/{time}²"
        symbols = {"linear": length, "angular": angle, "mass": mass, "time": time, "force": force, "moment": moment}
        symbols["inertia"] = f"{mass} {length}²"
        return symbols[kind.removeprefix("friction ")] + (f"/{time}{_POWERS[rates]}" if rates else "")

    def in_units(self, units: Units) -> "StatedUnits":
        """Those of the same model `in_units`; none where a factor is traced."""
        factors = [getattr(units, field.name) for field in dataclasses.fields(self)]
        if self.length is None or not all(map(is_concrete, factors)):
            return StatedUnits()
        return StatedUnits(*(own * float(x) for own, x in zip(dataclasses.astuple(self), factors, strict=True)))

    def __str__(self) -> str:
        return ", ".join(filter(None, map(self.of, ("linear", "angular", "mass", "time", "force"))))


UNSTATED = StatedUnits()


def check_units_given(units: object) -> None:
    """Refuse what is no units."""
    check_kind("units", units, Units, "units", "Give `rx.units.MM_TONNE` or `rx.units.Units(length=1000.0)`, say.")


def checked_units(units: Units | None) -> Units | None:
    """The same; what is no units is refused."""
    if units is not None:
        check_units_given(units)
    return units


def stated(units: Units | None) -> StatedUnits:
    """Those of a model whose figures are in `units`, as factors from SI; none where a factor is traced."""
    units = checked_units(units)
    stated = StatedUnits() if units is None else StatedUnits(1.0).in_units(units)
    if not math.isclose(stated.angle, 1.0, rel_tol=1e-6):
        raise RedundaxError(
            f"Argument `units` must leave angles in radians, but has {stated.angle:.4g} in one. "
            "Leave `angle` out: positions are computed from radians."
        )
    return stated


def with_unit(text: str, unit: str) -> str:
    """A text and the unit of what it names, if that is known."""
    return f"{text}, {unit}" if unit else text


def factor_of(text: str) -> float | None:
    """By how much numbers in a unit are those in SI, of products and powers of symbols as in "N mm" or "deg/s^2"; None
    where one is not known."""
    factor, power = 1.0, 1.0
    for sign, symbol, raised, other in _PART.findall(text):
        if other or (symbol and symbol not in _SYMBOLS):
            return None
        power = -1.0 if "/" in sign else power
        if symbol:
            factor *= _SYMBOLS[symbol] ** (power * _RAISED.get(raised, 1.0))
    return factor


def _name(factor: float, names: Mapping[str, float]) -> str:
    """The unit with this factor, if it has a name."""
    return next((name for name, value in names.items() if math.isclose(value, factor, rel_tol=1e-6)), "")


def _symbol(factor: float, names: Mapping[str, float]) -> str:
    """The same, else how many of the first unit it is."""
    return _name(factor, names) or f"({1 / factor:.4g} {next(iter(names))})"
