"""Extremes over the loads at rest: linear programmes in cones of the loads that friction depends on.

    max c^T x   with   A x = a,   B x <= b,   |V x + v| <= 1,   x in a box,
                       -down_j(rho_j) <= t_j <= up_j(rho_j),   t = T x + t_0,   rho = R x + rho_0

Every limit is a constant and a seminorm N of some loads. More load allows more friction, so that the set is not
convex. In a cone of loads with the rays v_i, and beside any loads rho*,

    N'(rho*) rho <= N(rho) <= sum_i w_i N(v_i),   rho = sum_i w_i v_i,   w_i >= 0.

With the right side as limit a linear programme holds all that is possible in the cone: it gives an outer bound. With
the left side it holds only what is possible: an inner one. Cones are split along the load that the programme found,
where its limit is exact then, until both bounds meet or `most` programmes are solved.

A slip that moves has all of its friction: `full` says at which limit. The lower bound N'(rho*) rho <= N is a cut then.

Slips at rest that share one friction are within a ball, |t_b| <= up_b: u . t_b <= up_b for every unit vector u.
Programmes have such planes for the directions u of what they found beyond the ball.

Cones are of the loads that the equations leave independent. A programme without bound grows along a ray, and so does
what is possible if the ray is within all limits far out: constants count for nothing there.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ._affine_map import AffineMap


class LimitValues(NamedTuple):
    """Lower limits with their sign turned and upper ones, (..., f), and their derivatives by the loads, (..., f, l)."""

    down: np.ndarray
    up: np.ndarray
    by_down: np.ndarray
    by_up: np.ndarray


Limits = Callable[[np.ndarray], LimitValues]
Rays = np.ndarray | None  # of a cone, shape (loads, loads), column by column; None for all loads


class Programme(NamedTuple):
    """What is possible, in figures of size 1; see the module.

    - `equal`, `within`: A, a and B, b; `norm`: V, v, without rows if there is none.
    - `box`: least and largest x, shape (x, 2); may be infinite.
    - `bounded`: T, t_0; `read`: R, rho_0; `reads`: the loads that each limit depends on.
    - `full`: 0 within limits, 1 at `up`, -1 at `-down`; the other limit is infinite then.
    - `limits`: the limits at loads rho, or at many, (..., l).
    - `balls`: which t are together within their limit, which each of them has too.
    """

    equal: tuple[np.ndarray, np.ndarray]
    within: tuple[np.ndarray, np.ndarray]
    norm: AffineMap
    box: np.ndarray
    bounded: AffineMap
    read: AffineMap
    reads: tuple[np.ndarray, ...]
    full: np.ndarray
    limits: Limits
    balls: tuple[list[int], ...] = ()

    def used(self, x: np.ndarray) -> np.ndarray:
        """|t| over its limits, where it has one; of balls as a whole."""
        down, up = self.limits(self.read(x))[:2]
        t = self.bounded(x)
        most, size = np.where(t > 0, up, down), np.abs(t)
        for ball in self.balls:
            size[ball] = np.linalg.norm(t[ball])
        return size / np.where(most > 0, most, 1.0)

    def limits_along(self, ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower limits with their sign turned and upper ones, by which they grow along a ray."""
        none, far = self.limits(np.zeros(len(self.read.offset)))[:2], self.limits(self.read.along(ray))[:2]
        down, up = (far - np.where(np.isinf(none), 0.0, none) for none, far in zip(none, far, strict=True))
        return down, up

    def with_more(self, count: int) -> "Programme":
        """The same with more unknowns, at least 0, behind its own."""
        wider = [(np.pad(left, ((0, 0), (0, count))), right) for left, right in (self.equal, self.within)]
        return self._replace(
            equal=wider[0], within=wider[1], box=np.concatenate([self.box, np.tile([0.0, np.inf], (count, 1))])
        )

    def with_limits(self, factor: float) -> "Programme":
        """The same with all limits multiplied."""
        return self._replace(limits=lambda loads: LimitValues(*(factor * part for part in self.limits(loads))))


class Row(NamedTuple):
    """left^T x <= right."""

    left: np.ndarray
    right: float


class Optimum(NamedTuple):
    """Of a linear programme: infinite without bound, at any x that it allows, or None; -inf without solution.

    `ray`: in which direction from x it grows without bound, of size 1; None where it does not.
    """

    value: float
    x: np.ndarray | None
    ray: np.ndarray | None = None


NOTHING = Optimum(-np.inf, None)
KEPT = 1e-9  # by how much a limit may be exceeded, relative to the size of its friction
TOLERANCE = 1e-10  # of the programmes, whose figures are of size 1
