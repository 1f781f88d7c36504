"""Bands along a quasi-static path: a mechanism that is raised, stops and is lowered, or stands under changing loads.

At each state friction opposes the slips that move, with all that it has, and is any within its limits where they rest.
So a drive needs more to raise than to hold, and less to lower: hysteresis, which the bands of successive states show.
"""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jax.typing import ArrayLike

from ..._analysis._outputs import plain
from ..._closures._closure import AbstractClosure
from ..._system._axis import Axis, join
from ..._system._contact import Contact, in_sentences
from ..._system._directions import directions_of
from ..._system._export import bands_dataset
from ..._system._joint_coordinates import joint_motion
from ..._system._names import ByName
from ..._system._pushing import changing
from ..._system._state import State, states_of
from ..._system._system import AbstractSystem, check_system
from ..._system._units import with_unit
from ..._tools._json import JSON
from ..._tools._numbers import xp
from ..._tools._questions import question
from ..._tools._table import text_of, without_rounding
from .._at_rest import free_slips, is_still
from .._bounds import AbstractBounds, checked_bounds
from ._band import Bands, asked_at, bands_of, effort_of

if TYPE_CHECKING:
    import pandas
    import xarray

_LINES = 40  # of a table
_STILL = 1e-9  # rate of a coordinate that is rounding, relative to the fastest


@dataclasses.dataclass(frozen=True)
class BandPath:
    """Bands of outputs at successive states. `str()` gives a table, `to_dict()`, `to_pandas()` and
    `to_xarray()` data.

    - `t`, `q`, `qd`: time, coordinates and velocities of the states, those of joints behind them, each with an axis for
      states in front. Coordinates whose rates are no velocities, as those of bodies in space, are NaN.
    - `coordinates`, `coordinate_units`, `time_unit`: names and kinds of what moves, and units.
    - `own`: how many coordinates are the system's own, which stand first.
    - `bands`: what `band` gives at each state, with the cases and solutions that attain the ends.
    - `motion`: of each state "rests", "moves", "partly", where some joints with friction rest and others move, or
      "lifts", where nothing moves yet and a one-sided contact opens, as of what tips. A joint that does not slip at any
      state, and cannot, as constraints and drivers hold it, does not count.
    - `contacts`: of each state what one-sided contacts do, by name; empty without these.

    Of all states, besides, shape (states, outputs): `lower`, `upper`, `outer_lower`, `outer_upper` and `exact` as in
    `Bands`, NaN where there is no solution; `stands`, a word for each state.

    ??? example

        ```python
        states = [mechanism.state(phi=0.8, rate=rate) for rate in (0.1, 0.0, -0.1)]
        path = rx.band_along(mechanism, states, "A.x", rx.AmplitudeBox({"A.x": (-40.0, 40.0)}), samples=32)
        path.motion, path.stands, path.lower  # lower has shape (3, 1)
        ```
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    coordinates: Axis
    coordinate_units: tuple[str, ...]
    time_unit: str
    own: int
    bands: tuple[Bands, ...]
    motion: tuple[str, ...]
    contacts: tuple[dict[str, str], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the outputs."""
        return self.bands[0].names

    @property
    def kinds(self) -> tuple[str, ...]:
        """Of the outputs."""
        return self.bands[0].kinds

    @property
    def units(self) -> tuple[str, ...]:
        """Of the outputs."""
        return self.bands[0].units

    @property
    def lower(self) -> np.ndarray:
        """Least values, shape (states, outputs)."""
        return np.stack([bands.lower for bands in self.bands])

    @property
    def upper(self) -> np.ndarray:
        """Largest values, shape (states, outputs)."""
        return np.stack([bands.upper for bands in self.bands])

    @property
    def outer_lower(self) -> np.ndarray:
        """Proved not to be exceeded, shape (states, outputs); infinite where unknown."""
        return np.stack([bands.outer_lower for bands in self.bands])

    @property
    def outer_upper(self) -> np.ndarray:
        """Proved not to be exceeded, shape (states, outputs); infinite where unknown."""
        return np.stack([bands.outer_upper for bands in self.bands])

    @property
    def exact(self) -> np.ndarray:
        """Which bands are proved, shape (states, outputs)."""
        return np.stack([bands.exact for bands in self.bands])

    @property
    def stands(self) -> tuple[str | None, ...]:
        """Whether joints that rest may stay at rest, of each state: "yes", "no", "undecided" or None, as in `Bands`."""
        return tuple(bands.stands for bands in self.bands)

    @property
    def leading(self) -> int | None:
        """The coordinate that moves most, a linear one where there is one; None if all rest.

        It is one of a joint where the system's own have no rates.
        """
        speed = np.abs(self.qd).max(axis=0, initial=0.0)
        speed[slice(self.own) if np.isnan(self.q[:, : self.own]).any() else slice(self.own, None)] = 0.0
        linear = speed * ~self.coordinates.angular
        size = np.nanmax(np.abs(self.q), initial=0.0) or 1.0
        speed = linear if linear.max(initial=0.0) > _STILL * size * speed.max(initial=0.0) else speed
        return int(np.argmax(speed)) if speed.any() else None

    def directions(self, coordinate: int | None) -> np.ndarray:
        """Sign of the rate of a coordinate at each state, 0 where all rests, shape (states,)."""
        moves = np.array([word != "rests" for word in self.motion])
        rate = np.zeros(len(moves)) if coordinate is None else self.qd[:, coordinate]
        rate = np.where(
            np.abs(rate) > _STILL * np.nanmax(np.abs(rate)), rate, 0.0
        )  # at an instant where it turns round
        return np.where(moves, np.sign(rate), 0.0).astype(int)

    def runs(self, coordinate: int | None) -> list[tuple[str, slice]]:
        """Successive states that do the same, in words."""
        signs, words, out, first = self.directions(coordinate), self.motion, [], 0
        label = "" if coordinate is None else self.coordinates.labels[coordinate]
        for (word, sign), group in itertools.groupby(zip(words, signs.tolist(), strict=True)):
            size = len(list(group))
            way = {1: f"{label} increases", -1: f"{label} decreases", 0: "moves"}[sign]
            said = word if word in ("rests", "lifts") else way + (", partly at rest" if word == "partly" else "")
            out.append((said, slice(first, first + size)))
            first += size
        return out

    def to_pandas(self) -> "pandas.DataFrame":
        """One row for each state and output, with its unit; needs pandas, of the extra `study`."""
        return self.to_xarray().to_dataframe()

    def to_xarray(self) -> "xarray.Dataset":
        """The bands along "state" and "output", with times, kinds and units; needs xarray, of the extra `study`."""
        return bands_dataset(
            self, ("state", "output"), {"t": ("state", self.t, {"units": self.time_unit} if self.time_unit else {})}
        )

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; infinities and NaN become None."""
        figures = ("names", "units", "t", "q", "qd", "motion", "stands", "lower", "upper", "outer_lower", "outer_upper")
        return {
            **{name: plain(getattr(self, name)) for name in figures},
            "coordinates": plain(self.coordinates.labels),
            "contacts": [*self.contacts],
            "bands": [bands.to_dict() for bands in self.bands],
        }

    def __str__(self) -> str:
        lines = [f"{len(self.t)} states from t = {self.t[0]:.6g} to {self.t[-1]:.6g}", self.bands[0].title]
        lines += self._flags()
        runs = self.runs(self.leading)
        size = max(len(word) for word, _ in runs)
        shown = max(1, _LINES // (len(runs) + 1))
        for k, (name, unit) in enumerate(list(zip(self.names, self.units, strict=True))[:shown]):
            lines.append(f"{with_unit(name, unit):{size + 22}}{'least':>13}{'largest':>13}")
            lines += [self._line(k, word.ljust(size), run) for word, run in runs]
        if len(self.names) > shown:
            lines.append(f"{len(self.names) - shown} more: {', '.join(self.names[shown:])}")
        return text_of(lines)

    def _flags(self) -> list[str]:
        """What has no band, by time."""
        empty = [bands.empty for bands in self.bands]
        pull = tuple(row for bands in self.bands for row in bands.pulling)
        found = {
            "CANNOT STAND (proved)": [word == "no" for word in self.stands],
            "NO SOLUTION with joints that rest held so (give `sense`)": [word == "slips" for word in self.stands],
            "UNDECIDED whether it can stand": [word == "undecided" for word in self.stands],
            "NO SOLUTION within the bounds was found": [
                gone and word is None for gone, word in zip(empty, self.stands, strict=True)
            ],
            f"{changing(pull)}, as contacts pull,": [bool(bands.pulling) for bands in self.bands],
        }
        lines = [f"{said} at t = {_times(self.t[flags])}." for said, flags in found.items() if any(flags)]
        told = ["".join(in_sentences(contacts)) for contacts in self.contacts]
        for said, group in itertools.groupby(range(len(told)), told.__getitem__):
            lines.append(f"{said}, at {_span(self.t[list(group)])}.")
        return lines

    def _line(self, k: int, word: str, run: slice) -> str:
        """What an output is over a run."""
        ends = np.stack([self.lower, self.upper])
        t, (lower, upper) = self.t[run], without_rounding(ends, ends)[:, run, k]
        span = _span(t)
        found = ~(np.isnan(lower) & np.isnan(upper))
        if not found.any():
            return f"  {word}  {span:18}{'none':>13}"
        proved = "exact" if self.exact[run, k][found].all() else "inner"
        return f"  {word}  {span:18}{np.fmin.reduce(lower):13.6g}{np.fmax.reduce(upper):13.6g}  {proved}"


def _moving(system: AbstractSystem, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, coordinates and velocities, with those of joints."""
    joints = joint_motion(system.joint_coordinates, state, xp.zeros_like(state.qd))
    own = state.q if system.names.adds else np.full_like(state.qd, np.nan)
    q, qd = (np.concatenate(parts) for parts in ((own, joints.position), (state.qd, joints.rate)))
    return np.asarray(state.t), q, qd


def _begins(word: str, contacts: Mapping[str, str]) -> str:
    """What a state does, of which one that rests may be about to open contacts."""
    return "lifts" if word == "rests" and Contact.lifts in contacts.values() else word


def _motion(
    system: AbstractSystem, found: Sequence[Bands], slips: np.ndarray, moving: Sequence[bool]
) -> tuple[str, ...]:
    """A word for each state, given which slips its constraints leave free, and whether anything moves."""
    if not slips.size:
        return tuple("moves" if some else "rests" for some in moving)
    moves = np.stack([bands.sense != 0 for bands in found])
    directions = directions_of(system.friction)
    if directions is not None:  # a sleeve that slides and does not turn moves
        moves, slips = (np.stack([directions.any(of) for of in flags]) for flags in (moves, slips))
    counts = np.any(moves | slips, axis=0)
    return tuple(
        "rests" if not (some or of.any()) else "moves" if of[counts].all() else "partly"
        for some, of in zip(moving, moves, strict=True)
    )


def _span(t: np.ndarray) -> str:
    return f"t = {t[0]:.6g}" + (f" to {t[-1]:.6g}" if len(t) > 1 else "")


def _times(t: np.ndarray) -> str:
    shown = ", ".join(f"{time:.6g}" for time in t[:6])
    return shown if len(t) <= 6 else f"{shown} and {len(t) - 6} more"


@question
def band_along(
    system: AbstractSystem,
    states: State | Sequence[State],
    outputs: Sequence[str] | str | None,
    bounds: AbstractBounds | AbstractClosure | None = None,
    *,
    samples: int = 256,
    starts: int = 8,
    seed: int = 0,
    nodes: int = 400,
    sense: ByName | None = None,
    rank: ArrayLike | None = None,
) -> BandPath:
    """Bands of outputs along a path of loads or drive, with friction that turns around with the motion.

    Each state stands for itself, with the velocity and the loads that it has at its time. Give slow velocities on the
    way and none where it stops. A drive is best a driver with a law of time: its load is a multiplier, such as
    "motor.angle" in the plane or "motor.twist" in space, and bands at rest tell what it needs to hold the mechanism.

    ??? example

        ```python
        states = [mechanism.state(phi=0.8, rate=rate) for rate in (0.1, 0.0, -0.1)]
        path = rx.band_along(mechanism, states, "A.x", rx.AmplitudeBox({"A.x": (-40.0, 40.0)}), samples=32)
        print(path)
        rx.plot.band_along(path).savefig("hysteresis.png")
        ```

    **Arguments:**

    - `system`: concrete values.
    - `states`: successive states, or a `State` whose arrays have an axis for them in front, as `Trajectory.states`
      gives them; states with NaN are left out of that.
    - `outputs` to `rank`: as in `band`. Of one-sided contacts those hold at each state that are closed there.

    **Returns:** a `types.BandPath`. Where a state cannot stand its `stands` is "no" and its band NaN. Joints
    that rest for an instant while the machine moves have the sense in which constraints and drives make them go on.

    **Raises:** as `band`; a note tells at which state.
    """
    check_system(system)
    each, found, slips, contacts, moves = states_of(states), [], [], [], []
    bounds, effort = checked_bounds(bounds, system), effort_of(samples, starts, seed, nodes)
    for k, state in enumerate(each):
        try:
            asked = asked_at(system, state, outputs, effort, sense, rank, None)
            found.append(bands_of(asked, bounds))
            slips.append(free_slips(asked.at.system, state, asked.at.factor))
            contacts.append(asked.report.contacts)
            moves.append(not is_still(asked.at.system, state, asked.at.factor))
        except (ValueError, RuntimeError) as error:
            error.add_note(f"This is state {k} of the path, at t = {float(state.t):.6g}.")
            raise
    coordinates, units = join([system.coordinates, system.names.joint_coordinates]), system.names.units
    t, q, qd = (np.stack(parts) for parts in zip(*(_moving(system, state) for state in each), strict=True))
    return BandPath(
        t=t,
        q=q,
        qd=qd,
        coordinates=coordinates,
        coordinate_units=tuple(units.of(kind, 0) for kind in coordinates.kinds),
        time_unit=units.of("time"),
        own=len(system.coordinates),
        bands=tuple(found),
        motion=tuple(map(_begins, _motion(system, found, np.stack(slips), moves), contacts)),
        contacts=tuple(contacts) if system.names.one_sided else (),
    )
