"""Chaplygin's sleigh: a body on ice with one blade, whose point lies at the distance a from the centre of mass.

With the speed u along the blade and the turn w, and with J the moment of inertia about the centre of mass, which is
ahead of the blade by a,

    u' = a w^2,   (J + m a^2) w' = -m a u w,   force across the blade  m (a w' + u w) = m J u w / (J + m a^2)

so that u^2 + (J + m a^2) / m w^2 is constant: it ends straight on, the centre of mass ahead of the blade.
"""

from jax.typing import ArrayLike

from .._bodies._body import GROUND, Body
from .._bodies._joints import KnifeEdge
from .._bodies._mechanism import Mechanism
from .._system._units import Units
from .._tools._module import floats
from ._parts import checked, point


@checked
def skate(mass: ArrayLike = 2.0, inertia: ArrayLike = 0.3, ahead: ArrayLike = 0.4) -> Mechanism:
    """Chaplygin's sleigh, seen from above: a body that slides on ice and has one blade.

    Body "sleigh", its frame at the centre of mass, x along the blade; knife edge "blade". n = 3, m = 1: no position is
    out of reach, and two velocities are left.

    ??? example

        ```python
        sleigh = rx.mechanisms.skate()
        rx.solve(sleigh, rx.assemble(sleigh, [0.0, 0.0, 0.0], qd=[1.0, 0.2, 0.5]))["blade.across"]
        ```

    **Arguments:**

    - `mass`: kg.
    - `inertia`: about the centre of mass, kg m^2.
    - `ahead`: how far the centre of mass lies ahead of the blade, m; negative behind it.
    """
    blade = KnifeEdge("blade", "sleigh", GROUND, point(-floats(ahead)), point(1.0))
    return Mechanism([Body("sleigh", mass, inertia)], [blade], units=Units())
