"""Loads on bodies in space; gravity belongs to the mechanism."""

from ._applied import AppliedForce as AppliedForce
from ._base import AbstractLoad as AbstractLoad
from ._function import LoadFunction as LoadFunction
from ._springs import Bushing as Bushing
from ._springs import SpringDamper as SpringDamper
from ._springs import TorsionSpring as TorsionSpring
