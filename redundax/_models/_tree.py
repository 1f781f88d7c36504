"""The tree of bodies that a file describes: what its loops leave open, and joint positions that close them

Loops are closed by truncated Gauss-Newton steps in the positions of the joints, each the least that lessens the misfit,
so that bodies stay in their joints and joints of no loop where they are, however far the file is from closed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from .._tools._optional import optional

WITHOUT = "; the figures are without it"
_STEPS, _STARTS, _ENOUGH, _LONGEST = 200, 20, 5, 0.3  # the longest step: rad, and the share of the model's size
CLOSED = 1e-13  # a misfit relative to the size of the model, by rounding of some ten products
OPEN = 1e-4  # likewise: files of four digits close to that, and what misses by more does not close
DIGITS = 1e-6  # relative: numbers of a file may have no more digits, so that less tells nothing
_STILL = 1e-12  # steps that lead nowhere
_NEAR = 1e-3  # rad, or the share of the model's size
_TORQUE_SCALE = 10  # of a weld: where its data have it
_REACH = 0.8  # rad, or the share of the model's size: the largest of random displacements of joints


class End(NamedTuple):
    """Where a loop closes on a body: its index, a point and axes in its frame."""

    body: int
    point: np.ndarray
    axes: np.ndarray


class Loop(NamedTuple):
    """Two bodies closed at a point ("connect", or a weld whose torques count for nothing) or wholly ("weld")."""

    name: str
    kind: str
    first: End
    second: End


class Tie(NamedTuple):
    """Displacement of one joint as a polynomial of that of another, by their indices; of none, -1, a number."""

    name: str
    first: int
    second: int
    polynomial: np.ndarray


class Tree:
    """A model of MuJoCo with its loops and ties."""

    def __init__(self, model: Any, loops: list[Loop], ties: list[Tie]):
        self.model, self.loops, self.ties = model, loops, ties
        self._mujoco = optional("mujoco", "models")
        self._data = self._mujoco.MjData(model)
        data = self.at(model.qpos0)
        points = np.concatenate(
            [data.xanchor, data.xipos, *(self._world(end)[:1] for each in loops for end in each[2:])]
        )
        self.size = max(float(np.ptp(points, axis=0).max(initial=0.0)), 1e-3)  # a length of it

    def at(self, positions: np.ndarray) -> Any:
        """Poses of all bodies, points and axes of all joints, as MuJoCo's data."""
        self._data.qpos[:] = positions
        self._mujoco.mj_kinematics(self.model, self._data)
        self._mujoco.mj_comPos(self.model, self._data)
        return self._data

    def misfit(self, positions: np.ndarray) -> float:
        """The largest misfit, relative to the size of the model."""
        return float(np.abs(self.system(positions)[0]).max(initial=0.0)) / self.size

    def misfits(self, positions: np.ndarray) -> dict[str, float]:
        """How far each loop is from closed, m or rad, the larger."""
        self.at(positions)
        parts = [*map(self._gap, self.loops), *(self._lag(tie) for tie in self.ties)]
        names = [part.name for part in (*self.loops, *self.ties)]
        return {name: float(np.abs(part).max()) for name, part in zip(names, parts, strict=True)}

    def closed(self, start: np.ndarray | None = None, *, only_near: bool = False) -> tuple[np.ndarray, float]:
        """Joint positions that close all loops as well as the digits of the file allow, by the least steps from those
        given, or those of the file; and the largest misfit left, relative to the size of the model. Where that does not
        close them, and not `only_near`, they are the nearest found otherwise. A misfit of digits moves no joint far."""
        start = np.array(self.model.qpos0 if start is None else start)
        found = self.descend(start)
        if self.misfit(start) <= DIGITS and self._distance(start, found[0]) > _NEAR:
            found = self.descend(start, rcond=DIGITS / _NEAR)
        return found if only_near or found[1] <= OPEN else self._nearest(start, found)

    def _nearest(self, start: np.ndarray, found: tuple[np.ndarray, float]) -> tuple[np.ndarray, float]:
        """As `closed`, the nearest of some positions that joints of loops reach from random displacements; where none
        closes, the one that misses least, of these and the one given."""
        random, closed, in_loops = np.random.default_rng(0), [], self.in_loops()
        for trial in range(_STARTS):
            way = random.normal(scale=0.1 + trial / _STARTS, size=self.model.nv)
            other = self.descend(self.moved(start, np.where(in_loops, way, 0.0)))
            found = min(found, other, key=lambda each: each[1])
            closed += [self._drawn(other, start)] if other[1] <= OPEN else []
            if len(closed) == _ENOUGH:
                break
        best = [each for each in closed if each[1] <= max(found[1], DIGITS)]
        return min(best, key=lambda each: self._distance(start, each[0]), default=found)

    def _drawn(self, found: tuple[np.ndarray, float], start: np.ndarray) -> tuple[np.ndarray, float]:
        """From a closed position, one that is closed as well and nearer to another, by steps along the motions."""
        best, (positions, _), scale = found, found, self.scale()
        for _ in range(_STEPS):
            residual, slope = self.system(positions)
            wish = self.difference(positions, start) / scale
            step = wish - np.linalg.lstsq(slope * scale, residual + slope * scale @ wish, rcond=DIGITS)[0]
            length = float(np.abs(step).max())
            positions = self.moved(positions, scale * step * min(1.0, _LONGEST / max(length, _STILL)))
            if length < _LONGEST:
                nearer = self.descend(positions)
                if nearer[1] > OPEN or self._distance(start, nearer[0]) > (1 - DIGITS) * self._distance(start, best[0]):
                    break
                best, (positions, _) = nearer, nearer
        return best

    def _distance(self, start: np.ndarray, positions: np.ndarray) -> float:
        return float(np.linalg.norm(self.difference(start, positions) / self.scale()))

    def in_loops(self) -> np.ndarray:
        """Which velocities of joints move some loop or tie in itself, (nv,)."""
        model, found = self.model, np.zeros(self.model.nv, dtype=bool)
        for loop in self.loops:
            first, second = (self._above(end.body) for end in (loop.first, loop.second))
            found |= first ^ second
        for joint in (joint for tie in self.ties for joint in (tie.first, tie.second) if joint >= 0):
            found[model.jnt_dofadr[joint]] = True
        return found

    def _above(self, body: int) -> np.ndarray:
        """Which velocities of joints move a body."""
        found = np.zeros(self.model.nv, dtype=bool)
        while body:
            first = int(self.model.body_dofadr[body])
            found[first : first + int(self.model.body_dofnum[body])] |= first >= 0
            body = int(self.model.body_parentid[body])
        return found

    def elsewhere(
        self, positions: np.ndarray, left: float, count: int, is_within: Callable[[np.ndarray], bool] | None = None
    ) -> list[np.ndarray]:
        """Other positions that close the loops as well as these do, or as the digits of the file allow, from random
        displacements along the motions, those first that are within limits; fewer where they are not found."""
        random, found, beyond, scale = np.random.default_rng(1), [], [], self.scale()
        _, values, basis = np.linalg.svd(self.system(positions)[1] * scale)
        free = basis[int(np.sum(values > DIGITS * values.max(initial=0.0))) :]
        for trial in range(4 * count):
            reach, way = _REACH / (1 + trial // count), random.normal(size=self.model.nv)
            way = free.T @ (free @ way) if len(free) else way  # what cannot move may close otherwise
            start = self.moved(positions, reach * scale * way / np.abs(way).max())
            other, misfit = self.descend(start)
            if misfit <= max(10 * left, DIGITS / 10) and np.abs(other - positions).max() > 1e-3 * reach:
                (found if is_within is None or is_within(other) else beyond).append(other)
            if len(found) == count:
                break
        return (found + beyond)[:count]

    def motion(self, positions: np.ndarray, freedom: int) -> tuple[np.ndarray, float]:
        """Velocities of the joints, relative to `scale`, that the loops leave, (nv, freedom); and the smallest singular
        value kept, relative to the largest."""
        _, values, basis = np.linalg.svd(self.system(positions)[1] * self.scale())
        rank = self.model.nv - freedom
        return basis[rank:].T, float(values[rank - 1] / values[0]) if rank else 1.0

    def drives(self, positions: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of the drives, and their rates by the velocities of the joints, (drives, nv)."""
        data, model = self.at(positions), self.model
        self._mujoco.mj_tendon(model, data)
        self._mujoco.mj_transmission(model, data)
        rates = np.zeros((model.nu, model.nv))
        for k, (first, count) in enumerate(zip(data.moment_rowadr, data.moment_rownnz, strict=True)):
            entries = slice(first, first + count)
            rates[k, data.moment_colind[entries]] = data.actuator_moment.ravel()[entries]
        return tuple(model.actuator(k).name or f"drive {k + 1}" for k in range(model.nu)), rates

    def descend(self, positions: np.ndarray, steps: int = _STEPS, rcond: float = DIGITS) -> tuple[np.ndarray, float]:
        """Positions that close the loops, from these on, and the largest misfit left, relative to the size."""
        left = 0.0
        for _ in range(steps if self.loops or self.ties else 0):
            residual, slope = self.system(positions)
            left = float(np.abs(residual).max()) / self.size
            if left < CLOSED:
                break
            step = -np.linalg.lstsq(slope, residual, rcond=rcond)[0]
            length = float(np.abs(step / self.scale()).max())
            if length < _STILL:
                break
            step *= min(1.0, _LONGEST / length)
            positions = self.moved(positions, step)
        return positions, left

    def moved(self, positions: np.ndarray, step: np.ndarray) -> np.ndarray:
        positions = np.array(positions)
        self._mujoco.mj_integratePos(self.model, positions, step, 1.0)
        return positions

    @property
    def rows(self) -> int:
        """How many conditions the loops and ties set."""
        return sum(3 if loop.kind == "connect" else 6 for loop in self.loops) + len(self.ties)

    def difference(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Displacements that lead from one position to another, as velocities for a unit of time."""
        step = np.zeros(self.model.nv)
        self._mujoco.mj_differentiatePos(self.model, step, 1.0, before, after)
        return step

    def joint_kind(self, joint: int) -> str:
        """Free, ball, slide or hinge."""
        return ("free", "ball", "slide", "hinge")[int(self.model.jnt_type[joint])]

    def joint_name(self, joint: int) -> str:
        """As in the file, or of its body."""
        body = int(self.model.jnt_bodyid[joint])
        return (
            self.model.joint(joint).name
            or f"{self.joint_kind(joint)} of {self.model.body(body).name or f'body {body}'}"
        )

    def scale(self) -> np.ndarray:
        """Of a long step of each joint: the size of the model for one that slides, 1 for one that turns."""
        kinds = self._mujoco.mjtJoint
        slides = np.isin(self.model.jnt_type, [kinds.mjJNT_SLIDE, kinds.mjJNT_FREE])[self.model.dof_jntid]
        return np.where(slides, self.size, 1.0)

    def system(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual of all loops and ties, and its derivative by the velocities of the joints."""
        data = self.at(positions)
        residuals, slopes = [np.zeros(0), *map(self._gap, self.loops)], [np.zeros((0, self.model.nv))]
        for loop in self.loops:
            parts = []
            for end in (loop.first, loop.second):
                rates = np.zeros((2, 3, self.model.nv))
                self._mujoco.mj_jac(self.model, data, rates[0], rates[1], self._world(end)[0], end.body)
                parts.append(rates[: 2 if loop.kind == "weld" else 1].reshape(-1, self.model.nv))
            slopes.append(parts[0] - parts[1])
        for tie in self.ties:
            row = np.zeros((1, self.model.nv))
            row[0, self.model.jnt_dofadr[tie.first]] = 1.0
            if tie.second >= 0:
                slope = np.polyval(np.polyder(tie.polynomial[::-1]), self._displacement(tie.second))
                row[0, self.model.jnt_dofadr[tie.second]] -= slope
            residuals.append(self._lag(tie))
            slopes.append(row)
        return np.concatenate(residuals), np.concatenate(slopes)

    def _world(self, end: End) -> tuple[np.ndarray, np.ndarray]:
        """Point and axes of an end in the global frame, at the positions taken last."""
        axes = self._data.xmat[end.body].reshape(3, 3)
        return self._data.xpos[end.body] + axes @ end.point, axes @ end.axes

    def _gap(self, loop: Loop) -> np.ndarray:
        (point, axes), (other, others) = self._world(loop.first), self._world(loop.second)
        if loop.kind == "connect":
            return point - other
        return np.concatenate([point - other, self._turn(axes @ others.T)])

    def _turn(self, turned: np.ndarray) -> np.ndarray:
        """Rotation vector of a rotation matrix."""
        quaternion, vector = np.zeros(4), np.zeros(3)
        self._mujoco.mju_mat2Quat(quaternion, turned.ravel())
        self._mujoco.mju_quat2Vel(vector, quaternion, 1.0)
        return vector

    def _displacement(self, joint: int) -> float:
        place = self.model.jnt_qposadr[joint]
        return float(self._data.qpos[place] - self.model.qpos0[place])

    def _lag(self, tie: Tie) -> np.ndarray:
        other = self._displacement(tie.second) if tie.second >= 0 else 0.0
        wanted = np.polyval(tie.polynomial[::-1], other)
        return np.array([self._displacement(tie.first) - wanted])


def tree_of(model: Any) -> tuple[Tree, list[str]]:
    """The tree of a model, and which of its constraints are left out, a line each."""
    mujoco, loops, ties, notes = optional("mujoco", "models"), [], [], []
    for k in range(model.neq):
        kind, (one, two) = mujoco.mjtEq(model.eq_type[k]), (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
        if kind == mujoco.mjtEq.mjEQ_JOINT:
            name = _named(model, k, "couple", model.joint(one).name, model.joint(two).name if two >= 0 else "0")
            if all(mujoco.mjtJoint(model.jnt_type[joint]) in _single(mujoco) for joint in (one, two) if joint >= 0):
                ties.append(Tie(name, one, two, model.eq_data[k, :5].copy()))
            else:
                notes.append(f"constraint '{name}' is left out: it does not couple two hinges or slides{WITHOUT}")
            continue
        word = "weld" if kind == mujoco.mjtEq.mjEQ_WELD else "connect"
        of_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
        ends = _site_ends(model, one, two) if of_sites else _body_ends(model, word, one, two, model.eq_data[k])
        names = (model.site if of_sites else model.body)(one).name, (model.site if of_sites else model.body)(two).name
        name = _named(model, k, word, *names)
        if root_of(model, ends[0].body) == root_of(model, ends[1].body):
            notes.append(f"constraint '{name}' is left out: the file fixes both of its bodies to each other")
        else:
            holds_turns = word == "weld" and model.eq_data[k, _TORQUE_SCALE] != 0
            loops.append(Loop(name, "weld" if holds_turns else "connect", *ends))
    moved = [model.body(body).name or f"body {body}" for body in range(model.nbody) if model.body_mocapid[body] >= 0]
    if moved:
        notes.append(f"motion from outside (mocap) of {', '.join(moved)}: they rest where the file has them")
    parts = [*loops, *ties]
    parts = [
        part._replace(name=name) for part, name in zip(parts, unique([part.name for part in parts], ()), strict=True)
    ]
    return Tree(model, parts[: len(loops)], parts[len(loops) :]), notes


def root_of(model: Any, body: int) -> int:
    """The body with joints that this one is fixed to, or 0 for the ground, to which bodies moved from outside count."""
    root = int(model.body_weldid[body])
    return root if model.body_jntnum[root] else 0


def _named(model: Any, k: int, word: str, one: str, two: str) -> str:
    return model.equality(k).name or f"{word} {one} ~ {two}"


def _single(mujoco: Any) -> tuple[Any, Any]:
    """Kinds of joints with one displacement."""
    return mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE


def _site_ends(model: Any, one: int, two: int) -> tuple[End, End]:
    first, second = (
        End(int(model.site_bodyid[site]), model.site_pos[site].copy(), _axes(model.site_quat[site]))
        for site in (one, two)
    )
    return first, second


def _body_ends(model: Any, word: str, one: int, two: int, data: np.ndarray) -> tuple[End, End]:
    if word == "connect":
        return End(one, data[:3].copy(), np.eye(3)), End(two, data[3:6].copy(), np.eye(3))
    return End(one, data[3:6].copy(), _axes(data[6:10])), End(two, data[:3].copy(), np.eye(3))


def _axes(quaternion: np.ndarray) -> np.ndarray:
    mujoco, axes = optional("mujoco", "models"), np.zeros(9)
    mujoco.mju_quat2Mat(axes, quaternion / np.linalg.norm(quaternion))
    return axes.reshape(3, 3)


def unique(names: list[str], taken: Any) -> list[str]:
    """The names, with a number after those that occur before."""
    found: list[str] = []
    for name in names:
        number, own = 1, name
        while own in found or own in taken:
            number += 1
            own = f"{name} ({number})"
        found.append(own)
    return found


def missing_of(notes: list[str] | tuple[str, ...]) -> list[str]:
    """Of what is left out, that which constrains."""
    return [note.partition(" is left out")[0] for note in notes if note.endswith(WITHOUT)]
