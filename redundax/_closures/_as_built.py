"""Parts as they are: the misfit of a mechanism from its geometry.

    d = Phi(q; p + dp) - Phi(q; p),   local points s -> (1 + alpha dT) s of a body warmer by dT

Lengths p as designed, p + dp as made, worn or warm. d is what the constraints of the parts as they are miss at the
position q of those as designed. It does not matter which of two equal positions of a moving joint is the nominal one:
misfits that differ by Phi_q v, the parts displaced by v, are the same to every closure.
"""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from .._bodies._body import GROUND
from .._bodies._mechanism import Mechanism
from .._system._names import index_of
from .._system._state import State
from .._system._system import AbstractSystem, check_system_at
from .._tools._module import as_float, check_kind, replace_fields
from ._closure import AbstractClosure, check_closure
from ._comparison import check_comparable, residual_by_axes_of
from ._play import Play

_ACTUAL = "a mechanism, or a system", "Give the machine as it is, with the joints of the nominal one."


def misfit(system: AbstractSystem, actual: AbstractSystem, state: State) -> Float[Array, " m"]:
    """Misfit d of the parts as they are, shape (m,): m or length unit for force-type rows, rad for moment-type rows.

    ??? example

        ```python
        longer = rx.mechanisms.wojtyra2020(length=0.1001, mu_rho=0.02)
        d = rx.misfit(mechanism, longer, state)
        rx.solve(mechanism, state, closure=rx.Compliance(W=jnp.full(12, 1e-8), misfit=d))
        ```

    **Arguments:**

    - `system`: the system as designed, whose constraints `state` satisfies.
    - `actual`: the same system with its lengths and angles as they are: the same bodies and joints by the same names
      in the same order, axes and normals in the same sense. Its masses, centres of mass, loads and friction do not
      matter.
    - `state`: position and time.

    Its sign is that of what the actual parts miss at the position as designed: of a pin A whose hole in body i sits
    1e-5 m farther along x, "A.x" is 1e-5. Where the actual parts fit without load, the constraints as designed have
    the residual -d.

    In space rows are along the axes of `system`, however axes of `actual` tilt, and whatever its marks are. Joints that
    hold the turn about their axis, such as fixed joints, sliders, screws and drivers, read the mark on one body against
    that on the other: tilt these with a `mark` on both.

    **Raises:** `RedundaxError`, by the name of a body, joint or row, where `actual` is another mechanism.
    """
    check_system_at(system, state)
    check_kind("actual", actual, AbstractSystem, *_ACTUAL)
    check_comparable(system, actual)
    if not (isinstance(actual, Mechanism) and isinstance(system, Mechanism)):
        return actual.constraint(state.q, state.t) - system.constraint(state.q, state.t)
    actual = replace_fields(actual, body=system.body)  # q is where the centres of mass of these bodies are
    return residual_by_axes_of(system, actual, state.q, state.t) - system.constraint(state.q, state.t)


class AsBuilt(AbstractClosure):
    """A closure with the misfit of the parts as they are, in every position.

    ??? example

        ```python
        warm = rx.heated(mechanism, {"2": 40.0}, expansion=12e-6)
        joints = rx.Compliance(W=jnp.full(12, 1e-8))
        rx.solve(mechanism, state, closure=rx.AsBuilt(joints, warm))
        ```

    **Arguments:**

    - `closure`: the compliance, and misfit that comes on top.
    - `actual`: the system with its lengths and angles as they are, as of `misfit`.
    """

    closure: AbstractClosure
    actual: AbstractSystem

    def __init__(self, closure: AbstractClosure, actual: AbstractSystem):
        check_closure(closure)
        check_kind("actual", actual, AbstractSystem, *_ACTUAL)
        self.closure, self.actual = closure, actual

    def by_place(self, system: AbstractSystem) -> "AsBuilt":
        check_comparable(system, self.actual)
        return replace_fields(self, closure=self.closure.by_place(system), actual=self.actual.anonymous)

    def clearances(self, system: AbstractSystem) -> Play | None:
        return self.closure.clearances(system)

    def of_drives(self, names: Sequence[str]) -> tuple[Array, Array]:
        return self.closure.of_drives(names)

    def compliance(self, system: AbstractSystem, state: State) -> tuple[Array, Array]:
        W, d = self.closure.compliance(system, state)
        return W, d + misfit(system, self.actual, state)


def heated(mechanism: Mechanism, warmer: Mapping[str, ArrayLike], expansion: ArrayLike) -> Mechanism:
    """The mechanism with some of its bodies warmer: the points of joints on them have moved.

    A body expands about the origin of its frame; the points are the joints' `point_i` and `point_j`. What belongs to
    no body, such as the length of a `DistanceDriver`, stays, and so do modules of gears and radii of wheels.

    ??? example

        ```python
        warm = rx.heated(mechanism, {"2": 40.0}, expansion=12e-6)  # body "2" is 40 K warmer
        rx.misfit(mechanism, warm, state)  # shape (12,)
        ```

    **Arguments:**

    - `warmer`: temperature differences, K, by name of body, or "ground".
    - `expansion`: coefficient of linear thermal expansion, 1/K.
    """
    check_kind("mechanism", mechanism, Mechanism, "a mechanism", "Give that first, then which bodies are warmer.")
    check_kind("warmer", warmer, Mapping, "differences of temperature by name", 'Write {"2": 40.0}, say.')
    bodies = (*mechanism.names.bodies, GROUND)
    for body in warmer:
        index_of("warmer", body, bodies, " of bodies")
    factor = 1 + as_float(expansion, "expansion") * jnp.stack(
        [as_float(warmer.get(body, 0.0), "warmer") for body in bodies]
    )
    stacks = []
    for stack in mechanism.joints:
        joint = stack.element
        points = {
            f"point_{end}": factor[bodies][:, None] * point
            for end, bodies in (("i", stack.i), ("j", stack.j))
            if (point := joint.point_on(end)) is not None
        }
        stacks.append(replace_fields(stack, element=replace_fields(joint, **points)))
    return replace_fields(mechanism, joints=tuple(stacks))
