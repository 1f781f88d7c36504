"""Releases of joints in space in the words of who chooses bearings: floating, self-aligning, or none at all."""

import itertools
import textwrap
from collections.abc import Sequence

from .._tools._table import WIDTH
from ._release import Release

_FREED = {
    ("axial",): "slide along its axis",
    ("radial_1", "radial_2"): "give way across its axis",
    ("bend_1", "bend_2"): "tilt",
    ("twist",): "turn about its axis",
}
_SHAFTS = {  # of a joint of two axes, one on each body, whose moment stands on neither
    ("axial",): "slide along its axis on its second body",
    ("radial_1", "radial_2"): "give way across its axis on its second body",
    ("twist",): "turn about all axes, as a ball joint",
}
_BEARINGS = {
    ("axial",): "floating bearing",
    ("bend_1", "bend_2"): "self-aligning bearing",
    ("axial", "bend_1", "bend_2"): "floating and self-aligning bearing",
}


def best_in_words(releases: Sequence[Release], rows: Sequence[str]) -> list[str]:
    """The first of some releases that bearings can do, as lines; none where no bearing does."""
    words = next(filter(None, (bearing_words(release, rows) for release in releases)), "")
    told = f"In words of bearings, of the releases below: {words}."
    return textwrap.wrap(told, WIDTH) if words else []


def bearing_words(release: Release, rows: Sequence[str]) -> str:
    """What to do to each joint, of all the `rows` of a mechanism.

    "" where some are not those of joints in space, or free one direction of two across an axis, or one oblique to both,
    as no bearing does.
    """
    freed: dict[str, list[str]] = {}
    for _, shares in release.directions:
        row, *others = shares
        joint, _, own = row.rpartition(".")
        if others or not any(own in rows for rows in _FREED):
            return ""
        freed.setdefault(joint, []).append(own)
    told = [_of_joint(joint, own, rows) for joint, own in freed.items()]
    return "; ".join(told) if all(told) else ""


def _of_joint(joint: str, freed: list[str], rows: Sequence[str]) -> str:
    own = {row.rpartition(".")[2] for row in rows if row.rpartition(".")[0] == joint}
    if own <= set(freed):
        return f"leave {joint} out"
    words = _SHAFTS if own == {*itertools.chain(*_SHAFTS)} else _FREED
    ways = [words[pair] for pair in words if set(pair) <= set(freed)]
    if sum(len(pair) for pair in _FREED if set(pair) <= set(freed)) < len(freed):
        return ""
    bearing = _BEARINGS.get(tuple(sorted(freed)))
    return f"let {joint} {' and '.join(ways)}" + (f" ({bearing})" if bearing else "")
