"""Which torque motors of wheels must give: a cart on two wheels and a caster along circles, against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

TRACK, R, AHEAD = 0.6, 0.15, 0.2  # of the wheels; of the chassis' centre ahead of their axle
M, IZ, M_WHEEL = 30.0, 1.7, 1.5
AXLE, ACROSS = M_WHEEL * R**2 / 2, M_WHEEL * R**2 / 4  # inertia of a thin disc
G = 9.81


def cart(couplers=()):
    chassis = rx.spatial.Body("chassis", M, (1.0, 1.2, IZ), position=(AHEAD, 0.0, 0.25))
    wheels, joints = [], [rx.spatial.PointOnPlane("caster", chassis, "ground", (0.5, 0.0, 0.0), (0.0, 0.0, 1.0))]
    for name, side in (("left", 1.0), ("right", -1.0)):
        centre, axle = (0.0, side * TRACK / 2, R), (0.0, 1.0, 0.0)
        wheels.append(rx.spatial.Body(name, M_WHEEL, (ACROSS, AXLE, ACROSS), position=centre))
        joints += [
            rx.spatial.Revolute(f"{name} hub", wheels[-1], chassis, centre, axle),
            rx.spatial.Wheel(f"{name} tyre", wheels[-1], "ground", centre, axle, radius=R),
        ]
    return rx.Mechanism([chassis, *wheels], joints, couplers=couplers, gravity=(0.0, 0.0, -G))


def torques(rates, changes):
    """Of both motors, from the plane: m (v' - d w^2) = F_l + F_r, (I + m d^2) w' + m d v w = (F_r - F_l) T / 2 about
    the middle of the axle, and J u' = tau - R F for each wheel, in which m and I are of all but its spin."""
    (left, right), (left_change, right_change) = rates, changes
    v, w = R * (right + left) / 2, R * (right - left) / TRACK
    v_change, w_change = R * (right_change + left_change) / 2, R * (right_change - left_change) / TRACK
    whole = IZ + M * AHEAD**2 + 2 * (ACROSS + M_WHEEL * TRACK**2 / 4)
    ahead = (M + 2 * M_WHEEL) * v_change - M * AHEAD * w**2
    turning = (whole * w_change + M * AHEAD * v * w) * 2 / TRACK
    forces = (ahead - turning) / 2, (ahead + turning) / 2
    return [AXLE * change + R * force for change, force in zip((left_change, right_change), forces, strict=True)]


TS = np.linspace(0.0, 2.0, 17)


@pytest.mark.slow
def test_a_cart_on_two_motors_runs_in_a_circle():
    """At constant speeds the axle's middle is at v / w (sin w t, 1 - cos w t)."""
    mechanism = cart()
    laws = {"left hub.angle": rx.Polynomial([0.0, 4.0]), "right hub.angle": rx.Polynomial([0.0, 6.0])}
    run = rx.drive(mechanism, laws, TS)
    v, w = 5.0 * R, 2.0 * R / TRACK
    heading = w * TS
    middle = v / w * np.stack([np.sin(heading), 1 - np.cos(heading)], axis=1)
    centre = middle + AHEAD * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    np.testing.assert_allclose(run.q[:, :2], centre, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run["left hub.angle"], 4.0 * TS, rtol=0, atol=1e-9)
    wanted = torques((4.0, 6.0), (0.0, 0.0))
    for name, torque in zip(("left", "right"), wanted, strict=True):
        np.testing.assert_allclose(run[f"{name} hub.angle torque"], torque, rtol=0, atol=1e-8)
    assert np.all(run.determined)
    assert "yes" in str(run)


@pytest.mark.slow
def test_speeds_that_grow_along_a_spiral():
    """By motors of speed, whose angles nobody gives; of a turn by more and more radians in a second."""
    left, right = rx.Polynomial([1.0, 1.5]), rx.Polynomial([1.0, 3.0])
    motors = [rx.SpeedDriver("L", "left hub.angle", left), rx.SpeedDriver("R", "right hub.angle", right)]
    run = rx.drive(cart(motors), {}, TS)
    turned = R / TRACK * 0.75 * TS**2
    fine = np.linspace(0.0, TS[-1], 16001)
    way = R * (1.0 + 2.25 * fine) * np.exp(1j * R / TRACK * 0.75 * fine**2)
    middle = np.concatenate([[0.0], np.cumsum(_simpson(way, fine))])[:: 8000 // 8]
    centre = middle + AHEAD * np.exp(1j * turned[::2])
    np.testing.assert_allclose(run.q[::2, 0] + 1j * run.q[::2, 1], centre, rtol=0, atol=1e-9)
    wanted = torques((1.0 + 1.5 * TS, 1.0 + 3.0 * TS), (1.5, 3.0))
    for name, torque in zip("LR", wanted, strict=True):
        np.testing.assert_allclose(run[f"{name} torque"], torque, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["R power"], wanted[1] * (1.0 + 3.0 * TS), rtol=0, atol=1e-7)


def _simpson(values, ts):
    """Integrals over each two intervals."""
    return (ts[2] - ts[0]) / 6 * (values[:-2:2] + 4 * values[1::2] + values[2::2])


@pytest.mark.slow
def test_motors_of_wheels_on_one_straight_way_share_or_contradict_each_other():
    """A bicycle: any split of the torque is right, which the closure decides; and speeds that differ have no motion."""
    bodies = [rx.Body("frame", 5.0, 0.5), rx.Body("front", 1.0, 0.05), rx.Body("rear", 1.0, 0.05)]
    pins = [rx.Revolute(f"{k} hub", k, "frame", (0, 0), (x, 0)) for k, x in (("front", 0.5), ("rear", -0.5))]
    tyres = [rx.Wheel(f"{k} tyre", k, "ground", (0, 0), (0, -R), (0, 1), R) for k in ("front", "rear")]
    bicycle = rx.Mechanism(bodies, [*pins, *tyres], gravity=(0.0, -G))
    guess, ts = {"front.x": 0.5, "rear.x": -0.5}, np.linspace(0.0, 1.0, 5)
    law = rx.Polynomial([0.0, 0.0, -2.0])  # -4 rad/s^2
    both = dict.fromkeys(("front hub.angle", "rear hub.angle"), law)
    run = rx.drive(bicycle, both, ts, guess, closure=rx.LeastNorm({"front hub.angle": 1.0, "rear hub.angle": 3.0}))
    whole = -2 * 0.05 * 4.0 - 7.0 * R**2 * 4.0
    np.testing.assert_allclose(run["front hub.angle torque"], whole / 10, rtol=1e-5)
    np.testing.assert_allclose(run["rear hub.angle torque"], 0.9 * whole, rtol=1e-5)
    np.testing.assert_allclose(run.q[:, 0], R * 2.0 * ts**2, rtol=0, atol=1e-9)
    assert not np.any(run.determined)
    other = both | {"rear hub.angle": rx.Polynomial([0.0, 0.0, -2.1])}
    with pytest.raises(rx.NoSolutionError, match="prescribe speeds there that contradict each other"):
        rx.drive(bicycle, other, ts, guess)
    with pytest.raises(rx.RedundaxError, match="must leave no freedom"):
        rx.drive(bicycle, {"frame.phi": 0.0}, ts, guess)
    with pytest.raises(rx.RedundaxError, match=r"outside of `jit`"):
        jax.jit(lambda t: rx.assemble_along(bicycle, both, t, guess).q)(jnp.asarray(ts))


@pytest.mark.slow
def test_a_pinion_lifts_a_rack_off_its_foot_and_puts_it_down():
    """tau = J a + r (m (g + r a) - N), with the foot's load N, which is none while it is lifted."""
    radius, mass, inertia = 0.1, 10.0, 0.01
    places = {"A": -0.3, "B": 0.3}
    sleeves = [rx.Translational(n, "rack", "ground", (x, 0.0), (x, 0.0), (1.0, 0.0)) for n, x in places.items()]
    foot = rx.PinInSlot("foot", "rack", "ground", (0.1, -0.2), (0.0, -0.2), (0.0, 1.0), one_sided=True)
    hub = rx.Revolute("hub", "pinion", "ground", (0.0, 0.0), (0.5, 0.0))
    mesh = rx.Wheel("mesh", "pinion", "rack", (0.0, 0.0), (0.4, 0.0), (1.0, 0.0), radius, rows=("along",))
    bodies = [rx.Body("rack", mass, 0.3), rx.Body("pinion", 1.0, inertia)]
    machine = rx.Mechanism(bodies, [*sleeves, foot, hub, mesh], gravity=(0.0, -G))
    law, ts = rx.Cycloidal(-1.0, move=0.4, begin=0.1, dwell=0.2), np.linspace(0.0, 1.3, 27)
    run = rx.drive(machine, {"hub.angle": law}, ts, {"pinion.x": 0.5})
    lifted = -np.array([float(law(jnp.asarray(t))) for t in ts])
    np.testing.assert_allclose(run["rack.y"], radius * lifted, rtol=0, atol=1e-9)
    second = -jax.vmap(jax.grad(jax.grad(law)))(jnp.asarray(ts))
    loads = np.asarray(run["foot.perpendicular"])
    flies = lifted > 1e-6
    np.testing.assert_allclose(loads[flies], 0.0, atol=1e-9)
    assert np.all(loads[~flies] > 10.0) and np.sum(~flies) > 4
    torque = -(inertia * second + radius * (mass * (G + radius * second) - loads))
    np.testing.assert_allclose(run["hub.angle torque"], torque, rtol=0, atol=1e-9)
    with pytest.raises(rx.NoSolutionError, match=r"Contacts are reached at t = 0\.10.*: foot"):
        rx.drive(machine, {"hub.angle": rx.Cycloidal(1.0, move=0.4, begin=0.1)}, ts, {"pinion.x": 0.5})
