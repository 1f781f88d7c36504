"""What programs say of a case: force and moment of each joint on body i, global, (6,), or None where they cannot say it

A program is a function of a `Case` in a file of its own, with its name and the package that it needs in `PEERS`: where
that is not installed, it is left out. MuJoCo has no hinge that closes a loop: two points on its axis stand for it.
"""

import importlib
import importlib.util
import pathlib
import tempfile
from collections.abc import Callable

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)
import redundax as rx  # noqa: E402

from ._cases import GRAVITY, GROUND, Case, floats, hung  # noqa: E402
from ._truth import MISFIT, ROTATION, TRANSLATION  # noqa: E402

Answer = dict[str, np.ndarray] | None
_JOINTS = {
    "hinge": rx.spatial.Revolute,
    "slide": rx.spatial.Prismatic,
    "cylindrical": rx.spatial.Cylindrical,
    "ball": rx.spatial.Spherical,
    "fixed": rx.spatial.Fixed,
}
_HALF = 0.05  # m: of two points that stand for a hinge


def mechanism(case: Case) -> rx.Mechanism:
    """Of redundax."""
    bodies = {
        name: rx.spatial.Body(name, float(body.mass), floats(body.inertia), position=floats(body.centre))
        for name, body in case.bodies.items()
    }
    ends = bodies | {GROUND: GROUND}
    joints = [
        _JOINTS[joint.kind](name, ends[joint.i], ends[joint.j], point=floats(joint.point), axis=floats(joint.axis))
        for name, joint in case.joints.items()
    ]
    return rx.Mechanism(list(bodies.values()), joints, gravity=floats(GRAVITY))


def loads_of(case: Case, solution: rx.types.Solution) -> Answer:
    """By joint."""
    names = [f"{part} {axis}" for part in ("force", "moment") for axis in "xyz"]
    return {
        name: np.array([float(solution[f"{name} {part} on {joint.i}"]) for part in names])
        for name, joint in case.joints.items()
    }


class Redundax:
    """Redundax at the reference position: verdicts, loads of least norm and by the compliance, and a band."""

    def __init__(self, case: Case):
        self.mechanism = mechanism(case)
        self.state = rx.State(self.mechanism.reference, np.zeros(len(self.mechanism.coordinates)))
        self.report = rx.analyze(self.mechanism, self.state)
        self.stiff = rx.ElasticJoints(
            self.mechanism, {name: (float(TRANSLATION), float(ROTATION)) for name in case.joints}
        )
        redundant = self.report.redundancy > 0
        closure = self.stiff if redundant else rx.MinimumNorm()
        self.least = loads_of(case, rx.solve(self.mechanism, self.state))
        self.elastic = loads_of(case, rx.solve(self.mechanism, self.state, closure=closure))
        self.unique = {}
        verdicts = {each.name: each.without_friction for each in self.report.verdicts["reaction"]}
        for name, joint in case.joints.items():
            own = [verdicts[f"{name} {part} {axis} on {joint.i}"] for part in ("force", "moment") for axis in "xyz"]
            self.unique[name] = np.array([each in (rx.Verdict.UNIQUE, rx.Verdict.ZERO) for each in own])
        hinges = [name for name, joint in case.joints.items() if joint.kind == "hinge"]
        self.band = None
        if redundant and hinges:
            box = rx.MisfitBox(self.stiff, {f"{name}.axial": (-float(MISFIT), float(MISFIT)) for name in hinges})
            found = rx.band(self.mechanism, self.state, f"{hinges[0]}.axial", box, samples=32)
            self.band = float(found.lower[0]), float(found.upper[0])


def mujoco(case: Case, settings: str) -> Answer:
    """MuJoCo's constraint forces at the first instant, by `Model.run`."""
    text = _mjcf(case, settings)
    if text is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "case.xml"
        file.write_text(text)
        reactions = rx.load_model(file).run(1e-6).reactions
    found = {}
    for name, joint in case.joints.items():
        point, total = floats(joint.point), np.zeros(6)
        for part in (name, f"{name} +", f"{name} -"):
            if part in reactions:
                own = reactions[part]
                where = own.point + (floats(case.bodies[own.on].centre) if own.on != GROUND else 0.0)
                moment = own.moment[0] + np.cross(where - point, own.force[0])
                sign = 1.0 if own.on == joint.i else -1.0
                total += sign * np.concatenate([own.force[0], moment])
        found[name] = total
    return found


def _mjcf(case: Case, settings: str) -> str | None:
    """The model; None of one that it has no words for."""
    hanging, closing = hung(case)
    if any(case.joints[name].kind not in ("hinge", "ball", "fixed") for name in closing):
        return None

    def numbers(values):
        return " ".join(repr(float(x)) for x in values)

    def body(name: str, above: np.ndarray) -> str:
        own, joint = case.bodies[name], case.joints[hanging[name]]
        place = floats(own.centre)
        at, axis = numbers(floats(joint.point) - place), numbers(joint.axis)
        kinds = {"cylindrical": ("slide", "hinge"), "fixed": ()}.get(joint.kind, (joint.kind,))
        inside = "".join(
            f'<joint name="{hanging[name]}{" slide" * (len(kinds) > 1 and kind == "slide")}" type="{kind}" pos="{at}" '
            f'axis="{axis}"/>'
            for kind in kinds
        )
        inside += f'<inertial pos="0 0 0" mass="{float(own.mass)!r}" diaginertia="{numbers(own.inertia)}"/>'
        inside += "".join(body(each, place) for each in hanging if case.joints[hanging[each]].j == name)
        return f'<body name="{name}" pos="{numbers(place - above)}">{inside}</body>'

    tree = "".join(body(each, np.zeros(3)) for each in hanging if case.joints[hanging[each]].j == GROUND)
    loops = ""
    for name in closing:
        joint = case.joints[name]
        place, other = floats(joint.point), "world" if joint.j == GROUND else joint.j
        centre, axis = floats(case.bodies[joint.i].centre), floats(joint.axis)
        pair = f'body1="{joint.i}" body2="{other}"'
        if joint.kind == "fixed":
            return None  # a body that is built in has no joint for MuJoCo
        points = ((" +", _HALF), (" -", -_HALF)) if joint.kind == "hinge" else (("", 0.0),)
        for mark, along in points:
            loops += f'<connect name="{name}{mark}" {pair} anchor="{numbers(place + along * axis - centre)}"/>'
    gravity = numbers(GRAVITY)
    return (
        f'<mujoco><option gravity="{gravity}" timestep="1e-6"/><default><equality {settings}/></default>'
        f"<worldbody>{tree}</worldbody><equality>{loops}</equality></mujoco>"
    )


PEERS = {  # names, the package that each needs, and the file and function that ask it
    "Exudyn, as printed": ("exudyn", "_exudyn", "answer"),
    "Exudyn, moments turned": ("exudyn", "_exudyn", "turned"),
    "Pinocchio": ("pinocchio", "_pinocchio", "answer"),
    "OndselSolver": ("pyondsel", "_ondsel", "answer"),
}
PROGRAMS: dict[str, Callable[[Case], Answer]] = {}
ABSENT: list[str] = []
if importlib.util.find_spec("mujoco"):
    PROGRAMS["MuJoCo, its defaults"] = lambda case: mujoco(case, "")
    PROGRAMS["MuJoCo, stiff loops"] = lambda case: mujoco(case, 'solref="2e-5 1" solimp="0.99999 0.99999 0.001"')
else:
    ABSENT.append("MuJoCo (mujoco)")
for _name, (_package, _file, _function) in PEERS.items():
    if importlib.util.find_spec(_package):
        PROGRAMS[_name] = getattr(importlib.import_module(f"benchmarks.reactions.{_file}"), _function)
    else:
        ABSENT.append(f"{_name} ({_package})")
