"""What is read of MuJoCo's objects, whose types no checker knows: a model, its data, and a specification to change"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np


@runtime_checkable
class Named(Protocol):
    """An element by its name and number."""

    name: str
    id: int


@runtime_checkable
class Options(Protocol):
    """How a model is run."""

    gravity: np.ndarray
    timestep: float
    disableflags: int
    viscosity: float
    density: float


@runtime_checkable
class MujocoModel(Protocol):
    """A compiled model, `MjModel`: how many elements it has of each kind, and arrays over those."""

    nbody: int
    neq: int
    njnt: int
    nkey: int
    nu: int
    nv: int
    names: bytes
    opt: Options
    body_gravcomp: np.ndarray
    body_inertia: np.ndarray
    body_jntadr: np.ndarray
    body_jntnum: np.ndarray
    body_mass: np.ndarray
    body_mocapid: np.ndarray
    body_parentid: np.ndarray
    body_rootid: np.ndarray
    body_weldid: np.ndarray
    dof_armature: np.ndarray
    dof_damping: np.ndarray
    dof_frictionloss: np.ndarray
    eq_data: np.ndarray
    eq_obj1id: np.ndarray
    eq_obj2id: np.ndarray
    eq_objtype: np.ndarray
    eq_type: np.ndarray
    jnt_bodyid: np.ndarray
    jnt_dofadr: np.ndarray
    jnt_limited: np.ndarray
    jnt_qposadr: np.ndarray
    jnt_range: np.ndarray
    jnt_stiffness: np.ndarray
    jnt_type: np.ndarray
    key_qpos: np.ndarray
    qpos0: np.ndarray
    qpos_spring: np.ndarray
    site_bodyid: np.ndarray
    site_pos: np.ndarray
    site_quat: np.ndarray
    tendon_adr: np.ndarray
    tendon_length0: np.ndarray
    tendon_limited: np.ndarray
    tendon_num: np.ndarray
    tendon_range: np.ndarray
    wrap_objid: np.ndarray
    wrap_prm: np.ndarray
    wrap_type: np.ndarray

    def __copy__(self) -> "MujocoModel": ...
    def actuator(self, which: int, /) -> Named: ...
    def body(self, which: int, /) -> Named: ...
    def equality(self, which: int, /) -> Named: ...
    def joint(self, which: int, /) -> Named: ...
    def key(self, which: int, /) -> Named: ...
    def site(self, which: int | str, /) -> Named: ...
    def tendon(self, which: int, /) -> Named: ...


@runtime_checkable
class MujocoData(Protocol):
    """A state of a model and what follows of it, `MjData`."""

    time: float
    actuator_moment: np.ndarray
    cfrc_int: np.ndarray
    efc_force: np.ndarray
    efc_id: np.ndarray
    efc_type: np.ndarray
    moment_colind: np.ndarray
    moment_rowadr: np.ndarray
    moment_rownnz: np.ndarray
    qacc: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    site_xmat: np.ndarray
    subtree_com: np.ndarray
    xanchor: np.ndarray
    xaxis: np.ndarray
    ximat: np.ndarray
    xipos: np.ndarray
    xmat: np.ndarray
    xpos: np.ndarray
    xquat: np.ndarray


@runtime_checkable
class AbstractSpecElement(Protocol):
    """An element of a specification; `parent` is the body that it is on."""

    name: str

    @property
    def parent(self) -> "SpecBody": ...


@runtime_checkable
class SpecJoint(AbstractSpecElement, Protocol):
    """A joint, by its kind of MuJoCo's enumeration."""

    type: int


@runtime_checkable
class SpecBody(Protocol):
    """A body."""

    name: str
    mass: float
    inertia: np.ndarray
    fullinertia: np.ndarray
    gravcomp: float
    explicitinertial: bool
    joints: Sequence[SpecJoint]

    @property
    def parent(self) -> "SpecBody | None": ...
    def add_joint(self, **given: object) -> SpecJoint: ...
    def add_site(self, **given: object) -> AbstractSpecElement: ...


@runtime_checkable
class SpecGeom(AbstractSpecElement, Protocol):
    """A shape."""

    meshname: str
    hfieldname: str
    material: str
    mass: float
    density: float
    group: int


@runtime_checkable
class SpecEnumerator(Protocol):
    """A value of one of MuJoCo's enumerations."""

    name: str


@runtime_checkable
class SpecEquality(Protocol):
    """A constraint."""

    name: str
    name1: str
    name2: str
    active: bool
    type: SpecEnumerator
    objtype: SpecEnumerator


@runtime_checkable
class SpecKey(Protocol):
    """A keyframe."""

    name: str
    qpos: np.ndarray


@runtime_checkable
class SpecActuator(Protocol):
    """A drive, by what it acts on."""

    trntype: SpecEnumerator


@runtime_checkable
class SpecMaterial(Protocol):
    """What is painted."""

    material: str


@runtime_checkable
class SpecLengths(Protocol):
    """How ranges of lengths are found."""

    mode: int


@runtime_checkable
class SpecCompiler(Protocol):
    """How a specification is compiled."""

    fusestatic: bool
    discardvisual: bool
    boundmass: float
    boundinertia: float
    balanceinertia: bool
    inertiafromgeom: int
    inertiagrouprange: np.ndarray
    LRopt: SpecLengths


@runtime_checkable
class MujocoSpec(Protocol):
    """A specification, `MjSpec`, whose elements are deleted and added."""

    actuators: Sequence[SpecActuator]
    bodies: Sequence[SpecBody]
    compiler: SpecCompiler
    equalities: Sequence[SpecEquality]
    geoms: Sequence[SpecGeom]
    hfields: Sequence[Named]
    joints: Sequence[SpecJoint]
    keys: Sequence[SpecKey]
    lights: Sequence[Named]
    materials: Sequence[Named]
    meshes: Sequence[Named]
    option: Options
    plugins: Sequence[Named]
    sites: Sequence[SpecMaterial]
    tendons: Sequence[SpecMaterial]
    textures: Sequence[Named]
    worldbody: SpecBody

    def add_actuator(self, **given: object) -> SpecActuator: ...
    def add_equality(self, **given: object) -> SpecEquality: ...
    def body(self, name: str, /) -> SpecBody | None: ...
    def compile(self) -> MujocoModel: ...
    def delete(self, element: object, /) -> None: ...
    def joint(self, name: str, /) -> SpecJoint | None: ...
    def site(self, name: str, /) -> AbstractSpecElement | None: ...
