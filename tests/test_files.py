"""The commands `analyze` and `study` on a user's file, with a joint that the library lacks."""

import contextlib
import io
import json
import sys

import numpy as np
import pytest

from redundax.__main__ import main
from redundax._family import _branches
from redundax._progress import progress

FILE = """
import jax.numpy as jnp
import redundax as rx


def pins(q, t, p):  # two pins of a body in an elliptic slot, the first one given twice
    s = p["s"] * jnp.array([1.0, -1.0, 1.0])
    x, y = q[0] + s * jnp.cos(q[2]), q[1] + s * jnp.sin(q[2])
    return jnp.sqrt((x / p["a"]) ** 2 + (y / p["b"]) ** 2) - 1.0


link = rx.System(
    pins, mass=[2.0, 2.0, 0.1], load=lambda q, qd, t, p: jnp.array([0.0, -19.62, 0.0]),
    parameters={"a": 1.0, "b": 0.5, "s": 0.3},
    coordinates=rx.Axis(("x", "y", "phi"), ("linear", "linear", "angular")),
    rows=rx.Axis(("first", "second", "again"), ("force",) * 3),
)
state = rx.assemble(link, [0.1, -0.4, 0.05], rates={"x": 1.0})


def paper():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)
    return mechanism, mechanism.state(0.8, rate=1.0)


def resting():
    mechanism, _ = paper()
    return mechanism, mechanism.state(0.8)


number = 3
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILE)
    return path


def run(*arguments):
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = main([str(argument) for argument in arguments])
    return status, out.getvalue(), error.getvalue()


def test_analyze_a_joint_of_ones_own(file):
    status, out, _ = run("analyze", f"{file}:link", "--json")
    report = json.loads(out)
    assert status == 0
    assert (report["rank"], report["redundancy"], report["freedom"]) == (2, 1, 1)
    assert report["unique_multipliers"] == ["second"]
    assert report["self_stress"][0]["first"] == pytest.approx(-report["self_stress"][0]["again"], abs=1e-14)


def test_study_shares_the_doubled_pin(file):
    status, out, _ = run("study", f"{file}:link", "--json", "--samples", 5)
    family = json.loads(out)["families"][0]
    values = np.array(family["values"])
    column = {name: values[:, k] for k, name in enumerate(family["names"])}
    assert status == 0
    assert np.ptp(column["x''"]) < 1e-12
    assert np.ptp(column["first"] + column["again"]) < 1e-12
    assert column["first"][2] == pytest.approx(column["again"][2], rel=1e-12)  # minimum norm: equal shares


@pytest.mark.slow
def test_study_draws(file, tmp_path):
    picture = tmp_path / "family.png"
    status, out, error = run("study", f"{file}:paper", "--png", picture, "--samples", 21)
    assert status == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert str(picture) in error
    assert "1.phi''" in out


@pytest.mark.slow
def test_study_works_in_chunks_and_tells(file, monkeypatch):
    arguments = ("study", f"{file}:link", "--samples", 10)
    status, whole, error = run(*arguments)
    assert (status, error) == (0, "")  # not on a terminal
    monkeypatch.setattr(_branches, "_CHUNK", 4)
    assert run(*arguments, "--progress")[:2] == (0, whole)
    told = run(*arguments, "--progress")[2]  # a bar where tqdm is installed, else a line for each chunk
    assert "3/3" in told or "3 of 3" in told
    monkeypatch.setitem(sys.modules, "tqdm", None)
    assert run(*arguments, "--progress")[2].splitlines() == [f"solving: {k} of 3" for k in (1, 2, 3)]


def test_progress_waits_for_long_work(monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    error = io.StringIO()
    monkeypatch.setattr(error, "isatty", lambda: True)
    monkeypatch.setattr("redundax._progress.time.monotonic", iter((0.0, 1.0, 2.5)).__next__)
    with contextlib.redirect_stderr(error):
        assert list(progress("ab", "solving", wanted=False)) == ["a", "b"]
    assert error.getvalue() == "solving: 2 of 2\n"


def test_a_file_that_fails_is_told_by_its_line(file):
    file.write_text("import redundax as rx\n\nbody = rx.Body('a', -1.0, 1.0)\n")
    status, out, error = run("analyze", f"{file}:body")
    assert (status, out) == (2, "")
    assert f"'{file}', line 3, fails with ValueError: Argument `mass`" in error
    file.write_text("import redundax as\n")
    assert "line 1, fails with SyntaxError" in run("analyze", f"{file}:body")[2]


def test_study_tells_why_nothing_can_be_solved(file):
    status, out, error = run("study", f"{file}:resting", "--samples", 5)
    assert (status, error) == (1, "")
    assert "PROBLEM: A joint with friction is at rest" in out and "At rest: A, B, C, D." in out


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--samples", "2", "at least 3"),
        ("--amplitude", "-5", "positive"),
        ("--samples", "many", "whole number"),
        ("--png", "picture.foo", ".png, .pdf or .svg"),
        ("--png", "nowhere/picture.png", "no nowhere"),
    ],
)
def test_wrong_options(file, capsys, option, value, words):
    with pytest.raises(SystemExit) as end:
        main(["study", f"{file}:link", option, value])
    assert end.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("mine.py", "FILE.py:NAME"),
        ("absent.py:link", "no file"),
        ("mine.py:absent", "It has link, paper"),
        ("mine.py:number", "must be a system"),
    ],
)
def test_a_wrong_file_is_told(file, monkeypatch, argument, words):
    monkeypatch.chdir(file.parent)
    status, out, error = run("analyze", argument)
    assert (status, out) == (2, "")
    assert words in error
