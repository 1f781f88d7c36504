"""The README's Python blocks run as printed."""

import contextlib
import io
import pathlib
import re

import pytest

import redundax as rx

README = (pathlib.Path(__file__).parents[2] / "README.md").read_text(encoding="utf8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_block_runs(block):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(block, "README.md", "exec"), {})
    assert out.getvalue().strip() or "print(" not in block
    assert "nan" not in out.getvalue()


def test_own_mechanism_is_held_twice():
    found = {}
    exec(compile(BLOCKS[1], "README.md", "exec"), found)
    factor = rx.factorize(found["press"], found["state"])
    assert factor.result == rx.RESULTS.successful
    assert (int(factor.redundancy), int(factor.freedom)) == (2, 1)


def test_example_is_short():
    assert len(BLOCKS) == 2
    assert len(README.splitlines()) < 120
