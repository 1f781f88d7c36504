"""Loops of a URDF in words that are not read, and slips in files of closures: none passes without a word.

The parallelogram of four hinges about one axis has, closed by a hinge, 20 conditions on 18 coordinates and moves in one
way, so that three repeat others; closed by a point one does.
"""

import contextlib
import io
import os
import pathlib

import numpy as np
import pytest

import redundax as rx
from redundax import __main__ as command
from redundax._models._description import missing_of
from redundax._models._formats import describe
from redundax._models._tree import Tree
from redundax._models._urdf import closures_of

pytest.importorskip("mujoco")
pytest.importorskip("yaml")

LINK = (
    '<link name="{}"><inertial><mass value="1"/><origin xyz="{}"/>'
    '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="{}"/><axis xyz="0 1 0"/></joint>'
LINKS = [("arm", "0 0 0.1"), ("bar", "0.2 0 0"), ("strut", "0 0 0.1")]
HINGES = [("p", "frame", "arm", "0 0 0"), ("q", "arm", "bar", "0 0 0.2"), ("r", "frame", "strut", "0.4 0 0")]
OPEN = '<link name="frame"/>' + "".join(LINK.format(*each) for each in LINKS)
OPEN += "".join(JOINT.format(name, "continuous", *rest) for name, *rest in HINGES)
EYES = '<link name="eye_bar"/><link name="eye_strut"/>' + JOINT.format("m1", "fixed", "bar", "eye_bar", "0.4 0 0")
EYES += JOINT.format("m2", "fixed", "strut", "eye_strut", "0 0 0.2")
LOOP_JOINT = '<loop_joint name="s" type="continuous"><link1 link="bar"/><link2 link="strut"/></loop_joint>'
UNREAD = {
    LOOP_JOINT: "<loop_joint> 's' of bar and strut",
    '<drake:ball_constraint><drake:ball_constraint_body_A name="bar"/><drake:ball_constraint_body_B name="strut"/>'
    "</drake:ball_constraint>": "<drake:ball_constraint> of bar and strut",
    '<drake:joint name="s" type="ball"><parent link="bar"/><child link="strut"/></drake:joint>': "<drake:joint> 's' of",
    '<gazebo><joint name="s" type="revolute"><parent>bar</parent><child> strut </child></joint></gazebo>': "<joint>",
    '<gazebo><plugin filename="libmimic.so"><joint>p</joint><other>q</other></plugin></gazebo>': "<plugin> of p and q",
    '<ros2_control name="c"><joint name="p"><param name="mimic">q</param></joint></ros2_control>': "<joint> 'p' of q",
    '<tie one="bar" two="strut"/>': "<tie> of bar and strut",
    '<loop frames="a b"/>': "<loop>",
}
HINGE = '<loop_joint name="s" type="{}"><axis xyz="0 1 0"/><link1 link="bar" xyz="0.4 0 0"/>{}</loop_joint>'
TOP = '<link2 link="strut" xyz="0 0 0.2" rpy="0 0 0"/>'
CLOSED = {  # what closes the parallelogram, and its redundancy and freedom
    HINGE.format("continuous", TOP): (3, 1),
    HINGE.format("spherical", TOP): (1, 1),
    HINGE.format("spherical", TOP.replace("link2", "link1")): (1, 1),
    HINGE.format("fixed", TOP): (3, 0),
    '<drake:ball_constraint><drake:ball_constraint_body_A name="bar"/><drake:ball_constraint_body_B name="strut"/>'
    '<drake:ball_constraint_p_AP value="0.4 0 0"/><drake:ball_constraint_p_BQ value="0 0 0.2"/>'
    "</drake:ball_constraint>": (1, 1),
    '<gazebo><joint name="s" type="revolute"><parent>bar</parent><child>strut</child><pose>0 0 0.2 0 0 0</pose>'
    "<axis><xyz>0 1 0</xyz></axis></joint></gazebo>": (3, 1),
    '<gazebo><joint name="s" type="ball"><parent>bar</parent><child>strut</child><pose>0 0 0.2 0 0 0</pose></joint>'
    "</gazebo>": (1, 1),
    '<gazebo><joint name="s" type="fixed"><parent>world</parent><child>strut</child></joint></gazebo>': (5, 2),
    JOINT.format("s", "continuous", "bar", "strut", "0.4 0 0"): (3, 1),
}
READ = [
    '<material name="m"/><sensor name="s"><parent link="bar"/></sensor><something link="bar"/>',
    '<gazebo reference="p"><provideFeedback>1</provideFeedback></gazebo>',
    '<gazebo><plugin name="diff_drive" filename="d.so"><left>p</left><right>q</right></plugin></gazebo>',
    '<transmission name="t"><joint name="p"/><joint name="q"/></transmission>',
    '<disable_collisions link1="bar" link2="strut"/>',
    '<drake:linear_spring_damper><a name="bar"/><b name="strut"/></drake:linear_spring_damper>',
]


@pytest.fixture
def write(tmp_path):
    def written(text, loops=None, name="swing"):
        (tmp_path / f"{name}.urdf").write_text(f'<robot name="swing">{text}</robot>')
        if loops is not None:
            (tmp_path / f"{name}.yaml").write_bytes(loops if isinstance(loops, bytes) else loops.encode())
        return tmp_path / f"{name}.urdf"

    return written


def taken(file):
    """The tree of a file, and what is said of it."""
    described = describe(file, closures_of(file, None))
    return Tree(described), described.notes


def figures(tree):
    """Redundancy and freedom, in the coordinates of the joints."""
    slopes = tree.system(tree.reference)[1]
    rank = np.linalg.matrix_rank(slopes, tol=1e-9)
    return len(slopes) - rank, slopes.shape[1] - rank


@pytest.mark.parametrize("element", UNREAD)
def test_what_may_constrain_and_is_not_read_is_told(write, element):
    (told,) = missing_of(taken(write(OPEN + element))[1])
    assert told.startswith(UNREAD[element])


@pytest.mark.parametrize("element", CLOSED)
def test_loops_in_the_file_itself_are_read(write, element):
    """A weld of the strut to the ground repeats the five rows of its hinge, and leaves the arm and the bar."""
    tree, notes = taken(write(OPEN + element))
    assert missing_of(notes) == [] and tree.misfit(tree.reference) < 1e-15
    assert figures(tree) == CLOSED[element]


def test_a_loop_that_is_turned_in_both_frames_closes(write):
    """Rolled by a quarter turn about x, the hinge's z is the y of both links."""
    turned = HINGE.replace('"0 1 0"', '"0 0 -1"').replace('"0.4 0 0"', '"0.4 0 0" rpy="1.5707963267948966 0 0"')
    text = turned.format("revolute", TOP.replace('rpy="0', 'rpy="1.5707963267948966'))
    tree, _ = taken(write(OPEN + text))
    np.testing.assert_allclose(np.abs(tree.loops[0].first.axes[:, 2]), (0, 1, 0), atol=1e-15)
    assert figures(tree) == (3, 1)


@pytest.mark.parametrize("element", READ)
def test_what_constrains_nothing_is_no_loop(write, element):
    assert missing_of(taken(write(OPEN + element))[1]) == []


def test_a_loop_that_is_not_read_stands_in_the_first_line_and_decides_the_status(write):
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        status = command.main(["audit", str(write(OPEN + LOOP_JOINT))])
    verdict = " ".join(out.getvalue().partition("\n\n")[2].split())
    assert status == 4
    assert verdict.startswith("UNDECIDED: <loop_joint> 's' of bar and strut is not taken over.")
    assert "NOT REDUNDANT" not in verdict


def test_loading_a_model_without_its_loop_warns(write):
    with pytest.warns(UserWarning, match="is read without <loop_joint> 's' of bar and strut, which may constrain"):
        model = rx.load_model(write(OPEN + LOOP_JOINT))
    assert not model.is_whole


@pytest.mark.parametrize("frames", ["eye_bar, eye_strut", "m1, m2", "eye_strut, m1"])
def test_a_loop_that_is_given_beside_the_file_is_left_out_no_more(write, frames):
    tree, notes = taken(write(OPEN + EYES + LOOP_JOINT, f"{{closed_loop: [[{frames}]], type: [3d]}}"))
    assert missing_of(notes) == []
    assert figures(tree) == (1, 1)


def test_a_link_of_two_joints_may_be_closed_by_a_link_of_its_own_too(write):
    last = JOINT.format("s", "continuous", "bar", "strut_2", "0.4 0 0")
    tree, _ = taken(
        write(OPEN + EYES + '<link name="strut_2"/>' + last, "{closed_loop: [[strut_2, eye_strut]], type: [6d]}")
    )
    assert figures(tree) == (3, 1)


ONE = "closed_loop: [[eye_bar, eye_strut]]\ntype: [3d]\n"
SLIPS = {
    f"{ONE}joint_name: [qq]\njoint_type: [SPHERICAL]": "the joint 'qq', which is not in the model. Did you mean 'q'?",
    f"{ONE}joint_name: [m1]\njoint_type: [SPHERICAL]": "replaces the joint 'm1', which is fixed or planar",
    f"{ONE}joint_name: [q, q]\njoint_type: [SPHERICAL, FIXED]": "names the joint 'q' twice",
    f"{ONE}name_mot: [pp]": "drives the joint 'pp', which is no joint that moves. Did you mean 'p'?",
    ONE.replace("strut", "stut"): "at 'eye_stut', which is no link or joint of the model. Did you mean 'eye_strut'",
    ONE.replace("eye_strut", "bar"): "between 'eye_bar' and 'bar', which are one body",
    ONE.replace("closed_loop", "closed_loops"): "has the key 'closed_loops', which is none. Did you mean",
    ONE + ONE: "has the key `closed_loop` twice",
    ONE.replace("eye_bar", "on"): "must hold names under `closed_loop`, but holds True. Put names in quotes",
    ONE.replace("[3d]", "[3d, 6d]"): "must have a `type` for each `closed_loop`, but has 2 for 1",
    "left: 1\nright: 2": "has none of the keys `closed_loop`",
    "": "but is empty",
    "when: 2001-99-99": "holds a number or date that is none",
    b"closed_loop: [[eye_b\xfcr, eye_strut]]": "is not in UTF-8: see line 1",
    "[" * 100_000: "lists in lists, more than 10 deep",
    "closed_loop: [[[[[1]]]], 2]\ntype: [3d]": "for each `closed_loop`, but has 1 for 2",
    f"{ONE}---\nname_mot: [p]": "line 3: but found another document",
    b"x" * 2_000_000: "has 2 MB, too much for loops",
}


@pytest.mark.parametrize("loops", SLIPS)
def test_a_slip_in_a_file_of_closures_is_refused_in_a_line(write, loops):
    with pytest.raises(rx.RedundaxError) as error:
        taken(write(OPEN + EYES, loops))
    assert SLIPS[loops] in str(error.value)
    assert len(str(error.value)) < 300 and "\n" not in str(error.value)


def test_a_file_that_grows_when_it_is_read_is_refused_at_once(write):
    """Nine times as many at each of 60 levels: what reads it whole, or prints it, never ends."""
    levels = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9 if k else 'x' * 9)}]" for k in range(60)]
    loops = "\n".join([*levels, "closed_loop: [*a59]", "type: [3d]"])
    with pytest.raises(rx.RedundaxError, match=r"repeats a value by \*a0. Write the value itself"):
        taken(write(OPEN + EYES, loops))


@pytest.mark.skipif(os.name != "posix", reason="makes a pipe")
def test_a_pipe_is_no_file_of_closures(write, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", pathlib.Path("/dev/zero"), tmp_path):
        with pytest.raises(rx.RedundaxError, match=r"is no file. Name a file"):
            describe(write(OPEN), place)


def test_names_of_kinds_may_be_in_small_letters_and_the_file_may_end_in_yml(write, tmp_path):
    file = write(OPEN + EYES, f"{ONE}joint_name: [q]\njoint_type: [spherical]")
    (tmp_path / "swing.yaml").rename(tmp_path / "swing.yml")
    tree, _ = taken(file)
    assert [joint.kind for joint in tree.joints].count("ball") == 1
    assert len(tree.loops) == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            OPEN.replace('child link="bar"', 'child link="bra"'),
            "with the child 'bra', which is no link. Did you mean",
        ),
        (OPEN.replace('"q" type="continuous"', '"q" type="spherical"'), "file of closures replaces by SPHERICAL"),
        (OPEN.replace('"q" type="continuous"', '"q" type="Continuous"'), "Did you mean 'continuous'?"),
        (OPEN.replace('"q" type="continuous"', '"q" type="floating"'), "floats on 'arm'"),
        (
            OPEN.replace("</joint>", '<mimic joint="pq"/></joint>', 1),
            "'pq', which is no other joint. Did you mean 'q'",
        ),
        (OPEN + '<link name="bar"/>', "has 2 links called 'bar'"),
        (
            OPEN + JOINT.format("s", "fixed", "strut", "frame", "0 0 0"),
            "the link 'frame' is above itself",
        ),
        (OPEN + '<xacro:leg x="1"/>', "is a template, with <xacro:leg>. Expand it"),
        (OPEN.replace("0 0 0.2", "0 0 ${length}"), "is a template, with '0 0 ${length}'"),
    ],
)
def test_names_and_kinds_of_a_urdf_that_do_not_fit_are_told_with_what_to_do(write, text, told):
    with pytest.raises(rx.RedundaxError) as error:
        taken(write(text))
    assert told in str(error.value)


def test_a_mimic_that_couples_more_than_single_displacements_is_told(write):
    tied = OPEN.replace('"q" type="continuous"', '"q" type="planar"').replace(
        "</joint>", '<mimic joint="q"/></joint>', 1
    )
    assert missing_of(taken(write(tied))[1]) == ["mimic of p by q"]


def test_limits_without_travel_are_told_to_be_no_lock(write):
    limited = OPEN.replace('"q" type="continuous"', '"q" type="revolute"').replace("</joint>", "{}</joint>", 2)
    for limit, told in (('lower="0" upper="0"', True), ('lower="-1" upper="1"', False), ('effort="1"', False)):
        notes = taken(write(limited.format("", f"<limit {limit}/>")))[1]
        assert ("limits of q, which leave no travel: taken as none, not as a lock" in notes) == told


@pytest.mark.parametrize("word", ["<turnGravityOff>true</turnGravityOff>", "<gravity>0</gravity>"])
def test_a_link_that_gazebos_gravity_leaves_alone_does_not_fall(write, word):
    """Of 1 kg each on a vertical slide, one without weight and fixed to the other: they fall by half of g."""
    joints = [("lift", "prismatic", "frame", "arm"), ("weld", "fixed", "arm", "bar")]
    text = '<link name="frame"/>' + "".join(LINK.format(name, "0 0 0") for name in ("arm", "bar"))
    text += "".join(JOINT.format(*each, "0 0 0").replace("0 1 0", "0 0 1") for each in joints)
    spring = '<gazebo reference="lift"><springStiffness>5</springStiffness></gazebo>'
    model = rx.load_model(write(f'{text}<gazebo reference="bar">{word}</gazebo>{spring}'))
    solution = rx.solve(model.mechanism, model.state)
    np.testing.assert_allclose(float(solution["lift.travel''"]), -9.81 / 2, rtol=1e-12)
    assert "springs that Gazebo has in lift" in model.notes
