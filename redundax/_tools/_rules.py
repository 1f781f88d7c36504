"""What NumPy does for an equation that JAX has traced, by the name of the equation's function.

A rule gives a function of arrays, from the parameters of an equation and the shapes of what it takes and gives. Arrays
that are given stay as they are.
"""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.core import ShapedArray

from ._rule import AtPlaces, Computed, Entries, NoRuleError, Parameters, Shapes, clamped
from ._rules_of_factors import cholesky, eigh, lu_factors, lu_permutation, or_nan, qr, svd, triangular_solve


def _as_it_is(function: Computed) -> Callable[..., Computed]:
    """A function of arrays without parameters."""
    return lambda parameters, of, to: function


def _by(name: str, bound: Callable[..., Computed]) -> Callable[..., Computed]:
    """What one parameter of an equation makes of its arrays."""
    return lambda parameters, of, to: bound(parameters[name])


def _divided(function: Computed) -> Callable[..., Computed]:
    """A quotient or remainder; of whole numbers towards 0, and by 0 as XLA has it: -1, and the number itself."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        if np.issubdtype(to[0].dtype, np.floating):
            return function
        one, is_remainder = np.ones((), to[0].dtype), function is np.fmod

        def whole(x: Entries, y: Entries) -> Entries:
            rest = np.fmod(x, np.where(y == 0, one, y))
            found = rest if is_remainder else (x - rest) // np.where(y == 0, one, y)
            return np.where(y == 0, x if is_remainder else np.invert(one - one), found)

        return whole

    return rule


def _ends(dtype: np.dtype) -> tuple[float, float]:
    """The least and the largest number of a type."""
    if np.issubdtype(dtype, np.bool_):
        return False, True
    return (-np.inf, np.inf) if np.issubdtype(dtype, np.floating) else (np.iinfo(dtype).min, np.iinfo(dtype).max)


def _along(reduce: Any) -> Callable[..., Computed]:
    """A reduction along axes, which keeps the type."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        axes, dtype = tuple(parameters["axes"]), to[0].dtype
        if reduce in (np.logical_and, np.logical_or) and dtype != np.dtype(bool):
            raise NoRuleError
        if reduce is np.add or reduce is np.multiply:
            return lambda x: reduce.reduce(x, axis=axes, dtype=dtype)
        if not of[0].size and reduce in (np.maximum, np.minimum):
            of_none = np.array(_ends(dtype)[reduce is np.minimum], dtype)
            return lambda x: np.full(to[0].shape, of_none)
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

    def broadcast(x: Entries) -> np.ndarray:
        out = np.empty(shape, dtype)
        out[...] = x.reshape(between)
        return out

    return broadcast


def _reshape(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape = to[0].shape
    return lambda x: x.reshape(shape)


def _reshape_in_order(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    if parameters["dimensions"] is not None:  # of axes in another order
        raise NoRuleError
    return _reshape(parameters, of, to)


def _slice(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    first, last = parameters["start_indices"], parameters["limit_indices"]
    steps = parameters["strides"] or (None,) * len(first)
    part = tuple(slice(*each) for each in zip(first, last, steps, strict=True))
    return lambda x: x[part]


def _dynamic_slice(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    within = _window(of[0].shape, parameters["slice_sizes"])
    return lambda x, *first: x[within(first)]


def _window(shape: Sequence[int], sizes: Sequence[int]) -> Callable[[Sequence[Entries]], tuple[slice, ...]]:
    """Slices of given sizes of an array, from where they are asked for or, where they would reach out, before."""
    each = [(size, whole - size) for whole, size in zip(shape, sizes, strict=True)]

    def slices(first: Sequence[Entries]) -> tuple[slice, ...]:
        begins = [clamped(k, last) for k, (_, last) in zip(first, each, strict=True)]
        return tuple(slice(k, k + size) for k, (size, _) in zip(begins, each, strict=True))

    return slices


def _in_parts(cut: Callable[[Parameters], Computed]) -> Callable[..., Computed]:
    """An array in a list of parts, or the one that there is."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        parts = cut(parameters)
        return parts if len(to) != 1 else lambda x: parts(x)[0]

    return rule


def _split(parameters: Parameters) -> Computed:
    places, axis = np.cumsum(parameters["sizes"])[:-1], parameters["axis"]
    return lambda x: np.split(x, places, axis)


def _pad(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """What is padded by less than nothing is cut."""
    config, dtype, where = parameters["padding_config"], to[0].dtype, zip(of[0].shape, to[0].shape, strict=True)
    whole = [size + max(-low, 0) + max(-high, 0) for size, (low, high, _) in zip(to[0].shape, config, strict=True)]
    inner, kept = [], []
    for (size, left), (low, _, between) in zip(where, config, strict=True):
        begin, step = max(low, 0), between + 1
        inner.append(slice(begin, begin + (size - 1) * step + 1 if size else begin, step))
        kept.append(slice(max(-low, 0), max(-low, 0) + left))

    def pad(x: Entries, value: Entries) -> np.ndarray:
        out = np.empty(whole, dtype)
        out[...] = value
        out[tuple(inner)] = x
        return out[tuple(kept)]

    return pad


def _convert(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    dtype = to[0].dtype
    if not (np.issubdtype(of[0].dtype, np.floating) and np.issubdtype(dtype, np.integer)):
        return lambda x: x.astype(dtype)
    least, most = np.iinfo(dtype).min, np.iinfo(dtype).max

    def convert(x: Entries) -> Entries:  # as XLA: of NaN 0, and the nearest of what is too large
        whole = np.where((x > least) & (x < most), x, 0).astype(dtype)
        return np.where(x >= most, most, np.where(x <= least, least, whole)).astype(dtype)

    return convert


def _iota(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    shape = to[0].shape
    one = _counted(shape, parameters["dimension"]).astype(to[0].dtype)
    return lambda: np.broadcast_to(one, shape)


def _select(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    if of[0].dtype == bool and len(of) == 3:
        return lambda which, no, yes: np.where(which, yes, no)
    most = len(of) - 2
    return lambda which, *cases: np.choose(np.clip(which, 0, most), cases)


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
    left_free = [k for k in range(a.ndim) if k not in left and k not in left_batch]
    right_free = [k for k in range(b.ndim) if k not in right and k not in right_batch]
    batch = [a.shape[k] for k in left_batch]
    inner = int(np.prod([a.shape[k] for k in left], dtype=int))
    order = ([*left_batch, *left_free, *left], [*right_batch, *right, *right_free])
    shapes = ((*batch, -1, inner), (*batch, inner, -1))
    if not a.size or not b.size:
        return lambda x, y: np.zeros(shape, dtype)

    def dot(x: Entries, y: Entries) -> np.ndarray:
        both = zip((x, y), order, shapes, strict=True)
        x, y = (each.astype(dtype, copy=False).transpose(axes).reshape(to) for each, axes, to in both)
        return np.matmul(x, y).reshape(shape)

    return dot


def _counted(shape: Sequence[int], axis: int) -> np.ndarray:
    """0, 1, 2, ... along an axis."""
    return np.arange(shape[axis]).reshape([-1 if k == axis else 1 for k in range(len(shape))])


def _entries(numbers: Any, operand: Any, sizes: Sequence[int], within: Sequence[int], mode: Any) -> Computed:
    """Where slices of an array at given places are in it, number by number, and which are not if some of a mode that
    fills or drops them are not: they count from where they can.

    `within` are the axes of slices among those of what is read or set, and `sizes` those of slices.
    """
    along, without, batched, batches = numbers
    kept = [k for k in range(operand.ndim) if k not in without and k not in batched]
    strides = np.cumprod([1, *operand.shape[:0:-1]])[::-1]
    most = np.subtract(operand.shape, sizes)[list(along)]

    def entries(places: Entries) -> tuple[Entries, Entries]:
        lost = None
        if places.size and (beyond := (places < 0) | (places > most)).any():
            lost = beyond.any(axis=-1) if "FILL" in str(mode) else None
            places = np.clip(places, 0, most)
        begins = places.astype(np.intp) @ strides[list(along)]
        for k, axis in zip(batched, batches, strict=True):
            begins = begins + strides[k] * _counted(begins.shape, axis)
        out = np.expand_dims(begins, tuple(within))
        for axis, k in zip(within, kept, strict=True):
            out = out + strides[k] * _counted((*out.shape[:axis], sizes[k], *out.shape[axis + 1 :]), axis)
        return out, None if lost is None else np.broadcast_to(np.expand_dims(lost, tuple(within)), out.shape)

    return entries


def _gather(parameters: Parameters, of: Shapes, to: Shapes) -> AtPlaces:
    numbers, sizes = parameters["dimension_numbers"], parameters["slice_sizes"]
    batches = numbers.operand_batching_dims, numbers.start_indices_batching_dims
    axes = numbers.start_index_map, numbers.collapsed_slice_dims, *batches
    entries = _entries(axes, of[0], sizes, [*map(int, numbers.offset_dims)], parameters["mode"])
    fill = parameters["fill_value"]
    if fill is None:
        dtype = to[0].dtype
        is_whole, unsigned = np.issubdtype(dtype, np.integer), np.issubdtype(dtype, np.unsignedinteger)
        fill = _ends(dtype)[unsigned] if is_whole else np.nan

    def gather(x: Entries, places: tuple[Entries, Entries]) -> Entries:
        found, lost = places
        out = x.take(found)
        return out if lost is None else np.where(lost, np.asarray(fill, out.dtype), out)

    return AtPlaces(entries, gather)


def _scatter(setting: Computed, equations: list[str]) -> Callable[..., AtPlaces]:
    """Entries set, or combined by one equation."""

    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> AtPlaces:
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

        def scatter(x: Entries, places: tuple[Entries, Entries], new: Entries) -> np.ndarray:
            out = np.array(x, order="C")  # so that its entries in one row are no copy
            found, lost = places
            setting(out.reshape(-1), *((found, new) if lost is None else (found[~lost], new[~lost])))
            return out

        return AtPlaces(entries, scatter)

    return rule


def _power(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    dtype = to[0].dtype
    return lambda x, y: np.power(x, y).astype(dtype)


def _place_of(extreme: Computed) -> Callable[..., Computed]:
    def rule(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
        (axis,), dtype = parameters["axes"], to[0].dtype
        return lambda x: extreme(x, axis).astype(dtype)

    return rule


def _sort(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    axis, keys = parameters["dimension"], parameters["num_keys"]
    if len(of) == 1:
        return lambda x: np.sort(x, axis, kind="stable")

    def sort(*given: Any) -> Entries:
        order = np.lexsort(given[keys - 1 :: -1], axis)
        return [np.take_along_axis(x, order, axis) for x in given]

    return sort


def _dynamic_update_slice(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    within = _window(of[0].shape, of[1].shape)

    def update(x: Entries, new: Entries, *first: Entries) -> np.ndarray:
        out = np.array(x)
        out[within(first)] = new
        return out

    return update


def _maybe_set(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """Equinox's setting of an entry in a loop, which outside of batches is always done."""
    if len(of) != 4 or of[3].shape != () or parameters["kwargs"] or parameters["i_static"] is not None:
        raise NoRuleError

    def set_entry(_: Entries, x: Entries, new: Entries, place: Entries) -> np.ndarray:
        out = np.array(x)
        if -len(out) <= place < len(out):
            out[int(place)] = new
        return out

    return set_entry


def _of_samples(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    """One of Equinox's own in a batch, sample by sample."""
    axes, size = parameters["__batch_axes"], parameters["__axis_size"]

    def one(x: ShapedArray, axis: int | None) -> ShapedArray:
        return ShapedArray(tuple(size for k, size in enumerate(x.shape) if k != axis), x.dtype)

    shapes = [*map(one, of, axes)], [one(x, 0) for x in to]
    rule = RULES[parameters["prim"].name](dict(parameters["params"]), *shapes)
    if isinstance(rule, AtPlaces) or len(to) != 1:
        raise NoRuleError

    def each(*given: Entries) -> np.ndarray:
        both = [*zip(given, axes, strict=True)]
        return np.stack([rule(*(x if axis is None else x.take(k, axis) for x, axis in both)) for k in range(size)])

    return each


def _of_platform(parameters: Parameters, of: Shapes, to: Shapes) -> Computed:
    names, own = parameters["platforms"], jax.default_backend()
    place = next(k for k, some in enumerate(names) if some is None or own in some)
    return lambda: np.int32(place)


RULES: dict[str, Callable[..., Computed | AtPlaces]] = {
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
            "nextafter": np.nextafter,
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
            "unvmap_all": np.all,
            "unvmap_any": np.any,
            "unvmap_max": np.max,
            "xor": np.bitwise_xor,
        }.items()
    },
    "argmax": _place_of(np.argmax),
    "argmin": _place_of(np.argmin),
    "broadcast_in_dim": _broadcast,
    "cholesky": or_nan(cholesky),
    "clamp": _as_it_is(lambda least, x, most: np.minimum(np.maximum(x, least), most)),
    "concatenate": _by("dimension", lambda axis: lambda *parts: np.concatenate(parts, axis)),
    "convert_element_type": _convert,
    "cummax": _cumulated(np.maximum.accumulate),
    "cumprod": _cumulated(np.multiply.accumulate),
    "cumsum": _cumulated(np.add.accumulate),
    "div": _divided(np.divide),
    "dot_general": _dot,
    "dynamic_slice": _dynamic_slice,
    "empty2": lambda parameters, of, to: functools.partial(np.zeros, to[0].shape, to[0].dtype),
    "dynamic_update_slice": _dynamic_update_slice,
    "eigh": or_nan(eigh),
    "expand_dims": _reshape,
    "gather": _gather,
    "integer_pow": _integer_power,
    "iota": _iota,
    "logistic": _as_it_is(lambda x: 1 / (1 + np.exp(-x))),
    "lu": lu_factors,
    "lu_pivots_to_permutation": lu_permutation,
    "maybe_set": _maybe_set,
    "pad": _pad,
    "platform_index": _of_platform,
    "polynomial": _as_it_is(lambda x, *factors: functools.reduce(lambda sum_, a: sum_ * x + a, reversed(factors))),
    "pow": _power,
    "qr": qr,
    "reduce_and": _along(np.logical_and),
    "reduce_max": _along(np.maximum),
    "reduce_min": _along(np.minimum),
    "reduce_or": _along(np.logical_or),
    "reduce_prod": _along(np.multiply),
    "reduce_sum": _along(np.add),
    "rem": _divided(np.fmod),
    "reshape": _reshape_in_order,
    "rev": _by("dimensions", lambda axes: lambda x: np.flip(x, axes)),
    "round": _round,
    "rsqrt": _as_it_is(lambda x: 1 / np.sqrt(x)),
    "scatter": _scatter(operator.setitem, []),
    "scatter-add": _scatter(np.add.at, ["add"]),
    "select_if_vmap": _as_it_is(lambda which, yes, no: yes),
    "select_n": _select,
    "slice": _slice,
    "sort": _sort,
    "split": _in_parts(_split),
    "squeeze": _reshape,
    "stack": _by("axis", lambda axis: lambda *parts: np.stack(parts, axis)),
    "svd": or_nan(svd),
    "tile": _by("reps", lambda repeats: lambda x: np.tile(x, repeats)),
    "transpose": _by("permutation", lambda order: lambda x: x.transpose(order)),
    "triangular_solve": triangular_solve,
    "unstack": _in_parts(lambda parameters: lambda x: [*np.moveaxis(x, parameters["axis"], 0)]),
    "vprim": _of_samples,
}
