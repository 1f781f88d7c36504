"""Many redundant constraints, k up to 20, and constraints that are nearly dependent but not redundant."""

from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import carriage, carriage_parameters

from .._case import Case
from .._linear import linear
from ._common import closed, irregular, linkage

FAMILY = "redundant"
ROUTES = ("decided", "declared", "compliance", "factorize")
SHORT = ("decided", "compliance")
SIZES = ("1e-2", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12", "1e-14")


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    found = [many_guides(guides) for guides in ((3,) if quick else (3, 11))]
    found += [linkage(FAMILY, f"{count} cranks, k = {count - 2}", SHORT, count) for count in (() if quick else (7, 12))]
    return found + [nearly(size) for size in (SIZES[::3] if quick else SIZES)]


def many_guides(guides: int) -> Case:
    """A carriage with k = 2 (guides - 1)."""
    parameters = closed(carriage_parameters(guides), 2 * guides)
    routes = SHORT if guides > 3 else ROUTES
    return Case(FAMILY, f"{guides} guides, k = {2 * guides - 2}", carriage, parameters, routes)


@exactly
def nearly(size: str) -> Case:
    """Three independent rows of which the third is the sum of the others but for a small part; two that repeat them."""
    first, second, third = (irregular(6), irregular(7)[1:], irregular(8)[2:])
    part = exact.exact(size)
    last = tuple(a + b + part * c for a, b, c in zip(first, second, third, strict=True))
    parameters = {
        "mass": exact.exact(("1", "2", "1/2", "3", "1", "3/2")),
        "load": irregular(6, 10),
        "free": (first, second, last),
        "combinations": exact.exact((("1", "-2", "0"), ("0", "1/3", "0"))),
        "gamma": (mp.mpf(1), mp.mpf(-2), mp.mpf(-1) + part),
    }
    return Case(FAMILY, f"nearly dependent by {size}", linear, closed(parameters, 5), (*ROUTES, "vmap"))
