"""The paper's tables, printed and computed."""

import json

from .. import _paper
from .._analysis._outputs import plain
from .._tools._progress import stage
from ._arguments import version
from ._output import show, tell

_KEYS = ("table2", "table3", "table4")


def tables_as_text() -> int:
    """Show the tables beside their printed figures, and how far these vary."""
    show(_paper.heading(version()) + "\n")
    comparisons = []
    for key in _KEYS:
        comparisons.append(_compared(key))
        show(_paper.table_text(comparisons[-1]) + "\n")
    show("How far the figures vary\n========================\n")
    show(_paper.spread_text(*(comparison.table for comparison in comparisons)) + "\n")
    show("Result\n======\n\n" + _paper.verdict_text(comparisons))
    return 1 if any(comparison.problems for comparison in comparisons) else 0


def tables_as_json() -> int:
    """Show the computed figures at full precision."""
    comparisons = [_compared(key) for key in _KEYS]
    rows = {c.table.printed.key: c.table.rows() for c in comparisons}
    problems = [problem for comparison in comparisons for problem in comparison.problems]
    show(json.dumps(plain(rows), indent=1, allow_nan=False))
    for problem in problems:
        tell(problem)
    return 1 if problems else 0


def _compared(key: str) -> _paper.Comparison:
    with stage(f"computing {key}"):
        return _paper.compare(_paper.table(key))
