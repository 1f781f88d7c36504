"""Whether a mechanism at rest sticks, under what is known of its preload.

At rest dry friction is a set: a mechanism with one degree of freedom stays at rest with the self-stress z iff

    some tau with |tau_j| <= |law_j(rho, sense 1)|, rho = rho_0(z) + K tau,  leaves no acceleration.

Let a_0 be the acceleration without friction, s the sense of slip in which it sets out, and y a_0 the acceleration under
the whole friction tau = law(rho, s) against it. y is a linear output of [qdd; lam; tau], and

    margin = -y = (what friction holds of the load's drive) - 1.

Where margin >= 0 a share t <= 1 of the friction holds: y falls from 1 at t = 0 without a jump. `_held` finds it.
Where margin < 0 and, with Gamma_ij = max |d law_i / d rho| |K_ij| and y = 1 + e^T tau,

    spectral radius of Gamma < 1   and   |e|^T Gamma (I - Gamma)^-1 <= |e|^T,

it slips (proved): with tau_j = sigma_j |law_j| the derivatives e^T (I - diag(sigma) law' K)^-1 |law| of y have the
signs of e, so that no friction holds more. `Search` looks for the least and the largest margin over the bounds.
Verdicts on all of them are proved by cells that cover the bounds, because under this Gamma

    |change of y| <= |e|^T (I - Gamma)^-1 Lambda |change of the case|,   Lambda: bounds of the change of law.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from .._analysis._analyze import analyze
from .._analysis._verdict import spectral_radius
from .._closures._closure import AbstractClosure, MinimumNorm
from .._enumerate import start_factors
from .._factorisation import factorize
from .._friction import slip_kinds
from .._kinematics import slip_motion
from .._module import no_classes
from .._state import State
from .._system import AbstractSystem
from ._bounds import AbstractBounds, one_case
from ._cases import AbstractCases, Affine
from ._descent import sampled
from ._held import held
from ._search import Search, proved_single
from ._solution_set import SolutionSet, solution_set
from ._sticking_report import Sticking

T = TypeVar("T")

_MINIMUM_NORM = MinimumNorm()
_NONE = 1e-10  # relative size of a drive or of a slip that is rounding
_LIMIT = 1e-9  # margin that is rounding
_CELLS = 4096  # cells of the bounds at most, in a proof


def sticking(
    system: AbstractSystem,
    state: State,
    bounds: AbstractBounds | AbstractClosure = _MINIMUM_NORM,
    *,
    samples: int = 256,
    starts: int = 8,
    seed: int = 0,
    rank: ArrayLike | None = None,
) -> Sticking:
    """Whether a mechanism with one degree of freedom, at rest, must stick, may stick or must slip.

    ??? example

        ```python
        rest = mechanism.state(phi=0.8, rate=0.0)
        found = rx.sticking(mechanism, rest, rx.AmplitudeBox({"A.x": (-400.0, 400.0)}))  # N
        print(found)
        found.verdict, found.proved
        ```

    **Arguments:**

    - `system`, `state`: concrete values, at rest; not inside `jit` or `vmap`.
    - `bounds`: what is known of preload, misfit or compliance, as of `band`; or a closure, for the loads that it picks.
    - `samples`: random cases that are looked at, beside vertices.
    - `starts`, `seed`: random initial loads for each of them, where the number of solutions is not proved.
    - `rank`: as in `solve`.

    **Raises:** `ValueError` where the state moves, drivers set it in motion, the system has not one degree of freedom,
    or bounds do not fit it; `RuntimeError` where the equations cannot be trusted, as `solve` does.
    """
    no_classes(bounds=bounds)
    state = State(state.q, state.qd, state.t)  # bristles that bend let it move, so they do not count
    drive = _drive(system, state, rank)
    senses = jnp.asarray(drive.sense)
    report = analyze(system, state, sense=senses, rank=rank)
    if report.problem:
        raise RuntimeError(report.problem)
    if report.freedom != 1:
        raise ValueError(
            f"Argument `system` must have one degree of freedom to stick as a whole, but has {report.freedom}. "
            "Drive or lock the others, as with a `DistanceDriver` or `AngleDriver`."
        )
    solutions = solution_set(system, state, jnp.asarray(report.self_stress), senses, rank)
    closure = isinstance(bounds, AbstractClosure)
    cases = one_case(bounds, system, state, solutions) if closure else bounds.cases(system, state, report, solutions)
    single = proved_single(solutions, cases, report)
    search = Search(solutions, cases, start_factors(solutions.rows.size, 0 if single else starts, seed))
    theta = search.sample(samples if cases.lower.size else 0, seed)
    ends = _ends(search, drive, theta, samples, seed)
    slips, sticks = ends.margin < -_LIMIT, ends.margin >= -_LIMIT
    settled = single and _most_holds(solutions, cases, drive)
    everywhere = single and (closure or not report.friction_reads)
    if not len(ends.margin):
        verdict, proved = "undecided", False
    elif not slips.any():
        verdict, proved = "must stick", everywhere or (single and _covered(search, drive, theta, 1.0))
    elif not sticks.any():
        verdict, proved = "must slip", settled and (everywhere or _covered(search, drive, theta, -1.0))
    else:
        verdict, proved = "may stick", settled
    order = [np.argmin(ends.margin), np.argmax(ends.margin)] if len(ends.margin) else []
    return Sticking(
        verdict=verdict,
        proved=proved,
        margin=ends.margin[order],
        case=ends.theta[order],
        acceleration=ends.acceleration[order],
        multipliers=ends.multipliers[order],
        friction=ends.tau[order],
        share=ends.share[order],
        bounds=type(bounds).__name__,
        parameters=cases.names,
        box=np.stack([cases.lower, cases.upper], axis=1),
        names=tuple(slip_kinds(system.friction).labels),
        senses=drive.sense,
        can_hold=any(group.has_sense for group in system.friction),
        solved=ends.solved,
    )


class _Drive(NamedTuple):
    """The start without friction: its sense of slip (p,), y as an output of [qdd; lam; tau], and e (p,)."""

    sense: np.ndarray
    output: np.ndarray
    effect: np.ndarray

    @property
    def none(self) -> bool:
        """Whether nothing drives the mechanism."""
        return not self.output.any()


def _drive(system: AbstractSystem, state: State, rank: ArrayLike | None) -> _Drive:
    factor = factorize(system, state, rank)
    length, angular = np.asarray(factor.length), np.asarray(system.coordinates.angular)
    rates = np.abs(np.asarray(state.qd)) * np.where(angular, length, 1.0)
    if rates.max() > factor.resting_rate:
        raise ValueError(
            f"Argument `state` must be at rest, but has velocities up to {rates.max():.3g}. "
            "Take `qd = 0`, or `simulate` to where it comes to rest."
        )
    a, mass, load = (np.asarray(x, float) for x in (factor.acceleration, factor.mass, factor.load))
    if np.abs(factor.gamma).max() > _NONE * np.abs(factor.jacobian @ a).max(initial=0.0):
        raise ValueError(
            "Argument `state` must be free to stay at rest, but a driver accelerates the mechanism. "
            "Lock the driver, or choose another time `t`."
        )
    force, lever = mass @ a, np.where(angular, 1 / length, 1.0)
    slips, p = slip_kinds(system.friction), len(slip_kinds(system.friction))
    size = state.qd.size + len(system.rows)
    if not np.abs(lever * force).max() > _NONE * np.abs(lever * load).max():
        return _Drive(np.zeros(p), np.zeros(size + p), np.zeros(p))
    output = np.concatenate([force / (a @ force), np.zeros(len(system.rows) + p)])
    slip = np.asarray(slip_motion(system, state)[1]).T @ a if p else np.zeros(0)
    shift = np.abs(slip) * np.where(slips.angular, length, 1.0)
    slip = np.where(shift > _NONE * shift.max(initial=0.0), slip, 0.0)
    return _Drive(np.sign(slip), output, slip / (a @ force))


class _Ends(NamedTuple):
    """States that are possible from rest, held or as slip begins, as arrays; and the share of cases decided."""

    margin: np.ndarray
    theta: np.ndarray
    acceleration: np.ndarray
    multipliers: np.ndarray
    tau: np.ndarray
    share: np.ndarray
    solved: float


def _ends(search: Search, drive: _Drive, theta: jax.Array, samples: int, seed: int) -> _Ends:
    solutions, cases = search.solutions, search.cases
    n, m = solutions.free.acceleration.size, solutions.stress.shape[0]
    found = search.found(drive.output[None], np.zeros(1, bool), samples if cases.lower.size else 0, seed)
    margin = -(found.values @ drive.output)
    if drive.none:
        margin = np.full_like(margin, np.inf)
    slips = found.within() & (margin < -_LIMIT)
    # From solutions, and from cases without any: friction that grows with its own load can hold and not let go.
    without = np.array([row not in {tuple(row) for row in found.theta} for row in map(tuple, np.asarray(theta))])
    places = jnp.concatenate([jnp.asarray(found.theta), theta[without]])
    begin = np.concatenate([found.tau, np.full((without.sum(), drive.effect.size), np.nan)])
    margin = np.concatenate([margin, np.full(without.sum(), np.inf)])
    effect = jnp.asarray(drive.effect)
    stays = _in_batches(lambda *own: held(solutions, cases, effect, *own), len(theta), places, jnp.asarray(begin))
    if drive.none:
        stays = stays._replace(
            tau=0 * begin, share=np.zeros(len(begin)), multipliers=found.values[:, n : n + m], good=found.good
        )
    sticks = stays.within() & (margin >= -_LIMIT)
    decided = {tuple(row) for row in (*found.theta[slips], *stays.theta[sticks])}
    parts = [
        (margin[: len(slips)][slips], margin[sticks]),
        (found.theta[slips], stays.theta[sticks]),
        (found.values[slips, :n], np.zeros((sticks.sum(), n))),
        (found.values[slips, n : n + m], stays.multipliers[sticks]),
        (found.tau[slips], stays.tau[sticks]),
        (np.ones(slips.sum()), stays.share[sticks]),
    ]
    solved = np.mean([tuple(row) in decided for row in np.asarray(theta)])
    margins, *others = (np.concatenate(part) for part in parts)
    return _Ends(margins, *others, solved=float(solved))


def _in_batches(function: Callable[..., T], size: int, *arrays: ArrayLike) -> T:
    """A compiled function of rows, called with batches of one size, so that nothing is compiled anew."""
    rows, parts = np.asarray(arrays[0]).shape[0], []
    for first in range(0, rows, size):
        places = np.minimum(np.arange(first, first + size), rows - 1)
        out = jax.device_get(function(*(jnp.asarray(array)[places] for array in arrays)))
        parts.append(jax.tree.map(lambda x, first=first: x[: rows - first], out))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *parts)


def _gamma(solutions: SolutionSet, cases: AbstractCases) -> np.ndarray:
    if solutions.law is None:
        return np.zeros((0, 0))
    gain = cases.chosen(cases.lower)[1][solutions.rows]
    return np.asarray(solutions.law.largest_changes(gain))


def _most_holds(solutions: SolutionSet, cases: AbstractCases, drive: _Drive) -> bool:
    """Whether, of all friction, the whole friction against the start is proved to hold most."""
    gamma, effect = _gamma(solutions, cases), np.abs(drive.effect)
    back = effect @ np.linalg.solve(np.eye(len(gamma)) - gamma, gamma) if gamma.size else effect
    return bool(spectral_radius(gamma) < 1 and np.all(back <= effect))


def _covered(search: Search, drive: _Drive, theta: jax.Array, sign: float) -> bool:
    """Whether cells prove that sign * margin >= 0 over the whole box, where each case has one solution."""
    solutions, cases = search.solutions, search.cases
    if not isinstance(cases, Affine) or solutions.law is None:
        return False
    gamma = _gamma(solutions, cases)
    change = np.asarray(solutions.law.largest_changes(cases.slope[solutions.rows]))
    slope = np.abs(drive.effect) @ np.linalg.solve(np.eye(len(gamma)) - gamma, change)
    middle, half = np.asarray(cases.lower + cases.upper)[None] / 2, np.asarray(cases.upper - cases.lower)[None] / 2
    looked = 0
    while len(middle) and looked < _CELLS:
        looked += len(middle)
        found = _in_batches(lambda own: sampled(solutions, cases, own, search.factors), len(theta), middle)
        margin = sign * np.where(found.good[:, 0], -(found.values[:, 0] @ drive.output), np.nan)
        if not np.all(margin >= 0):
            return False
        left = margin < half @ slope
        middle, half = middle[left], half[left]
        widest = (half * slope).argmax(axis=1)[:, None] == np.arange(len(slope))
        half = np.where(widest, half / 2, half)
        shift = np.where(widest, half, 0.0)
        middle, half = np.concatenate([middle - shift, middle + shift]), np.concatenate([half, half])
    return not len(middle)
