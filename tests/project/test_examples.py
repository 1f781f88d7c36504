"""The examples in docstrings run as printed, each after the lines in the docstring of the package."""

import ast
import inspect
import re
import textwrap

import jax
import numpy as np
import pytest

import redundax as rx


def blocks(thing):
    return [textwrap.dedent(block) for block in re.findall(r"```python\n(.*?)```", inspect.getdoc(thing), re.DOTALL)]


(START,) = blocks(rx)
FACES = {"": rx, **{f"{face}.": getattr(rx, face) for face in ("mechanisms", "plot", "spatial", "types", "units")}}
EXAMPLES = [
    pytest.param(block, id=f"{place}{name}")
    for place, face in FACES.items()
    for name, thing in vars(face).items()
    if name[0] != "_" and (inspect.isclass(thing) or inspect.isfunction(thing))
    for block in blocks(thing)
]


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
    return [np.asarray(leaf, float) for leaf in jax.tree.leaves(values) if np.asarray(leaf).dtype.kind in "bif"]


@pytest.mark.slow
@pytest.mark.parametrize("block", EXAMPLES)
def test_example_runs(block, tmp_path, monkeypatch, capsys):
    """Without NaN in what it makes or prints, and with the figures that its comments tell."""
    if "load_model" in block:
        pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # some write pictures and data
    scene = {"__name__": "example"}
    for value, told in steps(START + block, scene):
        if told is not None:
            for one, other in zip(figures(value), figures(told), strict=True):
                np.testing.assert_allclose(one, other, rtol=2e-3, atol=1e-9)  # of three digits
    for name, made in scene.items():
        if isinstance(made, rx.types.Solution | rx.types.Trajectory | jax.Array):
            assert not any(np.isnan(one).any() for one in figures(getattr(made, "acceleration", made))), name
    assert not re.search(r"\bnan\b", capsys.readouterr().out, re.IGNORECASE)
