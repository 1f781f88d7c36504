"""The rank of a large mechanism along a motion: the rows that count at the start are held.

They stay independent until a pivot of theirs becomes small, as it does on the way to a singular position, or where
others would do instead: where less than a tenth of the least is left rows are chosen anew, of the same number.
"""

from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from .._equations._kinematics import AlongMotion, along_motion
from .._equations._response import AbstractFactorisation, AbstractPick, Response
from .._equations._scaling import Scaling
from .._equations._sparse_factorisation import closed
from .._equations._sparse_rows import rows_of, unit_rows
from .._sparse._gram import Gram, gram, rank_pivots
from .._sparse._rows import Rows
from .._sparse._symbolic import Symbolic
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._module import replace_fields
from .._tools._value import AbstractModule
from ._linear import AnyLinear, Asked, linear_maps_of, linear_of

_LEFT = 0.1  # of the least pivot


class SparseHeld(AbstractModule):
    """What is held while the motion goes on.

    - `kept`: 1 for rows that count, else 0, shape (m,).
    - `row_scale`: D, shape (m,).
    - `inverse_mass`, `mass`: of each body as in `Rows`, shape (bodies, s, s).
    - `least`: the least pivot when rows were chosen.
    """

    kept: Float[Array, " m"]
    row_scale: Float[Array, " m"]
    inverse_mass: Float[Array, "bodies s s"]
    mass: Float[Array, "bodies s s"] | None
    least: Float[Array, ""]

    @property
    def rank(self) -> dict[str, Array]:
        """As of dense matrices."""
        return {"kept": self.kept, "least": self.least}

    def factorised(self, system: AbstractSystem, state: State) -> "SparseHeldFactorisation":
        """Assemble and factorise at a state."""
        slopes, _ = system.by_bodies(state.q, state.t)
        rows = Rows(cast(Symbolic, system.symbolic), slopes, self.inverse_mass, self.mass).scaled(self.row_scale)
        return SparseHeldFactorisation(self, along_motion(system, state), gram(rows, self.kept))

    def anew(
        self, system: AbstractSystem, state: State, scale: Scaling, rank: Int[Array, ""], redundancy: int | None
    ) -> tuple["SparseHeld", Int[Array, ""]]:
        """As of dense matrices."""
        return hold_sparse(system, state, rank)


class SparseHeldFactorisation(AbstractFactorisation[Array]):
    """The equations at a state, factorised on the rows that are held; rows scaled.

    - `motion`: Phi, its rate and gamma, not scaled.
    """

    held: SparseHeld
    motion: AlongMotion
    gram: Gram

    @property
    def pivots(self) -> Float[Array, " m"]:
        """Diagonal of the factor."""
        return self.gram.pivots

    def respond(self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None) -> Response:
        """As of any factorisation."""
        scale = self.held.row_scale[:, None]
        gamma = jnp.zeros((scale.size, forces.shape[1]), forces.dtype) if gamma is None else gamma / scale
        a, mu = self.gram.respond(forces, gamma, refines=False)
        return Response(a, mu / scale)

    def nearest(self, off: Float[Array, " m"]) -> Float[Array, " n"]:
        """The least change by which the held rows change as much."""
        return self.gram.nearest((off / self.held.row_scale)[:, None])[:, 0]

    def close(self, compliance: Float[Array, "m j"]) -> tuple[AbstractPick, Array]:
        """As of any factorisation; the evidence is that of the compliance."""
        pick, decision = closed(self.gram, self.held.row_scale, compliance)
        return pick, decision.margin

    def renewed(self) -> tuple[SparseHeld, Float[Array, ""]]:
        """The same rank held by rows that are far from dependent, and how much those left out contribute."""
        stress, held = jax.lax.stop_gradient(self.gram), self.held

        def excess() -> Array:
            z = jnp.ones_like(stress.kept)[:, None]
            state = stress.stress(z)
            turned = stress.rows.accelerations(stress.rows.transposed(state))
            return jnp.sqrt(jnp.max(jnp.abs(stress.rows.times(turned)))) / jnp.max(jnp.abs(state))

        def chosen() -> tuple[Array, Array]:
            return _largest(stress.rows, jnp.sum(stress.kept))

        none = jnp.zeros((), stress.kept.dtype)
        some = jnp.any(stress.kept == 0)
        left = jnp.min(stress.pivots) < _LEFT * held.least
        kept, least = jax.lax.cond(some & left, chosen, lambda: (held.kept, held.least))
        return replace_fields(held, kept=kept, least=least), jax.lax.cond(some, excess, lambda: none)

    def completed(self, rows: tuple[int, ...], off: Float[Array, " m"]) -> Float[Array, " m"]:
        """As of dense matrices, of a system without rows of velocity."""
        return off

    def linear(self, asked: Asked) -> AnyLinear:
        """As of dense matrices; without friction there is nothing that maps are needed for."""
        return linear_maps_of(self, asked, self.gram) if asked.system.friction else linear_of(self, asked)


def hold_sparse(system: AbstractSystem, state: State, rank: Int[Array, ""]) -> tuple[SparseHeld, Int[Array, ""]]:
    """Hold a rank at a state, and the rank found there."""
    rows, _ = rows_of(system, state)
    row_scale = unit_rows(rows)
    kept, least = _largest(jax.lax.stop_gradient(rows.scaled(row_scale)), rank)
    return SparseHeld(kept, row_scale, rows.inverse_mass, rows.mass, least), jnp.sum(kept).astype(int)


def _largest(rows: Rows, rank: Array) -> tuple[Float[Array, " m"], Float[Array, ""]]:
    """The rows of the largest pivots, as many as a rank, and the least of these."""
    squares, _, _ = rank_pivots(rows)
    ordered = jnp.sort(squares)[::-1]
    least = ordered[jnp.clip(rank.astype(int) - 1, 0, squares.size - 1)]
    kept = (squares >= least) & (rank > 0)
    return kept.astype(squares.dtype), jnp.sqrt(jnp.maximum(least, 0.0))
