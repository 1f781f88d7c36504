"""The benchmark of pseudoinverses: redundax is as exact as its inputs where textbook routes are not."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

import pseudoinverses


@pytest.mark.slow
@pytest.mark.parametrize("name", pseudoinverses.mechanisms())
def test_redundax_is_as_exact_as_its_inputs(name):
    rows = list(pseudoinverses.measure({name: pseudoinverses.mechanisms()[name]}, repeats=1, batch=2))
    errors = {row.route: row.error for row in rows}
    for route in ("redundax, factorize", "redundax, solve"):
        assert errors[route] <= 10 * rows[0].rounding, route
    if name == "the paper's mechanism":
        assert max(error for route, error in errors.items() if "reg" not in route) < 1e-12
        assert max(error for route, error in errors.items() if "refined" in route) < 1e-7
    elif name != "1e-3 from singular":
        assert max(errors.values()) > 1e-2
