"""Sarrus linkage: a platform on folding arms in different planes that let it go straight up and down

Bars of length l and mass m, two in each of N arms, that rise by phi; platform of mass M at the height h = 2 l sin phi:

    2 T = M h'^2 + N m l^2 phi'^2 (2 / 3 + 2 cos(phi)^2)
"""

import numpy as np
from jax.typing import ArrayLike

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Revolute
from ..._system._units import Units
from ..._tools._module import Numbers, floats, numpy_of
from .._parts import checked, several
from ._parts import bar


@checked
def sarrus(
    directions: Numbers = (0.0, 2 * np.pi / 3),
    length: ArrayLike = 0.3,
    radius: ArrayLike = 0.1,
    angle: ArrayLike = 0.6,
    mass: ArrayLike = 0.5,
    platform_mass: ArrayLike = 2.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """Sarrus linkage: straight motion by revolutes alone.

    Bodies "platform" and, in each arm, "lower 1" and "upper 1", uniform slender bars; revolutes of parallel axes A1
    (lower bar on the ground), B1 (upper bar on it), C1 (platform on that). n = 6 + 12 arms, m = 15 arms,
    rank 5 + 12 arms, k = 3 arms - 5, one degree of freedom: with two arms 30, 30, 29 and 1.

    ??? example

        ```python
        linkage = rx.mechanisms.sarrus()
        rx.analyze(linkage, rx.assemble(linkage, rates={"A1.angle": 1.0}))
        ```

    **Arguments:**

    - `directions`: of the arms about the vertical, rad, at least two that are not opposite.
    - `length`: of a bar, m.
    - `radius`: distance of the arms' ends from the vertical axis, m.
    - `angle`: of the bars above the horizontal at the reference pose, rad.
    - `mass`: of a bar, kg.
    - `platform_mass`: kg; a disc of that radius.
    - `gravity`: m/s^2, downwards.
    """
    angles = several("directions", directions)
    length, radius, rise, mass, heavy, gravity = map(floats, (length, radius, angle, mass, platform_mass, gravity))
    xp = numpy_of(angles, length, radius, rise, mass, heavy, gravity)
    up = xp.eye(3)[2]
    top = 2 * length * xp.sin(rise) * up
    disc = heavy * radius**2 / 4 * xp.array([1.0, 1.0, 2.0])
    platform = Body("platform", heavy, disc, position=top)
    bodies, joints = [platform], []
    for k, turn in enumerate(angles, 1):
        out = xp.stack([xp.cos(turn), xp.sin(turn), 0 * turn])
        foot, axis = radius * out, xp.cross(out, up)
        knee = foot + length * (xp.cos(rise) * out + xp.sin(rise) * up)
        lower = bar(f"lower {k}", mass, foot, knee, axis)
        upper = bar(f"upper {k}", mass, knee, foot + top, axis)
        bodies += [lower, upper]
        pairs = (("A", lower, GROUND, foot), ("B", upper, lower, knee), ("C", platform, upper, foot + top))
        joints += [Revolute(f"{name}{k}", i, j, point=point, axis=axis) for name, i, j, point in pairs]
    return Mechanism(bodies, joints, gravity=-gravity * up, units=Units())
