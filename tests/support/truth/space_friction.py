"""Friction of joints in space to 50 digits: bearings and guides whose ends, shoulders and flanks are pressed.

    tau = -s mu R N,   N = |F / 2 + c| + |F / 2 - c| + |F_axial| R_thrust / R + |M_twist| / R_twist,   c = z x M / L

or with |F| + |M| / L in place of both ends; R is the radius of a pin, 1 for a guide, and s the sense of slip. Loads are
the multipliers of a joint's rows, derivatives differences of 150 digits.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mpmath import mp

from . import space
from .exact import AbstractExact, exactly
from .space import GROUND, Body, Joint, Scene, cross, frame, turn, vector

_FINE = 150


@dataclass(frozen=True)
class Rub:
    """Coefficient and lengths of a joint's friction, as strings; `radius` and `thrust` of a pin, `twist` of a guide."""

    mu: str
    length: str
    radius: str = "1"
    thrust: str = "0"
    twist: str = "1"
    additive: bool = False


@dataclass(frozen=True, eq=False)
class Rubbing(AbstractExact):
    """A scene some of whose revolutes and prismatics rub."""

    scene: Scene
    rubs: Mapping[str, Rub]

    @property
    def kinds(self) -> tuple:
        """Those of the scene."""
        return self.scene.kinds

    @property
    def rank(self) -> int:
        """That of the scene."""
        return self.scene.rank

    @property
    def mass_matrix(self):
        """That of the scene."""
        return self.scene.mass_matrix

    @property
    def load(self):
        """That of the scene."""
        return self.scene.load

    @property
    def jacobian(self):
        """That of the scene."""
        return self.scene.jacobian

    @property
    def gamma(self):
        """That of the scene."""
        return self.scene.gamma

    @property
    def joints(self) -> list[Joint]:
        """Those that rub."""
        return [joint for joint in self.scene.joints if joint.name in self.rubs]

    @cached_property
    @exactly
    def distribution(self):
        """E (n, f): unit moments about axes of revolutes and unit forces along those of prismatics."""
        bodies, count = self.scene.bodies, len(self.scene.bodies)
        out = mp.zeros(6 * count, len(self.joints))
        for column, joint in enumerate(self.joints):
            z = mp.matrix([joint.axes[k, 2] for k in range(3)])
            for body, sign in ((joint.i, 1), (joint.j, -1)):
                if body == GROUND:
                    continue
                slides = joint.kind == "Prismatic"
                moment = bodies[body].axes.T * (cross(joint.point - bodies[body].centre, z) if slides else z)
                for k in range(3):
                    out[3 * body + k, column] = sign * z[k] if slides else 0
                    out[3 * (count + body) + k, column] = sign * moment[k]
        return out

    @cached_property
    @exactly
    def senses(self) -> tuple:
        """Signs of the slip rates."""
        return tuple(int(mp.sign(rate)) for rate in self.distribution.T * self.scene.velocity)

    def law(self, multipliers) -> tuple:
        """tau (f, 1) for multipliers (m, 1), and its derivative (f, m)."""
        with mp.workdps(_FINE):
            h, m = mp.mpf(10) ** -60, len(self.kinds)
            slope = mp.zeros(len(self.joints), m)
            for row in range(m):
                step = mp.matrix([h * int(row == r) for r in range(m)])
                slope[:, row] = (self._friction(multipliers + step) - self._friction(multipliers - step)) / (2 * h)
            return self._friction(multipliers), slope

    def _friction(self, multipliers):
        out, first, place = mp.zeros(len(self.joints), 1), 0, 0
        for joint in self.scene.joints:
            size = sum(len(_PARTS[part]) for part in space.ROWS[joint.kind])
            own = [multipliers[row] for row in range(first, first + size)]
            first += size
            if joint.name in self.rubs:
                rub = self.rubs[joint.name]
                scale = mp.mpmathify(rub.mu) * mp.mpmathify(rub.radius)
                out[place] = -self.senses[place] * scale * _pressed(joint.kind, rub, own)
                place += 1
        return out


_PARTS = {"offset": "xyz", "shift": "xy", "tilt": "xy", "rotation": "xyz"}


def _pressed(kind: str, rub: Rub, own: list):
    """N of the multipliers of a joint: radial, axial, bending of a revolute, radial, bending, twist of a prismatic."""
    length, radius, thrust, twist = (mp.mpmathify(x) for x in (rub.length, rub.radius, rub.thrust, rub.twist))
    force, moment = own[:2], own[3:5] if kind == "Revolute" else own[2:4]
    beside = abs(own[2]) * thrust / radius if kind == "Revolute" else abs(own[4]) / twist
    if rub.additive:
        return mp.hypot(*force) + mp.hypot(*moment) / length + beside
    c = [-moment[1] / length, moment[0] / length]
    ends = (mp.hypot(force[0] / 2 + sign * c[0], force[1] / 2 + sign * c[1]) for sign in (1, -1))
    return sum(ends) + beside


# Scenes -------------------------------------------------------------------------------------


@exactly
def carriage() -> Scene:
    """A body on two parallel rails, a slider on each, its centre of mass beside both."""
    axis, mark, axes = vector(2, -1, 2), vector(1, 1, 0), turn(vector(1, 2, -1))
    inertia = mp.matrix([["0.3", "0.02", "-0.05"], ["0.02", "0.4", "0.04"], ["-0.05", "0.04", "0.5"]])
    origin = vector("0.3", -1, "0.7")
    body = Body(mp.mpf(4), inertia, origin + axes * vector("0.1", "0.2", "0.3"), origin, axes)
    joints = [
        Joint("Prismatic", name, 0, GROUND, origin + point, frame(axis, mark))
        for name, point in (("left", vector(0, "-0.2", 0)), ("right", vector("0.1", "0.3", "0.2")))
    ]
    return Scene((body,), tuple(joints), vector(3, -9, 2), 5, (3, -1, 2, 0, 1, -2))


PIN = Rub("0.2", length="0.05", radius="0.012", thrust="0.02")
ADDITIVE = Rub("0.15", length="0.04", radius="0.02", thrust="0.03", additive=True)
SCENES = {
    "door": lambda: Rubbing(space.door(), {name: PIN for name in ("bottom", "middle", "top")}),
    "door, additive": lambda: Rubbing(space.door(), {"bottom": ADDITIVE, "top": PIN}),
    "bennett": lambda: Rubbing(space.bennett(), {name: PIN for name in "ABCD"}),
    "carriage": lambda: Rubbing(
        carriage(), {name: Rub("0.1", length="0.2", twist="0.06") for name in ("left", "right")}
    ),
}
