"""Overconstrained mechanisms at rest, exact to 50 digits: geometry by mpmath, so that what depends does so exactly

A case is bodies, by mass, principal inertia and centre, all in global axes, and joints, by kind, bodies, point and
axis. To add one, write a function that returns a `Case` and put it in `CASES`; all programs take it from there. Joints
come so that a program of trees may hang each body on the first joint that has it as i.
"""

from typing import NamedTuple

import mpmath as mp
import numpy as np

mp.mp.dps = 50
GRAVITY = (mp.mpf("1.5"), mp.mpf("-2.5"), mp.mpf("-9"))  # m/s^2, oblique, so that every direction is loaded
GROUND = "ground"


class Body(NamedTuple):
    """Mass, kg, inertia about the centre along the global axes, kg m^2, and centre, m."""

    mass: mp.mpf
    inertia: tuple
    centre: tuple


class Joint(NamedTuple):
    """A joint of a kind between bodies i and j, at a point, m, along or about an axis of length 1."""

    kind: str
    i: str
    j: str
    point: tuple
    axis: tuple


class Case(NamedTuple):
    """A mechanism: bodies and joints by name; redundancy and freedom, as counting by hand gives them."""

    name: str
    bodies: dict[str, Body]
    joints: dict[str, Joint]
    redundancy: int
    freedom: int


def hung(case: Case) -> tuple[dict[str, str], list[str]]:
    """For programs of trees: the joint that each body hangs on, and the joints that close loops."""
    found: dict[str, str] = {}
    closing = []
    for name, joint in case.joints.items():
        if joint.i not in found and (joint.j in found or joint.j == GROUND):
            found[joint.i] = name
        else:
            closing.append(name)
    return found, closing


def floats(values):
    return np.array([float(x) for x in values])


def axes_along(axis):
    """Axes whose z is a direction, as columns."""
    z = floats(axis)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def vector(*values):
    return tuple(mp.mpf(str(x)) if isinstance(x, float) else mp.mpf(x) for x in values)


X, Y, Z = vector(1, 0, 0), vector(0, 1, 0), vector(0, 0, 1)


def plus(a, b, factor=1):
    return tuple(x + factor * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    size = mp.sqrt(sum(x * x for x in a))
    return tuple(x / size for x in a)


def rod(*points):
    """A body of 1 to 2 kg at the mean of some points."""
    centre = tuple(sum(part) / len(points) for part in zip(*points, strict=True))
    mass = 1 + mp.fabs(centre[0]) / 3
    return Body(mass, vector(0.02, 0.03, 0.04), centre)


def ring(name, points, axes, redundancy, freedom, kinds=()):
    """A closed chain: joint k at point k, between body k - 1 and body k, of which the last is the ground."""
    count = len(points)
    bodies = {f"{k}": rod(points[k], points[k + 1]) for k in range(count - 1)}
    names = [*bodies, GROUND]
    joints = {}
    for k in range(count):
        i, j = (names[k], names[k - 1]) if k < count - 1 else (names[k - 1], GROUND)
        joints["ABCDEF"[k]] = Joint(dict(kinds).get(k, "hinge"), i, j, points[k], axes[k])
    return Case(name, bodies, joints, redundancy, freedom)


def four_bar():
    points = [vector(0, 0, 0), vector(0.1, 0, 0.3), vector(0.6, 0, 0.4), vector(0.7, 0, 0)]
    return ring("four-bar in space", points, [Y] * 4, 3, 1)


def control():
    points = [vector(0, 0, 0), vector(0.1, 0, 0.3), vector(0.6, 0, 0.4), vector(0.7, 0, 0)]
    return ring("four-bar, freed (control)", points, [Y] * 4, 0, 1, [(1, "cylindrical"), (3, "ball")])


def slider_crank():
    points = [vector(0, 0, 0), vector(0.1, 0, 0.2), vector(0.7, 0, 0.1), vector(0.8, 0, 0.1)]
    order = ring("slider-crank", points, [Y, Y, Y, X], 3, 1, [(3, "slide")])
    joints = dict(sorted(order.joints.items(), key=lambda each: each[0] != "D"))  # a slide is no loop of MuJoCo's
    joints["C"] = joints["C"]._replace(i="1", j="2")
    return order._replace(joints={name: joints[name] for name in ("D", "A", "B", "C")})


def door():
    bodies = {"door": Body(mp.mpf(20), vector(7, 8, 1.1), vector(0.4, 0, 1))}
    joints = {
        f"hinge {k}": Joint("hinge", "door", GROUND, vector(0, 0, z), Z) for k, z in enumerate((0.2, 1.0, 1.8), 1)
    }
    return Case("door on three hinges", bodies, joints, 10, 1)


def shaft():
    bodies = {"shaft": Body(mp.mpf(5), vector(0.01, 0.4, 0.4), vector(0.3, 0, 0.02))}
    joints = {"fixed bearing": Joint("hinge", "shaft", GROUND, vector(0, 0, 0), X)}
    joints |= {
        f"bearing {k}": Joint("cylindrical", "shaft", GROUND, vector(x, 0, 0), X) for k, x in ((2, 0.5), (3, 0.9))
    }
    return Case("shaft in three bearings", bodies, joints, 8, 1)


def rails():
    bodies = {"table": Body(mp.mpf(12), vector(0.4, 0.5, 0.7), vector(0.1, 0.05, 0.2))}
    joints = {f"rail {k}": Joint("slide", "table", GROUND, vector(0, y, 0), X) for k, y in ((1, -0.3), (2, 0.3))}
    return Case("table on two rails", bodies, joints, 5, 1)


def beam():
    bodies = {"beam": Body(mp.mpf(8), vector(0.01, 0.6, 0.6), vector(0.4, 0, 0))}
    joints = {name: Joint("fixed", "beam", GROUND, vector(x, 0, 0), X) for name, x in (("left", 0), ("right", 1))}
    return Case("beam built in twice", bodies, joints, 6, 0)


def plate():
    bodies = {"plate": Body(mp.mpf(6), vector(0.2, 0.2, 0.4), vector(0.1, 0.2, 0.1))}
    feet = {"1": (0, 0, 0), "2": (1, 0, 0), "3": (0.2, 0.8, 0)}
    joints = {f"ball {name}": Joint("ball", "plate", GROUND, vector(*at), Z) for name, at in feet.items()}
    return Case("plate on three balls", bodies, joints, 3, 0)


def cranks():
    """A parallelogram of three cranks."""
    lean = vector(0.1, 0, 0.3)
    bodies = {f"crank {k}": rod(vector(x, 0, 0), plus(vector(x, 0, 0), lean)) for k, x in enumerate((0, 0.4, 0.9), 1)}
    bodies["bar"] = rod(lean, plus(vector(0.9, 0, 0), lean))
    joints = {f"A{k}": Joint("hinge", f"crank {k}", GROUND, vector(x, 0, 0), Y) for k, x in enumerate((0, 0.4, 0.9), 1)}
    for k, x in enumerate((0, 0.4, 0.9), 1):
        joints[f"B{k}"] = Joint("hinge", "bar", f"crank {k}", plus(vector(x, 0, 0), lean), Y)
    return Case("parallelogram of three cranks", bodies, joints, 7, 1)


def bennett():
    """Twists alpha and beta, lengths a and b with a / sin alpha = b / sin beta, no offsets, theta_1 = 1:

    tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2)
    """
    alpha, beta, first = mp.mpf("0.6"), mp.mpf("1.1"), mp.mpf(1)
    a = mp.mpf("0.4")
    b = a * mp.sin(beta) / mp.sin(alpha)
    second = 2 * mp.atan(mp.sin((beta + alpha) / 2) / mp.sin((beta - alpha) / 2) / mp.tan(first / 2))
    frame, points, axes = mp.eye(4), [], []
    for theta, twist, length in zip((first, second, -first, -second), (alpha, beta) * 2, (a, b) * 2, strict=True):
        points.append(tuple(frame[k, 3] for k in range(3)))
        axes.append(tuple(frame[k, 2] for k in range(3)))
        c, s, ct, st = mp.cos(theta), mp.sin(theta), mp.cos(twist), mp.sin(twist)
        step = [[c, -s * ct, s * st, length * c], [s, c * ct, -c * st, length * s], [0, st, ct, 0], [0, 0, 0, 1]]
        frame = frame * mp.matrix(step)
    return ring("Bennett's linkage", points, axes, 3, 1)


def bricard():
    """Six links along edges of a cube, each hinge square to both of its links."""
    ways = [X, vector(0, -1, 0), Z, vector(-1, 0, 0), Y, vector(0, 0, -1)]
    points, at = [], vector(0, 0, 0)
    for way in ways:
        points.append(at)
        at = plus(at, way)
    return ring("Bricard's linkage", points, [unit(cross(ways[k - 1], ways[k])) for k in range(6)], 1, 1)


def sarrus():
    """A platform on two legs of three parallel hinges, about x and about y."""
    foot, knee, hip = (vector(1, 0, 0), vector(1.3, 0, 0.4), vector(1, 0, 0.8))

    def turned(p):
        return (p[1], p[0], p[2])

    bodies = {"platform": Body(mp.mpf(3), vector(0.1, 0.1, 0.2), vector(0.3, 0.2, 0.8))}
    joints = {}
    for leg, axis, place in (("a", Y, lambda p: p), ("b", X, turned)):
        low, middle, high = (place(p) for p in (foot, knee, hip))
        bodies[f"{leg} low"], bodies[f"{leg} high"] = rod(low, middle), rod(middle, high)
        joints[f"{leg} foot"] = Joint("hinge", f"{leg} low", GROUND, low, axis)
        joints[f"{leg} knee"] = Joint("hinge", f"{leg} high", f"{leg} low", middle, axis)
        joints[f"{leg} hip"] = Joint("hinge", "platform", f"{leg} high", high, axis)
    return Case("Sarrus' linkage", bodies, joints, 1, 1)


def scissor_lift():
    """Two bars that cross, on a pin and a slider below and above."""
    w, h = mp.mpf("0.8"), mp.mpf("0.5")
    corners = [vector(0, 0, 0), (w, mp.mpf(0), mp.mpf(0)), (mp.mpf(0), mp.mpf(0), h), (w, mp.mpf(0), h)]
    a, b = rod(corners[0], corners[3]), rod(corners[1], corners[2])
    light = vector(0.001, 0.001, 0.001)
    bodies = {"a": a, "low": Body(mp.mpf("0.2"), light, corners[1]), "b": b}
    bodies |= {"deck": Body(mp.mpf(4), vector(0.1, 0.2, 0.2), (w / 2, mp.mpf(0), h))}
    bodies |= {"high": Body(mp.mpf("0.2"), light, corners[3])}
    joints = {
        "pin": Joint("hinge", "a", GROUND, corners[0], Y),
        "rail": Joint("slide", "low", GROUND, corners[1], X),
        "middle": Joint("hinge", "b", "a", (w / 2, mp.mpf(0), h / 2), Y),
        "deck pin": Joint("hinge", "deck", "b", corners[2], Y),
        "deck rail": Joint("slide", "high", "deck", corners[3], X),
        "foot": Joint("hinge", "b", "low", corners[1], Y),
        "head": Joint("hinge", "high", "a", corners[3], Y),
    }
    return Case("scissor lift", bodies, joints, 6, 1)


CASES = (
    four_bar,
    control,
    slider_crank,
    door,
    shaft,
    rails,
    beam,
    plate,
    cranks,
    bennett,
    bricard,
    sarrus,
    scissor_lift,
)
