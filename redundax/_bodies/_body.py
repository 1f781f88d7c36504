"""Planar rigid bodies."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._tools._module import as_float, is_concrete

GROUND = "ground"


class Body(eqx.Module):
    """A planar rigid body with its local frame at the centre of mass, Eq. (1).

    ??? example

        ```python
        rx.Body("lever", mass=2.0, inertia=0.03)
        ```

    **Arguments:**

    - `name`: any word but "ground".
    - `mass`: kg.
    - `inertia`: moment of inertia about the centre of mass, kg m^2.
    """

    name: str = eqx.field(static=True)
    mass: Float[Array, ""] = eqx.field(converter=as_float)
    inertia: Float[Array, ""] = eqx.field(converter=as_float)

    def __check_init__(self) -> None:
        for name, value in (("mass", self.mass), ("inertia", self.inertia)):
            if value.shape != ():
                raise ValueError(
                    f"Argument `{name}` of body '{self.name}' must be a number, but has shape {value.shape}. "
                    "Make one `Body` for each."
                )
            if is_concrete(value) and not np.asarray(value) >= 0:
                raise ValueError(
                    f"Argument `{name}` of '{self.name}' must not be negative, but is {float(value)}. Zero is allowed "
                    "where the constraints leave the coordinate no freedom of its own, condition (14)."
                )


class Pose(eqx.Module):
    """Position (2,) and angle of a body's local frame in the global frame, of one body or stacked.

    `axes`, of shape (2,) each, are those of the frame, where they are known already; constraints and slips are given
    poses with axes, loads without. To turn a pose make a new one: axes do not follow the angle.

    ??? example

        ```python
        pose = rx.Pose(jnp.array([1.0, 0.0]), jnp.array(jnp.pi / 2))
        pose.point(jnp.array([0.5, 0.0]))  # [1.0, 0.5]
        ```
    """

    r: Float[Array, "*bodies 2"]
    phi: Float[Array, "*bodies"]
    axes: tuple[Float[Array, "*bodies 2"], Float[Array, "*bodies 2"]] | None = None

    def __getitem__(self, body: Int[Array, "*some"] | int) -> "Pose":
        """Poses of some bodies out of stacked ones."""
        return jax.tree.map(lambda x: x[body], self)

    def point(self, s: Float[Array, "2"]) -> Float[Array, "2"]:
        """Global position of the point s of the local frame: r + R s."""
        return self.r + self.rotate(s)

    def rotate(self, v: Float[Array, "2"]) -> Float[Array, "2"]:
        """Global components of the local vector v: R v, Eq. (54)."""
        along, across = _axes(self.phi) if self.axes is None else self.axes
        return along * v[0] + across * v[1]

    def with_axes(self) -> "Pose":
        """The same with its axes, computed once for all that reads them."""
        return Pose(self.r, self.phi, _axes(self.phi))


@jax.custom_jvp
def _axes(phi: Float[Array, "*bodies"]) -> tuple[Float[Array, "*bodies 2"], Float[Array, "*bodies 2"]]:
    """The axes of frames in the global frame, the columns of R."""
    along = jnp.stack([jnp.cos(phi), jnp.sin(phi)], axis=-1)
    # A product is computed once. Without it XLA computes sines anew for every entry that reads them.
    both = jnp.matmul(along, jnp.array([[1, 0, 0, 1], [0, 1, -1, 0]], along.dtype), precision="highest")
    return both[..., :2], both[..., 2:]


@_axes.defjvp
def _axes_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    along, across = _axes(*primals)  # each turns into the other: no sines in derivatives of any order
    rate = tangents[0][..., None]
    return (along, across), (rate * across, -rate * along)


def perpendicular(v: Float[np.ndarray | Array, "2"]) -> Float[Array, "2"]:
    """v turned by +90 degrees."""
    return jnp.stack([-v[1], v[0]])


def poses(values: Array) -> Pose:
    """Poses of all bodies and of the ground, stacked, from coordinates in the order of Eq. (1)."""
    count = values.shape[0] // 3
    r = jnp.concatenate([values[: 2 * count].reshape(count, 2), jnp.zeros((1, 2), values.dtype)])
    return Pose(r, jnp.concatenate([values[2 * count :], jnp.zeros(1, values.dtype)]))
