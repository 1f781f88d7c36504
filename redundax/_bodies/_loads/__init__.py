"""Loads on planar bodies, one kind a file; gravity belongs to the mechanism."""

from ._applied import AppliedForce as AppliedForce
from ._base import AbstractLoad as AbstractLoad
from ._function import AbstractLoadFunction as AbstractLoadFunction
from ._function import LoadFunction as LoadFunction
from ._spring import SpringDamper as SpringDamper
from ._spring import TorsionSpring as TorsionSpring
