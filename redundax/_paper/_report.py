"""The study as text for a terminal of 100 columns: printed and computed figures side by side."""

import textwrap

import numpy as np

from .._tools._errors import RedundaxError
from ._compare import Comparison, digits
from ._printed import ROUNDINGS, SWAPPED
from ._tables import Table

WIDTH = 100
_LABEL = 15  # "K.perpendicular"
_PRINTED, _COMPUTED = 7, 9  # width of a printed figure, and of a computed one with the blank before it
_EXTRA = 2  # decimals shown beyond the printed ones

_GROUPS = {
    "linear": "linear accelerations",
    "angular": "angular accelerations",
    "forces": "multipliers: forces",
    "moments": "multipliers: moments",
    "tau": "moments of friction",
}

# What the spread is shown for, with units.
_SPREAD = {
    "1.phi''": "rad/s^2",
    "2.y''": "m/s^2",
    "4.y''": "m/s^2",
    "A.x": "N",
    "B.y": "N",
    "D.x": "N",
    "K.perpendicular": "N",
    "L.perpendicular": "N",
    "K.angle": "N m",
    "tau A": "N m",
}


def heading(version: str) -> str:
    """What is shown and how to read it."""
    return "\n".join(
        [
            f"redundax {version}: the example of Wojtyra, Pekal, Fraczek (2020), Mech. Mach. Theory 153, 103999",
            "",
            _fill(
                "Two cranks, a coupler on them and a slider that guides it: revolute joints A to D, guides K and "
                "L, 12 coordinates, 12 constraints, one of them redundant. All tables are for one state: crank "
                "angle pi/4, crank rate 1 rad/s; friction has mu rho = 0.02 m in A to D."
            ),
            "",
            _fill(
                "Printed and computed figures stand side by side. * marks a computed figure that does not round "
                "to the printed one; the lines below the table say why. 1.x'' is the x-acceleration of body 1, "
                "A.x the multiplier of joint A along x. u is the number of length units in a metre: in m, N, N m "
                "for u = 1, in dm, dN, dN dm for u = 10, in dam, daN, daN dam for u = 0.1; angles are in rad."
            ),
        ]
    )


def table_text(comparison: Comparison) -> str:
    """A table with printed and computed figures side by side, and what explains the differences."""
    title = comparison.table.printed.title
    parts = [f"{title}\n{'=' * len(title)}"]
    if comparison.placement is None:
        parts.append(_figures(comparison, range(len(comparison.table.printed.rows))))
    else:
        parts.append(
            _fill(
                "'same K': the solution with the printed moment in guide K, which tells whether the printed row is "
                "a solution. 'from x0': where Newton's method ends from the stated x0."
            )
        )
        parts += [_figures(comparison, range(3)), _figures(comparison, range(3, 5))]
    if comparison.problems:
        parts.append(_problems(comparison))
    else:
        notes = {"table2": _notes2, "table3": _notes3, "table4": _notes4}
        parts.append(notes[comparison.table.printed.key](comparison))
    return "\n\n".join(parts)


def spread_text(table2: Table, table3: Table, table4: Table) -> str:
    """How far figures vary over the cases of the tables, in metres: what is unique and what is not."""
    frictionless, frictional = table2.metric, np.concatenate([table3.metric, table4.metric])
    lines = [
        "",
        f"{'':24}{'no friction (Table 2)':>24}{'':12}{'friction (Tables 3, 4)':>24}",
        f"{'':24}{'from':>12}{'to':>12}{'':12}{'from':>12}{'to':>12}",
    ]
    for entry, unit in _SPREAD.items():
        line = f"{entry:<16}{unit:<8}"
        for table, values in ((table2, frictionless), (table3, frictional)):
            if entry not in table.entries:
                line += f"{'-':>12}{'-':>12}{'':12}"
                continue
            column = values[:, table.entries.index(entry)]
            low, high = float(np.min(column)), float(np.max(column))
            size = float(np.max(np.abs(values)))
            word = "  the same" if high - low < 1e-11 * size else "  varies"
            line += f"{_number(low, 4):>12}{_number(high, 4):>12}{word:12}"
        lines.append(line.rstrip())
    text = _fill(
        "What that means for the figures. Mechanism and state are the same in all cases of the tables, only h, x0 "
        "and the length unit differ. Below, all in SI units: without friction the motion does not depend on "
        "them; friction that depends on the load hands the freedom of the self-stress on to the motion. These "
        "are the spreads over the paper's cases, not the bounds of what is possible."
    )
    return f"{text}\n" + "\n".join(lines)


def verdict_text(comparisons: list[Comparison]) -> str:
    """One line for each table, and the differences that nothing explains."""
    lines = []
    for comparison in comparisons:
        key, total = comparison.table.printed.key, comparison.differs.size
        known = sum(name == key for name, _, _ in ROUNDINGS)
        what = {
            "table2": f"all {total} printed figures agree, once the two swapped rows of forces are put right",
            "table3": f"{total - known} of {total} printed figures agree to every digit; the other {known} are "
            "off by little more than half a digit",
            "table4": f"all {len(comparison.differs)} printed rows are solutions, {total - known} of {total} "
            f"figures to every digit, the other {known} off by little more than half a digit; Newton's method "
            "from the stated x0 ends elsewhere on the set of solutions",
        }[key]
        if comparison.problems:
            what = f"{len(comparison.problems)} failures or unexplained differences"
        lines.append(_fill(f"{comparison.table.printed.title[:7]}: {what}.", " " * 9))
        if comparison.problems:
            lines.append(_problems(comparison))
    return "\n".join(lines)


def _problems(comparison: Comparison) -> str:
    return "\n".join(_fill(f"! {problem}", "  ") for problem in comparison.problems)


def _figures(comparison: Comparison, rows: range) -> str:
    table, placement = comparison.table, comparison.placement
    columns = [(table.values, comparison.differs, "computed")]
    if placement is not None:
        columns = [(placement.values, placement.differs, "same K"), (*columns[0][:2], "from x0")]
    width = _PRINTED + len(columns) * (_COMPUTED + 1)
    cases = "".join(f"{table.printed.case(row):>{width - 1}} " for row in rows)
    names = f"{'printed':>{_PRINTED}}" + "".join(f"{name:>{_COMPUTED}} " for *_, name in columns)
    lines = [" " * _LABEL + cases, " " * _LABEL + names * len(rows)]
    for group, entries in table.groups.items():
        lines.append(_GROUPS[group])
        for entry in range(entries.start, entries.stop):
            line = f"{table.entries[entry]:<{_LABEL}}"
            for row in rows:
                word = table.printed.rows[row].words[entry]
                line += f"{word:>{_PRINTED}}"
                for values, differs, _ in columns:
                    value = _number(values[row, entry], digits(word) + _EXTRA)
                    line += f"{value:>{_COMPUTED}}{'*' if differs[row, entry] else ' '}"
            lines.append(line)
    lines.append(
        f"{'iterations':<{_LABEL}}" + "".join(f"{table.steps[row]:>{width - 1}} " for row in rows)
        if table.printed.key == "table4"
        else ""
    )
    return "\n".join(line.rstrip() for line in lines).rstrip()


def _notes2(comparison: Comparison) -> str:
    table, (_, first, second) = comparison.table, SWAPPED
    multipliers = slice(table.groups["forces"].start, table.groups["moments"].stop)
    norms = [
        np.linalg.norm([float(word) for word in table.printed.rows[row].words[multipliers]]) for row in (first, second)
    ]
    return _fill(
        f"* The forces of the rows {table.printed.case(first)} and {table.printed.case(second)} stand swapped in "
        "print; accelerations and moments stand right. The print shows it by itself: h = 0 is the answer of "
        f"smallest norm, but its printed multipliers are the longer ones ({norms[0]:.1f} against "
        f"{norms[1]:.1f}). Put right, every figure agrees.",
        "  ",
    )


def _notes3(comparison: Comparison) -> str:
    table = comparison.table
    steps = ", ".join(str(step) for step in table.steps)
    return "\n".join(
        [
            *_roundings(table, table.values),
            "All other figures agree to every printed digit.",
            f"Iterations of (27), tested after every third: {steps}.",
        ]
    )


def _notes4(comparison: Comparison) -> str:
    table, placement = comparison.table, comparison.placement
    if placement is None:
        raise RedundaxError(
            "Argument `comparison` must place the rows, but its `placement` is None. Use the comparison of Table 4."
        )
    guide, crank = table.entries.index("K.angle"), table.entries.index("1.phi''")
    lines = [
        _fill(
            "The solutions form a curve, and the moment in guide K (K.angle) is a coordinate on it. Within the "
            "rounding of that moment all printed figures of a row hold at once (but for one, named below), "
            "so every printed row is a solution; 'same K' is the one in the middle of where they hold."
        ),
        *_roundings(table, placement.values),
        _fill(
            "* 'from x0' is where (35) to (38) end from the stated x0, with the exact derivative G_x: on the same "
            f"curve (to {np.max(placement.distance):.0e} relative), but elsewhere. Which detail of the original "
            "computation led to the printed points is not in print, and nothing here is fitted to reach them.",
            "  ",
        ),
        "",
        f"{'Place on the curve:':<23}{'K.angle':^49}{table.entries[crank]:^26}".rstrip(),
        f"{'':18}{'printed':>9}{'figures hold for':>22}{'from x0':>11}{'apart':>10}{'printed':>14}{'from x0':>11}",
    ]
    for row, case in enumerate(table.printed.rows):
        low, high, end = placement.low[row], placement.high[row], table.values[row]
        lines.append(
            f"{table.printed.case(row):<18}{case.words[guide]:>9}{f'{low:.4f} to {high:.4f}':>22}"
            f"{end[guide]:>11.4f}{end[guide] - (low + high) / 2:>+10.4f}"
            f"{case.words[crank]:>14}{end[crank]:>11.4f}"
        )
    return "\n".join(lines)


def _roundings(table: Table, values: np.ndarray) -> list[str]:
    lines = []
    for key, row, entry in ROUNDINGS:
        if key == table.printed.key:
            column = table.entries.index(entry)
            word, value = table.printed.rows[row].words[column], values[row, column]
            lines.append(
                f"* {entry} at {table.printed.case(row)}: {value:.4f} is printed {word}; the nearest figure "
                f"is {round(float(value), digits(word)):.{digits(word)}f}."
            )
    return lines


def _number(value: float, decimals: int) -> str:
    """Fixed decimals without a sign on zero."""
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"


def _fill(text: str, indent: str = "") -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent=indent)
