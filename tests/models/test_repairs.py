"""What the audit proposes: verdicts and repairs that hold in MuJoCo, wherever the model moves."""

import contextlib
import dataclasses
import difflib
import io
import json

import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._models import _fix
from redundax._models._audit_page import audit_page
from redundax._models._examine import _idle, examine
from redundax._models._fix import fix
from redundax._models._formats import describe
from redundax._models._repair_page import mended
from redundax._models._stress import Stress
from redundax._models._tree import Tree
from redundax._models._urdf import closures_of

mujoco = pytest.importorskip("mujoco")

FOUR_BAR = """<mujoco>
  <default><joint axis="0 1 0"/><geom type="capsule"
      size="0.01"/></default>
  <worldbody>
    <body name="crank"><joint name="A"/><geom fromto="0 0 0 0 0 0.1"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0">
          <joint name="C"/><!-- a pin -->
          <geom fromto="0 0 0 0 0 -0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><connect name="D" body1="rocker" body2="world" anchor="0 0 -0.2"/></equality>
</mujoco>
"""
DOOR = """<mujoco><worldbody>
  <body name="door" pos="0 0 1"><joint name="low" axis="0 0 1" pos="0 0 -0.7"/>
    <geom type="box" pos="0.3 0 0" size="0.3 0.01 0.8" mass="12"/></body>
  <body name="leaf" pos="0 0 1.7"><joint name="top" axis="0 0 1"/>
    <geom type="box" pos="0.02 0 0" size="0.02 0.003 0.03" mass="0.05" contype="0" conaffinity="0"/></body>
  </worldbody>
  <equality>
    <connect name="pivot" body1="door" anchor="0 0 -1"/>
    <weld name="screws" body1="leaf" body2="door"/>
  </equality></mujoco>"""
IN_LINE = FOUR_BAR.replace('"0 0 0.1"', '"0.1 0 0"').replace('"0 0 -0.2"', '"0.2 0 0"')


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("repairs")


def audited(folder, name, text):
    (folder / name).write_text(text)
    model = rx.load_model(folder / name)
    return model, examine(model, 2)


@pytest.fixture(scope="module")
def four_bar(folder):
    return audited(folder, "bar.xml", FOUR_BAR)


@pytest.fixture(scope="module")
def door(folder):
    return audited(folder, "door.xml", DOOR)


def run(*arguments):
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = command.main(["audit", *map(str, arguments)])
    return status, " ".join(out.getvalue().split()), " ".join(error.getvalue().split())


def least_kept(file, turns):
    """Of MuJoCo's own Jacobian of the loops: the third singular value, at positions of the crank."""
    tree = Tree(describe(file, closures_of(file, None)))
    model = tree.description.origin.model
    model.opt.jacobian, data, found = mujoco.mjtJacobian.mjJAC_DENSE, mujoco.MjData(model), []
    place, positions = int(model.joint("A").qposadr[0]), tree.closed()[0]
    for turn in turns:
        positions[place] = turn
        positions = tree.descend(positions)[0]
        data.qpos[:] = positions
        mujoco.mj_forward(model, data)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        jacobian = data.efc_J.reshape(-1, model.nv)[: rows.size][rows]
        found.append(np.linalg.svd(jacobian, compute_uv=False)[2])
    return np.array(found)


def test_what_is_proposed_stays_clear_of_singular_positions_in_a_whole_turn(four_bar, folder):
    """B.bend_2 is the farthest from moving where the file stands, and moves freely four times in a turn."""
    model, found = four_bar
    best = max(found.groups[0].releases, key=lambda one: one.determinant).directions[0][1]
    assert list(best) == ["B.bend_2"]
    (repair,) = found.repairs
    turns, kept = np.linspace(0, 2 * np.pi, 400), {}
    for rows in (*(choice.rows for choice in repair.choices), ("B.bend_2",)):
        made = fix(model, found, folder / "copy.xml", rows)
        assert (made.redundancy, made.freedom) == (0, 1)
        kept[rows] = least_kept(folder / "copy.xml", turns)
        clear = kept[rows].min() > 0.1 * kept[rows].max()
        assert clear == (rows != ("B.bend_2",)) == ("not usable over the full motion" not in str(made))
    assert len(kept) == 3
    best, least = min(zip(kept[("B.bend_2",)], turns, strict=True))
    assert best < 0.02 * kept[("B.bend_2",)].max() and 0 < least < 2 * np.pi


def test_self_stress_elsewhere_is_that_of_the_whole_mechanism(four_bar, door):
    for model, found in (four_bar, door):
        positions = [model.positions, *(at for at, _ in model.beside(2))]
        for at, look in zip(positions, (found.here, *found.others), strict=True):
            basis = Stress(model.tree, found.rows, look.scales).basis(at, look.redundancy)
            np.testing.assert_allclose(basis @ basis.T, look.stress, atol=1e-10)


def test_directions_are_those_of_the_file(four_bar):
    """An axis; the force of a point along its body's y; and moments, square to the axis."""
    _, found = four_bar
    for row in ("A.axial", "B.axial", "C.axial", "D.radial_2"):
        np.testing.assert_allclose(found.directions[row], (0, 1, 0), atol=1e-12)
    for joint in "ABC":
        first, second = (found.directions[f"{joint}.bend_{k}"] for k in (1, 2))
        np.testing.assert_allclose([first @ second, first[1], second[1]], 0, atol=1e-12)
    assert found.to_dict()["directions"]["A.axial"] == pytest.approx([0, 1, 0])


def test_the_text_tells_what_is_known_what_to_write_and_what_cannot_be_said(four_bar, folder):
    told = run(folder / "bar.xml")[1]
    assert "Known: loads in the plane across (0 1 0), in world axes." in told
    assert "how a sideways load, along (0 1 0), splits between A, B, C and D." in told
    assert "C slides along its axis (0 1 0) <- --fix takes it" in told
    assert '<joint name="C axial" type="slide" axis="0 1 0"/> before <joint name="C"/>' in told
    assert "First what frees loops, then joints that carry least; after 'or' what stays" in told
    assert "D.radial_2" not in told and "Directions of D: radial_2 (0 1 0)" in told
    everything = run(folder / "bar.xml", "--all")[1]
    assert "D.radial_2 0.29, 0.28 (not possible in MJCF)" in everything
    assert "0.00 not over the full motion" in everything


def test_a_copy_differs_by_the_lines_that_it_says(four_bar, folder):
    model, found = four_bar
    made = fix(model, found, folder / "copy.xml")
    before, after = FOUR_BAR.splitlines(keepends=True), (folder / "copy.xml").read_text().splitlines(keepends=True)
    changed = [line for line in difflib.ndiff(before, after) if not line.startswith("  ")]
    assert changed == ['+           <joint name="C axial" type="slide" axis="0 1 0"/>\n']
    assert '+          <joint name="C axial"' in str(made)
    assert "a machine that really has this play. If yours has none, its joint loads stay unknown" in str(made)
    assert "there C now gives way as far as D does" in str(made)


def test_rows_that_are_not_there_are_told_with_those_of_the_joint(four_bar, folder):
    model, found = four_bar
    for row, told in (("C.tilt", "C has radial_1, radial_2, axial, bend_1, bend_2."), ("E", "are A, B, C, D.")):
        with pytest.raises(rx.RedundaxError, match=f"no row of the model.*{told}"):
            fix(model, found, folder / "copy.xml", [row])


def test_a_row_that_was_named_and_stays_is_told(four_bar, folder, monkeypatch):
    """Two slides along parallel axes: what is between would slide by itself."""
    model, found = four_bar
    made = fix(model, found, folder / "copy.xml", ["A.axial", "B.axial"])
    assert made.freed == ("B slides along its axis (0 1 0)",) and (made.redundancy, made.freedom) == (0, 1)
    assert "A.axial is not freed: it would add a motion." in made.notes
    made = fix(model, found, folder / "copy.xml", ["A.axial", "B.axial", "C.axial"])
    assert "A.axial and B.axial are not freed: they would add a motion." in made.notes
    monkeypatch.setattr(_fix, "_figures", lambda *_: (1, 2))
    made = fix(model, found, folder / "copy.xml")
    assert made.notes[0].startswith("redundancy 0 and freedom 1 were expected, so look at the copy")


def test_positions_are_counted_and_rows_that_are_many_are_left_to_the_data(four_bar, door):
    for count, told in ((1, "Same at 1 other position and"), (2, "Same at 2 other positions and")):
        found = dataclasses.replace(four_bar[1], others=four_bar[1].others[:count])
        assert told in audit_page(found, None, lines={}, language="MJCF")
    found = door[1]
    assert len(found.repairs[0].choices[1].rows) > 4
    told = " ".join(" ".join(mended(found, {}, "MJCF")).split())
    assert told.endswith("<- its rows for --release are in --json")


def test_a_mended_door_stays_as_rigid_as_it_was(door, folder):
    """Hinges on one axis are coupled in place of a weld, which is soft, and a point that repeats them is left out: the
    heavy leaf hangs on its own hinge."""
    model, found = door
    made = fix(model, found, folder / "mended.xml")
    assert (found.figures, made.redundancy, made.freedom) == ((8, 1), 0, 1)
    assert [line[:15] for line in made.lines] == ["-    <connect n", "-    <weld name", "+    <joint nam"]
    assert made.freed[0] == "pivot is deleted: nothing passes through it then"
    poses = []
    for name in ("door.xml", "mended.xml"):
        theirs = mujoco.MjModel.from_xml_path(str(folder / name))
        data = mujoco.MjData(theirs)
        data.xfrc_applied[theirs.body("door").id, :3] = 0, 3, -50
        for _ in range(500):
            mujoco.mj_step(theirs, data)
        np.testing.assert_allclose(data.body("door").xmat[-3:], (0, 0, 1), atol=1e-9)
        poses.append(np.concatenate([data.xpos.ravel(), data.xmat.ravel()]))
    np.testing.assert_allclose(*poses, atol=1e-4)


def test_a_dead_point_that_cannot_be_left_is_told_and_not_mended(folder):
    (folder / "line.xml").write_text(IN_LINE)
    status, told, error = run(folder / "line.xml", "--fix", folder / "bent.xml")
    assert status == 4 and not (folder / "bent.xml").exists()
    assert "UNDECIDED: in this file the mechanism is at a dead point" in told
    assert "To mend it" not in told and "Joint loads" not in told and "Moved" not in told
    assert "no copy is written: the model is at a dead point" in error
    found = json.loads(run(folder / "line.xml", "--json")[1])
    assert found["stuck"] and "repairs" not in found


def test_a_model_without_loops_or_of_which_some_are_left_out_is_told_at_once(folder):
    arm = '<mujoco><worldbody><body><joint name="A"/><geom size="0.1"/></body></worldbody>{}</mujoco>'
    tied = (
        '<tendon><fixed name="t"><joint joint="A" coef="1"/></fixed><fixed name="u"><joint joint="A" coef="1"/></fixed>'
        '</tendon><equality><tendon tendon1="t" tendon2="u" polycoef="0 0 1 0 0"/>{}</equality>'
    )
    for more, first in (
        ("", "NOT REDUNDANT: no loops"),
        (tied.format(""), "UNDECIDED: constraint 'tendon t ~ u' is not taken over. Without it:"),
        (
            tied.format('<tendon name="v" tendon1="u" tendon2="t" polycoef="0 0 1 0 0"/>'),
            "are not taken over. Without them:",
        ),
    ):
        (folder / "arm.xml").write_text(arm.format(more))
        assert first in run(folder / "arm.xml")[1]


def test_bodies_that_move_while_drives_rest_are_told(folder):
    """A pendulum on a driven one may swing, and one beside it."""
    joint = '<body name="{}" pos="{} 0 0"><joint name="{}" axis="0 1 0"/><geom size="0.1" pos="0 0 -1"/>{}</body>'
    bodies = joint.format("a", 0, "A", joint.format("b", 1, "B", "")) + joint.format("c", 5, "C", "")
    drive = '<actuator><motor joint="A"/></actuator>'
    (folder / "swings.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody>{drive}</mujoco>")
    model = rx.load_model(folder / "swings.xml")
    assert _idle(model, model.positions, 3) == ("b", "c")
    sum_of_turns = '<tendon><fixed name="t"><joint joint="A" coef="1"/><joint joint="B" coef="1"/></fixed></tendon>'
    drive = f'{sum_of_turns}<actuator><motor tendon="t"/></actuator>'
    (folder / "swings.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody>{drive}</mujoco>")
    model = rx.load_model(folder / "swings.xml")
    assert _idle(model, model.positions, 3) == ()  # all can move, which needs no list


def test_a_folder_is_no_model(folder):
    assert run(folder) == (2, "", f"redundax: '{folder}' is a folder. Name a file in it, or FILE.py:NAME.")
