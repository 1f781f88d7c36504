"""USD with its schema of physics, in which Isaac Sim, Newton and Omniverse have machines

Bodies are prims with `PhysicsRigidBodyAPI`, joints prims of their own with a frame on each of two prims, or in the
world where one is not named. A generic joint locks the directions whose limits are the wrong way round. Joints with
`excludeFromArticulation` are hung last, so that they close loops where others span a tree.

Lengths are in `metersPerUnit`, masses in `kilogramsPerUnit`, angles in degrees; here they are SI and rad. Frames of
joints are in single precision, and are taken as the shortest decimals that they may have been written as.
"""

import dataclasses
import pathlib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .._bodies._space._rotation import rotation
from .._tools._errors import RedundaxError
from .._tools._optional import optional
from .._tools._words import did_you_mean, ended, printable, short
from ._assembly import NOWHERE, Assembly, Frame, Held
from ._description import WITHOUT, Description, Joint, drive_rates, unique
from ._usd_masses import shape_of, together

FIRST = (b"#usda", b"PXR-USDC", b"PK\x03\x04")
_KINDS = {
    "PhysicsFixedJoint": "fixed joint",
    "PhysicsRevoluteJoint": "hinge",
    "PhysicsPrismaticJoint": "slide",
    "PhysicsSphericalJoint": "ball",
}
_GENERIC = {  # what a generic joint leaves free: travels and turns, of which z is the one that differs from others
    ("", ""): "fixed joint",
    ("", "z"): "hinge",
    ("z", ""): "slide",
    ("z", "z"): "cylindrical joint",
    ("", "xyz"): "ball",
    ("xy", "z"): "planar joint",
    ("z", "xyz"): "point-on-line joint",
    ("xy", "xyz"): "point-on-plane joint",
    ("xyz", "z"): "parallel-axes joint",
    ("xyz", ""): "no-rotation joint",
}
_TO_Z = {"X": (1, 2, 0), "Y": (2, 0, 1), "Z": (0, 1, 2)}  # axes of a frame, in an order in which one of them is z
_HOLDING = re.compile("joint|constraint|gear|rack|tendon|mimic|attachment|weld|equality", re.IGNORECASE)
_SILENT = re.compile("^(Mjc|Newton|Physx)JointAPI|^Physx(Limit|Articulation)|JointStateAPI")  # which hold nothing
_EARTH, _WATER = 9.81, 1000.0  # m/s^2, kg/m^3: of USD where a file says nothing
_LARGEST = 1e30


class _Acting(NamedTuple):
    """What is known of a joint besides what it holds: its limits, and whether it is driven."""

    limits: tuple[float, float] | None
    is_driven: bool


def read_usd(path: pathlib.Path) -> Description:
    """What a file of USD says."""
    Tf = optional("pxr.Tf", "usd")
    with Tf.DiagnosticTrap() as told:
        try:
            return _Reader(path).description()
        finally:
            told.ClearWarnings()  # none on the screen: what matters is in a note


class _Reader:
    """A stage of USD that is being read."""

    def __init__(self, path: pathlib.Path):
        self._path = path
        Tf, Usd = optional("pxr.Tf", "usd"), optional("pxr.Usd", "usd")
        UsdGeom, UsdPhysics = optional("pxr.UsdGeom", "usd"), optional("pxr.UsdPhysics", "usd")
        self._geometry, self._physics, self._notes = UsdGeom, UsdPhysics, []
        try:
            stage = Usd.Stage.Open(str(path))
            lost = [printable(" ".join(str(each).split())) for each in stage.GetCompositionErrors()]
        except Tf.ErrorException as error:
            why = printable(" ".join(str(getattr(error.args[0], "commentary", error)).split()))
            raise self._refuse(
                f"cannot be read as USD: {why.replace(f'{path}:', 'line ')}. Correct the file"
            ) from error
        self._notes += [f"part of the stage is left out: {each}{WITHOUT}" for each in lost]
        self._stage = stage  # prims live as long as it does
        self._prims = list(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
        self._at = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
        self._length, self._mass = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
        if not (0 < self._length < _LARGEST and 0 < self._mass < _LARGEST):
            raise self._refuse(f"has {self._length:g} m and {self._mass:g} kg in a unit. Give positive numbers")
        self._up = np.eye(3)["XYZ".index(str(UsdGeom.GetStageUpAxis(stage)))]
        self._poses, self._weights = [NOWHERE], [(0.0, np.zeros(3), np.zeros((3, 3)))]
        self._part_of: dict[Any, int] = {}
        self._shapes: dict[Any, list[Any]] = {}  # by the paths of the bodies that they are on
        for prim in self._prims:
            if prim.HasAPI(UsdPhysics.CollisionAPI):
                self._shapes.setdefault(self._carrier(prim), []).append(prim)
        bodies = [prim for prim in self._prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)]
        for prim in bodies:
            self._add_body(prim)
        moving = [prim for prim in bodies if self._part_of[prim.GetPath()]]
        if not moving:
            advice = f"Bring what it refers to: {lost[0]}" if lost else "Name the file with the physics"
            raise self._refuse(f"has no body that moves, by `PhysicsRigidBodyAPI`. {advice}")
        self._parts = _named(moving)

    def _refuse(self, why: str) -> RedundaxError:
        return RedundaxError(f"Argument `path`: '{self._path}' {ended(why)}")

    def _values(self, prim: Any, name: str, size: int = 1) -> np.ndarray:
        """Numbers of an attribute: in single precision as the shortest decimals that they may have been written as."""
        value = prim.GetAttribute(name).Get()
        if value is not None and hasattr(value, "GetImaginary"):
            value = [value.GetReal(), *value.GetImaginary()]
        found = np.array([float(str(np.float32(x))) for x in np.ravel([] if value is None else value)])
        if found.size != size or np.any(np.isnan(found)):
            raise self._refuse(f"must have {size} numbers in {short(name)} of {short(str(prim.GetPath()))}. Correct it")
        return found

    def _map(self, prim: Any) -> tuple[np.ndarray, np.ndarray]:
        """What takes points of a prim, in its units, to global ones in m: a matrix and a shift."""
        matrix = np.array(self._at.GetLocalToWorldTransform(prim))
        if not np.all(np.abs(matrix) < _LARGEST) or not np.linalg.det(matrix[:3, :3]):
            raise self._refuse(f"places {short(str(prim.GetPath()))} by no usable numbers. Correct its transform")
        return self._length * matrix[:3, :3].T, self._length * matrix[3, :3]

    def _frame(self, prim: Any) -> Frame:
        linear, shift = self._map(prim)
        left, _, right = np.linalg.svd(linear)
        axes = left @ right
        return Frame(shift, axes * np.sign(np.linalg.det(axes)))

    def _turn(self, prim: Any, name: str) -> np.ndarray:
        values = self._values(prim, name, 4)
        if not np.linalg.norm(values) > 0:
            raise self._refuse(f"has no rotation in {short(name)} of {short(str(prim.GetPath()))}. Correct it")
        return np.asarray(rotation(values / np.linalg.norm(values)))

    def _add_body(self, prim: Any) -> None:
        own = self._physics.RigidBodyAPI(prim)
        is_held = bool(own.GetKinematicEnabledAttr().Get())
        if is_held:
            self._notes.append(f"motion from outside of '{prim.GetName()}': it rests where the file has it")
        self._part_of[prim.GetPath()] = 0
        if is_held or not own.GetRigidBodyEnabledAttr().Get():
            return
        self._part_of[prim.GetPath()] = len(self._poses)
        self._poses.append(self._frame(prim))
        self._weights.append(self._weight(prim, self._poses[-1]))

    def _weight(self, body: Any, pose: Frame) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, and centre and inertia in the axes of a body; what it does not say itself is of its shapes."""
        own, name = self._said(body), str(body.GetPath())
        shapes, densities = [], []
        for prim in self._shapes.get(body.GetPath(), ()):
            shape = shape_of(prim, self._geometry)
            if shape is None:
                if not own["mass"] or own["inertia"] is None:
                    kind = prim.GetTypeName()
                    self._notes.append(f"{kind} '{prim.GetName()}' of '{name}': it adds nothing to its mass")
                continue
            linear, shift = self._map(prim)
            back = pose.axes.T
            shape = shape.mapped(back @ linear, back @ (shift - pose.point))
            said = self._said(prim)
            density = said["density"] or own["density"] or self._of_material(prim) or _WATER
            shapes.append(shape)
            densities.append(said["mass"] / shape.volume if said["mass"] else density)
        mass, centre, inertia = together(shapes, densities)
        if own["mass"] and mass:
            inertia *= own["mass"] / mass
        mass = own["mass"] or mass
        if not mass or (not inertia.any() and own["inertia"] is None):
            assumed = {"mass": None if mass else "1 kg", "inertia": None if own["inertia"] is not None else "1 kg m^2"}
            missing = {word: value for word, value in assumed.items() if value}
            told, values = (" and ".join(words) for words in (missing, missing.values()))
            self._notes.append(f"{told} of '{name}', which the file does not say: {values}")
            mass, inertia = mass or 1.0, np.eye(3)
        if own["centre"] is not None:
            linear, shift = self._map(body)
            centre = pose.axes.T @ (linear @ own["centre"] + shift - pose.point)
        return mass, centre, inertia if own["inertia"] is None else own["inertia"]

    def _said(self, prim: Any) -> dict[str, Any]:
        """What a prim says of its mass, SI: 0 or None where nothing, as of USD; its centre in its own units."""
        found: dict[str, Any] = {"mass": 0.0, "density": 0.0, "centre": None, "inertia": None}
        if not prim.HasAPI(self._physics.MassAPI):
            return found
        mass, density = (float(self._values(prim, f"physics:{word}")[0]) for word in ("mass", "density"))
        moments, centre = (self._values(prim, f"physics:{word}", 3) for word in ("diagonalInertia", "centerOfMass"))
        if min(mass, density, *moments) < 0 or not max(mass, density, *moments) < _LARGEST:
            raise self._refuse(f"gives {short(str(prim.GetPath()))} a mass that none has. Give positive numbers")
        found["mass"], found["density"] = mass * self._mass, density * self._mass / self._length**3
        if np.all(np.abs(centre) < _LARGEST):
            found["centre"] = centre
        if np.any(moments):
            axes = np.eye(3)
            if np.any(self._values(prim, "physics:principalAxes", 4)):
                axes = self._turn(prim, "physics:principalAxes")
            found["inertia"] = axes @ np.diag(moments) @ axes.T * self._mass * self._length**2
        return found

    def _of_material(self, prim: Any) -> float:
        """The density of the material that a shape is bound to, or 0."""
        material, _ = optional("pxr.UsdShade", "usd").MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        if not material or not material.GetPrim().HasAPI(self._physics.MaterialAPI):
            return 0.0
        return max(0.0, float(self._values(material.GetPrim(), "physics:density")[0])) * self._mass / self._length**3

    def _carrier(self, prim: Any) -> Any:
        """The path of the body that a prim is, or is on; None of one that rests."""
        while prim and not prim.IsPseudoRoot():
            if prim.HasAPI(self._physics.RigidBodyAPI):
                return prim.GetPath()
            prim = prim.GetParent()
        return None

    def _end(self, prim: Any, side: int) -> tuple[int, Frame]:
        """A frame of a joint on the part that it is on, in which axes are those of the prim that it names."""
        targets = prim.GetRelationship(f"physics:body{side}").GetTargets()
        here = self._values(prim, f"physics:localPos{side}", 3), self._turn(prim, f"physics:localRot{side}")
        if not np.all(np.abs(here[0]) < _LARGEST):
            raise self._refuse(f"places {short(str(prim.GetPath()))} by no usable numbers. Correct its frames")
        if not targets:
            return 0, Frame(self._length * here[0], here[1])
        name = prim.GetPath().name
        target = self._stage.GetPrimAtPath(targets[0])
        if len(targets) > 1:
            raise self._refuse(f"holds '{name}' to {len(targets)} bodies by `body{side}`. Name one")
        if not target:
            known = [str(path) for path in self._part_of]
            hint = did_you_mean(str(targets[0]), known) or "Correct the name"
            raise self._refuse(f"holds '{name}' to {short(str(targets[0]))}, which is not there. {hint}")
        linear, shift = self._map(target)
        at = Frame(linear @ here[0] + shift, self._frame(target).axes @ here[1])
        part = self._part_of.get(self._carrier(target), 0)
        return part, self._poses[part].back().of(at)

    def _held(self) -> Iterator[tuple[Held, _Acting]]:
        """Joints, with what acts in them, and of those that are not taken over a note."""
        joints = [prim for prim in self._prims if prim.IsA(self._physics.Joint) and self._is_on(prim)]
        joints.sort(key=lambda prim: bool(prim.GetAttribute("physics:excludeFromArticulation").Get()))
        series: dict[tuple[int, int], list[str]] = {}
        for prim, name in zip(joints, _named(joints), strict=True):
            kind, axis, value, limits = self._kind(prim, name)
            i, j = self._end(prim, 0), self._end(prim, 1)
            if i[0] == j[0]:
                self._notes.append(f"joint '{name}' is left out: both of its ends are on one body")
            elif kind:
                turns = (Frame(np.zeros(3), np.eye(3)[:, _TO_Z[each]]) for each in (axis[0], axis[-1]))
                i, j = ((part, at.of(turn)) for (part, at), turn in zip((i, j), turns, strict=True))
                driven = any(self._drives(prim, each) for each in prim.GetAppliedSchemas())
                yield Held(name, kind, i, j, value), _Acting(limits, driven)
                pair = min(i[0], j[0]), max(i[0], j[0])
                if "MjcJointAPI" in _applied(prim):
                    series.setdefault(pair, []).append(name)
        for some in (each for each in series.values() if len(each) > 1):
            told = ", ".join(some)
            self._notes.append(f"series of {told} is left out: MuJoCo has them one after the other{WITHOUT}")
        for prim in self._prims:
            kind, own = str(prim.GetTypeName()), prim.IsA(self._physics.Joint)
            if kind and _HOLDING.search(kind) and not own and not kind.startswith("Skel"):
                self._notes.append(f"{kind} '{prim.GetName()}' is left out: it is not read{WITHOUT}")
            for each in _applied(prim):
                if _HOLDING.search(each) and not _SILENT.search(each):
                    self._notes.append(f"{each} of '{prim.GetName()}' is left out: it is not read{WITHOUT}")

    def _is_on(self, prim: Any) -> bool:
        is_on = bool(prim.GetAttribute("physics:jointEnabled").Get())
        if not is_on:
            self._notes.append(f"joint '{prim.GetName()}' is left out: the file switches it off")
        return is_on

    def _drives(self, prim: Any, schema: str) -> bool:
        """Whether an applied schema is a drive that acts."""
        kind, _, of = schema.partition(":")
        words = ("stiffness", "damping", "maxForce")
        return kind == "PhysicsDriveAPI" and any(
            prim.GetAttribute(f"drive:{of}:physics:{word}").HasAuthoredValue() for word in words
        )

    def _kind(self, prim: Any, name: str) -> tuple[str, str, float, tuple[float, float] | None]:
        """The kind of a joint, its axis, or that of each body, what it counts from, and its limits, m or rad; no kind
        after a note."""
        kind = str(prim.GetTypeName())
        if kind == "PhysicsJoint":
            return self._generic(prim, name)
        if kind == "PhysicsDistanceJoint":
            low, high = (float(self._values(prim, f"physics:{word}Distance")[0]) for word in ("min", "max"))
            if 0 < low == high:
                return "distance joint", "Z", low * self._length, None
            self._notes.append(f"joint '{name}' is left out: its distances are limits, which bear no load here")
            return "", "Z", 0.0, None
        if kind not in _KINDS:
            self._notes.append(f"joint '{name}' is left out: {kind} is not taken over{WITHOUT}")
            return "", "Z", 0.0, None
        limits = None
        if kind in ("PhysicsRevoluteJoint", "PhysicsPrismaticJoint"):
            unit = np.pi / 180 if kind == "PhysicsRevoluteJoint" else self._length
            low, high = (float(self._values(prim, f"physics:{word}Limit")[0]) * unit for word in ("lower", "upper"))
            if low >= high:
                self._notes.append(f"lock of '{name}' by its limits is left out: they leave it no way{WITHOUT}")
            elif np.isfinite(low) or np.isfinite(high):
                limits = low, high
        cones = (
            [float(self._values(prim, f"physics:coneAngle{k}Limit")[0]) for k in (0, 1)]
            if kind == "PhysicsSphericalJoint"
            else []
        )
        if any(0 < each < 360 for each in cones):
            self._notes.append(f"limits of '{name}': they bear no load here")
        axis = "Z" if kind == "PhysicsFixedJoint" else str(prim.GetAttribute("physics:axis").Get())
        if axis not in _TO_Z:
            raise self._refuse(f"gives '{name}' the axis {short(axis)}. Give X, Y or Z")
        return _KINDS[kind], axis, 0.0, limits

    def _generic(self, prim: Any, name: str) -> tuple[str, str, float, tuple[float, float] | None]:
        """Of a generic joint, by the limits of its directions."""
        free: dict[str, str] = {"trans": "", "rot": ""}
        limited: dict[str, tuple[float, float]] = {}
        for word, axis in [(word, axis) for word in free for axis in "XYZ"] + [("distance", "")]:
            if not prim.HasAPI(self._physics.LimitAPI, f"{word}{axis}"):
                free[word] = free.get(word, "") + axis
                continue
            of = f"limit:{word}{axis}:physics:"
            low, high = (float(self._values(prim, of + each)[0]) for each in ("low", "high"))
            if (low == high and low) or word == "distance":
                self._notes.append(f"limit {word}{axis} of '{name}' is left out: it is not read{WITHOUT}")
            if low < high or word == "distance":
                free[word] = free.get(word, "") + axis
            if low < high and (np.isfinite(low) or np.isfinite(high)):
                unit = np.pi / 180 if word == "rot" else self._length
                limited[word + axis] = low * unit, high * unit
        moves, turns = free["trans"], free["rot"]
        own = next((each for each in (turns, moves) if len(each) == 1), "")
        own = own or (next(each for each in "XYZ" if each not in moves) if len(moves) == 2 else "Z")
        order = dict(zip(("XYZ"[k] for k in _TO_Z[own]), "xyz", strict=True))
        left = ["".join(sorted(order[each] for each in some)) for some in (moves, turns)]
        key = left[0], left[1]
        if key == ("xyz", "xyz"):
            self._notes.append(f"joint '{name}' is left out: it leaves all free")
            return "", "Z", 0.0, None
        if not moves and len(turns) == 2:
            self._notes.append(
                f"'{name}' leaves two turns free: about {turns[0]} of its first body, {turns[1]} of its second"
            )
            return "universal joint", turns, 0.0, None
        kind = _GENERIC.get(key, "")
        if not kind:
            told = [f"{word}{axis}" for word in ("trans", "rot") for axis in free[word]]
            self._notes.append(
                f"joint '{name}' is left out: no joint here leaves {', '.join(told)} free alone{WITHOUT}"
            )
        if limited and kind not in ("hinge", "slide"):
            self._notes.append(f"limits of '{name}': they bear no load here")
        return kind, own, 0.0, next(iter(limited.values()), None) if kind in ("hinge", "slide") else None

    def description(self) -> Description:
        """What the file says."""
        found = list(self._held())
        held = [each for each, _ in found]
        acting = {each.name: acts for each, acts in found}
        assembly = Assembly(self._parts, self._poses, held)
        self._notes += assembly.notes
        joints = [self._limited(assembly, joint, acting.get(joint.name), held) for joint in assembly.joints]
        bodies = assembly.bodies(self._weights)
        driven = [
            k
            for k, joint in enumerate(joints)
            if joint.kind in ("hinge", "slide") and joint.name in acting and acting[joint.name].is_driven
        ]
        rates = drive_rates(joints, [(k, 0) for k in driven])
        for name, acts in acting.items():
            if acts.is_driven and name not in [joints[k].name for k in driven]:
                self._notes.append(f"drive of '{name}', which is no hinge or slide of the tree")
        if driven:
            self._notes.append(f"forces of {len(driven)} drive{'s' * (len(driven) > 1)}")
        shapes = sum(map(len, self._shapes.values()))
        self._notes += [f"contact of {shapes} shape{'s' * (shapes > 1)}"] if shapes else []
        points = [body.centre for body in bodies] + [joint.child.point for joint in joints]
        return Description(
            "USD",
            bodies,
            tuple(joints),
            assembly.loops(),
            (),
            self._gravity(),
            tuple(joints[k].name for k in driven),
            lambda positions: rates,
            np.array(points),
            {},
            tuple(self._notes),
        )

    def _limited(self, assembly: Assembly, joint: Joint, acts: _Acting | None, held: list[Held]) -> Joint:
        """A joint with its limits, of the child as the parent sees it."""
        if acts is None or acts.limits is None:
            return joint
        low, high = acts.limits
        return dataclasses.replace(joint, limits=(low, high) if assembly.sign(joint, held) > 0 else (-high, -low))

    def _gravity(self) -> tuple[float, float, float]:
        scenes = [prim for prim in self._prims if prim.IsA(self._physics.Scene)]
        way, size = -self._up, _EARTH
        if not scenes:
            self._notes.append(f"gravity, which the file does not say: {_EARTH:g} m/s^2 down")
        for scene in scenes[:1]:
            given = self._values(scene, "physics:gravityDirection", 3)
            value = float(self._values(scene, "physics:gravityMagnitude")[0])
            if not (np.all(np.abs(given) < _LARGEST) and value < _LARGEST):
                raise self._refuse("has a gravity that is no number. Correct its `physics:gravityMagnitude`")
            way = given / np.linalg.norm(given) if np.any(given) else way
            size = value * self._length if value >= 0 else size
        x, y, z = (size * way).tolist()
        return x, y, z


def _applied(prim: Any) -> list[str]:
    """Schemas that are applied to a prim, those too that are not known here."""
    said = prim.GetMetadata("apiSchemas")
    return list(said.GetAddedOrExplicitItems()) if said else []


def _named(prims: list[Any]) -> list[str]:
    """Short names; of several that are alike the paths."""
    short_names = [prim.GetName() for prim in prims]
    paths = [str(prim.GetPath()).strip("/") for prim in prims]
    return unique([a if short_names.count(a) == 1 else b for a, b in zip(short_names, paths, strict=True)], ())
