"""Drives of more coordinates than freedoms, along laws from the motion that some of them make."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

G, ARM, FORE, TIP = 9.81, 0.5, 0.55, 0.5  # m/s^2, m, m, kg
BASES = np.array([(-0.5, 0.0), (0.5, 0.0), (0.0, 0.9)])
MASSES, INERTIAS = (1.0, 0.8), (0.02, 0.03)  # of arms, and of forearms
MOTORS = ["A0.angle", "A1.angle", "A2.angle"]
TS = np.linspace(0.0, 1.5, 31)


def path(t):
    return jnp.stack([0.05 + 0.15 * jnp.sin(2.0 * t), 0.35 + 0.1 * jnp.cos(3.0 * t)])


def turns(point, base):
    """Of an arm and its forearm that reach a point, the elbow to the left."""
    way = point - base
    length = jnp.hypot(*way)
    inner = jnp.arccos((ARM**2 + length**2 - FORE**2) / (2 * ARM * length))
    arm = jnp.arctan2(way[1], way[0]) + inner
    fore = way - ARM * jnp.stack([jnp.cos(arm), jnp.sin(arm)])
    return arm, jnp.arctan2(fore[1], fore[0])


def poses(point):
    """Of the arms and forearms: places of their middles, and turns."""
    for base in BASES:
        arm, fore = turns(point, base)
        out, on = (jnp.stack([jnp.cos(x), jnp.sin(x)]) for x in (arm, fore))
        yield base + ARM / 2 * out, arm
        yield base + ARM * out + FORE / 2 * on, fore


def robot():
    """A tip on three arms, which does not turn."""
    bodies, joints = [rx.Body("tip", TIP, 0.01)], [rx.AngleDriver("keep", "tip", "ground", angle=lambda t: 0.0 * t)]
    guess = dict(zip(("tip.x", "tip.y"), path(0.0), strict=True))
    for k, base in enumerate(BASES):
        for kind, (mass, inertia) in zip(("arm", "fore"), zip(MASSES, INERTIAS, strict=True), strict=True):
            bodies.append(rx.Body(f"{kind}{k}", mass, inertia))
        joints += [
            rx.Revolute(f"A{k}", f"arm{k}", "ground", (-ARM / 2, 0.0), base),
            rx.Revolute(f"B{k}", f"fore{k}", f"arm{k}", (-FORE / 2, 0.0), (ARM / 2, 0.0)),
            rx.Revolute(f"C{k}", f"fore{k}", "tip", (FORE / 2, 0.0), (0.0, 0.0)),
        ]
    for name, (place, turn) in zip([body.name for body in bodies[1:]], poses(path(0.0)), strict=True):
        guess |= {f"{name}.x": place[0], f"{name}.y": place[1], f"{name}.phi": turn}
    return rx.Mechanism(bodies, joints, gravity=(0.0, -G)), guess


def needed(t):
    """By Lagrange's equations of the tip: N^T u = d/dt dL/dv - dL/dx, of which the least u."""

    def energy(x, v):
        rates = jax.jvp(lambda x: list(poses(x)), (x,), (v,))[1]
        kinetic, height = TIP * v @ v / 2, TIP * G * x[1]
        for (place, _), (speed, spin), mass, inertia in zip(poses(x), rates, MASSES * 3, INERTIAS * 3, strict=True):
            kinetic, height = kinetic + (mass * speed @ speed + inertia * spin**2) / 2, height + mass * G * place[1]
        return kinetic - height

    def momentum(t):
        return jax.grad(energy, 1)(path(t), jax.jvp(path, (t,), (1.0,))[1])

    load = jax.jvp(momentum, (t,), (1.0,))[1] - jax.grad(energy)(path(t), jax.jvp(path, (t,), (1.0,))[1])
    by_motor = jnp.stack([jax.jacfwd(lambda x, base=base: turns(x, base)[0])(path(t)) for base in BASES])
    return by_motor @ jnp.linalg.solve(by_motor.T @ by_motor, load)


def test_three_motors_share_what_moves_a_tip_along_a_path():
    """Cubic splines through the angles contradict each other by 1e-4 rad/s^2 and more."""
    machine, guess = robot()
    laws = {name: lambda t, base=base: turns(path(t), base)[0] for name, base in zip(MOTORS[:2], BASES, strict=False)}
    moved = rx.drive(machine, laws, TS, guess)
    np.testing.assert_allclose(moved["tip.x"], jax.vmap(path)(TS)[:, 0], atol=1e-9)
    run = rx.drive(machine, moved.laws(MOTORS), TS, guess, closure=rx.LeastNorm(dict.fromkeys(MOTORS, 1.0)))
    wanted = jax.vmap(needed)(jnp.asarray(TS))
    np.testing.assert_allclose(run.q, moved.q, atol=1e-12)
    np.testing.assert_allclose([run[f"{name} torque"] for name in MOTORS], wanted.T, rtol=1e-5, atol=1e-5)
    with pytest.raises(rx.RedundaxError, match=r"`names` must .*, but holds 'A9\.angle'"):
        moved.laws(["A9.angle"])


def test_runs_without_laws_say_why():
    pin = rx.Revolute("pin", "arm", "ground", (-ARM, 0.0), (0.0, 0.0))
    rod = rx.DistanceDriver("rod", "arm", "ground", (ARM, 0.0), (2.0, 0.0), rx.Polynomial([1.5, 1.7]))
    arm, guess = rx.Mechanism([rx.Body("arm", TIP, 0.01)], [pin, rod]), {"arm.x": 0.4, "arm.y": 0.3, "arm.phi": 0.7}
    lost = rx.drive(arm, {}, [0.0, 0.1, 1.0, 2.0], guess, throw=False)
    with pytest.raises(rx.RedundaxError, match="no answer at t = 1 s"):
        lost.laws(["pin.angle"])
    with pytest.raises(rx.RedundaxError, match="three times or more"):
        rx.drive(arm, {}, [0.0, 0.1], guess).laws(["pin.angle"])
