"""Distributions of what parts, joints and surroundings vary by.

Samples are scrambled Sobol points u in the unit cube, taken through the quantile functions of the distributions:
means and percentiles of smooth outputs converge nearly as 1/N where random samples need 1/sqrt(N).
"""

import abc
from collections.abc import Mapping, Sequence

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._module import Numbers, check_kind, check_seed, check_whole, floats

_BITS = 30  # of the Sobol points


class AbstractDistribution(abc.ABC):
    """Independent random numbers, one or an array of them."""

    nominal: np.ndarray
    std: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the numbers."""
        return self.nominal.shape

    @abc.abstractmethod
    def quantile(self, u: np.ndarray) -> np.ndarray:
        """Values that are not exceeded with probability u, shape (N, ...)."""


class Normal(AbstractDistribution):
    """Normally distributed.

    ??? example

        ```python
        rx.Normal(mean=0.1, std=1e-4)  # a length, m
        rx.Normal(jnp.zeros(3), 1e-5 * jnp.ones(3))  # three independent misfits
        ```

    **Arguments:**

    - `mean`, `std`: mean, which is the nominal value, and standard deviation, numbers or arrays of one shape.
    """

    def __init__(self, mean: Numbers, std: Numbers):
        self.nominal, self.std = _pair("mean", mean, "std", std)
        if not np.all(self.std > 0):
            raise RedundaxError(
                f"Argument `std` must be positive, but is {std}. What does not vary belongs into `build`."
            )

    def quantile(self, u: np.ndarray) -> np.ndarray:
        from scipy.special import ndtri

        return self.nominal + self.std * ndtri(u)


class Uniform(AbstractDistribution):
    """Equally likely between two bounds; the nominal value is in the middle.

    ??? example

        ```python
        rx.Uniform(low=0.01, high=0.03)  # a friction radius, m
        ```

    **Arguments:**

    - `low`, `high`: bounds, numbers or arrays of one shape.
    """

    def __init__(self, low: Numbers, high: Numbers):
        self.low, self.high = _pair("low", low, "high", high)
        if not np.all(self.low < self.high):
            raise RedundaxError(
                f"Argument `high` must be above `low`, but they are {high} and {low}. Swap them, or widen the range."
            )
        self.nominal = (self.low + self.high) / 2
        self.std = (self.high - self.low) / np.sqrt(12)

    def quantile(self, u: np.ndarray) -> np.ndarray:
        return self.low + u * (self.high - self.low)


def check_distributions(parameters: Mapping[str, AbstractDistribution], rest: str) -> None:
    """Refuse parameters without a distribution; `rest` says what to do with what has none."""
    advice = 'Write {"mu": rx.Uniform(0.05, 0.15)}, say.'
    check_kind("parameters", parameters, Mapping, "distributions by name", advice)
    wrong = [name for name, one in parameters.items() if not isinstance(one, AbstractDistribution)]
    if wrong or not parameters:
        raise RedundaxError(
            "Argument `parameters` must hold a `Normal` or `Uniform` for each parameter, but holds "
            f"{f'something else for {wrong}' if wrong else 'none'}. {rest}"
        )


def check_percentiles(percentiles: Sequence[float], least: int) -> None:
    """Refuse what are not at least so many."""
    given = np.asarray(floats(percentiles, "percentiles"))
    if given.ndim != 1 or given.size < least or not np.all((given >= 0) & (given <= 100)):
        some = "numbers" if least == 1 else "two or more numbers"
        raise RedundaxError(
            f"Argument `percentiles` must hold {some} from 0 to 100, but is {percentiles}. Give [5, 95], say."
        )


def check_power(name: str, count: int, least: int = 2) -> None:
    """Refuse a number of Sobol points that is no power of two."""
    check_whole(1, **{name: count})
    if count < least or count & (count - 1):
        near = max(least, 2 ** count.bit_length())
        raise RedundaxError(f"Argument `{name}` must give a power of two points, but gives {count}. {near} is one.")


def sobol(parameters: Mapping[str, AbstractDistribution], samples: int, seed: int) -> dict[str, np.ndarray]:
    """Samples of every parameter, shape (N, ...)."""
    from scipy.stats import qmc

    check_seed(seed)
    sizes = [one.nominal.size for one in parameters.values()]
    points = qmc.Sobol(sum(sizes), bits=_BITS, rng=seed).random(samples)
    points += 0.5**_BITS / 2  # the middle of the cells, which are the points' lower ends: 0 has no finite quantile
    parts = np.split(points, np.cumsum(sizes)[:-1], axis=1)
    return {
        name: one.quantile(part.reshape(samples, *one.shape))
        for (name, one), part in zip(parameters.items(), parts, strict=True)
    }


def entries(name: str, shape: tuple[int, ...]) -> list[str]:
    """One name for each entry of an array."""
    return [name + (str([*index]) if shape else "") for index in np.ndindex(shape)]


def _pair(first: str, one: Numbers, second: str, other: Numbers) -> tuple[np.ndarray, np.ndarray]:
    values = [np.asarray(floats(value, name), float) for name, value in ((first, one), (second, other))]
    try:
        a, b = np.broadcast_arrays(*values)
    except ValueError:
        shapes = f"{values[0].shape} and {values[1].shape}"
        raise RedundaxError(
            f"Arguments `{first}` and `{second}` must have one shape, but have {shapes}. Give both for every entry."
        ) from None
    for name, value in ((first, a), (second, b)):
        if not np.all(np.isfinite(value)):
            raise RedundaxError(f"Argument `{name}` must be finite, but is {value}. Look for NaN or infinity in it.")
    return a, b
