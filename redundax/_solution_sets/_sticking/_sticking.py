"""Whether a mechanism at rest sticks, and which of its joints, under what is known of its preload.

At rest dry friction is a set. A case, that is a self-stress z, has as states that are possible from rest all tau with

    alpha = alpha_0 + A tau,   |tau_j| <= limit_j(rho),   rho = rho_0(z) + K tau,
    alpha_j = 0, or tau_j = -limit_j sgn alpha_j,

where alpha are the rates of the slip rates, alpha_0 without friction. Two questions are kept apart. Does the whole stay
at rest: is there a tau within its limits that leaves no acceleration at all? And does a joint stick: is alpha_j = 0,
while others may slip? With one degree of freedom they are one, for all joints that slip do so together.

    margin = (the largest part of the load's drive that friction can hold, at the loads that it has then) - 1:

0 and more where it sticks, -1 where no friction acts against some part of the drive. Where joints slip one by one,
margin < 0 says that the acceleration cannot vanish: the drive would have to fall by the share -margin for rest.

`_many_freedoms` finds and proves it, by linear programmes. With one degree of freedom it is the load that friction in
full slip takes up, and `_one_freedom` proves more. `_stick_slip` asks for the joints, `_joint_verdicts` says what is
known of them over the bounds.
"""

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._analyze import analyze
from ..._analysis._report import Report
from ..._closures._closure import AbstractClosure, MinimumNorm
from ..._equations._factorisation import Factorisation
from ..._solve._all_solutions import start_factors
from ..._system._state import State
from ..._system._system import AbstractSystem, check_system_at
from ..._tools._errors import NoSolutionError, RedundaxError
from ..._tools._module import check_seed, check_whole, replace_fields
from ..._tools._questions import question
from .._at_rest import LIMIT, Ends, ReducedForce, drive
from .._bounds import AbstractBounds, cases_of, check_bounds, title_of
from .._loads_at_rest._wedged import wedged
from .._pushing import held, pulling_rows
from .._search import Search, proved_single
from .._solution_set import solution_set
from ._joint_verdicts import joint_verdicts
from ._many_freedoms import ManyFreedoms
from ._one_freedom import is_covered, most_holds
from ._stick_slip import one_start
from ._sticking_report import Sticking

_MINIMUM_NORM = MinimumNorm()


@question
def sticking(
    system: AbstractSystem,
    state: State,
    bounds: AbstractBounds | AbstractClosure = _MINIMUM_NORM,
    *,
    samples: int = 256,
    starts: int = 8,
    seed: int = 0,
    rank: ArrayLike | None = None,
    factor: Factorisation | None = None,
) -> Sticking:
    """Whether a mechanism at rest, and each of its joints, must stick, may stick or must slip.

    ??? example

        ```python
        rest = mechanism.state(phi=0.8, rate=0.0)
        found = rx.sticking(mechanism, rest, rx.AmplitudeBox({"A.x": (-400.0, 400.0)}))  # N
        print(found)
        found.verdict, found.proved
        dict(zip(found.names, found.slip_verdicts))  # joint by joint
        ```

    **Arguments:**

    - `system`, `state`: concrete values, at rest; not inside `jit` or `vmap`.
    - `bounds`: what is known of preload, misfit or compliance, as of `band`; or a closure, for the loads that it picks.
    - `samples`: random cases that are looked at, beside vertices.
    - `starts`, `seed`: random initial loads for each of them, where the number of solutions is not proved.
    - `rank`, `factor`: as in `solve`.

    One-sided contacts that are closed are held; where one would pull in a case it lifts, and an error tells which. Over
    bounds nothing is proved then.

    **Raises:** `ValueError` where the state moves, drivers set it in motion, the system has no degree of freedom, or
    bounds do not fit it; `RuntimeError` where the equations cannot be trusted, as `solve` does.
    """
    check_bounds(bounds)
    check_system_at(system, state)
    check_whole(0, samples=samples, starts=starts)
    check_seed(seed)
    state = replace_fields(state, memory=())  # bristles that bend let it move, so they do not count
    system, factor, pushing = held(system, state, rank, factor)
    start = drive(system, state, factor)
    report = analyze(system, state, sense=start.sense, factor=factor)
    if report.problem:
        raise NoSolutionError(report.problem)
    if report.freedom < 1:
        raise RedundaxError("Argument `system` must have a freedom to stick or slip, but has none. Release a lock.")
    solutions = solution_set(system, state, factor, report.self_stress, start.sense)
    cases = cases_of(bounds, system, state, report, solutions)
    single = proved_single(solutions, cases, report)
    search = Search(solutions, cases, start_factors(solutions.rows.size, 0 if single else starts, seed))
    samples = samples if cases.lower.size else 0
    theta = search.sample(samples, seed)
    fixed = isinstance(bounds, AbstractClosure) or not report.friction_reads
    many = ManyFreedoms(search, start, len(theta), reads=not fixed)
    ends = many.ends(theta, seed)
    ends = _with_wedged(ends, system, state, factor, bounds, report)
    _check_pushes(ends, pushing, report)
    verdict = _verdict(ends)
    known = fixed and ends.solved == 1 and one_start(start, many.gamma)  # the one state that was found is all
    if report.freedom == 1 and not known:
        known = verdict != "undecided" and (
            start.none or (single and _proved_of_one(verdict, search, start, fixed=fixed))
        )
    may_pull = bool(pushing) and not isinstance(bounds, AbstractClosure)  # in cases that nobody looked at

    def proves(verdict: str, joint: int | None = None) -> bool:
        return not may_pull and (known or many.proves(verdict, joint))

    proved, blocked = proves(verdict), np.logical_not(start.slips.any(axis=1))
    joints = joint_verdicts(ends, blocked, proves)
    order = [np.argmin(ends.margin), np.argmax(ends.margin)] if len(ends.margin) else []
    return Sticking(
        verdict=verdict,
        proved=proved,
        margin=ends.margin[order],
        case=cases.figures(ends.theta[order]),
        acceleration=ends.acceleration[order],
        multipliers=ends.multipliers[order],
        friction=ends.tau[order],
        share=ends.share[order],
        bounds=type(bounds).__name__,
        parameters=cases.names,
        box=cases.box,
        title=title_of(bounds, cases),
        names=tuple(system.slips.labels),
        senses=start.sense,
        slip_verdicts=joints.verdicts,
        slip_proved=joints.proved,
        slip_senses=joints.senses,
        can_hold=any(group.has_sense for group in system.friction),
        solved=ends.solved,
    )


def _check_pushes(ends: Ends, pushing: tuple[int, ...], report: Report) -> None:
    """Refuse states in which a contact would pull: there it lifts, and the mechanism is another."""
    pulls = np.ravel(pulling_rows(ends.multipliers, pushing).any(axis=0))
    if pulls.any():
        rows = ", ".join(report.rows[row] for row, own in zip(pushing, pulls, strict=True) if own)
        raise NoSolutionError(
            f"Contacts would pull in {rows} in a case that was found: they lift, which `sticking` does not follow. "
            "`limit_load` tells how much load they bear until they lift, and `solve` how they do."
        )


def _verdict(ends: Ends) -> str:
    """The verdict that states found support."""
    slips, sticks = ends.margin < -LIMIT, ends.margin >= -LIMIT
    if not len(ends.margin):
        return "undecided"
    return "may stick" if slips.any() and sticks.any() else "must slip" if slips.any() else "must stick"


def _proved_of_one(verdict: str, search: Search, start: ReducedForce, *, fixed: bool) -> bool:
    """Whether a verdict is proved where each case has one solution; `fixed` says that friction is the same in all."""
    if verdict == "must stick":
        return fixed or is_covered(search, start, 1.0)
    settled = verdict != "undecided" and most_holds(search.solutions, search.cases, start)
    return settled and (verdict == "may stick" or fixed or is_covered(search, start, -1.0))


def _with_wedged(
    ends: Ends,
    system: AbstractSystem,
    state: State,
    factor: Factorisation,
    bounds: AbstractBounds | AbstractClosure,
    report: Report,
) -> Ends:
    """With a state of joints that wedge themselves, where none was found that friction holds."""
    if np.any(ends.margin >= -LIMIT) or not system.friction:
        return ends
    resting = solution_set(system, state, factor, report.self_stress, None)
    held = wedged(system, state, factor, resting, cases_of(bounds, system, state, report, resting))
    return ends if held is None else ends.beside(held)
