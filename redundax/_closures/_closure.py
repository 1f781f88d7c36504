"""Closures: the k equations that choose one multiplier vector from the family lam + N z.

Every constraint row has a compliance (matrix W) and a misfit d, the residual of the parts as they really
are. Stiff elastic joints satisfy W lam = Phi_q dq + d, hence N^T W lam = N^T d and

    lam = lam_p + G (d - W lam_p),   G = N (N^T W N)^-1 N^T = (P W P)^+

for any particular lam_p. W = I, d = h is the paper's (9), (12) with h, and d = 0 the Moore-Penrose answer.
"""

import abc
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Integer

from .._equations._matrices import matrices_of
from .._sparse._symbolic import Symbolic
from .._system._names import DRIVE, ByName, vector
from .._system._state import State
from .._system._system import AbstractSystem
from .._system._units import Units, checked_units
from .._tools._compilation import compiled
from .._tools._errors import RedundaxError
from .._tools._module import as_float, check_kind, is_concrete, on_device, optional_figure, positive
from .._tools._no_answer import nan_where
from .._tools._numbers import are_known, are_numbers, as_numbers, of_model, or_one, xp
from .._tools._value import AbstractModule
from ._play import Play, refuse_play


class AbstractClosure(AbstractModule):
    """Chooses the self-stress by compliance and misfit."""

    @abc.abstractmethod
    def compliance(
        self, system: AbstractSystem, state: State
    ) -> tuple[Float[Array, "m m"], Float[Array, " m"] | Float[Array, ""]]:
        """Compliance W, symmetric positive semidefinite, and misfit d at a state; a number stands for m equal ones."""

    def by_joint(
        self, system: AbstractSystem, state: State
    ) -> tuple[Float[Array, "m j"], Float[Array, " m"] | Float[Array, ""]]:
        """The same where matrices are sparse: W as entries of each row with its mates, the rows of its joint.

        NaN where it couples rows of different joints.
        """
        compliance, misfit = self.compliance(system, state)
        return with_mates(compliance, system), misfit

    @property
    def is_constant(self) -> bool:
        """Whether both are the same in every state."""
        return False

    def by_place(self, system: AbstractSystem) -> "AbstractClosure":
        """The same with places of rows for their names, which compiled programs do not know."""
        return self

    def of_drives(self, names: Sequence[str]) -> tuple[Float[Array, " d"], Float[Array, " d"]]:
        """Compliance and misfit of drives, by the coordinates that they move: stiff and in step unless it says so."""
        none = xp.zeros(len(names))
        return none, none

    def clearances(self, system: AbstractSystem) -> Play | None:
        """Play of rows of the system, in its units; none unless it says so."""
        return None

    def drive_errors(self, state: State) -> Float[Array, "..."]:
        """More misfit of drives, that depends on the state."""
        return xp.zeros((), state.qd.dtype)


def check_closure(closure: object) -> None:
    """Refuse what is no closure."""
    check_kind(
        "closure",
        closure,
        AbstractClosure,
        "a closure",
        "Give `rx.MinimumNorm()`, `rx.Compliance(...)` or `rx.ElasticJoints(...)`, say. Bounds such as `rx.PreloadBox` "
        "and `rx.MisfitBox` go to `rx.band`.",
    )


class Elasticity(NamedTuple):
    """All that the equations know of a closure: W, (m, m), and d, (m,) or a number for m equal entries.

    Where matrices are sparse W has the shape (m, j), entries of each row with its mates, itself first.
    """

    compliance: Float[Array, "m m"] | Float[Array, "m j"]
    misfit: Float[Array, " m"] | Float[Array, ""]


def without_rows(elasticity: Elasticity, kept: Bool[Array, " m"]) -> Elasticity:
    """The closure of the other rows: what is left out is coupled with none and fits."""
    compliance, misfit = elasticity
    own = xp.diagonal(compliance)
    alone = xp.where(own > 0, own, or_one(xp.max(own, initial=0.0)))
    both = kept[:, None] & kept
    return Elasticity(xp.where(both, compliance, xp.diag(xp.where(kept, 0.0, alone))), xp.where(kept, misfit, 0.0))


def of_kept_rows(elasticity: Elasticity, system: AbstractSystem) -> Elasticity:
    """The closure of the rows that hold where contacts are open for good, and none is left that closes."""
    return elasticity if system.kept is None or system.names.one_sided else without_rows(elasticity, system.kept)


def elasticity(closure: AbstractClosure, system: AbstractSystem, state: State, *, play: bool = False) -> Elasticity:
    """Compliance and misfit at a state, checked; of one with play where the call knows it.

    Outside of transformations they have the same shapes for every closure, so that no program is compiled for one.
    """
    if not play:
        refuse_play(closure.clearances(system))
    whole, closure = are_known(closure, state, system), placed(closure, system)
    return matrices_of(system).run(_by_matrix, _by_joint)(closure, system.anonymous, state, whole=whole)


def _by_matrix(closure: AbstractClosure, system: AbstractSystem, state: State, *, whole: bool) -> Elasticity:
    m, dtype = len(system.rows), state.qd.dtype
    given = (closure.compliance if closure.is_constant else partial(_at_state, closure))(system, state)
    compliance, misfit = (xp.asarray(x, dtype) for x in (as_numbers(given) if are_numbers(state) else given))
    if compliance.shape != (m, m) or misfit.shape not in ((), (m,)):
        raise RedundaxError(
            f"Argument `closure` must give a compliance of shape (m, m) = ({m}, {m}) and a misfit that is a number or "
            f"has shape ({m},), but gives {compliance.shape} and {misfit.shape}. Change what its `compliance` returns."
        )
    return of_kept_rows(Elasticity(compliance, xp.broadcast_to(misfit, (m,)) if whole else misfit), system)


@of_model
def _at_state(closure: AbstractClosure, system: AbstractSystem, state: State) -> tuple[Array, Array]:
    return tuple(jnp.asarray(x, state.qd.dtype) for x in closure.compliance(system, state))  # pyright: ignore


@compiled
def _by_joint(closure: AbstractClosure, system: AbstractSystem, state: State, *, whole: bool) -> Elasticity:
    compliance, misfit = (jnp.asarray(x, state.qd.dtype) for x in closure.by_joint(system, state))
    return Elasticity(compliance, jnp.broadcast_to(misfit, (len(system.rows),)) if whole else misfit)


class _Constant(AbstractClosure):
    given: Elasticity
    play: Play | None = None

    def clearances(self, system: AbstractSystem) -> Play | None:
        return self.play

    def compliance(self, system: AbstractSystem, state: State) -> Elasticity:
        return self.given

    def by_joint(self, system: AbstractSystem, state: State) -> Elasticity:
        return self.given


def constant(elasticity: Elasticity, play: Play | None = None) -> AbstractClosure:
    """The closure of this compliance, misfit and play."""
    return _Constant(elasticity, play)


def mates_of(system: AbstractSystem) -> Integer[Array, "m j"]:
    """The rows of the joint of each row, itself first, m for none."""
    return cast(Symbolic, system.symbolic).mates


def with_mates(compliance: Float[Array, "m m"], system: AbstractSystem) -> Float[Array, "m j"]:
    """Entries of a matrix that couples rows of one joint only, else NaN: W_ij beside sqrt(W_ii W_jj) is rounding."""
    mates = mates_of(system)
    own = jnp.where(mates < len(mates), jnp.take_along_axis(compliance, mates, axis=1, mode="clip"), 0.0)
    others = compliance.at[jnp.arange(len(own))[:, None], mates].set(0.0, mode="drop")
    softness = jnp.sqrt(jnp.abs(jnp.diagonal(compliance)))
    rounding = 1e3 * float(jnp.finfo(own.dtype).eps) * softness[:, None] * softness
    return nan_where(~jnp.all(jnp.abs(others) <= rounding), own)


def alone(diagonal: Float[Array, " m"], system: AbstractSystem) -> Float[Array, "m j"]:
    """Entries of each row with its mates, of a matrix that couples no rows."""
    return jnp.zeros(mates_of(system).shape, diagonal.dtype).at[:, 0].set(diagonal)


def for_motion(closure: AbstractClosure, system: AbstractSystem, state: State) -> AbstractClosure:
    """The same closure for the states of a motion; all that do not depend on the state are one class to programs."""
    return _Constant(elasticity(closure, system, state)) if closure.is_constant else placed(closure, system)


def placed(closure: AbstractClosure, system: AbstractSystem) -> AbstractClosure:
    """`by_place`; of a system with drives that of its own rows, and what the closure says of the drives."""
    base = system.undriven
    if base is system or isinstance(closure, _OfDrives | _Constant):  # of all rows already
        return closure.by_place(system)
    coordinates = [name.removesuffix(DRIVE) for name in system.rows.labels[len(base.rows) :]]
    return _OfDrives(closure.by_place(base), *closure.of_drives(coordinates))


class _OfDrives(AbstractClosure):
    """A closure of the rows of a system, and compliance and misfit of the drives, whose rows stand behind."""

    closure: AbstractClosure
    softness: Float[Array, " d"]
    error: Float[Array, " d"]

    @property
    def is_constant(self) -> bool:
        return self.closure.is_constant

    def clearances(self, system: AbstractSystem) -> Play | None:
        return self.closure.clearances(system.undriven)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        m, dtype = len(system.undriven.rows), state.qd.dtype
        W, d = (xp.asarray(x, dtype) for x in self.closure.compliance(system.undriven, state))
        none, softness = xp.zeros((m, self.softness.size), dtype), xp.diag(xp.asarray(self.softness, dtype))
        rows = xp.concatenate([W, none], axis=1), xp.concatenate([none.T, softness], axis=1)
        misfit = xp.broadcast_to(d, (m,)), xp.asarray(self.error + self.closure.drive_errors(state), dtype)
        return xp.concatenate(rows), xp.concatenate(misfit)


def minimum_norm(m: int, dtype: DTypeLike) -> Elasticity:
    """That of the Moore-Penrose pick for m rows."""
    return Elasticity(xp.eye(m, dtype=dtype), xp.zeros((), dtype))


class MinimumNorm(AbstractClosure):
    """The Moore-Penrose pick x = A^+ b + (I - A^+ A) h, Eq. (9), in the units of the system or in others.

    The first n entries of h act only where accelerations are not unique, which a solve flags, so only the
    last m entries are used.

    ??? example

        ```python
        rx.solve(mechanism, state)  # h = 0
        rx.solve(mechanism, state, closure=rx.MinimumNorm(h=100.0))
        ```

    **Arguments:**

    - `h`: arbitrary vector of Eq. (9), shape (n + m,), a number stands for that many equal entries; 0 gives
      the minimum-norm multipliers.
    - `units`: units in which the norm is taken and h is given, as factors from the units of the system.
    """

    h: Float[Array, ""] | Float[Array, " n+m"] | None = eqx.field(converter=optional_figure("h"), default=None)
    units: Units | None = eqx.field(converter=checked_units, default=None)

    @property
    def is_constant(self) -> bool:
        return True

    def of_drives(self, names: Sequence[str]) -> tuple[Array, Array]:
        return xp.ones(len(names)), xp.zeros(len(names))

    def _misfit(self, system: AbstractSystem, state: State) -> Array:
        n, m = len(system.coordinates), len(system.rows)
        h = xp.zeros((), state.qd.dtype) if self.h is None else self.h
        if h.shape not in ((), (n + m,)):
            raise RedundaxError(
                f"Argument `h` must be a number or have shape (n + m,) = ({n + m},), but has {h.shape}. "
                "Give one number for all, or that many."
            )
        return (h[n:] if h.ndim else h).astype(state.qd.dtype)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        m, misfit = len(system.rows), self._misfit(system, state)
        if self.units is None:
            return xp.eye(m, dtype=misfit.dtype), misfit
        scale = self.units.of_force(system.rows)
        return xp.diag(scale**2), scale * misfit

    def by_joint(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        scale = jnp.ones(len(system.rows)) if self.units is None else self.units.of_force(system.rows)
        return alone(scale**2, system), scale * self._misfit(system, state)


class Compliance(AbstractClosure):
    """Joints of given compliance and misfit: a pick with physical units, the same in every unit system.

    ??? example

        ```python
        joints = rx.Compliance(W=jnp.array([1e-8] * 10 + [1e-6] * 2))  # m/N, then rad/(N m)
        rx.solve(mechanism, state, closure=joints).multipliers
        soft = rx.Compliance({"A.x": 1e-8, "D.x": 2e-8}, misfit={"A.x": 1e-5})  # all else is rigid and fits
        ```

    **Arguments:**

    - `W`: compliance of the constraint rows, shape (m, m), (m,) for uncoupled rows, or by name of row, where those
      not named are rigid; m/N for force-type rows and rad/(N m) for moment-type rows, in the frame in which the rows
      are written.
    - `misfit`: d, what the parts as they are miss at the position as designed, with the sign of Phi there as of
      `rx.misfit`, shape (m,) or by name of row; m for force-type rows and rad for moment-type rows. Zero if not given.
    - `units`: units of `W` and `misfit`, as factors from the units of the system, which they have if not given and in
      which a solve warns where they look wrong: `rx.units.Units(length=1000.0, mass=0.001)` for mm/N and mm where
      the system is in SI units.
    """

    W: Float[Array, " m"] | Float[Array, "m m"] | dict[str, Array]
    misfit: Float[Array, " m"] | dict[str, Array]
    units: Units | None

    def __init__(self, W: ByName, misfit: ByName | None = None, units: Units | None = None):
        self.W, self.units = _figures("W", W), checked_units(units)
        if isinstance(self.W, dict):
            self.misfit = _figures("misfit", {} if misfit is None else misfit)
            return
        if self.W.ndim not in (1, 2) or self.W.shape[0] != self.W.shape[-1]:
            raise RedundaxError(
                f"Argument `W` must have shape (m,) or (m, m), but has {self.W.shape}. "
                "Give one compliance for each row, or a matrix."
            )
        size = self.W.shape[-1]
        self.misfit = on_device(np.zeros(size, self.W.dtype)) if misfit is None else _figures("misfit", misfit)
        if not isinstance(self.misfit, dict) and self.misfit.shape != (size,):
            raise RedundaxError(
                f"Argument `misfit` must have one entry for each of the {size} rows of `W`, but has shape "
                f"{self.misfit.shape}. Give 0 for rows that fit."
            )
        if is_concrete(self.W):
            check_compliance(np.asarray(self.W))

    @classmethod
    def from_stiffness(
        cls, stiffness: ByName, misfit: ByName | None = None, units: Units | None = None
    ) -> "Compliance":
        """The closure of joints of given stiffness, the inverse of `W`, as a matrix, by row or by name of row.

        Stiffness is positive, N/m for force-type and N m/rad for moment-type rows; rows that are not named, and those
        of infinite stiffness, are rigid.

        ??? example

            ```python
            joints = rx.Compliance.from_stiffness({"A.x": 1e8, "D.x": 5e7}, misfit={"A.x": 1e-5})
            rx.solve(mechanism, state, closure=joints)["A.x"]
            ```
        """
        given = _figures("stiffness", stiffness)
        W = {name: inverse(value) for name, value in given.items()} if isinstance(given, dict) else inverse(given)
        return cls(W, misfit, units)

    @property
    def is_constant(self) -> bool:
        return True

    def by_place(self, system: AbstractSystem) -> "Compliance":
        if not isinstance(self.W, dict) and not isinstance(self.misfit, dict):
            return self
        W = vector("W", self.W, system.rows, " of rows") if isinstance(self.W, dict) else self.W
        return Compliance(W, vector("misfit", self.misfit, system.rows, " of rows"), self.units)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        m = len(system.rows)
        if isinstance(self.W, dict) or isinstance(self.misfit, dict):
            return self.by_place(system).compliance(system, state)
        if self.W.shape[-1] != m:
            raise RedundaxError(
                f"Argument `W` must have one entry for each of the {m} constraint rows, but has {self.W.shape[-1]}. "
                "The rows are those of `system.rows`."
            )
        W = xp.diag(self.W) if self.W.ndim == 1 else self.W
        if self.units is None:
            return W, self.misfit
        scale = self.units.of(system.rows)
        return self.units.energy * W / (scale[:, None] * scale), self.misfit / scale

    def by_joint(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        if isinstance(self.W, dict) or isinstance(self.misfit, dict):
            return self.by_place(system).by_joint(system, state)
        if self.W.shape != (len(system.rows),):
            compliance, misfit = self.compliance(system, state)
            return with_mates(compliance, system), misfit
        units = Units() if self.units is None else self.units
        scale = units.of(system.rows)
        return alone(units.energy * self.W / scale**2, system), self.misfit / scale


def _figures(argument: str, given: ByName) -> Array | dict[str, Array]:
    """Numbers as an array, or each by its name."""
    if isinstance(given, Mapping):
        return {name: as_float(value, argument) for name, value in given.items()}
    return as_float(given, argument)


def inverse(stiffness: Array) -> Array:
    """Compliance of a stiffness, entry by entry or of a matrix."""
    positive("stiffness", jnp.diagonal(stiffness) if stiffness.ndim == 2 else stiffness)
    return jnp.linalg.inv(stiffness) if stiffness.ndim == 2 else 1 / stiffness


def check_compliance(W: np.ndarray, argument: str = "Argument `W`") -> None:
    """Refuse a compliance that is not symmetric positive semidefinite; what is not finite is left to the solve."""
    if not np.all(np.isfinite(W)):
        return
    diagonal = W if W.ndim == 1 else np.diag(W)
    negative = np.flatnonzero(diagonal < 0)
    if negative.size:
        raise RedundaxError(
            f"{argument} must not be negative, but its diagonal is {diagonal[negative[0]]:.4g} in row {negative[0]}. "
            "A compliance is at least 0: check the sign."
        )
    if W.ndim == 1:
        return
    size = np.sqrt(np.where(diagonal > 0, diagonal, np.max(diagonal) or 1.0))
    scaled, rounding = W / size[:, None] / size, np.sqrt(np.finfo(W.dtype).eps)
    i, j = np.unravel_index(np.argmax(np.abs(scaled - scaled.T)), W.shape)
    if np.abs(scaled - scaled.T)[i, j] > rounding * np.max(np.abs(scaled)):
        raise RedundaxError(
            f"{argument} must be symmetric, but W[{i}, {j}] = {W[i, j]:.4g} and W[{j}, {i}] = {W[j, i]:.4g}. "
            "Give both entries of a pair, or (W + W.T) / 2."
        )
    values, vectors = np.linalg.eigh(scaled)
    if values[0] < -rounding * values[-1]:
        rows = np.flatnonzero(np.abs(vectors[:, 0]) > 0.3 * np.max(np.abs(vectors[:, 0])))
        raise RedundaxError(
            f"{argument} must be positive semidefinite, but scaled to a unit diagonal it has the eigenvalue "
            f"{values[0]:.4g} along rows {rows.tolist()}. Correct its entries between these rows: joints store energy "
            "under any load."
        )
