"""Door on hinges of one axis: one of them would do, and each of the others repeats its five constraints.

With width w, thickness s, the angle phi from where it hangs and an axis that leans by alpha

    m (w^2 / 3 + s^2 / 12) phi'' = -m g sin alpha (w / 2) sin phi.
"""

from jax.typing import ArrayLike

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Revolute
from ..._system._units import Units
from ..._tools._module import Numbers, floats, numpy_of
from .._parts import checked, several


@checked
def door(
    heights: Numbers = (0.2, 1.0, 1.8),
    width: ArrayLike = 1.0,
    height: ArrayLike = 2.0,
    thickness: ArrayLike = 0.04,
    mass: ArrayLike = 20.0,
    lean: ArrayLike = 0.05,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A door on hinges of one axis.

    Body "door", a uniform plate, local frame at the foot of the axis, x along the width, z along the axis; hinges
    "hinge 1", "hinge 2", ... n = 6, m = 5 hinges, rank 5, k = 5 (hinges - 1), one degree of freedom, "hinge 1.angle",
    which is 0 where the door hangs. With three hinges m = 15 and k = 10, and no load of a hinge is unique.

    ??? example

        ```python
        door = rx.mechanisms.door()
        rx.solve(door, rx.assemble(door, rates={"hinge 1.angle": 1.0}))
        ```

    **Arguments:**

    - `heights`: of the hinges on the axis, m, one or more.
    - `width`, `height`, `thickness`: of the plate, m.
    - `mass`: kg.
    - `lean`: of the axis from the vertical, rad, towards where the door hangs.
    - `gravity`: m/s^2.
    """
    heights = several("heights", heights)
    width, height, thickness, mass, lean, gravity = (floats(x) for x in (width, height, thickness, mass, lean, gravity))
    squares = (height**2 + thickness**2, height**2 + width**2, width**2 + thickness**2)
    xp, zero = numpy_of(heights, width, height, thickness, mass, lean, gravity), 0.0 * width
    body = Body("door", mass, mass / 12 * xp.stack(squares), centre=xp.stack([width / 2, zero, height / 2]))
    hinges = [
        Revolute(f"hinge {k + 1}", body, GROUND, point=xp.stack([zero, zero, z + zero])) for k, z in enumerate(heights)
    ]
    down = gravity * xp.stack([xp.sin(lean), 0 * lean, -xp.cos(lean)])
    return Mechanism([body], hinges, gravity=down, units=Units())
