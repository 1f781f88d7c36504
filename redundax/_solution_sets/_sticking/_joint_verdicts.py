"""What is known of each joint at rest: whether it sticks, over all states that were found to be possible.

A joint whose slip no motion of the mechanism changes sticks. A state in which a joint sticks and one in which it slips
say that it may stick; that it must stick, or slip, is as good as the search, unless it is proved.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._at_rest import Ends


class Joints(NamedTuple):
    """Verdict on each slip, whether it is proved, shape (p,), and the senses in which it was found to start."""

    verdicts: tuple[str, ...]
    proved: np.ndarray
    senses: tuple[tuple[int, ...], ...]


def joint_verdicts(ends: Ends, blocked: np.ndarray, proves: Callable[[str, int], bool]) -> Joints:
    """What states found say of each slip, with a proof of `proves(verdict, slip)`."""
    verdicts, proved, senses = [], [], []
    for joint, found in enumerate(map(set, ends.sense.T.astype(int).tolist())):
        slips = found - {0}
        verdict = "may stick" if slips and 0 in found else "must slip" if slips else "must stick"
        verdicts.append(verdict if found else "undecided")
        proved.append(bool(found) and bool(blocked[joint] or proves(verdict, joint)))
        senses.append(tuple(sorted(slips)))
    return Joints(tuple(verdicts), np.array(proved, bool), tuple(senses))
