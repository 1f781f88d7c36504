"""Tables 2, 3 and 4 as printed, word for word, with what is known to be wrong in print.

A row holds the length unit u (1 metre, 10 decimetres, 0.1 decametres), the number that times ones is h
(Tables 2, 3) or x0 (Table 4), and the figures in the order of Eqs. (60) and (61): linear and angular
accelerations, multipliers of force and of moment type, then (Tables 3, 4) the friction moments of A to D.
"""

import dataclasses
import re
from typing import NamedTuple


class PrintedRow(NamedTuple):
    """One row of a table: `u`, `start` (h or x0 times ones), and the figures as printed."""

    u: float
    start: float
    words: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class PrintedTable:
    """A printed table: what it shows, what its `start` is called, and its rows, in `text` a line for u and `start`
    and indented ones for the figures."""

    key: str
    title: str
    start: str
    text: str

    @property
    def rows(self) -> tuple[PrintedRow, ...]:
        """All rows in order."""
        parts = (row.split() for row in re.split(r"\n(?=\S)", self.text.strip()))
        return tuple(PrintedRow(float(u), float(start), tuple(words)) for u, start, *words in parts)

    def case(self, row: int) -> str:
        """What a row assumes, in words."""
        return f"u = {self.rows[row].u:g}, {self.start} = {self.rows[row].start:g}"


TABLE2 = PrintedTable(
    "table2",
    "Table 2. No friction: x = A^+ b + (I - A^+ A) h, Eq. (9)",
    "h",
    """
1 0
    3.26 -3.46 6.52 -6.92 3.26 -3.46 0.00 -6.92 -33.58 0.0 -33.58 0.00
    -18.5 -26.8 -8.7 -7.2 49.9 48.3 -59.7 -68.0 0.0 27.8 4.79 -4.79
1 50
    3.26 -3.46 6.52 -6.92 3.26 -3.46 0.00 -6.92 -33.58 0.0 -33.58 0.00
    -40.1 -48.3 -30.3 -28.7 28.4 26.8 -38.1 -46.4 0.0 27.8 22.0 -22.0
10 0
    32.6 -34.6 65.2 -69.2 32.6 -34.6 0.00 -69.2 -33.58 0.0 -33.58 0.00
    -456 -539 -359 -343 228 212 -326 -409 0.0 278 32.7 -32.7
""",
)

TABLE3 = PrintedTable(
    "table3",
    "Table 3. Friction that depends on the load, fixed point (27): x <- A^+ b(x) + (I - A^+ A) h",
    "h",
    """
1 0
    3.57 -3.77 7.15 -7.55 3.57 -3.77 0.00 -7.55 -36.75 0.00 -36.75 0.00
    -44.1 -41.6 -33.4 -23.0 31.0 21.2 -41.7 -39.8 0.0 22.1 5.25 -5.25
    -1.21 0.81 -0.75 -1.15
1 50
    3.58 -3.78 7.15 -7.55 3.58 -3.78 0.00 -7.55 -36.75 0.00 -36.75 0.00
    -19.0 -22.8 -8.3 -4.1 56.1 40.0 -66.8 -58.7 0.0 22.0 20.34 -20.34
    -0.59 0.18 -1.38 -1.78
1 100
    3.65 -3.85 7.31 -7.71 3.65 -3.85 0.00 -7.71 -37.53 0.00 -37.53 0.00
    3.6 -1.3 14.6 17.2 80.3 58.5 -91.3 -76.9 0.0 20.6 36.83 -36.83
    -0.08 0.45 -1.99 -2.39
10 100
    35.7 -37.7 71.5 -75.5 35.7 -37.7 0.00 -75.5 -36.75 0.00 -36.75 0.00
    -518 -474 -410 -287 233 154 -340 -341 0.0 220 63.86 -63.86
    -140.4 100.2 -55.8 -96.3
0.1 100
    0.79 -0.81 1.57 -1.61 0.79 -0.81 0.00 -1.61 -79.54 0.00 -79.54 0.00
    40.7 54.6 43.1 55.2 57.2 44.2 -59.6 -44.8 0.0 -5.5 4.15 -4.15
    -0.14 0.14 -0.14 -0.15
""",
)

TABLE4 = PrintedTable(
    "table4",
    "Table 4. The same friction, Newton (38) from x0: x <- x - G_x^+ G(x)",
    "x0",
    """
1 1
    3.57 -3.77 7.15 -7.55 3.57 -3.77 0.00 -7.55 -36.75 0.00 -36.75 0.00
    -42.1 -40.1 -31.4 -21.5 33.0 22.6 -43.7 -41.3 0.0 22.1 6.44 -6.44
    -1.16 0.76 -0.80 -1.20
1 50
    3.58 -3.78 7.15 -7.55 3.58 -3.78 0.00 -7.55 -36.75 0.00 -36.75 0.00
    -18.7 -22.5 -8.0 -3.9 56.4 40.2 -67.1 -58.9 0.0 22.0 20.51 -20.51
    -0.59 0.18 -1.39 -1.79
1 100
    3.64 -3.84 7.28 -7.68 3.64 -3.84 0.00 -7.68 -37.39 0.00 -37.39 0.00
    1.6 -3.6 12.5 14.9 78.0 56.7 -88.9 -75.2 0.0 20.9 35.14 -35.14
    -0.08 0.39 -1.93 -2.33
10 100
    35.7 -37.7 71.5 -75.5 35.7 -37.7 0.00 -75.5 -36.75 0.00 -36.75 0.00
    -516 -473 -409 -286 234 155 -342 -342 0.0 220 71.99 -71.99
    -140.0 99.9 -56.2 -96.6
0.1 100
    0.52 -0.54 1.05 -1.09 0.52 -0.54 0.00 -1.09 -53.32 0.00 -53.32 0.00
    15.6 20.5 17.1 21.8 26.5 20.3 -28.1 -21.7 0.0 -0.8 1.79 -1.79
    -0.05 0.06 -0.07 -0.07
""",
)

TABLES = {printed.key: printed for printed in (TABLE2, TABLE3, TABLE4)}

# The forces of these two rows of Table 2 stand swapped in print: those of h = 0 are printed at h = 50
# and the other way round. Moments and accelerations stand right.
SWAPPED = ("table2", 0, 1)

# Figures that are not the nearest ones of their digits: (table, row, entry). Each is off by less than
# 0.55 of the last printed digit, where a nearest one is off by 0.5 at most.
ROUNDINGS = (("table3", 3, "B.x"), ("table3", 3, "L.perpendicular"), ("table4", 3, "L.perpendicular"))
