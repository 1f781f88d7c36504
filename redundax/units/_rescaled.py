"""A system, its states and its solutions in other units, Eq. (16).

With s the factors of coordinates, rows or slips, T that of time and e that of energy (see `_units`),

    Phi' = s_row Phi,   qd' = s qd / T,   M' = e T^2 M / (s s^T),   Q' = e Q / s,   lam' = e lam / s_row,

which changes the blocks of Phi_q as (16) does: u^-1 in moment-type rows of linear coordinates, u in force-type
rows of angular ones. The chart q is left as it is; velocities and all else are in the new units.
"""

import dataclasses
from typing import Self

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int, PyTree

from .._closures._closure import AbstractClosure, check_closure
from .._closures._play import Play
from .._solve._solution import Solution
from .._system._axis import Axis
from .._system._friction import AbstractFriction
from .._system._joint_coordinates import AbstractJointCoordinates, JointMotion
from .._system._names import Names
from .._system._state import State
from .._system._system import AbstractSystem, check_system, check_system_at
from .._system._units import Units, check_units_given
from .._tools._errors import RedundaxError
from .._tools._module import check_kind, replace_fields


class Rescaled(AbstractSystem):
    """The system `inner` in other units."""

    inner: AbstractSystem
    units: Units

    def __init__(self, inner: AbstractSystem, units: Units):
        self.inner, self.units = inner, units

    @property
    def _names(self) -> Names:
        """Those of the inner system, with the new units; the chart stays, so that positions have none."""
        names = self.inner.names
        return dataclasses.replace(names, units=names.units.in_units(self.units), adds=False, centres=Axis((), ()))

    @property
    def friction(self) -> tuple[AbstractFriction, ...]:
        """Friction of the inner system, group by group, in the new units."""
        return tuple(_RescaledFriction(group, self.inner, self.units) for group in self.inner.friction)

    @property
    def radian(self) -> ArrayLike:
        """One radian in the new unit."""
        return self.units.angle * self.inner.radian

    @property
    def length(self) -> ArrayLike:
        """That of the inner system in the new unit."""
        return self.units.length * self.inner.length

    @property
    def has_length(self) -> bool:
        return self.inner.has_length

    @property
    def _scale(self) -> Float[Array, " n"]:
        return self.units.of(self.coordinates)

    @property
    def constant_mass(self) -> bool:
        return self.inner.constant_mass

    @property
    def diagonal_mass(self) -> bool:
        return self.inner.diagonal_mass

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, inner=self.inner.anonymous)

    def mass(self, q: Array, t: Array) -> Float[Array, "n n"]:
        inner = self.inner.mass(q, t / self.units.time)
        scale = self._scale / self.units.time
        return self.units.energy * inner / (scale[:, None] * scale)

    def constraint(self, q: Array, t: Array) -> Float[Array, " m"]:
        return self.units.of(self.rows) * self.inner.constraint(q, t / self.units.time)

    def jacobian(self, q: Array, t: Array) -> Float[Array, "m n"]:
        inner = self.inner.jacobian(q, t / self.units.time)
        return self.units.of(self.rows)[:, None] * inner / self._scale

    def velocity_constraint(self, q: Array, qd: Array, t: Array, u: Array | None = None) -> Float[Array, " m"]:
        rates = qd * self.units.time / self._scale
        inner = self.inner.velocity_constraint(q, rates, t / self.units.time, u)
        return self.units.of(self.rows) / self.units.time * inner

    @property
    def may_bend(self) -> bool:
        return self.inner.may_bend

    def load(self, state: State) -> Float[Array, " n"]:
        inner = self.inner.load(_restored_state(state, self.inner, self.units))
        return self.units.of_force(self.coordinates) * inner

    @property
    def joint_coordinates(self) -> AbstractJointCoordinates:
        """Those of the inner system, in the new units."""
        return _RescaledJoints(self.inner.joint_coordinates, self.inner.anonymous, self.units)

    def retract(self, q: Array, d: Array) -> Array:
        return self.inner.retract(q, d / self._scale)

    def start(self, q: Array, t: Array) -> Array:
        return self.inner.start(q, t / self.units.time)

    @property
    def doubt(self) -> str:
        return self.inner.doubt

    @property
    def adds(self) -> bool:
        return False

    @property
    def reference(self) -> Float[Array, "..."]:
        """That of the inner system, in its chart."""
        return self.inner.reference


class _RescaledJoints(AbstractJointCoordinates):
    inner: AbstractJointCoordinates
    system: AbstractSystem
    units: Units

    @property
    def wraps(self) -> np.ndarray:
        return self.inner.wraps

    @property
    def radian(self) -> ArrayLike:
        return self.units.angle * self.inner.radian

    @property
    def opposite(self) -> "_RescaledJoints":
        return replace_fields(self, inner=self.inner.opposite)

    def positions(self, state: State) -> Array:
        shift = self.units.of(self.system.names.joint_coordinates)
        return shift * self.inner.positions(_restored_state(state, self.system, self.units))

    def motion(self, state: State, acceleration: Array) -> JointMotion:
        shift, time = self.units.of(self.system.names.joint_coordinates), self.units.time
        scale = time**2 / self.units.of(self.system.coordinates)
        inner = self.inner.motion(_restored_state(state, self.system, self.units), scale * acceleration)
        return JointMotion(shift * inner.position, shift / time * inner.rate, shift / time**2 * inner.acceleration)

    def reactions(self, state: State, multipliers: Array) -> Array:
        names, of_force = self.system.names, self.units.of_force
        state = _restored_state(state, self.system, self.units)
        return of_force(names.reactions) * self.inner.reactions(state, multipliers / of_force(names.rows))


class _RescaledFriction(AbstractFriction):
    inner: AbstractFriction
    system: AbstractSystem
    units: Units

    def __init__(self, inner: AbstractFriction, system: AbstractSystem, units: Units):
        self.inner, self.system, self.units = inner, system, units

    @property
    def rows(self) -> Int[Array, "..."]:
        return self.inner.rows

    @property
    def slips(self) -> Axis:
        return self.inner.slips

    @property
    def has_sense(self) -> bool:
        return self.inner.has_sense

    @property
    def may_bend(self) -> bool:
        """As the friction of the inner system."""
        return self.inner.may_bend

    @property
    def has_direction(self) -> bool:
        """As the friction of the inner system."""
        return self.inner.has_direction

    @property
    def width(self) -> int:
        """As the friction of the inner system."""
        return self.inner.width

    @property
    def arms(self) -> Array:
        """So that velocities of the surfaces stay as they are."""
        return self.inner.arms / self.units.of(self.slips)

    @property
    def has_convex_limits(self) -> bool:
        """As the friction of the inner system."""
        return self.inner.has_convex_limits

    @property
    def anonymous(self) -> Self:
        return replace_fields(self, inner=self.inner.anonymous, system=self.system.anonymous)

    def slip(self, q: Array, t: Array) -> Array:
        return self.units.of(self.slips) * self.inner.slip(q, t / self.units.time)

    def force(self, loads: Array, rate: Array, sense: Array, memory: PyTree, state: State) -> Array:
        tau = self.inner.force(
            loads / self.units.of_force(self.system.rows)[self.rows],
            self._inner_rate(rate),
            sense,
            memory,
            _restored_state(state, self.system, self.units),
        )
        return self.units.of_force(self.slips) * tau

    def largest_change(self, change: Array, rate: Array, memory: PyTree, state: State) -> Array:
        change = change / self.units.of_force(self.system.rows)[self.rows]
        inner = _restored_state(state, self.system, self.units)
        return self.units.of_force(self.slips) * self.inner.largest_change(
            change, self._inner_rate(rate), memory, inner
        )

    def memory_size(self) -> PyTree:
        """That of the inner group: internal states stay as they are."""
        return self.inner.memory_size()

    def memory_rate(self, rate: Array, memory: PyTree, state: State) -> PyTree:
        inner = self.inner.memory_rate(self._inner_rate(rate), memory, _restored_state(state, self.system, self.units))
        return jax.tree.map(lambda x: x / self.units.time, inner)

    def _inner_rate(self, rate: Array) -> Array:
        return rate * self.units.time / self.units.of(self.slips)


def in_units(system: AbstractSystem, units: Units) -> AbstractSystem:
    """The same system with all its numbers in other units, (16).

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        system = rx.units.in_units(mechanism, millimetres)
        solution = rx.solve(system, rx.units.state_in_units(state, mechanism, millimetres))
        solution = rx.units.solution_from_units(solution, mechanism, millimetres)  # back in metres
        ```
    """
    _check(system, units)
    return Rescaled(system, units)


def state_in_units(state: State, system: AbstractSystem, units: Units) -> State:
    """A state of `system` as a state of `in_units(system, units)`.

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        rx.units.state_in_units(state, mechanism, millimetres).qd  # mm/s and rad/s
        ```
    """
    check_kind("state", state, State, "a state", "Give that first, then its system.")
    check_system_at(system, state)
    _check(system, units)
    return State(state.q, state.qd * units.of(system.coordinates) / units.time, state.t * units.time, state.memory)


class _RescaledClosure(AbstractClosure):
    inner: AbstractClosure

    @property
    def is_constant(self) -> bool:
        return self.inner.is_constant

    def by_place(self, system: AbstractSystem) -> "_RescaledClosure":
        return replace_fields(self, inner=self.inner.by_place(system.inner if isinstance(system, Rescaled) else system))

    def clearances(self, system: AbstractSystem) -> Play | None:
        play = self.inner.clearances(system.inner) if isinstance(system, Rescaled) else None
        if not isinstance(system, Rescaled) or play is None:
            return None
        first = np.array([rows[0] for rows in play.rows])
        return Play(play.clearance * system.units.of(system.rows)[first], play.rows)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        if not isinstance(system, Rescaled):
            raise RedundaxError(
                "Argument `closure` comes from `closure_in_units` and must go with a system of `in_units`, but the "
                "system is none. Give the closure that it was made from."
            )
        W, d = self.inner.compliance(system.inner, _restored_state(state, system.inner, system.units))
        scale = system.units.of(system.rows)
        return scale[:, None] * W * scale / system.units.energy, scale * d


def closure_in_units(closure: AbstractClosure) -> AbstractClosure:
    """The closure of a system as one of `in_units(system, units)`: the same choice among the same solutions.

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        there = rx.units.in_units(mechanism, millimetres), rx.units.state_in_units(state, mechanism, millimetres)
        joints = rx.Compliance(W=jnp.full(12, 1e-8))  # m/N, rad/(N m)
        rx.solve(*there, closure=rx.units.closure_in_units(joints))
        ```
    """
    check_closure(closure)
    return _RescaledClosure(closure)


def solution_from_units(solution: Solution, system: AbstractSystem, units: Units) -> Solution:
    """A solution whose numbers are in `units`, mapped back to the units of `system`.

    ??? example

        ```python
        millimetres = rx.units.Units(length=1000.0)
        there = rx.units.in_units(mechanism, millimetres), rx.units.state_in_units(state, mechanism, millimetres)
        rx.units.solution_from_units(rx.solve(*there), mechanism, millimetres).multipliers  # N and N m
        ```
    """
    check_kind("solution", solution, Solution, "a solution", "Give what `rx.solve` gives.")
    _check(system, units)
    scale, batch = units.of(system.coordinates) / units.time**2, solution.acceleration.shape[:-1]
    return replace_fields(
        solution,
        names=system.names,
        acceleration=solution.acceleration / scale,
        multipliers=solution.multipliers / units.of_force(system.rows),
        friction=solution.friction / units.of_force(system.slips),
        joint_coordinates=jax.tree.map(lambda x: jnp.broadcast_to(x, batch + x.shape), system.joint_coordinates),
        state=None if solution.state is None else _restored_state(solution.state, system, units),
    )


def _check(system: object, units: object) -> None:
    check_system(system)
    check_units_given(units)


def _restored_state(state: State, system: AbstractSystem, units: Units) -> State:
    scale = units.time / units.of(system.coordinates)
    return State(state.q, state.qd * scale, state.t / units.time, state.memory)
