"""Computed figures against printed ones: what differs, and whether the difference is accounted for.

A figure differs where the computed value, rounded to the printed digits, is not the printed one. For
Table 4 the printed rows are placed on the one-parameter set of solutions first: the moment in guide K is
the coordinate, and an interval of it is sought in which all figures of a row hold at once.
"""

import dataclasses

import numpy as np

from ._printed import ROUNDINGS, SWAPPED, TABLES
from ._tables import Table, failures, with_guide_moment

# Largest error of a known rounding, in units of the last printed digit.
_ROUNDING = 0.55
# How far an end point may lie from the set of solutions, relative to the size of each kind of figure.
_ON_SET = 1e-10


@dataclasses.dataclass(frozen=True)
class Placement:
    """Where printed rows and end points of Table 4 lie on the set of solutions.

    - `low`, `high`: moments in guide K between which all printed figures of a row hold, shape (rows,).
    - `values`: the solution halfway, shape (rows, entries).
    - `differs`: mask of the printed figures that differ from it.
    - `distance`: of the computed end points from the solution that has their moment in guide K, relative.
    """

    low: np.ndarray
    high: np.ndarray
    values: np.ndarray
    differs: np.ndarray
    distance: np.ndarray


@dataclasses.dataclass(frozen=True)
class Comparison:
    """A computed table beside the printed one.

    - `table`: the computed table.
    - `differs`: mask of the printed figures that differ from it, shape (rows, entries).
    - `problems`: failed solves and differences that nothing explains, in words.
    - `placement`: for Table 4.
    """

    table: Table
    differs: np.ndarray
    problems: tuple[str, ...]
    placement: Placement | None = None


def compare(table: Table) -> Comparison:
    """Compare a computed table with the printed one."""
    words = [list(row.words) for row in table.printed.rows]
    differs = differences(words, table.values)
    problems = [f"{table.printed.key}, {message}" for message in table.failures]
    if table.printed.key == "table4":
        placement, unsolved = _placement(table, words)
        problems += [f"table4, solution with the printed moment, {message}" for message in unsolved]
        problems += _unexplained(table, words, placement.values, placement.differs)
        problems += [
            f"table4, {table.printed.case(row)}: the end point lies off the set of solutions"
            for row in np.flatnonzero(~(placement.distance < _ON_SET)).tolist()
        ]
        return Comparison(table, differs, tuple(problems), placement)
    key, first, second = SWAPPED
    right = [list(row) for row in words]
    if table.printed.key == key:
        forces = table.groups["forces"]
        right[first][forces], right[second][forces] = words[second][forces], words[first][forces]
    problems += _unexplained(table, right, table.values, differences(right, table.values))
    return Comparison(table, differs, tuple(problems))


def reproduced() -> tuple[int, int]:
    """Printed figures that are computed alike, those of swapped rows put right, and all of them."""
    total = sum(len(row.words) for printed in TABLES.values() for row in printed.rows)
    return total - len(ROUNDINGS), total


def check(key: str, row: int, names: tuple[str, ...], values: np.ndarray) -> list[str]:
    """Names of the figures of one row that do not round to the printed ones."""
    return [names[column] for column in np.flatnonzero(differences([list(TABLES[key].rows[row].words)], values[None]))]


def digits(word: str) -> int:
    """Number of decimals of a printed figure."""
    return len(word.partition(".")[2])


def differences(words: list[list[str]], values: np.ndarray) -> np.ndarray:
    """Mask of the values that do not round to the printed figures."""
    return np.array(
        [
            [round(float(v), digits(w)) != float(w) for w, v in zip(*row, strict=True)]
            for row in zip(words, values, strict=True)
        ]
    )


def _unexplained(table: Table, words: list[list[str]], values: np.ndarray, differs: np.ndarray) -> list[str]:
    problems = []
    for row, column in np.argwhere(differs).tolist():
        word, value, entry = words[row][column], values[row, column], table.entries[column]
        known = (table.printed.key, row, entry) in ROUNDINGS
        if not (known and abs(value - float(word)) < _ROUNDING * 10.0 ** -digits(word)):
            case = table.printed.case(row)
            problems.append(f"{table.printed.key}, {case}: {entry} printed {word}, computed {value:.10g}")
    return problems


def _placement(table: Table, words: list[list[str]]) -> tuple[Placement, tuple[str, ...]]:
    """Place the printed rows and the end points of Table 4 on the set of solutions."""
    rows, guide = table.printed.rows, table.entries.index("K.angle")
    cases = [table.printed.case(row) for row in range(len(rows))]
    u = [float(row.u) for row in rows]
    printed = np.array([[float(word) for word in row] for row in words])
    moment = printed[:, guide]
    values, slope, first = with_guide_moment(u, moment)
    half = np.array([[0.5 * 10.0 ** -digits(word) for word in row] for row in words])
    for key, row, entry in ROUNDINGS:
        if key == table.printed.key:
            half[row, table.entries.index(entry)] = np.inf
    low, high = _interval(printed - values, slope, half)
    values, _, second = with_guide_moment(u, moment + (low + high) / 2)
    own, _, third = with_guide_moment(u, table.values[:, guide])
    placement = Placement(moment + low, moment + high, values, differences(words, values), _distance(table, own))
    return placement, (*failures(cases, first), *failures(cases, second), *failures(cases, third))


def _interval(error: np.ndarray, slope: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes of the coordinate for which |error - slope change| <= half in all columns; 0, 0 if none."""
    steep = np.where(slope == 0, 1.0, slope)
    ends = np.stack([(error - half) / steep, (error + half) / steep])
    ends = np.where(slope == 0, [[[-np.inf]], [[np.inf]]], ends)
    low, high = np.max(np.min(ends, axis=0), axis=1), np.min(np.max(ends, axis=0), axis=1)
    return np.where(low <= high, low, 0.0), np.where(low <= high, high, 0.0)


def _distance(table: Table, own: np.ndarray) -> np.ndarray:
    """Largest difference of each row, relative to the largest figure of the same kind."""
    return np.max(
        [
            np.max(np.abs(own - table.values)[:, columns], axis=1) / np.max(np.abs(table.values)[:, columns], axis=1)
            for columns in table.groups.values()
        ],
        axis=0,
    )
