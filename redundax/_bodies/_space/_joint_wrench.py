"""What a joint in space does to its body, in the frame that is asked for."""

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array

from ..._system._joint_coordinates import joint_reactions
from ..._system._names import index_of
from ..._system._state import State
from ..._tools._errors import RedundaxError
from ..._tools._module import as_float, tree_take
from .._mechanism import Mechanism
from ._pose import Pose, Wrench

FRAMES = ("joint", "body", "global")


def joint_wrench(
    mechanism: Mechanism,
    state: State,
    multipliers: Array,
    joint: str,
    frame: Literal["joint", "body", "global"] = "joint",
) -> Wrench:
    """Force, N, and moment, N m, of a joint on its body i, or on body j where i is the ground, about the joint's point.

    ??? example

        ```python
        door = rx.mechanisms.door()
        closed = rx.assemble(door, rates={"hinge 1.angle": 1.0})
        solution = rx.solve(door, closed)
        rx.spatial.joint_wrench(door, closed, solution.multipliers, "hinge 1", "body").force
        ```

    **Arguments:**

    - `multipliers`: of a solution at the state, shape (m,).
    - `joint`: its name.
    - `frame`: components along the axes of the "joint" on body j, as those of its rows, with z along its axis; of the
      "body" on which they act; or "global".

    The same in global components is `solution["hinge 1 force x on door"]` and so on. A row's multiplier is minus the
    component of that name in the joint's axes where body i is not the ground.
    """
    if frame not in FRAMES:
        raise RedundaxError(f"Argument `frame` must be one of {FRAMES}, but is {frame!r}. Name one of them.")
    bodies = mechanism.poses(state.q)
    if not isinstance(bodies, Pose):
        raise RedundaxError(
            "Argument `mechanism` must be one of `rx.spatial`, but is planar. Read the loads of its joints from "
            'the solution, as in `solution["A force x on rod"]`.'
        )
    multipliers, names = as_float(multipliers, "multipliers"), mechanism.names.joint_names
    place = index_of("joint", joint, names, " of joints")
    loads = joint_reactions(mechanism.joint_coordinates, state, multipliers)[6 * place : 6 * place + 6]
    stack = next(k for k, members in enumerate(mechanism.names.joints) if joint in members)
    member = jnp.asarray(mechanism.names.joints[stack].index(joint))
    own = tree_take(mechanism.joints[stack], member)
    body = jnp.where(own.i == len(mechanism.names.bodies), own.j, own.i)
    turned = own.element.axes_on("j")
    axes = {
        "joint": lambda: tree_take(bodies, own.j).axes @ (jnp.eye(3) if turned is None else turned),
        "body": lambda: tree_take(bodies, body).axes,
        "global": lambda: jnp.eye(3, dtype=loads.dtype),
    }[frame]()
    return Wrench(axes.T @ loads[:3], axes.T @ loads[3:])
