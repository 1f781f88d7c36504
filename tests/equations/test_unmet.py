"""What an assembly without an answer says: a slip of one joint first, or the two that contradict each other."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs = rx.spatial
PINS = {"a": (0.0, 0.0, 0.0), "b": (0.05, 0.0, 0.15), "c": (0.4, 0.0, 0.3), "d": (0.45, 0.0, 0.0)}
BODIES = {"crank": "a", "rod": "b", "arm": "d"}  # each with its origin at a pin
PAIRS = {"a": ("crank", "ground"), "b": ("rod", "crank"), "c": ("arm", "rod"), "d": ("arm", "ground")}


def four_bar(axis=(0.0, 1.0, 0.0), shift=(0.0, 0.0, 0.0)):
    """A planar four-bar built in space, closed as it is drawn but for a slip in the placement of c on the rod."""

    def on(body, pin, axis=(0.0, 1.0, 0.0), shift=(0.0, 0.0, 0.0)):
        origin = PINS[BODIES[body]] if body in BODIES else (0.0, 0.0, 0.0)
        return rs.Placement(np.subtract(PINS[pin], origin) + shift, axis, mark=(1.0, 0.0, 0.0))

    slip = {"axis": axis, "shift": shift}
    joints = [
        rs.Revolute(pin, i, j, on_i=on(i, pin), on_j=on(j, pin, **(slip if pin == "c" else {})))
        for pin, (i, j) in PAIRS.items()
    ]
    bodies = [rs.Body(name, 1.0, (0.01, 0.01, 0.01), position=PINS[pin]) for name, pin in BODIES.items()]
    return rx.Mechanism(bodies, joints, units=rx.units.SI)


@pytest.mark.parametrize(
    ("slip", "words"),
    [  # sin(0.25) = 0.247 is the residual of an axis that is 0.25 rad off
        (
            {"axis": (0.0, np.cos(0.25), np.sin(0.25))},
            r"guess: c\.bend_1 by 0\.25 rad \(arm on rod\); all 19 others are",
        ),
        ({"shift": (0.0, 0.05, 0.0)}, r"guess: c\.axial by 0\.05 m \(arm on rod\); all 19 others are met there"),
    ],
)
def test_the_joint_with_a_slip_is_told_first(slip, words):
    with pytest.raises(rx.NoSolutionError, match=words) as told:
        rx.assemble(four_bar(**slip))
    assert str(told.value).count("bend") + str(told.value).count("axial") <= 2  # no list of all rows


def test_sizes_in_another_unit_and_several_joints_are_told_in_plain_figures():
    with pytest.raises(rx.NoSolutionError, match=r"c\.radial_1 by 350 m .* points and axes of this joint;"):
        rx.assemble(four_bar(shift=(350.0, 0.0, 0.0)))


def turned(first, second, **rates):
    """A rod on a pin with two drivers."""
    drivers = [rx.AngleDriver(name, "rod", "ground", law) for name, law in (("motor", first), ("lock", second))]
    pin = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    rod = rx.Mechanism([rx.Body("rod", 1.0, 0.1)], [pin, *drivers], units=rx.units.SI)
    return rx.assemble(rod, {"rod.x": 0.5}, **rates)


def test_two_that_contradict_are_told_with_what_they_miss():
    with pytest.raises(
        rx.NoSolutionError, match=r"motor\.angle and lock\.angle cannot both be met: .* by 0\.1 rad"
    ) as a:
        turned(0.2, 0.4)
    with pytest.raises(rx.NoSolutionError, match=r"No velocity .* motor\.angle by 0\.5 rad/s") as b:
        turned(rx.Polynomial([0.2, 1.0]), 0.2)
    assert not any("guess" in str(told.value).split("near the guess")[-1] for told in (a, b))  # none would help
    with pytest.raises(rx.NoSolutionError, match=r"motor\.angle.* and rod\.phi as given cannot (both|all) be met"):
        turned(0.2, rx.Polynomial([0.2]), positions={"rod.phi": 0.5})
    assert jnp.isfinite(turned(0.2, 0.2).q).all()
