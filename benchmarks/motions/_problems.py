"""The problems, and what is known of their motions."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import spaces
from scipy.integrate import solve_ivp
from truth import bricard, four_bar, governor, squeezer

import redundax as rx

T1, GRAVITY = 10.0, 9.81


@dataclass(frozen=True)
class Problem:
    """A motion up to `t1` with the error of the position at its end; `loops` of N-four-bar, for the peers."""

    name: str
    mechanism: rx.Mechanism
    state: rx.State
    error: Callable[[np.ndarray], float]
    t1: float = T1
    loops: int = 0


@dataclass(frozen=True)
class SpatialProblem(Problem):
    """A motion in space, at whose end a body has the origin of its local frame at `end`."""

    body: int = 0
    end: tuple[float, ...] = ()


def crank_angle(k: float, phi: float, rate: float, t1: float = T1) -> float:
    """The angle of parallel cranks after t1, phi'' = -k cos phi."""
    run = solve_ivp(
        lambda t, y: [y[1], -k * np.cos(y[0])], (0, t1), [phi, rate], method="DOP853", rtol=1e-13, atol=1e-14
    )
    return run.y[0, -1]


def stiffness(loops: int) -> float:
    """k of N-four-bar with rods of 1 m and 1 kg."""
    return GRAVITY * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)


def crank(loops: int) -> int:
    """Where the angle of its first crank stands in q."""
    return 4 * loops + 2


def n_four_bar(loops: int) -> Problem:
    """N-four-bar with rods of 1 m and 1 kg."""
    mechanism = rx.mechanisms.n_four_bar(loops)
    angle = crank_angle(stiffness(loops), np.pi / 2, -1.0)
    return Problem(
        f"{loops}-four-bar",
        mechanism,
        mechanism.state(np.pi / 2, rate=-1.0),
        lambda q: abs(q[crank(loops)] - angle),
        loops=loops,
    )


def three_cranks() -> Problem:
    """A coupler of 4 kg on three cranks of 0.5 m and 1 kg: k = 1 redundant constraint."""
    inertia, weight = 3 * 0.5**2 / 3 + 4 * 0.5**2, GRAVITY * 0.5 * (3 / 2 + 4)
    angle = crank_angle(weight / inertia, np.pi / 2, -1.0)
    mechanism = rx.mechanisms.parallelogram(3)
    return Problem("three cranks, k = 1", mechanism, mechanism.state(np.pi / 2, rate=-1.0), lambda q: abs(q[8] - angle))


def papers(mu_rho: float | None = None) -> Problem:
    """The paper's mechanism from phi = pi/4; with friction it comes to rest. No truth is known."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    name = "the paper's" + (", to rest" if mu_rho else "")
    return Problem(name, mechanism, mechanism.state(phi=jnp.pi / 4, rate=1.0), lambda q: np.nan)


def rubbing() -> tuple[Problem, Problem]:
    """A four-bar whose dry pins stop and turn round five times in 1 s, in the plane and built in space."""
    (bodies, joints), gravity = spaces.rods(rx.Coulomb(0.2)), np.array([0.0, -GRAVITY])
    planar = rx.Mechanism(bodies, joints, gravity=gravity)
    state = spaces.swinging(planar)
    there = rx.State(spaces.position_in_space(state.q), spaces.velocity_in_space(state.qd))
    ends = [
        ("rubbing four-bar, 1 s", planar, state),
        ("the same in space", spaces.lifted(bodies, joints, gravity), there),
    ]
    first, second = (Problem(*end, lambda q: np.nan, 1.0) for end in ends)
    return first, second


def andrews() -> Problem:
    """Andrews' squeezer, with the published position after 0.03 s."""

    def error(q: np.ndarray) -> float:
        return float(np.max(np.abs(squeezer.relative_angles(q) / squeezer.PUBLISHED - 1)))

    return Problem("squeezer, 0.03 s", squeezer.mechanism(), squeezer.start(), error, squeezer.T1)


def a04() -> SpatialProblem:
    """Bricard's mechanism in space, problem A04 of the multibody benchmark library: n = m = 30, rank 29."""
    mechanism = rx.mechanisms.bricard()
    third = bricard.released(np.array([T1]))[0, 1]
    return _in_space("A04, Bricard in space", mechanism, rx.assemble(mechanism), 2, third)


def four_bar_in_space() -> SpatialProblem:
    """A planar four-bar of four spatial hinges in a plane that leans, its crank at 1 rad/s: n = 18, m = 20, rank 17."""
    mechanism = spaces.four_bar()
    x, y = four_bar.turned(np.array([T1]))[0]
    state = rx.assemble(mechanism, rates={"A.angle": 1.0})
    return _in_space("four-bar in space", mechanism, state, 2, np.array([x, 0.8 * y, 0.6 * y]))


def a05() -> SpatialProblem:
    """Stiff flyball governor, problem A05 of the multibody benchmark library: n = 24, m = 20, four freedoms."""
    mechanism = rx.mechanisms.governor()
    rest = dict.fromkeys(("pin 1.angle", "pin 2.angle", "sleeve.travel"), 0.0)
    state = rx.assemble(mechanism, rates={"axis.angle": governor.SPIN, **rest})
    height = governor.released(np.array([T1]))[1, 0]
    return _in_space("A05, stiff governor", mechanism, state, 1, np.array([0, 0, height]))


def _in_space(
    name: str,
    mechanism: rx.Mechanism,
    state: rx.State,
    body: int,
    end: np.ndarray,
) -> SpatialProblem:
    def error(q: np.ndarray) -> float:
        return float(np.abs(mechanism.poses(jnp.asarray(q)).r[body] - end).max())

    return SpatialProblem(name, mechanism, state, error, body=body, end=tuple(end))
