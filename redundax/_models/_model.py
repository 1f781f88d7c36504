"""Models from files as mechanisms in space."""

import dataclasses
import os
import pathlib
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Array, Float

from .._bodies._coupler import Coupler, Stop
from .._bodies._joints import AbstractJoint
from .._bodies._loads import AbstractLoad
from .._bodies._mechanism import Mechanism
from .._bodies._space._body import Body
from .._bodies._speed_driver import SpeedDriver
from .._system._names import Named, index_of
from .._system._state import State
from .._tools._errors import NoSolutionError, RedundaxError
from .._tools._module import Numbers, check_kind, finite, floats, on_device
from .._tools._table import text_of
from .._tools._words import printable, warn
from ._build import Added, bodies_of, mechanism_of, position_of
from ._content import refusal
from ._description import CLOSING, WITHOUT, Description, missing_of
from ._formats import describe
from ._mujoco_run import run
from ._series import Series
from ._start import Limit, Start, outside, start
from ._tree import OPEN, Tree
from ._urdf import closures_of

STOPS = "stops at the limits"  # of which a note tells that they bear no load
_CLOSED = 1e-12  # a misfit relative to the size of the model, by rounding alone
_MOVED = 1e-9  # rad, or the share of the model's size: what rounding of a misfit moves, where joints have some leverage


class LeftOutWarning(UserWarning):
    """Something that constrains is not in the mechanism; an audit says so in its first line."""


@dataclasses.dataclass(frozen=True)
class Model:
    """What `load_model` makes of a file.

    - `mechanism`: with the names of the file.
    - `state`: a closed one at rest, the file's own position, or that of a keyframe, moved as little as closing asks.
    - `notes`: what was left out, a line each.
    - `joints`: names of the joints of the file, by kind: "hinge", "slide", "ball", "free", or others.
    - `loops`: names of what closes loops, by kind: "connect", "weld", "coupling", or as joints.
    - `misfits`: how far each of them is from closed in the file, m or rad, whichever is more.
    - `moved`: how far joints were moved to close them, rad or m, by their names; empty where that was not needed.
    - `keyframe`: that of the file which `state` is, or "" for the position where all joints are as the file draws them.
    - `keyframes`: names of all that the file has; one without a name is "keyframe 1", by its place.
    - `outside`: limits of joints that `state` is beyond: joint, position and limit, rad or m, as the file counts them.
    - `is_near`: whether the state was found by the least steps from the file; otherwise from random ones, the nearest.
    - `tree`: its bodies and joints as the file has them; `positions`: of the joints in `state`, as the file counts
      them; `left`: how far from closed it is, relative to the size of the model.
    - `path`, `closures`: the file, and that of the loops of a URDF.

    ??? example

        ```python
        import pathlib

        swing = '<body name="swing"><joint name="pin" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
        pathlib.Path("swing.xml").write_text(f"<mujoco><worldbody>{swing}</worldbody></mujoco>")
        model = rx.load_model("swing.xml")
        turned = rx.assemble(model.mechanism, model.guess({"pin": 0.5}))
        print(rx.analyze(model.mechanism, turned))
        ```
    """

    mechanism: Mechanism
    state: State
    notes: tuple[str, ...]
    joints: dict[str, tuple[str, ...]]
    loops: dict[str, tuple[str, ...]]
    misfits: dict[str, float]
    moved: dict[str, float]
    keyframe: str
    keyframes: tuple[str, ...]
    outside: tuple[Limit, ...]
    is_near: bool
    tree: Tree = dataclasses.field(repr=False, compare=False)
    positions: np.ndarray = dataclasses.field(repr=False, compare=False)
    left: float = dataclasses.field(repr=False, compare=False)
    path: pathlib.Path = dataclasses.field(compare=False)
    closures: pathlib.Path | None = dataclasses.field(compare=False)

    def __str__(self) -> str:
        """What the file has, how far joints were moved to close it, what was left out, and the mechanism."""
        has = contents(len(self.mechanism.names.bodies), self.joints, self.loops)
        moved = [f"moved to close it: {name} by {size:.2g} (rad or m)" for name, size in self.moved.items()]
        notes = [note if " is left out" in note else f"left out: {note}" for note in self.notes]
        return printable(text_of([f"{self.path.name}: {has}", *moved, *notes, str(self.mechanism)]))

    def guess(self, positions: Mapping[str, Numbers]) -> Float[Array, " q"]:
        """Coordinates q of the mechanism with joints at given positions, to start `rx.assemble` from.

        **Arguments:**

        - `positions`: by the name of the joint in the file, or of its coordinate, as the file counts them: the angle of
          a hinge, rad, the travel of a slide, m, the quaternion (w, x, y, z) of a ball; position and quaternion of a
          free joint. Others stay as in `state`.
        """
        chosen, tree = self.positions.copy(), self.tree
        places = {joint.name: (joint, place) for joint, place in zip(tree.joints, tree.places, strict=True)}
        for name, value in positions.items():
            plain = name if name in places else name.removesuffix(".angle").removesuffix(".travel")
            index_of("positions", plain, list(places), " of joints")
            joint, place = places[plain]
            finite("positions", floats(value, "positions"), f"'{name}'")
            if np.size(value) != (size := place.stop - place.start):
                raise RedundaxError(
                    f"Argument `positions` must hold {size} for the {joint.kind} '{name}', but holds {np.size(value)}. "
                    "Give as many."
                )
            chosen[place] = np.ravel(value)
        return on_device(floats(position_of(tree, self.mechanism, chosen)))

    def elsewhere(self, count: int = 3) -> list[State]:
        """States at rest at other positions of the joints, at random, always the same; those within limits of joints
        first, and fewer if not found.

        **Arguments:**

        - `count`: how many.
        """
        return [state for _, state in self.beside(count)]

    def beside(self, count: int) -> list[tuple[np.ndarray, State]]:
        """The states of `elsewhere`, with the positions of the joints as the file counts them."""
        found = self.tree.elsewhere(self.positions, self.left, count, lambda at: not outside(self.tree, at))
        return [(positions, _state(self.tree, self.mechanism, positions)) for positions in found]

    @property
    def is_whole(self) -> bool:
        """Whether all that the file constrains is in the mechanism."""
        return not any(note.endswith(WITHOUT) for note in self.notes)

    @property
    def driven(self) -> Mechanism:
        """The mechanism with the motions that the file gives by laws of time, as drivers; it has more rows."""
        return mechanism_of(self.described, driven=True)[0]

    @property
    def stopped(self) -> Mechanism:
        """The mechanism with the limits of hinges and slides as stops, which only push and are named "stop of" the
        joint: for `solve` and `analyze`, which tell which of them carry."""
        return mechanism_of(self.described, stopped=True)[0]

    @property
    def bodies(self) -> dict[str, Body]:
        """The moving bodies by their names, for joints and loads that `extended` adds."""
        return Named((body.name, body) for body in bodies_of(self.described))

    def extended(
        self,
        joints: Sequence[AbstractJoint] = (),
        *,
        couplers: Sequence[Coupler | Stop | SpeedDriver] = (),
        loads: Sequence[AbstractLoad] = (),
        friction: Mapping[str, object] | None = None,
    ) -> Mechanism:
        """The mechanism with parts that the file does not have: feet on a floor, stops, drives, loads, friction.

        Global points and axes are those of the pose that the file draws; `bodies` are what they need. Coordinates are
        those of `mechanism`, so that `guess` serves.

        ??? example

            ```python
            leg = model.bodies["leg"]
            foot = rx.spatial.PointOnPlane("foot", leg, "ground", (0.2, 0, 0), axis=(0, 0, 1), one_sided=True)
            standing = model.extended([foot])
            print(rx.solve(standing, rx.assemble(standing, model.guess({}))).contacts)
            ```

        **Arguments:**

        - `joints`, `couplers`, `loads`: those of `rx.Mechanism`, in space.
        - `friction`: of joints of the file by their names, as arguments of their constructors in `rx.spatial`, in place
          of what the file says: {"guide": {"friction": rx.Coulomb(0.1), "guide_length": 0.08}}.
        """
        added = Added(joints, couplers, loads)
        for name, given in added._asdict().items():
            check_kind(name, given, Sequence, "a list", f"Write it with brackets, as in `{name}=[...]`.")
        return mechanism_of(self.described, added=added, rubbing={} if friction is None else friction)[0]

    @property
    def series(self) -> Series | None:
        """What a program has stored of a run in the file: positions of bodies and reactions of joints over time."""
        return self.described.series

    def run(self, seconds: float) -> Series:
        """A run of the model by MuJoCo, from rest where it is, as `series`: of MJCF, and of URDF with loops beside it.

        Loads are those of MuJoCo's constraint forces, which make loops soft; contact, limits of joints and drives are
        switched off.
        """
        return run(self.tree, self.positions, seconds)

    @property
    def described(self) -> Description:
        """What the file says."""
        return self.tree.description


def contents(bodies: int, *parts: Mapping[str, Sequence[str]]) -> str:
    """What a model has, as in "3 bodies; 3 hinges, 1 connect", of names by kind."""
    kinds = Counter(kind for part in parts for kind, names in part.items() for _ in names)
    counts = [f"{count} {kind}{'s' * (count > 1)}" for kind, count in kinds.items()]
    return f"{bodies} {'body' if bodies == 1 else 'bodies'}; {', '.join(counts)}"


def load_model(
    path: str | pathlib.Path, closures: str | pathlib.Path | None = None, *, keyframe: str | None = None
) -> Model:
    """A mechanism in space, closed, from a file of MJCF (.xml), URDF, SDF, ASMT or USD; `redundax[models]` reads the
    first two, `redundax[usd]` the last.

    Constraints that MuJoCo makes soft, `connect`, `weld` and `joint`, are ideal here. Bodies that the file fixes to
    others are one with them. Springs, damping, gravity and armature act; contact, limits of joints, sensors, forces of
    drives and meshes are left out, as `notes` of the result say.

    The position of the file is kept, and moved as little as closing its loops asks; joints of no loop stay. If it is
    beyond limits of joints, or does not close, and a keyframe does better, then that is taken, and `keyframe` of the
    result names it.

    ??? example

        ```python
        import pathlib

        swing = '<body name="swing"><joint name="pin" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/></body>'
        pathlib.Path("swing.xml").write_text(f"<mujoco><worldbody>{swing}</worldbody></mujoco>")
        model = rx.load_model("swing.xml")
        rx.solve(model.mechanism, model.state)
        model.notes  # what was left out, a line each
        ```

    **Arguments:**

    - `path`: the file. Meshes may be missing.
    - `closures`: a YAML file with the loops of a URDF, which has none of its own: `closed_loop`, pairs of names of
      links or joints, whose frames coincide (`type` 6d) or have one origin (3d); `joint_name` and `joint_type`, joints
      that become SPHERICAL, UJOINT_XY or FIXED. By default the file beside it of the same name that ends in .yaml.
    - `keyframe`: the name of the keyframe to begin from, of a file of MJCF.

    **Raises:** `ValueError` for a file that cannot be read, `RuntimeError` for loops that do not close. It warns of
    what constrains and is not read.
    """
    check_kind("path", path, (str, os.PathLike), "the name of a file", 'Write "gripper.xml", say.')
    path = pathlib.Path(path)
    loops = closures_of(path, closures)
    described = describe(path, loops)
    _tell_missing(path, described.notes)
    if not described.joints:
        beside = "".join(f" beside {each}, which is not read" for each in missing_of(described.notes)[:1])
        raise refusal(path, f"has no joints{beside}, so nothing that moves. Add some")
    if all(joint.kind == "free" for joint in described.joints) and not (described.loops or described.ties):
        raise refusal(path, "has free bodies alone, so nothing that constrains. Add joints or loops")
    tree = Tree(described)
    first = start(tree, keyframe)
    _check_closed(path, tree, first)
    _tell_misfit(path, tree.misfits(first.positions), first.left)
    mechanism, others = mechanism_of(described)
    limited = sum(part.limits is not None for part in (*described.joints, *described.loops))
    for count, what in ((limited, "joint"), (len(described.cables), "tendon")):
        if count:
            others.append(f"{STOPS} of {count} {what}{'s' * (count > 1)}, which bear no load here")
    return Model(
        mechanism,
        _state(tree, mechanism, first.positions),
        (*described.notes, *others),
        _by_kind([(joint.kind, joint.name) for joint in described.joints]),
        _by_kind([*((loop.kind, loop.name) for loop in tree.loops), *(("coupling", tie.name) for tie in tree.ties)]),
        tree.misfits(first.given),
        _moved(tree, first),
        first.keyframe,
        tuple(described.keyframes),
        first.outside,
        first.is_near,
        tree,
        first.positions,
        first.left,
        path,
        loops,
    )


def _check_closed(path: pathlib.Path, tree: Tree, first: Start) -> None:
    """Refuse loops that nothing closes, and name them."""
    if first.left > OPEN:
        worst = sorted(tree.misfits(first.positions).items(), key=lambda item: -item[1])
        told = ", ".join(f"'{name}' by {misfit:.2g}" for name, misfit in worst[:4] if misfit > OPEN * tree.size)
        moved = [note for note in tree.description.notes if note.startswith(CLOSING)]
        there = f" Other joints are open in the file, too: {'; '.join(moved[:4])}." if moved else ""
        raise NoSolutionError(
            f"The loops of '{path}' cannot be closed: the nearest position leaves open {told} (m or rad).{there} "
            "Correct lengths, anchors or loops."
        )


def _moved(tree: Tree, first: Start) -> dict[str, float]:
    """How far each joint is from where the file has it, the largest of its velocities, beyond rounding."""
    steps = np.abs(tree.difference(first.given, first.positions))
    steps = np.where(steps > _MOVED * tree.scale, steps, 0.0)
    return {
        joint.name: float(steps[dofs].max())
        for joint, dofs in zip(tree.joints, tree.dofs, strict=True)
        if steps[dofs].any()
    }


def _state(tree: Tree, mechanism: Mechanism, positions: np.ndarray) -> State:
    """At rest; joints hold to rounding at any positions, and loops as these close them."""
    q = floats(position_of(tree, mechanism, positions))
    return State(on_device(q), on_device(np.zeros(len(mechanism.coordinates), q.dtype)))


def _tell_misfit(path: pathlib.Path, misfits: dict[str, float], left: float) -> None:
    """Warn of loops that close to the digits of a file only."""
    if left > _CLOSED:
        worst = max(misfits, key=lambda name: misfits[name])
        warn(
            f"The loops of '{path}' close to {misfits[worst]:.1g} m or rad only, '{worst}' worst: numbers of the file "
            "have few digits. Give it all digits, unless they are measured."
        )


def _tell_missing(path: pathlib.Path, notes: tuple[str, ...]) -> None:
    """Warn of what constrains and is not in the mechanism."""
    if missing := missing_of(notes):
        warn(
            f"'{path}' is read without {', '.join(missing)}, which may constrain: `notes` of the model say more.",
            LeftOutWarning,
        )


def _by_kind(named: list[tuple[str, str]]) -> dict[str, tuple[str, ...]]:
    return {kind: tuple(name for of, name in named if of == kind) for kind in dict.fromkeys(kind for kind, _ in named)}
