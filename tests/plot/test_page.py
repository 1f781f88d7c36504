"""The command `report`: pages that read the same as HTML and Markdown, load nothing, and escape what users write."""

import base64
import contextlib
import html
import html.parser
import io
import re

import numpy as np
import pytest

import redundax as rx
from redundax.__main__ import main
from redundax._command._file import load
from redundax.plot._page._blocks import Code, Items, Page, Picture, Section, Table, Text
from redundax.plot._page._formats import as_html, as_markdown

NASTY = '<b>&"it\'s"|*'  # a name that must come out as it is
FILE = f"""
import jax.numpy as jnp

import redundax as rx


def sledge(height=0.0, friction=None, speed=1.0):  # on three pins in slots of one line
    name, pins = {NASTY!r}, (("left", -0.2), ("middle", 0.0), ("right", 0.3))
    slots = [rx.PinInSlot(pin, name, "ground", (x, 0), (0, 0), (0, 1), friction=friction) for pin, x in pins]
    mechanism = rx.Mechanism([rx.Body(name, 2.0, 0.1)], slots, gravity=(0.0, -9.81))
    return mechanism, rx.State([0.1, height, 0.0], [speed, 0.0, 0.0])


def steered():  # turns to 1e-17, as `assemble` leaves it
    mechanism, state = sledge(friction=rx.Coulomb(0.1))
    return mechanism, rx.State([0.1, -3e-17, 2e-17], [1.0, 1e-18, -4e-17])


def lifted():
    return sledge(height=0.01)


def rough():
    return sledge(friction=rx.Coulomb(0.1))


def resting():
    return sledge(friction=rx.Coulomb(0.1), speed=0.0)


def free(q, d):
    return jnp.concatenate([q[:3] + d[:3], q[3:] + jnp.pad(d[3:], (1, 0)) / 2])


def chart():  # a body in space: 7 coordinates, 6 velocities
    kinds = ["linear"] * 3 + ["angular"] * 3
    body = rx.System(lambda q, t, p: q[:1], jnp.ones(6), coordinates=kinds, rows="force", m=1, retraction=free)
    return body, rx.State([0.0, 1.5, 0, 1, 0, 0, 0], [0.0, 0, 0, 0, 0, 2.5])
"""
KINDS = ["linear"] * 3 + ["angular"] * 3
VOID = {"img", "meta"}
PNG = b"\x89PNG\r\n"


class Reader(html.parser.HTMLParser):
    """Collects tags, attributes and text; complains where tags do not close in order."""

    def __init__(self, text):
        html.parser.HTMLParser.__init__(self)
        self.open, self.tags, self.text = [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text.append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def run(*arguments):
    error = io.StringIO()
    with contextlib.redirect_stderr(error):
        status = main([str(argument) for argument in arguments])
    return status, error.getvalue()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Both formats of one report."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "mine.py").write_text(FILE)
    for name in ("page.html", "page.md"):
        status, told = run("report", f"{folder}/mine.py:sledge", "-o", folder / name, "--samples", 5)
        assert status == 0
        assert f"written: {folder / name}" in told
    return folder


@pytest.fixture(scope="module")
def page(folder):
    return Reader((folder / "page.html").read_text(encoding="utf-8"))


def test_html_stands_alone(page):
    assert page.all("html") == [{"lang": "en"}]
    assert not {"script", "link", "iframe", "object"} & {tag for tag, _ in page.tags}
    assert {name for _, attributes in page.tags for name in attributes} <= {
        "lang", "charset", "name", "content", "class", "alt", "src", "id", "href",
    }  # fmt: skip
    assert "width=device-width" in page.all("meta")[1]["content"]


def test_contents_lead_to_every_section(page):
    """The links of the list, in order, are the sections, whose titles they carry; and no id occurs twice."""
    links = [attributes["href"] for attributes in page.all("a")]
    sections = [attributes["id"] for attributes in page.all("section")]
    assert links == [f"#{section}" for section in sections] and len(set(sections)) == len(sections) == 8
    cells = [text for text in page.text if text.strip()]
    titles = cells[cells.index("In short") :][: len(links)]
    assert [cells.count(title) for title in titles[1:]] == [2] * 7
    assert titles.index("Motion and loads") < titles.index("What is unique and what is not") < titles.index("The state")


def test_html_addresses_nothing(folder):
    assert not re.search(r"https?://|url\(|@import", (folder / "page.html").read_text(encoding="utf-8"))


def test_every_picture_is_inside_and_told_in_words(page):
    pictures = page.all("img")
    assert len(pictures) == 4  # the mechanism, the spectrum, self-stress, loads
    for picture in pictures:
        kind, _, data = picture["src"].partition(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(PNG)
        assert len(picture["alt"]) > 20


def test_names_come_out_as_written(page):
    assert f"{NASTY}.x''" in page.text
    assert any(NASTY in picture["alt"] for picture in page.all("img"))


def test_the_report_is_told(page):
    text = " ".join(page.text)
    for words in (
        "3 constraints of rank 2: 1 redundant, 1 degree of freedom.",
        "not unique",
        "Moore-Penrose",
        "redundax report",
        "--samples 5",
        "SHA-256",
        "right",
    ):
        assert words in text


def test_markdown_has_the_same_content(folder, page):
    text = (folder / "page.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(<(.*?)>\)", text)
    assert len(pictures) == len(page.all("img"))
    assert all((folder / name).read_bytes().startswith(PNG) for name in pictures)
    words = re.sub(r"\\(.)", r"\1", text)
    for told in filter(str.strip, page.text):
        if "page.html" not in told:
            assert " ".join(told.split()) in words or told.strip() in words


def test_a_chart_has_positions_and_velocities_of_its_own(folder):
    status, _ = run("report", f"{folder}/mine.py:chart", "-o", folder / "chart.html")
    text = Reader((folder / "chart.html").read_text(encoding="utf-8")).text
    assert status == 0
    cells = [cell for cell in text if cell.strip()]
    positions = cells[cells.index("position") + 1 : cells.index("Velocities")]
    assert positions == [cell for k, q in enumerate(("0", "1.5", "0", "1", "0", "0", "0")) for cell in (str(k), q)]
    velocities = cells[cells.index("Velocities") + 4 :][:18]
    assert velocities == [cell for k in range(6) for cell in (str(k), "2.5" if k == 5 else "0", KINDS[k])]


def cells_of(text):
    """The texts of a page that say something."""
    return [cell for cell in text if cell.strip()]


@pytest.mark.slow
def test_what_rounding_leaves_is_zero(folder):
    """The turn and lift of 1e-17 that a solver leaves are printed as 0, in the table of the state too."""
    assert run("report", f"{folder}/mine.py:steered", "-o", folder / "steered.html", "--samples", 5)[0] == 0
    cells = cells_of(Reader((folder / "steered.html").read_text(encoding="utf-8")).text)
    numbers = [cell for cell in cells if re.fullmatch(r"-?\d[\d.]*(e[-+]\d+)?", cell)]
    assert len(numbers) > 20
    assert not [cell for cell in numbers if 0 < abs(float(cell)) < 1e-12]
    place = cells.index(f"{NASTY}.phi")
    assert cells[place : place + 4] == [f"{NASTY}.phi", "0", "0", "angular"]


@pytest.mark.slow
def test_a_page_begins_with_ranges_under_the_preload_that_it_states(folder):
    """Pins in slots of one line carry any multiple of each other's load: the widest range is told, and over what."""
    wish = ("--amplitude", 7, "--samples", 5)
    assert run("report", f"{folder}/mine.py:rough", "-o", folder / "given.html", *wish)[0] == 0
    cells = cells_of(Reader((folder / "given.html").read_text(encoding="utf-8")).text)
    told = cells[cells.index("In short", 3) : cells.index("The mechanism", 9)]
    assert "Where self-stress is added, up to 7 at left.perpendicular, as was asked for, these vary most:" in told
    ranges = [line.rpartition(": ") for line in told if " to " in line and ": " in line and "self" not in line]
    assert ranges
    table = cells[cells.index("minimum norm") :]
    for name, _, ends in ranges:
        assert ends.split(" to ") == table[table.index(name) + 2 :][:2], name


def test_friction_has_one_sense(page):
    text = " ".join(page.text)
    assert "The model has no friction." in text
    assert "without friction" not in text.replace("joint load without friction", "")


def test_a_problem_is_told(folder):
    status, _ = run("report", f"{folder}/mine.py:lifted", "-o", folder / "lifted.html")
    text = " ".join(Reader((folder / "lifted.html").read_text(encoding="utf-8")).text)
    assert status == 1
    assert "Problem: The state does not satisfy the constraints" in text
    assert "minimum norm" not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "status", "pictures", "words"),
    [
        ("rough", 0, 5, "changes with self-stress state 0 through friction"),
        ("resting", 1, 3, "friction can take any value"),
    ],
)
def test_friction_is_told(folder, name, status, pictures, words):
    file = folder / f"{name}.html"
    assert run("report", f"{folder}/mine.py:{name}", "-o", file, "--samples", 5)[0] == status
    page = Reader(file.read_text(encoding="utf-8"))
    assert words in " ".join(page.text)
    assert len(page.all("img")) == pictures


@pytest.mark.parametrize(
    ("output", "words"), [("page.txt", "must end in .html or .md"), ("nowhere/page.html", "no nowhere")]
)
def test_wrong_output(output, words, capsys):
    with pytest.raises(SystemExit) as end:
        main(["report", "mine.py:sledge", "-o", output])
    assert end.value.code == 2
    assert words in capsys.readouterr().err


def test_a_wrong_file_is_told(tmp_path):
    status, error = run("report", f"{tmp_path}/absent.py:sledge", "-o", tmp_path / "page.html")
    assert status == 2
    assert "no file" in error
    assert not list(tmp_path.iterdir())


def test_every_block_in_both_formats():
    blocks = (
        Text("a < b", warning=True),
        Items(("one", "2 * 3")),
        Table("Loads", ("name", "value"), (("A|B", "1"), ("C", "-2.5"))),
        Picture(PNG, "caption", 'says "so"'),
        Code("x = '<'\ny = 1"),
    )
    made = Page("T & T", (Section("S", blocks),))
    page = Reader(as_html(made))
    assert [tag.get("class") for tag in page.all("td")] == [None, "number"] * 2
    assert {"a < b", "2 * 3", "A|B", "x = '<'\ny = 1"} <= set(page.text)
    assert as_markdown(made, ["p.png"]) == (
        "# T \\& T\n\n## S\n\n**a \\< b**\n\n- one\n- 2 \\* 3\n\n**Loads**\n\n| name | value |\n| --- | ---: |\n"
        "| A\\|B | 1 |\n| C | -2.5 |\n\n![says \"so\"](<p.png>)\n\ncaption\n\n    x = '<'\n    y = 1\n"
    )


def test_spectrum(folder):
    system, state = load(f"{folder}/mine.py:sledge")
    report = rx.analyze(system, state)
    figure = rx.plot.spectrum(report)
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    assert np.allclose(lines["counted"], report.singular_values[:2])
    assert np.all(lines["dropped"] < report.tolerance) and np.all(lines["counted"] > report.tolerance)
    assert "rank 2 of 3" in figure.axes[0].get_title()
