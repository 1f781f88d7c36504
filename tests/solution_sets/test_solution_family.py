"""The solution family against 50 digits: what solutions there are for an amount of self-stress, and how many.

The truth are the solutions of (25) with lam = lam_MP + z s, as the paths of
`truth.friction` find them.
"""

import json
from functools import cache

import jax
import jax.numpy as jnp
import literal
import numpy as np
import pytest
import registry
from truth import exact, friction, scenes

import redundax as rx

STRESS = (1, 1, 1, 1, 1, 1, -1, -1, 0, 0, "4/5", "-4/5")
FOUR = 0.1445  # mu_rho with up to four solutions


def paper(mu_rho):
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return mechanism, mechanism.state(phi=np.pi / 4, rate=1.0)


@cache
def family(mu_rho, least, largest, samples=21) -> rx.types.SolutionFamily:
    return rx.solution_family(*paper(mu_rho), z=np.linspace(least, largest, samples))


@cache
def truth(mu_rho, z) -> list[exact.Solution]:
    """All solutions at the amplitude z, by the moment of the first joint."""
    with exact.exactly:
        misfit = tuple(exact.exact(str(z)) * entry for entry in exact.exact(STRESS))
    return friction.solutions(scenes.wojtyra2020(mu_rho=mu_rho), misfit=misfit)


def at(found, z) -> np.ndarray:
    """Values of the solutions at an amplitude, by the moment of the first joint."""
    here = np.flatnonzero((np.abs(found.z[:, 0] - z) < 1e-9) & ~found.fold)
    return found.values[here][np.argsort(found["tau A"][here])]


def agree(found, mu_rho, z):
    expected = [np.concatenate([exact.floats(part) for part in solution]) for solution in parts(mu_rho, z)]
    values = at(found, float(z))
    assert len(values) == len(expected) == found.count[np.abs(found.axes[0] - float(z)).argmin()]
    for value, true in zip(values, expected, strict=True):
        np.testing.assert_allclose(value, true, rtol=0, atol=1e-9 * np.abs(true).max())


def parts(mu_rho, z):
    return [(s.acceleration, s.multipliers, s.friction) for s in truth(mu_rho, z)]


@pytest.mark.parametrize("z", ["-400", "-80", "400"])
def test_one_solution_each_is_proved_where_friction_is_weak(z):
    found = family(0.02, -400.0, 400.0)
    assert found.proved and np.all(found.count == 1) and np.all(found.branch == 0)
    agree(found, "0.02", z)


@pytest.mark.parametrize("z", ["-36", "-28", "-4", "0", "4", "8", "32", "36"])
def test_every_solution_is_found_and_counted(z):
    found = family(FOUR, -40.0, 40.0)
    assert not found.proved and not found.lost
    agree(found, str(FOUR), z)


@pytest.mark.slow
def test_one_curve_goes_through_all_its_folds():
    """At mu_rho = 0.1445 the solutions are one closed curve with four folds, whatever the amplitudes looked at."""
    coarse, fine = family(FOUR, -40.0, 40.0), family(FOUR, -40.0, 40.0, 161)
    for found in (coarse, fine):
        assert set(found.branch) == {0}
        assert np.count_nonzero(found.fold) == 4
        # along the curve z goes on until it folds
        turns = np.flatnonzero(np.diff(np.sign(np.diff(found.z[:, 0]))) != 0) + 1
        assert set(turns) <= set(np.flatnonzero(found.fold))
    assert np.allclose(np.sort(coarse.z[coarse.fold, 0]), np.sort(fine.z[fine.fold, 0]), rtol=1e-10)


def test_folds_are_where_two_solutions_meet():
    found = family(FOUR, -40.0, 40.0)
    for fold in np.flatnonzero(found.fold):
        z = float(found.z[fold, 0])
        counts = [len(truth(str(FOUR), repr(z + step))) for step in (-1e-4, 1e-4)]
        assert abs(counts[1] - counts[0]) == 2


def dense(mu_rho, rho0, gain, sense) -> np.ndarray:
    """All friction with tau = -mu_rho |rho0 + K tau| sense that Newton's method in NumPy finds from 4000 starts."""
    random = np.random.default_rng(5)
    tau = random.normal(size=(4000, 4)) * 10 ** random.uniform(-2, 3, (4000, 1))
    for _ in range(60):
        rho = rho0 + np.einsum("icj,sj->sic", gain, tau)
        size = np.linalg.norm(rho, axis=2)
        slope = np.eye(4) + mu_rho * np.einsum("i,sic,icj->sij", sense, rho / size[:, :, None], gain)
        step = np.linalg.solve(slope, (tau + mu_rho * size * sense)[:, :, None])[:, :, 0]
        tau = tau - step
    tau = tau[np.abs(step).max(axis=1) <= 1e-10 * np.abs(tau).max(axis=1)]
    found = []
    while len(tau):
        found.append(tau[0])
        tau = tau[np.abs(tau - tau[0]).max(axis=1) > 1e-6 * np.abs(tau[0]).max()]
    return np.array(sorted(found, key=lambda tau: tau[0])).reshape(-1, 4)


@pytest.mark.parametrize("rate", [1, -1])
@pytest.mark.slow
def test_one_amplitude_is_searched_as_well_as_many(rate):
    """The family at one amplitude, `frictional_solutions` there, and a search of its own in NumPy."""
    counts = []
    for z in (0, 30):
        stress = tuple(z * entry for entry in exact.exact(STRESS))
        pins = registry.pins(scenes.wojtyra2020(rate=rate), stress)
        for mu_rho in (0.139, 0.141, 0.144, 0.1475, 0.15):
            mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
            state = mechanism.state(phi=np.pi / 4, rate=float(rate))
            truth = dense(mu_rho, *pins)
            family = rx.solution_family(mechanism, state, z=np.array([float(z)]))
            misfit = np.r_[np.zeros(12), exact.floats(stress)]
            listed = rx.frictional_solutions(mechanism, state, closure=rx.MinimumNorm(misfit))
            assert family.count[0] == len(listed) == len(truth)
            for found in (family.values[:, -4:], np.reshape([solution.friction for solution in listed], (-1, 4))):
                order = np.argsort(found[:, 0])
                np.testing.assert_allclose(found[order], truth, rtol=0, atol=1e-8 * np.abs(truth).max(initial=0.0))
            counts.append(len(truth))
    assert set(counts) == ({0, 1, 2, 4} if rate == 1 else {0, 1})


@pytest.mark.slow
def test_where_no_solution_exists_none_is_reported():
    assert truth("0.15", "0") == []
    found = rx.solution_family(*paper(0.15), z=np.array([-10.0, 0.0, 10.0]))
    assert not found.count.any() and found.values.shape == (0, 28)
    assert "found: 0 at 3 of 3" in str(found)


@pytest.mark.slow
def test_two_states_against_the_literal_iteration():
    """The carriage on two guides, k = 2, with translational friction."""
    mechanism = rx.mechanisms.carriage(offset=0.1, mu=0.05, guide_length=0.1)
    state = mechanism.state(0.0, rate=1.0)
    found = rx.solution_family(mechanism, state, z=(np.linspace(-20, 20, 5), np.linspace(-1, 1, 4)))
    assert found.count.shape == (5, 4) and np.all(found.count == 1)
    equations = literal.equations(mechanism, state, 2)
    h = np.concatenate([np.zeros((20, 3)), found.z @ found.stress], axis=1)
    step = jax.jit(jax.vmap(lambda x: equations.a_pinv @ equations.right_side(x)))
    end = jnp.zeros((20, 7))
    for _ in range(100):
        end = step(end) + h
    for k, x in enumerate(end):
        np.testing.assert_allclose(found.values[k, :7], x, rtol=0, atol=1e-9 * np.abs(x).max())


def test_about_a_closure():
    """z is added to the solution of the closure, with friction too, and `amplitude` finds it again."""
    system, state = paper(0.02)
    joints = rx.Compliance(np.linspace(1e-8, 5e-8, 12), misfit=np.linspace(-1e-6, 2e-6, 12))
    found = rx.solution_family(system, state, z=[-30.0, 0.0, 20.0], closure=joints)
    here = rx.solve(system, state, closure=joints)
    assert found.about == "the solution of Compliance"
    np.testing.assert_allclose(
        found.multipliers[1], here.multipliers, rtol=0, atol=1e-9 * np.abs(here.multipliers).max()
    )
    np.testing.assert_allclose(found.acceleration[1], here.acceleration, rtol=0, atol=1e-9 * 80)
    for z, values in zip(found.z, found.multipliers, strict=True):
        assert found.amplitude(values) == pytest.approx(z, abs=1e-9 * 30)


def test_assumed_preload():
    """Self-stress reaches the largest frictionless joint load, moments as forces at the length of the guide."""
    system = rx.mechanisms.carriage(offset=0.1, mu=0.05, guide_length=0.05)
    state = system.state(0.0, rate=1.0)
    smooth = rx.mechanisms.carriage(offset=0.1, guide_length=0.05)
    arms = np.where(system.rows.angular, 0.05, 1.0)
    load, states = np.asarray(rx.solve(smooth, state).multipliers) / arms, rx.analyze(system, state).self_stress / arms
    load -= np.linalg.lstsq(states.T, load)[0] @ states
    found = rx.solution_family(system, state, samples=9)
    assert f"{np.abs(load).max():.4g} N, where" in found.assumption
    for axis, stress in zip(found.axes, states, strict=True):
        assert axis[-1] * np.abs(stress).max() == pytest.approx(np.abs(load).max(), rel=1e-9)
        assert axis[0] == -axis[-1]


@pytest.mark.slow
def test_open_newton_ends_on_the_family_and_does_not_cover_it():
    """Newton (38) ends at solutions near the self-stress of x0: starts without any end in a corner of the family."""
    system, state = paper(0.02)
    found = family(0.02, -400.0, 400.0)
    x0 = 100 * np.random.default_rng(0).standard_normal((400, 24))
    x0[:, 12:] -= found.amplitude(x0[:, 12:]) * found.stress
    run = jax.jit(jax.vmap(lambda x0: rx.solve(system, state, closure=None, solver=rx.Newton(), x0=x0)))
    ends = run(jnp.asarray(x0))
    assert np.all(ends.result == rx.RESULTS.successful)
    z = found.amplitude(ends.multipliers)
    assert z.shape == (400, 1)
    here = rx.solution_family(system, state, z=np.sort(z[:, 0]))
    np.testing.assert_allclose(
        here.acceleration, np.asarray(ends.acceleration)[np.argsort(z[:, 0])], rtol=0, atol=1e-9 * 80
    )
    assert len(np.unique(z.round(6))) == 400  # no two starts end at the same solution
    assert np.abs(z).max() < 0.025 * 400  # and all end in a fortieth of the amplitudes
    assert np.ptp(ends.acceleration[:, 8]) < 0.02 * np.ptp(found["1.phi''"])


@pytest.mark.slow
def test_along_nothing():
    """Nothing redundant: the family is one point. A bead on a wire that pulls at it with 3 N rubs with mu = 0.1."""
    rubbing = rx.Friction(
        lambda q, t, p: q[1:],
        lambda loads, rate, sense, memory, state, p: -0.1 * jnp.abs(loads) * sense,
        [0],
        ["linear"],
    )
    pull = jnp.array([3.0, 5.0])
    system = rx.System(lambda q, t, p: q[:1], jnp.ones(2), lambda q, qd, t, p: pull, friction=rubbing)
    found = rx.solution_family(system, rx.State([0.0, 0.0], [0.0, 1.0]))
    assert found.along == () and found.count == 1
    np.testing.assert_allclose(found.values, [[0.0, 4.7, 3.0, -0.3]], atol=1e-12)
    assert str(found).startswith("No self-stress")


def test_data_text_and_picture(tmp_path):
    found = family(FOUR, -40.0, 40.0)
    data = json.loads(json.dumps(found.to_dict()))
    assert data["along"] == ["A.x"] and np.array(data["values"]).shape == found.values.shape
    text = str(found)
    assert "found: 0 at 5" in text and "1 connected piece" in text and "folds at" in text
    figure = rx.plot.family(found, outputs=["1.phi''", "tau A"])
    assert [axes.get_title() for axes in figure.axes] == ["1.phi''", "tau A", "number of solutions found"]
    assert [axes.get_ylabel() for axes in figure.axes] == ["rad/s²", "N m", ""]
    figure.savefig(tmp_path / "family.png")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"along": "K.angle"}, "`along` must hold"),
        ({"z": (np.array([0.0, 1.0]), np.array([0.0, 1.0]))}, "`z`"),
        ({"z": np.array([1.0, 0.0])}, "increasing"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(options, words):
    with pytest.raises(rx.RedundaxError, match=words):
        rx.solution_family(*paper(0.02), **options)


def test_at_rest_there_is_no_family():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    with pytest.raises(rx.NoSolutionError, match=r"at rest.*A, B, C, D"):
        rx.solution_family(mechanism, mechanism.state(phi=0.8))


def test_senses_by_name_go_to_the_search_for_solutions():
    """Of joints at rest: the solution that is found has full friction against each sense, as that of `solve`."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    rest, senses = mechanism.state(phi=0.8, rate=0.0), {"A": 1.0, "B": -1.0, "C": 1.0, "D": -1.0}
    (found,) = rx.frictional_solutions(mechanism, rest, sense=senses)
    np.testing.assert_array_equal(np.sign(found.friction), [-sense for sense in senses.values()])
    loads = found.multipliers[: 2 * len(senses)].reshape(-1, 2)
    np.testing.assert_allclose(np.abs(found.friction), 0.02 * np.linalg.norm(loads, axis=1), rtol=1e-9)
    np.testing.assert_allclose(found.friction, rx.solve(mechanism, rest, sense=senses).friction, rtol=1e-9)
