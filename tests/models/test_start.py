"""Where a model begins: the position of its file, moved as little as closing asks, or a keyframe, and limits of joints.

Angles of triangles and MuJoCo's own kinematics say where joints are to be.
"""

import warnings

import numpy as np
import pytest
from scipy.optimize import minimize

import redundax as rx

mujoco = pytest.importorskip("mujoco")

FEW_DIGITS = """<mujoco>
  <default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>
  <worldbody><site name="b" pos="0.4 {side} 0"/>
    <body name="crank"><joint name="A"/><geom fromto="0 0 0 0 0 0.1"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B" axis="{tilt} 1 0"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.1"/>
          <site name="a" pos="0 0 -0.1"/></body></body></body>
    <body name="arm" pos="0 1 0"><joint name="E"/><geom fromto="0 0 0 0 0 0.1"/>
      <body name="hand"><joint name="F" type="ball"/><geom fromto="0 0 0 0 0 0.1"/></body></body>
  </worldbody>
  <equality><connect name="D" site1="a" site2="b"/></equality>
</mujoco>"""


@pytest.fixture
def load(tmp_path):
    def loaded(text, **options):
        (tmp_path / "model.xml").write_text(text)
        return rx.load_model(tmp_path / "model.xml", **options)

    return loaded


@pytest.mark.parametrize(("side", "tilt"), [(5e-8, 5e-7), (5e-8, 5e-6), (-4e-7, 2e-6), (3e-5, 0.0)])
def test_a_file_that_closes_to_its_digits_keeps_its_position(load, side, tilt):
    """Axes that are parallel to the last digit would close what the digits miss, half a radian away."""
    with pytest.warns(UserWarning, match=f"close to {abs(side):.0e} m or rad only, 'D' worst"):
        model = load(FEW_DIGITS.format(side=side, tilt=tilt))
    np.testing.assert_allclose(model.positions, [0, 0, 0, 0, 1, 0, 0, 0], atol=1e-6)
    assert max(model.moved.values(), default=0.0) < 1e-6 and model.is_near
    assert model.misfits["D"] == pytest.approx(abs(side), rel=1e-6)


def test_a_misfit_that_joints_can_close_moves_these_alone_and_is_told(load):
    """The goal of the rocker's foot is 1e-3 m too far along x."""
    text = FEW_DIGITS.format(side=0, tilt=0).replace('name="b" pos="0.4 ', 'name="b" pos="0.401 ')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = load(text)
    assert set(model.moved) == {"A", "B", "C"}
    lines = str(model).splitlines()
    assert lines[0] == "model.xml: 5 bodies; 4 hinges, 1 ball, 1 connect"
    assert lines[1].startswith("moved to close it: A by 0.00") and lines[4] == "left out: contact of 5 shapes"
    foot = crank_chain(*model.positions[:3])
    np.testing.assert_allclose(foot, [0.401, 0.0], atol=1e-12)
    shape = least(lambda x: crank_chain(*x) - [0.401, 0.0], np.zeros(3))
    np.testing.assert_allclose(model.positions[:3], shape, atol=1e-5)  # steps are the least to first order
    assert [model.moved[name] for name in "ABC"] == pytest.approx(np.abs(model.positions[:3]).tolist())


def crank_chain(a, b, c):
    """The foot of the rocker, x and z, by turns about y."""
    angles, arms = np.cumsum([a, b, c]), ([0.0, 0.1], [0.4, 0.0], [0.0, -0.1])
    return sum(
        np.array([np.cos(t) * x + np.sin(t) * z, -np.sin(t) * x + np.cos(t) * z])
        for t, (x, z) in zip(angles, arms, strict=True)
    )


def least(residual, x):
    """The nearest zero, by Lagrange's conditions."""
    found = minimize(lambda y: y @ y, x + 1e-3, constraints={"type": "eq", "fun": residual}, tol=1e-16)
    return found.x


STRETCHED = """<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/><geom size="0.01"/></default><worldbody>
  <body name="upper"><joint name="A"/><geom/><body name="lower" pos="0.4 0 0"><joint name="B"/><geom/>
    <site name="tip" pos="0.3 0 0"/></body></body>
  <body name="hung" pos="0 1 0"><joint name="H"/><geom/><body><joint name="K" type="slide"/><geom/></body></body>
  <site name="goal" pos="0.5 0 0"/></worldbody>
  <equality><connect name="D" site1="tip" site2="goal"/></equality></mujoco>"""


def test_where_least_steps_lead_nowhere_the_nearest_position_is_taken_and_told(load):
    """A stretched arm has no way to first order to a nearer goal; the triangle of its links has the angle at A."""
    model = load(STRETCHED)
    angle = np.arccos((0.4**2 + 0.5**2 - 0.3**2) / (2 * 0.4 * 0.5))
    assert not model.is_near
    assert abs(model.positions[0]) == pytest.approx(angle, abs=1e-9)
    assert model.positions[2:].tolist() == [0.0, 0.0]  # they are in no loop
    assert model.moved["A"] == pytest.approx(angle, abs=1e-9) and set(model.moved) == {"A", "B"}


def test_a_keyframe_that_closes_goes_before_random_positions(load):
    """The links of the arm are square to each other there: 3, 4 and 5 dm."""
    angle = np.arccos(0.8)
    key = f'<keyframe><key name="bent" qpos="{-angle} {np.pi / 2} 0.3 0.1"/></keyframe></mujoco>'
    model = load(STRETCHED.replace("</mujoco>", key))
    assert (model.keyframe, model.is_near, model.moved) == ("bent", True, {})
    np.testing.assert_allclose(model.positions, [-angle, np.pi / 2, 0.3, 0.1], atol=1e-12)


def test_of_all_that_closes_the_nearest_is_found(load):
    """The goal turns with a wheel, so that there is a whole curve of positions that close."""
    text = STRETCHED.replace(
        '<site name="goal" pos="0.5 0 0"/>',
        '<body name="wheel" pos="0.6 0 0"><joint name="W"/><geom/><site name="goal" pos="-0.1 0 0"/></body>',
    )
    model = load(text)

    def miss(x):
        a, b, w = x
        tip = 0.4 * np.array([np.cos(a), np.sin(a)]) + 0.3 * np.array([np.cos(a + b), np.sin(a + b)])
        return tip - [0.6 - 0.1 * np.cos(w), -0.1 * np.sin(w)]

    own = model.positions[[0, 1, 4]]
    np.testing.assert_allclose(miss([*own]), 0.0, atol=1e-9)
    best = min(
        (
            minimize(lambda x: x @ x, start, constraints={"type": "eq", "fun": miss}, tol=1e-14)
            for start in ([0.8, -1.5, 0.2], [-0.8, 1.5, -0.2], [0.3, -0.9, 1.5], [-0.3, 0.9, -1.5])
        ),
        key=lambda found: found.fun + 1e3 * np.abs(miss(found.x)).max(),
    )
    assert own @ own <= 1.01 * best.fun


BAR = """<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>
  <worldbody><body name="crank"><joint name="A" {limits}/><geom fromto="0 0 0 0 0 0.1"/>
    <body name="coupler" pos="0 0 0.1"><joint name="B"/><geom fromto="0 0 0 0.4 0 0"/>
      <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.1"/></body></body></body>
    <body pos="0 1 0"><joint name="E" type="ball" {ball}/><geom fromto="0 0 0 0 0 0.1"/></body></worldbody>
  <equality><connect name="D" body1="rocker" body2="world" anchor="0 0 -0.1"/></equality>
  <keyframe>{keys}</keyframe></mujoco>"""
FILE = 'qpos="0 0 0 1 0 0 0"'
KEYS = '<key name="early" qpos="0.1 -0.1 0.1 1 0 0 0"/><key name="open" qpos="0.5 -0.5 0.5 2 0 0 0"/><key name="x"/>'


@pytest.mark.parametrize(
    ("limits", "asked", "used", "outside"),
    [
        ("", None, "", ()),
        ("", "open", "open", ()),
        ('range="-1 1"', None, "", ()),
        ('range="0.3 1"', None, "open", ()),
        ('range="0.05 1"', None, "early", ()),
        ('range="0.3 1"', "early", "early", (("A", 0.1, 0.3),)),
        ('range="0.6 1"', None, "", (("A", 0.0, 0.6),)),
        ('range="-2 -1"', "open", "open", (("A", 0.5, -1.0),)),
    ],
)
def test_a_keyframe_is_taken_if_asked_or_if_it_alone_is_within_limits(load, limits, asked, used, outside):
    """It is a parallelogram, whose joints turn alike."""
    model = load(BAR.format(limits=limits, ball="", keys=KEYS), keyframe=asked)
    assert (model.keyframe, model.keyframes) == (used, ("early", "open"))
    angle = {"": 0.0, "early": 0.1, "open": 0.5}[used]
    np.testing.assert_allclose(model.positions, [angle, -angle, angle, 1, 0, 0, 0], atol=1e-12)
    assert [tuple(each) for each in model.outside] == [pytest.approx(each) for each in outside]


def test_a_keyframe_that_nearly_closes_is_closed_and_one_without_a_name_has_its_number(load):
    model = load(
        BAR.format(limits="", ball="", keys=f'<key {FILE}/><key qpos="0.5 -0.501 0.5 1 0 0 0"/>'), keyframe="keyframe 2"
    )
    assert model.keyframes == ("keyframe 1", "keyframe 2")
    assert set(model.moved) == {"A", "B", "C"} and max(model.moved.values()) < 2e-3
    assert model.misfits["D"] == pytest.approx(1e-3 * (0.4 - 0.1 * np.sin(0.5)), rel=1e-3)  # upwards, by 1e-3 rad
    assert abs(model.positions[0] - 0.5) < 2e-3


def test_keyframes_that_count_other_joints_are_none(load):
    """One of a part that was added later, one of numbers that are none, and names that are there already."""
    keys = f'<key {FILE}/><key name="keyframe 1" {FILE}/><key name="short" qpos="0 0 0"/><key name="c" ctrl=""/>'
    model = load(BAR.format(limits="", ball="", keys=keys))
    assert model.keyframes == ("keyframe 1 (2)", "keyframe 1")
    assert "keyframes whose positions are not the 7 numbers of all joints: short" in model.notes


def test_how_far_a_ball_is_turned_is_held_against_its_limit(load):
    turned = f'<key name="far" qpos="0 0 0 {np.cos(0.4)} 0 {-np.sin(0.4)} 0"/>'
    model = load(BAR.format(limits="", ball='range="0 0.7"', keys=turned), keyframe="far")
    assert [tuple(each) for each in model.outside] == [pytest.approx(("E", 0.8, 0.7))]
    model = load(BAR.format(limits="", ball='range="0 0.9"', keys=turned), keyframe="far")
    assert not model.outside


@pytest.mark.parametrize(
    ("keys", "there"), [(KEYS, "It has early, open"), ("", "It has none"), ('<key name="x"/>', "It has none")]
)
def test_a_keyframe_that_is_not_there_is_refused_by_name(load, keys, there):
    with pytest.raises(rx.RedundaxError, match=f"`keyframe` names 'opne', which is no keyframe of the file. {there}"):
        load(BAR.format(limits="", ball="", keys=keys), keyframe="opne")
