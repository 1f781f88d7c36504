"""The equations (7) of a large mechanism at a state: what `Factorisation` is of small ones, on the rows that count.

    K = D^-1 Phi_q S  of `_scaling` is B for the evidence,   D_M^-1 Phi_q  with  diag(B M^-1 B^T) = 1  for the solution

The rank is that of the pivots of B M^-1 B^T (`_gram`), squares of the sines between a row and those before it, in the
metric of M^-1: units do not matter to it. What rounding makes of them grows with |x|^2, as where masses are of very
different size; a pivot that is neither rounding nor clearly more leaves the rank undecided.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._sparse._gram import Gram, gram
from .._sparse._pick import Compliance, Picking, picking, scaled_compliance
from .._system._decision import Decision
from .._system._results import RESULTS, first_failure
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._by_number import sum_few
from .._tools._compilation import compiled
from ._evidence import Violation, ratio
from ._kinematics import AlongMotion, second_derivative, second_order, slip_rate
from ._rank import Spectrum, checked_rank
from ._response import AbstractPick, AbstractSolvedFactorisation, Checks, FrictionResponse, Response, total
from ._scaling import Scaling, largest_violation, sparse_scaling
from ._sparse_rank import decided, with_least
from ._sparse_rows import rows_of, unit_rows

_LIGHT = 1e-5  # what a pass must take of each error of a


class SparsePick(AbstractPick):
    """(I - G W) lam and G d, by solutions.

    - `stress`: G of scaled rows.
    - `row_scale`: D, shape (m,).
    - `softest`: a bound of G.
    """

    stress: Picking
    row_scale: Float[Array, " m"]
    softest: Float[Array, ""]

    def __call__(self, multipliers: Float[Array, "m ..."]) -> Float[Array, "m ..."]:
        columns = multipliers.reshape(len(multipliers), -1)
        return self.columns(columns, jnp.zeros_like(self.row_scale)).reshape(multipliers.shape)

    def closed(self, multipliers: Array, misfit: Array) -> tuple[Array, Array]:
        mu = self.row_scale * multipliers
        pulled = self.stress.compliance.times(mu[:, None])[:, 0]
        own = misfit / self.row_scale / self.stress.compliance.size
        found = self.stress.response(jnp.stack([-pulled, own], axis=1))
        picked = mu + found[:, 0]
        return picked / self.row_scale, (picked + found[:, 1]) / self.row_scale

    def loads(self, closed: tuple[Array, Array], misfit: Array, rows: Array) -> Array:
        return closed[1][rows]

    def columns(self, multipliers: Array, misfit: Array) -> Array:
        mu = self.row_scale[:, None] * multipliers
        off = misfit / self.row_scale / self.stress.compliance.size
        off = (-self.stress.compliance.times(mu)).at[:, 0].add(off)
        return (mu + self.stress.response(off)) / self.row_scale[:, None]

    def caused(self, misfit: Array, rows: Int[Array, " l"] | None = None) -> Array:
        scaled = (misfit / self.row_scale)[:, None]
        found = self.stress.response(scaled)[:, 0] / self.row_scale / self.stress.compliance.size
        return found if rows is None else found[rows]

    def bound(self, misfit: Array) -> Float[Array, ""]:
        return total(misfit) * self.softest


class SparseFactorisation(AbstractSolvedFactorisation):
    """Everything about a large mechanism at a state that does not depend on closure, friction or solver.

    Its fields are those of a `Factorisation` of the same names, without matrices; `spectrum` has the pivots of the rows
    in place of singular values.

    - `gram`: B M^-1 B^T on the rows that count, these scaled by `row_scale`, shape (m,).

    ??? example

        ```python
        factor = rx.factorize(mechanism.sparse(), state)
        factor.redundancy, factor.spectrum.gap, factor.unique_multipliers
        ```
    """

    state: State
    gamma: Float[Array, " m"]
    load: Float[Array, " n"]
    spectrum: Spectrum
    violation: Violation
    finite: Bool[Array, ""]
    determinacy: Decision
    singularity: Decision
    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    residual: Float[Array, ""]
    length: Float[Array, ""]
    scaling: Scaling
    gram: Gram
    row_scale: Float[Array, " m"]
    rate_noise: Float[Array, ""]

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n)."""
        return self.gamma.size, self.load.size

    @property
    def dense(self) -> None:
        return None

    @property
    def local(self) -> int:
        """None: singular positions are refused."""
        return 0

    @property
    def noise(self) -> float:
        """Rounding of a solution of (7)."""
        return max(self.shape) * float(jnp.finfo(self.gamma.dtype).eps)

    @property
    def unique_multipliers(self) -> Bool[Array, " m"]:
        """Which multipliers are unique without friction: those that no self-stress has, of some at random; none
        while the rank is undecided."""
        return ~_in_self_stress(self.gram) & ~self.spectrum.ambiguous

    @property
    def lost_digits(self) -> Float[Array, ""]:
        return -jnp.log10(jnp.minimum(self.spectrum.kept, 1.0))

    @property
    def checks(self) -> Checks:
        violation, off_manifold = self.violation, largest_violation(self.gamma.dtype)
        blur = self._consistent
        contradiction = Decision(violation.acceleration / blur)
        return (
            (self.finite, RESULTS.not_finite),
            (violation.position <= off_manifold, RESULTS.violated_constraints),
            (~self.spectrum.ambiguous, RESULTS.ambiguous_rank),
            (violation.velocity <= off_manifold, RESULTS.inadmissible_velocity),
            (~(contradiction.is_yes & (violation.prescribed > blur)), RESULTS.inconsistent_constraints),
            (~contradiction.is_yes, RESULTS.inadmissible_velocity),
            (contradiction.is_no, RESULTS.ambiguous_constraints),
            (~self.determinacy.is_no, RESULTS.indeterminate_acceleration),
            (self.determinacy.is_yes, RESULTS.ambiguous_mass),
            (~self.singularity.is_yes, RESULTS.singular_position),
            (self.singularity.is_no, RESULTS.ambiguous_position),
            (self.residual <= 10 * blur, RESULTS.unsolved),
        )

    @property
    def _consistent(self) -> Float[Array, ""]:
        """What rounding and the violation of the state make of N^T gamma."""
        magnified = 10 / jnp.minimum(self.spectrum.kept, 1.0) ** 2
        rounding = float(jnp.finfo(self.gamma.dtype).eps)
        return magnified * rounding + 120 * self.violation.position + 10 * self.violation.velocity

    @property
    def result(self) -> RESULTS:
        return first_failure(self.checks)

    def to_friction(self, system: AbstractSystem, state: State, pick: AbstractPick) -> tuple[Array, FrictionResponse]:
        return slip_rate(system, state), FrictionResponse(system, state, self, pick)

    def undetermined(self, compliance: Array) -> None:
        return None  # singular positions are refused

    def respond(self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None) -> Response:
        scale = self.row_scale[:, None]
        gamma = jnp.zeros((self.gamma.size, forces.shape[1]), forces.dtype) if gamma is None else gamma / scale
        a, mu = self.gram.respond(forces, gamma)
        return Response(a, mu / scale)

    def close(self, compliance: Float[Array, "m j"]) -> tuple[SparsePick, Decision]:
        return closed(self.gram, self.row_scale, compliance)

    def contradicting(self, gamma: Float[Array, " m"]) -> Float[Array, " m"]:
        """The part of gamma that no acceleration has, in rows that depend on others."""
        return self.gram.across((gamma / self.row_scale)[:, None])[:, 0] * self.row_scale


def closed(stress: Gram, row_scale: Array, entries: Float[Array, "m j"]) -> tuple[SparsePick, Decision]:
    """The pick of a compliance, by entries of each row with its mates, and whether it determines the multipliers."""
    compliance: Compliance = scaled_compliance(stress.rows, entries, row_scale)
    found, least = picking(stress, compliance)
    noise = float(jnp.finfo(entries.dtype).eps) ** 0.525
    softest = jax.lax.stop_gradient(jnp.max(row_scale**-2) / compliance.size / least)
    return SparsePick(found, row_scale, softest), Decision(jnp.where(least >= 0, least, 0.0) / noise)


def sparse_factorised(system: AbstractSystem, state: State, rank: ArrayLike | None) -> SparseFactorisation:
    """The equations of a large system at a state."""
    rank = checked_rank(rank, len(system.rows), len(system.coordinates))
    return _factorised(system.anonymous.without_friction, state, None if rank is None else jnp.asarray(rank))


@compiled
def _factorised(system: AbstractSystem, state: State, rank: Int[Array, ""] | None) -> SparseFactorisation:
    rows, masses = rows_of(system, state)
    load = system.load(state)
    motion, explicit, turned = second_order(system, state)
    scales = sparse_scaling(system, rows.slopes, masses, turned)
    position = jnp.max(jnp.abs(scales.violations(motion.value)))
    row_scale = unit_rows(rows)
    scaled = rows.scaled(row_scale)
    kept, spectrum, growth = decided(scaled, jax.lax.stop_gradient(position), rank)
    stress = gram(scaled, kept)
    a, mu = stress.respond(load[:, None], (motion.gamma / row_scale)[:, None])
    spectrum = with_least(spectrum, stress)
    solved = jax.lax.stop_gradient(_Solved(stress, row_scale, scales, motion, explicit, load, a[:, 0], mu[:, 0], state))
    violation, noise, reached, residual = _evidence(masses, position, spectrum, solved)
    return SparseFactorisation(
        state=State(state.q, state.qd, state.t),
        gamma=motion.gamma,
        load=load,
        spectrum=spectrum,
        violation=violation,
        finite=jnp.isfinite(total(state.q, state.qd, state.t, *motion, rows.slopes, rows.inverse_mass, load)),
        determinacy=Decision((1 - jax.lax.stop_gradient(stress).left_by_mass()) / _LIGHT),
        singularity=_singularity(system, position, spectrum, reached, growth, solved),
        acceleration=a[:, 0],
        multipliers=mu[:, 0] / row_scale,
        residual=residual,
        length=scales.length,
        scaling=scales,
        gram=stress,
        row_scale=row_scale,
        rate_noise=noise,
    )


class _Solved(NamedTuple):
    """B M^-1 B^T on the rows that count, scaled by `row_scale`; what the equations are made of; and their solution."""

    stress: Gram
    row_scale: Float[Array, " m"]
    scales: Scaling
    motion: AlongMotion
    explicit: Float[Array, " m"]
    load: Float[Array, " n"]
    acceleration: Float[Array, " n"]
    mu: Float[Array, " m"]
    state: State


def _evidence(
    masses: Array, position: Array, spectrum: Spectrum, solved: _Solved
) -> tuple[Violation, Array, Array, Array]:
    """Consistency; what rounding makes of slip rates; the velocity that accelerations reach; the residual of (7)."""
    stress, row_scale, scales, (_, rate, gamma), explicit, load, a, mu, state = solved
    qd, own = state.qd / scales.coordinates, a / scales.coordinates
    rate, scaled, explicit = rate / scales.rows, gamma / scales.rows, explicit / scales.rows
    inertia = jnp.sum(jnp.diagonal(masses, axis1=1, axis2=2)) / load.size
    free = jnp.max(jnp.abs(scales.coordinates * load)) / jnp.where(inertia > 0, inertia, 1.0)
    reached = jnp.sqrt(scales.size * (jnp.max(jnp.abs(own)) + free))
    sizes = scaled, own, jnp.max(jnp.abs(qd)) ** 2 / scales.size
    across = jnp.stack([scaled, explicit], axis=1) * (scales.rows / row_scale)[:, None]
    across = stress.across(across) * (row_scale / scales.rows)[:, None]
    violation = Violation(position, ratio(rate, qd, reached), ratio(across[:, 0], *sizes), ratio(across[:, 1], *sizes))
    rounding = 10 * jnp.finfo(qd.dtype).eps
    noise = rounding * jnp.max(jnp.abs(qd)) + jnp.max(jnp.abs(rate))
    noise = jnp.maximum(10.0, 1 / jnp.minimum(spectrum.kept, 1.0)) * noise + rounding * reached
    rows, scale = stress.rows, row_scale / scales.rows
    missed = scaled - rows.times(a[:, None])[:, 0] * scale
    pulled = (
        rows.accelerations(jnp.stack([load, rows.transposed(mu[:, None])[:, 0]], axis=1)) / scales.coordinates[:, None]
    )
    inertial = own
    if rows.mass is not None:
        inertial = rows.accelerations(rows.inertia_force(a[:, None]))[:, 0] / scales.coordinates
    unbalanced = pulled[:, 0] - pulled[:, 1] - inertial
    residual = jnp.maximum(ratio(missed, *sizes, free), ratio(unbalanced, pulled, own, sizes[2]))
    return violation, jnp.where(noise > 0, noise, 1.0), reached, residual


def _singularity(
    system: AbstractSystem, position: Array, spectrum: Spectrum, reached: Array, growth: Array, solved: _Solved
) -> Decision:
    """Whether N^T Phi'' along the velocity with a motion added is other than without, of N with columns of length 1.

    As `singularity_by`; points of few digits leave N^T Phi_q too, and as much of N^T Phi''.
    """
    stress, row_scale, scales, (_, _, gamma), *_, state = solved
    qd = state.qd / scales.coordinates
    speed = jnp.max(jnp.abs(qd)) + reached
    speed = jnp.where(speed > 0, speed, scales.size)
    mixed = scales.coordinates * jnp.asarray(np.cos(np.arange(qd.size) ** 2), qd.dtype)
    free = mixed - stress.nearest(stress.rows.times(mixed[:, None]))[:, 0]
    free = free / scales.coordinates
    largest = jnp.max(jnp.abs(free))
    moves = (state.qd.size > spectrum.rank) & (largest > 0)
    free = jnp.where(free @ qd < 0, -1.0, 1.0) * free / jnp.where(moves, largest, 1.0) * moves
    bend = second_derivative(system, state, scales.coordinates * (qd + speed * free), jnp.ones_like(state.t))
    added = (bend + gamma) / row_scale
    changed = stress.across(added[:, None])[:, 0] * row_scale / scales.rows / jnp.sqrt(growth)
    turned = stress.nearest((bend / row_scale)[:, None])[:, 0] / scales.coordinates
    sizes = turned, bend / scales.rows, gamma / scales.rows
    terms = sum(jnp.max(jnp.abs(size)) for size in sizes) + (2 * speed) ** 2 / scales.size
    magnified = 1 / jnp.minimum(spectrum.kept, 1.0) ** 2
    rounding = float(jnp.finfo(qd.dtype).eps) * magnified
    off = position + _independent(stress, growth)
    return Decision(jnp.max(jnp.abs(changed)) / terms / (10 * (100 * rounding + off)))


def _independent(stress: Gram, growth: Array) -> Float[Array, ""]:
    """How far a self-stress, one of all at random, is from none: its largest force on a body, by M^-1, to its largest
    entry."""

    def found() -> Array:
        numbers = np.random.default_rng(5).normal(size=stress.kept.size)
        state = stress.stress((jnp.asarray(numbers, growth.dtype) / jnp.sqrt(growth))[:, None])
        force = stress.rows.transposed(state)
        energy = (force * stress.rows.accelerations(force))[stress.rows.symbolic.columns, 0]
        return jnp.sqrt(jnp.max(sum_few(energy))) / jnp.max(jnp.abs(state))

    return jax.lax.cond(jnp.any(stress.kept == 0), found, lambda: jnp.zeros((), growth.dtype))


def _in_self_stress(stress: Gram) -> Bool[Array, " m"]:
    """Which rows some self-stress has, of a few at random."""
    numbers = np.random.default_rng(7).normal(size=(stress.kept.size, 2))
    found = stress.stress(jnp.asarray(numbers, stress.kept.dtype))
    noise = float(jnp.finfo(found.dtype).eps) ** 0.5
    return jnp.max(jnp.abs(found), axis=1) > noise * jnp.max(jnp.abs(found), initial=1.0)
