"""What tolerances of parts, joints and surroundings do to motion and joint loads.

    y = build(p),   p_j independent with means mu_j and standard deviations s_j
    gradient:  dy/dp_j at p = mu, by forward mode
    share:     b_j^2 var(p_j) / var(y),   y = a + sum_j b_j p_j fitted to the samples by least squares

The gradient holds for small tolerances; the shares are those of the whole samples, and what they lack to 1 is what no
linear law of the parameters explains: curvature, reversals of a load, parameters that act together.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.sharding import Mesh
from jaxtyping import Array, PyTree

from .._solve._solution import Solution
from .._system._named import AbstractNamed
from .._system._names import QUANTITIES
from .._system._results import RESULTS, is_one_of, result_codes
from .._system._system import AbstractSystem
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import check_call
from .._tools._words import warn
from ._distributions import AbstractDistribution, check_distributions, check_percentiles, check_power, entries, sobol
from ._layout import SAMPLE, named, outcomes
from ._study import study, whole

if TYPE_CHECKING:
    import xarray

_LABELS = {QUANTITIES[name].axis: QUANTITIES[name].pattern for name in ("acceleration", "multipliers", "friction")}
_STATISTICS = {
    "mean": "output",
    "std": "output",
    "percentiles": ("output", "percentile"),
    "share": ("output", "parameter"),
}
_COORDINATES = ("output", "output_kind", "output_unit", "parameter", "percentile")
_TAKEN = {*_STATISTICS, *_COORDINATES, "solved", "nominal", "gradient"}
_ROUNDING = 1e3  # units in the last place of an output's largest value, below which its spread is rounding


class _Outputs(AbstractNamed):
    """What is looked at of a `Solution`."""

    acceleration: Array
    multipliers: Array
    friction: Array
    result: RESULTS


def tolerance_study(
    build: Callable[..., PyTree],
    parameters: Mapping[str, AbstractDistribution],
    *,
    samples: int = 4096,
    percentiles: Sequence[float] = (2.5, 50.0, 97.5),
    seed: int = 0,
    system: AbstractSystem | None = None,
    chunk: int = 65536,
    path: str | Path | None = None,
    mesh: Mesh | None = None,
    progress: bool = False,
) -> "xarray.Dataset":
    """How far motion and joint loads vary with the tolerances of parts, and which tolerance is to blame.

    ??? example

        ```python
        def build(misfit, mu_rho):
            mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
            joints = [rx.JointCompliance(name, 1e-8) for name in "BCD"]
            joints.append(rx.JointCompliance("A", 1e-8, misfit=jnp.stack([misfit, 0.0, 0.0])))
            closure = rx.ElasticJoints(mechanism, joints)
            return rx.solve(mechanism, mechanism.state(phi=0.8, rate=1.0), closure=closure)

        parameters = {"misfit": rx.Normal(0.0, 1e-5), "mu_rho": rx.Uniform(0.01, 0.03)}
        found = rx.tolerance_study(build, parameters, system=rx.mechanisms.wojtyra2020(mu_rho=0.02))
        found["std"].sel(output="A.x"), found["share"].sel(output="A.x", parameter="misfit")
        rx.plot.tolerance(found)
        ```

    **Arguments:**

    - `build`: function of the parameters, written in jnp and differentiable, that gives a `Solution`, or a dict or
      other pytree of arrays.
    - `parameters`: `Normal` or `Uniform` for each argument of `build`: lengths, misfits, temperatures, friction
      coefficients. They are independent of each other.
    - `samples`: their number, a power of two: Sobol points fill the space of the parameters evenly then.
    - `percentiles`: between 0 and 100.
    - `seed`: of the scrambling of the Sobol points.
    - `system`: gives the outputs their names, those of `band`; not needed where `build` returns a `Solution`.
    - `chunk`, `path`, `mesh`, `progress`: as in `study`; the file holds the samples, not the statistics.

    **Returns:** an `xarray.Dataset`: that of `study`, and over the dimension "output", all entries of all outputs,
    `nominal`, at the means of the parameters; `mean`, `std`, and `percentiles` (also over "percentile") of the samples;
    `gradient`, the derivative at the means, and `share`, the part of the variance that a linear law of one
    parameter explains (both also over "parameter"). Samples without a solution, or with values that are not finite, are
    left out of all statistics with a warning: `solved` tells which, the attribute `failed` how many. `output_kind` is
    "linear", "angular", "force", "moment", "friction force" or "friction moment", "" where that is not known, and
    `output_unit` the unit where the system states some.

    **Raises:** as `study`; `RuntimeError` where the nominal mechanism, or more samples than leave something to fit
    the shares to, have no solution.
    """
    _check(parameters, samples, percentiles)
    check_call("build", build, **parameters)

    def run(**values: Array) -> PyTree:
        found = build(**values)
        if isinstance(found, Solution):
            return _Outputs(found.acceleration, found.multipliers, found.friction, found.result, names=found.names)
        return found

    linear = _linear(run, parameters)
    given = sobol(parameters, samples, seed)
    data = whole(study(run, given, system=system, chunk=chunk, path=path, mesh=mesh, progress=progress))
    inputs = [name for one in parameters for name in entries(one, parameters[one].shape)]
    solved = _solved(data, linear.names)
    if solved.sum() <= len(inputs):
        raise NoSolutionError(
            f"Only {solved.sum()} of {solved.size} samples have a solution: too few for the shares of {len(inputs)} "
            "parameters. Take narrower distributions, or more samples."
        )
    if not solved.all():
        text = f"{np.sum(~solved)} of {solved.size} samples have no solution and are left out of the statistics"
        warn(f"{text}{_why(data)}.")
    statistics = _statistics(data, linear.names, solved, _standard(given, parameters), percentiles)
    coords = {"parameter": inputs, "percentile": [*percentiles]}
    return _together(data, linear, solved, statistics, coords)


def _check(parameters: Mapping[str, AbstractDistribution], samples: int, percentiles: Sequence[float]) -> None:
    check_distributions(parameters, "What does not vary belongs into `build`.")
    check_power("samples", samples)
    lost = sorted(set(parameters) & _TAKEN)
    if lost:
        raise RedundaxError(
            f"Argument `parameters` must not hold {lost}, which are names of statistics. Choose others."
        )
    check_percentiles(percentiles, 1)


class _Linear(NamedTuple):
    """Names of the outputs that are real numbers, their entries at the means, and the derivatives there."""

    names: list[str]
    nominal: np.ndarray
    gradient: np.ndarray


def _linear(run: Callable[..., PyTree], parameters: Mapping[str, AbstractDistribution]) -> _Linear:
    flat, listed = ravel_pytree([jnp.asarray(one.nominal) for one in parameters.values()])

    def restore(vector: Array) -> dict[str, Array]:
        return dict(zip(parameters, listed(vector), strict=True))

    shapes = named(jax.eval_shape(lambda vector: run(**restore(vector)), flat))
    names = [name for name, value in shapes.items() if jnp.issubdtype(value.dtype, jnp.floating)]
    if not names:
        raise RedundaxError(
            "Argument `build` must return arrays of real numbers, but returns none. "
            "Return the quantities that you want to know."
        )

    def outputs(vector: Array) -> tuple[Array, tuple[Array, list[RESULTS]]]:
        found = run(**restore(vector))
        results = [leaf for leaf in jax.tree.leaves(found, is_leaf=_is_result) if _is_result(leaf)]
        values = named(found)
        stacked = jnp.concatenate([values[name].ravel() for name in names])
        return stacked, (stacked, results)

    gradient, (nominal, results) = jax.jit(jax.jacfwd(outputs, has_aux=True))(flat)
    for result in results:
        if not is_one_of(result, RESULTS.successful):
            raise NoSolutionError(f"At the means of the parameters there is no solution. {RESULTS[result]}")
    lost = sorted(set(names) & _TAKEN)
    if lost:
        raise RedundaxError(
            f"Argument `build` must not call outputs {lost}, which are names of statistics. Choose others."
        )
    if not np.all(np.isfinite(nominal)):
        raise NoSolutionError(
            "At the means of the parameters there is no solution: outputs of `build` are not finite. Choose others."
        )
    return _Linear(names, np.asarray(nominal), np.asarray(gradient))


def _is_result(leaf: object) -> bool:
    return isinstance(leaf, RESULTS)


def _solved(data: "xarray.Dataset", names: Sequence[str]) -> np.ndarray:
    """Which samples have a solution, shape (N,)."""
    solved = np.ones(data.sizes[SAMPLE], dtype=bool)
    for name in names:
        solved &= np.isfinite(data[name].values).reshape(solved.size, -1).all(axis=1)
    for values in _results(data):
        solved &= values.values == result_codes()["successful"]
    return solved


def _results(data: "xarray.Dataset") -> list["xarray.DataArray"]:
    """What solves within `build` ended with."""
    return [values for values in data.values() if "flag_meanings" in values.attrs]


def _why(data: "xarray.Dataset") -> str:
    """What the samples ended with, where `build` tells."""
    counts: dict[str, int] = {}
    for values in _results(data):
        for name, count in outcomes(values).items():
            counts[name] = counts.get(name, 0) + count
    counts.pop("successful", None)
    return f" ({', '.join(f'{name}: {count}' for name, count in counts.items())})" if counts else ""


def _output_labels(data: "xarray.Dataset", names: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    """Names, kinds and units of all entries of all outputs."""
    labels, kinds, units = [], [], []
    for name in names:
        dims, shape = data[name].dims[1:], data[name].shape[1:]
        dim = str(dims[-1]) if dims else ""
        if len(dims) == 1 and dim in _LABELS:
            before = f"{name.rpartition('.')[0]} ".lstrip()
            labels += [before + _LABELS[dim].format(label) for label in data[dim].values]
            friction = {"linear": "friction force", "angular": "friction moment"} if dim == "slip" else {}
            own = [str(kind) for kind in data[f"{dim}_kind"].values]
            kinds += [friction.get(kind, kind) for kind in own]
            which = ("angular_unit" if kind in ("angular", "moment") else "linear_unit" for kind in own)
            units += [data[name].attrs.get(each, "") for each in which]
        else:
            found = entries(name, shape)
            labels += found
            kinds += [""] * len(found)
            units += [""] * len(found)
    return labels, kinds, units


def _standard(given: Mapping[str, np.ndarray], parameters: Mapping[str, AbstractDistribution]) -> np.ndarray:
    """Samples of all parameters in standard deviations from their means, shape (N, parameters)."""
    columns = [(given[name] - one.nominal) / one.std for name, one in parameters.items()]
    return np.concatenate([column.reshape(len(column), -1) for column in columns], axis=1)


def _statistics(
    data: "xarray.Dataset", names: Sequence[str], solved: np.ndarray, inputs: np.ndarray, percentiles: Sequence[float]
) -> dict[str, tuple[str | tuple[str, ...], np.ndarray]]:
    """Of every entry of every output, over the samples that have a solution."""
    inputs = inputs[: solved.size][solved]
    inputs = inputs - inputs.mean(axis=0)
    q, r = np.linalg.qr(inputs)
    parts = []
    for name in names:
        values = data[name].values.reshape(solved.size, -1)[solved].astype(float)
        mean, std = values.mean(axis=0), values.std(axis=0)
        rounding = _ROUNDING * np.finfo(data[name].dtype).eps * np.abs(values).max(initial=0.0)
        weights = np.linalg.solve(r, q.T @ (values - mean)) * inputs.std(axis=0)[:, None]
        varies = std > rounding
        share = np.where(varies, (weights / np.where(varies, std, 1.0)) ** 2, 0.0)
        parts.append((mean, std, np.percentile(values, percentiles, axis=0).T, share.T))
    joined = (np.concatenate(part) for part in zip(*parts, strict=True))
    return {name: (dims, values) for (name, dims), values in zip(_STATISTICS.items(), joined, strict=True)}


def _together(
    data: "xarray.Dataset",
    linear: _Linear,
    solved: np.ndarray,
    statistics: dict[str, tuple[str | tuple[str, ...], np.ndarray]],
    coords: dict[str, object],
) -> "xarray.Dataset":
    """The dataset of the study with all that was found."""
    outputs, kinds, units = _output_labels(data, linear.names)
    found = data.assign(
        {
            **statistics,
            "solved": (SAMPLE, solved),
            "nominal": ("output", linear.nominal),
            "gradient": (("output", "parameter"), linear.gradient),
        }
    )
    about = {"output_kind": ("output", kinds), "output_unit": ("output", units)}
    found = found.assign_coords(coords | {"output": outputs} | about)
    found = found.assign_attrs(failed=int(np.sum(~solved)))
    found.set_close(data.close)
    return found
