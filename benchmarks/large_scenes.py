"""Large scenes: a sparse factorisation behind the library's interface, beside its dense one.

    [ M     K^T    ] [ a       ]   [ f             ]        K = D^-1 Phi_q S,   W_s = D^-1 W D^-1
    [ K   -eps W_s ] [ lam_j+1 ] = [ g - eps W_s lam_j ]

    python benchmarks/large_scenes.py [--loops N] [--repeats N]

The passes never change the part of W_s lam along the self-stress, N^T W_s lam. From lam_0 = 0 they end at the
multipliers of least W_s norm, which are those of the closure (W, 0); with f = g = 0 they project a self-stress out of
lam_0. K is compressed by columns that share no row. KLU (klujax, LGPL, `pip install "redundax[bench]"`) factors it on
a pattern that is fixed beforehand; it takes x64 and the CPU for the whole process, so that only this file imports it.

A prototype: it decides no rank. What the passes cannot settle shows in the residual of (7) and in the growth of lam.
Times are medians of calls in turn, per solve; errors are against the dense factorisation, relative to the largest
figure of its kind.
"""

import argparse
import pathlib
import sys
from collections.abc import Callable
from functools import partial

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

import equinox as eqx
import jax
import jax.numpy as jnp
import klujax
import numpy as np
from jaxtyping import Array, Float

import redundax as rx
from benchmarks._devices import prepare
from benchmarks.sweeps._measure import times
from redundax._closures._closure import Elasticity, elasticity
from redundax._equations._kinematics import along_motion
from redundax._equations._response import AbstractPick, AbstractSolvedFactorisation, Response, total
from redundax._solve._reduced import reduce
from redundax._solvers._solver import closed_root
from redundax._system._decision import Decision
from redundax._system._system import AbstractSystem
from redundax._tools._module import is_concrete

SHIFT = 1e-8  # eps: what is left of a small singular value grows with it, rounding of the self-stress with 1 / eps
PASSES = 3
GRADIENTS = 60  # steps of conjugate gradients, at most


class Scene:
    """What is the same at all states of a mechanism: pattern, colours of the columns, scales, KLU's analysis."""

    def __init__(self, system: AbstractSystem, state: rx.State, compliance: Float[Array, "m m"]):
        factor = rx.factorize(system, state)
        moved = [
            np.asarray(system.jacobian(state.q + 0.1 * np.sin(k + np.arange(state.q.size)), state.t)) for k in (1, 2)
        ]
        used = np.any([np.asarray(factor.jacobian) != 0, *(one != 0 for one in moved)], axis=0)
        self.rows, self.columns = np.nonzero(used)
        self.colour = _colours(used)
        self.seeds = np.eye(self.colour.max() + 1)[self.colour].T
        scales = factor.scaling
        mass = np.diagonal(np.asarray(factor.mass)) * np.asarray(scales.coordinates) ** 2
        self.heft = float(mass.mean())  # makes M as large as K
        self.coordinates, self.row_scale = np.asarray(scales.coordinates), np.asarray(scales.rows)
        self.mass, self.length = mass / self.heft, float(scales.length)
        weight = np.asarray(compliance) / self.row_scale / self.row_scale[:, None]
        self.left, self.right = np.nonzero(weight)
        self.compliance = np.asarray(compliance)
        self.weight = weight[self.left, self.right] / np.abs(weight).max()
        n = len(mass)
        self.i = np.concatenate([np.arange(n), n + self.rows, self.columns, n + self.left]).astype(np.int32)
        self.j = np.concatenate([np.arange(n), self.columns, n + self.rows, n + self.right]).astype(np.int32)
        self.symbol = klujax.analyze(jnp.asarray(self.i), jnp.asarray(self.j), n + len(self.row_scale))

    def weighted(self, multipliers: Float[Array, "m p"]) -> Float[Array, "m p"]:
        """W_s lam."""
        parts = self.weight[:, None] * multipliers[self.right]
        return jnp.zeros_like(multipliers).at[self.left].add(parts)


def _colours(used: np.ndarray) -> np.ndarray:
    """A colour for each column; those of one colour share no row."""
    taken: list[np.ndarray] = []
    colour = np.zeros(used.shape[1], int)
    for column, rows in enumerate(used.T):
        free = [k for k, mask in enumerate(taken) if not np.any(mask & rows)]
        colour[column] = free[0] if free else len(taken)
        if not free:
            taken.append(np.zeros(used.shape[0], bool))
        taken[colour[column]] |= rows
    return colour


class SparseFactorisation(AbstractSolvedFactorisation):
    """The equations of a scene at a state, by a sparse factor.

    - `values`: the entries of the matrix above.
    - `entries`: those of K.
    - `acceleration`, `multipliers`: the solution of least W_s norm without friction.
    - `residual`: largest residual of (7), relative to its terms, and growth of lam in the last pass.
    """

    scene: Scene = eqx.field(static=True)
    values: Float[Array, " z"]
    entries: Float[Array, " y"]
    acceleration: Float[Array, " n"]
    multipliers: Float[Array, " m"]
    length: Float[Array, ""]
    residual: Float[Array, ""]
    rate_noise: Float[Array, ""]

    def respond(self, forces: Array, gamma: Array | None = None) -> Response:
        scale = self.scene.row_scale[:, None]
        gamma = jnp.zeros((len(scale), forces.shape[1])) if gamma is None else gamma / scale
        a, mu, _ = _passes(self.scene, self.values, self.scene.coordinates[:, None] * forces, gamma)
        return Response(self.scene.coordinates[:, None] * a, mu / scale)

    def close(self, compliance: Float[Array, "m m"]) -> tuple[AbstractPick, Decision]:
        own = is_concrete(compliance) and np.array_equal(compliance, self.scene.compliance)
        return SparsePick(self, compliance, own), Decision(jnp.asarray(jnp.inf))

    def motion_of(self, rates: Array) -> Decision:
        return Decision(jnp.abs(rates) / self.rate_noise)

    def undetermined(self, compliance: Float[Array, "m m"]) -> None:
        return None  # singular positions are not looked for

    def in_balance(self, multipliers: Float[Array, "m p"]) -> Float[Array, "m p"]:
        """The self-stress in scaled multipliers, along W_s."""
        still = jnp.zeros((len(self.scene.mass), multipliers.shape[1]))
        _, mu, _ = _passes(self.scene, self.values, still, jnp.zeros_like(multipliers), start=multipliers)
        return mu


class SparsePick(AbstractPick):
    """lam + G (d - W lam), G by conjugate gradients on the self-stress.

    Where W is the scene's `own`, G W is the projection itself; no misfit causes nothing.
    """

    factor: SparseFactorisation
    compliance: Float[Array, "m m"]
    own: bool = eqx.field(static=True)

    def __call__(self, multipliers: Array) -> Array:
        scale, columns = self.factor.scene.row_scale[:, None], multipliers.reshape(len(multipliers), -1)
        own = self.factor.in_balance(scale * columns) / scale if self.own else self._caused(self.compliance @ columns)
        return (columns - own).reshape(multipliers.shape)

    def caused(self, misfit: Array, rows: Array | None = None) -> Array:
        none, misfit = (
            is_concrete(misfit) and not np.asarray(misfit).any(),
            jnp.broadcast_to(misfit, self.factor.scene.row_scale.shape),
        )
        found = jnp.zeros_like(misfit) if none else self._caused(misfit[:, None])[:, 0]
        return found if rows is None else found[rows]

    def bound(self, misfit: Array) -> Array:
        return total(self.caused(misfit))

    def _caused(self, misfit: Float[Array, "m p"]) -> Float[Array, "m p"]:
        scale, project = self.factor.scene.row_scale[:, None], self.factor.in_balance

        def inside(mu: Array) -> Array:
            return _transposed(project, self.compliance @ (project(mu) / scale) / scale)

        right = _transposed(project, misfit / scale)
        least = 2.0**-52 / SHIFT * jnp.linalg.norm(misfit / scale)  # rounding of the projection
        found, _ = jax.scipy.sparse.linalg.cg(inside, right, tol=1e-14, atol=least, maxiter=GRADIENTS)
        return project(found) / scale


def _transposed(project: Callable[[Array], Array], rows: Array) -> Array:
    """The transpose of the projection along W_s, on the self-stress."""
    return jax.linear_transpose(project, rows)(rows)[0]


def _passes(
    scene: Scene, values: Array, force: Float[Array, "n p"], gamma: Float[Array, "m p"], start: Array | None = None
) -> tuple[Array, Array, Array]:
    """Scaled accelerations and multipliers, and the growth of these in the last pass."""
    mu, n, before = jnp.zeros_like(gamma) if start is None else start, len(scene.mass), 0.0 * gamma
    i, j = jnp.asarray(scene.i), jnp.asarray(scene.j)
    for _ in range(PASSES):
        right = jnp.concatenate([force / scene.heft, gamma - SHIFT * scene.weighted(mu / scene.heft)])
        found = klujax.solve_with_symbol(i, j, values, right, scene.symbol)
        before, mu = mu, scene.heft * found[n:]
    return found[:n], mu, jnp.max(jnp.abs(mu - before))


def factorise(scene: Scene, system: AbstractSystem, state: rx.State) -> SparseFactorisation:
    """The sparse factorisation of a scene at a state."""

    def along(seed: Array) -> Array:
        return jax.jvp(lambda d: system.constraint(state.q + d, state.t), (jnp.zeros_like(seed),), (seed,))[1]

    compressed = jax.vmap(along)(jnp.asarray(scene.seeds))
    entries = compressed[scene.colour[scene.columns], scene.rows]
    entries = entries * scene.coordinates[scene.columns] / scene.row_scale[scene.rows]
    values = jnp.concatenate([scene.mass, entries, entries, -SHIFT * scene.weight])
    force = scene.coordinates * system.load(state)
    gamma = along_motion(system, state).gamma / scene.row_scale
    a, mu, growth = (x[..., 0] if x.ndim else x for x in _passes(scene, values, force[:, None], gamma[:, None]))
    rows = jnp.zeros_like(gamma).at[scene.rows].add(entries * a[scene.columns])
    pull = jnp.zeros_like(a).at[scene.columns].add(entries * mu[scene.rows])
    off = jnp.max(jnp.abs(rows - gamma)) / jnp.max(jnp.abs(a))
    unbalanced = jnp.max(jnp.abs(scene.heft * scene.mass * a + pull - force)) / jnp.max(jnp.abs(mu))
    residual = jnp.maximum(jnp.maximum(off, unbalanced), growth / jnp.max(jnp.abs(mu)))
    noise = 1e-12 * jnp.max(jnp.abs(state.qd / scene.coordinates))
    length = jnp.asarray(scene.length)
    return SparseFactorisation(
        scene, values, entries, scene.coordinates * a, mu / scene.row_scale, length, residual, noise
    )


def solution(
    system: AbstractSystem, factor: AbstractSolvedFactorisation, state: rx.State, chosen: Elasticity
) -> Response:
    """Accelerations and multipliers under a closure, with friction by the fixed point (27)."""
    reduced = reduce(system, state, factor, chosen)
    if reduced.problem is None:
        return reduced.response.free
    start = reduced.problem.law(reduced.problem.rho0)
    return reduced.response.at(closed_root(reduced.problem, start, rx.FixedPoint()).tau)


def works(loops: int) -> dict[str, tuple[rx.Mechanism, rx.State, object]]:
    """Mechanism, state and closure of each line of the table."""
    rng = np.random.default_rng(4)
    row, crank = rx.mechanisms.n_four_bar(loops), rx.mechanisms.parallelogram(loops + 2)
    rubbing = rx.mechanisms.parallelogram(loops + 2, mu_rho=1e-4)
    rows = len(crank.rows)
    elastic = rx.Compliance(np.diag(rng.uniform(1e-9, 3e-9, rows)), 1e-5 * rng.normal(size=rows))
    return {
        f"{loops} four-bars in a row": (row, row.state(0.8, rate=1.0), rx.MinimumNorm()),
        f"{loops + 2} cranks": (crank, crank.state(0.8, rate=1.0), rx.MinimumNorm()),
        f"{loops + 2} cranks, elastic, misfit": (crank, crank.state(0.8, rate=1.0), elastic),
        f"{loops + 2} cranks, friction": (rubbing, rubbing.state(0.8, rate=1.0), rx.MinimumNorm()),
    }


def compare(system: rx.Mechanism, state: rx.State, closure, repeats: int) -> tuple[list[float], list[float], float]:
    """Seconds of the dense and the sparse way; errors of accelerations and multipliers; the residual."""
    chosen = elasticity(closure, system, state)
    scene = Scene(system, state, chosen.compliance)

    @jax.jit
    def dense(state: rx.State) -> tuple[Array, Array]:
        found = rx.solve(system, state, closure=closure)
        return found.acceleration, found.multipliers

    @jax.jit
    def sparse(state: rx.State) -> tuple[Array, Array, Array]:
        factor = factorise(scene, system, state)
        return *solution(system, factor, state, chosen), factor.residual

    true, found = dense(state), sparse(state)
    errors = [float(jnp.max(jnp.abs(x - y)) / jnp.max(jnp.abs(x))) for x, y in zip(true, found, strict=False)]
    return times([partial(dense, state), partial(sparse, state)], repeats), errors, float(found[2])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--loops", type=int, default=40, help="number of loops of each scene")
    parser.add_argument("--repeats", type=int, default=50, help="timed calls of each way")
    given = parser.parse_args()
    prepare()
    print(f"{'':32} {'dense':>9} {'sparse':>9} {'ratio':>6}  {'a':>7} {'lam':>7} {'residual':>8}")
    for name, work in works(given.loops).items():
        seconds, errors, residual = compare(*work, given.repeats)
        dense, sparse = (1e3 * value for value in seconds)
        figures = f"{errors[0]:7.0e} {errors[1]:7.0e} {residual:8.0e}"
        print(f"{name:32} {dense:6.2f} ms {sparse:6.2f} ms {dense / sparse:6.1f}  {figures}")


if __name__ == "__main__":
    main()
