"""Friction beyond contraction: one, two, four and no solutions of the frictional equations.

The paper's mechanism at several angles, in both senses, as mu_rho grows; a joint without load, from x0 = 0, at rest
with a given sense. The number of solutions comes from all complex roots of the four quadratics behind the equations.
"""

from functools import cache

from mpmath import mp
from truth import exact
from truth.exact import exactly
from truth.scenes import wojtyra, wojtyra_parameters

from .._case import Case
from ._common import paper

FAMILY = "folds"
ROUTES = ("decided", "newton", "fixed point", "from x0", "vmap")
ANGLES = ("pi/4", "3/2", "11/5")
# Two and four solutions.
SEVERAL = (
    ("1/4", 3, "29/200"),
    ("1/4", 3, "17/100"),
    ("29/10", -3, "19/100"),
    ("31/10", -1, "3/20"),
    ("11/5", -1, "7/50"),
)
LEVELS = ("1/50", "1/10", "13/100", "3/20", "1/2")


def cases(quick: bool) -> list[Case]:
    """All cases of the family."""
    found = []
    for angle in ANGLES[::2] if quick else ANGLES:
        changes = {} if angle == "pi/4" else {"phi": angle}
        for rate in (1, -1):
            for level in LEVELS[1::2] if quick else LEVELS:
                name = f"{angle}, sense {rate:+d}, mu_rho {level}"
                found.append(paper(FAMILY, name, ROUTES, mu_rho=(level,) * 4, rate=rate, **changes))
    for angle, rate, level in SEVERAL:
        name = f"{angle}, rate {rate}, mu_rho {level}"
        found.append(paper(FAMILY, name, (*ROUTES, "enumerate"), mu_rho=(level,) * 4, rate=rate, phi=angle))
    return [*found, *resting(), *without_load()]


def resting() -> list[Case]:
    """At rest, with the sense of the impending slip; without it, and as slow as rounding, no answer exists."""
    options = {"sense": True}
    routes = ("decided", "fixed point", "from x0", "vmap")
    found = [
        paper(FAMILY, f"at rest, sense {sign}", routes, rate=exact.exact(f"{sign}1e-40"), options=options)
        for sign in "+-"
    ]
    for rate in ("1e-40", "1e-18"):
        slow = exact.exact(rate)
        found.append(paper(FAMILY, f"at rate {rate}, no sense", routes[:2], rate=slow, options={"unsolvable": True}))
    return found


def without_load() -> list[Case]:
    """A joint whose load is zero, or small beside the others: |R| has no derivative there."""
    return [
        paper(FAMILY, f"|R_A| = 0, load off by {off}", ("decided", "fixed point", "from x0", "vmap"), loads=_loads(off))
        for off in ("0", "1e-12", "1e-6")
    ]


@exactly
def _loads(off: str) -> tuple:
    """Loads of which the one on the first crank makes R_A vanish, but for a relative change of it."""
    return _on_first_crank(x * (1 + exact.exact(off)) for x in _vanishing())


def _on_first_crank(force) -> tuple:
    return ((*force, 0), *((0,) * 3,) * 3)


@cache
@exactly
def _vanishing() -> tuple:
    """The force; friction in A itself does not matter."""

    def remaining(*force):
        parameters = wojtyra_parameters(loads=_on_first_crank(force), mu_rho=(0, *("1/50",) * 3))
        multipliers = wojtyra(parameters).solve().multipliers
        return mp.matrix([multipliers[0], multipliers[1]])

    force, step = mp.matrix([1, 1]), mp.mpf(10) ** -15
    for _ in range(30):
        value = remaining(*force)
        slope = mp.matrix(2)
        for c in range(2):
            moved = force.copy()
            moved[c] += step
            slope[:, c] = (remaining(*moved) - value) / step
        change = mp.lu_solve(slope, value)
        force -= change
        if mp.norm(change) < mp.mpf(10) ** -35 * mp.norm(force):
            break
    return tuple(force)
