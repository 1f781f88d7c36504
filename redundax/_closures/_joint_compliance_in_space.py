"""Compliance and misfit of one joint in space."""

from typing import ClassVar

from .._bodies._frame import AbstractFrame
from .._bodies._space._frame import SPACE
from ._joint_compliance import AbstractJointCompliance


class JointCompliance(AbstractJointCompliance):
    """Compliance and misfit of one joint in space, along its own axes on one of the bodies that it connects.

    The axes are x, y and z of the joint, z along its axis, as that body carries them; rows of a joint, as radial_1,
    radial_2 and axial, are along those on body j. A joint without axes has those of the body. Only what the joint holds
    counts: a hinge takes no moment about its axis, so that the compliance of its seat to such a moment has no effect.

    ??? example

        ```python
        hinge = rx.spatial.JointCompliance("top", (1e-8, 1e-8, 4e-8), 1e-5, misfit=(2e-5, 0, 0, 0, 1e-3, 0))
        guide = rx.spatial.JointCompliance("column", 2e-8, 1e-6, frame="ground", point=(0.0, 0.0, 0.5))
        ```

    **Arguments:**

    - `joint`: its name.
    - `translation`: shift by force, m/N: one number, one each along x, y and z, or a (3, 3) matrix.
    - `rotation`: turn by moment, rad/(N m), likewise.
    - `coupling`: turn by force, rad/N, shape (3, 3) with a row for each turn; by symmetry also shift by moment. Zero
      where the reference point is the centre of compliance, and if not given.
    - `misfit`: v0, by how much the parts as they are place body i's side of the joint elsewhere than on body j's
      without load: shift in m (3,), and misalignment as turns about x, y and z in rad (3,), shape (6,). Where body j is
      a bearing that sits 0.05 mm too high, v0 is 0.05 mm down.
    - `frame`: name of the body, or "ground", with whose side of the joint all this turns; body i if not given. What
      belongs to a housing that stands still is given on the ground.
    - `point`: reference point in the local frame of that body, m; the joint's own point on it if not given.
    """

    space: ClassVar[AbstractFrame] = SPACE
    __init__ = AbstractJointCompliance.__init__
