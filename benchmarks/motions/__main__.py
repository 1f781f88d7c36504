"""Runs the motions and prints their table: `python -m benchmarks.motions --help`."""

import argparse
import dataclasses
import itertools
import json
import os
import pathlib
import sys

from .._devices import prepare

# OpenBLAS reads its threads when it is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
prepare(os.cpu_count() or 1)  # a batch has a device for each core

import jax  # noqa: E402
import numpy as np  # noqa: E402

from . import _exudyn, _figure, _mujoco, _stiff, _works  # noqa: E402

_WORKS = {
    "one": _works.one_motion,
    "space": _works.in_space,
    "friction": _works.friction,
    "stiff": _stiff.stiff,
    "batch": _works.batch,
    "long": _works.long_run,
}
_COMPILATION = "compilation"


def main() -> None:
    """Run the works and print the table, or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.motions", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer mechanisms, precisions, motions and steps")
    parser.add_argument("--smallest", action="store_true", help="the first line of each work alone")
    works = [*_WORKS, _COMPILATION]
    parser.add_argument("--only", action="append", choices=works, help="a work; may be given several times")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="write every line")
    parser.add_argument("--png", type=pathlib.Path, metavar="FILE", help="write the diagram of time against error")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    works = arguments.only or (list(_WORKS) if arguments.smallest else works)
    if _COMPILATION in works:
        works = [name for name in works if name != _COMPILATION]
        print("\n".join(f"{work:28}{made}" for work, made in _works.compilation().items()), end="\n\n", flush=True)
    names = ("compile s", "run ms", "steps", "us/step", "error", "drift", "energy")
    print(f"{'motion, 10 s':24}{'program':22}{'setting':22}" + "".join(f"{name:>10}" for name in names))
    rows = []
    for name in works:
        lines = _WORKS[name](arguments.quick or arguments.smallest)
        for row in itertools.islice(lines, 1 if arguments.smallest else None):
            rows.append(row)
            print(_line(row), flush=True)
    for reason in filter(None, (_exudyn.missing(), _mujoco.missing())):
        print(f"note: {reason}", file=sys.stderr)
    if arguments.json:
        arguments.json.write_text(json.dumps([dataclasses.asdict(row) for row in rows], indent=1))
    if arguments.png:
        _figure.figure(rows).savefig(arguments.png)


def _line(row: _works.Row) -> str:
    numbers = (
        f"{row.compilation:.1f}" if row.compilation > 0.05 else "",
        f"{1e3 * row.seconds:.4g}",
        f"{row.steps}",
        f"{1e6 * row.seconds / row.steps:.3g}",
        *(f"{value:.0e}" for value in (row.error, row.drift, row.energy)),
    )
    shown = "".join(f"{'' if number == 'nan' else number:>10}" for number in numbers)
    return f"{row.work:24}{row.program:22}{row.setting:22}{shown}".rstrip().replace("nan", "   ")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
