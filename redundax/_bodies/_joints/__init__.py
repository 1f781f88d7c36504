"""Planar joints, Appendix B, one kind a file."""

from ._angle_coupling import AngleCoupling as AngleCoupling
from ._base import AbstractFrictionalJoint as AbstractFrictionalJoint
from ._base import AbstractJoint as AbstractJoint
from ._driver import AngleDriver as AngleDriver
from ._driver import DistanceDriver as DistanceDriver
from ._fixed import Fixed as Fixed
from ._gear import AbstractMesh as AbstractMesh
from ._gear import GearPair as GearPair
from ._gear import whole as whole
from ._pin_in_slot import PinInSlot as PinInSlot
from ._rack_and_pinion import RackAndPinion as RackAndPinion
from ._revolute import Revolute as Revolute
from ._translational import Translational as Translational
