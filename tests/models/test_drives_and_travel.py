"""Which forces of drives a motion determines, and singular positions on the way, against what geometry says."""

import numpy as np
import pytest

from redundax._models._drives import drives_at
from redundax._models._examine import agreed
from redundax._models._formats import describe
from redundax._models._travel import _Path, travel
from redundax._models._tree import Tree
from redundax._models._urdf import closures_of
from redundax._tools._errors import RedundaxError

pytest.importorskip("mujoco")
pytest.importorskip("yaml")

PARALLELOGRAM = """
<mujoco>
  <compiler angle="radian"/><default><joint axis="0 1 0"/><geom type="capsule" size="0.01"/></default>
  <worldbody>
    <body name="crank"><joint name="A" {limits}/><geom fromto="0 0 0 0 0 0.1"/>
      <body name="coupler" pos="0 0 0.1"><joint name="B"/><geom fromto="0 0 0 0.4 0 0"/>
        <body name="rocker" pos="0.4 0 0"><joint name="C"/><geom fromto="0 0 0 0 0 -0.1"/></body>
      </body>
    </body>
    <body name="wheel" pos="0 2 0"><joint name="W"/><geom type="sphere" size="0.1"/></body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="A" coef="0.5"/><joint joint="W" coef="2"/></fixed></tendon>
  <equality><connect name="D" body1="rocker" body2="world" anchor="0 0 -0.1"/></equality>
  <actuator>{drives}</actuator>
</mujoco>
"""
LINK = (
    '<link name="{}"><inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
HINGE = '<joint name="{}" type="continuous"><parent link="base"/><child link="{}"/><axis xyz="0 0 1"/></joint>'
PAIR = "".join(['<robot name="pair">', *map(LINK.format, ("base", "a", "b")), HINGE.format("A", "a")])
PAIR += HINGE.format("B", "b")


@pytest.fixture
def tree(tmp_path):
    def of(text, name="model.xml", loops=None):
        (tmp_path / name).write_text(text)
        if loops:
            (tmp_path / name).with_suffix(".yaml").write_text(loops)
        file = tmp_path / name
        described = describe(file, closures_of(file, None))
        return Tree(described), described.notes

    return of


def driven(*names, limits=""):
    drives = "".join(f'<motor name="{k} {name}" {kind}="{name}"/>' for k, (kind, name) in enumerate(names))
    return PARALLELOGRAM.format(drives=drives, limits=limits)


@pytest.mark.parametrize(
    ("drives", "loose", "redundancy", "idle"),
    [
        ([], "", 0, 2),
        ([("joint", "A")], "", 0, 1),
        ([("joint", "A"), ("joint", "W")], "", 0, 0),
        ([("joint", "A"), ("joint", "C")], "01", 1, 1),
        ([("joint", "W"), ("joint", "A"), ("joint", "C")], "12", 1, 0),
        ([("joint", "A"), ("joint", "A"), ("joint", "C")], "012", 2, 1),
        ([("tendon", "both")], "", 0, 1),
        ([("tendon", "both"), ("joint", "W")], "", 0, 0),
        ([("tendon", "both"), ("joint", "W"), ("joint", "A")], "012", 1, 0),
    ],
)
def test_drives_beyond_the_freedoms_they_move_share_their_force(tree, drives, loose, redundancy, idle):
    model, _ = tree(driven(*drives))
    at, left = model.closed()
    found = drives_at(model, at, 2, left)
    assert found.names == tuple(f"{k} {name}" for k, (_, name) in enumerate(drives))
    assert "".join(name[0] for name in found.loose) == loose
    assert (found.redundancy, found.idle, found.is_decided) == (redundancy, idle, True)


def test_a_drive_that_nothing_can_move_has_no_unique_force(tree):
    locked = '<connect name="E" body1="wheel" body2="world" anchor="0.1 0 0.1"/></equality>'
    model, _ = tree(driven(("joint", "A"), ("joint", "W")).replace("</equality>", locked))
    assert drives_at(model, model.closed()[0], 1).loose == ("1 W",)


def test_a_dead_point_is_told_from_drives_that_share(tree):
    """A piston cannot turn its crank where rod and crank are in line, and can where they are not."""
    text = """<mujoco><default><joint axis="0 1 0"/><geom type="sphere" size="0.1"/></default><worldbody>
      <body name="crank"><joint name="A"/><geom/><body name="rod" pos="0.1 0 0"><joint name="B"/><geom/></body></body>
      <body name="piston" pos="0.5 0 0"><joint name="S" type="slide" axis="1 0 0"/><geom/></body></worldbody>
      <equality><connect body1="rod" body2="piston" anchor="0.4 0 0"/></equality>
      <actuator><motor name="gas" joint="S"/></actuator></mujoco>"""
    model, _ = tree(text)
    here = drives_at(model, model.reference, 1)
    beside = drives_at(model, model.descend(np.array([0.5, -0.6, 0.0]))[0], 1)
    assert (here.loose, here.redundancy, beside.loose, beside.redundancy) == (("gas",), 1, (), 0)
    found = agreed(here, [here, beside])
    assert (found.loose, found.dead, found.redundancy, found.is_decided) == ((), ("gas",), 0, True)
    assert agreed(beside, [beside]).dead == ()


@pytest.mark.parametrize(
    ("text", "loops", "names"),
    [
        ('<transmission name="t"><joint name="B"/></transmission>', None, ("B",)),
        ("", "name_mot: [A, B]", ("A", "B")),
        ('<transmission name="t"><joint name="B"/></transmission>', "name_mot: [A]", ("A",)),
    ],
)
def test_drives_of_a_urdf_are_those_of_the_loops_or_transmissions(tree, text, loops, names):
    model, _ = tree(f"{PAIR}{text}</robot>", "pair.urdf", loops)
    assert model.drives(model.reference)[0] == names


def test_a_drive_of_a_joint_that_is_not_there_is_refused_or_told(tree):
    """In the file of its loops it is a slip; a transmission may be of a joint that moves nothing."""
    with pytest.raises(RedundaxError, match=r"drives the joint 'Z', which is no joint that moves. There are A, B"):
        tree(f"{PAIR}</robot>", "pair.urdf", "name_mot: [A, Z]")
    driven = '<transmission name="t"><joint name="Z"/></transmission>'
    model, notes = tree(f"{PAIR}{driven}</robot>", "pair.urdf", "closed_loop: []")
    assert "drive of 'Z': there is no such joint" in notes
    assert model.drives(model.reference)[0] == ()


@pytest.mark.parametrize(
    ("limits", "singular"), [("", (-1.5, -0.5, 0.5, 1.5)), ('range="-1.2 2"', (0.5,)), ('range="-1.2 1.3"', ())]
)
def test_a_parallelogram_is_singular_where_it_is_flat(tree, limits, singular):
    model, _ = tree(driven(("joint", "A"), limits=limits))
    at, left = model.closed()
    found = travel(model, at, 2, left)
    assert {each.joint for each in found.singular} <= {"A"}
    np.testing.assert_allclose(sorted(each.at for each in found.singular), np.pi * np.array(singular), atol=1e-5)
    assert {(each.redundancy, each.freedom) for each in found.singular} <= {(2, 3)}
    assert set(found.ranges) == {"A"}  # no loop feels the wheel
    assert found.is_limited == bool(limits)
    if limits:
        low, high = found.ranges["A"]
        assert -1.2 <= low < -1.0 and high <= 2.0


ROCKING = """<mujoco><compiler angle="radian"/><default><joint axis="0 1 0"/><geom type="sphere" size="0.01"/></default>
  <worldbody><body name="crank"><joint name="A" ref="{ref}"/><geom/><body pos="0.05 0 0.1"><joint/><geom/>
  <body name="rocker" pos="0.4 0 0.1"><joint/><geom/></body></body></body></worldbody>
  <equality><connect body1="rocker" body2="world" anchor="0.1 0 -0.2"/></equality>
  <actuator><motor joint="A"/></actuator></mujoco>"""


@pytest.mark.parametrize(("ref", "start"), [(0.0, 0.0), (0.0, 2.4), (0.5, -0.9)])
def test_the_range_of_a_crank_that_turns_round_is_that_of_its_triangles(tree, ref, start):
    """Coupler and rocker are in line at both ends; wherever the walk begins, and as the file counts."""
    model, _ = tree(ROCKING.format(ref=ref))
    at, left = model.descend(model.reference + np.array([start, 0.0, 0.0]))
    found = travel(model, at, 1, left)
    ground, crank, line = 0.55, np.hypot(0.05, 0.1), np.hypot(0.4, 0.1) + np.hypot(0.1, 0.2)
    most = np.arccos((crank**2 + ground**2 - line**2) / (2 * crank * ground))
    middle = np.arctan2(0.1, 0.05) + ref  # the crank turns about y, from z to x
    np.testing.assert_allclose(found.ranges["A"], (middle - most, middle + most), atol=1e-6)
    assert not found.is_limited and not found.singular


@pytest.mark.parametrize("offset", [0.5, 0.03, -0.03, 0.08, -0.08])
def test_a_singular_position_beside_the_start_is_found_and_told_as_the_file_counts(tree, offset):
    text = driven(("joint", "A")).replace('<joint name="A" ', '<joint name="A" ref="0.25" ')
    model, _ = tree(text)
    turn = np.pi / 2 + offset
    at, left = model.descend(model.reference + np.array([turn, -turn, turn, 0.0]))
    found = travel(model, at, 2, left)
    nearest = min(found.singular, key=lambda each: abs(each.at - at[0]))
    np.testing.assert_allclose(nearest.at, 0.25 + np.pi / 2, atol=1e-5)
    assert nearest.positions["A"] == pytest.approx([nearest.at], abs=1e-12)
    again = np.concatenate([nearest.positions[name] for name in "ABCW"])
    slopes = model.system(again)[1]
    assert np.linalg.matrix_rank(slopes, tol=1e-4) == np.linalg.matrix_rank(model.system(at)[1], tol=1e-4) - 1
    np.testing.assert_allclose(np.diff([each.at for each in found.singular]), np.pi, atol=1e-5)  # each once


def test_two_that_are_flat_at_once_are_found_together(tree):
    """The sign of no determinant tells of them: the rank falls by two."""
    before, start, rest = driven(("joint", "A")).partition('<body name="crank">')
    body, end, after = rest.partition('<body name="wheel"')
    twin = (start + body).replace("<body ", '<body pos="0 1 0" ', 1)
    for name in ("crank", "coupler", "rocker", "A", "B", "C"):
        twin = twin.replace(f'name="{name}"', f'name="{name}2"')
    more = (
        '<connect name="E" body1="rocker2" body2="world" anchor="0 0 -0.1"/><joint joint1="A2" joint2="A"/></equality>'
    )
    model, _ = tree(before + start + body + twin + end + after.replace("</equality>", more))
    at, left = model.closed()
    found = travel(model, at, 2, left)
    np.testing.assert_allclose(
        sorted(each.at for each in found.singular), np.pi * np.array([-1.5, -0.5, 0.5, 1.5]), atol=1e-5
    )
    assert {(each.redundancy, each.freedom) for each in found.singular} == {(4, 4)}


@pytest.mark.parametrize("beyond", [1e-16, -1e-16])
def test_a_joint_at_its_limit_stops_no_other(tree, beyond):
    """Rounding puts the wheel beyond while the crank moves."""
    model, _ = tree(driven(("joint", "A")).replace('<joint name="W"', '<joint name="W" range="0 2"'))
    path, way = _Path(model, 2, 0.0), np.zeros(model.nv)
    way[[0, 3]] = 1.0, beyond
    assert path.step(path.at(model.closed()[0], way), 0.1) is not None
    way[[0, 3]] = 0.0, -1.0
    assert path.step(path.at(model.closed()[0], way), 0.1) is None


def test_without_loops_there_is_nothing_to_look_for(tree):
    model, _ = tree(f"{PAIR}</robot>", "pair.urdf")
    assert travel(model, model.reference, 2) is None
