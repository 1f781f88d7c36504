"""Releases in USD: a layer over the file, which says of some joints that they are of another type

So whatever the file is, text, binary or a package, and wherever its joints come from, it stays as it is.
"""

import os
import pathlib
import tempfile
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import cast

import numpy as np

from .._tools._optional import optional
from ._edit import Changed, Edit
from ._edit_pairs import pair_moves, place_of, without_limits
from ._kinds import KINDS
from ._model import Model
from ._stress import AXES
from ._usd import TO_Z
from ._usd_stage import stage_of
from ._usd_types import UsdPrimSpec

_KINDS = ("cylindrical joint", "ball", "point-on-line joint", "planar joint", "point-on-plane joint", "hinge", "slide")
_TYPES = {"ball": "PhysicsSphericalJoint"}
_ANY = "PhysicsJoint"  # whose limits tell what it locks
_OF_LAYERS = ("subLayers", "subLayerOffsets", "primChildren")  # what a layer has of its own


def usd_moves(model: Model) -> list[Edit]:
    """What USD can say, of the joints and loops of a model."""
    return pair_moves(model, _KINDS)


def layers_of(path: pathlib.Path) -> Iterator[pathlib.Path]:
    """Files that a stage is made of."""
    stage = stage_of(path)  # whose layers live as long as it does
    yield from (pathlib.Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath)


def usd_change(model: Model, edits: Sequence[Edit], file: pathlib.Path) -> Changed:
    """A layer over the file of a model, with changes."""
    Sdf = optional("pxr.Sdf", "usd")
    below, layer = Sdf.Layer.FindOrOpen(str(model.path)), Sdf.Layer.CreateAnonymous(".usda")
    for key in below.pseudoRoot.ListInfoKeys():
        if key not in _OF_LAYERS:
            layer.pseudoRoot.SetInfo(key, below.pseudoRoot.GetInfo(key))
    near = os.path.relpath(model.path.resolve(), file.resolve().parent)
    layer.subLayerPaths.append(f"./{pathlib.PurePath(near).as_posix()}")
    for edit in edits:
        prim = Sdf.CreatePrimInLayer(layer, place_of(model, edit).at.path)
        if edit.how == "delete":
            _put(Sdf, prim, "physics:jointEnabled", False)
            continue
        prim.typeName = _TYPES.get(edit.kind, _ANY)
        if prim.typeName == _ANY:
            _lock(Sdf, prim, edit, place_of(model, edit).at.axis)
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / file.name  # whose ending tells whether it is text
        layer.Export(str(copy))
        content = copy.read_bytes()
    note = f"It is a layer over '{model.path.name}', which it needs. {without_limits(edits)}".rstrip()
    return Changed({file: content}, [_told(model, edit) for edit in edits], note, ("", layer.ExportToString()))


def _lock(Sdf: ModuleType, prim: UsdPrimSpec, edit: Edit, axis: str) -> None:
    """Lock the directions that a joint of a kind holds, and leave the others free."""
    held = {_direction(row, axis) for row in KINDS[edit.kind].rows}
    freed = {_direction(row.rpartition(".")[2], axis) for row in edit.rows}
    told = Sdf.TokenListOp()
    told.prependedItems = [f"PhysicsLimitAPI:{each}" for each in sorted(held | freed)]
    prim.SetInfo("apiSchemas", told)
    for each in sorted(held | freed):
        low, high = (1.0, -1.0) if each in held else (-np.inf, np.inf)
        _put(Sdf, prim, f"limit:{each}:physics:low", low)
        _put(Sdf, prim, f"limit:{each}:physics:high", high)


def _direction(row: str, axis: str) -> str:
    """What USD calls the direction of a row."""
    is_turn, column = AXES[row]
    return f"{('trans', 'rot')[is_turn]}{'XYZ'[TO_Z[axis][column]]}"


def _put(Sdf: ModuleType, prim: UsdPrimSpec, name: str, value: bool | float) -> None:
    kind = Sdf.ValueTypeNames.Bool if isinstance(value, bool) else Sdf.ValueTypeNames.Float
    Sdf.AttributeSpec(prim, name, kind).default = value


def _told(model: Model, edit: Edit) -> str:
    path = cast(str, place_of(model, edit).at.path)
    if edit.how == "delete":
        return f"physics:jointEnabled = false at {path}"
    held = "" if edit.kind in _TYPES else f", of {' '.join(KINDS[edit.kind].rows)} locked,"
    return f"{_TYPES.get(edit.kind, _ANY)}{held} at {path}"
