"""Linear programmes that hold all that is possible over cones of loads, or only what is possible beside some loads."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._programme import KEPT, NOTHING, TOLERANCE, Optimum, Programme, Rays, Row

_ROUNDS = 40  # of cuts, and of steps to a better inner bound


class Relaxation:
    """The programmes of one set.

    - `sides`: upper and lower limits, (f, 2), that hold whatever the loads.
    - `cuts`: inequalities that hold for all that is possible.
    """

    def __init__(self, programme: Programme):
        self.programme = programme
        self.sides = np.full((len(programme.reads), 2), np.inf)
        self.cuts: list[Row] = []
        self._known: dict[tuple[int, bytes], np.ndarray] = {}

    def outer(self, cost: np.ndarray, cones: Sequence[Rays]) -> Optimum:
        """The largest that the limits over cones allow."""
        rows = [row for j, rays in enumerate(cones) for row in self._over_cone(j, rays)]
        return self._solve(cost, rows)

    def inner(self, cost: np.ndarray, x: np.ndarray) -> tuple[Optimum, int]:
        """A local extreme of what is possible, from loads beside it, and the number of programmes."""
        best, count = NOTHING, 0
        while count < _ROUNDS:
            count += 1
            tangents = self._tangents(x)
            self.cuts += [Row(-row.left, -row.right) for row, full in tangents if full]
            found = self._convex(cost, [row for row, _ in tangents])
            if found.x is None:
                break
            x = found.x
            good = bool(np.all(self.excess(x) <= KEPT)) and not self.violated(x)
            settled = best.x is not None and found.value <= best.value + TOLERANCE * max(1.0, abs(best.value))
            if good and found.value > best.value:
                best = found
            if good and settled:
                break
        return best, count

    def _convex(self, cost: np.ndarray, rows: list[Row]) -> Optimum:
        """The largest c^T x under the rows, and cuts until what is convex is kept."""
        found = self._solve(cost, rows)
        for _ in range(_ROUNDS):
            cuts = [] if found.x is None else self.violated(found.x)
            if not cuts:
                break
            self.cuts += cuts
            found = self._solve(cost, rows)
        return found

    def _solve(self, cost: np.ndarray, rows: list[Row]) -> Optimum:
        from scipy.optimize import linprog  # here, because its import takes a second

        own, rows = self.programme, [*rows, *self.cuts]
        left = np.array([*own.within[0], *(row.left for row in rows)]).reshape(-1, len(cost))
        right = np.array([*own.within[1], *(row.right for row in rows)])
        size = np.abs(left).max(axis=1, initial=0.0)
        size = np.where(size > 0, size, 1.0)

        def solve(cost: np.ndarray, presolve: bool) -> Any:
            options = {"primal_feasibility_tolerance": TOLERANCE, "dual_feasibility_tolerance": TOLERANCE}
            return linprog(
                -cost,
                left / size[:, None],
                right / size,
                *own.equal,
                own.box,
                options={**options, "presolve": presolve},
            )

        for presolve in (True, False):  # a presolve takes rounding for a contradiction
            found = solve(cost, presolve)
            if found.status == 0:
                return Optimum(-found.fun, found.x)
            if found.status == 2 and not presolve:
                return NOTHING
            if found.status == 3:
                return Optimum(np.inf, solve(np.zeros_like(cost), presolve).x)
        return Optimum(np.inf, None)

    def violated(self, x: np.ndarray) -> list[Row]:
        """Cuts that x does not keep: of the ellipsoid, and of slips that have all of their friction."""
        matrix, offset = self.programme.norm
        cuts, at = [], matrix @ x + offset
        length = np.linalg.norm(at)
        if length > 1 + KEPT:
            cuts.append(Row(at @ matrix / length, float(1 - at @ offset / length)))
        cuts += [
            Row(-row.left, -row.right) for row, full in self._tangents(x) if full and row.right - row.left @ x > KEPT
        ]
        return cuts

    def _tangents(self, x: np.ndarray) -> list[tuple[Row, bool]]:
        """Of all limits at the loads of x, upper then lower; and whether the friction is that limit."""
        own = self.programme
        (T, t), (R, r) = own.bounded, own.read
        loads = R @ x + r
        down, up, by_down, by_up = own.limits(loads)
        out = []
        for sign, limit, slope in ((1.0, up, by_up), (-1.0, down, by_down)):
            left, right = sign * T - slope @ R, limit - slope @ (loads - r) - sign * t
            rows = zip(left, right, own.full, limit, strict=True)
            out += [(Row(a, float(b)), bool(full == sign)) for a, b, full, most in rows if most < np.inf]
        return out

    def excess(self, x: np.ndarray) -> np.ndarray:
        """By how much limits are exceeded, and full friction is missed."""
        both = self._shortage(x).reshape(2, -1)
        full = self.programme.full
        missed = np.where(full == 1, both[0], np.where(full == -1, both[1], -np.inf))
        return np.maximum(np.max(-both, axis=0), missed)

    def _shortage(self, x: np.ndarray) -> np.ndarray:
        """What is left to the upper limits, then to the lower ones."""
        own = self.programme
        down, up = own.limits(own.read(x))[:2]
        t = own.bounded(x)
        return np.concatenate([up - t, down + t])

    def _over_cone(self, j: int, rays: Rays) -> list[Row]:
        """The limits of one friction over a cone of its loads, and the cone."""
        own = self.programme
        (T, t), (R, r), reads = own.bounded, own.read, own.reads[j]
        if rays is None or not reads.size:
            return [
                Row(s * T[j], side - s * t[j]) for s, side in zip((1, -1), self.sides[j], strict=True) if side < np.inf
            ]
        weights = np.linalg.inv(rays)
        shares, given = weights @ R[reads], weights @ r[reads]
        out = [Row(-share, more) for share, more in zip(shares, given, strict=True)]
        for sign, limit in zip((1, -1), self._limits_along(j, rays), strict=True):
            if limit[0] < np.inf:
                out.append(Row(sign * T[j] - limit[1:] @ shares, limit[0] + limit[1:] @ given - sign * t[j]))
        return out

    def _limits_along(self, j: int, rays: np.ndarray) -> np.ndarray:
        """The upper and the lower limit without load, and by how much each ray raises them: (2, 1 + rays)."""
        none = self.limits_at(j, np.zeros(len(rays)))
        raised = [self.limits_at(j, ray) - np.where(np.isinf(none), 0.0, none) for ray in rays.T]
        return np.stack([none, *raised], axis=1)

    def limits_at(self, j: int, loads: np.ndarray) -> np.ndarray:
        """The upper and the lower limit of one friction."""
        key = j, loads.tobytes()
        if key not in self._known:
            point = np.zeros(len(self.programme.read.offset))
            point[self.programme.reads[j]] = loads
            down, up = self.programme.limits(point)[:2]
            self._known[key] = np.array([up[j], down[j]])
        return self._known[key]
