"""Hard cases for programs that solve overconstrained mechanisms, with the truth at 50 digits.

    python -m benchmarks.hard_cases [--only FAMILY] [--quick] [--json FILE] [--png FILE]

The geometry of every case is exact, its redundancy permanent by construction and its rank known beforehand; the truth
is mpmath at 50 digits. Each case runs in float64 and float32 over the routes of the library. An answer is right if
its error, per kind of quantity (linear, angular, force, moment, friction) and relative to the largest true value of
that kind, is at most 10 times the bound: eps of the dtype, or the largest change of the exact answer

- as every parameter (length, mass, load, angle, rate, compliance, misfit) changes by eps, relative, and the frame of
  every body moves by eps times the size of the mechanism, or
- as every entry of the equations (7) changes by eps, relative: M, Q, the independent rows of Phi_q and gamma, and the
  coefficients by which the others depend on them.

The largest is that over 3 random changes, and over 24 where an error exceeds that. Both keep the redundancy; where the
state is off the manifold by more than eps, that size takes the place of eps. The table says how many answers are right
by the second alone. Every line ends with a verdict:

    ok            successful, and right
    flagged       not successful, and the result names the reason; or loads without a value are left out, the rest right
    false flag    not successful though sigma_r / sigma_1 > 1e-3, friction contracts with a spectral radius below 0.9,
                  the state is as consistent as the documentation asks, and the bound is below 0.1 for every kind
    SILENT WRONG  successful, but wrong, or of another rank than the true one where sigma_r / sigma_1 exceeds 10 eps
"""

import pathlib
import sys

# The truth of the tests is the truth here too.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "support"))
