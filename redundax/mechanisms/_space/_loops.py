"""Closed chains of bars on revolutes, square to both of their axes: Bennett's of four, Bricard's of six

Bennett: opposite bars alike, of lengths a, b and twists alpha, beta from axis to axis, with a / sin alpha =
b / sin beta. With the angles of joints theta and phi from bar to bar

    tan(theta / 2) tan(phi / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2),
    theta + theta_C = phi + phi_D = 2 pi.

Bricard: six bars of one length with twists of +90 and -90 degrees in turn. At the reference pose they are edges of a
cube.
"""

import numpy as np
from jax.typing import ArrayLike

from ..._bodies._mechanism import Mechanism
from ..._system._units import Units
from ..._tools._module import floats, numpy_of
from .._parts import checked
from ._parts import chain


@checked
def bennett(
    length: ArrayLike = 0.6,
    twist: ArrayLike = 0.6435011087932844,
    other_twist: ArrayLike = np.pi / 2,
    angle: ArrayLike = np.pi / 2,
    mass: ArrayLike = 1.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """Bennett's linkage: four bars in space that move although a count of constraints forbids it.

    Bodies "1", "2" and "3", uniform slender bars; the ground is the fourth, from joint D to joint A at the origin.
    Revolutes A (1 on the ground), B (2 on 1), C (3 on 2), D (ground on 3). n = 18, m = 20, rank 17, k = 3, one degree
    of freedom.

    ??? example

        ```python
        linkage = rx.mechanisms.bennett()
        rx.analyze(linkage, rx.assemble(linkage, rates={"A.angle": 1.0}))
        ```

    **Arguments:**

    - `length`: of bars 1 and 3, m; the others are as long as Bennett's condition asks.
    - `twist`, `other_twist`: angle between the axes at both ends of bars 1 and 3, and of bar 2 and the ground, rad.
    - `angle`: at the reference pose from the line of the ground to bar 1, rad.
    - `mass`: of each bar, kg.
    - `gravity`: m/s^2, against the axis of joint A.
    """
    length, alpha, beta, theta, mass, gravity = (floats(x) for x in (length, twist, other_twist, angle, mass, gravity))
    xp = numpy_of(length, alpha, beta, theta, mass, gravity)
    ratio = xp.sin((beta + alpha) / 2) / xp.sin((beta - alpha) / 2)
    phi = 2 * xp.arctan2(ratio * xp.cos(theta / 2), xp.sin(theta / 2))
    other = length * xp.sin(beta) / xp.sin(alpha)
    points, axes, frame = [xp.zeros(3)], [xp.eye(3)[2]], xp.eye(3)
    for turn, reach, tilt in ((theta, length, alpha), (phi, other, beta), (-theta, length, alpha)):
        along, across, axis = xp.moveaxis(frame, 1, 0)
        line = xp.cos(turn) * along + xp.sin(turn) * across
        next_axis = xp.cos(tilt) * axis - xp.sin(tilt) * xp.cross(axis, line)
        points, axes = [*points, points[-1] + reach * line], [*axes, next_axis]
        frame = xp.stack([line, xp.cross(next_axis, line), next_axis], axis=1)
    down = gravity * xp.stack([0.0, 0.0, -1.0])
    return Mechanism(*chain(points, axes, mass), gravity=down, units=Units())


@checked
def bricard(
    length: ArrayLike = 1.0, width: ArrayLike = 0.1, mass: ArrayLike = 1.0, gravity: ArrayLike = 9.81
) -> Mechanism:
    """Bricard's mechanism of six revolutes: problem A04 of the IFToMM library of computational benchmarks.

    Bodies "1" to "5", uniform bars of a square section along edges of a cube; the sixth link is the ground. Revolutes
    A (1 on the ground, at the origin) to F (ground on 5), each square to both of its bars. n = 30, m = 30, rank 29,
    k = 1, one degree of freedom. In the benchmark it is released at rest from the reference pose.

    ??? example

        ```python
        mechanism = rx.mechanisms.bricard()
        rx.simulate(mechanism, rx.assemble(mechanism), 1.0)
        ```

    **Arguments:**

    - `length`: of a bar, m.
    - `width`: of its section, m.
    - `mass`: of a bar, kg.
    - `gravity`: m/s^2, against the axis y, which is that of joint A.
    """
    length, gravity = floats(length), floats(gravity)
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]])
    axes = np.eye(3)[[1, 2, 0, 1, 2, 0]]
    down = gravity * np.array([0.0, -1.0, 0.0])
    return Mechanism(*chain([*(length * corners)], [*axes], mass, width), gravity=down, units=Units())
