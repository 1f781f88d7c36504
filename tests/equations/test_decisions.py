"""Decisions that rounding can turn, through the public functions, against what is so by construction and 50 digits.

Every case is a random linear system: constraints C (K q - g t^2 / 2) with K (r, n) of full rank and C (m, r), so that
r of m rows are independent exactly, whatever floats make of it.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp

import redundax as rx
from redundax._system._results import result_codes

NAMES = {code: name for name, code in result_codes().items()}
CASES = pytest.mark.parametrize("cases", [300, pytest.param(2000, marks=pytest.mark.slow)])
EPS = float(np.finfo(float).eps)


def orthonormal(rng, n, k):
    return np.linalg.qr(rng.normal(size=(n, k)))[0]


def jacobian(rng, n, r, smallest, null=None):
    """K with singular values from 1 to `smallest`; its null space has a vector (2^j, -1, 0, ...) exactly if asked."""
    columns = rng.normal(size=(n, r))
    if null is not None:
        v = np.zeros(n)
        v[:2] = 2.0**null, -1.0
        columns -= np.outer(v, v @ columns) / (v @ v)
    k = orthonormal(rng, r, r) * np.geomspace(1, smallest, r) @ np.linalg.qr(columns)[0].T
    if null is not None:
        k[:, 1] = 2.0**null * k[:, 0]
    return k


def draw(rng, n, r, m, smallest, null=None):
    """A case: K, C, masses, load f, prescribed g, contradiction e, compliance and misfit."""
    return {
        "K": jacobian(rng, n, r, smallest, null),
        "C": np.concatenate([np.eye(r), rng.normal(size=(m - r, r))]),
        "M": np.diag(10.0 ** rng.uniform(0, 3, n)),
        "f": rng.normal(size=n),
        "g": rng.normal(size=r),
        "e": np.zeros(m),
        "W": np.diag(10.0 ** rng.uniform(0, 3, m)),
    }


def stacked(cases):
    return {name: jnp.array([case[name] for case in cases]) for name in cases[0]}


def constraint(q, t, p):
    return p["C"] @ (p["K"] @ q - p["g"] * t**2 / 2) - p["e"] * t**2 / 2


@jax.jit
@jax.vmap
def solved(p):
    n, m = p["M"].shape[0], p["C"].shape[0]
    system = rx.System(constraint, p["M"], lambda q, qd, t, p: p["f"], p, m=m)
    return rx.solve(system, rx.State(jnp.zeros(n), jnp.zeros(n)), closure=rx.Compliance(p["W"]))


def names(solution):
    return np.array([NAMES[int(code)] for code in jax.tree.leaves(solution.result)[0]])


def truth(case, rng=None):
    """[qdd; lam] at 50 digits; with `rng` of inputs moved by a rounding."""

    def exact(name):
        value = case[name]
        return mp.matrix((value if rng is None else value * (1 + EPS * rng.uniform(-1, 1, value.shape))).tolist())

    with mp.workdps(50):
        K, M, W = (exact(name) for name in ("K", "M", "W"))
        C, f, g = (mp.matrix(case[name].tolist()) for name in ("C", "f", "g"))
        n, r, m = K.cols, K.rows, C.rows
        # N^T W lam = 0 says that W lam is in the range of C:
        # M qdd + (C K)^T lam = f,  K qdd = g,  W lam - C y = 0
        A, b = mp.zeros(n + m + r), mp.zeros(n + m + r, 1)
        J = C * K
        for i in range(n):
            b[i] = f[i]
            for j in range(n):
                A[i, j] = M[i, j]
            for j in range(m):
                A[i, n + j] = J[j, i]
        for i in range(r):
            b[n + i] = g[i]
            for j in range(n):
                A[n + i, j] = K[i, j]
        for i in range(m):
            for j in range(m):
                A[n + r + i, n + j] = W[i, j]
            for j in range(r):
                A[n + r + i, n + m + j] = -C[i, j]
        x = mp.lu_solve(A, b)
        return np.array([float(value) for value in x[: n + m]])


def right(case, solution, k, rng):
    """Whether the answer of sample k is as near to 50 digits as 100 times what a rounding of the inputs does.

    A rounding of the rows turns the self-stress by as much over the smallest kept singular value, and what the
    compliances differ by magnifies that once more.
    """
    exact, compliances = truth(case), np.diag(case["W"])
    moved = max(np.abs(truth(case, rng) - exact).max() for _ in range(3))
    spread = compliances.max() / compliances[compliances > 0].min()
    moved += EPS * np.abs(exact).max() * min(spread, 1e8) / float(solution.stats.spectrum.kept[k])
    found = np.concatenate([solution.acceleration[k], solution.multipliers[k]])
    return np.abs(found - exact).max() <= 100 * moved


@pytest.mark.parametrize(
    ("freedom", "cases"), [(2, 300), *(pytest.param(k, 2000, marks=pytest.mark.slow) for k in (1, 3))]
)
def test_motions_without_mass(freedom, cases):
    rng, given = np.random.default_rng(freedom), []
    n, r = 7, 7 - freedom
    smallest = 10.0 ** rng.uniform(-9, 0, cases)
    for sigma in smallest:
        case = draw(rng, n, r, r + 2, sigma, null=int(rng.integers(-3, 4)))
        turn = orthonormal(rng, n - 2, n - 2)
        case["M"][2:, 2:] = turn @ case["M"][2:, 2:] @ turn.T
        case["M"][:2] = 0.0
        given.append(case)
    found = names(solved(stacked(given)))
    assert set(found) <= {"indeterminate_acceleration", "ambiguous_mass", "ambiguous_rank"}
    assert np.mean(found == "indeterminate_acceleration") >= 0.9
    for case in given:
        case["M"][:2, :2] = np.diag(10.0 ** rng.uniform(-6, 0, 2))
    solution = solved(stacked(given))
    found = names(solution)
    assert np.all(found[smallest > 1e-5] == "successful")
    chosen = np.flatnonzero(found == "successful")[:30]
    assert all(right(given[k], solution, k, rng) for k in chosen)


@pytest.mark.parametrize(
    ("redundancy", "cases"), [(2, 300), *(pytest.param(k, 2000, marks=pytest.mark.slow) for k in (1, 3))]
)
def test_closures_without_compliance(redundancy, cases):
    rng, given = np.random.default_rng(10 + redundancy), []
    n, r = 6, 5
    m = r + redundancy
    smallest = 10.0 ** rng.uniform(-7, 0, cases)
    for sigma in smallest:
        case = draw(rng, n, r, m, sigma)
        case["C"][-1] = 0.0  # the last row is 2^j times the first: their self-stress is (2^j, .., -1)
        case["C"][-1, 0] = 2.0 ** rng.integers(-2, 3)
        case["W"][[0, -1]] = 0.0
        given.append(case)
    found = names(solved(stacked(given)))
    assert set(found) <= {"indeterminate_closure", "ambiguous_closure", "ambiguous_rank"}
    assert np.mean(found == "indeterminate_closure") >= 0.9
    for case in given:
        case["W"][-1, -1] = 10.0 ** rng.uniform(-6, 0)
    solution = solved(stacked(given))
    found = names(solution)
    assert np.all(found[smallest > 1e-5] == "successful")
    chosen = np.flatnonzero(found == "successful")[:30]
    assert all(right(given[k], solution, k, rng) for k in chosen)


@pytest.mark.slow
def test_compliances_over_sixteen_decades():
    rng, given = np.random.default_rng(5), []
    for _ in range(2000):
        case = draw(rng, 6, 4, 7, 0.3)
        case["W"] = np.diag(10.0 ** rng.uniform(-8, 8, 7))
        given.append(case)
    solution = solved(stacked(given))
    assert np.all(names(solution) == "successful")
    assert all(right(given[k], solution, k, rng) for k in range(20))


@CASES
def test_rank(cases):
    """Of systems whose smallest independent singular value is anything down to rounding, the rank is right or open."""
    rng = np.random.default_rng(20)
    smallest = 10.0 ** rng.uniform(-14, 0, cases)
    given = [draw(rng, 6, 4, 6, sigma) for sigma in smallest]
    solution = solved(stacked(given))
    found = names(solution)
    rank, clear = np.asarray(solution.stats.rank), found != "ambiguous_rank"
    assert np.all(rank[clear] == 4)
    assert np.all(clear[smallest > 1e-10])
    assert np.mean(clear[smallest < 1e-13]) < 0.1
    chosen = np.flatnonzero(found == "successful")[:30]
    assert all(right(given[k], solution, k, rng) for k in chosen)


@CASES
def test_constraints_that_contradict_each_other(cases):
    rng, given = np.random.default_rng(30), []
    size = np.where(np.arange(cases) % 3 == 0, 0.0, 10.0 ** rng.uniform(-18, 0, cases))
    for share in size:
        case = draw(rng, 6, 4, 6, 10.0 ** rng.uniform(-4, 0))
        self_stress = np.linalg.svd(case["C"])[0][:, 4:] @ rng.normal(size=2)
        scale = np.abs(np.linalg.pinv(case["K"]) @ case["g"]).max()
        case["e"] = share * scale * self_stress / np.abs(self_stress).max()
        given.append(case)
    found = names(solved(stacked(given)))
    assert set(found) <= {"successful", "inconsistent_constraints", "ambiguous_constraints"}
    assert np.all(found[size == 0] == "successful")
    assert np.all(found[size > 1e-9] == "inconsistent_constraints")
    assert np.all(size[found == "successful"] < 1e-11)


@CASES
def test_rest(cases):
    """A slip s = (b^T C K + share * motion) . q: at rest exactly where the share is zero."""
    rng, given = np.random.default_rng(40), []
    share = np.where(np.arange(cases) % 3 == 0, 0.0, 10.0 ** rng.uniform(-18, 0, cases))
    for part in share:
        case = draw(rng, 6, 4, 6, 10.0 ** rng.uniform(-6, 0))
        z = np.linalg.svd(case["K"])[2][4:].T
        speed = z @ rng.normal(size=2)
        case["qd"] = speed / np.abs(speed).max()
        held = case["K"].T @ rng.normal(size=4)
        case["E"] = held / np.linalg.norm(held) + part * case["qd"] / (case["qd"] @ case["qd"])
        given.append(case)

    def run(p):
        friction = rx.Friction(
            lambda q, t, p: (p @ q)[None],
            lambda loads, rate, sense, memory, state, p: -0.01 * sense,
            rows=np.array([[0]]),
            kinds=["linear"],
            parameters=p["E"],
        )
        system = rx.System(constraint, p["M"], lambda q, qd, t, p: p["f"], p, m=6, friction=friction)
        return rx.solve(system, rx.State(jnp.zeros(6), p["qd"]))

    solution = jax.jit(jax.vmap(run))(stacked(given))
    found = names(solution)
    assert not np.any(found[share == 0] == "successful")
    assert np.mean(found[share == 0] == "friction_at_rest") >= 0.9
    assert np.all(found[share > 1e-7] == "successful")
    moving = found == "successful"
    assert np.all(np.asarray(solution.friction)[moving] <= 0)  # against the slip, whose rate is positive


@CASES
def test_singular_positions(cases):
    """One redundant row that bends: C K q and a last row + (share / 2) (B q)^2, singular here unless the share is 0."""
    rng, given = np.random.default_rng(50), []
    share = np.where(np.arange(cases) % 3 == 0, 0.0, 10.0 ** rng.uniform(-16, 0, cases))
    for part in share:
        case = draw(rng, 6, 4, 6, 10.0 ** rng.uniform(-6, 0))
        case["bend"] = np.sqrt(part) * rng.normal(size=6)
        given.append(case)

    def run(p):
        def bent(q, t, p):
            return constraint(q, t, p) + jnp.array([0, 0, 0, 0, 0, 0.5]) * (p["bend"] @ q) ** 2

        system = rx.System(bent, p["M"], lambda q, qd, t, p: p["f"], p, m=6)
        return rx.solve(system, rx.State(jnp.zeros(6), jnp.zeros(6)), closure=rx.Compliance(p["W"]))

    found = names(jax.jit(jax.vmap(run))(stacked(given)))
    assert set(found) <= {"successful", "singular_position", "ambiguous_position"}
    assert np.all(found[share == 0] == "successful")
    assert np.all(found[share > 1e-7] == "singular_position")
    assert not np.any(found[share > 1e-9] == "successful")
