"""Numbers and flags as diffrax gives and takes them; its own names for them are private."""

from typing import TypeAlias

import numpy as np
from jaxtyping import Array

Scalar: TypeAlias = float | Array | np.ndarray
Flag: TypeAlias = bool | Array | np.ndarray
