"""How many solutions friction of joints in space has, and which: a search of its own, each root then at 50 digits."""

import dataclasses
from functools import cache

import numpy as np
import pytest
import registry
from mpmath import mp
from truth import exact, space, space_friction
from truth.space_friction import Rub, Rubbing

import redundax as rx

STARTS, STEPS = 3000, 60


def scene_of(name: str, mu: str, back: bool) -> Rubbing:
    if name == "door":
        scene = dataclasses.replace(space.door(), gravity=space.vector(3, -9, 2))
    else:
        scene = dataclasses.replace(space_friction.carriage(), gravity=space.vector(1, 2, 9))
        scene = dataclasses.replace(scene, joints=scene.joints[:1] if name == "guide" else scene.joints)
    if back:
        scene = dataclasses.replace(scene, push=tuple(-x for x in scene.push))
    pin, guide = Rub(mu, length="0.05", radius="0.012", thrust="0.02"), Rub(mu, length="0.2", twist="0.06")
    return Rubbing(scene, {joint.name: pin if joint.kind == "Revolute" else guide for joint in scene.joints})


def pressed(kind: str, rub: Rub, own: np.ndarray) -> np.ndarray:
    """N of multipliers (.., rows), as of `space_friction`."""
    length, radius, thrust, twist = (float(x) for x in (rub.length, rub.radius, rub.thrust, rub.twist))
    force, moment = own[..., :2], own[..., 3:5] if kind == "Revolute" else own[..., 2:4]
    beside = np.abs(own[..., 2]) * thrust / radius if kind == "Revolute" else np.abs(own[..., 4]) / twist
    c = np.stack([-moment[..., 1], moment[..., 0]], axis=-1) / length
    return sum(np.linalg.norm(force / 2 + sign * c, axis=-1) for sign in (1, -1)) + beside


def searched(mechanism: Rubbing, start: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Roots tau (s, f) of tau = law(start + unit tau) that Newton's method finds from many starts."""
    joints, rubs = mechanism.scene.joints, mechanism.rubs

    def law(tau):
        parts = np.split(start + tau @ unit.T, len(joints), axis=-1)
        sizes = [float(rubs[j.name].mu) * float(rubs[j.name].radius) for j in joints]
        forces = [size * pressed(j.kind, rubs[j.name], own) for size, j, own in zip(sizes, joints, parts, strict=True)]
        return -np.array(mechanism.senses) * np.stack(forces, axis=-1)

    random, f = np.random.default_rng(1), unit.shape[1]
    tau = random.normal(size=(STARTS, f)) * 10 ** random.uniform(-2, 5, (STARTS, 1))
    for _ in range(STEPS):
        here, h = law(tau), 1e-6 * np.abs(tau).max(axis=1, keepdims=True)
        slopes = [(law(tau + h * np.eye(f)[k]) - here) / h for k in range(f)]
        step = np.linalg.solve(np.eye(f) - np.stack(slopes, axis=-1), (tau - here)[..., None])[..., 0]
        tau = tau - step
    tau = tau[np.abs(step).max(axis=1) <= 1e-8 * np.abs(tau).max(axis=1)]
    found = []
    while len(tau):
        found.append(tau[0])
        tau = tau[np.abs(tau - tau[0]).max(axis=1) > 1e-6 * np.abs(tau[0]).max()]
    return np.array(sorted(found, key=lambda tau: tau[0])).reshape(-1, f)


@cache
def truth(name: str, mu: str, back: bool) -> np.ndarray:
    """All friction under minimum norm, shape (count, f)."""
    mechanism = scene_of(name, mu, back)
    with mp.workdps(exact.DIGITS):
        _, multipliers = mechanism.responses
        picked = multipliers - mechanism.projector * multipliers
        start, unit = picked[:, 0], picked[:, 1:]
        roots = []
        for tau in searched(mechanism, exact.floats(start), exact.floats(unit).reshape(mechanism.m, -1)):
            tau = mp.matrix(tau.tolist())
            for _ in range(6):
                here, slope = mechanism.law(start + unit * tau)
                tau = tau - mp.lu_solve(mp.eye(len(tau)) - slope * unit, tau - here)
            assert mp.norm(tau - mechanism.law(start + unit * tau)[0]) <= mp.mpf(10) ** -40 * mp.norm(tau)
            roots.append(exact.floats(tau))
    return np.reshape(roots, (len(roots), unit.cols))


CASES = [
    ("door", "2.5", False, 1),
    ("door", "3.2", False, 2),
    ("door", "3.2", True, 0),
    ("carriage", "0.2", True, 1),
    ("carriage", "0.25", False, 2),
    ("carriage", "0.25", True, 0),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "mu", "back", "count"), CASES)
def test_every_solution_is_found(name, mu, back, count):
    """Friction that presses its own joint has one solution, two or none."""
    true = truth(name, mu, back)
    assert len(true) == count
    contact = rx.spatial.EndContacts()
    sizes = {
        "Revolute": {"pin_radius": 0.012, "bearing_length": 0.05, "thrust_radius": 0.02},
        "Prismatic": {"guide_length": 0.2, "twist_radius": 0.06},
    }
    rubs = {kind: {"friction": rx.Coulomb(float(mu)), "contact": contact, **own} for kind, own in sizes.items()}
    mechanism = scene_of(name, mu, back)
    system, state = registry.in_space(mechanism.scene, dict.fromkeys(mechanism.rubs, rubs))
    found = np.reshape([solution.friction for solution in rx.frictional_solutions(system, state)], (-1, true.shape[1]))
    order = np.argsort(found[:, 0])
    assert len(found) == count
    np.testing.assert_allclose(found[order], true, rtol=1e-10)
