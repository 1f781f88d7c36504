"""The equations (25) of planar mechanisms by hand-written formulas, for batches of floats or of 50 digits.

    M qdd + Phi_q^T lam = Q + E tau,   Phi_q qdd = gamma = -Phi'',   tau = -coefficient (N + preload) sgn(rate)

with Phi'' the second derivative of Phi along (q + s qd, t + s). For a point with the arm a = R s on a body with the
rate w: p' = r' + w Omega a, p'' = -w^2 a, Omega a quarter turn.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import meshes
from .description import GROUND, Parameters, Structure


def turned(v: Any) -> Any:
    """Omega v."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


def dot(a: Any, b: Any) -> Any:
    """Scalar products."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


class Poses:
    """Positions (batch, bodies, 2) and angles (batch, bodies), with those of the ground last, and time (batch,)."""

    def __init__(self, r: Any, phi: Any, t: Any, real: Any):
        self.real, self.t = real, t
        self.r = np.concatenate([r, np.zeros_like(r[:, :1])], axis=1)
        self.phi = np.concatenate([phi, np.zeros_like(phi[:, :1])], axis=1)
        self.cos, self.sin = real.cos(self.phi), real.sin(self.phi)

    @property
    def q(self) -> Any:
        """Coordinates, (batch, n)."""
        return np.concatenate([self.r[:, :-1].reshape(len(self.t), -1), self.phi[:, :-1]], axis=1)

    def rotate(self, body: int, v: Any) -> Any:
        """R v."""
        c, s = self.cos[:, body], self.sin[:, body]
        return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1]], axis=-1)

    def point(self, body: int, s: Any) -> Any:
        """r + R s."""
        return self.r[:, body] + self.rotate(body, s)

    def local(self, body: int, p: Any) -> Any:
        """R^T (p - r)."""
        v, c, s = p - self.r[:, body], self.cos[:, body], self.sin[:, body]
        return np.stack([c * v[:, 0] + s * v[:, 1], c * v[:, 1] - s * v[:, 0]], axis=-1)


@dataclass(frozen=True)
class Equations:
    """Everything in (25) at a state, each with a leading batch axis.

    - `value`, `rate`: Phi (m,) and Phi_q qd + Phi_t (m,); `explicit`: Phi_t (m,).
    - `jacobian` (m, n), `gamma` (m,), `mass` (n,), `load` (n,).
    - `slip_rate` (p,), `direction` E (n, p), in the order of the joints.
    - `gamma_size`, `load_size`: sums of the absolute values of the terms of gamma and of Q.
    - `power`: power of the loads, from their own mechanics.
    """

    qd: Any
    value: Any
    rate: Any
    explicit: Any
    jacobian: Any
    gamma: Any
    mass: Any
    load: Any
    slip_rate: Any
    direction: Any
    gamma_size: Any
    load_size: Any
    power: Any


class _Motion:
    """Rates of bodies and points."""

    def __init__(self, poses: Poses, qd: Any):
        count = poses.phi.shape[1] - 1
        linear = qd[:, : 2 * count].reshape(len(qd), count, 2)
        self.poses = poses
        self.r = np.concatenate([linear, np.zeros_like(linear[:, :1])], axis=1)
        self.w = np.concatenate([qd[:, 2 * count :], np.zeros_like(qd[:, :1])], axis=1)

    def at(self, body: int, s: Any) -> tuple:
        """Point, arm, velocity, and second derivative of a point."""
        arm, w = self.poses.rotate(body, s), self.w[:, body, None]
        return self.poses.r[:, body] + arm, arm, self.r[:, body] + w * turned(arm), -(w**2) * arm


class _Sheet:
    """Rows being filled in."""

    def __init__(self, batch: int, rows: int, n: int, like: Any):
        zero = np.zeros((batch, rows), like.dtype)
        self.value, self.rate, self.explicit, self.gamma, self.size = (zero + 0 * like[:, :1] for _ in range(5))
        self.jacobian = np.zeros((batch, rows, n), like.dtype) + 0 * like[:, :1, None]
        self.bodies = n // 3

    def put(self, row: int, body: int, linear: Any, angular: Any) -> None:
        """Add to the derivatives of a row."""
        if body < self.bodies:
            self.jacobian[:, row, 2 * body : 2 * body + 2] += linear
            self.jacobian[:, row, 2 * self.bodies + body] += angular


def evaluate(structure: Structure, parameters: Parameters, poses: Poses, qd: Any) -> Equations:
    """All parts of (25) at poses and velocities (batch, n)."""
    motion, batch = _Motion(poses, qd), len(qd)
    place = {body: k for k, body in enumerate((*structure.bodies, GROUND))}
    sheet = _Sheet(batch, structure.m, structure.n, qd)
    slips = _Sheet(batch, max(len(structure.frictional), 1), structure.n, qd)
    for row, (k, part, _) in enumerate(structure.rows):
        joint = structure.joints[k]
        _row(sheet, row, joint.kind, part, motion, place[joint.i], place[joint.j], parameters.joints[k])
    for row, k in enumerate(structure.frictional):
        joint = structure.joints[k]
        _slip(slips, row, joint.kind, motion, place[joint.i], place[joint.j], parameters.joints[k])
    load, load_size, power = _loads(structure, parameters, motion, place)
    count = len(structure.frictional)
    sheet.rate = sheet.explicit + (sheet.jacobian @ qd[..., None])[..., 0]
    return Equations(
        qd=qd,
        value=sheet.value,
        rate=sheet.rate,
        explicit=sheet.explicit,
        jacobian=sheet.jacobian,
        gamma=sheet.gamma,
        mass=np.concatenate([np.repeat(parameters.mass, 2, axis=1), parameters.inertia], axis=1),
        load=load,
        slip_rate=(slips.jacobian @ qd[..., None])[:, :count, 0],
        direction=slips.jacobian[:, :count].swapaxes(1, 2),
        gamma_size=sheet.size,
        load_size=load_size,
        power=power,
    )


def _row(sheet: _Sheet, row: int, kind: str, part: int, motion: _Motion, i: int, j: int, own: dict) -> None:
    phi = motion.poses.phi
    if kind == "gear":
        sheet.value[:, row] = phi[:, i] + own["ratio"] * phi[:, j] - own["angle"]
        sheet.put(row, i, 0, 1)
        sheet.put(row, j, 0, own["ratio"])
        return
    if kind == "angle" or (kind == "fixed" and part == 2) or (kind == "translational" and part == 1):
        sheet.value[:, row] = phi[:, i] - phi[:, j] - (0 if kind == "angle" else own["angle"])
        sheet.put(row, i, 0, 1)
        sheet.put(row, j, 0, -1)
        if kind == "angle":
            _law(sheet, row, motion.poses.t, own["coefficients"])
        return
    if kind == "mesh":
        _mesh_row(sheet, row, motion, own["mesh"][0])
        return
    p_i, a_i, v_i, s_i = motion.at(i, own["point_i"])
    p_j, a_j, v_j, s_j = motion.at(j, own["point_j"])
    if kind in ("revolute", "fixed"):
        along = np.zeros_like(a_i)
        along[:, part] += 1
        sheet.value[:, row] = (p_i - p_j)[:, part]
        sheet.gamma[:, row] = (s_j - s_i)[:, part]
        sheet.size[:, row] = (np.abs(s_j) + np.abs(s_i))[:, part]
        sheet.put(row, i, along, dot(along, turned(a_i)))
        sheet.put(row, j, -along, -dot(along, turned(a_j)))
    elif kind in ("translational", "pin"):
        _slot_row(sheet, row, motion, (i, p_i, a_i, v_i, s_i), (j, p_j, a_j, v_j, s_j), own["normal"])
    else:
        _distance_row(sheet, row, motion.poses, (i, p_i, a_i, v_i, s_i), (j, p_j, a_j, v_j, s_j))
        _law(sheet, row, motion.poses.t, own["coefficients"])


def _law(sheet: _Sheet, row: int, t: Any, coefficients: Any) -> None:
    """Minus a law of motion c0 + c1 t + c2 t^2."""
    start, first, second = (coefficients[:, k] for k in range(3))
    sheet.value[:, row] -= start + first * t + second * t**2
    sheet.explicit[:, row] -= first + 2 * second * t
    sheet.gamma[:, row] += 2 * second
    sheet.size[:, row] += np.abs(2 * second)


def _slot_row(sheet: _Sheet, row: int, motion: _Motion, on_i: tuple, on_j: tuple, normal: Any) -> None:
    """(p_j - p_i)^T R_j v_j."""
    (i, p_i, a_i, v_i, s_i), (j, p_j, a_j, v_j, s_j) = on_i, on_j
    n, w = motion.poses.rotate(j, normal), motion.w[:, j]
    gap, slide, bend = p_j - p_i, v_j - v_i, s_j - s_i
    terms = [dot(bend, n), 2 * w * dot(slide, turned(n)), -(w**2) * dot(gap, n)]
    sheet.value[:, row] = dot(gap, n)
    sheet.gamma[:, row] = -(terms[0] + terms[1] + terms[2])
    size = [
        dot(np.abs(s_j) + np.abs(s_i), np.abs(n)),
        2 * np.abs(w) * dot(np.abs(v_j) + np.abs(v_i), np.abs(turned(n))),
    ]
    sheet.size[:, row] = size[0] + size[1] + w**2 * dot(np.abs(p_i) + np.abs(p_j), np.abs(n))
    sheet.put(row, i, -n, -dot(n, turned(a_i)))
    sheet.put(row, j, n, dot(n, turned(a_j)) + dot(gap, turned(n)))


def _distance_row(sheet: _Sheet, row: int, poses: Poses, on_i: tuple, on_j: tuple) -> None:
    """|p_i - p_j|."""
    (i, p_i, a_i, v_i, s_i), (j, p_j, a_j, v_j, s_j) = on_i, on_j
    gap, slide, bend = p_i - p_j, v_i - v_j, s_i - s_j
    length = poses.real.sqrt(dot(gap, gap))
    line = gap / length[:, None]
    along = dot(slide, line)
    sheet.value[:, row] = length
    sheet.gamma[:, row] = -((dot(slide, slide) - along**2) / length + dot(bend, line))
    moving = np.abs(v_i) + np.abs(v_j)
    sheet.size[:, row] = 2 * dot(moving, moving) / length + dot(np.abs(s_i) + np.abs(s_j), np.abs(line))
    sheet.put(row, i, line, dot(line, turned(a_i)))
    sheet.put(row, j, -line, -dot(line, turned(a_j)))


def _mesh_row(sheet: _Sheet, row: int, motion: _Motion, mesh: meshes.Mesh) -> None:
    """Teeth, of one sample in 50 digits."""
    count = sheet.bodies

    def ground_first(r: Any, phi: Any) -> tuple:
        return [r[-1], *r[:-1]], [phi[-1], *phi[:-1]]

    place = ground_first(motion.poses.r[0], motion.poses.phi[0])
    sheet.value[0, row] = meshes.row(mesh, *place)
    sheet.gamma[0, row] = -meshes.along(mesh, place, ground_first(motion.r[0], motion.w[0]), 2)
    for column in range(3 * count):
        unit = np.append((np.arange(3 * count) == column).astype(int), 0)
        rates = np.append(unit[: 2 * count], (0, 0)).reshape(-1, 2), unit[2 * count :]
        sheet.jacobian[0, row, column] = meshes.along(mesh, place, ground_first(*rates), 1)


def _slip(slips: _Sheet, row: int, kind: str, motion: _Motion, i: int, j: int, own: dict) -> None:
    """phi_i - phi_j of a revolute, (p_i - p_j)^T u along the line of a guide or slot, u = -Omega R_j v_j."""
    if kind == "revolute":
        slips.put(row, i, 0, 1)
        slips.put(row, j, 0, -1)
        return
    p_i, a_i, *_ = motion.at(i, own["point_i"])
    p_j, a_j, *_ = motion.at(j, own["point_j"])
    along = -turned(motion.poses.rotate(j, own["normal"]))
    slips.put(row, i, along, dot(along, turned(a_i)))
    slips.put(row, j, -along, -dot(along, turned(a_j)) + dot(p_i - p_j, turned(along)))


def _loads(structure: Structure, parameters: Parameters, motion: _Motion, place: dict) -> tuple:
    """Q, the sum of the absolute values of its terms, and its power as forces times speeds."""
    raw, count = parameters.raw, len(structure.bodies)
    zero = 0 * motion.w[:, :1]
    force = np.zeros((len(zero), count + 1, 2), zero.dtype) + zero[..., None]
    moment = np.zeros((len(zero), count + 1), zero.dtype) + zero
    sizes = force.copy(), moment.copy()
    force[:, :count] += parameters.mass[..., None] * raw["gravity"][:, None]
    sizes[0][:, :count] += np.abs(force[:, :count])
    power = np.sum(force[..., 0] * motion.r[..., 0] + force[..., 1] * motion.r[..., 1], axis=1)
    for load in structure.loads:
        for body, f, arm, c, p in _wrenches(load, raw, motion, place):
            force[:, body] += f
            moment[:, body] += arm[:, 0] * f[:, 1] - arm[:, 1] * f[:, 0] + c
            sizes[0][:, body] += np.abs(f)
            sizes[1][:, body] += np.abs(arm[:, 0] * f[:, 1]) + np.abs(arm[:, 1] * f[:, 0]) + np.abs(c)
            power = power + p

    def generalised(f: Any, c: Any) -> Any:
        return np.concatenate([f[:, :count].reshape(len(f), -1), c[:, :count]], axis=1)

    return generalised(force, moment), generalised(*sizes), power


def _wrenches(load: Any, raw: dict, motion: _Motion, place: dict) -> list[tuple]:
    """(body, force, arm, moment, power) of a load on each body; the power of a spring stands beside the first."""
    i, j, k = place[load.i], place[load.j], load.number
    p_i, a_i, v_i, _ = motion.at(i, raw["point_i"][:, k])
    none, still = np.zeros_like(a_i), 0 * motion.w[:, i]
    if load.kind in ("force", "follower"):
        force, moment = raw["force"][:, k], raw["moment"][:, k]
        force = motion.poses.rotate(i, force) if load.kind == "follower" else force
        return [(i, force, a_i, moment, dot(force, v_i) + moment * motion.w[:, i])]
    if load.kind == "torsion":
        turn, rate = motion.poses.phi[:, i] - motion.poses.phi[:, j], motion.w[:, i] - motion.w[:, j]
        size = raw["length"] ** 2
        moment = -size * (raw["stiffness"][:, k] * (turn - raw["free"][:, k]) + raw["damping"][:, k] * rate)
        return [(i, none, none, moment, moment * rate), (j, none, none, -moment, still)]
    p_j, a_j, v_j, _ = motion.at(j, raw["point_j"][:, k])
    gap = p_i - p_j
    length = motion.poses.real.sqrt(dot(gap, gap))
    line = gap / length[:, None]
    speed = dot(v_i - v_j, line)
    free = raw["free"][:, k] * raw["length"]
    tension = raw["stiffness"][:, k] * (length - free) + raw["damping"][:, k] * speed
    pull = -tension[:, None] * line
    return [(i, pull, a_i, still, -tension * speed), (j, -pull, a_j, still, still)]


# Friction by its definition ------------------------------------------------------------------


def places_of_rows(structure: Structure) -> dict[tuple[int, int], int]:
    """Row of each joint and place in the joint."""
    return {(k, part): row for row, (k, part, _) in enumerate(structure.rows)}


def friction_law(structure: Structure, parameters: Parameters, sense: Any, multipliers: Any, sqrt: Callable) -> tuple:
    """tau (batch, p), its derivative by the multipliers (batch, p, m), and the largest it can be for their size.

    The derivative of |x| at 0 is 0.
    """
    rows = places_of_rows(structure)
    tau, bound = np.zeros_like(sense), np.zeros_like(sense)
    slope = np.zeros((*sense.shape, structure.m), sense.dtype)
    for place, k in enumerate(structure.frictional):
        joint, own = structure.joints[k], parameters.joints[k]
        if joint.friction == "constant":
            tau[:, place], bound[:, place] = -own["size"] * sense[:, place], own["size"]
            continue
        gain = -own["coefficient"] * sense[:, place]
        a = multipliers[:, rows[k, 0]]
        if joint.kind == "revolute":
            b = multipliers[:, rows[k, 1]]
            normal = sqrt(a**2 + b**2)
            size = np.where(normal > 0, normal, 1.0)
            slope[:, place, rows[k, 0]], slope[:, place, rows[k, 1]] = gain * a / size, gain * b / size
        elif joint.kind == "pin":
            normal = np.abs(a)
            slope[:, place, rows[k, 0]] = gain * np.sign(a)
        else:
            couple = multipliers[:, rows[k, 1]] / own["guide_length"]
            ends = a / 2 + couple, a / 2 - couple
            normal = np.abs(ends[0]) + np.abs(ends[1])
            slope[:, place, rows[k, 0]] = gain * (np.sign(ends[0]) + np.sign(ends[1])) / 2
            slope[:, place, rows[k, 1]] = gain * (np.sign(ends[0]) - np.sign(ends[1])) / own["guide_length"]
        tau[:, place] = gain * (normal + own["preload"])
        bound[:, place] = np.abs(tau[:, place])
    return tau, slope, bound
