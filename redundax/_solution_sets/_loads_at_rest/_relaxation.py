"""Linear programmes that hold all that is possible over cones of loads, or only what is possible beside some loads."""

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ._programme import KEPT, NOTHING, TOLERANCE, Optimum, Programme, Rays, Row

if TYPE_CHECKING:
    import scipy.optimize

_PART = 0.3  # of what splits keep out, which is worth a plane
_ROUNDING = 1e-10  # of loads that depend on each other, relative to the largest
_ROUNDS = 40  # of cuts, and of steps to a better inner bound


class Relaxation:
    """The programmes of one set.

    - `own`: the loads that each limit depends on, as far as they are independent; `bases`: these in those.
    - `sides`: upper and lower limits, (f, 2), that hold whatever the loads.
    - `cuts`: inequalities that hold for all that is possible.
    - `planes`: directions in which programmes keep within a ball.
    - `kept`: by how much limits may be exceeded, at least by what programmes leave.
    """

    def __init__(self, programme: Programme):
        self.programme = programme
        self.bases = _independent_loads(programme)
        self.own = [
            programme.read.rows(reads).times(basis.T) for reads, basis in zip(programme.reads, self.bases, strict=True)
        ]
        self.sides = np.full((len(programme.reads), 2), np.inf)
        self.cuts: list[Row] = []
        self.planes: list[list[np.ndarray]] = [[] for _ in programme.balls]
        self._known: dict[tuple[int, bytes], np.ndarray] = {}
        self.kept = _kept(programme)

    def narrowed(self, box: np.ndarray) -> "Relaxation":
        """The same in a narrower box."""
        part = copy.copy(self)
        part.programme, part.cuts, part.planes = self.programme._replace(box=box), [], [[] for _ in self.planes]
        return part

    def outer(self, cost: np.ndarray, cones: Sequence[Rays]) -> Optimum:
        """The largest that the limits over cones allow."""
        rows = [row for j, rays in enumerate(cones) for row in self._over_cone(j, rays)]
        return self._solve(cost, rows + self._touching(self._radii_over(cones)))

    def leaves(self, found: Optimum, cones: Sequence[Rays]) -> bool:
        """Whether it is outside a ball whose radius is the largest over cones, or what is convex; rows keep it in then.

        Of a ball less than a part of what smaller cones would keep out does not count.
        """
        return self._leaves(found, self._radii_over(cones), _PART)

    def _leaves(self, found: Optimum, radii: list[Row], part: float = 0.0) -> bool:
        """The same of balls with given radii: where it is, and along its ray."""
        leaves = False
        for x, far in ((found.x, False), (found.ray, True)):
            if x is not None:
                cuts = self.violated(x, far)
                out = self._kept_out(x, radii, part * np.max(self.excess(x, far), initial=0.0) if part else 0.0, far)
                self.cuts += cuts
                leaves = leaves or out or bool(cuts)
        return leaves

    def inner(self, cost: np.ndarray, x: np.ndarray) -> tuple[Optimum, int]:
        """A local extreme of what is possible, from loads beside it, and the number of programmes."""
        best, count = NOTHING, 0
        while count < _ROUNDS:
            count += 1
            tangents = self._tangents(x)
            self.cuts += [Row(-row.left, -row.right) for row, full in tangents if full]
            found = self._convex(cost, [row for row, _ in tangents], self._radii_beside(x))
            if found.x is None:
                break
            x = found.x
            good = bool(np.all(self.excess(x) <= self.kept)) and not self.violated(x)
            settled = best.x is not None and found.value <= best.value + TOLERANCE * max(1.0, abs(best.value))
            if good and found.value > best.value:
                best = found
            if good and settled:
                break
        return best, count

    def _convex(self, cost: np.ndarray, rows: list[Row], radii: list[Row]) -> Optimum:
        """The largest c^T x under the rows and within balls of these radii, with cuts until what is convex is kept."""
        found = self._solve(cost, rows + self._touching(radii))
        for _ in range(_ROUNDS):
            if not self._leaves(found, radii):
                break
            if np.isfinite(found.value) and any(self.planes):
                inside = self._inside(cost, found.value, rows, radii)
                if inside.x is not None and not self._leaves(inside, radii):
                    return inside
            found = self._solve(cost, rows + self._touching(radii))
        return found

    def _inside(self, cost: np.ndarray, value: float, rows: list[Row], radii: list[Row]) -> Optimum:
        """What is as good and farthest within all balls, up to half of their radii, and then within each.

        Where friction is not unique the first programme ends at a corner of planes, outside of balls, for hundreds of
        rounds.
        """
        n, balls = len(cost), [k for k, planes in enumerate(self.planes) if planes and radii[k].right < np.inf]
        count, all_rows = len(balls), [*rows, Row(-cost, -value)]
        for k, margin in zip(balls, np.eye(count), strict=True):
            half = Row(np.concatenate([radii[k].left / 2, [0.0], margin]), radii[k].right / 2)
            least = Row(np.concatenate([np.zeros(n), [1.0], -margin]), 0.0)
            sides = [Row(np.concatenate([row.left, [0.0], margin]), row.right) for row in self._planes_of(k, radii[k])]
            all_rows += [half, least, *sides]
        found = self._solve(np.concatenate([np.zeros(n), [float(count)], np.ones(count)]), all_rows)
        return NOTHING if found.x is None else Optimum(float(cost @ found.x[:n]), found.x[:n])

    def _touching(self, radii: list[Row]) -> list[Row]:
        """u . t <= radius for the planes of each ball, the radius being right - left^T x."""
        return [row for k, radius in enumerate(radii) for row in self._planes_of(k, radius)]

    def _planes_of(self, k: int, radius: Row) -> list[Row]:
        """The same of one ball."""
        if not self.planes[k] or radius.right == np.inf:
            return []
        (T, t), ball, sides = self.programme.bounded, self.programme.balls[k], np.array(self.planes[k])
        return list(map(Row, sides @ T[ball] + radius.left, (radius.right - sides @ t[ball]).tolist()))

    def _kept_out(self, x: np.ndarray, radii: list[Row], enough: float, far: bool) -> bool:
        """Whether x is outside a ball, or a ray far out; a plane keeps it out then."""
        t, out = self.programme.bounded.along(x) if far else self.programme.bounded(x), False
        for ball, radius, planes in zip(self.programme.balls, radii, self.planes, strict=True):
            length, right = np.linalg.norm(t[ball]), 0.0 if far and radius.right < np.inf else radius.right
            if length > right - radius.left @ x + max(enough, self.kept[ball[0]]):
                planes.append(t[ball] / length)
                out = True
        return out

    def _radii_beside(self, x: np.ndarray) -> list[Row]:
        """The least radii of balls, beside the loads of x."""
        own = self.programme
        loads = own.read(x)
        _, up, _, slope = own.limits(loads)
        return [
            Row(-slope[j] @ own.read.matrix, float(up[j] + slope[j] @ (own.read.offset - loads)))
            for j in (ball[0] for ball in own.balls)
        ]

    def _radii_over(self, cones: Sequence[Rays]) -> list[Row]:
        """The largest radii of balls over cones of their loads."""
        out = []
        for j in (ball[0] for ball in self.programme.balls):
            rays, own = cones[j], self.own[j]
            if rays is None:
                out.append(Row(np.zeros(own.matrix.shape[1]), self.sides[j, 0]))
            else:
                limit = self._limits_along(j, rays)[0]
                weights = limit[1:] @ np.linalg.inv(rays)
                out.append(Row(-weights @ own.matrix, float(limit[0] + weights @ own.offset)))
        return out

    def _solve(self, cost: np.ndarray, rows: list[Row]) -> Optimum:
        """The largest c^T x; entries of c beyond the unknowns are of more of them, at least 0."""
        from scipy.optimize import linprog  # here, because its import takes a second

        own, rows = self.programme.with_more(len(cost) - len(self.programme.box)), [*rows, *self.cuts]
        if not len(cost):  # all is unique, and linprog takes no programme without unknowns
            off = [*(-own.within[1]), *(-row.right for row in rows), *np.abs(own.equal[1])]
            return Optimum(0.0, cost) if np.all(np.array(off) <= KEPT) else NOTHING
        lefts = (np.pad(row.left, (0, len(cost) - len(row.left))) for row in rows)
        left = np.array([*own.within[0], *lefts]).reshape(-1, len(cost))
        right = np.array([*own.within[1], *(row.right for row in rows)])
        size = np.abs(left).max(axis=1, initial=0.0)
        size = np.where(size > 0, size, 1.0)

        def solve(cost: np.ndarray, presolve: bool, far: bool = False) -> "scipy.optimize.OptimizeResult":
            options = {"primal_feasibility_tolerance": TOLERANCE, "dual_feasibility_tolerance": TOLERANCE}
            return linprog(
                -cost,
                left / size[:, None],
                0.0 * right if far else right / size,
                own.equal[0],
                0.0 * own.equal[1] if far else own.equal[1],
                np.where(np.isinf(own.box), np.sign(own.box), 0.0) if far else own.box,
                options={**options, "presolve": presolve},
            )

        for presolve in (True, False):  # a presolve takes rounding for a contradiction
            found = solve(cost, presolve)
            if found.status == 0:
                return Optimum(-found.fun, found.x)
            if found.status == 2 and not presolve:
                return NOTHING
            if found.status == 3:
                ray = solve(cost, presolve, far=True).x
                grows = ray is not None and cost @ ray > TOLERANCE
                return Optimum(np.inf, solve(np.zeros_like(cost), presolve).x, ray if grows else None)
        return Optimum(np.inf, None)

    def violated(self, x: np.ndarray, far: bool = False) -> list[Row]:
        """Cuts that x, or a ray, does not keep: of the ellipsoid, and of slips that have all of their friction."""
        (matrix, offset), reach = self.programme.norm, 0.0 if far else 1.0
        cuts, at = [], matrix @ x + reach * offset
        length = np.linalg.norm(at)
        if length > reach + KEPT:
            cuts.append(Row(at @ matrix / length, float(1 - at @ offset / length)))
        if self.programme.full.any():
            rows = [row for row, full in self._tangents(x, far) if full]
            cuts += [Row(-row.left, -row.right) for row in rows if reach * row.right - row.left @ x > KEPT]
        return cuts

    def _tangents(self, x: np.ndarray, far: bool = False) -> list[tuple[Row, bool]]:
        """Of all limits at the loads of x, or along a ray, upper then lower; and whether the friction is that limit."""
        own = self.programme
        (T, t), (R, r) = own.bounded, own.read
        loads = R @ x + (0.0 if far else r)
        down, up, by_down, by_up = own.limits(loads)
        out = []
        for sign, limit, slope in ((1.0, up, by_up), (-1.0, down, by_down)):
            left, right = sign * T - slope @ R, limit - slope @ (loads - r) - sign * t
            rows = zip(left, right, own.full, limit, strict=True)
            out += [(Row(a, float(b)), bool(full == sign)) for a, b, full, most in rows if most < np.inf]
        return out

    def excess(self, x: np.ndarray, far: bool = False) -> np.ndarray:
        """By how much limits are exceeded, and full friction is missed, at x or along a ray; of a ball at its first."""
        own = self.programme
        down, up = own.limits_along(x) if far else own.limits(own.read(x))[:2]
        t = own.bounded.along(x) if far else own.bounded(x)
        missed = np.where(own.full == 1, up - t, np.where(own.full == -1, down + t, -np.inf))
        excess = np.max([t - up, -t - down, missed], axis=0)
        for ball in own.balls:
            excess[ball] = -np.inf
            excess[ball[0]] = np.linalg.norm(t[ball]) - up[ball[0]]
        return excess

    def _over_cone(self, j: int, rays: Rays) -> list[Row]:
        """The limits of one friction over a cone of its loads, and the cone."""
        T, t = self.programme.bounded
        if rays is None:
            return [
                Row(s * T[j], side - s * t[j]) for s, side in zip((1, -1), self.sides[j], strict=True) if side < np.inf
            ]
        shares, given = self.own[j].times(np.linalg.inv(rays))
        out = [Row(-share, more) for share, more in zip(shares, given, strict=True)]
        for sign, limit in zip((1, -1), self._limits_along(j, rays), strict=True):
            if limit[0] < np.inf:
                out.append(Row(sign * T[j] - limit[1:] @ shares, limit[0] + limit[1:] @ given - sign * t[j]))
        return out

    def _limits_along(self, j: int, rays: np.ndarray) -> np.ndarray:
        """The upper and the lower limit without load, and by how much each ray raises them: (2, 1 + rays)."""
        key = j, rays.tobytes()
        if key not in self._known:
            none, *limits = self.limits_at(j, np.pad(rays.T, ((1, 0), (0, 0))))
            self._known[key] = np.stack([none, *(own - np.where(np.isinf(none), 0.0, none) for own in limits)], axis=1)
        return self._known[key]

    def limits_at(self, j: int, loads: np.ndarray) -> np.ndarray:
        """The upper and the lower limit of one friction at loads (s, r), shape (s, 2)."""
        points = np.zeros((len(loads), len(self.programme.read.offset)))
        points[:, self.programme.reads[j]] = loads @ self.bases[j].T
        down, up = self.programme.limits(points)[:2]
        return np.stack([up[:, j], down[:, j]], axis=1)


def _kept(programme: Programme) -> np.ndarray:
    """By how much limits may be exceeded: programmes keep rows to their tolerance, in sizes of the largest entry."""
    (T, _), (R, _), ones = programme.bounded, programme.read, np.ones(len(programme.read.offset))
    slopes = [np.abs(slope) for loads in (ones, -ones) for slope in programme.limits(loads)[2:]]
    entries = np.max([slope @ np.abs(R) for slope in slopes], axis=0) + np.abs(T)
    return np.maximum(KEPT, 2 * TOLERANCE * entries.max(axis=1, initial=0.0))


def _independent_loads(programme: Programme) -> list[np.ndarray]:
    """A basis of the loads of each limit that equations leave, columns; of all of them the loads themselves."""
    left, right = programme.equal
    least = np.linalg.lstsq(left, right, rcond=None)[0] if len(left) else np.zeros(len(programme.box))
    _, sizes, ways = np.linalg.svd(left)
    ways = ways[np.sum(sizes > _ROUNDING * sizes.max(initial=0.0)) :].T
    given, caused = programme.read(least), programme.read.matrix @ ways
    bases = []
    for reads in programme.reads:
        basis, sizes, _ = np.linalg.svd(np.column_stack([given[reads], caused[reads]]), full_matrices=False)
        basis = basis[:, sizes > _ROUNDING * sizes.max(initial=0.0)]
        bases.append(np.eye(reads.size) if basis.shape[1] == reads.size else basis)
    return bases
