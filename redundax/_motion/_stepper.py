"""Steps of any diffrax solver on the constraint manifold.

A step of the given solver is followed by the projection of positions and velocities. How far it moves the state is an
error of the step that the solver's own estimate need not see, and is added to it; where the projection does not close
the mechanism the step is rejected. So it is where friction changes by much that may have several solutions: the motion
follows its branch, and where the branch ends steps become too small. Solvers that reuse their last stage are told that
the state jumped.
"""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from .._equations._kinematics import velocity
from .._tools._numbers import stop_gradient
from ._held_rank import AnyHeldFactorisation, factorize_held
from ._moving import Context, Equations, Moving, rechart, tolerance_of
from ._project import project
from ._slip import ends_well, has_event

# Relative constraint residual after a projection beyond which it has failed, at least so many roundings.
_CLOSED = 2e-10, 1e3
# Largest change of friction in a step, relative to its size, where it may have several solutions.
_JUMP = 0.1
# Part of the rows left out, in roots of the rounding, at which they are constraints of their own.
_SAME = 1e2
# Least part of its pivot that a step leaves; and of the largest pivot, at least so many cube roots of the rounding.
_LEFT, _BESIDE = 0.1, (1e-3, 10.0)


class Diagnostics(NamedTuple):
    """What is watched over the accepted steps.

    - `position`: largest violation, relative to the size of the mechanism.
    - `velocity`, `speed`: largest violation and largest velocity, both as lengths per time; `speed` begins with what
      the first accelerations reach over the length of the mechanism.
    - `kinetic`, `start`, `energy`: largest kinetic energy, T - A at the start, and its largest change.
    - `nearest`: smallest pivot of the constraints, mass-weighted: 0 in a singular position.
    - `contraction`: largest bound of that of friction at all loads.
    - `jump`: largest change of friction in a step, relative to its size, where that bound is 1 or more.
    """

    position: Float[Array, ""]
    velocity: Float[Array, ""]
    speed: Float[Array, ""]
    kinetic: Float[Array, ""]
    start: Float[Array, ""]
    energy: Float[Array, ""]
    nearest: Float[Array, ""]
    contraction: Float[Array, ""]
    jump: Float[Array, ""]


def at_start(like: Float[Array, ""]) -> Diagnostics:
    """Nothing seen yet."""
    zero = jnp.zeros_like(like)
    return Diagnostics(zero, zero, zero, zero, zero, zero, jnp.full_like(zero, jnp.inf), zero, zero)


class Carried(NamedTuple):
    """State: the solver's own, what is held, the watch, pivots now and largest, the start of the step."""

    inner: Any
    context: Context
    watch: Diagnostics
    pivot: Float[Array, ""]
    largest: Float[Array, ""]
    start: tuple[Array, Moving]


class Stepper(diffrax.AbstractWrappedSolver):
    """The solver, followed by the stabilisation; `constant` steps are judged by where they end alone."""

    solver: diffrax.AbstractSolver
    constant: bool = eqx.field(static=True)

    @property
    def term_structure(self) -> Any:
        return self.solver.term_structure

    @property
    def interpolation_cls(self) -> Any:  # pyright: ignore
        return self.solver.interpolation_cls

    @property
    def term_compatible_contr_kwargs(self) -> Any:
        return self.solver.term_compatible_contr_kwargs

    @property
    def root_finder(self) -> Any:
        """Of an implicit solver."""
        return self.solver.root_finder  # pyright: ignore

    @property
    def scan_kind(self) -> Any:
        """Of a Runge-Kutta solver."""
        return self.solver.scan_kind  # pyright: ignore

    def order(self, terms: Any) -> int | None:
        return self.solver.order(terms)

    def error_order(self, terms: Any) -> Any:
        return self.solver.error_order(terms)

    def func(self, terms: Any, t0: Any, y0: Any, args: Any) -> Any:
        return self.solver.func(terms, t0, y0, args)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any) -> Carried:
        equations, context = args
        inner = self.solver.init(terms, t0, t1, y0, args)
        kinetic = equations.kinetic_energy(t0, y0)
        watch = at_start(kinetic)._replace(speed=equations.speed, kinetic=kinetic, start=kinetic - y0.work)
        zero = jnp.zeros_like(kinetic)
        return Carried(inner, context, *jax.lax.stop_gradient((watch, zero, zero, (t0, y0))))

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Any, args: Any, solver_state: Carried, made_jump: Any
    ) -> tuple[Any, Any, Any, Carried, Any]:
        equations, _ = args
        system, context = equations.system, solver_state.context
        projects = equations.stabilisation.projects
        y, error, dense, inner, result = self.solver.step(
            terms, t0, t1, y0, (equations, context), solver_state.inner, made_jump or projects or not system.adds
        )
        raw = y
        y, settled = rechart(system, y)
        if projects:
            y = project(system, t1, y, context.held)
        # What is watched and what the next step starts from have no derivatives.
        fixed, there, t, before = stop_gradient((equations, y, t1, context.held))
        factor = factorize_held(fixed.system, there.at(t), before)
        held, excess = factor.renewed(context.held)
        watch, off = _diagnostics_after(solver_state.watch, fixed, t, there, factor)
        pivot = jnp.min(factor.pivots)
        (_, tau, along), state, well = context, there.at(t), True
        jump = jnp.zeros_like(off)
        if system.friction:
            linear = fixed.linear(state, before, factor, closed=fixed.loaded)
            solved = fixed.solved(state, linear, tau, along)
            change = jnp.where(fixed.sticking, 0.0, jnp.abs(solved.tau - tau) / solved.size)
            jump = jnp.where(solved.contraction < 1, 0.0, jnp.max(change))
            watch = watch._replace(
                contraction=jnp.maximum(watch.contraction, solved.contraction), jump=jnp.maximum(watch.jump, jump)
            )
            tau = solved.tau
            if fixed.has_sense:
                event = has_event(fixed, state, linear, along)
                y = y._replace(event=event.astype(t.dtype))
                if along is not None:
                    well, along = ends_well(fixed, linear.rate, along), fixed.turned(linear.rate, along, event)
        largest = jnp.maximum(solver_state.largest, pivot)
        carried = Carried(inner, Context(held, tau, along), watch, pivot, largest, jax.lax.stop_gradient((t0, y0)))
        good = _may_end(off, excess, solver_state, pivot) if projects else jnp.isfinite(off)
        good = good & settled & (jump <= _JUMP) & well
        if self.constant or error is None:
            error = jax.tree.map(jnp.zeros_like, y)
        else:
            if projects or not system.adds:
                error = jax.tree.map(lambda e, a, b: jnp.abs(e) + jnp.abs(a - b), error, y, raw)
            error = _relative(error, t1 - t0, equations, solver_state, carried)
        error = jax.tree.map(lambda e: jnp.where(good, e, jnp.inf), error)
        return y, error, dense, carried, result


def _may_end(off: Array, excess: Array, before: Carried, end: Array) -> Bool[Array, ""]:
    """Whether a step may end here: on the manifold, with the rank that is held, and not beside a singular position.

    A step passes a singular position; it does not end where less than a tenth of the pivot that it began with is left,
    nor where rounding, magnified by the cube of 1 / pivot, would tell in accelerations, unless it begins there.
    """
    eps = float(jnp.finfo(off.dtype).eps)
    beside = max(_BESIDE[0], _BESIDE[1] * eps ** (1 / 3)) * before.largest
    clear = (end >= _LEFT * before.pivot) & (end >= beside)
    return (off <= tolerance_of(_CLOSED, off)) & (excess <= _SAME * eps**0.5) & (clear | (before.pivot < beside))


def _relative(error: Moving, dt: Array, equations: Equations, before: Carried, after: Carried) -> Moving:
    """The error of a step free of units, of which the tolerance is taken: positions relative to the size of the
    mechanism, velocities to the largest that it had, internal states to their sizes.

    At the pivot p, rounding is magnified by 1 / p in positions, its square in velocities, and its cube in
    accelerations, whatever the length of a step; that much is not counted.
    """
    sizes, speed = equations.scaling, after.watch.speed
    pivot = jnp.minimum(jnp.where(before.pivot > 0, before.pivot, after.pivot), after.pivot)
    blur = 10 * jnp.finfo(speed.dtype).eps / pivot
    shift = speed * jnp.abs(dt) / sizes.size / pivot

    def counted(value: Array, size: Array, rounding: Array) -> Array:
        return jnp.maximum(jnp.abs(value) / size - rounding, 0.0)

    system, off = equations.system, error.q
    if not system.adds:
        off = velocity(system, after.start[1].q, off)
    position = counted(off, sizes.size * sizes.coordinates, blur * (1 + shift**2))
    return Moving(
        position if system.adds else jnp.full_like(error.q, jnp.max(position)),
        jax.tree.map(jnp.zeros_like, error.base),
        counted(error.qd, speed * sizes.coordinates, blur / pivot * (1 + shift)),
        jnp.zeros_like(error.work),
        jax.tree.map(jnp.zeros_like, error.event),
        [
            jax.tree.map(lambda e, size: jnp.abs(e) / size, own, group.memory_size())
            for own, group in zip(error.memory, system.friction, strict=True)
        ],
    )


def size_of(error: Moving) -> Float[Array, ""]:
    """Root of the mean square of a step's errors; on a chart the largest, which coordinates that keep still do not
    dilute: in space most do."""
    return optx.rms_norm(error) if error.base is None else optx.max_norm(error)


def _diagnostics_after(
    watch: Diagnostics, equations: Equations, t: Array, y: Moving, factor: AnyHeldFactorisation
) -> tuple[Diagnostics, Float[Array, ""]]:
    """The watch after a step, and the violation of the position by this step."""
    sizes = equations.scaling
    position = jnp.max(jnp.abs(factor.motion.value) / sizes.rows) / sizes.size
    kinetic = equations.kinetic_energy(t, y)
    watch = watch._replace(
        position=jnp.maximum(watch.position, position),
        velocity=jnp.maximum(watch.velocity, jnp.max(jnp.abs(factor.motion.rate) / sizes.rows)),
        speed=jnp.maximum(watch.speed, jnp.max(jnp.abs(y.qd) / sizes.coordinates)),
        kinetic=jnp.maximum(watch.kinetic, kinetic),
        energy=jnp.maximum(watch.energy, jnp.abs(kinetic - y.work - watch.start)),
        nearest=jnp.minimum(watch.nearest, jnp.min(factor.pivots)),
    )
    return watch, position
