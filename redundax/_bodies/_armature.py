"""Armature: rotors of drives, which turn or travel with coordinates c of joints alone, or with the spin of a ball

    T = a c'^2 / 2,   M += J^T a J,   Q -= J^T a (J' v)

with c' = J v: the drive feels a c'', the bodies its opposite as a pair of forces or moments along the coordinate.
"""

from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._system._names import Names, index_of
from .._tools._errors import RedundaxError
from .._tools._module import Numbers, as_float, is_concrete, numpy_of, on_device
from .._tools._value import AbstractModule
from ._coordinate import SPIN, Coordinate, Place
from ._frame import AbstractFrame, AbstractPose
from ._stack import Stack, indices


class Armature(AbstractModule):
    """That of one coordinate of joints of one kind, and columns of both bodies, beyond the last those of the ground.

    Of each of the three rates of a ball joint by itself.
    """

    coordinate: Coordinate
    inertia: Float[Array, " size"]
    columns: Int[Array, "size columns"]

    def words(self, names: Names, joints: Sequence[Stack]) -> list[str]:
        """Names of the coordinates with their inertia."""
        stack, column = joints[self.coordinate.kind], self.coordinate.column
        what, kind = ("", "angular") if column == SPIN else stack.element.coordinate_kinds[column]
        unit = names.units.of("inertia" if kind == "angular" else "mass")
        own = [names.joints[self.coordinate.kind][k] for k in np.asarray(self.coordinate.members)]
        values = np.asarray(self.inertia).reshape(len(own), -1)[:, 0]
        return [
            f"{name}{'.' if what else ''}{what} {value:.4g} {unit}".strip()
            for name, value in zip(own, values, strict=True)
        ]

    def slopes(self, joints: Sequence[Stack], bodies: AbstractPose, n: int) -> Float[Array, "size n"]:
        """J, by n velocities."""
        slopes = self.coordinate.slopes(joints, bodies)
        rows = jnp.arange(slopes.shape[0])[:, None]
        return jnp.zeros((slopes.shape[0], n), slopes.dtype).at[rows, self.columns].add(slopes, mode="drop")


def armature_mass(
    parts: Sequence[Armature], joints: Sequence[Stack], bodies: AbstractPose, n: int
) -> Float[Array, "n n"]:
    """J^T a J at the poses of the bodies."""
    mass = jnp.zeros((n, n), parts[0].inertia.dtype)
    for each in parts:
        slopes = each.slopes(joints, bodies, n)
        mass = mass + slopes.T @ (each.inertia[:, None] * slopes)
    return mass


def armature_load(
    parts: Sequence[Armature], joints: Sequence[Stack], along: Callable[[Array], AbstractPose], v: Float[Array, " n"]
) -> Float[Array, " n"]:
    """J^T a (J' v), given the poses of the bodies after a time along v."""

    def slopes(s: Array) -> list[Array]:
        return [each.slopes(joints, along(s), v.size) for each in parts]

    now, change = jax.jvp(slopes, (jnp.zeros_like(v[0]),), (jnp.ones_like(v[0]),))
    load = jnp.zeros_like(v)
    for each, own, rate in zip(parts, now, change, strict=True):
        load = load + own.T @ (each.inertia * (rate @ v))
    return load


def armatures(
    given: Mapping[str, Numbers] | None,
    places: dict[str, Place],
    joints: Sequence[Stack],
    frame: AbstractFrame,
    count: int,
) -> tuple[Armature, ...]:
    """The armature by names of coordinates or ball joints, of a mechanism of `count` bodies."""
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        raise RedundaxError(
            f"Argument `armature` must give inertia by the name of a joint coordinate, but is {given!r}. Write "
            '{"hinge.angle": 0.02}, say.'
        )
    alike: dict[tuple[int, int], list[tuple[int, Array]]] = {}
    for name, value in given.items():
        index_of("armature", name, list(places), " of joint coordinates or ball joints")
        stack, column, member, _ = places[name]
        alike.setdefault((stack, column), []).append((member, _checked(name, as_float(value, "armature"))))
    found = []
    for at, members in alike.items():
        coordinate, values = Coordinate(*at, indices([k for k, _ in members])), [value for _, value in members]
        rates = 3 if coordinate.column == SPIN else 1
        columns = indices(np.repeat(coordinate.columns(joints, frame, count), rates, axis=0))
        inertia = numpy_of(values).repeat(numpy_of(values).stack(values), rates)
        found.append(Armature(coordinate, on_device(inertia), columns))
    return tuple(found)


def _checked(name: str, value: Array) -> Array:
    if value.shape != () or (is_concrete(value) and not 0 <= np.asarray(value) < np.inf):
        raise RedundaxError(
            f"Argument `armature` must hold a number for '{name}' that is not negative, but holds {value}. Give the "
            "inertia of the rotor times the square of its gear ratio, kg m^2, or of a travel a mass, kg."
        )
    return value
