"""What laws of time have in common, and the instants at which those of a system are not smooth."""

import abc
from typing import ClassVar, TypeGuard

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float, PyTree

from .._tools._module import as_float
from .._tools._numbers import are_known, computed
from .._tools._value import AbstractModule


class AbstractLaw(AbstractModule):
    """A law of time, that may be multiplied by a number and shifted by one: `-2 * jnp.pi / pitch * slide + 0.3`."""

    __array_ufunc__: ClassVar[None] = None  # NumPy's numbers leave products to the law

    @abc.abstractmethod
    def __call__(self, t: ArrayLike) -> Float[Array, ""]:
        """Where it is at a time."""

    @property
    def instants(self) -> tuple[Float[Array, "..."], ...]:
        """When its second derivative by time, or one before, jumps or has a kink, s; of laws stacked those of each."""
        return ()

    def __mul__(self, factor: ArrayLike) -> "AbstractLaw":
        return _Linear(self, as_float(factor), as_float(0.0))

    __rmul__ = __mul__

    def __add__(self, shift: ArrayLike) -> "AbstractLaw":
        return _Linear(self, as_float(1.0), as_float(shift))

    __radd__ = __add__

    def __sub__(self, shift: ArrayLike) -> "AbstractLaw":
        return self + -as_float(shift)

    def __rsub__(self, shift: ArrayLike) -> "AbstractLaw":
        return -self + shift

    def __neg__(self) -> "AbstractLaw":
        return self * -1.0

    def __truediv__(self, divisor: ArrayLike) -> "AbstractLaw":
        return self * (1 / as_float(divisor))


class _Linear(AbstractLaw):
    law: AbstractLaw
    factor: Float[Array, ""]
    shift: Float[Array, ""]

    @property
    def instants(self) -> tuple[Float[Array, "..."], ...]:
        return self.law.instants

    def __call__(self, t: ArrayLike) -> Array:
        return self.factor * self.law(t) + self.shift


def instants_of(system: PyTree) -> Float[Array, " instants"] | None:
    """When laws of time that a system holds are not smooth; None if they always are, or where they are traced: an
    instant that moves with what derivatives are taken by would have to be told apart from others."""
    laws = [x for x in jax.tree.leaves(system, is_leaf=_is_law) if _is_law(x)]
    instants = _joined(laws) if laws and are_known(laws) else None
    return instants if instants is not None and instants.size else None


@computed
def _joined(laws: list[AbstractLaw]) -> Float[Array, " instants"]:
    return jnp.concatenate([jnp.zeros(0), *(jnp.ravel(t) for law in laws for t in law.instants)])


def _is_law(x: object) -> TypeGuard[AbstractLaw]:
    return isinstance(x, AbstractLaw)
