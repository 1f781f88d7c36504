"""Whether the data of a closure look as if they were in other units than the system.

Arrays carry no unit, but their size gives them away. Of a joint whose contacts stand a distance b apart

    c_moment L^2 / c_force = (L / b)^2,   L a length of the mechanism,

is 1e-3 for b = 30 L and 1e6 for b = L / 1000. No part misses its place by L / 4 or a quarter of a radian. A misfit is
more than a millionth of what the loads of the mechanism make joints give way, which as many times both are; without
misfit, compliance is mere weights, up to 1000, or joints give way by less than L.
"""

import dataclasses
from weakref import WeakValueDictionary

import numpy as np
from jaxtyping import Array

from .._system._axis import Axis
from .._system._names import Names
from .._system._units import StatedUnits
from .._tools._module import is_concrete
from .._tools._words import warn
from ._closure import AbstractClosure, Elasticity

_LEAST, _MOST = 1e-3, 1e6
_SHARE, _TURN = 0.25, 0.25  # of the length, and rad: the largest misfit
_LOST, _WEIGHT = 1e-6, 1e3
_IN_M, _IN_MM = StatedUnits(1.0), StatedUnits(1e3, mass=1e-3)
_checked: WeakValueDictionary[int, AbstractClosure] = WeakValueDictionary()


def check_units(names: Names, length: Array, closure: AbstractClosure, given: Elasticity, multipliers: Array) -> None:
    """Warn, once for each closure whose loads are known, where its concrete values look as if they were in other units.

    `length` is that of the factorised mechanism, `given` what the closure gave at its state, and `multipliers` those of
    the solution, which may be traced.
    """
    if _checked.get(id(closure)) is closure:
        return
    if is_concrete(multipliers):
        _checked[id(closure)] = closure
    if float(length) == 1.0:  # stands for a mechanism without a length of its own
        return
    whole, misfit, scale = np.asarray(given.compliance), np.asarray(given.misfit), np.asarray(length)
    compliance = np.diag(whole) if whole.shape[0] == whole.shape[1] else whole[:, 0]  # of W, or by the mates of rows
    problems = (
        _of_compliance(names, compliance, scale),
        _of_stiffness(names, (compliance, misfit), np.asarray(multipliers), scale) if is_concrete(multipliers) else "",
        _of_misfit(names, misfit, scale),
    )
    for problem in filter(None, problems):
        warn(f"{problem}; if the figures are meant, ignore this warning.")


def _of_compliance(names: Names, compliance: np.ndarray, length: np.ndarray) -> str:
    rows, of = names.rows, names.units.of
    kinds = [kind & (compliance > 0) for kind in (~rows.angular, rows.angular)]
    if not all(kind.any() for kind in kinds):
        return ""
    force, moment = (np.median(compliance[kind]) for kind in kinds)
    ratio = moment * length**2 / force
    if _LEAST <= ratio <= _MOST:
        return ""
    units = f"{of('linear')}/{of('force')}", f"{of('angular')}/({of('moment')})"
    per_force, per_moment = (f" {unit}" if str(names.units) else "" for unit in units)
    return (
        f"Argument `W` looks as if it were in other units than the system: force-type rows have {force:.2g}{per_force} "
        f"in the median, most {_largest(rows, compliance, kinds[0])}, and moment-type rows {moment:.2g}{per_moment}, "
        f"most {_largest(rows, compliance, kinds[1])}. With the length L = {_of_length(names, length)} of the "
        f"mechanism c_moment L^2 / c_force is {ratio:.1g}, but lies between {_LEAST:g} and {_MOST:g} for joints. "
        f"Give {_remedy(names.units, _IN_MM if ratio < 1 else _IN_M, _IN_M if ratio < 1 else _IN_MM)}"
    )


def _of_stiffness(
    names: Names, given: tuple[np.ndarray, np.ndarray], multipliers: np.ndarray, length: np.ndarray
) -> str:
    """Of compliance and misfit, which only weigh against each other, and multipliers of their solution."""
    (compliance, misfit), rows, of = given, names.rows, names.units.of
    forces = np.abs(multipliers[~rows.angular & np.isfinite(multipliers)])
    soft = ~rows.angular & (compliance > 0)
    load = forces.max(initial=0.0)
    if not (load > 0 and soft.any()):
        return ""
    middle, most = np.median(compliance[soft]), np.abs(misfit[~rows.angular]).max(initial=0.0)
    if most > 0:
        is_lost, why = most < _LOST * middle * load, "A misfit of {:.2g} {} is nothing beside"
    else:
        is_lost, why = (
            middle > _WEIGHT and middle * load > length,
            "The length of the mechanism, {:.2g} {}, is less than",
        )
    if not is_lost:
        return ""
    per_force = f" {of('linear')}/{of('force')}" if str(names.units) else ""
    less = why.format(most or length, of("linear")).replace(" ,", ",").replace("  ", " ")
    return (
        "Argument `W` looks as if it were stiffness, or in other units than the system: force-type rows have "
        f"{middle:.2g}{per_force} in the median, most {_largest(rows, compliance, soft)}. {less} the deflection "
        f"{f'{middle * load:.2g} ' + of('linear')}".rstrip()
        + " by the largest joint load. Give stiffness to "
        "`from_stiffness`, or compliance in the units of the model"
    )


def _of_misfit(names: Names, misfit: np.ndarray, length: np.ndarray) -> str:
    rows = names.rows
    large = np.abs(misfit) > np.where(rows.angular, _TURN, _SHARE * length)
    if not large.any():
        return ""
    return (
        "Argument `misfit` looks as if it were in other units than the system: it has "
        f"{_largest(rows, misfit, large)}, more than {_SHARE:g} of the length {_of_length(names, length)} of the "
        f"mechanism or {_TURN:g} rad. Give {_remedy(names.units, _IN_MM, _IN_M)}, "
        "`units=rx.units.Units(angle=57.2958)` for degrees"
    )


def _remedy(own: StatedUnits, data: StatedUnits, assumed: StatedUnits) -> str:
    """The argument for data in units that they may be in, from those of the model, assumed where it states none."""
    own = assumed if own.length is None else own
    pairs = zip(dataclasses.asdict(data).items(), dataclasses.astuple(own), strict=True)
    factors = {name: float(f"{there / here:.6g}") for (name, there), here in pairs}
    given = ", ".join(f"{name}={factor}" for name, factor in factors.items() if factor != 1)
    symbols = f"in {data.of('linear')} and {data.of('force')}"
    return f"`units=rx.units.Units({given})` for data {symbols}" if given else f"figures {symbols}, as the model has"


def _of_length(names: Names, length: np.ndarray) -> str:
    return f"{length:.2g} {names.units.of('linear')}".rstrip()


def _largest(rows: Axis, values: np.ndarray, among: np.ndarray) -> str:
    """Names and values of the largest three."""
    order = np.argsort(-np.abs(values) * among, kind="stable")[: min(3, among.sum())]
    return ", ".join(f"{rows.labels[k]} ({values[k]:.2g})" for k in order)
