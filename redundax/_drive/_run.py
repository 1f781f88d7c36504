"""What `drive` returns: how a machine moves along the laws of its drives, and what they must give."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._system._contact import words
from .._system._export import frame_of
from .._system._joint_coordinates import JointMotion, joint_motion, joint_reactions
from .._system._named import AbstractNamed
from .._system._names import Named, index_of
from .._system._pages import notes, outcome
from .._system._pushing import in_words, pulling
from .._system._results import RESULTS
from .._system._state import State
from .._system._system import AbstractSystem
from .._system._units import with_unit
from .._tools._errors import RedundaxError
from .._tools._module import is_concrete, names_in, on_device
from .._tools._no_answer import nan_where
from .._tools._numbers import computed, xp
from .._tools._table import are_known, figures, group, page, text_of
from .._tools._value import AbstractModule
from ._laws import FEWEST, Sampled

if TYPE_CHECKING:
    import pandas


class Drive(NamedTuple):
    """A drive: its name, the row of its multiplier, and whether it turns."""

    name: str
    row: int
    turns: bool

    @property
    def word(self) -> str:
        """What it gives."""
        return "torque" if self.turns else "force"


class Moment(AbstractModule):
    """Loads on one side of each time.

    - `multipliers`, `friction`: lam, shape (times, m), and tau, (times, p).
    """

    multipliers: Float[Array, "times m"]
    friction: Float[Array, "times p"]


class Run(AbstractNamed):
    """A machine along the laws of its drives, at all times, also by name.

    Of a drive on "motor.angle" `run["motor.angle torque"]` is what it gives, N m, positive along the coordinate: on
    body i of the joint, and the opposite on body j; `run["guide.travel force"]` is that of a linear one, N. Likewise
    `power`, and `energy` since the first time. Drivers among the joints are drives by their own names. All else has the
    names that it has in a `Solution` and a motion: `run["A force x on crank"]`, `run["K.travel"]`, `run["tau A"]`.

    Where a joint with friction rests its friction is not determined. Loads are then those with which the motion goes
    on; `run.before` has those with which it came to rest, and `run["motor.angle torque before"]` names them. They
    differ nowhere else.

    - `t`, `q`, `qd`, `acceleration`: as in a motion.
    - `multipliers`, `friction`: as in a `Solution`, of the closure.
    - `before`: the same on the other side of an instant of rest.
    - `result`: how the solution of each time ended; its loads are NaN unless it is `RESULTS.successful`. Then `peak`
      and `rms` are those of the other times, and `energy` that up to the last of them, NaN if one before has none, as a
      print says; inside of transformations they are NaN.
    - `rates`: of the drives, shape (times, drives).
    - `determined`: which forces of drives the rigid machine determines, friction included, shape (times, drives);
      `determined_without_friction` too. The closure decides the others.
    - `stays`: the least and the largest force of each drive with which the machine stays at rest, shape (times, drives,
      2), NaN where it moves and of joints with play. Beyond them it breaks away, the one way and the other.
    - `remarks`: what else is to be said, which a print shows.
    - `weakest`: the least singular value of the scaled constraints over their size: 0 at a singular position.
    - `drives`: their names, rows and kinds.
    - `system`: the machine with its drives, for `rx.band_along(run.system, run.states, ...)` and other questions; None
      inside of transformations.
    - `contact`: what one-sided contacts do, as the numbers of `contacts`, shape (times, contacts), -1 where there is no
      answer; None where there are none.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        run = rx.drive(smooth, {"A.angle": rx.Polynomial([0.8, 1.0])}, jnp.linspace(0.0, 1.0, 11), state.q)
        print(run)
        run["A.angle torque"], run.peak["A.angle"], run.rms["A.angle"]
        ```
    """

    t: Float[Array, " times"]
    q: Float[Array, "times ..."]
    qd: Float[Array, "times n"]
    acceleration: Float[Array, "times n"]
    multipliers: Float[Array, "times m"]
    friction: Float[Array, "times p"]
    before: Moment
    result: RESULTS
    rates: Float[Array, "times drives"]
    determined: Bool[Array, "times drives"]
    determined_without_friction: Bool[Array, "times drives"]
    stays: Float[Array, "times drives 2"]
    weakest: Float[Array, " times"]
    drives: tuple[Drive, ...] = eqx.field(static=True)
    remarks: tuple[str, ...] = eqx.field(static=True, default=())
    system: AbstractSystem | None = eqx.field(default=None, repr=False)
    contact: Int[Array, "times c"] | None = None

    @property
    def contacts(self) -> dict[str, str | np.ndarray]:
        """What one-sided contacts do at the times, by name: arrays of "carries", "touches" and "open", "" where there
        is no answer."""
        return words(self.contact, None if self.system is None else self.system.names)

    @property
    def states(self) -> State:
        """The states at all times, each array with an axis for them in front."""
        return State(self.q, self.qd, self.t)

    @property
    def centres(self) -> Float[Array, "..."]:
        """Positions of the centres of mass in space, shape (times, 3 bodies)."""
        return self.q[..., : 0 if self.names is None else len(self.names.centres)]

    @property
    def joints(self) -> JointMotion:
        """How joint coordinates move, shape (times, c) each; angles go on from turn to turn."""
        return joint_motion(self.joint_coordinates, self.states, self.acceleration, times=True)

    def laws(self, names: Sequence[str]) -> dict[str, Sampled]:
        """Laws by which joint coordinates move in this run, for drives of their own at the same times: of machines with
        more drives than freedoms, or whose tool the laws of this run move.

        ??? example

            ```python
            moved = rx.drive(smooth, {"A.angle": rx.Polynomial([0.8, 1.0])}, jnp.linspace(0.0, 1.0, 11), state.q)
            rx.drive(smooth, moved.laws(["B.angle"]), moved.t, state.q)["B.angle torque"]
            ```
        """
        known, found = [each.name[:-2] for each in self.entries if each.name.endswith("''")], names_in("names", names)
        for name in found:
            index_of("names", name, known, " of coordinates")
        lost = is_concrete(self.acceleration) and np.isnan(np.asarray(self.acceleration)).any(axis=1)
        if np.any(lost) or self.t.size < FEWEST:
            at = f"has no answer at t = {self.t[np.argmax(lost)]:.6g} s" if np.any(lost) else f"has {self.t.size}"
            raise RedundaxError(
                "Argument `ts` of a run from which laws are taken must hold three times or more that all have an "
                f"answer, but this one {at}. Give `drive` such times."
            )
        return {k: Sampled(self.t, self[k], rates=self[f"{k}'"], accelerations=self[f"{k}''"]) for k in found}

    @property
    def reactions(self) -> Float[Array, "..."]:
        """What each joint does to its body, as of a `Solution`, shape (times, 3 joints), in space 6."""
        return joint_reactions(self.joint_coordinates, self.states, self.multipliers, times=True)

    @property
    def pulling(self) -> tuple[str, ...]:
        """Names of the rows of contacts that pull at any time, as of a `Solution`."""
        return pulling(self.names, self.multipliers)

    @property
    @computed
    def forces(self) -> Float[Array, "times drives"]:
        """What the drives give, N or N m."""
        return self._of(self.multipliers)

    @property
    @computed
    def forces_before(self) -> Float[Array, "times drives"]:
        """The same on the other side of an instant of rest."""
        return self._of(self.before.multipliers)

    @property
    @computed
    def powers(self) -> Float[Array, "times drives"]:
        """Force by rate, W, positive where the drive gives energy."""
        return self.forces * self.rates

    @property
    @computed
    def energies(self) -> Float[Array, "times drives"]:
        """What each drive has given since the first time, J, by the trapezoidal rule between the times."""
        power = _after_and_before(self.powers, self.forces_before * self.rates)
        none = xp.zeros((1, len(self.drives)), power.dtype)
        return xp.concatenate([none, xp.cumsum(power * xp.diff(self.t)[:, None], axis=0)])

    @property
    def peak(self) -> dict[str, Array]:
        """The largest size of each drive's force, by name, at the times and on both sides of instants of rest;
        `rx.with_peaks` looks between them too."""
        return self._peak(self._skips)

    @property
    @computed
    def peak_time(self) -> dict[str, Array]:
        """When each is largest."""
        return self._by_name(self.t[self.largest])

    @property
    @computed
    def largest(self) -> Int[Array, " drives"]:
        """At which of the times that is."""
        return xp.argmax(xp.where(xp.isnan(self._sizes), -1.0, self._sizes), axis=0)

    @property
    def rms(self) -> dict[str, Array]:
        """The root of the mean square of each drive's force over the time, by the trapezoidal rule; of a rest that of
        both of its sides."""
        return self._rms(self._skips)

    @property
    @computed
    def power(self) -> dict[str, Array]:
        """The power of each drive over time, by name."""
        return self._by_name(self.powers.T)

    @property
    def energy(self) -> dict[str, Array]:
        """What each drive has given in all, by name."""
        return self._energy(self._last)

    @computed
    def _peak(self, skips: bool) -> dict[str, Array]:
        """NaN where a time has none, or all of them if the others are to be skipped."""
        missing = xp.isnan(self._sizes)
        none = xp.all(missing, axis=0) if skips else xp.any(missing, axis=0)
        return self._by_name(nan_where(none, xp.max(xp.where(missing, -1.0, self._sizes), axis=0)))

    @computed
    def _rms(self, skips: bool) -> dict[str, Array]:
        """Over all of the time, or over what of it lies between two times that have an answer."""
        square, spans = _after_and_before(self.forces**2, self.forces_before**2), xp.diff(self.t)[:, None]
        missing = xp.isnan(square) & skips
        over = xp.sum(xp.where(missing, 0.0, spans), axis=0)
        mean = xp.sum(xp.where(missing, 0.0, square * spans), axis=0) / xp.where(over > 0, over, xp.nan)
        return self._by_name(xp.sqrt(mean))

    @computed
    def _energy(self, last: int) -> dict[str, Array]:
        return self._by_name(self.energies[last])

    @property
    def _skips(self) -> bool:
        """Whether figures are of the times that have an answer: inside of transformations nobody could see that."""
        return are_known(self.multipliers)

    @property
    def _last(self) -> int:
        """The last of the times that have an answer."""
        answered = np.flatnonzero(self._answered) if self._skips else np.zeros(0, int)
        return int(answered[-1]) if answered.size else -1

    @property
    def _answered(self) -> np.ndarray:
        return np.all(~np.isnan(np.asarray(self._sizes)), axis=1)

    @property
    @computed
    def _sizes(self) -> Array:
        return xp.maximum(xp.abs(self.forces), xp.abs(self.forces_before))

    def _of_part(self) -> str:
        """What is to be said of figures where some times have no answer."""
        answered, last = self._answered, self._last
        if answered.all() or not answered.any():
            return ""
        if answered[: last + 1].all():
            return f"Figures are those of the motion up to t = {np.asarray(self.t)[last]:.6g} alone."
        return f"Figures are those of the {answered.sum()} times that have an answer alone."

    def _of(self, multipliers: Array) -> Array:
        return -multipliers[..., np.array([drive.row for drive in self.drives], int)]

    def _by_name(self, values: Array) -> dict[str, Array]:
        return Named(zip((drive.name for drive in self.drives), values, strict=True))

    @property
    def _own(self) -> dict[str, tuple[str, int]]:
        """Arrays and columns of what drives have, by name."""
        found = {}
        for k, drive in enumerate(self.drives):
            found[f"{drive.name} {drive.word}"] = "forces", k
            found[f"{drive.name} {drive.word} before"] = "forces_before", k
            found[f"{drive.name} power"] = "powers", k
            found[f"{drive.name} energy"] = "energies", k
        return found

    def __getitem__(self, name: str) -> Float[Array, "..."]:
        own = self._own
        if name in own:
            array, k = own[name]
            values = getattr(self, array)
            return on_device(np.asarray(values)[..., k]) if is_concrete(values) else values[..., k]
        known = [entry.name for entry in self.entries]
        if self.names is not None and name not in known and self.names.other_end(name) is None:
            index_of("name", name, [*own, *known])
        return AbstractNamed.__getitem__(self, name)

    def to_pandas(self) -> "pandas.DataFrame":
        """All entries and what drives give as columns by name, one row for each time."""
        frame = frame_of(self)
        for place, name in enumerate(self._own):
            frame.insert(place, name, np.asarray(self[name]))
        return frame

    def __str__(self) -> str:
        """What each drive gives, and what is to be known of it; shapes inside of transformations."""
        if self.names is None or not are_known((self.t, self.q, self.multipliers)):
            return repr(self)
        units, t = self.names.units, np.asarray(self.t)
        time = f"{t.size} times from t = {t[0]:.6g} to {t[-1]:.6g} {units.of('time')}".strip()
        groups = []
        for turns in (True, False):
            some = [k for k, drive in enumerate(self.drives) if drive.turns is turns]
            if not some:
                continue
            word, unit = ("torque", units.of("moment")) if turns else ("force", units.of("force"))
            drives = [self.drives[k] for k in some]
            head = (with_unit(word, unit), "peak", "at t", "rms", "mean power", "energy", "determined")
            span = (t[self._last] - t[0]) or 1.0
            energy = np.array([float(self.energy[drive.name]) for drive in drives])
            columns = [
                figures(np.array([float(figure[drive.name]) for drive in drives]), digits=5)
                for figure in (self.peak, self.peak_time, self.rms)
            ]
            most = np.nanmax(np.abs(np.asarray(self.powers)), initial=0.0)[None]  # beside which rounding is none
            columns += [figures(energy / span, most, 5), figures(energy, most * span, 5)]
            groups.append(group(head, [d.name for d in drives], *columns, [self._verdict(k) for k in some]))
        said = [*self.remarks, self._of_part(), in_words(self.pulling)]
        head = [*outcome(self.result, f"Drives at {time}"), *notes(self.names, " ".join(filter(None, said)))]
        return text_of([*head, *page(groups, [], "")])

    def _verdict(self, k: int) -> str:
        """What is told of a drive's force over all times."""
        with_friction, without = (np.asarray(x)[:, k] for x in (self.determined, self.determined_without_friction))
        if with_friction.all():
            return "yes"
        if without.all():
            return "but for friction" if not with_friction.any() else "but for friction at some times"
        return "no: the closure decides" if not without.any() else "not at all times: the closure decides"


def _after_and_before(after: Array, before: Array) -> Array:
    """The mean over each span of time."""
    return (after[:-1] + before[1:]) / 2
