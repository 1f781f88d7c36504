"""The equations of a motion at a state, linear in the friction forces: by matrices, or by products of maps.

    x = x_0 + X tau,   alpha = alpha_0 + A tau,   A = E^T A_tau symmetric positive semidefinite

alpha are the rates of the slip rates. Joints that stick have the least friction, as of contacts equally compliant, with
which their alpha is what it should be.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._closures._closure import Elasticity
from .._equations._kinematics import slip_gamma, slip_motion, slip_rate
from .._equations._response import AbstractFactorisation, AbstractPick, FrictionResponse, LinearResponse, Response
from .._solvers._active_set import Effects, active_set
from .._solvers._gauss_seidel import gauss_seidel
from .._sparse._gram import Gram
from .._system._directions import Directions
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._least_solution import least_solution
from .._tools._linear_map import LinearMap
from .._tools._numbers import xp

# Roundings, of the parts that cancel, that are left of slips which constraints forbid.
BLOCKED = 100
# Eigenvalues of unit slip accelerations of joints that stick, relative to the largest, that count as 0.
_DEPENDENT = 1e-10
# Least and largest friction at loads that friction causes.
Limits: TypeAlias = Callable[[Float[Array, " l"]], tuple[Float[Array, " p"], Float[Array, " p"]]]


class Change(NamedTuple):
    """What friction adds, and the sum of its parts; of maps the former's size."""

    value: Array
    parts: Array


class Holding(NamedTuple):
    """Friction of joints that stick or start to slip, what it adds to accelerations and to those of slips, and if it is
    found."""

    tau: Float[Array, " p"]
    caused: Change
    slip: Change
    found: Bool[Array, ""]


class Linear(NamedTuple):
    """The equations by matrices.

    - `response`: accelerations and multipliers.
    - `load`, `directions`: Q and E, shape (n,) and (n, p).
    - `rate`: slip rates, shape (p,); their rates of change are `slip` + `yields` tau, shape (p,) and (p, p).
    - `drift`: what is in `slip` besides E^T x_0, shape (p,).
    """

    response: LinearResponse
    load: Float[Array, " n"]
    directions: Float[Array, "n p"]
    rate: Float[Array, " p"]
    slip: Float[Array, " p"]
    yields: Float[Array, "p p"]
    drift: Float[Array, " p"]

    def without_rounding(
        self, free: Float[Array, " p"], gamma: Float[Array, " m"], row_scale: Float[Array, " m"]
    ) -> "Linear":
        """The same where constraints forbid slips by friction, of those that unit friction causes of `free` bodies.

            alpha_0 = lam_E^T gamma + drift,   Phi_q^T lam_E = E

        is what they prescribe then: loads have no part in it, of which rounding would be left.
        """
        few = BLOCKED * float(xp.finfo(free.dtype).eps)
        blocked = xp.diagonal(self.yields) <= few * free
        unit, right = self.response.unit.multipliers * row_scale[:, None], gamma / row_scale
        prescribed = unit.T @ right + self.drift
        parts = xp.max(xp.abs(unit), axis=0, initial=0.0) * xp.max(xp.abs(right), initial=0.0) + xp.abs(self.drift)
        prescribed = xp.where(xp.abs(prescribed) > few * parts, prescribed, 0.0)
        yields = xp.where(blocked[:, None] | blocked, 0.0, self.yields)
        return self._replace(slip=xp.where(blocked, prescribed, self.slip), yields=yields)

    @property
    def free(self) -> Bool[Array, " p"]:
        """Slips that constraints do not forbid, as far as it is known."""
        return jnp.diagonal(self.yields) > 0

    def slips_caused(self, tau: Float[Array, " p"], acceleration: Float[Array, " n"]) -> Float[Array, " p"]:
        """A tau, of friction that makes these accelerations."""
        return self.yields @ tau

    def caused_at_most(self, most: Array, by_loads: Array) -> tuple[Float[Array, " p"], Float[Array, " n"]]:
        """|A| tau of the largest friction, and |X| tau of what loads add to it."""
        return jnp.abs(self.yields) @ most, jnp.abs(self.response.unit.acceleration) @ by_loads

    def limits_at(self, tau: Float[Array, " p"], rows: Int[Array, " l"], limits: Limits) -> tuple[Array, Array]:
        """Limits at loads that this friction causes."""
        return limits(self.response.unit.multipliers[rows] @ tau)

    def hold(
        self, stick: Bool[Array, " p"], pull: Float[Array, " p"], sizes: Float[Array, " p"]
    ) -> tuple[Float[Array, " p"], Float[Array, "p p"]]:
        """Friction that holds joints against a pull, and from friction of all to that with which they are held."""
        none = jnp.zeros_like(self.yields)
        inverse = jax.lax.cond(jnp.any(stick), lambda: least_friction(self.yields, stick, sizes), lambda: none)
        passed = jnp.where(stick, 0.0, jnp.eye(stick.size, dtype=none.dtype) - inverse @ self.yields)
        return -inverse @ pull, passed

    def held_loads(
        self, rho0: Float[Array, " l"], gain: Float[Array, "l p"], stick: Bool[Array, " p"], holding: Array
    ) -> Float[Array, " l"]:
        """Loads with friction that holds joints."""
        return rho0 + gain @ holding

    def sticking(
        self,
        rows: Int[Array, " l"],
        limits: Limits,
        still: Bool[Array, " p"],
        sizes: Float[Array, " p"],
        tolerance: tuple[float, float],
        directions: Directions | None,
        wanted: Bool[Array, ""],
    ) -> Holding:
        """Friction of joints that stick or start to slip, if wanted, and of those that slip; `tolerance` is that of
        accelerations and of friction."""
        gain, unit = self.response.unit.multipliers[rows], self.response.unit.acceleration
        own = yielding(self.yields, sizes)
        pull = jnp.abs(self.slip) * sizes
        reverses = jnp.isinf(own) & (pull > tolerance[0] * jnp.max(pull))  # whatever its friction
        own = jnp.where(reverses, jnp.finfo(pull.dtype).tiny, own)
        tau, settled = gauss_seidel(
            lambda tau: limits(gain @ tau), self.slip, self.yields, own, 1 / sizes, tolerance, wanted, directions
        )
        caused, slip = (Change(matrix @ tau, jnp.abs(matrix) @ jnp.abs(tau)) for matrix in (unit, self.yields))
        return Holding(tau, caused, slip, settled)


class LinearMaps(NamedTuple):
    """The equations of a large mechanism, where E, A and what unit friction causes are maps.

    `mobility` is a size of A, as lengths, were the bodies free; with some mass for those that lack it. Which slips are
    free, and which friction causes at most, no map tells: all are, and none.
    """

    response: LinearResponse
    load: Float[Array, " n"]
    directions: LinearMap
    rate: Float[Array, " p"]
    slip: Float[Array, " p"]
    yields: LinearMap
    mobility: Float[Array, ""]

    @property
    def unit(self) -> FrictionResponse:
        """What unit friction causes."""
        return self.response.unit

    @property
    def free(self) -> Bool[Array, " p"]:
        return jnp.ones_like(self.rate, bool)

    def slips_caused(self, tau: Array, acceleration: Array) -> Float[Array, " p"]:
        return self.unit.slips(acceleration - self.response.free.acceleration)

    def caused_at_most(self, most: Array, by_loads: Array) -> tuple[Float[Array, " p"], Float[Array, " n"]]:
        return jnp.zeros_like(most), jnp.abs((self.unit @ (by_loads * _several(most))).acceleration)

    def limits_at(self, tau: Array, rows: Array, limits: Limits) -> tuple[Array, Array]:
        return limits((self.unit @ tau).multipliers[rows])

    def inverse(self, stick: Array, sizes: Array, rounding: ArrayLike = 0.0) -> LinearMap:
        """From accelerations of slips that stick to the least friction; it takes a rounding of them, as lengths, for
        none."""
        return LinearMap(_least_friction, (jnp.where(stick, sizes, 0.0), self.yields, self.mobility, rounding))

    def hold(self, stick: Array, pull: Array, sizes: Array) -> tuple[Array, LinearMap]:
        inverse = self.inverse(stick, sizes)
        holding = jax.lax.cond(jnp.any(stick), lambda: -(inverse @ pull), lambda: jnp.zeros_like(pull))
        return holding, LinearMap(_passed, (stick, inverse, self.yields))

    def held_loads(self, rho0: Array, gain: LinearMap, stick: Array, holding: Array) -> Float[Array, " l"]:
        return rho0 + jax.lax.cond(jnp.any(stick), lambda: gain @ holding, lambda: jnp.zeros_like(rho0))

    def sticking(
        self,
        rows: Array,
        limits: Limits,
        still: Array,
        sizes: Array,
        tolerance: tuple[float, float],
        directions: Directions | None,
        wanted: Array,
    ) -> Holding:
        def caused(tau: Array) -> tuple[Response, Array]:
            response = self.unit @ tau
            return response, self.unit.slips(response.acceleration)

        effects = Effects(
            caused,
            lambda multipliers: limits(multipliers[rows]),
            lambda joints, change, rounding: self.inverse(joints, sizes, rounding) @ change,
        )
        active = active_set(effects, self.slip, still, sizes, tolerance, wanted & jnp.any(still))
        added, slip = (Change(x, jnp.abs(x)) for x in (active.caused.acceleration, active.acceleration - self.slip))
        return Holding(active.tau, added, slip, active.settled)


AnyLinear: TypeAlias = Linear | LinearMaps


class Asked(NamedTuple):
    """What the equations at a state are asked of.

    - `gamma`: the right-hand side of the constraints, shape (m,).
    - `chosen`: gives compliance and misfit of the closure; None where one solution of many for the multipliers will do.
    - `sizes`: the lengths by which slips are made lengths, shape (p,).
    - `has_sense`: whether slips can stick, so that their rates count.
    """

    system: AbstractSystem
    state: State
    gamma: Float[Array, " m"]
    chosen: Callable[[], Elasticity] | None
    sizes: Float[Array, " p"]
    has_sense: bool

    def closed(
        self, factor: AbstractFactorisation, multipliers: Float[Array, "m c"]
    ) -> tuple[Float[Array, "m c"], AbstractPick | None]:
        """Multipliers, of which the first are those of loads, as they are chosen, and by which pick."""
        if self.chosen is None:
            return multipliers, None
        compliance, misfit = self.chosen()
        pick, _ = factor.close(compliance)
        return pick.columns(multipliers, misfit), pick


def linear_of(factor: AbstractFactorisation, asked: Asked) -> Linear:
    """The equations by matrices."""
    system, state, gamma, *_ = asked
    load, rate, directions = system.load(state), state.qd[:0], jnp.zeros((state.qd.size, 0), state.qd.dtype)
    if system.friction:
        rate, directions = slip_motion(system, state)
    columns = jnp.concatenate([load[:, None], directions], axis=1)
    a, lam = factor.respond(columns, jnp.pad(gamma[:, None], ((0, 0), (0, rate.size))))
    lam, _ = asked.closed(factor, lam)
    slip, drift = directions.T @ a, -slip_gamma(system, state) if asked.has_sense else jnp.zeros_like(rate)
    response = LinearResponse(Response(a[:, 0], lam[:, 0]), Response(a[:, 1:], lam[:, 1:]))
    return Linear(response, load, directions, rate, slip[:, 0] + drift, slip[:, 1:], drift)


def linear_maps_of(factor: AbstractFactorisation, asked: Asked, stress: Gram) -> LinearMaps:
    """The same by maps, of a factorisation that rests on B M^-1 B^T."""
    system, state, gamma, *_ = asked
    load = system.load(state)
    a, lam = factor.respond(load[:, None], gamma[:, None])
    lam, pick = asked.closed(factor, lam)
    unit, unclosed = (FrictionResponse(system, state, factor, choice) for choice in (pick, None))
    slip = unit.slips(a[:, 0])
    if asked.has_sense:
        slip = slip - slip_gamma(system, state)
    response = LinearResponse(Response(a[:, 0], lam[:, 0]), unit)
    mobility = _free_mobility(unit, asked.sizes, stress)
    return LinearMaps(response, load, unit.forces, slip_rate(system, state), slip, unclosed.yields, mobility)


def _free_mobility(unit: FrictionResponse, sizes: Float[Array, " p"], stress: Gram) -> Float[Array, ""]:
    """A size of A, as lengths, of bodies without constraints."""
    some = sizes * _several(sizes)
    free = stress.rows.accelerations((unit.forces @ some)[:, None])[:, 0]
    return jnp.linalg.norm(sizes * unit.slips(free)) / jnp.linalg.norm(some)


def _several(like: Float[Array, " p"]) -> Float[Array, " p"]:
    """Numbers up to 1 of both signs, which nothing that they cause cancels."""
    return jnp.cos(jnp.arange(like.size, dtype=like.dtype) ** 2)


def least_friction(
    yields: Float[Array, "p p"], stick: Bool[Array, " p"], sizes: Float[Array, " p"]
) -> Float[Array, "p p"]:
    """From slip accelerations of joints that stick to the least friction that causes them."""
    scale = xp.where(stick, 1 / xp.sqrt(yielding(yields, sizes)), 0.0)
    matrix, one = scale[:, None] * yields * scale, xp.eye(stick.size, dtype=scale.dtype)
    inverse = xp.linalg.pinv(matrix, rtol=max(_DEPENDENT, 100 * float(xp.finfo(one.dtype).eps)), hermitian=True)
    weight = (scale / sizes) ** 2
    weight = xp.where(scale > 0, weight / xp.max(weight, initial=xp.finfo(one.dtype).tiny), 1.0)
    idle = one - inverse @ matrix  # what slips do not see
    least = inverse - xp.linalg.solve(idle * weight @ idle + one - idle, idle * weight @ inverse)
    return scale[:, None] * least * scale


def yielding(yields: Float[Array, "p p"], sizes: Float[Array, " p"]) -> Float[Array, " p"]:
    """Slip acceleration of each joint by its own unit friction; infinite where constraints leave it no slip."""
    own = xp.diagonal(yields)
    size = own * sizes**2
    blocked = size <= 10 * xp.finfo(own.dtype).eps * xp.max(size)
    return xp.where(blocked, xp.inf, xp.where(blocked, 1.0, own))


def _scaled(scale: Float[Array, " p"], yields: LinearMap, force: Float[Array, " p"]) -> Float[Array, " p"]:
    return scale * (yields @ (scale * force))


def _least_friction(
    scale: Float[Array, " p"], yields: LinearMap, mobility: Array, rounding: ArrayLike, change: Float[Array, " p"]
) -> Float[Array, " p"]:
    return scale * least_solution(LinearMap(_scaled, (scale, yields)), scale * change, mobility, rounding)


def _passed(stick: Bool[Array, " p"], inverse: LinearMap, yields: LinearMap, tau: Array) -> Float[Array, " p"]:
    """Friction of joints that slip, and what holds the others against it."""
    tau = jnp.where(stick, 0.0, tau)
    return tau - jax.lax.cond(jnp.any(stick), lambda: inverse @ (yields @ tau), lambda: jnp.zeros_like(tau))
