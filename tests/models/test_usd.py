"""USD with its schema of physics: bodies, masses, joints, loops and units, and what is said of spoiled files

A parallelogram of 0.2 by 0.4 m whose hinges are along y: three redundant as hinges, one as a ball, freedom 1. About the
foot of a leg of 2 kg with its centre at 0.1 m the inertia is 0.02 + 2 0.1^2 kg m^2, and the bar moves with its 2 kg on
a circle of 0.2 m: of gravity g across the legs the angle accelerates by

    g (2 2 0.1 + 2 0.2) / (2 0.04 + 2 0.2^2) = 5 g.
"""

import pathlib
import struct
import sys

import numpy as np
import pytest
from loops import figures
from usd import BOX, FACES, HEAD, TURNED, body, joint, locked, parallelogram, shape, weighing

import redundax as rx
from redundax import __main__ as command
from redundax._models._build import _stops
from redundax._models._description import missing_of
from redundax._models._formats import describe
from redundax._models._tree import Tree

pytest.importorskip("pxr")


@pytest.fixture
def write(tmp_path):
    def written(text, name="swing.usda"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


@pytest.mark.parametrize(
    ("last", "free", "redundant", "freedom"),
    [
        ("PhysicsRevoluteJoint", None, 3, 1),
        ("PhysicsSphericalJoint", None, 1, 1),
        ("PhysicsFixedJoint", None, 3, 0),
        ("PhysicsJoint", ("rotY",), 3, 1),
        ("PhysicsJoint", ("rotX", "rotY", "rotZ"), 1, 1),
        ("PhysicsJoint", ("rotX", "rotY"), 2, 1),
        ("PhysicsJoint", ("rotY", "transY"), 2, 1),
        ("PhysicsJoint", ("rotY", "transX", "transZ"), 3, 3),
        ("PhysicsJoint", ("rotX", "rotY", "rotZ", "transZ"), 1, 2),
        ("PhysicsJoint", ("rotX", "rotY", "rotZ", "transX", "transZ"), 1, 3),
        ("PhysicsJoint", ("rotY", "transX", "transY", "transZ"), 2, 3),
    ],
)
def test_a_joint_out_of_the_articulation_closes_a_loop(write, last, free, redundant, freedom):
    path = write(parallelogram(last, free))
    assert figures(path)[:2] == (redundant, freedom)
    assert figures(path)[2] < 1e-12 or "Fixed" in last  # whose frames are a quarter of a turn apart
    assert [loop.name for loop in describe(path).loops] == ["s"]


@pytest.mark.parametrize(("length", "mass"), [(1.0, 1.0), (0.01, 0.001)])
def test_units_of_the_stage_change_nothing(write, length, mass):
    model = rx.load_model(write(parallelogram(length=length, mass=mass)))
    solution = rx.solve(model.mechanism, model.state)
    np.testing.assert_allclose(float(solution["p.angle''"]), 5 * 9.81, rtol=1e-12)
    described = model.described
    np.testing.assert_allclose(described.bodies[2].inertia, np.diag([0.01, 0.02, 0.02]), atol=1e-8)
    np.testing.assert_allclose(described.bodies[2].centre, [0.1, 0, 0.2], atol=1e-12)


def test_a_body_that_gravity_leaves_alone_has_no_weight(write):
    """Of the same parallelogram without the weight of the bar, 2 kg on a circle of 0.2 m: g (2 2 0.1) / 0.24 m."""
    rigid = 'def Xform "bar" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])\n{'
    text = parallelogram()
    assert rigid in text
    model = rx.load_model(write(text.replace(rigid, f"{rigid}\nbool physxRigidBody:disableGravity = 1")))
    solution = rx.solve(model.mechanism, model.state)
    np.testing.assert_allclose(float(solution["p.angle''"]), 9.81 * (2 * 2 * 0.1) / (2 * 0.04 + 2 * 0.2**2), rtol=1e-12)


@pytest.mark.parametrize(("up", "way"), [("Y", (0, -9.81, 0)), ("Z", (0, 0, -9.81))])
def test_gravity_is_down_where_a_scene_does_not_say(write, up, way):
    text = parallelogram(up=up).replace("vector3f physics:gravityDirection = (1, 0, 0)", "")
    np.testing.assert_allclose(describe(write(text.replace("float physics:gravityMagnitude = 9.81", ""))).gravity, way)


def test_a_door_is_held_as_the_same_door_of_mjcf(write):
    """On three hinges in a stage with y up; its centre is beside the hinges, so that gravity across turns it."""
    pytest.importorskip("mujoco")
    door = body("door", "0, 1, 0", inside=weighing())
    hinges = [
        joint(f"h{y}", "PhysicsRevoluteJoint", "/frame", "/door", (f"0, {y}, 0", f"0, {y - 1}, 0")) for y in range(3)
    ]
    scene = 'def PhysicsScene "s"\n{\nvector3f physics:gravityDirection = (0, -4, -3)\n}\n'
    text = HEAD.format(1, 1, "Y") + 'def Xform "frame"\n{\n}\n' + scene + door + "".join(hinges)
    usd = rx.load_model(write(text))
    ends = "".join(f'<connect body1="door" body2="world" anchor="0 {y} 0"/>' for y in (-1, 1))
    inertial = '<inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.02 0.02"/>'
    xml = f"""<mujoco><option gravity="0 -7.848 -5.886"/><worldbody><body name="door" pos="0 1 0">
      <joint name="h1" axis="0 1 0"/>{inertial}</body></worldbody><equality>{ends}</equality></mujoco>"""
    mjcf = rx.load_model(write(xml, "door.xml"))
    one, other = (rx.solve(model.mechanism, model.state) for model in (usd, mjcf))
    np.testing.assert_allclose(float(one["h1.angle''"]), float(other["h1.angle''"]), rtol=1e-7)
    np.testing.assert_allclose(float(one["h1.angle''"]), 2 * 0.1 * 5.886 / (0.02 + 2 * 0.1**2), rtol=1e-6)
    assert figures(usd.path)[:2] == (10, 1)
    total = sum(float(one[f"h{y} force y on {'door'}"]) for y in range(3))
    np.testing.assert_allclose(total, 2 * 7.848, rtol=1e-6)


SOLIDS = {  # of r = 0.2, h = 0.6 along z, of density 500: mass, centre on z, inertia across and along z
    'def Cylinder "s"': (np.pi * 0.04 * 0.6, 0.0, (3 * 0.04 + 0.36) / 12, 0.04 / 2),
    'def Cone "s"': (np.pi * 0.04 * 0.2, -0.15, 3 / 20 * 0.04 + 3 / 80 * 0.36, 0.3 * 0.04),
    'def Sphere "s"': (4 / 3 * np.pi * 0.008, 0.0, 0.4 * 0.04, 0.4 * 0.04),
    'def Cube "s"': (0.008, 0.0, 0.04 / 6, 0.04 / 6),
}


def weighed(write, inside):
    return describe(
        write(HEAD.format(1, 1, "Z") + body("b", "0, 0, 0", inside=inside) + joint("h", "PhysicsFixedJoint", "", "/b"))
    ).bodies[1]


@pytest.mark.parametrize("kind", SOLIDS)
def test_masses_of_shapes(write, kind):
    size = "double size = 0.2" if "Cube" in kind else "double radius = 0.2"
    size += "" if "Cube" in kind or "Sphere" in kind else '\n double height = 0.6\n uniform token axis = "Z"'
    found = weighed(write, shape(kind, f"{size}\n float physics:density = 500"))
    volume, z, across, along = SOLIDS[kind]
    np.testing.assert_allclose(found.mass, 500 * volume, rtol=1e-12)
    np.testing.assert_allclose(found.centre, [0, 0, z], atol=1e-15)
    np.testing.assert_allclose(found.inertia, found.mass * np.diag([across, across, along]), rtol=1e-12, atol=1e-14)


def test_a_capsule_is_a_cylinder_and_two_halves_of_a_ball(write):
    """By integrals over slices along z, of half the square of the radius."""
    found = weighed(
        write, shape('def Capsule "s"', 'double radius = 0.2\n double height = 0.6\n uniform token axis = "Z"')
    )
    z, weights = np.polynomial.legendre.leggauss(8)
    halves = (0.3 * z, 0.3 * weights, 0.04 + 0 * z), (0.4 + 0.1 * z, 0.1 * weights, 0.04 - (0.1 + 0.1 * z) ** 2)
    (z, w, square), (end, v, cap) = halves
    volume = np.pi * (w @ square + 2 * v @ cap)
    along = np.pi / 2 * (w @ square**2 + 2 * v @ cap**2)
    tilted = np.pi * (w @ (square**2 / 4 + square * z**2) + 2 * v @ (cap**2 / 4 + cap * end**2))
    np.testing.assert_allclose(found.mass, 1000 * volume, rtol=1e-12)
    np.testing.assert_allclose(np.diag(found.inertia), 1000 * np.array([tilted, tilted, along]), rtol=1e-12)


@pytest.mark.parametrize("mirrored", [1, -1])
def test_a_mesh_weighs_as_the_box_that_it_is(write, mirrored):
    """1 by 2 by 3 m, turned inside out or not, of a mass that the body says, moved by 1 m along y."""
    mesh = f"""point3f[] points = [{BOX}]
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [{FACES}]
        double3 xformOp:translate = (0, 1, 0)
        float3 xformOp:scale = ({0.5 * mirrored}, 1, 1.5)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]"""
    found = weighed(write, "float physics:mass = 12\n" + shape('def Mesh "s"', mesh))
    np.testing.assert_allclose(found.mass, 12)
    np.testing.assert_allclose(found.centre, [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(found.inertia, np.diag([4 + 9, 1 + 9, 1 + 4]), atol=1e-12)


def test_limits_and_drives_of_joints(write):
    limits = "float physics:lowerLimit = -30\n float physics:upperLimit = 60"
    drive = '(prepend apiSchemas = ["PhysicsDriveAPI:angular"])\n{\nfloat drive:angular:physics:stiffness = 9\n'
    text = parallelogram(feet=limits).replace('"p" \n{', f'"p" {drive}')
    described = describe(write(text))
    np.testing.assert_allclose(described.joints[0].limits, np.deg2rad([-30, 60]), rtol=1e-12)
    assert described.drives == ("p",) and described.rates(np.zeros(3)).tolist() == [[1, 0, 0]]
    turned = text.replace("rel physics:body1 = </arm>", "rel physics:body0 = </arm>").replace("localRot0", "localRot1")
    np.testing.assert_allclose(describe(write(turned)).joints[0].limits, np.deg2rad([-60, 30]), rtol=1e-12)


def test_limits_of_a_joint_that_closes_a_loop_count_from_where_it_is(write):
    """The bar is a quarter of a turn from the strut, about y, in the file: 10 degrees above the limit."""
    text = parallelogram().replace("localPos1 = (0.4, 0, 0)", "localPos1 = (0.4, 0, 0)\n float physics:lowerLimit = 80")
    described = describe(write(text))
    assert described.loops[0].limits == (np.deg2rad(80), np.inf)
    tree = Tree(described)
    np.testing.assert_allclose(tree.counts(tree.reference), [np.pi / 2], rtol=1e-7)
    (stop,) = _stops(described)
    np.testing.assert_allclose(stop.least, np.deg2rad(-10), rtol=1e-6)


def test_frames_on_parts_of_bodies_that_are_scaled(write):
    """A pin on a part that is scaled by 2, 1 m up on a body: 0.1 there is 0.2 m."""
    part = """def Xform "lug"
    {
        double3 xformOp:translate = (0, 0, 1)
        float3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    }"""
    text = HEAD.format(1, 1, "Z") + body("b", "5, 0, 0", inside=weighing() + "\n" + part)
    path = write(text + joint("h", "PhysicsRevoluteJoint", "", "/b/lug", ("5.2, 0, 1", "0.1, 0, 0")))
    described = describe(path)
    np.testing.assert_allclose(described.joints[0].child.point, [5.2, 0, 1], atol=1e-12)
    np.testing.assert_allclose(described.bodies[1].centre, [5.1, 0, 0], atol=1e-12)
    assert not any("moved" in note for note in described.notes)


def test_binary_files_are_read_as_text_is(write, tmp_path):
    Sdf, path = pytest.importorskip("pxr.Sdf"), write(parallelogram())
    Sdf.Layer.FindOrOpen(str(path)).Export(str(tmp_path / "swing.usdc"))
    (tmp_path / "swing.usd").write_bytes((tmp_path / "swing.usdc").read_bytes())
    for name in ("swing.usdc", "swing.usd"):
        assert figures(pathlib.Path(tmp_path / name))[:2] == (3, 1)


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        ("</bar>", "</bra>", "Did you mean '/bar'"),
        ('"bar"', '"<b>bar"', "prim name at"),
        ("physics:mass = 2.0", "physics:mass = -2", "a mass that none has"),
        ("physics:mass = 2.0", "physics:mass = nan", "must have 1 numbers in 'physics:mass'"),
        ("(0.2, 0, 0)", "(0.2, 0)", "cannot be read as USD: Tuple"),
        ("(0.2, 0, 0)", "(inf, 0, 0)", "places '/q' by no usable numbers"),
        (f"localRot0 = ({TURNED})", "localRot0 = (0, 0, 0, 0)", "has no rotation in 'physics:localRot0'"),
        ("</bar>", "</bar>, </arm>", "cannot be read as USD: line"),
        ('axis = "Y"', 'axis = "y"', "the axis 'y'. Give X, Y or Z"),
        ("metersPerUnit = 1.0", "metersPerUnit = -1", "Give positive numbers"),
        ("PhysicsRigidBodyAPI", "PhysicsCollisionAPI", "has no body that moves"),
        ("#usda 1.0", "<mujoco>", "holds MJCF"),
        ("#usda 1.0", "hello", "is no USD"),
        ("gravityMagnitude = 9.81", "gravityMagnitude = inf", "has a gravity that is no number"),
    ],
)
def test_spoiled_files_are_told_in_a_line(write, capfd, was, now, told):
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*[.?]\s?[^\n]*$") as caught:
        describe(write(parallelogram().replace(was, now)))
    assert told in str(caught.value) and capfd.readouterr() == ("", "")


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_files_that_are_cut_off_are_told_in_a_line(write, share):
    text = parallelogram()
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*\.$"):
        describe(write(text[: int(share * len(text))]))


ODD = locked("transX", "rotY")
STUCK = "float physics:lowerLimit = 9\n float physics:upperLimit = 9"


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('def PhysxPhysicsGearJoint "gears"\n{\n}\n', "PhysxPhysicsGearJoint 'gears' is left out"),
        ('def Xform "m" (prepend apiSchemas = ["PhysxMimicJointAPI:rotX"])\n{\n}\n', "PhysxMimicJointAPI:rotX of 'm'"),
        ('def Xform "part" (references = @../../gone.usda@)\n{\n}\n', "stage is left out: Could not open asset"),
        (
            joint("odd", "PhysicsJoint", "/arm", "/bar", more=ODD[1], schemas=ODD[0]),
            "joint 'odd' is left out: no joint here leaves transX, rotY free alone",
        ),
        (
            joint("lock", "PhysicsRevoluteJoint", "/arm", "/strut", more=STUCK),
            "lock of 'lock' by its limits is left out",
        ),
    ],
)  # fmt: skip
def test_what_constrains_and_is_not_read_is_undecided(write, more, told):
    described = describe(write(parallelogram("PhysicsSphericalJoint", more=more)))
    notes = [note for note in described.notes if told in note]
    assert len(notes) == 1 and notes[0].endswith("; the figures are without it")


PHYSX = "physxMimicJoint:rotY:"
MIMICS = {
    "PhysX": (
        "PhysxMimicJointAPI:rotY",
        f"rel {PHYSX}referenceJoint",
        f"{PHYSX}gearing = -0.5",
        f"{PHYSX}offset = -20",
    ),
    "Newton": ("NewtonMimicAPI", "rel newton:mimicJoint", "newton:mimicCoef1 = 0.5", "newton:mimicCoef0 = 20"),
}


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize(("schema", "rel", "slope", "offset"), MIMICS.values(), ids=MIMICS)
def test_a_joint_that_mimics_another(write, flip, schema, rel, slope, offset):
    """p = 20 degrees + r / 2, as the file counts: whichever body of p is the first, and wherever they are drawn."""
    words = 'token physics:axis = "Y"', f"{rel} = </r>", f"float {slope}", f"float {offset}"
    more = "\n".join([*words, "quatf physics:localRot0 = (0.8, 0, 0.6, 0)"])
    ends = ("/arm", "") if flip else ("", "/arm")
    text = (
        HEAD.format(1, 1, "Z") + body("arm", "0, 0, 0", TURNED, weighing()) + body("leg", "1, 0, 0", inside=weighing())
    )
    text += joint("p", "PhysicsRevoluteJoint", *ends, more=more, schemas=f'(prepend apiSchemas = ["{schema}"])')
    text += joint("r", "PhysicsRevoluteJoint", "", "/leg", ("1, 0, 0", "0, 0, 0"))
    described = describe(write(text))
    tree = Tree(described)
    positions, left = tree.closed(np.array([0.3, 0.8]))
    p, r = positions * [-1 if flip else 1, 1]
    np.testing.assert_allclose(p, np.deg2rad(20) + r / 2, atol=1e-9)
    assert left < 1e-12 and abs(r) > 0.1 and not missing_of(described.notes)
    assert set(described.origin) == set()  # neither is to become another joint in a copy


def test_an_audit_of_what_is_not_whole_ends_undecided(write, capsys):
    more = 'def PhysxPhysicsRackAndPinionJoint "rack"\n{\n}\n'
    assert command.main(["audit", str(write(parallelogram("PhysicsSphericalJoint", more=more)))]) == 4
    assert "'rack' is left out" in capsys.readouterr().out


def test_joints_in_series_of_mujoco_move_as_in_mjcf(write):
    """Two hinges and a slide of a body, which its converter writes as joints of the same two bodies."""
    pytest.importorskip("mujoco")
    schemas = '(prepend apiSchemas = ["MjcJointAPI"])'
    kinds = (("y", "Revolute", "Y"), ("x", "Revolute", "X"), ("s", "Prismatic", "Z"))
    joints = [
        joint(name, f"Physics{kind}Joint", "", "/b", ("0, 0, 1", "0, 0, 0"), f'token physics:axis = "{axis}"', schemas)
        for name, kind, axis in kinds
    ]
    scene = 'def PhysicsScene "scene"\n{\nvector3f physics:gravityDirection = (0, -4, -3)\n}\n'
    text = HEAD.format(1, 1, "Z") + scene + body("b", "0, 0, 1", inside=weighing()) + "".join(joints)
    usd = rx.load_model(write(text))
    inertial = '<inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.02 0.02"/>'
    xml = f"""<mujoco><option gravity="0 -7.848 -5.886"/><worldbody><body name="b" pos="0 0 1">
      <joint name="y" axis="0 1 0"/><joint name="x" axis="1 0 0"/><joint name="s" type="slide" axis="0 0 1"/>
      {inertial}</body></worldbody></mujoco>"""
    mjcf = rx.load_model(write(xml, "b.xml"))
    assert usd.mechanism.names.bodies == mjcf.mechanism.names.bodies == ("b after y", "b after x", "b")
    at = {"y": 0.3, "x": -0.7, "s": 0.2}
    for name in ("y.angle''", "x.angle''", "s.travel''"):
        one, other = (
            rx.solve(each.mechanism, rx.assemble(each.mechanism, each.guess(at)))[name] for each in (usd, mjcf)
        )
        np.testing.assert_allclose(float(one), float(other), rtol=1e-7)
    assert not [note for note in usd.notes if "left out" in note]


def test_without_the_extra_it_is_named(write, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pxr.Tf", None)
    assert command.main(["audit", str(write(parallelogram()))]) == 2
    assert 'pip install "redundax[usd]"' in capsys.readouterr().err


def test_masses_that_are_missing_are_told_and_files_that_are_not_there_are_not_looked_for(write):
    text = parallelogram().replace(weighing(), "", 1)
    found = describe(write(text))
    assert found.bodies[1].mass == 1.0
    assert "mass and inertia of '/arm', which the file does not say: 1 kg and 1 kg m^2" in found.notes
    outside = HEAD.format(1, 1, "Z") + 'def Xform "all" (references = @/nowhere/etc/passwd@)\n{\n}\n'
    with pytest.raises(rx.RedundaxError, match=r"has no body that moves, .* Bring what it refers to: .*/nowhere/etc/"):
        describe(write(outside))


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_binary_files_that_are_cut_off_are_told_in_a_line(write, tmp_path, share):
    Sdf = pytest.importorskip("pxr.Sdf")
    Sdf.Layer.FindOrOpen(str(write(parallelogram()))).Export(str(tmp_path / "swing.usdc"))
    content = (tmp_path / "swing.usdc").read_bytes()
    (tmp_path / "cut.usdc").write_bytes(content[: int(share * len(content))])
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]* cannot be read as USD: [^\n]*\.$"):
        describe(tmp_path / "cut.usdc")


@pytest.mark.parametrize("of", ["value", "count of fields"])
def test_binary_files_that_are_spoiled_break_no_more_than_a_reader_of_their_own(write, tmp_path, of):
    """The first value, at which USD breaks, and a count for which it asks more memory than there is."""
    Sdf = pytest.importorskip("pxr.Sdf")
    Sdf.Layer.FindOrOpen(str(write(parallelogram()))).Export(str(tmp_path / "swing.usdc"))
    content = bytearray((tmp_path / "swing.usdc").read_bytes())
    at = struct.unpack_from("<q", content, content.index(b"FIELDS\0") + 16)[0] + 5 if of != "value" else 88
    content[at] ^= 0x7F
    (tmp_path / "spoiled.usdc").write_bytes(content)
    with pytest.raises(rx.RedundaxError, match=r"cannot be read as USD: it is spoiled, [^\n]* Export it again\.$"):
        describe(tmp_path / "spoiled.usdc")
