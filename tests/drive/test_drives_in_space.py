"""Forces of drives of overconstrained mechanisms in space against mpmath at 50 digits, with and without friction."""

from functools import cache

import numpy as np
import pytest
import registry
from mpmath import mp
from truth import driven, exact, space, space_friction

import redundax as rx

TS = (0.0, 0.25, 0.5)  # s
LAW = (0.0, 1.5, 2.0)  # rad, rad/s, rad/s^2: of the angle from where it begins
SOFT = (3e-8, 5e-6)  # m/N, rad/(N m) of every joint
RUBBING = tuple("ABCD")
PIN = {
    "friction": rx.Coulomb(float(space_friction.PIN.mu)),
    "pin_radius": float(space_friction.PIN.radius),
    "bearing_length": float(space_friction.PIN.length),
    "thrust_radius": float(space_friction.PIN.thrust),
    "contact": rx.spatial.EndContacts(),
}


@exact.exactly
def motion(t, start):
    """The angle and its derivatives."""
    first, second = (mp.mpf(x) for x in LAW[1:])
    return start + first * t + second * t**2, first + 2 * second * t, 2 * second


@cache
def bennett(t: float) -> driven.Driven:
    with mp.workdps(exact.DIGITS):
        return driven.bennett(*motion(t, 2 * mp.atan(mp.mpf(3) / 4)))


@cache
def truth(t: float, *, rubs: bool) -> tuple[float, np.ndarray, np.ndarray]:
    """What the drive gives, wrenches of the joints and friction."""
    scene = bennett(t)
    mechanism = space_friction.Rubbing(scene, dict.fromkeys(RUBBING, space_friction.PIN)) if rubs else scene
    weights = [SOFT[kind == "moment"] for kind in scene.kinds]
    found = mechanism.solve(weights, friction=rubs)
    wrenches = exact.floats(scene.wrenches(found.multipliers))
    return -float(found.multipliers[len(scene.kinds) - 1]), wrenches, exact.floats(found.friction)


@pytest.mark.parametrize("rubs", [True, False])
@pytest.mark.slow
def test_bennetts_linkage(rubs, record_property):
    """Torque, all joint loads on elastic joints, and friction at several times; positions follow the closed form."""
    rub = {name: {"Revolute": PIN} for name in RUBBING} if rubs else {}
    linkage, _ = registry.in_space(space.bennett(), rub)
    soft = rx.ElasticJoints(linkage, dict.fromkeys(RUBBING, SOFT))
    run = rx.drive(linkage, {"A.angle": rx.Polynomial([*LAW])}, TS, closure=soft)
    labels = [f"{x} force {y}" for x in RUBBING for y in "xyz"], [f"{x} moment {y}" for x in RUBBING for y in "xyz"]
    torques, wrenches, friction = (np.array(part) for part in zip(*(truth(t, rubs=rubs) for t in TS), strict=True))
    wrenches = wrenches.reshape(len(TS), 4, 2, 3)
    pairs = [(run["A.angle torque"], torques)]
    for which, names in enumerate(labels):
        on = [f"{name} on body {min(k // 3, 2)}" for k, name in enumerate(names)]
        pairs.append((np.stack([run[name] for name in on], axis=1), wrenches[:, :, which].reshape(len(TS), -1)))
    if rubs:
        pairs.append((np.stack([run[f"tau {name}"] for name in RUBBING], axis=1), friction))
    errors = [float(np.max(np.abs(np.asarray(found) - true)) / np.max(np.abs(true))) for found, true in pairs]
    record_property("errors", errors)
    assert max(errors) <= 1e-12, errors  # as of one solve, `test_friction_in_space`
    assert np.all(run.determined) != rubs and np.all(run.determined_without_friction)


@pytest.mark.slow
def test_bricards_mechanism(record_property):
    """Problem A04 of the benchmark library, from the cube on."""
    mechanism, _ = registry.in_space(space.bricard())
    run = rx.drive(mechanism, {"A.angle": rx.Polynomial([*LAW])}, TS)
    with mp.workdps(exact.DIGITS):
        wanted = [float(driven.torque_of_bricard(*motion(t, -mp.pi / 2))) for t in TS]
    error = float(np.max(np.abs(np.asarray(run["A.angle torque"]) - wanted)) / np.max(np.abs(wanted)))
    record_property("errors", [error])
    assert error <= 1e-12
    assert np.all(run.determined)
