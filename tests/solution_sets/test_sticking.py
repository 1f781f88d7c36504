"""Whether mechanisms at rest stick, against closed forms and the paper's own iteration."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from truth import paper

import redundax as rx

MU, WEIGHT, PULL = 0.3, 10.0, 9.0
slow = pytest.mark.slow


def walls(q, t, p):
    return jnp.stack([q[1], -q[1]])


def pulled(q, qd, t, p):
    return jnp.stack([p, -WEIGHT])


def slips(q, t, p):
    return jnp.stack([q[0], q[0]])


def rubbing(loads, rate, sense, memory, state, p):
    return -p * jnp.abs(loads) * sense


def clamped(pull=PULL, mu=MU):
    """A block between two rough walls, loads N and N + WEIGHT: it holds iff mu (|N| + |N + WEIGHT|) >= pull."""
    system = rx.System(
        walls,
        jnp.ones(2),
        pulled,
        jnp.asarray(pull),
        rows=rx.Axis(("below", "above"), ("force", "force")),
        friction=rx.Friction(slips, rubbing, [0, 1], ["linear"] * 2, jnp.asarray(mu)),
    )
    return system, rx.State([0.0, 0.0], [0.0, 0.0])


def margin(load):
    return MU * (np.abs(load) + np.abs(load + WEIGHT)) / PULL - 1


BOXES = pytest.mark.parametrize(
    ("box", "verdict"),
    [
        ((9.999, 40.0), "may stick"),
        ((10.001, 40.0), "must stick"),
        ((-19.999, 9.999), "must slip"),
        ((-20.001, 9.999), "may stick"),
        ((-60.0, -20.001), "must stick"),
    ],
)


@BOXES
def test_a_clamped_block_sticks_where_its_clamping_holds_it(box, verdict):
    found = rx.sticking(*clamped(), rx.PreloadBox({"below": box}))
    assert (found.verdict, found.solved) == (verdict, 1.0)
    assert found.proved == (verdict == "may stick")  # nothing is known of the law between the cases looked at
    values = margin(np.linspace(*box, 20001))
    np.testing.assert_allclose(found.margin, [values.min(), values.max()], rtol=0, atol=1e-5)
    np.testing.assert_allclose(margin(found.case[:, 0]), found.margin, rtol=0, atol=1e-12)
    sticks = found.margin >= 0
    drawn = PULL + found.friction.sum(axis=1)
    np.testing.assert_allclose(found.acceleration[:, 0], drawn, rtol=0, atol=1e-9)
    np.testing.assert_allclose(drawn, np.where(sticks, 0.0, -PULL * found.margin), rtol=0, atol=1e-9)
    limit = MU * np.abs(found.multipliers)
    np.testing.assert_allclose(np.abs(found.friction), found.share[:, None] * limit, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.share, np.where(sticks, 1 / (1 + found.margin), 1.0), rtol=1e-9)


@BOXES
def test_verdicts_over_bounds_are_proved_where_the_law_is_known(box, verdict):
    """The same block in two guides: forces N up in the first and WEIGHT - N in the other."""
    guides = [
        rx.Translational(name, "a", "ground", (0, 0), (0, 0), (0, 1), guide_length=0.1, friction=rx.Coulomb(MU))
        for name in ("first", "second")
    ]
    pull = rx.AppliedForce("a", (PULL, 0.0))
    block = rx.Mechanism([rx.Body("a", 1.0, 0.1)], guides, loads=[pull], gravity=(0.0, -WEIGHT))
    first = (-box[1], -box[0])  # N below is -N first
    bounds = rx.PreloadBox({"first.angle": (0.0, 0.0), "first.perpendicular": first})
    found = rx.sticking(block, rx.State(jnp.zeros(3), jnp.zeros(3)), bounds)
    assert (found.verdict, found.proved, found.solved) == (verdict, True, 1.0)
    assert found.slip_proved.all()
    values = margin(np.linspace(*box, 20001))
    np.testing.assert_allclose(found.margin, [values.min(), values.max()], rtol=0, atol=1e-5)


def test_a_closure_gives_one_case_and_without_a_drive_anything_holds():
    found = rx.sticking(*clamped())
    assert (found.verdict, found.proved) == ("must slip", True)  # the weight is shared: 5 N on each wall
    np.testing.assert_allclose(found.margin, MU * WEIGHT / PULL - 1)
    assert (found.slip_verdicts, found.slip_senses) == (("must slip",) * 2, ((1,), (1,)))
    assert found.slip_proved.all()
    assert rx.sticking(*clamped(2.9)).verdict == "must stick"
    still = rx.sticking(*clamped(0.0), rx.PreloadBox({"below": (-5.0, 5.0)}))
    assert (still.verdict, still.proved, still.share.tolist()) == ("must stick", True, [0.0, 0.0])
    assert np.all(still.margin == np.inf) and np.all(still.friction == 0.0)
    assert json.loads(json.dumps(still.to_dict()))["margin"] == [None, None]
    for above, verdict in (((10.0, 15.0), "must stick"), ((100.0, 101.0), "undecided")):
        both = rx.sticking(*clamped(0.0), rx.PreloadBox({"below": (0.0, 5.0), "above": above}))
        assert (both.verdict, both.proved) == (verdict, verdict != "undecided")


def test_text():
    text = str(rx.sticking(*clamped(), rx.PreloadBox({"below": (0.0, 40.0)})))
    assert text.startswith(
        "At rest, PreloadBox: below 0 to 40\nMAY STICK (proved)\nleast margin -0.6667 at below 0: slips"
    )
    assert "largest margin 2 at below 40: held by 33% of the friction\n    tau 0 -4" in text
    assert text.endswith("\nslips that may stick (proved): 0 +, 1 +")


STRESS = np.array([1, 1, 1, 1, 1, 1, -1, -1, 0, 0, 0.8, -0.8])


def crank_acceleration(mu_rho, phi, z, sense):
    """Of the paper's mechanism at rest with the self-stress z, friction acting in a sense, by (27)."""
    parameters = paper.Parameters(mu_rho=mu_rho)
    q, qd = paper.configuration(parameters, phi, sense * 1e-9)
    h = z * STRESS @ STRESS / STRESS.sum()  # its own component along the stress of h in all 24 entries
    return paper.fixed_point(parameters, q, qd, h)[-1][8]


def paper_margin(mu_rho, phi, z):
    free = crank_acceleration(0.0, phi, z, 1.0)
    return -crank_acceleration(mu_rho, phi, z, np.sign(free)) / free


@slow
def test_the_papers_mechanism_sticks_where_its_own_iteration_does():
    """The limit of the self-stress in A.x beyond which no sense of slip leaves rest."""
    mu_rho, phi = 0.02, np.pi / 4
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=mu_rho)
    state = mechanism.state(phi=phi, rate=0.0)
    limit = brentq(lambda z: paper_margin(mu_rho, phi, z), 300.0, 400.0, xtol=1e-9)
    for ends, verdict in (((limit + 0.01, 500.0), "must stick"), ((-300.0, limit - 0.01), "must slip")):
        found = rx.sticking(mechanism, state, rx.AmplitudeBox({"A.x": ends}))
        assert (found.verdict, found.proved) == (verdict, True)
        truth = [paper_margin(mu_rho, phi, z) for z in found.case[:, 0]]
        np.testing.assert_allclose(found.margin, truth, rtol=0, atol=1e-9)
    assert rx.sticking(mechanism, state, rx.AmplitudeBox({"A.x": (limit - 0.01, limit + 0.01)})).verdict == "may stick"


def held_is_an_equilibrium(found, mechanism, state, k):
    """Whether Phi_q^T lam = Q + F at the end k, with friction |tau| <= mu_rho |R|, by the paper's formulas."""
    parameters = paper.Parameters(mu_rho=0.08)
    q, lam, tau = np.asarray(state.q), found.multipliers[k], found.friction[k]
    moment = np.zeros(12)
    for (i, j, *_), own in zip(paper.revolutes(parameters), tau, strict=True):
        for body, sign in ((i, 1), (j, -1)):
            if body:
                moment[8 + body - 1] += sign * own
    residual = paper.jacobian(parameters, q).T @ lam - paper.load(parameters) - moment
    limit = 0.08 * np.hypot(lam[0:8:2], lam[1:8:2])
    return np.abs(residual).max() < 1e-8 and np.all(np.abs(tau) <= limit * (1 + 1e-9))


@pytest.mark.slow
def test_a_held_state_is_an_equilibrium_with_friction_below_its_limit():
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.08)
    state = mechanism.state(phi=np.pi / 4, rate=0.0)
    found = rx.sticking(mechanism, state, rx.AmplitudeBox({"A.x": (-400.0, 400.0)}))
    assert found.verdict == "may stick" and found.margin[0] < 0 <= found.margin[1]
    assert held_is_an_equilibrium(found, mechanism, state, 1)
    np.testing.assert_allclose(found.margin[0], paper_margin(0.08, np.pi / 4, found.case[0, 0]), rtol=0, atol=1e-9)


def incline(friction, angle=0.5):
    """A body of 2 kg on an incline, in one guide."""
    block = rx.Body("block", 2.0, 0.1)
    guide = rx.Translational(
        "guide", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), friction=friction, guide_length=0.1
    )
    gravity = (10 * np.sin(angle), -10 * np.cos(angle))
    mechanism = rx.Mechanism([block], [guide], gravity=gravity)
    return mechanism, rx.State([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])


@slow
@pytest.mark.parametrize(
    ("friction", "hold"),
    [
        (rx.Coulomb(0.2, preload=30.0), 0.2 * (20 * np.cos(0.5) + 30)),
        (rx.Coulomb(0.6), 0.6 * 20 * np.cos(0.5)),
        (rx.Stribeck(0.5, 0.1, velocity=0.1), 0.5 * 20 * np.cos(0.5)),
        (rx.ConstantFriction(9.5), 9.5),
        (rx.RegularisedCoulomb(3.0, velocity=0.1), 0.0),
    ],
)
def test_a_body_on_an_incline(friction, hold):
    found = rx.sticking(*incline(friction))
    assert found.verdict == ("must stick" if hold >= 20 * np.sin(0.5) else "must slip")
    np.testing.assert_allclose(found.margin, hold / (20 * np.sin(0.5)) - 1, rtol=1e-9)
    assert found.can_hold == (hold > 0) == ("gives way" not in str(found))


def test_errors():
    system, state = clamped()
    with pytest.raises(rx.RedundaxError, match="`state` must be at rest"):
        rx.sticking(system, rx.State(state.q, [1.0, 0.0]))
    locked = rx.System(lambda q, t, p: q, jnp.ones(3), lambda q, qd, t, p: jnp.ones(3))
    with pytest.raises(rx.RedundaxError, match="must have a freedom to stick or slip, but has none"):
        rx.sticking(locked, rx.State(jnp.zeros(3), jnp.zeros(3)))
    driven = rx.System(lambda q, t, p: q[:1] - t**2, jnp.ones(2), lambda q, qd, t, p: jnp.ones(2))
    with pytest.raises(rx.RedundaxError, match="a driver accelerates"):
        rx.sticking(driven, rx.State(jnp.zeros(2), jnp.zeros(2)))
    for closure in (rx.Compliance(jnp.ones(2), misfit=jnp.array([0.0, jnp.nan])), rx.MinimumNorm(jnp.inf)):
        with pytest.raises(rx.NoSolutionError, match="not finite"):
            rx.sticking(system, state, closure)


def portal(mu: float) -> tuple[rx.Mechanism, rx.State, rx.ElasticJoints]:
    """A beam of 20 kg in upright guides of 0.1 m, 1 m to both sides, lifted by 702 N at 0.3 m from its middle."""
    guide = {"normal": (1.0, 0.0), "guide_length": 0.1, "friction": rx.Coulomb(mu)}
    guides = [
        rx.Translational(name, "beam", "ground", (x, 0), (x, 0), **guide) for name, x in (("L", -1.0), ("R", 1.0))
    ]
    load = rx.AppliedForce("beam", force=(0.0, 702.0), point=(0.3, 0.0))
    mechanism = rx.Mechanism([rx.Body("beam", 20.0, 6.7)], guides, loads=[load], gravity=(0.0, -9.81))
    return mechanism, rx.assemble(mechanism, {}), rx.ElasticJoints(mechanism, {"L": (5e-8, 1e-6), "R": (5e-8, 1e-6)})


@pytest.mark.parametrize(("mu", "verdict", "stands"), [(0.04, "must slip", "no"), (0.12, "may stick", "yes")])
def test_guides_wedge_where_their_friction_makes_the_moment_that_makes_it(mu, verdict, stands):
    """Each guide takes half of the moment, and has friction of 2 mu |M| / 0.1 m: from mu = 0.05 on M holds itself."""
    mechanism, state, joints = portal(mu)
    found = rx.sticking(mechanism, state, joints)
    assert found.verdict == verdict
    held = rx.band(mechanism, state, ["tau L", "L moment on beam"], joints)
    assert held.stands == stands
    if stands == "no":
        return
    left, right = found.friction[np.argmax(found.margin)]
    moment = -(right - left + 0.3 * 702.0) / 2
    np.testing.assert_allclose(left + right, 702.0 - 20 * 9.81, rtol=1e-9)
    assert max(abs(left), abs(right)) <= 2 * mu * abs(moment) / 0.1 * (1 + 1e-7)
    assert np.all(held.exact)
    assert np.all(held.lower == -np.inf)
    assert np.all(held.upper == np.inf)
    assert "wedge" in str(held)
