"""N-four-bar in Exudyn: redundant multibody coordinates, generalised-alpha method."""

import time

import numpy as np

from ._problems import GRAVITY, T1

NAME = "Exudyn"


def missing() -> str:
    """Why it cannot run, if it cannot."""
    try:
        import exudyn  # noqa: F401
    except ImportError:
        return "exudyn is not installed"
    return ""


def run(loops: int, steps: int, rate: float = -1.0) -> tuple[float, float]:
    """Seconds of the integration, and the angle of the first crank at the end, from vertical cranks of a rate.

    The angle is NaN where Newton's method of a step fails, as it may beside a singular position.
    """
    import exudyn as exu

    system, crank = _model(loops, rate)
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = T1
    settings.linearSolver.ignoreSingularJacobian = True
    dense = loops < 5
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense if dense else exu.LinearSolverType.EigenSparse
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime, integration.verboseMode = steps, T1, 0
    integration.generalizedAlpha.spectralRadius = 0.9
    integration.newton.useModifiedNewton = True
    start = time.perf_counter()
    try:
        system.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    except exu.SolverError:
        return time.perf_counter() - start, np.nan
    seconds = time.perf_counter() - start
    return seconds, np.pi / 2 + system.GetNodeOutput(crank, exu.OutputVariableType.Coordinates)[2]


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
