"""Files that are not what their names say, that hold what no body has, or what MuJoCo does not know."""

import gzip
import json

import numpy as np
import pytest

import redundax as rx
from redundax._command._audit import _check_size
from redundax._command._copy import check_copy
from redundax._command._file import FileError
from redundax._models import _formats
from redundax._models._assembly import Frame, Held
from redundax._models._audit_page import audit_page
from redundax._models._examine import examine
from redundax._models._formats import describe, not_a_model
from redundax._models._reader import AbstractReader
from redundax._models._repair import language

pytest.importorskip("mujoco")

PIN = '<joint name="A"/><geom size="0.1"/>'
BAR = f'<mujoco>{{}}<worldbody><body name="a">{PIN}</body></worldbody>{{}}</mujoco>'
PLAIN = BAR.format("", "")
LATIN = f'<?xml version="1.0" encoding="ISO-8859-1"?>\n{PLAIN}'
ARM = (
    '<robot name="r"><link name="base"/><link name="l"><inertial><mass value="{}"/>'
    '<inertia ixx="{}" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="l"/></joint></robot>'
)
INERTIAL = (
    '<mujoco><worldbody><body name="l"><joint/><inertial pos="0 0 0" mass="{}" diaginertia="{} 1 1"/></body>'
    "</worldbody></mujoco>"
)


@pytest.fixture
def write(tmp_path):
    def written(name, content):
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return tmp_path / name

    return written


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.xml", "", "is empty"),
        ("a.xml", gzip.compress(PLAIN.encode(), mtime=0), "is compressed. Unpack it"),
        ("a.xml", "version https://git-lfs.github.com/spec/v1\n", "Run `git lfs pull`"),
        ("a.xml", PLAIN.encode("utf-16"), "is in UTF-16. Save it in UTF-8"),
        (
            "a.xml",
            LATIN.replace('"A"', '"grün"').encode("latin-1"),
            "but in ISO-8859-1 as it says: see line 2",
        ),
        ("a.urdf", ARM.format(1, 1).replace('"j"', '"grün"').encode("latin-1"), "is not in UTF-8: see line 1"),
        ("a.xml", "hello", "holds no XML: it begins with b'hello'"),
        ("a.xml", "<!DOCTYPE html>\n<html/>", "its first element is <html>"),
        ("a.xml", '<?xml version="1.0"?><!-- <mujoco> --><sdf/>', "holds SDF, by its first element <sdf>"),
        ("a.xml", "<mujocoinclude/>", "is a part of MJCF, <mujocoinclude>. Name the file that includes it"),
        ("a.xml", "<Mujoco/>", "Did you mean 'mujoco'?"),
        ("a.xml", ARM.format(1, 1), "holds URDF, by its first element <robot>. Rename it to end in .urdf"),
        ("a.xml", PLAIN[:-9], "is no well-formed XML: no element found: line 1"),
        ("a.xml", "<mujoco><worldbody>" + "<body>" * 1000, "Shorten chains of bodies"),
        ("a.xml", "<mujoco><worldbody>" + "<body/>" * 20_001, "has 20001 bodies"),
        (
            "a.xml",
            BAR.replace('"a"', '"arm"').format("", '<equality><connect body1="amr" anchor="0 0 0"/></equality>'),
            "mean 'arm'?",
        ),
        (
            "a.xml",
            PLAIN.replace("<geom", "<geon"),
            "right for another version or program, take that out",
        ),
        ("a.step", "ISO-10303-21;", "is geometry without joints"),
    ],
)
def test_what_a_file_is_and_what_to_do_is_told(write, name, content, told):
    file = write(name, content)
    with pytest.raises(rx.RedundaxError) as error:
        describe(file)
    assert told in str(error.value) and str(file) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["a.slx", "b.XACRO", "c.sldasm", "d.xml.gz", "e.wbt", "f.stp", "g.yaml"])
def test_other_formats_are_known_by_their_endings(name):
    assert not_a_model(name)
    assert not any(map(not_a_model, ("a.xml", "a.urdf", "a.usd", "a.mjcf", "a.py", "a.py:m", "a")))


@pytest.mark.parametrize(("template", "name"), [(ARM, "a.urdf"), (INERTIAL, "a.xml")])
@pytest.mark.parametrize(
    ("mass", "inertia", "told"),
    [
        ("-1", "1", "gives 'l' the mass -1"),
        ("nan", "1", "gives 'l' the mass nan"),
        ("inf", "1", "gives 'l' the mass inf"),
        ("1", "-1", "gives 'l' the inertia -1"),
        ("1", "nan", "nan"),
        ("1", "inf", "gives 'l' the inertia inf"),
    ],
)
def test_masses_and_inertias_that_no_body_has_are_refused(write, template, name, mass, inertia, told):
    with pytest.raises(rx.RedundaxError, match=r"Give a positive number|Correct it") as error:
        describe(write(name, template.format(mass, inertia)))
    assert told in str(error.value)


PLUGIN = '<extension><plugin plugin="my.own"><instance name="i"/></plugin></extension>'
DRIVEN = '<actuator><plugin name="drive" joint="A" plugin="my.own" instance="i" actdim="1"/></actuator>'


def test_plugins_and_attributes_of_defaults_that_mujoco_does_not_know_are_left_out(write, tmp_path):
    """Drives of plugins still drive; included files are read alike, from where they are."""
    (tmp_path / "parts").mkdir()
    write("parts/part.xml", f'<mujocoinclude>{PLUGIN}<default group="1"><geom group="2"/></default></mujocoinclude>')
    described = describe(write("a.xml", BAR.format('<include file="parts/part.xml"/>', DRIVEN)))
    assert (len(described.joints), described.drives) == (1, ("drive",))
    assert list(described.notes[:2]) == [
        "plugins: my.own, whose forces do not act here",
        'attributes of defaults, which MuJoCo does not know: group="1"',
    ]


def test_pictures_and_muscles_need_nothing_that_is_left_out(write):
    """A light and materials have pictures, and a muscle lengths that MuJoCo looks for; here it finds none."""
    light = '<asset><texture name="sky" type="cube" builtin="flat" width="8" height="8"/><material name="m"/></asset>'
    bar = '<body><joint name="A" axis="1 0 0"/><geom size="0.1" pos="0 0 1"/><site name="end" pos="0 0 1"/></body>'
    muscle = '<tendon><spatial name="t" material="m"><site site="foot"/><site site="end"/></spatial></tendon>'
    muscle += '<actuator><muscle name="m" tendon="t"/></actuator>'
    world = f'<worldbody><light type="image" texture="sky"/><site name="foot" material="m"/>{bar}</worldbody>'
    described = describe(write("a.xml", f"<mujoco>{light}{world}{muscle}</mujoco>"))
    assert (len(described.joints), described.drives) == (1, ("m",))


@pytest.mark.parametrize("name", ["a.mjcf", "a.XML", "b.URDF"])
def test_endings_that_mujoco_does_not_know_are_read_as_said(write, name):
    assert len(describe(write(name, ARM.format(1, 1) if name.startswith("b") else PLAIN)).joints) == 1


def test_a_large_model_is_told_early_or_refused(capsys):
    _check_size(100)
    assert capsys.readouterr().err == ""
    _check_size(1000)
    assert "1000 bodies that move: matrices of 0.3 GB" in capsys.readouterr().err
    with pytest.raises(FileError, match="4000 bodies that move: an audit has matrices of 5 GB"):
        _check_size(4000)


class Doors(AbstractReader):
    """A file of heights of hinges of one door, and of what else holds it."""

    form = "Doors"

    def _begin(self, path):
        self._root = json.loads(path.read_text())
        self._add("door", Frame(np.array([0.5, 0.0, 1.0]), np.eye(3)), (20.0, np.zeros(3), np.eye(3)))

    def described(self):
        held = []
        for name, height in self._root["hinges"].items():
            at = Frame(np.array([0.0, 0.0, height]), np.eye(3))
            held.append(Held(name, "hinge", (1, self._poses[1].back().of(at)), (0, at), 0.0))
        for name in self._root["others"]:
            self._leave_out(name, "nothing here is of its kind")
        return self._described(self._assembled(held), (0.0, 0.0, -9.81))


def test_a_reader_and_an_entry_are_a_format_all_told(write, monkeypatch):
    """A door on three hinges has ten loads too many; what is known of copies of it is that none are written."""
    form = _formats.Format("Doors", (".door",), lambda path, _: Doors(path).described(), first=(b"{",))
    monkeypatch.setattr(_formats, "FORMATS", (*_formats.FORMATS, form))
    file = write("a.door", json.dumps({"hinges": {"a": 0.2, "b": 1.0, "c": 1.8}, "others": ["latch"]}))
    with pytest.warns(UserWarning, match="without latch"):
        model = rx.load_model(file)
    found = examine(model, 1)
    assert found.figures == (10, 1)
    text = audit_page(found, None, lines={}, language=language(model).name)
    assert "REDUNDANT by 10" in text and "free what each line names" in text
    with pytest.raises(FileError, match="`--fix` copies"):
        check_copy(str(file), None, file.with_name("b.door"))
