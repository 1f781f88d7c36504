"""What the sweeps are to reach: ratios of two lines of one run."""

from ._measure import Row

_VECTORISED, _EIGEN = "NumPy, vectorised", "C++/Eigen, full, 2 threads"
_REDUCED, _PINV = "NumPy, reduced, in chunks", "NumPy, batched pinv of A"

# Work, whose line, compared with whose, how many times as fast.
_GOALS = (
    ("h, ", "redundax, all", _VECTORISED, 25),
    ("h, ", "redundax, all", _EIGEN, 2),
    ("h, ", "redundax, accelerations", _VECTORISED, 40),
    ("h, ", "redundax, accelerations", _EIGEN, 3),
    ("h, ", "redundax, friction", _VECTORISED, 40),
    ("h, ", "redundax, friction", _EIGEN, 3),
    ("12 joints, ", "redundax, all", _REDUCED, 2),
    ("40 joints, ", "redundax, all", _REDUCED, 2),
    ("x0, ", "redundax, all", "NumPy, batched pinv", 1000),
    ("lengths, ", "redundax, all", _PINV, 10),
    ("one call", "redundax, all", "NumPy, (9)", 0.5),
    ("one call, friction", "redundax, all", "NumPy, (27)", 1),
    ("derivatives, ", "forward", "accelerations", 0.2),
    ("derivatives, ", "reverse, one of them", "accelerations", 0.2),
)
# Largest error that counts, by work.
_ERRORS = {"h, ": 1e-11, "12 joints, ": 1e-11, "40 joints, ": 1e-11, "x0, ": 1e-9}


def goals(rows: list[Row]) -> list[str]:
    """One line for each goal that the rows speak of."""
    by_name = {(row.work, row.program): row for row in rows}
    out = []
    for work, own, peer, wanted in _GOALS:
        for name in dict.fromkeys(row.work for row in rows if row.work.startswith(work)):
            if (name, own) in by_name and (name, peer) in by_name:
                row = by_name[name, own]
                ratio = by_name[name, peer].seconds / row.seconds
                right = row.error <= _ERRORS.get(work, 1e-8)
                said = "reached" if ratio >= wanted and right else "missed"
                out.append(f"{said:8} {name}: {own}, {ratio:.3g} times as fast as {peer} (goal {wanted:g})")
    return out
