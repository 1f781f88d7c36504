"""Assembly: a guessed position and velocity projected onto the constraint manifold.

    Phi(q [+] d, t) = 0 with small d,   Phi_q qd = -Phi_t with small change of qd            (2), (3)

`_closing` says how both are found, and `_dense_closing` and `_sparse_closing` where it begins.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import equinox as eqx
import jax
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._system._contact import rows_that_hold
from .._system._names import ByName, Names, index_of, vector
from .._system._state import State
from .._system._system import AbstractSystem, check_system
from .._tools._chunks import alike, with_derivative_of
from .._tools._compilation import compiled
from .._tools._derivatives import once
from .._tools._errors import RedundaxError
from .._tools._module import (
    as_float,
    check_kind,
    check_position,
    floats,
    is_concrete,
    numpy_of,
    on_device,
    one_number,
    replace_fields,
)
from .._tools._no_answer import nan_where
from .._tools._numbers import computed, on_numbers, stop_gradient, while_loop, xp
from ._closing import given_axis, position, velocity_of
from ._gaps import overlaps
from ._guess import ask_for_radians, check_finite
from ._matrices import matrices_of
from ._misfit import Misfit, tell
from ._parting import rows_of_velocity
from ._scaling import largest_violation
from ._unmet import check_rows, no_position, no_velocity


def assemble(
    system: AbstractSystem,
    q: ByName | None = None,
    qd: ByName = 0.0,
    t: ArrayLike = 0.0,
    *,
    positions: Mapping[str, ArrayLike] | None = None,
    rates: Mapping[str, ArrayLike] | None = None,
    closed: Sequence[str] | str = (),
    throw: bool | None = None,
) -> State:
    """The state on the constraint manifold (2), (3) nearest to a guess.

    ??? example

        ```python
        guess = state.q + 0.01
        closed = rx.assemble(mechanism, guess, positions={"1.phi": 0.8}, rates={"A.angle": 1.0})
        pin = rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
        rx.assemble(rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [pin]), {"rod.x": 0.5})  # all else is guessed as 0
        ```

    **Arguments:**

    - `system`: a `Mechanism` or `System`.
    - `q`, `qd`: guessed coordinates and velocities, as vectors or by name, as in `{"crank.phi": 0.5}`, 0 for those not
      named; a number for `qd` stands for all. Their order is that of `State`. A mechanism in space starts from the
      reference poses of its bodies if `q` is not given, which has no names there. A `qd` that leaves one-sided contacts
      does so if it is a velocity of the mechanism and no `rates` are given; beside these only what they leave opens.
    - `t`: time.
    - `positions`, `rates`: values that named coordinates must take, such as `{"crank.phi": 0.5}`, those of joints too,
      such as `{"K.travel": 0.02}`. Rates have the same names, or those of results, as in `{"crank.phi'": 1.0}`.
    - `closed`: names of one-sided contacts to close. Others with a gap at the guess stay open, unless they would
      overlap; those without one stay closed.
    - `throw`: whether to raise an error where no state is found; by default outside of `jit` and `vmap`.

    **Returns:** a `State`. Where no position is found it is NaN, and where no velocity is found that is; `state.result`
    says which, sample by sample under `jit` and `vmap`. Derivatives are NaN there too, unless a sample is masked by its
    result, as of `solve`. Freedoms that `positions` leave to the guess have derivatives of the smallest displacement
    that keeps the state closed, as if it had been the guess: give a position for each of them where that matters.
    Redundant constraints on points of few digits cannot be met exactly: the state then meets them as nearly as they
    allow, by least squares and as far as `solve` takes it, and outside of `jit` and `vmap` a warning tells the largest
    misfit, which is that of `solve`'s `stats.violation`.

    **Raises:** `RuntimeError` that names the rows that cannot be met.
    """
    check_system(system)
    n = len(system.coordinates)
    for name, value in (("positions", positions), ("rates", rates)):
        advice = f'Write {name}={{"{(given_axis(system.names).labels or ("K.travel",))[0]}": 0.1}}, say.'
        check_kind(name, {} if value is None else value, Mapping, "numbers by name", advice)
    positions, rates = dict(positions or {}), _without_prime("rates", rates or {})
    q = system.reference if q is None else q
    if isinstance(q, Mapping) and len(system.names.centres):
        raise RedundaxError(
            "Argument `q` must be a vector in space, where positions of bodies have no names, but is given by name. "
            "Leave it out to start from the reference poses, and give coordinates of joints as `positions`."
        )
    q = vector("q", q, system.coordinates, " of coordinates") if isinstance(q, Mapping) else as_float(q, "q")
    qd = _without_prime("qd", qd) if isinstance(qd, Mapping) else qd
    qd, t = vector("qd", qd, system.coordinates, " of coordinates"), as_float(t, "t")
    own = {x.dtype for x in jax.tree.leaves(system) if eqx.is_inexact_array(x)}
    one_number("t", t, "Call it for each, or use jax.vmap.")
    positions, rates = _each_a_number("positions", positions), _each_a_number("rates", rates)
    dtype, labels = xp.result_type(q, qd, *own), given_axis(system.names).labels
    held = [index_of("positions", name, labels, " of coordinates") for name in positions]
    driven = [index_of("rates", name, labels, " of coordinates") for name in rates]
    if system.adds:
        check_position(q, n)
    elif any(index < n for index in held) and q.shape != (n,):
        wrong = next(name for name, index in zip(positions, held, strict=True) if index < n)
        raise RedundaxError(
            f"Argument `positions` must name coordinates of joints, as positions of bodies have no names in space, but "
            f"holds {wrong!r}. There are {', '.join(system.names.joint_coordinates.labels) or 'none'}."
        )
    numbers = {"q": q, "qd": qd, "t": t}
    if throw is not False:
        check_finite(system.coordinates.labels, **numbers, positions=positions, rates=rates)
    angles = {name for name, angular in zip(labels, given_axis(system.names).angular.tolist(), strict=True) if angular}
    ask_for_radians(angles, system.coordinates.labels if system.adds else (), q, positions)
    np_ = numpy_of(numbers, positions, rates)  # NumPy, which compiles nothing, where all is known
    finite = np_.all(np_.stack([np_.all(np_.isfinite(value)) for value in numbers.values()]))
    guess = np_.where(finite, q, np_.nan), np_.broadcast_to(qd, (n,)), t
    given = (np_.stack([np_.zeros(()), *map(floats, values.values())])[1:] for values in (positions, rates))
    q, qd, t, at, rate = (on_device(np_.asarray(value, dtype)) for value in (*guess, *given))
    held, driven = (on_device(np.array(indices, int)) for indices in (held, driven))
    given = State(system.start(q, t), qd, t), held, at, driven, rate
    run = matrices_of(system).run(_assemble, _assemble_sparse)
    bare, moving, holding, shut = system.anonymous.without_friction, None, system, ()
    if system.names.one_sided:
        kept, moving = _rows_that_hold(system.names, bare, run, given, closed)
        bare, holding = bare.opened(kept), system.opened(kept)
        if is_concrete(kept):
            stay = np.asarray(kept)[list(system.names.one_sided)]
            shut = tuple(name for name, stays in zip(system.names.contacts, stay, strict=True) if stays)
    state, off, slow = run(bare, *given, moving)
    if is_concrete(off.refused) and is_concrete(slow.refused):
        off, slow = jax.device_get(stop_gradient((off, slow)))
        if off.refused and throw is not False:
            raise no_position(holding, check_rows(holding, q, t), off, tuple(positions), shut)
        if slow.refused and throw is not False:
            raise no_velocity(system.names, slow, tuple(rates))
        tell("position", off, (*system.rows.labels, *(f"{name} as given" for name in positions)))
        if not off.beyond.any():  # what the position misses the velocity does too
            tell("velocity", slow, (*system.rows.labels, *(f"{name} as given" for name in rates)))
    return state


@computed
def _rows_that_hold(
    names: Names,
    system: AbstractSystem,
    run: Callable[..., tuple[State, Misfit, Misfit]],
    given: tuple,
    closed: Sequence[str],
) -> tuple[Bool[Array, " m"], Bool[Array, " m"]]:
    """The rows that hold the position, all but contacts with a gap at the guess that stay open; and those that hold the
    velocity. No derivatives."""
    system, (start, *others) = stop_gradient((system, given))
    wanted = np.isin(names.contacts, _checked(closed, names.contacts))
    tolerance = largest_violation(start.qd.dtype)

    def body(kept: tuple[Array, Array]) -> tuple[Array, Array]:
        reached = overlaps(system, run(system.opened(rows_that_hold(names, kept[0], kept[0])), start, *others, None)[0])
        more = kept[0] | (reached > tolerance)
        return more, xp.any(more & ~kept[0])

    begins = overlaps(system, start)
    most = tolerance if wanted.any() else np.inf  # those that are wanted may push the others out
    first = xp.asarray(wanted) | ((begins > -tolerance) & (begins <= most))
    kept, _ = while_loop(lambda kept: kept[1], body, (first, xp.ones((), bool)))
    rows = rows_that_hold(names, kept, kept)
    at = replace_fields(start, q=run(system.opened(rows), start, *others, None)[0].q)

    def velocity(system: AbstractSystem) -> tuple[Array, Misfit]:
        return matrices_of(system).run(_velocity, _velocity_sparse)(system, at, *others[2:])

    return rows, rows_of_velocity(system, at, velocity, kept)


def _checked(closed: Sequence[str], contacts: tuple[str, ...]) -> Sequence[str]:
    """Names of contacts."""
    for name in [closed] if isinstance(closed, str) else closed:
        index_of("closed", name, contacts, " of one-sided contacts")
    return [closed] if isinstance(closed, str) else closed


def _each_a_number(argument: str, given: Mapping[str, ArrayLike]) -> dict[str, np.ndarray | Array]:
    numbers = {name: floats(value, argument) for name, value in given.items()}
    for name, value in numbers.items():
        if value.shape != ():
            raise RedundaxError(
                f"Argument `{argument}` must hold a number for each name, but {name!r} has shape {value.shape}. Let "
                "`jax.vmap` give one at a time."
            )
    return numbers


def _without_prime(argument: str, given: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
    """Rates by the names of coordinates, as they are given or with the prime that results have."""
    names = [str(name).removesuffix("'") for name in given]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RedundaxError(
            f"Argument `{argument}` must name each rate once, but holds {twice[0]} twice. Leave one out."
        )
    return dict(zip(names, given.values(), strict=True))


def _assembled(
    system: AbstractSystem,
    guess: State,
    held: Int[Array, " h"],
    positions: Float[Array, " h"],
    driven: Int[Array, " d"],
    rates: Float[Array, " d"],
    moving: Bool[Array, " m"] | None,
) -> tuple[State, Misfit, Misfit]:
    """State, and the misfits of its position and of its velocity, which `moving` holds, if other rows do."""
    q, off = position(matrices_of(system).closing.of(system, guess, held, positions))
    system = system if moving is None else system.opened(moving)
    qd, slow = _velocity(system, replace_fields(guess, q=q), driven, rates)
    found = replace_fields(guess, q=nan_where(off.refused, q), qd=nan_where(off.refused | slow.refused, qd))
    return found, off, slow


@with_derivative_of(_assembled, failed=lambda found: found[1].refused)
def _assembled_each(*arguments: PyTree) -> tuple[State, Misfit, Misfit]:
    return alike(_assembled(*arguments), eqx.filter(arguments, eqx.is_array))


def _velocity(system: AbstractSystem, state: State, driven: Array, rates: Array) -> tuple[Array, Misfit]:
    return velocity_of(matrices_of(system).closing, system, state, driven, rates)


_velocity_sparse = compiled(_velocity)
_assemble = on_numbers(_assembled_each, traced=partial(once, in_little_time=False))
_assemble_sparse = compiled(_assembled_each)
