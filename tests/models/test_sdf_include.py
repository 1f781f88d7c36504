"""Models of SDF that are included: where they are found, where they are put, and what is said of those that are not."""

import numpy as np
import pytest

import redundax as rx
from redundax._models._description import missing_of
from redundax._models._edit_sdf import sdf_change, sdf_moves
from redundax._models._formats import describe

Y = "<axis><xyz>0 1 0</xyz></axis>"
LEVER = f"""<sdf version="1.9"><model name="lever"><link name="arm"><pose>0 0 0.1 0 0 0</pose>
  <inertial><mass>2</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
  <frame name="tip" attached_to="arm"><pose>0.3 0 0 0 0 1.5707963267948966</pose></frame>
  <joint name="own" type="revolute"><parent>arm</parent><child>pad</child>{Y}</joint>
  <link name="pad"><pose relative_to="tip"/><inertial><mass>1</mass></inertial></link></model></sdf>"""
IN_A_WORLD = LEVER.replace("<model", '<world name="w"><model').replace("</sdf>", "</world></sdf>")
CONFIG = (
    '<model><sdf version="1.2">old.sdf</sdf><sdf version="1.10">lever.sdf</sdf><sdf version="1.9">no.sdf</sdf></model>'
)
HELD = f'<joint name="pin" type="revolute"><parent>world</parent><child>left::arm</child>{Y}</joint>'


def around(*parts):
    return f'<sdf version="1.9"><model name="rig">{"".join(parts)}</model></sdf>'


def include(uri="model://lever", name="left", more=""):
    return f"<include><uri>{uri}</uri><name>{name}</name>{more}</include>"


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.delenv("GZ_SIM_RESOURCE_PATH", raising=False)

    def written(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return written


def pads(described):
    """Names and poses of the bodies at the ends."""
    return {body.name: (body.position, body.axes) for body in described.bodies if body.name.endswith("pad")}


@pytest.mark.parametrize("where", ["beside", "above", "in a folder of models", "by its path"])
def test_included_models_are_found_and_put_in_their_place(write, tmp_path, monkeypatch, where):
    folder = {"beside": "rig/lever", "above": "lever", "by its path": "rig/lever"}.get(where, "far/models/lever")
    write(f"{folder}/lever.sdf", LEVER)
    write(f"{folder}/model.config", CONFIG)
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", f"/nowhere:{tmp_path / 'far' / 'models'}")
    uri = "lever/lever.sdf" if where == "by its path" else "model://lever"
    poses = [f"<pose>{at}</pose>" for at in ("1 0 0 0 0 0", "0 2 0 0 0 3.141592653589793")]
    both = [include(uri, name, pose) for name, pose in zip(("left", "right"), poses, strict=True)]
    found = describe(write("rig/rig.sdf", around(*both, HELD)))
    assert [joint.name for joint in found.joints if joint.kind == "hinge"] == ["pin", "left::own", "right::own"]
    assert not missing_of(found.notes)
    (left, turned), (right, _) = pads(found).values()
    np.testing.assert_allclose([left, right], [(1.3, 0, 0.1), (-0.3, 2, 0.1)], atol=1e-12)
    np.testing.assert_allclose(turned[:, 0], (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize("how", ["<placement_frame>tip</placement_frame>", "<placement_frame>own</placement_frame>"])
def test_a_model_is_placed_by_a_frame_of_it(write, how):
    """Both frames are those of the pad, which is where the pose says."""
    write("lever/model.sdf", LEVER)
    text = around(include(more=f"{how}<pose>5 0 1 0 0 0</pose>"))
    ((place, axes),) = pads(describe(write("rig.sdf", text))).values()
    np.testing.assert_allclose(place, (5, 0, 1), atol=1e-12)
    np.testing.assert_allclose(axes, np.eye(3), atol=1e-12)


def test_what_is_not_there_leaves_a_model_undecided(write):
    """But for Gazebo's sun and ground, which hold nothing."""
    write("lever/model.sdf", LEVER)
    scenery = [
        include("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Sun", "s"),
        include("model://ground_plane", "g"),
    ]
    path = write("rig.sdf", around(*scenery, include(), include("model://gone", "other"), HELD))
    assert missing_of(describe(path).notes) == ["<include> of 'model://gone'"]
    text = path.read_text().replace("left::arm", "other::arm")
    with pytest.raises(rx.RedundaxError, match=r"names 'other::arm' .* Bring 'model://gone', which it includes: it is"):
        describe(write("rig.sdf", text))


def test_a_world_whose_joints_are_not_there_says_so(write):
    """All that moves is in a file that it includes, and that nothing fetches."""
    still = '<model name="m"><static>1</static><link name="l"/></model>'
    path = write("rig.sdf", f'<sdf><world name="w">{still}{include("https://fuel.gazebosim.org/x3")}</world></sdf>')
    with (
        pytest.warns(UserWarning, match="is read without <include>"),
        pytest.raises(
            rx.RedundaxError, match=r"no joints beside <include> of 'https://fuel\.gazebosim\.org/x3', which"
        ),
    ):
        rx.load_model(path)


@pytest.mark.parametrize(
    ("uri", "more", "told"),
    [
        ("/etc/passwd", "", "includes '/etc/passwd', which is neither beside it nor in a folder of GZ_SIM"),
        ("model://../../../../etc", "", "neither beside it nor in a folder"),
        ("rig.sdf", "", "files in files. Does one include itself"),
        ("several.sdf", "", "which has 2 models"),
        ("cut.sdf", "", "is no well-formed XML"),
        ("typed.sdf", "", "declares a document type"),
        ("", "", "'rig.sdf' has an <include> without a <uri>"),
        ("model://gone", "", "has no <model> but what it includes, 'model://gone': it is neither beside"),
        ("merge model://lever", "", "and merges it into a world, which has no links of its own"),
        (
            "merge model://lever",
            "<placement_frame>top</placement_frame><pose/>",
            "places it by 'top', which it has none",
        ),
        ("world.sdf", "", "has no <model> but what it includes, 'world.sdf': it holds <world> in place of a <model>"),
    ],
)
def test_includes_that_are_spoiled_are_told_in_a_line(write, uri, more, told):
    write("several.sdf", '<sdf><model name="a"/><model name="b"/></sdf>')
    write("cut.sdf", LEVER[:90])
    write("typed.sdf", "<!DOCTYPE sdf>" + LEVER)
    write("world.sdf", f'<sdf version="1.9"><world name="w">{LEVER[LEVER.index("<model") : -6]}</world></sdf>')
    write("lever/model.sdf", LEVER)
    path = write("rig.sdf", f'<sdf version="1.9"><world name="w">{include(uri, more=more)}</world></sdf>')
    if uri.startswith("merge "):
        text = merged(uri.removeprefix("merge "), more)
        path = write("rig.sdf", around(text) if more else f'<sdf version="1.9"><world name="w">{text}</world></sdf>')
    if uri == "rig.sdf":
        path = write("rig.sdf", around(include(uri)))
    with pytest.raises(rx.RedundaxError, match=r"^Argument `path`: [^\n]*[.?]$") as caught:
        describe(path)
    assert told in str(caught.value).replace(f"{path.parent}/", "")


@pytest.mark.parametrize("text", [IN_A_WORLD, "<sdf/>", "<robot/>"])
def test_a_file_without_a_model_of_its_own_leaves_a_model_undecided(write, text):
    """Gazebo reads no model inside of a world that is included; a light holds nothing."""
    write("lever/model.sdf", LEVER)
    write("sky.sdf", '<sdf><light name="l"/></sdf>')
    write("other.sdf", text)
    path = write("rig.sdf", around(include("sky.sdf", "s"), include("other.sdf", "o"), include(), HELD))
    assert missing_of(describe(path).notes) == ["<include> of 'other.sdf'"]


@pytest.mark.parametrize("uri", ["model://sun", "sun", "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Sun"])
def test_a_model_by_the_name_of_scenery_is_read_where_it_is_there(write, uri):
    """As a wheel of a planetary gear; what is beside the file and is not there is told, whatever its name."""
    is_fuel = uri.startswith("https")
    write("lever/model.sdf", LEVER)
    path = write("rig.sdf", around(include(), include(uri, "gear"), HELD))
    assert missing_of(describe(path).notes) == ([f"<include> of '{uri}'"] if uri == "sun" else [])
    write("sun/model.sdf", LEVER)
    found = describe(path)
    assert ("gear::own" in [joint.name for joint in found.joints]) is not is_fuel
    assert not missing_of(found.notes)


@pytest.mark.parametrize("word", ["true", "True", "TRUE", " 1 "])
def test_booleans_are_read_in_letters_of_any_case(write, word):
    write("lever/model.sdf", LEVER)
    still = write("still.sdf", around(include(more=f"<static>{word}</static>")))
    merging = write("rig.sdf", around(merged(word=word), HELD.replace("left::", "")))
    assert not describe(still).bodies[1:]
    assert {body.name for body in describe(merging).bodies[1:]} == {"arm", "pad"}


PARTS = """<sdf version="1.9"><model name="m" {}>{}<static>true</static><link name="L1"/><frame name="F1"/>
  <frame name="F2"><pose relative_to="__model__">0 0 1 0 0 0</pose></frame>
  <link name="L2"><pose relative_to="F2">0 2 0 0 0 0</pose></link>
  <joint name="A" type="revolute"><parent>__model__</parent><child>L2</child>
    <axis><xyz expressed_in="__model__">1 0 0</xyz></axis></joint>
  <joint name="B" type="revolute"><pose relative_to="__model__">0 0 3 0 0 0</pose>
    <parent>F1</parent><child>in::L3</child><axis><xyz>1 0 0</xyz>
    <use_parent_model_frame>1</use_parent_model_frame></axis></joint>
  <model name="in"><link name="L3"><pose>0.5 0 0 0 0 0</pose></link></model></model></sdf>"""
# As SDFormat's proposal of merging writes the result, by hand; its pose turns by a quarter about z.
BY_HAND = """<frame name="_merged__m__model__" attached_to="L1">
    <pose relative_to="base">100 0 0 0 0 1.5707963267948966</pose></frame>
  <link name="L1"><pose relative_to="_merged__m__model__"/></link>
  <frame name="F1" attached_to="_merged__m__model__"/>
  <frame name="F2" attached_to="_merged__m__model__"><pose relative_to="_merged__m__model__">0 0 1 0 0 0</pose></frame>
  <link name="L2"><pose relative_to="F2">0 2 0 0 0 0</pose></link>
  <joint name="A" type="revolute"><parent>_merged__m__model__</parent><child>L2</child>
    <axis><xyz expressed_in="_merged__m__model__">1 0 0</xyz></axis></joint>
  <joint name="B" type="revolute"><pose relative_to="_merged__m__model__">0 0 3 0 0 0</pose>
    <parent>F1</parent><child>in::L3</child><axis><xyz expressed_in="_merged__m__model__">1 0 0</xyz></axis></joint>
  <model name="in"><pose relative_to="_merged__m__model__"/><link name="L3"><pose>0.5 0 0 0 0 0</pose></link></model>"""
BASE = '<frame name="base"><pose>0 0 7 0 0 0</pose></frame>'


def merged(uri="model://lever", more="", word="true"):
    return f'<include merge="{word}"><uri>{uri}</uri>{more}</include>'


def test_a_model_that_is_merged_stands_in_the_model_around_it(write):
    """As SDFormat's proposal writes it out; where it is: a quarter turn takes (0, 2, 1) to (-2, 0, 1)."""
    pose = '<pose relative_to="base">100 0 0 0 0 1.5707963267948966</pose>'
    write("m/model.sdf", PARTS.format("", ""))
    one, other = (
        describe(write(name, around(BASE, text)))
        for name, text in (("a.sdf", merged("model://m", pose)), ("b.sdf", BY_HAND))
    )
    places = {body.name: body.position for body in one.bodies}
    assert [*places] == ["ground", "L1", "L2", "in::L3"] and not missing_of(one.notes)
    np.testing.assert_allclose(places["L2"], (98, 0, 8), atol=1e-12)
    np.testing.assert_allclose(places["in::L3"], (100, 0.5, 7), atol=1e-12)
    for mine, theirs in zip(one.joints, other.joints, strict=True):
        assert (mine.name, mine.kind, mine.parent.body) == (theirs.name, theirs.kind, theirs.parent.body)
        for end in ("child", "parent"):
            for what in ("point", "axes"):
                ours, right = (getattr(getattr(each, end), what) for each in (mine, theirs))
                np.testing.assert_allclose(ours, right, atol=1e-12)
    np.testing.assert_allclose([joint.child.axes[:, 2] for joint in one.joints[1:]], [(0, 1, 0)] * 2, atol=1e-12)


@pytest.mark.parametrize(
    ("own", "more"),
    [
        ('placement_frame="F2"', "<pose>5 0 0 0 0 0</pose>"),
        ("", "<placement_frame>F2</placement_frame><pose>5 0 0 0 0 0</pose>"),
        ('placement_frame="L1"', "<placement_frame>in::L3</placement_frame><pose>5.5 0 -1 0 0 0</pose>"),
    ],
)
def test_a_merged_model_is_placed_by_a_frame_of_it(write, own, more):
    """F2 is 1 m above the model's frame, and L3 0.5 m beside."""
    write("m/model.sdf", PARTS.format(own, "<pose>9 9 9 0 0 0</pose>"))
    places = {body.name: body.position for body in describe(write("rig.sdf", around(merged("model://m", more)))).bodies}
    np.testing.assert_allclose(places["L1"], (5, 0, -1), atol=1e-12)
    np.testing.assert_allclose(places["in::L3"], (5.5, 0, -1), atol=1e-12)


def test_a_model_of_models_is_merged_into_a_world(write):
    inner = '<model name="{}"><link name="L"><pose>0 {} 0 0 0 0</pose></link></model>'
    hinge = f'<joint name="A" type="revolute"><parent>F</parent><child>two::L</child>{Y}</joint>'
    frame = '<frame name="F"><pose>0 0 4 0 0 0</pose></frame>'
    held = '<joint name="B" type="fixed"><parent>W</parent><child>one::L</child></joint>'
    write(
        "m/model.sdf",
        f'<sdf><model name="m">{inner.format("one", 1)}{inner.format("two", 2)}{frame}{hinge}</model></sdf>',
    )
    world = f'<frame name="W"/>{merged("model://m", "<pose>0 0 3 0 0 0</pose>")}{held}'
    found = describe(write("rig.sdf", f'<sdf version="1.10"><world name="w">{world}</world></sdf>'))
    assert {(joint.name, found.parent(joint), found.child(joint)) for joint in found.joints} == {
        ("B", "ground", "one::L"), ("A", "one::L", "two::L"),
    }  # fmt: skip
    np.testing.assert_allclose([body.position for body in found.bodies[1:]], [(0, 1, 3), (0, 2, 3)], atol=1e-12)


def test_a_copy_changes_what_stands_in_the_file_alone(write, tmp_path):
    write("lever/model.sdf", LEVER)
    model = rx.load_model(write("rig.sdf", around(include(), HELD)))
    moves = sdf_moves(model)
    assert {move.name for move in moves} == {"pin"}
    sdf_change(model, [next(move for move in moves if move.kind == "ball")], tmp_path / "copy.sdf").write()
    kinds = {joint.name: joint.kind for joint in describe(tmp_path / "copy.sdf").joints}
    assert kinds == {"pin": "ball", "left::own": "hinge"}
