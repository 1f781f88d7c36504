"""Implicit steps, by as many coordinates as the mechanism has freedoms.

A step begins at q_0, qd_0. With the columns of N a basis of what the constraints allow there, N^+ = (N^T M N)^-1 N^T M
and C the least changes that meet them, N^+ C = 0,

    q = q_0 [+] d,   d = N u + C a,   qd = qd_0 + N v + C b        with a, b such that the constraints hold,
    u' = N^+ d',   v' = N^+ qdd

are ordinary equations for u and v. What constraints forbid is not seen by an implicit method, whose Jacobian has 2 f
columns for f freedoms, and those of the internal states of friction. Positions and velocities are on the manifold in
each stage, so that stiff springs feel no error of the constraints.

Any diffrax solver takes the step, in a time from 0 to 1 and coordinates free of units, so that its root finder has the
tolerance of the step. Where the rank is traced the projector N N^+ stands for N and N^+.
"""

from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from .._equations._kinematics import constraint_motion, displacement
from .._system._state import State
from .._tools._numbers import stop_gradient
from ._held_rank import HeldFactorisation, factorize_held
from ._moving import Context, Equations, Moving
from ._radau import STAGES, Collocation, RadauSteps
from ._radau_solver import Radau
from ._scalars import Flag, Scalar

# Chord iterations of a stage, from what is off by e^3 where the step bends by e: each takes it by e. Those of a stage
# at the beginning of a step, whose derivatives are exact after one.
_CHORDS, _AT_BEGIN = 5, 1


class Coordinates(NamedTuple):
    """Those of one step.

    - `begin`: where it begins, at `t`; `drift`, `bend`: the parts of velocities and accelerations there across the
      freedoms.
    - `factor`: the equations there.
    - `along`, `onto`: N and N^+, lengths by numbers; shape (n, f) and (f, n).
    - `size`, `speed`, `energy`: of the mechanism, by which z is free of units.
    """

    equations: Equations
    context: Context
    t: Array
    begin: Moving
    drift: Float[Array, " n"]
    bend: Float[Array, " n"]
    factor: HeldFactorisation
    along: Float[Array, "n f"]
    onto: Float[Array, "f n"]
    size: Float[Array, ""]
    speed: Float[Array, ""]
    energy: Float[Array, ""]

    @property
    def start(self) -> Float[Array, " z"]:
        """z at the beginning."""
        none = jnp.zeros_like(self.onto[:, 0])
        return self.packed(none, none, jnp.zeros_like(self.begin.work), self.begin.memory)

    def packed(self, u: Array, v: Array, work: Array, memory: list[PyTree]) -> Float[Array, " z"]:
        """z, free of units."""
        sized = [jax.tree.map(jnp.divide, own, size) for own, size in zip(memory, self._sizes(), strict=True)]
        return ravel_pytree((u / self.size, v / self.speed, work / self.energy, sized))[0]

    def _sizes(self) -> list[PyTree]:
        return [group.memory_size() for group in self.equations.system.friction]

    def _unpacked(self, z: Array) -> tuple[Array, Array, Array, list[PyTree]]:
        none = jnp.zeros_like(self.onto[:, 0])
        u, v, work, sized = ravel_pytree((none, none, self.begin.work, self.begin.memory))[1](z)
        memory = [jax.tree.map(jnp.multiply, own, size) for own, size in zip(sized, self._sizes(), strict=True)]
        return self.size * u, self.speed * v, self.energy * work, memory

    def lifted(self, t: Array, z: Float[Array, " z"], chords: int = _CHORDS) -> Moving:
        """Position and velocity on the manifold."""
        u, v, work, memory = self._unpacked(z)
        system, begin, factor, after = self.equations.system, self.begin, self.factor, t - self.t

        def nearer(_: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
            d, qd = now
            off, rate = constraint_motion(system, State(system.retract(begin.q, d), qd, t))
            return d - factor.nearest(off), qd - factor.nearest(rate)

        guess = self.along @ u + after * (self.drift + after / 2 * self.bend)
        d, qd = jax.lax.fori_loop(0, chords, nearer, (guess, begin.qd + self.along @ v + after * self.bend))
        return begin._replace(q=system.retract(begin.q, d), qd=qd, work=begin.work + work, memory=memory)

    def rate(self, t: Array, z: Float[Array, " z"], at_begin: bool) -> Float[Array, " z"]:
        """z'."""
        y, system = self.lifted(t, z, _AT_BEGIN if at_begin else _CHORDS), self.equations.system
        slope = self.equations.derivative(t, y, self.context)
        moved = slope.q
        if not system.adds:
            moved = jax.jvp(lambda q: displacement(system, self.begin.q, q)[0], (y.q,), (slope.q,))[1]
        return self.packed(self.onto @ moved, self.onto @ slope.qd, slope.work, slope.memory)

    def error(self, z: Float[Array, " z"]) -> Moving:
        """A small z as a change of position and velocity."""
        u, v, work, memory = self._unpacked(z)
        system, begin, d = self.equations.system, self.begin, self.along @ u
        q = jax.jvp(lambda d: system.retract(begin.q, d), (jnp.zeros_like(d),), (d,))[1]
        return Moving(q, jax.tree.map(jnp.zeros_like, begin.base), self.along @ v, work, memory)


def coordinates(equations: Equations, t: Array, y: Moving, context: Context, near: Array | None) -> Coordinates:
    """Those of a step that begins at a state; the columns of `near` span about what the constraints allow, None where
    the rank is not known."""
    fixed, there, then, held = jax.lax.stop_gradient((equations, y, t, context))
    factor = cast(HeldFactorisation, factorize_held(fixed.system, there.at(then), held.held))
    mass, scale = fixed.system.mass(there.q, then), fixed.scaling
    every = jnp.diag(scale.coordinates) if near is None else near
    along = every - factor.response @ factor.held_inverse(factor.rows @ every)
    if near is None:
        onto = along / scale.coordinates / scale.coordinates[:, None]
    else:
        own = jnp.linalg.cholesky(along.T @ mass @ along)
        along = jax.scipy.linalg.solve_triangular(own, along.T, lower=True).T
        longest = jnp.max(jnp.abs(along) / scale.coordinates[:, None], axis=0)
        along, onto = along / longest, longest[:, None] * (along.T @ mass)
    drift, bend = (x - along @ (onto @ x) for x in (there.qd, fixed.derivative(then, there, held).qd))
    energy = jnp.trace(mass * scale.coordinates**2) * fixed.speed**2
    return Coordinates(equations, context, t, y, drift, bend, factor, along, onto, scale.size, fixed.speed, energy)


class Tangent(diffrax.AbstractWrappedSolver):
    """A solver that takes steps in the coordinates of the freedoms; `known` says whether their number is."""

    solver: diffrax.AbstractSolver
    known: bool = eqx.field(static=True)
    term_structure = diffrax.AbstractTerm
    interpolation_cls = Collocation

    def order(self, terms: PyTree) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: PyTree) -> Scalar | None:
        return self.solver.error_order(terms)

    def func(self, terms: PyTree, t0: Scalar, y0: PyTree, args: PyTree) -> Moving:
        return terms.vf(t0, y0, args)

    def init(self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree) -> Float[Array, "n f"] | None:
        equations, context = args
        if not self.known:
            return None
        factor = cast(HeldFactorisation, factorize_held(equations.system, y0.at(t0), context.held))
        rank, scale = len(factor.rows) - context.held.basis.shape[1], equations.scaling.coordinates
        return stop_gradient(scale[:, None] * jnp.linalg.svd(stop_gradient(factor.rows * scale))[2][rank:].T)

    def step(
        self, terms: PyTree, t0: Scalar, t1: Scalar, y0: PyTree, args: PyTree, solver_state: PyTree, made_jump: Flag
    ) -> tuple[Moving, Moving | None, dict[str, Moving], Float[Array, "n f"] | None, diffrax.RESULTS]:
        (equations, context), t0, t1 = args, jnp.asarray(t0), jnp.asarray(t1)
        at, dt = coordinates(equations, t0, y0, context, solver_state), t1 - t0
        term = diffrax.ODETerm(lambda s, z, at_begin: dt * at.rate(t0 + s * dt, z, at_begin is True))
        begin, zero, one = at.start, jnp.zeros_like(t0), jnp.ones_like(t0)
        inner = self.solver.init(term, zero, one, begin, None)
        end, error, dense, _, result = self.solver.step(term, zero, one, begin, None, inner, True)
        path, places = self.solver.interpolation_cls(t0=zero, t1=one, **dense), jnp.asarray(STAGES, t0.dtype)
        stages = jnp.concatenate([jax.vmap(path.evaluate)(places[:-1]), end[None]])
        there = jax.vmap(at.lifted)(t0 + places * dt, stages)
        values = jax.tree.map(lambda a, b: jnp.concatenate([a[None].astype(b.dtype), b]), y0, there)
        y = jax.tree.map(lambda x: x[-1], there)
        near = stop_gradient(at.along) if self.known else None
        return y, None if error is None else at.error(error), {"values": values}, near, result


def in_tangent(solver: diffrax.AbstractSolver | Radau, tolerance: Array, *, known: bool) -> Tangent:
    """An implicit solver with the tolerance of a step for its equations, where it has none."""
    steps = RadauSteps(tolerance) if isinstance(solver, Radau) else solver
    finder = getattr(steps, "root_finder", None)
    if finder is not None and not eqx.is_array_like(getattr(finder, "atol", 0.0)):
        own = (0.0, tolerance, optx.rms_norm)
        finder = eqx.tree_at(lambda f: (f.rtol, f.atol, f.norm), finder, own)
        steps = eqx.tree_at(lambda s: s.root_finder, steps, finder)
    if isinstance(steps, diffrax.AbstractRungeKutta) and steps.scan_kind is None:  # the one that both modes take
        steps = eqx.tree_at(lambda s: s.scan_kind, steps, "bounded", is_leaf=lambda x: x is None)
    return Tangent(steps, known)
