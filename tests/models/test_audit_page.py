"""The page of an audit: one file that loads nothing, and a clear line where what draws it is missing."""

import contextlib
import io
import json
import math
import re
import sys

import pytest

from redundax import __main__ as command

pytest.importorskip("mujoco")
DOOR = """<mujoco><worldbody><body name="leaf &lt;i&gt;"><joint name="pin" axis="0 0 1"/>
  <geom type="box" size="0.4 0.02 1" pos="0.4 0 1"/><site name="top" pos="0 0 2"/></body>
  <site name="frame" pos="0 0 2"/></worldbody>
  <equality><connect name="upper" site1="top" site2="frame"/></equality></mujoco>"""
RED = re.compile(r'"color": ?"#F2814B"', re.IGNORECASE)
GREEN = re.compile(r'"color": ?"#5FC9A8"', re.IGNORECASE)
PLANAR = """
import redundax as rx
def build():
    mechanism = rx.mechanisms.parallelogram()
    return mechanism, mechanism.state(phi=0.5)
"""


def run(*arguments):
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        status = command.main(["audit", *map(str, arguments)])
    return status, out.getvalue(), error.getvalue()


def test_the_page_has_the_text_and_the_mechanism_and_loads_nothing(tmp_path):
    pytest.importorskip("plotly")
    (tmp_path / "door.xml").write_text(DOOR)
    page = tmp_path / "door.html"
    status, out, error = run(tmp_path / "door.xml", "--html", page)
    assert status == 3 and f"written: {page}" in error
    text = page.read_text()
    assert "REDUNDANT by 3" in out and "REDUNDANT by 3" in text
    assert "leaf <i>" not in text.partition("<script")[0]
    assert not re.search(r"<(?:script|link|img)[^>]*(?:src|href)=\"(?!data:)", text)
    assert RED.search(text) and not GREEN.search(text)


@pytest.mark.slow
def test_a_planar_mechanism_has_a_picture(tmp_path):
    pytest.importorskip("plotly")
    (tmp_path / "own.py").write_text(PLANAR)
    page = tmp_path / "own.html"
    assert run(f"{tmp_path / 'own.py'}:build", "--html", page)[0] in (0, 3)
    assert 'src="data:image/png;base64,' in page.read_text()


def test_what_is_unique_of_a_mechanism_of_ones_own_is_told_by_its_rows(tmp_path):
    """Cranks side by side hold each other along themselves: square to that, (-sin 0.5, cos 0.5), all is unique."""
    (tmp_path / "own.py").write_text(PLANAR)
    status, out, _ = run(f"{tmp_path / 'own.py'}:build")
    assert status == 3 and f"A1: force {-math.sin(0.5):+.3g} x {math.cos(0.5):+.3g} y" in out


def test_a_missing_package_is_told_before_anything_is_computed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    (tmp_path / "door.xml").write_text(DOOR)
    status, out, error = run(tmp_path / "door.xml", "--html", tmp_path / "door.html")
    assert (status, out) == (2, "")
    assert error == 'redundax: --html: This needs the package plotly: pip install "redundax[html]".\n'
    assert not (tmp_path / "door.html").exists()


ARM = """<body name="{name}" pos="0 {y} 0"><joint name="{name}" axis="0 1 0" {limits}/>
  <geom type="sphere" size="0.1" mass="2" pos="0.5 0 0"/></body>"""


def arms(limits, coupled=False):
    parts = "".join(ARM.format(name=name, y=y, limits=limits) for name, y in (("a", 0), ("b", 1)))
    tie = '<equality><joint joint1="a" joint2="b"/></equality>' if coupled else ""
    return f"<mujoco><worldbody>{parts}</worldbody>{tie}</mujoco>"


@pytest.mark.slow
def test_stops_tell_what_joint_limits_bear(tmp_path):
    """Arms of 2 kg reach 0.5 m out, and their limit keeps them from falling; ones that are tied share as they like."""
    file = tmp_path / "arms.xml"
    file.write_text(arms('range="-90 0"'))
    status, out, _ = run(file, "--stops")
    assert status == 0
    assert "With joint limits as stops, at rest and let go: 0 redundant, 0 free; 2 of 4\n  stops are open." in out
    assert "  a.most carries 9.81 N m, unique\n" in out
    assert "bear no load here" not in out and "bear no load here" in run(file)[1]
    file.write_text(arms('range="-90 0"', coupled=True))
    stops = json.loads(run(file, "--stops", "--json")[1])["stops"]
    assert (stops["redundancy"], stops["freedom"]) == (1, 0)
    loads = [stops["stops"][f"{name}.most"] for name in "ab"]
    assert sum(stop["load"] for stop in loads) == pytest.approx(2 * 9.81, rel=1e-9)
    assert not any(stop["unique"] for stop in loads)
    file.write_text(arms('range="0 90"'))
    assert "  a.least and b.least: lifts\n" in run(file, "--stops")[1]
    file.write_text(arms(""))
    assert "Stops: the file limits no hinge and no slide." in run(file, "--stops")[1]
    assert "Stops" not in run(file)[1]
