"""Compliances spread over ten decades, unique rows far softer or stiffer than the others, misfits of 1e3 and 1e-12."""

from truth import exact
from truth.scenes import carriage, carriage_parameters

from .._case import Case
from ._common import irregular, linkage, paper, spread

FAMILY = "closures"
RUBBING = ("compliance", "fixed point")
SPREADS = (2, 6, 10)
MISFITS = ("1e3", "1", "1e-12")
# Rows of the paper's mechanism with a unique multiplier: the forces of K and L.
UNIQUE = (8, 9)


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    found = []
    for decades in SPREADS[::2] if quick else SPREADS:
        for misfit in MISFITS[::2] if quick else MISFITS:
            name = f"{decades} decades, misfit {misfit}"
            found.append(with_closure(paper(FAMILY, f"paper, {name}", ("compliance",)), decades, misfit))
            found.append(
                with_closure(paper(FAMILY, f"paper, {name}, smooth", ("compliance",), friction=False), decades, misfit)
            )
            found.append(with_closure(linkage(FAMILY, f"cranks, {name}", ("compliance",)), decades, misfit))
            parameters = {**carriage_parameters(3), "compliance": spread(6, decades), "misfit": irregular(6, misfit)}
            found.append(Case(FAMILY, f"carriage, {name}", carriage, parameters, ("compliance",)))
    for factor in ("1e-10", "1e10"):
        case = paper(FAMILY, f"paper, unique rows x {factor}", ("compliance",), friction=False)
        compliance = [x * exact.exact(factor) if row in UNIQUE else x for row, x in enumerate(spread(12, 2))]
        case.parameters["compliance"] = tuple(compliance)
        found.append(case)
    return found


def with_closure(case: Case, decades: int, misfit: str) -> Case:
    """The case with another compliance and misfit."""
    rows = case.exact.m
    return Case(
        case.family,
        case.name,
        case.build,
        {**case.parameters, "compliance": spread(rows, decades), "misfit": irregular(rows, misfit)},
        case.routes,
        friction=case.friction,
    )
