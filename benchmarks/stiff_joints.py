"""Closures against what they stand for: the paper's mechanism on stiff, damped, elastic joints, simulated.

    M qdd = Q + F(lam) - Phi_q^T lam,   eps W0 lam = Phi + beta Phi' + eps d0

Every joint is a spring of compliance eps W0 and misfit eps d0 in the frame of a body, as of machine parts at eps = 1e-2
to 1e-4. The motion starts under a strong damping beta, which fades smoothly to a constant times eps, so that it
ends on the slow manifold, without vibration of the joints. There loads and accelerations differ from those of the
closure (W0, d0) at the same crank angle and rate by the quasi-static deflection, O(eps).

    python benchmarks/stiff_joints.py [--smallest] [--json]

The elastic model is the paper's own formulas (tests/support/truth/paper.py) in NumPy with SciPy's Radau IIA; its joints
are assembled here; only the closure is the library's.
"""

import argparse
import json
import pathlib
import sys
from collections.abc import Sequence

import jax
import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "tests" / "support"))

from truth import paper

import redundax as rx

EPSILONS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
START, RATE, FADES, END = 0.3, 8.0, (0.03, 0.2), 0.25  # rad, rad/s, s
DAMPING = 0.5  # beta at the end, eps times, s

# Joint: body of the frame, translational compliance m/N (2, 2), rotational rad/(N m), coupling rad/N, misfit m, m, rad.
_SOFT, _SKEW = np.array([[3.0, 1.0], [1.0, 2.0]]) * 1e-4, np.array([2e-4, -1e-4])
JOINTS = {
    "A": (1, _SOFT, 0.0, np.zeros(2), (4e-2, 2e-2, 0.0)),
    "B": (2, 0.5 * _SOFT, 0.0, np.zeros(2), (0.0, 3e-2, 0.0)),
    "C": (3, 2.0 * _SOFT, 0.0, np.zeros(2), (-2e-2, 0.0, 0.0)),
    "D": (3, _SOFT, 0.0, np.zeros(2), (1e-2, 5e-2, 0.0)),
    "K": (4, _SOFT, 4e-3, _SKEW, (3e-2, 0.0, 0.1)),
    "L": (4, _SOFT, 2e-3, _SKEW, (0.0, -2e-2, -0.1)),
}


def springs(p: paper.Parameters, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """W0 and d0 of the rows of (61) at a position."""
    W, d = np.zeros((12, 12)), np.zeros(12)
    _, phi = paper.split(q)
    for k, (body, shift, turn, cross, misfit) in enumerate(JOINTS.values()):
        R = paper.rotation(phi[body])
        if k < 4:
            rows, directions = [2 * k, 2 * k + 1], np.hstack([R, np.zeros((2, 1))])
        else:
            _, j, *_, normal, _ = paper.translationals(p)[k - 4]
            rows, directions = [k + 4, k + 6], np.zeros((2, 3))
            directions[0, :2], directions[1, 2] = -paper.rotation(phi[j]) @ normal @ R, 1.0
        C = np.block([[shift, cross[:, None]], [cross[None], np.array([[turn]])]])
        W[np.ix_(rows, rows)], d[rows] = directions @ C @ directions.T, directions @ misfit
    return W, d


def loads(p: paper.Parameters, eps: float, beta: float, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Loads and accelerations of the elastic model."""
    W, d = springs(p, q)
    jac = paper.jacobian(p, q)
    lam = np.linalg.solve(W, (paper.constraints(p, q) + beta * jac @ qd) / eps + d)
    force = paper.load(p) + paper.friction(p, lam, qd)[1] - jac.T @ lam
    return lam, force / np.diag(paper.mass(p))


def simulate(eps: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """q, qd, loads and accelerations of the elastic model at the end of its motion."""
    p = paper.Parameters()
    q, qd = paper.configuration(p, START, RATE)
    jac, W = paper.jacobian(p, q), springs(p, q)[0]
    squares = np.linalg.eigvals(jac @ np.linalg.solve(paper.mass(p), jac.T) @ np.linalg.inv(W)).real / eps
    strong, weak = 2 / np.sqrt(np.sort(squares)[1]), DAMPING * eps

    def beta(t: float) -> float:
        x = np.clip((t - FADES[0]) / (FADES[1] - FADES[0]), 0.0, 1.0)
        return strong + (weak - strong) * x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[12:], loads(p, eps, beta(t), y[:12], y[12:])[1]])

    def stiff_part(t: float, y: np.ndarray) -> np.ndarray:
        q, qd = y[:12], y[12:]
        jac, lam = paper.jacobian(p, q), loads(p, eps, beta(t), q, qd)[0]
        stiffness = np.linalg.solve(springs(p, q)[0], jac) / eps
        force = (paper.friction_jacobian(p, lam, qd) - jac.T) @ stiffness
        acceleration = np.linalg.solve(paper.mass(p), force)
        return np.block([[np.zeros((12, 12)), np.eye(12)], [acceleration, beta(t) * acceleration]])

    start = np.concatenate([q, qd])
    run = solve_ivp(rate, (0.0, END), start, "Radau", rtol=1e-6, atol=1e-10, jac=stiff_part)
    q, qd = run.y[:12, -1], run.y[12:, -1]
    return q, qd, *loads(p, eps, weak, q, qd)


def compare(epsilons: Sequence[float] = EPSILONS) -> list[dict[str, float | None]]:
    """For each eps the largest relative differences of forces, moments and accelerations, and the order of forces."""
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    joints = [
        rx.JointCompliance(name, shift, turn, coupling=cross, misfit=misfit, frame=str(body))
        for name, (body, shift, turn, cross, misfit) in JOINTS.items()
    ]
    closure, rows = rx.ElasticJoints(mechanism, joints), []
    for eps in epsilons:
        q, qd, lam, qdd = simulate(eps)
        solution = rx.solve(mechanism, mechanism.state(phi=q[8], rate=qd[8]), closure=closure)
        row: dict[str, float | None] = {"eps": eps}
        for kind, found, true, part in (
            ("force", lam, solution.multipliers, slice(0, 10)),
            ("moment", lam, solution.multipliers, slice(10, 12)),
            ("linear", qdd, solution.acceleration, slice(0, 8)),
            ("angular", qdd, solution.acceleration, slice(8, 12)),
        ):
            true = np.asarray(true)[part]
            row[kind] = float(np.max(np.abs(found[part] - true)) / np.max(np.abs(true)))
        before = rows[-1] if rows else None
        row["order"] = before and float(np.log(before["force"] / row["force"]) / np.log(before["eps"] / eps))
        rows.append(row)
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--smallest", action="store_true", help="the softest joints alone")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = compare(EPSILONS[:1] if arguments.smallest else EPSILONS)
    if arguments.json:
        print(json.dumps(rows, indent=2))
        return
    print("Elastic joints of compliance eps W0, simulated, against the closure: largest relative differences\n")
    print(f"{'eps':>8}{'forces':>12}{'moments':>12}{'linear acc.':>14}{'angular acc.':>14}{'order':>8}")
    for row in rows:
        order = "" if row["order"] is None else f"{row['order']:.2f}"
        print(
            f"{row['eps']:8.0e}{row['force']:12.1e}{row['moment']:12.1e}{row['linear']:14.1e}{row['angular']:14.1e}"
            f"{order:>8}"
        )


if __name__ == "__main__":
    main()
