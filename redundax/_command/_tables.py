"""Commands on the paper's mechanism: its tables, and what of it is unique."""

import json
import pathlib
import sys

import numpy as np

from .. import _paper
from .._analysis._analyze import analyze
from .._closures._closure import MinimumNorm
from ..mechanisms import wojtyra2020
from ._arguments import version
from ._families import draw_families, report_with_families, show

_KEYS = ("table2", "table3", "table4")


def paper_study(png: pathlib.Path | None) -> int:
    """Show the tables and what is unique, and draw the solutions into a file if there is one."""
    comparisons = _tables()
    show("What is unique\n==============\n")
    mechanism = wojtyra2020(mu_rho=_paper.MU_RHO)
    report = analyze(mechanism, mechanism.state(phi=_paper.PHI, rate=_paper.RATE))
    show(f"{report}\n")
    show(_paper.spread_text(*(comparison.table for comparison in comparisons)) + "\n")
    status = _verdict(comparisons)
    if png:
        state = mechanism.state(phi=_paper.PHI, rate=_paper.RATE)
        draw_families(report_with_families(mechanism, state, MinimumNorm(), amplitude=400.0, samples=401)[1], png)
    return 1 if report.problem else status


def tables_as_text() -> int:
    """Show the tables beside their printed figures."""
    return _verdict(_tables())


def tables_as_json() -> int:
    """Show the computed figures at full precision."""
    comparisons = [_paper.compare(_paper.table(key)) for key in _KEYS]
    rows = {c.table.printed.key: c.table.rows() for c in comparisons}
    problems = [problem for comparison in comparisons for problem in comparison.problems]
    show(json.dumps(_without_nan(rows), indent=1, allow_nan=False))
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


def _tables() -> list[_paper.Comparison]:
    """Show the tables one after the other, each as soon as it is computed."""
    show(_paper.heading(version()) + "\n")
    comparisons = []
    for key in _KEYS:
        comparisons.append(_paper.compare(_paper.table(key)))
        show(_paper.table_text(comparisons[-1]) + "\n")
    return comparisons


def _verdict(comparisons: list[_paper.Comparison]) -> int:
    show("Result\n======\n\n" + _paper.verdict_text(comparisons))
    return 1 if any(comparison.problems for comparison in comparisons) else 0


def _without_nan(value: object) -> object:
    """JSON has no NaN: figures of a failed solve become null."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
