"""SDF: frames, axes, loops and models in models, as Gazebo and Drake write them, and what is said of spoiled files

A parallelogram of 0.2 by 0.4 m whose hinges are along y: three redundant as hinges, one as a ball, freedom 1.
"""

import re

import numpy as np
import pytest
from loops import figures

import redundax as rx
from redundax import __main__ as command
from redundax._models._formats import describe
from redundax._models._source import Source
from redundax._models._start import outside
from redundax._models._travel import travel
from redundax._models._tree import Tree

LINK = """<link name="{0}"><pose {2}>{1}</pose><inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
  <inertia><ixx>0.01</ixx><iyy>0.02</iyy><izz>0.02</izz></inertia></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent>{2}</parent><child>{3}</child>{4}</joint>"""
Y = "<axis><xyz>0 1 0</xyz></axis>"


def model(*parts, name="swing", around="<sdf version='1.9'>{}</sdf>"):
    return around.format(f'<model name="{name}">{"".join(parts)}</model>')


def parallelogram(last="revolute", axis=Y, links=None, more=""):
    """The arm points along z, its own x; so does the strut."""
    up = "0 -1.5707963267948966 0"
    given = links or [
        LINK.format("arm", f"0 0 0 {up}", ""),
        LINK.format("bar", "0 0 0.2 0 0 0", ""),
        LINK.format("strut", f"0.4 0 0 {up}", ""),
    ]
    joints = [
        JOINT.format("p", "revolute", "world", "arm", Y),
        JOINT.format("q", "revolute", "arm", "bar", Y),
        JOINT.format("r", "revolute", "world", "strut", Y),
        JOINT.format("s", last, "strut", "bar", f"<pose>0.4 0 0 0 0 0</pose>{axis}"),
    ]
    return model(*given, *joints, more)


@pytest.fixture
def write(tmp_path):
    def written(text, name="swing.sdf"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return written


@pytest.mark.parametrize(("last", "redundant"), [("revolute", 3), ("ball", 1), ("universal", 2), ("fixed", 3)])
def test_a_second_parent_closes_a_loop(write, last, redundant):
    cross = "<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz></axis2>"
    found = figures(write(parallelogram(last, cross if last == "universal" else Y)))
    assert found[:2] == (redundant, 0 if last == "fixed" else 1) and found[2] < 1e-12


def test_drakes_ball_constraint_closes_a_loop(write):
    ball = """<drake:ball_constraint><drake:ball_constraint_body_A>bar</drake:ball_constraint_body_A>
      <drake:ball_constraint_body_B>strut</drake:ball_constraint_body_B>
      <drake:ball_constraint_p_AP>0.4 0 0</drake:ball_constraint_p_AP>
      <drake:ball_constraint_p_BQ>0.2 0 0</drake:ball_constraint_p_BQ></drake:ball_constraint>"""
    text = parallelogram(more=ball).replace(
        JOINT.format("s", "revolute", "strut", "bar", f"<pose>0.4 0 0 0 0 0</pose>{Y}"), ""
    )
    assert figures(write(text))[:2] == (1, 1)


def test_frames_and_axes_in_them_are_those_of_a_flat_file(write):
    """The same by poses relative to frames and joints, and an axis in the frame of another link, which is turned."""
    up = "0 0 0 0 -90 0"
    links = [
        '<frame name="feet"><pose degrees="true">0.4 0 0 0 0 30</pose></frame>',
        '<frame name="foot" attached_to="feet"><pose degrees="true">0 0 0 0 0 -30</pose></frame>',
        LINK.format("arm", up, 'degrees="true"'),
        LINK.format("bar", "0.2 0 0 0 90 0", 'relative_to="arm" degrees="true"'),
        LINK.format("strut", up, 'relative_to="foot" degrees="true"'),
    ]
    axis = '<axis><xyz expressed_in="foot">0 1 0</xyz></axis>'
    flat, framed = (describe(write(text, name)) for text, name in (
        (parallelogram(), "flat.sdf"), (parallelogram(axis=axis, links=links), "framed.sdf")))  # fmt: skip
    for one, other in zip(flat.bodies, framed.bodies, strict=True):
        np.testing.assert_allclose(one.centre, other.centre, atol=1e-15)
        np.testing.assert_allclose(one.inertia, other.inertia, atol=1e-15)
    assert figures(write(parallelogram(axis=axis, links=links)))[:2] == (3, 1)


def test_models_in_models_and_static_ones(write):
    """A rod in a model that is turned by 90 degrees about z and moved, on a static post: its pin is along -x."""
    inner = model(LINK.format("rod", "0 0 0 0 0 0", ""), name="inner", around="{}").replace(
        '<model name="inner">', '<model name="inner"><pose>0 0 1 0 0 1.5707963267948966</pose>'
    )
    post = model(LINK.format("base", "0 0 0 0 0 0", ""), "<static>true</static>", name="post", around="{}")
    joint = JOINT.format("pin", "revolute", "world", "inner::rod", Y)
    outer = model(inner, joint, name="outer", around="{}")
    text = f"<sdf version='1.9'><world name='w'><gravity>0 0 -9.81</gravity>{post}{outer}</world></sdf>"
    described = describe(write(text, "post.world"))
    assert [body.name for body in described.bodies] == ["ground", "outer::inner::rod"] and described.gravity == (
        0,
        0,
        -9.81,
    )
    np.testing.assert_allclose(described.joints[0].child.axes[:, 2], [-1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(described.bodies[1].centre, [0, 0.1, 1], atol=1e-15)
    loaded = rx.load_model(write(text, "post.world"))
    solution = rx.solve(loaded.mechanism, loaded.state)
    about = 0.02 + 2 * 0.1**2  # a rod that falls from the horizontal
    np.testing.assert_allclose(abs(float(solution["outer::pin.angle''"])), 2 * 9.81 * 0.1 / about, rtol=1e-12)


def test_a_joint_of_the_world_joins_models(write):
    """A rod on a floating frame: two pins of one axis, the second in the world."""
    links = [model(LINK.format(name, "0 0 0 0 0 0", ""), name=name, around="{}") for name in ("frame", "rod")]
    pins = [JOINT.format(name, "revolute", "frame::frame", "rod::rod", Y) for name in ("a", "b")]
    hold = JOINT.format("c", "fixed", "world", "frame", "")
    text = f"<sdf version='1.11'><world name='w'>{''.join([*links, *pins, hold])}</world></sdf>"
    assert figures(write(text, "w.world"))[:2] == (5, 1)


@pytest.mark.parametrize("several", [False, True])
def test_a_joint_that_mimics_another_of_its_model(write, several):
    """Whichever way round their links are held."""
    links = [LINK.format(name, "0 0 0 0 0 0", "") for name in ("one", "two")]
    numbers = "<multiplier>-2</multiplier><offset>0.1</offset><reference>0.3</reference>"
    mimic = Y.replace("</axis>", f'<mimic joint="lead">{numbers}</mimic></axis>')
    joints = (
        JOINT.format("lead", "revolute", "world", "one", Y),
        JOINT.format("follow", "revolute", "two", "world", mimic),
    )
    pair = model(*links, *joints, name="pair", around="{}")
    other = model(LINK.format("rest", "0 0 0 0 0 0", ""), name="other", around="{}") if several else ""
    (tie,) = describe(write(f"<sdf version='1.11'>{pair}{other}</sdf>")).ties
    assert (tie.first, tie.second) == (((1, 1.0),), ((0, 1.0),))
    np.testing.assert_allclose(tie.polynomial, [-0.7, 2])  # follow = -2 (lead - 0.3) + 0.1, and turned the other way


def test_limits_of_a_joint_that_closes_a_loop_are_stops_too(write):
    """Of the bar as the strut, its parent, sees it, from the pose of the file on."""
    limited = Y.replace("</axis>", "<limit><lower>-0.1</lower><upper>0.2</upper></limit></axis>")
    loaded = rx.load_model(write(parallelogram(axis=limited)))
    (loop,) = loaded.described.loops
    np.testing.assert_allclose(loop.limits, (-0.1, 0.2), atol=1e-12)
    assert loaded.stopped.names.rows.labels[-2:] == ("stop of s.least", "stop of s.most")


@pytest.mark.parametrize(("least", "most"), [(-0.1, 0.2), (-4.0, 3.5), (-np.inf, 4.0), (0.3, 0.5)])
def test_limits_of_a_joint_that_closes_a_loop_bound_motions(write, least, most):
    """The strut, whose angle is that of the arm, sees the bar turn back; angles beyond half a turn are counted on."""
    limited = Y.replace("</axis>", f"<limit><lower>{least}</lower><upper>{most}</upper></limit></axis>")
    tree = Tree(describe(write(parallelogram(axis=limited))))
    found, beyond = travel(tree, tree.reference, 1), outside(tree, tree.reference)
    assert [(each.joint, each.limit) for each in beyond] == ([("s", least)] if least > 0 else [])
    low, high = found.ranges["p"]
    np.testing.assert_allclose((low, min(high, 6.0)), (-most, min(-min(least, 0.0), 6.0)), atol=2e-3)
    assert ("s", most) in found.stops and (("s", least) in found.stops) == (least > -np.inf)


def test_limits_that_are_no_limits(write):
    axis = "<axis><xyz>0 1 0</xyz><limit><lower>-1.79769e+308</lower><upper>1e16</upper></limit></axis>"
    assert describe(write(parallelogram().replace(Y, axis))).joints[0].limits is None


def test_what_acts_in_a_joint_and_a_screw(write):
    acts = """<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>2</upper></limit><dynamics><damping>0.3</damping>
      <friction>0.1</friction><spring_stiffness>5</spring_stiffness><spring_reference>0.4</spring_reference></dynamics></axis>"""
    links = [LINK.format(name, "0 0 0 0 0 0", "") for name in ("door", "nut")]
    nut = "<screw_thread_pitch>0.02</screw_thread_pitch><axis><xyz>0 0 1</xyz></axis>"
    joints = (
        JOINT.format("pin", "revolute", "world", "door", acts),
        JOINT.format("thread", "screw", "world", "nut", nut),
    )
    described = describe(write(model(*links, *joints)))
    pin, (thread,) = described.joints[0], described.loops
    assert (pin.limits, pin.stiffness, pin.rest[0], pin.damping, pin.friction) == ((-1, 2), 5, 0.4, 0.3, 0.1)
    assert described.joints[1].kind == "cylindrical joint" and thread.kind == "thread joint"
    turned = describe(write(model(*links, JOINT.format("pin", "revolute", "door", "world", acts))))
    assert turned.joints[0].limits == (-2, 1) and turned.joints[0].rest[0] == -0.4


@pytest.mark.parametrize(
    ("was", "now", "told"),
    [
        ("<child>bar</child>", "<child>bra</child>", "Did you mean 'bar'"),
        ("<mass>2</mass>", "<mass>-2</mass>", "gives 'arm' a negative mass"),
        ("<mass>2</mass>", "<mass>two</mass>", "must have 1 numbers in <mass>"),
        ("0.4 0 0 0 0 0", "0.4 0 0 0", "must have 6 numbers in the pose"),
        ("0 1 0", "0 0 0", "the axis 0 0 0"),
        ('name="bar"', 'name="arm"', "has the name 'arm' twice"),
        ('name="bar"', "", "without a name"),
        ("<parent>world</parent>", "", "has no parent or child in the joint 'p'"),
        (
            '<model name="swing">',
            '<model name="swing"><include><uri>../../etc/passwd</uri></include>',
            "includes '../../etc/passwd'",
        ),
        ("</axis>", '<mimic joint="p"/></axis>', "makes the joint 'p' mimic itself"),
        ("</axis>", '<mimic joint="q"><multiplier>inf</multiplier></mimic></axis>', "in <multiplier>, but has 'inf'"),
        ("<mass>2</mass>", "<mass>inf</mass>", "in <mass>, but has 'inf'"),
        ("<sdf", '<!DOCTYPE sdf [<!ENTITY a "b">]><sdf', "declares a document type"),
        ("<sdf version='1.9'>", "<robot>", "holds URDF"),
        ("</link>", "", "is no well-formed XML"),
    ],
)
def test_spoiled_files_are_told_in_a_line(write, was, now, told):
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*[.?]\s?[^\n]*$") as caught:
        describe(write(parallelogram().replace(was, now)))
    assert told in str(caught.value)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 0.95])
def test_files_that_are_cut_off_are_told_in_a_line(write, share):
    text = parallelogram()
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*\.$"):
        describe(write(text[: int(share * len(text))]))


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (JOINT.format("odd", "gearbox", "arm", "bar", Y), "joint 'odd' is left out: gearbox"),
        (
            JOINT.format("odd", "universal", "arm", "bar", Y + Y.replace("axis>", "axis2>")),
            "joint 'odd' is left out: its two axes are not square",
        ),
        ("<drake:distance_constraint/>", "<drake:distance_constraint> of 'swing' is left out"),
        (
            '<plugin name="hook" filename="detachable_joint"><child_model>x</child_model></plugin>',
            "plugin 'hook' is left out",
        ),
    ],
)
def test_what_constrains_and_is_not_read_is_undecided(write, more, told, capsys):
    assert command.main(["audit", str(write(parallelogram("ball", more=more)))]) == 4
    assert told in " ".join(capsys.readouterr().out.split())


def test_a_second_axis_that_mimics_is_told(write):
    cross = '<axis><xyz>0 1 0</xyz></axis><axis2><xyz>1 0 0</xyz><mimic joint="p"/></axis2>'
    notes = describe(write(parallelogram("universal", cross))).notes
    assert "mimic of 's' is left out: it is of a second axis; the figures are without it" in notes


def test_names_with_markup_stay_names(write):
    described = describe(write(parallelogram().replace("strut", "&lt;b&gt;&amp;")))
    assert "<b>&" in [body.name for body in described.bodies]


def test_names_with_markup_stay_names_and_masses_that_are_missing_are_told(write):
    text = parallelogram().replace('"bar"', '"&lt;b&gt;&amp;"').replace(">bar<", ">&lt;b&gt;&amp;<")
    found = describe(write(re.sub("<inertial>.*?</inertial>", "", text, count=1, flags=re.DOTALL)))
    assert [body.name for body in found.bodies] == ["ground", "arm", "<b>&", "strut"]
    assert found.bodies[1].mass == 1.0 and "mass of 'arm', which the file does not say: 1 kg" in found.notes[0]


def test_comments_with_dashes_are_read_as_gazebo_reads_them(write):
    """Its own worlds tell in comments what to type, with `--` before options, which strict XML has none of."""
    text = parallelogram().replace("<model", "<!-- gz topic --msgtype gz.msgs.Double -p '<link/>' --->\n<model", 1)
    assert figures(write(text))[:2] == (3, 1)
    assert [each.tag for each in Source(write(text)).root.children[0].children] == ["model"]


@pytest.mark.parametrize(
    "pitch", ["<screw_thread_pitch>0.02</screw_thread_pitch>", "<thread_pitch>-314.159265358979</thread_pitch>"]
)
@pytest.mark.parametrize("ends", [("world", "nut"), ("nut", "world")])
@pytest.mark.parametrize("closes", [False, True])
def test_a_screw_travels_by_its_lead_in_a_tree_and_in_a_loop(write, pitch, ends, closes):
    """A nut of m = 2 kg and J = 0.02 kg m^2 falls along its axis by m g / (m + J / lead^2), and turns by that over the
    lead, right-handed as the child sees it from its parent; a cylindrical screw of the world holds it once or twice."""
    link = LINK.format("nut", "0 0 0 0 0 0", "").replace("0.1 0 0 0 0 0", "0 0 0 0 0 0")
    screws = [
        JOINT.format(name, "screw", *ends, f"{pitch}<axis><xyz>0 0 1</xyz></axis>") for name in ("a", "b")[: 1 + closes]
    ]
    model_ = rx.load_model(write(model(link, *screws)))
    report = rx.analyze(model_.mechanism, model_.state)
    assert (report.redundancy, report.freedom) == (5 * closes, 1) and not model_.notes
    solution, lead = rx.solve(model_.mechanism, model_.state), 0.02 / (2 * np.pi)
    fall = float(solution["a.travel''"])
    np.testing.assert_allclose(abs(fall), 2 * 9.8 / (2 + 0.02 / lead**2), rtol=1e-9)
    np.testing.assert_allclose(fall, lead * float(solution["a.angle''"]), rtol=1e-9)


SLIDE = JOINT.format("lift", "prismatic", "world", "a", "<axis><xyz>0 0 1</xyz></axis>")


def loaded(path):
    found = rx.load_model(path)
    return found, rx.solve(found.mechanism, found.state)


def test_a_link_that_gravity_leaves_alone_is_carried_by_nothing_else(write):
    """Of 2 kg without weight and 2 kg with it, fixed to each other, on a vertical slide: they fall by half of g."""
    links = [LINK.format(name, "0 0 1 0 0 0", "") for name in "ab"]
    links[0] = links[0].replace("<inertial>", "<gravity>false</gravity><inertial>", 1)
    _, solution = loaded(write(model(*links, SLIDE, JOINT.format("weld", "fixed", "a", "b", ""))))
    np.testing.assert_allclose(float(solution["lift.travel''"]), -9.8 / 2, rtol=1e-12)
    np.testing.assert_allclose(float(solution["weld force z on b"]), 2 * 9.8 / 2, rtol=1e-12)


def test_a_kinematic_link_holds_as_the_ground_does(write):
    base = LINK.format("base", "0 0 0 0 0 0", "").replace("<inertial>", "<kinematic>1</kinematic><inertial>", 1)
    slide = SLIDE.replace("world", "base")
    found, solution = loaded(write(model(base, LINK.format("a", "0 0 1 0 0 0", ""), slide)))
    assert [body.name for body in found.described.bodies] == ["ground", "a"]
    assert "motion from outside of 'base': it rests where the file has it" in found.notes
    np.testing.assert_allclose(float(solution["lift.travel''"]), -9.8, rtol=1e-12)


@pytest.mark.parametrize("damped", [0, 1])
def test_what_acts_in_a_cross_is_left_out_and_told(write, damped):
    inside = ["", ""]
    inside[damped] = "<dynamics><damping>3</damping></dynamics>"
    cross = f"<axis><xyz>1 0 0</xyz>{inside[0]}</axis><axis2><xyz>0 1 0</xyz>{inside[1]}</axis2>"
    text = model(LINK.format("a", "0 0 1 0 0 0", ""), JOINT.format("u", "universal", "world", "a", cross))
    assert "spring, damping and friction of u" in loaded(write(text))[0].notes


def test_limits_of_a_cross_are_told(write):
    limit = "<limit><lower>-1</lower><upper>1</upper></limit>"
    cross = f"<axis><xyz>1 0 0</xyz>{limit}</axis><axis2><xyz>0 1 0</xyz></axis2>"
    text = model(LINK.format("a", "0 0 1 0 0 0", ""), JOINT.format("u", "universal", "world", "a", cross))
    assert "limits of 'u': they bear no load here" in loaded(write(text))[0].notes


def test_loops_beside_a_file_that_has_its_own_are_refused(write, capsys):
    path = write(parallelogram())
    with pytest.raises(rx.RedundaxError, match=r"`closures` must be left out.*loops in the file itself"):
        rx.load_model(path, path.with_suffix(".yaml"))
    assert command.main(["drive", str(path), "--law", "p=cycloidal(1, 2)", "--closures", "none.yaml"]) == 2
    assert "`closures` must be left out" in capsys.readouterr().err
