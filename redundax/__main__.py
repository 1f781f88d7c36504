"""The command.

    python -m redundax [--png FILE]              the paper's tables, printed and computed, and what is unique
    python -m redundax tables [--json]           the tables alone, as text or as JSON with full precision
    python -m redundax analyze FILE.py:NAME      what is unique in a mechanism of yours
    python -m redundax study FILE.py:NAME        how far it varies along its self-stress
    python -m redundax report FILE.py:NAME -o F  both as a page with pictures, F.html or F.md

It ends with 0, with 1 where a solve failed or a difference from the printed figures is unexplained, with 2 where the
arguments cannot be understood, a file of yours fails or cannot be written, and with 130 where you stop it. It computes
in float64.
"""

import sys

from ._command._run import main as main
from ._command._run import process as process

if __name__ == "__main__":
    sys.exit(process())
