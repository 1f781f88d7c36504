"""The referee on machines with contacts that push: a beam of 10 N on three supports, one more than it needs."""

import numpy as np
import pytest

import redundax as rx

X, TIMES = (-0.6, 0.1, 0.8), np.linspace(0.0, 1.0, 3)


def beam(at=0.2, heights=(0.0, 0.0, 0.0)):
    supports = [
        rx.PinInSlot(f"s{k}", "beam", "ground", (x, 0.0), (x, y), (0.0, 1.0), one_sided=True)
        for k, (x, y) in enumerate(zip(X, heights, strict=True))
    ]
    held = rx.PinInSlot("held", "beam", "ground", (0.0, 0.0), (0.0, 0.0), (1.0, 0.0))
    load = rx.AppliedForce("beam", force=(0.0, -10.0), point=(at, 0.0))
    return rx.Mechanism([rx.Body("beam", 2.0, 0.5)], [*supports, held], loads=[load])


def log(middle, at=0.2):
    """Loads of the supports with that of the middle one given: they carry 10 N at a place."""
    right = (10.0 * (at - X[0]) - middle * (X[1] - X[0])) / (X[2] - X[0])
    loads = 10.0 - middle - right, middle, right
    return {"t": TIMES, **{f"s{k} force y on beam": np.full(3, load) for k, load in enumerate(loads)}}


def check(mechanism, table):
    return rx.check(mechanism, table, q=np.zeros(3), axes="global")


@pytest.mark.parametrize("middle", [3.0, -4.0])
def test_a_support_that_pulls_is_wrong(middle):
    """Whatever the self-stress, no support pulls: nearest to the log is a middle one that carries nothing."""
    report = check(beam(), log(middle))
    assert report.redundancy == 1
    assert report.is_right == (middle > 0)
    if middle < 0:
        assert report.stamps["s1 force y on beam"] == "not determined, wrong"
        expected = [log(0.0)[name][0] for name in report.names]
        np.testing.assert_allclose(report.expected[0], expected, rtol=1e-3, atol=0.02)


def test_what_pushing_and_a_closure_allow_stands_beside():
    """Equal supports share it by least squares; with the middle 1 mm too short the closure would make it pull."""
    mechanism = beam()
    soft = [rx.JointCompliance(f"s{k}", 1e-6) for k in range(3)]
    table = log(3.0)
    bounds = rx.PreloadBox({"s1.perpendicular": (0.0, 4.0)})
    report = rx.check(mechanism, table, rx.ElasticJoints(mechanism, soft), q=np.zeros(3), axes="global", bounds=bounds)
    arms = np.array([[1.0, 1.0, 1.0], X])
    exact = np.linalg.pinv(arms) @ [10.0, 2.0]  # equal springs: the least sum of squares
    np.testing.assert_allclose(report.closed[0], exact, rtol=1e-9)
    ends = [sorted(log(middle)["s0 force y on beam"][0] for middle in (0.0, 4.0))]
    np.testing.assert_allclose(report.bands["s0 force y on beam"], ends[0], rtol=1e-7)
    soft[1] = rx.JointCompliance("s1", 1e-6, misfit=(0.0, 1e-3, 0.0))
    short = rx.check(mechanism, table, rx.ElasticJoints(mechanism, soft), q=np.zeros(3), axes="global")
    assert np.isnan(short.closed).all()


def test_a_support_with_a_gap_carries_nothing():
    mechanism, table = beam(heights=(0.0, -1e-3, 0.0)), log(0.0)
    report = check(mechanism, table)
    assert report.redundancy == 0 and report.is_right
    assert set(report.stamps.values()) == {"determined, right"}
    wrong = check(mechanism, log(3.0))
    assert wrong.stamps["s1 force y on beam"] == "determined, wrong"
    np.testing.assert_allclose(wrong.worst[1], 3.0, rtol=1e-9)


def test_a_beam_that_tips_is_refused():
    with pytest.raises(rx.NoSolutionError, match=r"At t = 0 the contacts s0.* cannot carry the motion of the log"):
        check(beam(at=1.0), log(0.0, at=1.0))


def test_a_contact_that_closes_on_the_way_is_named():
    slots = [
        rx.PinInSlot(f"g{k}", "block", "ground", (0.0, y), (0.0, 0.0), (1.0, 0.0)) for k, y in enumerate((0.1, -0.1))
    ]
    floor = rx.PinInSlot("floor", "block", "ground", (0.0, 0.0), (0.0, 0.0), (0.0, 1.0), one_sided=True)
    block = rx.Mechanism([rx.Body("block", 2.0, 0.5)], [*slots, floor], gravity=(0.0, -9.81))
    down, none = 0.95 - np.linspace(0.0, 1.0, 3), np.zeros(3)
    table = {"t": TIMES, "block.y": down, "block.y'": none - 1.0, "block.y''": none, "g0 force x on block": none}
    with pytest.raises(rx.RedundaxError, match=r"but floor.perpendicular close by t = 1\."):
        rx.check(block, table, q=np.array([0.0, 0.95, 0.0]))
    table |= {"block.y": down + 1.0}
    assert rx.check(block, table, q=np.array([0.0, 1.95, 0.0])).is_right
