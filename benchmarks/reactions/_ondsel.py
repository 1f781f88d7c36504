"""OndselSolver, of FreeCAD's assembly workbench, by pyondsel: markers, joints and the loads that it writes, at t = 0"""

import numpy as np
from pyondsel.model.asmt_model import AsmtModel
from pyondsel.model.joint import Joint
from pyondsel.model.marker import Marker
from pyondsel.model.part import Part
from pyondsel.model.simulation import Simulation
from pyondsel.solve import solve_asmt

from ._cases import GRAVITY, GROUND, Case, axes_along, floats

_KINDS = {
    "hinge": "revolute",
    "slide": "translational",
    "cylindrical": "cylindrical",
    "ball": "spherical",
    "fixed": "fixed",
}
_LOADS = ("FXonI", "FYonI", "FZonI", "TXonI", "TYonI", "TZonI")
_FIRST = 2  # of a row: its name, the input, then times


def answer(case: Case) -> dict[str, np.ndarray] | None:
    """Loads on marker I, which is on body i."""
    model = AsmtModel(name="case", gravity=tuple(floats(GRAVITY).tolist()))
    model.simulation = Simulation(t_start=0.0, t_end=1e-4, frames=1)
    for name, body in case.bodies.items():
        moments, place = tuple(floats(body.inertia).tolist()), tuple(floats(body.centre).tolist())
        model.add_part(Part(name, position=place, mass=float(body.mass), moments_of_inertia=moments))
    parts = {part.name: part for part in model.parts}
    for name, joint in case.joints.items():
        ends, turn = [], tuple(map(tuple, axes_along(joint.axis).tolist()))
        for body in (joint.i, joint.j):
            if body == GROUND:
                model.add_ground_marker(Marker(name, tuple(floats(joint.point).tolist()), turn))
                ends.append(model.ground_path(name))
                continue
            at = floats(joint.point) - floats(case.bodies[body].centre)
            parts[body].add_marker(Marker(name, tuple(at.tolist()), turn))
            ends.append(model.part_path(body, name))
        model.add_joint(Joint(name, _KINDS[joint.kind], *ends))
    try:
        solved = solve_asmt(model.to_asmt())
    except Exception:
        return None
    rows = [line.split("\t") for line in solved[solved.index("TimeSeries") :].splitlines()]
    loads = [float(row[_FIRST]) for row in rows if row[0] in _LOADS]  # titles of series are garbled, their order is not
    return dict(zip(case.joints, np.array(loads).reshape(-1, 6), strict=True))
