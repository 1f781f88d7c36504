"""Pictures of a report as PNG, with what they show in words."""

import io
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._solution_sets._family._solution_family import SolutionFamily
from ..._system._state import State
from ..._system._system import AbstractSystem
from .. import _solution_sets as plots
from .._draw import draw
from .._draw._camera import not_unique
from ._blocks import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drawing(
    system: AbstractSystem,
    state: State,
    caption: str,
    report: Report | Collection[str] | None = None,
    *,
    multipliers: np.ndarray | None = None,
    self_stress: np.ndarray | None = None,
) -> list[Picture]:
    """The mechanism, with verdicts and loads as `draw` takes them; none for a system that has no bodies to draw."""
    if not isinstance(system, Mechanism):
        return []
    from matplotlib import pyplot

    figure = cast("Figure", draw(system, state, report=report, multipliers=multipliers, self_stress=self_stress).figure)
    png = _png(figure)
    pyplot.close(figure)
    if not_unique(report):
        caption += "; a question mark is at joints whose load is not unique"
    joints = ", ".join(system.names.joint_names)
    alt = f"{caption}: drawing of the bodies {', '.join(system.names.bodies)} and the joints {joints}"
    loads = "" if multipliers is None and self_stress is None else ", with loads as arrows"
    return [Picture(png, caption, f"{alt}{loads}.")]


def spectrum_picture(report: Report) -> Picture:
    """The singular values of the constraints and the gap that decides the rank."""
    if len(report.singular_values) <= report.rank:
        tells = "none is dropped"
    elif np.isfinite(report.gap):
        tells = f"the smallest counted is {report.gap:.1g} times the largest dropped, and a wide gap is a sure rank"
    else:
        tells = "those dropped are zero"
    caption = f"Singular values of the constraints: {report.rank} count; {tells}."
    return Picture(_png(plots.spectrum(report)), caption, f"Dots on a logarithmic scale. {caption}")


def family_picture(family: SolutionFamily, names: Sequence[str]) -> Picture:
    """Solutions over the amplitude of a self-stress state: those of these outputs that change most."""
    caption = f"What varies with the self-stress of {family.along[0]}; each axis is the range of its own curve"
    alt = f"Curves of accelerations, joint loads and friction over the self-stress of {family.along[0]}."
    return Picture(_png(plots.family_of(family, names)), caption, alt)


def _png(figure: "Figure") -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=150)
    return out.getvalue()
