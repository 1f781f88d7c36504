"""The command: exit status, JSON, and the printed figures of the paper, each accounted for.

The printed figures and the computed ones of `truth.paper` are independent of the package.
"""

import contextlib
import dataclasses
import functools
import io
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from truth import paper

import redundax as rx
from redundax import __main__ as command
from redundax import _paper
from redundax._paper import _compare, _printed, _tables

KINDS = {"linear": 8, "angular": 4, "forces": 10, "moments": 2, "tau": 4}
PRINTED = {"table2": paper.TABLE2, "table3": paper.TABLE3, "table4": paper.TABLE4}
# Figures that are not the nearest of their digits: (table, row, column of [qdd; lam; tau]).
ROUNDED = {("table3", 3, 14), ("table3", 3, 21), ("table4", 3, 21)}
EVERY_ROW = [(key, row) for key, rows in PRINTED.items() for row in range(len(rows))]
every_row = pytest.mark.parametrize(("key", "row"), EVERY_ROW)


def in_process(*arguments):
    """Exit status, standard output and standard error of the command."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = command.main(arguments)
    return status, out.getvalue(), error.getvalue()


def process(*arguments):
    """The same in a process of its own, with JAX as installed."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_ENABLE_X64"}
    return subprocess.run(
        [sys.executable, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


@pytest.fixture(scope="module")
def data():
    begin = "import sys, jax, redundax.__main__ as command; assert not jax.config.jax_enable_x64; "
    done = process("-c", f"{begin} sys.exit(command.process())", "tables", "--json")
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return json.loads(done.stdout)


def shown(*arguments):
    status, out, error = in_process(*arguments)
    assert (status, error) == (0, "")
    return out


@pytest.fixture(scope="module")
def page():
    return shown()


@pytest.fixture(scope="module")
def tables():
    return shown("tables")


@functools.cache
def comparison(key):
    return _paper.compare(_paper.table(key))


def figures(row):
    """[qdd; lam; tau] of a row of the JSON."""
    return np.concatenate([row[kind] for kind in KINDS if kind in row])


def nearest(row, values):
    """Mask of the printed figures that the values round to."""
    words = (row.x + " " + row.tau).split()
    decimals = [len(word.partition(".")[2]) for word in words]
    rounded = [round(float(v), d) for v, d in zip(values, decimals, strict=True)]
    return np.array(rounded) == row.values()


def close(values, truth, tolerance):
    """Closeness relative to the largest entry of each kind."""
    ends = np.cumsum(list(KINDS.values()))[:-1]
    parts = zip(np.split(values, ends), np.split(truth, ends), strict=True)
    return all(np.all(np.abs(v - t) <= tolerance * np.max(np.abs(t), initial=0)) for v, t in parts)


def state(u):
    p = paper.Parameters(u=u)
    return p, *paper.configuration(p, np.pi / 4, 1.0)


# JSON ---------------------------------------------------------------------------------------


def test_json_has_the_rows_of_the_paper(data):
    assert list(data) == list(PRINTED)
    for key, rows in PRINTED.items():
        start = "x0" if key == "table4" else "h"
        kinds = [kind for kind in KINDS if key != "table2" or kind != "tau"]
        for found, row in zip(data[key], rows, strict=True):
            assert list(found) == ["u", start, *kinds]
            assert (found["u"], found[start]) == (row.u, row.start)
            assert {kind: len(found[kind]) for kind in kinds} == {k: KINDS[k] for k in kinds}
            assert all(type(value) is float for kind in kinds for value in found[kind])


@every_row
def test_json_against_truth(data, key, row):
    case = PRINTED[key][row]
    p, q, qd = state(case.u)
    if key == "table2":
        truth = paper.solve(p, q, qd, case.start)
    else:
        solver = paper.fixed_point if key == "table3" else paper.newton
        x = solver(p, q, qd, case.start)[-1]
        truth = np.concatenate([x, paper.friction(p, x[12:], qd)[0]])
    assert close(figures(data[key][row]), truth, 1e-10)


@pytest.mark.parametrize(("key", "row"), [case for case in EVERY_ROW if case[0] != "table4"])
def test_json_against_print(data, key, row):
    # truth.paper holds Table 2 with the swapped forces put right.
    agree = nearest(PRINTED[key][row], figures(data[key][row]))
    assert {(key, row, column) for column in np.flatnonzero(~agree)} <= ROUNDED
    assert np.all(agree) or row == 3


# Table 4 ------------------------------------------------------------------------------------


@pytest.mark.parametrize("row", range(5))
def test_printed_rows_of_table_4_are_solutions(row):
    case, placement = paper.TABLE4[row], comparison("table4").placement
    p, q, qd = state(case.u)
    x, tau = placement.values[row][:24], placement.values[row][24:]
    size = np.max(np.abs(paper.right_side(p, q, qd, x)))
    assert np.max(np.abs(paper.residual(p, q, qd, x))) <= 1e-12 * size
    assert close(tau, paper.friction(p, x[12:], qd)[0], 1e-12)
    wrong = np.flatnonzero(~nearest(case, placement.values[row]))
    assert {("table4", row, column) for column in wrong} <= ROUNDED
    guide, half = case.values()[22], case.half_digit()[22]
    assert guide - half - 1e-12 <= placement.low[row] <= placement.high[row] <= guide + half + 1e-12  # rounding
    assert placement.distance[row] < 1e-12


def test_end_points_of_newton_are_not_the_printed_ones(data):
    ends = np.array([figures(row)[22] for row in data["table4"]])
    placement = comparison("table4").placement
    assert np.all((ends < placement.low) | (ends > placement.high))


def test_guide_moment_is_a_coordinate_on_the_solutions():
    u, moment, step = [1.0, 0.1], np.array([7.0, 2.0]), 1e-5
    values, slope, _ = _tables.with_guide_moment(u, moment)
    assert np.allclose(values[:, 22], moment, rtol=1e-13)
    after, before = (_tables.with_guide_moment(u, moment + s)[0] for s in (step, -step))
    assert np.allclose(slope, (after - before) / (2 * step), atol=1e-6)


# What is shown ------------------------------------------------------------------------------


def test_print_is_transcribed_twice_alike():
    for key, rows in PRINTED.items():
        ours = [list(row.words) for row in _printed.TABLES[key].rows]
        if key == "table2":
            ours[0][12:22], ours[1][12:22] = ours[1][12:22], ours[0][12:22]
        assert ours == [(row.x + " " + row.tau).split() for row in rows]
        starts = [(row.u, row.start) for row in _printed.TABLES[key].rows]
        assert starts == [(row.u, row.start) for row in rows]


@pytest.mark.parametrize("what", ["page", "tables"])
def test_it_fits_a_terminal(request, what):
    text = request.getfixturevalue(what)
    assert max(map(len, text.splitlines())) <= {"page": 80, "tables": 100}[what]
    assert not re.search(r"-0\.0+(?!\d)", text), "zero with a sign"
    assert text.isascii() or what == "page"  # units have superscripts there


def test_tables_mark_every_difference(tables):
    parts = re.split(r"^(?=Table \d\.)", tables, flags=re.MULTILINE)[1:]
    parts[-1] = parts[-1].partition("How far the figures vary")[0]
    for key, text in zip(PRINTED, parts, strict=True):
        compared = comparison(key)
        marks = np.sum(compared.differs)
        if compared.placement is not None:
            marks += np.sum(compared.placement.differs)
        assert len(re.findall(r"\d\*", text)) == marks
    assert [int(np.sum(comparison(key).differs)) for key in ("table2", "table3")] == [16, 2]


def test_tables_explain(tables):
    text = " ".join(tables.split())
    for words in (
        "stand swapped in print",
        "-410.5017 is printed -410",
        "220.5425 is printed 220",
        "220.5428 is printed 220",
        "all 72 printed figures agree",
        "138 of 140 printed figures agree",
        "all 5 printed rows are solutions",
    ):
        assert words in text


def test_tables_show_what_varies(tables):
    lines = [line.split() for line in tables.splitlines()]
    spread = {line[0]: (line.count("same"), line.count("varies")) for line in lines if line}
    assert spread["1.phi''"] == spread["L.perpendicular"] == (1, 1)
    assert spread["A.x"] == spread["K.angle"] == (0, 2)
    assert spread["K.perpendicular"] == (2, 0)


# The first page -----------------------------------------------------------------------------


def test_the_page_fits_a_screen_and_says_what_is_unique_and_what_to_type(page):
    assert len(page.splitlines()) <= 40
    text = " ".join(page.split())
    for words in (
        "of rank 11: 1 redundant, 1 degree of freedom",
        "Without friction, unique: all accelerations, K.perpendicular, L.perpendicular",
        "With friction, not unique: 1.x'', 1.y''",
        "redundax tables",
        "redundax report FILE.py:NAME",
    ):
        assert words in text


def test_ranges_of_the_page_hold_what_the_paper_solves(page):
    """A preload of up to 100 N in A.x beside the minimum norm takes in the case h = 0 of Table 3."""
    found = re.findall(r"^([^\s,]+), .*? +\S+ +(\S+) +(\S+)  varies", page, flags=re.MULTILINE)
    bands = {name: (float(low), float(high)) for name, low, high in found}
    p, q, qd = state(1.0)
    x = paper.fixed_point(p, q, qd, 0.0)[-1]
    for name, place in {"1.phi''": 8, "4.y''": 7, "A.x": 12, "K.angle": 22}.items():
        low, high = bands[name]
        assert low - 1e-3 < x[place] < high + 1e-3 and high - low > 0.1  # one ends at h = 0


def test_the_page_counts_the_printed_figures_that_are_reproduced(page, data):
    right = sum(
        int(np.sum(nearest(PRINTED[key][row], figures(data[key][row])))) for key, row in EVERY_ROW if key != "table4"
    )
    right += sum(
        int(np.sum(nearest(case, values)))
        for case, values in zip(paper.TABLE4, comparison("table4").placement.values, strict=True)
    )
    total = sum(len(row.values()) for rows in PRINTED.values() for row in rows)
    assert f"{right} of {total} printed figures reproduced" in page


def test_the_page_checks_figures_of_the_paper(monkeypatch):
    words = list(_printed.TABLES["table3"].rows[0].words)
    text = _printed.TABLES["table3"].text.replace(words[22], f"{float(words[22]) + 0.5:.2f}", 1)
    wrong = dataclasses.replace(_printed.TABLES["table3"], text=text)
    monkeypatch.setitem(_printed.TABLES, "table3", wrong)
    status, out, _ = in_process()
    assert status == 1
    assert "! At this state these differ from Table 3: K.angle." in out


# Status -------------------------------------------------------------------------------------


def test_help(capsys):
    for arguments in (["--help"], ["tables", "--help"], ["study", "--help"], ["--version"]):
        with pytest.raises(SystemExit) as end:
            command.main(arguments)
        assert end.value.code == 0
        assert "redundax" in capsys.readouterr().out


@pytest.mark.parametrize("arguments", [["table"], ["--json"], ["tables", "--yaml"]])
def test_wrong_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        command.main(arguments)
    assert end.value.code == 2
    assert "usage: redundax" in capsys.readouterr().err


def test_a_failed_solve_is_told(monkeypatch):
    monkeypatch.setattr(_tables, "FixedPoint", lambda: rx.FixedPoint(max_steps=9))
    status, out, error = in_process("tables", "--json")
    failed = [row["linear"] == [None] * 8 for row in json.loads(out)["table3"]]
    assert (status, failed) == (1, [False, True, True, True, False])
    told = "table3, u = 10, h = 100: The friction iteration reached `max_steps`"
    assert told in error
    status, out, _ = in_process("tables")
    assert status == 1
    assert f"! {told}" in " ".join(out.split())
    assert "How far the figures vary" in out


def test_an_unexplained_difference_is_told():
    table = _paper.table("table2")
    values = table.values.copy()
    values[2, 12] += 1.0
    compared = _compare.compare(dataclasses.replace(table, values=values))
    (problem,) = compared.problems
    assert problem.startswith("table2, u = 10, h = 0: A.x printed -456, computed -455.2")
