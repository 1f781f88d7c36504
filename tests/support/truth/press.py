"""A slider crank that presses a plate by a stiff spring, and its two equations.

A crank (r, m1, J1 about its centre), a rod (l, m2, J2) and a slider (m3) move in the plane, x = r cos phi + l cos psi
with l sin psi = r sin phi. Between slider and plate (m4), both guided along x, stands a stiff spring with a damper, and
between plate and ground a soft one:

    I(phi) phi'' = -I'(phi) phi'^2 / 2 - F dx/dphi,   m4 y'' = F - K (y - y0),   F = k (x - y + d) + c (x' - y')
"""

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

import redundax as rx

R, ROD, GAP = 0.1, 0.3, 0.05
CRANK, COUPLER, SLIDER, PLATE = (5.0, 0.2), (1.0, 0.01), 2.0, 3.0  # mass, and moment of inertia about the centre
STIFFNESS, DAMPING, SOFT = 1e9, 1e5, 2e3
SPIN, PHI0 = 10.0, 0.5
REST = R + ROD + GAP


def _along(phi):
    """x, dx/dphi, dpsi/dphi and psi."""
    psi = np.arcsin(R / ROD * np.sin(phi))
    turn = R * np.cos(phi) / (ROD * np.cos(psi))
    return R * np.cos(phi) + ROD * np.cos(psi), -R * np.sin(phi) * (1 + turn), turn, psi


def inertia(phi):
    """I(phi), of complex phi too."""
    _, slope, turn, _ = _along(phi)
    (m1, j1), (m2, j2) = CRANK, COUPLER
    across, beside = -R * np.sin(phi) * (1 + turn / 2), R * np.cos(phi) / 2
    return j1 + m1 * R**2 / 4 + m2 * (across**2 + beside**2) + j2 * turn**2 + SLIDER * slope**2


def rates(_, state):
    """Of phi, y and their rates."""
    phi, y, spin, speed = state
    x, slope, *_ = _along(phi)
    force = STIFFNESS * (x - y + GAP) + DAMPING * (slope * spin - speed)
    bend = inertia(phi + 1e-30j).imag / 1e-30
    return [
        spin,
        speed,
        (-bend * spin**2 / 2 - force * slope) / inertia(phi).real,
        (force - SOFT * (y - REST)) / PLATE,
    ]


def elongated(_, state):
    """The same of phi and the elongation x - y + d, by which the force of the stiff spring loses no digits."""
    phi, longer, spin, speed = state
    x, slope, *_ = _along(phi)
    force = STIFFNESS * longer + DAMPING * speed
    bend, turning = inertia(phi + 1e-30j).imag / 1e-30, _along(phi + 1e-30j)[1].imag / 1e-30
    change = (-bend * spin**2 / 2 - force * slope) / inertia(phi).real
    plate = (force - SOFT * (x - longer + GAP - REST)) / PLATE
    return [spin, speed, change, slope * change + turning * spin**2 - plate]


def begin():
    """phi, y and their rates, where the stiff spring is at rest."""
    x, slope, *_ = _along(PHI0)
    return [PHI0, x + GAP, SPIN, slope * SPIN]


def solved(times, rtol, atol):
    """phi, y and their rates at times."""
    return solve_ivp(rates, (0, times[-1]), begin(), "Radau", times, rtol=rtol, atol=atol)


def mechanism():
    """The press, its slider in two guides in line, of which one is redundant, and where it begins."""
    (x, slope, turn, psi), zero, across = _along(PHI0), (0.0, 0.0), (0.0, 1.0)
    bodies = [
        rx.Body("crank", CRANK[0], CRANK[1]),
        rx.Body("rod", COUPLER[0], COUPLER[1]),
        rx.Body("slider", SLIDER, 0.01),
        rx.Body("plate", PLATE, 0.01),
    ]
    joints = [
        rx.Revolute("A", "crank", "ground", (-R / 2, 0.0), zero),
        rx.Revolute("B", "crank", "rod", (R / 2, 0.0), (-ROD / 2, 0.0)),
        rx.Revolute("C", "rod", "slider", (ROD / 2, 0.0), zero),
        rx.Translational("guide", "slider", "ground", zero, zero, across),
        rx.Translational("second guide", "slider", "ground", (0.02, 0.0), zero, across),
        rx.Translational("plate guide", "plate", "ground", zero, zero, across),
    ]

    def springs(i, j, t, p):
        pull = p["stiffness"] * (i.pose.r[0] - j.pose.r[0] + GAP) + p["damping"] * (i.rate.r[0] - j.rate.r[0])
        force = jnp.stack([pull, 0.0 * t])
        return i.wrench(-force, jnp.zeros(2)), j.wrench(force, jnp.zeros(2))

    def back(i, j, t, p):
        force = jnp.stack([-p["soft"] * (i.pose.r[0] - REST), 0.0 * t])
        return i.wrench(force, jnp.zeros(2)), j.wrench(0 * force, jnp.zeros(2))

    loads = [
        rx.LoadFunction("slider", springs, "plate", {"stiffness": STIFFNESS, "damping": DAMPING}),
        rx.LoadFunction("plate", back, parameters={"soft": SOFT}),
    ]
    s, c = np.sin(PHI0), np.cos(PHI0)
    places = [R / 2 * c, R / 2 * s, R * c + ROD / 2 * np.cos(psi), R / 2 * s, x, 0.0, x + GAP, 0.0]
    speeds = [-R / 2 * s, R / 2 * c, -R * s * (1 + turn / 2), R * c / 2, slope, 0.0, slope, 0.0]
    q, qd = [*places, PHI0, -psi, 0.0, 0.0], SPIN * jnp.array([*speeds, 1.0, -turn, 0.0, 0.0])
    return rx.Mechanism(bodies, joints, loads=loads, gravity=(0.0, 0.0)), rx.State(jnp.array(q), qd)
