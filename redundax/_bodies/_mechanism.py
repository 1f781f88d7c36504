"""Planar mechanisms: bodies and joints assembled into a system.

Coordinates are x and y of every body, then all angles, Eqs. (1), (60); rows are the force-type rows of all
joints in the order given, then their moment-type rows, Eq. (61).
"""

from collections.abc import Callable, Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Int, Shaped

from .._system._axis import Axis, join
from .._system._names import Names
from .._system._state import State
from .._system._system import AbstractSystem
from .._system._units import Units, of_model
from .._tools._compilation import compiled
from .._tools._module import (
    Numbers,
    as_functions,
    as_vector,
    check_position,
    floats,
    moved,
    on_device,
    replace_fields,
    tree_take,
)
from .._tools._table import are_known
from ._body import GROUND, Body, Pose, poses
from ._joint_coordinates import JointCoordinates
from ._joint_friction import FrictionMembers, JointFriction, friction_members
from ._joints import AbstractFrictionalJoint, AbstractJoint
from ._loads import AbstractLoad, Motion
from ._mechanism_page import mechanism_page
from ._names import check_kinds, check_names
from ._pins import warn_of_large_pins
from ._stack import Stack, indices, stacked, stacks


class Mechanism(AbstractSystem):
    """A planar mechanism of rigid bodies and joints.

    ??? example

        ```python
        pin = rx.Revolute("A", "rod", "ground", point_i=(-0.5, 0.0), point_j=(0.0, 0.0))
        pendulum = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -9.81))
        rx.solve(pendulum, rx.assemble(pendulum, [0.5, 0.0, 0.0])).acceleration  # [0, -7.36, -14.7]
        ```

    **Arguments:**

    - `bodies`: its moving bodies.
    - `joints`: its joints and drivers.
    - `loads`: applied loads.
    - `gravity`: acceleration of gravity (2,), m/s^2, global components.
    - `pose`: the coordinates q on the constraint manifold as a function of some independent coordinates, for
      `state`; make it an eqx.Module with its lengths as arrays, so that gradients move q with the lengths.
    - `units`: those of all its figures, `rx.units.SI` where they are m, kg, s and N, `rx.units.MM_TONNE` where they are
      mm, t, s and N, or other `rx.units.Units`, as factors from SI. Results, tables and pictures show them, or none
      where none are given; compliance and misfit are read in them. Angles are in radians.
    """

    _names: Names = eqx.field(static=True)
    body: Body
    joints: tuple[Stack[AbstractJoint], ...]
    loads: tuple[Stack[AbstractLoad], ...]
    gravity: Float[Array, "2"]
    pose: Callable[..., Array] | None
    _source: Int[Array, " m"]
    _entries: Int[Array, "m n"]  # for the bodies that joints had when they were given
    _friction: tuple[FrictionMembers, ...]

    def __init__(
        self,
        bodies: Sequence[Body],
        joints: Sequence[AbstractJoint],
        *,
        loads: Sequence[AbstractLoad] = (),
        gravity: Numbers = (0.0, 0.0),
        pose: Callable[..., Array] | None = None,
        units: Units | None = None,
    ):
        check_kinds(bodies, joints, loads)
        names = [body.name for body in bodies]
        check_names(names, joints, loads)
        warn_of_large_pins(joints)
        self.body = stacked([replace_fields(body, name="") for body in bodies])
        self.loads, _ = stacks(loads, names)
        self.gravity, self.pose = as_vector(gravity), as_functions(pose)
        self.joints, groups = stacks(joints, names, name="", friction=None, pin_radius=None, sliding_arm=None)
        rows, source, places = _rows(joints, groups)
        self._source = indices(source)
        self._entries = indices(_entries(joints, groups, source, names))
        self._friction = tuple(
            members
            for kind, group in enumerate(groups)
            for members in friction_members(kind, [joints[k] for k in group], places[kind])
        )
        self._names = Names(
            _coordinates(names),
            rows,
            joint_coordinates=_joint_coordinates([joints[k] for group in groups for k in group]),
            reactions=_reactions([joints[k] for group in groups for k in group]),
            bodies=tuple(names),
            joints=tuple(tuple(joints[k].name for k in group) for group in groups),
            pushing=_pushing(joints, rows),
            units=of_model(units),
        )

    @property
    def friction(self) -> tuple[JointFriction, ...]:
        """Friction of the joints that have some, model by model."""
        return tuple(members.of(self.joints) for members in self._friction)

    @property
    def slips(self) -> Axis:
        """Names and kinds of the slips of all frictional joints."""
        return join([members.slips for members in self._friction])

    @property
    def constant_mass(self) -> bool:
        return True

    @property
    def diagonal_mass(self) -> bool:
        return True

    def anonymous(self) -> Self:
        return replace_fields(
            self,
            _names=self._names.anonymous(),
            pose=None,
            _friction=tuple(replace_fields(f, slips=f.slips.anonymous()) for f in self._friction),
        )

    def without_friction(self) -> Self:
        return replace_fields(self, _friction=())

    def state(self, *coordinates: ArrayLike, rate: ArrayLike = 0.0, t: ArrayLike = 0.0, **named: ArrayLike) -> State:
        """The state on the constraint manifold at given independent coordinates and their rate.

        **Arguments:**

        - the arguments of `pose`, by position or name.
        - `rate`: rate of the one independent coordinate, or a tuple with one rate for each in that order.
        - `t`: time.
        """
        if self.pose is None:
            raise ValueError(
                "Argument `pose` of the mechanism must be given to use `state`, but it is None. "
                "Use `rx.assemble`, which closes the mechanism from a guess."
            )
        names, given = tuple(named), tuple(floats(x) for x in (*coordinates, *named.values()))
        rates = tuple(rate) if isinstance(rate, tuple | list) else (rate,)
        if len(rates) != len(given):
            raise ValueError(
                f"Argument `rate` must hold a rate for each of the {len(given)} independent coordinates, "
                f"but holds {len(rates)}. Give a tuple with as many."
            )
        dtype = jnp.result_type(*given)
        values, tangents = (tuple(on_device(floats(x).astype(dtype)) for x in numbers) for numbers in (given, rates))
        return State(*_along(self.pose, values, tangents, names), t)

    def mass(self, q: Array, t: Array) -> Float[Array, "n n"]:
        return jnp.diag(jnp.concatenate([jnp.repeat(self.body.mass, 2), self.body.inertia]))

    def constraint(self, q: Array, t: Array) -> Float[Array, " m"]:
        body = poses(q).with_axes()
        return self.of_rows(_residuals(self.joints, body, t))

    def jacobian(self, q: Array, t: Array) -> Float[Array, "m n"]:
        """Joint by joint: each reads the coordinates of two bodies."""
        check_position(q, len(self.coordinates))
        body = poses(q).with_axes()
        slopes = _slopes(self.joints, body, t)
        flat = jnp.concatenate([jnp.zeros(1, q.dtype), *(slope.ravel() for slope in slopes)])
        return tree_take(flat, self._entries)

    @property
    def joint_coordinates(self) -> JointCoordinates:
        """Angles of revolutes, travels of sliders and of pins in slots, of body i relative to body j; all reactions."""
        return JointCoordinates(self.joints, self._source)

    def of_rows(self, values: Sequence[Array]) -> Shaped[Array, " m ..."]:
        """What the rows of the joints have, kind by kind of shape (joints, rows, ...), in the order of the rows."""
        flat = jnp.concatenate([value.reshape(-1, *value.shape[2:]) for value in values])
        return tree_take(flat, self._source)

    @property
    def rows_of_joints(self) -> list[np.ndarray]:
        """Row indices of the joints of each stack, (joints, rows); concrete values."""
        sizes = [(len(joints.i), len(joints.element.row_kinds)) for joints in self.joints]
        flat = np.split(np.argsort(self._source), np.cumsum([size * rows for size, rows in sizes])[:-1])
        return [part.reshape(size) for part, size in zip(flat, sizes, strict=True)]

    def load(self, state: State) -> Float[Array, " n"]:
        body, rate = poses(state.q), poses(state.qd)
        count = self.body.mass.shape[0]
        weight = self.body.mass[:, None] * self.gravity
        force = jnp.zeros((count + 1, 2), state.qd.dtype).at[:count].set(weight)
        moment = jnp.zeros(count + 1, state.qd.dtype)
        for loads in self.loads:
            on_i, on_j = loads.over(lambda load, i, j: load.wrenches(i, j, state.t), Motion(body, rate))
            force = force.at[loads.i].add(on_i.force).at[loads.j].add(on_j.force)
            moment = moment.at[loads.i].add(on_i.moment).at[loads.j].add(on_j.moment)
        return jnp.concatenate([force[:count].ravel(), moment[:count]])

    def retract(self, q: Array, d: Array) -> Array:
        return moved(q, d)

    @property
    def adds(self) -> bool:
        return True

    def __repr__(self) -> str:
        """Its size and its bodies, in a line."""
        bodies = f", bodies {', '.join(self.names.bodies)}" if self.names.bodies else ""
        return f"Mechanism with {len(self.coordinates)} coordinates, {len(self.rows)} rows{bodies}"

    def __str__(self) -> str:
        """A table of its bodies and joints; its size inside of transformations, and of several or without names."""
        parts = self.body, self.joints, self._friction, self.loads, self.gravity
        is_one = getattr(self.body.mass, "ndim", None) == 1
        if not (self.names.bodies and is_one and are_known(eqx.filter(parts, eqx.is_array))):
            return repr(self)
        return mechanism_page(self.names, *parts)


@eqx.filter_jit  # traced once for all derivatives in all programs
def _residuals(joints: tuple[Stack, ...], bodies: Pose, t: Array) -> list[Array]:
    return [stack.over(lambda joint, i, j: joint.residual(i, j, t), bodies) for stack in joints]


@eqx.filter_jit
def _slopes(joints: tuple[Stack, ...], bodies: Pose, t: Array) -> list[Array]:
    return [stack.over(lambda joint, i, j: joint.jacobian(i, j, t), bodies) for stack in joints]


@compiled
def _along(
    pose: Callable[..., Array], values: tuple[Array, ...], rates: tuple[Array, ...], names: tuple[str, ...]
) -> tuple[Array, Array]:
    """The position at values of the independent coordinates, the last of them given by name, and the velocity."""
    positional = len(values) - len(names)

    def position(*values: Array) -> Array:
        return pose(*values[:positional], **dict(zip(names, values[positional:], strict=True)))

    return jax.jvp(position, values, rates)


def _coordinates(bodies: Sequence[str]) -> Axis:
    """x and y of every body, then all angles."""
    names = (*(f"{name}.{axis}" for name in bodies for axis in "xy"), *(f"{name}.phi" for name in bodies))
    return Axis(names, ("linear",) * (2 * len(bodies)) + ("angular",) * len(bodies))


def _joint_coordinates(joints: Sequence[AbstractJoint]) -> Axis:
    """One for each joint that can have friction, which opposes its rate."""
    moving = [joint for joint in joints if isinstance(joint, AbstractFrictionalJoint)]
    return Axis(
        tuple(f"{joint.name}.{joint.coordinate}" for joint in moving), tuple(joint.slip_kind for joint in moving)
    )


def _reactions(joints: Sequence[AbstractJoint]) -> Axis:
    """Force and moment of each joint on its body i, or on body j where i is the ground."""
    on = [(joint.name, joint.j if joint.i == GROUND else joint.i) for joint in joints]
    names = (f"{name} {part} on {body}" for name, body in on for part in ("force x", "force y", "moment"))
    return Axis(tuple(names), ("force", "force", "moment") * len(joints))


def _pushing(joints: Sequence[AbstractJoint], rows: Axis) -> tuple[int, ...]:
    """Rows whose contacts push alone."""
    return tuple(rows.labels.index(f"{joint.name}.{row}") for joint in joints for row in joint.pushing)


def _rows(
    joints: Sequence[AbstractJoint], groups: Sequence[Sequence[int]]
) -> tuple[Axis, np.ndarray, list[np.ndarray]]:
    """The rows, force-type first and in the order of the joints; and where the rows come from and go to.

    The residuals of all kinds of joints, one after the other, are taken in the order `source`, shape (m,); the rows
    of the members of each kind are `places`, shape (members, rows) each.
    """
    flat = [(k, column) for group in groups for k in group for column in range(len(joints[k].row_kinds))]
    given = sorted(range(len(flat)), key=lambda position: flat[position])
    source = [p for wanted in ("force", "moment") for p in given if _kind(joints, flat[p]) == wanted]
    row_of = {flat[position]: row for row, position in enumerate(source)}
    places = [np.array([[row_of[k, c] for c in range(len(joints[k].row_kinds))] for k in group]) for group in groups]
    names = tuple(f"{joints[k].name}.{joints[k].row_kinds[column][0]}" for k, column in row_of)
    return Axis(names, tuple(joints[k].row_kinds[column][1] for k, column in row_of)), np.array(source), places


def _entries(
    joints: Sequence[AbstractJoint], groups: Sequence[Sequence[int]], source: np.ndarray, bodies: Sequence[str]
) -> np.ndarray:
    """Where the Jacobian, (m, n), finds its entries among those of the joints, 6 for each row, after a zero."""
    columns = {name: (2 * k, 2 * k + 1, 2 * len(bodies) + k) for k, name in enumerate(bodies)}
    owner = [joints[k] for group in groups for k in group for _ in joints[k].row_kinds]
    entries = np.zeros((len(source), 3 * len(bodies)))
    for row, place in enumerate(source):
        for k, body in enumerate((owner[place].i, owner[place].j)):
            if body in columns:
                entries[row, columns[body]] = 1 + 6 * place + 3 * k + np.arange(3)
    return entries


def _kind(joints: Sequence[AbstractJoint], place: tuple[int, int]) -> str:
    return joints[place[0]].row_kinds[place[1]][1]
