"""Copies of models with releases: by MuJoCo's own Jacobian of their loops, less is redundant and nothing more moves."""

import contextlib
import dataclasses
import io

import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._command._copy import check_copy
from redundax._command._file import FileError
from redundax._models._description import WITHOUT
from redundax._models._edit_mjcf import mjcf_change, mjcf_moves
from redundax._models._examine import examine
from redundax._models._fix import fix
from redundax._models._formats import describe
from redundax._models._tree import Tree
from redundax._models._urdf import closures_of

mujoco = pytest.importorskip("mujoco")
yaml = pytest.importorskip("yaml")

FOUR_BAR = """<mujoco>
  <!-- kept -->
  <compiler angle="radian"/>
  <default><joint axis="0 1 0" damping="0.1" limited="true" range="-3 3"/><geom type="capsule" size="0.01"/></default>
  <asset><mesh name="nowhere" file="nowhere.stl"/></asset>
  <worldbody>
    <body name="crank" euler="0 0.3 0"><joint name="A"/><geom fromto="0 0 0 0 0 0.1"/><geom type="mesh" mesh="nowhere"/>
      <body name="coupler" pos="0 0 0.1" euler="0 -0.3 0"><joint/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.2"/></body>
      </body>
    </body>
    <body name="glass" pos="0 3 0"><joint name="W" type="ball" limited="false"/><geom size="0.1" type="sphere"/></body>
  </worldbody>
  <equality>
    <connect body1="rocker" body2="world" anchor="0 0 -0.2"/>
    <weld name="hung" body1="glass" body2="world" anchor="0 3 0"/>
  </equality>
</mujoco>
"""
FINGERS = """<mujoco><worldbody>
  <body name="a"><joint name="A" type="slide" axis="1 0 0"/><geom size="0.1"/>
    <body name="b" pos="0 1 0"><joint name="B" type="slide" axis="0 0 1"/><geom size="0.1"/><site name="tip"/></body>
  </body><site name="rail" pos="0 1 0"/>
  <body name="c" pos="0 2 0"><joint name="C" axis="0 0 1"/><geom size="0.1"/></body>
  </worldbody><equality><joint name="tie" joint1="C" joint2="A"/><joint joint1="C" joint2="A" polycoef="0 1 0 0 0"/>
  </equality></mujoco>"""
LINK = (
    '<link name="{}"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
HINGE = '<joint name="{0}" type="continuous"><parent link="frame"/><child link="{1}"/><axis xyz="0 0 1"/></joint>'
LEAVES = ("door", "leaf", "wing")
DOOR = "".join(['<robot name="door">', LINK.format("frame"), *map(LINK.format, LEAVES)])
DOOR += "".join(HINGE.format(f"at {leaf}", leaf) for leaf in LEAVES) + "</robot>"
SCREWS = "closed_loop: [[door, leaf], [door, wing]]\ntype: [{0}, {0}]\n"


@pytest.fixture
def write(tmp_path):
    def written(name, text):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


def figures(file):
    """Redundancy and freedom by the Jacobian that MuJoCo makes of all that is equal, at a closed position."""
    described = describe(file, closures_of(file, None))
    positions, left = Tree(described).closed()
    model = described.origin.model
    assert left < 1e-12
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:] = positions
    mujoco.mj_forward(model, data)
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    jacobian = data.efc_J.reshape(-1, model.nv)[: rows.size][rows]
    rank = np.linalg.matrix_rank(jacobian, tol=1e-8)
    return len(jacobian) - rank, model.nv - rank


def run(*arguments):
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = command.main(["audit", *map(str, arguments)])
    return status, out.getvalue(), error.getvalue()


@pytest.fixture(scope="module")
def four_bar(tmp_path_factory):
    file = tmp_path_factory.mktemp("four bar") / "bar.xml"
    file.write_text(FOUR_BAR)
    model = rx.load_model(file)
    return model, examine(model, 1)


def test_the_best_releases_leave_nothing_redundant(four_bar, tmp_path):
    model, found = four_bar
    assert found.figures == figures(model.path) == (1 + 3, 1)  # a four-bar in its plane; a ball held twice
    made = fix(model, found, tmp_path / "copy.xml")
    assert figures(tmp_path / "copy.xml") == (made.redundancy, made.freedom) == (0, 1)
    text = (tmp_path / "copy.xml").read_text()
    assert "<!-- kept -->" in text and 'file="nowhere.stl"' in text


def test_what_is_undecided_is_not_mended(four_bar, tmp_path):
    """Positions that disagree prove no release; one that is proved of what was read holds with what was not, too."""
    model, found = four_bar
    other = dataclasses.replace(found.here, rank=found.here.rank - 1, redundancy=5, freedom=2)
    told = str(fix(model, dataclasses.replace(found, others=(other,)), tmp_path / "none.xml"))
    assert told.startswith("no copy is written: the model is undecided, as its positions do not agree")
    assert not (tmp_path / "none.xml").exists()
    model = dataclasses.replace(model, notes=(f"plugin 'p' is left out: it joins models{WITHOUT}",))
    told = str(fix(model, found, tmp_path / "proved.xml"))
    assert "These figures are without plugin 'p'. What is freed repeats others with it too" in told
    assert figures(tmp_path / "proved.xml") == (0, 1)


@pytest.mark.parametrize("row", ["A.axial", "A.bend_2", "hinge of coupler.axial", "C.bend_1", "C.axial"])
def test_each_row_that_is_redundant_can_be_freed_alone(four_bar, tmp_path, row):
    model, found = four_bar
    group = next(each for each in found.groups if row in each.rows)
    assert group.redundancy == 1
    made = fix(model, found, tmp_path / "copy.xml", [row])
    assert len(made.freed) == 1
    assert figures(tmp_path / "copy.xml") == (made.redundancy, made.freedom) == (3, 1)


def test_what_would_move_is_not_freed_and_what_has_no_words_is_told(four_bar, tmp_path):
    model, found = four_bar
    made = fix(model, found, tmp_path / "copy.xml", ["A.radial_1"])
    assert (made.files, made.redundancy) == ((), 4)
    assert "no copy is written" in str(made)
    assert not (tmp_path / "copy.xml").exists()
    with pytest.raises(rx.RedundaxError, match="in MJCF: it cannot free single directions"):
        fix(model, found, tmp_path / "copy.xml", ["connect rocker ~ world.radial_2"])
    with pytest.raises(rx.RedundaxError, match=r"names 'A\.twist', which is no row"):
        fix(model, found, tmp_path / "copy.xml", ["A.twist"])


FRAMED = """<mujoco>
  <compiler angle="radian"/><default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>
  <worldbody>
    <body name="crank">
      <frame name="outer" euler="0 0.3 0" pos="0 0.1 0"><geom fromto="0 0 0 0 0 0.1"/>
        <frame euler="0 0.4 0"><geom size="0.02" type="sphere"/><joint name="A"/><geom fromto="0 0 0 0.1 0 0"/></frame>
      </frame>
      <body name="coupler" pos="0 0 0.1"><frame pos="0 1 0"><joint/></frame><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.2"/></body>
      </body>
    </body>
  </worldbody>
  <equality><connect body1="rocker" body2="world" anchor="0 0 -0.2"/></equality>
  <keyframe><key qpos="0 0 0"/><key name="up" qpos="0 0 0"/></keyframe>
</mujoco>"""


def test_joints_in_frames_are_freed_and_keyframes_left_out(write, tmp_path):
    """The joint more stands on the body: a frame would turn its axis. Keyframes count the joints that were."""
    model = rx.load_model(write("framed.xml", FRAMED))
    found, before = examine(model, 1), mujoco.MjModel.from_xml_path(str(tmp_path / "framed.xml"))
    for row, place in (("A.bend_1", 0), ("hinge of coupler.axial", 1)):
        made = fix(model, found, tmp_path / "copy.xml", [row])
        assert figures(tmp_path / "copy.xml") == (made.redundancy, made.freedom) == (0, 1)
        assert "without 2 keyframes of the file" in str(made)
        copy = mujoco.MjModel.from_xml_path(str(tmp_path / "copy.xml"))
        assert (copy.nkey, before.nkey, copy.ngeom) == (0, 2, before.ngeom)
        assert copy.joint(place).name == row.replace(".", " ")
        np.testing.assert_allclose(copy.body_inertia, before.body_inertia, atol=1e-12)
        np.testing.assert_allclose(np.delete(copy.jnt_axis, place, axis=0), before.jnt_axis, atol=1e-12)


def test_keyframes_of_included_files_are_told(write, tmp_path):
    before, _, rest = FRAMED.partition("<keyframe>")
    keys, _, after = rest.partition("</keyframe>")
    write("keys.xml", f"<mujoco><keyframe>{keys}</keyframe></mujoco>")
    model = rx.load_model(write("framed.xml", f'{before}<include file="keys.xml"/>{after}'))
    made = mjcf_change(model, mjcf_moves(model)[:1], tmp_path / "copy.xml").write()
    assert [*made.files] == [tmp_path / "copy.xml"]
    assert made.note == "Take 2 keyframes out of the included files: they count fewer joints."


UNNAMED = """<mujoco>{}<worldbody>
  <body><joint/><geom size="0.1"/><frame><body><joint/><joint axis="1 0 0"/><geom size="0.1"/></body></frame>
    <body><joint/><geom size="0.1"/></body></body>
  <body name="last"><body><joint/><geom size="0.1"/></body><geom size="0.1"/></body></worldbody></mujoco>"""


def test_joints_of_bodies_without_a_name_are_found_by_their_place(write, tmp_path):
    """MuJoCo reads the copy: the joint more is in the body that is meant. What is included hides the place."""
    model = rx.load_model(write("unnamed.xml", UNNAMED.format("")))
    edits = [edit for edit in mjcf_moves(model) if edit.rows[0].endswith(".axial")]
    assert len(edits) == 5
    for edit, (body, before) in zip(edits, ((1, 0), (2, 1), (2, 2), (3, 3), (5, 4)), strict=True):
        mjcf_change(model, [edit], tmp_path / "copy.xml").write()
        copy = mujoco.MjModel.from_xml_path(str(tmp_path / "copy.xml"))
        assert (int(copy.joint(before).bodyid[0]), copy.joint(before).name) == (body, edit.rows[0].replace(".", " "))
        assert mjcf_change(model, [edit], model.path).lines[0].endswith(f" in body {body}")
    write("more.xml", "<mujoco><worldbody><body><joint/><geom size='0.1'/></body></worldbody></mujoco>")
    model = rx.load_model(write("unnamed.xml", UNNAMED.format('<include file="more.xml"/>')))
    for edit in mjcf_moves(model):
        with pytest.raises(rx.RedundaxError, match=r"is not in '.*' itself"):
            mjcf_change(model, [edit], tmp_path / "copy.xml").write()


def test_what_is_freed_has_no_spring_of_the_defaults(write, tmp_path):
    more = '<default><joint axis="0 1 0" springdamper="0.1 1" armature="1"/></default>'
    model = rx.load_model(write("sprung.xml", UNNAMED.format(more)))
    mjcf_change(model, mjcf_moves(model)[:1], tmp_path / "copy.xml").write()
    copy = mujoco.MjModel.from_xml_path(str(tmp_path / "copy.xml"))
    for values in (copy.jnt_stiffness, copy.dof_damping, copy.dof_armature):
        assert values[0] == 0 and (values[1:] > 0).all()


@pytest.mark.slow
def test_slides_ties_and_closures_by_bodies_are_freed(write, tmp_path):
    file = write("fingers.xml", FINGERS)
    model = rx.load_model(file)
    made = fix(model, examine(model, 1), tmp_path / "copy.xml")
    assert (figures(file), figures(tmp_path / "copy.xml")) == ((1, 2), (0, 2))
    assert made.freed in [(f"{name} is deleted: nothing passes through it then",) for name in ("couple C ~ A", "tie")]


def test_loops_of_a_urdf_become_freer(write, tmp_path):
    """All joints are at one point, where 15 forces hold 9 velocities: 6 of 10 stay, as only moments can be freed."""
    write("door.yaml", SCREWS.format("6d"))
    file = write("door.urdf", DOOR)
    status, out, error = run(file, "--fix", tmp_path / "copy.urdf")
    assert (status, figures(file)) == (3, (10, 1))
    assert "redundant by 10 -> 6" in " ".join(out.split()) and "which URDF cannot express" in " ".join(out.split())
    assert figures(tmp_path / "copy.urdf") == (6, 1)
    assert "The copy has redundancy 6, freedom 1." in error and "URDF cannot say" in error
    loops = yaml.safe_load((tmp_path / "copy.yaml").read_text())
    assert "3d" in loops["type"] or "SPHERICAL" in loops["joint_type"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["bar.xml", "--fix", "copy.urdf"], "`--fix` must end in .xml"),
        (["bar.xml", "--fix", "bar.xml"], "another file than the model"),
        (["bar.xml", "--release", "A.axial"], "Give --fix FILE too"),
        (["bar.py:build", "--fix", "copy.py"], "`--fix` copies .xml"),
        (["bar.xml", "--fix", "nowhere/copy.xml"], "cannot be written"),
    ],
)
def test_a_copy_that_cannot_be_is_refused_in_a_line(write, monkeypatch, tmp_path, words, told):
    write("bar.xml", FOUR_BAR)
    monkeypatch.chdir(tmp_path)
    status, _, error = run(*words)
    assert status == 2
    assert told in error and len(error.splitlines()) == 1


def test_a_copy_never_costs_the_loops_of_the_model(write, monkeypatch, tmp_path):
    """They are written beside the copy, under a name that nobody typed."""
    write("door.urdf", DOOR)
    loops = write("loops.yaml", SCREWS.format("6d"))
    monkeypatch.chdir(tmp_path)
    for words, told in (
        (["--closures", "loops.yaml", "--fix", "loops.urdf"], "holds those of the model"),
        (["--closures", "./loops.yaml", "--fix", tmp_path / "loops.urdf"], "holds those of the model"),
        (["--fix", "loops.urdf"], "is there without 'loops.urdf'"),
    ):
        status, _, error = run("door.urdf", *words)
        assert status == 2 and told in error and len(error.splitlines()) == 1
        assert loops.read_text() == SCREWS.format("6d") and not (tmp_path / "loops.urdf").exists()
    (tmp_path / "copy.yaml").mkdir()
    write("copy.urdf", "")
    status, _, error = run("door.urdf", "--fix", "copy.urdf")
    assert status == 2 and "'copy.yaml' cannot be written" in error


NAMING = """<mujoco><compiler {compiler}/><asset>{asset}</asset><worldbody>
  <body><joint/><geom size="0.1"/></body></worldbody>{more}</mujoco>"""


@pytest.mark.parametrize(
    ("compiler", "asset", "more", "path"),
    [
        ("", '<mesh name="m" file="m.stl"/>', "", "m.stl"),
        ('meshdir="parts"', '<mesh name="m" file="m.stl"/>', "", "parts/m.stl"),
        ('assetdir="parts"', '<texture name="t" type="2d" file="t.png"/>', "", "parts/t.png"),
        ('meshdir="/parts"', '<mesh name="m" file="m.stl"/>', '<include file="more.xml"/>', "more.xml"),
        ('meshdir="/parts"', '<mesh name="m" file="m.stl"/>', "", None),
    ],
)
def test_a_copy_elsewhere_must_find_what_the_model_names(write, tmp_path, compiler, asset, more, path):
    file = write("model.xml", NAMING.format(compiler=compiler, asset=asset, more=more))
    (tmp_path / "away").mkdir()
    check_copy(str(file), None, tmp_path / "away" / "copy.xml")  # what is missing is missing there, too
    if path is not None:
        (tmp_path / path).parent.mkdir(exist_ok=True)
        write(path, "")
    if path is None:
        check_copy(str(file), None, tmp_path / "away" / "copy.xml")
    else:
        with pytest.raises(FileError, match=f"names '{path}' from there"):
            check_copy(str(file), None, tmp_path / "away" / "copy.xml")
    check_copy(str(file), None, tmp_path / "copy.xml")
    assert not list(tmp_path.rglob("copy.xml"))


def test_a_copy_is_not_written_over_what_the_model_includes(write, tmp_path):
    file = write("model.xml", NAMING.format(compiler="", asset="", more='<include file="more.xml"/>'))
    write("more.xml", "<mujoco/>")
    with pytest.raises(FileError, match="which the model names"):
        check_copy(str(file), None, tmp_path / "more.xml")
