"""The site: python docs/build.py writes docs/site from the pages, the docstrings and the notebooks.

Every example is run, and what it prints and draws stands behind it; `--quick` leaves that out. What ran once is kept in
docs/made until the code of the example changes; `--clean` begins anew.
"""

import argparse
import base64
import contextlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import jax
import latex2mathml.converter
import matplotlib
import nbformat
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from examples import PAGES, examples, steps
from links import SITE, dead
from matplotlib.figure import Figure
from shown import SHOWN, with_shown

ROOT = Path(__file__).parent
MADE = ROOT / "made"  # what Zensical reads
PICTURES = "shown"  # in MADE
WIDTH = 90  # of code, in characters that a page shows without scrolling
SIMPLE = (jax.Array, np.ndarray, np.generic, float, int, str, list, tuple, dict)


def main() -> None:
    """Build."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="run no examples")
    parser.add_argument("--clean", action="store_true", help="run all examples, also those that have not changed")
    given = parser.parse_args()
    if given.clean:
        SHOWN.unlink(missing_ok=True)
        shutil.rmtree(MADE, ignore_errors=True)
    MADE.mkdir(exist_ok=True)
    shown = json.loads(SHOWN.read_text(encoding="utf8")) if SHOWN.exists() else {}
    if not given.quick:
        shown = shown_by_examples(shown)
        SHOWN.write_text(json.dumps(shown), encoding="utf8")
        kept = {picture for found in shown.values() for picture in found["pictures"]}
        for path in (MADE / PICTURES).iterdir():
            if f"{PICTURES}/{path.name}" not in kept:
                path.unlink()
    notebooks = sorted((ROOT.parent / "notebooks").glob("*.ipynb"))
    for path in MADE.iterdir():  # of pages that are no more
        if path.name != PICTURES:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    for path in PAGES.iterdir():
        if path.suffix == ".md":
            names = "|".join(notebook.stem for notebook in notebooks)
            named = rf"(^\| |notebook\s)`({names})`"
            text = re.sub(named, r"\1[`\2`](notebook_\2.md)", path.read_text("utf8"), flags=re.MULTILINE)
            (MADE / path.name).write_text(with_shown(text, shown), encoding="utf8")
        else:
            shutil.copy(path, MADE)
    for path in notebooks:
        (MADE / f"notebook_{path.stem}.md").write_text(page_of(path), encoding="utf8")
    narrow = ["ruff", "format", "--quiet", "--isolated", "--preview", f"--line-length={WIDTH}"]
    subprocess.run([sys.executable, "-m", *narrow, *map(str, MADE.glob("*.md"))], check=True)
    command = [sys.executable, "-m", "zensical", "build", "--clean", "--strict", "-f", str(ROOT / "mkdocs.yml")]
    status = subprocess.run(command, check=False, env={**os.environ, "PYTHONPATH": str(ROOT)}).returncode
    sys.exit(status or "\n".join(f"dead link: {link}" for link in dead(SITE)) or 0)


def shown_by_examples(known: dict[str, Any]) -> dict[str, Any]:
    """What each piece of code prints and draws, by the code; of `known` pieces nothing runs again."""
    shown = {}
    for name, codes in examples():
        if all(code in known for code in codes):
            shown |= {code: known[code] for code in codes}
            continue
        print(name, flush=True)
        scene: dict[str, Any] = {"__name__": "example"}
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # they go to a terminal
            for code in codes:
                shown[code] = shown_by(code, scene, name)
    return shown


def shown_by(code: str, scene: dict[str, Any], name: str) -> dict[str, Any]:
    """What code prints, values that no comment tells among it, and the pictures that it shows, leaves or writes."""
    printed, figures, before = io.StringIO(), [], {*Path().iterdir()}
    with contextlib.redirect_stdout(printed), np.printoptions(precision=6, threshold=50, linewidth=80):
        for value, told in steps(code, scene):
            if isinstance(value, Figure):
                figures.append(value)
            elif told is None and isinstance(value, SIMPLE):
                print(np.asarray(value) if isinstance(value, jax.Array) else value)
    folder = MADE / PICTURES
    folder.mkdir(exist_ok=True)

    def place(suffix: str) -> Path:
        return folder / f"{name}-{len(list(folder.glob(f'{name}-*')))}{suffix}"

    pictures = [Path(shutil.copy(path, place(path.suffix))) for path in written(before)]
    for figure in [*figures, *map(plt.figure, plt.get_fignums())] if not pictures else []:
        pictures.append(place(".png"))
        figure.savefig(pictures[-1], dpi=90, bbox_inches="tight")
    plt.close("all")
    return {"text": printed.getvalue().rstrip(), "pictures": [f"{PICTURES}/{path.name}" for path in pictures]}


def written(before: set[Path]) -> list[Path]:
    """Pictures in this folder that were not there."""
    return sorted(path for path in {*Path().iterdir()} - before if path.suffix in (".png", ".gif"))


def page_of(path: Path) -> str:
    """A notebook as a page, with its pictures beside it."""
    folder = MADE / f"notebook_{path.stem}"
    folder.mkdir(exist_ok=True)
    parts, count = [], 0
    for cell in nbformat.read(path, as_version=4).cells:
        is_text = cell.cell_type == "markdown"
        parts.append(beside(with_formulas(cell.source), path, folder) if is_text else f"```python\n{cell.source}\n```")
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                (folder / f"{count}.png").write_bytes(base64.b64decode(data["image/png"]))
                parts.append(f"![Output of the code above]({folder.name}/{count}.png)")
                count += 1
            elif text := output.get("text") or data.get("text/plain", ""):
                parts.append(f"```text\n{text.rstrip()}\n```")
    parts.append(f"This page is `notebooks/{path.name}`, where its code can be run and changed.")
    return "\n\n".join(parts) + "\n"


def with_formulas(text: str) -> str:
    """The text of a notebook with its formulas as browsers draw them by themselves, within lines."""
    return re.sub(r"\$([^$\n]+)\$", lambda found: f"<span>{latex2mathml.converter.convert(found[1])}</span>", text)


def beside(text: str, path: Path, folder: Path) -> str:
    """The text of a notebook with the files that it links copied beside its page; those that it writes are words."""

    def copied(match: re.Match[str]) -> str:
        source = path.parent / match[2]
        if not source.is_file():
            return match[1].strip("![]")
        shutil.copy(source, folder)
        return f"{match[1]}({folder.name}/{source.name})"

    return re.sub(r"(!?\[[^\]]*\])\(([^):#]+)\)", copied, text)


if __name__ == "__main__":
    main()
