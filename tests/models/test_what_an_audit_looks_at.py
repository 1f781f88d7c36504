"""What an audit says that it looked at: limits that stop joints, noise, drives that move nothing, spins, alike parts.

Geometry says how far joints go, and MuJoCo's own Jacobian what a copy leaves.
"""

import contextlib
import io
import json
import re

import numpy as np
import pytest

from redundax import __main__ as command
from redundax._models._choice import listed, series
from redundax._models._drives import drives_at
from redundax._models._formats import describe
from redundax._models._spins import spins
from redundax._models._travel import travel
from redundax._models._tree import Tree

mujoco = pytest.importorskip("mujoco")

PARALLELOGRAM = """<mujoco><compiler angle="radian"/>
  <default><geom type="capsule" size="0.01"/><joint axis="0 1 0"/></default>
  <worldbody>
    <body name="lever"><joint name="swing" {swing}/><geom fromto="0 0 0 0 0 0.3"/>
      <body name="beam" pos="0 0 0.3"><joint name="tilt" {tilt}/><geom fromto="0 0 0 0.5 0 0"/></body></body>
    <body name="leg" pos="0.5 0 0"><joint name="knee" {knee}/><geom fromto="0 0 0 0 0 0.3"/></body>{body}
  </worldbody>
  <equality><connect name="pin" body1="beam" body2="leg" anchor="0.5 0 0"/>{loop}</equality>
  <actuator>{drives}</actuator>
</mujoco>"""


def parallelogram(swing="", tilt="", knee="", body="", loop="", drives='<motor name="m" joint="swing"/>'):
    parts = {"swing": swing, "tilt": tilt, "knee": knee}
    limits = {name: f'range="{span}"' if span else "" for name, span in parts.items()}
    return PARALLELOGRAM.format(**limits, body=body, loop=loop, drives=drives)


@pytest.fixture
def tree(tmp_path):
    def of(text):
        (tmp_path / "model.xml").write_text(text)
        return Tree(describe(tmp_path / "model.xml"))

    return of


@pytest.fixture
def audit(tmp_path):
    def run(text, *arguments):
        (tmp_path / "model.xml").write_text(text)
        out, error = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
            command.main(["audit", str(tmp_path / "model.xml"), *map(str, arguments)])
        return out.getvalue(), error.getvalue()

    return run


def freedom(tree, at):
    return int(tree.nv - np.linalg.matrix_rank(tree.system(at)[1], tol=1e-9))


@pytest.mark.parametrize(
    ("limits", "low", "high", "stops"),
    [
        ({}, -6.4, 6.4, set()),
        ({"swing": "-0.7 0.4"}, -0.7, 0.4, {("swing", -0.7), ("swing", 0.4)}),
        ({"tilt": "-0.3 1"}, -1.0, 0.3, {("tilt", -0.3), ("tilt", 1.0)}),
        ({"swing": "-0.02 9", "knee": "-9 0.03"}, -0.02, 0.03, {("swing", -0.02), ("knee", 0.03)}),
        ({"swing": "0 1.4", "tilt": "0 6.28"}, 0.0, 0.0, {("swing", 0.0), ("tilt", 0.0)}),
        ({"knee": "0 0.0005"}, 0.0, 0.0005, {("knee", 0.0), ("knee", 0.0005)}),
    ],
)
def test_joints_are_moved_as_far_as_limits_allow_and_those_that_stop_them_are_named(tree, limits, low, high, stops):
    """swing, -tilt and knee are the same angle."""
    model = tree(parallelogram(**limits))
    found = travel(model, model.reference, 1)
    np.testing.assert_allclose(found.ranges["swing"], (low, high), atol=0.1 / 2**6 if stops else 0.05)
    assert not stops or (low - 1e-6 <= found.ranges["swing"][0] and found.ranges["swing"][1] <= high + 1e-6)
    assert set(found.stops) == stops
    assert found.moved == (() if high - low < 1e-3 else ("swing",))


def test_a_motion_that_limits_forbid_is_not_claimed(audit):
    """The linkage has one freedom all the same, and the joints stand at the limits where they are 0."""
    text = parallelogram(swing="0 1.4", tilt="0 6.28")
    out = " ".join(audit(text)[0].split())
    assert "No motion was looked at: limits of joints keep swing in place: swing at 0 and tilt at 0" in out
    assert "along the motion" not in out and "Moved" not in out
    assert re.search(
        r"Same at 3 other positions, all of them outside limits of (swing|tilt)( and (swing|tilt))?\.", out
    )
    found = json.loads(audit(text, "--json")[0])
    assert (found["redundancy"], found["freedom"], found["travel"]["moved"]) == (1, 1, [])
    assert {each["joint"] for each in found["travel"]["limits_that_stop"]} == {"swing", "tilt"}


def test_positions_beyond_limits_are_told_and_a_keyframe_within_goes_first(audit):
    text, key = parallelogram(swing="0.2 1"), '<keyframe><key name="up" qpos="0.5 -0.5 0.5"/></keyframe></mujoco>'
    out = " ".join(audit(text)[0].split())
    assert "Outside joint limits there: swing at 0, limit 0.2 (rad or m)." in out
    out = " ".join(audit(text.replace("</mujoco>", key))[0].split())
    assert "begins from the keyframe 'up': the position of the file is outside joint limits" in out
    assert "Outside joint limits" not in out and "Keyframe of the file" not in out and "keyframes:" not in out
    plain = parallelogram().replace("</mujoco>", key)
    assert "Keyframe of the file: up; --keyframe NAME begins from one." in audit(plain)[0]
    assert "It begins from the keyframe 'up'.\n" in audit(plain, "--keyframe", "up")[0]
    assert "'down', which is no keyframe of the file. It has up." in audit(plain, "--keyframe", "down")[1]


def test_what_is_rounding_in_positions_is_told_as_0(tree):
    """A flat parallelogram is singular where it lies, and after each half turn, though loops settle it to 1e-6."""
    flat = parallelogram().replace('pos="0 0 0.3"', 'pos="0.3 0 0"').replace("0 0 0 0 0 0.3", "0 0 0 0.3 0 0")
    model = tree(flat)
    found = travel(model, np.array([0.7, -0.7, 0.7]), 1)
    places = sorted(each.at for each in found.singular)
    np.testing.assert_allclose(places, np.pi * np.round(np.array(places) / np.pi), atol=1e-5)
    assert 0.0 in places


LOCKED = """<mujoco><default><geom type="sphere" size="0.02"/></default><worldbody>
  <body name="cart" pos="0 0 0.3"><joint name="rail" type="slide" axis="1 0 0"/><geom/>
    <body name="stay"><joint name="pivot" axis="0 1 0"/><geom/></body></body></worldbody>
  <equality><connect body1="stay" body2="world" anchor="0.2 0 -0.3"/></equality>
  <actuator>{}</actuator></mujoco>"""
PUSH, TURN = '<motor name="push" joint="rail"/>', '<motor name="turn" joint="pivot"/>'
WHEEL = '<body name="wheel" pos="0 1 0"><joint name="W"/><geom type="sphere" size="0.1"/></body>'
HELD = '<connect name="held" body1="wheel" body2="world" anchor="0.1 0 0.1"/>'
MOTORS = "".join(
    f'<motor name="{name}" joint="{joint}"/>' for name, joint in (("m", "swing"), ("o", "knee"), ("n", "W"))
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LOCKED.format(PUSH), "Drive: push works against a locked mechanism: its force loads joints alone."),
        (
            LOCKED.format(PUSH + TURN),
            "Drives: push and turn work against a locked mechanism: their forces load joints alone.",
        ),
        (parallelogram(), "Drive: the motion determines the force of m."),
        (
            parallelogram(body=WHEEL, loop=HELD, drives=MOTORS),
            "Drives: n moves nothing, as what it acts on is held: its force loads joints alone. The others: 2, which "
            "is 1 more than they can move independently. The motion does not determine the forces of m and o:",
        ),
        (
            parallelogram(body=WHEEL, loop=HELD, drives=MOTORS.replace("knee", "W")),
            "Drives: o and n move nothing, as what they act on is held: their forces load joints alone. The other: the "
            "motion determines the force of m.",
        ),
    ],
)
def test_drives_that_move_nothing_are_told_from_those_that_share(audit, text, words):
    out = " ".join(audit(text)[0].split())
    assert words in out
    assert ("can work against each other" in out) == ("more than they can move" in words)


def test_a_drive_at_a_dead_point_is_one(audit):
    piston = """<mujoco><default><joint axis="0 1 0"/><geom type="sphere" size="0.1"/></default><worldbody>
      <body name="crank"><joint name="A"/><geom/><body name="rod" pos="0.1 0 0"><joint name="B"/><geom/></body></body>
      <body name="piston" pos="0.5 0 0"><joint name="S" type="slide" axis="1 0 0"/><geom/></body></worldbody>
      <equality><connect body1="rod" body2="piston" anchor="0.4 0 0"/></equality>
      <actuator><motor name="gas" joint="S"/></actuator></mujoco>"""
    out = " ".join(audit(piston)[0].split())
    assert "The position of the file is a dead point of gas: there its force is not determined." in out


def test_which_drives_move_nothing_is_a_matter_of_position_and_freedom(tree):
    model = tree(parallelogram(body=WHEEL, loop=HELD, drives=MOTORS))
    found = drives_at(model, model.reference, freedom(model, model.reference))
    assert (found.locked, found.loose, found.redundancy) == (("n",), ("m", "o", "n"), 2)
    assert found.to_dict()["moving_nothing"] == ["n"]


def hexapod(legs, ram=False, drive=False):
    """A plate on legs with a ball at both ends; with a slide in each, or as rods."""
    bodies, loops, drives = "", "", ""
    for k, turn in enumerate(np.linspace(0, 2 * np.pi, legs, endpoint=False), 1):
        shift = turn + 0.4 * (-1) ** k
        foot, top = np.array([np.cos(turn), np.sin(turn), 0]), np.array([0.5 * np.cos(shift), 0.5 * np.sin(shift), 0.8])
        along = (top - foot) / (2 if ram else 1)
        line = " ".join(map(str, along.tolist()))
        end = f'<geom type="capsule" size="0.02" fromto="0 0 0 {line}"/>'
        slide = f'<body name="rod{k}" pos="{line}"><joint name="ram{k}" type="slide" axis="{line}"/>{end}</body>' * ram
        place = " ".join(map(str, foot.tolist()))
        bodies += f'<body name="leg{k}" pos="{place}"><joint name="foot{k}" type="ball"/>{end}{slide}</body>'
        loops += f'<connect body1="{"rod" if ram else "leg"}{k}" body2="plate" anchor="{line}"/>'
        drives += f'<motor joint="foot{k}" gear="{line}"/>' if drive else ""
    plate = '<body name="plate" pos="0 0 0.8"><freejoint/><geom type="cylinder" size="0.5 0.02"/></body>'
    return (
        f"<mujoco><worldbody>{plate}{bodies}</worldbody><equality>{loops}</equality>"
        f"<actuator>{drives}</actuator></mujoco>"
    )


DOOR = """<mujoco><worldbody><body name="leaf"><joint name="pin" axis="0 0 1"/><geom type="box" size="0.4 0.02 1"/>
  <site name="top" pos="0 0 2"/></body><site name="frame" pos="0 0 2"/></worldbody>
  <equality><connect site1="top" site2="frame"/></equality></mujoco>"""


@pytest.mark.parametrize(
    ("text", "free", "found"),
    [
        (hexapod(6), 6, [(f"leg{k}",) for k in range(1, 7)]),  # a truss: the plate is held by six rods
        (hexapod(3), 6, [(f"leg{k}",) for k in range(1, 4)]),
        (hexapod(6, ram=True), 12, [(f"leg{k}", f"rod{k}") for k in range(1, 7)]),  # 6 of the plate, 6 spins
        (hexapod(6, drive=True), 6, []),
        (DOOR, 1, []),
        (parallelogram(body=WHEEL), 2, []),
    ],
)
def test_spins_of_parts_between_others_are_counted_apart(tree, text, free, found):
    """Six distances leave a plate none of its six freedoms, three leave three."""
    model = tree(text)
    at = model.reference
    assert freedom(model, at) == free
    assert spins(model, at, free) == tuple(found)


def test_an_audit_tells_spins_from_the_freedoms_of_the_rest(audit):
    text = hexapod(3)
    out = " ".join(audit(text)[0].split())
    assert (
        "freedom 6: 6 independent motions, 3 of which only spin single parts between others (leg1 to leg3), so 3 "
        "without." in out
    )
    found = json.loads(audit(text, "--json")[0])
    assert (found["freedom"], found["freedom_without_spins"]) == (6, 3)
    assert found["spins"] == [["leg1"], ["leg2"], ["leg3"]]


def legs(count, radial):
    """Four-bars side by side, or all round."""
    bodies, loops = "", ""
    for k in range(1, count + 1):
        turn = 360 / count * k * radial
        place = f'pos="{np.cos(np.radians(turn))} {np.sin(np.radians(turn)) + k * (not radial)} 0" euler="0 0 {turn}"'
        bodies += f"""<body name="hub{k}" {place}>
          <body name="crank{k}"><joint name="hip{k}"/><geom fromto="0 0 0 0.05 0 0.1"/>
            <body name="rod{k}" pos="0.05 0 0.1"><joint name="knee{k}"/><geom fromto="0 0 0 0.4 0 0.1"/>
              <body name="foot{k}" pos="0.4 0 0.1"><joint name="heel{k}"/><geom fromto="0 0 0 0.05 0 -0.2"/></body>
          </body></body></body>"""
        loops += f'<connect name="pin{k}" body1="foot{k}" body2="hub{k}" anchor="0.05 0 -0.2"/>'
    head = '<default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>'
    return f"<mujoco>{head}<worldbody>{bodies}</worldbody><equality>{loops}</equality></mujoco>"


@pytest.mark.parametrize("radial", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_alike_parts_are_told_once_with_how_many(audit, radial):
    text = legs(4, radial)
    out = audit(text)[0]
    words = " ".join(out.split())
    assert "REDUNDANT by 4" in words
    assert "between hip1, knee1, heel1 and pin1, and alike 3 more times (with hip2 to hip4; --all tells each)" in words
    assert ("each in directions of its own" in words) == radial
    assert "knee1 to knee4" in words and "heel2 " not in words
    assert words.count("<- --fix takes it") == 1
    everything = " ".join(audit(text, "--all")[0].split())
    assert everything.count("<- --fix takes it") == 4 and "alike 3 more" not in everything
    assert "hip4 slides" in everything or "heel4 slides" in everything


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (["A", "B"], "A and B"),
        (["leg1", "leg2"], "leg1 and leg2"),
        (["leg1", "leg2", "leg3"], "leg1 to leg3"),
        (["a1", "b1", "a2", "b2", "a3", "b3"], "a1 to a3 and b1 to b3"),
        (["r2_j1", "r2_j2", "r2_j3", "r3_j1"], "r2_j1 to r2_j3 and r3_j1"),
        (["x08", "x09", "x10", "x12"], "x08 to x10 and x12"),
        (["k2", "k1", "k3"], "k2, k1 and k3"),
        (["n1", "n3", "n5"], "n1, n3 and n5"),
        (["pin 1 ~ 1", "pin 2 ~ 2", "pin 3 ~ 3"], "pin 1 ~ 1 to pin 3 ~ 3"),
    ],
)
def test_names_that_count_on_stand_together(names, told):
    assert listed(names) == told
    assert len(series(names)) <= len(names)


FLAT = """<mujoco><default><geom type="capsule" size="0.01"/><joint axis="0 1 0"/></default><worldbody>
  <body name="left"><joint name="a"/><geom fromto="0 0 0 0.3 0 0"/>
    <body name="top" pos="0.3 0 0"><joint name="b"/><geom fromto="0 0 0 0.5 0 0"/></body></body>
  <body name="right" pos="0.5 0 0"><joint name="c"/><geom fromto="0 0 0 0.3 0 0"/></body></worldbody>
  <equality><connect name="d" body1="top" body2="right" anchor="0.5 0 0"/></equality></mujoco>"""


def test_a_copy_of_a_model_at_a_singular_position_is_judged_beside_it(audit, tmp_path):
    """As a parallelogram with one slide more is: by MuJoCo's own Jacobian where left and right are turned alike."""
    copy = tmp_path / "copy.xml"
    told = " ".join(audit(FLAT, "--fix", copy)[1].split())
    assert "The copy has redundancy 0, freedom 1." in told and "expected" not in told
    model = mujoco.MjModel.from_xml_path(str(copy))
    model.opt.jacobian, data = mujoco.mjtJacobian.mjJAC_DENSE, mujoco.MjData(model)
    for turn in (0.0, 0.4, -1.1):
        for name, sign in (("a", 1), ("b", -1), ("c", 1)):
            data.joint(name).qpos[0] = sign * turn
        mujoco.mj_forward(model, data)
        rows = data.efc_J.reshape(-1, model.nv)[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
        rank = np.linalg.matrix_rank(rows, tol=1e-9)
        assert (len(rows) - rank, model.nv - rank) == ((0, 1) if turn else (1, 2))
