"""Units of length, mass and angle from 1e-4 to 1e4, and bodies 1e8 times lighter or heavier than others.

The numbers themselves in other units, `in_units`, and the norm alone in other units.
"""

from truth import exact
from truth.scenes import wojtyra_parameters

from .._case import Case
from ._common import linkage, paper

FAMILY = "units"
EVERY = ("decided", "declared", "compliance", "fixed point", "vmap")
OPEN = ("1e-4", "1e2")  # the truth of Newton's open iteration takes seconds
FACTORS = ("1e-4", "1e-3", "1e-2", "1e2", "1e3", "1e4")


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    factors = FACTORS[::5] if quick else FACTORS
    found = [in_length(u, friction) for friction in (True, False) for u in factors]
    found += [in_mass(factor) for factor in factors]
    found += [converted(kind, factor) for kind in ("length", "angle", "mass", "time") for factor in factors]
    return found + [with_masses(ratio, friction) for friction in (True, False) for ratio in ("1e-8", "1e8")]


def in_length(u: str, friction: bool) -> Case:
    """Every number in units of 1 / u metres."""
    scale = exact.exact(u)
    changes = {"length": scale / 10, "gravity": 10 * scale, "mu_rho": (scale / 50,) * 4}
    routes = EVERY if friction else ("decided", "declared", "factorize", "vmap")
    if friction and u in OPEN:
        routes = (*routes, "open newton")
    name = f"length x {u}" + ("" if friction else ", smooth")
    return paper(FAMILY, name, routes, friction=friction, **changes)


def in_mass(factor: str) -> Case:
    """Every number in units of 1 / factor kilograms."""
    base, scale = wojtyra_parameters(), exact.exact(factor)
    changes = {name: tuple(x * scale for x in base[name]) for name in ("mass", "inertia")}
    return paper(FAMILY, f"mass x {factor}", ("decided", "compliance", "fixed point", "vmap"), **changes)


def converted(kind: str, factor: str) -> Case:
    """The paper's numbers, turned into other units by the library."""
    return paper(FAMILY, f"{kind} x {factor}", ("in units", "units"), options={"units": {kind: float(factor)}})


def with_masses(ratio: str, friction: bool) -> Case:
    """Masses of bodies in turn: the mass of every other one times the ratio."""
    scale = exact.exact(ratio)
    base = linkage(FAMILY, "", ()).parameters
    changes = {name: tuple(x * scale if c % 2 else x for c, x in enumerate(base[name])) for name in ("mass", "inertia")}
    routes = ("decided", "compliance", "fixed point", "vmap") if friction else ("decided", "factorize", "vmap")
    name = f"mass ratio {ratio}" + ("" if friction else ", smooth")
    return linkage(FAMILY, name, routes, friction=friction, **changes)
