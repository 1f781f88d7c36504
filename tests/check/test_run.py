"""Runs of MuJoCo, whose loops are springs: the stiffer they are, the nearer its loads come to those of rigid loops"""

import pytest

import redundax as rx
from redundax import __main__ as command

pytest.importorskip("mujoco")

BAR = """<mujoco><option gravity="1 0 -9.81" timestep="{step}"/>
  <default><joint axis="0 1 0"/><geom type="capsule" size="0.02"/>
    <equality solref="{settling} 1" solimp="{impedance} {impedance} 0.001"/></default>
  <worldbody><body name="crank"><joint name="A"/><geom fromto="0 0 0 0 0 0.2"/>
    <body name="coupler" pos="0 0 0.2"><joint name="B"/><geom fromto="0 0 0 0.4 0 0.1"/>
      <body name="rocker" pos="0.4 0 0.1"><joint name="C"/><geom fromto="0 0 0 0 0 -0.3"/></body></body></body>
  </worldbody>
  <equality><connect name="D" body1="rocker" body2="world" anchor="0 0 -0.3"/></equality></mujoco>"""
LEAVES = """<mujoco><worldbody>
    <body name="door"><joint name="lower" axis="0 0 1" pos="0 0 0.2"/>
      <geom type="box" size="0.4 0.02 0.9" pos="0.4 0 1" mass="20"/></body>
    <body name="leaf" pos="0 0 1.8"><joint name="upper" axis="0 0 1"/>
      <geom type="box" size="0.03 0.02 0.05" pos="0.03 0 0" mass="0.2"/></body></worldbody>
  <equality><weld name="screws" body1="door" body2="leaf" anchor="0.06 0 0"/></equality></mujoco>"""


@pytest.fixture
def load(tmp_path):
    def loaded(text):
        (tmp_path / "model.xml").write_text(text)
        return rx.load_model(tmp_path / "model.xml")

    return loaded


@pytest.mark.parametrize(
    ("step", "settling", "impedance", "right"), [(2e-3, 0.02, 0.9, False), (2e-4, 4e-4, 0.999999, True)]
)
def test_loads_of_stiff_loops_are_right_and_of_soft_ones_are_not(load, step, settling, impedance, right):
    model = load(BAR.format(step=step, settling=settling, impedance=impedance))
    report = rx.check(model.mechanism, model.run(0.4), rtol=0.01)
    stamps = report.stamps
    assert report.is_right is right
    assert {stamps[f"{joint} force y on {body}"] for joint, body in (("A", "crank"), ("C", "rocker"))} == {
        "not determined"
    }
    assert stamps["D force z on rocker"] == ("determined, right" if right else "determined, wrong")
    worst = dict(zip(report.names, report.worst, strict=True))
    assert worst["D moment y on rocker"] < 1e-9


def test_a_door_that_rests_is_in_balance_and_its_hinges_are_open(load):
    """Its weight hangs on one hinge, as MuJoCo has it; the other and the screws carry the rest of the tree."""
    model = load(LEAVES)
    report = rx.check(model.mechanism, model.run(0.1))
    assert report.is_right and report.redundancy == 5
    largest = dict(zip(report.names, abs(report.logged).max(axis=0), strict=True))
    assert largest["lower force z on door"] == pytest.approx(20 * 9.81, rel=1e-3)
    assert report.stamps["lower force z on door"] == "not determined"


def test_a_loop_that_no_joint_can_move_bears_nothing_in_mujoco(load):
    """A point on the door's own hinge: MuJoCo leaves its rows out, and all loads to the hinge."""
    pin = '<equality><connect name="top" body1="door" body2="world" anchor="0 0 1.8"/></equality></mujoco>'
    model = load(f"{LEAVES.partition('<equality>')[0]}{pin}")
    report = rx.check(model.mechanism, model.run(0.05))
    assert report.is_right and report.stamps["top force x on door"] == "not determined"
    assert not report.logged[:, report.names.index("top force x on door")].any()


def test_what_mujoco_does_not_run_is_told(tmp_path, capsys):
    (tmp_path / "loop.urdf").write_text(
        '<robot name="r"><link name="base"/><link name="rod"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="a" type="continuous"><parent link="base"/><child link="rod"/></joint>'
        '<loop_joint name="b" type="continuous"><axis xyz="1 0 0"/>'
        '<link1 link="base" xyz="0 0 0" rpy="0 0 0"/><link2 link="rod" xyz="0 0 0" rpy="0 0 0"/></loop_joint></robot>'
    )
    assert command.main(["check", str(tmp_path / "loop.urdf"), "--run", "0.1"]) == 2
    assert "must have loops that MuJoCo has, but 'b' is none" in capsys.readouterr().err
