"""The suite of hard cases: no silent wrong answer, and at most 1 % of false flags.

`python -m benchmarks.hard_cases` prints it; the mathematics of its truth is tested here too.
"""

import dataclasses
import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from mpmath import mp
from truth import exact, friction, scenes

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.hard_cases._case import equations_near, neighbours, reframed
from benchmarks.hard_cases._library import build
from benchmarks.hard_cases._report import passes, troubles
from benchmarks.hard_cases._routes import ROUTES
from benchmarks.hard_cases._run import DTYPES, judged, run
from benchmarks.hard_cases.families import FAMILIES

pytestmark = pytest.mark.filterwarnings("ignore:Argument `(misfit|W)` looks:UserWarning")


def check(lines):
    assert lines
    assert passes(lines), "\n" + troubles(lines)


@pytest.mark.parametrize("family", ["drift", pytest.param("folds", marks=pytest.mark.slow)])
def test_selection(family):
    """Some cases of some families in float64, on the default route or, of closures, the closure."""
    cases = FAMILIES[family].cases(quick=True)
    route = "compliance" if family == "closures" else "decided"
    chosen = [case for case in cases if route in case.routes]
    check([*run(chosen[:: max(1, len(chosen) // 4)], ["float64"], [route], draws=2)])


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_every_route(family):
    """Every eighth case in float64; what float32 is worth the command tells, with 6 % of flags without need."""
    check([*run(FAMILIES[family].cases(quick=True)[::8], ["float64"])])
    jax.clear_caches()


# The suite itself ---------------------------------------------------------------------------


def smooth_case():
    return next(case for case in FAMILIES["units"].cases(quick=True) if not case.friction)


def test_a_wrong_answer_is_called_wrong():
    case = smooth_case()
    [line] = run([case], ["float64"], ["decided"], draws=2)
    assert line.verdict == "ok"
    found = ROUTES["decided"].run(case, *build(case))
    for part, factor, rank, verdict in (
        ("acceleration", 1 + 1e-12, 11, "SILENT WRONG"),
        ("multipliers", 1 + 1e-12, 11, "SILENT WRONG"),
        ("multipliers", np.nan, 11, "SILENT WRONG"),
        ("multipliers", 1, 12, "SILENT WRONG"),
        ("multipliers", 1, 11, "ok"),
    ):
        spoilt = dataclasses.replace(found, rank=rank, values={**found.values, part: factor * found.values[part]})
        assert judged(case, ROUTES["decided"], "float64", spoilt, 2).verdict == verdict
    flagged = dataclasses.replace(found, result="The rank cannot be decided")
    assert judged(case, ROUTES["decided"], "float64", flagged, 2).verdict == "false flag"


@exact.exactly
def test_neighbours_keep_the_redundancy_and_are_near():
    for case in (smooth_case(), FAMILIES["closures"].cases(quick=True)[2]):
        for around in (neighbours, equations_near):
            for _, mechanism in around(case, 1e-7, 3):
                assert mp.norm(mechanism.jacobian.T * exact.selfstress(mechanism.jacobian, case.exact.rank)) < 1e-45
                assert 0 < mp.norm(mechanism.jacobian - case.exact.jacobian) < 1e-5
        moved = reframed(case.exact, 1e-3, np.random.default_rng(0))
        assert mp.norm(exact.constraints(moved, moved.q, moved.t)) < 1e-45
        assert mp.norm(moved.jacobian * mp.matrix(list(moved.qd)) + exact.time_rate(moved, moved.t)) < 1e-45


# All solutions of the frictional equations --------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1])
def test_all_roots_of_separate_quadratics(seed):
    """y1^2 = |(1, 0) + (1/2, 0) y1|^2 has y1 = 2 and -2/3; y2^2 = 9 |(1, 0)|^2 has 3 and -3."""
    offset = np.array([[1.0, 0.0], [3.0, 0.0]])
    forces = np.zeros((2, 2, 2))
    forces[0, 0, 0] = 0.5
    ends = friction.all_roots(offset, forces, seed)
    roots = sorted(tuple(np.round(root.real, 9)) for root in ends[:, 1:] / ends[:, :1])
    assert np.allclose(roots, sorted((a, b) for a in (2, -2 / 3) for b in (3, -3)))


@pytest.mark.parametrize(("phi", "rate", "level", "count"), [
    ("1/2", 1, "1/50", 1), ("1/4", 3, "29/200", 4), ("31/10", -1, "3/20", 4), ("11/5", -1, "7/50", 2),
    ("1/2", 1, "1/2", 0),
])  # fmt: skip
def test_number_of_solutions(phi, rate, level, count):
    """The count does not depend on the random numbers, and every one solves the equations to 40 digits."""
    mechanism = scenes.wojtyra2020(phi=phi, rate=rate, mu_rho=level)
    for seed in range(3):
        found = friction.solutions(mechanism, seed=seed)
        assert len(found) == count
        for solution in found:
            assert max(exact.residuals(mechanism, solution)) < 1e-38 * max(abs(x) for x in solution.multipliers)


def test_open_newton_ends_at_a_solution():
    mechanism = scenes.wojtyra2020()
    solution = friction.open_newton(mechanism, [1] * 24)
    assert max(exact.residuals(mechanism, solution)) < 1e-38
    assert abs(solution.acceleration[8] + mp.mpf("36.75")) < 0.01  # printed in Table 4


def test_contraction_of_one_joint():
    """Gamma of a single frictional joint is mu_rho |dR/dtau|."""
    mechanism = scenes.wojtyra(scenes.wojtyra_parameters(mu_rho=(0, "1/50", 0, 0)))
    _, slope = friction.reduced(mechanism)
    wanted = float(mechanism.revolutes[1].mu_rho * mp.hypot(slope[2, 1], slope[3, 1]))
    assert friction.contraction(mechanism) == pytest.approx(wanted, rel=1e-12)


def test_dtypes():
    assert {name: float(np.finfo(name).eps) for name in DTYPES} == DTYPES
    assert jax.config.read("jax_enable_x64")
