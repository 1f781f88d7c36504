"""Mechanisms in space with exact geometry, solved to 50 digits.

All is stated at one pose, at which every joint is closed: bodies by their axes R, origin and centre of mass, joints by
a point and axes E = (x, y, z) in global components. Rows, for the axes on body j, say in other words what joints do:

    offset    E_j^T (p_i - p_j)                       its first two entries are `shift`, the third `travel`
    turn      T = E_j^T E_i,  `tilt` (-T_yz, T_xz),  `rotation` (T_zy - T_yz, T_xz - T_zx, T_yx - T_xy) / 2
    cross     z_i . z_j of pins, `twist` (T_yx - T_xy) / 2, `length` |p_i - p_j|

Velocities are those of centres of mass and the angular velocities in body axes. Derivatives are differences of 150
digits along R exp([w]s), which Rodrigues' formula gives: nothing is derived by hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from mpmath import mp

from .exact import AbstractExact, exactly, independent_rows, solve_columns

ROWS = {
    "Revolute": ("offset", "tilt"),
    "Prismatic": ("shift", "rotation"),
    "Cylindrical": ("shift", "tilt"),
    "Spherical": ("offset",),
    "Planar": ("travel", "tilt"),
    "Fixed": ("offset", "rotation"),
    "PointOnLine": ("shift",),
    "PointOnPlane": ("travel",),
    "ParallelAxes": ("tilt",),
    "Universal": ("offset", "cross"),
    "ConstantVelocity": ("offset", "twist"),
}
_MOMENTS = ("tilt", "rotation", "cross", "twist")
_FINE = 150  # digits of differences
GROUND = -1


@dataclass(frozen=True)
class Body:
    """Mass, inertia (3, 3) in its axes, centre of mass and origin in global components, axes R as columns."""

    mass: object
    inertia: object
    centre: object
    origin: object
    axes: object


@dataclass(frozen=True)
class Joint:
    """Kind, bodies, point and axes in global components; `axes_i` where those on body i are others."""

    kind: str
    name: str
    i: int
    j: int
    point: object
    axes: object
    axes_i: object = None


@exactly
def vector(*entries):
    """A column of exact numbers."""
    return mp.matrix([mp.mpf(x) if not isinstance(x, str) else mp.mpmathify(x) for x in entries])


@exactly
def cross(a, b):
    """a x b."""
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(v):
    """[v]x."""
    return mp.matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def turn(v):
    """exp([v]x), Rodrigues' formula."""
    angle = mp.norm(v)
    if angle == 0:
        return mp.eye(3)
    k = skew(v / angle)
    return mp.eye(3) + mp.sin(angle) * k + (1 - mp.cos(angle)) * k * k


@exactly
def frame(axis, mark):
    """Axes as columns: z along an axis, x along the part of a mark that is square to it."""
    z = axis / mp.norm(axis)
    x = mark - (mark.T * z)[0] * z
    x = x / mp.norm(x)
    y = cross(z, x)
    return mp.matrix([[x[k], y[k], z[k]] for k in range(3)])


@dataclass(frozen=True, eq=False)
class Scene(AbstractExact):
    """A mechanism at one pose; `rank` by construction, `push` chooses the velocity."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    gravity: object
    rank: int
    push: tuple = ()

    @property
    def kinds(self) -> tuple:
        """'force' or 'moment' for every row, joint by joint."""
        return tuple(kind for joint in self.joints for kind in _kinds(joint))

    @cached_property
    @exactly
    def mass_matrix(self):
        """diag(m I, J)."""
        count = len(self.bodies)
        mass = mp.zeros(6 * count)
        for b, body in enumerate(self.bodies):
            for k in range(3):
                mass[3 * b + k, 3 * b + k] = body.mass
                for other in range(3):
                    mass[3 * (count + b) + k, 3 * (count + b) + other] = body.inertia[k, other]
        return mass

    @property
    def distribution(self):
        """No friction."""
        return mp.zeros(6 * len(self.bodies), 0)

    @cached_property
    @exactly
    def load(self):
        """(m g, -w x J w)."""
        rate, count = self.velocity, len(self.bodies)
        forces = [entry for body in self.bodies for entry in body.mass * self.gravity]
        spins = [rate[3 * (count + b) : 3 * (count + b) + 3] for b in range(count)]
        spins = [mp.matrix(list(spin)) for spin in spins]
        moments = [x for body, spin in zip(self.bodies, spins, strict=True) for x in -cross(spin, body.inertia * spin)]
        return mp.matrix(forces + moments)

    def constraints(self, s, rate):
        """Rows after a time s at constant velocities."""
        count = len(self.bodies)

        def placed(b: int, point, axes):
            if b == GROUND:
                return point, axes
            body = self.bodies[b]
            v, w = (mp.matrix([rate[3 * c + k] for k in range(3)]) for c in (b, count + b))
            moved = body.axes * turn(w * s) * body.axes.T
            return body.centre + v * s + moved * (point - body.centre), moved * axes

        rows: list = []
        for joint in self.joints:
            p_i, e_i = placed(joint.i, joint.point, joint.axes if joint.axes_i is None else joint.axes_i)
            p_j, e_j = placed(joint.j, joint.point, joint.axes)
            rows += _rows(joint, e_j.T * (p_i - p_j), e_j.T * e_i)
        return mp.matrix(rows)

    @cached_property
    def jacobian(self):
        """Phi_q (m, n)."""
        n = 6 * len(self.bodies)
        with mp.workdps(_FINE):
            h = mp.mpf(10) ** -45
            unit = [mp.matrix([int(k == c) for k in range(n)]) for c in range(n)]
            columns = [(self.constraints(h, e) - self.constraints(-h, e)) / (2 * h) for e in unit]
            return mp.matrix([[column[row] for column in columns] for row in range(len(self.kinds))])

    @cached_property
    def gamma(self):
        """gamma (m, 1): minus the second derivative at constant velocities."""
        with mp.workdps(_FINE):
            h, rate = mp.mpf(10) ** -32, self.velocity
            ends = self.constraints(h, rate) + self.constraints(-h, rate) - 2 * self.constraints(0, rate)
            return -ends / h**2

    @cached_property
    @exactly
    def velocity(self):
        """What `push` leaves of itself on the null space of Phi_q."""
        n, jac = 6 * len(self.bodies), self.jacobian
        rows = independent_rows(jac, self.rank)
        free = mp.matrix([[jac[row, column] for column in range(n)] for row in rows])
        push = mp.matrix([mp.mpf(x) for x in self.push])
        rate = push - free.T * solve_columns(free * free.T, free * push)
        return rate / mp.norm(rate) * mp.sqrt(n)

    @exactly
    def wrenches(self, multipliers):
        """Forces and moments on bodies i about the joints' points, global components, (6 joints, columns)."""
        count, rows, out = len(self.bodies), 0, []
        for joint in self.joints:
            body, size = self.bodies[joint.i], len(_kinds(joint))
            own = [*range(rows, rows + size)]
            given = mp.matrix([[multipliers[r, c] for c in range(multipliers.cols)] for r in own])
            on_i = [
                mp.matrix([[-self.jacobian[r, 3 * place + k] for r in own] for k in range(3)]) * given
                for place in (joint.i, count + joint.i)
            ]
            force, moment = on_i[0], body.axes * on_i[1] - skew(joint.point - body.centre) * on_i[0]
            out += force.tolist() + moment.tolist()
            rows += size
        return mp.matrix(out)


def _kinds(joint: Joint) -> list[str]:
    sizes = {"offset": 3, "shift": 2, "travel": 1, "tilt": 2, "rotation": 3, "cross": 1, "twist": 1}
    return ["moment" if part in _MOMENTS else "force" for part in ROWS[joint.kind] for _ in range(sizes[part])]


def _rows(joint: Joint, offset, t) -> list:
    parts = {
        "offset": [*offset],
        "shift": [offset[0], offset[1]],
        "travel": [offset[2]],
        "tilt": [-t[1, 2], t[0, 2]],
        "rotation": [(t[2, 1] - t[1, 2]) / 2, (t[0, 2] - t[2, 0]) / 2, (t[1, 0] - t[0, 1]) / 2],
        "cross": [t[2, 2]],
        "twist": [(t[1, 0] - t[0, 1]) / 2],
    }
    return [x for part in ROWS[joint.kind] for x in parts[part]]


# Scenes -------------------------------------------------------------------------------------


def _push(count: int) -> tuple:
    """Numbers without a pattern."""
    return tuple((11 * k * k + 5 * k + 2) % 17 - 8 for k in range(6 * count))


@exactly
def bar(start, end, axis, mass=1, width=0) -> Body:
    """A uniform bar of a square section, y along an axis."""
    line = end - start
    length, a = mp.norm(line), frame(line, axis)
    axes = mp.matrix([[a[k, 2], a[k, 0], a[k, 1]] for k in range(3)])
    mass, width = mp.mpf(mass), mp.mpmathify(width)
    across = mass * (length**2 + width**2) / 12
    return Body(mass, mp.diag([mass * width**2 / 6, across, across]), (start + end) / 2, start, axes)


@exactly
def _chain(points: Sequence, axes: Sequence, gravity, rank: int, width=0) -> Scene:
    bodies = [bar(points[k], points[k + 1], axes[k], width=width) for k in range(len(points) - 1)]
    links = [GROUND, *range(len(bodies)), GROUND]
    mark = vector(1, 2, 3)
    joints = []
    for k, (point, axis) in enumerate(zip(points, axes, strict=True)):
        i, j = (links[k + 1], links[k]) if links[k + 1] != GROUND else (links[k], GROUND)
        joints.append(Joint("Revolute", "ABCDEF"[k], i, j, point, frame(axis, mark)))
    return Scene(tuple(bodies), tuple(joints), gravity, rank, _push(len(bodies)))


@exactly
def door() -> Scene:
    """Three hinges on a slanting axis; the inertia is a matrix, the centre of mass beside all axes."""
    axis, mark = vector(2, 3, 6), vector(1, 1, 0)
    axes = turn(vector(1, 2, -1))
    inertia = mp.matrix([[3, "0.2", "-0.5"], ["0.2", 4, "0.4"], ["-0.5", "0.4", 5]])
    origin, foot = vector("0.3", -1, "0.7"), vector(1, "-0.2", "0.1")
    body = Body(mp.mpf(20), inertia, origin + axes * vector("0.4", "0.1", "0.2"), origin, axes)
    joints = [
        Joint("Revolute", name, 0, GROUND, foot + mp.mpf(k) / 7 * axis / 7, frame(axis, mark))
        for k, name in ((0, "bottom"), (3, "middle"), (8, "top"))
    ]
    return Scene((body,), tuple(joints), vector(1, -9, 2), 5, _push(1))


@exactly
def bennett(theta=None) -> Scene:
    """tan(alpha / 2) = 1 / 3, beta = 90 degrees: tan(theta / 2) tan(phi / 2) = 2; tan(theta / 2) = 3 / 4 at first."""
    points, axes, frame_ = [vector(0, 0, 0)], [vector(0, 0, 1)], mp.eye(3)
    alpha, beta = 2 * mp.atan(mp.mpf(1) / 3), mp.pi / 2
    theta = 2 * mp.atan(mp.mpf(3) / 4) if theta is None else theta
    phi = 2 * mp.atan(2 / mp.tan(theta / 2))
    short, long = mp.mpf(3) / 5, mp.mpf(1)
    for angle, length, twist in ((theta, short, alpha), (phi, long, beta), (-theta, short, alpha)):
        line = frame_ * turn(vector(0, 0, angle)) * vector(1, 0, 0)
        frame_ = frame_ * turn(vector(0, 0, angle)) * turn(vector(twist, 0, 0))
        points.append(points[-1] + length * line)
        axes.append(frame_ * vector(0, 0, 1))
    return _chain(points, axes, vector(1, 2, -9), 17)


@exactly
def bricard() -> Scene:
    """Edges of a cube: problem A04 of the library of benchmarks."""
    corners = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    axes = [vector(*(int(k == a) for k in range(3))) for a in (1, 2, 0, 1, 2, 0)]
    gravity = vector(0, "-9.81", 0)
    return _chain([vector(*corner) for corner in corners], axes, gravity, 29, width="0.1")


@exactly
def sarrus() -> Scene:
    """Two arms at 120 degrees that rise by 30 degrees; a platform off the middle."""
    up, length, radius = vector(0, 0, 1), mp.mpf(3) / 10, mp.mpf(1) / 10
    rise = mp.pi / 6
    top = 2 * length * mp.sin(rise) * up
    inertia = mp.diag([mp.mpf(1) / 50, mp.mpf(1) / 40, mp.mpf(1) / 30])
    bodies = [Body(mp.mpf(2), inertia, top + vector("0.02", "-0.01", "0.05"), top, mp.eye(3))]
    joints, mark = [], vector(1, 2, 3)
    for k in range(2):
        out = vector(mp.cos(2 * mp.pi * k / 3), mp.sin(2 * mp.pi * k / 3), 0)
        axis, foot = cross(out, up), radius * out
        knee = foot + length * (mp.cos(rise) * out + mp.sin(rise) * up)
        bodies += [bar(foot, knee, axis), bar(knee, foot + top, axis)]
        ends = ((2 * k + 1, GROUND, foot), (2 * k + 2, 2 * k + 1, knee), (0, 2 * k + 2, foot + top))
        joints += [
            Joint("Revolute", f"{name}{k}", i, j, point, frame(axis, mark))
            for name, (i, j, point) in zip("ABC", ends, strict=True)
        ]
    return Scene(tuple(bodies), tuple(joints), vector(0, 0, "-9.81"), 29, _push(5))


@exactly
def chain_of_kinds(kinds: Sequence[str]) -> Scene:
    """An open chain of bodies, each on the one before it by a joint of these kinds; no constraint is redundant."""
    bodies, joints, rank = [], [], 0
    inertia = mp.matrix([["0.3", "0.02", "-0.05"], ["0.02", "0.4", "0.04"], ["-0.05", "0.04", "0.5"]])
    for k, kind in enumerate(kinds):
        axes = turn(vector(k + 1, 2 - k, 1))
        origin = vector(k, mp.mpf(k * k) / 5, mp.mpf(2 * k - 1) / 3)
        bodies.append(Body(mp.mpf(k + 1), inertia, origin + axes * vector("0.1", "-0.2", "0.3"), origin, axes))
        placed = frame(vector(1, k, 2), vector(0, 1, -k))
        on_i = frame(mp.matrix([placed[c, 0] for c in range(3)]), mp.matrix([placed[c, 2] for c in range(3)]))
        point = origin + vector("-0.3", "0.2", "0.1")
        joints.append(Joint(kind, f"{kind} {k}", k, k - 1, point, placed, on_i if kind == "Universal" else None))
        rank += len(_kinds(joints[-1]))
    return Scene(tuple(bodies), tuple(joints), vector(1, -9, 2), rank, _push(len(kinds)))


@exactly
def doubled(scene: Scene, joint: int) -> Scene:
    """The same with one joint twice."""
    twin = replace(scene.joints[joint], name=f"{scene.joints[joint].name} twin")
    return replace(scene, joints=(*scene.joints, twin))


SCENES = {
    "door": door,
    "bennett": bennett,
    "bricard": bricard,
    "sarrus": sarrus,
    "pairs": lambda: chain_of_kinds(("Revolute", "Prismatic", "Cylindrical", "Spherical", "Planar", "Fixed")),
    "contacts": lambda: chain_of_kinds(
        ("Universal", "ConstantVelocity", "PointOnLine", "PointOnPlane", "ParallelAxes")
    ),
    "universal, twice": lambda: doubled(chain_of_kinds(("Universal", "Prismatic")), 0),
}
