"""A model of MuJoCo, described without it: what MJCF and URDF are read to"""

import itertools
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import NamedTuple

import numpy as np

from .._bodies._body import GROUND
from .._bodies._space._rotation import rotation
from .._tools._optional import optional
from ._description import WITHOUT, Body, Description, End, Joint, Loop, Term, Tie, unique
from ._kinds import KINDS
from ._mujoco_types import MujocoData, MujocoModel
from ._vectors import axes_of

LEAST = 1e-14  # kg and kg m^2: less is no mass at all, which MuJoCo takes for no moving body
TORQUE_SCALE = 10  # of a weld: where its data have it
_KINDS = ("free", "ball", "slide", "hinge")  # of joints, as MuJoCo numbers them


class Origin(NamedTuple):
    """MuJoCo's model, whose joints are those of the description, and which of its equalities a loop is, by name."""

    model: MujocoModel
    equalities: dict[str, int]


def described(
    form: str, model: MujocoModel, notes: Sequence[str], closed: Sequence[tuple[str, str, str, str, bool]] = ()
) -> Description:
    """The description of a model of a format; see `by_mujoco`."""
    mujoco = optional("mujoco", "models")
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    movers = [k for k in range(1, model.nbody) if model.body_jntnum[k]]
    number = {0: 0} | {k: int(model.body_jntadr[k] + model.body_jntnum[k]) for k in movers}
    read = _Read(mujoco, model, data, number)
    loops, ties, places, more = read.constraints()
    for name, kind, one, two, coincide in closed:
        first, second = read.site_ends(model.site(one).id, model.site(two).id)
        loops.append(Loop(name, kind, second._replace(body=first.body) if coincide else first, second))
    names = unique([part.name for part in (*loops, *ties)], ())
    loops = [loop._replace(name=name) for loop, name in zip(loops, names, strict=False)]
    ties = [tie._replace(name=name) for tie, name in zip(ties, names[len(loops) :], strict=True)]
    names += [term.name for tie in ties for term, _ in (*tie.first, *tie.second) if isinstance(term, Loop)]
    joint_names = unique([_joint_name(model, joint) for joint in range(model.njnt)], names)
    swapped = model.jnt_range[:, 0] > model.jnt_range[:, 1]
    if form == "MJCF" and swapped.any():  # of a URDF they are told with its own words
        swapped_names = ", ".join(itertools.compress(joint_names, swapped))
        more.append(f"limits of {swapped_names}, least above largest: taken as none")
    return Description(
        form,
        tuple(read.bodies(movers, joint_names)),
        tuple(read.joint(k, name) for k, name in enumerate(joint_names)),
        tuple(loops),
        tuple(ties),
        tuple(model.opt.gravity.tolist()),
        tuple(model.actuator(k).name or f"drive {k + 1}" for k in range(model.nu)),
        lambda positions: _rates(mujoco, model, positions),
        np.concatenate([data.xanchor, data.xipos]),
        _keyframes(mujoco, model),
        (*more, *notes),
        is_soft=True,
        cables=tuple(read.cables()),
        lifts=tuple(
            (number[root_of(model, k)], data.xipos[k].copy(), -model.body_gravcomp[k] * mass * model.opt.gravity)
            for k, mass in enumerate(model.body_mass)
            if model.body_gravcomp[k] and root_of(model, k) and mass > 2 * LEAST
        ),
        origin=Origin(model, places),
    )


def root_of(model: MujocoModel, body: int) -> int:
    """The body with joints that this one is fixed to, or 0 for the ground, to which bodies moved from outside count."""
    root = int(model.body_weldid[body])
    return root if model.body_jntnum[root] else 0


def _rates(mujoco: ModuleType, model: MujocoModel, positions: np.ndarray) -> np.ndarray:
    """Of the drives by the velocities of the joints."""
    data, rates = mujoco.MjData(model), np.zeros((model.nu, model.nv))
    if not model.nu:
        return rates
    data.qpos[:] = positions
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    mujoco.mj_transmission(model, data)
    for k, (first, count) in enumerate(zip(data.moment_rowadr, data.moment_rownnz, strict=True)):
        entries = slice(first, first + count)
        rates[k, data.moment_colind[entries]] = data.actuator_moment.ravel()[entries]
    return rates


def _keyframes(mujoco: ModuleType, model: MujocoModel) -> dict[str, np.ndarray]:
    """Positions of joints that the keyframes give, by their names."""
    found = {}
    for key in range(model.nkey):
        found[model.key(key).name] = positions = model.key_qpos[key].copy()
        mujoco.mj_normalizeQuat(model, positions)
    return found


def _joint_name(model: MujocoModel, joint: int) -> str:
    """As in the file, or of its body."""
    body, kind = int(model.jnt_bodyid[joint]), _KINDS[int(model.jnt_type[joint])]
    return model.joint(joint).name or f"{kind} of {model.body(body).name or f'body {body}'}"


class _Read(NamedTuple):
    """A model where its data put it, and the numbers here of its bodies that have joints."""

    mujoco: ModuleType
    model: MujocoModel
    data: MujocoData
    number: dict[int, int]

    def bodies(self, movers: Sequence[int], joints: Sequence[str]) -> list[Body]:
        """The ground, and for each joint the body on it."""
        model, data = self.model, self.data
        names = unique([model.body(body).name or f"body {body}" for body in movers], (GROUND,))
        found = [Body.massless(GROUND, np.zeros(3), np.eye(3))]
        for body, name in zip(movers, names, strict=True):
            position, axes = data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()
            first = int(model.body_jntadr[body])
            last = first + int(model.body_jntnum[body]) - 1
            found += [Body.massless(f"{name} after {joints[joint]}", position, axes) for joint in range(first, last)]
            found.append(Body(name, position, axes, *self._weight(body)))
        return found

    def _weight(self, root: int) -> tuple[float, np.ndarray, np.ndarray]:
        """Mass, centre and inertia about it of a body and of all that are fixed to it, global."""
        model, data = self.model, self.data
        members = [k for k in range(1, model.nbody) if root_of(model, k) == root]
        masses = np.where(model.body_mass[members] > 2 * LEAST, model.body_mass[members], 0.0)
        centres, total = data.xipos[members], float(masses.sum())
        if not total:
            return 0.0, data.xpos[root].copy(), np.zeros((3, 3))
        centre, inertia = masses @ centres / total, np.zeros((3, 3))
        for k, mass, arm in zip(members, masses, centres - centre, strict=True):
            axes, own = data.ximat[k].reshape(3, 3), model.body_inertia[k]
            inertia += axes @ np.diag(np.where(own > 2 * LEAST, own, 0.0)) @ axes.T
            inertia += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return total, centre, (inertia + inertia.T) / 2

    def joint(self, joint: int, name: str) -> Joint:
        """A joint, whose body is the next in number."""
        model, data = self.model, self.data
        body, kind = int(model.jnt_bodyid[joint]), _KINDS[int(model.jnt_type[joint])]
        is_first = joint == int(model.body_jntadr[body])
        parent = self.number[root_of(model, int(model.body_parentid[body]))] if is_first else joint
        place, size, dof = int(model.jnt_qposadr[joint]), KINDS[kind].sizes[0], int(model.jnt_dofadr[joint])
        axis = np.array([0.0, 0.0, 1.0]) if kind in ("ball", "free") else data.xaxis[joint].copy()
        at = data.xanchor[joint].copy(), axes_of(axis)
        limits = None
        if model.jnt_limited[joint] and kind != "free":
            low, high = model.jnt_range[joint].tolist()
            limits = (-np.inf if kind == "ball" else low, high)
        friction, armature = float(model.dof_frictionloss[dof]), float(model.dof_armature[dof])
        rubs, floats = kind in ("ball", "free") and friction > 0, kind == "free" and armature > 0
        untaken = {"armature": floats, "dry friction": rubs}
        for what, of, where in (("springs", "jnt_stiffnesspoly", joint), ("dampers", "dof_dampingpoly", dof)):
            untaken[f"what is not linear in the {what}"] = bool(np.any(getattr(model, of, np.zeros(model.nv))[where]))
        return Joint(
            name,
            kind,
            End(joint + 1, *at),
            End(parent, *at),
            model.qpos0[place : place + size].copy(),
            model.qpos_spring[place : place + size].copy(),
            limits,
            float(model.jnt_stiffness[joint]),
            float(model.dof_damping[dof]),
            0.0 if kind == "free" else armature,
            0.0 if kind in ("ball", "free") else friction,
            tuple(what for what, is_there in untaken.items() if is_there),
        )

    def constraints(self) -> tuple[list[Loop], list[Tie], dict[str, int], list[str]]:
        """Loops and ties, which equalities they are, by name, and which are left out, a line each."""
        (mujoco, model, _, _), loops, ties, places, notes = self, [], [], {}, []
        for k in range(model.neq):
            kind, (one, two) = mujoco.mjtEq(model.eq_type[k]), (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
            if kind == mujoco.mjtEq.mjEQ_JOINT:
                name = _named(model, k, "couple", model.joint(one).name, model.joint(two).name if two >= 0 else "0")
                if all(_KINDS[int(model.jnt_type[joint])] in ("hinge", "slide") for joint in (one, two) if joint >= 0):
                    terms = ((one, 1.0),), ((two, 1.0),) if two >= 0 else ()
                    ties.append(Tie(name, *terms, model.eq_data[k, :5].copy()))
                else:
                    notes.append(f"constraint '{name}' is left out: it does not couple two hinges or slides{WITHOUT}")
                continue
            if kind == mujoco.mjtEq.mjEQ_TENDON:
                name = _named(model, k, "tendon", model.tendon(one).name, model.tendon(two).name if two >= 0 else "0")
                found = self._of_tendons(k, name)
                ends = self._rod(one) if two < 0 else None
                length = float(model.tendon_length0[one] + model.eq_data[k, 0])
                if ends is not None and length > 0:
                    loops.append(Loop(name, "distance joint", *ends, length))
                    places.setdefault(name, k)
                elif isinstance(found, Tie):
                    ties.append(found)
                else:
                    notes.append(f"constraint '{name}' is left out: {found}{WITHOUT}")
                continue
            word = "weld" if kind == mujoco.mjtEq.mjEQ_WELD else "connect"
            of_sites = model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE
            held = model.site if of_sites else model.body
            name = _named(model, k, word, held(one).name, held(two).name)
            if of_sites:
                ends = self.site_ends(one, two)
            else:
                ends = [self._end(*end) for end in body_ends(word, one, two, model.eq_data[k])]
            if ends[0].body == ends[1].body:
                notes.append(f"constraint '{name}' is left out: the file fixes both of its bodies to each other")
            else:
                holds_turns = word == "weld" and model.eq_data[k, TORQUE_SCALE] != 0
                loops.append(Loop(name, "weld" if holds_turns else "connect", ends[0], ends[1]))
                places.setdefault(name, k)
        driven = np.flatnonzero(model.body_mocapid >= 0).tolist()
        moved = [model.body(body).name or f"body {body}" for body in driven]
        if moved:
            notes.append(f"motion from outside (mocap) of {', '.join(moved)}: they rest where the file has them")
        return loops, ties, places, notes

    def _end(self, body: int, point: np.ndarray, axes: np.ndarray) -> End:
        """What is held of a body of the file, by a point and axes in its frame."""
        own = self.data.xmat[body].reshape(3, 3)
        return End(self.number[root_of(self.model, body)], self.data.xpos[body] + own @ point, own @ axes)

    def site_ends(self, one: int, two: int) -> list[End]:
        """Of two sites."""
        model = self.model
        return [
            self._end(int(model.site_bodyid[site]), model.site_pos[site], _axes(model.site_quat[site]))
            for site in (one, two)
        ]

    def cables(self) -> Iterator[Loop]:
        """Tendons between two sites that have a greatest length."""
        model = self.model
        for tendon in np.flatnonzero(model.tendon_limited).tolist():
            ends, (_, most) = self._rod(tendon), model.tendon_range[tendon].tolist()
            if ends is not None and most > 0:
                yield Loop(model.tendon(tendon).name or f"tendon {tendon + 1}", "distance joint", *ends, most)

    def _rod(self, tendon: int) -> tuple[End, End] | None:
        """The ends of a tendon that goes straight from a site to another, on another body."""
        model = self.model
        first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
        if count != 2 or np.any(model.wrap_type[first : first + count] != self.mujoco.mjtWrap.mjWRAP_SITE):
            return None
        one, two = model.wrap_objid[first : first + count].tolist()
        start, end = self.site_ends(one, two)
        return (start, end) if start.body != end.body else None

    def _of_tendons(self, k: int, name: str) -> Tie | str:
        """What ties joints by lengths of tendons, a . x - p(b . x) = 0 in displacements x of the joints and of
        distances of sites; or why none."""
        model = self.model
        ends = [end for end in (int(model.eq_obj1id[k]), int(model.eq_obj2id[k])) if end >= 0]
        first, second = ({} if end is None else self._terms(end) for end in (*ends, None)[:2])
        if first is None or second is None:
            return "a tendon of it wraps about a sphere or a cylinder"
        polynomial = model.eq_data[k, :5].copy()
        if not second or not np.any(polynomial[2:]):
            slope, every = polynomial[1], {**first, **second}
            both = {joint: first.get(joint, 0.0) - slope * second.get(joint, 0.0) for joint in every}
            first, second = {}, {}
            for joint, value in both.items():
                if value:
                    (second if first else first)[joint] = -value if first else value
            polynomial[1] = 1.0
        if not first or (second and {*first} == {*second}):
            return "it ties joints to themselves" if first else "nothing moves what it ties"
        (size, *more), (slope, *others) = first.values(), second.values() or (0.0,)
        first = first if more else dict.fromkeys(first, 1.0)
        second = second if others else dict.fromkeys(second, 1.0)
        polynomial = polynomial / (1.0 if more else size) * (1.0 if others else slope) ** np.arange(5)
        return Tie(name, self._parts(first), self._parts(second), polynomial)

    def _terms(self, tendon: int) -> dict[int | tuple[int, int], float] | None:
        """By how much displacements of joints, and of distances of sites, make a tendon longer; None of one that wraps
        about a geometry."""
        model, kinds, first = self.model, self.mujoco.mjtWrap, int(self.model.tendon_adr[tendon])
        found: dict[int | tuple[int, int], float] = {}
        share, last = 1.0, -1
        for place in range(first, first + int(model.tendon_num[tendon])):
            kind, at, value = model.wrap_type[place], int(model.wrap_objid[place]), float(model.wrap_prm[place])
            if kind == kinds.mjWRAP_JOINT:
                found[at] = value
            elif kind == kinds.mjWRAP_PULLEY:  # what follows is pulled by a share, and begins anew
                share, last = 1.0 / value, -1
            elif kind == kinds.mjWRAP_SITE:
                pair = (min(last, at), max(last, at))
                if last >= 0 and self._part(pair) is not None:
                    found[pair] = found.get(pair, 0.0) + share
                last = at
            else:
                return None
        return {key: value for key, value in found.items() if value}

    def _parts(self, terms: dict[int | tuple[int, int], float]) -> tuple[Term, ...]:
        """Terms that move."""
        both = [(self._part(key), weight) for key, weight in terms.items()]
        return tuple((part, weight) for part, weight in both if part is not None)

    def _part(self, key: int | tuple[int, int]) -> int | Loop | None:
        """A joint, or the distance of two sites; None of sites that move alike."""
        if isinstance(key, int):
            return key
        start, end = self.site_ends(*key)
        name = f"span from {' to '.join(self.model.site(site).name or f'site {site}' for site in key)}"
        length = float(np.linalg.norm(end.point - start.point))
        return Loop(name, "distance joint", start, end, length) if start.body != end.body else None


def _named(model: MujocoModel, k: int, word: str, one: str, two: str) -> str:
    return model.equality(k).name or f"{word} {one} ~ {two}"


def body_ends(word: str, one: int, two: int, data: np.ndarray) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """What an equality holds of two bodies: their numbers, points and axes in their frames."""
    if word == "connect":
        return [(one, data[:3].copy(), np.eye(3)), (two, data[3:6].copy(), np.eye(3))]
    return [(one, data[3:6].copy(), _axes(data[6:10])), (two, data[:3].copy(), np.eye(3))]


def _axes(quaternion: np.ndarray) -> np.ndarray:
    return np.asarray(rotation(quaternion / np.linalg.norm(quaternion)))
