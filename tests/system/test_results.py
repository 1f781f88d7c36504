"""Failures are values: each cause has its result, no number comes with it, and neighbours live on."""

import dataclasses
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registry

import redundax as rx

R = rx.RESULTS
BUILD = rx.mechanisms.wojtyra2020


def paper(mu_rho=None, rate=1.0, **parameters):
    mechanism = BUILD(mu_rho=mu_rho, **parameters)
    return mechanism, mechanism.state(phi=jnp.pi / 4, rate=rate)


def moved(pair, q=0.0, qd=0.0):
    system, state = pair
    pattern = np.linspace(-1, 1, state.q.size) ** 2
    return system, rx.State(state.q + q * pattern, state.qd + qd * pattern, state.t)


def of(case):
    return case.system, case.state


def driven_twice():
    """The slider-crank with a second driver of another acceleration, equal in angle and speed."""
    mechanism = registry.MECHANISMS["slider_crank"]()
    driver = mechanism.drivers[0]
    with registry.exact.exactly:
        t, more = mechanism.t, registry.exact.exact(2)
        other = dataclasses.replace(
            driver,
            name="M2",
            acceleration=driver.acceleration + more,
            speed=driver.speed - more * t,
            start=driver.start + more * t**2 / 2,
        )
    return registry.build(dataclasses.replace(mechanism, drivers=(driver, other)))


def nearly_doubled():
    """Two rows that differ by about the rounding of the rank decision."""
    system = rx.System(lambda q, t, p: jnp.stack([q[0] - q[1], q[0] - q[1] * (1 + p)]), jnp.ones(2), None, 1e-14)
    return system, rx.State([0.0, 0.0], [0.0, 0.0])


def held_mass():
    """A singular mass matrix v v^T and the constraint v^T q = 0: two motions have no mass."""
    v = np.array([1.0, 1 / 3, 0.7])
    system = rx.System(lambda q, t, p: (p @ q)[None], np.outer(v, v), lambda q, qd, t, p: p, v)
    return system, rx.State(np.zeros(3), np.zeros(3))


DEAR = ("rate", "too few sweeps", "too few open steps", "mass", "state", "x0", "mu_rho and fixed point")


def some_are_slow(names):
    """Those in `DEAR` compile a program that no other test shares."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in DEAR else name for name in names]


FAILURES = {
    "state off the manifold": (R.violated_constraints, lambda: moved(paper(), q=0.05), {}),
    "velocity off the manifold": (R.inadmissible_velocity, lambda: moved(paper(), qd=0.1), {}),
    "flat parallelogram, no branch": (
        R.inadmissible_velocity, lambda: registry.four_bar(0.0, (1.0, 2.0)), {}),
    "contradictory drivers": (
        R.inconsistent_constraints, lambda: of(registry.contradictory()), {}),
    "crank driven twice": (R.inconsistent_constraints, driven_twice, {}),
    "nearly dependent rows": (R.ambiguous_rank, nearly_doubled, {}),
    "massless coordinate": (
        R.indeterminate_acceleration, lambda: of(registry.massless(free=True)), {}),
    "mass in what the constraints hold alone": (
        R.indeterminate_acceleration, held_mass, {}),
    "massless mechanism": (R.indeterminate_acceleration, lambda: paper(mass=0.0), {}),
    "massless mechanism with friction": (
        R.indeterminate_acceleration, lambda: paper(mu_rho=0.02, mass=0.0), {}),
    "closure without compliance": (
        R.indeterminate_closure, lambda: paper(0.02), {"closure": rx.Compliance(np.zeros(12))}),
    "closure that knows unique rows alone": (
        R.indeterminate_closure, lambda: paper(0.02),
        {"closure": rx.Compliance(np.eye(12)[8] + np.eye(12)[9])}),
    "joints at rest": (R.friction_at_rest, lambda: paper(0.02, rate=0.0), {}),
    "sense of one joint unknown": (
        R.friction_at_rest, lambda: paper(0.02, rate=0.0), {"sense": np.array([1.0, 0.0, 1.0, 1.0])}),
    "friction that does not contract": (
        R.no_contraction, lambda: paper(0.2), {"solver": rx.FixedPoint()}),
    "friction that diverges": (R.diverged, lambda: paper(1e8), {"solver": rx.FixedPoint()}),
    "too few sweeps": (
        R.max_steps_reached, lambda: paper(0.02), {"solver": rx.FixedPoint(max_steps=1)}),
    "too few steps": (R.max_steps_reached, lambda: paper(0.02), {"solver": rx.Newton(max_steps=1)}),
    "too few open steps": (
        R.max_steps_reached, lambda: paper(0.02),
        {"solver": rx.Newton(max_steps=1), "closure": None, "x0": 1.0}),
}  # fmt: skip
every_failure = pytest.mark.parametrize("cause", some_are_slow(FAILURES))


@every_failure
def test_cause_has_its_result(cause):
    result, pair, options = FAILURES[cause]
    system, state = pair()
    solution = registry.solve(system, state, **options, throw=False)
    assert solution.result == result, f"{rx.RESULTS[solution.result]!r}"
    for part in (solution.acceleration, solution.multipliers, solution.friction):
        assert np.all(np.isnan(part))
    assert np.all(np.isfinite(solution.stats.spectrum.singular_values))


@every_failure
def test_cause_is_raised_unless_asked_not_to(cause):
    result, pair, options = FAILURES[cause]
    with pytest.raises(rx.NoSolutionError) as raised:
        registry.solve(*pair(), **options)
    assert rx.RESULTS[result] in str(raised.value)


@pytest.mark.parametrize("rates", [(1.0, 1.0), (1.0, -3.0), (-2.0, 6.0), (0.0, 0.0)])
def test_a_flat_parallelogram_is_singular_on_all_its_branches(rates):
    """At rest nothing decides between them."""
    solution = registry.solve(*registry.four_bar(0.0, rates), throw=False)
    assert solution.stats.singular_position
    assert solution.result == (R.successful if any(rates) else R.singular_position)
    assert (solution.stats.rank, solution.stats.freedom) == (7, 2)


def test_drivers_that_agree_are_consistent():
    mechanism = registry.MECHANISMS["slider_crank"]()
    twin = dataclasses.replace(mechanism.drivers[0], name="M2")
    doubled = dataclasses.replace(mechanism, drivers=(*mechanism.drivers, twin))
    once, twice = registry.solve(*registry.build(mechanism)), registry.solve(*registry.build(doubled))
    assert np.allclose(twice.acceleration, once.acceleration, rtol=0, atol=1e-13)
    assert np.allclose(twice.multipliers[-2:], once.multipliers[-1] / 2, rtol=1e-12)


@pytest.mark.parametrize("place", ["q", "qd", "gravity", "h", "mu_rho"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_no_success(place, bad):
    mechanism, state = paper(mu_rho=0.02)
    options = {}
    if place == "q":
        state = rx.State(state.q.at[0].set(bad), state.qd)
    elif place == "qd":
        state = rx.State(state.q, state.qd.at[8].set(bad))
    elif place == "h":
        options = {"h": bad}
    else:
        mechanism = BUILD(**{"mu_rho": 0.02, place: bad})
    smooth = BUILD(gravity=-mechanism.gravity[1])
    for system in (mechanism,) if place == "mu_rho" else (mechanism, smooth):
        solution = registry.solve(system, state, **options, throw=False)
        assert solution.result != R.successful
        assert np.all(np.isnan(solution.acceleration)) and np.all(np.isnan(solution.multipliers))


def test_a_mechanism_at_rest_is_sent_to_the_call_that_answers_it():
    mechanism, state = paper(0.02, rate=0.0)
    with pytest.raises(rx.NoSolutionError, match=r"Ask `rx\.band`.*`rx\.sticking`.*At rest: A, B, C, D"):
        registry.solve(mechanism, state)


def test_what_is_not_finite_is_not_called_at_rest():
    solution = registry.solve(*paper(mu_rho=np.nan), throw=False)
    assert solution.result != R.friction_at_rest


# In a batch ---------------------------------------------------------------------------------


def whole(solution):
    return jnp.concatenate([solution.acceleration, solution.multipliers, solution.friction])


BATCHES = {
    "rate": (lambda x: (*paper(0.02, rate=x), {}), [1.0, 2.0, -1.0, 0.5, 1.5], 0.0),
    "mu_rho and fixed point": (
        lambda x: (*paper(x), {"solver": rx.FixedPoint()}), [0.02, 0.01, 0.03, 0.015, 0.005], 0.3),
    "mass": (lambda x: (*paper(0.02, mass=x), {}), [1.0, 2.0, 3.0, 0.5, 1.5], 0.0),
    "x0": (
        lambda x: (*paper(0.02), {"closure": None, "x0": x}), [1.0, 2.0, 50.0, 100.0, 7.0], np.nan),
    "state": (lambda x: (*moved(paper(0.02), q=x), {}), [0.0, 1e-9, 2e-9, 3e-9, 4e-9], 0.1),
}  # fmt: skip


@pytest.mark.parametrize("name", some_are_slow(BATCHES))
def test_one_bad_sample_leaves_its_neighbours_as_they_are(name):
    """Bit by bit."""
    make, good, bad = BATCHES[name]

    @jax.jit
    @jax.vmap
    def sweep(x):
        system, state, options = make(x)
        solution = registry.solve(system, state, **options)
        return whole(solution), solution.result == R.successful, solution.stats.steps

    values, fine, steps = sweep(jnp.asarray(good))
    assert np.all(fine) and np.all(np.isfinite(values))
    spoiled, still_fine, steps_there = sweep(jnp.asarray(good).at[2].set(bad))
    others = np.array([0, 1, 3, 4])
    assert not still_fine[2] and np.all(np.isnan(spoiled[2]))
    assert np.all(still_fine[others])
    assert np.array_equal(spoiled[others], values[others])
    assert np.array_equal(steps_there[others], steps[others])


def test_transformed_code_does_not_raise_unless_asked_to():
    """That it does not, batches below with one bad sample show."""
    pin = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0), pin_radius=0.01, friction=rx.Coulomb(0.1))
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -10.0))
    state = rx.State(jnp.array([0.5, 0.0, 0.0]), jnp.zeros(3))
    with pytest.raises(Exception, match="at rest"):
        jax.block_until_ready(jax.jit(lambda s: registry.solve(mechanism, s, throw=True).acceleration)(state))


# Arguments that do not fit ------------------------------------------------------------------


def mechanism_of(bodies=("a", "b"), **joint):
    fields = {"i": "a", "j": "b", "point_i": (0.0, 0.0), "point_j": (0.0, 0.0), **joint}
    return rx.Mechanism([rx.Body(name, 1.0, 1.0) for name in bodies], [rx.Revolute("J", **fields)])


@pytest.mark.parametrize(("bodies", "joint"), [
    (("a", "a"), {}), ((), {}), (("a", rx.GROUND), {}), (("a", "b"), {"j": "c"}),
    (("a", "b"), {"j": "a"}),
])  # fmt: skip
def test_mechanisms_that_make_no_sense_are_refused(bodies, joint):
    with pytest.raises(rx.RedundaxError, match=r"Argument `(bodies|joints)`"):
        mechanism_of(bodies, **joint)


@pytest.mark.parametrize("options", [
    {"x0": np.zeros(12), "closure": None}, {"sense": np.ones(3)}, {"x0": np.zeros((1, 24))},
])  # fmt: skip
def test_options_that_do_not_fit_are_refused(options):
    with pytest.raises(rx.RedundaxError, match=r"Argument `(x0|sense)` must"):
        registry.solve(*paper(0.02), **options)


def test_a_state_of_another_mechanism_is_refused():
    mechanism, state = paper()
    with pytest.raises(rx.RedundaxError, match=r"Argument `state` must"):
        registry.solve(mechanism, rx.State(state.q[:9], state.qd[:9]))


@pytest.mark.parametrize("function", [rx.solve, rx.analyze, lambda system, state: rx.assemble(system, state.q)])
def test_positions_of_another_mechanism_are_refused(function):
    mechanism, state = paper()
    for q, shape in ((state.q[:9], r"\(9,\)"), (jnp.stack([state.q] * 2), r"\(2, 12\)")):
        with pytest.raises(rx.RedundaxError, match=rf"Argument `q` must have shape \(12,\).* but has {shape}"):
            function(mechanism, rx.State(q, state.qd))


@pytest.mark.skipif(os.environ.get("REDUNDAX_CHECKS") == "on", reason="types of calls are refused before")
@pytest.mark.parametrize(
    ("call", "argument", "kind"),
    [
        (lambda *given: rx.solve(*given, closure=rx.MinimumNorm), "closure", "MinimumNorm"),
        (lambda *given: rx.solve(*given, solver=rx.Newton), "solver", "Newton"),
        (lambda *given: rx.analyze(*given, closure=rx.MinimumNorm), "closure", "MinimumNorm"),
        (lambda *given: rx.simulate(*given, 1.0, stabilisation=rx.Projection), "stabilisation", "Projection"),
        (lambda *given: rx.band(*given, None, rx.PreloadBox), "bounds", "PreloadBox"),
    ],
)
def test_a_class_in_place_of_an_object_is_refused(call, argument, kind):
    with pytest.raises(rx.RedundaxError, match=rf"^Argument `{argument}` must be an object.* Write `{kind}\("):
        call(*paper())


def test_what_is_printed():
    """A uniform rod of 1 m that falls from the horizontal turns with 3 g / 2."""
    pin = rx.Revolute("A", "rod", "ground", point_i=(-0.5, 0.0), point_j=(0.0, 0.0))
    pendulum = rx.Mechanism([rx.Body("rod", 1.0, 1 / 12)], [pin], gravity=(0.0, -10.0))
    assert repr(pendulum) == "Mechanism with 3 coordinates, 2 rows, bodies rod"
    state = rx.State([0.5, 0.0, 0.0], [0.0, 0.0, 0.0])
    lines = [line.split() for line in str(registry.solve(pendulum, state)).splitlines()]
    assert lines == [
        ["Solution:", "successful"],
        ["redundancy", "0,", "freedom", "1,", "steps", "of", "friction", "0"],
        ["position", "velocity", "acceleration", "multiplier"],
        ["rod.x", "0.5", "0", "0", "A.x", "0"],
        ["rod.y", "0", "0", "-7.5", "A.y", "-2.5"],
        ["rod.phi", "0", "0", "-15"],
        ["Joints", "by", "name:", '["A', "force", "x", "on", 'rod"],', '["A.angle"],', "..."],
    ]
    off = registry.solve(pendulum, rx.State(state.q + 0.1, state.qd), throw=False)
    assert rx.RESULTS[off.result] in " ".join(str(off).split())
    shapes = jax.tree.map(jnp.shape, (off, pendulum))
    assert (
        "float" not in "".join(map(str, shapes)) and str(pendulum.anonymous) == "Mechanism with 3 coordinates, 2 rows"
    )


def test_a_guide_that_rubs_needs_a_length():
    with pytest.raises(rx.RedundaxError, match=r"Argument `guide_length`"):
        rx.Translational("K", "a", rx.GROUND, (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), friction=rx.Coulomb(0.1))


def test_a_print_shows_figures_and_words():
    """Of one and of many, and inside of other prints."""
    factor = rx.factorize(*paper())
    decision = factor.spectrum.decision
    assert repr(decision) == f"Decision(margin={decision.margin:.6g})" and "[]" not in str(factor.spectrum)
    assert str(factor.violation).splitlines()[0].split() == ["position", f"{factor.violation.position:.6g}"]
    assert "margin=" in f"{[factor.spectrum]}"
    many = jax.tree.map(lambda x: jnp.stack([x, 2 * x]), decision)
    assert str(many).split() == ["margin", f"{decision.margin:.6g}", "to", f"{2 * decision.margin:.6g}"]
    assert f"{R.successful} {[R.stuck]}".startswith("redundax.RESULTS<successful> [redundax.RESULTS<The mechanism came")
    results = jax.tree.map(lambda *x: jnp.stack(x), R.successful, R.stuck, R.successful)
    assert str(results) == "redundax.RESULTS<2 successful, 1 stuck>"


def test_one_result_of_many_has_its_message():
    """Where a batch is known, an entry of it is a number of NumPy."""
    of_all = jax.tree.map(lambda code: np.stack([code, code]), R.not_finite)
    assert rx.RESULTS[jax.tree.map(lambda codes: codes[0], of_all)] == rx.RESULTS[R.not_finite]
