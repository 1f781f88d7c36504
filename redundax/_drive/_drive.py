"""Inverse dynamics along a prescribed motion: which forces must the drives give?

Positions follow the laws from time to time (`_along`), and each is solved for its loads (`_loads`), in batches of one
compiled program. What a batch leaves open, as singular positions and friction that Newton's method does not find, is
asked of `solve`, time by time.
"""

import itertools
from collections.abc import Sequence
from functools import partial
from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from .._bodies._joints import AngleDriver
from .._bodies._joints._driver import AbstractDistance
from .._bodies._law_of_time import Polynomial
from .._bodies._mechanism import Mechanism
from .._bodies._space._joints._distance import AbstractDistance as AbstractSpatialDistance
from .._bodies._space._joints._drivers import AngleDriver as SpatialAngleDriver
from .._bodies._space._joints._drivers import TravelDriver
from .._bodies._speed_driver import DrivenSpeed
from .._closures._closure import AbstractClosure, MinimumNorm, check_closure, placed
from .._closures._play import refuse_play
from .._equations._scaling import Scaling
from .._solvers._solver import AbstractSolver, Newton, check_solver
from .._system._names import DRIVE, ByName
from .._system._results import RESULTS, result_codes
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import Numbers, numpy_of, replace_fields
from .._tools._no_answer import nan_where
from .._tools._numbers import Numeric, are_known, as_arrays, as_program, tolerance_of
from ._along import Laws, Path, along, decide, in_batches, laws_and_held, narrow_places, started, with_laws
from ._loads import Loads, Moving, loads, moving
from ._one_by_one import (
    Batch,
    Held,
    Touching,
    as_closed,
    asked_again,
    driven_by,
    held_at,
    none_held,
    touching,
    until_reached,
    with_codes,
    with_contacts,
)
from ._run import Drive, Moment, Run
from ._senses import NOISE, Senses, never_slip, senses_of, signs_of
from ._share import LeastPeak

_MINIMUM_NORM = MinimumNorm()
_DRIVERS = AngleDriver, AbstractDistance, SpatialAngleDriver, TravelDriver, AbstractSpatialDistance
# A bound of the least singular value over the largest, at least so many roundings: too few digits are left for a batch.
_SINGULAR = 1e-9, 1e3
_SOLVES = "`solve` does, state by state, with derivatives; or take differences of `drive`"  # with play
_NAMED = 8  # frictions, at most
# Of the accelerations that redundant rows prescribe, at least so many roundings: what those of positions leave of none.
_CONTRADICTS = 1e-7, 1e4
_STILL = 1e-9, 1e2  # of the largest speed, at least so many roundings: that of a machine at rest


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
    - `closure`: which of the loads to take where they are not unique, as of `solve`; its joints may have play, but not
      inside of `jit`, `vmap` and `grad`, and `solve` is then asked time by time. Where drives are more than the
      freedoms they fight: `ElasticJoints(..., drives=...)` has the stiffness of their servos and their synchronising
      errors, `LeastNorm` and `LeastPeak` share the load.
    - `solver`: of friction: `Newton()` if not given.
    - `throw`: whether to raise an error where a time has no solution; by default outside of `jit`, `vmap` and `grad`.

    **Returns:** a `Run`.

    **Raises:** as of `assemble_along`, and `NoSolutionError` with the time at which loads have no solution.
    """
    check_system(system)
    if not isinstance(closure, LeastPeak):
        check_closure(closure)
    elif closure.closure is not None:
        refuse_play(closure.closure.clearances(system))
    if solver is not None:
        check_solver(solver)
    solver = solver or Newton()
    held, start, contacts = Held(system.names, np.ones(len(system.names.one_sided), bool)), None, None
    if system.names.one_sided and are_known(driven := with_laws(system, laws), ts, q):
        start = started(driven, laws, ts, q, throw)
        held, every_law = none_held(system), laws_and_held(system, laws, hold, start)
        if decide(with_laws(as_closed(system.whole, held), every_law), start):
            contacts = system, start
        else:
            held = held_at(system, start)
    path = along(as_closed(system, held), laws, ts, q, hold, throw, start)
    if not drives_of(path.system):
        raise RedundaxError(
            "Argument `laws` must name a coordinate that is driven, but is empty, and no joint is a driver. Write "
            '{"motor.angle": rx.Harmonic(0.1, 2.0)}, say.'
        )
    if not are_known(path, closure):
        _refuse_inside(system, closure)
        return _solved(path, held, cast(AbstractClosure, closure), solver, throw)
    path, said = until_reached(system, held, path, throw)
    if isinstance(closure, LeastPeak):
        count = len(path.system.undriven.rows)

        def forces_of(path: Path, contacts: tuple[AbstractSystem, State] | None, one: AbstractClosure) -> np.ndarray:
            return -np.asarray(_solved(path, held, one, solver, False, contacts).multipliers)[:, count:]

        smooth = path._replace(system=path.system.without_friction)
        beside = contacts and (contacts[0].without_friction, contacts[1])
        both = partial(forces_of, path, contacts), partial(forces_of, smooth, beside)
        sharing = [each.name for each in drives_of(path.system) if each.row >= count]
        closure, shared = closure.shared(*both, sharing, np.asarray(path.t), throw)
        said = *said, *shared
    run = _solved(path, held, closure, solver, throw, contacts)
    run = replace_fields(run, remarks=(*run.remarks, *said))
    if not system.names.one_sided:
        return run
    return as_arrays(replace_fields(with_codes(run, system), system=driven_by(path, system.whole)))


def _refuse_inside(system: AbstractSystem, closure: AbstractClosure | LeastPeak) -> None:
    """Refuse what is not had inside of transformations: one-sided contacts, all of which would be held, shares that are
    looked for, and play."""
    if system.names.one_sided:
        raise RedundaxError(
            f"Argument `system` has one-sided contacts, {', '.join(system.names.contacts)}, which `drive` does not "
            "open and close inside of `jit`, `vmap` and `grad`. Ask `solve` or `analyze` which of them carry, and give "
            "the mechanism with these alone, not one-sided."
        )
    if isinstance(closure, LeastPeak):
        raise RedundaxError(
            "Argument `closure` must be another than `LeastPeak` inside of `jit`, `vmap` and `grad`: `LeastNorm`, say."
        )
    refuse_play(closure.clearances(system), "`drive` inside of transformations", _SOLVES)


def _solved(
    path: Path,
    held: Held,
    closure: AbstractClosure,
    solver: AbstractSolver,
    throw: bool | None,
    contacts: tuple[AbstractSystem, State] | None = None,
) -> Run:
    """The loads along a motion; with those of a system and its start where they come and go with it."""
    choices = placed(closure, path.system), solver
    if not are_known(path, closure, solver):
        at, found, senses = _traced(path, choices)
        return _masked(*_batch_of(path, at, found, senses, solver)[:2])

    def asked(path: Path) -> Batch:
        return _batch_of(path, *_on_numbers(path, choices), solver)

    at, found, senses = _on_numbers(path, choices)
    run, good, _ = _batch_of(path, at, found, senses, solver)
    remarks = *narrow_places(path, np.asarray(at.weakest)), *_of_joints_that_never_slip(path.system, senses)
    stays = _stays(path, choices, at, senses)
    run = replace_fields(run, system=path.system, remarks=remarks, stays=stays)
    touches = touching(*contacts, path, run) if contacts else ()
    alone = ~np.any([np.zeros_like(good), *(touch.at for touch in touches)], axis=0)
    run = asked_again(path, held, closure, Batch(run, good, senses), asked, throw, alone)
    for touch in touches:
        run = _touched(run, touch, choices[0], solver)
    if throw is not False:
        _check(run)
    return as_arrays(run)


def _touched(run: Run, touch: Touching, closure: AbstractClosure, solver: AbstractSolver) -> Run:
    """A run with what contacts carry that are closed at some times. Where these stay closed as laws move the parts the
    batch with them held answers, if they push; else `solve` does."""
    path, choices = touch.path, (closure, solver)
    at, found, senses = _on_numbers(path, choices)
    own = _batch_of(path, at, found, senses, solver)[0]
    stays = _stays(path, choices, at, senses)
    own = replace_fields(own, system=path.system, stays=stays)
    sizes = [np.abs(x / np.asarray(path.scale.coordinates)) for x in (at.acceleration, run.acceleration)]
    apart = np.abs(at.acceleration - run.acceleration) / np.asarray(path.scale.coordinates)
    together = apart.max(axis=1) <= tolerance_of(_CONTRADICTS, apart) * np.nanmax(sizes, initial=0.0)
    good = together & _is_good(at._replace(contradiction=np.zeros_like(at.weakest)), found, solver)
    own = asked_again(path, touch.held, closure, Batch(own, good, senses), None, False, touch.at)
    return with_contacts(run, own, touch)


def _batch_of(path: Path, at: Moving, found: Loads, senses: Senses, solver: AbstractSolver) -> Batch:
    """A run without what is known of its rests."""
    xp = numpy_of(at)
    drives, good = drives_of(path.system), _is_good(at, found, solver)
    reached = xp.isfinite(at.q.reshape(len(path.t), -1)).all(axis=1)[:, None]
    rows = np.array([each.row for each in drives], int)
    run = Run(
        t=path.t,
        q=at.q,
        qd=at.qd * _moves(at.prescribed)[:, None],
        acceleration=at.acceleration,
        multipliers=found.multipliers[:, 0],
        friction=found.friction[:, 0],
        before=Moment(found.multipliers[:, 1], found.friction[:, 1]),
        result=RESULTS.successful,
        rates=at.prescribed[:, rows],
        determined=reached & ~found.depends[:, rows],
        determined_without_friction=reached & ~found.direct[:, rows],
        stays=xp.full((len(path.t), len(rows), 2), np.nan),
        weakest=at.weakest,
        drives=drives,
        names=path.system.names,
        joint_coordinates=path.system.joint_coordinates,
    )
    return Batch(run, good, senses)


def _moves(rates: Float[Numeric, "times m"]) -> Bool[Numeric, " times"]:
    """When it moves: where nothing is driven but by rounding all of it rests."""
    sizes = abs(rates)
    return ~(sizes <= tolerance_of(NOISE, sizes) * sizes.max(axis=0, initial=0.0)).all(axis=1)


@eqx.filter_jit  # one program of a derivative that is asked outside of programs
def _traced(path: Path, choices: tuple) -> tuple[Moving, Loads, Senses]:
    """How it moves at all times, and loads on both sides of each."""
    system, scale = path.given
    found, held = jax.vmap(lambda *at: moving(system, scale, *at))(path.q, path.t, path.beside)
    senses = senses_of(system, found.slips, scale.length)
    asked = found, held, path.t, senses.both, senses.rests
    return found, jax.vmap(lambda *at: loads(system, scale, choices, *at))(*asked), senses


@as_program
def _batch(system: AbstractSystem, scale: Scaling, choices: tuple, *at: Array) -> tuple[Moving, Loads]:
    """How it moves, and loads for one sense of each slip: NaN for its own; at times as `of_one` takes them."""

    def of_one(q: Array, t: Array, beside: Array, going: Array, sense: Array, rests: Array) -> tuple[Moving, Loads]:
        found, held = moving(system, scale, q, t, beside, going)
        sense = jnp.where(jnp.isnan(sense), signs_of(system, found.slips[0]), sense)
        return found, loads(system, scale, choices, found, held, t, sense[None], rests)

    return jax.vmap(of_one)(*at)


def _asked(
    path: Path, choices: tuple, at: np.ndarray, going: float, sense: np.ndarray, rests: Array | np.ndarray
) -> tuple[Moving, Loads]:
    """The batch at some of the times."""
    asked = (np.asarray(x)[at] for x in (path.q, path.t, path.beside))
    asked = *asked, np.full(len(at), going), sense, rests
    return in_batches(path, _batch, (*path.given, choices), asked)


def _on_numbers(path: Path, choices: tuple) -> tuple[Moving, Loads, Senses]:
    """The same of known numbers: where joints rest they are asked again, for both sides."""
    own = np.full((len(path.t), len(path.system.slips)), np.nan)
    found, one = _asked(path, choices, np.arange(len(path.t)), 1.0, own, np.zeros(own.shape, bool))
    senses = senses_of(path.system, found.slips, path.scale.length)

    def by_sense(found: Loads) -> dict[str, PyTree]:
        return {name: getattr(found, name) for name in ("multipliers", "friction", "progress")}

    both = jax.tree.map(lambda x: np.repeat(x, 2, axis=1), by_sense(one))
    rest = np.flatnonzero(senses.rests.any(axis=1))
    if rest.size:
        turns = rest[(senses.before != senses.after)[rest].any(axis=1)]
        at, sense = np.concatenate([rest, turns]), np.concatenate([senses.after[rest], senses.before[turns]])
        _, again = _asked(path, choices, at, 1.0, sense, senses.rests[at])
        for x, new in zip(*map(jax.tree.leaves, (both, by_sense(again))), strict=True):
            x[rest], x[turns, 1] = new[: rest.size], new[rest.size :, 0]
    return found, one._replace(**both), senses


def _of_joints_that_never_slip(system: AbstractSystem, senses: Senses) -> tuple[str, ...]:
    """What is to be said of friction that no motion gives a sense."""
    labels = list(itertools.compress(system.slips.labels, never_slip(system, senses)))
    names = ", ".join(f"tau {label}" for label in labels[:_NAMED])
    return (f"Friction of joints that do not slip at any of the times is taken as none: {names}.",) if names else ()


def drives_of(system: AbstractSystem) -> tuple[Drive, ...]:
    """Drivers among the joints, drives of speed, and coordinates that follow laws."""
    base, found = system.undriven, []
    labels, angular = system.rows.labels, system.rows.angular.tolist()
    if isinstance(base, Mechanism):
        for stack, names in zip(base.joints, base.names.joints, strict=True):
            driver = stack.element
            if isinstance(driver, _DRIVERS):
                law = getattr(driver, "distance", None)
                if isinstance(law, Polynomial) and law.coefficients.shape[-1] == 1:  # a rod or cable of constant length
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


def _is_good(at: Moving, found: Loads, solver: AbstractSolver) -> Bool[Array, " times"]:
    """At which times the batch has answered."""
    xp = numpy_of(found)
    good = (
        found.decided
        & (at.weakest > tolerance_of(_SINGULAR, at.qd))
        & (at.contradiction < tolerance_of(_CONTRADICTS, at.qd))
    )
    for x in (found.multipliers, found.friction, at.acceleration):
        good = good & xp.all(xp.isfinite(x.reshape(len(x), -1)), axis=1)
    if found.progress is not None:
        rtol = solver.tolerance(at.qd.dtype)
        good = good & xp.all(xp.asarray(found.progress.converged(rtol)), axis=1)
    return good


def _stays(path: Path, choices: tuple, at: Moving, senses: Senses) -> np.ndarray:
    """Forces of the drives between which the machine stays, where all of it rests: friction the one way and the other,
    nothing accelerates."""
    rows = np.array([each.row for each in drives_of(path.system)], int)
    out = np.full((len(path.t), len(rows), 2), np.nan)
    speed = np.abs(at.qd).max(axis=1)
    still = np.flatnonzero((speed <= tolerance_of(_STILL, speed) * np.nanmax(speed, initial=0.0)) & np.isfinite(speed))
    if still.size:
        ways = np.concatenate([senses.after[still], -senses.after[still]])
        found = _asked(path, choices, np.tile(still, 2), 0.0, ways, np.ones(ways.shape, bool))[1]
        forces = -found.multipliers[:, 0, rows].reshape(2, still.size, len(rows))
        out[still, :, 0], out[still, :, 1] = forces.min(axis=0), forces.max(axis=0)
    return out


def _masked(run: Run, good: Bool[Array, " times"]) -> Run:
    """Of traced numbers: NaN where there is no answer."""
    result = jax.vmap(lambda one: RESULTS.where(one, RESULTS.successful, RESULTS.not_finite))(good)

    def kept(x: Array) -> Array:
        return nan_where(~good[:, None], x)

    before = Moment(kept(run.before.multipliers), kept(run.before.friction))
    return replace_fields(
        run, multipliers=kept(run.multipliers), friction=kept(run.friction), before=before, result=result
    )


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
