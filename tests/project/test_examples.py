"""Examples run as printed: of pages alone, of docstrings after the lines in the docstring of the package."""

import ast
import inspect
import pathlib
import re
import textwrap

import jax
import numpy as np
import pytest

import redundax as rx


def blocks(text):
    return [textwrap.dedent(block) for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL)]


(START,) = blocks(inspect.getdoc(rx))
PAGES = sorted((pathlib.Path(__file__).parents[2] / "docs" / "pages").glob("*.md"))
FACES = {"": rx, **{f"{face}.": getattr(rx, face) for face in ("mechanisms", "plot", "spatial", "types", "units")}}
EXAMPLES = [
    pytest.param(START + block, id=f"{place}{name}")
    for place, face in FACES.items()
    for name, thing in vars(face).items()
    if name[0] != "_" and (inspect.isclass(thing) or inspect.isfunction(thing))
    for block in blocks(inspect.getdoc(thing))
]
EXAMPLES += [pytest.param(block, id=page.stem) for page in PAGES for block in blocks(page.read_text(encoding="utf8"))]


def steps(block, scene):
    """Runs a block; each value that it shows, with the figures in the comment behind it, None where there are none."""
    lines = block.splitlines()
    for statement in ast.parse(block).body:
        if not isinstance(statement, ast.Expr):
            exec(compile(ast.Module([statement], []), "example", "exec"), scene)
            continue
        value = eval(compile(ast.Expression(statement.value), "example", "eval"), scene)
        comment = lines[statement.end_lineno - 1].partition("# ")[2]
        try:
            yield value, ast.literal_eval(re.sub(r"^[\d\s.+*/()-]+= ", "", comment))
        except (SyntaxError, ValueError):  # words
            yield value, None


def figures(values):
    """All numbers, in one row."""
    arrays = [np.asarray(leaf) for leaf in jax.tree.leaves(values)]
    return np.concatenate([np.zeros(0), *(array.ravel() for array in arrays if array.dtype.kind in "bif")])


@pytest.mark.slow
@pytest.mark.parametrize("block", EXAMPLES)
def test_example_runs(block, tmp_path, monkeypatch, capsys):
    """Without NaN in what it makes or prints, and with the figures that its comments tell."""
    if "load_model" in block:
        pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # some write pictures and data
    scene = {"__name__": "example"}
    for value, told in steps(block, scene):
        if told is not None:
            np.testing.assert_allclose(figures(value), figures(told), rtol=2e-3, atol=1e-9)  # of three digits
    made_of = {} if "throw=False" in block else scene  # that shows a solve without solution
    for name, made in made_of.items():
        if isinstance(made, rx.types.Solution | rx.types.Trajectory | jax.Array):
            assert not np.isnan(figures(getattr(made, "acceleration", made))).any(), name
    assert not re.search(r"\bnan\b", capsys.readouterr().out, re.IGNORECASE)
