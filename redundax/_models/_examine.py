"""The audit of a model from a file: of its mechanism, its drives, and along motions of its joints."""

import dataclasses

from ._audit import Audit, audit
from ._drives import Drives, drives_at
from ._model import Model
from ._travel import travel
from ._tree import DIGITS


def examine(model: Model, count: int = 3) -> Audit:
    """Audit a model at its closed position, at others beside, and along motions of its joints.

    **Arguments:**

    - `count`: how many other positions.
    """
    beside = model.beside(count)
    found = audit(model.mechanism, model.state, [state for _, state in beside], DIGITS)
    places = [model.positions, *(positions for positions, _ in beside)]
    looks = [found.here, *found.others]
    driven = [drives_at(model.tree, at, look.freedom, model.left) for at, look in zip(places, looks, strict=True)]
    regular = next(k for k, look in enumerate(looks) if look is found.regular)
    same = [each for each, look in zip(driven, looks, strict=True) if look.figures == found.figures]
    moved = travel(model.tree, places[regular], found.regular.freedom, model.left)
    return dataclasses.replace(found, drives=agreed(driven[regular], same), travel=moved)


def agreed(here: Drives, others: list[Drives]) -> Drives:
    """What is so of drives in general, where they move most; and which have a dead point here."""
    general = min((here, *others), key=lambda each: each.redundancy)
    dead = tuple(name for name in here.loose if name not in general.loose)
    return dataclasses.replace(general, dead=dead, is_decided=all(each.is_decided for each in (here, *others)))
