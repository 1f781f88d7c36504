"""Shaft between two universal joints, whose output turns as evenly as the input where both angles are equal and the
forks of the shaft lie in one plane

With the angles theta of the input, psi of the shaft between and eta of the output from the reference pose

    tan psi = cos beta tan theta = cos beta' tan eta           forks in one plane
    tan eta = cos beta cos beta' tan theta                     forks square to each other
"""

from jax.typing import ArrayLike

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._joints._pairs import Revolute
from ..._bodies._space._joints._universal import Universal
from ..._system._units import Units
from ..._tools._module import floats, numpy_of
from .._parts import checked
from ._parts import bar


@checked
def double_cardan(
    angle: ArrayLike = 0.5,
    other_angle: ArrayLike | None = None,
    fork: ArrayLike = 0.0,
    length: ArrayLike = 0.5,
    width: ArrayLike = 0.03,
    mass: ArrayLike = 2.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """Double Cardan shaft in the plane of its three axes, input and output on one side each: Z arrangement.

    Bodies "input", "shaft" and "output", uniform bars of one length and a square section; revolutes "inlet" and
    "outlet" on the ground, universal joints "first" and "second" at both ends of the shaft. n = 18, m = 18, rank 17,
    k = 1, one degree of freedom: the axial force of the shaft is not unique.

    ??? example

        ```python
        drive = rx.mechanisms.double_cardan()
        rx.solve(drive, rx.assemble(drive, rates={"inlet.angle": 10.0}))["outlet.angle'"]  # 10.0
        ```

    **Arguments:**

    - `angle`, `other_angle`: between the axes of input and shaft, of shaft and output, rad; equal if not given.
    - `fork`: angle of the shaft's second fork about it from the first, rad; 0 with equal angles for even motion.
    - `length`: of each body, m.
    - `width`: of its section, m.
    - `mass`: of each body, kg.
    - `gravity`: m/s^2, against the normal of the plane of the axes.
    """
    beta, fork, length, gravity = (floats(x) for x in (angle, fork, length, gravity))
    other = beta if other_angle is None else floats(other_angle)
    xp = numpy_of(beta, other, fork, length, gravity)
    ahead, normal = xp.eye(3)[2], xp.eye(3)[1]
    inlet, outlet = (xp.stack([xp.sin(x), 0 * x, xp.cos(x)]) for x in (beta, other))
    end = length * ahead
    first = bar("input", mass, -length * inlet, xp.zeros(3), normal, width)
    shaft = bar("shaft", mass, xp.zeros(3), end, normal, width)
    last = bar("output", mass, end, end + length * outlet, normal, width)
    pin = xp.stack([xp.cos(fork), xp.sin(fork), 0 * fork])
    joints = [
        Revolute("inlet", first, GROUND, point=-length * inlet, axis=inlet),
        Universal("first", shaft, first, (0.0, 0.0, 0.0), axis_i=xp.eye(3)[0], axis_j=normal),
        Universal("second", last, shaft, end, axis_i=xp.cross(outlet, pin), axis_j=pin),
        Revolute("outlet", last, GROUND, point=end + length * outlet, axis=outlet),
    ]
    return Mechanism([first, shaft, last], joints, gravity=-gravity * normal, units=Units())
