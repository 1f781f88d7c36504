"""Pendulums with friction in their pins on a row of parallel cranks that friction holds upright, and where they stop.

Of a rod of mass 1 and inertia 1/12 that hangs by a pin at l from its centre, turned by phi,

    (1/12 + l^2) phi'' = -g l sin(phi) + tau,   tau = -mu r N sign(phi'),   N = |a + (0, g)|

with a the acceleration of its centre. While the cranks stand still each swings as if alone.
"""

import jax.numpy as jnp
import numpy as np
import racks
from jax.typing import ArrayLike
from scipy.integrate import solve_ivp

import redundax as rx

GRAVITY, RADIUS, ARM, START, UPRIGHT, MU = 9.81, 0.1, 0.25, 0.3, np.pi / 2 - 0.01, 0.3


def frictions(loops: int) -> np.ndarray:
    """Coefficients of the pendulums' pins, each another."""
    return MU * (1 + 0.5 * np.arange(loops) / loops)


def swings(loops: int, mu: ArrayLike | None = None) -> tuple[rx.Mechanism, rx.State]:
    """Loops of cranks and couplers, every third pin twice over, with a pendulum on each coupler; all starts at rest.

    Angles of the pendulums stand last in q.
    """
    bodies, pins = racks.parts(loops)
    bodies += racks.rods("p", loops)
    rubs = [rx.Coulomb(MU)] * len(pins)
    for k, each in enumerate(jnp.asarray(frictions(loops) if mu is None else mu)):
        pins.append((f"P{k}", f"p{k}", f"b{k}", (0.0, ARM), (0.0, 0.0)))
        rubs.append(rx.Coulomb(each))
    joints = [rx.Revolute(*pin, friction=rub, pin_radius=RADIUS) for pin, rub in zip(pins, rubs, strict=True)]
    along, across = np.cos(UPRIGHT), np.sin(UPRIGHT)
    cranks = [(k + along / 2, across / 2, UPRIGHT) for k in range(loops + 1)]
    couplers = [(k + along + 0.5, across, 0.0) for k in range(loops)]
    hanging = [(x + ARM * np.sin(START), y - ARM * np.cos(START), START) for x, y, _ in couplers]
    poses = np.array(cranks + couplers + hanging)
    q = np.concatenate([poses[:, :2].ravel(), poses[:, 2]])
    return rx.Mechanism(bodies, joints, gravity=(0.0, -GRAVITY)), rx.State(q, np.zeros_like(q), 0.0)


def stop(mu: float) -> tuple[float, float]:
    """When a pendulum stops first, and the angle."""

    def moves(_: float, y: np.ndarray) -> list[float]:
        phi, rate = y
        turn = 0.0
        for _ in range(60):
            a = ARM * np.array([turn * np.cos(phi) - rate**2 * np.sin(phi), turn * np.sin(phi) + rate**2 * np.cos(phi)])
            pull = np.hypot(a[0], a[1] + GRAVITY)
            turn = (-GRAVITY * ARM * np.sin(phi) + mu * RADIUS * pull) / (1 / 12 + ARM**2)
        return [rate, turn]

    def stands(t: float, y: np.ndarray) -> float:
        return y[1] if t > 0.1 else -1.0

    stands.terminal = True
    run = solve_ivp(moves, (0, 2), [START, 0.0], method="DOP853", rtol=1e-12, atol=1e-14, events=stands)
    return run.t_events[0][0], run.y_events[0][0][0]
