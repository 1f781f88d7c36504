"""Verdicts on random overconstrained mechanisms against their exact families of solutions.

The oracle, in 50 digits and without the library: the same mechanism with random self-stress added, its friction solved
anew. What is called unique must not move at all, what is called not unique must move, and where each misfit is said to
have one solution other starts must lead to it.
"""

import dataclasses

import jax
import numpy as np
import pytest
from fuzzing import digits, fuzz
from fuzzing.library import mechanisms
from fuzzing.samples import Scales, raw_numbers

import redundax as rx

pytestmark = pytest.mark.filterwarnings("ignore:Argument `(misfit|W)` looks:UserWarning")
SAMPLES = 50
UNIQUE, ZERO, NO_CHANGE, NOT_UNIQUE, UNDECIDED = rx.Verdict
RECIPES = ("loop, doubled pin", "parallel guides", "driven twice", "gears and frames", "smooth")


def whole(parts, kinds):
    """Accelerations, multipliers and frictions from the parts by kind, in the order of the system."""
    rest = {kind: iter(values) for kind, values in parts.items()}
    return np.array([next(rest[kind]) for kind in kinds])


def kinds_of(structure):
    sliding = ["force" if structure.joints[k].kind != "revolute" else "moment" for k in structure.frictional]
    bodies = len(structure.bodies)
    rows = [kind for *_, kind in structure.rows]
    return np.array(["linear"] * 2 * bodies + ["angular"] * bodies + rows + [f"friction {kind}" for kind in sliding])


def family(structure, raw, answer, rng):
    """The exact solution, exact solutions with random self-stress, and exact solutions from other starts."""
    problem = fuzz.problem(structure, raw, digits.DIGITS)
    given, kinds = digits.of(problem), kinds_of(structure)
    n = structure.n
    size = np.array([max(np.abs(answer[kinds == kind]).max(), 1e-3) for kind in kinds])[n : n + structure.m]
    start = answer[n + structure.m :]
    base, moved, again = whole(digits.solution(problem, start, given), kinds), [], []
    for scale in (1e-3, 1e-2, 1.0):
        stress = scale * size * rng.normal(size=size.shape)
        other = dataclasses.replace(problem, misfit=problem.misfit + problem.compliance * stress)
        for to, problem_, guess in (
            (moved, other, start),
            (again, problem, start * rng.uniform(-2, 2, start.shape)),
        ):
            try:
                to.append(whole(digits.solution(problem_, guess, given), kinds))
            except RuntimeError:
                continue  # no solution found there
    return base, np.array(moved), np.array(again), kinds


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RECIPES)
def test_no_wrong_verdict(recipe):
    structure, rng = fuzz.structure_of(recipe, 0), np.random.default_rng(9)
    raw = raw_numbers(structure, SAMPLES, rng, Scales(length=1.0, mass=1.0, time=0.5, friction=0.1))
    problem = fuzz.problem(structure, raw)
    batch = mechanisms(structure, problem.parameters)
    slips = [name for group in batch.friction for name in group.slips.names or ()]
    order = [slips.index(f"joint {k}") for k in structure.frictional]
    counts = dict.fromkeys(rx.Verdict, 0)
    for sample in range(SAMPLES):
        take = jax.tree.map(lambda x, k=sample: x[k] if np.issubdtype(x.dtype, np.inexact) else x, batch)
        state = jax.tree.map(lambda x, k=sample: x[k], problem.state)
        closure = rx.Compliance(problem.compliance[sample], problem.misfit[sample])
        solution = rx.solve(take, state, closure=closure, throw=False)
        if solution.result != rx.RESULTS.successful:
            continue
        report = rx.analyze(take, state, closure=closure)
        assert report.redundancy == structure.redundancy
        judged = [*report.verdicts["acceleration"], *report.verdicts["multiplier"]]
        judged += [report.verdicts["friction"][k] for k in order]
        one = {name: value[sample : sample + 1] for name, value in raw.items()}
        answer = np.concatenate([solution.acceleration, solution.multipliers, solution.friction[np.array(order, int)]])
        base, moved, again, kinds = family(structure, one, answer, rng)
        size = np.array([np.abs(base[kinds == kind]).max() for kind in kinds])
        for k, each in enumerate(judged):
            spread = np.abs(moved[:, k] - base[k]).max(initial=0.0) / (size[k] or 1.0)
            verdict = each.with_friction
            counts[verdict] += 1
            assert verdict is not UNIQUE or spread < 1e-14, (sample, each, spread)
            assert verdict is not NOT_UNIQUE or spread > 1e-14, (sample, each, spread)
        if report.spectral_radius is not None and report.spectral_radius < 1:
            assert np.all(np.abs(again - base) <= 1e-13 * size)
    assert counts[UNIQUE] and counts[NOT_UNIQUE]
