"""Contacts that only push, against enumeration of all active sets at 50 digits, closed forms and figures by hand."""

import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

import redundax as rx

G = 9.81


def heights(q, t, p):
    return -(q[0] + p["feet"][:, 1] * q[1] - p["feet"][:, 0] * q[2])


def given(q, qd, t, p):
    return p["load"]


def table(feet, load):
    """A plate of z, phi_x, phi_y on feet at (x, y), as a system of one structure for as many feet."""
    return rx.System(
        heights,
        mass=jnp.array([10.0, 0.8, 1.1]),
        load=given,
        parameters={"feet": jnp.asarray(feet), "load": jnp.asarray(load)},
        coordinates=["linear", "angular", "angular"],
        rows="force",
        m=len(feet),
        one_sided=range(len(feet)),
    )


def enumerated(jacobian, mass, load, compliance, misfit):
    """Loads and accelerations of the one active set that fits, of stiff joints whose stiffness grows without bound.

    0 <= p _|_ J M^-1 (J^T p - f) + e (W p - d) >= 0 with e = 1e-25, by 50 digits: an error of about e.
    """
    mp.mp.dps, e = 50, mp.mpf(10) ** -25
    jacobian, load = mp.matrix(jacobian.tolist()), mp.matrix(load.tolist())
    inverse = mp.diag([1 / mp.mpf(float(x)) for x in mass])
    both = jacobian * inverse * jacobian.T + e * mp.diag([mp.mpf(float(x)) for x in compliance])
    right = jacobian * inverse * load + e * mp.matrix(misfit.tolist())
    m = jacobian.rows
    for size in range(m, -1, -1):
        for active in itertools.combinations(range(m), size):
            loads = mp.matrix(m, 1)
            if active:
                rows = list(active)
                part = mp.matrix([[both[i, j] for j in rows] for i in rows])
                found = mp.lu_solve(part, mp.matrix([right[i] for i in rows]))
                for k, i in enumerate(rows):
                    loads[i] = found[k]
            gap = both * loads - right
            if min(loads) >= 0 and all(gap[i] >= 0 for i in range(m) if i not in active):
                acceleration = inverse * (load - jacobian.T * loads)
                return np.array(loads.tolist(), float)[:, 0], np.array(acceleration.tolist(), float)[:, 0], active
    raise AssertionError("no active set fits")


@pytest.mark.parametrize("feet", [3, 4, pytest.param(6, marks=pytest.mark.slow)])
def test_tables_against_all_active_sets(feet):
    rng, seen = np.random.default_rng(feet), set()
    for _ in range(12):
        at = rng.uniform(-1, 1, (feet, 2))
        compliance, misfit = rng.uniform(0.5, 2, feet) * 1e-6, rng.normal(size=feet) * 3e-5
        where = rng.uniform(-1.1, 1.1, 2)
        load = np.array([-98.1, -98.1 * where[1], 98.1 * where[0]])
        jacobian = -np.column_stack([np.ones(feet), at[:, 1], -at[:, 0]])
        truth = enumerated(jacobian, np.array([10.0, 0.8, 1.1]), load, compliance, misfit)
        system = table(at, load)
        closure = rx.Compliance(jnp.diag(jnp.asarray(compliance)), jnp.asarray(misfit))
        solution = rx.solve(system, rx.State(jnp.zeros(3), jnp.zeros(3)), closure=closure)
        np.testing.assert_allclose(solution.multipliers, truth[0], rtol=0, atol=1e-10 * 98.1)
        np.testing.assert_allclose(solution.acceleration, truth[1], rtol=0, atol=1e-9)
        assert tuple(k for k, word in enumerate(solution.contacts.values()) if word == "carries") == truth[2]
        seen |= {str(word) for word in solution.contacts.values()}
    assert {"carries", "lifts"} <= seen


def table_of_joints(push=0.0, held_aside=False):
    """A table of 10 kg whose feet stand on the corners of 0.8 m by 0.6 m, pushed along x at its top, 0.7 m up."""
    top = rx.spatial.Body("table", 10.0, inertia=(1.0, 1.0, 1.5), centre=(0.0, 0.0, 0.7))
    corners = {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
    feet = [
        rx.spatial.PointOnPlane(name, top, "ground", (x, y, 0.0), (0.0, 0.0, 1.0), one_sided=True)
        for name, (x, y) in corners.items()
    ]
    fence = [rx.spatial.PointOnPlane("fence", top, "ground", (0.4, 0.0, 0.0), (1.0, 0.0, 0.0))]
    if held_aside:
        fence.append(rx.spatial.PointOnPlane("side", top, "ground", (0.0, 0.3, 0.0), (0.0, 1.0, 0.0)))
    loads = [rx.spatial.AppliedForce(top, force=(push, 0.0, 0.0), point=(0.0, 0.0, 0.7))]
    return rx.Mechanism([top], [*feet, *fence], loads=loads, gravity=(0.0, 0.0, -G))


def test_pushing_alone_bounds_the_legs_of_a_table():
    """A quarter of the weight each, and as much again to and fro in the one self-stress; z of the feet sums to m g."""
    mechanism = table_of_joints()
    report = rx.analyze(mechanism, rx.assemble(mechanism))
    for foot in ("f1", "f2", "f3", "f4"):
        assert report.ranges[f"{foot} force z on table"] == pytest.approx((0.0, 10 * G / 2), abs=1e-9)
    assert report.redundancy == 1
    assert set(report.contacts.values()) == {"carries"}
    assert "f1 force z on table 0 to 49.05" in str(report)


def test_a_table_tips_about_its_front_feet():
    """Tipping begins where push * 0.7 m is more than m g * 0.4 m; then the rear feet lift."""
    tips = 10 * G * 0.4 / 0.7
    for push, words in ((0.9 * tips, {"carries"}), (1.1 * tips, {"carries", "lifts"})):
        mechanism = table_of_joints(push)
        solution = rx.solve(mechanism, rx.assemble(mechanism))
        assert {str(word) for word in solution.contacts.values()} == words
        assert float(solution["f2 force z on table"]) > 0
    assert solution.contacts["f1"] == solution.contacts["f4"] == "lifts"
    moment = 0.7 * push - 0.4 * 10 * G  # about the line of the front feet, along y
    assert float(solution["table.phi_y''"]) == pytest.approx(moment / (1.0 + 10 * (0.7**2 + 0.4**2)), rel=1e-10)


def sunk(q, t, p):
    return -(q[0] + p[0] * q[1])


def pressed(q, qd, t, p):
    return jnp.stack([-p[1], -p[1] * p[2]])


def beam(x, load, at):
    """A rigid beam of y and phi on supports at x, loaded at one place."""
    return rx.System(
        sunk,
        mass=jnp.array([2.0, 0.5]),
        load=pressed,
        parameters=(jnp.asarray(x), jnp.asarray(load), jnp.asarray(at)),
        coordinates=["linear", "angular"],
        rows="force",
        m=len(x),
        one_sided=range(len(x)),
    )


SUPPORTS, SOFT = np.array([-0.8, -0.1, 0.4, 0.9]), jnp.diag(jnp.array([1.0, 2.0, 1.5, 0.7])) * 1e-3
REST = rx.State(jnp.zeros(2), jnp.zeros(2))


def loads(at):
    solution = rx.solve(beam(SUPPORTS, 10.0, at), REST, closure=rx.Compliance(SOFT))
    return solution.multipliers, solution.contact, solution.result


def least_energy(active, at):
    """Loads of these supports under 10 N: lam = W^-1 (a + b x), in equilibrium."""
    x, soft = SUPPORTS[active], np.diagonal(SOFT)[active]
    line = np.stack([np.ones(len(x)), x])
    out = np.zeros(4)
    out[active] = line.T @ np.linalg.solve(line / soft @ line.T, [10.0, 10.0 * at]) / soft
    return out


@pytest.mark.slow
def test_batches_and_derivatives_of_a_beam_on_supports():
    """The support that the load is far from carries nothing; derivatives are those of the active set."""
    at = np.array([-0.6, 0.1, 0.2, 0.5, 0.75])
    active = [[0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3], [0, 1, 2, 3], [1, 2, 3]]
    found, codes, result = jax.jit(jax.vmap(loads))(jnp.asarray(at))
    assert (result == rx.RESULTS.successful).all()
    for k, own in enumerate(active):
        np.testing.assert_allclose(found[k], least_energy(own, at[k]), atol=1e-10)
        np.testing.assert_allclose(loads(at[k])[0], found[k], atol=1e-12)
        assert [*np.flatnonzero(np.asarray(codes[k]) == 3)] == own
    slope = least_energy([0, 1, 2, 3], 1.1) - least_energy([0, 1, 2, 3], 0.1)  # linear in the place of the load
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(derivative(lambda x: loads(x)[0])(0.2), slope, atol=1e-9)


def rod(**limits):
    """A rod of 1 kg and 1 m, hinged at an end, with stops of its angle."""
    hinge = rx.Revolute("A", "rod", "ground", (-0.5, 0.0), (0.0, 0.0))
    body = rx.Body("rod", 1.0, 1 / 12)
    return rx.Mechanism([body], [hinge], couplers=[rx.Stop("end", "A.angle", **limits)], gravity=(0.0, -G))


def test_an_assembly_that_a_closed_stop_prevents_names_it_and_no_open_one():
    """At a guess on its limit a stop holds; the other, open by 2 rad there, is no reason."""
    flap = rod(least=0.0, most=2.0)
    with pytest.raises(
        rx.NoSolutionError, match=r"Held closed: end\.least\. Give a contact .* a gap at the guess"
    ) as told:
        rx.assemble(flap, {"rod.x": 0.5}, positions={"A.angle": 0.3})
    assert "end.most" not in str(told.value)


def test_stops_hold_and_let_go():
    mechanism = rod(least=-0.2, most=1.0)
    held = rx.solve(mechanism, rx.assemble(mechanism, {"rod.x": 0.5}, positions={"rod.phi": -0.2}))
    assert held.contacts == {"end.least": "carries", "end.most": "open"}
    assert float(held["end.least"]) == pytest.approx(G * 0.5 * np.cos(0.2), rel=1e-12)
    free = rx.solve(mechanism, rx.assemble(mechanism, {"rod.x": 0.5}, positions={"rod.phi": 1.0}))
    assert free.contacts == {"end.least": "open", "end.most": "lifts"}
    assert float(free["rod.phi''"]) == pytest.approx(-1.5 * G * np.cos(1.0), rel=1e-12)
    pushed_back = rx.assemble(mechanism, {"rod.x": 0.3, "rod.y": 0.5, "rod.phi": 1.3})
    assert float(pushed_back.q[2]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("height", "pulls", "word"), [(-1.0, 2 * G, "carries"), (1.0, 0.0, "lifts"), (0.5, 0.0, "open")]
)
def test_a_cable_pulls_alone(height, pulls, word):
    rope = rx.Cable("rope", "weight", "ground", (0.0, 0.0), (0.0, 0.0), 1.0)
    mechanism = rx.Mechanism([rx.Body("weight", 2.0, 0.1)], [rope], gravity=(0.0, -G))
    solution = rx.solve(mechanism, rx.assemble(mechanism, {"weight.y": height}))
    assert solution.contacts == {"rope": word}
    assert float(solution["rope.distance"]) == pytest.approx(pulls, abs=1e-12)


def test_a_cable_in_space():
    plate = rx.spatial.Body("plate", 2.0, inertia=(0.1, 0.1, 0.2))
    cables = [
        rx.spatial.Cable(name, plate, "ground", (x, 0.0, 0.0), (x, 0.0, height))
        for name, x, height in (("left", -0.5, 1.0), ("right", 0.5, 1.0))
    ]
    cables.append(rx.spatial.Cable("under", plate, "ground", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 1.5))
    mechanism = rx.Mechanism([plate], cables, gravity=(0.0, 0.0, -G))
    solution = rx.solve(mechanism, rx.assemble(mechanism))
    assert solution.contacts == {"left": "carries", "right": "carries", "under": "open"}
    assert float(solution["left.distance"]) == pytest.approx(G, rel=1e-12)  # the tension, as in the plane


def sliding_rod(angle, mu, rate):
    """Painlevé's rod: it leans to the right and slides on its lower end to the left, 2 m long, 1 kg."""
    foot = rx.PinInSlot("foot", "rod", "ground", (-1.0, 0.0), (0.0, 0.0), (0.0, 1.0), rx.Coulomb(mu), one_sided=True)
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 1 / 3)], [foot], gravity=(0.0, -G))
    s, c = np.sin(angle), np.cos(angle)
    q, qd = [c, s, angle], [-2.0 - rate * s, rate * c, rate]
    return mechanism, rx.State(jnp.array(q), jnp.array(qd))


def test_a_sliding_rod_is_pressed_lifts_or_jams():
    """The foot's y'' = b + p N: b = rate^2 sin - g, p = 1 + 3 cos (cos - mu sin); friction is against the motion."""
    for angle, mu, rate, word in ((1.0, 0.3, 0.0, "carries"), (1.0, 0.3, 4.0, "lifts"), (1.0, 2.0, 0.0, None)):
        mechanism, state = sliding_rod(angle, mu, rate)
        s, c = np.sin(angle), np.cos(angle)
        b, p = rate**2 * s - G, 1 + 3 * c * (c - mu * s)
        solution = rx.solve(mechanism, state, throw=False)
        if word is None:  # p < 0, b < 0: no load keeps the foot from sinking
            assert b < 0 and p < 0
            assert solution.result in (rx.RESULTS.contacts_undecided, rx.RESULTS.no_solution_found)
            assert np.isnan(solution.acceleration).all()
            continue
        assert solution.contacts == {"foot": word}
        load = -b / p if word == "carries" else 0.0
        assert float(solution["foot.perpendicular"]) == pytest.approx(load, rel=1e-9, abs=1e-12)


def test_what_does_not_fit_is_refused():
    mechanism = rod(most=1.0)
    state = rx.assemble(mechanism, {"rod.x": 0.5})
    with pytest.raises(rx.RedundaxError, match="one-sided contacts, for which `solve` takes a closure"):
        rx.solve(mechanism, state, rank=3)
    with pytest.raises(rx.RedundaxError, match="`closed` must hold names of one-sided contacts"):
        rx.assemble(mechanism, {"rod.x": 0.5}, closed="stop")
    with pytest.raises(rx.RedundaxError, match="must have `least` or `most`"):
        rx.Stop("end", "A.angle")
    with pytest.raises(rx.RedundaxError, match="`least` below `most`"):
        rx.Stop("end", "A.angle", 1.0, -1.0)
    with pytest.raises(rx.RedundaxError, match="`one_sided` must hold names of rows"):
        beam_with_wrong_row()


def beam_with_wrong_row():
    return rx.System(lambda q, t, _: q[:1], mass=jnp.ones(2), one_sided=[4])


def test_rounding_of_velocities_opens_no_contact():
    system = table([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]], [-98.1, 0.0, 9.81])
    still, moved = (rx.solve(system, rx.State(jnp.zeros(3), x * jnp.array([1.0, 3.0, 1.0]))) for x in (0.0, 1e-22))
    np.testing.assert_allclose(moved.multipliers, still.multipliers, rtol=1e-10)
    assert set(moved.contacts.values()) == {"carries"}


def beside_and_above(q, t, p):
    return jnp.stack([q[0] - p["bend"] * q[1] ** 2, -q[1]])


def falling(q, qd, t, p):
    return jnp.stack([0.0, -2.0 * G * p["unit"]])


def ball(unit, bend, **options):
    """A ball beside a guide along y that bends away from it, above a floor at y = 0; `unit` is 1 for m, 1000 for mm."""
    return rx.System(
        beside_and_above,
        mass=jnp.full(2, 2.0),
        load=falling,
        parameters={"bend": jnp.asarray(bend / unit), "unit": jnp.asarray(unit)},
        rows="force",
        one_sided=[1],
        **options,
    )


@pytest.mark.parametrize("bend", [pytest.param(1e-10, marks=pytest.mark.slow), 1e-3])
def test_nearly_straight_guides_leave_the_floor_where_it_is(bend):
    for unit in (1.0, 1000.0):
        system = ball(unit, bend)
        for height, word in ((0.5, "open"), (1e-5, "open"), (0.0, "carries")):
            state = rx.State(jnp.array([bend * height**2, height]) * unit, jnp.zeros(2))
            solution = rx.solve(system, state)
            assert solution.contacts == {"1": word}
            fall = -G if word == "open" else 0.0
            np.testing.assert_allclose(solution.acceleration[1] / unit, fall, rtol=1e-5, atol=1e-12)
        # It falls from 0.5 m, and rises to a quarter of that: times of impacts by hand.
        if unit == 1.0:
            start = rx.State(jnp.array([bend * 0.25, 0.5]), jnp.zeros(2))
            motion = rx.simulate(system, start, 0.7, restitution=0.5)
            first = (1 / G) ** 0.5
            times = np.asarray(motion.impacts.t)
            np.testing.assert_allclose(times[np.isfinite(times)], [first, 2 * first], rtol=1e-5)


def test_a_shift_of_the_origin_moves_no_contact():
    """A ball 10 um above the bottom of a bowl of 50 m: by no place of the origin does it carry."""

    def bowl(q, t, p):
        return jnp.stack([jnp.hypot(q[0] - p["x"], q[1] - 50.0) - 50.0])

    for x in (0.0, 5.0, 100.0):
        weight = lambda q, qd, t, p: jnp.array([0.0, -G])  # noqa: E731
        system = rx.System(bowl, jnp.ones(2), weight, {"x": x}, rows="force", one_sided=[0])
        for gap, word in ((1e-5, "open"), (1e-7, "carries")):
            assert rx.solve(system, rx.State(jnp.array([x, gap]), jnp.zeros(2))).contacts == {"0": word}


def test_a_declared_length_is_what_gaps_are_told_by():
    state = rx.State(jnp.array([0.0, 1e-7]), jnp.zeros(2))
    assert rx.solve(ball(1.0, 1e-10), state).contacts == {"1": "carries"}  # within 1e-6 of a metre
    assert rx.solve(ball(1.0, 1e-10, length=1e-3), state).contacts == {"1": "open"}
    in_mm = rx.State(state.q * 1000.0, state.qd)
    for units, word in ((rx.units.MM_TONNE, "carries"), (None, "open")):  # of a metre, and of one of what is not stated
        assert rx.solve(ball(1000.0, 1e-10, units=units), in_mm).contacts == {"1": word}
    with pytest.raises(rx.RedundaxError, match="`length` must be left out where coordinates are angular"):
        rx.System(lambda q, t, p: q[:1], mass=jnp.ones(1), coordinates="angular", rows="moment", length=1.0)
    with pytest.raises(rx.RedundaxError, match="`length` must be positive"):
        ball(1.0, 0.0, length=-1.0)
    for none in (np.nan, np.inf):
        with pytest.raises(rx.RedundaxError, match="`length` must be finite, but is"):
            ball(1.0, 0.0, length=none)


def test_a_crate_that_tips_as_it_slides():
    """Were both feet held down there would be no solution; one lifts: N (1 / m + b (b - mu h) / I) = g of the other."""
    mu, mass, inertia, half, high = 0.65, 3.0, 0.2, 0.3, 0.5
    feet = [
        rx.PinInSlot(name, "crate", "ground", (x, -high), (0, 0), (0, 1), rx.Coulomb(mu), one_sided=True)
        for name, x in (("f1", -half), ("f2", half))
    ]
    crate = rx.Mechanism([rx.Body("crate", mass, inertia)], feet, gravity=(0.0, -9.81))
    solution = rx.solve(crate, rx.State(jnp.array([0.0, high, 0.0]), jnp.array([2.0, 0.0, 0.0])))
    load = 9.81 / (1 / mass + half * (half - mu * high) / inertia)
    assert solution.contacts == {"f1": "lifts", "f2": "carries"}
    np.testing.assert_allclose(solution.multipliers, [0.0, load], rtol=1e-12)
    np.testing.assert_allclose(solution.acceleration[0], -mu * load / mass, rtol=1e-12)
