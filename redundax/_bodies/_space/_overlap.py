"""The part of a slider that is within its guide

    from  max(x + a_1, b_1)  to  min(x + a_2, b_2),   x the travel,

with the ends a of the slider from the joint's point on body i and those b of the guide from its point on body j.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._tools._errors import RedundaxError
from ..._tools._module import Numbers, as_float, is_concrete
from ..._tools._value import AbstractModule


class Overlap(AbstractModule):
    """The contact of a slider and a guide that is as long as they overlap, about the middle of that part.

    Where they do not overlap nothing guides the slider: friction is not finite there.

    ??? example

        ```python
        drawer = rx.spatial.Body("drawer", 4.0, inertia=(0.1, 0.1, 0.1))
        runs = rx.spatial.Overlap(slider=(-0.2, 0.2), guide=(-0.25, 0.2))  # the drawer shortens it as it comes out
        rubs = {"guide_length": runs, "twist_radius": 0.15, "friction": rx.Coulomb(0.2)}
        rx.spatial.Prismatic("rails", drawer, "ground", point=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 0.0), **rubs)
        ```

    **Arguments:**

    - `slider`: both ends along the joint's axis, from its point on body i, m.
    - `guide`: likewise from its point on body j, m.
    """

    slider: Float[Array, "2"]
    guide: Float[Array, "2"]

    def __init__(self, slider: Numbers, guide: Numbers):
        self.slider, self.guide = as_float(slider, "slider"), as_float(guide, "guide")
        for name, ends in (("slider", self.slider), ("guide", self.guide)):
            if ends.shape != (2,) or (is_concrete(ends) and not 0 < np.diff(np.asarray(ends)) < np.inf):
                raise RedundaxError(
                    f"Argument `{name}` must be two finite positions along the axis, the smaller first, but is {ends}. "
                    "Give both ends, m."
                )

    def at(self, travel: Float[Array, ""]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Length of the contact, NaN where there is none, and its middle from the joint's point on body i."""
        first = jnp.maximum(self.slider[0], self.guide[0] - travel)
        last = jnp.minimum(self.slider[1], self.guide[1] - travel)
        return jnp.where(last > first, last - first, jnp.nan), (first + last) / 2
