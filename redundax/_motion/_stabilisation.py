"""Stabilisation: how a motion is kept on the constraint manifold.

    none       Phi_q qdd = gamma                                                            (4), (5)
    Baumgarte  Phi_q qdd = gamma - 2 alpha (Phi_q qd + Phi_t) - beta^2 Phi
    projection min |dq|_M with Phi(q + dq, t) = 0,   min |dqd|_M with Phi_q (qd + dqd) + Phi_t = 0

(7) alone holds the second derivative of the constraints, so that errors of position grow linearly with time.
Projection leaves nothing of them: after each step it changes position, then velocity, by what is least in the norm of
the mass matrix, so that it does no work along the motion and the drift stays at rounding. Of rows of velocity Phi is
zero, so that the term of alpha alone acts on them.
"""

import abc
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from .._equations._kinematics import AlongMotion
from .._tools._module import check_kind, figure
from .._tools._value import AbstractModule


class AbstractStabilisation(AbstractModule):
    """What is done against the drift: inside the equations, and after each step."""

    projects: eqx.AbstractClassVar[bool]

    @abc.abstractmethod
    def gamma(self, motion: AlongMotion) -> Float[Array, " m"]:
        """Right-hand side of Phi_q qdd = gamma."""


class NoStabilisation(AbstractStabilisation):
    """Nothing is done: the drift of the plain equations (7).

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        motion = rx.simulate(smooth, smooth.state(phi=0.8, rate=1.0), 0.1, stabilisation=rx.NoStabilisation())
        motion.stats.position_violation
        ```
    """

    projects: ClassVar[bool] = False

    def gamma(self, motion: AlongMotion) -> Array:
        return motion.gamma


class Baumgarte(AbstractStabilisation):
    """Baumgarte's stabilisation, a damped oscillator for the violation, which stays about as large as errors of a step.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        motion = rx.simulate(smooth, smooth.state(phi=0.8, rate=1.0), 0.1, stabilisation=rx.Baumgarte(20.0, 20.0))
        motion.stats.position_violation
        ```

    **Arguments:**

    - `alpha`, `beta`: in 1 / time; equal ones damp critically.
    """

    projects: ClassVar[bool] = False
    alpha: Float[Array, ""] = eqx.field(converter=figure("alpha"), default=10.0)
    beta: Float[Array, ""] = eqx.field(converter=figure("beta"), default=10.0)

    def gamma(self, motion: AlongMotion) -> Array:
        return motion.gamma - 2 * self.alpha * motion.rate - self.beta**2 * motion.value


class Projection(AbstractStabilisation):
    """Projection onto positions and velocities after each accepted step; the default.

    ??? example

        ```python
        smooth = rx.mechanisms.wojtyra2020()
        motion = rx.simulate(smooth, smooth.state(phi=0.8, rate=1.0), 0.1, stabilisation=rx.Projection())
        ```
    """

    projects: ClassVar[bool] = True

    def gamma(self, motion: AlongMotion) -> Array:
        return motion.gamma


def check_stabilisation(stabilisation: object) -> None:
    """Refuse what is none."""
    advice = "Give `rx.Projection()`, `rx.Baumgarte(alpha, beta)` or `rx.NoStabilisation()`."
    check_kind("stabilisation", stabilisation, AbstractStabilisation, "a stabilisation", advice)
