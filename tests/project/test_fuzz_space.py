"""Random mechanisms in space against NumPy: ranks, accelerations, the power of joints, laws of Newton and Euler."""

import numpy as np
import pytest
from fuzzing import space

import redundax as rx

SAMPLES = 4


@pytest.mark.slow
@pytest.mark.parametrize(("number", "bodies"), [(k, 2 + k % 4) for k in range(8)])
def test_random_trees_and_loops(number, bodies):
    rng = np.random.default_rng([7, number])
    structure, judged = space.draw(rng, bodies), 0
    for _ in range(SAMPLES):
        mechanism, q = space.build(structure, rng)
        differences = space.Differences(mechanism, q, rng.normal(size=6 * bodies))
        if not differences.clear:
            continue
        solution = rx.solve(mechanism, rx.State(q, differences.velocity), throw=False)
        assert solution.stats.rank == differences.rank
        assert solution.result == rx.RESULTS.successful
        judged += 1
        agrees_with_differences(mechanism, differences, solution)
        joints_do_no_work_and_bodies_obey_newton_and_euler(structure, mechanism, solution)
    assert judged


def agrees_with_differences(mechanism, differences, solution):
    load = np.asarray(mechanism.load(solution.state))
    truth = differences.acceleration(load)
    assert np.max(np.abs(solution.acceleration - truth)) <= 1e-5 * (1 + np.max(np.abs(truth)))


def joints_do_no_work_and_bodies_obey_newton_and_euler(structure, mechanism, solution):
    q, qd, qdd = (np.asarray(x) for x in (solution.q, solution.qd, solution.acceleration))
    at, count = space.kinematics(q, qd), structure.bodies
    forces, moments = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    size = 1 + np.max(np.abs(solution.reactions))
    for k, (_, i, j, _) in enumerate(structure.joints):
        point = at_joint(mechanism, at, k, i)
        force, moment = (
            np.array([solution[f"joint {k} {part} {axis} on body {i}"] for axis in "xyz"])
            for part in ("force", "moment")
        )
        power = force @ (at.of_point(i, point) - at.of_point(j, point)) + moment @ (at.spin[i] - at.spin[j])
        assert abs(power) <= 1e-10 * size * (1 + np.max(np.abs(qd)))
        for body, sign in ((i, 1), (j, -1)):
            forces[body] += sign * force
            moments[body] += sign * (moment + np.cross(point - at.centre[body], force))
    mass, gravity = np.asarray(mechanism.body.mass), np.asarray(mechanism.gravity)
    for b in range(count):
        axes, inertia = at.axes[b], at.axes[b] @ np.asarray(mechanism.body.inertia[b]) @ at.axes[b].T
        turning = axes @ qdd[3 * (count + b) : 3 * (count + b) + 3]
        assert np.allclose(forces[b], mass[b] * (qdd[3 * b : 3 * b + 3] - gravity), rtol=0, atol=1e-11 * size)
        gyroscopic = np.cross(at.spin[b], inertia @ at.spin[b])
        assert np.allclose(moments[b], inertia @ turning + gyroscopic, rtol=0, atol=1e-10 * size)


def at_joint(mechanism, at, joint, body):
    """The joint's point on body i, global."""
    for stack, group in zip(mechanism.joints, mechanism.names.joints, strict=True):
        if f"joint {joint}" in group:
            local = np.asarray(stack.element.point_i[group.index(f"joint {joint}")])
    return at.centre[body] + at.axes[body] @ (local - np.asarray(mechanism.body.centre[body]))
