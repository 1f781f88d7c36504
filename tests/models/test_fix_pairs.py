"""Copies of assemblies with joints of other kinds: a parallelogram of four hinges is three redundant, one freedom

With a ball in a sleeve for one hinge, or a ball and a cross for two, nothing is redundant: 5 + 5 + 5 + 2 rows, or
3 + 4 + 5 + 5, hold 17 of 18 velocities of three bodies. All else of a file stays as it is written.
"""

import asmt
import numpy as np
import pytest
from loops import figures
from test_asmt import crank, four_bar
from test_sdf import JOINT, LINK, Y, model, parallelogram
from usd import parallelogram as of_usd

import redundax as rx
from redundax import __main__ as command
from redundax._command._copy import check_copy
from redundax._command._file import FileError
from redundax._models._edit_asmt import asmt_change, asmt_moves
from redundax._models._edit_sdf import sdf_change, sdf_moves
from redundax._models._edit_usd import usd_change, usd_moves
from redundax._models._examine import examine
from redundax._models._fix import fix


@pytest.fixture
def write(tmp_path):
    def written(text, name):
        (tmp_path / name).write_bytes(text.encode())
        return tmp_path / name

    return written


def change(moves, rows):
    """The one that frees exactly these rows."""
    (found,) = (move for move in moves if move.rows == tuple(rows.split()))
    return found


def test_the_copy_of_an_assembly_has_another_word_and_the_lines_of_the_file(write, tmp_path):
    text = four_bar().replace("\n", "\r\n") + "TimeSeries\r\nNumber\tInput\t1\t\r\nTime\tInput\t0.0\t0.0\t\r\n"
    loaded, copy = rx.load_model(write(text, "bar.asmt")), tmp_path / "copy.asmt"
    found = examine(loaded, 1)
    assert found.figures == (3, 1) == figures(loaded.path)[:2]
    made = fix(loaded, found, copy)
    assert figures(copy)[:2] == (made.redundancy, made.freedom) == (0, 1)
    before, last = "\t\t\tRevoluteJoint\r\n", text.rindex("\t\t\tRevoluteJoint")
    now = text[:last] + text[last:].replace(before, "\t\t\tPointInLineJoint\r\n")
    assert copy.read_bytes().decode() == now[: now.index("TimeSeries")]
    assert made.lines == ("-\t\t\tRevoluteJoint", "+\t\t\tPointInLineJoint") and "without the run" in str(made)
    some = fix(loaded, found, copy, ["q.axial", "s.bend_1", "s.bend_2"])
    assert figures(copy)[:2] == (some.redundancy, some.freedom) == (0, 1)
    assert "CylindricalJoint" in copy.read_text() and "SphericalJoint" in copy.read_text()
    with pytest.raises(rx.RedundaxError, match="in ASMT: it has no joint that frees a single tilt"):
        fix(loaded, found, copy, ["s.bend_1"])


@pytest.mark.parametrize(
    ("kind", "rows", "left"),
    [
        ("FixedJoint", "s.bend_1 s.bend_2 s.twist", (1, 1)),
        ("FixedJoint", "s.radial_1 s.radial_2 s.twist", (3, 3)),
        ("FixedJoint", "s.radial_1 s.radial_2 s.bend_1 s.bend_2 s.twist", (1, 3)),
        ("FixedJoint", "s.twist", (3, 1)),
        ("PlanarJoint", "s.bend_1 s.bend_2", (1, 3)),
        ("CylindricalJoint", "s.bend_1 s.bend_2", (0, 1)),
        ("RevoluteJoint", "s.axial", (2, 1)),
    ],
)
def test_words_of_an_assembly_and_the_number_that_some_need(write, tmp_path, kind, rows, left):
    """A plate across z has the row that hinges hold already, and leaves two freedoms more."""
    text = four_bar(kind, **({"offset": 0.0} if kind == "PlanarJoint" else {}))
    loaded, copy = rx.load_model(write(text, "bar.asmt")), tmp_path / "copy.asmt"
    edit = change(asmt_moves(loaded), rows)
    asmt_change(loaded, [edit], copy).write()
    assert figures(copy)[:2] == left
    assert copy.read_text().count("offset") == int("radial_1" in rows or kind == "PlanarJoint")
    line = text[: text.rindex(kind)].count("\n") + 1
    assert asmt_change(loaded, [edit], loaded.path).lines[0].endswith(f" in place of {kind} in line {line}")


def test_a_joint_that_a_motion_or_a_limit_names_keeps_its_coordinate(write, tmp_path):
    door = crank().replace(
        "\t\tMotions", "\n".join([*asmt.joint("RevoluteJoint", "top", "base", "crank/eye"), "\t\tMotions"])
    )
    loaded, copy = rx.load_model(write(door, "door.asmt")), tmp_path / "copy.asmt"
    told = {(move.name, move.how, move.kind) for move in asmt_moves(loaded)}
    assert {each for each in told if each[0] == "pin"} == {("pin", "become", "cylindrical joint")}
    assert ("top", "delete", "") in told and ("top", "become", "ball") in told
    edit = next(move for move in asmt_moves(loaded) if move.how == "delete")
    assert len(edit.rows) == 5
    asmt_change(loaded, [edit], copy).write()
    assert copy.read_text() == crank() and figures(copy)[:2] == (0, 1)
    with pytest.raises(StopIteration):
        next(move for move in asmt_moves(rx.load_model(copy)) if move.how == "delete")


def test_a_copy_of_sdf_has_a_ball_and_a_cross_and_all_else_byte_for_byte(write, tmp_path):
    text = parallelogram().replace("<joint", "\n  <joint").replace("</model>", "<!-- kept -->\n</model>")
    loaded, copy = rx.load_model(write(text, "bar.sdf")), tmp_path / "copy.sdf"
    made = fix(loaded, examine(loaded, 1), copy)
    assert figures(copy)[:2] == (made.redundancy, made.freedom) == (0, 1)
    now = text.replace('"p" type="revolute"', '"p" type="universal"').replace('"s" type="revolute"', '"s" type="ball"')
    cross = "<axis><xyz>-1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"
    start, end = now.index('"p"'), now.index("</joint>")
    now = now[:start] + now[start:end].replace(Y, cross) + now[end:]
    assert copy.read_text() == now[: now.rindex(Y)] + now[now.rindex(Y) + len(Y) :]


@pytest.mark.parametrize("rows", ["a.bend_1", "a.bend_2", "b.bend_1", "b.bend_2"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_cross_of_sdf_frees_the_tilt_that_is_meant(write, tmp_path, rows, turned):
    """Two doors in series, each on two hinges that are apart, in frames of their own, held either way round: of five
    redundant rows each, a cross takes off one, and leaves what the other hinge holds."""
    ends = [("world", "one"), ("world", "one"), ("one", "two"), ("one", "two")]
    pose = '<pose relative_to="__model__">0 0 {} 0.3 0.5 0.7</pose>'
    axis = '<axis><xyz expressed_in="__model__">0 1 0</xyz></axis>'
    joints = [
        JOINT.format(name, "revolute", *(each[::-1] if turned else each), pose.format(k % 2) + axis)
        for k, (name, each) in enumerate(zip("abcd", ends, strict=True))
    ]
    links = [LINK.format(name, "0 0 0 0 0 0", "") for name in ("one", "two")]
    loaded, copy = (
        rx.load_model(write(model(*links, *joints).replace("0 0 1 0.3", "0 0 0 0.3"), "door.sdf")),
        tmp_path / "copy.sdf",
    )
    assert figures(loaded.path)[:2] == (10, 2)
    sdf_change(loaded, [change(sdf_moves(loaded), rows)], copy).write()
    assert figures(copy)[:2] == (9, 2)
    (name, _, _), column = rows.partition("."), int(rows[-1]) - 1
    before, after = (_ends(rx.load_model(path).described, name) for path in (loaded.path, copy))
    np.testing.assert_allclose(abs(after[0][:, 2] @ before[0][:, column]), 1.0, rtol=1e-12)
    np.testing.assert_allclose(abs(after[1][:, 2] @ before[1][:, 2]), 1.0, rtol=1e-12)


def _ends(described, name):
    """Axes of a joint on the body above it, which rows are told in, and on the other."""
    part = next(each for each in (*described.joints, *described.loops) if each.name == name)
    return (part.first.axes, part.second.axes) if hasattr(part, "first") else (part.parent.axes, part.child.axes)


def test_what_acts_in_a_joint_of_sdf_or_names_it_keeps_it(write):
    spring = Y.replace("</axis>", "<dynamics><damping>1</damping></dynamics></axis>")
    text = parallelogram(axis=spring, more='<plugin name="x" filename="y"><joint_name>q</joint_name></plugin>')
    loaded = rx.load_model(write(text, "bar.sdf"))
    assert {move.name for move in sdf_moves(loaded)} == {"p", "r"}
    limited = Y.replace("</axis>", "<limit><lower>-1</lower><upper>1</upper></limit></axis>")
    loaded = rx.load_model(write(parallelogram().replace(Y, limited, 1), "bar.sdf"))
    edit = change(sdf_moves(loaded), "p.bend_1 p.bend_2")
    assert (
        sdf_change(loaded, [edit], loaded.path.with_name("copy.sdf")).write().note == "It is without the limits of p."
    )


def test_a_copy_of_usd_is_a_layer_over_the_file(write, tmp_path):
    pytest.importorskip("pxr")
    text = of_usd(length=0.01, mass=0.001)
    (tmp_path / "in").mkdir()
    loaded, copy = rx.load_model(write(text, "bar.usda")), tmp_path / "in" / "copy.usda"
    found = examine(loaded, 1)
    made = fix(loaded, found, copy)
    assert figures(copy)[:2] == (made.redundancy, made.freedom) == (0, 1)
    assert loaded.path.read_text() == text and "@./../bar.usda@" in copy.read_text()
    again = rx.load_model(copy)
    assert [body.mass for body in again.described.bodies] == [body.mass for body in loaded.described.bodies]
    some = fix(loaded, found, copy, ["q.axial", "s.bend_1", "s.bend_2"])
    assert figures(copy)[:2] == (some.redundancy, some.freedom) == (0, 1)
    assert 'over PhysicsSphericalJoint "s"' in copy.read_text()
    with pytest.raises(rx.RedundaxError, match="in USD: no joint of it that is read frees a single tilt"):
        fix(loaded, found, copy, ["s.bend_1"])


@pytest.mark.parametrize(
    ("last", "free", "rows", "left"),
    [
        ("PhysicsFixedJoint", None, "s.bend_1 s.bend_2 s.twist", (1, 1)),
        ("PhysicsJoint", ("rotY", "transY"), "s.bend_1 s.bend_2", (0, 1)),
        ("PhysicsJoint", ("rotY",), "s.axial", (2, 1)),
        ("PhysicsJoint", ("rotY", "transX", "transZ"), "s.bend_1 s.bend_2", (1, 3)),
        ("PhysicsRevoluteJoint", None, "s.radial_1 s.radial_2 s.axial s.bend_1 s.bend_2", (0, 3)),
    ],
)
def test_layers_lock_what_is_left(write, tmp_path, last, free, rows, left):
    pytest.importorskip("pxr")
    loaded, copy = rx.load_model(write(of_usd(last, free), "bar.usda")), tmp_path / "copy.usd"
    usd_change(loaded, [change(usd_moves(loaded), rows)], copy).write()
    assert figures(copy)[:2] == left


def test_a_package_is_read_and_has_a_layer_over_it(write, tmp_path):
    Sdf, UsdUtils = pytest.importorskip("pxr.Sdf"), pytest.importorskip("pxr.UsdUtils")
    write(of_usd(), "bar.usda")
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "bar.usda")), str(tmp_path / "bar.usdz"))
    loaded, copy = rx.load_model(tmp_path / "bar.usdz"), tmp_path / "copy.usda"
    assert figures(loaded.path)[:2] == (3, 1)
    usd_change(loaded, [change(usd_moves(loaded), "s.bend_1 s.bend_2")], copy).write()
    assert figures(copy)[:2] == (1, 1)


def test_layers_are_not_written_over_those_of_the_model(write, tmp_path):
    pytest.importorskip("pxr")
    write(of_usd(), "below.usda")
    file = write("#usda 1.0\n(\n  subLayers = [@./below.usda@]\n)\n", "bar.usda")
    with pytest.raises(FileError, match="which the model names"):
        check_copy(str(file), None, tmp_path / "below.usda")
    with pytest.raises(FileError, match=r"must end in \.usda, \.usd, \.usdc for USD"):
        check_copy(str(file), None, tmp_path / "copy.usdz")
    (tmp_path / "link.usda").symlink_to("elsewhere.usda")
    with pytest.raises(FileError, match="which would be overwritten"):
        check_copy(str(file), None, tmp_path / "link.usda")
    check_copy(str(file), None, tmp_path / "copy.usd")
    assert not list(tmp_path.glob("copy*"))


def test_a_copy_of_sdf_must_find_the_meshes_that_it_names(write, tmp_path):
    (tmp_path / "away").mkdir()
    shape = "<visual name='v'><geometry><mesh><uri>arm.stl</uri></mesh></geometry></visual></link>"
    file = write(parallelogram().replace("</link>", shape), "bar.sdf")
    check_copy(str(file), None, tmp_path / "away" / "copy.sdf")
    write("", "arm.stl")
    with pytest.raises(FileError, match=r"names 'arm\.stl' from there"):
        check_copy(str(file), None, tmp_path / "away" / "copy.sdf")


def test_the_command_writes_a_copy_of_an_assembly_and_audits_it(write, tmp_path, capsys):
    copy = tmp_path / "copy.asmt"
    assert command.main(["audit", str(write(four_bar("CylindricalJoint"), "bar.asmt")), "--fix", str(copy)]) == 3
    out, error = capsys.readouterr()
    assert "PointInLineJoint in place of CylindricalJoint in line" in out
    assert "The copy has redundancy 0, freedom 1." in error
