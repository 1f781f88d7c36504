"""Small helpers: fields that do not retrace, functions in pytrees, copies of frozen modules, safe norms, conditions
of a whole batch."""

import contextlib
import dataclasses
import functools
import inspect
import operator
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import ModuleType, UnionType
from typing import Any, SupportsIndex, TypeVar, cast

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike, DTypeLike
from jaxtyping import Array, Bool, Float, Integer, Num, PyTree

from ._compilation import is_loopless
from ._errors import RedundaxError
from ._functions import Function, as_functions
from ._numbers import are_numbers, or_one
from ._words import short, warn

T = TypeVar("T")
N = TypeVar("N", bound=str | int)


# What users may write for an array: lists of numbers too.
Numbers = ArrayLike | Sequence[Any]


def as_float(value: Numbers, argument: str = "") -> Array:
    """`value` as a floating-point array; the dtype follows the input, integers take the default.

    Where it is none the error names the `argument`, if that is known.
    """
    if isinstance(value, jax.Array) and is_concrete(value) and value.dtype == _float_type(value):
        return value
    return on_device(floats(value, argument))


@functools.cache
def _tell_of_single_precision() -> None:
    """Once: it is a setting of the process."""
    warn(
        "redundax works in float32, about 7 digits, as JAX does unless told otherwise, and has just cut numbers of "
        "more digits. Put jax.config.update('jax_enable_x64', True) at the start, before a mechanism is built; or give "
        "float32 arrays where single precision is wanted."
    )


def floats(value: object, argument: str = "") -> np.ndarray | Array:
    """`value` as floating-point numbers: in NumPy, which compiles nothing, where they are known, else traced."""
    try:
        array = numpy_of(value).asarray(value)
    except ValueError:  # lists of several lengths
        array = np.asarray(None)
    if array.dtype.kind in "OSUc":  # objects, words and complex numbers
        raise RedundaxError(
            f"{f'Argument `{argument}`' if argument else 'A figure'} must be a number, or a list of numbers, but is "
            f"{short(value)}. Give it without a unit: `units=` of a mechanism states that of all."
        )
    found = array.astype(_float_type(array))
    if found.dtype == np.float32 and found.dtype != array.dtype and is_concrete(found) and np.any(array != found):
        _tell_of_single_precision()
    return found


def _float_type(array: np.ndarray | Array) -> np.dtype:
    if isinstance(array, np.ndarray):
        return _float_types(array.dtype, jax.config.jax_enable_x64)  # pyright: ignore[reportAttributeAccessIssue]
    return jnp.result_type(array, float)


@functools.cache
def _float_types(dtype: np.dtype, _wide: bool) -> np.dtype:  # as JAX takes tens of microseconds to say
    return jnp.result_type(np.empty(0, dtype), float)


def numpy_of(*values: PyTree) -> ModuleType:
    """NumPy where all values are known, and else `jax.numpy`: of the same names."""
    return np if all(map(is_concrete, jax.tree.leaves(values))) else jnp


def on_device(array: np.ndarray | Array) -> Array:
    """`array` for JAX, at once, even where something else is traced: nothing is compiled for it."""
    if isinstance(array, jax.core.Tracer):
        return array
    with jax.core.eval_context():
        return jax.device_put(array)


def figure(argument: str) -> Callable[[Numbers], Array]:
    """`as_float` as the converter of a field, which is the `argument` of that name."""
    return functools.partial(as_float, argument=argument)


def optional_figure(argument: str) -> Callable[[Numbers | None], Array | None]:
    """`figure` that leaves `None` alone."""
    return functools.partial(optional_float, argument=argument)


def optional_float(value: Numbers | None, argument: str = "") -> Array | None:
    """`as_float` that leaves `None` alone."""
    return None if value is None else as_float(value, argument)


def as_parameters(tree: PyTree) -> PyTree:
    """The pytree with its numbers as arrays, each of its own kind."""
    try:
        return jax.tree.map(jnp.asarray, as_functions(tree))
    except TypeError as error:  # of words and other objects
        raise RedundaxError(
            f"Argument `parameters` must hold numbers, arrays and functions alone, but: {error} Leave out what is "
            "none, or let the functions close over it."
        ) from error


def cores() -> int:
    """Cores of the CPU that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # not on all platforms
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def is_concrete(value: object) -> bool:
    """Whether the value is there to be checked, not traced."""
    return not isinstance(value, jax.core.Tracer)


@contextlib.contextmanager
def tracing(argument: str) -> Iterator[None]:
    """Say what to do where a function of the user, traced within, takes its numbers for those of Python."""
    try:
        yield
    except (
        jax.errors.ConcretizationTypeError,
        jax.errors.TracerArrayConversionError,
        jax.errors.TracerIntegerConversionError,
    ) as error:
        raise RedundaxError(
            f"Argument `{argument}` must be a function that JAX can trace, but math.sin, np.sin, float() or an `if` in "
            "it wants a known number. Write it with jax.numpy: jnp.sin, jnp.where."
        ) from error
    except TypeError as error:
        if "not a valid JAX type" not in str(error):  # as of text that a function of `jax.jit` gives
            raise
        raise RedundaxError(f"Argument `{argument}` must give numbers, but {error}. Return those alone.") from error


def is_real(value: object, shape: tuple[int, ...] = ()) -> bool:
    """Whether what `eqx.filter_eval_shape` found is real numbers of a shape; truth values count as 0 and 1."""
    if isinstance(value, jax.ShapeDtypeStruct | np.ndarray | np.generic):
        kinds = jnp.floating, jnp.integer, jnp.bool
        return value.shape == shape and any(jnp.issubdtype(value.dtype, kind) for kind in kinds)
    return not shape and isinstance(value, int | float)


def check_takes(argument: str, function: object, *given: str) -> None:
    """Refuse a function of the user that does not take what it will be given, one after the other."""
    function = check_callable(argument, function)
    try:
        wanted = inspect.signature(function.function if isinstance(function, Function) else function)
    except (TypeError, ValueError):  # of a compiled function, which does not tell
        return
    try:
        wanted.bind(*given)
    except TypeError:
        raise RedundaxError(
            f"Argument `{argument}` must be a function of ({', '.join(given)}), but is one of "
            f"({', '.join(wanted.parameters)}). Give it these arguments, in this order."
        ) from None


def check_callable(argument: str, function: object) -> Callable[..., object]:
    """The same; what is no function is refused."""
    if callable(function):
        return function
    raise RedundaxError(f"Argument `{argument}` must be a function, but is {short(function)}. Give one by its name.")


def check_call(name: str, function: Callable[..., object], *arguments: object, **named: object) -> None:
    """Refuse arguments that a function of the user does not take."""
    check_callable(name, function)
    wanted = inspect.signature(function.function if isinstance(function, Function) else function)
    try:
        wanted.bind(*arguments, **named)
    except TypeError as error:
        raise RedundaxError(
            f"Arguments of `{name}` must be {', '.join(wanted.parameters)}, but: {error}. Give these."
        ) from error


@contextlib.contextmanager
def part(owner: str) -> Iterator[None]:
    """Say of which part an argument is that is refused within."""
    try:
        yield
    except RedundaxError as error:
        raise RedundaxError(str(error).replace("` must", f"` of {owner} must", 1)) from None


def check_kind(argument: str, value: object, kind: type | tuple[type, ...] | UnionType, what: str, advice: str) -> None:
    """Refuse what is not of a kind, such as a class where one of its objects is wanted.

    `what` says what the argument must be, `advice` what may be given.
    """
    if isinstance(value, type):
        raise RedundaxError(
            f"Argument `{argument}` must be an object, but is the class {value.__name__}. "
            f"Write `{value.__name__}(...)`, with its arguments if it needs some."
        )
    if not isinstance(value, kind):
        is_short = value is None or isinstance(value, str | int | float | complex)
        shown = repr(value) if is_short else f"of the type {type(value).__name__}"
        shown = f"an array of shape {value.shape}" if isinstance(value, jax.Array | np.ndarray) else shown
        raise RedundaxError(f"Argument `{argument}` must be {what}, but is {shown}. {advice}")


def check_word(argument: str, value: object) -> None:
    """Refuse a name that is no text."""
    check_kind(argument, value, str, "a word", "Give text in quotes.")


def check_whole(least: int, **numbers: object) -> None:
    """Refuse what is no whole number from the least on."""
    for argument, value in numbers.items():
        try:
            is_good = (
                isinstance(value, SupportsIndex) and not isinstance(value, bool) and operator.index(value) >= least
            )
        except TypeError:  # of an array of several, or of numbers that are not whole
            is_good = False
        if not is_good:
            raise RedundaxError(
                f"Argument `{argument}` must be a whole number from {least} on, but is {short(value)}. Give an integer."
            )


def check_seed(seed: object) -> None:
    """Refuse what no random numbers of NumPy begin with."""
    try:
        np.random.default_rng(seed)  # pyright: ignore[reportArgumentType, reportCallIssue]
    except (TypeError, ValueError) as error:
        raise RedundaxError(
            f"Argument `seed` must be a whole number from 0 on, but is {short(seed)}. Give an integer."
        ) from error


def names_in(argument: str, value: Iterable[N]) -> list[N]:
    """Names, or their numbers, of which a single name may stand by itself."""
    if not isinstance(value, Iterable):
        raise RedundaxError(
            f"Argument `{argument}` must hold names, but is {short(value)}. Write them in quotes, as a list."
        )
    return [cast(N, value)] if isinstance(value, str) else list(value)


def moved(q: Array, d: Array) -> Array:
    """q + d, for coordinates that add."""
    check_position(q, d.size)
    return q + d


def check_position(q: Array, n: int) -> None:
    """Refuse a position that is not one number for each of n coordinates."""
    if q.shape != (n,):
        raise RedundaxError(
            f"Argument `q` must have shape ({n},), one number for each coordinate, but has {q.shape}. Give them in "
            "the order of `system.coordinates`, and use jax.vmap for many positions."
        )


def replace_fields(module: T, **fields: object) -> T:
    """A copy of the frozen `module` with the given fields replaced, without running its `__init__`."""
    copy = object.__new__(type(module))
    for field in dataclasses.fields(module):  # pyright: ignore[reportArgumentType]
        object.__setattr__(copy, field.name, fields.get(field.name, getattr(module, field.name)))
    return copy


_FEW = 2_000  # numbers that a product chooses from in the time that a loop takes for a turn


def tree_take(stacked: T, members: Integer[Array, "..."]) -> T:
    """Some members of what is stacked; the indices, ours, are in bounds, and nothing is traced that checks them."""
    return jax.tree.map(
        lambda x: jnp.asarray(x).at[members].get(mode="promise_in_bounds", wrap_negative_indices=False), stacked
    )


def tree_pick(stacked: T, members: Integer[Array, " some"]) -> T:
    """`tree_take` of numbers of which all may be NaN where one is: a product, where loops are to be avoided."""

    def picked(x: Array) -> Array:
        if not (is_loopless() and x.size <= _FEW):
            return tree_take(x, members)
        return _product(ones_at(members, len(x), x.dtype), x, 1)

    return jax.tree.map(picked, stacked)


def tree_add(totals: T, members: Integer[Array, " some"], parts: T) -> T:
    """Totals of what is stacked, with the parts of some members added; as `tree_pick`."""

    def added(total: Array, part: Array) -> Array:
        if not (is_loopless() and part.size <= _FEW):
            return total.at[members].add(part)
        return total + _product(ones_at(members, len(total), part.dtype), part, 0)

    return jax.tree.map(added, totals, parts)


def ones_at(members: Integer[Array, "..."], size: int, dtype: DTypeLike) -> Num[Array, "... size"]:
    """Rows of the unit matrix."""
    return jnp.asarray(jnp.expand_dims(members, -1) == jnp.arange(size, dtype=members.dtype), dtype)


def _product(ones: Num[Array, "some size"], x: Array, axis: int) -> Array:
    flat = x.reshape(len(x), -1)
    out = jax.lax.dot_general(ones, flat, (((axis,), (0,)), ((), ())), precision="highest")
    return out.reshape(-1, *x.shape[1:])


def as_matrix(argument: str, value: Numbers, size: int, owner: str = "") -> Float[Array, "size size"]:
    """A square matrix, given whole, by its diagonal or as one number for all of that."""
    array = floats(value, argument)
    if array.shape not in ((), (size,), (size, size)):
        raise RedundaxError(
            f"Argument `{argument}`{owner and f' of {owner}'} must be a number or have shape ({size},) or "
            f"({size}, {size}), but has {array.shape}. Give one number for all directions, one for each, or a matrix."
        )
    finite(argument, array, owner)
    return on_device(array if array.ndim == 2 else array * numpy_of(array).eye(size, dtype=array.dtype))


def one_number(name: str, value: Array | np.ndarray, advice: str = "Make one part for each.") -> None:
    """Refuse several numbers for one."""
    if value.shape != ():
        raise RedundaxError(f"Argument `{name}` must be a number, but has shape {value.shape}. {advice}")


def not_negative(name: str, value: Array) -> None:
    """Refuse a negative number; one that is NaN gives results that say so."""
    if is_concrete(value) and np.any(np.asarray(value) < 0):
        raise RedundaxError(f"Argument `{name}` must not be negative, but is {value}. Give a number from 0 on.")


def positive(name: str, value: Array | np.ndarray) -> None:
    """Refuse a number that is not positive; one that is NaN gives results that say so."""
    if is_concrete(value) and np.any(np.asarray(value) <= 0):
        raise RedundaxError(f"Argument `{name}` must be positive, but is {value}. Give a number above 0.")


def finite(name: str, value: Array | np.ndarray, owner: str = "") -> None:
    """Refuse NaN and infinity among known numbers."""
    if is_concrete(value) and not np.all(np.isfinite(value)):
        raise RedundaxError(
            f"Argument `{name}`{owner and f' of {owner}'} must be finite, but is {np.asarray(value).tolist()}. Look "
            "for NaN or infinity in what it is computed from."
        )


def unit(argument: str) -> Callable[[Numbers], Array]:
    """v / |v| as the converter of a field, which is the `argument` of that name."""

    def converted(given: Numbers) -> Array:
        v = floats(given, argument)
        size = numpy_of(v).linalg.norm(v)
        if is_concrete(size) and size == 0:
            raise RedundaxError(
                f"Argument `{argument}` must not be zero: it gives the direction of a line, but is (0, 0)."
            )
        return on_device(v / size)

    return converted


@jax.custom_jvp
def safe_norm(v: Float[Array, "n *columns"]) -> Float[Array, "*columns"]:  # noqa: F821 (axes are no names)
    """|v| with derivative 0 at v = 0, column by column; `hypot` has a spurious value there and sqrt NaN."""
    entries = [v[k] for k in range(v.shape[0])]  # not `v @ v`: a batch lays entries side by side
    return jnp.sqrt(functools.reduce(operator.add, [x * x for x in entries]))


@safe_norm.defjvp
def _safe_norm_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    v, size = primals[0], safe_norm(*primals)  # d|v| = v . dv / |v|
    divisor = or_one(size)
    return size, functools.reduce(operator.add, [v[k] / divisor * tangents[0][k] for k in range(v.shape[0])])


def or_zeros(tangents: T, like: T) -> T:
    """Tangents, zeros where nothing that moves is in what they are of."""
    return jax.tree.map(lambda x, dot: jnp.zeros_like(x) if dot is None else dot, like, tangents)


def batch_any(flag: Bool[Array, ""]) -> Bool[Array, ""]:
    """Whether it is so for any sample of a batch; a condition that does not depend on the sample is not a selection."""
    return flag if are_numbers(flag) else _batch_any(flag)


@jax.custom_batching.custom_vmap
def _batch_any(flag: Array) -> Array:
    return flag


@_batch_any.def_vmap
def _any_in_batch(size: int, batched: list[bool], flag: Bool[Array, " size"]) -> tuple[Bool[Array, ""], bool]:
    return _batch_any(jnp.any(flag, axis=0)), False
