"""The examples in docstrings run as printed, each after the lines in the docstring of the package."""

import inspect
import re
import textwrap

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


@pytest.mark.slow
@pytest.mark.parametrize("block", EXAMPLES)
def test_example_runs(block, tmp_path, monkeypatch):
    if "load_model" in block:
        pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # some write pictures and data
    exec(compile(START + block, "example", "exec"), {"__name__": "example"})
