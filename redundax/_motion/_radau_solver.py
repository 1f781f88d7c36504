"""The solver for stiff motions, as it is named by hand: importing its steps takes time that only motions need."""

from .._tools._value import AbstractModule


class Radau(AbstractModule):
    """Radau IIA of order 5, an implicit solver of time for stiff motions.

    ??? example

        ```python
        governor = rx.mechanisms.governor()
        rates = {"axis.angle": 6.283, "pin 1.angle": 0.0, "pin 2.angle": 0.0, "sleeve.travel": 0.0}
        start = rx.assemble(governor, rates=rates)
        motion = rx.simulate(governor, start, 0.1, solver=rx.Radau(), rtol=1e-6)
        motion.stats.steps
        ```

    It suits springs, dampers, bushings and friction as stiff as constraints, whose steps an explicit solver bounds by
    its stability. Steps are taken in as many coordinates as the mechanism has freedoms, with exact Jacobians of all
    loads and friction. Each costs several times an explicit one.
    """
