"""Energy over a cycle, the motion that the torque found makes, and derivatives by a design."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import redundax as rx

SPEED = 6.0  # rad/s of the crank


@pytest.mark.slow
def test_over_a_cycle_the_drive_gives_what_friction_takes():
    """A rubbing slider-crank at constant speed: the mean over one turn, by a rule that is exact for smooth cycles."""
    crank = rx.mechanisms.slider_crank(guides=1, crank=0.1, mu_rho=0.004)
    ts = np.arange(256) * (2 * np.pi / SPEED / 256)
    run = rx.drive(crank, {"A.angle": rx.Polynomial([0.2, SPEED])}, ts, crank.state(0.2).q)
    given = np.mean(run["A.angle power"])
    taken = sum(np.mean(np.asarray(run[f"tau {pin}"]) * np.asarray(run[f"{pin}.angle'"])) for pin in "ABC")
    assert given > 0.1 and np.asarray(run["A.angle power"]).min() < 0
    assert given == pytest.approx(-taken, rel=1e-10)


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_laws_leave_free_is_refused_and_moves_in_simulate():
    """A pendulum on an arm that a driver swings, against SciPy on its one equation."""
    joints = [
        rx.Revolute("shoulder", "upper", "ground", (-0.5, 0.0), (0.0, 0.0)),
        rx.Revolute("elbow", "lower", "upper", (-0.5, 0.0), (0.5, 0.0)),
        rx.AngleDriver("motor", "upper", "ground", rx.Harmonic(0.2, frequency=1.0)),
    ]
    arms = rx.Mechanism([rx.Body(name, 1.0, 0.1) for name in ("upper", "lower")], joints, gravity=(0.0, -9.81))
    ts, start, rate = np.linspace(0.0, 0.5, 6), {"upper.x": 0.5, "lower.x": 1.5}, 2 * np.pi
    with pytest.raises(rx.RedundaxError, match=r"elbow.angle can move there.*`rx.simulate` moves what is free"):
        rx.drive(arms, {}, ts, start)
    state = rx.assemble(arms, start, t=0.0, rates={"lower.phi": 0.2 * rate})
    motion = rx.simulate(arms, state, 0.5, ts=ts, rtol=1e-10)

    def swing(t, y):
        angle, speed, change = 0.2 * np.array(
            [np.sin(rate * t), rate * np.cos(rate * t), -(rate**2) * np.sin(rate * t)]
        )
        normal = np.cos(y[0] - angle) * change + np.sin(y[0] - angle) * speed**2  # of the elbow, to the pendulum
        return [y[1], -0.5 * (normal + 9.81 * np.cos(y[0])) / (0.1 + 0.25)]

    wanted = solve_ivp(swing, (0.0, 0.5), [0.0, 0.2 * rate], rtol=1e-12, atol=1e-12, t_eval=ts).y[0]
    np.testing.assert_allclose(motion["lower.phi"], wanted, rtol=0, atol=1e-8)


@pytest.mark.slow
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


@pytest.mark.slow
def test_one_stroke_tells_friction_and_preload_together_and_strokes_under_two_loads_tell_both():
    """A table of 20 kg on a guide: by hand F = 20 a + mu (20 g + load + preload) with mu = 0.1 and 50 N of preload."""
    law, ts = rx.Harmonic(0.1, frequency=1.0), np.linspace(0.02, 0.2, 10)

    def stroke(mu, preload, load):
        guide = {"normal": (0.0, 1.0), "guide_length": 0.2, "friction": rx.Coulomb(mu, preload)}
        slide = rx.Translational("K", "table", "ground", (0.0, 0.0), (0.0, 0.0), **guide)
        press = rx.AppliedForce("table", force=jnp.stack([0.0 * load, -load]))
        table = rx.Mechanism([rx.Body("table", 20.0, 1.0)], [slide], loads=[press], gravity=(0.0, -9.81))
        return rx.drive(table, {"K.travel": law}, ts, {})["K.travel force"]

    loads, omega = np.array([100.0, 400.0]), 2 * np.pi
    hand = -20 * 0.1 * omega**2 * np.sin(omega * ts) + 0.1 * (20 * 9.81 + loads[:, None] + 50.0)
    ranges, noise = {"mu": rx.Uniform(0.02, 0.3), "preload": rx.Uniform(0.0, 200.0)}, 0.1
    one = rx.identify(lambda mu, preload: stroke(mu, preload, loads[0]), hand[0], ranges, noise=noise, starts=2)
    assert [set(each.names) for each in one.undetermined] == [{"mu", "preload"}]
    mu, preload = one.estimate["mu"], one.estimate["preload"]
    assert mu * (20 * 9.81 + 100 + preload) == pytest.approx(0.1 * (20 * 9.81 + 150), rel=1e-5)
    both = rx.identify(
        lambda mu, preload: jax.vmap(lambda load: stroke(mu, preload, load))(jnp.asarray(loads)),
        hand,
        ranges,
        noise=noise,
        starts=2,
    )
    assert not both.undetermined
    assert both.estimate["mu"] == pytest.approx(0.1, rel=1e-4) and both.estimate["preload"] == pytest.approx(
        50, rel=1e-3
    )
