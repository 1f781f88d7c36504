"""Friction of joints in space against mpmath at 50 digits: with radial, axial and bending loads, and twist."""

from functools import cache

import numpy as np
import pytest
import registry
from mpmath import mp
from truth import exact, space_friction

import redundax as rx

every_scene = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=() if n in ("door", "carriage") else pytest.mark.slow) for n in space_friction.SCENES],
)
every_closure = pytest.mark.parametrize("closure", ["minimum norm", "compliance"])


@cache
def rubbing(name: str) -> space_friction.Rubbing:
    return space_friction.SCENES[name]()


def irregular(count: int) -> list[float]:
    """Compliances from 1/8 to 4, of two binary digits, which are exact as floats."""
    return [(1 + (7 * k) % 4 / 4) * 2.0 ** ((5 * k) % 5 - 3) for k in range(count)]


@cache
def truth_of(name: str, closure: str) -> exact.Solution:
    mechanism = rubbing(name)
    with mp.workdps(exact.DIGITS):
        weights = mp.diag([mp.mpf(x) for x in irregular(mechanism.m)])
        return mechanism.solve(None if closure == "minimum norm" else weights)


def built(name: str) -> tuple[rx.Mechanism, rx.State]:
    mechanism = rubbing(name)
    return registry.in_space(mechanism.scene, {joint: model(rub) for joint, rub in mechanism.rubs.items()})


def model(rub: space_friction.Rub) -> dict:
    """What the library's joint is given, for each kind."""
    contact = rx.spatial.AdditiveContact() if rub.additive else rx.spatial.EndContacts()
    both = {"friction": rx.Coulomb(float(rub.mu)), "contact": contact}
    pin = {"pin_radius": float(rub.radius), "bearing_length": float(rub.length), "thrust_radius": float(rub.thrust)}
    guide = {"guide_length": float(rub.length), "twist_radius": float(rub.twist)}
    return {"Revolute": {**both, **pin}, "Prismatic": {**both, **guide}}


@every_scene
def test_the_truth_satisfies_its_equations(name):
    mechanism, found = rubbing(name), truth_of(name, "minimum norm")
    with mp.workdps(exact.DIGITS):
        friction = mechanism.distribution * found.friction
        motion = mechanism.mass_matrix * found.acceleration + mechanism.jacobian.T * found.multipliers
        assert mp.norm(motion - mechanism.load - friction) < mp.mpf(10) ** -35
        assert mp.norm(found.friction - mechanism.law(found.multipliers)[0]) < mp.mpf(10) ** -35
        assert all(tau * sense < 0 for tau, sense in zip(found.friction, mechanism.senses, strict=True))


@every_scene
@every_closure
def test_friction_and_accelerations(name, closure, record_property):
    truth, (mechanism, state) = truth_of(name, closure), built(name)
    joints = rubbing(name).scene.joints
    labels = [f"{joint.name}.{row}" for joint in joints for row, _ in getattr(rx.spatial, joint.kind).row_kinds]
    places = [labels.index(label) for label in mechanism.rows.labels]
    weights = np.array(irregular(len(labels)))[places]
    picked = rx.MinimumNorm() if closure == "minimum norm" else rx.Compliance(weights)
    found = rx.solve(mechanism, state, closure=picked)
    named = [joint.name for joint in rubbing(name).joints]
    errors = []
    for value, true in (
        (found.acceleration, exact.floats(truth.acceleration)),
        (found.multipliers, exact.floats(truth.multipliers)[places]),
        ([found[f"tau {joint}"] for joint in named], exact.floats(truth.friction)),
    ):
        errors.append(float(np.max(np.abs(np.asarray(value) - true)) / np.max(np.abs(true))))
    record_property("errors", errors)
    assert max(errors) <= 1e-12
