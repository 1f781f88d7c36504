"""Joints in space, by what they leave free."""

from ._base import AbstractJoint as AbstractJoint
from ._base import AbstractPlacedJoint as AbstractPlacedJoint
from ._contacts import ParallelAxes as ParallelAxes
from ._contacts import PointOnLine as PointOnLine
from ._contacts import PointOnPlane as PointOnPlane
from ._distance import Distance as Distance
from ._drivers import AngleDriver as AngleDriver
from ._drivers import TravelDriver as TravelDriver
from ._frictional import AbstractFrictionalJoint as AbstractFrictionalJoint
from ._gear import Gear as Gear
from ._pairs import Fixed as Fixed
from ._pairs import Free as Free
from ._prismatic import Prismatic as Prismatic
from ._revolute import Revolute as Revolute
from ._screw import Screw as Screw
from ._shafts import ConstantVelocity as ConstantVelocity
from ._sliding_pairs import Cylindrical as Cylindrical
from ._sliding_pairs import Planar as Planar
from ._sliding_pairs import Spherical as Spherical
from ._universal import Universal as Universal
