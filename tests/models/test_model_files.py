"""Models from small files: what of a file becomes what, closed loops, motion as MuJoCo has it, and spoiled files."""

import contextlib
import dataclasses
import io
import json
import pathlib

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._models._audit import Audit, Look
from redundax._models._examine import examine

mujoco = pytest.importorskip("mujoco")
pytest.importorskip("yaml")
velocity_of_bodies = pytest.importorskip("ideal_loops").velocity_of_bodies

FOUR_BAR = """
<mujoco>
  <default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>
  <asset><mesh name="nowhere" file="nowhere.stl"/></asset>
  <worldbody>
    <body name="crank"><joint name="A"/><geom fromto="0 0 0 0 0 0.1"/><geom type="mesh" mesh="nowhere"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.2"/></body>
      </body>
    </body>
    <site name="foot" pos="{foot} 0 -0.1"/>
  </worldbody>
  <equality><connect name="D" body1="rocker" body2="world" anchor="0 0 -0.2"/>{more}</equality>
</mujoco>
"""
ARM = """
<mujoco><worldbody>
  <body name="a">
    <joint name="A" axis="0 1 0.2" damping="0.3" stiffness="2" springref="20"/>
    <geom size="0.1 0.3 0.2" type="box" pos="0.3 0 0"/>
    <body name="b" pos="0.6 0 0.1" euler="20 30 40">
      <joint name="x" type="slide" axis="1 0 1" damping="0.5"/><joint name="T" axis="0 0 1" pos="0.1 0 0"/>
      <geom size="0.1 0.2 0.05" type="ellipsoid"/>
      <body name="tip" pos="0.2 0.1 0"><geom size="0.07"/></body>
    </body>
  </body>
</worldbody></mujoco>
"""
LINK = (
    '<link name="{}"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
MESHES = """
<mujoco><asset><mesh name="m" file="no.stl"/></asset><worldbody>{}</worldbody></mujoco>
"""
HINGE = (
    '<joint name="{0}" type="{4}"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/><axis xyz="0 0 1"/>'
    '<limit lower="-2" upper="2" effort="5" velocity="5"/></joint>'
)
DOOR = "".join(
    [
        '<robot name="door">',
        *map(LINK.format, ("frame", "door", "leaf")),
        HINGE.format("lower", "frame", "door", "0 0 0.2", "revolute"),
        HINGE.format("upper", "frame", "leaf", "0 0 1.8", "revolute"),
        '<link name="screw"/>',
        HINGE.format("screw_place", "door", "screw", "0 0 1.6", "fixed"),
        "</robot>",
    ]
)
LOOP = "closed_loop: [[screw_place, leaf]]\ntype: [6d]\n"


@pytest.fixture
def write(tmp_path):
    def written(name, text):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


def run(*arguments):
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = command.main(["audit", *map(str, arguments)])
    return status, out.getvalue(), error.getvalue()


def jacobian(model, q):
    return np.asarray(model.mechanism.jacobian(q, jnp.zeros(())))


def figures(model):
    """Redundancy and freedom of the mechanism of a model."""
    rows = jacobian(model, model.state.q)
    rank = np.linalg.matrix_rank(rows, tol=1e-9)
    return len(rows) - rank, rows.shape[1] - rank


def test_a_four_bar_with_a_point_closure_has_one_redundant_row(write):
    status, out, error = run("--json", write("bar.xml", FOUR_BAR.format(foot=0.4, more="")))
    found = json.loads(out)
    assert (status, error) == (3, "")
    assert (found["redundancy"], found["freedom"], found["decided"]) == (1, 1, True)
    assert len(found["positions"]) == 4
    assert found["parts"]["D"]["unique_dimensions"] == {"force": [2, 3], "moment": [0, 0]}
    assert all("axial" in found["parts"][name]["not_unique"] for name in "ABC")
    assert found["joints"] == {"hinge": ["A", "B", "C"]}
    assert (found["drives"]["names"], found["drives"]["freedoms_without_drive"]) == ([], 1)
    assert (len(found["travel"]["ranges"]), found["travel"]["singular_positions"]) == (1, [])
    assert found["loops"] == {"connect": ["D"]}
    assert found["left_out"][0] == "1 shape from meshes"


def test_the_exit_status_follows_what_is_allowed_and_the_page_says_what_is_redundant(write):
    file = write("bar.xml", FOUR_BAR.format(foot=0.4, more=""))
    status, out, _ = run(file, "--allow", "1")
    assert status == 0
    words = " ".join(out.split())
    assert "REDUNDANT by 1, allowed 1: accepted: 1 constraint repeats what others already enforce" in words
    assert "Same at 3 other positions and along the motion." in words
    assert "as the file counts" in words and "joint limits" not in words and "Drives" not in words
    assert "Known: loads in the plane across (0 1 0)" in words
    assert "how a sideways load, along (0 1 0), splits between A, B, C and D." in words
    assert "Next: --fix COPY.xml" in out


def test_loops_of_a_urdf_are_read_beside_it_or_as_given(write):
    door = write("door.urdf", DOOR)
    assert rx.load_model(door).loops == {}
    loops = write("other.yaml", LOOP)
    assert rx.load_model(door, loops).loops == {"weld": ("weld screw_place ~ leaf",)}
    write("door.yaml", LOOP)
    model = rx.load_model(door)
    assert figures(model) == (5, 1)  # two hinges on one axis hold one body


TILTED = """
<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/><geom size="0.05"/></default><worldbody>
  <body><joint name="A"/><geom/>
    <body pos="0 0 0.1"><joint name="B" axis="{tilt} 1 0"/><geom/>
      <body pos="0.4 0 0.1"><joint name="C"/><geom/>
        <body name="foot" pos="0.05 0 -0.3"><joint name="D"/><geom/></body>
  </body></body></body></worldbody>
  <equality><weld body1="foot"/></equality>
</mujoco>
"""


@pytest.mark.parametrize("tilt", [0.0, 3e-9, 3e-3])
def test_axes_that_are_parallel_to_the_digits_of_a_file_are_parallel(write, tilt):
    """A four-bar of hinges alone moves and has three redundant rows; tilted truly it is locked, and has two."""
    found = examine(rx.load_model(write("bar.xml", TILTED.format(tilt=tilt))))
    assert found.is_decided
    assert found.figures == ((2, 0) if tilt > 1e-6 else (3, 1))
    assert len(found.others) == 3 or tilt > 1e-6


TWO = """
<mujoco><worldbody>
  <body name="a"><joint name="A" axis="0 0 1"/><geom size="0.1"/>
    <body name="b" pos="1 0 0"><joint name="B" axis="0 0 1"/><geom size="0.1"/></body>
  </body>{more}
</worldbody>{beside}</mujoco>
"""


def test_loops_without_names_between_the_same_bodies_are_told_apart(write):
    """Two points on the axis of the second hinge, held by the ground: the first needs one condition of their six."""
    point = '<connect body1="b" body2="world" anchor="{} 0 {}"/>'
    both = f"<equality>{point.format(0, 0)}{point.format(0, 1)}</equality>"
    file = write("two.xml", TWO.format(more="", beside=both))
    model = rx.load_model(file)
    assert model.loops == {"connect": ("connect b ~ world", "connect b ~ world (2)")}
    assert set(model.misfits) == set(model.loops["connect"])
    factor = rx.factorize(model.mechanism, model.state)
    assert (int(factor.redundancy), int(factor.freedom)) == (5, 1)


def test_a_body_moved_from_outside_rests_where_the_file_has_it(write):
    """A weld to a hand that MuJoCo moves holds a body that floats, and a hinge on the hand one that hangs there."""
    hung = '<body name="d" pos="0 0 1"><joint name="D"/><geom size="0.1"/></body>'
    more = f"""<body name="hand" mocap="true" pos="0 2 1">{hung}</body>
      <body name="f" pos="0 3 1"><freejoint/><geom size="0.1"/></body>"""
    file = write("hand.xml", TWO.format(more=more, beside='<equality><weld body1="hand" body2="f"/></equality>'))
    model = rx.load_model(file)
    assert any("mocap) of hand: they rest" in note for note in model.notes)
    factor = rx.factorize(model.mechanism, model.state)
    assert (int(factor.redundancy), int(factor.freedom)) == (0, 3)
    for body, place in (("f", (0, 3, 1)), ("d", (0, 2, 2))):
        np.testing.assert_allclose(model.mechanism.point(model.state, body, (0, 0, 0)), place, atol=1e-12)


def test_mass_that_only_meshes_would_give_is_told_to_be_missing(write):
    """Not that of a body with an inertia of its own, of shapes without density, or of what is fixed to the ground."""
    mesh, pin = '<geom type="mesh" mesh="m" {}/>', '<joint axis="0 0 1"/>'
    bodies = {
        "a": mesh.format('mass="2"') + '<geom size="0.1"/>',
        "b": mesh.format("") + '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>',
        "c": mesh.format('density="0"') + '<geom size="0.1"/>',
        "d": mesh.format("") + mesh.format(""),
        "e": mesh.format('mass="3"').replace('type="mesh"', 'type="box"') + '<geom size="0.1"/>',  # fitted to the mesh
    }
    file = MESHES.format(mesh.format("") + "".join(f'<body name="{n}">{pin}{of}</body>' for n, of in bodies.items()))
    notes = rx.load_model(write("meshes.xml", file)).notes
    assert "mass that shapes from meshes give to a, d, e" in notes


def test_forces_that_are_not_taken_over_are_told(write):
    """Those of a fluid; nothing is told where there are none."""
    told = ["forces of the fluid around, of the density and viscosity in the file's options"]
    plain = TWO.format(more="", beside="")
    for option, more in (("", []), ('<option viscosity="1"/>', told), ('<option density="1000"/>', told)):
        notes = rx.load_model(write("a.xml", plain.replace("<mujoco>", f"<mujoco>{option}"))).notes
        assert [note for note in notes if "contact" not in note] == more


def test_compensation_of_gravity_lifts_a_body_at_its_centre(write):
    """Of an arm of 2 kg with its centre at 0.3 m half the weight stays, and all of a weight of 1 kg fixed at 0.5 m."""
    arm = """<mujoco><worldbody><body name="arm" gravcomp="0.5"><joint name="pin" axis="0 1 0"/>
      <inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.02 0.02"/><body name="weight" pos="0.5 0 0">
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body></body></worldbody></mujoco>"""
    model = rx.load_model(write("arm.xml", arm))
    solution = rx.solve(model.mechanism, model.state)
    moment, inertia = 9.81 * (0.5 * 2 * 0.3 + 0.5), 0.02 + 2 * 0.3**2 + 0.01 + 0.5**2
    np.testing.assert_allclose(float(solution["pin.angle''"]), moment / inertia, rtol=1e-12)
    np.testing.assert_allclose(
        float(solution["pin force z on arm"]), 9.81 * 2 - (2 * 0.3 + 0.5) * moment / inertia, rtol=1e-12
    )


@pytest.mark.parametrize("active", ["true", "false"])
def test_a_constraint_that_is_not_taken_over_is_told_by_the_exit_status(write, active):
    """A tendon that ties joints to themselves, if it is active: an audit without it must not pass for the file."""
    tendon = '<tendon><fixed name="t"><joint joint="A" coef="1"/><joint joint="B" coef="-1"/></fixed>'
    tendon += '<fixed name="u"><joint joint="A" coef="1"/><joint joint="B" coef="2"/></fixed></tendon>'
    tied = '<equality><tendon name="tie" tendon1="t" tendon2="u" polycoef="0 1 1 0 0" active="{}"/></equality>'
    tied = tied.format(active)
    file = write("tied.xml", TWO.format(more="", beside=tendon + tied))
    status, out, _ = run(file)
    assert status == (4 if active == "true" else 0)
    told = "'tie' is left out: it ties joints to themselves; the figures are without it"
    assert (told in " ".join(out.split())) == (active == "true")
    assert json.loads(run("--json", file)[1])["whole"] == (active == "false")


@pytest.mark.parametrize(("kind", "freedom"), [("SPHERICAL", 4), ("UJOINT_XY", 3), ("FIXED", 1)])
def test_joints_of_a_urdf_are_replaced_as_the_loops_say(write, kind, freedom):
    write("door.yaml", f"joint_name: [lower]\njoint_type: [{kind}]\n")
    model = rx.load_model(write("door.urdf", DOOR))
    assert figures(model)[1] == freedom


@pytest.mark.slow
def test_an_arm_of_several_joints_moves_as_in_mujoco(write):
    model = rx.load_model(write("arm.xml", ARM))
    assert model.mechanism.names.bodies == ("a", "b after x", "b")
    at, rates = {"A": 0.4, "x": 0.2, "T": -0.7}, {"A.angle": 1.1, "x.travel": -0.4, "T.angle": 2.0}
    state = rx.assemble(model.mechanism, model.guess(at), rates=rates)
    solution = rx.solve(model.mechanism, state)
    theirs = mujoco.MjModel.from_xml_string(ARM)
    theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(theirs)
    data.qpos[:], data.qvel[:] = list(at.values()), list(rates.values())
    mujoco.mj_forward(theirs, data)
    ours = [float(solution[f"{name}''"]) for name in rates]
    np.testing.assert_allclose(ours, data.qacc, rtol=1e-10)


ELASTIC = """
<mujoco><compiler angle="radian"/><worldbody>
  <body name="a" euler="0.2 0.1 0.4">
    <joint name="A" axis="0 1 0.2" armature="0.7" stiffness="1.5" springref="0.3"/><geom size="0.1" pos="0.3 0.1 0"/>
    <body name="b" pos="0.6 0 0.1" euler="0.3 0.5 0.1">
      <joint name="S" type="slide" axis="1 0 1" stiffness="40" springref="0.2" damping="3"/>
      <geom size="0.1 0.2 0.05" type="box"/>
      <body name="c" pos="0.2 0.1 0" euler="1 0.2 0">
        <joint name="K" type="ball" stiffness="2.5" damping="0.4" pos="0.05 0 0"/><geom size="0.1 0.2 0.3" type="box"/>
      </body>
    </body>
  </body>
  <body name="d" pos="3 0 0"><joint name="L" type="ball" armature="0.4" stiffness="7"/>
    <geom size="0.1 0.2 0.3" type="box" pos="0.3 0.2 0.5"/></body>
</worldbody></mujoco>
"""


def test_springs_dampers_and_armature_act_as_in_mujoco(write):
    model = rx.load_model(write("elastic.xml", ELASTIC))
    assert not any("armature" in note or "spring" in note for note in model.notes)
    quaternions = {name: np.array(q) / np.linalg.norm(q) for name, q in (("K", (9, 3, -2, 4)), ("L", (5, -2, 1, 3)))}
    at = {"A": 0.4, "S": -0.1, **quaternions}
    theirs = mujoco.MjModel.from_xml_string(ELASTIC)
    theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, velocity = mujoco.MjData(theirs), np.array([0.8, -0.3, 0.5, 1.2, -0.7, 0.4, -0.6, 0.9])
    data.qpos[:], data.qvel[:] = np.concatenate([np.ravel(at[name]) for name in "ASKL"]), velocity
    mujoco.mj_forward(theirs, data)
    q, system = model.guess(at), model.mechanism
    state = rx.State(q, jnp.asarray(velocity_of_bodies(theirs, data, system.names.bodies)))
    np.testing.assert_allclose(system.jacobian(q, state.t) @ state.qd, 0.0, atol=1e-12)
    solution = rx.solve(system, state)
    np.testing.assert_allclose([solution["A.angle''"], solution["S.travel''"]], data.qacc[:2], rtol=1e-9)
    spin = solution.acceleration[-3:]  # of d about its own axes, whose rates are those of its ball
    np.testing.assert_allclose(spin, data.qacc[-3:], rtol=1e-9)


def test_dry_friction_of_balls_and_armature_of_what_floats_are_told(write):
    ball = """<mujoco><worldbody><body name="a"><joint name="K" type="ball" frictionloss="1" armature="1"/>
      <geom size="0.1" pos="1 0 0"/></body><body name="b"><joint name="F" type="free" armature="0.1"/>
      <geom size="0.1"/></body></worldbody></mujoco>"""
    notes = rx.load_model(write("ball.xml", ball)).notes
    assert "dry friction of K" in notes and "armature of F" in notes


NOT_LINEAR = """<mujoco><worldbody>
  <body name="a"><joint name="both" stiffness="1 2 3" damping="0.1 2"/><geom size="0.1"/>
  <body pos="0 0 1"><joint name="line" stiffness="1" damping="0.1"/><geom size="0.1"/>
  <body pos="0 1 1"><joint name="damper" type="ball" damping="0 0 1"/><geom size="0.1"/></body></body></body>
  </worldbody></mujoco>"""


def test_springs_and_dampers_that_are_not_linear_are_told(write):
    if not hasattr(mujoco.MjModel, "jnt_stiffnesspoly"):
        pytest.skip("this MuJoCo has none")
    notes = rx.load_model(write("springs.xml", NOT_LINEAR)).notes
    assert "what is not linear in the springs of both" in notes
    assert "what is not linear in the dampers of both, damper" in notes


@pytest.mark.parametrize(
    ("kind", "coordinate", "inertia"), [("hinge", "angle", 4.0 * (0.4 * 0.01 + 1)), ("slide", "travel", 4.0)]
)
def test_dry_friction_is_as_large_as_the_file_says_and_against_the_motion(write, kind, coordinate, inertia):
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody>
      <body name="a"><joint name="A" type="{kind}" axis="0 0 1" frictionloss="0.7"/>
      <geom size="0.1" pos="1 0 0" mass="4"/></body></worldbody></mujoco>"""
    model = rx.load_model(write("dry.xml", text))
    for rate in (1.0, -1.0):
        state = rx.assemble(model.mechanism, rates={f"A.{coordinate}": rate})
        found = rx.solve(model.mechanism, state)[f"A.{coordinate}''"]
        np.testing.assert_allclose(found, -np.sign(rate) * 0.7 / inertia, rtol=1e-9)
    assert not model.notes or "friction" not in " ".join(model.notes)


@pytest.mark.parametrize(("kind", "row"), [("hinge", "twist"), ("slide", "axial")])
def test_a_joint_that_is_locked_does_not_move(write, kind, row):
    text = f"""<mujoco><compiler angle="radian"/><worldbody>
      <body name="a"><joint name="A" type="{kind}" axis="0 0 1"/><geom size="0.1" pos="1 0 0"/>
      <body name="b"><joint name="B"/><geom size="0.1" pos="1 0 0"/></body></body>
      </worldbody><equality><joint name="lock" joint1="A" polycoef="0.4 0 0 0 0"/></equality></mujoco>"""
    model = rx.load_model(write("lock.xml", text))
    assert model.loops == {"coupling": ("lock",)}
    assert f"lock.{row}" in model.mechanism.rows.labels
    assert figures(model) == (0, 1)
    np.testing.assert_allclose(model.positions, [0.4, 0.0], atol=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.3, -0.6])
def test_a_polynomial_couples_two_joints(write, at):
    text = """<mujoco><compiler angle="radian"/><worldbody>
      <body name="a"><joint name="A" axis="0 0 1"/><geom size="0.1" pos="1 0 0"/></body>
      <body name="b"><joint name="B" type="slide" axis="0 1 0"/><geom size="0.1"/></body>
      </worldbody><equality><joint name="cam" joint1="B" joint2="A" polycoef="0 0.5 0.25 -1 0"/></equality></mujoco>"""
    model = rx.load_model(write("cam.xml", text))
    guess = model.guess({"A": at, "B": 0.5 * at + 0.25 * at**2 - at**3})
    residual = model.mechanism.constraint(guess, jnp.zeros(()))
    assert float(jnp.abs(residual).max()) < 1e-14
    (motion,) = np.linalg.svd(jacobian(model, guess))[2][-1:]
    turn, lift = (motion[model.mechanism.coordinates.labels.index(name)] for name in ("a.phi_z", "b.y"))
    np.testing.assert_allclose(lift / turn, 0.5 + 0.5 * at - 3 * at**2, atol=1e-12)


def test_a_body_that_floats_has_six_freedoms(write):
    text = '<mujoco><worldbody><body name="ball"><freejoint/><geom size="0.1"/></body>{}</worldbody></mujoco>'
    pin = '<body name="a"><joint name="A"/><geom size="0.1" pos="1 0 0"/></body>'
    model = rx.load_model(write("free.xml", text.format(pin)))
    assert figures(model) == (0, 7)
    assert model.joints["free"] == ("free of ball",)


def test_a_weld_keeps_the_pose_of_the_file(write):
    text = """<mujoco><worldbody>
      <body name="a" pos="0.2 0.1 0" euler="10 20 30"><joint name="A" axis="0 0 1"/><geom size="0.1"/></body>
      <body name="b" pos="0.5 -0.1 0.3" euler="70 0 20"><freejoint/><geom size="0.1"/></body>
      </worldbody><equality><weld name="glue" body1="a" body2="b" anchor="0.1 0.2 0.3"/></equality></mujoco>"""
    model = rx.load_model(write("glue.xml", text))
    assert model.misfits["glue"] < 1e-12
    assert figures(model) == (0, 1)


def test_a_weld_without_torques_holds_a_point_alone(write):
    """As in MuJoCo, whose rows for its moments are 0."""
    weld = '<weld name="hook" body1="a" body2="b" anchor="0.1 0.2 0.3" relpose="0.2 0 0.1 1 0 0 0" torquescale="{}"/>'
    text = """<mujoco><worldbody>
      <body name="a" euler="10 20 30"><joint name="A" axis="0 0 1"/><geom size="0.1"/></body>
      <body name="b" pos="0.5 -0.1 0.3" euler="70 0 20"><freejoint/><geom size="0.1"/></body>
      </worldbody><equality>{}</equality></mujoco>"""
    model = rx.load_model(write("hook.xml", text.format(weld.format(0))))
    assert model.loops == {"connect": ("hook",)} and figures(model) == (0, 4)
    theirs = mujoco.MjModel.from_xml_path(str(model.path))
    theirs.opt.jacobian, data = mujoco.mjtJacobian.mjJAC_DENSE, mujoco.MjData(theirs)
    data.qpos[:] = model.positions
    mujoco.mj_forward(theirs, data)
    assert theirs.nv - np.linalg.matrix_rank(data.efc_J.reshape(-1, theirs.nv)) == 4
    assert np.abs(data.efc_pos[:3]).max() < 1e-12  # the point is where MuJoCo has it
    assert figures(rx.load_model(write("hook.xml", text.format(weld.format(0.5))))) == (0, 1)


FAR = FOUR_BAR.format(foot=9, more='<connect name="E" site1="foot" site2="end"/>').replace(
    "</body>", '<site name="end" pos="0 0 -0.2"/></body>', 1
)
FILES = {
    "an empty file": ("bad.xml", ""),
    "a truncated file": ("bad.xml", FOUR_BAR[:400]),
    "an unknown tag": ("bad.xml", "<mujoco><worldbody><bodi/></worldbody></mujoco>"),
    "markup in a name": ("bad.xml", '<mujoco><worldbody><body name="<b>"/></worldbody></mujoco>'),
    "bytes": ("bad.urdf", "\0\1\2"),
    "no joints": ("bad.xml", '<mujoco><worldbody><body name="a"/></worldbody></mujoco>'),
    "a loop that cannot be closed": ("bad.xml", FAR),
    "a link that is not there": ("bad.urdf", DOOR.replace('child link="leaf"', 'child link="leaves"')),
    "another format": ("bad.sdf", "<sdf/>"),
}


@pytest.mark.parametrize("what", FILES)
def test_a_spoiled_file_ends_in_one_line(write, what):
    status, out, error = run(write(*FILES[what]))
    assert (status, out) == (2, "")
    assert error.startswith("redundax: ")
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("loops", "told"),
    [
        ("closed_loop: [", "is no YAML"),
        ("[]", "must have the keys"),
        ("closed_loop: [[screw_place, leaf]]\ntype: []", "a `type` for each"),
        ("closed_loop: [[screw_place]]\ntype: [6d]", "Give two frames"),
        ("closed_loop: [[screw_place, leaf]]\ntype: [5d]", "3d or 6d"),
        ("closed_loop: [[screw_place, hook]]\ntype: [6d]", "'hook', which is no link or joint"),
        ("closed_loop: 3", "must hold a list under `closed_loop`, but holds 3"),
        ("joint_name: [lower]\njoint_type: [GEAR]", "SPHERICAL, UJOINT_XY or FIXED"),
    ],
)
def test_spoiled_loops_end_in_one_line(write, loops, told):
    write("door.yaml", loops)
    status, _, error = run(write("door.urdf", DOOR))
    assert status == 2
    assert told in error
    assert len(error.splitlines()) == 1


def test_a_singular_position_of_a_file_is_told_from_the_machine(write):
    flat = FOUR_BAR.replace('pos="0 0 0.1"', 'pos="0.1 0 0"').replace("0 0 -0.2", "-0.1 0 0").format(foot=0.4, more="")
    status, out, _ = run("--json", write("flat.xml", flat))
    found = json.loads(out)
    here, *others = found["positions"]
    assert status == 3
    assert (here["redundancy"], here["freedom"], here["singular_position"]) == (2, 2, True)
    assert {(each["redundancy"], each["freedom"]) for each in others} == {(1, 1)}
    assert (found["redundancy"], found["freedom"], found["decided"]) == (1, 1, True)
    assert found["parts"]["A"]["unique_dimensions"]["force"] == [2, 3]
    assert "The position of the file is singular" in run(write("flat.xml", flat))[1]


@pytest.mark.slow
def test_loops_of_few_digits_close_as_nearly_as_they_can(write):
    write("door.yaml", LOOP)
    rough = DOOR.replace("0 0 1.6", "0.0000003 0 1.6")
    status, out, _ = run("--json", write("door.urdf", rough))
    found = json.loads(out)
    assert status == 3
    assert (found["redundancy"], found["freedom"], found["decided"]) == (5, 1, True)
    assert 1e-8 < found["misfit"] < 1e-6


def test_positions_that_do_not_agree_are_undecided():
    here = Look(4, 1, 2, 0.5, 1e-16, True, False, np.zeros((5, 5)), 1e-12, np.ones(5))
    other = dataclasses.replace(here, rank=5, redundancy=0, freedom=1)
    assert Audit((), here, (here,), (), ()).is_decided
    assert not Audit((), here, (here, other), (), ()).is_decided
    assert not Audit((), here, (dataclasses.replace(here, is_decided=False),), (), ()).is_decided
    assert Audit((), dataclasses.replace(here, is_singular=True), (other,), (), ()).figures == (0, 1)


@pytest.mark.slow
def test_a_mechanism_of_a_file_of_python_is_audited(write):
    file = write(
        "door.py",
        """
import redundax as rx
def door():
    body = rx.spatial.Body("door", 20.0, inertia=(6.7, 8.3, 1.6), centre=(0.5, 0.0, 1.0))
    hinges = [rx.spatial.Revolute(f"at {h}", body, "ground", (0, 0, h), (0, 0, 1)) for h in (0.2, 1.8)]
    mechanism = rx.Mechanism([body], hinges)
    return mechanism, rx.assemble(mechanism)
""",
    )
    status, out, _ = run(f"{file}:door", "--json")
    found = json.loads(out)
    assert (status, found["redundancy"], found["freedom"], len(found["positions"])) == (3, 5, 1, 4)
    assert run(f"{file}:gate")[0] == 2


def test_a_joint_to_be_replaced_that_is_not_there_is_refused_with_near_names(write):
    write("door.yaml", "joint_name: [uper, lower]\njoint_type: [SPHERICAL, SPHERICAL]\n")
    with pytest.raises(rx.RedundaxError, match=r"the joint 'uper', which is not in the model. Did you mean 'upper'\?"):
        rx.load_model(write("door.urdf", DOOR))


def test_names_with_quotes_and_markup_stay(write):
    text = """<mujoco><worldbody><body name="a &quot;b&quot; &lt;i&gt;">
      <joint name="it's &amp; so"/><geom size="0.1" pos="1 0 0"/></body></worldbody></mujoco>"""
    model = rx.load_model(write("names.xml", text))
    assert model.mechanism.names.bodies == ('a "b" <i>',)
    assert model.joints == {"hinge": ("it's & so",)}


def test_what_has_no_inertia_is_told_and_read(write):
    text = DOOR.replace(LINK.format("leaf"), '<link name="leaf"/>')
    write("door.yaml", LOOP)
    model = rx.load_model(write("door.urdf", text))
    assert any("leaf" in note for note in model.notes)
    assert figures(model) == (5, 1)


def test_positions_of_joints_that_are_not_there_are_refused(write):
    model = rx.load_model(write("arm.xml", ARM))
    with pytest.raises(rx.RedundaxError, match=r"holds 'elbow'\. There are"):
        model.guess({"elbow": 1.0})
    with pytest.raises(rx.RedundaxError, match="must hold 1 for the hinge 'A'"):
        model.guess({"A": [1.0, 2.0]})
    for wrong, words in (("20", "must be a number"), (np.nan, "of 'A' must be finite")):
        with pytest.raises(rx.RedundaxError, match=f"Argument `positions` {words}"):
            model.guess({"A": wrong})
    with pytest.raises(rx.RedundaxError, match="there is no file"):
        rx.load_model(pathlib.Path("nowhere.xml"))


def test_limits_in_the_wrong_order_are_told(write):
    model = rx.load_model(write("arm.xml", ARM.replace('<joint name="A"', '<joint name="A" range="60 -60"')))
    assert "limits of A, least above largest: taken as none" in model.notes
    assert all("limits of" not in note for note in rx.load_model(write("arm.xml", ARM)).notes)


def test_feet_and_loads_are_added_to_a_model(write):
    text = """<mujoco><worldbody><body name="table" pos="0 0 0.5"><freejoint name="floats"/>
      <geom type="box" size="0.4 0.3 0.1" mass="8"/>
      <body name="drawer"><joint type="slide" axis="0 1 0"/><geom type="box" size="0.2 0.2 0.1" mass="2"/></body>
    </body></worldbody></mujoco>"""
    model = rx.load_model(write("table.xml", text))
    table, corners = model.bodies["table"], {"f1": (-0.4, -0.3), "f2": (0.4, -0.3), "f3": (0.4, 0.3), "f4": (-0.4, 0.3)}
    feet = [
        rx.spatial.PointOnPlane(name, table, "ground", (*at, 0.0), axis=(0.0, 0.0, 1.0), one_sided=True)
        for name, at in corners.items()
    ]
    push = rx.spatial.AppliedForce(table, (0.0, 0.0, -50.0), point=(0.4, 0.3, 0.5))  # above f3
    standing = model.extended(feet, loads=[push])
    solution = rx.solve(standing, rx.assemble(standing, model.guess({})))
    loads = {name: solution[f"{name} force z on table"] for name in corners}
    assert loads["f1"] + loads["f4"] == pytest.approx(49.05, abs=1e-9)
    assert loads["f2"] + loads["f3"] == pytest.approx(99.05, abs=1e-9)
    assert loads["f3"] + loads["f4"] == pytest.approx(99.05, abs=1e-9)
    assert min(loads.values()) >= 0
    assert np.abs(solution.acceleration).max() < 1e-9


def test_a_joint_of_a_file_rubs_by_its_load(write):
    text = """<mujoco><worldbody><body name="block"><joint name="way" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.1 0.1 0.1" mass="2"/></body></worldbody></mujoco>"""
    model = rx.load_model(write("block.xml", text))
    rubs = {"friction": rx.Coulomb(0.3), "guide_length": 0.2, "twist_radius": 0.05}
    mechanism = model.extended(friction={"way": rubs})
    state = rx.assemble(mechanism, model.guess({"way.travel": 0.1}), rates={"way.travel": 1.0})
    assert rx.solve(mechanism, state)["block.x''"] == pytest.approx(-0.3 * 9.81, rel=1e-9)
    with pytest.raises(rx.RedundaxError, match=r"but holds 'wya'. Did you mean 'way'\?"):
        model.extended(friction={"wya": rubs})
    for wrong, said in (
        ({"way": rx.Coulomb(0.3)}, "must hold arguments of joints by their names"),
        ({"way": {"name": "w"}}, "must hold arguments of `rx.spatial.Prismatic` for 'way'"),
    ):
        with pytest.raises(rx.RedundaxError, match=said):
            model.extended(friction=wrong)
