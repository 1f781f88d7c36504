"""Energy over a cycle, the motion that the torque found makes, and derivatives by a design."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import redundax as rx

SPEED = 6.0  # rad/s of the crank


def test_over_a_cycle_the_drive_gives_what_friction_takes():
    """A rubbing slider-crank at constant speed: the mean over one turn, by a rule that is exact for smooth cycles."""
    crank = rx.mechanisms.slider_crank(guides=1, crank=0.1, mu_rho=0.004)
    ts = np.arange(256) * (2 * np.pi / SPEED / 256)
    run = rx.drive(crank, {"A.angle": rx.Polynomial([0.2, SPEED])}, ts, crank.state(0.2).q)
    given = np.mean(run["A.angle power"])
    taken = sum(np.mean(np.asarray(run[f"tau {pin}"]) * np.asarray(run[f"{pin}.angle'"])) for pin in "ABC")
    assert given > 0.1 and np.asarray(run["A.angle power"]).min() < 0
    assert given == pytest.approx(-taken, rel=1e-10)


def test_the_torque_found_makes_the_motion_that_was_asked_for():
    """The spline of the torque at 801 times on the crank without drive: `simulate` follows the law to 1e-8."""
    crank = rx.mechanisms.slider_crank(guides=1, crank=0.1)
    law, ts = rx.Cycloidal(2.0, move=0.5, start=0.3), np.linspace(0.0, 0.5, 801)
    run = rx.drive(crank, {"A.angle": law}, ts, crank.state(0.3).q)
    torque = CubicSpline(ts, np.asarray(run["A.angle torque"]))

    def motor(i, j, t, p):
        k = jnp.clip(jnp.searchsorted(p["t"], t, side="right") - 1, 0, p["c"].shape[1] - 1)
        moment = jnp.polyval(p["c"][:, k], t - p["t"][k])
        return rx.Wrench(jnp.zeros(2), moment), rx.Wrench(jnp.zeros(2), -moment)

    bodies = [rx.Body("crank", 1.0, 0.1**2 / 12), rx.Body("rod", 1.0, 0.52**2 / 12), rx.Body("slider", 2.0, 0.01)]
    joints = [
        rx.Revolute("A", "crank", "ground", (-0.05, 0.0), (0.0, 0.0)),
        rx.Revolute("B", "rod", "crank", (-0.26, 0.0), (0.05, 0.0)),
        rx.Revolute("C", "slider", "rod", (0.0, 0.0), (0.26, 0.0)),
        rx.Translational("K", "slider", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)),
    ]
    loads = [rx.LoadFunction("crank", motor, parameters={"t": ts[:-1], "c": torque.c})]
    free = rx.Mechanism(bodies, joints, loads=loads, gravity=(0.0, -9.81))
    some = np.linspace(0.0, 0.5, 6)
    motion = rx.simulate(free, crank.state(0.3), 0.5, ts=some, rtol=1e-11)
    np.testing.assert_allclose(motion["crank.phi"], jax.vmap(law)(some), rtol=0, atol=1e-8)


def test_peak_and_rms_are_differentiable_by_lengths_masses_friction_and_law_and_batch_over_designs():
    """Against central differences of the calls on known numbers."""
    ts = np.linspace(0.0, 0.4, 9)

    def figures(design):
        length, mass, mu_rho, rate = design
        crank = rx.mechanisms.slider_crank(guides=1, crank=length, slider_mass=mass, mu_rho=mu_rho, force=-20.0)
        law = rx.Polynomial(jnp.stack([jnp.asarray(0.3), rate]))
        run = rx.drive(crank, {"A.angle": law}, ts, crank.state(0.3).q)
        return jnp.stack([run.peak["A.angle"], run.rms["A.angle"]])

    designs = np.array([[0.1, 2.0, 0.004, 8.0], [0.12, 1.5, 0.002, 6.0]])
    by_design = jax.jit(jax.vmap(lambda design: (figures(design), jax.jacfwd(figures)(design))))
    values, slopes = by_design(jnp.asarray(designs))
    for design, value, slope in zip(designs, values, slopes, strict=True):
        np.testing.assert_allclose(figures(design), value, rtol=1e-10)
        for k, step in enumerate(1e-5 * design):
            change = np.eye(4)[k] * step
            found = (figures(design + change) - figures(design - change)) / (2 * step)
            np.testing.assert_allclose(slope[:, k], found, rtol=1e-6, atol=1e-8)
