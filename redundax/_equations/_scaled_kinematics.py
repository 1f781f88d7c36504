"""What the constraints say of a state, in scaled variables: K = D^-1 Phi_q S, D^-1 gamma, and how far Phi is from 0."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from ._evidence import ScaledMotion
from ._kinematics import AlongMotion, second_order
from ._scaling import Scaling, scaling


class ScaledKinematics(NamedTuple):
    """K and Phi_q; the largest |Phi| relative to the size of the mechanism; the scales; gamma, and its part -Phi_tt."""

    scaled: Float[Array, "m n"]
    jacobian: Float[Array, "m n"]
    position: Float[Array, ""]
    scales: Scaling
    motion: AlongMotion
    explicit: Float[Array, " m"]

    def moving(self, state: State, acceleration: Float[Array, " n"], reached: Float[Array, ""]) -> ScaledMotion:
        """The motion of a state with a scaled acceleration, and the velocity that this reaches."""
        rows = self.scales.rows
        qd, rate, gamma = state.qd / self.scales.coordinates, self.motion.rate / rows, self.motion.gamma / rows
        return ScaledMotion(qd, rate, gamma, self.explicit / rows, acceleration, reached)


def scaled_kinematics(system: AbstractSystem, state: State) -> ScaledKinematics:
    """Those of a system at a state."""
    matrix = system.jacobian(state.q, state.t)
    check_shapes(system, constraint=matrix[:, 0], mass=system.mass(state.q, state.t))
    motion, explicit, turned = second_order(system, state)
    scales = scaling(system, state, matrix, turned)
    scaled = matrix * scales.coordinates / scales.rows[:, None]
    position = jnp.max(jnp.abs(motion.value) / scales.rows) / scales.size
    return ScaledKinematics(scaled, matrix, position, scales, motion, explicit)


def check_shapes(system: AbstractSystem, **given: Array) -> None:
    """Refuse what a function of a system gives in a shape that its coordinates and rows do not have."""
    n, m = len(system.coordinates), len(system.rows)
    wanted = {"constraint": (m,), "mass": (n, n), "load": (n,)}
    for name, value in given.items():
        shape = wanted[name]
        if value.shape != shape:
            raise RedundaxError(
                f"Argument `{name}` of the system must give shape {shape}, as its coordinates and rows say, but gives "
                f"{value.shape}. Change what it returns, or `coordinates` and `rows`."
            )
