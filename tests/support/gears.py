"""Ready gear mechanisms with what is known of each in closed form, as the arguments of `mechanisms.Case`."""

from mpmath import mp
from truth import exact, scenes
from truth.exact import exactly
from truth.meshes import Mesh

import redundax as rx

ZERO = mp.mpf(0)
ORIGIN = (ZERO, ZERO)
ANGLE = mp.pi / 9  # pressure angle


def _disc(mass, radius, moment=ZERO) -> exact.Body:
    return exact.Body(mass, mass * radius**2 / 2, (ZERO, ZERO, moment))


def _around(count: int, start=ZERO) -> list:
    return [start + 2 * mp.pi * k / count for k in range(count)]


def _at(angle, radius=1) -> tuple:
    return radius * mp.cos(angle), radius * mp.sin(angle)


def _plus(*terms) -> tuple:
    """Sum of weights times vectors."""
    return tuple(sum(weight * vector[c] for weight, vector in terms) for c in range(2))


def _revolutes(mu_rho, pins, on, axes) -> tuple:
    """A and B of the first two bodies at the origin, and C1, ... of the others."""
    first = [exact.Revolute(name, body, 0, ORIGIN, ORIGIN, mu_rho) for body, name in enumerate("AB", 1)]
    return *first, *(
        exact.Revolute(f"C{k}", 2 + k, on, ORIGIN, axis, mu_rho) for k, axis in zip(pins, axes, strict=True)
    )


def _press(angle) -> tuple:
    """Forces per multiplier at a place around the axis: of the first mesh on the wheel in the middle, and of the second
    on what stands around it, by a ring and by a wheel in the middle."""
    out, across = _at(angle), _at(angle + mp.pi / 2)
    c, s = mp.cos(ANGLE), mp.sin(ANGLE)
    return _plus((-c, across), (-s, out)), _plus((c, across), (-s, out)), _plus((-c, across), (s, out))


def _states(names, places, forces) -> tuple:
    """The first path against each of the others; `forces` gives rows of A, B, C and both meshes for a place."""
    out = []
    for other in range(1, len(places)):
        state: dict = {}
        for path, sign in ((0, 1), (other, -1)):
            at_a, at_b, at_c, own, second = forces(places[path])
            for joint, vector in (("A", at_a), ("B", at_b), (f"C{path + 1}", at_c)):
                for axis, value in zip("xy", vector, strict=True):
                    state[f"{joint}.{axis}"] = state.get(f"{joint}.{axis}", 0) + sign * value
            state |= {f"{names[0]}{path + 1}.teeth": sign * own, f"{names[1]}{path + 1}.teeth": sign * second}
        out.append(state)
    return tuple(out)


@exactly
def planetary(planets: int, sun_teeth: int, planet_teeth: int) -> dict:
    """Sun at an angle that sets the carrier along (3/5, 4/5)."""
    module, gravity, rate, torque, load = exact.exact(("3/1000", "10", "40", "8", "-12"))
    masses = exact.exact(("3/5", "6/5", "1/4"))
    ring_teeth = sun_teeth + 2 * planet_teeth
    slow = mp.mpf(sun_teeth) / (sun_teeth + ring_teeth)
    spin = slow * (1 - mp.mpf(ring_teeth) / planet_teeth)
    carrier = mp.atan2(4, 3)
    at, places = carrier / slow, _around(planets, carrier)
    sun_radius, radius, reach = (module * z / 2 for z in (sun_teeth, planet_teeth, sun_teeth + planet_teeth))
    in_ring = mp.pi / ring_teeth if planet_teeth % 2 else ZERO

    def pose(phi):
        angles = _around(planets, slow * phi)
        turned = [p + ((planet_teeth + 1) * mp.pi - sun_teeth * (phi - p)) / planet_teeth for p in angles]
        return (
            (*ORIGIN, phi),
            (*ORIGIN, slow * phi),
            *((*_at(p, reach), x) for p, x in zip(angles, turned, strict=True)),
        )

    @exactly
    def truth(mu_rho):
        teeth = []
        for k in range(planets):
            ends = (ORIGIN, ORIGIN)
            teeth += [
                Mesh(f"S{k + 1}", 1, 3 + k, *ends, (sun_teeth, planet_teeth), module, ANGLE, -1),
                Mesh(f"R{k + 1}", 3 + k, 0, *ends, (planet_teeth, -ring_teeth), module, ANGLE, 1, ZERO, in_ring),
            ]
        bodies = [_disc(masses[0], sun_radius, torque), _disc(masses[1], reach, load)]
        return exact.Mechanism(
            bodies=(*bodies, *[_disc(masses[2], radius)] * planets),
            revolutes=_revolutes(mu_rho, range(1, planets + 1), 2, [_at(p, reach) for p in _around(planets)]),
            translationals=(),
            drivers=(),
            meshes=tuple(teeth),
            gravity=(ZERO, -gravity),
            rank=5 + 3 * planets,
            **scenes.on_curve(pose, at, rate),
        )

    def forces(place):
        on_sun, on_planet, _ = _press(place)
        pin = _plus((1, on_planet), (-1, on_sun))
        return on_sun, pin, pin, 1, 1

    inertia = masses[0] * sun_radius**2 / 2 + (masses[1] / 2 + planets * masses[2]) * (reach * slow) ** 2
    inertia += planets * masses[2] * (radius * spin) ** 2 / 2
    acceleration = (torque + load * slow) / inertia
    return {
        "make": rx.mechanisms.planetary,
        "parameters": {
            "planets": planets,
            "sun_teeth": sun_teeth,
            "planet_teeth": planet_teeth,
            "module": module,
            "sun_mass": masses[0],
            "carrier_mass": masses[1],
            "planet_mass": masses[2],
            "torque": torque,
            "load": load,
            "gravity": gravity,
        },
        "friction": {"mu_rho": "1/2000"},
        "coordinate": "sun.phi",
        "at": at,
        "rate": rate,
        "n": 6 + 3 * planets,
        "m": 4 + 4 * planets,
        "rank": 5 + 3 * planets,
        "truth": truth,
        "self_stress": _states("SR", places, forces),
        "acceleration": acceleration,
        "motion": lambda t: at + acceleration * t**2 / 2,
    }


@exactly
def countershaft_train(shafts: int) -> dict:
    """The numbers of teeth that the builder has by default."""
    a, b, c, d = 20, 40, 24, 36
    module, gravity, rate, at, torque, load = exact.exact(("1/400", "10", "-30", "3/5", "6", "-11"))
    masses = exact.exact(("1", "9/5", "7/5"))
    first, second = -mp.mpf(a) / b, mp.mpf(a * c) / (b * d)  # rates of countershafts and output
    reach, places = module * (a + b) / 2, _around(shafts)
    meshed = [p + (a * p + (b + 1) * mp.pi) / b for p in places]
    timing = [p + mp.pi - s + (d * (p + mp.pi) + (d + 1) * mp.pi) / c for p, s in zip(places, meshed, strict=True)]

    centres = [_at(p, reach) for p in places]

    def pose(phi):
        turned = ((*centre, angle + first * phi) for centre, angle in zip(centres, meshed, strict=True))
        return (*ORIGIN, phi), (*ORIGIN, second * phi), *turned

    @exactly
    def truth(mu_rho):
        teeth = []
        for k, angle in enumerate(timing, 1):
            teeth += [
                Mesh(f"I{k}", 1, 2 + k, ORIGIN, ORIGIN, (a, b), module, ANGLE, -1),
                Mesh(f"O{k}", 2 + k, 2, ORIGIN, ORIGIN, (c, d), module, ANGLE, 1, angle),
            ]
        return exact.Mechanism(
            bodies=(
                _disc(masses[0], module * a / 2, torque),
                _disc(masses[1], module * d / 2, load),
                *[_disc(masses[2], module * b / 2)] * shafts,
            ),
            revolutes=_revolutes(mu_rho, range(1, shafts + 1), 0, centres),
            translationals=(),
            drivers=(),
            meshes=tuple(teeth),
            gravity=(ZERO, -gravity),
            rank=5 + 3 * shafts,
            **scenes.on_curve(pose, at, rate),
        )

    def forces(place):
        on_input, _, on_shaft = _press(place)
        ratio = mp.mpf(b) / c
        return on_input, _plus((-ratio, on_shaft)), _plus((-1, on_input), (ratio, on_shaft)), 1, ratio

    radii = [(module * z / 2) ** 2 / 2 for z in (a, d, b)]
    inertia = masses[0] * radii[0] + masses[1] * radii[1] * second**2 + shafts * masses[2] * radii[2] * first**2
    acceleration = (torque + load * second) / inertia
    names = ("input_mass", "output_mass", "shaft_mass")
    return {
        "make": rx.mechanisms.countershaft_train,
        "parameters": {
            "shafts": shafts,
            "module": module,
            **dict(zip(names, masses, strict=True)),
            "torque": torque,
            "load": load,
            "gravity": gravity,
        },
        "friction": {"mu_rho": "1/2000"},
        "coordinate": "input.phi",
        "at": at,
        "rate": rate,
        "n": 6 + 3 * shafts,
        "m": 4 + 4 * shafts,
        "rank": 5 + 3 * shafts,
        "truth": truth,
        "self_stress": _states("IO", places, forces),
        "acceleration": acceleration,
        "motion": lambda t: at + acceleration * t**2 / 2,
    }
