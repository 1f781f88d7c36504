"""The command on a four-bar from an MJCF, against MuJoCo's own mass matrix and bias along the same motion."""

import csv
import pathlib
import re

import numpy as np
import pytest

from redundax import __main__ as command

mujoco = pytest.importorskip("mujoco")
FOUR_BAR = str(pathlib.Path(__file__).parents[1] / "support" / "models" / "fourbar.xml")


def angles_of(crank):
    """B and C of the loop for crank angles, by the triangle of its lengths; from the file's own position on."""
    a, b, c, d = 0.1, 0.35, 0.3, 0.4
    at = a * np.stack([np.sin(crank), np.cos(crank)])  # of B, x and z; the crank points up at 0
    to = np.array([[d], [0.0]]) - at
    length = np.hypot(*to)
    rod = np.arctan2(to[1], to[0]) + np.arccos((b**2 + length**2 - c**2) / (2 * b * length))
    rocker = np.arctan2(to[1], to[0]) - np.arccos((c**2 + length**2 - b**2) / (2 * c * length))
    upright = np.pi / 2 - crank
    turns = upright - rod, rod - rocker
    return np.stack([crank, *turns])


def test_the_command_tells_the_torque_that_mujocos_equations_need(tmp_path, capsys):
    """tau = v^T (M a + bias - damping) / v_A along the one motion v of the loop, at every tenth time."""
    table, picture = tmp_path / "drive.csv", tmp_path / "drive.png"
    law = "A=cycloidal(1.0, move=0.5)"
    asked = ["drive", FOUR_BAR, "--law", law, "--samples", "101", "--csv", str(table), "--png", str(picture)]
    assert command.main(asked) == 0
    assert "A.angle" in capsys.readouterr().out and picture.stat().st_size > 10_000
    with table.open() as stream:
        rows = list(csv.DictReader(stream))
    t, crank, torque = (np.array([float(row[name]) for row in rows]) for name in ("t", "A.angle", "A.angle torque"))
    np.testing.assert_allclose(crank, t / 0.5 - np.sin(4 * np.pi * t) / (2 * np.pi), atol=1e-9)
    model = mujoco.MjModel.from_xml_path(FOUR_BAR)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EQUALITY | mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    for k in range(0, 101, 10):
        step = 1e-3 * np.arange(-4, 5)  # polynomials through nine positions: derivatives to rounding
        path = [np.polyfit(step, angle, 8) for angle in angles_of(crank[k] + step) - angles_of(np.zeros(1))]
        q, slope, bend = ([poly[8 - n] * (1, 1, 2)[n] for poly in path] for n in range(3))
        rate, change = 2 - 2 * np.cos(4 * np.pi * t[k]), 8 * np.pi * np.sin(4 * np.pi * t[k])
        data.qpos, data.qvel = q, np.array(slope) * rate
        data.qacc = np.array(slope) * change + np.array(bend) * rate**2
        mujoco.mj_inverse(model, data)
        assert torque[k] == pytest.approx(slope @ data.qfrc_inverse, abs=1e-8 * np.abs(torque).max())


def test_laws_that_cannot_be_read_are_told(capsys):
    for law, words in (
        ("A=jump(1)", "unknown kind 'jump'. There are trapezoid"),
        ("A=cycloidal(1.0)", "does not fit"),
        ("A 1.0", "cannot be read. It has the form NAME=LAW"),
        ("A=constant(1, 2)", "does not fit: too many positional arguments. Figures of constant: value"),
        ("crank=constant(0)", "There are A.angle, B.angle, C.angle"),
        ("crank=constant(0)", "Give the law to a joint, not to an actuator"),
        ("A=constant(0)", "no law has an end"),
        ("A=harmonic(1, 0)", "no law has an end"),
    ):
        assert command.main(["drive", FOUR_BAR, "--law", law]) == 2
        assert words in capsys.readouterr().err


def test_two_laws_of_one_coordinate_are_refused(capsys):
    laws = ["--law", "A=cycloidal(1, 2)", "--law", "A.angle=harmonic(1, 2)"]
    assert command.main(["drive", FOUR_BAR, *laws]) == 2
    assert "Arguments `--law` and `--table` give 'A.angle' two laws. Leave one" in capsys.readouterr().err


@pytest.mark.slow
def test_a_table_of_a_motion_is_followed(tmp_path):
    """That of a run, with its rates and accelerations, and one of angles alone, which say them to a few digits."""
    first, second, table = (tmp_path / name for name in ("first.csv", "second.csv", "table.csv"))
    asked = ["drive", FOUR_BAR, "--samples", "51"]
    assert command.main([*asked, "--law", "A=cycloidal(1.0, move=0.5)", "--csv", str(first)]) == 0
    rows = list(csv.DictReader(first.open()))
    table.write_text("time;A.angle\n" + "".join(f"{row['t']};{row['A.angle']}\n".replace(".", ",") for row in rows))
    table.write_text(table.read_text().replace("A,angle", "A.angle"))
    for given, digits in ((first, 1e-9), (table, 3e-3)):
        assert command.main([*asked, "--table", str(given), "--csv", str(second)]) == 0
        torque, again = ([float(row["A.angle torque"]) for row in csv.DictReader(x.open())] for x in (first, second))
        np.testing.assert_allclose(again, torque, atol=digits * np.max(np.abs(torque)))


def test_tables_that_are_no_motion_are_told(tmp_path, capsys):
    table = tmp_path / "table.csv"
    for text, words in (
        ("t,crank\n0,1\n1,2\n", "has no coordinate. Call a column as one is: A.angle"),
        ("s,A.angle\n0,1\n1,2\n", "has no column `t` of times"),
        ("t,A.angle\n0,1\n1,2\n", "of 'A.angle' in '.*'. Arguments `times` and `values` must hold three samples"),
        ("t,A.angle,A.angle''\n0,1,0\n1,2,0\n2,3,0\n", "`rates` must be given"),
        ("t,A.angle\n0,x\n", "has 'x' in line 2, which is no number"),
    ):
        table.write_text(text)
        assert command.main(["drive", FOUR_BAR, "--table", str(table)]) == 2
        assert re.search(words, capsys.readouterr().err)


@pytest.mark.slow
def test_joints_that_a_motion_leads_beyond_their_limits_are_told(tmp_path, capsys):
    """A hinge that the file counts from 0.2 rad on, to 0.5: a law of 20, meant as degrees, leads it to 20.2."""
    hinge = '<joint name="A" axis="0 1 0" ref="0.2" range="0 0.5"/><geom size="0.1" pos="0.3 0 0"/>'
    file = tmp_path / "arm.xml"
    file.write_text(f'<mujoco><compiler angle="radian"/><worldbody><body>{hinge}</body></worldbody></mujoco>')
    for stroke, told in ((0.3, False), (20, True)):
        assert command.main(["drive", str(file), "--law", f"A=cycloidal({stroke}, move=1)"]) == 0
        printed = " ".join(capsys.readouterr().out.split())
        said = "Beyond limits of the file: A goes from 0.2 to 20.2, limits are 0 and 0.5 (rad or m)."
        assert (said in printed) is told and ("Beyond" in printed) is told
