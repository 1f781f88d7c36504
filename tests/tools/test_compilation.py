"""Programs outside transformations: compiled in little time, run at once, with the numbers of optimised ones."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._bodies._space._rotation import rotation, times
from redundax._tools import _compilation, _numbers
from redundax._tools._compilation import compiled, quick_options
from redundax._tools._derivatives import once, once_in_reverse

MECHANISMS = {
    "wojtyra2020": lambda: rx.mechanisms.wojtyra2020(mu_rho=0.02),
    "slider_crank": lambda: rx.mechanisms.slider_crank(),
}


@compiled
def square(x, scale=1.0):
    return scale * x**2


@compiled
def applied(function, x):
    return function(x)


@pytest.mark.parametrize("name", ["wojtyra2020", "slider_crank"])
@pytest.mark.slow
def test_a_call_by_itself_agrees_with_an_optimised_program(name):
    mechanism = MECHANISMS[name]()
    state = mechanism.state(phi=0.7, rate=1.3)
    optimised = {"xla_backend_optimization_level": 3, "xla_cpu_use_fusion_emitters": True}
    options = {option: value for option, value in optimised.items() if option in quick_options()}
    inside = jax.jit(lambda *given: _figures(rx.solve(*given)), compiler_options=options)(mechanism, state)
    for own, other in zip(_figures(rx.solve(mechanism, state)), inside, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-12 * np.max(np.abs(other), initial=0.0))


def _figures(solution):
    return solution.acceleration, solution.multipliers, solution.friction


def frictional(mu_rho):
    """The paper's mechanism: Newton's end contracts at 0.02 m, not at 0.144 m; the branch folds before 0.4 m."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    return mechanism, mechanism.state(phi=0.47, rate=1.0)


@pytest.mark.slow
def test_a_call_by_itself_ends_on_the_branch_of_an_optimised_program():
    """Whether Newton's method alone settles it or the branch is followed, from any start; the fold too."""
    closure, found = rx.MinimumNorm(-17.0), []
    inside = jax.jit(lambda x0, *given: rx.solve(*given, closure=closure, x0=x0))
    for mu_rho in (0.02, 0.13, 0.144, 0.15, 0.4):
        given = frictional(mu_rho)
        for x0 in (0.0, 1e4, -1e4):
            own, other = rx.solve(*given, closure=closure, x0=x0, throw=False), inside(x0, *given)
            assert own.result == other.result
            np.testing.assert_allclose(own.stats.fold, other.stats.fold, rtol=1e-12)
            for a, b in zip(_figures(own), _figures(other), strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * np.nanmax(np.abs(b), initial=0.0))
            found.append((bool(own.stats.contraction < 1), bool(own.result == rx.RESULTS.successful)))
    assert set(found) >= {(True, True), (False, True)}
    assert {successful for _, successful in found} == {True, False}


def test_no_solver_of_friction_is_compiled_for_known_numbers(programs):
    mechanism, state = frictional(0.144)  # where the branch from zero friction is followed
    rx.solve(mechanism, state, closure=rx.MinimumNorm(-17.0), throw=False)
    assert not [name for name in programs if "solve" in name or "while" in name]


def test_frictions_share_a_factorisation_with_none(programs):
    for mechanism in (rx.mechanisms.wojtyra2020(), rx.mechanisms.wojtyra2020(mu_rho=0.1)):
        rx.factorize(mechanism, mechanism.state(phi=0.7, rate=1.3))
    assert programs.count("jit(model_at)") == 1


@pytest.mark.slow
def test_a_motion_shares_the_factorisation_of_a_solve(programs):
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.7, rate=1.3)
    rx.solve(mechanism, state)
    rx.simulate(mechanism, state, 0.01)
    assert programs.count("jit(model_at)") == 1


@pytest.mark.slow
def test_a_motion_is_compiled_once_for_closures_that_do_not_depend_on_the_state(programs):
    mechanism = rx.mechanisms.wojtyra2020()
    state = mechanism.state(phi=0.7, rate=1.3)
    matrix = jnp.diag(jnp.linspace(1e-8, 2e-8, 12)).at[0, 1].set(4e-9).at[1, 0].set(4e-9)
    for closure in (
        rx.MinimumNorm(),
        rx.MinimumNorm(20.0),
        rx.MinimumNorm(units=rx.units.Units(length=10.0)),
        rx.Compliance(jnp.linspace(1e-8, 2e-8, 12)),
        rx.Compliance(matrix),
        rx.Compliance({"A.x": 1e-8, "C.x": 2e-8, "K.angle": 1e-6, "L.angle": 1e-6, "A.y": 1e-8, "B.y": 1e-8}),
    ):
        motion = rx.simulate(mechanism, state, 0.01, ts=jnp.array([0.01]), closure=closure)
        end = rx.State(motion.q[-1], motion.qd[-1], motion.t[-1])
        loads = rx.solve(mechanism, end, closure=closure).multipliers
        np.testing.assert_allclose(motion.multipliers[-1], loads, rtol=1e-9, atol=1e-9 * np.abs(loads).max())
    assert programs.count("jit(stretch)") == 1


def test_turns_in_space_are_less_text_where_they_are_compiled_in_little_time():
    """Products of matrices; inside transformations, and in what runs long, sums written out, which XLA fuses."""
    texts = []

    def turned(p, v):
        return times(rotation(p), v)

    def traced(p, v):
        texts.append(str(jax.make_jaxpr(turned)(p, v)))
        return turned(p, v)

    given = jnp.array([[0.5, -0.5, 0.5, 0.5], [3.0, 0.0, 0.0, 3.0]]), jnp.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    for run in (compiled(traced), compiled(traced, runs_long=True), jax.jit(traced)):
        exact = [[-0.2, 0.3, -0.1], [-0.5, 0.4, 0.6]]  # a cyclic permutation with signs, a quarter turn about z
        np.testing.assert_allclose(run(*given), exact, rtol=0, atol=1e-15)
    quick, long, inside = texts
    assert long == inside
    assert "dot_general" not in inside
    assert 2 * len(quick.splitlines()) < len(inside.splitlines())


def test_what_is_known_is_known_inside_transformations():
    seen = []

    def one(x):
        seen.append(square(jnp.asarray(known)))
        return x + seen[-1]

    known = jnp.asarray(3.0)
    assert jax.jit(one)(1.0) == 10
    assert jax.grad(one)(1.0) == 1
    np.testing.assert_array_equal(jax.vmap(one)(jnp.arange(2.0)), [9, 10])
    assert not any(isinstance(value, jax.core.Tracer) for value in seen[1:])
    assert isinstance(compiled(lambda: jnp.ones(()))(), jax.Array)


def test_what_does_not_depend_on_the_sample_is_traced_once():
    """The factorisation under a `vmap` over closures."""
    traced = []

    def constraint(q, t, _):
        traced.append(q)
        return jnp.stack([q[0] + q[1], 2 * q[0] + 2 * q[1]])

    system = rx.System(mass=jnp.eye(2), constraint=constraint)
    state = rx.State(jnp.zeros(2), jnp.zeros(2))
    rx.factorize(system, state)
    before = len(traced)
    assert before > 0
    jax.vmap(lambda x: x * rx.factorize(system, state).gamma[0])(jnp.arange(3.0))
    jax.jit(lambda x: x * rx.factorize(system, state).gamma[0])(1.0)
    assert len(traced) == before


def test_functions_that_hold_traced_numbers():
    x, ones = jnp.arange(3.0), jnp.ones(())

    def outer(x):
        return applied(lambda y: y + x, ones)

    np.testing.assert_array_equal(jax.vmap(outer)(x), x + 1)
    assert jax.jit(outer)(2.0) == 3
    assert jax.grad(outer)(2.0) == 1
    assert outer(2.0) == 3


def test_derivatives_and_batches_go_through():
    assert jax.grad(square)(3.0) == 6
    assert jax.jvp(lambda x: square(x, scale=2.0), (3.0,), (1.0,))[1] == 12
    np.testing.assert_array_equal(jax.vmap(square)(jnp.arange(3.0)), [0, 1, 4])


def test_settings_of_jax_hold():
    with jax.disable_jit():
        assert square(jnp.asarray(2.0)) == 4
    with jax.debug_nans(True), pytest.raises(FloatingPointError):
        square(jnp.asarray(jnp.inf)) - compiled(jnp.log)(jnp.asarray(-1.0))


def test_options_that_xla_does_not_know_are_left_out(monkeypatch):
    monkeypatch.setattr(_compilation, "_QUICK", {"xla_of_another_year": True, "xla_backend_optimization_level": 0})
    quick_options.cache_clear()
    assert quick_options() == {"xla_backend_optimization_level": 0}
    monkeypatch.undo()
    quick_options.cache_clear()
    if jax.default_backend() == "cpu":
        assert "xla_backend_optimization_level" in quick_options()
        assert "xla_backend_optimization_level" not in quick_options(runs_long=True)


@pytest.mark.parametrize("name", ["wojtyra2020", "carriage", "slider_crank", "parallelogram", "doubled_four_bar"])
def test_building_a_mechanism_compiles_nothing(name, programs):
    friction = {"mu": 0.1, "guide_length": 0.1} if name == "carriage" else {"mu_rho": 0.01}
    mechanism = getattr(rx.mechanisms, name)(**friction)
    rx.Mechanism([rx.Body("a", 1, 2)], [rx.PinInSlot("S", "a", "ground", (0, 1), [0.0, 1.0], (3.0, 4.0))])
    rx.State(np.arange(3), [0.0, 1.0, 2.0])
    assert not programs
    mechanism.state(0.7, rate=1.0)
    assert len(programs) == 1


def test_a_mechanism_built_of_known_numbers_is_known_under_a_trace():
    def masses(x):
        known, traced = rx.mechanisms.wojtyra2020(mass=2.0), rx.mechanisms.wojtyra2020(mass=x)
        assert not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(known))
        return known.body.mass + traced.body.mass

    np.testing.assert_allclose(jax.jit(masses)(3.0), [15, 45, 15, 45], rtol=1e-15)
    np.testing.assert_allclose(jax.jacfwd(masses)(3.0), [3, 9, 3, 9], rtol=1e-15)


@once_in_reverse
def summed(x, y, *, times):
    return {"sum": jnp.sum(x * y), "power": x**times, "count": jnp.size(x), "name": "one"}


def turned(x):
    """What is looped over, set at places and read from there."""

    def turn(now, k):
        now = now.at[k].set(jnp.sin(now[k]) * now[(k + 1) % 3])
        return jnp.where(now > 0.9, now[::-1], now), jnp.max(now)

    out, largest = jax.lax.scan(turn, x / 3, jnp.arange(3))
    return jnp.linalg.solve(jnp.diag(out) + 0.1, largest) @ jnp.pad(x, 1)[:3]


def test_reverse_mode_alone_has_the_derivatives_of_the_function():
    """By some arguments and not others, of some results; by rows and in batches."""
    x, y = jnp.arange(1.0, 4.0), jnp.array([2.0, 3.0, 5.0])
    assert summed(x, y, times=3)["name"] == "one"
    np.testing.assert_allclose(jax.grad(lambda y: summed(x, y, times=3)["sum"])(y), x)
    np.testing.assert_allclose(jax.jacrev(lambda x: summed(x, y, times=3)["power"])(x), np.diag(3 * x**2))
    both = jax.grad(lambda x, y: summed(x, y, times=2)["sum"] + summed(x, y, times=2)["power"][0], argnums=(0, 1))
    many = jax.vmap(both, in_axes=(0, None))(jnp.stack([x, 2 * x]), y)
    np.testing.assert_allclose(many[0], [y + 2 * x * np.eye(3)[0], y + 4 * x * np.eye(3)[0]])
    np.testing.assert_allclose(many[1], [x, 2 * x])
    assert jax.grad(lambda c: summed(c, y, times=2)["sum"])(2.0) == 10.0  # by a number of Python
    weak, single = jax.jit(lambda: 2.0)(), jnp.ones(2, jnp.float32)
    out, back = jax.vjp(lambda x: summed(x, weak, times=2)["sum"], single)
    assert (out.dtype, back(out)[0].dtype) == (jnp.float32, jnp.float32)
    held = jax.grad(lambda c: once_in_reverse(lambda x: jnp.sum(c * x))(c * x))
    np.testing.assert_allclose(held(2.0), 24.0)  # by what the function holds, too


def test_a_first_gradient_in_reverse_compiles_neither_way(monkeypatch):
    x = jnp.array([0.3, 1.2, -0.5])
    with monkeypatch.context() as patch:
        patch.setattr(_numbers._Traced, "program", property(lambda self: pytest.fail("compiled")))
        found = jax.grad(once_in_reverse(turned))(x)
    np.testing.assert_allclose(found, jax.jit(jax.grad(turned))(x), rtol=1e-14)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev, lambda f: lambda x: jax.jvp(f, (x,), (x,))[1]])
def test_a_first_derivative_forward_compiles_nothing_of_it(mode, monkeypatch):
    x = jnp.array([0.3, 1.2, -0.5])
    with monkeypatch.context() as patch:
        patch.setattr(_numbers._Traced, "program", property(lambda self: pytest.fail("compiled")))
        found = mode(once(turned))(x)
    np.testing.assert_allclose(found, jax.jit(mode(turned))(x), rtol=1e-13)


@pytest.mark.parametrize("quick", [True, False])
def test_forward_mode_alone_has_the_derivatives_of_the_function(quick):
    """By some arguments and not others, of whole numbers among the results; in batches, of each other, and linearly."""
    count, x, y = 3, jnp.arange(1.0, 4.0), jnp.array([2.0, 3.0, 5.0])

    @partial(once, in_little_time=quick)
    def powers(x, y, *, times, places):
        return {"sum": jnp.sum(x**times * y), "least": jnp.argmin(x) + places}

    def summed(x, y=y):
        return powers(x, y, times=3, places=jnp.arange(count))["sum"]

    (out, found), by_one = jax.jvp(lambda x: powers(x, y, times=3, places=jnp.arange(count)), (x,), (y,)), 3 * x**2 * y
    np.testing.assert_array_equal(out["least"], [0, 1, 2])
    assert found["least"].dtype == jax.dtypes.float0
    np.testing.assert_allclose(found["sum"], by_one @ y)
    np.testing.assert_allclose(jax.jacfwd(summed)(x), by_one)
    np.testing.assert_allclose(jax.jacfwd(summed, argnums=(0, 1))(x, y), [by_one, x**3])
    np.testing.assert_allclose(jax.jacfwd(jax.jacfwd(summed))(x), np.diag(6 * x * y))
    np.testing.assert_allclose(jax.linearize(summed, x)[1](y), by_one @ y)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(summed))(x), by_one)
    both = jnp.stack([x, 2 * x])
    np.testing.assert_allclose(jax.vmap(jax.jacfwd(summed))(both), [by_one, 4 * by_one])
    np.testing.assert_allclose(jax.jacfwd(lambda c: jax.vmap(summed)(c * both))(2.0), 12 * both**3 @ y)
    many = jax.vmap(lambda v: jax.vmap(lambda w: jax.jvp(summed, (x,), (v + w,))[1])(jnp.eye(3)))(jnp.eye(3))
    np.testing.assert_allclose(many, by_one + by_one[:, None])
    assert jax.jvp(lambda c: summed(c * x), (2.0,), (1.0,))[1] == 12 * x**3 @ y
    for by_tangent in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(by_tangent(lambda v: jax.jvp(summed, (x,), (v,))[1])(y), by_one)
    numbers = jax.vmap(lambda v: jax.jvp(lambda c, d: summed(c * x + d), (2.0, 0.0), (v, 1.0))[1])(jnp.arange(2.0))
    np.testing.assert_allclose(numbers, 12 * x**2 @ y + np.arange(2) * (12 * x**3 @ y))
    assert jax.jacfwd(lambda none: summed(x + jnp.sum(none)))(jnp.zeros(0)).shape == (0,)
    np.testing.assert_allclose(jax.grad(summed)(x), by_one)
    many = jnp.arange(1.0, 201.0)
    np.testing.assert_allclose(jax.jvp(lambda x: summed(x, x), (many,), (many,))[1], 4 * jnp.sum(many**4))
    if not quick:  # programs with options of their own have no derivatives in reverse
        np.testing.assert_allclose(jax.grad(lambda x: summed(x, x))(many), 4 * many**3)
        np.testing.assert_allclose(jax.hessian(summed)(x), np.diag(6 * x * y))
