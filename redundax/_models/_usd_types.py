"""What is read of USD's objects, whose types no checker knows: a stage, and the prims that it consists of"""

from collections.abc import Hashable, Sequence
from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class UsdPath(Hashable, Protocol):
    """Where a prim is."""

    name: str


@runtime_checkable
class UsdAttribute(Protocol):
    """An attribute, of which `Get` gives what the file has, of whatever type, and None where there is none."""

    def Get(self) -> Any: ...
    def GetName(self) -> str: ...
    def HasAuthoredValue(self) -> bool: ...
    def HasValue(self) -> bool: ...


@runtime_checkable
class UsdRelationship(Protocol):
    """What names other prims."""

    def GetTargets(self) -> Sequence[UsdPath]: ...


@runtime_checkable
class UsdList(Protocol):
    """A list that layers add to."""

    def GetAddedOrExplicitItems(self) -> Sequence[str]: ...


@runtime_checkable
class UsdPrim(Protocol):
    """A prim, `Usd.Prim`; schemas are types of USD."""

    def GetAppliedSchemas(self) -> Sequence[str]: ...
    def GetAttribute(self, name: str, /) -> UsdAttribute: ...
    def GetAttributes(self) -> Sequence[UsdAttribute]: ...
    def GetMetadata(self, name: str, /) -> UsdList | None: ...
    def GetName(self) -> str: ...
    def GetParent(self) -> "UsdPrim": ...
    def GetPath(self) -> UsdPath: ...
    def GetRelationship(self, name: str, /) -> UsdRelationship: ...
    def GetTypeName(self) -> str: ...
    def HasAPI(self, schema: type, name: str = "", /) -> bool: ...
    def IsA(self, schema: type, /) -> bool: ...
    def IsInstanceProxy(self) -> bool: ...
    def IsPseudoRoot(self) -> bool: ...


@runtime_checkable
class UsdMesh(Protocol):
    """A mesh, `UsdGeom.Mesh`."""

    def GetPointsAttr(self) -> UsdAttribute: ...
    def GetFaceVertexCountsAttr(self) -> UsdAttribute: ...
    def GetFaceVertexIndicesAttr(self) -> UsdAttribute: ...


@runtime_checkable
class UsdPrimSpec(Protocol):
    """What a layer says of a prim, `Sdf.PrimSpec`."""

    typeName: str

    def SetInfo(self, name: str, value: object, /) -> None: ...


@runtime_checkable
class UsdLayer(Protocol):
    """A file of a stage."""

    realPath: str


@runtime_checkable
class UsdStage(Protocol):
    """A stage, `Usd.Stage`."""

    def GetCompositionErrors(self) -> Sequence[Exception]: ...
    def GetPrimAtPath(self, path: UsdPath, /) -> UsdPrim: ...
    def GetUsedLayers(self) -> Sequence[UsdLayer]: ...
