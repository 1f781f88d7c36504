"""Names of the bodies and joints that a mechanism gets from the tree of a model."""

from collections.abc import Iterator
from typing import NamedTuple

from .._bodies._body import GROUND
from ._tree import Tree, root_of, unique


class Link(NamedTuple):
    """A joint of the file between the bodies `child` and `parent` of the mechanism."""

    joint: int
    kind: str
    name: str
    child: str
    parent: str


class Plan:
    """What becomes of the bodies and joints of a model."""

    def __init__(self, tree: Tree):
        self.tree, self.model = tree, tree.model
        self.movers = [k for k in range(1, self.model.nbody) if self.model.body_jntnum[k]]
        self.names = unique([self._own(body) for body in self.movers], (GROUND,))
        self.body_names = {0: GROUND} | dict(zip(self.movers, self.names, strict=True))
        taken = [*(part.name for part in (*tree.loops, *tree.ties))]
        self.joint_names = unique([tree.joint_name(joint) for joint in range(self.model.njnt)], taken)
        self.links = list(self._links())

    def root(self, body: int) -> int:
        """The body that this one is fixed to, or 0 for the ground."""
        return root_of(self.model, body)

    def name(self, body: int) -> str:
        """Of the body of the mechanism that a body of the file is part of."""
        return self.body_names[self.root(body)]

    def is_between(self, link: Link) -> bool:
        """Whether the child of a joint is a body without mass between two joints of one body."""
        return link.child != self.body_names[int(self.model.jnt_bodyid[link.joint])]

    def _own(self, body: int) -> str:
        return self.model.body(body).name or f"body {body}"

    def _links(self) -> Iterator[Link]:
        for body in self.movers:
            first, parent = int(self.model.body_jntadr[body]), self.name(int(self.model.body_parentid[body]))
            last = first + int(self.model.body_jntnum[body]) - 1
            for joint in range(first, last + 1):
                name = self.joint_names[joint]
                child = self.body_names[body] if joint == last else f"{self.body_names[body]} after {name}"
                yield Link(joint, self.tree.joint_kind(joint), name, child, parent)
                parent = child
