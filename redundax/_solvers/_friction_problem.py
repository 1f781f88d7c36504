"""The frictional equations on few unknowns.

Given tau, the equations (25) are linear, and so are the loads that the friction laws read:

    rho = rho0 + K tau,   tau = law(rho)                                          (25) reduced to tau

rho0 are the loads without friction and K those caused by unit friction, both under one closure. The loops
see only (rho0, K, law). A sweep tau -> law(rho0 + K tau) is the paper's fixed-point iteration (27) written
on tau, because x_{i+1} depends on x_i through F(lam_i) alone.

K is a matrix here, and known by its products alone in `_product_problem`.
"""

import abc
import math
from collections.abc import Callable
from typing import NamedTuple, Self, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from .._system._directions import directions_of
from .._system._friction import AbstractFriction, friction_force, largest_changes, load_rows, memories, slip_kinds
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._by_number import combine, solve_few
from .._tools._linear_map import LinearMap
from .._tools._module import replace_fields
from .._tools._numbers import (
    Numeric,
    are_known,
    are_numbers,
    fori_loop,
    of_model,
    product,
    solution,
    stop_gradient,
    take,
    xp,
)
from .._tools._value import value

T = TypeVar("T")

# Samples of a batch on numbers that a program of the laws takes.
_BATCHES = 64, 512, 8192
_COLUMNS = 16  # of changes, or a multiple of them
# Powers of a matrix that the bound of its spectral radius takes.
_POWERS = 6


@value
class Law:
    """The friction laws of all groups at a state, as a function of the loads alone.

    `pushing` are loads of one-sided contacts, if there are some: one that would pull presses nothing.
    """

    groups: tuple[AbstractFriction, ...]
    rate: Float[Numeric, " p"]
    sense: Float[Numeric, " p"]
    state: State
    memory: tuple[PyTree, ...] | None = None  # that of `state` if not given
    pushing: Bool[Numeric, " l"] | None = None

    @classmethod
    def of(cls, system: AbstractSystem, rate: Numeric, sense: Numeric, state: State) -> Self:
        """Those of a system."""
        pushing = None
        if system.names.one_sided and system.friction:
            pushing = take(xp.asarray(system.names.is_one_sided), load_rows(system.friction))
        return cls(system.friction, rate, sense, state, pushing=pushing)

    def __call__(self, loads: Float[Numeric, "... l"]) -> Float[Numeric, "... p"]:
        return self.linearised(loads)[0] if self._is_known(loads) else self.force(loads)

    def force(self, loads: Float[Numeric, " l"]) -> Float[Numeric, " p"]:
        """The same, traced."""
        if self.pushing is not None:
            loads = jnp.where(self.pushing & (loads < 0), 0.0, loads)
        return friction_force(self.groups, loads, self.rate, self.sense, self.state, self.memory)

    def _is_known(self, loads: Float[Numeric, "... l"]) -> bool:
        return are_numbers(loads, self.rate, self.sense) and are_known(self.groups)

    @property
    def is_open(self) -> Bool[Numeric, " p"]:
        """For each slip whether its joint has no sense."""
        directions = directions_of(self.groups)
        return self.sense == 0 if directions is None else directions.every(self.sense == 0)

    def limits(
        self, loads: Float[Numeric, "... l"], either: Bool[Numeric, " p"]
    ) -> tuple[Float[Numeric, "... p"], Float[Numeric, "... p"]]:
        """Least and largest friction of slips that may have either sense; of the others that of their own."""
        one, two = (replace_fields(self, sense=xp.where(either, sense, self.sense))(loads) for sense in (1.0, -1.0))
        return xp.minimum(one, two), xp.maximum(one, two)

    def apart(self) -> "Law":
        """The same law, joint by joint."""
        whole = zip(self.groups, memories(self.groups, self.state), strict=True)
        groups, parts = zip(*(part for group, memory in whole for part in group.apart(memory)), strict=True)
        return replace_fields(self, groups=groups, memory=parts)

    def largest_changes(self, loads: Float[Numeric, "l columns"]) -> Float[Numeric, "p columns"]:
        """Bounds of |change of friction| that each column of changes of the loads can cause at any loads."""
        if not self._is_known(loads):
            return largest_changes(self.groups, loads, self.rate, self.state)
        count = loads.shape[1]
        padded = np.pad(loads, ((0, 0), (0, -count % _COLUMNS)))
        return largest_changes(self.groups, padded, self.rate, self.state)[:, :count]

    def slope(self, loads: Float[Numeric, "... l"]) -> Float[Numeric, "... p l"]:
        """Derivative of the friction forces with respect to the loads, F_lam of Eq. (35) reduced."""
        return self.linearised(loads)[1] if self._is_known(loads) else jax.jacfwd(self.force)(loads)

    def linearised(self, loads: Float[Numeric, "... l"]) -> tuple[Float[Numeric, "... p"], Float[Numeric, "... p l"]]:
        """Both; of known numbers also sample by sample, along axes in front."""
        if not self._is_known(loads):
            return self.force(loads), self.slope(loads)
        return _linearised(self, loads) if loads.ndim == 1 else _of_samples(self, loads)


@of_model
def _linearised(law: Law, loads: Float[Numeric, " l"]) -> tuple[Float[Numeric, " p"], Float[Numeric, "p l"]]:
    """Friction and its slope, which numbers ask for together."""
    return law.force(loads), jax.jacfwd(law.force)(loads)


@of_model
def _linearised_each(law: Law, loads: Float[Numeric, "s l"]) -> tuple[Float[Numeric, "s p"], Float[Numeric, "s p l"]]:
    return jax.vmap(lambda own: (law.force(own), jax.jacfwd(law.force)(own)))(loads)


def _of_samples(law: Law, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Friction and its slope in batches of few sizes, so that few programs are compiled."""
    flat = loads.reshape(math.prod(loads.shape[:-1]), loads.shape[-1])
    size = next((size for size in _BATCHES if size >= len(flat)), _BATCHES[-1])
    parts = [flat[first : first + size] for first in range(0, len(flat), size)]
    padded = [np.pad(part, ((0, size - len(part)), (0, 0)), mode="edge") for part in parts]
    pairs = zip(*(_linearised_each(law, part) for part in padded), strict=True)
    force, slope = (np.concatenate(pair)[: len(flat)] for pair in pairs)
    return tuple(x.reshape(loads.shape[:-1] + x.shape[1:]) for x in (force, slope))  # pyright: ignore[reportReturnType]


class Sizes(NamedTuple):
    """A size of the forces and one of the moments."""

    linear: Float[Numeric, "..."]
    angular: Float[Numeric, "..."]

    @classmethod
    def of(cls, entries: Float[Numeric, "... d"], angular: Bool[Numeric, " d"]) -> "Sizes":
        """The largest entry of each kind, 1 if there is none but zeros."""
        largest = (_largest(xp.where(kind, entries, 0.0)) for kind in (~angular, angular))
        return cls(*(xp.where(_is_some(size), size, 1.0) for size in largest))

    def at(self, angular: Bool[Numeric, " d"]) -> Float[Numeric, "... d"]:
        """The size of each entry's kind."""
        return xp.where(angular, self.angular[..., None], self.linear[..., None])

    def larger(self, other: "Sizes") -> "Sizes":
        """The larger of both, kind by kind."""
        return Sizes(*map(xp.maximum, self, other))


@value
class AbstractFrictionProblem(abc.ABC):
    """tau = law(rho0 + K tau), with the sizes that make residuals comparable.

    - `rho0`, `gain`: loads without friction, shape (l,), and K, shape (l, p), or its products.
    - `law`: the friction laws.
    - `angular_loads`, `angular_slips`: which loads and frictions are moments.
    - `friction_sizes`: the largest friction of each kind, at the first sweep from rho0, whichever way joints slide.
    - `unsized`: whether a kind has no friction at the first sweep, so that its size says nothing.
    - `load_sizes`: the largest load of each kind, rho0 or what friction of its size can cause, so that a relative
      change of friction is no larger change of the loads; of products rho0 alone.
    """

    rho0: Float[Numeric, "... l"]
    gain: Numeric
    law: Law
    angular_loads: Bool[Numeric, " l"]
    angular_slips: Bool[Numeric, " p"]
    load_sizes: Sizes
    friction_sizes: Sizes
    unsized: Bool[Numeric, "..."]

    @classmethod
    def make(
        cls, rho0: Float[Numeric, "... l"], gain: Numeric | LinearMap, law: Law, angular_loads: Bool[Numeric, " l"]
    ) -> Self:
        """The problem, given which loads are moments."""
        angular_slips = xp.asarray(slip_kinds(law.groups).angular)
        given, effect, friction = stop_gradient((rho0, gain, law))
        first, directions = xp.abs(friction(given)), directions_of(friction.groups)
        first = first if directions is None else directions.whole(first)
        friction_sizes = Sizes.of(first, angular_slips)
        unsized = _nothing(first, angular_slips) | _nothing(first, ~angular_slips)
        load_sizes = Sizes.of(cls.reached(xp.abs(given), effect, angular_slips, friction_sizes), angular_loads)
        return cls(rho0, gain, law, angular_loads, angular_slips, load_sizes, friction_sizes, unsized)

    @classmethod
    @abc.abstractmethod
    def reached(cls, loads: Numeric, gain: Numeric | LinearMap, angular: Numeric, friction: Sizes) -> Numeric:
        """Loads without friction, or what friction of these sizes can cause where that is more."""

    @abc.abstractmethod
    def sized_at(self, tau: Float[Numeric, "... p"]) -> Self:
        """The same problem, its sizes at least those of the friction tau; sizes have no derivatives."""

    @abc.abstractmethod
    def solution(self, rho: Float[Numeric, "... l"], right: Float[Numeric, "... p"]) -> Float[Numeric, "... p"]:
        """(I - law'(rho) K)^-1 right."""

    @abc.abstractmethod
    def newton(
        self, rho: Float[Numeric, "... l"], tau: Float[Numeric, "... p"]
    ) -> tuple[Float[Numeric, "... p"], Float[Numeric, "... p"]]:
        """What the friction tau of loads rho misses, tau - law(rho), and Newton's change of it."""

    @abc.abstractmethod
    def searched(
        self, search: Callable[[], T], rtol: Float[Array, ""] | None, start: Float[Numeric, "... p"], *, near: bool
    ) -> T:
        """What a search finds, or what stands for it where it takes matrices; `near` says of which kind it is, one for
        a root beside the start."""

    @abc.abstractmethod
    def contraction(self, rho: Float[Numeric, "... l"]) -> Float[Numeric, "..."]:
        """Upper bound of the spectral radius of one sweep's derivative at loads: below 1 sweeps contract there."""

    @abc.abstractmethod
    def contraction_anywhere(self) -> Float[Numeric, "..."]:
        """Upper bound of `contraction` at all friction: below 1 there is one solution, and sweeps find it."""

    @abc.abstractmethod
    def contraction_on_way(self, rho: Float[Numeric, "... l"]) -> Float[Numeric, "..."]:
        """That of a motion at loads on its way, as far as it is known."""

    @property
    def friction_size(self) -> Float[Numeric, "... p"]:
        """Size of each friction: that of its kind."""
        return self.friction_sizes.at(self.angular_slips)

    @property
    def load_size(self) -> Float[Numeric, "... l"]:
        """Size of each load: that of its kind."""
        return self.load_sizes.at(self.angular_loads)

    def at(self, rho0: Float[Numeric, "... l"]) -> Self:
        """The same problem with other loads without friction."""
        return type(self).make(rho0, self.gain, self.law, self.angular_loads)

    def loads(self, tau: Float[Numeric, "... p"]) -> Float[Numeric, "... l"]:
        """rho = rho0 + K tau."""
        return self.rho0 + product(self.gain, tau)

    def change_of_friction(self, change: Float[Numeric, "... p"]) -> Float[Numeric, "..."]:
        """Largest change of tau, relative to the size of its kind."""
        return xp.max(xp.abs(change) / self.friction_size, axis=-1)

    def change_of_load(self, change: Float[Numeric, "... l"]) -> Float[Numeric, "..."]:
        """Largest change of rho, relative to the size of its kind."""
        return xp.max(xp.abs(change) / self.load_size, axis=-1)


@value
class FrictionProblem(AbstractFrictionProblem):
    """The problem by a matrix K, shape (l, p)."""

    @property
    def alone(self) -> "FrictionProblem":
        """As a batch of one, on numbers."""
        own = {name: getattr(self, name) for name in ("rho0", "load_sizes", "friction_sizes", "unsized")}
        return replace_fields(self, **jax.tree.map(lambda x: np.asarray(x)[None], own))

    def of(self, samples: np.ndarray) -> "FrictionProblem":
        """Some of a batch on numbers."""
        own = {name: getattr(self, name) for name in ("rho0", "load_sizes", "friction_sizes", "unsized")}
        own = jax.tree.map(lambda x: x[samples], own if self.gain.ndim == 2 else {**own, "gain": self.gain})
        return replace_fields(self, **own)

    @classmethod
    def reached(cls, loads: Numeric, gain: Numeric, angular: Numeric, friction: Sizes) -> Numeric:
        return xp.maximum(loads, _caused(gain, angular, friction))

    def sized_at(self, tau: Numeric) -> "FrictionProblem":
        tau, gain = stop_gradient((tau, self.gain))
        friction = self.friction_sizes.larger(Sizes.of(xp.abs(tau), self.angular_slips))
        caused = _caused(gain, self.angular_slips, friction)
        loads = self.load_sizes.larger(Sizes.of(caused, self.angular_loads))
        return replace_fields(self, load_sizes=loads, friction_sizes=friction)

    def slope(self, rho: Float[Numeric, "... l"]) -> Float[Numeric, "... p p"]:
        """law'(rho) K, the derivative of one sweep."""
        if are_numbers(rho, self.gain):
            return self.law.slope(rho) @ self.gain
        return jax.vmap(lambda column: jax.jvp(self.law, (rho,), (column,))[1], in_axes=1, out_axes=1)(self.gain)

    def linearised(self, rho: Float[Numeric, "... l"]) -> tuple[Float[Numeric, "... p"], Float[Numeric, "... p p"]]:
        """law(rho) and law'(rho) K, which known numbers ask for together."""
        if are_numbers(rho, self.gain):
            force, slope = self.law.linearised(rho)
            return force, slope @ self.gain
        return self.law(rho), self.slope(rho)

    def solution(self, rho: Numeric, right: Numeric) -> Numeric:
        return solve_few(self.root_slope(rho), right)

    def newton(self, rho: Numeric, tau: Numeric) -> tuple[Numeric, Numeric]:
        force, slope = self.linearised(rho)
        residual = tau - force
        return residual, -solution(xp.eye(tau.shape[-1], dtype=tau.dtype) - slope, residual)

    def searched(self, search: Callable[[], T], rtol: Array | None, start: Numeric, *, near: bool) -> T:
        return search()

    def root_slope(self, rho: Float[Numeric, "... l"]) -> Float[Numeric, "... p p"]:
        """I - law'(rho) K."""
        slope = self.slope(rho)
        return xp.eye(slope.shape[-1], dtype=slope.dtype) - slope

    def contraction(self, rho: Numeric) -> Float[Numeric, "..."]:
        matrix = xp.abs(self.slope(rho))
        return _radius_bound(matrix * self.friction_size[..., None, :] / self.friction_size[..., None])

    def contraction_anywhere(self) -> Float[Numeric, "..."]:
        law, gain = stop_gradient((self.law, self.gain))
        bound = _radius_bound(law.largest_changes(gain))
        return xp.where(xp.isnan(bound), xp.inf, bound)

    def contraction_on_way(self, rho: Numeric) -> Float[Numeric, "..."]:
        return self.contraction_anywhere()


def _radius_bound(matrix: Float[Numeric, "... p p"]) -> Float[Numeric, "..."]:
    """Upper bound of the spectral radius of a matrix A >= 0.

    Collatz and Wielandt: max_i (A v)_i / v_i over positive v; powers of A bring it down to the spectral radius.
    """

    def powered(_: Numeric, vector: Numeric) -> Numeric:
        image = product(matrix, vector)
        size = xp.max(image, axis=-1, keepdims=True)
        return xp.where(size > 0, image / xp.where(size > 0, size, 1.0), vector) + 1e-3

    vector = fori_loop(0, _POWERS, powered, xp.ones_like(matrix[..., 0, :]))
    return xp.max(product(matrix, vector) / vector, axis=-1)


def _caused(gain: Numeric, angular: Numeric, friction: Sizes) -> Numeric:
    """Bound of the loads that friction of these sizes causes: |K| times the sizes."""
    linear, angles = (xp.sum(xp.where(kind, xp.abs(gain), 0.0), axis=-1) for kind in (~angular, angular))
    return linear * friction.linear[..., None] + angles * friction.angular[..., None]


def _nothing(size: Numeric, kind: Numeric) -> Numeric:
    """Whether there are sizes of this kind, and all are 0."""
    return xp.any(kind) & ~_is_some(_largest(xp.where(kind, size, 0.0)))


def _is_some(size: Numeric) -> Numeric:
    """Whether a size is more than rounding leaves of nothing: its square does not underflow."""
    return size > float(xp.finfo(size.dtype).tiny) ** 0.5


def _largest(size: Numeric) -> Numeric:
    if size.ndim > 1:
        return xp.max(size, axis=-1, initial=0.0)
    return combine(xp.maximum, lambda size: xp.max(size, initial=0.0), size)
