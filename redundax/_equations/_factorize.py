"""The factorisation at a state: by singular values, and at a singular position with the rows that it lacks.

Near a singular position, at a distance s in relative singular values, the equations as they stand lose a digit of their
accelerations to each decade of s, and those of the position itself are off by s: below a small distance they are taken,
where all checks pass. That is decided on numbers, so outside transformations only; in them a singular position is
refused, and beside it the digits go that `lost_digits` tells.

The rows that lack are Phi derived once more, whose second derivative is symmetric, so that their force is along their
gradient. Rows of velocity have neither: with such rows a singular position is refused, whatever the velocity.
"""

import functools
import operator
from typing import cast

import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool

from .._system._decision import CLEAR
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._errors import RedundaxError
from .._tools._module import check_kind, is_concrete, replace_fields
from .._tools._numbers import on_numbers, stop_gradient, xp
from ._branch import Branch, lacking, lost_rows
from ._evidence import ScaledMotion, singularity_of
from ._factorisation import Factorisation, factorised
from ._matrices import matrices_of
from ._rank import split
from ._response import AbstractSolvedFactorisation
from ._restricted_inverse import restricted_inverse
from ._scaled_equations import reached_by, refined, residual_of
from ._scaling import Scaling
from ._sparse_factorisation import sparse_factorised

_NEAR = 0.575  # power of the rounding, 1e-9 in float64: relative singular values that are none where it is singular


@functools.partial(on_numbers, jit=False)
def factorize(system: AbstractSystem, state: State, rank: ArrayLike | None = None) -> AbstractSolvedFactorisation:
    """Factorise the equations (7) of a system at a state, at a singular position with the rows that they lack there.

    ??? example

        ```python
        rx.factorize(mechanism, state).redundancy  # 1
        angles = jnp.linspace(0.2, 1.4, 5)
        jax.vmap(lambda phi: rx.factorize(mechanism, mechanism.state(phi=phi)).spectrum.gap)(angles)
        ```

    **Arguments:**

    - `system`, `state`: the system and the known (q, qd, t).
    - `rank`: declared rank r of the constraint Jacobian; decided from its spectrum if not given.

    **Returns:** a `Factorisation`; of a large mechanism, whose matrices are sparse, a `SparseFactorisation`.
    """
    check_system_at(system, state)
    return matrices_of(system).run(factorize_dense, sparse_factorised)(system, state, rank)


def factorize_dense(system: AbstractSystem, state: State, rank: ArrayLike | None = None) -> Factorisation:
    """`factorize` with dense matrices."""
    system = system.whole.anonymous.without_friction
    factor = factorised(system, state, rank)
    return _continued(system, state, factor, rank) if is_concrete(factor.residual) else factor


def _continued(system: AbstractSystem, state: State, factor: Factorisation, rank: ArrayLike | None) -> Factorisation:
    """A factorisation as it is at a regular position; at a singular one, or too near to it, with the rows that lack."""
    spectrum, near = factor.spectrum, factor
    values = np.asarray(spectrum.singular_values)
    least = float(np.finfo(values.dtype).eps) ** _NEAR
    if rank is None and (spectrum.kept.item() < least or spectrum.decision.margin.item() < CLEAR):
        near = factorised(system, state, xp.asarray(np.sum(values > least)))
    if system.velocity_rows or not near.singularity.margin.item() >= CLEAR:  # nor where it is NaN
        return factor
    found, branch, is_trusted = _on_branch(system, state, near)
    if near is not factor and not is_trusted.item():
        return factor
    if not branch.count.item():
        return replace_fields(factor, branch=branch)
    if not branch.alone.item():
        branch = replace_fields(branch, alone=_last_alone(system, state, near, branch.lost))
    return replace_fields(found, branch=branch)


def factorisation_at(
    system: AbstractSystem, state: State, rank: ArrayLike | None, factor: AbstractSolvedFactorisation | None
) -> AbstractSolvedFactorisation:
    """The factorisation that is there already, or a new one."""
    if factor is None:
        return factorize(system, state, rank)
    check_kind(
        "factor", factor, AbstractSolvedFactorisation, "what `factorize` gives", "Leave it out, or call `rx.factorize`."
    )
    shape = len(system.rows), len(system.coordinates)
    if factor.shape != shape or rank is not None:
        raise RedundaxError(
            "Argument `factor` must be what `factorize` gives for this system at this state, with a Jacobian of shape "
            f"{shape}, and takes no `rank` beside it, but has {factor.shape} and `rank` is {rank}. "
            "Give `rank` to `factorize`, and no `factor` of another system."
        )
    pairs = (state.q, factor.state.q), (state.qd, factor.state.qd), (state.t, factor.state.t)
    if not all(np.array_equal(*pair, equal_nan=True) for pair in pairs if all(map(is_concrete, pair))):
        raise RedundaxError(
            "Argument `factor` must be what `factorize` gives at this state, but comes from another. "
            "Factorise at this state, or leave it out."
        )
    return factor


def dense_at(
    system: AbstractSystem, state: State, rank: ArrayLike | None, factor: AbstractSolvedFactorisation | None
) -> tuple[AbstractSystem, Factorisation]:
    """A system with dense matrices, and its factorisation, that is there already or a new one."""
    check_system_at(system, state)
    system = system.whole
    factor = factor.dense if isinstance(factor, AbstractSolvedFactorisation) else factor
    return system, cast(Factorisation, factorisation_at(system, state, rank, factor))


@on_numbers
def _on_branch(
    system: AbstractSystem, state: State, factor: Factorisation
) -> tuple[Factorisation, Branch, Bool[Array, ""]]:
    """A factorisation at a singular position with the rows that lack there; its branch; whether all checks pass."""
    n, m, scales, values = *factor.jacobian.shape[::-1], factor.scaling, factor.spectrum.singular_values
    force, gamma = scales.coordinates * factor.load, factor.gamma / scales.rows
    beside = xp.max(xp.where(xp.arange(values.size) < factor.spectrum.rank, 0.0, values))
    position = factor.violation.position + beside
    noise = factor.noise + position, factor.rate_noise
    more = lacking(system, state, (factor.scaled, gamma), factor.split, scales, factor.least_kept, noise)
    mass = factor.scaled_mass
    freedom = n - factor.spectrum.rank - more.states
    response, determinacy = restricted_inverse(mass, more.parts.motion, freedom, more.kept)
    a, mu = refined(more.matrix, mass, more.inverse, response, (force, more.wanted))
    motion = _scaled_motion(state, scales, gamma, a, reached_by(mass, force, a, scales.size))
    evidence = {
        "decision": more.decision,
        "touching": singularity_of(system, state, motion, more.parts, position, scales),
        "contradiction": more.contradiction(a),
    }
    lasting = xp.linalg.norm(more.parts.stress, axis=1) > noise[0] / more.kept
    lost = lost_rows(more, factor.split.stress, noise[0] / factor.least_kept)
    growth = mu[m:] / more.size / scales.rows
    branch = Branch(
        beside, more.states, growth=growth, lost=lost, alone=~xp.any(lasting & ~lost), **stop_gradient(evidence)
    )
    decides = functools.reduce(operator.and_, (passed for passed, _ in branch.checks))
    branch = replace_fields(branch, count=xp.where(decides, branch.count, 0))
    centripetal = xp.max(xp.abs(motion.qd)) ** 2 / scales.size
    found = replace_fields(
        factor,
        spectrum=replace_fields(factor.spectrum, kept=stop_gradient(more.kept)),
        determinacy=stop_gradient(determinacy),
        acceleration=scales.coordinates * a,
        multipliers=mu[:m] / scales.rows,
        residual=stop_gradient(residual_of(more.matrix, mass, (force, more.wanted), (a, mu), centripetal)),
        split=more.parts,
        response=response,
        branch=branch,
    )
    return found, branch, found.result == RESULTS.successful


@on_numbers
def _last_alone(system: AbstractSystem, state: State, factor: Factorisation, lost: Array) -> Array:
    """Whether the self-stress of the rows that are not lost lasts without these."""
    scales, position, gamma = factor.scaling, factor.violation.position, factor.gamma / factor.row_scale
    parts, spectrum = split(xp.where(lost[:, None], 0.0, factor.scaled), position, None)
    stress = xp.where(lost | lost[:, None], 0.0, parts.stress)
    a = factor.acceleration / scales.coordinates
    reached = reached_by(factor.scaled_mass, scales.coordinates * factor.load, a, scales.size)
    motion = _scaled_motion(state, scales, gamma, a, reached)
    changes = singularity_of(system, state, motion, parts._replace(stress=stress), position, scales)
    return spectrum.decision.is_yes & changes.is_no


def _scaled_motion(state: State, scales: Scaling, gamma: Array, acceleration: Array, reached: Array) -> ScaledMotion:
    """The motion at a closed state with these accelerations, as far as `singularity_of` reads it."""
    return ScaledMotion(state.qd / scales.coordinates, 0.0 * gamma, gamma, 0.0 * gamma, acceleration, reached)
