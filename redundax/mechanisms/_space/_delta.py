"""Delta robot: a platform on three arms, each with a pair of parallel rods, that shifts without turning

With the arms of length L down by a_k about the tangents at the radius R, rods of length l and the platform's radius r,
its centre p obeys, for the directions e_k outwards and z upwards,

    |p + r e_k - (R + L cos a_k) e_k + L sin a_k z| = l,   k = 1, 2, 3.
"""

import numpy as np
from jax.typing import ArrayLike

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Revolute
from ..._bodies._space._joints._universal import Universal
from ..._system._units import Units
from ..._tools._module import floats, numpy_of
from .._parts import checked
from ._parts import bar


@checked
def delta(
    arm: ArrayLike = 0.25,
    rod: ArrayLike = 0.55,
    radius: ArrayLike = 0.2,
    platform_radius: ArrayLike = 0.06,
    gap: ArrayLike = 0.1,
    angle: ArrayLike = 0.3,
    arm_mass: ArrayLike = 0.3,
    rod_mass: ArrayLike = 0.05,
    platform_mass: ArrayLike = 1.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """Delta robot with universal joints at both ends of its rods.

    Bodies "platform", a disc, and in each of three arms "arm 1", "rod 1a" and "rod 1b", uniform slender bars; revolutes
    "shoulder 1" (arm on the ground), universal joints "elbow 1a", "elbow 1b" (rods on the arm) and "wrist 1a",
    "wrist 1b" (rods on the platform). n = 60, m = 63, rank 57, k = 6, three degrees of freedom: each pair of rods is
    held once too often, and of six twists that hold the platform's orientation three would do.

    ??? example

        ```python
        robot = rx.mechanisms.delta()
        rx.analyze(robot, rx.assemble(robot, rates={"shoulder 1.angle": 1.0}))
        ```

    **Arguments:**

    - `arm`, `rod`: their lengths, m.
    - `radius`, `platform_radius`: distance of shoulders and of wrists from the middle, m.
    - `gap`: between the rods of a pair, m.
    - `angle`: of the arms below the horizontal at the reference pose, rad; positive turns of shoulders add to it.
    - `arm_mass`, `rod_mass`, `platform_mass`: of each, kg.
    - `gravity`: m/s^2, downwards.
    """
    given = (arm, rod, radius, platform_radius, gap, angle, platform_mass, gravity)
    arm, rod, radius, small, gap, angle, heavy, gravity = (floats(x) for x in given)
    xp = numpy_of(arm, rod, radius, small, gap, angle, heavy, gravity)
    up, reach = xp.eye(3)[2], radius + arm * xp.cos(angle)
    height = -arm * xp.sin(angle) - xp.sqrt(rod**2 - (reach - small) ** 2)
    disc = heavy * small**2 / 4 * xp.array([1.0, 1.0, 2.0])
    platform = Body("platform", heavy, disc, position=height * up)
    bodies, joints = [platform], []
    for k in (1, 2, 3):
        turn = 2 * np.pi / 3 * (k - 1)
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        axis = np.array([-np.sin(turn), np.cos(turn), 0.0])
        shoulder, elbow, wrist = radius * out, reach * out - arm * xp.sin(angle) * up, small * out + height * up
        upper = bar(f"arm {k}", arm_mass, shoulder, elbow, axis)
        bodies.append(upper)
        joints.append(Revolute(f"shoulder {k}", upper, GROUND, point=shoulder, axis=axis))
        normal = xp.cross(axis, wrist - elbow) / rod
        for side, aside in (("a", gap / 2 * axis), ("b", -gap / 2 * axis)):
            thin = bar(f"rod {k}{side}", rod_mass, elbow + aside, wrist + aside, axis)
            bodies.append(thin)
            ends = (("elbow", upper, elbow + aside), ("wrist", platform, wrist + aside))
            joints += [Universal(f"{n} {k}{side}", thin, j, p, axis_i=normal, axis_j=axis) for n, j, p in ends]
    return Mechanism(bodies, joints, gravity=-gravity * up, units=Units())
