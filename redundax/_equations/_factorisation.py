"""One factorisation of the index-1 equations (7) at a state, valid at any rank and with singular mass.

    M a + Phi_q^T lam = f,   Phi_q a = g

In the scaled variables of `_scaling` (a = S a_s, lam = D^-1 mu, K = D^-1 Phi_q S, M_s = S M S) motion and
self-stress are dual to each other: mass acts on the null space of K as compliance acts on that of K^T,

    Y = (Z M_s Z)^+       response of the motion to force,
    G = (P W_s P)^+       response of the self-stress to misfit,

    a_s = K^+ g_s + Y (f_s - M_s K^+ g_s),   mu = K^+T (f_s - M_s a_s).

For regular M this is the block form (10) of A^+ up to the choice of the self-stress; Y exists exactly where
condition (14), rank [M Phi_q^T] = n, holds. No matrix is multiplied with its transpose, so the condition
number is that of K, not its square. One step of iterative refinement follows, which keeps mass ratios harmless.
"""

import functools
from collections.abc import Callable
from typing import TypeVar

from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._system._decision import Decision
from .._system._results import RESULTS, first_failure
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._lapack import in_order
from .._tools._module import replace_fields
from .._tools._numbers import computed, is_number, on_numbers, stop_gradient, xp
from ._branch import Branch
from ._evidence import Violation, independence_of, rate_noise, singularity_of, violation_of
from ._kinematics import slip_motion
from ._rank import Spectrum, Split, checked_rank, split
from ._response import AbstractPick, AbstractSolvedFactorisation, Checks, Pick, Response
from ._restricted_inverse import restricted_inverse
from ._scaled_equations import reached_by, refined, residual_of
from ._scaled_kinematics import scaled_kinematics
from ._scaling import Scaling, largest_violation

T = TypeVar("T")


def _asked(method: Callable[["Factorisation"], T]) -> Callable[["Factorisation"], T]:
    """What users ask of a factorisation that they hold, in arrays of JAX, is computed as on numbers."""
    outside = computed(method)

    @functools.wraps(method)
    def run(self: "Factorisation") -> T:
        return (method if is_number(self.gamma) else outside)(self)

    return run


class Factorisation(AbstractSolvedFactorisation):
    """Everything about a system at a state that does not depend on closure, friction or solver.

    - `state`: position, velocity and time.
    - `jacobian`: Phi_q, shape (m, n).
    - `gamma`: right-hand side of Phi_q qdd = gamma, Eq. (5), shape (m,).
    - `mass`, `load`: M, shape (n, n), and Q, shape (n,).
    - `spectrum`: rank decision with its evidence.
    - `violation`: consistency of the state.
    - `finite`: whether state and equations are free of NaN and infinity; asked of every entry, because a batched
      maximum on CPU can lose a NaN.
    - `determinacy`: the decision whether condition (14) holds, so that accelerations are unique.
    - `singularity`: the decision whether the rank is higher beside this position, to second order.
    - `independence`: the decision whether the weakest constraint that counts is more than what points of few digits
      make of one that depends on others; a declared rank says so.
    - `acceleration`, `multipliers`: a solution without friction; the multipliers are one of many.
    - `residual`: largest residual of (7) at it, the larger of its two blocks, relative to their terms and to what the
      velocity bends.
    - `length`: a length of the mechanism, which makes angles and lengths comparable.
    - `row_scale`: D, shape (m,): D lam are multipliers free of units but for a common factor.
    - `scaled`, `scaled_mass`: K and M_s.
    - `split`: K^+, P and Z of the scaled Jacobian.
    - `response`: Y, shape (n, n).
    - `rate_noise`: what rounding and violation make of a slip rate that is zero.
    - `branch`: at a singular position outside transformations what the velocity decides (`_branch`); else none.

    ??? example

        ```python
        factor = rx.factorize(mechanism, state)
        factor.jacobian.shape, factor.spectrum.rank, factor.determinate  # (12, 12), 11, True
        ```
    """

    state: State
    jacobian: Float[Array, "m n"]
    gamma: Float[Array, " m"]
    mass: Float[Array, "n n"]
    load: Float[Array, " n"]
    spectrum: Spectrum
    violation: Violation
    finite: Bool[Array, ""]
    determinacy: Decision
    singularity: Decision
    independence: Decision
    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    residual: Float[Array, ""]
    length: Float[Array, ""]
    row_scale: Float[Array, " m"]
    scaled: Float[Array, "m n"]
    scaled_mass: Float[Array, "n n"]
    split: Split
    response: Float[Array, "n n"]
    rate_noise: Float[Array, ""]
    _size: Float[Array, ""]
    _coordinate_scale: Float[Array, " n"]
    branch: Branch | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """(m, n)."""
        return self.jacobian.shape

    def contradicting(self, gamma: Float[Array, " m"]) -> Float[Array, " m"]:
        """The part of gamma that no acceleration has."""
        return self.self_stress @ gamma

    @property
    def dense(self) -> "Factorisation":
        return self

    def to_friction(self, system: AbstractSystem, state: State, pick: AbstractPick) -> tuple[Array, Response]:
        rate, directions = slip_motion(system, state)
        acceleration, multipliers = self.respond(directions)
        return rate, Response(acceleration, pick(multipliers))

    @property
    def least_kept(self) -> Float[Array, ""]:
        """sigma_r / sigma_1, or a bound below it."""
        return xp.minimum(self.spectrum.kept, 1.0)

    @property
    def noise(self) -> float:
        """Rounding of a decomposition of K, relative to sigma_1."""
        return max(self.jacobian.shape) * float(xp.finfo(self.gamma.dtype).eps)

    @property
    def local(self) -> Int[Array, ""] | int:
        """Number of self-stress states that `branch` leaves out, as they are there at this position only."""
        return 0 if self.branch is None else self.branch.count

    @property
    def scaling(self) -> Scaling:
        """The scales of coordinates and rows, the length, and the size of the mechanism."""
        return Scaling(self._coordinate_scale, self.row_scale, self.length, self._size)

    @property
    @_asked
    def self_stress(self) -> Float[Array, "m m"]:
        """Orthogonal projector P = N N^T onto the self-stress states null(Phi_q^T), in the units of the multipliers."""
        return self.stress_response(xp.eye(self.gamma.size, dtype=self.gamma.dtype))[0]

    @property
    @_asked
    def unique_multipliers(self) -> Bool[Array, " m"]:
        """Which multipliers are unique without friction: those whose row of P, so of N, is zero, Eq. (13).

        A state off the manifold blurs the zeros; then fewer multipliers are called unique, never more.
        """
        return ~self.in_self_stress if self.branch is None else ~(self.in_self_stress | self.branch.lost)

    @property
    def in_self_stress(self) -> Bool[Array, " m"]:
        """Which rows of P are not zero."""
        return xp.linalg.norm(self.split.stress, axis=1) > 100 * self.noise / self.least_kept

    @property
    def contradiction(self) -> Decision:
        """Whether the accelerations that the constraints prescribe contradict each other: P gamma is not zero."""
        return Decision(self.violation.acceleration / self._consistent)

    @property
    def _consistent(self) -> Float[Array, ""]:
        """What the violation of the state and the rounding of P make of P gamma."""
        blur = self.noise + self.violation.position
        return xp.minimum(5 / self.least_kept, 120) * blur + 10 * (self.violation.velocity + self._beside)

    @property
    def _beside(self) -> Float[Array, ""] | float:
        """How far a singular position is off, of which these are the equations, as a relative singular value."""
        return 0.0 if self.branch is None else self.branch.beside

    @property
    def determinate(self) -> Bool[Array, ""]:
        """Whether condition (14) holds, so that accelerations are unique."""
        return self.determinacy.is_yes

    @property
    @_asked
    def lost_digits(self) -> Float[Array, ""]:
        """Decimal digits that accelerations and multipliers lose to the smallest kept singular value."""
        return -xp.log10(self.least_kept)

    @property
    def checks(self) -> Checks:
        violation = self.violation
        off_manifold = largest_violation(self.gamma.dtype)
        blur = self.noise + violation.position
        prescribed = violation.prescribed > self._consistent
        position = (
            (~self.singularity.is_yes, RESULTS.singular_position),
            (self.singularity.is_no, RESULTS.ambiguous_position),
        )
        return (
            (self.finite, RESULTS.not_finite),
            (violation.position <= off_manifold, RESULTS.violated_constraints),
            (~self.spectrum.ambiguous, RESULTS.ambiguous_rank),
            (self.independence.is_yes | ~self.singularity.is_no, RESULTS.ambiguous_rank),
            (~self.determinacy.is_no, RESULTS.indeterminate_acceleration),
            (self.determinacy.is_yes, RESULTS.ambiguous_mass),
            (violation.velocity <= off_manifold, RESULTS.inadmissible_velocity),
            (~(self.contradiction.is_yes & prescribed), RESULTS.inconsistent_constraints),
            (~self.contradiction.is_yes, RESULTS.inadmissible_velocity),
            (self.contradiction.is_no, RESULTS.ambiguous_constraints),
            *(position if self.branch is None else self.branch.checks),
            (self.residual <= 120 * blur + 10 * (violation.velocity + self._beside), RESULTS.unsolved),
        )

    @property
    @_asked
    def result(self) -> RESULTS:
        """The first check that fails, or `RESULTS.successful`."""
        return first_failure(self.checks)

    def respond(self, forces: Float[Array, "n p"], gamma: Float[Array, "m p"] | None = None) -> Response:
        coordinate_scale, row_scale = self._coordinate_scale[:, None], self.row_scale[:, None]
        wanted = xp.zeros((self.gamma.size, forces.shape[1]), forces.dtype) if gamma is None else gamma / row_scale
        a, mu = refined(
            self.scaled, self.scaled_mass, self.split.inverse, self.response, (coordinate_scale * forces, wanted)
        )
        return Response(coordinate_scale * a, mu / row_scale)

    def close(self, compliance: Float[Array, "m m"]) -> tuple[Pick, Decision]:
        response, definiteness = self.stress_response(compliance)
        return Pick(response, compliance), definiteness

    def in_balance(self, multipliers: Float[Array, " m"]) -> Float[Array, " m"]:
        """A self-stress state without what rounding has left of other multipliers, D^-1 P D lam."""
        return self.split.stress @ (self.row_scale * multipliers) / self.row_scale

    def undetermined(self, compliance: Float[Array, "m m"]) -> Bool[Array, " m"] | None:
        """Which multipliers a closure of this compliance does not determine; none where the position is regular.

        Those of the rows that the local self-stress touches, and of all in self-stress if the closure couples these
        with them, or if it lasts with them only.
        """
        if self.branch is None:
            return None
        lost, lasting = self.branch.lost, self.in_self_stress & ~self.branch.lost
        coupled = xp.any((compliance != 0) & lost & lasting[:, None])
        return lost | (lasting & (coupled | ~self.branch.alone))

    @_asked
    def apparent_mass(self) -> Float[Array, "m m"]:
        """M_c = C^+ for regular M: the multipliers -lam of accelerations g of the constraints.

        M a + Phi_q^T lam = 0, Phi_q a = g; of g in the range of Phi_q, and one solution of many for lam.
        """
        none = xp.zeros((self._coordinate_scale.size, self.gamma.size), self.gamma.dtype)
        return -self.respond(none, xp.eye(self.gamma.size, dtype=none.dtype)).multipliers

    def stress_response(self, compliance: Float[Array, "m m"]) -> tuple[Float[Array, "m m"], Decision]:
        """G = N (N^T W N)^-1 N^T: self-stress caused by a misfit under the compliance W; and whether N^T W N > 0."""
        scale = 1 / self.row_scale
        scaled = in_order(scale[:, None] * compliance * scale, self.response[0, 0])
        kept, states = self.spectrum.kept, self.redundancy - self.local
        response, definiteness = restricted_inverse(scaled, self.split.stress, states, kept)
        return scale[:, None] * response * scale, definiteness


def factorised(system: AbstractSystem, state: State, rank: ArrayLike | None) -> Factorisation:
    """The equations at a state, decided by singular values."""
    rank = checked_rank(rank, len(system.rows), len(system.coordinates))
    return _factorised(system.anonymous.without_friction, state, None if rank is None else xp.asarray(rank))


@functools.partial(on_numbers, repeats=True)
def _factorised(system: AbstractSystem, state: State, rank: Int[Array, ""] | None) -> Factorisation:
    kinematics = scaled_kinematics(system, state)
    scaled, matrix, position, scales, motion, _, mass, load = kinematics
    coordinate_scale, row_scale, length, size = scales
    parts, spectrum = split(scaled, position, rank)
    scaled_mass = coordinate_scale[:, None] * mass * coordinate_scale
    freedom = matrix.shape[1] - spectrum.rank
    response, determinacy = restricted_inverse(scaled_mass, parts.motion, freedom, spectrum.kept)
    force, gamma = coordinate_scale * load, motion.gamma / row_scale
    a, mu = refined(scaled, scaled_mass, parts.inverse, response, (force, gamma))
    found = kinematics.moving(state, a, reached_by(scaled_mass, force, a, size))
    centripetal = xp.max(xp.abs(found.qd)) ** 2 / size
    kept = spectrum.kept if rank is None else xp.full_like(spectrum.kept, xp.inf)
    evidence = {
        "violation": violation_of(found, parts.stress, position, size),
        "determinacy": determinacy,
        "singularity": singularity_of(system, state, found, parts, position, scales),
        "independence": independence_of(system, state, found, parts, kept, scales),
        "residual": residual_of(scaled, scaled_mass, (force, gamma), (a, mu), centripetal),
        "rate_noise": rate_noise(found, spectrum.kept),
    }
    given = state.q, state.qd, state.t, *motion, matrix, mass, load
    return Factorisation(
        state=replace_fields(state, memory=()),
        jacobian=matrix,
        gamma=motion.gamma,
        mass=mass,
        load=load,
        spectrum=spectrum,
        finite=xp.all(xp.concatenate([xp.isfinite(array).ravel() for array in given])),
        acceleration=coordinate_scale * a,
        multipliers=mu / row_scale,
        length=length,
        scaled=scaled,
        scaled_mass=scaled_mass,
        split=parts,
        response=response,
        _size=size,
        _coordinate_scale=coordinate_scale,
        row_scale=row_scale,
        **stop_gradient(evidence),
    )
