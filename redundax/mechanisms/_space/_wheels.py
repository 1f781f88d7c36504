"""Wheels on a floor: a disc that rolls, and a cart on four wheels

An upright cart on four legs has one self-stress, and both wheels of an axle say the same of the way across: with fixed
axles its rows of velocity add two. All that drive the same wheels beyond one fight each other.
"""

from collections.abc import Callable, Sequence

from jax.typing import ArrayLike
from jaxtyping import Array

from ..._bodies._body import GROUND
from ..._bodies._mechanism import Mechanism
from ..._bodies._space._body import Body
from ..._bodies._space._joints._pairs import Revolute
from ..._bodies._space._joints._wheels import Wheel
from ..._bodies._space._loads import AppliedForce
from ..._bodies._speed_driver import SpeedDriver
from ..._system._names import index_of
from ..._system._units import Units
from ..._tools._module import Numbers, floats, names_in, numpy_of
from .._parts import checked

CORNERS = ("front left", "front right", "rear left", "rear right")


def _disc(name: str, mass: Numbers, radius: Numbers, position: Numbers, orientation: Numbers | None = None) -> Body:
    """A thin uniform disc whose axle is y of its frame."""
    unit = floats(mass) * floats(radius) ** 2 / 4
    inertia = numpy_of(unit).stack([unit, 2 * unit, unit])
    return Body(
        name, mass, inertia, position=position, orientation=(1, 0, 0, 0) if orientation is None else orientation
    )


@checked
def rolling_disc(
    radius: ArrayLike = 0.3, mass: ArrayLike = 2.0, tilt: ArrayLike = 0.0, gravity: ArrayLike = 9.81
) -> Mechanism:
    """A thin uniform disc that rolls on a floor, upright or tilted, as a coin does.

    Body "disc", its frame at the centre, y along the axle; wheel "rim". At the reference pose the axle is (0, cos tilt,
    sin tilt), and the disc stands above (0, 0). n = 6, m = 3: five freedoms of position and three of velocity.

    ??? example

        ```python
        disc = rx.mechanisms.rolling_disc(tilt=0.3)
        rx.solve(disc, rx.assemble(disc, qd=[0.0, 0.0, 0.0, 0.1, 8.0, 0.5]))["rim.across"]
        ```

    **Arguments:**

    - `radius`: m.
    - `mass`: kg.
    - `tilt`: of the disc from upright at the reference pose, rad.
    - `gravity`: m/s^2.
    """
    radius, tilt, gravity = (floats(x) for x in (radius, tilt, gravity))
    xp, zero = numpy_of(radius, tilt, gravity), 0.0 * radius * tilt
    c, s = xp.cos(tilt) + zero, xp.sin(tilt) + zero
    centre, turn = xp.stack([zero, -radius * s, radius * c]), (tilt + zero) / 2
    disc = _disc("disc", mass, radius, centre, xp.stack([xp.cos(turn), xp.sin(turn), 0 * turn, 0 * turn]))
    rim = Wheel("rim", disc, GROUND, centre, xp.stack([zero, c, s]), radius=radius)
    return Mechanism([disc], [rim], gravity=-gravity * xp.eye(3, dtype=gravity.dtype)[2], units=Units())


@checked
def cart(
    wheelbase: ArrayLike = 0.8,
    track: ArrayLike = 0.6,
    radius: ArrayLike = 0.15,
    mass: ArrayLike = 30.0,
    wheel_mass: ArrayLike = 1.5,
    height: ArrayLike = 0.25,
    push: Numbers = (20.0, 10.0, 0.0),
    driven: Sequence[str] = (),
    speed: Callable[[Array], Array] | Numbers = 5.0,
    gravity: ArrayLike = 9.81,
) -> Mechanism:
    """A cart on four wheels with fixed axles, which rolls straight on: four legs, and more wheels than it needs.

    Bodies "chassis", a uniform block with its frame at its middle, and "front left", "front right", "rear left" and
    "rear right", discs; hubs "front left hub", ..., revolutes, and wheels "front left tyre", ... on the floor z = 0. It
    heads for x. n = 30, m = 32 and rank 29, one degree of freedom: one self-stress of the four legs, two of the rows of
    velocity, and one more for each motor beyond the first.

    ??? example

        ```python
        cart = rx.mechanisms.cart(driven=("rear left", "rear right"))
        print(rx.analyze(cart, rx.assemble(cart)))
        ```

    **Arguments:**

    - `wheelbase`, `track`: distance of the axles, and of the wheels of one, m.
    - `radius`: of the wheels, m.
    - `mass`, `wheel_mass`: of the chassis and of each wheel, kg.
    - `height`: of the middle of the chassis, m.
    - `push`: force on the middle of the chassis, global components, N.
    - `driven`: which wheels have a motor of their speed, "front left motor", say.
    - `speed`: of the motors, rad/s, a number or a function of time.
    - `gravity`: m/s^2.
    """
    wheelbase, track, radius, mass, height, gravity = map(floats, (wheelbase, track, radius, mass, height, gravity))
    xp, zero = numpy_of(wheelbase, track, radius, mass, height, gravity), 0.0 * radius
    squares = xp.stack([track**2 + zero, wheelbase**2 + zero, wheelbase**2 + track**2])
    middle = xp.stack([zero, zero, height + zero])
    chassis = Body("chassis", mass, mass / 12 * squares, position=middle)
    wheels, hubs, tyres = [], [], []
    for name, (along, side) in zip(CORNERS, ((1, 1), (1, -1), (-1, 1), (-1, -1)), strict=True):
        centre = xp.stack([along * wheelbase / 2 + zero, side * track / 2 + zero, radius])
        wheels.append(_disc(name, wheel_mass, radius, centre))
        hubs.append(Revolute(f"{name} hub", wheels[-1], chassis, centre, (0, 1, 0)))
        tyres.append(Wheel(f"{name} tyre", wheels[-1], GROUND, centre, (0, 1, 0), radius=radius))
    driven = names_in("driven", driven)
    for name in driven:
        index_of("driven", name, CORNERS, " of wheels")
    motors = [SpeedDriver(f"{name} motor", f"{name} hub.angle", speed) for name in driven]
    loads = [AppliedForce(chassis, push, point=middle)]
    joints, down = [*hubs, *tyres], -gravity * xp.eye(3, dtype=gravity.dtype)[2]
    return Mechanism([chassis, *wheels], joints, couplers=motors, loads=loads, gravity=down, units=Units())
