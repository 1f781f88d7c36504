"""What a solve returns."""

import itertools
import math

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._equations._evidence import Violation
from .._equations._rank import Spectrum
from .._system._contact import in_sentences, words
from .._system._joint_coordinates import JointMotion, joint_motion, joint_reactions
from .._system._named import AbstractNamed
from .._system._pages import further, notes, numbers_of, outcome, ranges_of, values_of
from .._system._pushing import in_words, pulling
from .._system._results import RESULTS, is_one_of
from .._system._state import State
from .._tools._errors import RedundaxError
from .._tools._table import AbstractFigures, are_known, page
from .._tools._value import value


@value
class Stats(AbstractFigures):
    """The evidence beside the numbers; it is there whatever the result. Figures other than `contraction` are found
    without derivatives: these are 0, and say nothing of how `spectrum` and `lost_digits` change.

    - `redundancy`, `freedom`: k = m - r redundant constraints and n - r degrees of freedom.
    - `spectrum`: the rank decision with singular values, tolerance and gap.
    - `violation`: consistency of the state.
    - `singular_position`: whether the rank is lower at this position than beside it, so that branches of motion meet.
      (7) does not keep accelerations on their branch there: its third-order condition does where the velocity decides
      the branch, outside of `jit` and `vmap`, and else none are given.
    - `lost_digits`: decimal digits that accelerations and multipliers lose to the smallest kept singular value, as
      beside a singular position; of about 16 in float64, 7 in float32.
    - `steps`: friction iterations done; 0 without friction.
    - `tolerance`: what `residual` and `step` had to reach.
    - `residual`: last relative change of friction (fixed point) or relative residual of (34) (Newton).
    - `step`: last relative change of the loads.
    - `contraction`: upper bound of the spectral radius of one sweep of friction at the solution, 0 without friction
      that depends on load; below 1 the fixed-point iteration contracts there. By sparse matrices it is an estimate.
    - `fold`: fraction of the friction up to which the branch of solutions from zero friction exists; infinite if it
      reaches the whole friction, or was not followed because Newton's solution contracts.

    ??? example

        ```python
        stats = rx.solve(mechanism, state).stats
        stats.rank, stats.redundancy, stats.spectrum.gap, stats.contraction
        ```
    """

    redundancy: Int[Array, ""]
    freedom: Int[Array, ""]
    spectrum: Spectrum
    violation: Violation
    singular_position: Bool[Array, ""]
    lost_digits: Float[Array, ""]
    steps: Int[Array, ""]
    tolerance: Float[Array, ""]
    residual: Float[Array, ""]
    step: Float[Array, ""]
    contraction: Float[Array, ""]
    fold: Float[Array, ""]

    @property
    def rank(self) -> Int[Array, "*batch"]:
        """r, rank of the constraint Jacobian."""
        return self.spectrum.rank


class Solution(AbstractNamed):
    """Accelerations, multipliers and friction at a state, also by name.

    `solution["crank.phi''"]` is an acceleration and `solution["K.travel''"]` that of a joint coordinate; without primes
    it is the coordinate at the state, with one its rate. `solution["A force x on crank"]` is the constraint force of a
    joint on that body, either of its two, in global components, but for its friction, `solution["tau A"]`.
    `solution["A.x"]` is the multiplier of that row, with the sign of the paper: of a revolute joint it is minus the
    force on body i. Of a batch they are arrays with its axes. Other names raise a `ValueError` that is a `KeyError`
    too. `to_pandas()` and `to_xarray()` give everything by name, a row for each case, with units in `attrs`.

    - `acceleration`: qdd, shape (n,).
    - `multipliers`: lam, shape (m,); the constraint force on the system is -Phi_q^T lam.
    - `friction`: friction forces and moments tau, one for each slip, shape (p,); on a joint's body i, and
      the opposite on body j.
    - `result`: how the solve ended. The three arrays are NaN unless it is `RESULTS.successful`; at a singular position
      those multipliers are too that have no value there: those of the rows that the self-stress of this position alone
      touches, which are unbounded beside it or whose limit is not known.
    - `stats`: the evidence.
    - `state`: the state, where `solve` gives the solution.
    - `contact`: what one-sided contacts do, as the numbers of `contacts`; None where there are none.
    - `names`: what is called how.
    - `joint_coordinates`: what the angles of revolutes and the travels of sliders, of body i relative to body j, are
      computed from when they are asked for by name, or by `joints`.

    ??? example

        ```python
        solution = rx.solve(mechanism, state)
        solution.acceleration, solution.multipliers, solution.friction  # shapes (12,), (12,), (4,)
        solution["1.phi''"], solution["K.travel'"]  # rad/s^2, m/s
        solution["A force x on 1"], solution["A.x"], solution["tau A"]  # N, minus that, N m
        ```
    """

    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    friction: Float[Array, " p"]
    result: RESULTS
    stats: Stats
    state: State | None = eqx.field(default=None, repr=False, kw_only=True)
    contact: Int[Array, " c"] | None = eqx.field(default=None, repr=False, kw_only=True)

    @property
    def q(self) -> Float[Array, "..."]:
        """The position at which it was solved."""
        return self._at.q

    @property
    def qd(self) -> Float[Array, "..."]:
        """The velocity there."""
        return self._at.qd

    @property
    def centres(self) -> Float[Array, "..."]:
        """Positions of the centres of mass in space, shape (3 bodies,)."""
        return self._at.q[..., : 0 if self.names is None else len(self.names.centres)]

    @property
    def joints(self) -> JointMotion:
        """How joint coordinates move: `position`, `rate` and `acceleration`, shape (c,) each."""
        return joint_motion(self.joint_coordinates, self._at, self.acceleration)

    @property
    def reactions(self) -> Float[Array, "*batch r"]:
        """What each joint does to its body i, or to body j where i is the ground: force x and y in global components,
        and the moment about its point on that body, joint by joint, but for its friction, which is `friction`.

        Their names are "A force x on crank", "A force y on crank" and "A moment on crank".
        """
        return joint_reactions(self.joint_coordinates, self._at, self.multipliers)

    @property
    def contacts(self) -> dict[str, str | np.ndarray]:
        """What each one-sided contact does, by the name of its joint or row: "carries", "touches" (closed without
        load), "lifts" or "open"; of a batch arrays of words."""
        return words(self.contact, self.names)

    @property
    def pulling(self) -> tuple[str, ...]:
        """Names of the rows of teeth that pull, in any sample of a batch: their other flanks are in contact."""
        return pulling(self.names, self.multipliers)

    @property
    def _at(self) -> State:
        if self.state is None:
            raise RedundaxError(
                "This solution does not know its state: it does not come from `solve`. Index its arrays."
            )
        return self.state

    def __str__(self) -> str:
        """A table by name, or what failed; of a batch the least and the largest; inside of transformations shapes."""
        numbers = {name: getattr(self, name) for name in ("acceleration", "multipliers", "friction")}
        if self.names is None or not are_known((self.result, self.stats, self.state, *numbers.values())):
            return repr(self)
        head = [*self._outcome(), *in_sentences(self.contacts), *notes(self.names, in_words(self.pulling))]
        if self.acceleration.ndim > 1:
            failed = "failed" if any(np.isnan(array).any() for array in numbers.values()) else ""
            left, *right = (ranges_of(self.names, name, array, failed) for name, array in numbers.items())
        elif not is_one_of(self.result, RESULTS.successful):
            return "\n".join(head)
        else:
            places = ["q"] if self.names.adds else ["centres"] * bool(len(self.names.centres))
            moves = [*places, "qd"] if self.state is not None else []
            left = values_of(self.names, *((name, getattr(self, name)) for name in (*moves, "acceleration")))
            right = [values_of(self.names, (name, numbers[name])) for name in ("multipliers", "friction")]
        return "\n".join([*head, *page(left, [*itertools.chain(*right)], _MORE), *further(self.names)])

    def _outcome(self) -> list[str]:
        """How it ended, or all of a batch did, and the counts."""
        stats, shape = self.stats, self.acceleration.shape[:-1]
        what = f"{math.prod(shape)} solutions" if shape else "Solution"
        counts = {"redundancy": stats.redundancy, "freedom": stats.freedom, "steps of friction": stats.steps}
        return [*outcome(self.result, what), *numbers_of(counts)]


_MORE = "All of them: print(solution.to_pandas().T.to_string())"
