"""What a study holds: names, shapes and labels of its variables, told before anything is computed.

The outputs of one sample are any pytree; its leaves are called by their path, as in "stats.redundancy". How a solve
ended is a code, with the meaning of every code beside it (`flag_values` and `flag_meanings` of the CF conventions).
"""

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import jax
import numpy as np
from jaxtyping import PyTree

from .._system._axis import Axis
from .._system._named import AbstractNamed
from .._system._names import KEPT, Names
from .._system._results import RESULTS, flags
from .._system._system import AbstractSystem
from .._system._units import UNSTATED, StatedUnits
from .._tools._errors import RedundaxError
from .._tools._module import replace_fields
from .._tools._numbers import Numeric

if TYPE_CHECKING:
    import xarray

SAMPLE = "sample"
_LABELLED = {array: quantity.axis for array, quantity in KEPT.items()} | {"sense": "slip"}
_HASHED = 2**22  # bytes of samples that are hashed at once


@dataclasses.dataclass(frozen=True)
class Variable:
    """An array of a study without its sample axis."""

    shape: tuple[int, ...]
    dtype: np.dtype
    dims: tuple[str, ...]
    attrs: dict[str, str | np.ndarray]


@dataclasses.dataclass(frozen=True)
class Layout:
    """The variables of a study, its labels along dimensions as (dimension, labels), and the number of samples."""

    variables: dict[str, Variable]
    labels: dict[str, tuple[str, tuple[str, ...]]]
    size: int

    def fingerprint(self, samples: Mapping[str, np.ndarray]) -> str:
        """The same for the same samples, outputs, labels and units, and for no others."""
        digest = hashlib.sha256(repr((self.size, sorted(self.labels.items()))).encode())
        for name, variable in sorted(self.variables.items()):
            digest.update(repr((name, variable.shape, variable.dtype.str, variable.dims)).encode())
            digest.update(repr(sorted(variable.attrs.items())).encode())
        for _, values in sorted(samples.items()):
            rows = max(1, _HASHED // max(1, values[:1].nbytes))
            for first in range(0, self.size, rows):
                digest.update(np.ascontiguousarray(values[first : first + rows]).data)
        return digest.hexdigest()


def named(tree: PyTree) -> dict[str, Numeric]:
    """The arrays of a pytree, or their shapes, by the path that leads to them; results as codes."""
    return {name: jax.tree.leaves(leaf)[0] for name, leaf in _leaves(tree).items()}


def layout(samples: Mapping[str, np.ndarray], outputs: PyTree, system: AbstractSystem | None) -> Layout:
    """The layout for samples and for what one sample gives, a pytree of shapes as of `jax.eval_shape`."""
    given = {name: Variable(v.shape[1:], v.dtype, _dims(name, v.shape[1:]), {}) for name, v in samples.items()}
    names = _names(outputs) if system is None else system.names
    axes = {} if names is None else {name: axis for name, axis in names.axes.items() if len(axis)}
    units = UNSTATED if names is None else names.units
    found = {name: _variable(name, leaf, axes, units) for name, leaf in _leaves(outputs).items()}
    if not found:
        raise RedundaxError(
            "Argument `run` must return arrays, but returns none. Return the quantities that you want to know."
        )
    used = {dim for variable in (given | found).values() for dim in variable.dims}
    labels = {}
    for dim in sorted(used & set(axes)):
        labels[dim] = (dim, axes[dim].labels)
        labels[f"{dim}_kind"] = (dim, axes[dim].kinds)
    for name in found:
        if not name or "/" in name:
            raise RedundaxError(
                "Argument `run` must return a dict of arrays or a `Solution`, with names that are not empty and hold "
                f"no slash, but one array is called {name!r}. Rename it."
            )
        if name in given:
            raise RedundaxError(f"No output may be called {name!r}, as samples are. Choose another name.")
    for name in (*given, *found):
        if name in used | {SAMPLE, *labels}:
            raise RedundaxError(
                f"No samples or outputs may be called {name!r}, as a dimension is. Choose another name."
            )
    return Layout({**given, **found}, labels, len(next(iter(samples.values()))))


def outcomes(results: "xarray.DataArray") -> dict[str, int]:
    """How many of the results of a study are which."""
    meanings = dict(zip(results.flag_values, results.flag_meanings.split(), strict=True))
    codes, counts = np.unique(results.values, return_counts=True)
    return {meanings[code]: int(count) for code, count in zip(codes, counts, strict=True)}


def storable(dtype: np.dtype) -> bool:
    """Whether netCDF has such numbers."""
    return dtype.kind in "biu" or dtype in (np.float32, np.float64)


def _leaves(tree: PyTree) -> dict[str, PyTree]:
    tree = jax.tree.map(_figures, tree, is_leaf=lambda x: isinstance(x, AbstractNamed))
    leaves = jax.tree_util.tree_flatten_with_path(tree, is_leaf=lambda x: isinstance(x, RESULTS))[0]
    return {jax.tree_util.keystr(path, simple=True, separator="."): leaf for path, leaf in leaves}


def _figures(result: PyTree) -> PyTree:
    """A result without what says where its figures are."""
    return replace_fields(result, state=None, joint_coordinates=None) if isinstance(result, AbstractNamed) else result


def _names(outputs: PyTree) -> Names | None:
    """Those of the first result that has some."""
    found = jax.tree.leaves(outputs, is_leaf=lambda x: isinstance(x, AbstractNamed))
    return next((one.names for one in found if isinstance(one, AbstractNamed) and one.names), None)


def _variable(name: str, leaf: PyTree, axes: Mapping[str, Axis], units: StatedUnits) -> Variable:
    attrs: dict[str, str | np.ndarray] = {}
    if isinstance(leaf, RESULTS):
        leaf = jax.tree.leaves(leaf)[0]
        attrs = flags(leaf.dtype)
    shape, dtype = tuple(leaf.shape), np.dtype(leaf.dtype)
    if not storable(dtype):
        raise RedundaxError(
            f"Argument `run` must return real numbers of at least 32 bits, but {name!r} has dtype {dtype}. "
            "Convert it, say with `astype(float)`."
        )
    dims = _dims(name, shape)
    last = name.rpartition(".")[2]
    label = _LABELLED.get(last, "")
    if label in axes and shape and shape[-1] == len(axes[label]):
        dims = (*dims[:-1], label)
        attrs |= KEPT[last].attributes(units) if last in KEPT else {}
    return Variable(shape, dtype, dims, attrs)


def _dims(name: str, shape: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(f"{name}_{k}" for k in range(len(shape)))
