"""Friction of joints in space against closed forms: bearings, guides, and what presses them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx

rs = rx.spatial
MU, MASS, WEIGHT = 0.2, 2.0, 30.0
RADIUS, LENGTH, THRUST, TWIST = 0.01, 0.05, 0.016, 0.03  # m


# Bearings -----------------------------------------------------------------------------------

FORCE, ARM, SPIN = np.array([30.0, 40.0, 0.0]), 0.07, 3.0


SIZES, HERE = {"pin_radius": RADIUS, "bearing_length": LENGTH, "thrust_radius": THRUST}, rs.Placement((0, 0, 0))


def rotor(**given):
    """A balanced rotor on a vertical axis, with a weight and a force at an arm above the middle of its bearing."""
    body = rs.Body("rotor", MASS, (0.1, 0.1, 0.15))
    pin = rs.Revolute("pin", body, rx.GROUND, point=(0, 0, 0), **{"friction": rx.Coulomb(MU), **SIZES, **given})
    push = rs.AppliedForce(body, FORCE, point=(0, 0, ARM))
    mechanism = rx.Mechanism([body], [pin], loads=[push], gravity=(0, 0, -WEIGHT / MASS))
    return mechanism, rx.assemble(mechanism, rates={"pin.angle": SPIN})


ENDS = 50 * (abs(0.5 + ARM / LENGTH) + abs(0.5 - ARM / LENGTH))  # N, beyond the bearing: to opposite sides
LOADS = {
    "at both ends": (rs.EndContacts(), RADIUS * ENDS + THRUST * WEIGHT),
    "without thrust": (rs.EndContacts(axial=False), RADIUS * ENDS),
    "without bending": (rs.EndContacts(bend=False), RADIUS * 50 + THRUST * WEIGHT),
    "thrust alone": (rs.EndContacts(radial=False, bend=False), THRUST * WEIGHT),
    "bending alone": (rs.EndContacts(radial=False, axial=False), RADIUS * 2 * 50 * ARM / LENGTH),
    "additive": (rs.AdditiveContact(), RADIUS * 50 + THRUST * WEIGHT + RADIUS / LENGTH * 50 * ARM),
    "additive, no radial": (rs.AdditiveContact(radial=False), THRUST * WEIGHT + RADIUS / LENGTH * 50 * ARM),
}


@pytest.mark.slow
def test_a_rotor_is_slowed():
    mechanism, state = rotor()
    found, pressed = rx.solve(mechanism, state), LOADS["at both ends"][1]
    np.testing.assert_allclose(found["tau pin"], -MU * pressed, rtol=1e-12)
    np.testing.assert_allclose(found["pin.angle''"], -MU * pressed / 0.15, rtol=1e-12)


@pytest.mark.parametrize("name", LOADS)
def test_what_presses_a_bearing(name):
    """Of the loads that the force and the weight cause: `rows` of the joint are minus those on the rotor."""
    contact, pressed = LOADS[name]
    pin = rs.Revolute("pin", rx.GROUND, "a", on_i=HERE, on_j=HERE, contact=contact, **SIZES)
    rows = jnp.array([30.0, 40.0, -WEIGHT, -40.0 * ARM, 30.0 * ARM])
    np.testing.assert_allclose(RADIUS * pin.normal_load(rows), pressed, rtol=1e-14)
    np.testing.assert_allclose(pin.largest_change(-rows), pin.normal_load(rows), rtol=1e-14)


class Shuffled(rs.AbstractFrictionalJoint):
    """A hinge whose rows stand in another order."""

    row_kinds = tuple(rs.Revolute.row_kinds[k] for k in (0, 2, 4, 1, 3))
    coordinate_kinds = rs.Revolute.coordinate_kinds
    slip_kind = "angular"
    friction: rx.AbstractFrictionModel | None
    contact: rs.AbstractContact
    size = rs.ContactSize(jnp.asarray(LENGTH), jnp.asarray(THRUST / RADIUS))

    def __init__(self):
        self.make("pin", rx.GROUND, "a", [None, None], HERE, HERE)


def test_what_presses_is_read_by_the_names_of_rows():
    """Not by their places: those of the radial forces and of the moments need not be side by side."""
    pin = rs.Revolute("pin", rx.GROUND, "a", on_i=HERE, on_j=HERE, **SIZES)
    rows = np.array([30.0, 40.0, -WEIGHT, -40.0 * ARM, 30.0 * ARM])
    shuffled = jnp.asarray(rows[[0, 2, 4, 1, 3]])
    np.testing.assert_allclose(Shuffled().normal_load(shuffled), pin.normal_load(jnp.asarray(rows)), rtol=1e-14)


def test_models_are_of_surfaces_at_the_pin():
    """Stribeck friction, with a preload."""
    model = rx.Stribeck(0.4, 0.2, 0.05, viscous=7.0, preload=25.0)
    pressed, rate = LOADS["at both ends"][1] / RADIUS + 25.0, RADIUS * SPIN
    force = (0.2 + 0.2 * np.exp(-((rate / 0.05) ** 2))) * pressed + 7.0 * rate
    np.testing.assert_allclose(rx.solve(*rotor(friction=model))["tau pin"], -RADIUS * force, rtol=1e-12)


@pytest.mark.slow
def test_derivatives_by_the_size_of_a_bearing():
    """Of mu (pin_radius (|N1| + |N2|) + thrust_radius |F_axial|), built anew."""
    state = rotor()[1]

    def slowed(radius, thrust):
        return rx.solve(rotor(pin_radius=radius, thrust_radius=thrust)[0], state)["tau pin"]

    slopes = jax.jit(jax.grad(slowed, argnums=(0, 1)))(RADIUS, THRUST)
    np.testing.assert_allclose(slopes, [-MU * ENDS, -MU * WEIGHT], rtol=1e-10)


# Guides -------------------------------------------------------------------------------------


GUIDE = {"guide_length": LENGTH, "twist_radius": TWIST}


def slider(force=(0.0, 0.0, 0.0), arm=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), mu=MU, loads=(), **given):
    """A block on a guide along x, and a force."""
    body = rs.Body("block", MASS, (0.02, 0.03, 0.04))
    given = {"point": (0, 0, 0), "friction": rx.Coulomb(mu), **GUIDE, **given}
    guide = rs.Prismatic("guide", body, rx.GROUND, axis=(1, 0, 0), **given)
    return rx.Mechanism([body], [guide], loads=[rs.AppliedForce(body, force, point=arm, moment=moment), *loads])


def at(mechanism, rate, travel=0.0):
    return rx.assemble(mechanism, positions={"guide.travel": travel}, rates={"guide.travel": rate})


@pytest.mark.slow
def test_a_block_pushed_from_the_side_slides_to_rest():
    block = slider((0.0, 40.0, -WEIGHT))
    slows = MU * np.hypot(40.0, WEIGHT) / MASS
    run = rx.simulate(block, at(block, 2.0), 1.0, ts=[0.2, 0.4 - 1e-9, 0.4 + 1e-9, 1.0])
    np.testing.assert_allclose(run["guide.travel"], [0.4 - slows * 0.02, *[2.0 / slows] * 3], rtol=1e-8)
    np.testing.assert_allclose(run["guide.travel'"][1:], [slows * 1e-9, 0.0, 0.0], rtol=0, atol=1e-12)


MOMENT = np.array([0.6, 0.3, -0.4])
PRESSED = {
    "at both ends": (rs.EndContacts(), 2 * 0.5 / LENGTH + 0.6 / TWIST),
    "no twist": (rs.EndContacts(twist=False), 2 * 0.5 / LENGTH),
    "no bending": (rs.EndContacts(bend=False), 0.6 / TWIST),
    "additive": (rs.AdditiveContact(), 0.5 / LENGTH + 0.6 / TWIST),
}


@pytest.mark.parametrize("name", PRESSED)
def test_what_presses_a_guide(name):
    """Moments alone: ends are pressed to opposite sides."""
    contact, pressed = PRESSED[name]
    guide = rs.Prismatic("guide", "a", rx.GROUND, on_i=HERE, on_j=HERE, contact=contact, **GUIDE)
    rows = jnp.array([0.0, 0.0, 0.3, -0.4, 0.6])
    np.testing.assert_allclose(guide.normal_load(rows), pressed, rtol=1e-14)


def test_a_twisted_block_is_slowed():
    block = slider(moment=MOMENT)
    found, pressed = rx.solve(block, at(block, -1.0)), PRESSED["at both ends"][1]
    np.testing.assert_allclose(found["tau guide"], MU * pressed, rtol=1e-12)
    np.testing.assert_allclose(found["guide.travel''"], MU * pressed / MASS, rtol=1e-12)


@pytest.mark.parametrize("pull", [5.0, 5e5])
@pytest.mark.slow
def test_a_drawer_jams_however_hard_it_is_pulled(pull):
    """At an arm a to the side and up 2 mu a / L of the pull is friction."""
    jams, arm = LENGTH / (2 * 0.1), (0.0, 0.06, 0.08)
    for mu, verdict in ((jams * (1 - 1e-6), "must slip"), (jams * (1 + 1e-6), "must stick")):
        drawer = slider((pull, 0.0, 0.0), arm, mu=mu)
        found = rx.sticking(drawer, at(drawer, 0.0))
        assert (found.verdict, found.proved) == (verdict, True)
    drawer = slider((pull, 0.0, 0.0), arm, mu=jams / 4)
    begins = rx.solve(drawer, at(drawer, 0.0), sense={"guide": 1})
    np.testing.assert_allclose(begins["guide.travel''"], 0.75 * pull / MASS, rtol=1e-12)


# Screws -------------------------------------------------------------------------------------

PITCH, THREAD = 0.006, 0.009  # m
LEAD = np.arctan(PITCH / (2 * np.pi * THREAD))


def jack(moment, mu, hand=1, **given):
    """A nut with its weight on a vertical spindle, turned by a moment about it."""
    nut = rs.Body("nut", MASS, (1e-3, 1e-3, 1e-3))
    given = {"thread_radius": THREAD, "bearing_length": LENGTH, "friction": rx.Coulomb(mu), **given}
    screw = rs.Screw("jack", nut, rx.GROUND, point=(0, 0, 0), axis=(0, 0, 1), pitch=hand * PITCH, **given)
    turns = rs.AppliedForce(nut, moment=(0, 0, moment))
    return rx.Mechanism([nut], [screw], loads=[turns], gravity=(0, 0, -WEIGHT / MASS))


@pytest.mark.parametrize("hand", [1, -1])
@pytest.mark.parametrize(("flank", "mu"), [(0.0, 0.15), (np.pi / 6, 0.15), (np.pi / 12, 0.02)])
def test_moments_that_raise_and_lower_a_load(flank, mu, hand):
    """F r tan(lead +- friction angle): the nut goes on as it is."""
    angle = np.arctan(mu / np.cos(flank))
    for rises in (1, -1):
        nut = jack(hand * WEIGHT * THREAD * np.tan(LEAD + rises * angle), mu, hand, flank_angle=flank)
        found = rx.solve(nut, rx.assemble(nut, rates={"jack.travel": 0.01 * rises}))
        assert abs(found["jack.angle''"]) < 1e-12 * WEIGHT * THREAD / 1e-3
        normal = WEIGHT / np.cos(LEAD) / np.cos(flank) / (1 - rises * np.tan(angle) * np.tan(LEAD))
        np.testing.assert_allclose(found["tau jack"], -hand * rises * mu * normal, rtol=1e-12)


@pytest.mark.parametrize(("share", "verdict"), [(1 - 1e-6, "must slip"), (1 + 1e-6, "must stick")])
@pytest.mark.slow
def test_a_screw_locks_itself_from_the_angle_of_its_lead_on(share, verdict):
    nut = jack(0.0, share * np.tan(LEAD))
    found = rx.sticking(nut, rx.assemble(nut))
    assert (found.verdict, found.proved) == (verdict, True)


# Laws of users ------------------------------------------------------------------------------


class OnRollers(rs.AbstractContact):
    """Rollers in two rows each way, which feel both components of force and moment each by itself."""

    def normal_load(self, load, size):
        return jnp.sum(jnp.abs(load.radial)) + jnp.sum(jnp.abs(load.bend)) / size.length


class Bounded(OnRollers):
    def largest_change(self, change, size):
        return self.normal_load(change, size)


STIFFNESS, SHARE = 200.0, 0.05
SHIFT = SHARE * (40.0 + WEIGHT + 0.7 / LENGTH) / STIFFNESS  # friction over stiffness


@pytest.mark.slow
def test_the_law_of_a_user_through_reversals():
    """At a spring from 0.25 m: after every half period it is nearer by twice the shift, until friction holds it."""
    spring = rs.SpringDamper("block", rx.GROUND, stiffness=STIFFNESS, on_i=(0, 0, 0), on_j=(0, 0, 0))
    block = slider((0.0, 40.0, -WEIGHT), moment=MOMENT, mu=SHARE, loads=[spring], contact=OnRollers())
    times = np.pi / np.sqrt(STIFFNESS / MASS) * np.arange(1, 6)
    run = rx.simulate(block, at(block, 0.0, 0.25), 10.0, ts=[*times, 10.0], throw=False)
    turns = [(-1) ** k * (0.25 - 2 * k * SHIFT) for k in range(1, 6)]
    np.testing.assert_allclose(run["guide.travel"], [*turns, 0.25 - 12 * SHIFT], rtol=0, atol=1e-7)
    assert run.result == rx.RESULTS.stuck


@pytest.mark.parametrize(("contact", "radius"), [(Bounded(), 0.15), (OnRollers(), np.inf)])
@pytest.mark.slow
def test_a_bound_of_a_users_law_proves_that_its_solution_is_the_only_one(contact, radius):
    """Beside the centre of mass friction presses the guide: by mu (0.1 m + 0.05 m) / 0.05 m of itself at most."""
    block = slider((0.0, 0.0, -WEIGHT), mu=SHARE, contact=contact, point=(0.0, 0.1, 0.05))
    found = rx.analyze(block, at(block, 1.0))
    np.testing.assert_allclose(found.spectral_radius, radius, rtol=1e-12)
    assert ("(proved: spectral radius 0.15 < 1)" in str(found)) == (radius < 1)


# What is refused ----------------------------------------------------------------------------

BAD = {
    "no pin radius": (lambda: rotor(pin_radius=None), "`pin_radius` of joint 'pin'"),
    "no bearing length": (lambda: rotor(bearing_length=None), r"`bearing_length`.*EndContacts\(bend=False\)"),
    "no thrust radius": (lambda: rotor(thrust_radius=None), r"`thrust_radius`.*EndContacts\(axial=False\)"),
    "no guide length": (lambda: slider(guide_length=None), "`guide_length`"),
    "no twist radius": (lambda: slider(contact=rs.AdditiveContact(), twist_radius=None), r"AdditiveContact\(twist"),
    "no thread radius": (lambda: jack(0.0, MU, thread_radius=None), "`thread_radius`"),
    "no length": (lambda: slider(guide_length=0.0), "must be positive"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_says_what_to_do(name):
    build, words = BAD[name]
    with pytest.raises(rx.RedundaxError, match=words):
        build()


@pytest.mark.slow
def test_what_does_not_press_needs_no_size():
    only = rs.EndContacts(axial=False, bend=False)
    for rubs in ({"contact": only}, {"friction": rx.ConstantFriction(3.0)}, {"contact": OnRollers()}):
        mechanism, _ = rotor(bearing_length=None, thrust_radius=None, **rubs)
        assert mechanism.names.slips.labels == ("pin",)
