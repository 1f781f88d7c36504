"""States off the manifold by 1e-12 to 1e-4, in position and velocity.

A sharp tolerance then takes full rank: accelerations 100 % wrong, multipliers of 1e12. The disturbance counts as one
of the inputs: the bound is that of neighbours at its distance. Beyond 1e-6 the documentation refuses such states, in
float32 beyond 2e-3.
"""

import dataclasses
from functools import partial

from truth import exact
from truth.exact import exactly

from .._case import Case
from ._common import irregular, linkage, paper

FAMILY = "drift"
RUBBING = ("decided", "declared", "compliance", "fixed point", "vmap")
SMOOTH = ("decided", "declared", "factorize", "vmap")
SIZES = ("1e-12", "1e-11", "1e-10", "1e-9", "1e-8", "1e-7", "1e-6", "1e-5", "1e-4")


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    found = []
    for size in SIZES[::3] if quick else SIZES:
        options = {"disturb": partial(moved, size=size), "size": float(size), "refused": float(size) > 2e-7}
        found += [
            paper(FAMILY, f"paper off by {size}", RUBBING, options=options),
            linkage(FAMILY, f"cranks off by {size}", SMOOTH, options=options),
            paper(FAMILY, f"paper off by {size}, smooth", SMOOTH, friction=False, options=options),
        ]
    return found


@exactly
def moved(mechanism: exact.Mechanism, size: str) -> exact.Mechanism:
    """Coordinates and velocities off by a relative size, without a pattern."""
    length = max(abs(x) for x in mechanism.q)
    speed = max(abs(x) for x in mechanism.qd)
    shift = irregular(2 * mechanism.n, size)
    return dataclasses.replace(
        mechanism,
        q=tuple(x + length * d for x, d in zip(mechanism.q, shift[: mechanism.n], strict=True)),
        qd=tuple(x + speed * d for x, d in zip(mechanism.qd, shift[mechanism.n :], strict=True)),
    )
