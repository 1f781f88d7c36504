"""Components of a relative pose in space, by the names of the rows that lock them and of the coordinates that are free

radial_1, radial_2, axial    forces along x, y and the axis z
bend_1, bend_2, twist        moments about x, y and the axis z
angle, travel                turn about and offset along the axis; travel_1 and travel_2 along x and y

in the axes of body j's side, at the point of body i's. A turn that is locked whole has other values than a tilt and a
twist.
"""

from ..._joints._base import Row
from ..._joints._components import Components

RADIAL: tuple[Row, ...] = (("radial_1", "force"), ("radial_2", "force"))
AXIAL: Row = ("axial", "force")
BEND: tuple[Row, ...] = (("bend_1", "moment"), ("bend_2", "moment"))
TWIST: Row = ("twist", "moment")
ANGLE: Row = ("angle", "angular")
TRAVEL: Row = ("travel", "linear")
TRAVELS: tuple[Row, ...] = (("travel_1", "linear"), ("travel_2", "linear"))
SPIN: tuple[Row, ...] = (("bend_1", "angular"), ("bend_2", "angular"), ("twist", "angular"))

LOCKED: Components = {
    ("radial_1", "radial_2", "axial"): lambda seen: seen.offset,
    ("bend_1", "bend_2", "twist"): lambda seen: seen.rotation,
    ("radial_1", "radial_2"): lambda seen: seen.shift,
    ("bend_1", "bend_2"): lambda seen: seen.tilt,
    ("axial",): lambda seen: seen.travel[None],
    ("twist",): lambda seen: seen.angle[None],
}
FREE: Components = {
    ("bend_1", "bend_2", "twist"): lambda seen: seen.spin,
    ("travel_1", "travel_2"): lambda seen: seen.shift,
    ("angle",): lambda seen: seen.angle[None],
    ("travel",): lambda seen: seen.travel[None],
}
