"""One-sided contacts of all rows, whichever hold: by one program, that of any set of them."""

import numpy as np
from jaxtyping import Array, Float

from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._numbers import take, xp
from ._kinematics import Model, model_at
from ._scaling import scaling


def model_of_all(system: AbstractSystem, state: State) -> Model:
    """The model with the rows of all contacts."""
    return model_at(system.opened(xp.ones(len(system.rows), bool)).anonymous.without_friction, state)


def overlaps(system: AbstractSystem, state: State) -> Float[Array, " contacts"]:
    """Minus the gaps of contacts, relative to the size of the system."""
    model = model_of_all(system, state)
    scales = scaling(system, model)
    return take(scales.violations(model.motion.value), np.array(system.names.one_sided, int))
