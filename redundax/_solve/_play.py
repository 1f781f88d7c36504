"""Loads of joints with play: at which side of its clearance each stands, outside of the equations (7), (25).

Loads are least in energy over all multipliers that solve the equations, where c is the clearance of a group g of rows:

    minimum of lam^T W lam / 2 - d^T lam + sum c |lam_g|

With r = d + Phi_q u - W lam, u the displacement, that is

    lam_g != 0:  r_g = c lam_g / |lam_g|,    lam_g = 0:  |r_g| <= c,    or    lam_g = S(lam_g + s r_g)

for any stiffness s > 0, S(v) = max(0, 1 - s c / |v|) v. Two methods take turns. Douglas-Rachford splitting

    v <- v + y - S(v),   y the loads of compliance W + 1/s and misfit d + (2 S(v) - v)/s

comes nearer with each step from anywhere, quickest where loads and s r are alike in size. Newton's method ends it:
where |v| <= s c the rows carry nothing, and elsewhere, with n = v / |v|, the joints have

    compliance W + H,   misfit d - c n,   H = c (I - n n^T) / (|v| - s c),

so that all else, friction too, is solved as it is. Given zeros, n and H the solution has the derivatives of the
minimum, as a step of Newton's method from there has them.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Array, Bool, Float, Int, PyTree

from .._closures._closure import Elasticity
from .._closures._play import Play
from .._equations._factorisation import Factorisation
from .._equations._unloaded import among_unloaded, unloaded
from .._system._results import RESULTS, differs
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import fori_loop, or_one, stop_gradient, take, while_loop, xp

_SPLITTINGS = 20  # steps before each of Newton's, which has its region of convergence then in most cases
_MOST = 100  # turns; of 3600 random cases of up to 18 rows 1 in 300 takes more
# Of the stiffness, between which s is: loads from 1e-10 of those by which clearances would be closed.
_SHARES = (1e-10, 1e2)
_SAME, _BEYOND = 0.1, 0.05  # of a change, as parts of it: splitting makes good what is off, from anywhere
_ON_EDGE = 1e-9  # of a clearance: what just closes it is no load; above the rounding of r, whose size is that of W lam


class Sides(NamedTuple):
    """Which rows carry nothing; n, and the load |v| - s c, of the others with play; v and s that tell it."""

    zero: Bool[Array, " m"]
    direction: Float[Array, " m"]
    load: Float[Array, " m"]
    gap: Float[Array, " m"]  # r that v has


class _Turn(NamedTuple):
    v: Float[Array, " m"]
    share: Float[Array, ""]
    multipliers: Float[Array, " m"]
    sides: Sides
    turns: Int[Array, ""]
    goes_on: Bool[Array, ""]
    settled: Bool[Array, ""]


class _Clearance:
    """The play of rows beside the stiffness of their self-stress, which rows go together, and which can be without load
    at all: others are not redundant, and their play changes no load."""

    def __init__(self, play: Play, factor: Factorisation, elasticity: Elasticity):
        m = factor.gamma.size
        self.factor, self.elasticity, self.together = factor, elasticity, play.together(m)
        own = play.of_rows(m).astype(factor.gamma.dtype)
        self.own = xp.where(own < 0, 0.0, own)  # where it is 0 it has the derivative of one that grows
        response, _ = factor.stress_response(elasticity.compliance)
        stiffness = self.together @ xp.diagonal(response) / self.together.sum(axis=1)
        redundant = self.together @ factor.in_self_stress.astype(int) > 0
        self.size = xp.where(redundant & (stiffness > 0), self.own, 0.0)
        self.switches = self.size > 0
        self.stiffness = xp.where(self.switches, stiffness, 1.0)

    def norm(self, v: Array) -> Array:
        """|v_g| at each of its rows."""
        square = self.together @ v**2
        return xp.where(square > 0, xp.sqrt(or_one(square)), 0.0)

    def along(self, v: Array) -> Array:
        """v_g / |v_g|."""
        return v / or_one(self.norm(v))

    def shrunk(self, v: Array, s: Array) -> Array:
        """S(v)."""
        return v * xp.maximum(0.0, 1 - s * self.size / or_one(self.norm(v)))

    def gap(self, v: Array, s: Array) -> Array:
        """r of v."""
        return xp.where(self.switches, (v - self.shrunk(v, s)) / s, 0.0)

    def splitting(self, multipliers: Array, s: Array) -> Callable[[Array], Array]:
        """y - S(v) of v, where multipliers solve the equations."""
        soft = xp.where(self.switches, 1 / s, 0.0)
        pick = self.factor.close(self.elasticity.compliance + xp.diag(soft))[0]
        base = pick(multipliers) + pick.caused(self.elasticity.misfit)

        def change(v: Array) -> Array:
            x = self.shrunk(v, s)
            return base + pick.caused(soft * (2 * x - v)) - x

        return change

    def past_drift(self, v: Array, s: Array, change: Callable[[Array], Array]) -> Array:
        """v where its change first differs, if it is the same up to there: small loads cross wide clearances slowly."""
        way, size = change(v), s * self.size
        a, b, c = self.together @ way**2, self.together @ (v * way), self.norm(v) ** 2 - size**2
        root = xp.sqrt(xp.maximum(b**2 - a * c, 0.0))
        comes_in = (b < 0) & (root > 0)
        far = xp.where(c < 0, root - b, xp.where(comes_in, -b - root, xp.inf)) / or_one(a)
        far = xp.min(xp.where(self.switches & (a > 0), far, xp.inf))
        there = v + xp.where(far < xp.inf, far + _BEYOND, 0.0) * way
        return xp.where(xp.linalg.norm(change(there) - way) <= _SAME * xp.linalg.norm(way), there, v)

    def sides(self, v: Array, s: Array) -> Sides:
        load = self.norm(v) - s * self.size
        zero = self.switches & (load <= _ON_EDGE * s * self.size)
        direction = xp.where(self.switches & ~zero, self.along(v), 0.0)
        return Sides(zero, direction, load, self.gap(v, s))

    def bend(self, sides: Sides) -> Float[Array, "m m"]:
        """H."""
        turned = xp.eye(self.own.size) - xp.outer(sides.direction, sides.direction)
        slope = xp.where(self.switches & ~sides.zero, self.size / or_one(sides.load), 0.0)
        return xp.where(self.together, slope[:, None] * turned, 0.0)

    def closure(self, sides: Sides) -> Elasticity:
        """The closure at sides."""
        compliance, misfit = self.elasticity
        return Elasticity(compliance + self.bend(sides), misfit - self.size * sides.direction)

    def gaps(self, sides: Sides, multipliers: Array) -> Array:
        """r; of rows that carry nothing that nearest to the one of `sides`, as it is not the only one where they depend
        on each other."""
        compliance, misfit = self.elasticity
        given = xp.where(sides.zero, sides.gap, self.size * sides.direction + self.bend(sides) @ multipliers)
        scale = self.factor.row_scale
        missed = self.factor.split.stress @ ((misfit - compliance @ multipliers - given) / scale)
        return given + scale * (among_unloaded(self.factor, sides.zero) @ missed)

    def outside(self, multipliers: Array) -> Array:
        """c n of rows that are not redundant."""
        return (self.own - self.size) * self.along(multipliers)

    def balanced(self, v: Array, s: Array, share: Array) -> Array:
        """The share of the stiffness for which loads and s r are alike in size: what splitting is quick with."""
        loads = xp.linalg.norm(xp.where(self.switches, self.shrunk(v, s), 0.0))
        gaps = xp.linalg.norm(self.stiffness * self.gap(v, s))
        wanted = xp.where(loads > 0, xp.clip(loads / or_one(gaps), *_SHARES), share * _SHARES[1] ** -0.5)
        return xp.where(gaps > 0, xp.sqrt(share * wanted), share)


def two_sided(play: Play | None, one_sided: tuple[int, ...]) -> Play | None:
    """Play of rows that push both ways."""
    both = [] if play is None else [k for k, rows in enumerate(play.rows) if rows[0] not in one_sided]
    if play is None or not both:
        return None
    return Play(take(play.clearance, np.array(both)), tuple(play.rows[k] for k in both))


def with_play_of_contacts(elasticity: Elasticity, play: Play | None, one_sided: tuple[int, ...]) -> Elasticity:
    """The closure in which play of contacts, which stand at one side, is a misfit."""
    if play is None or not one_sided:
        return elasticity
    misfit = xp.broadcast_to(elasticity.misfit, elasticity.compliance.shape[:1])
    contacts = np.isin(np.arange(misfit.size), one_sided)
    misfit = misfit - xp.where(contacts, play.of_rows(misfit.size).astype(misfit.dtype), 0.0)
    return elasticity._replace(misfit=misfit)


@runtime_checkable
class Loaded(Protocol):
    """What a solve gives: multipliers, and how it ended."""

    @property
    def multipliers(self) -> Array: ...
    @property
    def result(self) -> RESULTS: ...


L = TypeVar("L", bound=Loaded)


def at_sides(play: Play | None, solved: Callable[..., L]) -> Callable[..., tuple[L, Elasticity, Bool[Array, ""]]]:
    """Of `solved(system, state, factor, elasticity, ...)` the solution of joints with play, the closure that it has at
    their sides, and whether these are found."""
    if play is None:
        return lambda *given: (solved(*given), given[3], xp.ones((), bool))

    def run(
        system: AbstractSystem, state: State, factor: Factorisation, elasticity: Elasticity, *more: PyTree
    ) -> tuple[L, Elasticity, Bool[Array, ""]]:
        without, closure, settled, (sides, clearance) = at_own_sides(
            play, solved, (system, state, factor, elasticity, *more)
        )
        solution = solved(system, state, without, closure, *more)
        return solution, fitted(closure, sides, clearance, solution.multipliers), settled

    return run


def at_own_sides(
    play: Play, solved: Callable[..., L], given: tuple
) -> tuple[Factorisation, Elasticity, Bool[Array, ""], tuple[Sides, _Clearance]]:
    """The factorisation and the closure at the sides at which the solution is consistent with itself, and whether they
    are found; with the sides."""
    turn, (_, _, factor, elasticity, *_) = _found(play, solved, given), given
    sides, clearance = stop_gradient(turn.sides), _Clearance(play, factor, elasticity)
    along = clearance.along(stop_gradient(turn.multipliers))  # of play that is 0
    sides = sides._replace(direction=xp.where(clearance.switches, sides.direction, along))
    return unloaded(factor, sides.zero), clearance.closure(sides), turn.settled, (sides, clearance)


def fitted(closure: Elasticity, sides: Sides, clearance: _Clearance, multipliers: Array) -> Elasticity:
    """The closure at sides in which the misfit of what carries nothing is where it stands: W lam - d fits Phi_q u."""
    gaps = xp.where(sides.zero, clearance.gaps(sides, multipliers), 0.0)
    return closure._replace(misfit=closure.misfit - gaps - clearance.outside(multipliers))


def _found(play: Play, solved: Callable[..., L], given: tuple) -> _Turn:
    """The sides at which the solution is consistent with itself."""
    play, (system, state, factor, elasticity, *more) = stop_gradient((play, given))
    clearance, eps = _Clearance(play, factor, elasticity), float(xp.finfo(factor.gamma.dtype).eps)

    def body(turn: _Turn) -> _Turn:
        s = xp.where(clearance.switches, turn.share * clearance.stiffness, 1.0)
        change = clearance.splitting(turn.multipliers, s)
        v = clearance.past_drift(fori_loop(0, _SPLITTINGS, lambda _, v: v + change(v), turn.v), s, change)
        sides = clearance.sides(v, s)
        solution = solved(system, state, unloaded(factor, sides.zero), clearance.closure(sides), *more)
        lam = solution.multipliers
        reached = lam + xp.where(clearance.switches, s * clearance.gaps(sides, lam), 0.0)
        along = xp.where(clearance.switches & ~sides.zero, clearance.along(lam), 0.0)
        size = factor.row_scale * xp.abs(lam)
        # To the rounding of a solve that a thousand rows have, which what carries nothing adds to.
        consistent = (
            xp.all(xp.abs(sides.direction - along) < 1e4 * eps)
            & xp.all(~sides.zero | (size <= 1e5 * eps * xp.max(size)))
            & xp.all(~sides.zero | clearance.sides(reached, s).zero)
        )
        failed = differs(solution.result, RESULTS.successful)
        nearer = xp.linalg.norm(change(reached)) <= xp.linalg.norm(change(v))
        v = xp.where(nearer & ~failed, reached, v)
        share = clearance.balanced(v, s, turn.share)
        v = xp.where(clearance.switches, clearance.shrunk(v, s) + share * clearance.stiffness * clearance.gap(v, s), v)
        turns, lam = turn.turns + 1, xp.where(failed, turn.multipliers, lam)
        goes_on = ~consistent & ~failed & (turns < _MOST)
        return _Turn(v, share, lam, sides, turns, goes_on, consistent | failed)

    lam, one = factor.multipliers, xp.ones((), factor.gamma.dtype)
    sides = clearance.sides(lam, clearance.stiffness)
    start = _Turn(lam, one, lam, sides, xp.zeros((), int), xp.ones((), bool), xp.zeros((), bool))
    return while_loop(lambda turn: turn.goes_on, body, start)
