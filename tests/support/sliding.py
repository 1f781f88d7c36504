"""A sledge that slides at 2 m/s until friction has stopped it, by an independent integration."""

import numpy as np
from scipy.integrate import solve_ivp


def check_slide(motion, acceleration):
    """Compare positions and velocities along x over 1 s, by the acceleration at a time; gives when it slides."""

    def stops(t, y):
        return y[1]

    stops.terminal = True
    exact = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 1e-3}
    run = solve_ivp(
        lambda t, y: [y[1], acceleration(t)], (0.0, 1.0), [0.0, 2.0], events=stops, dense_output=True, **exact
    )
    slides = np.asarray(motion.t) < run.t[-1]
    truth = run.sol(np.minimum(motion.t, run.t[-1]))
    np.testing.assert_allclose(motion.q[:, 0], truth[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(motion.qd[:, 0], np.where(slides, truth[1], 0.0), rtol=0, atol=1e-8)
    return slides
