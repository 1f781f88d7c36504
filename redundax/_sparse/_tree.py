"""The order of elimination: a tree of fronts, by nested dissection of the graph of joints.

Two joints are neighbours where they share a body. A front owns a few joints, a leaf whole neighbourhoods, all others
what separates the pieces below; its border is what eliminating its own joints ties together, joints of fronts above it.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

_LEAF = 16  # rows of a leaf, at most: batches of small dense factors
_FRONT = 24  # rows of several separators in one front, at most: fewer heights, which cost compilation


class Front(NamedTuple):
    """Own joints and those of the border, in order; the front above, -1 of a root; the height above the leaves."""

    own: list[int]
    border: list[int]
    parent: int
    level: int


class _Graph:
    """Joints by the moving bodies that they connect, with their numbers of rows."""

    def __init__(self, bodies: Sequence[Sequence[int]], rows: Sequence[int]):
        self.bodies, self.rows = bodies, rows
        self.joints: dict[int, list[int]] = {}
        for joint, connected in enumerate(bodies):
            for body in connected:
                self.joints.setdefault(body, []).append(joint)

    def neighbours(self, joint: int) -> set[int]:
        return {other for body in self.bodies[joint] for other in self.joints[body]} - {joint}

    def layers(self, start: int, part: set[int]) -> list[list[int]]:
        """The joints of a part by their distance from one of them."""
        seen, found, bodies = {start}, [[start]], set()
        while found[-1]:
            new = {body for joint in found[-1] for body in self.bodies[joint]} - bodies
            bodies |= new
            found.append(sorted(({k for body in new for k in self.joints[body]} & part) - seen))
            seen |= set(found[-1])
        return found[:-1]

    def components(self, part: set[int]) -> Iterator[set[int]]:
        left = set(part)
        for start in sorted(part):
            if start in left:
                found = {k for layer in self.layers(start, left) for k in layer}
                left -= found
                yield found

    def weight(self, joints: Sequence[int] | set[int]) -> int:
        return sum(self.rows[k] for k in joints)


def tree(bodies: Sequence[Sequence[int]], rows: Sequence[int]) -> list[Front]:
    """Fronts in the order of elimination, from the bodies and the number of rows of each joint."""
    graph = _Graph(bodies, rows)
    own: list[list[int]] = []
    parents: list[int] = []
    for part in graph.components(set(range(len(rows)))):
        _dissect(graph, part, _separator(graph, part), own, parents)
    place = {joint: k for k, joints in enumerate(own) for joint in joints}
    borders: list[set[int]] = [set() for _ in own]
    levels = [0] * len(own)
    for k, joints in enumerate(own):
        touched = set().union(*(graph.neighbours(joint) for joint in joints))
        borders[k] = {joint for joint in borders[k] | touched if place[joint] > k}
        if parents[k] >= 0:
            borders[parents[k]] |= borders[k]
            levels[parents[k]] = max(levels[parents[k]], levels[k] + 1)
    order = [sorted(border, key=lambda joint: (place[joint], joint)) for border in borders]
    return [Front(*each) for each in zip(own, order, parents, levels, strict=True)]


def _dissect(graph: _Graph, part: set[int], separator: set[int], own: list[list[int]], parents: list[int]) -> int:
    """Append the fronts of a connected part, what separates its pieces last; and the number of that.

    All pieces that are not small are parted further, or none, so that the fronts of one height are alike.
    """
    between, pieces, small = set(), [(part, separator)], []
    while pieces:
        whole = between.union(*(separator for _, separator in pieces))
        if between and graph.weight(whole) > _FRONT:
            break
        between = whole
        small += [each for each in pieces if not each[1]]
        parts = [each for piece, separator in pieces if separator for each in graph.components(piece - separator)]
        pieces = [(each, _separator(graph, each)) for each in parts]
    if not between:
        between, small = part, []
    children = [_dissect(graph, piece, separator, own, parents) for piece, separator in (*small, *pieces)]
    own.append(sorted(between))
    parents.append(-1)
    for child in children:
        parents[child] = len(own) - 1
    return len(own) - 1


def _separator(graph: _Graph, part: set[int]) -> set[int]:
    """Joints that part about one half of a part from the other; none where it is small or has no halves."""
    if graph.weight(part) <= _LEAF:
        return set()
    layers = graph.layers(graph.layers(min(part), part)[-1][0], part)
    half, reached, middle = graph.weight(part) / 2, 0, 0
    for middle, layer in enumerate(layers[:-1]):
        reached += graph.weight(layer)
        if middle and reached >= half:
            break
    beyond = {k for layer in layers[middle + 1 :] for k in layer}
    return {k for k in layers[middle] if graph.neighbours(k) & beyond} if middle else set()
