"""The referee: what another program prints of joint loads, against what a machine determines"""

import dataclasses
import itertools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from .._bodies._law_of_time import Polynomial
from .._bodies._mechanism import Mechanism
from .._closures._closure import AbstractClosure, check_closure
from .._drive._along import with_laws
from .._equations._dense_closing import closing_at
from .._models._series import Series
from .._solution_sets._band._band import band
from .._solution_sets._bounds import AbstractBounds
from .._system._state import State
from .._tools._computing import computing
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_kind, floats
from .._tools._numbers import as_arrays
from ._judge import AXES, Judgement, Kinds, Loads, closed_loads, coefficients_of, judged, loads_along
from ._log import Figure, Log, read_log, table_of
from ._motion import Path, models, path_of, reactions
from ._pushing import Held, check_open, held_at
from ._report import LogReport
from ._run import of_series, states_of

_GRAVITY = 9.81  # m/s^2: where all loads are rounding, they are so beside the weight
_WILD = 1e3  # times the tolerance: so much counts of one figure, where axes are sought
_BETTER = 1e-3  # of other axes, than those before, which are more usual
_SAMPLES = 128  # of a band, for figures that are not determined


def check(
    mechanism: Mechanism,
    log: Series | Mapping[str, Numbers] | str | pathlib.Path,
    closure: AbstractClosure | None = None,
    *,
    axes: str | None = None,
    drives: Sequence[str] | None = None,
    q: Numbers | None = None,
    bounds: AbstractBounds | None = None,
    rtol: float = 1e-3,
) -> LogReport:
    """Which joint loads in the log of another program a machine determines, whether those are right, and what
    self-stress the others carry.

    ??? example

        ```python
        bar = rx.mechanisms.parallelogram()
        ts = jnp.linspace(0.0, 1.0, 21)
        run = rx.drive(bar, {"A1.angle": rx.Polynomial([0.8, 1.0])}, ts, bar.state(0.8).q)
        names = ["A1.angle", "A1.angle'", "A1.angle''", "A1 force x on crank 1", "B1 force x on coupler"]
        print(rx.check(bar, {"t": ts, **{name: run[name] for name in names}}, q=run.q[0]))
        ```

    **Arguments:**

    - `mechanism`: without friction that depends on loads. Drivers among its joints are its motion. One-sided
      contacts that have no gap at the first position hold all along, and those that pull are wrong.
    - `log`: a file of CSV, a table with columns by name, or the stored run of a model, `model.series`. Columns are `t`,
      coordinates of joints, "A.angle", with ' their rates and with '' their accelerations, loads of joints, as in
      "A force x on crank", and what drives a coordinate, "A.angle torque". Units are those of the mechanism; moments
      are about the joint's point. Rates and accelerations that are not there are derivatives of splines.
    - `closure`: whose loads stand beside those that are not determined.
    - `axes`: in which components are: "global", "body", that of the body on which they act, or "joint", those of its
      body j. By default those are taken that fit best, and so is the body where columns do not name it.
    - `drives`: which coordinates are driven; their accelerations are those of the log. By default those whose drives
      are logged, or all where they are as many as the freedoms; else the machine moves by its loads alone.
    - `q`: guess of the first position; by default the reference poses.
    - `bounds`: of fits or stiffness, as of `band`: the ends of what they allow stand beside the loads that are not
      determined, at the time of the largest self-stress of the log; of global components.
    - `rtol`: what is right, relative to the largest force, or moment, of the joint.

    **Returns:** a `LogReport`, to print.

    **Raises:** `RedundaxError` for a log that does not tell the motion or has no load, or along which a contact closes;
    `NoSolutionError` where the loops do not close at its coordinates, or a contact would open.
    """
    check_kind("mechanism", mechanism, Mechanism, "a `Mechanism`", "Give one of `rx.Mechanism` or of `rx.load_model`.")
    check_kind(
        "log", log, (Series, Mapping, str, pathlib.Path), "a log", "Give a file of CSV, a table or `model.series`."
    )
    if closure is not None:
        check_closure(closure)
    if axes is not None and axes not in AXES:
        raise RedundaxError(
            f"Argument `axes` must be one of {', '.join(AXES)}, but is {axes!r}. Name one, or leave it out."
        )
    if isinstance(log, Series) and (drives is not None or axes not in (None, "global")):
        raise RedundaxError(
            "Arguments `axes` and `drives` must be left out where `log` is the stored run of a model, which tells its "
            "motion and has global components. Write `rx.check(mechanism, model.series)`."
        )
    if not 0 < rtol < 1:
        raise RedundaxError(f"Argument `rtol` must be between 0 and 1, but is {rtol!r}. Give 1e-3, say.")
    whole = mechanism.whole
    with computing():
        if isinstance(log, Series):
            held = held_at(whole, states_of(whole, log)[0][0], log.times[0])
            read, path = of_series(held.system, log)
            axes = "global"
        else:
            table = table_of(pathlib.Path(log)) if isinstance(log, str | pathlib.Path) else log
            read = read_log(whole, table)
            guess = np.asarray(floats(whole.reference if q is None else q))
            held = held_at(whole, guess, read.times[0])
            path = path_of(held.system, read, guess, drives)
        check_open(held, path)
        system = held.system
        model = models(system, path.times, path.q, path.qd, bool(path.drive.names))
        loads = loads_along(held, path, model)
        doubt = np.zeros_like(loads.multipliers)
        if path.splined:
            drive = path.drive._replace(accelerations=path.drive.accelerations + path.drive.doubt)
            doubt = loads_along(held, path._replace(drive=drive), model).multipliers - loads.multipliers
        if not loads.judged.any():
            raise RedundaxError(
                "Argument `log` has no time whose loads are finite. Check its numbers and those of masses."
            )
        found, B, logged, chosen = _best(held, path, loads, read, axes, (rtol, doubt))
    closed = None if closure is None else closed_loads(held, path, closure, B, loads)
    report = _report(system, path, loads, read, (found, logged, chosen), closed)
    return report if bounds is None else _with_bands(whole, path, read, report, bounds)


def _best(
    held: Held, path: Path, loads: Loads, log: Log, axes: str | None, right: tuple
) -> tuple[Judgement, np.ndarray, np.ndarray, tuple[str, bool]]:
    """The judgement, B and the loads of the log, in axes and on bodies that are told, or on those which fit best."""
    system, forces = held.system, [name for name in path.drive.names if name in log.drives]
    columns = len(system.rows) + len(path.drive.names)
    of_drives = np.zeros((len(path.q), len(forces), columns))
    for k, name in enumerate(forces):
        of_drives[:, k, len(system.rows) + path.drive.names.index(name)] = -1.0
    logged = np.stack([*(x.values for x in log.figures), *(log.drives[name] for name in forces)], axis=-1)
    turns = [*(x.part == "moment" for x in log.figures), *(_turns(system, name) for name in forces)]
    groups = [*(2 * x.joint + (x.part == "moment") for x in log.figures), *(-1 - k for k in range(len(forces)))]
    weight = float(np.sum(np.abs(np.asarray(system.body.mass)))) * _GRAVITY
    kinds = Kinds(np.array(turns, bool), np.array(groups, int), path.scale.length, weight)
    others = (False, True) if any(x.is_other is None for x in log.figures) else (False,)
    on = reactions(system, path, True in others or any(x.is_other for x in log.figures))
    best: Any = None
    for other, way in itertools.product(others, AXES if axes is None else (axes,)):
        figures = [_on(system, figure, other) for figure in log.figures]
        B = np.concatenate([coefficients_of(system, columns, on, figures, way), of_drives], axis=1)
        found = judged(held, loads, B, logged, kinds, *right)
        miss = np.abs(found.wrong[loads.judged]) / found.tolerance
        cost = float(np.sum(np.minimum(miss.max(axis=0), _WILD)))
        if best is None or cost < (1 - _BETTER) * best[0]:
            best = cost, (found, B, logged, (way, other))
    return best[1]


def _on(system: Mechanism, figure: Figure, other: bool) -> Figure:
    """A load with the body that it acts on."""
    is_other = other if figure.is_other is None else figure.is_other
    told = system.names.reactions.labels[figure.joint * system.frame.size]
    pair = cast(tuple[str, str], system.names.bodies_at(system.names.joint_names[figure.joint]))
    is_first = told.endswith(f" on {pair[0]}")
    return dataclasses.replace(figure, is_other=is_other, on=pair[is_first == is_other])


def _turns(system: Mechanism, name: str) -> bool:
    axis = system.names.joint_coordinates
    return bool(axis.angular[axis.labels.index(name)]) if name in axis.labels else name.endswith("phi")


def _report(
    system: Mechanism,
    path: Path,
    loads: Loads,
    log: Log,
    found: tuple[Judgement, np.ndarray, tuple[str, bool]],
    closed: np.ndarray | None,
) -> LogReport:
    judgement, logged, (axes, other) = found
    driven = [name for name in path.drive.names if name in log.drives]
    forces = (f"{name} {'torque' if _turns(system, name) else 'force'}" for name in driven)
    names = (*(figure.name for figure in log.figures), *forces)
    moments = [*(figure.part == "moment" for figure in log.figures), *(_turns(system, name) for name in driven)]
    units = system.names.units
    return LogReport(
        names,
        path.times,
        logged,
        judgement.least + judgement.stress,
        judgement.stress,
        judgement.determined,
        judgement.tolerance,
        loads.judged,
        loads.rank,
        axes,
        other,
        path.drive.names,
        path.apart,
        path.splined,
        log.unused,
        tuple(units.of("moment" if turns else "force") for turns in moments),
        closed,
    )


def _with_bands(system: Mechanism, path: Path, log: Log, report: LogReport, bounds: AbstractBounds) -> LogReport:
    """The same with what bounds allow of loads that are not determined, when the log has the largest self-stress."""
    loose = [k for k, figure in enumerate(log.figures) if not report.determined[report.judged, k].all()]
    told = [_told(system, log.figures[k]) for k in loose]
    if not loose or report.axes != "global" or report.on_other:
        return report
    sizes = np.where(report.judged, np.abs(report.stress / report.tolerance)[:, loose].max(axis=1), -1.0)
    k = int(np.argmax(sizes))
    t = float(path.times[k])
    driven = with_laws(system, _laws(system, path, k)) if path.drive.names else system
    state = as_arrays(State(path.q[k], path.qd[k], np.asarray(t)))
    found = band(driven, state, list(dict.fromkeys(name for name, _ in told)), bounds, samples=_SAMPLES)
    ends = {
        name: (float(low), float(high)) for name, low, high in zip(found.names, found.lower, found.upper, strict=True)
    }
    named = {
        report.names[column]: ends[name] if sign > 0 else (-ends[name][1], -ends[name][0])
        for column, (name, sign) in zip(loose, told, strict=True)
        if log.figures[column].point is None or log.figures[column].part == "force"
    }
    return dataclasses.replace(report, bands=named, band_time=t)


def _told(system: Mechanism, figure: Figure) -> tuple[str, int]:
    """The name of a load here, and its sign."""
    parts = [part for part, kind in system.frame.reaction if kind == figure.part]
    size, known = system.frame.size, [part for part, _ in system.frame.reaction]
    label = system.names.reactions.labels[figure.joint * size + known.index(parts[figure.component])]
    return label, -1 if figure.is_other else 1


def _laws(system: Mechanism, path: Path, k: int) -> dict[str, Polynomial]:
    """Laws of time that move driven coordinates as at a time of the log."""
    m, n, t = len(system.rows), len(system.coordinates), float(path.times[k])
    with computing():
        _, values, slopes = closing_at(system.anonymous, path.q[k], np.zeros(n), path.times[k])
    found = {}
    for name, place, acceleration in zip(path.drive.names, path.drive.places, path.drive.accelerations[k], strict=True):
        row = m + place + (0 if system.names.adds else n)
        x, v, a = float(values[row]), float(slopes[row] @ path.qd[k]), float(acceleration)
        found[name] = Polynomial([x - v * t + a * t**2 / 2, v - a * t, a / 2])
    return found
