"""What contacts that only push leave of loads that are not unique, whatever the joints are made of: linear programmes

    least and largest  y = Y (lam_0 + N z)   over z   with   p = (lam_0 + N z)_c >= 0

without friction, where accelerations are unique and contacts that lift carry nothing in any solution.
"""

import numpy as np

_UNIQUE = 1e-9  # a share of the largest load, above the rounding of N and of a programme


def pushing_ranges(
    names: list[str], outputs: np.ndarray, multipliers: np.ndarray, stress: np.ndarray, pushing: np.ndarray
) -> dict[str, tuple[float, float]]:
    """Least and largest of each output that is not unique, infinite where nothing bounds it.

    **Arguments:**

    - `outputs`: Y, coefficients of the multipliers, shape (outputs, m).
    - `multipliers`: lam_0 with p >= 0, shape (m,); `stress`: N, shape (m, k).
    - `pushing`: indices of the rows of contacts that may carry.
    """
    scale = np.abs(multipliers).max(initial=0.0) or 1.0
    slopes, start = outputs @ stress, outputs @ multipliers
    sizes = np.abs(outputs).max(axis=1, initial=0.0)
    out = {}
    for k in np.flatnonzero(np.linalg.norm(slopes, axis=1) > _UNIQUE * sizes):
        down, up = (scale * _least(sign * slopes[k], stress, multipliers / scale, pushing) for sign in (1, -1))
        rounding = _UNIQUE * scale * sizes[k]
        low, high = (0.0 if abs(x) < rounding else float(x) for x in (start[k] + down, start[k] - up))
        out[names[k]] = (low, low) if high - low < rounding else (low, high)
    return out


def _least(slope: np.ndarray, stress: np.ndarray, multipliers: np.ndarray, pushing: np.ndarray) -> float:
    """The least slope . z; z = 0 is among what is possible, so that there is always an answer."""
    from scipy.optimize import linprog  # here, as its import takes time that few need

    size = np.linalg.norm(slope)
    found = linprog(
        slope / size, A_ub=-stress[pushing], b_ub=np.maximum(multipliers[pushing], 0.0), bounds=(None, None)
    )
    return size * found.fun if found.status == 0 else -np.inf
