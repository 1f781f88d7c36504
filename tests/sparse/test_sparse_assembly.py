"""Assembly of large mechanisms: as by dense matrices where both can, and of a thousand loops."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from tests.sparse.test_sparse import ladder


def planar():
    mechanism = rx.mechanisms.doubled_four_bar()
    return mechanism, mechanism.state(0.8, rate=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("case", [planar, lambda: ladder(2, twice=True)])
def test_assembly_is_that_of_dense_matrices(case):
    """With the one freedom given, of a joint, the state is one; the velocity follows its rate."""
    mechanism, state = case()
    angle = next(name for name in mechanism.names.joint_coordinates.labels if name.endswith(".angle"))
    numbers = jnp.asarray(np.random.default_rng(3).normal(size=(2, state.qd.size)))
    guess = mechanism.retract(state.q, 0.03 * numbers[0]), state.qd + 0.1 * numbers[1]
    given = {"positions": {angle: 0.75}, "rates": {angle: 2.0}}
    dense, sparse = (rx.assemble(each, *guess, **given) for each in (mechanism, mechanism.sparse()))
    np.testing.assert_allclose(sparse.q, dense.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(sparse.qd, dense.qd, rtol=0, atol=1e-12)
    free = rx.assemble(mechanism.sparse(), *guess)
    assert np.abs(mechanism.constraint(free.q, free.t)).max() < 1e-12
    assert np.abs(mechanism.jacobian(free.q, free.t) @ free.qd).max() < 1e-12


@pytest.mark.slow
def test_bodies_turn_by_more_than_half_a_turn():
    """From guesses on the other side, whose quaternions end with the opposite sign."""
    mechanism, state = ladder(1)
    random, sparse = np.random.default_rng(0), mechanism.sparse()
    far = 0
    for _ in range(40):
        guess = np.array(state.q)
        p = guess[9:].reshape(3, 4) + 0.8 * random.normal(size=(3, 4))
        guess[9:] = (p / np.linalg.norm(p, axis=1)[:, None]).ravel()
        found = rx.assemble(sparse, guess)
        assert np.abs(mechanism.constraint(found.q, found.t)).max() < 1e-12
        far += np.any(np.sum(guess[9:].reshape(3, 4) * np.asarray(found.q)[9:].reshape(3, 4), axis=1) < 0)
    assert far


@pytest.mark.slow
def test_values_that_constraints_determine_are_missed_and_named():
    """A driver leaves the rate of its rod no choice."""
    rod, pin = rx.Body("rod", 1.0, 0.1), rx.Revolute("O", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    driven = rx.Mechanism([rod], [pin, rx.AngleDriver("D", "rod", "ground", lambda t: 0.3 + 2.0 * t)]).sparse()
    guess = {"rod.x": 0.5, "rod.phi": 0.2}
    with pytest.raises(rx.NoSolutionError, match=r"rod\.phi as given cannot be met: .* by 1\. "):
        rx.assemble(driven, guess, rates={"rod.phi": 3.0})
    with pytest.warns(UserWarning, match=r"misses rod\.phi as given by 1e-07"):
        rx.assemble(driven, guess, rates={"rod.phi": 2.0 + 1e-7})
    np.testing.assert_allclose(rx.assemble(driven, guess, rates={"rod.phi": 2.0}).qd[2], 2.0, rtol=1e-14)


@pytest.mark.slow
def test_what_contradicts_is_named():
    mechanism, state = ladder(2)
    given = {"A0.angle": 0.7, "A1.angle": 0.8}
    told = r"misses \d+ rows, A[01]\.angle as given by 0\.05 the most|A0\.angle as given and A1\.angle as given"
    for what in ("positions", "rates"):
        with pytest.raises(rx.NoSolutionError, match=told):
            rx.assemble(mechanism.sparse(), state.q, **{what: given})
    state = rx.assemble(
        mechanism.sparse(), state.q, positions=dict.fromkeys(given, 0.7), rates=dict.fromkeys(given, 1.0)
    )
    assert np.isfinite(state.qd).all()


@pytest.mark.slow
@pytest.mark.parametrize("pin", ["D", "B2"])
def test_derivatives_by_a_point_are_those_of_dense_matrices(pin):
    """Also of one of two couplers' points, which no position can follow: by least squares."""
    mechanism, state = planar()
    member = mechanism.names.joints[0].index(pin)

    def assembled(x, each):
        moved = eqx.tree_at(lambda m: m.joints[0].element.point_j, each, replace_fn=lambda p: p.at[member, 0].add(x))
        found = rx.assemble(moved, state.q, state.qd, throw=False)
        return jnp.concatenate([found.q, found.qd])

    sparse = mechanism.sparse()
    dense, forward = (jax.jacfwd(assembled)(0.0, each) for each in (mechanism, sparse))
    assert np.abs(dense).max() > 0.1
    np.testing.assert_allclose(forward, dense, rtol=0, atol=1e-10)
    np.testing.assert_allclose(jax.jacrev(assembled)(0.0, sparse), forward, rtol=0, atol=1e-10)


@pytest.mark.slow
def test_a_thousand_loops_close_at_the_angle_given():
    mechanism = rx.mechanisms.n_four_bar(1000)
    assert mechanism.symbolic is not None
    truth = mechanism.state(0.85, rate=2.0)
    guess = mechanism.state(0.8).q + 0.01 * np.cos(np.arange(truth.q.size))
    found = rx.assemble(mechanism, guess, positions={"crank 1.phi": 0.85}, rates={"crank 1.phi": 2.0})
    np.testing.assert_allclose(found.q, truth.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.qd, truth.qd, rtol=0, atol=1e-11)
