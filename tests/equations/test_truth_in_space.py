"""Mechanisms in space against mpmath at 50 digits: accelerations, and forces and moments of joints that are unique.

Errors are relative to the largest entry of a kind.
"""

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
import registry
from mpmath import mp
from truth import exact, space

import redundax as rx

ACCELERATION, WRENCH, UNIQUE = 1e-12, 1e-11, 1e-40
QUICK = ("door", "bennett", "bricard")
every_scene = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in space.SCENES]
)


@cache
def scene_of(name: str) -> space.Scene:
    return space.SCENES[name]()


@cache
def truth_of(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Accelerations, wrenches and which of these are unique."""
    scene = scene_of(name)
    solution = scene.solve(friction=False)
    wrenches = scene.wrenches(solution.multipliers)
    stress = scene.wrenches(scene.selfstress) if scene.k else mp.zeros(wrenches.rows, 1)
    unique = [all(abs(x) < UNIQUE for x in row) for row in stress.tolist()]
    return exact.floats(solution.acceleration), exact.floats(wrenches), np.array(unique)


def _labels(scene: space.Scene) -> list[str]:
    """Forces and moments of all joints as the library calls them."""
    parts = [f"{part} {axis}" for part in ("force", "moment") for axis in "xyz"]
    return [f"{joint.name} {part} on body {joint.i}" for joint in scene.joints for part in parts]


@cache
def solution_of(name: str) -> tuple[rx.Mechanism, rx.types.Solution]:
    mechanism, state = registry.in_space(scene_of(name))
    return mechanism, rx.solve(mechanism, state)


@every_scene
def test_the_truth_satisfies_its_equations(name):
    scene = scene_of(name)
    with mp.workdps(exact.DIGITS):
        solution = scene.solve(friction=False)
        motion = scene.mass_matrix * solution.acceleration + scene.jacobian.T * solution.multipliers - scene.load
        assert max(mp.norm(motion), mp.norm(scene.jacobian * solution.acceleration - scene.gamma)) < mp.mpf(10) ** -35
        assert mp.norm(scene.jacobian * scene.velocity) < mp.mpf(10) ** -40


@every_scene
def test_rank_and_accelerations(name):
    scene, found = scene_of(name), solution_of(name)[1]
    assert (found.stats.rank, found.stats.redundancy) == (scene.rank, scene.k)
    truth, half = truth_of(name)[0], 3 * len(scene.bodies)
    for part in (slice(half), slice(half, None)):
        error = np.max(np.abs(found.acceleration[part] - truth[part]))
        assert error <= ACCELERATION * max(np.max(np.abs(truth[part])), 1e-3 * np.max(np.abs(truth)))


@every_scene
def test_unique_wrenches(name):
    scene, (mechanism, found), (_, truth, unique) = scene_of(name), solution_of(name), truth_of(name)
    places = [mechanism.names.reactions.labels.index(label) for label in _labels(scene)]
    error, size = np.abs(np.asarray(found.reactions)[places] - truth), np.abs(truth).reshape(-1, 2, 3)
    for kind in range(2):
        own = np.arange(truth.size) // 3 % 2 == kind
        assert np.max(error[own & unique], initial=0.0) <= WRENCH * np.max(size[:, kind])


@every_scene
def test_which_wrenches_are_unique(name):
    scene, (mechanism, found), unique = scene_of(name), solution_of(name), truth_of(name)[2]
    verdicts = rx.analyze(mechanism, found.state).verdicts["reaction"]
    told = {judged.name for judged in verdicts if judged.without_friction in (rx.Verdict.UNIQUE, rx.Verdict.ZERO)}
    assert told == {label for label, is_unique in zip(_labels(scene), unique, strict=True) if is_unique}


def test_the_mass_matrix_is_constant():
    mechanism, state = registry.in_space(scene_of("door"))
    truth = exact.floats(scene_of("door").mass_matrix)
    np.testing.assert_allclose(mechanism.mass(state.q, jnp.zeros(())), truth, rtol=1e-15)
