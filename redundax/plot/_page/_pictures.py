"""Pictures of a report as PNG, with what they show in words."""

import io
from typing import Any

import numpy as np

from ..._analysis._report import Report
from ..._bodies._mechanism import Mechanism
from ..._solution_sets._family._solution_family import SolutionFamily
from ..._system._state import State
from ..._system._system import AbstractSystem
from .. import _solution_sets as plots
from .._draw import draw
from ._blocks import Picture


def drawing(
    system: AbstractSystem,
    state: State,
    *,
    self_stress: np.ndarray | None = None,
    multipliers: np.ndarray | None = None,
) -> list[Picture]:
    """The mechanism, with a self-stress state or joint loads; none for a system that has no bodies to draw."""
    if not isinstance(system, Mechanism):
        return []
    from matplotlib import pyplot

    figure: Any = draw(system, state, self_stress=self_stress, multipliers=multipliers).figure
    png = _png(figure)
    pyplot.close(figure)
    joints = ", ".join(name for names in system.names.joints for name in names)
    alt = f"Drawing of the bodies {', '.join(system.names.bodies)} and the joints {joints}"
    if self_stress is not None:
        return [Picture(png, "Self-stress as open arrows", f"{alt}, with a self-stress state as open arrows.")]
    if multipliers is not None:
        return [Picture(png, "Joint loads without friction", f"{alt}, with the joint loads as arrows.")]
    return [Picture(png, "The mechanism at this state", f"{alt}.")]


def spectrum_picture(report: Report) -> Picture:
    """The singular values of the constraints and the gap that decides the rank."""
    if not report.redundancy:
        tells = "none is dropped"
    elif np.isfinite(report.gap):
        tells = f"the smallest counted is {report.gap:.1g} times the largest dropped, and a wide gap is a sure rank"
    else:
        tells = "those dropped are zero"
    caption = f"Singular values of the constraints: {report.rank} count; {tells}."
    return Picture(_png(plots.spectrum(report)), caption, f"Dots on a logarithmic scale. {caption}")


def family_picture(family: SolutionFamily) -> Picture:
    """Frictional solutions over the amplitude of a self-stress state."""
    caption = f"What varies with the self-stress of {family.along[0]}"
    alt = f"Curves of accelerations, multipliers and friction over the self-stress of {family.along[0]}."
    return Picture(_png(plots.family(family)), caption, alt)


def _png(figure: Any) -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=150)
    return out.getvalue()
