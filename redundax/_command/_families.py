"""Solutions along every self-stress state, as commands show and draw them."""

import dataclasses
import pathlib
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from .._analysis._analyze import analyze
from .._analysis._report import Report
from .._closures._closure import AbstractClosure
from .._equations._factorisation import Factorisation
from .._equations._factorize import dense_at
from .._solution_sets._family._solution_family import SolutionFamily, families_of
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._progress import stage
from ..plot import _solution_sets as plots
from ._file import writing
from ._output import tell


def report_with_families(
    system: AbstractSystem,
    state: State,
    closure: AbstractClosure,
    amplitude: float | None,
    samples: int,
    watch: Callable[[range], Iterable[int]] = iter,
    factor: Factorisation | None = None,
) -> tuple[Report, list[SolutionFamily]]:
    """The report, and the solutions along every self-stress state; none where there is a problem."""
    with stage("finding what is unique"):
        system, factor = dense_at(system, state, None, factor)
        report = analyze(system, state, closure=closure, factor=factor)
    if report.problem:
        return report, []
    z = None if amplitude is None else np.linspace(-amplitude, amplitude, samples)
    try:
        found = families_of(system, state, report, factor, closure=closure, z=z, samples=samples, watch=watch)
    except RuntimeError as error:
        return dataclasses.replace(report, problem=str(error)), []
    return report, found


def draw_families(families: Sequence[SolutionFamily], file: pathlib.Path) -> None:
    """A picture of each family, the further ones with their number in the name."""
    for number, family in enumerate(families):
        target = file if number == 0 else file.with_stem(f"{file.stem}_{number}")
        with writing(target):
            plots.family(family).savefig(target)
        tell(f"drawn: {target}")
