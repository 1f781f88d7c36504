"""A traced function computed by NumPy, equation by equation: what runs a few times does not wait for a compiler.

The equations that JAX traces become a list of NumPy's functions, once: calls inside of others are opened, what depends
on no argument is computed at once, and what no result needs is left out. A function with an equation that has no rule
here, such as a loop or a factor of a matrix, remains a program.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.core
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

Computed = Callable[..., Any]
Parameters = dict[str, Any]
Shapes = list[jax.core.ShapedArray]  # of what an equation takes and gives, with types


class NoRuleError(Exception):
    """NumPy does not compute an equation."""


class Interpreted:
    """The function of NumPy's arrays, one by one, that equations say."""

    def __init__(self, closed: ClosedJaxpr):
        if any(isinstance(x, jax.core.Tracer) for x in closed.consts):
            raise NoRuleError
        self._values: list[Any] = []  # those that are known at once, None of others
        self._steps: list[tuple[Computed, tuple[int, ...], tuple[int, ...], tuple[int, ...]]] = []
        self._large: set[int] = set()  # places of arrays that are let go as soon as no step takes them
        given = [self._place() for _ in closed.jaxpr.invars]
        self._given = len(given)
        self._results = self._opened(closed.jaxpr, closed.consts, given)
        needed, steps = set(self._results), []
        for function, taken, made, _ in reversed(self._steps):
            if needed.intersection(made):
                steps.append((function, taken, made, tuple(k for k in {*taken} - needed if k in self._large)))
                needed.update(taken)
        self._steps = steps[::-1]

    def __call__(self, given: Sequence[Any]) -> list[np.ndarray]:
        values = self._values.copy()
        values[: self._given] = given
        for function, taken, made, last in self._steps:
            out = function(*[values[k] for k in taken])
            if len(made) == 1:
                values[made[0]] = out
            else:
                for k, x in zip(made, out, strict=True):
                    values[k] = x
            for k in last:
                values[k] = None
        return [np.array(values[k]) for k in self._results]

    def _place(self, value: Any = None) -> int:
        self._values.append(value)
        return len(self._values) - 1

    def _opened(self, jaxpr: Jaxpr, consts: Sequence[Any], given: Sequence[int]) -> list[int]:
        """Steps of the equations, and the places of their results."""
        places: dict[Any, int] = dict(zip(jaxpr.invars, given, strict=True))
        places |= {var: self._place(np.asarray(x)) for var, x in zip(jaxpr.constvars, consts, strict=True)}

        def place(atom: Any) -> int:
            if isinstance(atom, Literal):
                return self._place(np.asarray(atom.val, atom.aval.dtype))  # pyright: ignore[reportAttributeAccessIssue]
            return places[atom]

        for equation in jaxpr.eqns:
            taken, name = [place(atom) for atom in equation.invars], equation.primitive.name
            if name in _CALLS:
                inner = equation.params[_CALLS[name]]
                body, held = (inner.jaxpr, inner.consts) if isinstance(inner, ClosedJaxpr) else (inner, ())
                made = self._opened(body, held, taken)
            elif name in _RULES:
                shapes = [[x.aval for x in group] for group in (equation.invars, equation.outvars)]
                if any(getattr(x, "dtype", None) not in _TYPES for group in shapes for x in group):
                    raise NoRuleError
                made = self._made(_RULES[name](equation.params, *shapes), taken, len(equation.outvars))
                self._large.update(k for k, x in zip(made, shapes[1], strict=True) if getattr(x, "size", 0) > _LARGE)
            else:
                raise NoRuleError(name)
            places |= dict(zip(equation.outvars, made, strict=True))
        return [place(atom) for atom in jaxpr.outvars]

    def _made(self, function: Computed, taken: list[int], count: int) -> list[int]:
        """Places of what a step gives, which is computed now if all it takes is known."""
        known = [self._values[k] for k in taken]
        if any(x is None for x in known):
            made = [self._place() for _ in range(count)]
            self._steps.append((function, tuple(taken), tuple(made), ()))
            return made
        with np.errstate(all="ignore"):
            found = function(*known)
        return [self._place(x) for x in ([found] if count == 1 else found)]


_LARGE = 10_000  # entries, some 80 kB: what is smaller is not worth the time of letting go
_TYPES = {*map(np.dtype, ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"))}
_TYPES |= {*map(np.dtype, ("float32", "float64"))}
_CALLS = {  # the parameter that holds the equations of a call
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "closed_call": "call_jaxpr",
    "core_call": "call_jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "remat2": "jaxpr",
}


def _as_it_is(function: Computed) -> Callable[..., Computed]:
    """A function of arrays without parameters."""
    return lambda parameters, of, to: function


def _of_floats(function: Computed) -> Callable[..., Computed]:
    """A function of floating-point numbers; whole ones have rules of their own beside 0."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        if not np.issubdtype(to[0].dtype, np.floating):
            raise NoRuleError
        return function

    return rule


def _along(reduce: Any) -> Callable[..., Computed]:
    """A reduction along axes, which keeps the type."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        axes, dtype = tuple(parameters["axes"]), to[0].dtype
        if reduce in (np.logical_and, np.logical_or) and dtype != np.dtype(bool):
            raise NoRuleError
        if reduce is np.add or reduce is np.multiply:
            return lambda x: reduce.reduce(x, axis=axes, dtype=dtype)
        return lambda x: reduce.reduce(x, axis=axes)

    return rule


def _cumulated(accumulate: Computed) -> Callable[..., Computed]:
    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        axis, dtype = parameters["axis"], to[0].dtype
        if not parameters["reverse"]:
            return lambda x: accumulate(x, axis=axis, dtype=dtype)
        return lambda x: np.flip(accumulate(np.flip(x, axis), axis=axis, dtype=dtype), axis)

    return rule


def _broadcast(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape, size, before = to[0].shape, to[0].size, of[0]
    between = [1] * len(shape)
    for axis, length in zip(parameters["broadcast_dimensions"], before.shape, strict=True):
        between[axis] = length
    if before.size == size:
        return lambda x: x.reshape(shape)
    dtype = to[0].dtype

    def broadcast(x: Any) -> np.ndarray:
        out = np.empty(shape, dtype)
        out[...] = x.reshape(between)
        return out

    return broadcast


def _reshape(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape = to[0].shape
    return lambda x: x.reshape(shape)


def _transpose(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    order = tuple(parameters["permutation"])
    return lambda x: x.transpose(order)


def _slice(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    first, last = parameters["start_indices"], parameters["limit_indices"]
    steps = parameters["strides"] or (None,) * len(first)
    part = tuple(slice(*each) for each in zip(first, last, steps, strict=True))
    return lambda x: x[part]


def _dynamic_slice(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    sizes, most = (
        parameters["slice_sizes"],
        [a - b for a, b in zip(of[0].shape, parameters["slice_sizes"], strict=True)],
    )

    def part(x: Any, *first: Any) -> Any:
        begins = [min(max(int(k), 0), last) for k, last in zip(first, most, strict=True)]
        return x[tuple(slice(k, k + size) for k, size in zip(begins, sizes, strict=True))]

    return part


def _concatenate(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    axis = parameters["dimension"]
    return lambda *parts: np.concatenate(parts, axis)


def _stack(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    axis = parameters["axis"]
    return lambda *parts: np.stack(parts, axis)


def _unstack(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    axis, count = parameters["axis"], len(to)

    def unstack(x: Any) -> Any:
        parts = np.moveaxis(x, axis, 0)
        return parts[0] if count == 1 else list(parts)

    return unstack


def _tile(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    repeats = tuple(parameters["reps"])
    return lambda x: np.tile(x, repeats)


def _split(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    places, axis, count = np.cumsum(parameters["sizes"])[:-1], parameters["axis"], len(to)

    def split(x: Any) -> Any:
        parts = np.split(x, places, axis)
        return parts[0] if count == 1 else parts

    return split


def _pad(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape, dtype, config = to[0].shape, to[0].dtype, parameters["padding_config"]
    if any(low < 0 or high < 0 for low, high, _ in config):
        raise NoRuleError
    inner = tuple(
        slice(low, low + (size - 1) * (between + 1) + 1 if size else low, between + 1)
        for (low, _, between), size in zip(config, of[0].shape, strict=True)
    )

    def pad(x: Any, value: Any) -> np.ndarray:
        out = np.empty(shape, dtype)
        out[...] = value
        out[inner] = x
        return out

    return pad


def _convert(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    dtype = to[0].dtype
    if np.issubdtype(of[0].dtype, np.floating) and np.issubdtype(dtype, np.integer):
        raise NoRuleError  # where each has its own of NaN and of what is too large
    return lambda x: x.astype(dtype)


def _iota(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape = to[0].shape
    one = _counted(shape, parameters["dimension"]).astype(to[0].dtype)
    return lambda: np.broadcast_to(one, shape)


def _select(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    if of[0].dtype != bool or len(of) != 3:
        raise NoRuleError
    return lambda which, no, yes: np.where(which, yes, no)


def _clamp(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    return lambda least, x, most: np.minimum(np.maximum(x, least), most)


def _integer_power(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    power = parameters["y"]
    if power == 2:
        return np.square
    return lambda x: x**power if power >= 0 else 1 / x**-power


def _round(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    if int(parameters["rounding_method"]) != 1:  # halves away from zero
        return lambda x: np.trunc(x) + np.copysign(np.abs(x - np.trunc(x)) >= 0.5, x)
    return np.rint


def _dot(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    ((left, right), (left_batch, right_batch)) = parameters["dimension_numbers"]
    a, b, shape, dtype = *of, to[0].shape, to[0].dtype
    if a.dtype != b.dtype or a.dtype != dtype:
        raise NoRuleError
    left_free = [k for k in range(a.ndim) if k not in left and k not in left_batch]
    right_free = [k for k in range(b.ndim) if k not in right and k not in right_batch]
    batch = [a.shape[k] for k in left_batch]
    inner = int(np.prod([a.shape[k] for k in left], dtype=int))
    order = ([*left_batch, *left_free, *left], [*right_batch, *right, *right_free])
    shapes = ((*batch, -1, inner), (*batch, inner, -1))
    if not a.size or not b.size:
        return lambda x, y: np.zeros(shape, dtype)

    def dot(x: Any, y: Any) -> np.ndarray:
        x, y = (each.transpose(axes).reshape(to) for each, axes, to in zip((x, y), order, shapes, strict=True))
        return np.matmul(x, y).reshape(shape)

    return dot


def _counted(shape: Sequence[int], axis: int) -> np.ndarray:
    """0, 1, 2, ... along an axis."""
    return np.arange(shape[axis]).reshape([-1 if k == axis else 1 for k in range(len(shape))])


def _entries(numbers: Any, operand: Any, sizes: Sequence[int], within: Sequence[int], mode: Any) -> Computed:
    """Where slices of an array at given places are in it, number by number.

    `within` are the axes of slices among those of what is read or set, and `sizes` those of slices.
    """
    along, without, batched, batches = numbers
    kept = [k for k in range(operand.ndim) if k not in without and k not in batched]
    strides = np.cumprod([1, *operand.shape[:0:-1]])[::-1]
    most = np.subtract(operand.shape, sizes)[list(along)]

    def entries(places: np.ndarray) -> np.ndarray:
        if places.size and ((places < 0) | (places > most)).any():
            if "FILL" in str(mode):
                raise NoRuleError
            places = np.clip(places, 0, most)
        begins = places.astype(np.intp) @ strides[list(along)]
        for k, axis in zip(batched, batches, strict=True):
            begins = begins + strides[k] * _counted(begins.shape, axis)
        out = np.expand_dims(begins, tuple(within))
        for axis, k in zip(within, kept, strict=True):
            out = out + strides[k] * _counted((*out.shape[:axis], sizes[k], *out.shape[axis + 1 :]), axis)
        return out

    last: list[tuple[Any, Any]] = [(None, None)]

    def same(places: np.ndarray) -> np.ndarray:
        known, found = last[0]
        if places is not known:  # most are constants
            last[0] = places, found = places, entries(places)
        return found

    return same


def _gather(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    numbers, sizes = parameters["dimension_numbers"], parameters["slice_sizes"]
    batches = numbers.operand_batching_dims, numbers.start_indices_batching_dims
    axes = numbers.start_index_map, numbers.collapsed_slice_dims, *batches
    entries = _entries(axes, of[0], sizes, [*map(int, numbers.offset_dims)], parameters["mode"])
    return lambda x, places: x.take(entries(places))


def _scatter(setting: Computed, equations: list[str]) -> Callable[..., Computed]:
    """Entries set, or combined by one equation."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        combined = parameters["update_jaxpr"]
        if combined is not None and [each.primitive.name for each in combined.eqns] != equations:
            raise NoRuleError
        if combined is not None and not equations and combined.outvars[0] is not combined.invars[1]:
            raise NoRuleError
        numbers, (operand, _, updates) = parameters["dimension_numbers"], of
        within, without = [*map(int, numbers.update_window_dims)], numbers.inserted_window_dims
        window = iter([updates.shape[k] for k in within])
        batches = numbers.operand_batching_dims, numbers.scatter_indices_batching_dims
        sizes = [1 if k in without or k in batches[0] else next(window) for k in range(operand.ndim)]
        axes = numbers.scatter_dims_to_operand_dims, without, *batches
        entries = _entries(axes, operand, sizes, within, parameters["mode"])

        def scatter(x: Any, places: Any, new: Any) -> np.ndarray:
            out = np.array(x, order="C")  # so that its entries in one row are no copy
            setting(out.reshape(-1), entries(places), new)
            return out

        return scatter

    return rule


def _set(x: np.ndarray, places: Any, new: Any) -> None:
    x[places] = new


def _power(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    dtype = to[0].dtype
    return lambda x, y: np.power(x, y).astype(dtype)


def _reversed(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    axes = tuple(parameters["dimensions"])
    return lambda x: np.flip(x, axes)


def _place_of(extreme: Computed) -> Callable[..., Computed]:
    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        (axis,), dtype = parameters["axes"], to[0].dtype
        return lambda x: extreme(x, axis).astype(dtype)

    return rule


_RULES: dict[str, Callable[..., Computed]] = {
    **{
        name: _as_it_is(function)
        for name, function in {
            "abs": np.abs,
            "acos": np.arccos,
            "acosh": np.arccosh,
            "add": np.add,
            "add_any": np.add,
            "and": np.bitwise_and,
            "asin": np.arcsin,
            "asinh": np.arcsinh,
            "atan": np.arctan,
            "atan2": np.arctan2,
            "atanh": np.arctanh,
            "cbrt": np.cbrt,
            "ceil": np.ceil,
            "copy": np.array,
            "copy_p": np.array,
            "cos": np.cos,
            "cosh": np.cosh,
            "eq": np.equal,
            "exp": np.exp,
            "exp2": np.exp2,
            "expm1": np.expm1,
            "floor": np.floor,
            "ge": np.greater_equal,
            "gt": np.greater,
            "is_finite": np.isfinite,
            "le": np.less_equal,
            "log": np.log,
            "log1p": np.log1p,
            "lt": np.less,
            "max": np.maximum,
            "min": np.minimum,
            "mul": np.multiply,
            "ne": np.not_equal,
            "neg": np.negative,
            "not": np.invert,
            "or": np.bitwise_or,
            "sign": np.sign,
            "sin": np.sin,
            "sinh": np.sinh,
            "sqrt": np.sqrt,
            "square": np.square,
            "sub": np.subtract,
            "tan": np.tan,
            "tanh": np.tanh,
            "xor": np.bitwise_xor,
        }.items()
    },
    "argmax": _place_of(np.argmax),
    "argmin": _place_of(np.argmin),
    "broadcast_in_dim": _broadcast,
    "clamp": _clamp,
    "concatenate": _concatenate,
    "convert_element_type": _convert,
    "cummax": _cumulated(np.maximum.accumulate),
    "cumprod": _cumulated(np.multiply.accumulate),
    "cumsum": _cumulated(np.add.accumulate),
    "div": _of_floats(np.divide),
    "dot_general": _dot,
    "dynamic_slice": _dynamic_slice,
    "expand_dims": _reshape,
    "gather": _gather,
    "integer_pow": _integer_power,
    "iota": _iota,
    "logistic": _as_it_is(lambda x: 1 / (1 + np.exp(-x))),
    "pad": _pad,
    "pow": _power,
    "reduce_and": _along(np.logical_and),
    "reduce_max": _along(np.maximum),
    "reduce_min": _along(np.minimum),
    "reduce_or": _along(np.logical_or),
    "reduce_prod": _along(np.multiply),
    "reduce_sum": _along(np.add),
    "rem": _of_floats(np.fmod),
    "reshape": _reshape,
    "rev": _reversed,
    "round": _round,
    "rsqrt": _as_it_is(lambda x: 1 / np.sqrt(x)),
    "scatter": _scatter(_set, []),
    "scatter-add": _scatter(np.add.at, ["add"]),
    "select_n": _select,
    "slice": _slice,
    "split": _split,
    "squeeze": _reshape,
    "stack": _stack,
    "tile": _tile,
    "transpose": _transpose,
    "unstack": _unstack,
}
