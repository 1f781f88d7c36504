"""Flyball governor whose coupler rods are stiff springs with dampers

A rod of mass m, length l and square section w, with a ball of mass M at its end, has its centre at c from the pin:

    c = (m / 2 + M) l / (m + M),   J = (m w^2 / 6, J', J'),   J' = m (l^2 + w^2) / 12 + m M / (m + M) l^2 / 4
"""

import numpy as np
from jax.typing import ArrayLike

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Prismatic, Revolute
from ..._bodies._space._loads import SpringDamper
from ..._bodies._space._rotation import axes_along
from ..._system._units import Units
from ..._tools._module import floats, numpy_of
from .._parts import checked


@checked
def governor(
    angle: ArrayLike = np.pi / 6,
    ball_mass: ArrayLike = 5.0,
    stiffness: ArrayLike = 8e5,
    damping: ArrayLike = 4e4,
    free_length: ArrayLike = 0.5,
    length: ArrayLike = 1.0,
    width: ArrayLike = 0.01,
    slider_width: ArrayLike = 0.1,
    density: ArrayLike = 3000.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """Stiff flyball governor: problem A05 of the IFToMM library of computational benchmarks.

    Bodies "shaft", upright on the ground at the origin, "slider", a cube on it, "rod 1" and "rod 2", pinned to the top
    of the shaft and pointing down and outwards, each with a ball at its end, a point mass. Springs with dampers go from
    the slider's sides to the rods' middles. Revolutes "axis" (shaft on the ground), "pin 1" and "pin 2" (rods on the
    shaft), the prismatic joint "sleeve" (slider on the shaft). n = 24, m = 20, rank 20, k = 0, four degrees of freedom.
    In the benchmark the shaft turns freely, at 2 pi rad/s at first. The springs are stiff: an explicit
    solver takes some 1800 steps for each second at any tolerance down to 1e-6, `Radau` some 50.

    ??? example

        ```python
        mechanism = rx.mechanisms.governor()
        rates = {"axis.angle": 6.283, "pin 1.angle": 0.0, "pin 2.angle": 0.0, "sleeve.travel": 0.0}
        rx.solve(mechanism, rx.assemble(mechanism, rates=rates))["sleeve.travel''"]  # it begins to fall
        ```

    **Arguments:**

    - `angle`: of the rods below the horizontal at the reference pose, rad.
    - `ball_mass`: kg.
    - `stiffness`, `damping`, `free_length`: of each spring, N/m, N s/m, m.
    - `length`, `width`: of shaft and rods, and of their square section, m.
    - `slider_width`: edge of the slider, m; the rods' pins are as far apart.
    - `density`: of shaft, rods and slider, kg/m^3.
    - `gravity`: m/s^2, downwards.

    The slider starts at half the height of the shaft.
    """
    given = (angle, ball_mass, length, width, slider_width, density, gravity)
    angle, ball, length, width, cube, density, gravity = (floats(x) for x in given)
    xp = numpy_of(angle, ball, length, width, cube, density, gravity)
    out, across, up = xp.eye(3)
    thin = density * length * width**2
    slender = thin * xp.stack([length**2 + width**2, length**2 + width**2, 2 * width**2]) / 12
    heavy = density * cube**3
    shaft = Body("shaft", thin, slender, centre=length / 2 * up)
    slider = Body("slider", heavy, heavy * cube**2 / 6 * xp.ones(3), position=length / 2 * up)
    joints = [
        Revolute("axis", shaft, GROUND, point=xp.zeros(3), axis=up),
        Prismatic("sleeve", slider, shaft, point=length / 2 * up, axis=up),
    ]
    bending = thin * (length**2 + width**2) / 12 + thin * ball / (thin + ball) * length**2 / 4
    inertia, centre = xp.stack([thin * width**2 / 6, bending, bending]), (thin / 2 + ball) * length / (thin + ball)
    spring = {"stiffness": stiffness, "damping": damping, "free_length": free_length}
    rods, springs = [], []
    for k, side in ((1, out), (2, -out)):
        line = xp.cos(angle) * side - xp.sin(angle) * up
        pin, hook = length * up + cube / 2 * side, length / 2 * up + cube / 2 * side
        axes = axes_along("axis", line, across)[:, (2, 0, 1)]
        rods.append(Body(f"rod {k}", thin + ball, inertia, centre=centre * out, position=pin, orientation=axes))
        joints.append(Revolute(f"pin {k}", rods[-1], shaft, point=pin, axis=across))
        springs.append(SpringDamper(rods[-1], slider, pin + length / 2 * line, hook, **spring))
    return Mechanism([shaft, slider, *rods], joints, loads=springs, gravity=-gravity * up, units=Units())
