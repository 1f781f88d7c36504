"""Reactions of overconstrained mechanisms: what is unique, and who prints it right.

    python -m benchmarks.reactions [--smallest] [--json]

Truth is mpmath's, in 50 digits, of equations written apart from redundax. Errors are the largest of a case, of forces
in N and moments at 1 m, relative to its largest load; "wrong" is one above 1e-2 among loads that are unique. What a
program prints for the others is one of many.
"""

import argparse
import json
import time

import numpy as np

from ._cases import CASES
from ._programs import ABSENT, PROGRAMS, Redundax
from ._truth import truth_of

WRONG = 1e-2


def main() -> None:
    """Print who is right where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--smallest", action="store_true", help="two cases")
    parser.add_argument("--json", action="store_true", help="figures as JSON")
    arguments = parser.parse_args()
    rows = [_row(make()) for make in (CASES[:2] if arguments.smallest else CASES)]
    if arguments.json:
        print(json.dumps(rows))
        return
    head = ["mechanism", "redundant", "free", "unique", "verdicts", "unique loads", "by stiffness", "band", *PROGRAMS]
    lines = [head, *([_text(row[key]) for key in head] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print(
            "  ".join(
                f"{cell:{'<' if k == 0 else '>'}{width}}"
                for k, (cell, width) in enumerate(zip(line, widths, strict=True))
            )
        )
    print(
        "\nverdicts, unique loads, by stiffness, band: of redundax; errors beside the truth, and of other programs "
        "those of unique loads.\n-: the program has no words for the case, or gave no numbers."
    )
    if ABSENT:
        print(f"Not installed, and left out: {', '.join(ABSENT)}.")


def _row(case) -> dict:
    begin = time.process_time()
    truth, ours = truth_of(case), Redundax(case)
    if (truth.redundancy, truth.freedom) != (case.redundancy, case.freedom):
        raise SystemExit(f"{case.name}: counted {case.redundancy}, {case.freedom}, but the truth is {truth[:2]}")
    flags = np.concatenate([*truth.unique.values()])
    said = np.concatenate([*ours.unique.values()])
    size = max(np.abs(load).max() for load in truth.least.values())
    found = {
        "mechanism": case.name,
        "redundant": truth.redundancy,
        "free": truth.freedom,
        "unique": f"{flags.sum()} of {flags.size}",
        "verdicts": "right" if np.array_equal(flags, said) else f"{np.sum(flags != said)} wrong",
        "unique loads": _error(truth.least, ours.least, truth.unique, size),
        "by stiffness": _error(truth.elastic, ours.elastic, None, size),
        "band": None,
    }
    if truth.band is not None:
        ends = np.array(ours.band) if ours.band else np.full(2, np.nan)
        found["band"] = float(min(np.abs(ends - truth.band).max(), np.abs(-ends[::-1] - truth.band).max()) / size)
    for name, program in PROGRAMS.items():
        answer = program(case)
        found[name] = None if answer is None else _error(truth.least, answer, truth.unique, size)
    return found | {"seconds": time.process_time() - begin}


def _error(truth, answer, unique, size) -> float:
    worst = 0.0
    for name, load in truth.items():
        if name not in answer:  # a program that prints no load of this joint
            continue
        flags = np.ones(6, bool) if unique is None else unique[name]
        worst = max(worst, float(np.abs(answer[name] - load)[flags].max(initial=0.0)))
    return worst / size


def _text(value) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.0e}" if value <= WRONG else f"wrong, {value:.0e}"
    return str(value)


if __name__ == "__main__":
    main()
