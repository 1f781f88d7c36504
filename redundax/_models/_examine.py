"""The audit of a model from a file: its mechanism, its drives, motions of its joints, and what mends it."""

import dataclasses

import numpy as np

from ._audit import Audit, Group, audit
from ._description import End
from ._drives import Drives, drives_at, turning
from ._model import Model
from ._repair import along, ranked, repairs
from ._spins import spins
from ._start import outside
from ._stress import Along, Stress
from ._travel import travel
from ._tree import DIGITS

_REST = 1e-6  # relative: what moves less is at rest


def examine(model: Model, count: int = 3) -> Audit:
    """Audit a model at its closed position, at others beside, and along motions of its joints.

    **Arguments:**

    - `count`: how many other positions.
    """
    beside = model.beside(count)
    beyond = [outside(model.tree, positions) for positions, _ in beside]
    found = audit(model.mechanism, model.state, [state for _, state in beside], DIGITS)
    places = [model.positions, *(positions for positions, _ in beside)]
    looks = [found.here, *found.others]
    driven = [drives_at(model.tree, at, look.freedom, model.left) for at, look in zip(places, looks, strict=True)]
    regular = next(k for k, look in enumerate(looks) if look is found.regular)
    same = [each for each, look in zip(driven, looks, strict=True) if look.figures == found.figures]
    moved = travel(model.tree, places[regular], found.regular.freedom, model.left)
    kinds = {part.name: part.kind for part in (*model.tree.joints, *model.tree.loops)}
    kinds |= {tie.name: "coupling" for tie in model.tree.ties}
    turns = turning(model.tree, places[regular], moved.turns, found.regular.freedom) if moved else ()
    found = dataclasses.replace(
        found,
        drives=dataclasses.replace(agreed(driven[0], same), turns=turns),
        travel=moved,
        parts=tuple(dataclasses.replace(part, kind=kinds.get(part.name, part.kind)) for part in found.parts),
        directions=Stress(model.tree, found.rows).directions(places[regular]),
        idle=_idle(model, places[regular], found.regular.freedom),
        spins=spins(model.tree, places[regular], found.regular.freedom),
        outside=tuple(tuple(limit.joint for limit in each) for each in beyond if each),
    )
    if not found.is_decided:
        return dataclasses.replace(found, groups=tuple(dataclasses.replace(each, releases=()) for each in found.groups))
    way = along(model, found, places[regular], moved)
    groups = tuple(_ranked(group, way, found) for group in found.groups)
    return dataclasses.replace(found, groups=groups, along=way, repairs=repairs(model, found, way))


def _ranked(group: Group, way: Along, found: Audit) -> Group:
    best = ranked(way, group.releases, found.rows)
    return dataclasses.replace(
        group, releases=tuple(each for each, _ in best), margins=tuple(margin for _, margin in best)
    )


def _idle(model: Model, positions: np.ndarray, freedom: int) -> tuple[str, ...]:
    """Bodies that can move while all drives rest, if some cannot."""
    tree = model.tree
    names, rates = tree.drives(positions)
    if not freedom or not names:
        return ()
    motion = tree.scale[:, None] * tree.motion(positions, freedom)[0]
    driven = rates @ motion
    motion = motion @ np.linalg.svd(driven)[2][np.linalg.matrix_rank(driven, tol=_REST) :].T
    poses, moving, movers = tree.at(positions), [], tree.movers
    for number in movers:
        body = model.described.bodies[number]
        both = np.concatenate(tree.velocities(poses, End(number, body.position, body.axes)))
        if np.abs(both @ motion).max(initial=0.0) > _REST * tree.size:
            moving.append(body.name)
    return tuple(moving) if len(moving) < len(movers) else ()


def agreed(here: Drives, others: list[Drives]) -> Drives:
    """What is so of drives in general, where they move most of some positions; and which have a dead point here."""
    general = min(others, key=lambda each: each.redundancy)
    dead = tuple(name for name in here.loose if name not in general.loose)
    return dataclasses.replace(general, dead=dead, is_decided=all(each.is_decided for each in others))
