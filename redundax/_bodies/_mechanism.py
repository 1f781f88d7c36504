"""Mechanisms: bodies and joints assembled into a system.

Velocities are the linear ones of every body, then all angular ones, Eqs. (1), (60); rows are the force-type rows of all
joints in the order given, then their moment-type rows, Eq. (61). What a pose is, in the plane or in space, the frame of
the bodies knows.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Self, cast

import equinox as eqx
import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int, Shaped

from .._sparse._symbolic import Symbolic
from .._system._axis import Axis, join
from .._system._names import Names, index_of
from .._system._state import State
from .._system._system import AbstractSystem, Path, among, check_system_at
from .._system._units import Units, stated
from .._tools._errors import RedundaxError
from .._tools._functions import as_functions
from .._tools._module import (
    Numbers,
    check_call,
    check_kind,
    floats,
    is_concrete,
    numpy_of,
    on_device,
    replace_fields,
    tree_pick,
)
from .._tools._numbers import Numeric, asked_of_model
from .._tools._table import are_known
from .._tools._value import found_once
from ._armature import Armature, armature_load, armature_mass, armatures
from ._body import GROUND, AbstractBody
from ._coordinate import ball_places, coordinate_places
from ._coupler import Coupler, Couplings, Stop, coupled_rows, couplings
from ._frame import AbstractFrame, AbstractPose
from ._joint_coordinates import JointCoordinates
from ._joint_friction import FrictionMembers, JointFriction, friction_members
from ._joint_rows import (
    Positions,
    check_residuals,
    coordinate_axis,
    missed_velocities,
    path,
    reaction_axis,
    residuals,
    slopes,
)
from ._joints import AbstractJoint
from ._loads import AbstractLoad, AbstractLoadFunction
from ._mechanism_page import mechanism_page
from ._meshing import Turns, in_mesh, teeth_in_doubt, turns_into_mesh
from ._names import check_ends, check_frames, check_kinds, check_names
from ._pattern import LARGE, DenseEntries, Pattern, SparseEntries
from ._pins import warn_of_large_pins
from ._row_order import ordered_rows, pushing_rows, tied_rows, velocity_rows
from ._speed_driver import DrivenSpeed, SpeedDriver, SpeedRow, driven_speeds
from ._stack import Stack, indices, stacked, stacks


class Mechanism(AbstractSystem):
    """A mechanism of rigid bodies and joints, all planar or all of `rx.spatial`.

    ??? example

        ```python
        pin = rx.Revolute("A", "rod", "ground", point_i=(-0.5, 0.0), point_j=(0.0, 0.0))
        pendulum = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -9.81))
        rx.solve(pendulum, rx.assemble(pendulum, [0.5, 0.0, 0.0])).acceleration  # [0, -7.36, -14.7]
        ```

    **Arguments:**

    - `bodies`: its moving bodies.
    - `joints`: its joints and drivers.
    - `couplers`: `Coupler`s, `Stop`s and `SpeedDriver`s of coordinates of its joints.
    - `loads`: applied loads.
    - `gravity`: acceleration of gravity (2,), in space (3,), m/s^2, global components; none if not given.
    - `armature`: inertia of rotors that turn or travel with coordinates of joints alone, by their names, as in
      {"hinge.angle": 0.02}: of a geared drive, that of its rotor times the square of the gear ratio, kg m^2, or of a
      travel a mass, kg. That of a ball joint has the joint's name. The mass matrix then depends on the position.
    - `pose`: the coordinates q on the constraint manifold as a function of some independent coordinates, for
      `state`; make it an eqx.Module with its lengths as arrays, so that gradients move q with the lengths.
    - `units`: those of all its figures, `rx.units.SI` where they are m, kg, s and N, `rx.units.MM_TONNE` where they are
      mm, t, s and N, or other `rx.units.Units`, as factors from SI. Results, tables and pictures show them, or none
      where none are given; compliance and misfit are read in them. Angles are in radians.
    """

    _names: Names = eqx.field(static=True)
    frame: AbstractFrame = eqx.field(static=True)
    body: AbstractBody
    joints: tuple[Stack[AbstractJoint], ...]
    couplings: tuple[Couplings | DrivenSpeed, ...]
    armature: tuple[Armature, ...]
    loads: tuple[Stack[AbstractLoad], ...]
    gravity: Float[Array, " axes"]
    pose: Callable[..., Array] | None
    _source: Int[Array, " m"]
    _matrices: DenseEntries | SparseEntries  # for the bodies that joints had when they were given
    _friction: tuple[FrictionMembers, ...]
    _turns: tuple[Turns, ...]
    _kept: Bool[Array, " m"] | None

    def __init__(
        self,
        bodies: Sequence[AbstractBody],
        joints: Sequence[AbstractJoint],
        *,
        couplers: Sequence[Coupler | Stop | SpeedDriver] = (),
        loads: Sequence[AbstractLoad] = (),
        gravity: Numbers | None = None,
        armature: Mapping[str, Numbers] | None = None,
        pose: Callable[..., Array] | None = None,
        units: Units | None = None,
    ):
        check_kinds(bodies, joints, loads, couplers)
        names = [body.name for body in bodies]
        check_names(names, joints, loads, couplers)
        check_frames(bodies[0].frame, "bodies", *bodies, *joints, *loads)
        warn_of_large_pins(joints)
        if pose is not None and not callable(pose):
            raise RedundaxError(
                f"Argument `pose` must be a function of independent coordinates that gives `q`, but is {pose!r}. Leave "
                "it out to use `rx.assemble`."
            )
        self.frame = bodies[0].frame.of(bodies)
        self.body = stacked([replace_fields(body, name="") for body in self.frame.alike(bodies)])
        self.loads, _ = stacks(loads, names)
        self.gravity, self.pose = self.frame.vector("gravity", gravity), as_functions(pose)
        self.joints, groups = stacks(joints, names)
        self._check_residuals([joints[group[0]].name for group in groups], len(names))
        at = coordinate_places(joints, groups)
        speeds = [each for each in couplers if isinstance(each, SpeedDriver)]
        couplers = [each for each in couplers if not isinstance(each, SpeedDriver)]
        coupled = [*coupled_rows(couplers, at), *(SpeedRow(each, at) for each in speeds)]
        own = [len(joints) + k for k in range(len(coupled))]
        rows, source, places = ordered_rows([*joints, *coupled], [*groups, *([own] if own else [])])
        self._source, self._turns = indices(source), turns_into_mesh(joints, groups, names)
        coupler_rows = places[-1][:, 0] if own else np.zeros(0, int)
        first, last = (coupler_rows[part] for part in np.split(np.arange(len(own)), [len(own) - len(speeds)]))
        self.couplings = (
            *couplings(couplers, at, first.tolist(), self.joints, self.frame, len(names)),
            *driven_speeds(speeds, at, last.tolist(), self.joints, self.frame, len(names)),
        )
        self.armature = armatures(armature, at | ball_places(joints, groups), self.joints, self.frame, len(names))
        self._friction = tuple(
            members
            for kind, group in enumerate(groups)
            for members in friction_members(kind, [joints[k] for k in group], places[kind])
        )
        self._names = Names(
            self.frame.coordinates(names),
            rows,
            joint_coordinates=coordinate_axis([joints[k] for group in groups for k in group]),
            reactions=reaction_axis([joints[k] for group in groups for k in group], self.frame),
            centres=self.frame.centre_names(names),
            bodies=tuple(names),
            joints=tuple(tuple(joints[k].name for k in group) for group in groups),
            joined=tuple((joint.name, joint.i, joint.j) for joint in joints),
            pushing=pushing_rows([*joints, *coupled], rows),
            one_sided=pushing_rows([each for each in (*joints, *coupled) if each.one_sided], rows),
            tied=tied_rows([each for each in (*joints, *coupled) if each.one_sided], rows),
            velocity_rows=velocity_rows([*joints, *coupled], rows),
            units=stated(units),
            adds=self.frame.adds,
        )
        many = len(rows) + self.frame.size * len(names) >= LARGE
        self._matrices = self._entries(many and not self.armature and not self.velocity_rows)
        self._kept = None

    def _check_residuals(self, names: Sequence[str], count: int) -> None:
        """Refuse joints of a user whose residual has another shape than their rows."""

        def poses() -> AbstractPose:
            q = jnp.zeros(count * self.frame.size) if self.frame.adds else self.frame.reference(self.body)
            return self.frame.poses(self.frame.centres(self.body), q)

        check_residuals(self.joints, names, poses)

    @property
    def symbolic(self) -> Symbolic | None:
        return self._matrices.symbolic

    def sparse(self, is_sparse: bool = True) -> Self:
        """The same mechanism with sparse matrices in `assemble`, `solve` and `simulate`, or with dense ones.

        From 2000 coordinates and rows on they are sparse anyway.

        All other questions are answered with dense ones, up to 6000 coordinates and rows in all. Sparse ones take no
        armature and no rows of velocity, and in motions no dry sleeves, balls, plates and points on planes. Contraction
        of friction is estimated there, not bounded.

        ??? example

            ```python
            rx.solve(mechanism.sparse(), state)
            ```
        """
        if is_sparse and self.armature:
            raise RedundaxError(
                "Sparse matrices take the mass of each body by itself, but `armature` couples bodies. Leave it out, or "
                "solve the mechanism without `sparse()`."
            )
        if is_sparse and self.velocity_rows:
            raise RedundaxError(
                "Sparse matrices take no rows of velocity, as those of wheels and drives of speed. Solve the mechanism "
                "without `sparse()`."
            )
        return replace_fields(self, _matrices=self._entries(is_sparse))

    @property
    def whole(self) -> Self:
        return self._matrices.whole(self, len(self.rows) + len(self.coordinates))

    def _entries(self, is_sparse: bool) -> DenseEntries | SparseEntries:
        """Where the entries of its Jacobian come from."""
        pattern = Pattern(self.joints, self.rows_of_joints, self.couplings, self.frame, self.body.mass.shape[0])
        if not is_sparse:
            return pattern.dense()
        masses = self.frame.masses(self.body)
        is_known = is_concrete(masses)
        return pattern.sparse((np.linalg.eigvalsh(np.asarray(masses))[:, 0] <= 0).tolist() if is_known else [])

    @property
    def friction(self) -> tuple[JointFriction, ...]:
        """Friction of the joints that have some, model by model."""
        return self._known_friction if self.is_known else self._groups()

    @found_once
    def _known_friction(self) -> tuple[JointFriction, ...]:
        with jax.core.eval_context():  # not traced where something else is
            return self._groups()

    def _groups(self) -> tuple[JointFriction, ...]:
        centres = self.frame.centres(self.body)
        return tuple(members.of(self.joints, self.frame, centres) for members in self._friction)

    @found_once
    def slips(self) -> Axis:
        """Names and kinds of the slips of all frictional joints."""
        return join([members.slips for members in self._friction])

    @property
    def constant_mass(self) -> bool:
        return not self.armature

    @property
    def diagonal_mass(self) -> bool:
        return self.frame.diagonal_mass and not self.armature

    @found_once
    def anonymous(self) -> Self:
        return replace_fields(
            self,
            _names=self._names.anonymous,
            pose=None,
            _friction=tuple(replace_fields(f, slips=f.slips.anonymous) for f in self._friction),
        )

    @found_once
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
            raise RedundaxError(
                "Argument `pose` of the mechanism must be given to use `state`, but it is None. "
                "Use `rx.assemble`, which closes the mechanism from a guess."
            )
        check_call("state", self.pose, *coordinates, **named)
        names, given = tuple(named), tuple(floats(x) for x in (*coordinates, *named.values()))
        rates = tuple(rate) if isinstance(rate, tuple | list) else (rate,)
        if len(rates) != len(given):
            raise RedundaxError(
                f"Argument `rate` must hold a rate for each of the {len(given)} independent coordinates, "
                f"but holds {len(rates)}. Give a tuple with as many."
            )
        dtype = jnp.result_type(*given)
        values, tangents = (tuple(on_device(floats(x).astype(dtype)) for x in numbers) for numbers in (given, rates))
        q, q_rate = _along(self.pose, values, tangents, names)
        return State(q, self.frame.velocity(q, q_rate), t)

    def point(self, state: State, body: str, at: Numbers) -> Float[Array, " axes"]:
        """Global position, m, of a point that is given in the local frame of a body, or of the ground.

        ??? example

            ```python
            mechanism.point(state, "1", (0.1, 0.0))
            jax.vmap(lambda each: mechanism.point(each, "1", (0.1, 0.0)))(motion.states)
            ```
        """
        known = (*self.names.bodies, GROUND)
        place = np.asarray(index_of("body", body, known, " of bodies"))
        return self._point(state.q, place, self.frame.vector("at", at))

    @asked_of_model
    def _point(self, q: Array, place: Int[Numeric, ""], at: Float[Array, " axes"]) -> Float[Array, " axes"]:
        return self.poses(q)[place].point(at)

    @asked_of_model
    def mass(self, q: Array, t: Array) -> Float[Array, "n n"]:
        own = self.frame.mass(self.body)
        return own + armature_mass(self.armature, self.joints, self.poses(q), len(own)) if self.armature else own

    def poses(self, q: Array) -> AbstractPose:
        """Poses of all bodies and of the ground, which is last, stacked."""
        self.frame.check(q, len(self.coordinates))
        return self.frame.poses(self.frame.centres(self.body), q)

    @asked_of_model
    def constraint(self, q: Array, t: Array) -> Float[Array, " m"]:
        return self.constraint_at(Positions(self.poses(q), (None,) * len(self.joints)), t)

    def path(self, q: Array, rate: Array) -> Path | None:
        return None if self.frame.adds else path(self.frame, self.frame.centres(self.body), self.joints, q, rate)

    @asked_of_model
    def displacement(self, base: Array, q: Array) -> tuple[Array, Array] | None:
        return self.frame.displacement(base, q)

    @asked_of_model
    def velocity(self, q: Array, rate: Array) -> Array:
        return self.frame.velocity(q, rate)

    def constraint_at(self, at: Positions, t: Array) -> Float[Array, " m"]:
        coupled = [each.residuals(self.joints, at.poses) for each in self.couplings]
        return among(self._kept, self.of_rows([*residuals(self.joints, at, t), *coupled]))

    @asked_of_model
    def velocity_constraint(self, q: Array, qd: Array, t: Array, u: Array | None = None) -> Float[Array, " m"]:
        zero, one, none = jnp.zeros((), qd.dtype), jnp.ones((), qd.dtype), (None,) * len(self.joints)
        at, rate = jax.jvp(lambda s: self.poses(self.retract(q, s * qd)), (zero,), (one,))
        return self.velocity_constraint_at(Positions(at, none), Positions(rate, none), qd, t, u)

    def velocity_constraint_at(
        self, at: Positions, rate: Positions, qd: Array, t: Array, u: Array | None = None
    ) -> Float[Array, " m"]:
        none = jnp.zeros((1, 1), qd.dtype)
        own = missed_velocities(self.joints, at.poses, rate.poses)
        coupled = [
            each.missed(self.joints, at.poses, qd, t, u)
            if isinstance(each, DrivenSpeed)
            else jnp.broadcast_to(none, (each.rows.size, 1))
            for each in self.couplings
        ]
        return among(self._kept, self.of_rows([*own, *coupled]))

    def opened(self, kept: Array) -> Self:
        return replace_fields(self, _kept=kept)

    @property
    def kept(self) -> Array | None:
        return self._kept

    def rubbing(self, factors: Mapping[str, ArrayLike]) -> Self:
        joints = [name for members in self._friction for name in members.joints]
        for name in factors:
            index_of("friction", name, joints, " of joints with friction")
        return replace_fields(self, _friction=tuple(members.times(factors) for members in self._friction))

    def slips_at(self, at: Positions) -> Float[Array, " p"]:
        parts = zip(self.friction, self._friction, strict=True)
        return jnp.concatenate([group.slip_at(at.poses, members.of_stack(at.relatives)) for group, members in parts])

    def slip_directions(self, at: Positions) -> Float[Array, "n p"]:
        return jnp.concatenate([group.directions_at(at.poses) for group in self.friction], axis=1)

    @asked_of_model
    def jacobian(self, q: Array, t: Array) -> Float[Array, "m n"]:
        """Joint by joint: each reads the coordinates of two bodies."""
        body = self.poses(q)
        own = slopes(self.joints, body, t)
        return among(self._kept, self._matrices.jacobian(own, self.couplings, self.joints, body, self._joined))

    def _joined(self, own: Sequence[Array]) -> Float[Array, "m n"]:
        """The Jacobian of joints alone, of their slopes, by products."""
        pairs, count = zip(self.joints, own, strict=True), self.body.mass.shape[0]
        return self.frame.by_velocities(self.of_rows([stack.by_bodies(slope, count) for stack, slope in pairs]))

    def by_bodies(self, q: Array, t: Array) -> tuple[Array, Array]:
        body = self.poses(q)
        own = cast(SparseEntries, self._matrices).by_bodies(
            slopes(self.joints, body, t), self.couplings, self.joints, body
        )
        return among(self._kept, own), self.frame.masses(self.body)

    def kinetic_energy(self, q: Array, qd: Array, t: Array) -> Float[Array, ""]:
        return self._matrices.kinetic_energy(self, q, qd, t)

    @found_once
    def joint_coordinates(self) -> JointCoordinates:
        """What joints leave free, as angles of revolutes and travels of sliders, of body i relative to body j; all
        reactions."""
        return JointCoordinates(self.frame, self.frame.centres(self.body), self.joints, self._source)

    def of_rows(self, values: Sequence[Array], coupled: ArrayLike = 0) -> Shaped[Array, " m ..."]:
        """What the rows of the joints have, kind by kind of shape (joints, rows, ...), in the order of the rows; all of
        couplers have the same number, unless theirs are given too."""
        flat = [value.reshape(-1, *value.shape[2:]) for value in values]
        if len(values) == len(self.joints):
            flat += [jnp.full((each.rows.size, *flat[0].shape[1:]), coupled, flat[0].dtype) for each in self.couplings]
        return tree_pick(jnp.concatenate(flat), self._source)

    @property
    def rows_of_joints(self) -> list[Numeric]:
        """Row indices of the joints of each stack, (joints, rows); traced where the mechanism is."""
        sizes, xp = [(len(joints.i), len(joints.element.row_kinds)) for joints in self.joints], numpy_of(self._source)
        places = xp.argsort(xp.asarray(self._source))
        flat = xp.split(places, np.cumsum([size * rows for size, rows in sizes]))[:-1]
        return [part.reshape(size) for part, size in zip(flat, sizes, strict=True)]

    @property
    def may_bend(self) -> bool:
        return any(isinstance(loads.element, AbstractLoadFunction) for loads in self.loads)

    @asked_of_model
    def load(self, state: State) -> Float[Array, " n"]:
        count, motion = self.body.mass.shape[0], self.frame.motions(self.body, state)
        force = jnp.zeros((count + 1, self.gravity.shape[0]), state.qd.dtype)
        moment = jnp.zeros_like(force if len(self.frame.angular) > 1 else force[:, 0])
        for loads in self.loads:
            ends = loads.over(lambda load, i, j: load.wrenches(i, j, state.t), motion)
            force, moment = (
                loads.onto_bodies(total, *parts)
                for total, parts in ((force, [on.force for on in ends]), (moment, [on.moment for on in ends]))
            )
        weight = (self.body.mass[:, None] * self.gravity).ravel()  # at the centres of mass, whose velocities come first
        linear, angular = jnp.split(self.frame.load(self.body, motion, force, moment), [weight.size])
        load = jnp.concatenate([linear + weight, angular])
        if not self.armature:
            return load

        def along(s: Array) -> AbstractPose:
            return self.poses(self.retract(state.q, s * state.qd))

        return load - armature_load(self.armature, self.joints, along, state.qd)

    def load_of(self, load: AbstractLoad, state: State) -> Float[Array, " n"]:
        """Generalised force, N or N m, of one load at a state; it need not be among those of the mechanism.

        ??? example

            ```python
            mechanism.load_of(rx.AppliedForce("1", force=(0.0, -1.0), point=(0.1, 0.0)), state)
            ```
        """
        check_system_at(self, state)
        check_kind("load", load, AbstractLoad, "a load", "Give an `AppliedForce`, say.")
        check_ends(self.names.bodies, load=[load])
        check_frames(self.frame, "load", load)
        own = stacks([load], self.names.bodies)[0]
        bare = replace_fields(self.body, mass=0.0 * self.body.mass, inertia=0.0 * self.body.inertia)
        return replace_fields(self, loads=own, body=bare, armature=()).load(state)

    @asked_of_model
    def retract(self, q: Array, d: Array) -> Array:
        return self.frame.retract(q, d)

    @property
    def adds(self) -> bool:
        return self.frame.adds

    @property
    def reference(self) -> Array:
        return self.frame.reference(self.body)

    def start(self, q: Array, t: Array) -> Array:
        return in_mesh(self._turns, self.joints, q, t) if self._turns else q

    @property
    def doubt(self) -> str:
        return teeth_in_doubt(self.joints, self.names.bodies)

    def __repr__(self) -> str:
        """Its size and its bodies, in a line."""
        bodies = f", bodies {', '.join(self.names.bodies)}" if self.names.bodies else ""
        return f"Mechanism with {len(self.coordinates)} coordinates, {len(self.rows)} rows{bodies}"

    def __str__(self) -> str:
        """A table of its bodies and joints; its size inside of transformations, and of several or without names."""
        parts = self.body, self.joints, self._friction, self.loads, self.gravity, self.armature
        is_one = getattr(self.body.mass, "ndim", None) == 1
        if not (self.names.bodies and is_one and are_known(eqx.filter(parts, eqx.is_array))):
            return repr(self)
        couplers = [words for each in self.couplings for words in each.words(self.names, self.joints)]
        return mechanism_page(self.names, *parts, couplers)


@asked_of_model
def _along(
    pose: Callable[..., Array], values: tuple[Array, ...], rates: tuple[Array, ...], names: tuple[str, ...]
) -> tuple[Array, Array]:
    """The position at values of the independent coordinates, the last of them given by name, and the velocity."""
    positional = len(values) - len(names)

    def position(*values: Array) -> Array:
        return pose(*values[:positional], **dict(zip(names, values[positional:], strict=True)))

    return jax.jvp(position, values, rates)
