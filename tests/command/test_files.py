"""The commands `analyze` and `study` on a user's file, with a joint that the library lacks."""

import contextlib
import io
import json
import os
import pathlib
import signal
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from redundax.__main__ import main
from redundax._command._file import load
from redundax._command._output import show
from redundax._solution_sets._family import _branches
from redundax._tools import _progress
from redundax._tools._progress import progress, stage

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


def test_study_begins_as_an_analysis_does_and_does_not_repeat_it(file):
    """Counts and the rank's margin stand in both; self-stress, verdicts and releases in the analysis alone."""
    (_, study, _), (_, analysis, _) = (
        run(*words) for words in (("study", f"{file}:link", "--samples", 5), ("analyze", f"{file}:link"))
    )
    head, _, rest = study.partition("\n\n")
    assert analysis.startswith(f"{head}\n") and head.startswith("3 coordinates")
    assert rest.startswith("Along the self-stress of first")
    assert "release one of" in analysis and "Without friction:" in analysis
    assert "release one of" not in study and "Without friction:" not in study


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
    monkeypatch.setattr("redundax._tools._progress.time.monotonic", iter((0.0, 1.0, 2.5)).__next__)
    with contextlib.redirect_stderr(error):
        assert list(progress("ab", "solving", wanted=False)) == ["a", "b"]
    assert error.getvalue() == "solving: 2 of 2\n"


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_stage_tells_on_a_terminal_how_long_it_took_and_compiled(monkeypatch, is_terminal):
    error = io.StringIO()
    monkeypatch.setattr(error, "isatty", lambda: is_terminal)
    clock, compiled = iter((10.0, 15.25)), []
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(_progress, "_compilations", lambda: compiled)
    with contextlib.redirect_stderr(error), stage("looking"):
        assert error.getvalue() == ("looking ... " if is_terminal else "")
        compiled += [2.5, 1.0]
    assert error.getvalue() == ("looking ... 5.2 s, of which 3.5 s compiling\n" if is_terminal else "")


def test_what_jax_compiles_is_timed():
    before = sum(_progress._compilations())
    jax.jit(lambda x: jnp.cos(x) + 5.0).lower(1.0).compile()
    assert sum(_progress._compilations()) > before


def test_a_file_that_fails_is_told_by_its_line(file):
    file.write_text("import redundax as rx\n\nbody = rx.Body('a', -1.0, 1.0)\n")
    status, out, error = run("analyze", f"{file}:body")
    assert (status, out) == (2, "")
    assert f"'{file}', line 3, fails with RedundaxError: Argument `mass`" in error
    file.write_text("import redundax as\n")
    assert "line 1, fails with SyntaxError" in run("analyze", f"{file}:body")[2]


def test_a_neighbour_that_fails_is_told_by_the_line_that_imports_it(file):
    (file.parent / "neighbour_of_mine.py").write_text("\n\n\n\na b\n")
    file.write_text("import math\nimport neighbour_of_mine\n")
    error = run("analyze", f"{file}:body")[2]
    assert "line 2, fails with SyntaxError" in error and "(neighbour_of_mine.py, line 5)" in error


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("import sys\nsys.exit()", "line 2, exits with 0 before it gives 'link'"),
        ("raise SystemExit(3)", "line 1, exits with 3 before it gives 'link'"),
        ("def link():\n    raise SystemExit('enough')", "line 2, exits with enough before it gives 'link'"),
    ],
)
@pytest.mark.parametrize("words", [("audit",), ("report", "-o", "page.html")])
def test_a_file_that_exits_does_not_pass_for_one_that_is_sound(file, monkeypatch, text, told, words):
    monkeypatch.chdir(file.parent)
    file.write_text(text)
    status, out, error = run(words[0], f"{file.name}:link", *words[1:])
    assert (status, out) == (2, "")
    assert told in error and len(error.splitlines()) == 1


def test_paths_are_told_from_where_the_command_was_called_wherever_a_file_goes(file, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "away").mkdir()
    file.write_text(f"import os\nos.chdir('away')\n{FILE}")
    load(f"{file.name}:link")
    assert pathlib.Path.cwd() == tmp_path
    file.write_text("import os\nos.chdir('away')\n1 / 0")
    assert "'mine.py', line 3, fails with ZeroDivisionError" in run("analyze", "mine.py:link")[2]


def test_signs_that_act_on_a_terminal_are_shown_as_codes(file):
    file.write_text("raise RuntimeError('red \\x1b[31m, turned \\u202e, tab \\t, gr\\xfcn, half \\udc80')")
    error = run("analyze", f"{file}:link")[2]
    assert error.endswith("RuntimeError: red \\x1b[31m, turned \\u202e, tab \t, gr\xfcn, half \\udc80\n")


def test_wrong_arguments_are_told_as_codes_too(capsys):
    with pytest.raises(SystemExit):
        main(["audit", "x.xml", "\x1b[31m.xml"])
    assert capsys.readouterr().err.endswith("unrecognized arguments: \\x1b[31m.xml\n")


def test_a_stream_without_a_letter_is_given_its_code(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    show("grün\nand more")
    assert stream.buffer.getvalue() == b"gr\\xfcn\nand more\n"


@pytest.mark.skipif(os.name != "posix", reason="makes links")
@pytest.mark.parametrize(
    "words", [("report", "x.py:m", "-o", "link.html"), ("audit", "x.xml", "--fix", "link.xml"), ("--png", "link.png")]
)
def test_what_a_link_leads_to_is_not_written_over(monkeypatch, tmp_path, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kept").write_text("kept")
    (tmp_path / words[-1]).symlink_to("kept")
    status, out, error = run(*words)
    assert (status, out) == (2, "")
    assert f"'{words[-1]}' is a link to 'kept', which would be overwritten. Choose another place." in error
    assert (tmp_path / "kept").read_text() == "kept"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("audit", "x.slx"),
            "which is not read. MJCF (.xml), URDF (.urdf), SDF (.sdf), ASMT (.asmt) and USD (.usd) are read",
        ),
        (("analyze", "x.wbt"), "is a model of Webots, which is not read"),
        (
            ("audit", "x.json"),
            ".asmt, .usd, .usda, .usdc, .usdz, or FILE.py:NAME",
        ),
        (("report", "x.urdf"), "is a model. Type `redundax audit x.urdf`"),
        (("audit", ""), "must be a model"),
        (("audit", "https://x.org/x.xml"), "is an address. Fetch the file first"),
        (("audit", "x.py:door", "--closures", "x.yaml"), "Argument `--closures` asks for the loops of a URDF"),
        (("check", "x.py:door", "x.csv", "--keyframe", "up"), "Argument `--keyframe` asks for a position of an MJCF"),
        (("check", "x.py:door", "--run", "1"), "Argument `--run` asks for a run of an MJCF file"),
        (("drive", "x.py:arm", "--law", "a=constant(1)", "--closures", "x.yaml"), "'x.py:arm' is none. Leave it out"),
    ],
)
def test_a_file_of_another_kind_is_told_with_what_to_do(words, told):
    status, out, error = run(*words)
    assert (status, out) == (2, "")
    assert told in error


@pytest.mark.slow
def test_a_file_called_like_a_module_does_not_replace_it(file):
    for name in ("json", "redundax"):  # the second time the file has been loaded before
        own, module = file.with_name(f"{name}.py"), sys.modules[name]
        own.write_text(FILE)
        try:
            for _ in range(2):
                assert run("analyze", f"{own}:link")[0] == 0
        finally:
            sys.path.remove(str(file.parent))
        assert sys.modules[name] is module


BROKEN = """
import time
import jax.numpy as jnp
import redundax as rx


def broken():
    return 1 / 0


def branching(q, t, p):
    if q[0] > 0:
        return q
    return -q


def slow():
    print("begun", flush=True)
    while True:  # a signal that arrives just before a sleep does not end it
        time.sleep(0.1)


axes = {"coordinates": rx.Axis(("x", "y"), ("linear",) * 2), "rows": rx.Axis(("a", "b"), ("force",) * 2)}
branched = rx.System(branching, mass=[1.0, 1.0], **axes)
unequal = rx.System(lambda q, t, p: q, mass=[1.0, 1.0, 1.0], **axes)
state = rx.State([0.0, 0.0], [0.0, 0.0])
"""


@pytest.fixture
def broken(tmp_path):
    (tmp_path / "broken.py").write_text(BROKEN)
    return tmp_path


def begin(folder, *arguments):
    """The command in a process of its own, stopped by SIGINT even where the tests are not."""
    code = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from redundax.__main__ import process; sys.exit(process())"
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(command, cwd=folder, stdin=-3, stdout=-1, stderr=-1, text=True)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("broken", "'broken.py', line 8, fails with ZeroDivisionError: division by zero"),
        ("branched", "'broken.py', line 12, fails with TracerBoolConversionError: Attempted boolean conversion"),
        ("unequal", r"'broken.py' fails with RedundaxError: Argument `mass` of the system must give shape (2, 2)"),
    ],
)
def test_what_fails_in_a_file_is_told_in_a_line(broken, monkeypatch, name, told):
    monkeypatch.chdir(broken)
    status, out, error = run("analyze", f"broken.py:{name}")
    assert (status, out) == (2, "")
    (line,) = error.splitlines()
    assert line.startswith(f"redundax: {told}")


def test_no_traceback_reaches_the_terminal(broken):
    process = begin(broken, "report", "broken.py:broken")
    out, error = process.communicate(timeout=500)
    assert (process.returncode, out, len(error.splitlines())) == (2, "", 1)
    assert not (broken / "report.html").exists()


@pytest.mark.skipif(os.name != "posix", reason="sends the signal of Ctrl-C")
@pytest.mark.parametrize(
    "arguments", [("analyze", "broken.py:slow"), pytest.param(("tables",), marks=pytest.mark.slow)]
)
def test_stopped_from_the_keyboard(broken, arguments):
    process = begin(broken, *arguments)
    assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=500)
    assert (process.returncode, error) == (130, "redundax: stopped\n")


@pytest.mark.parametrize(
    ("words", "place"),
    [
        (("report", "broken.py:broken", "-o"), "folder.html"),
        (("report", "broken.py:broken", "-o"), "/proc/page.md"),
        (("study", "broken.py:broken", "--png"), "folder.png"),
        (("--png",), "folder.png"),
    ],
)
def test_where_nothing_can_be_written_is_told_first(broken, monkeypatch, words, place):
    monkeypatch.chdir(broken)
    if "folder" in place:
        (broken / place).mkdir()
    elif not os.path.isdir("/proc"):
        pytest.skip("has no /proc")
    status, out, error = run(*words, place)
    assert (status, out) == (2, "")
    (line,) = error.splitlines()
    assert line.startswith(f"redundax: '{place}' cannot be written: ") and line.endswith(". Choose another place.")


def test_a_page_that_is_there_stays_until_the_new_one_is_made(broken, monkeypatch):
    monkeypatch.chdir(broken)
    (broken / "report.html").write_text("old")
    assert run("report", "broken.py:broken")[0] == 2
    assert (broken / "report.html").read_text() == "old"


def test_study_tells_why_nothing_can_be_solved(file):
    status, out, error = run("study", f"{file}:resting", "--samples", 5)
    assert (status, error) == (1, "")
    told = " ".join(out.split())
    assert "PROBLEM: A joint with friction is at rest" in told and "At rest: A, B, C, D." in told


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
