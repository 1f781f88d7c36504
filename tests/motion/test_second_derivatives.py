"""Second derivatives of motions, past instants at which joints stop, stick and are let go, against closed forms.

Those of events with several slips in a joint, and of contacts that open or close, are not known: NaN.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_simulate import richardson
from test_stick_slip import crank

import redundax as rx
import redundax.spatial as rs

GRAVITY, BLOCK = 9.81, 2.0
slow = pytest.mark.slow
OPTIONS = {"adjoint": diffrax.ForwardMode(), "throw": False}


def hessian(function):
    return jax.jacfwd(jax.jacfwd(function))


def sliding(p):
    """Where a block of rate p[1] on a guide of friction p[0] is, before its stop and after it."""
    ahead = {"point_i": (0.0, 0.0), "point_j": (0.0, 0.0), "normal": (0.0, 1.0), "guide_length": 0.5}
    guide = rx.Translational("guide", "block", "ground", **ahead, friction=rx.Coulomb(p[0]))
    block = rx.Mechanism([rx.Body("block", BLOCK, 1.0)], [guide], gravity=(0.0, -GRAVITY))
    start = rx.State(jnp.zeros(3), jnp.stack([p[1], 0.0 * p[1], 0.0 * p[1]]))
    return rx.simulate(block, start, 2.0, ts=[0.1, 2.0], **OPTIONS).q[:, 0]


@slow
def test_a_block_slides_to_its_stop():
    def truth(p):
        mu, rate = p
        return jnp.stack([0.1 * rate - mu * GRAVITY * 0.1**2 / 2, rate**2 / (2 * mu * GRAVITY)])

    at = jnp.array([0.2, 1.0])
    np.testing.assert_allclose(hessian(sliding)(at), hessian(truth)(at), rtol=1e-6, atol=1e-8)


def carried(p):
    """Where a cart of mass p[0] is at 2 s that a force p[1] t pulls, and a block that friction carries."""
    cart, block = rx.Body("cart", p[0], 1.0), rx.Body("block", BLOCK, 1.0)
    middles = (0.0, 0.0), (0.0, 0.0), (0.0, 1.0)
    rail = rx.Translational("rail", "cart", "ground", *middles)
    top = rx.Translational("top", "block", "cart", *middles, guide_length=0.5, friction=rx.Coulomb(0.2))

    def pulled(i, j, t, growth):
        none = jnp.zeros(2)
        return i.wrench(jnp.stack([growth * t, 0.0 * t]), none), j.wrench(none, none)

    pull = rx.LoadFunction("cart", pulled, parameters=p[1])
    mechanism = rx.Mechanism([cart, block], [rail, top], gravity=(0.0, -GRAVITY), loads=[pull])
    run = rx.simulate(mechanism, rx.State(jnp.zeros(6), jnp.zeros(6)), 2.0, ts=[2.0], **OPTIONS)
    return jnp.stack([run["cart.x"][0], run["block.x"][0]])


@slow
def test_a_block_is_left_behind_by_the_cart_that_carries_it():
    """Accelerations do not jump there, so that only second derivatives see how that instant moves."""

    def truth(p):
        (mass, growth), hold = p, 0.2 * GRAVITY
        t = hold * (mass + BLOCK) / growth
        left, rate, way = 2.0 - t, growth * t**2 / 2 / (mass + BLOCK), growth * t**3 / 6 / (mass + BLOCK)
        pull = (growth * t - BLOCK * hold) / mass
        cart = way + rate * left + pull * left**2 / 2 + growth * left**3 / 6 / mass
        return jnp.stack([cart, way + rate * left + hold * left**2 / 2])

    at = jnp.array([3.0, 10.0])
    np.testing.assert_allclose(hessian(carried)(at), hessian(truth)(at), rtol=1e-6, atol=1e-8)


@slow
def test_the_papers_crank_turns_round():
    """By friction, across the reversal of the crank; the truth is that of the scalar equation."""

    def angle(mu_rho):
        mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
        return rx.simulate(mechanism, mechanism.state(jnp.pi / 4, rate=1.0), 0.3, ts=[0.3], **OPTIONS).q[0, 8]

    def slope(mu_rho):
        return richardson(lambda mu_rho: crank(mu_rho, 0.3)[0], mu_rho, 2e-3)

    np.testing.assert_allclose(hessian(angle)(0.02), richardson(slope, 0.02, 4e-3), rtol=1e-4)


@slow
def test_a_plate_that_slides_on_a_table_has_none_past_its_stop():
    def truth(mu):
        return jnp.stack([0.1 - mu * GRAVITY * 0.1**2 / 2, 1 / (2 * mu * GRAVITY)])

    def slid(mu):
        plate = rs.Body("plate", BLOCK, (1.0, 1.0, 1.0))
        sizes = {"plate_length": 0.3, "spin_radius": 0.1, "friction": rx.Coulomb(mu)}
        table = rs.Planar("table", plate, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), **sizes)
        mechanism = rx.Mechanism([plate], [table], gravity=(0, 0, -GRAVITY))
        rates = jnp.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        return rx.simulate(mechanism, rx.State(mechanism.reference, rates), 2.0, ts=[0.1, 2.0], **OPTIONS)["plate.x"]

    np.testing.assert_allclose(slid(0.2), truth(0.2), rtol=1e-8)
    np.testing.assert_allclose(jax.jacfwd(slid)(0.2), jax.jacfwd(truth)(0.2), rtol=1e-6)
    second = hessian(slid)(0.2)
    np.testing.assert_allclose(second[0], 0.0, atol=1e-8)
    assert jnp.isnan(second[1])


@slow
def test_a_ball_that_bounces_has_none_past_its_impact():
    def height(h):
        ball = rx.System(
            lambda q, t, p: -q,
            mass=jnp.array([3.0]),
            load=lambda q, qd, t, p: jnp.array([-3 * GRAVITY]),
            coordinates=["linear"],
            rows="force",
            m=1,
            length=1.0,
            one_sided=[0],
        )
        start = rx.State(h[None], jnp.zeros(1))
        return rx.simulate(ball, start, 1.0, ts=[0.1, 1.0], restitution=0.5, **OPTIONS).q[:, 0]

    def truth(h):
        at = jnp.sqrt(2 * h / GRAVITY)
        return 0.5 * GRAVITY * at * (1 - at) - GRAVITY / 2 * (1 - at) ** 2

    np.testing.assert_allclose(jax.jacfwd(height)(2.0)[1], jax.grad(truth)(2.0), rtol=1e-8)
    second = hessian(height)(2.0)
    np.testing.assert_allclose(second[0], 0.0, atol=1e-8)
    assert jnp.isnan(second[1])


@pytest.mark.parametrize("transformation", [jax.jacfwd, pytest.param(jax.hessian, marks=slow)])
def test_modes_that_do_not_fit_the_adjoint_are_refused_by_name(transformation):
    def angle(rate):
        pin = rx.Revolute("A", "rod", "ground", (0.0, 0.5), (0.0, 0.0))
        pendulum = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [pin], gravity=(0.0, -GRAVITY))
        start = rx.State(jnp.array([0.0, -0.5, 0.0]), jnp.stack([0.5 * rate, 0.0 * rate, rate]))
        return rx.simulate(pendulum, start, 0.1, ts=[0.1])["rod.phi"][0]

    with pytest.raises(rx.RedundaxError, match="Argument `adjoint` must fit"):
        transformation(angle)(1.0)


@slow
def test_a_hessian_in_forward_mode_is_refused_by_name():
    with pytest.raises(rx.RedundaxError, match=r"Argument `adjoint` must fit .* is ForwardMode"):
        jax.hessian(sliding)(jnp.array([0.2, 1.0]))
