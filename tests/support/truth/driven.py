"""Mechanisms in space whose first joint, a pin at the ground, is driven: what the drive gives, to 50 digits.

Bennett's linkage by its equations at each pose, the angle of the pin one row more. Bricard's by its energies along the
closed form of its motion, u theta' = d(T + V)/dt, without constraints.
"""

from dataclasses import dataclass
from functools import cached_property

from mpmath import mp

from . import space
from .exact import exactly, independent_rows, solve_columns

_FINE = 150  # digits of differences


@dataclass(frozen=True, eq=False)
class Driven(space.Scene):
    """A scene of one freedom at a pose, with the rate and the acceleration of the driven angle."""

    rate: object = 0
    change: object = 0

    @property
    def kinds(self) -> tuple:
        """The last is that of the drive."""
        return (*super().kinds, "moment")

    def constraints(self, s, rate):
        """With the angle of the pin, whose axis is that of body j, the ground."""
        (pin, *_), body, count = self.joints, self.bodies[0], len(self.bodies)
        moved = body.axes * space.turn(rate[3 * count : 3 * count + 3] * s) * body.axes.T
        turned = pin.axes.T * moved * pin.axes
        return mp.matrix([*super().constraints(s, rate), mp.atan2(turned[1, 0], turned[0, 0])])

    @cached_property
    @exactly
    def velocity(self):
        """The one at which the angle has its rate."""
        rows = independent_rows(self.jacobian, self.rank)
        square = mp.matrix([[self.jacobian[row, c] for c in range(self.jacobian.cols)] for row in rows])
        return solve_columns(square, mp.matrix([self.rate if row == len(self.kinds) - 1 else 0 for row in rows]))

    @cached_property
    def gamma(self):
        """That of constant velocities, and the acceleration of the angle."""
        with mp.workdps(_FINE):
            out = space.Scene.gamma.func(self)
            out[len(self.kinds) - 1] += self.change
            return out


@exactly
def bennett(angle, rate, change) -> Driven:
    """Bennett's linkage at an angle of its first pin."""
    scene = space.bennett(angle)
    return Driven(scene.bodies, scene.joints, scene.gravity, scene.rank + 1, rate=rate, change=change)


# Bricard's mechanism --------------------------------------------------------------------------------------


def _bars(theta):
    """Centres and axes of the five bars, x along each, z along the joint at its start; the problem A04 at -pi / 2."""
    phi = -mp.acos(1 / (1 + mp.cos(theta)) - 1)
    frame = mp.matrix([[0, -1, 0], [0, 0, 1], [-1, 0, 0]])
    end, centres, frames = mp.matrix([0, 0, 0]), [], []
    for k in range(5):
        frame = frame * space.turn(mp.matrix([0, 0, (theta, phi)[k % 2]]))
        along = mp.matrix([frame[c, 0] for c in range(3)])
        centres, frames, end = [*centres, end + along / 2], [*frames, frame], end + along
        frame = frame * space.turn(mp.matrix([mp.pi / 2 * (-1) ** k, 0, 0]))
    return centres, frames


def _energies(theta, h):
    """Half of T over theta'^2, and V, by differences."""
    width, (centres, frames) = mp.mpf(1) / 10, _bars(theta)
    (after, turned), (before, turned_back) = _bars(theta + h), _bars(theta - h)
    inertia, potential = mp.mpf(0), mp.mpf(0)
    for k, centre in enumerate(centres):
        speed = (after[k] - before[k]) / (2 * h)
        spin = frames[k].T * (turned[k] - turned_back[k]) / (2 * h)
        rates = spin[2, 1] ** 2 * width**2 / 6 + (spin[0, 2] ** 2 + spin[1, 0] ** 2) * (1 + width**2) / 12
        inertia += (speed.T * speed)[0] + rates
        potential += mp.mpf("9.81") * centre[1]
    return inertia, potential


def torque_of_bricard(theta, rate, change):
    """I theta'' + dI/dtheta theta'^2 / 2 + dV/dtheta."""
    with mp.workdps(_FINE):
        h = mp.mpf(10) ** -32
        (inertia, _), (more, high), (less, low) = (_energies(theta + step, h) for step in (0, h, -h))
        return inertia * change + (more - less) / (2 * h) * rate**2 / 2 + (high - low) / (2 * h)
