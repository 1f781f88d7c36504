"""Ways to solve the frictionless equations (7) with minimum-norm multipliers: time against error.

    M qdd + Phi_q^T lam = Q,   Phi_q qdd = gamma

    python benchmarks/pseudoinverses.py [--repeats N] [--smallest] [--json FILE] [--png FILE]

The mechanisms and their truth at 50 digits are those of `benchmarks.hard_cases`. The NumPy and SciPy routes are given
the exact equations, rounded, and take the tolerance of the textbooks for the rank: size times eps times the largest
singular value; they scale neither rows nor columns. redundax is given the mechanism and the state, makes the equations
itself, decides and judges the rank and checks its answer; all of that is in its time. Errors are relative to the
largest true value of the kind (linear, angular, force, moment); `rounding` is what rounding the inputs, or the drift
of the state, does to the exact answer. Times are medians of calls in turn, per solve: alone, and in a batch of 1000
copies where a batched form exists.
"""

import argparse
import dataclasses
import json
import os
import pathlib
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from benchmarks._devices import prepare

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
prepare()

import jax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import scipy.linalg  # noqa: E402

import redundax as rx  # noqa: E402
from benchmarks.hard_cases import _library, _truth  # noqa: E402
from benchmarks.hard_cases._case import Case, difference, equations_near, neighbours  # noqa: E402
from benchmarks.hard_cases._routes import Truth  # noqa: E402
from benchmarks.hard_cases.families import _common, drift, singular, units  # noqa: E402
from benchmarks.sweeps._measure import times  # noqa: E402

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EPS, BATCH = 2.0**-52, 1000
# Of the regularised routes, relative to the largest diagonal entry of C: sqrt(eps), where what is neglected meets
# the rounding of the null direction, which grows as 1 / SHIFT.
SHIFT = 1.5e-8
Answer = tuple[np.ndarray, np.ndarray, object]  # qdd (b, n), lam (b, m), rank or None


def mechanisms() -> dict[str, Case]:
    """Well- and ill-conditioned mechanisms, n = m = 12 of rank 11."""
    off = {"disturb": partial(drift.moved, size="1e-8"), "size": 1e-8}
    return {
        "the paper's mechanism": _common.paper("pinv", "paper", (), friction=False),
        "lengths x 1e4": units.in_length("1e4", friction=False),
        "mass ratio 1e8": units.with_masses("1e8", friction=False),
        "1e-3 from singular": singular.three("1e-3"),
        "1e-6 from singular": singular.three("1e-6"),
        "state off by 1e-8": _common.paper("pinv", "off", (), friction=False, options=off),
    }


# Routes: (M, Phi_q, Q, gamma) of a batch -> qdd, lam, rank ---------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Equations:
    """M (b, n) diagonal, Phi_q (b, m, n), Q (b, n), gamma (b, m)."""

    mass: np.ndarray
    jacobian: np.ndarray
    load: np.ndarray
    gamma: np.ndarray

    @property
    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """A (b, n + m, n + m) and b (b, n + m)."""
        count, m, n = self.jacobian.shape
        matrix = np.zeros((count, n + m, n + m))
        matrix[:, range(n), range(n)] = self.mass
        matrix[:, n:, :n], matrix[:, :n, n:] = self.jacobian, self.jacobian.mT
        return matrix, np.concatenate([self.load, self.gamma], axis=1)

    @property
    def reduced(self) -> tuple[np.ndarray, np.ndarray]:
        """C = Phi_q M^-1 Phi_q^T and the right side of C lam = Phi_q M^-1 Q - gamma."""
        weighted = self.jacobian / self.mass[:, None]
        return weighted @ self.jacobian.mT, apply(weighted, self.load) - self.gamma

    @property
    def weighted(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """B = Phi_q M^-1/2, y0 = M^-1/2 Q, and M^1/2."""
        root = np.sqrt(self.mass)
        return self.jacobian / root[:, None], self.load / root, root

    def accelerations(self, multipliers: np.ndarray) -> np.ndarray:
        """M^-1 (Q - Phi_q^T lam)."""
        return (self.load - apply(self.jacobian.mT, multipliers)) / self.mass


def apply(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A x for a batch of both."""
    return (matrix @ vector[..., None])[..., 0]


def whole(given: Equations) -> Answer:
    """A^+ b by SVD."""
    matrix, right = given.whole
    u, sigma, vh = np.linalg.svd(matrix)
    kept = sigma > matrix.shape[-1] * EPS * sigma[:, :1]
    x = apply(vh.mT, np.where(kept, apply(u.mT, right) / np.where(kept, sigma, 1.0), 0.0))
    n = given.load.shape[1]
    return x[:, :n], x[:, n:], kept[0].sum() - n


def reduced(given: Equations) -> Answer:
    """C^+ by eigenvalues: the condition number is squared."""
    matrix, right = given.reduced
    values, vectors = np.linalg.eigh(matrix)
    kept = values > matrix.shape[-1] * EPS * values[:, -1:]
    lam = apply(vectors, np.where(kept, apply(vectors.mT, right) / np.where(kept, values, 1.0), 0.0))
    return given.accelerations(lam), lam, kept[0].sum()


def weighted(given: Equations) -> Answer:
    """B^+ by SVD, which gives accelerations and multipliers both."""
    matrix, y0, root = given.weighted
    u, sigma, vh = np.linalg.svd(matrix, full_matrices=False)
    kept = sigma > max(matrix.shape[1:]) * EPS * sigma[:, :1]
    inverse = (vh.mT * np.where(kept, 1 / np.where(kept, sigma, 1.0), 0.0)[:, None]) @ u.mT
    change = apply(inverse, given.gamma - apply(matrix, y0))
    return (y0 + change) / root, -apply(inverse.mT, change), kept[0].sum()


def pivoted(given: Equations) -> Answer:
    """QR of B^T with pivoting, and a second QR for the minimum norm; one after the other."""
    found = [_pivoted(*rows) for rows in zip(*given.weighted, given.gamma, strict=True)]
    qdd, lam, ranks = zip(*found, strict=True)
    return np.stack(qdd), np.stack(lam), ranks[0]


def _pivoted(matrix: np.ndarray, y0: np.ndarray, root: np.ndarray, gamma: np.ndarray) -> tuple:
    q, r, order = scipy.linalg.qr(matrix.T, mode="economic", pivoting=True, check_finite=False)
    diagonal = np.abs(np.diagonal(r))
    rank = np.sum(diagonal > max(matrix.shape) * EPS * diagonal[0])
    q, r = q[:, :rank], r[:rank]
    solve = partial(scipy.linalg.solve_triangular, check_finite=False)
    change = solve(r[:, :rank], gamma[order[:rank]], trans="T") - q.T @ y0
    v, t = scipy.linalg.qr(r.T, mode="economic", check_finite=False)
    lam = np.empty(len(gamma))
    lam[order] = -v @ solve(t, change, trans="T")
    return (y0 + q @ change) / root, lam, rank


def bordered(given: Equations) -> Answer:
    """LU of A bordered by a basis N of null(Phi_q^T), so that N^T lam = 0; the basis by SVD."""
    matrix, right = given.whole
    u, sigma, _ = np.linalg.svd(given.jacobian)
    rank = np.sum(sigma[0] > max(given.jacobian.shape[1:]) * EPS * sigma[0, 0])
    basis, (count, size), n = u[:, :, rank:], right.shape, given.load.shape[1]
    more = basis.shape[-1]
    edged = np.zeros((count, size + more, size + more))
    edged[:, :size, :size] = matrix
    edged[:, n:size, size:], edged[:, size:, n:size] = basis, basis.mT
    x = np.linalg.solve(edged, np.concatenate([right, np.zeros((count, more))], axis=1)[..., None])[..., 0]
    return x[:, :n], x[:, n:size], rank


def _shift(matrix: np.ndarray) -> np.ndarray:
    """SHIFT times the largest diagonal entry of C (b, m, m), times the identity."""
    largest = np.max(np.diagonal(matrix, axis1=1, axis2=2), axis=1)
    return SHIFT * largest[:, None, None] * np.eye(matrix.shape[-1])


def regular_lu(given: Equations, refinements: int = 0) -> Answer:
    """LU of A with -eps I in place of the zero block, refined with the residual of A."""
    matrix, right = given.whole
    n = given.load.shape[1]
    shifted = matrix.copy()
    shifted[:, n:, n:] = -_shift(given.reduced[0])
    inverse = np.linalg.inv(shifted)
    x = apply(inverse, right)
    for _ in range(refinements):
        x = x + apply(inverse, right - apply(matrix, x))
    return x[:, :n], x[:, n:], None


def regular_cholesky(given: Equations, refinements: int = 0) -> Answer:
    """Cholesky of C + eps I, refined with the residual of C."""
    matrix, right = given.reduced
    inverse = np.linalg.inv(np.linalg.cholesky(matrix + _shift(matrix)))
    lam = apply(inverse.mT, apply(inverse, right))
    for _ in range(refinements):
        lam = lam + apply(inverse.mT, apply(inverse, right - apply(matrix, lam)))
    return given.accelerations(lam), lam, None


ROUTES: dict[str, Callable[[Equations], Answer]] = {
    "pinv of A, SVD": whole,
    "pinv of C, eigh": reduced,
    "pinv of B, SVD": weighted,
    "QR of B, pivoted": pivoted,
    "bordered LU": bordered,
    "LU, regularised": regular_lu,
    "LU, regularised, refined": partial(regular_lu, refinements=2),
    "Cholesky, regularised": regular_cholesky,
    "Cholesky, reg., refined": partial(regular_cholesky, refinements=2),
}
ALONE = ("QR of B, pivoted",)  # no batched form


def _factorised(system: rx.AbstractSystem, state: rx.State) -> tuple:
    factor = rx.factorize(system, state)
    return factor.acceleration, factor.multipliers - factor.self_stress @ factor.multipliers, factor.spectrum.rank


def _solved(system: rx.AbstractSystem, state: rx.State) -> tuple:
    solution = rx.solve(system, state)
    return solution.acceleration, solution.multipliers, solution.stats.spectrum.rank


# One compiled program for all mechanisms of the same joints.
_COMPILED = {
    "redundax, factorize": jax.jit(jax.vmap(_factorised, in_axes=(None, 0))),
    "redundax, solve": jax.jit(jax.vmap(_solved, in_axes=(None, 0))),
}


# What is measured --------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Row:
    """A route on a mechanism: seconds per solve alone and in a batch, errors, rank found, and what rounding does."""

    mechanism: str
    route: str
    seconds: float
    batched: float | None
    accelerations: float
    multipliers: float
    rank: int | None
    rounding: float

    @property
    def error(self) -> float:
        """The larger one."""
        return float(np.maximum(self.accelerations, self.multipliers))


def measure(cases: dict[str, Case], repeats: int = 30, batch: int = BATCH) -> Iterable[Row]:
    """All routes on each mechanism."""
    for name, case in cases.items():
        judge, rounding = _judge(case)
        routes, alone, together = zip(*_programs(case, batch), strict=True)
        seconds = times(alone, repeats)
        batched = iter(times([run for run in together if run], max(repeats // 6, 3)))
        for route, run, one, many in zip(routes, alone, seconds, together, strict=True):
            qdd, lam, rank = run()
            errors = judge(np.asarray(qdd)[0], np.asarray(lam)[0])
            found = None if rank is None else int(np.ravel(rank)[0])
            yield Row(name, route, one, next(batched) / batch if many else None, *errors, found, rounding)


def _programs(case: Case, batch: int) -> Iterable[tuple[str, Callable, Callable | None]]:
    """Name, one solve, and a batch of copies."""
    given = case.given
    mass = np.diagonal(_library.exact.floats(given.mass_matrix))
    parts = (mass, *(_library.exact.floats(x) for x in (given.jacobian, given.load, given.gamma)))
    one, many = (Equations(*(np.repeat(part[None], count, 0) for part in parts)) for count in (1, batch))
    for name, route in ROUTES.items():
        yield name, partial(route, one), None if name in ALONE else partial(route, many)
    system, state = _library.build(case)
    system = system.anonymous
    one, many = (jax.tree.map(lambda x, count=count: jnp.repeat(x[None], count, 0), state) for count in (1, batch))
    for name, route in _COMPILED.items():
        yield name, partial(route, system, one), partial(route, system, many)


def _judge(case: Case) -> tuple[Callable[[np.ndarray, np.ndarray], tuple[float, float]], float]:
    """Errors of accelerations and multipliers of an answer, and the change of the exact one by rounding."""
    (answer,) = Truth().answers(case, case.exact, case.parameters)
    scale = _truth.scales(case, answer, case.kinds)
    size = max(EPS, case.size)
    around = [*neighbours(case, size, 3), *equations_near(case, size, 3)]
    limit = _truth.bound(size, around, answer, scale, case.kinds, Truth().near(case))

    def errors(qdd: np.ndarray, lam: np.ndarray) -> tuple[float, float]:
        found = {"acceleration": qdd, "multipliers": lam, "friction": np.zeros(0)}
        kinds = _truth.per_kind(difference(answer, found), scale, case.kinds)
        return max(kinds["linear"], kinds["angular"]), max(kinds["force"], kinds.get("moment", 0.0))

    return errors, max(limit.values())


# Table and diagram -------------------------------------------------------------------------------------------------


def line(row: Row) -> str:
    """A line of the table."""
    batched = f"{1e6 * row.batched:10.2f}" if row.batched else " " * 10
    rank = "" if row.rank is None else row.rank
    errors = "".join(
        f"{error:14.0e}" if np.isfinite(error) else f"{'flagged':>14}" for error in (row.accelerations, row.multipliers)
    )
    return f"{row.mechanism:24}{row.route:26}{1e6 * row.seconds:10.0f}{batched}{errors}{rank:>6}{row.rounding:10.0e}"


_NAMES = ("us alone", 10), ("us batch", 10), ("accelerations", 14), ("multipliers", 14), ("rank", 6), ("rounding", 10)
HEAD = f"{'mechanism':24}{'route':26}" + "".join(f"{name:>{width}}" for name, width in _NAMES)

# Colours of Okabe and Ito; what differs in colour differs in shape too, and refined routes are filled.
STYLES = {
    "pinv of A, SVD": ("s", "#222222", "none"),
    "pinv of C, eigh": ("D", "#D55E00", "none"),
    "pinv of B, SVD": ("^", "#009E73", "none"),
    "QR of B, pivoted": ("v", "#CC79A7", "none"),
    "bordered LU": ("P", "#E69F00", "none"),
    "LU, regularised": ("<", "#56B4E9", "none"),
    "LU, regularised, refined": ("<", "#56B4E9", "#56B4E9"),
    "Cholesky, regularised": (">", "#999999", "none"),
    "Cholesky, reg., refined": (">", "#999999", "#999999"),
    "redundax, factorize": ("o", "#0072B2", "none"),
    "redundax, solve": ("o", "#0072B2", "#0072B2"),
}
LEAST, MOST = 1e-17, 1e4


def figure(rows: Sequence[Row]) -> "Figure":
    """A panel for each mechanism: a large mark for one solve alone, a small one for a solve of a batch."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(row.mechanism for row in rows))
    columns = min(len(names), 3)
    lines = -(-len(names) // columns)
    out = Figure(figsize=(1.0 + 3.3 * columns, 1.6 + 2.7 * lines), layout="constrained", dpi=130)
    panels = out.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    for axes, name in zip(panels.flat, names, strict=False):
        _panel(axes, [row for row in rows if row.mechanism == name], name)
    for axes in panels[-1]:
        axes.set_xlabel("largest relative error (-)")
    for axes in panels[:, 0]:
        axes.set_ylabel("time per solve (s)")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    title = (
        "large marks: one solve alone; small ones: a batch of 1000; shaded: wrong by 10 %, at the end by 1e3 or more"
    )
    style = {"frameon": False, "fontsize": 8.5, "title_fontsize": 8.5}
    out.legend(handles, labels, loc="outside lower center", ncols=min(columns + 1, 4), title=title, **style)
    return out


def _panel(axes, rows: Sequence[Row], name: str) -> None:
    """Errors beyond the axis, and answers that are not numbers, stand at its end."""
    axes.axvspan(1e-1, MOST, color="#D55E00", alpha=0.08, linewidth=0)
    axes.axvline(rows[0].rounding, color="#222222", linewidth=1.0, linestyle="--", label="rounding of the inputs")
    for row in rows:
        marker, color, face = STYLES[row.route]
        x = float(np.clip(row.error if np.isfinite(row.error) else MOST, 2 * LEAST, MOST / 3))
        style = {"color": color, "marker": marker, "markerfacecolor": face, "linestyle": "none"}
        if row.batched:
            axes.plot([x, x], [row.seconds, row.batched], color=color, linewidth=0.6, alpha=0.7)
            axes.plot(x, row.batched, markersize=3.5, markeredgewidth=0.9, **style)
        axes.plot(x, row.seconds, markersize=7.5, markeredgewidth=1.3, label=row.route, **style)
    axes.set(xscale="log", yscale="log", xlim=(LEAST, MOST), title=name)
    axes.set_xticks([10.0**k for k in range(-16, 4, 4)])
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.minorticks_off()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=30, help="calls of one solve that are timed")
    parser.add_argument("--smallest", action="store_true", help="one mechanism, a call, and a batch of two")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="write every line")
    parser.add_argument("--png", type=pathlib.Path, metavar="FILE", help="write the diagram")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(HEAD)
    given, repeats, batch = mechanisms(), arguments.repeats, BATCH
    if arguments.smallest:
        given, repeats, batch = dict([*given.items()][:1]), 1, 2
    rows = []
    for row in measure(given, repeats, batch):
        rows.append(row)
        print(line(row), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps([dataclasses.asdict(row) for row in rows], indent=1))
    if arguments.png:
        figure(rows).savefig(arguments.png)


if __name__ == "__main__":
    main()
