"""Inverse dynamics along a prescribed motion: which forces must the drives give?

Positions follow the laws from time to time (`_along`), and each is solved for its loads (`_loads`), in batches of one
compiled program. What a batch leaves open, as singular positions and friction that Newton's method does not find, is
asked of `solve`, time by time.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from .._bodies._joints import AngleDriver, DistanceDriver
from .._bodies._law_of_time import Polynomial
from .._bodies._mechanism import Mechanism
from .._bodies._space._joints._drivers import AngleDriver as SpatialAngleDriver
from .._bodies._space._joints._drivers import TravelDriver
from .._bodies._speed_driver import DrivenSpeed
from .._closures._closure import AbstractClosure, MinimumNorm, check_closure, placed
from .._closures._play import refuse_play
from .._solve._solve import solve
from .._solvers._solver import AbstractSolver, Newton, check_solver
from .._system._directions import directions_of
from .._system._friction import have_sense
from .._system._names import DRIVE, ByName
from .._system._results import RESULTS, result_codes
from .._system._state import State
from .._system._system import AbstractSystem, refuse_contacts
from .._tools._compilation import compiled
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import Numbers, replace_fields
from .._tools._numbers import are_known, as_arrays
from ._along import Laws, Path, along, in_batches, narrow_places
from ._loads import Loads, loads
from ._run import Drive, Moment, Run
from ._senses import Senses, senses_of
from ._share import LeastPeak

_MINIMUM_NORM = MinimumNorm()
_SINGULAR = 1e-9  # a bound of the least singular value over the largest: too few digits are left for a batch
_NAMED = 8  # frictions, at most
_CONTRADICTS = 1e-7  # of the accelerations that redundant rows prescribe: what rounding of positions leaves of none


def drive(
    system: AbstractSystem,
    laws: Laws,
    ts: Numbers,
    q: ByName | None = None,
    *,
    hold: Sequence[str] = (),
    closure: AbstractClosure | LeastPeak = _MINIMUM_NORM,
    solver: AbstractSolver | None = None,
    throw: bool | None = None,
) -> Run:
    """What the drives of a machine must give so that it follows laws of time, and all joint loads on the way.

    ??? example

        ```python
        crank = rx.mechanisms.slider_crank()
        law, ts = rx.Polynomial([0.5, 10.0]), jnp.linspace(0.0, 0.6, 61)  # rad, s
        run = rx.drive(crank, {"A.angle": law}, ts, crank.state(0.5).q)
        print(run)
        run["A.angle torque"], run.peak, run.rms, run.power
        ```

    **Arguments:**

    - `system`, `laws`, `ts`, `q`, `hold`: as of `assemble_along`. Leave `laws` empty, {}, where drivers among the
      joints say all.
    - `closure`: which of the loads to take where they are not unique, as of `solve`. Where drives are more than the
      freedoms they fight: `ElasticJoints(..., drives=...)` has the stiffness of their servos and their synchronising
      errors, `LeastNorm` and `LeastPeak` share the load.
    - `solver`: of friction: `Newton()` if not given.
    - `throw`: whether to raise an error where a time has no solution; by default outside of `jit`, `vmap` and `grad`.

    **Returns:** a `Run`.

    **Raises:** as of `assemble_along`, and `NoSolutionError` with the time at which loads have no solution.
    """
    refuse_contacts("drive", system)
    if not isinstance(closure, LeastPeak):
        check_closure(closure)
    own = closure.closure if isinstance(closure, LeastPeak) else closure
    if own is not None:
        refuse_play(own, system)
    if solver is not None:
        check_solver(solver)
    solver = solver or Newton()
    path = along(system, laws, ts, q, hold, throw)
    if not drives_of(path.system):
        raise RedundaxError(
            "Argument `laws` must name a coordinate that is driven, but is empty, and no joint is a driver. Write "
            '{"motor.angle": rx.Harmonic(0.1, 2.0)}, say.'
        )
    if not isinstance(closure, LeastPeak):
        return _solved(path, closure, solver, throw)
    if not are_known(path, closure):
        raise RedundaxError(
            "Argument `closure` must be another than `LeastPeak` inside of `jit`, `vmap` and `grad`: `LeastNorm`, say."
        )
    count = len(path.system.undriven.rows)

    def forces_of(one: AbstractClosure) -> np.ndarray:
        return -np.asarray(_solved(path, one, solver, False).multipliers)[:, count:]

    names = [each.name for each in drives_of(path.system) if each.row >= count]
    chosen, said = closure.shared(forces_of, names, np.asarray(path.t))
    run = _solved(path, chosen, solver, throw)
    return replace_fields(run, remarks=(*run.remarks, *said))


def _solved(path: Path, closure: AbstractClosure, solver: AbstractSolver, throw: bool | None) -> Run:
    """The loads along a motion."""
    known, drives = are_known(path, closure, solver), drives_of(path.system)
    anonymous, choices = path.system.anonymous, (placed(closure, path.system), solver)
    senses = senses_of(path.system, path.moving.slips, path.scale.length)
    both: Any = (np if known else jnp).stack([senses.after, senses.before], axis=1)
    given = anonymous, path.scale, choices
    asked = path.moving.q, path.moving.qd, path.t, path.moving.acceleration, both, senses.rests
    found: Loads = in_batches(_loads_batch, given, asked) if known else _loads_of(*given, *asked)
    good: Any = _is_good(path, found, solver)
    rows = np.array([each.row for each in drives], int)
    run = Run(
        t=path.t,
        q=path.moving.q,
        qd=path.moving.qd,
        acceleration=path.moving.acceleration,
        multipliers=found.multipliers[:, 0],
        friction=found.friction[:, 0],
        before=Moment(found.multipliers[:, 1], found.friction[:, 1]),
        result=RESULTS.successful,
        rates=path.moving.prescribed[:, rows],
        determined=~found.depends[:, rows],
        determined_without_friction=~found.direct[:, rows],
        stays=_stays(path, given, senses, rows) if known else jnp.full((len(path.t), len(rows), 2), jnp.nan),
        weakest=path.moving.weakest,
        drives=drives,
        names=path.system.names,
        joint_coordinates=path.system.joint_coordinates,
    )
    if not known:
        return _masked(run, good)
    remarks = *narrow_places(path), *_of_joints_that_never_slip(path, senses)
    run = replace_fields(run, system=path.system, remarks=remarks)
    run = _asked_again(run, path.system, good, closure, both)
    if throw is not False:
        _check(run)
    return as_arrays(run)


def _of_joints_that_never_slip(path: Path, senses: Senses) -> tuple[str, ...]:
    """What is to be said of friction that no motion gives a sense."""
    system = path.system
    never = np.all((senses.after == 0) & (senses.before == 0), axis=0) & np.array(have_sense(system.friction), bool)
    joints = directions_of(system.friction) if never.any() else None
    never = never if joints is None else np.asarray(joints.every(never))
    if not never.any():
        return ()
    names = [f"tau {label}" for label, one in zip(system.slips.labels, never, strict=True) if one]
    return (f"Friction of joints that do not slip at any of the times is taken as none: {', '.join(names[:_NAMED])}.",)


def drives_of(system: AbstractSystem) -> tuple[Drive, ...]:
    """Drivers among the joints, drives of speed, and coordinates that follow laws."""
    base, found = system.undriven, []
    labels, angular = system.rows.labels, system.rows.angular.tolist()
    if isinstance(base, Mechanism):
        for stack, names in zip(base.joints, base.names.joints, strict=True):
            driver = stack.element
            if isinstance(driver, AngleDriver | DistanceDriver | SpatialAngleDriver | TravelDriver):
                law = getattr(driver, "distance", None)
                if isinstance(law, Polynomial) and law.coefficients.shape[-1] == 1:  # a rod of constant length
                    continue
                rows = [labels.index(f"{name}.{driver.row_kinds[0][0]}") for name in names]
                found += [Drive(name, row, angular[row]) for name, row in zip(names, rows, strict=True)]
        for speed in base.couplings:
            if isinstance(speed, DrivenSpeed):
                row = int(np.asarray(speed.rows)[0])
                found.append(Drive(labels[row].removesuffix(".speed"), row, angular[row]))
    for row in range(len(base.rows), len(labels)):
        found.append(Drive(labels[row].removesuffix(DRIVE), row, angular[row]))
    return tuple(found)


def _loads_of(
    system: AbstractSystem,
    scale: Any,
    choices: tuple,
    q: Array,
    qd: Array,
    t: Array,
    acceleration: Array,
    senses: Array,
    rests: Array,
) -> Loads:
    def of_one(q: Array, qd: Array, t: Array, *given: Array) -> Loads:
        return loads(system, scale, choices, State(q, qd, t), *given)

    return jax.vmap(of_one)(q, qd, t, acceleration, senses, rests)


_loads_batch = compiled(_loads_of)


def _is_good(path: Path, found: Loads, solver: AbstractSolver) -> Bool[Array, " times"]:
    """At which times the batch has answered."""
    xp = np if are_known(found) else jnp
    good = found.decided & (path.moving.weakest > _SINGULAR) & (path.moving.contradiction < _CONTRADICTS)
    for x in (found.multipliers, found.friction, path.moving.acceleration):
        good = good & xp.all(xp.isfinite(x.reshape(len(x), -1)), axis=1)
    if found.progress is not None:
        rtol = solver.tolerance(path.moving.qd.dtype)
        good = good & xp.all(xp.asarray(found.progress.converged(rtol)), axis=1)
    return good


def _stays(path: Path, given: tuple, senses: Senses, rows: np.ndarray) -> Any:
    """Forces of the drives between which the machine stays, where all of it rests: friction the one way and the other,
    nothing accelerates."""
    out = np.full((len(path.t), len(rows), 2), np.nan)
    speed = np.abs(path.moving.qd).max(axis=1)
    still = np.flatnonzero((speed <= 1e-9 * np.nanmax(speed, initial=0.0)) & np.isfinite(speed))  # rounding of none
    if still.size:
        none = np.zeros_like(path.moving.qd[still])
        ways = np.stack([senses.after[still], -senses.after[still]], axis=1)
        asked = path.moving.q[still], none, np.asarray(path.t)[still], none, ways, np.ones_like(senses.rests[still])
        forces = -in_batches(_loads_batch, given, asked).multipliers[:, :, rows]
        out[still, :, 0], out[still, :, 1] = forces.min(axis=1), forces.max(axis=1)
    return out


def _masked(run: Run, good: Array) -> Run:
    """Of traced numbers: NaN where there is no answer."""
    result = jax.vmap(lambda one: RESULTS.where(one, RESULTS.successful, RESULTS.not_finite))(good)

    def kept(x: Array) -> Array:
        return jnp.where(good[:, None], x, jnp.nan)

    before = Moment(kept(run.before.multipliers), kept(run.before.friction))
    return replace_fields(
        run, multipliers=kept(run.multipliers), friction=kept(run.friction), before=before, result=result
    )


def _asked_again(
    run: Run, system: AbstractSystem, good: np.ndarray, closure: AbstractClosure, senses: np.ndarray
) -> Run:
    """Of known numbers: what the batch left open is asked of `solve`."""
    codes = np.full(len(good), result_codes()["successful"])
    arrays = {name: np.array(getattr(run, name)) for name in ("multipliers", "friction", "acceleration")}
    before: Any = Moment(*(np.array(x) for x in (run.before.multipliers, run.before.friction)))  # pyright: ignore
    for k in np.flatnonzero(~good).tolist():
        if not np.all(np.isfinite(run.q[k])):
            codes[k], found = result_codes()["no_position"], None
        else:
            state = as_arrays(State(run.q[k], run.qd[k], np.asarray(run.t)[k]))
            found = [
                solve(system, state, closure=closure, sense=jnp.asarray(sense), throw=False) for sense in senses[k]
            ]
            ends = [int(jax.tree.leaves(one.result)[0]) for one in found]
            codes[k] = max(ends)
        for name, array in arrays.items():
            array[k] = np.nan if found is None else np.asarray(getattr(found[0], name))
        for name in ("multipliers", "friction"):
            getattr(before, name)[k] = np.nan if found is None else np.asarray(getattr(found[1], name))
    result = jax.tree.map(lambda _: codes, RESULTS.successful)
    return replace_fields(run, **arrays, before=before, result=result)


def _check(run: Run) -> None:
    """Raise an error where a time has no solution."""
    codes = np.asarray(jax.tree.leaves(run.result)[0])
    failed = np.flatnonzero(codes != result_codes()["successful"])
    if failed.size:
        first, count = failed[0], failed.size
        message = RESULTS[jax.tree.map(lambda x: x[first], run.result)]
        raise NoSolutionError(
            f"At {count} of {codes.size} times, first t = {float(np.asarray(run.t)[first]):.6g}: {message} "
            "With `throw=False` the other times are given, and NaN at these."
        )
