"""Examples run as printed: of pages, one after the other, of docstrings after the lines in that of the package."""

import re

import jax
import numpy as np
import pytest
from examples import examples, steps

import redundax as rx

EXAMPLES = [pytest.param(codes, id=name) for name, codes in examples()]


def figures(values):
    """All numbers, in one row."""
    arrays = [np.asarray(leaf) for leaf in jax.tree.leaves(values)]
    return np.concatenate([np.zeros(0), *(array.ravel() for array in arrays if array.dtype.kind in "bif")])


@pytest.mark.slow
@pytest.mark.parametrize("codes", EXAMPLES)
def test_example_runs(codes, tmp_path, monkeypatch, capsys):
    """Without NaN in what it makes or prints, and with the figures that its comments tell."""
    if any("load_model" in code for code in codes):
        pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # some write pictures and data
    scene = {"__name__": "example"}
    for value, told in (step for code in codes for step in steps(code, scene)):
        if told is not None:
            np.testing.assert_allclose(figures(value), figures(told), rtol=2e-3, atol=1e-9)  # of three digits
    made_of = {} if any("throw=False" in code for code in codes) else scene  # that shows a solve without solution
    for name, made in made_of.items():
        if isinstance(made, rx.types.Solution | rx.types.Trajectory | jax.Array):
            assert not np.isnan(figures(getattr(made, "acceleration", made))).any(), name
    assert not re.search(r"\bnan\b", capsys.readouterr().out, re.IGNORECASE)
