"""Random mechanisms in batches: every answer judged by laws, a sample of them with 50 digits.

    python benchmarks/fuzz.py [--cases 100000] [--seed 0] [--structures 4] [--digits 100] [--smallest]

Each case is one mechanism of random structure, geometry, state, loads, friction and closure; it is solved plain, with
bodies and joints in another order, and with a joint in two halves, every second time in other units. Laws are ratios of
error to tolerance, at most 1 where they hold (`tests/support/fuzzing/laws.py`); a flag is false where the rank is clear
(sigma_r / sigma_1 > 1e-3) and friction contracts (spectral radius of Gamma below 0.9).
"""

import argparse
import os
import pathlib
import sys
import time

# Independent batched LAPACK calls can wait for good on two-core CPUs under the other scheduler (see tests/conftest.py).
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_scheduler_type=CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED")

import jax
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "tests" / "support"))

from fuzzing import digits, fuzz
from fuzzing.recipes import RECIPES
from fuzzing.samples import Scales, raw_numbers

# Spread of masses and compliances (powers of ten) and size of friction, in turn.
SPREADS = (
    Scales(),
    Scales(friction=0.03, masses=2.0, compliances=4.0),
    Scales(length=4.0, mass=4.0, time=2.0),
    Scales(friction=0.3),
)


def compared(recipe: str, number: int, size: int, samples: int, worst: dict[str, tuple]) -> list[tuple]:
    """Compare some answers of a structure with 50 digits: largest ratios go to `worst`, those above 1 are listed."""
    structure = fuzz.structure_of(recipe, number)
    raw = raw_numbers(structure, size, np.random.default_rng([number, samples]))  # of a size that is compiled
    answers = fuzz.solve(fuzz.problem(structure, raw))
    beyond = []
    for sample in np.flatnonzero(answers.successful)[:samples]:
        ratios = digits.errors(lambda raw, real: fuzz.problem(structure, raw, real), raw, sample, answers)
        for kind, (ratio, relative) in ratios.items():
            worst[kind] = tuple(np.maximum(worst.get(kind, (0.0, 0.0)), (ratio, relative)))
            if not ratio <= 1:
                beyond.append((recipe, number, int(sample), kind, f"{ratio:.2g}", f"{relative:.1g}"))
    return beyond


def show(report: fuzz.Report, seconds: float) -> None:
    """Print what a run found."""
    print(f"\n{report.structures} structures, {report.cases} cases, {report.answers} answers in {seconds:.0f} s")
    for name, count in report.flags.most_common():
        print(f"  {name:28}{count:9}")
    share = report.false_flags / max(report.clear, 1)
    print(f"clear of any reason for a flag: {report.clear}, flagged all the same: {report.false_flags} ({share:.2%})")
    print(f"\n{'law':24}{'worst error / tolerance':>24}{'violations':>12}")
    for law, worst in report.worst.items():
        if law != "false flag":
            print(f"{law:24}{worst:24.2g}{len(report.violations.get(law, ())):12}")
    for law, places in report.violations.items():
        for place in places[:5]:
            print(f"  {law}: {place}")


def main() -> None:
    """Run the batches, then the sample with 50 digits, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=100_000, help="cases in all (default 100000)")
    parser.add_argument("--seed", type=int, default=0, help="of the numbers (default 0)")
    parser.add_argument("--structures", type=int, default=4, help="structures of each recipe (default 4)")
    parser.add_argument("--digits", type=int, default=2, help="answers of each structure compared with 50 digits")
    parser.add_argument("--smallest", action="store_true", help="ten cases of one structure")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    report, start = fuzz.Report(), time.perf_counter()
    places = [(recipe, number) for recipe in RECIPES for number in range(arguments.structures)]
    places, spreads, cases = (places[:1], SPREADS[:1], 10) if arguments.smallest else (places, SPREADS, arguments.cases)
    size = -(-cases // (len(places) * len(spreads)))
    for recipe, number in places:
        for part, scales in enumerate(spreads):
            fuzz.batch(recipe, number, len(SPREADS) * arguments.seed + part, size, scales, report)
        report.structures += 1
        print(f"{recipe:24}{number:3}{time.perf_counter() - start:9.0f} s", flush=True)
    show(report, time.perf_counter() - start)
    start, worst = time.perf_counter(), {}
    beyond = [place for recipe, number in places for place in compared(recipe, number, size, arguments.digits, worst)]
    print(f"\n50 digits, {len(places) * arguments.digits} answers in {time.perf_counter() - start:.0f} s")
    print(f"{'kind':24}{'worst error / bound':>24}{'relative':>12}")
    for kind, (ratio, relative) in worst.items():
        print(f"{kind:24}{ratio:24.2g}{relative:12.1g}")
    for place in beyond:
        print(f"  beyond its bound: {place}")


if __name__ == "__main__":
    main()
