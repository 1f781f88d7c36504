"""Motions of 10 s: time against error, with other programs in the same run.

    python -m benchmarks.motions [--quick] [--only WORK] [--json FILE] [--png FILE]

N-four-bar is problem A02 of the multibody benchmark library: N loops of cranks and couplers, uniform rods of 1 m and
1 kg, cranks vertical at the start, their tips at 1 m/s. It passes singular positions, where N + 1 motions branch off.
On the branch of parallel cranks the crank angle obeys one scalar equation; its solution by SciPy to 1e-13 is the truth.

Beside it stand three cranks with a coupler, Andrews' squeezer with its published end, and the paper's mechanism, which
comes to rest where it has friction; and in space problem A04, Bricard's mechanism, a four-bar, and problem A05, a
governor on stiff springs, each by an integration of its own freedoms to 1e-12. Two stiff motions, a press on a spring
of 1e9 N/m and a block on LuGre's bristles, stand beside SciPy's Radau on their own equations (`_stiff`).

Peers run where they are installed (`pip install exudyn mujoco`): Exudyn, implicit generalised-alpha method with its
redundant constraints ignored in the factorisation; MuJoCo, a tree closed by equality constraints, as stiff as the step
allows. Both are given the settings that were found fastest for them.
"""

import pathlib
import sys

# The truth of the tests is the truth here too.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "support"))
