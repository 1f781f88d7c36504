"""What a solve can end with. Failures are values: one bad sample does not end a sweep.

Numbers are given only with `RESULTS.successful`; with every other result the arrays of a solution are NaN, and its
`stats` hold the evidence.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, PyTree

from .._tools._module import is_concrete
from .._tools._numbers import is_number, xp


class _Words(type(eqx.Enumeration)):
    """An enumeration that tells of a batch how many ended in which way."""

    def __getitem__(cls, item: PyTree) -> str:
        item = jax.tree.map(lambda code: np.asarray(code) if isinstance(code, np.generic | int) else code, item)
        codes = next(iter(jax.tree.leaves(item)), None)
        if not isinstance(codes, np.ndarray | jax.Array) or not is_concrete(codes) or codes.ndim == 0:
            return type(eqx.Enumeration).__getitem__(cls, item)  # pyright: ignore[reportCallIssue]
        names = {code: name for name, code in result_codes().items()}
        counts = zip(*np.unique(np.asarray(codes), return_counts=True), strict=True)
        return ", ".join(f"{count} {names[int(code)]}" for code, count in counts)


class RESULTS(eqx.Enumeration, metaclass=_Words):
    """How a solve ended, with a message that names the cause and a way out.

    `RESULTS[result]` is the message; of a batch it says how many ended in which way, as a print of the result does.

    ??? example

        ```python
        solution = rx.solve(mechanism, mechanism.state(phi=0.8), throw=False)  # at rest, with friction
        solution.result == rx.RESULTS.friction_at_rest  # True
        print(rx.RESULTS[solution.result])
        ```
    """

    __module__ = "redundax"  # where users find it, and what a print says

    successful = "successful"
    violated_constraints = (
        "The state does not satisfy the constraints Phi(q, t) = 0: `stats.violation` is the largest residual "
        "relative to the size of the mechanism. Give a state on the constraint manifold: `rx.assemble` finds the one "
        "nearest to a guess."
    )
    inadmissible_velocity = (
        "The velocity is not admissible: either Phi_q qd + Phi_t = 0 fails, or the position is singular and "
        "the self-stress condition N^T gamma = 0 fails, so that no acceleration exists. Give a velocity "
        "along one of the branches of motion."
    )
    inconsistent_constraints = (
        "The constraints contradict each other: the accelerations that they prescribe cannot all be met "
        "(A A^+ b differs from b). Remove or correct one of the contradictory driving constraints."
    )
    ambiguous_constraints = (
        "Whether the constraints contradict each other cannot be decided: the accelerations that they prescribe differ "
        "by hardly more than rounding and the violation of the state explain. Bring the state closer to the constraint "
        "manifold with `rx.assemble`."
    )
    ambiguous_rank = (
        "The rank of the constraint Jacobian cannot be decided: a singular value lies too close to the "
        "tolerance, or to what points of few digits make of it, or a declared rank keeps one that is rounding. Look at "
        "`stats.spectrum` and declare the rank with `rank=`, or bring the state closer to the constraint manifold."
    )
    singular_position = (
        "The position is singular: the rank of the constraints is lower here than beside it, branches of motion meet, "
        "and nothing decides on which of them the accelerations are. The velocity does not at rest and where branches "
        "touch, and inside `jit` and `vmap` and in motions it is not asked. Give a velocity along one branch to a "
        "`solve` outside of them, move the state beside the position, or let `simulate` pass it from a state before it."
    )
    ambiguous_position = (
        "Whether the position is singular, or on which branch of motion the velocity is, cannot be decided: what tells "
        "is hardly more than rounding. Bring the state closer to the constraint manifold, or move it."
    )
    unbounded_friction = (
        "The position is singular, and friction depends on the load of a joint that its local self-stress touches: "
        "beside the position that load and its friction grow as 1 over the distance, so that the mechanism jams, or "
        "have a limit that these equations do not know. Move the state beside the position, or leave out this friction."
    )
    indeterminate_acceleration = (
        "The accelerations are not unique: rank [M Phi_q^T] < n, condition (14). Give mass or inertia to "
        "every coordinate that the constraints leave free."
    )
    ambiguous_mass = (
        "Whether the accelerations are unique, condition (14), cannot be decided: the mass of a motion is hardly more "
        "than what rounding leaves of none. Give it more mass or inertia, or a state further from singular positions."
    )
    indeterminate_closure = (
        "The closure does not determine the multipliers: some self-stress loads only what the closure holds rigid, and "
        "N^T W N is singular. Give compliance to more of what is in self-stress; `rx.analyze` prints each state of it."
    )
    ambiguous_closure = (
        "Whether the closure determines the multipliers cannot be decided: the compliance of a self-stress state is "
        "hardly more than what rounding leaves of none. Give a compliance `W` that is clearly positive on it."
    )
    unsolved = (
        "The linear equations (7) were not solved: their residual is too large. The declared rank may be too low, or "
        "masses and geometry differ in size by too much for this precision."
    )
    not_finite = (
        "The result is not finite: look for NaN or infinity in the state, parameters, loads or `closure`, and for "
        "guides that their sliders have left."
    )
    friction_at_rest = (
        "A joint with friction is at rest, where Coulomb friction can take any value up to its bound. Ask `rx.band` "
        "what its joints may carry while it stands, `rx.sticking` whether it stays at rest and `rx.limit_load` what "
        "moves it, or give the sense of the impending slip with `sense=`, 1 or -1."
    )
    ambiguous_rest = (
        "Whether a joint with friction moves cannot be decided: its slip rate is hardly more than rounding and the "
        "violation of the constraints by the velocity explain. Give the sense of its slip with `sense=`, or a state "
        "closer to the constraint manifold."
    )
    no_contraction = (
        "The friction iteration does not contract: its residual stopped decreasing. That says nothing about "
        "the existence of a solution; leave `solver` out, or try another `x0` or a smaller friction coefficient."
    )
    no_solution_found = (
        "No solution of the frictional equations was found: Newton's method does not converge, and followed from "
        "zero friction the solution ends at the fraction `stats.fold` of the friction. Beyond a fold there may be no "
        "solution (the mechanism jams) or others apart from this branch: `frictional_solutions` searches for them. "
        "Reduce the friction coefficient below the fold, or change the closure."
    )
    max_steps_reached = (
        "The friction iteration reached `max_steps` before it met the tolerance. Raise `max_steps` or `rtol`."
    )
    contacts_undecided = (
        "Which contacts carry, or at which side joints with play stand, was not found: no choice that was tried meets "
        "all conditions. Drivers may contradict contacts that push: look at what they drive there. Where joints have "
        "friction, or wheels roll with any load, there may be no solution (the mechanism jams, or a wheel slips) or "
        "several: reduce the friction. Where `stats.nearest_singularity` of a motion is far below 1 a singular "
        "position is next. Or say which contacts carry by leaving the others out."
    )
    impulse_unknown = (
        "The motion ended at an impact: it loads joints whose friction has no law of impulses, bristles or a "
        "`Friction` of your own that depends on loads. Give them `Coulomb`, or no friction."
    )
    steps_exhausted = "The motion took `max_steps` steps before `t1`. Raise `max_steps` or `rtol`."
    step_too_small = (
        "The motion stopped where steps became too small. Where `stats.nearest_singularity` is far below 1 a singular "
        "position is next, a flat or dead one, that the motion does not pass: start beyond it, and in float64. Else, "
        "where `stats.contraction` is 1 or more, friction may have no solution further on (it jams) or one on another "
        "branch only. Else loads or laws of time are not smooth there, or end: give such times as `jump_ts`."
    )
    stuck = (
        "The mechanism came to rest and sticks: admissible friction forces hold it, and its loads do not let it go by "
        "`t1`. At rest friction and multipliers are not determined, and NaN."
    )
    joint_sticks = (
        "The motion stopped where it could not be decided which joints stick and which slip on. "
        "Friction this large may jam; `RegularisedCoulomb` goes on."
    )
    phases_exhausted = (
        "Joints stopped, reversed or were let go, or contacts opened or closed, `max_phases` times before `t1`. Raise "
        "`max_phases`."
    )
    rank_changed = (
        "The motion stopped where the rank of its constraints changes for good. Start a motion of its own beyond."
    )
    diverged = (
        "The friction iteration diverged to values that are not finite. At this friction level the equations "
        "may have no solution; reduce the friction coefficient."
    )
    times_out_of_order = (
        "The times do not follow each other: a motion runs forward, from the time of `state` through `ts` to `t1`. "
        "Look for a `t1` before the start, times beyond the ends or in descending order, and NaN."
    )

    no_position = (
        "There is no position: none that satisfies the constraints, with the values that are given, was found near the "
        "guess, or a number of the guess is NaN. Give a better guess, or change given values or lengths."
    )
    no_velocity = (
        "There is no velocity: at the position found none satisfies the constraints with the rates that are given. "
        "Change given rates, or look for a dead centre, through which a given rate would need infinite others."
    )

    __members__ = tuple(name for name in vars() if not name.startswith("__"))  # last, after all of them


def chosen(flag: Bool[Array, ""], yes: RESULTS, no: RESULTS) -> RESULTS:
    """One of two results."""
    return (yes if flag else no) if is_number(flag) else RESULTS.where(flag, yes, no)


def differs(one: object, other: object) -> Bool[Array, ""]:
    """Whether two results differ, of whichever kind."""
    return xp.not_equal(*jax.tree.leaves((one, other)))


def first_failure(checks: Sequence[tuple[Bool[Array, ""], RESULTS]]) -> RESULTS:
    """The result of the first check that did not pass, or `RESULTS.successful`."""
    result = RESULTS.successful
    for passed, failure in reversed(checks):
        result = chosen(passed, result, failure)
    return result


def is_one_of(result: RESULTS, *expected: RESULTS) -> bool:
    """Whether a result that is known is one of these; in NumPy, which compiles nothing."""
    return int(jax.tree.leaves(result)[0]) in [int(jax.tree.leaves(one)[0]) for one in expected]


def result_codes() -> dict[str, int]:
    """The name of every result and the number that stands for it in arrays."""
    return {name: int(jax.tree.leaves(getattr(RESULTS, name))[0]) for name in RESULTS.__members__}


def flags(dtype: np.dtype) -> dict[str, str | np.ndarray]:
    """What every number of results stands for, as the CF conventions write it into the attributes of a data set."""
    codes = result_codes()
    return {"flag_values": np.array([*codes.values()], dtype), "flag_meanings": " ".join(codes)}
