"""Runs batches of random mechanisms and judges every answer."""

import dataclasses
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from truth.description import Structure

import redundax as rx

from . import laws
from .library import NAMES, Answers, Problem, solve
from .recipes import RECIPES
from .samples import FLOATS, Arithmetic, Raw, Scales, derive, raw_numbers
from .structures import draw, duplicated, permuted


def _sample(structure: Structure) -> tuple[bool, np.ndarray]:
    """Whether the rank is the counted one at generic poses, and the median sizes of the slip rates."""
    if structure.rank > structure.n:
        return False, np.zeros(0)
    raw = raw_numbers(structure, 8, np.random.default_rng(0), Scales(0, 0, 0))
    _, _, equations = derive(structure, raw)
    sigma = np.linalg.svd(equations.jacobian / np.linalg.norm(equations.jacobian, axis=2, keepdims=True))[1]
    counted = np.all(np.sum(sigma > 1e-11, axis=1) == structure.rank)
    clear = np.median(sigma[:, structure.rank - 1]) > 1e-3
    return bool(counted and clear), np.median(np.abs(equations.slip_rate), axis=0)


def sound(structure: Structure) -> bool:
    """Whether the rank is the counted one at generic poses and no joint with friction rests."""
    counted, rates = _sample(structure)
    return counted and bool(np.all(rates > 1e-6))


def resting(structure: Structure) -> bool:
    """Whether the rank is the counted one and all joints with friction rest."""
    counted, rates = _sample(structure)
    return counted and bool(np.all(rates < 1e-9))


def structure_of(recipe: str, number: int) -> Structure:
    """The structure of that number of a recipe."""
    return draw(RECIPES[recipe], np.random.default_rng([number, [*RECIPES].index(recipe)]), sound)


def problem(structure: Structure, raw: Raw, real: Arithmetic = FLOATS) -> Problem:
    """The problem with these numbers; parts of a joint in two halves are twice as soft."""
    places = [(structure.joints[k], c if kind == "force" else 2) for k, c, kind in structure.rows]
    compliance = np.stack([raw["compliance"][:, joint.number, c] / joint.share for joint, c in places], axis=1)
    misfit = np.stack([raw["misfit"][:, joint.number, c] for joint, c in places], axis=1)
    return Problem(structure, *derive(structure, raw, real), real.number(compliance), real.number(misfit))


# One batch -------------------------------------------------------------------------------------


@dataclass
class Report:
    """What a run found.

    - `cases`, `structures`: how many; `answers`: solves, variants included.
    - `flags`: answers by result, `clear`: those where no flag is due, `false_flags`: those flagged all the same.
    - `worst`: largest ratio of error to tolerance by law; `residual`: largest relative residual of (7), (25).
    - `violations`: for each law the samples that violate it, as (recipe, number, seed, sample, ratio).
    """

    cases: int = 0
    structures: int = 0
    answers: int = 0
    flags: Counter = field(default_factory=Counter)
    clear: int = 0
    false_flags: int = 0
    worst: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    violations: dict[str, list[tuple]] = field(default_factory=lambda: defaultdict(list))

    def add(self, name: str, judged: laws.Judged, answers: Answers, place: tuple) -> None:
        """Count the answers of one variant of a batch."""
        self.answers += len(answers.result)
        self.flags.update(NAMES[k] for k in answers.result)
        self.clear += int(np.sum(judged.clear))
        self.false_flags += int(np.sum(judged.clear & ~answers.successful))
        for law, ratios in judged.ratios.items():
            self.law(law, ratios, (name, *place))

    def law(self, law: str, ratios: np.ndarray, place: tuple) -> None:
        """Count the ratios of one law; NaN violates it."""
        ratios = np.where(np.isnan(ratios), np.inf, ratios)
        self.worst[law] = max(self.worst[law], float(np.max(ratios)))
        for sample in np.flatnonzero(ratios > 1):
            self.violations[law].append((*place, int(sample), float(ratios[sample])))


def batch(recipe: str, number: int, seed: int, size: int, scales: Scales, report: Report) -> None:
    """Solve a batch of one structure, plain, permuted, and with a joint in two halves in other units; judge all."""
    place = recipe, number, seed
    rng = np.random.default_rng([number, [*RECIPES].index(recipe), seed])
    structure = structure_of(recipe, number)
    raw = raw_numbers(structure, size, rng, scales)
    plain = problem(structure, raw)
    answers = solve(plain)
    judged = laws.judge(plain, answers)
    report.add("plain", judged, answers, place)
    report.cases += size

    other = permuted(structure, rng)
    shuffled = problem(other, raw)
    found = solve(shuffled)
    report.add("permuted", laws.judge(shuffled, found), found, place)
    coordinates, rows = laws.same_places(structure, other)
    back = dataclasses.replace(
        found, acceleration=found.acceleration[:, coordinates], multipliers=found.multipliers[:, rows]
    )
    report.law("permutation", _difference(plain, judged, answers, back), place)

    twice, joint = duplicated(structure, RECIPES[recipe], rng)
    halves = problem(twice, raw)
    units = _units(size, rng)
    found = solve(halves, units)
    report.add("two halves", laws.judge(halves, found), found, place)
    joined = dataclasses.replace(found, multipliers=_joined(structure, twice, joint, found.multipliers))
    ratios = _difference(plain, judged, answers, joined)
    changed = np.asarray(units.length) != 1
    report.law("duplicate", np.where(changed, 0.0, ratios), place)
    report.law("units and duplicate", np.where(changed, ratios, 0.0), place)


def _units(size: int, rng: np.random.Generator) -> rx.units.Units:
    """Random units for every second sample."""
    on = np.arange(size) % 2
    return rx.units.Units(*(jnp.asarray(10.0 ** (on * rng.uniform(-spread, spread, size))) for spread in (3, 2, 3, 2)))


def _joined(structure: Structure, twice: Structure, joint: int, multipliers: np.ndarray) -> np.ndarray:
    """Multipliers of the structure, from those of the one that has the joint in two halves, the second half last."""
    place = {(k, part): row for row, (k, part, _) in enumerate(twice.rows)}
    copy = len(structure.joints)
    return np.stack(
        [
            multipliers[:, place[k, part]] + (multipliers[:, place[copy, part]] if k == joint else 0.0)
            for k, part, _ in structure.rows
        ],
        axis=1,
    )


def _difference(plain: Problem, judged: laws.Judged, answers: Answers, other: Answers) -> np.ndarray:
    """Error of the other answers against the plain ones over the tolerances of both."""
    both = answers.successful & other.successful
    x = laws.scaled(plain).unknown(other)
    error = np.linalg.norm(x - judged.x, axis=1)
    return np.where(both, error / (2 * judged.tolerance), 0.0)
