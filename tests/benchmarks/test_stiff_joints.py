"""The closure is the limit of stiff elastic joints."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import stiff_joints


@pytest.mark.slow
def test_stiff_joints_converge_to_the_closure_with_order_one():
    soft, stiff = stiff_joints.compare((1e-2, 1e-3))
    for kind in ("force", "moment", "linear", "angular"):
        assert soft[kind] < 1e-2
        assert 8 < soft[kind] / stiff[kind] < 12.5, kind
    assert abs(stiff["order"] - 1) < 0.05
