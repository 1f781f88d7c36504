"""The rule of collocation by which motions set out from a release."""

import numpy as np

from redundax._motion import _release


def test_polynomials_are_integrated_exactly_up_to_each_node():
    times, weights = _release._TIMES, _release._WEIGHTS
    assert times[0] == 0.0 and times[-1] == 1.0
    for power in range(times.size):
        np.testing.assert_allclose(weights @ times**power, times ** (power + 1) / (power + 1), rtol=0, atol=1e-13)


def test_the_last_terms_are_those_of_legendre_polynomials():
    """t^7 holds 16 / 429 of P7 = 429 t^7 / 16 - ..., and nothing of P8."""
    nodes = 2 * _release._TIMES - 1
    np.testing.assert_allclose(_release._COEFFICIENTS[-2:] @ nodes**7, [16 / 429, 0.0], rtol=0, atol=1e-14)


def test_slopes_at_the_end_are_those_of_polynomials():
    for power in range(_release._TIMES.size):
        np.testing.assert_allclose(_release._SLOPE @ _release._TIMES**power, power, rtol=0, atol=1e-10)
