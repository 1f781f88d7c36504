"""Closures from the compliance of each joint, given as a data sheet or a finite-element model gives it.

A joint on an elastic seat: under the wrench w = (force, moment) between its bodies the seat gives way by C w, which is
the small displacement v = (shift, turn) of body i's side relative to body j's beside that of the parts as they are, v0,

    C w = v + v0,   A = d residual / d v,   w = A^T lam,   residual = A v

so that the rows of the joint have the compliance A C A^T and the misfit A v0. C, (3, 3) in the plane and (6, 6) in
space, the displacement v0 of the parts as they are, and the reference point about which it turns are constant in the
frame of a body that the joint connects, the one on which the seat sits, and turn with it.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._bodies._body import GROUND
from .._bodies._frame import AbstractFrame, AbstractPose
from .._bodies._joint_rows import slopes
from .._bodies._mechanism import Mechanism
from .._bodies._stack import Stack, stacked
from .._system._axis import join
from .._system._names import Names, index_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._system._units import Units, checked_units
from .._tools._errors import RedundaxError
from .._tools._module import as_float, check_kind, is_concrete, not_negative
from .._tools._numbers import as_numbers, asked_of_model, known, on_numbers, xp
from .._tools._value import AbstractModule
from ._closure import AbstractClosure, mates_of
from ._joint_compliance import AbstractJointCompliance, JointCompliance
from ._joint_compliance_in_space import JointCompliance as SpatialJointCompliance
from ._play import Play, play_of


class _Seat(AbstractModule):
    """C and v0 of a joint along axes, the columns, and about a point of body i if `on_i`, else of body j."""

    compliance: Float[Array, "size size"]
    misfit: Float[Array, " size"]
    point: Float[Array, " dimensions"]
    axes: Float[Array, "dimensions dimensions"]
    on_i: Bool[Array, ""]
    number: Int[Array, ""]

    def rows(
        self, frame: AbstractFrame, slope: Float[Array, "rows columns"], i: AbstractPose, j: AbstractPose
    ) -> tuple[Float[Array, "rows size"], Float[Array, "rows size"], Float[Array, " rows"], Int[Array, " rows"]]:
        """A and A C along the axes of the seat, A v0, and the number of the joint, whose slopes by the velocities of
        both bodies are given."""
        pose = jax.tree.map(lambda one, other: jnp.where(self.on_i, one, other), i, j)
        on_i = slope[:, : frame.size].T
        force, moment, _ = frame.reactions(i, on_i, i.local(pose.point(self.point)))
        axes = jax.vmap(pose.rotate, in_axes=1, out_axes=1)(self.axes)
        a = frame.along(axes, force, moment).T
        return a, a @ self.compliance, a @ self.misfit, jnp.broadcast_to(self.number, a.shape[:1])


class ElasticJoints(AbstractClosure):
    """The closure of a mechanism on elastic joints: the same physics in every position, frame and unit.

    Joints that are not listed are rigid and fit exactly. At least the listed ones must give way under every
    self-stress state.

    ??? example

        ```python
        guides = {name: (2e-8, 1e-6) for name in "KL"}  # m/N, rad/(N m)
        joints = rx.ElasticJoints(mechanism, {name: 1e-8 for name in "ABCD"} | guides)
        rx.solve(mechanism, state, closure=joints)["A.x"]
        ```

    **Arguments:**

    - `mechanism`: the mechanism, for the names of its joints and bodies.
    - `joints`: a `JointCompliance`, in space a `spatial.JointCompliance`, for each joint that is elastic or does not
      fit; or by name of joint its compliance, `translation` in m/N or a pair with `rotation` in rad/(N m).
    - `units`: units of their figures, as factors from the units of the mechanism.
    - `drives`: what gives way in drives that follow laws (`rx.drive`), by name of the coordinate, as in {"left.angle":
      1e-4}: one over the servo's stiffness, rad/(N m) or m/N; or a pair with the synchronising error, rad or m, by
      which the drive would stand behind its law without load. Others are stiff and in step. Units are those of the
      mechanism.
    - `play`: clearance from the middle to either side, m or rad, by name of joint or row, as in {"A": 20e-6,
      "K.angle": 1e-4}. Of a pin, a sleeve or a ball it is radial: that of the radii. A joint whose rows have units or
      directions of their own is named by them: of a guide in the plane "K.perpendicular" and "K.angle". A joint carries
      nothing until its parts have moved by it. The ideal mechanism moves as without play: what is not redundant is not
      loosened. In `band` it is the most that there may be. Motions take it with dense matrices.
    """

    seats: tuple[_Seat, ...]
    drives: dict[str, tuple[Array, Array]]
    play: Play | None

    def __init__(
        self,
        mechanism: Mechanism,
        joints: Sequence[AbstractJointCompliance] | Mapping[str, ArrayLike | tuple[ArrayLike, ...]],
        units: Units | None = None,
        *,
        drives: Mapping[str, ArrayLike | tuple[ArrayLike, ArrayLike]] | None = None,
        play: Mapping[str, ArrayLike] | None = None,
    ):
        check_kind("mechanism", mechanism, Mechanism, "a mechanism", "Give that first, then how its joints give way.")
        kind = _KINDS[mechanism.frame.word]
        if isinstance(joints, Mapping):
            joints = [kind(name, *_pair("joints", name, figures)) for name, figures in joints.items()]
        _check_space(joints, mechanism.frame)
        names = mechanism.names.joint_names
        given = {joint.joint: joint for joint in joints}
        if len(given) < len(joints):
            raise RedundaxError("Argument `joints` must name each joint once, but names some twice. Leave one out.")
        for name in given:
            index_of("joints", name, names, " of joints")
        units = checked_units(units) or Units()
        self.seats = seats_of(given, kind, mechanism.joints, mechanism.names, units)
        known = join([mechanism.coordinates, mechanism.names.joint_coordinates]).labels
        self.drives = {}
        drives = {} if drives is None else drives
        check_kind("drives", drives, Mapping, "compliances by name of coordinate", 'Give {"A.angle": 1e-6}, say.')
        for name, figures in drives.items():
            index_of("drives", name, known, " of coordinates")
            softness, error = (*_pair("drives", name, figures, "it and its error"), 0.0)[:2]
            self.drives[name] = as_float(softness, "drives"), as_float(error, "drives")
            not_negative("drives", self.drives[name][0])
        self.play = play_of(mechanism, play, units)

    def clearances(self, system: AbstractSystem) -> Play | None:
        return self.play

    def of_drives(self, names: Sequence[str]) -> tuple[Array, Array]:
        others = sorted(set(self.drives) - set(names))
        if others:
            raise RedundaxError(
                f"Argument `drives` of the closure names {', '.join(others)}, which follow no law: drives are on "
                f"{', '.join(names) or 'none'}. Give laws to them, or leave them out."
            )
        pairs = [self.drives.get(name, (xp.zeros(()), xp.zeros(()))) for name in names]
        return xp.stack([softness for softness, _ in pairs]), xp.stack([error for _, error in pairs])

    @asked_of_model
    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        a, bent, misfit, joint = self._rows(system, state)
        return jnp.where(joint[:, None] == joint, bent @ a.T, 0.0), misfit

    def by_joint(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        a, bent, misfit, _ = self._rows(system, state)
        own = jnp.einsum("mk,mjk->mj", bent, a.at[mates_of(system)].get(mode="fill", fill_value=0.0))
        return own, misfit

    def _rows(self, system: AbstractSystem, state: State) -> list[Array]:
        """A, A C, A v0 and the number of the joint, row by row."""
        sizes = [seats.number.shape for seats in self.seats]
        if not isinstance(system, Mechanism) or [stack.i.shape for stack in system.joints] != sizes:
            raise RedundaxError(
                "Argument `closure` must be made with the mechanism that is solved, but its joints are others. "
                "For the same mechanism in other units give `rx.units.closure_in_units(closure)`."
            )
        frame, body = system.frame, system.poses(state.q)
        rows = [
            Stack((seats, slope), stack.i, stack.j).over(lambda own, i, j: own[0].rows(frame, own[1], i, j), body)
            for seats, stack, slope in zip(self.seats, system.joints, slopes(system.joints, body, state.t), strict=True)
        ]
        return [system.of_rows(values) for values in zip(*rows, strict=True)]


_KINDS = {kind.space.word: kind for kind in (JointCompliance, SpatialJointCompliance)}


def _check_space(joints: Sequence[AbstractJointCompliance], frame: AbstractFrame) -> None:
    """Refuse what is no compliance, figures of a planar joint in space, and the other way round."""
    what, advice = "compliances of joints", 'Give {"A": 1e-8} by name of joint, or a list of `rx.JointCompliance`.'
    check_kind("joints", joints, Sequence, what, advice)
    for joint in joints:
        check_kind("joints", joint, AbstractJointCompliance, f"{what} alone", advice)
    wrong = [joint.joint for joint in joints if joint.space.word != frame.word]
    if wrong:
        place = "rx.spatial" if frame.word == "spatial" else "rx"
        raise RedundaxError(
            f"Argument `joints` must hold those of a {frame.word} mechanism, but that of joint '{wrong[0]}' is not. "
            f"Give `{place}.JointCompliance`."
        )


@partial(on_numbers, jit=False)
def seats_of(
    given: dict[str, AbstractJointCompliance],
    kind: Callable[[str], AbstractJointCompliance],
    joints: Sequence[Stack],
    names: Names,
    units: Units,
) -> tuple[_Seat, ...]:
    """The seats of all joints."""
    number, stacks = 0, []
    for stack, members in zip(joints, names.joints, strict=True):
        seats = []
        for k, name in enumerate(members):
            seat = given[name] if name in given else as_numbers(kind(name))
            seats.append(_seat(seat, stack, k, _on_i(seat, stack, k, names.bodies), units, number))
            number += 1
        stacks.append(stacked(seats))
    return tuple(stacks)


def _pair(
    argument: str,
    name: str,
    figures: ArrayLike | tuple[ArrayLike, ...],
    pair: str = "that of translation and that of rotation",
) -> tuple[ArrayLike, ...]:
    given = figures if isinstance(figures, tuple) else (figures,)
    if isinstance(figures, AbstractJointCompliance):
        raise RedundaxError(
            f"Argument `{argument}` must have numbers by name, but has a {type(figures).__name__} for '{name}'. "
            "Give these as a list: they have names of their own."
        )
    if len(given) not in (1, 2):
        raise RedundaxError(
            f"Argument `{argument}` must have one compliance for '{name}', or a pair of {pair}, but has "
            f"{len(given)}. Put those of the axes in a list: {list(given)}."
        )
    return given


def _on_i(given: AbstractJointCompliance, stack: Stack, k: int, bodies: tuple[str, ...]) -> Bool[Array, ""]:
    """Whether the frame is that of body i of the k-th joint of the stack; otherwise it is that of body j."""
    if given.frame is None:
        return xp.asarray(True)
    index = {name: position for position, name in enumerate((*bodies, GROUND))}
    body = index.get(given.frame, -1)
    if is_concrete(stack.i) and is_concrete(stack.j):
        ends = int(np.asarray(stack.i)[k]), int(np.asarray(stack.j)[k])
        if body not in ends:
            raise RedundaxError(
                f"Argument `frame` of joint '{given.joint}' must be one of the bodies that it connects, "
                f"{[(*bodies, GROUND)[end] for end in ends]}, but is '{given.frame}'. Name one of them."
            )
    return stack.i[k] == body


def _seat(given: AbstractJointCompliance, stack: Stack, k: int, on_i: Array, units: Units, number: int) -> _Seat:
    """The seat of the k-th joint of the stack in the units of the mechanism."""
    linear, angular = len(given.space.linear), len(given.space.angular)
    scale = xp.concatenate([xp.full(linear, units.length), xp.full(angular, units.angle)])
    point, axes = (
        xp.where(on_i, *(otherwise if (own := of(end)) is None else own[k] for end in ("i", "j")))
        for of, otherwise in ((stack.element.point_on, xp.zeros(linear)), (stack.element.axes_on, xp.eye(linear)))
    )
    point = point if given.point is None else given.point / units.length
    compliance = known(units.energy) * given.compliance / (scale[:, None] * scale)
    return _Seat(compliance, given.misfit / scale, point, axes, on_i, xp.asarray(number))
