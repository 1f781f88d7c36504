"""What is joined to what: random trees of bodies with loops, drives and constraints that are redundant for good.

Rows are redundant by construction, whatever the numbers are: exact copies of a joint or drive, guides and pins
parallel to a guide, second fixed joints, and cranks parallel to two others. All other rows are independent at generic
poses, which `draw` checks, so the rank is known.

Structures of one recipe have the same number of everything, so that one compiled program serves them all.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from truth.description import GROUND, ROWS, Joint, Load, Structure


@dataclass(frozen=True)
class Recipe:
    """How many of what.

    - `tree`: joint of each body to an earlier one or the ground, with its friction.
    - `loops`: joints between bodies that are there.
    - `cranks`: for each platform on parallel cranks, how many cranks it has, and the friction in them.
    - `copies`: joints that are there twice.
    - `parallels`: "translational" or "pin" beside a guide, "fixed" beside a fixed joint.
    - `drives`: kinds of drives; `loads`: kinds of loads.
    - `halved`: which joint can be given in two halves.
    """

    tree: tuple[tuple[str, str | None], ...]
    loops: tuple[tuple[str, str | None], ...] = ()
    cranks: tuple[tuple[int, str | None], ...] = ()
    copies: tuple[tuple[str, str | None], ...] = ()
    parallels: tuple[str, ...] = ()
    drives: tuple[str, ...] = ()
    loads: tuple[str, ...] = ("force",)
    halved: tuple[str, str | None] = ("revolute", None)


class _Draft:
    """A structure in the making."""

    def __init__(self, rng: np.random.Generator):
        self.rng, self.joints, self.bodies, self.links, self.numbers, self.redundancy = rng, [], 0, 0, 0, 0

    def body(self) -> int:
        self.bodies += 1
        return self.bodies - 1

    def anywhere(self) -> int:
        """A body or the ground."""
        return int(self.rng.integers(self.bodies + 1)) - 1

    def pair(self) -> tuple[int, int]:
        """Two different bodies, or a body and the ground."""
        i, j = (int(x) - 1 for x in self.rng.choice(self.bodies + 1, 2, replace=False))
        return (i, j) if i != GROUND else (j, i)

    def add(self, kind: str, i: int, j: int, friction: str | None = None) -> Joint:
        self.joints.append(Joint(kind, i, j, self.numbers, self.numbers, friction))
        self.numbers += 1
        return self.joints[-1]

    def one(self, kind: str, *friction: str | None) -> Joint:
        """A joint that is there, of this kind and any of these frictions if there are some."""
        found = [x for x in self.joints if x.kind == kind and (not friction or x.friction in friction)]
        return found[self.rng.integers(len(found))]

    def platform(self, cranks: int, friction: str | None) -> None:
        """A body on parallel cranks of one length and direction; from the third crank on each has a redundant row."""
        parent = self.anywhere()
        platform, link = self.body(), self.links
        self.links += 1
        for count in range(cranks):
            crank = self.body()
            first = self.add("revolute", crank, parent, friction if count == 0 else None)
            self.joints.append(dataclasses.replace(first, i=crank, j=platform, link=link))
            self.redundancy += count >= 2

    def copy(self, joint: Joint) -> None:
        self.joints.append(joint)
        self.redundancy += len(ROWS[joint.kind])

    def beside(self, kind: str) -> None:
        """A joint that does nothing more than the guide or fixed joint that it stands beside."""
        other = self.one("fixed" if kind == "fixed" else "translational")
        self.joints.append(dataclasses.replace(other, kind=kind, number=self.numbers, friction=None))
        self.numbers += 1
        self.redundancy += len(ROWS[kind])


def _draft(recipe: Recipe, rng: np.random.Generator) -> Structure:
    draft = _Draft(rng)
    for kind, friction in recipe.tree:
        parent = draft.anywhere()
        draft.add(kind, draft.body(), parent, friction)
    for cranks, friction in recipe.cranks:
        draft.platform(cranks, friction)
    for kind, friction in recipe.loops:
        draft.add(kind, *draft.pair(), friction)
    for kind in recipe.drives:
        draft.add(kind, *draft.pair())
    for kind, friction in recipe.copies:
        draft.copy(draft.one(kind, friction))
    for kind in recipe.parallels:
        draft.beside(kind)
    loads = tuple(
        Load(kind, *(draft.pair() if kind in ("spring", "torsion") else (int(rng.integers(draft.bodies)), GROUND)), k)
        for k, kind in enumerate(sorted(recipe.loads))
    )
    bodies = tuple(range(draft.bodies))
    return Structure(bodies, _ordered(draft.joints, rng), loads, int(draft.redundancy), draft.links)


def draw(recipe: Recipe, rng: np.random.Generator, sound: Callable[[Structure], bool], tries: int = 2000) -> Structure:
    """A random structure of a recipe that is `sound`: of known rank, no frictional joint at rest."""
    for _ in range(tries):
        structure = _draft(recipe, rng)
        if sound(structure):
            return structure
    raise RuntimeError(f"no sound structure found for {recipe}")


def _ordered(joints: Sequence[Joint], rng: np.random.Generator) -> tuple[Joint, ...]:
    """The joints in random order, but for the first of every key: the order of the keys names the compiled program."""
    shuffled = [joints[k] for k in rng.permutation(len(joints))]
    leaders = {key: [x.key for x in shuffled].index(key) for key in sorted({x.key for x in shuffled})}
    first = list(leaders.values())
    return tuple(shuffled[k] for k in [*first, *(k for k in range(len(shuffled)) if k not in first)])


# Variants of a structure -----------------------------------------------------------------------


def permuted(structure: Structure, rng: np.random.Generator) -> Structure:
    """The same structure with bodies, joints and loads in another order."""
    bodies = tuple(int(x) for x in rng.permutation(structure.bodies))
    loads = sorted(structure.loads, key=lambda load: (load.kind, rng.uniform()))
    return dataclasses.replace(structure, bodies=bodies, joints=_ordered(structure.joints, rng), loads=tuple(loads))


def duplicated(structure: Structure, recipe: Recipe, rng: np.random.Generator) -> tuple[Structure, int]:
    """The same structure with a joint in two halves, the copy last; and the place of that joint."""
    places = [k for k, joint in enumerate(structure.joints) if (joint.kind, joint.friction) == recipe.halved]
    place, joints = int(rng.choice(places)), list(structure.joints)
    joints[place] = half = dataclasses.replace(joints[place], share=joints[place].share / 2)
    redundancy = structure.redundancy + len(ROWS[half.kind])
    return dataclasses.replace(structure, joints=(*joints, half), redundancy=redundancy), place
