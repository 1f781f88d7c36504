"""What `simulate` returns."""

import itertools
import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._system._contact import words
from .._system._joint_coordinates import JointMotion, joint_motion, joint_reactions
from .._system._named import AbstractNamed
from .._system._pages import further, notes, numbers_of, outcome, ranges_of, spans_of
from .._system._pushing import in_words, pulling
from .._system._results import RESULTS
from .._system._state import State
from .._tools._table import AbstractFigures, are_known, page, text_of
from .._tools._value import AbstractModule


class TrajectoryStats(AbstractFigures, AbstractModule):
    """The evidence beside a motion, over all its accepted steps. Of figures that are no counts only `end` has
    derivatives: those of the others are NaN.

    - `steps`, `rejected`: steps of motion accepted and rejected.
    - `phases`: phases of motion between events at which joints came to a stop or were let go; 1 without them.
    - `end`: time at which the motion ended: `t1`, or where it came to rest for good or stopped.
    - `position_violation`: largest |Phi|, relative to the size of the mechanism.
    - `velocity_violation`: largest |Phi_q qd + Phi_t|, relative to the largest velocity.
    - `kinetic_energy`: the largest.
    - `energy_error`: largest change of kinetic energy less the work of loads, friction and drivers, relative to the
      largest kinetic energy, or of what stands to what loads do along the size of the mechanism; 0 for the exact
      motion.
    - `nearest_singularity`: how near to a singular position steps ended: 0 in it, about 1 far from it, infinite where
      there was no step.
    - `contraction`: largest bound of the contraction of friction at all loads; below 1 friction, and so the motion, is
      proved unique under the closure, with those joints sticking that do; of impacts it is that if all slip. By sparse
      matrices it is an estimate where the motion is, and of joints with play that of the sides at which they stand,
      which proves nothing.
    - `jump`: where it is not, the largest change of friction in a step, relative to its size; at most 0.1, so that the
      motion follows one branch of solutions.
    """

    steps: Int[Array, ""]
    rejected: Int[Array, ""]
    phases: Int[Array, ""]
    end: Float[Array, ""]
    position_violation: Float[Array, ""]
    velocity_violation: Float[Array, ""]
    kinetic_energy: Float[Array, ""]
    energy_error: Float[Array, ""]
    nearest_singularity: Float[Array, ""]
    contraction: Float[Array, ""]
    jump: Float[Array, ""]


class Impacts(AbstractModule):
    """Impacts of one-sided contacts in a motion, in order; inside of transformations there are as many as phases at
    most, NaN behind the last.

    ??? example

        ```python
        fall = rx.State([1.0], [0.0])
        ball = rx.System(
            lambda q, t, p: -q, [2.0], lambda q, qd, t, p: jnp.array([-19.6]), rows="force", m=1, one_sided=[0]
        )
        impacts = rx.simulate(ball, fall, 1.0, restitution=0.5).impacts
        impacts.t, impacts.energy  # s, J
        impacts.impulses  # N s of each contact, in the order of `contacts`
        ```

    - `t`: times, shape (impacts,).
    - `impulses`: of all contacts, positive where they push, shape (impacts, contacts).
    - `energy`: what they took, shape (impacts,): kinetic energy before less that after, and `work`.
    - `work`: that of drivers, and of all that moves as prescribed, by their impulses, shape (impacts,).
    """

    t: Float[Array, " impacts"]
    impulses: Float[Array, "impacts contacts"]
    energy: Float[Array, " impacts"]
    work: Float[Array, " impacts"]


class Trajectory(AbstractNamed):
    """A motion at the times asked for, also by name.

    `motion["ram.y"]`, `motion["ram.y'"]` and `motion["ram.y''"]` are a position, its velocity and its acceleration,
    `motion["A force x on ram"]` is the force of a joint on that body, `motion["A.x"]` a multiplier with the sign of the
    paper, `motion["tau A"]` friction, `motion["K.travel"]` a joint coordinate, each of shape (times,). Where velocities
    are not rates of positions, as in a chart, positions have no names.

    Where the motion did not get to, all is NaN; accelerations, multipliers and friction are NaN too where the held rank
    gives none, as exactly in a singular position.

    - `t`: times, shape (times,).
    - `q`, `qd`: coordinates and velocities, on the constraint manifold with `Projection`; `q` as the chart has it.
    - `acceleration`, `multipliers`, `friction`: qdd, lam and tau of the closure, as `solve` gives them. Where
      `stats.contraction` is not below 1 they may be of another solution than the motion follows.
    - `sense`: sense of slip of each friction, 0 where the joint sticks; 1 where friction does not depend on it. Of
      sleeves, balls, plates and points on planes the unit direction of the velocity of their surfaces, as (R omega, v).
    - `memory`: internal states of friction laws that have some, one entry for each friction group.
    - `result`: how the motion ended.
    - `stats`: the evidence.
    - `contact`: what one-sided contacts do, as the numbers of `contacts`, shape (times, contacts), -1 where the motion
      did not get to; None where there are none.
    - `impacts`: those of one-sided contacts, None where there are none.
    - `names`: what is called how.
    - `joint_coordinates`: what joint coordinates are computed from when they are asked for by name, or by `joints`.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        motion = rx.simulate(smooth, smooth.state(phi=0.8, rate=1.0), 0.1)
        motion.t, motion["1.phi''"], motion["K.travel"]  # s, rad/s^2 of body 1, m of slider K
        motion.stats.steps, motion.stats.energy_error
        ```
    """

    t: Float[Array, " times"]
    q: Float[Array, "times ..."]
    qd: Float[Array, "times n"]
    acceleration: Float[Array, "times n"]
    multipliers: Float[Array, "times m"]
    friction: Float[Array, "times p"]
    sense: Float[Array, "times p"]
    memory: tuple[PyTree, ...]
    result: RESULTS
    stats: TrajectoryStats
    contact: Int[Array, "times c"] | None = None
    impacts: Impacts | None = None

    @property
    def contacts(self) -> dict[str, str | np.ndarray]:
        """What one-sided contacts do at the times, by name: arrays of "carries", "touches" and "open"; "" where the
        motion did not get to."""
        return words(self.contact, self.names)

    @property
    def centres(self) -> Float[Array, "..."]:
        """Positions of the centres of mass in space, shape (times, 3 bodies)."""
        return self.q[..., : 0 if self.names is None else len(self.names.centres)]

    @property
    def joints(self) -> JointMotion:
        """How joint coordinates move: `position`, `rate` and `acceleration`, shape (times, c) each.

        In space angles start between -pi and pi and go on without jumps.
        """
        return joint_motion(self.joint_coordinates, self.states, self.acceleration, times=True)

    @property
    def reactions(self) -> Float[Array, "..."]:
        """What each joint does to its body, as of a `Solution`, shape (times, 3 joints)."""
        return joint_reactions(self.joint_coordinates, self.states, self.multipliers, times=True)

    @property
    def pulling(self) -> tuple[str, ...]:
        """Names of the rows of teeth that pull at any time: there their other flanks are in contact."""
        return pulling(self.names, self.multipliers)

    @property
    def states(self) -> State:
        """The states at all times, each array with an axis for them in front."""
        return State(self.q, self.qd, self.t, self.memory)

    def __str__(self) -> str:
        """How it ended, and the least and the largest of all by name; shapes inside of transformations."""
        names = self.names
        loads = {name: getattr(self, name) for name in ("multipliers", "friction")}
        if names is None or not are_known((self.t, self.result, self.stats, self.q, self.qd, loads)):
            return repr(self)
        moves = [("q", "qd")] if names.adds else [("centres",)] * bool(len(names.centres)) + [("qd",)]
        left = [each for own in moves for each in spans_of(names, *((name, getattr(self, name)) for name in own))]
        right = itertools.chain(*(ranges_of(names, name, array) for name, array in loads.items()))
        head = [*self._outcome(), *notes(names, in_words(self.pulling))]
        return "\n".join([*head, *page(left, [*right], _MORE), *further(names)])

    def _outcome(self) -> list[str]:
        """Times, how it ended, and the evidence."""
        stats, (*shape, count) = self.stats, self.t.shape
        what = f"{math.prod(shape)} motions" if shape else "Motion"
        unit = "" if self.names is None else self.names.units.of("time")
        times = f"{count} times from t = {jnp.nanmin(self.t):.6g} to {jnp.nanmax(self.t):.6g} {unit}".strip()
        steps = {"end at t =": stats.end, "nearest singularity": stats.nearest_singularity}
        steps |= {"contraction": stats.contraction}
        steps |= {name: getattr(stats, name) for name in ("steps", "rejected", "phases")}
        sizes = {
            "error of energy": stats.energy_error,
            "violation of positions": stats.position_violation,
            "of velocities": stats.velocity_violation,
        }
        return [*outcome(self.result, f"{what} at {times}"), *numbers_of(steps), *numbers_of(sizes), *self._impacts()]

    def _impacts(self) -> list[str]:
        """A line on the impacts of one motion."""
        if self.impacts is None or self.t.ndim > 1 or self.names is None or not self.impacts.t.size:
            return []
        (first, *_, last), count = (*self.impacts.t, self.impacts.t[-1]), self.impacts.t.size
        struck = [
            name
            for name, own in zip(self.names.contacts, self.impacts.impulses.T, strict=True)
            if np.any(np.asarray(own) > 0)
        ]
        when = f"at t = {first:.6g}" if count == 1 else f"from t = {first:.6g} to {last:.6g}"
        what = "Impact" if count == 1 else f"{count} impacts"
        took = f"which took energy {jnp.sum(self.impacts.energy):.6g}"
        return text_of([f"{what} of {', '.join(struck)} {when}, {took}"]).splitlines()


_MORE = "All of them, at all times: motion.to_pandas()"
