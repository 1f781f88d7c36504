"""What Newton's open iteration (38) is given, and where it ends; symbols as in `_open_newton`."""

from jaxtyping import Array, Float, Int

from .._tools._numbers import take
from .._tools._value import AbstractModule
from ._friction_problem import FrictionProblem
from ._iterate import Progress


class OpenProblem(AbstractModule):
    """The friction problem at minimum norm, with what the minimum-norm step needs beside it.

    - `problem`: rho0 of the minimum-norm multipliers and the self-stress of x0, K of minimum-norm ones, and the law.
    - `rows`: of the multipliers that the law reads, shape (l,).
    - `projector`: P[:, rows], shape (m, l).
    - `balance`: takes from a self-stress what rounding has left of other multipliers, shape (m, m).
    - `axes`: Q, orthonormal and so that the columns of X Q are orthogonal, shape (p, p).
    - `gram`: (X Q)^T X Q, shape (p, p).
    - `pull`: (X Q)^T (x0 - x_p), shape (p,).
    - `first`: loads of x0, shape (l,).
    """

    problem: FrictionProblem
    rows: Int[Array, " l"]
    projector: Float[Array, "m l"]
    balance: Float[Array, "m m"]
    axes: Float[Array, "p p"]
    gram: Float[Array, "p p"]
    pull: Float[Array, " p"]
    first: Float[Array, " l"]

    @property
    def stress(self) -> Float[Array, "l l"]:
        """S = P[rows, rows]."""
        return take(self.projector, self.rows)


class OpenEnd(AbstractModule):
    """Friction tau, the self-stress added to that of x0, and how the iteration went."""

    tau: Float[Array, " p"]
    stress: Float[Array, " m"]
    progress: Progress
