"""Cables and rods whose length follows a law are drives: a load that hangs on one weighs m (g + z'')."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

G = 9.81


def hoist(kind, law):
    if kind == "cable in the plane":
        guide = rx.Translational("guide", "load", "ground", (0.0, 0.0), (0.0, 0.0), normal=(1.0, 0.0))
        winch = rx.Cable("winch", "load", "ground", (0.0, 0.0), (0.0, 1.0), law)
        return rx.Mechanism([rx.Body("load", 2.0, 0.1)], [guide, winch], gravity=(0.0, -G)), {}
    load = rx.spatial.Body("load", 2.0, (0.1, 0.1, 0.1))
    guide = rx.spatial.Prismatic("guide", load, "ground", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    span = rx.spatial.Cable if kind == "cable in space" else rx.spatial.Distance
    winch = span("winch", load, "ground", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), law)
    return rx.Mechanism([load], [guide, winch], gravity=(0.0, 0.0, -G)), None


@pytest.mark.parametrize("kind", ["cable in the plane", "cable in space", "rod in space"])
def test_what_a_winch_gives(kind):
    """Its force is along its length, so that it is negative where it pulls; its row is the tension."""
    move, ts = rx.Cycloidal(-0.2, 1.0), np.linspace(0.0, 1.0, 6)
    mechanism, q = hoist(kind, lambda t: 1.0 + move(t))
    run = rx.drive(mechanism, {}, ts, q)
    tension = 2.0 * (G - jax.vmap(jax.grad(jax.grad(move)))(jnp.asarray(ts)))
    np.testing.assert_allclose(run["winch.distance"], tension, rtol=1e-10)
    np.testing.assert_allclose(run["winch force"], -tension, rtol=1e-10)
    assert float(run.energy["winch"]) == pytest.approx(2.0 * G * 0.2, rel=1e-2) and run.determined.all()
