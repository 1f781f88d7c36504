"""Traced functions computed by NumPy: as programs compute them, whatever the equations, or not at all."""

import tracemalloc

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from equinox.internal import while_loop

import redundax as rx
from redundax._tools import _computing, _interpreted, _numbers
from redundax._tools._interpreted import Interpreted
from redundax._tools._rule import NoRuleError
from redundax._tools._rules import RULES

A = np.array([[0.3, -1.7, 2.2], [0.9, 0.4, -0.6]])
B = np.array([[1.1, 0.2, -0.8], [0.7, 0.7, 0.4]])
CUBE = np.linspace(-1.3, 2.1, 24).reshape(2, 3, 4)
WHICH = np.array([2, 0, 1, 1])
INTEGERS = np.array([np.iinfo(np.int32).min, -128, -3, -1, 0, 1, 2, 7, 127, np.iinfo(np.int32).max])


def noted(start):
    """A loop of Equinox that sets entries."""
    turned = lambda x: (x[0] + 1, x[1].at[x[0]].set(2.0 * x[0]))  # noqa: E731
    begin = jnp.zeros((), int), start
    return while_loop(lambda x: x[0] < 3, turned, begin, buffers=lambda x: x[1], max_steps=5, kind="lax")


FUNCTIONS = {
    "products": lambda a, b, c: (
        a @ b.T,
        jnp.einsum("ij,jk->ik", a, b.T),
        jnp.einsum("bij,bi->bj", c, a),
        jnp.outer(a, b),
    ),
    "several axes at once": lambda a, b, c: (jnp.tensordot(c, a, ((0, 1), (0, 1))), jnp.einsum("ij,ij->", a, b)),
    "reductions": lambda a, b, c: (
        a.sum(),
        a.sum(0),
        c.max((0, 2)),
        c.min(-1),
        a.prod(),
        (a > 0).sum(1),
        jnp.all(a > b),
        *(jnp.max(x[:, :0], 1, initial=least) for x, least in ((a, -jnp.inf), (a.astype(int), -7), (a > 0, False))),
        jnp.min(a[:, :0], 1, initial=jnp.inf),
        jnp.nextafter(a, b),
    ),
    "along an axis": lambda a, b, c: (
        jnp.cumsum(c, 1),
        jax.lax.cumsum(a, 1, reverse=True),
        jnp.cumprod(a),
        jax.lax.cummax(c, 2),
        jnp.any(a < b, 1),
    ),
    "comparisons": lambda a, b, c: (
        a < b,
        a <= b,
        a >= b,
        a == a,
        a != b,
        (a > 0) & (b > 0),
        (a > 0) | ~(b > 0),
        (a > 0) ^ (b > 0),
    ),
    "choices": lambda a, b, c: (
        jnp.where(a > b, a, b),
        jnp.maximum(a, b),
        jnp.clip(a, -0.5, b),
        jnp.argmax(a, 1),
        jnp.argmin(b),
        jax.lax.clamp(a[0, 0], a, b[0, 0]),
    ),
    "powers": lambda a, b, c: (
        a**3,
        a**-2,
        jnp.abs(a) ** b,
        jnp.sqrt(b),
        jax.lax.rsqrt(jnp.abs(a)),
        jnp.square(a),
        a / b,
    ),
    "turns": lambda a, b, c: (jnp.sin(a), jnp.cos(a), jnp.tan(a), jnp.arctan2(a, b), jnp.sinc(a), jnp.hypot(a, b)),
    "inverse turns": lambda a, b, c: (
        jnp.arcsin(a / 3),
        jnp.arccos(a / 3),
        jnp.arctan(a),
        jnp.arcsinh(a),
        jnp.arctanh(a / 3),
    ),
    "growth": lambda a, b, c: (
        jnp.exp(a),
        jnp.log(b),
        jnp.log1p(b),
        jnp.expm1(a),
        jnp.tanh(a),
        jnp.sinh(a),
        jnp.cosh(a),
    ),
    "steps": lambda a, b, c: (
        jnp.sign(a - b),
        -a,
        jnp.copy(a),
        jnp.unstack(c, axis=1),
        jnp.floor(a),
        jnp.ceil(a),
        jnp.round(a),
        a % b,
        jnp.fmod(a, b),
        jax.lax.round(a),
        jax.lax.round(jnp.array([0.49999999999999994, -2.5, 2.5, 0.3], a.dtype)),
    ),
    "shapes": lambda a, b, c: (
        c.transpose(2, 0, 1),
        c.reshape(4, 6),
        c[..., ::2],
        c[0, 1:],
        jnp.flip(c, 1),
        jnp.expand_dims(a, 1),
    ),
    "parts": lambda a, b, c: (
        jnp.concatenate([a, b], 1),
        jnp.stack([a, b], 1),
        jnp.split(c, [1, 3], 2),
        jnp.tile(a, 2),
        [*c],
    ),
    "padding": lambda a, b, c: (
        jnp.pad(a, 1),
        jax.lax.pad(a, a[0, 0], [(1, 0, 2), (0, 2, 0)]),
        jax.lax.pad(a, a[0, 0], [(-1, 1, 2), (1, -2, 0)]),
        jax.lax.pad(a, a[0, 0], [(3, -2, 0), (-1, -1, 1)]),
        jnp.repeat(a, 2, 1),
        jnp.eye(3),
    ),
    "entries read": lambda a, b, c: (
        a[:, WHICH],
        c[1, WHICH],
        c[:, [0, 1], [1, 2]],
        jnp.take(a, WHICH),
        a[jnp.argmax(a, 0), 0],
    ),
    "entries set": lambda a, b, c: (a.at[:, 1].set(5.0), a.at[0, 1:].set(b[0, :2]), c.at[1, 1:, 2].set(7.0)),
    "entries added": lambda a, b, c: (a.at[:, WHICH].add(1.0), a.at[1].add(b[0]), jnp.zeros(3).at[WHICH].add(c[0, 0])),
    "entries of what lies transposed": lambda a, b, c: (
        (2 * a.T).at[1].set(b[:, 0]),
        jnp.stack([a[0], b[0]], 1).T.at[0].add(1.0),
        jax.vmap(jnp.sin, out_axes=1)(a).at[0, 1].set(0.0),
    ),
    "calls inside": lambda a, b, c: (
        jax.jit(jnp.sin)(a),
        jax.nn.relu(a),
        jax.checkpoint(jnp.cos)(b),
        jax.nn.sigmoid(a),
    ),
    "derivatives": lambda a, b, c: (
        jax.jacfwd(lambda x: jnp.sin(x) @ b.T)(a),
        jax.jacrev(lambda x: x[:, WHICH] @ c[0].T[:, :2])(a),
    ),
    "batches": lambda a, b, c: jax.vmap(lambda x, k: (x[k] * jnp.roll(x, 1)[WHICH], x.at[k].add(2.0)))(
        a, jnp.array([1, 0])
    ),
    "numbers alone": lambda a, b, c: (
        a[0, 0] * b[1, 1],
        jnp.float32(a[0, 0]),
        a.astype(jnp.float32),
        jnp.arange(4) * a[0, 0],
    ),
    "loops": lambda a, b, c: (
        jax.lax.while_loop(lambda x: jnp.sum(x) < 9.0, lambda x: 1.5 * x + b[0, 0], jnp.abs(a)),
        jax.lax.while_loop(lambda x: x[0] < 0, lambda x: (x[0] + 1, 2 * x[1]), (jnp.zeros((), int), a)),
        jax.vmap(lambda x, y: jax.lax.while_loop(lambda z: z[0] < 9.0, lambda z: (z[0] + 1, 1.5 * z[1]), (x, y)))(
            a[:, 0], c
        ),
        jax.lax.scan(lambda x, y: (x * y[0][0] + b[0, 0], (x, y)), a[0], (b.T, c[0])),
        jax.lax.scan(lambda x, y: (x + y, x), a[0, 0], b[0], reverse=True),
        jax.lax.fori_loop(0, 4, lambda k, x: x.at[jnp.minimum(k, 1)].add(b[0]), a),
        jax.lax.map(lambda x: x @ b.T, c.transpose(0, 2, 1)),
        noted(jnp.zeros(4, a.dtype)),
        jax.vmap(noted)(c[0]),
    ),
    "branches": lambda a, b, c: (
        jax.lax.cond(a[0, 0] > b[0, 0], lambda x: (x, 2 * x), lambda x: (-x, x), a),
        jax.lax.switch(jnp.argmax(a[0]), [jnp.sin, jnp.cos, jnp.tan], b),
        jax.lax.select_n(jnp.argmin(a, 1), a[:, 0], a[:, 1], b[:, 0]),
        jax.lax.cond(jnp.arange(3).sum() > 2, jnp.sin, jnp.cos, a),
    ),
    "factors": lambda a, b, c: (
        jnp.linalg.solve(a[:, :2] + 3 * jnp.eye(2, dtype=a.dtype), b),
        jnp.linalg.cholesky(a @ a.T),
        jnp.linalg.eigvalsh(a @ a.T),
        [jnp.abs(x) for x in jnp.linalg.eigh(a @ a.T)],
        jnp.linalg.eigvalsh(jnp.stack([a @ a.T, b @ b.T])),
        [jnp.abs(x) for x in jnp.linalg.svd(a, full_matrices=False)],
        jnp.linalg.svd(a, compute_uv=False),
        jax.lax.linalg.lu(a.T @ a + b.T @ b),
        jax.lax.linalg.lu(a.T),
        jax.lax.linalg.lu(jnp.stack([c[0, :3, :3], c[1, :3, :3] ** 2, jnp.zeros_like(c[0, :3, :3])])),
        jnp.linalg.qr(jnp.stack([a.T, b.T])),
        jnp.linalg.qr(a.T, mode="complete"),
        jax.scipy.linalg.lu_solve(jax.scipy.linalg.lu_factor(a @ a.T + jnp.eye(2, dtype=a.dtype)[::-1]), b),
        jax.lax.linalg.lu_pivots_to_permutation(np.int32([[2, 1, 3], [0, 3, 2]]) + (0 * a[0, 0]).astype(np.int32), 4),
    ),
    "triangles": lambda a, b, c: [
        jax.lax.linalg.triangular_solve(
            a[:, :2] + 2 * jnp.eye(2, dtype=a.dtype),
            b if left else b.T,
            left_side=left,
            lower=lower,
            transpose_a=turned,
            unit_diagonal=unit,
        )
        for left in (True, False)
        for lower in (True, False)
        for turned in (True, False)
        for unit in (True, False)
    ],
    "orders": lambda a, b, c: (
        jnp.sort(a),
        jnp.sort(a, 0),
        jnp.argsort(b[0]),
        jax.lax.sort([jnp.round(c[0, 0]), c[1, 0], c[1, 1]], num_keys=2),
    ),
    "entries put": lambda a, b, c: (
        jax.lax.dynamic_update_slice(c, c[:1, :2, :2], (1, jnp.argmax(a[0]), 3)),
        (100 * a).astype(int),
        jax.lax.platform_dependent(a, cpu=jnp.sin, default=jnp.cos),
        jax.lax.stop_gradient(a),
    ),
    "whole quotients": lambda a, b, c: [  # of numbers that are not known before: XLA itself crashes where they are
        whole(*(x + (0 * a[0, 0]).astype(kind) for x in np.meshgrid(INTEGERS.astype(kind), INTEGERS.astype(kind))))
        for whole in (jax.lax.div, jax.lax.rem)
        for kind in (np.int32, np.uint32, np.int8)
    ],
    "places beyond": lambda a, b, c: (
        a.at[jnp.array([0, 9, -7])].get(mode="fill"),
        a.at[:, jnp.array([9, 1])].get(mode="fill", fill_value=2.0),
        a[0].at[jnp.argmax(b[0]) + 5].get(mode="fill"),
        *(x.at[jnp.array([1, 9])].get(mode="fill") for x in (jnp.arange(3), jnp.arange(3, dtype=np.uint32))),
        a.at[jnp.array([9, 0])].set(b[::-1], mode="drop"),
        c.at[:, jnp.array([1, 7]), jnp.array([0, 1])].add(1.0, mode="drop"),
        jax.vmap(lambda x, k: x.at[k].get(mode="fill"))(a, jnp.array([[0, 5], [-9, 1]])),
        jax.vmap(lambda x, k: x.at[k].add(x[:2], mode="drop"))(a, jnp.array([[0, 5], [-9, 1]])),
    ),
    "factors of batches": lambda a, b, c: (
        jax.lax.linalg.triangular_solve(c[:, :3, :3] + 3 * jnp.eye(3, dtype=a.dtype), c, left_side=True, lower=True),
        jnp.linalg.cholesky(jnp.stack([a @ a.T, -jnp.eye(2, dtype=a.dtype), b @ b.T])),
    ),
    "a read slice": lambda a, b, c: (
        jax.lax.dynamic_slice(c, (0, jnp.argmax(a[0]), 5), (2, 2, 2)),
        jnp.isfinite(a / 0.0),
    ),
}


def of_numpy(function, *given):
    """What NumPy computes, by the steps of the equations."""
    return Interpreted(jax.make_jaxpr(function)(*given))(given)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_numpy_computes_what_a_program_does(name, dtype):
    given = [x.astype(dtype) for x in (A, B, CUBE)]
    found = of_numpy(FUNCTIONS[name], *given)
    expected = jax.tree.leaves(jax.jit(FUNCTIONS[name])(*given))
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        np.testing.assert_allclose(one, other, rtol=30 * np.finfo(dtype).eps, atol=30 * np.finfo(dtype).eps)


def test_every_rule_is_tried():
    """But for names that other versions of JAX have."""
    seen = set()

    def walk(jaxpr):
        for equation in jaxpr.eqns:
            seen.add(equation.primitive.name)
            for inner in equation.params.values():
                if hasattr(inner, "eqns") or hasattr(inner, "jaxpr"):
                    walk(getattr(inner, "jaxpr", inner))

    for function in FUNCTIONS.values():
        walk(jax.make_jaxpr(function)(A, B, CUBE).jaxpr)
    assert RULES.keys() - seen <= {
        "copy_p",
        "polynomial",
        "expand_dims",
        "add_any",
        "acosh",
        "cbrt",
        "exp2",
        "unvmap_all",
        "unvmap_max",
        "empty2",
    }


def test_nothing_is_nan_as_in_a_program():
    x = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0])

    def values(x):
        return (
            jnp.maximum(x, 0.0),
            jnp.sign(x),
            1 / x,
            jnp.sqrt(x),
            jnp.max(x),
            jnp.where(x > 0, x, -x),
            jnp.arctan2(x, x),
        )

    with np.errstate(all="ignore"):
        for one, other in zip(of_numpy(values, x), jax.jit(values)(x), strict=True):
            np.testing.assert_array_equal(one, other)


def test_what_has_no_factor_is_nan_and_triangles_without_pivot_are_followed():
    singular = np.array([[2.0, 1.0], [0.0, 0.0]])

    def values(a):
        return (
            jnp.linalg.cholesky(-jnp.eye(2) + 0 * a),
            jnp.linalg.svd(a / 0.0, compute_uv=False),
            jax.lax.linalg.triangular_solve(a, jnp.array([[4.0], [0.0]]), left_side=True, lower=False),
            jax.lax.linalg.triangular_solve(a.T, jnp.array([[4.0], [1.0]]), left_side=True, lower=True),
            jnp.array([jnp.nan, 1e300, -1e300, 2.7, -2.7]).astype(jnp.int32) + 0 * jnp.int32(a[1, 1]),
        )

    with np.errstate(all="ignore"):
        for one, other in zip(of_numpy(values, singular), jax.jit(values)(singular), strict=True):
            np.testing.assert_array_equal(one, other)


def test_what_is_not_finite_spreads_to_what_depends_on_it_alone():
    upper = np.array([[2.0, 1.0, 3.0], [0.0, 4.0, 5.0], [0.0, 0.0, 6.0]])

    def solved(a, b):
        return [
            jax.lax.linalg.triangular_solve(x, b, left_side=True, lower=lower)
            for x, lower in ((a, False), (a[::-1, ::-1], True))
        ]

    for a, b in ((upper, [[np.nan], [2.0], [3.0]]), (np.where(upper == 1, np.inf, upper), [[1.0], [2.0], [3.0]])):
        given = a, np.array(b)
        with np.errstate(all="ignore"):
            for one, other in zip(of_numpy(solved, *given), jax.jit(solved)(*given), strict=True):
                np.testing.assert_allclose(one, other, rtol=1e-15)


def test_arrays_that_their_owner_changes_are_read_anew():
    """Places that are given; what a function holds stays as it was traced."""
    held = np.ones(5)
    program = jax.make_jaxpr(lambda x, k: held * x.at[k].get(mode="promise_in_bounds"))
    run = Interpreted(program(np.zeros(5), np.zeros(5, int)))
    x, places = np.arange(5.0), np.array([1, 2, 0, 3, 4])
    np.testing.assert_array_equal(run([x, places])[0], [1, 2, 0, 3, 4])
    places[:], held[:] = 4, 7.0
    np.testing.assert_array_equal(run([x, places])[0], [4] * 5)


@pytest.mark.parametrize("kind", ["while", "scan"])
def test_what_stays_the_same_in_a_loop_is_computed_once_a_call(kind, monkeypatch):
    sines = []

    def noted(x):
        sines.append(x)
        return np.sin(x)

    def steps(x, k, turns):
        def turn(now):
            return now * jnp.sin(x)[k] + 1

        if kind == "scan":
            return jax.lax.scan(lambda now, _: (turn(now), now), 0.0, length=5)[0]
        return jax.lax.while_loop(lambda now: now[0] < turns, lambda now: (now[0] + 1, turn(now[1])), (0, 0.0))[1]

    monkeypatch.setitem(RULES, "sin", lambda parameters, of, to: noted)
    x, k = np.array([0.4, 1.1, -0.7]), np.array(1)
    run = Interpreted(jax.make_jaxpr(steps)(x, k, 5))
    for change in (0.0, 0.3, -0.2):  # in place: the arrays are the same ones
        x += change
        k[...] = (k + 1) % 3
        np.testing.assert_allclose(run([x, k, np.array(5)])[0], np.sum(np.sin(x[k]) ** np.arange(5)), rtol=1e-14)
    assert len(sines) == 3
    if kind == "while":
        assert run([x, k, np.array(0)])[0] == 0 and len(sines) == 3  # no turn, nothing computed


@pytest.fixture
def clock(monkeypatch):
    """Seconds that a test says have passed."""
    seconds = [0.0]
    monkeypatch.setattr(_interpreted.time, "thread_time", lambda: seconds[0])
    return seconds


@pytest.fixture
def slow_sine(clock, monkeypatch):
    """One second that each sine takes, and what sines were asked for."""
    asked = []

    def slow(x):
        asked.append(x)
        clock[0] += 1.0
        return np.sin(x)

    monkeypatch.setitem(RULES, "sin", lambda parameters, of, to: slow)
    return asked


def test_a_loop_that_turns_for_long_goes_on_as_a_program(clock):
    """It is the program from there, not from its start; a short one never is. Later calls begin with it."""

    def slept(x):
        clock[0] += 1.0
        return np.asarray(x)

    def steps(x):
        def turn(now):
            y = jax.pure_callback(slept, jax.ShapeDtypeStruct((), x.dtype), now[1])
            return now[0] + 1, y * 1.5

        return jax.lax.while_loop(lambda now: now[0] < 40, turn, (0, x))

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(RULES, "pure_callback", lambda parameters, of, to: slept)
        run = Interpreted(jax.make_jaxpr(steps)(1.0), dict)
        patch.setattr(run._loops[0], "_left", 20.0)
        count, y = run([np.float64(1.0)])
        assert clock[0] == 40  # of 20 turns, 10 of them before the program
        assert run.has_programs
        np.testing.assert_allclose([count, y], [40, 1.5**40], rtol=1e-14)
        np.testing.assert_allclose(run([np.float64(2.0)])[1], 2 * 1.5**40, rtol=1e-14)


def test_a_loop_of_known_length_is_a_program_as_soon_as_its_turns_would_take_too_long(slow_sine):
    def steps(x):
        return jax.lax.map(jnp.sin, x)

    run, x = Interpreted(jax.make_jaxpr(steps)(np.ones(10)), dict), np.linspace(0, 1, 10)
    run._loops[0]._left = 10.5
    np.testing.assert_allclose(run([x])[0], np.sin(x), rtol=1e-15)
    assert (len(slow_sine), run.has_programs) == (10, False)
    np.testing.assert_allclose(run([x])[0], np.sin(x), rtol=1e-15)
    assert (len(slow_sine), run.has_programs) == (11, True)


def test_a_loop_in_a_branch_is_a_program_too(slow_sine, clock, monkeypatch):
    def steps(x):
        return jax.lax.cond(x[0] < 1, lambda x: jax.lax.map(jnp.sin, x), lambda x: x, x)

    monkeypatch.setattr(_interpreted, "_COMPILING", 0.5)
    run, x = Interpreted(jax.make_jaxpr(steps)(np.ones(30)), dict), np.linspace(0, 0.9, 30)
    np.testing.assert_allclose(run([x])[0], np.sin(x), rtol=1e-15)
    assert run.has_programs
    assert clock[0] < 30


def test_a_loop_in_a_loop_is_a_program_before_it(slow_sine, clock, monkeypatch):
    x = np.linspace(0, 0.9, 10)
    run = Interpreted(jax.make_jaxpr(lambda x: jax.lax.map(lambda y: jax.lax.map(jnp.sin, y), x))(x[:, None]), dict)
    run._loops[0]._left = 1e3
    monkeypatch.setattr(_interpreted, "_BEGINNING", 3.0)
    np.testing.assert_allclose(run([x[:, None]])[0], np.sin(x)[:, None], rtol=1e-15)
    assert [loop.program is not None for loop in run._loops] == [False, True]
    assert clock[0] < 10


@pytest.mark.parametrize(
    "function",
    [
        lambda x: jnp.asarray(x).reshape(3, 1).ravel(order="F") * jnp.reshape(jnp.outer(x, x), (3, 3), order="F")[0],
        lambda x: jnp.asarray(x).at[0].apply(jnp.square),
        lambda x: jnp.asarray(x).at[0].mul(3.0),
        lambda x: x * jax.random.uniform(jax.random.key(0)),
        lambda x: x.astype(jnp.bfloat16),
        lambda x: jax.lax.fori_loop(0, 3, lambda _, y: y.at[0].mul(3.0), x),
        lambda x: jax.lax.linalg.schur(jnp.diag(x))[0],
    ],
)
def test_what_has_no_rule_is_a_program(function, monkeypatch):
    x = np.array([0.5, 1.5, 2.5])
    with pytest.raises((NoRuleError, TypeError, ValueError)):
        of_numpy(function, x)
    with _computing.computing():
        found = _numbers.of_model(function)(x)
    np.testing.assert_array_equal(found, function(x))
    assert isinstance(found, np.ndarray)


def test_results_are_the_callers_own():
    """What one call does to its result does not come back in the next."""
    run = Interpreted(jax.make_jaxpr(lambda x: (jnp.arange(3.0), x, x[::-1]))(np.zeros(3)))
    for _ in range(2):
        x = np.array([1.0, 2.0, 3.0])
        constant, same, turned = run([x])
        np.testing.assert_array_equal(constant, [0, 1, 2])
        constant[:], same[:], turned[:] = 7.0, 7.0, 7.0
        np.testing.assert_array_equal(x, [1, 2, 3])


def test_large_arrays_are_let_go_once_nothing_takes_them():
    """Of 40 steps, each of an array of 0.8 MB, a few are held at a time; and the same call gives the same again."""

    def steps(x):
        y = x
        for _ in range(40):
            y = 0.5 * y + x
        return y, 2 * y

    x = np.ones(100_000)
    run = Interpreted(jax.make_jaxpr(steps)(x))
    first = run([x])
    tracemalloc.start()
    again = run([x])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * x.nbytes
    np.testing.assert_array_equal(first, again)
    np.testing.assert_allclose(again[0], 2 - 0.5**40, rtol=1e-15)


@pytest.mark.parametrize("few", [0, 2])
def test_a_program_takes_over_and_gives_the_same(few, monkeypatch):
    monkeypatch.setattr(_numbers, "FEW", few)
    run, x = _numbers.of_model(lambda x, word: {"sine": jnp.sin(x), word: None}), np.linspace(0, 1, 5)
    with _computing.computing():
        for _ in range(4):
            found = run(x, "other")
            assert found["other"] is None
            np.testing.assert_allclose(found["sine"], np.sin(x), rtol=1e-15)


@pytest.fixture
def compiled(monkeypatch):
    """Names of the programs compiled from here on, with the model computed by NumPy."""
    monkeypatch.setattr(_numbers, "FEW", 1000)
    names = []

    def listen(event, _, **about):
        if "backend_compile" in event:
            names.append(about.get("fun_name"))

    jax.monitoring.register_event_duration_secs_listener(listen)
    yield names
    jax.monitoring.unregister_event_duration_listener(listen)


def rod_on_three_pins():
    pins = [rx.Revolute(name, "rod", "ground", (x, 0.0), (x, 0.0)) for name, x in (("A", -0.4), ("B", 0.5), ("C", 0.7))]
    return rx.Mechanism([rx.Body("rod", 1.0, 0.1)], pins, gravity=(0.0, -9.81))


def test_first_answers_compile_nothing(compiled):
    rod = rod_on_three_pins()
    state = rx.assemble(rod, {})
    solution = rx.solve(rod, state)
    assert sum(np.asarray(solution[f"{pin} force y on rod"]) for pin in "ABC") == pytest.approx(9.81)
    assert rx.analyze(rod, state).redundancy == 4 - 1
    assert not compiled


def test_what_is_asked_of_a_model_and_of_its_factorisation_compiles_nothing(compiled):
    rod = rod_on_three_pins()
    state = rx.assemble(rod, {})
    factor = rx.factorize(rod, state)
    W, d = rx.ElasticJoints(rod, {"A": 1e-8, "B": 2e-8, "C": 3e-8}).compliance(rod, state)
    assert isinstance(rod.jacobian(np.zeros(3), np.zeros(())), jax.Array)
    asked = (
        *(rod.constraint(state.q, state.t), rod.jacobian(state.q, state.t), rod.mass(q=state.q, t=state.t)),
        *(rod.load(state), rod.point(state, "rod", (0.5, 0.0)), rod.retract(state.q, np.array([0.0, 0.0, 0.1]))),
        *(factor.self_stress, factor.unique_multipliers, factor.lost_digits, factor.apparent_mass(), W, d),
    )
    result = factor.result
    assert not compiled
    assert result == rx.RESULTS.successful
    assert all(isinstance(x, jax.Array) for x in asked)
    constraint, jacobian, mass, load, point, turned, stress, unique, _, inertia, W, d = map(np.asarray, asked)
    true = np.concatenate([[[1.0, 0.0, 0.0], [0.0, 1.0, arm]] for arm in (-0.4, 0.5, 0.7)])
    np.testing.assert_allclose(constraint, 0, atol=1e-12)
    np.testing.assert_allclose(jacobian, true, atol=1e-12)
    np.testing.assert_allclose(mass, np.diag([1.0, 1.0, 0.1]), atol=1e-12)
    np.testing.assert_allclose(load, [0.0, -9.81, 0.0], atol=1e-12)
    np.testing.assert_allclose(point, [0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned, [0.0, 0.0, 0.1], atol=1e-12)
    np.testing.assert_allclose(stress, np.eye(6) - true @ np.linalg.pinv(true), atol=1e-12)
    assert not unique.any()
    np.testing.assert_allclose(true @ np.linalg.solve(mass, true.T) @ inertia @ true, true, atol=1e-12)
    np.testing.assert_allclose(np.diag(W), np.repeat([1e-8, 2e-8, 3e-8], 2), rtol=1e-12)
    np.testing.assert_array_equal(d, 0)
