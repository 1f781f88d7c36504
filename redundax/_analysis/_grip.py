"""The friction coefficient that a wheel needs so as not to slip: |F_t, F_s| / F_n of the force where it touches."""

import numpy as np
from jaxtyping import Array, Float

from .._bodies._joints._wheels import AbstractRollingRows
from .._bodies._mechanism import Mechanism
from .._solve._solution import Solution
from .._tools._module import check_kind
from .._tools._numbers import computed, or_one, xp


def grip(mechanism: Mechanism, solution: Solution) -> dict[str, Float[Array, "*batch"]]:
    """The friction coefficient that each wheel needs at a solution so as to roll, by the name of its joint.

    A wheel slips where the floor has less. Where its load is not unique this is that of the solution's closure.

    ??? example

        ```python
        cart = rx.mechanisms.cart()
        rx.grip(cart, rx.solve(cart, rx.assemble(cart)))["front left tyre"]
        ```

    **Arguments:**

    - `mechanism`: with joints `Wheel` that have the row "normal" and one of rolling at least; others are left out.
    - `solution`: of it, or a batch.

    **Returns:** a number for each wheel, 0 where it rolls freely or lifts, and infinite where it is not pressed on but
    must hold.
    """
    check_kind("mechanism", mechanism, Mechanism, "a mechanism", "Give that first, then its solution.")
    check_kind("solution", solution, Solution, "a solution", "Give what `rx.solve` gives.")
    labels, found = mechanism.rows.labels, {}
    for stack, names in zip(mechanism.joints, mechanism.names.joints, strict=True):
        wheel = stack.element
        if isinstance(wheel, AbstractRollingRows) and wheel.pushing and wheel.velocity_rows:
            ends = wheel.pushing, wheel.velocity_rows
            for name in names:
                normal, rolling = ([labels.index(f"{name}.{row}") for row in of] for of in ends)
                found[name] = _needed(solution.multipliers, np.array(normal), np.array(rolling))
    return found


@computed
def _needed(multipliers: Float[Array, "*batch m"], normal: np.ndarray, rolling: np.ndarray) -> Float[Array, "*batch"]:
    pressed, square = multipliers[..., normal[0]], xp.sum(multipliers[..., rolling] ** 2, axis=-1)
    held = xp.where(square > 0, xp.sqrt(or_one(square)), 0.0)  # a derivative of 0 at 0
    ratio = held / or_one(pressed)
    return xp.where(pressed > 0, ratio, xp.where(held > 0, xp.inf, 0.0))
