"""The table: families and routes, worst error over bound, verdicts, time."""

import collections
import dataclasses
import json
import math
from collections.abc import Iterable, Sequence

import numpy as np

from ._run import DTYPES, Line

VERDICTS = ("ok", "flagged", "false flag", "SILENT WRONG")


def table(lines: Sequence[Line]) -> str:
    """One row for each family and route, a block of columns for each precision."""
    groups = collections.defaultdict(list)
    for line in lines:
        groups[line.family, line.route, line.dtype].append(line)
    dtypes = [dtype for dtype in DTYPES if any(line.dtype == dtype for line in lines)]
    head = f"{'':26}" + "".join(f" | {dtype:^47}" for dtype in dtypes)
    block = f" | {'worst':>8}{'ok':>6}{'flagged':>9}{'false':>7}{'WRONG':>7}{'us':>9} "
    rows = [head, f"{'family':12}{'route':14}" + block * len(dtypes)]
    for family, route in dict.fromkeys((line.family, line.route) for line in lines):
        cells = "".join(_cell(groups[family, route, dtype]) for dtype in dtypes)
        rows.append(f"{family:12}{route:14}{cells}")
    for dtype in dtypes:
        rows.append(f"{dtype}: " + summary([line for line in lines if line.dtype == dtype]))
    rows += [
        "worst: largest error over bound of what was called successful; right is 10 or less.",
        "us: median time of one solve, Python and dispatch included; of vmap per solve.",
    ]
    return "\n".join(rows)


def _cell(lines: Sequence[Line]) -> str:
    counts = collections.Counter(line.verdict for line in lines)
    worst = max((line.ratio for line in lines if line.verdict in ("ok", "SILENT WRONG")), default=math.nan)
    time = np.median([1e6 * line.seconds for line in lines]) if lines else math.nan
    numbers = f"{counts['ok']:6}{counts['flagged']:9}{counts['false flag']:7}{counts['SILENT WRONG']:7}"
    return f" | {'-' if math.isnan(worst) else f'{worst:.1g}':>8}{numbers}{time:9.0f} "


def summary(lines: Sequence[Line]) -> str:
    """Counts of verdicts; false flags as a share of the lines that are well posed."""
    counts = collections.Counter(line.verdict for line in lines)
    posed = sum(line.well_posed for line in lines)
    share = 100 * counts["false flag"] / max(posed, 1)
    beyond = sum(line.verdict == "ok" and line.strict > 10 for line in lines)
    return (
        f"{len(lines)} lines, "
        + ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS)
        + f" ({share:.1f} % of {posed} well-posed ones); {beyond} of the right ones only by the bound of the equations."
    )


def passes(lines: Sequence[Line]) -> bool:
    """No silent wrong answer, and at most 1 % of false flags."""
    counts = collections.Counter(line.verdict for line in lines)
    return not counts["SILENT WRONG"] and counts["false flag"] <= 0.01 * sum(line.well_posed for line in lines)


def troubles(lines: Iterable[Line]) -> str:
    """Every false flag and every silent wrong answer."""
    out = []
    for line in lines:
        if line.verdict in VERDICTS[2:]:
            kinds = ", ".join(f"{kind} {error:.0e} ({line.bounds[kind]:.0e})" for kind, error in line.errors.items())
            where = f"{line.family}, {line.case}, {line.route}, {line.dtype}"
            out.append(f"{line.verdict}: {where}: {line.result or kinds}; rank {line.rank_found} of {line.rank}")
    return "\n".join(out)


def spectra(lines: Iterable[Line]) -> str:
    """What the library says of the spectrum near singular positions."""
    out = [f"{'near a singular position':32}{'':10}{'sigma_r/sigma_1':>16}{'rank':>6}{'found':>6}{'gap':>10}  result"]
    for line in lines:
        if line.family == "singular" and line.route == "decided":
            out.append(
                f"{line.case:32}{line.dtype:10}{line.sharpness:16.0e}{line.rank:6}{line.rank_found:6}{line.gap:10.0e}"
                f"  {line.result or 'successful'}"
            )
    return "\n".join(out) if len(out) > 1 else ""


def as_json(lines: Iterable[Line]) -> str:
    """All lines; numbers that are not finite become strings."""

    def plain(x):
        if isinstance(x, dict):
            return {key: plain(value) for key, value in x.items()}
        return str(x) if isinstance(x, float) and not math.isfinite(x) else x

    return json.dumps([plain(dataclasses.asdict(line)) for line in lines], indent=1)
