"""USD with its schema of physics, in which Isaac Sim, Newton and Omniverse have machines

Bodies are prims with `PhysicsRigidBodyAPI`, joints prims of their own with a frame on each of two prims, or in the
world where one is not named. A generic joint locks the directions whose limits are the wrong way round. Joints with
`excludeFromArticulation` are hung last, so that they close loops where others span a tree.

Lengths are in `metersPerUnit`, masses in `kilogramsPerUnit`, angles in degrees; here they are SI and rad. Frames of
joints are in single precision, and are taken as the shortest decimals that they may have been written as.
"""

import pathlib
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .._bodies._body import GROUND
from .._bodies._space._rotation import rotation
from .._tools._optional import optional
from .._tools._words import did_you_mean, printable, short
from ._assembly import Frame, Held
from ._content import refusal
from ._description import Description, Joint, Place, Tie, unique
from ._reader import LARGEST, AbstractReader
from ._usd_masses import Shape, shape_of, together
from ._usd_stage import stage_of
from ._usd_types import UsdPath, UsdPrim

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
TO_Z = {"X": (1, 2, 0), "Y": (2, 0, 1), "Z": (0, 1, 2)}  # axes of a frame, in an order in which one of them is z
_HOLDING = re.compile("joint|constraint|gear|rack|tendon|mimic|attachment|weld|equality", re.IGNORECASE)
_SILENT = re.compile("^(Mjc|Newton|Physx)JointAPI|^Physx(Limit|Articulation)|JointStateAPI")  # which hold nothing
_MIMICS = re.compile("^(PhysxMimicJoint|NewtonMimic|MjcEqualityJoint)API")
_SERIES = "MjcJointAPI"
_CURVED = tuple(f"mjc:coef{k}" for k in range(5))  # of equalities of MuJoCo, which count otherwise
_EARTH, _WATER = 9.81, 1000.0  # m/s^2, kg/m^3: of USD where a file says nothing


class UsdPlace(NamedTuple):
    """Where a joint is: its path, and the axis of its frames that it is about or along, or that of each body."""

    path: str
    axis: str


class _Acting(NamedTuple):
    """What is known of a joint besides what it holds: whether it is driven, where it is, and
    whether others between the same bodies come after it."""

    is_driven: bool
    place: Place
    is_in_series: bool


class _Said(NamedTuple):
    """What a prim says of its mass, SI: 0 or None where nothing, as of USD; its centre in its own units."""

    mass: float = 0.0
    density: float = 0.0
    centre: np.ndarray | None = None
    inertia: np.ndarray | None = None


def read_usd(path: pathlib.Path) -> Description:
    """What a file of USD says."""
    Tf = optional("pxr.Tf", "usd")
    with Tf.DiagnosticTrap() as told:
        try:
            return _Reader(path).description()
        except (Tf.ErrorException, UnicodeDecodeError) as error:
            why = _told(error).replace(f"{path}:", "line ")
            raise refusal(path, f"cannot be read as USD: {why}. Correct the file") from error
        finally:
            told.ClearWarnings()  # none on the screen: what matters is in a note


class _Reader(AbstractReader):
    """A stage of USD that is being read."""

    form = "USD"

    def _begin(self, path: pathlib.Path) -> None:
        Usd, UsdGeom, UsdPhysics = (optional(f"pxr.{name}", "usd") for name in ("Usd", "UsdGeom", "UsdPhysics"))
        self._geometry, self._physics = UsdGeom, UsdPhysics
        stage = stage_of(path)
        lost = [printable(" ".join(str(each).split())) for each in stage.GetCompositionErrors()]
        for each in lost:
            self._leave_out("part of the stage", each)
        self._stage = stage  # prims live as long as it does
        self._prims = list(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
        self._at = UsdGeom.XformCache(Usd.TimeCode.EarliestTime())
        self._length, self._mass = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
        if not all(1 / LARGEST < unit < LARGEST for unit in (self._length, self._mass)):
            raise self._refuse(f"has {self._length:g} m and {self._mass:g} kg in a unit. Give positive numbers")
        up = str(UsdGeom.GetStageUpAxis(stage))
        if up not in TO_Z:
            raise self._refuse(f"has the axis {short(up)} up. Give X, Y or Z")
        self._up = np.eye(3)["XYZ".index(up)]
        self._part_of: dict[UsdPath | None, int] = {}
        self._shapes: dict[UsdPath | None, list[UsdPrim]] = {}  # by the paths of the bodies that they are on
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

    def _values(self, prim: UsdPrim, name: str, size: int = 1) -> np.ndarray:
        """Numbers of an attribute: in single precision as the shortest decimals that they may have been written as."""
        value = prim.GetAttribute(name).Get()
        if value is not None and hasattr(value, "GetImaginary"):
            value = [value.GetReal(), *value.GetImaginary()]
        try:
            found = np.array([float(str(np.float32(x))) for x in np.ravel([] if value is None else value)])
        except (TypeError, ValueError):  # of another type than the schema has
            found = np.zeros(0)
        if found.size != size or np.any(np.isnan(found)):
            raise self._refuse(f"must have {size} numbers in {short(name)} of {short(str(prim.GetPath()))}. Correct it")
        return found

    def _map(self, prim: UsdPrim) -> tuple[np.ndarray, np.ndarray]:
        """What takes points of a prim, in its units, to global ones in m: a matrix and a shift."""
        matrix = np.array(self._at.GetLocalToWorldTransform(prim))
        if not np.all(np.abs(matrix) < LARGEST) or not np.linalg.det(matrix[:3, :3]):
            raise self._refuse(f"places {short(str(prim.GetPath()))} by no usable numbers. Correct its transform")
        return self._length * matrix[:3, :3].T, self._length * matrix[3, :3]

    def _frame(self, prim: UsdPrim) -> Frame:
        linear, shift = self._map(prim)
        left, _, right = np.linalg.svd(linear)
        axes = left @ right
        return Frame(shift, axes * np.sign(np.linalg.det(axes)))

    def _turn(self, prim: UsdPrim, name: str) -> np.ndarray:
        values = self._values(prim, name, 4)
        if not np.linalg.norm(values) > 0:
            raise self._refuse(f"has no rotation in {short(name)} of {short(str(prim.GetPath()))}. Correct it")
        return np.asarray(rotation(values / np.linalg.norm(values)))

    def _add_body(self, prim: UsdPrim) -> None:
        own = self._physics.RigidBodyAPI(prim)
        is_held = bool(own.GetKinematicEnabledAttr().Get())
        if is_held:
            self._notes.append(f"motion from outside of '{prim.GetName()}': it rests where the file has it")
        self._part_of[prim.GetPath()] = 0
        if is_held or not own.GetRigidBodyEnabledAttr().Get():
            return
        pose = self._frame(prim)
        self._part_of[prim.GetPath()] = self._add("", pose, self._weight(prim, pose))
        if prim.GetAttribute("physxRigidBody:disableGravity").Get():
            self._carried.append(self._part_of[prim.GetPath()])

    def _weight(self, body: UsdPrim, pose: Frame) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, and centre and inertia in the axes of a body; what it does not say itself is of its shapes."""
        own, name = self._said(body), str(body.GetPath())
        shapes, densities = [], []
        for prim in self._shapes.get(body.GetPath(), ()):
            shape = self._shape(prim, pose)
            if shape is None:
                if not own.mass or own.inertia is None:
                    kind = prim.GetTypeName()
                    self._notes.append(f"{kind} '{prim.GetName()}' of '{name}': it adds nothing to its mass")
                continue
            said = self._said(prim)
            density = said.density or own.density or self._of_material(prim) or _WATER
            shapes.append(shape)
            densities.append(said.mass / shape.volume if said.mass else density)
        mass, centre, inertia = together(shapes, densities)
        if own.mass and mass:
            inertia *= own.mass / mass
        mass = own.mass or mass
        if not mass or (not inertia.any() and own.inertia is None):
            assumed = {"mass": None if mass else "1 kg", "inertia": None if own.inertia is not None else "1 kg m^2"}
            missing = {word: value for word, value in assumed.items() if value}
            told, values = (" and ".join(words) for words in (missing, missing.values()))
            self._notes.append(f"{told} of '{name}', which the file does not say: {values}")
            mass, inertia = mass or 1.0, np.eye(3)
        if own.centre is not None:
            linear, shift = self._map(body)
            centre = pose.axes.T @ (linear @ own.centre + shift - pose.point)
        return mass, centre, inertia if own.inertia is None else own.inertia

    def _shape(self, prim: UsdPrim, pose: Frame) -> Shape | None:
        """A shape in the axes of a body; None of one without a volume that can be told."""
        try:
            shape = shape_of(prim, self._geometry)
        except (TypeError, ValueError):  # of words where numbers are
            return None
        linear, shift = self._map(prim)
        found = None if shape is None else shape.mapped(pose.axes.T @ linear, pose.axes.T @ (shift - pose.point))
        return found if found is not None and 0 < found.volume < LARGEST else None

    def _said(self, prim: UsdPrim) -> _Said:
        """What a prim says of its mass."""
        if not prim.HasAPI(self._physics.MassAPI):
            return _Said()
        mass, density = (float(self._values(prim, f"physics:{word}")[0]) for word in ("mass", "density"))
        moments, centre = (self._values(prim, f"physics:{word}", 3) for word in ("diagonalInertia", "centerOfMass"))
        if min(mass, density, *moments) < 0 or not max(mass, density, *moments) < LARGEST:
            raise self._refuse(f"gives {short(str(prim.GetPath()))} a mass that none has. Give positive numbers")
        inertia = None
        if np.any(moments):
            axes = np.eye(3)
            if np.any(self._values(prim, "physics:principalAxes", 4)):
                axes = self._turn(prim, "physics:principalAxes")
            inertia = axes @ np.diag(moments) @ axes.T * self._mass * self._length**2
        own = centre if np.all(np.abs(centre) < LARGEST) else None
        return _Said(mass * self._mass, density * self._mass / self._length**3, own, inertia)

    def _of_material(self, prim: UsdPrim) -> float:
        """The density of the material that a shape is bound to, or 0."""
        material, _ = optional("pxr.UsdShade", "usd").MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        if not material or not material.GetPrim().HasAPI(self._physics.MaterialAPI):
            return 0.0
        return max(0.0, float(self._values(material.GetPrim(), "physics:density")[0])) * self._mass / self._length**3

    def _carrier(self, prim: UsdPrim) -> UsdPath | None:
        """The path of the body that a prim is, or is on; None of one that rests."""
        while prim and not prim.IsPseudoRoot():
            if prim.HasAPI(self._physics.RigidBodyAPI):
                return prim.GetPath()
            prim = prim.GetParent()
        return None

    def _end(self, prim: UsdPrim, side: int) -> tuple[int, Frame]:
        """A frame of a joint on the part that it is on, in which axes are those of the prim that it names."""
        targets = prim.GetRelationship(f"physics:body{side}").GetTargets()
        here = self._values(prim, f"physics:localPos{side}", 3), self._turn(prim, f"physics:localRot{side}")
        if not np.all(np.abs(here[0]) < LARGEST):
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

    def _held(self) -> Iterator[Held]:
        """Joints, with what acts in them, and of those that are not taken over a note."""
        joints = [prim for prim in self._prims if prim.IsA(self._physics.Joint) and self._is_on(prim)]
        joints.sort(key=lambda prim: bool(prim.GetAttribute("physics:excludeFromArticulation").Get()))
        for prim, name in zip(joints, _named(joints), strict=True):
            kind, axis, value, limits = self._kind(prim, name)
            i, j = self._end(prim, 0), self._end(prim, 1)
            if i[0] == j[0]:
                self._leave_out(f"joint '{name}'", "both of its ends are on one body", constrains=False)
            elif kind:
                turns = (Frame(np.zeros(3), np.eye(3)[:, TO_Z[each]]) for each in (axis[0], axis[-1]))
                i, j = ((part, at.of(turn)) for (part, at), turn in zip((i, j), turns, strict=True))
                driven = any(self._drives(prim, each) for each in prim.GetAppliedSchemas())
                place = Place(UsdPlace(str(prim.GetPath()), axis), driven or prim.IsInstanceProxy())
                yield Held(name, kind, i, j, value, limits, _Acting(driven, place, _SERIES in _applied(prim)))
        for prim in self._prims:
            kind, own = str(prim.GetTypeName()), prim.IsA(self._physics.Joint)
            if kind and _HOLDING.search(kind) and not own and not kind.startswith("Skel"):
                self._leave_out(f"{kind} '{prim.GetName()}'", "it is not read")
            for each in _applied(prim):
                if _HOLDING.search(each) and not (_SILENT.search(each) or _MIMICS.search(each)):
                    self._leave_out(f"{each} of '{prim.GetName()}'", "it is not read")

    def _is_on(self, prim: UsdPrim) -> bool:
        is_on = bool(prim.GetAttribute("physics:jointEnabled").Get())
        if not is_on:
            self._leave_out(f"joint '{prim.GetName()}'", "the file switches it off", constrains=False)
        return is_on

    def _drives(self, prim: UsdPrim, schema: str) -> bool:
        """Whether an applied schema is a drive that acts."""
        kind, _, of = schema.partition(":")
        words = ("stiffness", "damping", "maxForce")
        return kind == "PhysicsDriveAPI" and any(
            prim.GetAttribute(f"drive:{of}:physics:{word}").HasAuthoredValue() for word in words
        )

    def _kind(self, prim: UsdPrim, name: str) -> tuple[str, str, float, tuple[float, float] | None]:
        """The kind of a joint, its axis, or that of each body, what it counts from, and its limits, m or rad; no kind
        after a note."""
        kind = str(prim.GetTypeName())
        if kind == "PhysicsJoint":
            return self._generic(prim, name)
        if kind == "PhysicsDistanceJoint":
            low, high = (float(self._values(prim, f"physics:{word}Distance")[0]) for word in ("min", "max"))
            if 0 < low == high:
                return "distance joint", "Z", low * self._length, None
            self._leave_out(f"joint '{name}'", "its distances are limits, which bear no load here", constrains=False)
            return "", "Z", 0.0, None
        if kind not in _KINDS:
            self._leave_out(f"joint '{name}'", f"{kind} is not taken over")
            return "", "Z", 0.0, None
        limits = None
        if kind in ("PhysicsRevoluteJoint", "PhysicsPrismaticJoint"):
            unit = np.pi / 180 if kind == "PhysicsRevoluteJoint" else self._length
            low, high = (float(self._values(prim, f"physics:{word}Limit")[0]) * unit for word in ("lower", "upper"))
            if low >= high:
                self._leave_out(f"lock of '{name}' by its limits", "they leave it no way")
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
        if axis not in TO_Z:
            raise self._refuse(f"gives '{name}' the axis {short(axis)}. Give X, Y or Z")
        return _KINDS[kind], axis, 0.0, limits

    def _generic(self, prim: UsdPrim, name: str) -> tuple[str, str, float, tuple[float, float] | None]:
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
                self._leave_out(f"limit {word}{axis} of '{name}'", "it is not read")
            if low < high or word == "distance":
                free[word] = free.get(word, "") + axis
            if low < high and (np.isfinite(low) or np.isfinite(high)):
                unit = np.pi / 180 if word == "rot" else self._length
                limited[word + axis] = low * unit, high * unit
        moves, turns = free["trans"], free["rot"]
        own = next((each for each in (turns, moves) if len(each) == 1), "")
        own = own or (next(each for each in "XYZ" if each not in moves) if len(moves) == 2 else "Z")
        order = dict(zip(("XYZ"[k] for k in TO_Z[own]), "xyz", strict=True))
        left = ["".join(sorted(order[each] for each in some)) for some in (moves, turns)]
        key = left[0], left[1]
        if key == ("xyz", "xyz"):
            self._leave_out(f"joint '{name}'", "it leaves all free", constrains=False)
            return "", "Z", 0.0, None
        if not moves and len(turns) == 2:
            self._notes.append(
                f"'{name}' leaves two turns free: about {turns[0]} of its first body, {turns[1]} of its second"
            )
            return "universal joint", turns, 0.0, None
        kind = _GENERIC.get(key, "")
        if not kind:
            told = [f"{word}{axis}" for word in ("trans", "rot") for axis in free[word]]
            self._leave_out(f"joint '{name}'", f"no joint here leaves {', '.join(told)} free alone")
        if limited and kind not in ("hinge", "slide"):
            self._notes.append(f"limits of '{name}': they bear no load here")
        return kind, own, 0.0, next(iter(limited.values()), None) if kind in ("hinge", "slide") else None

    def description(self) -> Description:
        """What the file says."""
        held = list(self._held())
        acting = {each.name: each.said for each in held}
        assembly = self._assembled(list(self._in_series(held)))
        joints, paths = assembly.joints, {name: acts.place.at.path for name, acts in acting.items()}
        single = {joint.name: k for k, joint in enumerate(joints) if joint.kind in ("hinge", "slide")}
        driven = [(name, k, 0) for name, k in single.items() if name in acting and acting[name].is_driven]
        ties = tuple(self._ties(joints, assembly.signs, paths))
        tied = {joints[k].name for tie in ties for k, _ in (*tie.first, *tie.second) if isinstance(k, int)}
        for name, acts in acting.items():
            if acts.is_driven and name not in single:
                self._notes.append(f"drive of '{name}', which is no hinge or slide of the tree")
        if driven:
            self._notes.append(f"forces of {len(driven)} drive{'s' * (len(driven) > 1)}")
        return self._described(
            assembly,
            self._gravity(),
            driven,
            sum(map(len, self._shapes.values())),
            ties=ties,
            origin={name: acts.place for name, acts in acting.items() if name not in tied},
        )

    def _ties(self, joints: list[Joint], signs: dict[str, int], paths: dict[str, str]) -> Iterator[Tie]:
        """Joints that mimic others: q = a + b q' of their positions, in degrees or in units of length.

        So the schemas have it: PhysX's as q + gearing q' + offset = 0, Newton's as q = mimicCoef0 + mimicCoef1 q'.
        """
        numbers = {paths[joint.name]: k for k, joint in enumerate(joints) if joint.name in paths}
        names = {path: name for name, path in paths.items()}
        for prim in self._prims:
            for schema in filter(_MIMICS.search, _applied(prim)):
                path, name = str(prim.GetPath()), names.get(str(prim.GetPath()), prim.GetName())
                if prim.GetAttribute("newton:mimicEnabled").Get() is False:
                    continue
                other, offset, slope, is_linear = self._mimicked(prim, schema)
                both = [numbers.get(each, -1) for each in (path, other)]
                kinds = {joints[k].kind if k >= 0 else "" for k in both}
                if not is_linear or kinds not in ({"hinge"}, {"slide"}) or both[0] == both[1]:
                    why = "it is not of two hinges or two slides of the tree, and linear"
                    self._leave_out(f"{schema} of '{name}'", why)
                    continue
                one, two = (joints[k] for k in both)
                sign, unit = signs[one.name] * signs[two.name], np.pi / 180 if kinds == {"hinge"} else self._length
                constant = signs[one.name] * unit * offset + sign * slope * two.reference[0] - one.reference[0]
                first, second = (((k, 1.0),) for k in both)
                yield Tie(f"{one.name} as {two.name}", first, second, np.array([constant, sign * slope]))

    def _mimicked(self, prim: UsdPrim, schema: str) -> tuple[str, float, float, bool]:
        """The path of the joint that one mimics, offset and slope; and whether there is no more to it."""
        of = f"physxMimicJoint:{schema.partition(':')[2]}:" if schema.startswith("Physx") else "newton:mimic"
        word, least, most, sign = ("referenceJoint", "offset", "gearing", -1.0) if schema.startswith("Physx") else (
            "Joint", "Coef0", "Coef1", 1.0)  # fmt: skip
        targets = prim.GetRelationship(of + word).GetTargets()
        given = [self._values(prim, of + each)[0] if prim.GetAttribute(of + each).HasValue() else default
                 for each, default in ((least, 0.0), (most, 1.0))]  # fmt: skip
        more = [each for each in prim.GetAttributes() if each.GetName() in _CURVED and each.Get()]
        return str(targets[0]) if len(targets) == 1 else "", sign * given[0], sign * given[1], not more

    def _in_series(self, held: list[Held]) -> Iterator[Held]:
        """Joints of MuJoCo between the same two bodies one after the other, with bodies without mass between them."""
        groups: dict[tuple[int, int] | str, list[Held]] = {}
        for each in held:
            groups.setdefault((each.i[0], each.j[0]) if each.said.is_in_series else each.name, []).append(each)
        for some in groups.values():
            part = some[0].j[0]
            seen = self._poses[part].back().of(self._poses[some[0].i[0]])  # from the body below, where all are closed
            above = some[0].i[0]
            for each in some:
                each = each._replace(i=each.i if above == each.i[0] else (above, seen.of(each.i[1])))
                if each.name != some[-1].name:
                    own = self._parts[part - 1] if part else GROUND
                    above = self._add(f"{own} after {each.name}", self._poses[part])
                    each = each._replace(j=(above, each.j[1]))
                yield each

    def _gravity(self) -> tuple[float, float, float]:
        scenes = [prim for prim in self._prims if prim.IsA(self._physics.Scene)]
        way, size = -self._up, _EARTH
        if not scenes:
            self._notes.append(f"gravity, which the file does not say: {_EARTH:g} m/s^2 down")
        for scene in scenes[:1]:
            given = self._values(scene, "physics:gravityDirection", 3)
            value = float(self._values(scene, "physics:gravityMagnitude")[0])
            if not (np.all(np.abs(given) < LARGEST) and value < LARGEST):
                raise self._refuse("has a gravity that is no number. Correct its `physics:gravityMagnitude`")
            way = given / np.linalg.norm(given) if np.any(given) else way
            size = value * self._length if value >= 0 else size
        x, y, z = (size * way).tolist()
        return x, y, z


def _told(error: Exception) -> str:
    """An error of USD in a line; those of spoiled binary files may be in no encoding."""
    try:
        return printable(" ".join(str(getattr(error.args[0], "commentary", error)).split()))
    except UnicodeDecodeError:
        return "it holds text that is not in UTF-8"


def _applied(prim: UsdPrim) -> list[str]:
    """Schemas that are applied to a prim, those too that are not known here."""
    said = prim.GetMetadata("apiSchemas")
    return list(said.GetAddedOrExplicitItems()) if said else []


def _named(prims: list[UsdPrim]) -> list[str]:
    """Short names; of several that are alike the paths."""
    short_names = [prim.GetName() for prim in prims]
    paths = [str(prim.GetPath()).strip("/") for prim in prims]
    return unique([a if short_names.count(a) == 1 else b for a, b in zip(short_names, paths, strict=True)], ())
