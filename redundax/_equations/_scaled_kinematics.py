"""What the constraints say of a state, in scaled variables: K = D^-1 Phi_q S, D^-1 gamma, and how far Phi is from 0."""

from typing import NamedTuple

from jaxtyping import Array, Float

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._errors import RedundaxError
from .._tools._numbers import xp
from ._evidence import ScaledMotion
from ._kinematics import AlongMotion, model_at
from ._scaling import Scaling, scaling


class ScaledKinematics(NamedTuple):
    """K and Phi_q; the largest |Phi| relative to the size of the mechanism; the scales; gamma, and its part -Phi_tt."""

    scaled: Float[Array, "m n"]
    jacobian: Float[Array, "m n"]
    position: Float[Array, ""]
    scales: Scaling
    motion: AlongMotion
    explicit: Float[Array, " m"]
    mass: Float[Array, "n n"]
    load: Float[Array, " n"]

    def moving(self, state: State, acceleration: Float[Array, " n"], reached: Float[Array, ""]) -> ScaledMotion:
        """The motion of a state with a scaled acceleration, and the velocity that this reaches."""
        rows = self.scales.rows
        qd, rate, gamma = state.qd / self.scales.coordinates, self.motion.rate / rows, self.motion.gamma / rows
        return ScaledMotion(qd, rate, gamma, self.explicit / rows, acceleration, reached)


def scaled_kinematics(system: AbstractSystem, state: State) -> ScaledKinematics:
    """Those of a system at a state."""
    model = model_at(system, state)
    matrix, motion = model.jacobian, model.motion
    check_shapes(system, constraint=matrix[:, 0], mass=model.mass, load=model.load)
    scales = scaling(system, model)
    scaled = scales.scaled(matrix)
    position = xp.max(xp.abs(scales.violations(motion.value)))
    return ScaledKinematics(scaled, matrix, position, scales, motion, model.explicit, model.mass, model.load)


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
