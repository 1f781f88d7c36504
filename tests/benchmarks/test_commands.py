"""The commands of benchmarks/README.md run, each on its smallest size."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "benchmarks" / "README.md").read_text()
COMMANDS = re.findall(r"^\| `python -m (benchmarks\.\w+)` \|", PAGE, re.M)
# One process for all, since most of it is the import of JAX.
HELP = r"""
import contextlib, importlib, io, re, sys
for name in sys.argv[1:]:
    place = f"{name}.__main__" if importlib.import_module(name).__spec__.submodule_search_locations else name
    sys.argv, out = [name, "--help"], io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        importlib.import_module(place).main()
    print(name, *re.findall(r"--\w+(?: {[^}]*})?", out.getvalue()), sep="|")
"""


def run(*arguments):
    """What a command prints, which ends well."""
    process = subprocess.run([sys.executable, *arguments], cwd=ROOT, env=os.environ, capture_output=True, text=True)
    assert process.returncode == 0, process.stderr
    return process.stdout


@pytest.mark.slow
def test_every_benchmark_has_a_command_that_knows_a_smallest_size():
    written = {path.stem for path in (ROOT / "benchmarks").iterdir() if path.suffix == ".py" or path.is_dir()}
    assert {f"benchmarks.{name}" for name in written if name[0] != "_"} == set(COMMANDS)
    known = {name: options for name, *options in (line.split("|") for line in run("-c", HELP, *COMMANDS).splitlines())}
    assert [name for name, options in known.items() if "--smallest" in options] == COMMANDS
    for name, words in re.findall(r"`python -m (benchmarks\.\w+)([^`]*)`", PAGE):
        assert {*re.findall(r"--\w+", words)} <= {option.split()[0] for option in known[name]}, name
    works = {work for options in known.values() for option in options for work in re.findall(r"\w+", option)}
    assert {work for words in re.findall(r"--only ([\w ]+)", PAGE) for work in words.split()} <= works


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_the_smallest_size_runs(name):
    printed = run("-m", name, "--smallest")
    assert len(re.findall(r"\d", printed)) >= 20
    assert not re.search(r"^ *\d.*\bWRONG\b|beyond its bound", printed, re.M)  # as two of them say it
