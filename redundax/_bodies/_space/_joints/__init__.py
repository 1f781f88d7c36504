"""Joints in space, by what they leave free."""

from ._base import AbstractJoint as AbstractJoint
from ._base import AbstractPlacedJoint as AbstractPlacedJoint
from ._distance import Cable as Cable
from ._distance import Distance as Distance
from ._drivers import AngleDriver as AngleDriver
from ._drivers import TravelDriver as TravelDriver
from ._frictional import AbstractFrictionalJoint as AbstractFrictionalJoint
from ._gear import Gear as Gear
from ._pairs import ConstantVelocity as ConstantVelocity
from ._pairs import Cylindrical as Cylindrical
from ._pairs import Fixed as Fixed
from ._pairs import Free as Free
from ._pairs import ParallelAxes as ParallelAxes
from ._pairs import Planar as Planar
from ._pairs import PointOnLine as PointOnLine
from ._pairs import PointOnPlane as PointOnPlane
from ._pairs import Prismatic as Prismatic
from ._pairs import Revolute as Revolute
from ._pairs import Spherical as Spherical
from ._screw import Screw as Screw
from ._universal import Universal as Universal
