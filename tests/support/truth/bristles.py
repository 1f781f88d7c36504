"""A block in a guide, pulled by a spring whose end moves at a constant speed, on LuGre's bristles; and its equations.

m x'' = k (s t - x) + tau,   tau = -(m g + preload) (stiffness z + damping z' + viscous x')
"""

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import redundax as rx

MASS, GRAVITY, SPRING, SPEED = 2.0, 10.0, 50.0, 0.05
LUGRE = {
    "static": 0.3,
    "kinetic": 0.2,
    "velocity": 0.01,
    "stiffness": 1e3,
    "damping": 5.0,
    "viscous": 0.4,
    "preload": 5,
}


def pulling(i, j, t, p):
    """The spring."""
    force = jnp.stack([p["spring"] * (p["speed"] * t - i.pose.r[0]), 0.0 * t])
    return i.wrench(force, jnp.zeros(2)), j.wrench(0 * force, jnp.zeros(2))


def block(friction):
    """The block, and its start at rest."""
    body = rx.Body("block", MASS, 0.1)
    guide = rx.Translational(
        "guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), friction=friction, guide_length=0.1
    )
    load = rx.LoadFunction("block", pulling, parameters={"spring": SPRING, "speed": SPEED})
    return rx.Mechanism([body], [guide], loads=[load], gravity=(0.0, -GRAVITY)), rx.State(jnp.zeros(3), jnp.zeros(3))


def bristles(v, z, static, kinetic, velocity, stiffness, damping, viscous, preload):
    """z' and the friction."""
    rate = v - stiffness * np.abs(v) * z / (kinetic + (static - kinetic) * np.exp(-((v / velocity) ** 2)))
    return rate, -(MASS * GRAVITY + preload) * (stiffness * z + damping * rate + viscous * v)


def rates(t, state, values):
    """Of x, v and z."""
    x, v, z = state
    rate, tau = bristles(v, z, **values)
    return [v, (SPRING * (SPEED * t - x) + tau) / MASS, rate]


def pulled(times, **values):
    """x, v and z of the block, and the friction."""
    y = solve_ivp(rates, (0, times[-1]), [0, 0, 0], "Radau", times, args=(values,), rtol=1e-10, atol=1e-13).y
    return *y, bristles(y[1], y[2], **values)[1]
