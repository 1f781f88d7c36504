"""The reference pages: every public name on one of them, code that runs, and plain words in all that users read."""

import ast
import inspect
import json
import re
from collections import Counter
from pathlib import Path

import redundax as rx

PAGES = Path(__file__).parents[2] / "docs" / "pages"
COINED = ("unattainable", "capacity", "renewed", "onward", "theta", "reactions space", "null-space vectors h")
ROOMS = {"": rx} | {f"{room}.": getattr(rx, room) for room in ("mechanisms", "plot", "spatial", "types", "units")}


def test_every_public_name_is_on_one_page():
    public = {f"{room}{name}" for room, of in ROOMS.items() for name in dir(of) if not name.startswith("_")}
    public -= {room.rstrip(".") for room in ROOMS} | {f"{room}jaxtyping" for room in ROOMS}  # checks of types add it
    listed = Counter(
        name for page in PAGES.glob("*.md") for name in re.findall(r"^::: redundax\.(\S+)", page.read_text(), re.M)
    )
    assert set(listed) == public
    assert [name for name, times in listed.items() if times > 1] == []


def test_what_has_an_example_for_users_is_public():
    """A part that is written and not made public is found by nothing else."""
    kinds = ast.ClassDef | ast.FunctionDef
    modules = [ast.parse(path.read_text(encoding="utf8")) for path in Path(rx.__file__).parent.rglob("*.py")]
    parts = [part for module in modules for part in module.body if isinstance(part, kinds)]
    shown = {part.name for part in parts if "??? example" in (ast.get_docstring(part) or "")}
    assert shown - {name for of in ROOMS.values() for name in dir(of)} == set()


def test_every_page_and_notebook_is_linked():
    order, index = (PAGES.parent / "mkdocs.yml").read_text(), (PAGES / "index.md").read_text()
    pages = {page.name for page in PAGES.glob("*.md")}
    notebooks = {path.stem for path in (PAGES.parents[1] / "notebooks").glob("*.ipynb")}
    assert set(re.findall(r"- (\w+\.md)", order)) == pages | {f"notebook_{name}.md" for name in notebooks}
    assert set(re.findall(r"\]\((\w+\.md)\)", index)) == pages - {"index.md"}
    assert set(re.findall(r"^\| `(\w+)` \|", index, re.M)) == notebooks


def test_nothing_that_users_read_has_a_coined_word():
    root = PAGES.parents[1]
    pages = [root / "README.md", root / "benchmarks" / "README.md", *PAGES.glob("*.md")]
    texts = {str(page): page.read_text(encoding="utf8") for page in pages}
    for path in (root / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf8"))["cells"]
        texts[path.stem] = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    for room, of in ROOMS.items():
        texts |= {
            f"{room}{name}": inspect.getdoc(getattr(of, name)) or "" for name in dir(of) if not name.startswith("_")
        }
    found = {(place, word) for place, text in texts.items() for word in COINED if re.search(rf"\b{word}\b", text, re.I)}
    assert found == set()
