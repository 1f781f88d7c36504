"""Involute teeth to many digits: a crossed belt between base circles, R = b_i + b_j

    flank (b_i (phi_i - theta) + b_j (phi_j - theta) - those where a tooth meets a gap)
        + sgn(R) (sqrt(d^2 - R^2) - R arccos(R / d) - that at the distance without backlash) = 0   mod  2 pi b_i / z_i

The row is minus that. Derivatives are differences of many more digits.
"""

from dataclasses import dataclass

from mpmath import mp


@dataclass(frozen=True)
class Mesh:
    """Gears with axes s_i on body i and s_j on body j, numbers of teeth (that of a ring negative) and module.

    The middle of a tooth is at `angle_i` and `angle_j` on them.
    """

    name: str
    i: int
    j: int
    s_i: tuple
    s_j: tuple
    teeth: tuple
    module: object
    pressure_angle: object
    flank: int
    angle_i: object = 0
    angle_j: object = 0
    kind, friction = "mesh", None

    @property
    def numbers(self) -> dict:
        """As in a description."""
        return {"mesh": self}


def _axis(r, phi, s) -> tuple:
    c, d = mp.cos(phi), mp.sin(phi)
    return r[0] + c * s[0] - d * s[1], r[1] + d * s[0] + c * s[1]


def _belt(radius, distance):
    return mp.sqrt(distance**2 - radius**2) - radius * mp.acos(radius / distance)


def row(mesh: Mesh, r, phi):
    """The row at positions r[0..b] and angles phi[0..b] of all bodies, the ground first."""
    (xi, yi), (xj, yj) = (_axis(r[b], phi[b], s) for b, s in ((mesh.i, mesh.s_i), (mesh.j, mesh.s_j)))
    own, other = (mesh.module * z * mp.cos(mesh.pressure_angle) / 2 for z in mesh.teeth)
    radius, theta = own + other, mp.atan2(yj - yi, xj - xi)
    # At theta = 0: a tooth of i on the line of centres, a gap of j on it, half a pitch from a tooth
    first = 0 if other > 0 else mp.pi
    second = mp.pi - mp.pi / abs(mesh.teeth[1])
    rolled = own * (phi[mesh.i] + mesh.angle_i - theta - first) + other * (phi[mesh.j] + mesh.angle_j - theta - second)
    standard = radius / mp.cos(mesh.pressure_angle)
    belt = _belt(radius, mp.hypot(xj - xi, yj - yi)) - _belt(radius, abs(standard))
    value = -(mesh.flank * rolled + mp.sign(radius) * belt)
    pitch = 2 * mp.pi * own / mesh.teeth[0]
    return value - pitch * mp.nint(value / pitch)


def along(mesh: Mesh, place, rate, order: int):
    """Derivative of the row along the rates of (r, phi), of order 1 or 2."""
    (r, phi), (rd, phid) = place, rate

    def at(s):
        moved = [(x[0] + s * v[0], x[1] + s * v[1]) for x, v in zip(r, rd, strict=True)]
        return row(mesh, moved, [x + s * v for x, v in zip(phi, phid, strict=True)])

    digits = mp.dps
    with mp.workdps(5 * digits):
        step = mp.mpf(10) ** (-2 * digits)
        return (at(step) - at(-step)) / (2 * step) if order == 1 else (at(step) - 2 * at(0) + at(-step)) / step**2
