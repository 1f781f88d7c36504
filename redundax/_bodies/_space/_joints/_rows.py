"""Names of rows and coordinates of joints in space: in the axes of body j's side, at the point of body i's

radial_1, radial_2, axial    forces along x, y and the axis z
bend_1, bend_2, twist        moments about x, y and the axis z
"""

from ..._joints._base import Row

RADIAL: tuple[Row, ...] = (("radial_1", "force"), ("radial_2", "force"))
AXIAL: Row = ("axial", "force")
BEND: tuple[Row, ...] = (("bend_1", "moment"), ("bend_2", "moment"))
TWIST: Row = ("twist", "moment")
ANGLE: Row = ("angle", "angular")
TRAVEL: Row = ("travel", "linear")
