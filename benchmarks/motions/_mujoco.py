"""N-four-bar in MuJoCo: a tree of cranks and couplers, closed by equality constraints."""

import time

import numpy as np

from ._problems import GRAVITY, T1

INTEGRATORS = {"MuJoCo, Euler": "Euler", "MuJoCo, RK4": "RK4"}


def missing() -> str:
    """Why it cannot run, if it cannot."""
    try:
        import mujoco  # noqa: F401
    except ImportError:
        return "mujoco is not installed"
    return ""


def run(loops: int, steps: int, integrator: str, rate: float = -1.0, t1: float = T1) -> tuple[float, float]:
    """Seconds of the integration, and the angle of the first crank at the end, from vertical cranks of a rate."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_model(loops, t1 / steps, integrator))
    data = mujoco.MjData(model)
    data.qvel[:] = [rate if model.joint(j).name[0] == "c" else -rate for j in range(model.njnt)]
    start = time.perf_counter()
    mujoco.mj_step(model, data, nstep=steps)
    seconds = time.perf_counter() - start
    return seconds, np.pi / 2 + data.joint("c0").qpos[0]


def _model(loops: int, step: float, integrator: str) -> str:
    """Cranks vertical, in the plane x, y; every coupler a child of its left crank; two steps as time of closing."""
    rod = f'mass="1" diaginertia="{1 / 12} {1 / 12} {1 / 12}"'
    bodies = ""
    for c in range(loops + 1):
        coupler = (
            f'<body pos="0 1 0" name="B{c}"><joint name="b{c}" axis="0 0 1"/><inertial pos=".5 0 0" {rod}/></body>'
        )
        crank = f'<joint name="c{c}" axis="0 0 1"/><inertial pos="0 .5 0" {rod}/>{coupler if c < loops else ""}'
        bodies += f'<body pos="{c} 0 0" name="C{c}">{crank}</body>'
    stiff = f'solref="{2 * step} 1" solimp="0.9999 0.9999 0.001"'
    pins = "".join(f'<connect body1="B{c}" body2="C{c + 1}" anchor="1 0 0" {stiff}/>' for c in range(loops))
    option = f'timestep="{step}" gravity="0 {-GRAVITY} 0" integrator="{integrator}" tolerance="1e-14"'
    return (
        f'<mujoco><compiler inertiafromgeom="false"/><option {option}><flag contact="disable"/></option>'
        f"<worldbody>{bodies}</worldbody><equality>{pins}</equality></mujoco>"
    )
