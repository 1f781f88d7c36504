"""Equalities of tendons of MJCF, by the rows that MuJoCo itself makes of them, and what is said of those not read."""

import jax.numpy as jnp
import numpy as np
import pytest

import redundax as rx
from redundax._models._build import mechanism_of, position_of
from redundax._models._edit_mjcf import mjcf_change, mjcf_moves
from redundax._models._examine import examine
from redundax._models._fix import fix
from redundax._models._formats import describe
from redundax._models._stress import Stress
from redundax._models._tree import Tree

mujoco = pytest.importorskip("mujoco")

ROLLERS = """<mujoco><compiler angle="radian"/><worldbody>
  <geom name="ball" size="0.1" pos="0 1 1" contype="0" conaffinity="0"/><site name="g" pos="0.2 1 2"/>
  <site name="h" pos="0.7 0 2"/>
  <body><joint name="A" axis="0 1 0" ref="0.3"/><geom size="0.1" pos="0 0 1"/><site name="a" pos="0 0 1"/></body>
  <body pos="0 1 0"><joint name="S" type="slide" ref="-0.2"/><geom size="0.1"/><site name="s"/></body>
  <body pos="0 2 0"><joint name="T" axis="1 0 0"/><geom size="0.1" pos="0 0 1"/>
    <site name="t"/></body></worldbody>
  <tendon>
    <fixed name="AS"><joint joint="A" coef="0.5"/><joint joint="S" coef="2"/></fixed>
    <fixed name="ST"><joint joint="S" coef="1"/><joint joint="T" coef="1"/></fixed>
    <fixed name="TA"><joint joint="T" coef="0.5"/><joint joint="A" coef="1"/></fixed>
    <fixed name="A"><joint joint="A" coef="-2"/></fixed>
    <fixed name="also T"><joint joint="T" coef="1"/></fixed>
    <fixed name="T"><joint joint="T" coef="3"/></fixed>
    <spatial name="rod" limited="true" range="0 1.7"><site site="a"/><site site="s"/></spatial>
    <spatial name="way"><site site="a"/><site site="s"/><site site="t"/></spatial>
    <spatial name="round"><site site="a"/><geom geom="ball"/><site site="t"/></spatial>
    <spatial name="half"><pulley divisor="2"/><site site="a"/><site site="g"/></spatial>
    <spatial name="rope"><site site="a"/><site site="s"/><site site="g"/><site site="h"/><pulley divisor="2"/>
      <site site="s"/><site site="t"/><pulley divisor="4"/><site site="t"/><site site="a"/><site site="s"/></spatial>
  </tendon><equality>{}</equality></mujoco>"""
STAY = """<mujoco><option timestep="0.0001"/>
  <worldbody><site name="top" pos="0 0 1"/><body><joint axis="0 1 0"/>
    <geom type="capsule" size="0.01" fromto="0 0 0 1 0 0"/><site name="tip" pos="1 0 0"/></body></worldbody>
  <tendon><spatial name="stay"><site site="top"/><site site="tip"/></spatial></tendon><equality>
  <tendon name="hold" tendon1="stay" solref="0.0004 1" solimp="0.9999 0.9999 0.001"/></equality></mujoco>"""
TIES = {
    "two joints of one": 'tendon1="AS" polycoef="0.1 1 0 0 0"',
    "one joint of one": 'tendon1="T" polycoef="0.2 0 0 0 0"',
    "two joints of two": 'tendon1="ST" tendon2="TA" polycoef="-0.3 2 0 0 0"',
    "a polynomial": 'tendon1="T" tendon2="A" polycoef="0.2 0.5 0.25 -1 0.3"',
    "three joints of two": 'tendon1="AS" tendon2="T" polycoef="0.1 0.5 0 0 0"',
    "a polynomial of sums": 'tendon1="AS" tendon2="ST" polycoef="0.2 0.5 0.25 -1 0.3"',
}


ROPES = {
    "over sites": 'tendon1="way"',
    "over pulleys": 'tendon1="rope" polycoef="0.1 0 0 0 0"',
    "a share of one length": 'tendon1="half" polycoef="-0.1 0 0 0 0"',
    "as a rope": 'tendon1="half" tendon2="rope" polycoef="0.1 0.5 0 0 0"',
    "a polynomial of a rope": 'tendon1="way" tendon2="rope" polycoef="0.2 0.5 0.25 -1 0.3"',
    "joints by a rope": 'tendon1="AS" tendon2="rope" polycoef="0.2 0.5 0.25 0 0"',
    "a rope by a joint": 'tendon1="rope" tendon2="T" polycoef="0.2 0.5 0.25 0 0"',
}


@pytest.fixture
def write(tmp_path):
    def written(*ties):
        file = tmp_path / "rollers.xml"
        file.write_text(ROLLERS.format("".join(f"<tendon {each}/>" for each in ties)))
        return file

    return written


@pytest.mark.parametrize("ties", [TIES, ROPES], ids=["of joints", "over sites"])
def test_rows_of_tendons_are_those_of_mujoco(write, ties):
    """To a factor of each row: MuJoCo's is a length of the tendon, and here it is a displacement of a joint."""
    described = describe(write(*ties.values()))
    tree, model = Tree(described), described.origin.model
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    for positions in np.random.default_rng(0).normal(size=(3, 3)):
        data.qpos[:] = positions
        mujoco.mj_forward(model, data)
        theirs = np.column_stack([data.efc_J.reshape(-1, 3), data.efc_pos])
        residual, slopes = tree.system(positions)
        ours = np.column_stack([slopes, residual])
        largest = np.arange(len(ours)), np.argmax(np.abs(slopes), axis=1)
        sizes = theirs[largest] / ours[largest]
        np.testing.assert_allclose(ours * sizes[:, None], theirs, rtol=1e-12, atol=1e-14)
    assert not [note for note in described.notes if "left out" in note]


def test_a_mechanism_is_tied_as_the_file_says(write):
    """0.5 a + 2 s = 0.1 in displacements: where the pendulum hangs a radian off, the slide is 0.2 m back."""
    model = rx.load_model(write(TIES["two joints of one"]))
    assert model.loops == {"coupling": ("tendon AS ~ 0",)}
    state = rx.assemble(model.mechanism, model.guess({"A": 1.3, "S": -0.4}))
    report = rx.analyze(model.mechanism, state)
    assert (report.redundancy, report.freedom) == (0, 2)
    solution = rx.solve(model.mechanism, state)
    np.testing.assert_allclose(solution["A.angle''"], -4 * solution["S.travel''"], rtol=1e-12)
    np.testing.assert_allclose(0.5 * solution["A.angle"] + 2 * solution["S.travel"], 0.1, atol=1e-12)


def test_sums_of_joints_are_tied_as_the_file_says(write):
    """0.5 a + 2 s = 0.1 + 0.5 (3 t) in displacements, as the mechanism counts."""
    model = rx.load_model(write(TIES["three joints of two"]))
    state = rx.assemble(model.mechanism, model.guess({"A": 0.5, "T": 0.2, "S": -0.05}), positions={"T.angle": 0.2})
    solution = rx.solve(model.mechanism, state)
    a, s, t = (float(solution[each]) for each in ("A.angle", "S.travel", "T.angle"))
    np.testing.assert_allclose(0.5 * a + 2 * s, 0.1 + 1.5 * t, atol=1e-12)
    assert rx.analyze(model.mechanism, state).freedom == 2 and model.is_whole


def test_a_tendon_between_two_sites_is_a_rod_in_an_equality(write):
    """As MuJoCo has it: its row, and 0.1 m more than the length of the file."""
    described = describe(write('tendon1="rod" polycoef="0.1 0 0 0 0"'))
    (loop,), tree, model = described.loops, Tree(described), described.origin.model
    np.testing.assert_allclose(loop.value, 0.1 + np.sqrt(2.0), rtol=1e-12)
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    data.qpos[:] = 0.7, 0.1, 0.2
    mujoco.mj_forward(model, data)
    residual, slopes = tree.system(data.qpos.copy())
    rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    np.testing.assert_allclose(slopes, data.efc_J.reshape(-1, 3)[rows], rtol=1e-12)
    np.testing.assert_allclose(residual, data.efc_pos[rows], rtol=1e-12)


def test_ropes_of_a_mechanism_miss_what_those_of_the_file_miss(write):
    """Distances of a mechanism count from 0, those of a tendon from the file."""
    described = describe(write(*ROPES.values()))
    tree, (mechanism, _) = Tree(described), mechanism_of(described)
    positions = np.array([0.7, 0.2, -0.4])
    missed = mechanism.constraint(jnp.asarray(position_of(tree, mechanism, positions)), jnp.zeros(()))
    ours = dict(zip(mechanism.rows.labels, np.asarray(missed), strict=True))
    theirs = tree.system(positions)[0]
    for tie, lag in zip(described.ties, theirs, strict=True):
        row = f"{tie.name}.{'coupling' if tie.second else 'distance'}"
        np.testing.assert_allclose(ours[row], lag, rtol=1e-12)
        assert abs(lag) > 0.05


# A load on two falls of a rope whose end hangs over another pulley; all falls are vertical.
TACKLE = """<mujoco><worldbody><site name="A" pos="0 0 2"/><site name="B" pos="1 0 2"/>
  <body name="load" pos="1 0 1"><joint name="up" type="slide" axis="0 0 1"/>
    <geom size="0.1" mass="3"/><site name="hook"/></body>
  <body name="end" pos="0 0 0.5"><joint name="down" type="slide" axis="0 0 1"/>
    <geom size="0.1" mass="1"/><site name="tail"/></body>
  </worldbody><tendon><spatial name="rope">
    <site site="tail"/><site site="A"/><site site="B"/><site site="hook"/><site site="B"/></spatial>
    <spatial name="same"><pulley divisor="{}"/><site site="tail"/><site site="A"/><pulley divisor="{}"/>
    <site site="hook"/><site site="B"/></spatial></tendon>
  <equality><tendon name="one" tendon1="rope"/>{}</equality></mujoco>"""


def test_a_rope_over_pulleys_pulls_with_one_tension(tmp_path):
    """T = 3 g m M / (M + 4 m) of the load M on two falls and the end m; the load rises by T / m - g over -2."""
    file = tmp_path / "tackle.xml"
    file.write_text(TACKLE.format(1, 1, ""))
    model = rx.load_model(file)
    solution = rx.solve(model.mechanism, model.state)
    tension = 3 * 9.81 * 3 / (3 + 4)
    np.testing.assert_allclose(solution["down.travel''"], tension - 9.81, rtol=1e-12)
    np.testing.assert_allclose(solution["up.travel''"], (2 * tension / 3) - 9.81, rtol=1e-12)
    np.testing.assert_allclose(abs(solution["one.coupling"]), tension, rtol=1e-12)
    assert rx.analyze(model.mechanism, model.state).freedom == 1


def test_the_same_rope_by_divisors_is_redundant_and_taken_out(tmp_path):
    """Half of both falls of the end and the whole of the load's are half of the rope."""
    file = tmp_path / "tackle.xml"
    file.write_text(TACKLE.format(2, 1, '<tendon name="two" tendon1="same"/>'))
    model = rx.load_model(file)
    found = examine(model, 1)
    assert found.figures == (1, 1)
    assert fix(model, found, tmp_path / "copy.xml").freed[0].startswith(("one is deleted", "two is deleted"))
    assert len(describe(tmp_path / "copy.xml").ties) == 1


def test_self_stress_of_a_rope_passes_through_the_joints(tmp_path):
    """That of the tree is that of the mechanism, the left null space of its matrix, but for signs of rows."""
    file = tmp_path / "tackle.xml"
    text = TACKLE.format(2, 1, '<joint joint1="down" joint2="up" polycoef="0 -2 0 0 0"/>')
    file.write_text(text.replace('"0 0 2"', '"0.45 0.6 2"').replace('"1 0 2"', '"1.3 0.4 2"'))  # falls at one angle
    model = rx.load_model(file)
    labels = model.mechanism.rows.labels
    basis = Stress(model.tree, labels).basis(model.positions, 1)
    left, values, _ = np.linalg.svd(np.asarray(model.mechanism.jacobian(model.state.q, jnp.zeros(()))))
    assert values[-1] < 1e-12 < 1e-3 < values[-2]
    np.testing.assert_allclose(np.abs(basis[:, 0]), np.abs(left[:, len(values) - 1]), rtol=1e-10, atol=1e-12)
    assert np.abs(basis[[k for k, label in enumerate(labels) if label.startswith("up.radial")]]).max() > 0.1


def test_a_rod_that_is_there_twice_is_redundant_and_taken_out(write, tmp_path):
    twice = 'name="one" tendon1="rod"', 'name="two" tendon1="rod"'
    model = rx.load_model(write(*twice))
    found = examine(model, 1)
    assert found.figures == (1, 2)
    assert fix(model, found, tmp_path / "copy.xml").freed[0].startswith("one is deleted")
    assert [loop.name for loop in describe(tmp_path / "copy.xml").loops] == ["two"]


def test_what_mujoco_says_of_a_rod_is_its_tension(tmp_path):
    """A rod from above the pin, at 45 degrees, holds the tip of a bar of weight W: W / sqrt(2)."""
    file = tmp_path / "stay.xml"
    file.write_text(STAY)
    series = rx.load_model(file).run(0.05)
    force, weight = series.reactions["hold"].force[-1], 9.81 * mujoco.MjModel.from_xml_path(str(file)).body_mass.sum()
    np.testing.assert_allclose(force, weight / 2 * np.array([1.0, 0.0, -1.0]), rtol=1e-2, atol=1e-9)


def test_the_greatest_length_of_a_tendon_is_a_cable_among_stops(write):
    model = rx.load_model(write())
    assert "stop of rod.distance" in model.stopped.names.rows.labels
    assert model.described.cables[0].value == 1.7 and not model.loops
    assert "stops at the limits of 1 tendon, which bear no load here" in model.notes


@pytest.mark.parametrize(
    ("tie", "why"),
    [
        ('tendon1="round"', "a tendon of it wraps about a sphere or a cylinder"),
        ('tendon1="T" tendon2="round"', "a tendon of it wraps about a sphere or a cylinder"),
        ('tendon1="T" tendon2="also T" polycoef="0 0 1 0 0"', "it ties joints to themselves"),
    ],
)
def test_tendons_that_are_not_taken_over_are_told(write, tie, why):
    with pytest.warns(UserWarning, match="is read without constraint 'tendon "):
        model = rx.load_model(write(tie, TIES["one joint of one"]))
    assert not model.is_whole and any(why in note for note in model.notes)


def test_a_tendon_that_is_one_too_many_is_taken_out_of_a_copy(write, tmp_path):
    model = rx.load_model(write(TIES["one joint of one"], TIES["two joints of one"]))
    (edit,) = [move for move in mjcf_moves(model) if move.name == "tendon AS ~ 0"]
    mjcf_change(model, [edit], tmp_path / "copy.xml").write()
    assert [tie.name for tie in describe(tmp_path / "copy.xml").ties] == ["tendon T ~ 0"]
