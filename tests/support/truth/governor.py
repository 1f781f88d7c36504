"""Stiff flyball governor, problem A05 of the multibody benchmark library, by three freedoms.

Both rods stand alike, at the angle a below the horizontal, and the slider at the height s. The spin w about the
vertical keeps H = I(a) w, and the springs of the length d(a, s) pull by F = k (d - d0) + c d':

    J a'' = I'(a) w^2 / 4 + G cos a - F d_a,   S s'' = -S g - 2 F d_s

with J and G g those of one rod with its ball about its pin.
"""

import numpy as np
from scipy.integrate import solve_ivp

L, WIDTH, CUBE, DENSITY, BALL, GRAVITY = 1.0, 0.01, 0.1, 3000.0, 5.0, 9.81
STIFFNESS, DAMPING, FREE_LENGTH, ANGLE, SPIN = 8e5, 4e4, 0.5, np.pi / 6, 2 * np.pi
_ROD, _SLIDER = DENSITY * L * WIDTH**2, DENSITY * CUBE**3
_ALONG, _ACROSS = _ROD * WIDTH**2 / 6, _ROD * (L**2 + WIDTH**2) / 12
_SWING = _ACROSS + _ROD * L**2 / 4 + BALL * L**2
_WEIGHT = GRAVITY * (_ROD / 2 + BALL) * L


def spin_inertia(a: float) -> tuple[float, float]:
    """I and I' of all bodies about the vertical."""
    c, s, value, slope = np.cos(a), np.sin(a), _ALONG + _SLIDER * CUBE**2 / 6, 0.0
    for mass, x in ((_ROD, L / 2), (BALL, L)):
        reach = CUBE / 2 + x * c
        value, slope = value + 2 * mass * reach**2, slope - 4 * mass * reach * x * s
    value += 2 * (_ALONG * s**2 + _ACROSS * c**2)
    return value, slope + 4 * (_ALONG - _ACROSS) * s * c


def accelerations(a: float, s: float, rate_a: float, rate_s: float, spin: float) -> tuple[float, float, float]:
    """a'', s'' and w'."""
    out, down = L / 2 * np.cos(a), L - L / 2 * np.sin(a) - s
    length = np.hypot(out, down)
    by_a, by_s = -L / 2 * (out * np.sin(a) + down * np.cos(a)) / length, -down / length
    pull = STIFFNESS * (length - FREE_LENGTH) + DAMPING * (by_a * rate_a + by_s * rate_s)
    inertia, slope = spin_inertia(a)
    swing = (slope * spin**2 / 4 + _WEIGHT * np.cos(a) - pull * by_a) / _SWING
    return swing, -GRAVITY - 2 * pull * by_s / _SLIDER, -slope * rate_a * spin / inertia


def released(times: np.ndarray) -> np.ndarray:
    """a, s, their rates and w, (5, times), from rods at rest beside a turning shaft."""
    return solve_ivp(
        lambda _, y: [y[2], y[3], *accelerations(*y)],
        (0, times[-1]),
        [ANGLE, L / 2, 0.0, 0.0, SPIN],
        "Radau",
        times,
        rtol=1e-10,
        atol=1e-12,
    ).y
