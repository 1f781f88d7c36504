"""The command.

    redundax [--png FILE]              an example on one page: what is unique, and how far the rest varies
    redundax tables [--json]           the paper's tables, as text or as JSON with full precision
    redundax analyze FILE.py:NAME      what is unique in a mechanism of yours
    redundax study FILE.py:NAME        how far it varies along its self-stress
    redundax report FILE.py:NAME -o F  both as a page with pictures, F.html or F.md
    redundax audit MODEL               what is redundant in a model from a file: MJCF, URDF or yours
    redundax check MODEL LOG.csv       which joint loads of another program's log are determined, and right
    redundax drive MODEL --law M=LAW   which torque its motors must give along laws of time

`python -m redundax` is the same command.

It ends with 0, with 1 where a solve failed or a difference from the printed figures is unexplained, with 2 where the
arguments cannot be understood, a file of yours fails or cannot be written, and with 130 where you stop it; `audit` and
`check` also with 3 where something is redundant, or wrong, and 4 where that cannot be decided. It computes in float64.
"""

import sys

from ._command._run import main as main
from ._command._run import process as process

if __name__ == "__main__":
    sys.exit(process())
