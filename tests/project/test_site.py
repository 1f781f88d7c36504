"""The site: its links lead somewhere, and its search finds what engineers call things."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from links import dead

DOCS = Path(__file__).parents[2] / "docs"


def test_links_that_lead_nowhere_are_listed(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "picture.png").touch()
    (tmp_path / "in" / "one.html").write_text(
        """<h1 id="top">One</h1> <a href="#top">up</a> <a href="../two.html#there">two</a> <img src="../picture.png">
        <a href="https://example.org/none">out</a> <a href="#down">down</a> <a href="../two.html#here">two</a>
        <img src="none.png"> <a href="/none.html">root</a>""",
        encoding="utf8",
    )
    (tmp_path / "two.html").write_text("""<p id="there">Two</p> <a href="in/one.html?q=1#top">one</a>""")
    wrong = ["#down", "../two.html#here", "none.png", "/none.html"]
    assert dead(tmp_path) == [f"in/one.html: {link}" for link in wrong]


@pytest.mark.slow
def test_the_site_is_whole():
    """Built without its examples, which tests of their own run."""
    pytest.importorskip("zensical")
    built = subprocess.run([sys.executable, DOCS / "build.py", "--quick"], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    assert dead(DOCS / "site") == []
    items = json.loads((DOCS / "site" / "search.json").read_text(encoding="utf8"))["items"]
    texts = [f"{item['title']} {item['text']}".lower() for item in items]
    for words in ("inverse dynamics", "backlash", "load sharing", "required torque", "bushing", "kinematic loop"):
        assert any(words in text for text in texts), words
