"""What an identification found: estimates, uncertainties, other minima, and what is not determined (`_identify`)."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._tools._numbers import Numeric
from .._tools._table import text_of
from ._combination import Combination, Points, word
from ._distributions import entries

_LEFT = 0.01  # standard uncertainties from the minimum, up to which a search has converged
_APART = 0.1  # standard uncertainties between ends, up to which they are one minimum
_RIVAL = 4.0  # of chi^2 above the least, up to which the data do not tell minima apart (two standard deviations)
_MEMBER = 0.1  # part of a combination's largest entry, from which a parameter belongs to it
_LISTED = 3  # other minima on the page
_ODD = 4.0  # standard deviations of chi^2 from its mean, from which model or noise are in doubt


@dataclasses.dataclass(frozen=True)
class Minimum:
    """A minimum of the misfit: values of the parameters, chi^2, and how many searches ended in it."""

    values: dict[str, np.ndarray]
    chi_square: float
    searches: int


@dataclasses.dataclass(frozen=True)
class Identification:
    """Parameters identified from a measurement. `str()` gives a page.

    - `converged`: whether the least misfit was found by a search that converged. If not, `problem` says why, and
      estimates and uncertainties are NaN.
    - `estimate`, `uncertainty`: by parameter, values of least misfit and their standard uncertainties (68 % where the
      model is linear over them).
    - `names`, `covariance`: all entries of all parameters, and their covariance matrix.
    - `chi_square`, `degrees`: least |r|^2, and the number of data less that of determined combinations, which it is
      near if model and noise are right.
    - `undetermined`: combinations that the data leave as uncertain as they were before, or more.
    - `singular_values`: of the sensitivities in units of the noise and of the parameters' standard deviations.
    - `minima`: all distinct minima found, the least misfit first.
    - `searches`: how many searches there were.

    ??? example

        ```python
        def predict(load, drag):
            return load / drag * jnp.ones(3)


        found = rx.identify(predict, jnp.ones(3), {"load": rx.Normal(1, 0.1), "drag": rx.Normal(1, 0.1)}, noise=0.01)
        print(found, found.covariance, found.singular_values)
        print(found.undetermined[0])  # load and drag: ...; the data determine their quotient only
        print(found.minima[0].values, found.minima[0].searches)
        ```
    """

    converged: bool
    problem: str
    estimate: dict[str, np.ndarray]
    uncertainty: dict[str, np.ndarray]
    names: tuple[str, ...]
    covariance: np.ndarray
    chi_square: float
    degrees: int
    undetermined: tuple[Combination, ...]
    singular_values: np.ndarray
    minima: tuple[Minimum, ...]
    searches: int

    @property
    def rivals(self) -> tuple[Minimum, ...]:
        """Other minima that the data do not tell from the least: chi^2 within 4 of it."""
        return tuple(one for one in self.minima[1:] if one.chi_square <= self.chi_square + _RIVAL)

    def __str__(self) -> str:
        if not self.converged:
            return f"NOT CONVERGED: {self.problem}"
        ended = sum(one.searches for one in self.minima)
        lines = [f"{ended} of {self.searches} searches converged; chi^2 {self.chi_square:.4g}, expected {self.degrees}"]
        if abs(self.chi_square - self.degrees) > _ODD * np.sqrt(2.0 * max(self.degrees, 1)):
            large = self.chi_square > self.degrees
            lines.append(f"DOUBTFUL: the misfit is too {'large: the model or' if large else 'small:'} `noise` is wrong")
        width = max(map(len, self.names))
        for name, value, size in zip(self.names, _flat(self.estimate), _flat(self.uncertainty), strict=True):
            open_ = any(name in one.names for one in self.undetermined)
            lines.append(f"  {name.ljust(width)}  {value:.6g} {'not determined' if open_ else f'± {size:.2g}'}")
        if self.undetermined:
            lines += ["NOT DETERMINED by these data:", *(f"  {one}" for one in self.undetermined)]
        if self.rivals:
            lines.append("NOT THE ONLY ONE, misfits that the data do not tell from the least:")
        for one in self.rivals[:_LISTED]:
            values = ", ".join(f"{name} {x:.6g}" for name, x in zip(self.names, _flat(one.values), strict=True))
            lines.append(f"  {values}; chi^2 {one.chi_square:.4g}")
        if len(self.rivals) > _LISTED:
            lines.append(f"  and {len(self.rivals) - _LISTED} more in `rivals`")
        return text_of(lines)


Shapes = tuple[tuple[str, tuple[int, ...]], ...]


def restore(shapes: Shapes, vector: Numeric) -> dict[str, Numeric]:
    """The parameters from a vector of all their entries."""
    out, first = {}, 0
    for name, shape in shapes:
        size = math.prod(shape)
        out[name] = vector[first : first + size].reshape(shape)
        first += size
    return out


class Space(NamedTuple):
    """The space of the parameters: names and shapes, means and standard deviations of all entries."""

    shapes: Shapes
    middle: np.ndarray
    scale: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each entry."""
        return tuple(name for one, shape in self.shapes for name in entries(one, shape))

    def values(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """The parameters at a place in standard deviations."""
        return restore(self.shapes, self.middle + self.scale * u)


class Ends(NamedTuple):
    """Where searches ended: place in standard deviations, residual, sensitivities."""

    u: np.ndarray
    residual: np.ndarray
    slopes: np.ndarray


# Places in standard deviations (k, p), and the sensitivities there (k, N, p).
Sensitivities = Callable[[], tuple[np.ndarray, np.ndarray]]


class _End(NamedTuple):
    """One of them: singular value decomposition of the sensitivities, how many are determined, whether it converged."""

    u: np.ndarray
    slopes: np.ndarray
    chi_square: float
    singular: np.ndarray
    directions: np.ndarray
    rank: int
    converged: bool


def identified(ends: Ends, space: Space, sensitivities: Sensitivities) -> Identification:
    """The identification from the ends of all searches, and from sensitivities elsewhere, asked for where needed."""
    each = [_end(*one) for one in zip(*ends, strict=True)]
    order = sorted((one for one in each if np.isfinite(one.chi_square)), key=lambda one: one.chi_square)
    groups: list[list[_End]] = []
    for one in (one for one in order if one.converged):
        same = [group for group in groups if np.linalg.norm(group[0].slopes @ (one.u - group[0].u)) <= _APART]
        if same:
            same[0].append(one)
        else:
            groups.append([one])
    minima = tuple(Minimum(space.values(group[0].u), group[0].chi_square, len(group)) for group in groups)
    problem = _problem(order, minima, len(each))
    p = len(space.names)
    unknown = {name: np.full(value.shape, np.nan) for name, value in space.values(0.0 * space.middle).items()}
    if problem:
        none = np.full((p, p), np.nan)
        return Identification(
            False, problem, unknown, unknown, space.names, none, np.nan, 0, (), none[0], minima, len(each)
        )
    best = groups[0][0]
    covariance = _covariance(best, space.scale)
    return Identification(
        converged=True,
        problem="",
        estimate=minima[0].values,
        uncertainty=restore(space.shapes, np.sqrt(np.diag(covariance))),
        names=space.names,
        covariance=covariance,
        chi_square=best.chi_square,
        degrees=len(best.slopes) - best.rank,
        undetermined=tuple(_combination(best, k, space, sensitivities) for k in range(best.rank, p)),
        singular_values=best.singular,
        minima=minima,
        searches=len(each),
    )


def _end(u: np.ndarray, residual: np.ndarray, slopes: np.ndarray) -> _End:
    p = len(u)
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(slopes))):
        return _End(u, slopes, np.nan, np.zeros(p), np.eye(p), 0, False)
    left, singular, directions = np.linalg.svd(np.concatenate([slopes, np.zeros((max(p - len(slopes), 0), p))]))
    least = max(1.0, np.finfo(slopes.dtype).eps ** 0.5 * singular[0])
    rank = int(np.sum(singular >= least))
    steps = left[: len(residual), :rank].T @ residual
    return _End(u, slopes, float(residual @ residual), singular, directions, rank, bool(np.linalg.norm(steps) <= _LEFT))


def _problem(order: list[_End], minima: tuple[Minimum, ...], searches: int) -> str:
    """Why no estimate is given; empty if one is."""
    ways = "Raise `max_steps` or `starts`, or narrow the ranges in `parameters`."
    if not order:
        return f"None of {searches} searches got anywhere: what `predict` gives is not finite. {ways}"
    least = f"{order[0].chi_square:.4g}"
    if not minima:
        return f"None of {searches} searches converged; the least chi^2 that one got to is {least}. {ways}"
    if order[0].chi_square < minima[0].chi_square - _LEFT:
        above = f"{minima[0].chi_square:.4g}"
        return f"A search that did not converge got to chi^2 {least}, the best of those that did to {above}. {ways}"
    return ""


def _covariance(best: _End, scale: np.ndarray) -> np.ndarray:
    """D V S^-2 V^T D; what is not determined at all is as uncertain as rounding allows, not infinitely."""
    eps = np.finfo(best.singular.dtype).eps
    directions = np.where(np.abs(best.directions) > eps**0.5, best.directions, 0.0)
    half = directions.T / np.maximum(best.singular, max(eps * best.singular[0], eps))
    return scale[:, None] * (half @ half.T) * scale


def _combination(best: _End, k: int, space: Space, sensitivities: Sensitivities) -> Combination:
    direction = best.directions[k]
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    members = np.flatnonzero(np.abs(direction) > _MEMBER * np.abs(direction).max())
    about = ""
    if len(members) == 2:
        elsewhere, slopes = sensitivities()
        u, slopes = np.vstack([best.u, elsewhere]), np.concatenate([best.slopes[None], slopes])
        points = Points((space.middle + space.scale * u)[:, members], slopes[:, :, members])
        about = word(points, space.scale[members])
    uncertainty = 1.0 / max(float(best.singular[k]), np.finfo(float).tiny)
    return Combination(tuple(space.names[i] for i in members), (direction * space.scale)[members], uncertainty, about)


def _flat(values: dict[str, np.ndarray]) -> np.ndarray:
    return np.concatenate([np.ravel(value) for value in values.values()])
