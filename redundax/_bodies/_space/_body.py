"""Rigid bodies in space."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers, as_float, is_concrete, on_device
from ..._tools._words import warn
from .._body import check_amount
from .._frame import AbstractFrame
from ._frame import SPACE, AbstractSpatialBody
from ._rotation import as_quaternion


class Body(AbstractSpatialBody):
    """A rigid body in space.

    ??? example

        ```python
        rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))  # hung along the z axis
        ```

    **Arguments:**

    - `name`: any word but "ground".
    - `mass`: kg.
    - `inertia`: about the centre of mass in the axes of the local frame, kg m^2: principal values (3,), where these are
      principal axes, or a matrix (3, 3), products of inertia with the sign of that matrix.
    - `centre`: centre of mass in the local frame, m.
    - `position`: where the origin of the local frame is at the reference pose, m, global components.
    - `orientation`: axes of the local frame at the reference pose: a quaternion (w, x, y, z), or a rotation matrix
      (3, 3) whose columns are the axes.

    Joints given by a global point and axis are those of the reference pose, from which `rx.assemble` starts.
    """

    name: str = eqx.field(static=True)
    mass: Float[Array, ""]
    inertia: Float[Array, "3"] | Float[Array, "3 3"]
    centre: Float[Array, "3"]
    position: Float[Array, "3"]
    orientation: Float[Array, "4"]

    def __init__(
        self,
        name: str,
        mass: Numbers,
        inertia: Numbers,
        *,
        centre: Numbers = (0.0, 0.0, 0.0),
        position: Numbers = (0.0, 0.0, 0.0),
        orientation: Numbers = (1.0, 0.0, 0.0, 0.0),
    ):
        self.name, self.mass, self.inertia = name, as_float(mass, "mass"), as_float(inertia, "inertia")
        self.centre, self.position = (
            SPACE.vector(argument, value, f"body '{name}'")
            for argument, value in (("centre", centre), ("position", position))
        )
        self.orientation = on_device(as_quaternion("orientation", orientation))
        check_amount("mass", name, self.mass)
        _check_inertia(name, self.inertia)

    @property
    def frame(self) -> AbstractFrame:
        return SPACE

    @property
    def inertia_matrix(self) -> Float[Array, "3 3"]:
        return self.inertia if self.inertia.ndim == 2 else jnp.diag(self.inertia)


def _check_inertia(name: str, inertia: Array) -> None:
    if inertia.shape not in ((3,), (3, 3)):
        raise RedundaxError(
            f"Argument `inertia` of body '{name}' must be principal values (3,) or a matrix (3, 3), but has shape "
            f"{inertia.shape}. Give three numbers about the centre of mass."
        )
    if not is_concrete(inertia) or not np.all(np.isfinite(inertia)):
        return
    value = np.asarray(inertia)
    if value.ndim == 2 and np.abs(value - value.T).max() > 1e-9 * np.abs(value).max():
        raise RedundaxError(
            f"Argument `inertia` of body '{name}' must be symmetric, but is {value.tolist()}. Give products of inertia "
            "twice, with one sign."
        )
    principal = np.sort(np.linalg.eigvalsh(value) if value.ndim == 2 else value)
    if principal[0] < -1e-9 * abs(principal[2]):
        raise RedundaxError(
            f"Argument `inertia` of body '{name}' must have no negative principal value, but has {principal.tolist()}."
            " Was it taken about the centre of mass?"
        )
    if principal[0] + principal[1] < (1 - 1e-3) * principal[2]:
        warn(
            f"Argument `inertia` of body '{name}' has principal values {principal.tolist()}, one larger than the sum "
            "of the others, as no body has. Was it taken about the centre of mass?"
        )
