"""Runs the suite and prints its table: `python -m benchmarks.hard_cases --help`."""

import argparse
import pathlib
import sys
import time
import warnings

from .._devices import prepare

prepare()

import jax  # noqa: E402

from . import _figure, _report  # noqa: E402
from ._routes import QUICK, ROUTES  # noqa: E402
from ._run import DTYPES, run  # noqa: E402
from .families import FAMILIES  # noqa: E402


def main() -> int:
    """Run, print, and end with 1 if there is a silent wrong answer or more than 1 % of false flags."""
    arguments = _arguments()
    warnings.filterwarnings("ignore", "Argument `(misfit|W)` looks", UserWarning)  # some are large on purpose
    jax.config.update("jax_enable_x64", True)
    lines, begin = [], time.perf_counter()
    for name in arguments.only or FAMILIES:
        dtypes = [arguments.dtype] if arguments.dtype else list(DTYPES)
        routes = QUICK if arguments.quick else tuple(ROUTES)
        cases = FAMILIES[name].cases(arguments.quick or arguments.smallest)
        if arguments.smallest:
            dtypes, routes, cases = dtypes[:1], QUICK[:2], cases[:1]
        found = list(run(cases, dtypes, routes))
        lines += found
        jax.clear_caches()  # each program holds memory maps, of which Linux allows a process 65,530
        print(f"{name}: {len(found)} lines, {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    for text in (_report.table(lines), _report.spectra(lines), _report.troubles(lines)):
        if text:
            print(text, end="\n\n")
    if arguments.json:
        arguments.json.write_text(_report.as_json(lines))
    if arguments.png:
        _figure.figure(lines).savefig(arguments.png)
    return not _report.passes(lines)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hard_cases", description=__doc__)
    parser.add_argument("--only", action="append", choices=FAMILIES, help="a family; may be given several times")
    parser.add_argument("--quick", action="store_true", help="a selection of the cases")
    parser.add_argument("--smallest", action="store_true", help="a case of each family, on the default route")
    parser.add_argument("--dtype", choices=DTYPES, help="one precision only")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="write every line")
    parser.add_argument("--png", type=pathlib.Path, metavar="FILE", help="write the figure")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
