"""Runs the sweeps and prints their table and goals: `python -m benchmarks.sweeps --help`."""

import argparse
import dataclasses
import json
import os
import sys

from .._devices import prepare
from .._programs import Programs

# NumPy asks for huge pages for its arrays, XLA leaves that to malloc. The C library reads this when a program starts.
_PAGES = "glibc.malloc.hugetlb=1"
if __name__ == "__main__" and sys.platform == "linux" and _PAGES not in os.environ.get("GLIBC_TUNABLES", ""):
    given = os.environ.get("GLIBC_TUNABLES")
    os.environ["GLIBC_TUNABLES"] = f"{given}:{_PAGES}" if given else _PAGES
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])

# JAX must know the devices before it starts.
_early = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
_early.add_argument(
    "--devices",
    type=int,
    default=1,
    help="devices of the CPU for redundax's batches, a divisor of their size; 1 if not given",
)
prepare(_early.parse_known_args()[0].devices)

import jax  # noqa: E402
import numpy as np  # noqa: E402

from . import _costs, _eigen, _joints, _space, _works  # noqa: E402
from ._goals import goals  # noqa: E402
from ._measure import Row  # noqa: E402

_WORKS = {
    "h": lambda size: _works.over_h(size),
    "joints": lambda size: [row for cranks in (6, 20) for row in _joints.over_h(cranks, size // 10)],
    "x0": lambda size: _works.over_x0(size // 10),
    "u": lambda size: _works.over_u(size // 10),
    "lengths": lambda size: [row for rough in (False, True) for row in _works.over_length(size // 10, rough)],
    "single": lambda size: [row for rough in (False, True) for row in _costs.single(rough)],
    "derivatives": lambda size: _costs.derivatives(size // 10),
    "float32": lambda size: _costs.single_precision(size // 10),
    "sizes": _costs.sizes,
    "space": lambda size: _space.bricard(size // 100),
    "start": lambda size: _costs.cold_start(),
}
_COMPILATION, _SMALLEST = "compilation", 200


def main() -> None:
    """Run the works and print the table and the goals, or JSON."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sweeps", description=__doc__, parents=[_early], allow_abbrev=False
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "--quick", action="store_true", help="20,000 values of h instead of 1,000,000, a tenth elsewhere"
    )
    parser.add_argument("--smallest", action="store_true", help="the fewest values that every work can take")
    parser.add_argument(
        "--only", action="append", choices=[*_WORKS, _COMPILATION], help="a work; may be given several times"
    )
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_enable_compilation_cache", False)
    size = _SMALLEST if arguments.smallest else 20_000 if arguments.quick else 1_000_000
    rows: list[Row] = []
    programs: dict[str, Programs] = {}
    for name in arguments.only or _WORKS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        if name == _COMPILATION:
            programs = _costs.compilation()
            if not arguments.json:
                print("\n".join(f"{work:28}{made}" for work, made in programs.items()), end="\n\n", flush=True)
            continue
        found = _WORKS[name](size)
        rows += found
        if not arguments.json:
            print("\n".join(_table(found)), end="\n\n", flush=True)
        jax.clear_caches()
    notes = [f"no C++ peer: {_eigen.missing()}"] if _eigen.missing() else []
    if arguments.json:
        lines = [dataclasses.asdict(row) for row in rows]
        made = {name: dataclasses.asdict(program) for name, program in programs.items()}
        print(json.dumps({"rows": lines, "programs": made, "goals": goals(rows), "notes": notes}, indent=2))
    else:
        print("\n".join([*goals(rows), *notes]))


def _table(rows: list[Row]) -> list[str]:
    """Time of a solve, its ratio to the first line of the same work, and the error."""
    first: dict[str, Row] = {}
    out = [f"{'work':32}{'program':30}{'solves':>10}{'time per solve':>16}{'speed':>9}{'error':>9}"]
    for row in rows:
        base = first.setdefault(row.work, row)
        time = f"{1e6 * row.seconds:.3f} us" if row.seconds < 0.1 else f"{row.seconds:.2f} s"
        error = "" if np.isnan(row.error) else f"{row.error:.0e}"
        ratio = f"{base.seconds / row.seconds:.3g}"
        out.append(f"{row.work:32}{row.program:30}{row.solves:10,}{time:>16}{ratio:>9}{error:>9}")
    return out


if __name__ == "__main__":
    main()
