"""The problems, and what is known of their motions."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

import redundax as rx

T1, GRAVITY = 10.0, 9.81


@dataclass(frozen=True)
class Problem:
    """A mechanism of parallel cranks, phi'' = -k cos phi; `index` is that of a crank angle in q."""

    name: str
    mechanism: rx.Mechanism
    index: int
    k: float
    phi: float = np.pi / 2
    rate: float = -1.0

    @property
    def state(self) -> rx.State:
        """The start."""
        return self.mechanism.state(self.phi, rate=self.rate)

    def angle(self, rate: float | None = None) -> float:
        """The crank angle at the end."""
        run = solve_ivp(
            lambda t, y: [y[1], -self.k * np.cos(y[0])],
            (0, T1),
            [self.phi, self.rate if rate is None else rate],
            method="DOP853",
            rtol=1e-13,
            atol=1e-14,
        )
        return run.y[0, -1]


def n_four_bar(loops: int) -> Problem:
    """N-four-bar with rods of 1 m and 1 kg."""
    inertia, weight = (loops + 1) / 3 + loops, GRAVITY * ((loops + 1) / 2 + loops)
    return Problem(f"{loops}-four-bar", rx.mechanisms.n_four_bar(loops), 4 * loops + 2, weight / inertia)


def three_cranks() -> Problem:
    """A coupler of 4 kg on three cranks of 0.5 m and 1 kg: k = 1."""
    inertia, weight = 3 * 0.5**2 / 3 + 4 * 0.5**2, GRAVITY * 0.5 * (3 / 2 + 4)
    return Problem("three cranks, k = 1", rx.mechanisms.parallelogram(3), 8, weight / inertia)
