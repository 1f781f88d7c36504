"""N-four-bar and mechanisms in space in Exudyn: redundant multibody coordinates, generalised-alpha method."""

import time
from typing import Any

import jax
import numpy as np
from truth import press

import redundax as rx

from ._problems import GRAVITY, T1, SpatialProblem

NAME = "Exudyn"


def missing() -> str:
    """Why it cannot run, if it cannot."""
    try:
        import exudyn  # noqa: F401
    except ImportError:
        return "exudyn is not installed"
    return ""


def run(loops: int, steps: int, rate: float = -1.0, t1: float = T1) -> tuple[float, float]:
    """Seconds of the integration, and the angle of the first crank at the end, from vertical cranks of a rate.

    The angle is NaN where Newton's method of a step fails, as it may beside a singular position.
    """
    import exudyn as exu

    system, crank = _model(loops, rate)
    seconds = _solved(
        system, steps, exu.LinearSolverType.EXUdense if loops < 5 else exu.LinearSolverType.EigenSparse, t1
    )
    if np.isnan(seconds):
        return seconds, np.nan
    return seconds, np.pi / 2 + system.GetNodeOutput(crank, exu.OutputVariableType.Coordinates)[2]


def run_in_space(problem: SpatialProblem, steps: int) -> tuple[float, np.ndarray]:
    """Seconds of the integration, and where the problem's body has its origin at the end."""
    import exudyn as exu

    system, bodies = _in_space(problem.mechanism, problem.state)
    seconds = _solved(system, steps, exu.LinearSolverType.EigenDense)
    place, centre = exu.OutputVariableType.Position, np.asarray(problem.mechanism.body.centre)[problem.body]
    return seconds, np.array(system.GetObjectOutputBody(bodies[problem.body], place, list(-centre)))


def run_press(steps: int, t1: float) -> tuple[float, float]:
    """CPU seconds of the integration, and the crank's angle at the end, of the press of `truth.press`."""
    import exudyn as exu

    system, crank = _press()
    start = time.process_time()
    _solved(system, steps, exu.LinearSolverType.EigenDense, t1)
    seconds = time.process_time() - start
    return seconds, press.PHI0 + system.GetNodeOutput(crank, exu.OutputVariableType.Coordinates)[2]


def _solved(system: Any, steps: int, solver: Any, t1: float = T1) -> float:
    """Seconds of the integration, NaN where Newton's method of a step fails."""
    import exudyn as exu

    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = t1
    settings.linearSolver.ignoreSingularJacobian = True
    settings.linearSolver.solverType = solver
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime, integration.verboseMode = steps, t1, 0
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.newton.useModifiedNewton = True
    start = time.perf_counter()
    try:
        system.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    except exu.SolverError:
        return np.nan
    return time.perf_counter() - start


def _model(loops: int, rate: float) -> tuple:
    """The assembled system and the node of the first crank."""
    import exudyn as exu
    from exudyn import itemInterface as items

    system = exu.SystemContainer().AddSystem()
    ground = system.AddObject(items.ObjectGround())

    def rod(x: float, y: float, angle: float, vx: float, spin: float) -> tuple[int, int]:
        node = system.AddNode(
            items.NodeRigidBody2D(referenceCoordinates=[x, y, angle], initialVelocities=[vx, 0.0, spin])
        )
        body = system.AddObject(items.ObjectRigidBody2D(mass=1.0, inertia=1 / 12, nodeNumber=node))
        weight = items.LoadForceVector(markerNumber=marker(body, 0.0), loadVector=[0.0, -GRAVITY, 0.0])
        system.AddLoad(weight)
        return body, node

    def marker(body: int, x: float) -> int:
        return system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]))

    def pin(first: int, x: float, second: int, y: float) -> None:
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[marker(first, x), marker(second, y)]))

    cranks = [rod(c, 0.5, np.pi / 2, -rate / 2, rate) for c in range(loops + 1)]
    couplers = [rod(c + 0.5, 1.0, 0.0, -rate, 0.0) for c in range(loops)]
    for c, (crank, _) in enumerate(cranks):
        pin(ground, c, crank, -0.5)
    for c, (coupler, _) in enumerate(couplers):
        pin(cranks[c][0], 0.5, coupler, -0.5)
        pin(cranks[c + 1][0], 0.5, coupler, 0.5)
    system.Assemble()
    return system, cranks[0][1]


def _press() -> tuple:
    """The assembled press, of the bodies and the start of redundax's, and the node of its crank."""
    import exudyn as exu
    from exudyn import itemInterface as items

    mechanism, state = press.mechanism()
    body, (x, y, angle) = mechanism.body, np.split(_by_kind(state.q), 3)
    speeds = np.stack(np.split(_by_kind(state.qd), 3), axis=1)
    system = exu.SystemContainer().AddSystem()
    ground = system.AddObject(items.ObjectGround())
    nodes, bodies = [], []
    for k, start in enumerate(np.stack([x, y, angle], axis=1)):
        nodes.append(system.AddNode(items.NodeRigidBody2D(referenceCoordinates=start, initialVelocities=speeds[k])))
        mass, inertia = float(body.mass[k]), float(body.inertia[k])
        bodies.append(system.AddObject(items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=nodes[k])))
    crank, rod, slider, plate = bodies

    def marker(kind: Any, body: int, x: float) -> int:
        return system.AddMarker(kind(bodyNumber=body, localPosition=[x, 0.0, 0.0]))

    def spring(i: int, x: float, j: int, **sizes: list) -> None:
        ends = [marker(items.MarkerBodyPosition, *end) for end in ((i, x), (j, 0.0))]
        system.AddObject(items.ObjectConnectorCartesianSpringDamper(markerNumbers=ends, **sizes))

    half, long = press.R / 2, press.ROD / 2
    for i, at, j, there in ((ground, 0.0, crank, -half), (crank, half, rod, -long), (rod, long, slider, 0.0)):
        ends = [marker(items.MarkerBodyPosition, *end) for end in ((i, at), (j, there))]
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=ends))
    for each, at in ((slider, 0.0), (slider, 0.02), (plate, 0.0)):
        ends = [marker(items.MarkerBodyRigid, *end) for end in ((ground, 0.0), (each, at))]
        system.AddObject(items.ObjectJointPrismatic2D(markerNumbers=ends))
    stiff = {"stiffness": [press.STIFFNESS, 0, 0], "damping": [press.DAMPING, 0, 0], "offset": [press.GAP, 0, 0]}
    spring(slider, 0.0, plate, **stiff)
    spring(ground, press.REST, plate, stiffness=[press.SOFT, 0, 0])
    system.Assemble()
    return system, nodes[0]


def _by_kind(values: jax.Array) -> np.ndarray:
    """x, y and angle of all bodies, one after the other, of coordinates in the order of a mechanism."""
    linear, angular = np.split(np.asarray(values), [2 * len(values) // 3])
    return np.concatenate([linear[::2], linear[1::2], angular])


def _in_space(mechanism: rx.Mechanism, state: rx.State) -> tuple:
    """The assembled system of a mechanism of hinges, sliders and springs, and its bodies."""
    import exudyn as exu
    from exudyn import utilities

    system = exu.SystemContainer().AddSystem()
    pose, own, joints, loads, gravity = jax.tree.map(
        np.asarray, (mechanism.poses(state.q), mechanism.body, mechanism.joints, mechanism.loads, mechanism.gravity)
    )
    (r, axes), (linear, angular) = (pose.r, pose.axes), np.asarray(state.qd).reshape(2, -1, 3)
    bodies = [
        system.CreateRigidBody(
            inertia=utilities.RigidBodyInertia(float(own.mass[b]), np.diag(own.inertia[b]), [0, 0, 0]),
            referencePosition=r[b] + axes[b] @ own.centre[b],
            referenceRotationMatrix=axes[b],
            initialVelocity=linear[b],
            initialAngularVelocity=axes[b] @ angular[b],
            gravity=gravity,
        )
        for b in range(len(linear))
    ]
    bodies.append(system.CreateGround())
    make = {"Revolute": system.CreateRevoluteJoint, "Prismatic": system.CreatePrismaticJoint}
    for stack in joints:
        e = stack.element
        for i, j, point, along in zip(stack.i, stack.j, e.point_i, e.axes_i, strict=True):
            place = {"position": r[i] + axes[i] @ point, "axis": axes[i] @ along[:, 2], "useGlobalFrame": True}
            make[type(e).__name__](itemNumbers=[bodies[i], bodies[j]], **place)
    centres = np.append(own.centre, np.zeros((1, 3)), axis=0)
    for stack in loads:
        e = stack.element
        for k, (i, j) in enumerate(zip(stack.i, stack.j, strict=True)):
            system.CreateSpringDamper(
                bodyNumbers=[bodies[i], bodies[j]],
                localPosition0=e.point_i[k] - centres[i],
                localPosition1=e.point_j[k] - centres[j],
                referenceLength=float(e.free_length[k]),
                stiffness=float(e.stiffness[k]),
                damping=float(e.damping[k]),
            )
    system.Assemble()
    return system, bodies
