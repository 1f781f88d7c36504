"""Parallelograms near their flat position, at angles 1e-1 to 1e-14, and in it.

Near it one more singular value of the constraints goes to zero with the angle; in it the rank drops. Two cranks are
given as a four-bar linkage of four lengths, which perturbations change one by one; three cranks stay parallel. In the
flat position itself (7) lacks the condition that keeps accelerations on a branch, so that only a flag is right of the
routes that do not add it; those that do are in `tests/equations/test_singular_positions.py`.
"""

from functools import partial

from truth import exact
from truth.scenes import cranks, cranks_parameters, four_bar

from .._case import Case
from ._common import closed

FAMILY = "singular"
ROUTES = ("decided", "declared", "compliance", "factorize", "vmap")
ANGLES = tuple(f"1e-{k}" for k in range(1, 15))


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    angles = ANGLES[::4] if quick else ANGLES
    found = [three(angle) for angle in angles] + [two(angle) for angle in angles]
    rubbing = tuple(f"1/{100 + 20 * c}" for c in range(6))
    found += [
        three(angle, friction=True, mu_rho=rubbing) for angle in ("1e-1", "1e-3", "1e-5", "1e-7")[:: 3 if quick else 1]
    ]
    return [*found, three("0"), three("0", friction=True, mu_rho=rubbing)]


def three(angle: str, friction: bool = False, **changes) -> Case:
    """Three parallel cranks."""
    parameters = closed(cranks_parameters(3, phi=angle, **changes), 12)
    name = f"three cranks at {angle}" + (", friction" if friction else "")
    flat = angle == "0"
    routes = ("decided", "declared", "fixed point", "vmap") if friction else ("vmap",) if flat else ROUTES
    return Case(FAMILY, name, partial(cranks, flat=flat), parameters, routes, friction=friction, unsolvable=flat)


def two(angle: str) -> Case:
    """A four-bar linkage whose lengths happen to be those of a parallelogram."""
    given = {
        "crank": "1/2",
        "coupler": "5/6",
        "rocker": "1/2",
        "ground": "5/6",
        "phi": angle,
        "rate": "2",
        "gravity": "981/100",
        "mass": (1, 2, "3/2"),
        "inertia": ("1/50", "1/5", "1/25"),
        "mu_rho": (0,) * 4,
    }
    parameters = closed({name: exact.exact(value) for name, value in given.items()}, 8)
    return Case(FAMILY, f"two cranks at {angle}", four_bar, parameters, ("decided", "declared", "factorize"))
