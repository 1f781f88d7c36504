"""The page of an audit: one file that loads nothing, and a clear line where what draws it is missing."""

import contextlib
import io
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


def test_a_missing_package_is_told_before_anything_is_computed(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.graph_objects", None)
    (tmp_path / "door.xml").write_text(DOOR)
    status, out, error = run(tmp_path / "door.xml", "--html", tmp_path / "door.html")
    assert (status, out) == (2, "")
    assert error == 'redundax: --html: This needs the package plotly: pip install "redundax[html]".\n'
    assert not (tmp_path / "door.html").exists()
