"""Speed and error of whole sweeps on the mechanism of Wojtyra et al. (2020), with the peers in the same run.

    python -m benchmarks.sweeps [--quick] [--only WORK] [--json]

Each work is done by every program in turn and the medians are compared, so that what else the machine does meets all of
them. The error is the largest against the solution in 50-digit arithmetic at a few samples, each kind of quantity
(linear, angular, force, moment, friction) relative to its largest true value.
"""

import pathlib
import sys

# The truth of the tests is the truth here too.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "support"))
