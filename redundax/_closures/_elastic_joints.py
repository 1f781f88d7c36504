"""Closures from the compliance of each joint, given as a data sheet or a finite-element model gives it.

A joint on an elastic seat: under the wrench w = (force, moment) between its bodies the seat gives way by a small
displacement v = (shift, turn) of body i's side relative to body j's,

    v = C w + v0,   A = d residual / d v,   w = A^T lam,   residual = A v

so that the rows of the joint have the compliance A C A^T and the misfit A v0. C (3, 3), the displacement v0 of the
parts as they are, and the reference point about which it turns are constant in the frame of a body that the joint
connects, the one on which the seat sits, and turn with it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Int

from .._bodies._body import GROUND, Pose, perpendicular, poses
from .._bodies._joints import AbstractJoint
from .._bodies._mechanism import Mechanism
from .._bodies._stack import Stack, stacked
from .._system._names import index_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._system._units import Units
from .._tools._module import Numbers, as_float, as_vector, is_concrete
from ._closure import AbstractClosure, check_compliance, inverse


class JointCompliance(eqx.Module):
    """Compliance and misfit of one joint, in the frame of one of the bodies that it connects.

    Only what the joint holds counts: a revolute joint takes no moment about its pin, so that the angular compliance of
    its seat acts through a reference point beside the pin alone.

    ??? example

        ```python
        pin = rx.JointCompliance("A", translation=1e-8, misfit=(1e-5, 0.0, 0.0))
        guide = rx.JointCompliance("K", translation=2e-8, rotation=1e-6, frame="ground")
        ```

    **Arguments:**

    - `joint`: its name.
    - `translation`: shift by force, m/N, one number for all directions or a (2, 2) matrix.
    - `rotation`: turn by moment, rad/(N m).
    - `coupling`: turn by force, rad/N, shape (2,); by symmetry also shift by moment. Zero where the reference point is
      the centre of compliance.
    - `misfit`: v0, by how much the parts as they are place body i's side of the joint elsewhere than on body j's
      without load: shift in m (2,) and turn in rad, shape (3,).
    - `frame`: name of the body, or "ground", in whose frame all this is given; body i if not given.
    - `point`: reference point in that frame, m; the joint's own point on that body if not given.
    """

    joint: str = eqx.field(static=True)
    compliance: Float[Array, "3 3"]
    misfit: Float[Array, "3"]
    frame: str | None = eqx.field(static=True)
    point: Float[Array, "2"] | None

    def __init__(
        self,
        joint: str,
        translation: Numbers = 0.0,
        rotation: ArrayLike = 0.0,
        *,
        coupling: Numbers = (0.0, 0.0),
        misfit: Numbers = (0.0, 0.0, 0.0),
        frame: str | None = None,
        point: Numbers | None = None,
    ):
        self.joint, self.frame, self.misfit = joint, frame, as_float(misfit)
        self.point = None if point is None else as_vector(point)
        shift, cross = as_float(translation), as_float(coupling)
        for name, value, shapes in (
            ("translation", shift, ((), (2, 2))),
            ("coupling", cross, ((2,),)),
            ("misfit", self.misfit, ((3,),)),
        ):
            if value.shape not in shapes:
                raise ValueError(
                    f"Argument `{name}` of joint '{joint}' must have shape {' or '.join(map(str, shapes))}, but has "
                    f"{value.shape}. Its docstring says what each entry is."
                )
        shift = shift if shift.ndim else shift * jnp.eye(2)
        self.compliance = jnp.block([[shift, cross[:, None]], [cross[None], as_float(rotation)[None, None]]])
        if is_concrete(self.compliance):
            check_compliance(np.asarray(self.compliance), f"The compliance of joint '{joint}' in (x, y, angle)")

    @classmethod
    def from_stiffness(
        cls, joint: str, translation: Numbers = jnp.inf, rotation: ArrayLike = jnp.inf, **options: Any
    ) -> "JointCompliance":
        """The same from stiffness: `translation`, N/m, a number or a (2, 2) matrix, and `rotation`, N m/rad.

        Both are positive, infinite where the joint is rigid; `options` are the other arguments.

        ??? example

            ```python
            rx.JointCompliance.from_stiffness("K", 5e7, 1e6, frame="ground")
            ```
        """
        return cls(joint, inverse(as_float(translation)), inverse(as_float(rotation)), **options)


class _Seat(eqx.Module):
    """C, v0 and reference point of a joint in the frame of body i if `on_i`, else of body j."""

    compliance: Float[Array, "3 3"]
    misfit: Float[Array, "3"]
    point: Float[Array, "2"]
    on_i: Bool[Array, ""]
    number: Int[Array, ""]

    def rows(
        self, joint: AbstractJoint, i: Pose, j: Pose, t: Array
    ) -> tuple[Float[Array, "rows 3"], Float[Array, "rows 3"], Float[Array, " rows"], Int[Array, " rows"]]:
        """A and A C in the frame of the seat, A v0, and the number of the joint."""
        frame = jax.tree.map(lambda one, other: jnp.where(self.on_i, one, other), i, j)
        centre = frame.point(self.point)

        def moved(v: Array) -> Array:
            lever = perpendicular(i.r - centre)
            return joint.residual(Pose(i.r + frame.rotate(v[:2]) + v[2] * lever, i.phi + v[2]), j, t)

        a = jax.jacfwd(moved)(jnp.zeros_like(self.misfit))
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
    - `joints`: a `JointCompliance` for each joint that is elastic or does not fit; or by name of joint its
      compliance, `translation` in m/N or a pair with `rotation` in rad/(N m).
    - `units`: units of their figures, as factors from the units of the mechanism.
    """

    seats: tuple[_Seat, ...]

    def __init__(
        self,
        mechanism: Mechanism,
        joints: Sequence[JointCompliance] | Mapping[str, ArrayLike | tuple[ArrayLike, ArrayLike]],
        units: Units | None = None,
    ):
        if isinstance(joints, Mapping):
            joints = [JointCompliance(name, *_pair(figures)) for name, figures in joints.items()]
        names = [name for kind in mechanism.names.joints for name in kind]
        given = {joint.joint: joint for joint in joints}
        if len(given) < len(joints):
            raise ValueError("Argument `joints` must name each joint once, but names some twice. Leave one out.")
        for name in given:
            index_of("joints", name, names, " of joints")
        units, number, kinds = Units() if units is None else units, 0, []
        for stack, members in zip(mechanism.joints, mechanism.names.joints, strict=True):
            seats = []
            for k, name in enumerate(members):
                seat = given.get(name, JointCompliance(name))
                seats.append(_seat(seat, stack, k, _on_i(seat, stack, k, mechanism.names.bodies), units, number))
                number += 1
            kinds.append(stacked(seats))
        self.seats = tuple(kinds)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        sizes = [seats.number.shape for seats in self.seats]
        if not isinstance(system, Mechanism) or [stack.i.shape for stack in system.joints] != sizes:
            raise ValueError(
                "Argument `closure` must be made with the mechanism that is solved, but its joints are others. "
                "For the same mechanism in other units give `rx.units.closure_in_units(closure)`."
            )
        body = poses(state.q)
        rows = [
            eqx.filter_vmap(lambda seat, joint, i, j: seat.rows(joint, body[i], body[j], state.t))(
                seats, stack.element, stack.i, stack.j
            )
            for seats, stack in zip(self.seats, system.joints, strict=True)
        ]
        a, bent, misfit, joint = (system.of_rows(values) for values in zip(*rows, strict=True))
        return jnp.where(joint[:, None] == joint, bent @ a.T, 0.0), misfit


def _pair(figures: ArrayLike | tuple[ArrayLike, ArrayLike]) -> tuple[ArrayLike, ...]:
    return figures if isinstance(figures, tuple) else (figures,)


def _on_i(given: JointCompliance, stack: Stack, k: int, bodies: tuple[str, ...]) -> Bool[Array, ""]:
    """Whether the frame is that of body i of the k-th joint of the stack; otherwise it is that of body j."""
    if given.frame is None:
        return jnp.asarray(True)
    index = {name: position for position, name in enumerate((*bodies, GROUND))}
    body = index.get(given.frame, -1)
    if is_concrete(stack.i) and is_concrete(stack.j):
        ends = int(np.asarray(stack.i)[k]), int(np.asarray(stack.j)[k])
        if body not in ends:
            raise ValueError(
                f"Argument `frame` of joint '{given.joint}' must be one of the bodies that it connects, "
                f"{[(*bodies, GROUND)[end] for end in ends]}, but is '{given.frame}'. Name one of them."
            )
    return stack.i[k] == body


def _seat(given: JointCompliance, stack: Stack, k: int, on_i: Array, units: Units, number: int) -> _Seat:
    """The seat of the k-th joint of the stack in the units of the mechanism."""
    scale = jnp.stack([units.length, units.length, units.angle])
    if given.point is not None:
        point = given.point / units.length
    else:
        points = [getattr(stack.element, name, None) for name in ("point_i", "point_j")]
        point = jnp.where(on_i, *(jnp.zeros(2) if point is None else point[k] for point in points))
    compliance = units.energy * given.compliance / (scale[:, None] * scale)
    return _Seat(compliance, given.misfit / scale, point, on_i, jnp.asarray(number))
