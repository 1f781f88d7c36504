"""What each body of a mechanism in space bears at an instant, for a program of finite elements

In axes of the body, joint by joint a force and a moment about the joint's point on it. With

    R = Q - M qdd

at the centre, which is gravity, applied loads, friction and minus the inertia, they are in balance.
"""

import csv
import dataclasses
import io
import re
from typing import cast

import jax
import numpy as np

from .._bodies._body import GROUND
from .._bodies._joint_coordinates import coefficients
from .._bodies._mechanism import Mechanism
from .._bodies._space._frame import SPACE
from .._bodies._space._rotation import rotation
from .._equations._factorize import factorize_dense
from .._solve._solution import Solution
from .._system._state import State
from .._tools._errors import RedundaxError
from .._tools._module import check_kind

_LOOSE = 1e-6  # of the largest coefficient: a self-stress that is rounding in a load
_ZERO = 1e-12  # of the largest load: rounding


@dataclasses.dataclass(frozen=True, eq=False)
class BodyLoad:
    """A load on a body, in its own axes.

    - `body`, `joint`: their names; `joint` is "" for what acts at the centre: gravity, applied loads, inertia.
    - `point`: where, in the frame of the body, m; `force`, N, and `moment` about it, N m, shape (3,).
    - `unique`: which of the six components the machine determines; the closure of the solution decides the others.

    ??? example

        ```python
        door = rx.mechanisms.door()
        closed = rx.assemble(door, rates={"hinge 1.angle": 1.0})
        loads = rx.spatial.body_loads(door, closed, rx.solve(door, closed))
        loads[0].joint, loads[0].force, loads[0].unique
        ```
    """

    body: str
    joint: str
    point: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    unique: np.ndarray


def body_loads(mechanism: Mechanism, state: State, solution: Solution) -> tuple[BodyLoad, ...]:
    """What each body bears at a state: of each of its joints a force and a moment about the joint's point, and what
    acts at its centre of mass, gravity, applied loads, friction and minus the inertia; all of a body are in balance.

    ??? example

        ```python
        door = rx.mechanisms.door()
        closed = rx.assemble(door, rates={"hinge 1.angle": 1.0})
        for load in rx.spatial.body_loads(door, closed, rx.solve(door, closed)):
            print(load.body, load.joint, load.point, load.force, load.moment)
        ```

    **Arguments:**

    - `mechanism`: of `rx.spatial`, or of a file.
    - `state`, `solution`: a state, and what `solve` gives there; its closure decides loads that are not unique.

    **Returns:** a tuple of `BodyLoad`, body by body, the one without a joint last.
    """
    check_kind("mechanism", mechanism, Mechanism, "a `Mechanism`", "Give one of `rx.spatial` or `rx.load_model`.")
    if mechanism.frame.word != SPACE.word:
        raise RedundaxError(
            "Argument `mechanism` must be one of `rx.spatial`, but is planar. Read its loads from the solution, as in "
            '`solution["A force x on rod"]`.'
        )
    factor = factorize_dense(mechanism, state)
    stress, lam = np.asarray(factor.self_stress), np.asarray(solution.multipliers)
    rest = np.asarray(factor.load) - np.asarray(factor.mass) @ np.asarray(solution.acceleration)
    names, count = mechanism.names, len(mechanism.names.bodies)
    axes = rotation(np.asarray(state.q)[3 * count :].reshape(count, 4))
    joints = mechanism.joint_coordinates
    both = [jax.device_get([part for part, _ in coefficients(each, state)]) for each in (joints, joints.opposite)]
    found: dict[str, list[BodyLoad]] = {body: [] for body in names.bodies}
    place = 0
    for k, (stack, members) in enumerate(zip(mechanism.joints, names.joints, strict=True)):
        for number, name in enumerate(members):
            rows = np.asarray(mechanism.rows_of_joints[k])[number]
            told = names.reactions.labels[6 * place].rpartition(" on ")[2]
            pair = cast(tuple[str, str], names.bodies_at(name))
            for other, body in enumerate((told, pair[pair[0] == told])):
                if body == GROUND:
                    continue
                point = stack.element.point_on("i" if body == pair[0] else "j")
                at = np.zeros(3) if point is None else np.asarray(point)[number]
                turn = axes[names.bodies.index(body)].T
                by_row = np.asarray(both[other][k])[number]
                B = np.concatenate([turn @ by_row[:3], turn @ by_row[3:]])
                load, reach = B @ lam[rows], np.linalg.norm(B @ stress[rows], axis=1)
                unique = reach <= _LOOSE * max(np.abs(B).max(initial=0.0) * np.abs(stress).max(initial=0.0), 1e-300)
                found[body].append(BodyLoad(body, name, at, load[:3], load[3:], unique))
            place += 1
    centres, known = np.asarray(mechanism.frame.centres(mechanism.body)), np.ones(6, bool)
    for k, body in enumerate(names.bodies):
        force, moment = axes[k].T @ rest[3 * k : 3 * k + 3], rest[3 * (count + k) : 3 * (count + k) + 3]
        found[body].append(BodyLoad(body, "", centres[k], force, moment, known))
    return tuple(load for loads in found.values() for load in loads)


def as_csv(loads: tuple[BodyLoad, ...]) -> str:
    """A table: a line for each load, in axes of its body, m, N and N m."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    parts = [f"{part}{axis}" for part in ("f", "m") for axis in "xyz"]
    table.writerow(
        ["body", "joint", *(f"point {axis}" for axis in "xyz"), *parts, *(f"{part} unique" for part in parts)]
    )
    for load in loads:
        values = np.concatenate([load.point, load.force, load.moment]).tolist()
        table.writerow([load.body, load.joint or "(centre)", *values, *load.unique.astype(int).tolist()])
    return stream.getvalue()


def as_calculix(loads: tuple[BodyLoad, ...]) -> str:
    """Cards of CalculiX and Abaqus: for each load a set of one node, which the user has, with its force and moment."""
    largest = max((np.abs(np.concatenate([load.force, load.moment])).max() for load in loads), default=0.0)
    lines = [
        "** Loads of bodies in their own axes, N and N m. A set is one node at the point, which holds the surface of"
    ]
    lines += ["** the joint (*RIGID BODY with REF NODE and ROT NODE in CalculiX, whose rotations take the moments)."]
    for body in dict.fromkeys(load.body for load in loads):
        lines.append(f"** Body {_plain(body)}")
        for load in (each for each in loads if each.body == body):
            name = _set_name(body, load.joint or "centre")
            at = ", ".join(f"{x:.9g}" for x in load.point)
            lines.append(f"** {name}: {_plain(load.joint) or 'gravity, applied loads, friction, inertia'}, at {at} m")
            if not load.unique.all():
                loose = [f"{k + 1}" for k in np.flatnonzero(~load.unique)]
                lines.append(f"** not determined by the rigid machine: degrees of freedom {', '.join(loose)}")
            lines.append("*CLOAD")
            for k, value in enumerate(np.concatenate([load.force, load.moment]).tolist(), 1):
                if abs(value) > _ZERO * largest:
                    lines.append(f"{name}, {k}, {value:.9g}")
    return "\n".join(lines) + "\n"


def _set_name(*words: str) -> str:
    """A name of letters, digits and underscores."""
    return re.sub(r"\W+", "_", "_".join(words), flags=re.ASCII).upper()[:80]


def _plain(text: str) -> str:
    return " ".join(text.split())
