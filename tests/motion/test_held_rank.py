"""The equations with the rank held, against NumPy: on the manifold and off it, by a basis and by a projector."""

import jax.numpy as jnp
import numpy as np
import pytest
import spaces

import redundax as rx
from redundax._equations._factorisation import factorised
from redundax._motion._held_rank import factorize_held, held_by


@pytest.fixture(scope="module")
def four_bar():
    """A planar four-bar of four spatial hinges, m = 20 of rank 17, where its rank is found."""
    mechanism = spaces.four_bar()
    state = rx.assemble(mechanism, rates={"A.angle": 1.0})
    return mechanism, state, factorised(mechanism, state, None)


@pytest.mark.parametrize("redundancy", [3, None], ids=["basis", "projector"])
def test_held_equations_are_those_of_the_combinations_of_rows_held(four_bar, redundancy):
    mechanism, state, found = four_bar
    assert int(found.spectrum.rank) == 17
    held = held_by(mechanism, state, found.scaling, found.split.stress, redundancy, singular=False)
    assert held.basis.shape == (20, redundancy or 20)
    scale = np.asarray(held.row_scale)
    kept = np.linalg.svd(np.asarray(mechanism.jacobian(state.q, state.t)) / scale[:, None])[0][:, :17]
    rng = np.random.default_rng(0)
    forces, gamma = rng.normal(size=(18, 2)), rng.normal(size=(20, 2))
    for off in (0.0, 1e-3, 1e-2):  # from where the rank is held
        there = rx.State(mechanism.retract(state.q, jnp.asarray(off * rng.normal(size=18))), state.qd)
        rows = np.asarray(mechanism.jacobian(there.q, there.t)) / scale[:, None]
        mass, some = np.asarray(mechanism.mass(there.q, there.t)), kept.T @ rows
        kkt = np.block([[mass, some.T], [some, np.zeros((17, 17))]])
        truth = np.linalg.solve(kkt, np.concatenate([forces, kept.T @ (gamma / scale[:, None])]))
        got = factorize_held(mechanism, there, held).respond(jnp.asarray(forces), jnp.asarray(gamma))
        np.testing.assert_allclose(got.acceleration, truth[:18], rtol=0, atol=1e-11 * np.abs(truth).max())
        pulled = mass @ got.acceleration + rows.T @ (scale[:, None] * got.multipliers)
        np.testing.assert_allclose(pulled, forces, rtol=0, atol=1e-11 * np.abs(forces).max())


@pytest.mark.parametrize("redundancy", [3, None], ids=["basis", "projector"])
def test_the_pick_is_that_of_the_null_space(four_bar, redundancy):
    """Where the mechanism is, by a rank that is held elsewhere; and by what is held from there on."""
    mechanism, state, found = four_bar
    held = held_by(mechanism, state, found.scaling, found.split.stress, redundancy, singular=False)
    there = rx.assemble(mechanism, positions={"A.angle": 0.2})
    assert np.abs(there.q - state.q).max() > 0.05
    rng = np.random.default_rng(1)
    multipliers, misfit, half = rng.normal(size=(20, 2)), rng.normal(size=20), rng.normal(size=(20, 20))
    compliance = half @ half.T
    null = np.linalg.svd(np.asarray(mechanism.jacobian(there.q, there.t)))[0][:, 17:]
    stress = null @ np.linalg.solve(null.T @ compliance @ null, null.T)
    truth = multipliers - stress @ (compliance @ multipliers)
    truth[:, 0] += stress @ misfit
    for _ in range(2):
        factor = factorize_held(mechanism, there, held)
        pick, excess = factor.close(jnp.asarray(compliance))
        assert excess < 1e-12
        got = pick.columns(jnp.asarray(multipliers), jnp.asarray(misfit))
        np.testing.assert_allclose(got, truth, rtol=0, atol=1e-10 * np.abs(truth).max())
        held, _ = factor.renewed()


@pytest.mark.parametrize("heavy", [1e-15, 1e15])
def test_what_rows_left_out_contribute_has_no_unit(four_bar, heavy):
    """The same for all masses, of rows that contradict each other by as much; it grew as their root."""
    mechanism, state, found = four_bar
    off = rx.State(mechanism.retract(state.q, 1e-3 * jnp.sin(jnp.arange(18.0))), state.qd)

    def contributed(mechanism, at):
        held = held_by(mechanism, state, found.scaling, found.split.stress, 3, singular=False)
        return factorize_held(mechanism, at, held).renewed()[1]

    scaled = rx.units.in_units(mechanism, rx.units.Units(mass=heavy))
    assert contributed(scaled, state) < 1e-12
    np.testing.assert_allclose(contributed(scaled, off), contributed(mechanism, off), rtol=1e-6)
