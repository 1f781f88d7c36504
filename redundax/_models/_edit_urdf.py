"""Releases of a URDF, in the YAML file of its loops: SPHERICAL in place of a hinge, 3d in place of 6d"""

import pathlib
from collections.abc import Sequence

from .._tools._optional import optional
from ._closed_loops import children, list_under, loops_in
from ._description import Joint, Loop
from ._edit import Changed, Edit
from ._kinds import TURNS
from ._model import Model


def urdf_moves(model: Model) -> list[Edit]:
    """What the file of loops can say, of the joints and loops of a model; what is driven stays a hinge."""
    driven = model.tree.drives(model.positions)[0]
    free = children(model.path).keys() - driven
    moves = []
    for joint in model.tree.joints:
        if joint.kind == "hinge" and joint.name in free:
            rows = tuple(f"{joint.name}.{row}" for row in TURNS[:2])
            moves.append(Edit(rows, joint, "ball", model.described.weight_on(joint)))
    pairs = [] if model.closures is None else list_under(loops_in(model.closures), "closed_loop")
    beside = set(map(_weld, pairs))
    for loop in model.tree.loops:
        if loop.name in beside:
            moves.append(Edit(tuple(f"{loop.name}.{row}" for row in TURNS), loop, "point"))
    return moves


def urdf_change(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """The file of a model, and that of its loops with changes."""
    loops = {} if model.closures is None else loops_in(model.closures)
    spherical = [edit.target.name for edit in edits if isinstance(edit.target, Joint)]
    loops["joint_name"] = [*list_under(loops, "joint_name"), *spherical]
    loops["joint_type"] = [*list_under(loops, "joint_type"), *("SPHERICAL" for _ in spherical)]
    points = [edit.target.name for edit in edits if isinstance(edit.target, Loop)]
    pairs, kinds = list_under(loops, "closed_loop"), list_under(loops, "type")
    loops["type"] = ["3d" if _weld(pair) in points else kind for pair, kind in zip(pairs, kinds, strict=True)]
    beside = optional("yaml", "models").safe_dump(loops, sort_keys=False).encode("utf8")
    return Changed({file: model.path.read_bytes(), file.with_suffix(".yaml"): beside}, [])


def _weld(pair: object) -> str:
    """The name of the loop that a pair of frames closes."""
    return f"weld {' ~ '.join(map(str, pair)) if isinstance(pair, list) else pair}"
