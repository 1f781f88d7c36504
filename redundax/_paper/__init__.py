"""The paper's Section 5 as a study: its printed tables, the same figures computed, and the comparison.

M. Wojtyra, M. Pekal, J. Fraczek, Mechanism and Machine Theory 153 (2020) 103999.
"""

from ._compare import Comparison as Comparison
from ._compare import check as check
from ._compare import compare as compare
from ._compare import reproduced as reproduced
from ._report import heading as heading
from ._report import spread_text as spread_text
from ._report import table_text as table_text
from ._report import verdict_text as verdict_text
from ._tables import MU_RHO as MU_RHO
from ._tables import PHI as PHI
from ._tables import RATE as RATE
from ._tables import Table as Table
from ._tables import table as table
from ._tables import tables as tables
