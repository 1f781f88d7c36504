"""What is no argument at all is refused by the argument's name, in every public call, found by looking.

A call that is added fails here until it has a line, with the arguments that cannot be anything.
"""

import inspect
import os

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs, units = rx.spatial, rx.units
HERE, ORIGIN = (0.0, 0.0), (0.0, 0.0, 0.0)
ROD = rx.Body("rod", 1.0, 0.1)
PIVOT = rx.Revolute("A", "rod", "ground", HERE, HERE)
PENDULUM = rx.Mechanism([ROD], [PIVOT])
STOPPED = rx.Mechanism([ROD], [PIVOT], couplers=[rx.Stop("s", "A.angle", 0.3)])
STATE, MANY = rx.State([0.0, 0.0, 0.3], np.zeros(3)), rx.State(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2))
SOLUTION = rx.solve(PENDULUM, STATE)
AT, ALONG = {"system": PENDULUM, "state": STATE}, {"system": PENDULUM, "states": MANY}
CHOICE, FACTOR = {"closure": rx.MinimumNorm()}, {"factor": rx.factorize(PENDULUM, STATE)}
SOFT, BOX = rx.Compliance({"A.x": 1e-8}), {"bounds": rx.PreloadBox({"A.x": (-1.0, 1.0)})}
SEARCH, SAMPLED = {"starts": 1, "seed": 0}, {"samples": 1, "starts": 1, "seed": 0}
LAWS = {"laws": {"A.angle": lambda t: t}, "ts": [0.0, 0.1], "q": np.zeros(3), "hold": ()}
RUN = {
    "run": lambda a: {"b": a},
    "samples": {"a": np.ones(2)},
    "system": PENDULUM,
    "chunk": 1,
    "path": "a.nc",
    "mesh": None,
}

IN_PLANE = {"name": "A", "i": "rod", "j": "ground"}
PIN = IN_PLANE | {"point_i": HERE, "point_j": HERE}
LINE = PIN | {"normal": (0.0, 1.0)}
RUBS, SPRING = {"friction": rx.Coulomb(0.1)}, {"stiffness": 1.0, "damping": 0.0}
ENDS = {"i": "rod", "j": "ground"}
TEETH = {"teeth": (20, 40), "module": 0.002, "pressure_angle": 0.35, "flank": 1, "angle_i": 0.0, "sliding_arm": 0.1}
STROKE, TIMES = {"stroke": 1.0, "speed": 1.0, "acceleration": 1.0}, {"start": 0.0, "begin": 0.0, "dwell": 1.0}

BAR = rs.Body("bar", 1.0, (1.0, 1.0, 1.0))
PAIR = {"i": BAR, "j": "ground"}
PLACE = {"point": ORIGIN, "axis": (0.0, 0.0, 1.0), "mark": (1.0, 0.0, 0.0)}
SPATIAL = {"name": "A", **PAIR, **PLACE}
POINTS = {"name": "A", **PAIR, "point_i": ORIGIN, "point_j": (0.0, 0.0, 1.0)}

CALLS = {
    rx.analyze: AT | CHOICE | FACTOR,
    rx.analyze_along: ALONG | CHOICE | {"rank": 2},
    rx.assemble: {"system": PENDULUM, "q": np.zeros(3), "qd": np.zeros(3), "t": 0.0, "positions": {}, "rates": {}},
    rx.assemble_along: {"system": PENDULUM, **LAWS},
    rx.band: AT | BOX | SAMPLED | FACTOR | {"outputs": ["A.x"], "nodes": 1},
    rx.band_along: ALONG | BOX | SAMPLED | {"outputs": ["A.x"], "nodes": 1},
    rx.drive: {"system": PENDULUM, **LAWS, **CHOICE, "solver": rx.Newton()},
    rx.ensemble: RUN | {"samples": {"a": rx.Normal(1.0, 1.0)}, "size": 2, "percentiles": (5, 95), "seed": 0},
    rx.factorize: AT | {"rank": 2},
    rx.frictional_solutions: AT | CHOICE | FACTOR | SEARCH,
    rx.grip: {"mechanism": PENDULUM, "solution": SOLUTION},
    rx.heated: {"mechanism": PENDULUM, "warmer": {"rod": 1.0}, "expansion": 1e-5},
    rx.identify: {"predict": lambda a: a, "measured": 1.0, "parameters": {"a": rx.Normal(1.0, 1.0)}, "noise": 1.0}
    | {"starts": 1, "max_steps": 1, "rtol": 1e-3, "seed": 0},
    rx.keep_programs: {"folder": "programs"},
    rx.lift_off: CHOICE | {"system": STOPPED, "state": STATE, "load": {"rod.phi": 1.0}},
    rx.limit_load: AT | BOX | FACTOR | {"load": {"rod.phi": 1.0}, "nodes": 1},
    rx.load_model: {"path": "a.xml", "closures": []},
    rx.misfit: {"system": PENDULUM, "actual": PENDULUM, "state": STATE},
    rx.simulate: AT
    | CHOICE
    | {"t1": 0.1, "solver": diffrax.Dopri5(), "stabilisation": rx.Projection(), "ts": [0.1]}
    | {"rtol": 1e-6, "dt0": 0.1, "jump_ts": [0.05], "max_steps": 9, "max_phases": 1, "rank": 2, "restitution": 0.0}
    | {"adjoint": diffrax.ForwardMode()},
    rx.solution_family: AT | CHOICE | FACTOR | SAMPLED | {"watch": lambda solution: solution.friction},
    rx.solve: AT | CHOICE | FACTOR | {"solver": rx.Newton(), "x0": 0.0, "sense": 1.0},
    rx.stability: AT | CHOICE | FACTOR | {"solution": SOLUTION},
    rx.sticking: AT | BOX | SAMPLED | FACTOR,
    rx.study: RUN,
    rx.tolerance_study: {key: given for key, given in RUN.items() if key != "run"}
    | {
        "build": lambda a: {"b": a},
        "parameters": {"a": rx.Normal(1.0, 1.0)},
        "samples": 2,
        "percentiles": (5, 95),
        "seed": 0,
    },
    rx.with_peaks: {"run_at": lambda ts: ts, "ts": [0.0, 0.1]},
    units.closure_in_units: CHOICE,
    units.dependence_in_units: {"eta": [[1.0]], "dependent": ["force"], "independent": ["force"]}
    | {"units": units.MM_TONNE},
    units.in_units: {"system": PENDULUM, "units": units.MM_TONNE},
    units.minimum_norm_parameters: {"eta": [[1.0]], "basic": [1.0]},
    units.minimum_norm_parameters_in_units: {"eta": [[1.0]], "basic": [1.0], "dependent": ["force"]}
    | {"independent": ["force"], "units": units.MM_TONNE},
    units.parametrised_multipliers: {"eta": [[1.0]], "basic": [1.0], "parameters": [1.0]},
    units.solution_from_units: {"solution": SOLUTION, "system": PENDULUM, "units": units.MM_TONNE},
    units.state_in_units: AT | {"units": units.MM_TONNE},
    units.unit_certificate: AT,
    # Bodies, joints and couplers
    rx.Body: {"name": "rod", "mass": 1.0, "inertia": 0.1},
    rx.Mechanism: {"bodies": [ROD], "joints": [PIVOT], "couplers": (), "loads": (), "gravity": HERE}
    | {"armature": {"A.angle": 1.0}, "pose": lambda phi: (0.0, 0.0, phi), "units": units.SI},
    rx.AngleCoupling: IN_PLANE | {"ratio": 2.0, "angle": 0.0},
    rx.AngleDriver: IN_PLANE | {"angle": 0.0},
    rx.Cable: PIN | {"distance": 1.0},
    rx.Coupler: {"name": "c", "first": "A.angle", "second": "B.angle", "ratio": 1.0},
    rx.DistanceDriver: PIN | {"distance": 1.0},
    rx.Fixed: PIN | {"angle": 0.0},
    rx.GearPair: PIN | TEETH | RUBS | {"angle_j": 0.0},
    rx.KnifeEdge: IN_PLANE | {"point_i": HERE, "direction": (1.0, 0.0)},
    rx.PinInSlot: LINE | RUBS,
    rx.RackAndPinion: LINE | TEETH | RUBS | {"teeth": 20},
    rx.Revolute: PIN | RUBS | {"pin_radius": 0.1},
    rx.SpeedDriver: {"name": "d", "coordinate": "A.angle", "speed": 1.0},
    rx.Stop: {"name": "s", "coordinate": "A.angle", "least": 0.0, "most": 1.0},
    rx.Translational: LINE | RUBS | {"angle": 0.0, "guide_length": 0.1},
    rx.Wheel: LINE | {"radius": 0.1, "rows": ("normal", "along")},
    rs.Body: {"name": "bar", "mass": 1.0, "inertia": (1.0, 1.0, 1.0), "centre": ORIGIN, "position": ORIGIN}
    | {"orientation": (1.0, 0.0, 0.0, 0.0)},
    rs.AngleDriver: SPATIAL | {"angle": 0.0},
    rs.Cable: POINTS | {"distance": 1.0},
    rs.ConstantVelocity: SPATIAL,
    rs.Cylindrical: SPATIAL,
    rs.Distance: POINTS | {"distance": 1.0},
    rs.Fixed: SPATIAL,
    rs.Free: {"name": "A", **PAIR},
    rs.ParallelAxes: SPATIAL,
    rs.Planar: SPATIAL,
    rs.PointOnLine: SPATIAL,
    rs.PointOnPlane: SPATIAL | RUBS,
    rs.Prismatic: SPATIAL,
    rs.Revolute: SPATIAL
    | RUBS
    | {"pin_radius": 0.1, "thrust_radius": 0.1, "bearing_length": 0.1, "contact": rs.AdditiveContact()},
    rs.Screw: SPATIAL | {"pitch": 0.01, "flank_angle": 0.1},
    rs.Spherical: SPATIAL,
    rs.TravelDriver: SPATIAL | {"travel": 0.0},
    rs.Placement: PLACE,
    # Loads
    rx.AppliedForce: {"i": "rod", "force": HERE, "point": HERE, "moment": 0.0, "j": "ground"},
    rx.LoadFunction: {**ENDS, "function": lambda i, j, t, p: (i.wrench(HERE), j.wrench(HERE))},
    rx.SpringDamper: ENDS | SPRING | {"point_i": HERE, "point_j": HERE, "free_length": 0.0},
    rx.TorsionSpring: ENDS | SPRING | {"free_angle": 0.0},
    rs.AppliedForce: {"i": BAR, "force": ORIGIN, "point": ORIGIN, "moment": ORIGIN},
    rs.Bushing: PAIR
    | PLACE
    | {f"{way}{what}": 1.0 for way in ("translation", "rotation") for what in ("", "_damping")},
    rs.LoadFunction: {"i": "bar", "function": lambda i, j, t, p: None},
    rs.SpringDamper: PAIR | SPRING | {"point_i": ORIGIN, "point_j": (0.0, 0.0, 1.0), "free_length": 0.0},
    rs.TorsionSpring: PAIR | SPRING | {"axis": (0.0, 0.0, 1.0), "free_angle": 0.0},
    # Friction, solvers and stabilisation
    rx.ConstantFriction: {"size": 1.0},
    rx.Coulomb: {"mu": 0.1, "preload": 0.0},
    rx.Dahl: {"mu": 0.1, "stiffness": 1.0, "preload": 0.0},
    rx.Friction: {"slip": lambda q, t, p: q, "force": lambda *given: given[0], "rows": [0], "kinds": ["linear"]},
    rx.LuGre: {"static": 0.2, "kinetic": 0.1, "velocity": 0.01, "stiffness": 1e5, "damping": 1.0, "viscous": 0.0},
    rx.RegularisedCoulomb: {"mu": 0.1, "velocity": 0.01, "preload": 0.0},
    rx.Stribeck: {"static": 0.2, "kinetic": 0.1, "velocity": 0.01, "viscous": 0.0, "preload": 0.0},
    rx.Continuation: {"rtol": 1e-9, "max_steps": 9, "max_path": 9},
    rx.FixedPoint: {"rtol": 1e-9, "max_steps": 9},
    rx.Newton: {"rtol": 1e-9, "max_steps": 9},
    rx.Baumgarte: {"alpha": 1.0, "beta": 1.0},
    # Closures, bounds and distributions
    rx.AmplitudeBox: {"box": {"A.x": (0.0, 1.0)}},
    rx.AsBuilt: {"closure": SOFT, "actual": PENDULUM},
    rx.Compliance: {"W": {"A.x": 1.0}, "misfit": {"A.x": 1e-5}, "units": units.SI},
    rx.ComplianceBox: {"closure": SOFT, "box": {"A.x": (1e-9, 1e-8)}},
    rx.ElasticJoints: {"mechanism": PENDULUM, "joints": {"A": 1e-8}, "units": units.SI, "drives": {}, "play": {}},
    rx.JointCompliance: {"joint": "A", "translation": 1e-8, "rotation": 0.0, "coupling": HERE, "misfit": ORIGIN}
    | {"point": HERE},
    rx.LeastNorm: {"ratings": {"A.angle": 1.0}, **CHOICE},
    rx.LeastPeak: {"limits": {"A.angle": 1.0}, "preload": {"A.angle": 0.0}, **CHOICE},
    rx.MinimumNorm: {"h": 1.0, "units": units.SI},
    rx.MisfitBox: {"closure": SOFT, "box": {"A.x": (0.0, 1e-5)}, "friction": {}, "radial": {}},
    rx.PreloadBox: {"box": {"A.x": (0.0, 1.0)}},
    rx.PreloadNorm: {"sizes": {"A.x": 1.0}},
    rx.Normal: {"mean": 1.0, "std": 1.0},
    rx.Uniform: {"low": 0.0, "high": 1.0},
    rs.JointCompliance: {"joint": "A", "translation": 1e-8, "rotation": 0.0, "coupling": np.zeros((3, 3))}
    | {"misfit": np.zeros(6), "point": ORIGIN},
    # Laws of motion, states, units and systems
    rx.Cycloidal: {"stroke": 1.0, "move": 1.0, **TIMES},
    rx.Harmonic: {"amplitude": 1.0, "frequency": 1.0, "mean": 0.0, "phase": 0.0},
    rx.Polynomial: {"coefficients": [1.0]},
    rx.SCurve: STROKE | TIMES | {"jerk": 1.0},
    rx.Sampled: {"times": [0.0, 1.0, 2.0], "ends": "periodic"}
    | {key: [0.0, 1.0, 0.0] for key in ("values", "rates", "accelerations")},
    rx.Trapezoid: STROKE | TIMES,
    rx.State: {"q": [0.0], "qd": [0.0], "t": 0.0},
    rx.System: {"constraint": lambda q, t, p: q[:1], "mass": jnp.eye(2), "n": 2, "units": units.SI}
    | {"coordinates": "linear", "rows": ["force"], "one_sided": ()},
    units.Units: {"length": 1.0, "angle": 1.0, "mass": 1.0, "time": 1.0},
}
# What calls give or what parts inherit from, and spatial joints of which each axis is told by its own name.
# `check` asks for a log.
OTHERS = {rx.Axis, rx.Motion, rx.Pose, rx.Wrench, rx.Settling, rx.Verdict, rx.RESULTS, rx.RedundaxError, rx.check}
OTHERS |= {rx.NoSolutionError, rs.Motion, rs.Pose, rs.Wrench, rs.ContactLoad, rs.ContactSize, rs.Overlap}
OTHERS |= {rs.Gear, rs.KnifeEdge, rs.Universal, rs.Wheel, rs.body_loads, rs.joint_wrench}
OTHERS |= {rs.AdditiveContact, rs.EndContacts, units.UnitCertificate, units.UnitVerdict}


@pytest.mark.skipif(os.environ.get("REDUNDAX_CHECKS") == "on", reason="types of calls are refused before")
@pytest.mark.parametrize("call", CALLS, ids=lambda call: f"{call.__module__.split('.')[-1]}.{call.__name__}")
def test_what_is_no_argument_is_refused_by_its_name(call):
    for argument in CALLS[call]:
        with pytest.raises(rx.RedundaxError, match=f"`{argument}`"):
            call(**{**CALLS[call], argument: object()})


def test_every_public_call_is_asked():
    public = [
        part
        for room in (rx, rs, units)
        for name, part in vars(room).items()
        if not name.startswith("_") and callable(part) and "Abstract" not in name
    ]
    left = [part for part in public if part not in CALLS and part not in OTHERS]
    assert {part.__name__ for part in left if inspect.signature(part).parameters} == set()
