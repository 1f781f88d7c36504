"""What is known of a mechanism at rest: whether it sticks, as text and data."""

import dataclasses

import numpy as np

from ..._analysis._outputs import plain
from ..._tools._json import JSON
from ..._tools._table import text_of


@dataclasses.dataclass(frozen=True)
class Sticking:
    """Whether a mechanism at rest sticks, over all cases within bounds. `str()` gives a page, `to_dict()` data.

    - `verdict`: "must stick": no case was found in which it slips; "may stick": it sticks in some cases and slips in
      others; "must slip": no case was found in which friction can hold it; "undecided": no case was found to be
      possible.
    - `proved`: whether the verdict is proved; otherwise it is as good as the search.
    - `margin`: least and largest margin, shape (2,): the largest part of the load's drive that friction can hold, less
      1; it sticks from 0 on, -1 is no friction against some part of the drive. Infinite where nothing drives the
      mechanism, or friction grows with its own load so that no force would make it slip.
    - `case`: the case of each: amplitude, preload, misfit or compliance, shape (2, q).
    - `acceleration`, `multipliers`, `friction`: the state of each, shapes (2, n), (2, m) and (2, p): held, without
      acceleration, or as slip begins.
    - `share`: of its limit |law|, that the friction of every joint uses there, shape (2,): at most 1 where held, 1
      where it slips. Friction that holds is not unique; this is the one in which all joints use the same share, with
      several degrees of freedom one in which no joint uses more.
    - `bounds`: what was bounded, or the closure: the name of the class.
    - `parameters`, `box`: names of the entries of a case, and their bounds, shape (q, 2).
    - `title`: all that was bounded, in words.
    - `names`, `senses`: of the slips, and the sense of each in which it sets out without friction, shape (p,).
    - `slip_verdicts`, `slip_proved`: the same of each slip, "must stick", "may stick" or "must slip", and whether that
      is proved, shape (p,): with several degrees of freedom some joints slip while others stick.
    - `slip_senses`: the senses, -1 or 1, in which each slip was found to start.
    - `can_hold`: whether any friction depends on the sense of slip; other friction, as `RegularisedCoulomb`, creeps,
      and `LuGre` bends bristles.
    - `solved`: share of the cases looked at that are decided; the others have no solution, or lie beyond limits on
      multipliers.

    ??? example

        ```python
        rest = mechanism.state(phi=0.8, rate=0.0)
        found = rx.sticking(mechanism, rest)  # at minimum norm
        found.verdict, found.margin[0], found.friction[0]  # the margin, and the friction that goes with it
        ```
    """

    verdict: str
    proved: bool
    margin: np.ndarray
    case: np.ndarray
    acceleration: np.ndarray
    multipliers: np.ndarray
    friction: np.ndarray
    share: np.ndarray
    bounds: str
    parameters: tuple[str, ...]
    box: np.ndarray
    title: str
    names: tuple[str, ...]
    senses: np.ndarray
    slip_verdicts: tuple[str, ...]
    slip_proved: np.ndarray
    slip_senses: tuple[tuple[int, ...], ...]
    can_hold: bool
    solved: float

    def to_dict(self) -> dict[str, JSON]:
        """Plain Python data; infinities become None."""
        return {field.name: plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def __str__(self) -> str:
        how = "proved" if self.proved else "as far as the search went"
        lines = [f"At rest, {self.title}", f"{self.verdict.upper()} ({how})"]
        if not self.can_hold:
            lines.append("No friction here depends on the sense of slip: it gives way, and holds nothing.")
        if self.solved < 1:
            beyond = ", or their loads are beyond the bounds" if self.bounds.startswith("Preload") else ""
            lines.append(f"UNDECIDED for {1 - self.solved:.0%} of the cases looked at{beyond}.")
        for what, k in (("least", 0), ("largest", 1)):
            if len(self.margin) and not (k and self.margin[0] == self.margin[1]):
                lines += self._end(what if self.parameters else "", k)
        return text_of([*lines, *self._joints()])

    def _joints(self) -> list[str]:
        """What is known of the slips, in words."""
        groups: dict[str, list[str]] = {}
        for name, verdict, proved, senses in zip(
            self.names, self.slip_verdicts, self.slip_proved, self.slip_senses, strict=True
        ):
            verdict = "are undecided" if verdict == "undecided" else verdict
            line = f"{verdict} ({'proved' if proved else 'as far as the search went'})"
            groups.setdefault(line, []).append(name + "".join(" +" if sense > 0 else " -" for sense in senses))
        return [f"slips that {line}: {', '.join(names)}" for line, names in groups.items()]

    def _end(self, what: str, k: int) -> list[str]:
        """One of the ends, in words."""
        case = ", ".join(f"{name} {x:.4g}" for name, x in zip(self.parameters, self.case[k], strict=True))
        holds = f"held by {self.share[k]:.0%} of the friction" if self.margin[k] >= -1e-9 else "slips"
        line = f"{what} margin {self.margin[k]:.4g}".strip() + (f" at {case}" if case else "") + f": {holds}"
        tau = zip(self.names, self.friction[k], strict=True)
        return [line, *(f"    tau {name} {x:.6g}" for name, x in tau)]
