"""Planar joints, Appendix B, and what a joint is."""

from ._angle_coupling import AngleCoupling as AngleCoupling
from ._base import AbstractJoint as AbstractJoint
from ._driver import AngleDriver as AngleDriver
from ._driver import Cable as Cable
from ._driver import DistanceDriver as DistanceDriver
from ._gear import AbstractMesh as AbstractMesh
from ._gear import GearPair as GearPair
from ._gear import whole as whole
from ._pairs import Fixed as Fixed
from ._pairs import PinInSlot as PinInSlot
from ._pairs import Revolute as Revolute
from ._pairs import Translational as Translational
from ._rack_and_pinion import RackAndPinion as RackAndPinion
from ._rubbing import AbstractFrictionalJoint as AbstractFrictionalJoint
from ._rubbing import AbstractRubbingJoint as AbstractRubbingJoint
from ._wheels import KnifeEdge as KnifeEdge
from ._wheels import Wheel as Wheel
