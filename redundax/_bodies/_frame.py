"""What the pose of a body is, in the plane or in space: what a mechanism must know of it, and nothing else does.

A frame has no numbers: it is a strategy that compiled programs are keyed on. Velocities of all bodies are the linear
ones of each, then the angular ones of each, Eqs. (1), (60).
"""

import abc
from collections.abc import Sequence
from typing import ClassVar, Generic, Self, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from .._system._axis import Axis
from .._system._state import State
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, check_word, finite
from .._tools._value import AbstractModule
from ._figures import check_figures


class AbstractPose(AbstractModule):
    """Where the local frame of a body is in the global frame, of one body or stacked, in the plane or in space."""

    r: eqx.AbstractVar[Float[Array, "*bodies axes"]]

    def __getitem__(self, body: Int[Array, "*some"] | int) -> Self:
        """Poses of some bodies out of stacked ones."""
        return jax.tree.map(lambda x: x[body], self)

    @abc.abstractmethod
    def point(self, s: Float[Array, " axes"]) -> Float[Array, " axes"]:
        """Global position of the point s of the local frame: r + R s."""

    @abc.abstractmethod
    def rotate(self, v: Float[Array, " axes"]) -> Float[Array, " axes"]:
        """Global components of the local vector v: R v."""

    @abc.abstractmethod
    def local(self, x: Float[Array, " axes"]) -> Float[Array, " axes"]:
        """Position in the local frame of the global point x: R^T (x - r)."""

    @abc.abstractmethod
    def unit_rates(self) -> Self:
        """Rates of a pose by each of the velocities of its body, stacked."""


class AbstractBody(AbstractModule):
    """A rigid body of a mechanism; `frame` says what its pose is."""

    name: eqx.AbstractVar[str]
    mass: eqx.AbstractVar[Float[Array, ""]]
    inertia: eqx.AbstractVar[Float[Array, "*axes"]]

    def __check_init__(self) -> None:
        check_word("name", self.name)
        check_figures(self, f"body '{self.name}'", ())

    @property
    @abc.abstractmethod
    def frame(self) -> "AbstractFrame":
        """What its pose is."""


B = TypeVar("B", bound=AbstractBody)
P = TypeVar("P", bound=AbstractPose)
M = TypeVar("M")


class AbstractFrame(AbstractModule, Generic[B, P, M]):
    """Poses, mass and generalised forces of the bodies of a mechanism, stacked, from its coordinates: of bodies B whose
    poses are P, and motions M.

    - `word`: "planar" or "spatial".
    - `linear`, `angular`: names of the velocities of a body.
    - `reaction`: names of the parts of a joint's reaction, with their kinds.
    """

    word: ClassVar[str]
    linear: ClassVar[tuple[str, ...]]
    angular: ClassVar[tuple[str, ...]]
    reaction: ClassVar[tuple[tuple[str, str], ...]]

    @property
    def size(self) -> int:
        """Velocities of a body."""
        return len(self.linear) + len(self.angular)

    def coordinates(self, bodies: Sequence[str]) -> Axis:
        """Names and kinds of the velocities of these bodies."""
        parts = (("linear", self.linear), ("angular", self.angular))
        names = [f"{body}.{axis}" for _, axes in parts for body in bodies for axis in axes]
        return Axis(tuple(names), tuple(kind for kind, axes in parts for _ in bodies for _ in axes))

    def centre_names(self, bodies: Sequence[str]) -> Axis:
        """Names of the positions of centres of mass, which come first in q, where q has no names of its own."""
        names = () if self.adds else tuple(f"{body}.{axis}" for body in bodies for axis in self.linear)
        return Axis(names, ("linear",) * len(names))

    def columns(self, body: int, count: int) -> np.ndarray:
        """Where the velocities of a body are among those of `count` bodies."""
        linear, angular = len(self.linear), len(self.angular)
        return np.r_[body * linear + np.arange(linear), count * linear + body * angular + np.arange(angular)]

    def by_velocities(self, slopes: Float[Array, "values s bodies"]) -> Float[Array, "values n"]:
        """Slopes by the velocities of each body in their order among those of all."""
        parts = jnp.split(jnp.swapaxes(slopes, 1, 2), [len(self.linear)], axis=2)
        return jnp.concatenate([part.reshape(len(slopes), -1) for part in parts], axis=1)

    def vector(self, argument: str, value: Numbers | None, owner: str = "") -> Float[Array, " axes"]:
        """A vector in global components, zero where none is given; `owner` is the part that it belongs to."""
        array = as_float(np.zeros(len(self.linear)) if value is None else value, argument)
        if array.shape != (len(self.linear),):
            raise RedundaxError(
                f"Argument `{argument}`{owner and f' of {owner}'} must have {len(self.linear)} components in a "
                f"{self.word} mechanism, but has shape {array.shape}. Give ({', '.join(self.linear)})."
            )
        if owner:  # gravity that is NaN gives results that say so
            finite(argument, array, owner)
        return array

    def of(self, bodies: Sequence[B]) -> Self:
        """The frame of these bodies, as it is where their inertia allows."""
        return self

    def alike(self, bodies: Sequence[B]) -> Sequence[B]:
        """The bodies with arrays of the same shapes."""
        return bodies

    @property
    @abc.abstractmethod
    def adds(self) -> bool:
        """Whether positions are numbers whose rates are the velocities."""

    @property
    @abc.abstractmethod
    def diagonal_mass(self) -> bool:
        """Whether the mass matrix is known to be diagonal."""

    @abc.abstractmethod
    def centres(self, body: B) -> Float[Array, "bodies axes"] | None:
        """Centres of mass in the local frames; None where these are their origins."""

    @abc.abstractmethod
    def check(self, q: Float[Array, "..."], n: int) -> None:
        """Refuse a position that is not one of bodies with n velocities."""

    @abc.abstractmethod
    def poses(self, centres: PyTree, q: Float[Array, "..."]) -> P:
        """Poses of all bodies and of the ground, which is last, stacked."""

    def path(self, centres: PyTree, q: Float[Array, "..."], rate: Float[Array, " n"]) -> tuple[Array, P] | None:
        """q', and stacked poses of all bodies with their rates and the rates of these along q [+] s rate, where they
        have a form of their own."""
        return None

    @abc.abstractmethod
    def motions(self, body: B, state: State) -> M:
        """The same with their rates, as loads are given them."""

    @abc.abstractmethod
    def retract(self, q: Float[Array, "..."], d: Float[Array, " n"]) -> Float[Array, "..."]:
        """q [+] d."""

    def displacement(self, base: Float[Array, "..."], q: Float[Array, "..."]) -> tuple[Array, Array] | None:
        """d with base [+] d nearest to q, and whether there is one, where it has a form of its own."""
        return None

    @abc.abstractmethod
    def reference(self, body: B) -> Float[Array, "..."]:
        """The position q of bodies at their reference poses."""

    @abc.abstractmethod
    def velocity(self, q: Float[Array, "..."], rate: Float[Array, "..."]) -> Float[Array, " n"]:
        """The velocity at which positions have a rate."""

    @abc.abstractmethod
    def mass(self, body: B) -> Float[Array, "n n"]:
        """Mass matrix, which is constant."""

    @abc.abstractmethod
    def masses(self, body: B) -> Float[Array, "bodies v v"]:
        """That of each body."""

    @abc.abstractmethod
    def load(self, body: B, motion: M, force: Array, moment: Array) -> Float[Array, " n"]:
        """Generalised force of forces and moments about the origins of all bodies and of the ground, global
        components, and of the inertia that depends on the velocity."""

    @abc.abstractmethod
    def reactions(self, pose: P, by_row: Float[Array, "v rows"], point: Array) -> tuple[Array, Array, Array]:
        """Force and moment about a point of a body, both global and of one row each, from generalised forces on it;
        and the arm of the force."""

    @abc.abstractmethod
    def along(self, axes: Array, force: Float[Array, "v rows"], moment: Array) -> Array:
        """Components of forces and of moments along axes, the columns, one after the other."""
