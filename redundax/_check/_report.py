"""What the referee says: a stamp on each load of a log, in two sentences, a table and data."""

import dataclasses
import textwrap
from typing import TYPE_CHECKING

import numpy as np

from .._analysis._outputs import plain
from .._tools._json import JSON
from .._tools._optional import optional
from .._tools._table import WIDTH, text_of

if TYPE_CHECKING:
    import pandas

_LISTED = 60  # lines of a table
RIGHT, WRONG, OPEN = "determined, right", "determined, wrong", "not determined"
UNBALANCED = "not determined, wrong"


@dataclasses.dataclass(frozen=True, eq=False)
class LogReport:
    """The loads of a log against what the machine determines, over time; shapes are (times, figures).

    - `names`: of the loads, as the log has them; `t`: times, s; `logged`: the numbers of the log, N or N m.
    - `expected`: what the machine determines, with the self-stress of the log, `stress`, where it does not.
    - `determined`: which loads no self-stress reaches.
    - `tolerance`: what counts as right.
    - `judged`: which times are judged, shape (times,): not singular positions, where the rank is lower.
    - `redundancy`: by how many constraints and drives are more than independent.
    - `axes`: of the components, "global", "body" or "joint"; `on_other`: whether loads without a body are those on the
      other body of each joint.
    - `drives`: coordinates whose accelerations were taken from the log.
    - `apart`: how far coordinates of the log are from those of the machine, rad or m.
    - `splined`: coordinates whose rates or accelerations are derivatives of splines.
    - `unused`: columns that are not known.
    - `units`: of the loads, "" where the machine states none.
    - `closed`: the loads by the closure, or None.
    - `bands`: of loads that are not determined, by name, the least and the largest that bounds allow, at `band_time`.

    ??? example

        ```python
        bar = rx.mechanisms.parallelogram()
        ts = jnp.linspace(0.0, 1.0, 21)
        run = rx.drive(bar, {"A1.angle": rx.Polynomial([0.8, 1.0])}, ts, bar.state(0.8).q)
        names = ["A1.angle", "A1.angle'", "A1.angle''", "A1 force x on crank 1"]
        rx.check(bar, {"t": ts, **{name: run[name] for name in names}}, q=run.q[0]).stamps
        ```
    """

    names: tuple[str, ...]
    t: np.ndarray
    logged: np.ndarray
    expected: np.ndarray
    stress: np.ndarray
    determined: np.ndarray
    tolerance: np.ndarray
    judged: np.ndarray
    redundancy: int
    axes: str
    on_other: bool
    drives: tuple[str, ...]
    apart: float
    splined: tuple[str, ...]
    unused: tuple[str, ...]
    units: tuple[str, ...]
    closed: np.ndarray | None = None
    bands: dict[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    band_time: float = float("nan")

    @property
    def errors(self) -> np.ndarray:
        """How far the log is from what is possible, NaN at times that are not judged."""
        return np.where(self.judged[:, None], self.logged - self.expected, np.nan)

    @property
    def worst(self) -> np.ndarray:
        """The largest error of each load, shape (figures,)."""
        return np.nanmax(np.abs(self.errors), axis=0)

    @property
    def excess(self) -> np.ndarray:
        """The largest error of each load beside its tolerance, shape (figures,)."""
        return np.nanmax(np.abs(self.errors) / self.tolerance, axis=0)

    @property
    def stamps(self) -> dict[str, str]:
        """Of each load whether it is "determined, right", "determined, wrong", or "not determined"; of the last also
        "not determined, wrong" where no self-stress gives it together with the others."""
        known, wrong = self.determined[self.judged].all(axis=0), self.excess > 1
        words = np.where(known, np.where(wrong, WRONG, RIGHT), np.where(wrong, UNBALANCED, OPEN))
        return dict(zip(self.names, words.tolist(), strict=True))

    @property
    def is_right(self) -> bool:
        """Whether no load is wrong."""
        return not np.any(self.excess > 1)

    @property
    def summary(self) -> str:
        """Two sentences: what is determined and right, and what is not determined."""
        stamps = list(self.stamps.values())
        known = [k for k, stamp in enumerate(stamps) if stamp in (RIGHT, WRONG)]
        wrong = [k for k in known if stamps[k] == WRONG]
        loose = [k for k in range(len(stamps)) if k not in known]
        if not known:
            first = "None of the loads is determined by the machine."
        elif not wrong:
            first = f"{_all(known, stamps)} determined by the machine, and right{self._digits(known)}."
        else:
            k = max(wrong, key=lambda k: self.excess[k])
            more = f" and {len(wrong) - 1} more" if len(wrong) > 1 else ""
            at, by, share = self._at(k)
            first = (
                f"WRONG: of {len(known)} loads that the machine determines "
                f"{len(wrong)} {'is' if len(wrong) == 1 else 'are'} wrong, "
                f"'{self.names[k]}' by {by:.4g}{share} at t = {at:.4g}{more}."
            )
        if not loose:
            return f"{first} The machine leaves none of them open."
        bad = [k for k in loose if stamps[k] == UNBALANCED]
        if bad:
            k = max(bad, key=lambda k: self.excess[k])
            at, by, _ = self._at(k)
            return (
                f"{first} WRONG: {len(loose)} loads are not determined, but no self-stress gives {len(bad)} of them "
                f"together with the others: bodies are out of balance, '{self.names[k]}' by {by:.4g} at t = {at:.4g}."
            )
        k = max(loose, key=lambda k: np.abs(self.stress[self.judged, k]).max())
        most = float(np.abs(self.stress[self.judged, k]).max())
        own = f"with a self-stress of up to {most:.4g} in '{self.names[k]}'"
        if most <= np.median(self.tolerance[:, k]):
            own = "that without self-stress"
        return (
            f"{first} {_all(loose, stamps)} not determined: stiffness and fits of the parts decide them, and the log "
            f"has one of many, {own}."
        )

    def _digits(self, known: list[int]) -> str:
        largest = np.abs(self.expected[self.judged][:, known]).max(initial=0.0)
        some = largest > np.median(self.tolerance[:, known])
        return f", to {self.worst[known].max() / largest:.1g} of the largest" if some else ""

    def _at(self, k: int) -> tuple[float, float, str]:
        """When a load is worst, by how much, and what share of the load that is."""
        errors = np.abs(self.errors[:, k])
        place = int(np.nanargmax(errors))
        size = abs(float(self.expected[place, k]))
        share = f" ({errors[place] / size:.2g} of it)" if size > self.tolerance[place, k] else ""
        return float(self.t[place]), float(errors[place]), share

    @property
    def remarks(self) -> list[str]:
        """What else is to be known, a line each."""
        said = []
        if self.axes != "global" or self.on_other:
            other = ", on the other body of each joint" if self.on_other else ""
            said.append(f"Components are in {self.axes} axes{other}.")
        if self.drives:
            said.append(f"Driven as the log moves: {', '.join(self.drives)}.")
        if self.splined:
            said.append(
                f"Rates or accelerations of {', '.join(self.splined)} are derivatives of splines, so loads are as good "
                "as its times are dense: columns with ' and '' are better."
            )
        if self.apart > 1e-6:
            said.append(f"Positions of the log were moved by up to {self.apart:.2g} (m or rad) to close the loops.")
        if not self.judged.all():
            times = ", ".join(f"{t:.4g}" for t in self.t[~self.judged][:4])
            said.append(
                f"{(~self.judged).sum()} of {self.t.size} times are not judged, as positions are singular: t = {times}."
            )
        if self.unused:
            more = ", ..." if len(self.unused) > 6 else ""
            said.append(f"Columns not used: {', '.join(self.unused[:6])}{more}.")
        if self.bands:
            said.append(f"Least and largest within the bounds are those at t = {self.band_time:.4g}.")
        return said

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data."""
        stamps, worst = self.stamps, self.worst
        figures = {
            name: {
                "stamp": stamps[name],
                "largest": float(np.abs(self.logged[:, k]).max()),
                "worst_error": float(worst[k]),
                "tolerance": float(np.median(self.tolerance[:, k])),
                "largest_self_stress": float(np.abs(self.stress[self.judged, k]).max()),
                **({"band": plain(np.array(self.bands[name]))} if name in self.bands else {}),
            }
            for k, name in enumerate(self.names)
        }
        return {
            "right": self.is_right,
            "summary": self.summary,
            "redundancy": self.redundancy,
            "times": self.t.size,
            "times_judged": int(self.judged.sum()),
            "axes": self.axes,
            "on_other_body": self.on_other,
            "drives": list(self.drives),
            "moved": self.apart,
            "unused": list(self.unused),
            "figures": figures,
        }

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each load and time: logged, expected, stress, determined; needs pandas, of the extra `study`."""
        frame = optional("pandas", "study")
        count = len(self.names)
        return frame.DataFrame(
            {
                "t": np.repeat(self.t, count),
                "load": np.tile(self.names, self.t.size),
                "logged": self.logged.ravel(),
                "expected": self.expected.ravel(),
                "stress": self.stress.ravel(),
                "determined": self.determined.ravel(),
            }
        )

    def __str__(self) -> str:
        lines = [*textwrap.wrap(self.summary, WIDTH), "", *self._table(), *([""] * bool(self.remarks)), *self.remarks]
        return text_of(lines)

    def _table(self) -> list[str]:
        order = {WRONG: 0, UNBALANCED: 1, RIGHT: 2, OPEN: 3}
        stamps, worst = list(self.stamps.values()), self.worst
        rows = sorted(range(len(stamps)), key=lambda k: order[stamps[k]])
        head = ["load", "largest", "off by", "self-stress", "stamp"]
        head[4:4] = ["closure"] if self.closed is not None else []
        head[-1:-1] = ["least", "largest"] if self.bands else []
        lines = [head]
        for k in rows[:_LISTED]:
            cells = [self.names[k], f"{np.abs(self.logged[:, k]).max():.5g}", f"{worst[k]:.2g}"]
            loose = stamps[k] in (OPEN, UNBALANCED)
            cells.append(f"{np.abs(self.stress[self.judged, k]).max():.4g}" if loose else "")
            if self.closed is not None:
                cells.append(f"{np.nanmax(np.abs(self.closed[:, k]), initial=0.0):.5g}" if loose else "")
            if self.bands:
                cells += [f"{x:.4g}" for x in self.bands[self.names[k]]] if self.names[k] in self.bands else ["", ""]
            lines.append([*cells, stamps[k]])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        sides = ["<", *[">"] * (len(head) - 2), "<"]
        out = [
            "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(line, sides, widths, strict=True)).rstrip()
            for line in lines
        ]
        return out + ([f"... {len(rows) - _LISTED} more"] if len(rows) > _LISTED else [])


def _all(some: list[int], of: list[str]) -> str:
    if len(some) == 1:
        return "The load is" if len(of) == 1 else f"1 of {len(of)} loads is"
    return f"All {len(of)} loads are" if len(some) == len(of) else f"{len(some)} of {len(of)} loads are"
