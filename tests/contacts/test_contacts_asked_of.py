"""What calls beside `solve` say of contacts that only push: against linear programmes, closed forms and enumeration."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

import redundax as rx

G = 9.81
FEET = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
MASS = np.array([10.0, 0.8, 1.1])
HEIGHT = 0.7


def table():
    """A table of 98.1 N on four feet, of z, phi_x, phi_y, that is pushed along x at its top with t newtons."""
    return rx.System(
        lambda q, t, p: -(q[0] + FEET[:, 1] * q[1] - FEET[:, 0] * q[2]),
        mass=jnp.asarray(MASS),
        load=lambda q, qd, t, p: jnp.stack([-98.1 + 0.0 * t, 0.0 * t, HEIGHT * t]),
        coordinates=["linear", "angular", "angular"],
        rows="force",
        one_sided=range(4),
    )


def pushed(*pushes):
    return [rx.State(jnp.zeros(3), jnp.zeros(3), jnp.asarray(push)) for push in pushes]


def by_linear_programme(push, foot):
    """Least and largest load of a foot: sum p = 98.1, sum y p = 0, sum x p = h push, p >= 0."""
    balance, right = np.stack([np.ones(4), FEET[:, 1], FEET[:, 0]]), [98.1, 0.0, HEIGHT * push]
    return [sign * linprog(sign * np.eye(4)[foot], A_eq=balance, b_eq=right).fun for sign in (1.0, -1.0)]


def of_tipping(push):
    """Load N of each front foot of the table that tips: m z'' = 2 N - m g, J w' = h push - 0.4 * 2 N, z'' = 0.4 w'."""
    both = (HEIGHT * push * 0.4 / MASS[2] + G) / (1 / MASS[0] + 0.16 / MASS[2])
    return both / 2


def test_bands_along_a_push_are_those_of_linear_programmes():
    pushes = (0.0, 20.0, 40.0, 60.0)
    path = rx.band_along(table(), pushed(*pushes), ["0", "1"])
    for k, push in enumerate(pushes[:3]):
        for foot in range(2):
            expected = by_linear_programme(push, foot)
            np.testing.assert_allclose([path.lower[k, foot], path.upper[k, foot]], expected, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose([path.lower[3], path.upper[3]], [[0.0, of_tipping(60.0)]] * 2, rtol=1e-9, atol=1e-9)
    assert path.exact.all()
    assert path.contacts[0] == dict.fromkeys("0123", "carries")
    assert path.contacts[3] == {"0": "lifts", "1": "carries", "2": "carries", "3": "lifts"}
    assert "Contacts 0, 3: lifts; 1, 2: carries, at t = 60." in str(path).replace("\n    ", " ")
    assert path.motion == ("rests",) * 3 + ("lifts",)  # what tips does not rest
    rows = [line.split() for line in str(path).split("\n") if line.startswith("  rests")]
    assert [row[6:8] for row in rows] == [["0", "49.05"], ["0", "49.05"]]  # halves of the weight; no -3.6e-15


def stacked(states):
    return jax.tree.map(lambda *x: jnp.stack(x), *states)


def test_an_analysis_along_a_push_tells_when_feet_lift():
    report = rx.analyze_along(table(), stacked(pushed(0.0, 40.0, 60.0, 70.0)))
    np.testing.assert_array_equal(report.rank, [3, 3, 2, 2])
    assert [one.redundancy for one in report.reports] == [1, 1, 0, 0]
    told = {(change.start, change.name): (change.before, change.after) for change in report.changes}
    assert told[40.0, "contact 0"] == ("carries", "lifts")
    assert told[40.0, "rank"] == ("3", "2")
    assert (0.0, "contact 0") not in told and (60.0, "rank") not in told
    for foot in range(4):
        for k, push in enumerate((0.0, 40.0)):
            expected = by_linear_programme(push, foot)
            np.testing.assert_allclose(report.reports[k].ranges[str(foot)], expected, rtol=1e-9, atol=1e-7)
    # 3 rows without feet 0, 3: z + 0.4 w = 0 with y = +-0.3; singular values beside the largest do not change.
    assert report.smallest[2] == pytest.approx(report.smallest[3])
    assert report.narrow == () and report.releases == ()
    assert "rank drops nowhere between states with the same contacts" in str(report)  # it does where two lift
    with pytest.raises(rx.RedundaxError, match="`rank` must be left out where contacts are one-sided"):
        rx.analyze_along(table(), stacked(pushed(0.0, 40.0)), rank=3)


def sliding_rod(angle, mu, rate):
    """A rod of 2 m and 1 kg that leans to the right and slides on its lower end to the left."""
    foot = rx.PinInSlot("foot", "rod", "ground", (-1.0, 0.0), (0.0, 0.0), (0.0, 1.0), rx.Coulomb(mu), one_sided=True)
    mechanism = rx.Mechanism([rx.Body("rod", 1.0, 1 / 3)], [foot], gravity=(0.0, -G))
    s, c = np.sin(angle), np.cos(angle)
    return mechanism, rx.State(jnp.array([c, s, angle]), jnp.array([-2.0 - rate * s, rate * c, rate]))


@pytest.mark.parametrize("mu, rate, count", [(0.3, 0.0, 1), (0.3, 4.0, 1), (2.0, 0.0, 0), (2.0, 4.0, 2)])
def test_a_rod_has_as_many_solutions_as_painleve_says(mu, rate, count):
    """The foot's y'' = b + p N with b = rate^2 sin - g and p = 1 + 3 cos (cos - mu sin), 0 <= N _|_ y'' >= 0."""
    mechanism, state = sliding_rod(1.0, mu, rate)
    s, c = np.sin(1.0), np.cos(1.0)
    b, p = rate**2 * s - G, 1 + 3 * c * (c - mu * s)
    expected = [0.0] * int(b > 0) + [-b / p] * int(b * p < 0)
    assert len(expected) == count
    found = rx.frictional_solutions(mechanism, state, starts=20)
    loads = [float(solution["foot.perpendicular"]) for solution in found]
    np.testing.assert_allclose(loads, expected, rtol=1e-9, atol=1e-12)
    assert [solution.contacts["foot"] for solution in found] == ["carries" if load else "lifts" for load in expected]


@pytest.mark.parametrize("short, expected", [(0.0, [32.7] * 3), (1e-3, [0.0, 98.1, 0.0]), (9e-5, [2.7, 92.7, 2.7])])
def test_a_beam_that_slides_on_elastic_feet_rests_on_all_that_it_sinks_to(short, expected):
    """Feet of 1 um/N at -0.5, 0, 0.5, the outer ones short: the middle one alone would sink by 98.1 um."""
    feet = [
        rx.PinInSlot(f"f{k}", "b", "ground", (x, 0.0), (x, 0.0), (0.0, 1.0), friction=rx.Coulomb(0.3), one_sided=True)
        for k, x in enumerate((-0.5, 0.0, 0.5))
    ]
    mechanism = rx.Mechanism([rx.Body("b", 10.0, 1.0)], feet, gravity=(0.0, -G))
    soft = [rx.JointCompliance(f"f{k}", 1e-6, misfit=(0.0, short * (k != 1), 0.0)) for k in range(3)]
    closure = rx.ElasticJoints(mechanism, soft)
    state = rx.State(jnp.zeros(3), jnp.array([1.0, 0.0, 0.0]))
    (found,) = rx.frictional_solutions(mechanism, state, closure=closure, starts=20)
    np.testing.assert_allclose(found.multipliers, expected, rtol=1e-9, atol=1e-9)


def test_a_table_vibrates_on_the_feet_that_carry():
    """s = eigenvalues of J M^-1 J^T W^-1 of the rows that carry: three of four feet, where one is short."""
    compliance = np.array([1e-6, 2e-6, 3e-6, 4e-6])
    rows = -np.stack([np.ones(4), FEET[:, 1], -FEET[:, 0]], axis=1)
    (state,) = pushed(-20.0)
    for short, carried, touching in ((0.0, [0, 1, 2, 3], ()), (1e-3, [0, 2, 3], ("1",))):
        feet = rx.Compliance(W=compliance, misfit=np.array([0.0, -short, 0.0, 0.0]))
        solution = rx.solve(table(), state, closure=feet)
        found = rx.stability(table(), state, solution, feet)
        own = rows[carried]
        expected = np.linalg.eigvals(own @ np.diag(1 / MASS) @ own.T @ np.diag(1 / compliance[carried]))
        np.testing.assert_allclose(found.eigenvalues, np.sort(np.real(expected))[-3:], rtol=1e-9)
        assert found.verdict is rx.Settling.STABLE and found.touching == touching
    assert "without 1, which touch without load" in str(found)
    held = rx.Mechanism([rx.Body("rod", 1.0, 1.0)], [rx.Revolute("A", "rod", "ground", (0, 0), (0, 0))])
    other = rx.solve(held, rx.State(jnp.zeros(3), jnp.zeros(3)))
    with pytest.raises(rx.RedundaxError, match="`solution` must be one of `solve` for this system"):
        rx.stability(table(), state, other, feet)


def test_of_a_table_that_falls_there_is_nothing_to_judge():
    """A millimetre above the floor all feet are open: no joint carries, so that none vibrates."""
    feet, state = (
        rx.Compliance(W=np.full(4, 1e-6)),
        rx.State(jnp.array([1e-3, 0.0, 0.0]), jnp.zeros(3), jnp.asarray(0.0)),
    )
    solution = rx.solve(table(), state, closure=feet)
    assert set(solution.contacts.values()) == {"open"}
    found = rx.stability(table(), state, solution, feet)
    assert found.verdict is rx.Settling.NOTHING and found.eigenvalues.size == 0 and found.growth == 0.0
    assert str(found) == "nothing to judge: no joint that carries gives way"


def test_a_foot_in_the_air_changes_no_verdict_by_what_couples_it():
    """A closure may couple feet, as a frame does: one that is open carries nothing, and others are as without it."""
    law = {"normal": (0.0, 1.0), "friction": rx.Coulomb(0.3), "one_sided": True}

    def block(heights):
        points = enumerate(zip((-0.3, 0.0, 0.3, 0.1), heights, strict=False))
        feet = [rx.PinInSlot(f"f{k}", "block", "ground", (x, -0.5), (x, y), **law) for k, (x, y) in points]
        return rx.Mechanism([rx.Body("block", 10.0, 1.0)], feet, gravity=(0.0, -G))

    soft = np.diag([1e-6, 2e-6, 1.5e-6, 3e-6])
    soft[3, :3] = soft[:3, 3] = 0.9e-6, 1e-6, 0.4e-6
    state = rx.State(jnp.array([0.0, 0.5, 0.0]), jnp.array([1.0, 0.0, 0.0]))
    coupled = rx.analyze(block((0.0, 0.0, 0.0, -0.01)), state, closure=rx.Compliance(soft))
    alone = rx.analyze(block((0.0, 0.0, 0.0)), state, closure=rx.Compliance(soft[:3, :3]))
    assert coupled.contacts["f3"] == "open"
    assert coupled.spectral_radius == pytest.approx(alone.spectral_radius, rel=1e-9)
