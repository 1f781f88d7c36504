"""Parts that mechanisms in space share: bars of square section, and closed chains of them.

bar     from a start to an end: local frame at the start, x along it, y along an axis square to it
        J = m (w^2 / 6, (l^2 + w^2) / 12, (l^2 + w^2) / 12)
chain   bars from each point to the next; the ground is the last link, from the last point to the first
"""

from collections.abc import Sequence

from ..._bodies._body import GROUND
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Revolute
from ..._bodies._space._rotation import axes_along
from ..._tools._module import Numbers, floats, numpy_of
from ..._tools._numbers import Numeric

_NAMES = "ABCDEF"


def bar(
    name: str, mass: Numbers, start: Numbers, end: Numbers, axis: Numbers | None = None, width: Numbers = 0
) -> Body:
    """A uniform bar of a square section, whose y axis is along the part of `axis` that is square to it."""
    mass, width, start, end = (floats(value) for value in (mass, width, start, end))
    line = end - start
    xp, square = numpy_of(line, mass, width), line @ line
    across = mass * (square + width**2) / 12
    return Body(
        name,
        mass,
        xp.stack([mass * width**2 / 6, across, across]),
        centre=xp.sqrt(square) / 2 * xp.eye(3)[0],
        position=start,
        orientation=axes_along("axis", line, axis)[:, (2, 0, 1)],
    )


def chain(
    points: Sequence[Numeric] | Numeric, axes: Sequence[Numeric] | Numeric, mass: Numbers, width: Numbers = 0
) -> tuple[list[Body], list[Revolute]]:
    """Bars "1", "2", ... and the revolutes "A", "B", ... at the points: each of a bar on the one before it."""
    bodies = [bar(str(k + 1), mass, points[k], points[k + 1], axes[k], width) for k in range(len(points) - 1)]
    links = [GROUND, *bodies, GROUND]
    joints = [Revolute(_NAMES[k], links[k + 1], links[k], point=points[k], axis=axes[k]) for k in range(len(points))]
    return bodies, joints
