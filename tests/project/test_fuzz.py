"""Random mechanisms: no silent wrong answer.

Structures, geometry, states and loads are random, the redundancy is known by construction. Every answer is judged by
equations written by hand (`fuzzing.laws`) with tolerances from the condition of the problem, compared with that for
permuted bodies and joints, for a joint in two halves and in other units, and a few with 50 digits.
"""

import dataclasses

import numpy as np
import pytest
from fuzzing import digits, faults, fuzz, laws, structures
from fuzzing.library import NAMES, inverse
from fuzzing.recipes import RECIPES, RESTING
from fuzzing.samples import Scales, raw_numbers
from hypothesis import given, settings
from hypothesis import strategies as st

QUICK = ("loop, doubled pin", "smooth")
SLOW = [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in RECIPES]
LARGER = "large", "many cranks"  # joints as in the others, more of them: slow in exact numbers
SIZE = 500  # large enough for the compiler to split a batch among threads


def judged(recipe: str, number: int, seed: int, size: int, scales: Scales) -> fuzz.Report:
    report = fuzz.Report()
    fuzz.batch(recipe, number, seed, size, scales, report)
    return report


@pytest.mark.slow
@pytest.mark.parametrize("recipe", RECIPES)
@settings(max_examples=2, derandomize=True, database=None)
@given(
    number=st.integers(0, 1000),
    seed=st.integers(0, 1000),
    friction=st.sampled_from([0.01, 0.1, 0.5]),
    masses=st.floats(0, 3),
    compliances=st.floats(0, 4),
)
def test_no_answer_violates_a_law(recipe, number, seed, friction, masses, compliances):
    report = judged(recipe, number, seed, SIZE, Scales(friction=friction, masses=masses, compliances=compliances))
    found = {law: places for law, places in report.violations.items() if law != "false flag"}
    assert not found
    assert report.false_flags <= 0.01 * report.clear


@pytest.mark.slow
@pytest.mark.parametrize("recipe", SLOW)
def test_projector_and_inverse_satisfy_penrose(recipe):
    structure = fuzz.structure_of(recipe, 0)
    problem = fuzz.problem(structure, raw_numbers(structure, SIZE, np.random.default_rng(5), Scales(0, 0, 0)))
    stress, x, multipliers = inverse(problem)
    found = laws.judge_inverse(problem, stress, x, multipliers)
    assert {law: float(ratios.max()) for law, ratios in found.items() if not np.all(ratios <= 1)} == {}
    spoiled = laws.judge_inverse(problem, 1.001 * stress, 1.001 * x, multipliers)
    locked = structure.rank == structure.n  # X = 0
    for law in ("P idempotent", "trace P", *(() if locked else ("X generalised inverse", "forces carried"))):
        assert np.mean(spoiled[law] > 1) > 0.9


@pytest.mark.parametrize("closure", ["physical", "minimum norm"])
@pytest.mark.parametrize("recipe", [one for one, name in zip(SLOW, RECIPES, strict=True) if name not in LARGER])
def test_answers_are_near_those_of_50_digits(recipe, closure):
    """As near as the exact answer stays under rounding of the data.

    Minimum norm compares forces with moments in the units given: the projector along which it adds self-stress,
    1 - G W, can be as long as the root of the ratio of the compliances of scaled rows, and magnifies rounding by that.
    """
    structure = fuzz.structure_of(recipe, 0)
    raw = raw_numbers(structure, SIZE, np.random.default_rng(1))
    problem = fuzz.problem(structure, raw)
    answers, soft = fuzz.solve(problem), laws.scaled(problem).soft
    limit = np.sqrt(soft.max(axis=1) / soft.min(axis=1)) if closure == "minimum norm" else np.ones(SIZE)
    wanted = (raw["compliance"].max(axis=(1, 2)) == 1) == (closure == "minimum norm")
    for sample in np.flatnonzero(answers.successful & wanted)[:3]:
        ratios = digits.errors(lambda raw, real: fuzz.problem(structure, raw, real), raw, sample, answers)
        assert max(ratio for ratio, _ in ratios.values()) <= limit[sample], ratios


# Problems spoiled on purpose -------------------------------------------------------------------


@pytest.mark.parametrize("fault", faults.FAULTS)
@pytest.mark.parametrize("recipe", [*QUICK, pytest.param("driven twice", marks=pytest.mark.slow)])
def test_spoiled_samples_are_flagged_and_leave_the_others_alone(recipe, fault):
    spoil, applies, reasons = faults.FAULTS[fault]
    structure, rng = fuzz.structure_of(recipe, 0), np.random.default_rng(3)
    if not applies(structure):
        pytest.skip("does not apply")
    problem = fuzz.problem(structure, raw_numbers(structure, SIZE, rng))
    on = np.arange(SIZE) % 2 == 1
    sound, answers = fuzz.solve(problem), fuzz.solve(faults.mixed(problem, spoil(problem, rng), on))
    assert {NAMES[k] for k in answers.result[on]} <= set(reasons)
    for name in ("acceleration", "multipliers", "tau", "result"):
        assert np.array_equal(getattr(answers, name)[~on], getattr(sound, name)[~on], equal_nan=True), name


@pytest.mark.parametrize("recipe", SLOW)
def test_states_beside_the_manifold_are_flagged_or_harmless(recipe):
    """An error of position acts on the answer as rounding does, only larger; the rank stays."""
    structure, rng = fuzz.structure_of(recipe, 0), np.random.default_rng(4)
    problem = fuzz.problem(structure, raw_numbers(structure, SIZE, rng))
    drift = 10.0 ** rng.uniform(-14, -4, SIZE)
    answers, near = fuzz.solve(problem), fuzz.solve(faults.drifted(problem, drift, rng))
    judged = laws.judge(problem, answers)
    both = answers.successful & near.successful
    error = np.linalg.norm(laws.scaled(problem).unknown(near) - judged.x, axis=1)
    assert np.all(error[both] <= (judged.tolerance * (1 + drift / np.finfo(float).eps))[both])
    assert np.all(near.rank[near.successful] == structure.rank)
    assert np.mean(near.successful[drift < 1e-8]) > 0.99


@pytest.mark.slow
def test_friction_in_a_locked_part_is_flagged():
    rng = np.random.default_rng(0)
    structure = structures.draw(RESTING, rng, fuzz.resting)
    answers = fuzz.solve(fuzz.problem(structure, raw_numbers(structure, SIZE, rng)))
    assert not np.any(answers.successful)


# The laws themselves -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def answered():
    structure = fuzz.structure_of(QUICK[0], 0)
    problem = fuzz.problem(structure, raw_numbers(structure, SIZE, np.random.default_rng(2)))
    return problem, fuzz.solve(problem)


def stressed(problem, a):
    """The answers with a little self-stress more."""
    scaled = laws.scaled(problem)
    stress = scaled.stress.sum(axis=2) / scaled.rows
    size = np.abs(a.multipliers).max(axis=1, keepdims=True) / np.abs(stress).max(axis=1, keepdims=True)
    return dataclasses.replace(a, multipliers=a.multipliers + 1e-6 * size * stress)


SPOILED = {
    "motion": lambda _, a: dataclasses.replace(a, acceleration=a.acceleration * (1 + 1e-6)),
    "kinematics": lambda _, a: dataclasses.replace(
        a, acceleration=a.acceleration + 1e-6 * np.abs(a.acceleration).max()
    ),
    "closure": stressed,
    "rank": lambda _, a: dataclasses.replace(a, rank=a.rank + 1),
    "energy": lambda _, a: dataclasses.replace(a, acceleration=a.acceleration * (1 + 1e-3)),
    "friction law": lambda _, a: dataclasses.replace(a, tau=a.tau * (1 + 1e-6)),
    "dissipation": lambda _, a: dataclasses.replace(a, tau=-a.tau),
    "false flag": lambda _, a: dataclasses.replace(a, result=np.full_like(a.result, 4)),
}


@pytest.mark.parametrize("law", SPOILED)
def test_laws_see_what_breaks_them(law, answered):
    problem, answers = answered
    assert np.max(laws.judge(problem, answers).ratios[law]) <= 1
    spoiled = laws.judge(problem, SPOILED[law](problem, answers)).ratios[law]
    assert np.mean(spoiled > 1) > 0.9
