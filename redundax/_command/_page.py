"""The first command: what the library tells of a machine, on one page, and a check of the library itself.

The machine is that of the paper, so that the solution behind the page can be held against printed figures.
"""

import pathlib
import textwrap

import numpy as np

from .. import _paper
from .._analysis._analyze import analyze
from .._analysis._report import Report
from .._analysis._verdict import Verdict
from .._bodies._mechanism import Mechanism
from .._equations._factorize import factorize_dense
from .._solution_sets._family._solution_family import SolutionFamily, solution_family
from .._solve._solve import solve
from .._system._state import State
from .._tools._progress import stage
from .._tools._table import WIDTH, text_of
from ..mechanisms import wojtyra2020
from ._arguments import version
from ._families import draw_families
from ._output import show

_ALONG, _PRELOAD, _SAMPLES = "A.x", 100.0, 201  # N
_OUTPUTS = ("1.phi''", "4.y''", "A.x", "K.perpendicular", "L.perpendicular", "K.angle", "tau A")
_NEXT = {
    "redundax --png picture.png": "this page, and a picture of all solutions",
    "redundax tables": "the tables beside their printed figures",
    "redundax report FILE.py:NAME": "such a page with pictures, of your mechanism",
    "redundax --help": "all commands",
}


def first_page(png: pathlib.Path | None) -> int:
    """Show a machine, what of it is unique and how far the rest varies, and draw its solutions if wished."""
    mechanism = wojtyra2020(mu_rho=_paper.MU_RHO)
    state = mechanism.state(phi=_paper.PHI, rate=_paper.RATE)
    show(_heading(mechanism))
    with stage("finding what is unique"):
        factor = factorize_dense(mechanism, state)
        report = analyze(mechanism, state, factor=factor)
    show(_unique(report))
    if report.problem:
        return 1
    with stage("finding how far the rest varies"):
        z = np.linspace(-_PRELOAD, _PRELOAD, _SAMPLES)
        family = solution_family(mechanism, state, along=_ALONG, z=z, factor=factor)
    show(_ranges(family))
    wrong = _differences(mechanism, state)
    show(_figures(wrong, len(mechanism.names.unknowns)))
    show("What to type next\n\n" + "\n".join(f"    {words:<32}{what}" for words, what in _NEXT.items()))
    if png:
        draw_families([family], png)
    return 1 if wrong or np.any(family.count == 0) else 0


def _heading(mechanism: Mechanism) -> str:
    about = (
        "Two cranks, a coupler on them and a slider that guides it once more than needed. Revolutes A to D have "
        "friction, guides K and L none. 1 is the driven crank, 4 the slider; 1.phi'' is an angular acceleration, "
        "A.x a joint force."
    )
    title = f"redundax {version()}: what does the model of a machine really determine?"
    return f"{title}\n\n{textwrap.fill(about, WIDTH)}\n"


def _unique(report: Report) -> str:
    lines = ["What is unique: rx.analyze", "", *str(report).splitlines()[:1]]
    if report.problem:
        return text_of([*lines, f"PROBLEM: {report.problem}", ""])
    alone = [*(["all accelerations"] if report.unique_accelerations else []), *report.unique_multipliers]
    found = {"Without friction, unique": alone}
    judged = [each for kind in ("acceleration", "friction", "multiplier") for each in report.verdicts[kind]]
    for verdict in Verdict:
        found[f"With friction, {verdict.value}"] = [each.name for each in judged if each.with_friction is verdict]
    lists = [f"{what}: {', '.join(names)}" for what, names in found.items() if names]
    return text_of([*lines, *lists, ""])


def _ranges(family: SolutionFamily) -> str:
    """Of some outputs."""
    title = f"How far the rest varies, with A preloaded by up to {_PRELOAD:g} N: rx.solution_family"
    lines = str(family).splitlines()
    found, head = (next(k for k, line in enumerate(lines) if word in line) for word in ("solutions", "nearest 0"))
    chosen = [row for row in lines[head:] if row.split("  ")[0].partition(",")[0] in _OUTPUTS]
    return text_of([title, "", *lines[found : head + 1], *chosen, ""])


def _differences(mechanism: Mechanism, state: State) -> list[str]:
    """Figures at this state that are not those that the paper prints."""
    solution = solve(mechanism, state, throw=False)
    values = np.concatenate([solution.acceleration, solution.multipliers, solution.friction])
    return _paper.check("table3", 0, mechanism.names.unknowns.labels, values)


def _figures(wrong: list[str], count: int) -> str:
    right, total = _paper.reproduced()
    lines = [
        f"Tables 2 to 4 of the paper: {right} of {total} printed figures reproduced.",
        f"! At this state these differ from Table 3: {', '.join(wrong)}."
        if wrong
        else f"The {count} of this state were checked just now.",
    ]
    return text_of([*lines, ""])
