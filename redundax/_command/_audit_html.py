"""An audit as a page for a browser: its text beside the mechanism, with joints in the colours of the verdict."""

import dataclasses
import pathlib

from .._bodies._mechanism import Mechanism
from .._models._audit import Audit
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._optional import optional
from ..plot._draw import html as turning
from ..plot._page._blocks import Code
from ..plot._page._formats import block_as_html, document
from ..plot._page._pictures import drawing
from ._file import FileError, writing

_CAPTION = "Joints, not bodies: green where the load is unique, red where it is not."
_STYLE = """
body { font: 1rem/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; margin: 0; padding: 1rem; }
h1 { font-size: 1.3rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
main { display: flex; flex-wrap: wrap; gap: 1rem; } figure { flex: 1 1 40rem; min-width: 0; margin: 0; }
pre { flex: 0 1 auto; max-width: 100%; margin: 0; font-size: clamp(.4rem, 1.8vw, .8rem); overflow-x: auto; }
img { max-width: 100%; }
figcaption { font-size: .9rem; color: #444; }
@media (max-width: 95rem) { figure { order: -1; flex-basis: 100%; } }
"""


def check_pictures() -> None:
    """Refuse a page where what draws it is missing, before anything is computed."""
    try:
        optional("plotly.graph_objects", "html")
    except ImportError as error:
        raise FileError(f"--html: {error}") from error


def write_page(file: pathlib.Path, title: str, text: str, system: AbstractSystem, state: State, found: Audit) -> None:
    """Write one file that loads nothing from elsewhere."""
    body = f"{block_as_html(Code(text))}{_picture(system, state, found)}"
    with writing(file):
        file.write_text(document(title, _STYLE, body), encoding="utf-8")


def _picture(system: AbstractSystem, state: State, found: Audit) -> str:
    if not isinstance(system, Mechanism):
        return ""
    loose = [part.name for part in found.parts if part.loose]
    if system.frame.word == "spatial":
        figure = turning(system, state, report=loose)
        options = {"full_html": False, "include_plotlyjs": True, "config": {"displaylogo": False}}
        turned = figure.to_html(default_height="min(75vh, 110vw)", **options)
        return f"<figure>{turned}<figcaption>{_CAPTION}</figcaption></figure>"
    (picture,) = drawing(system, state, _CAPTION, report=loose)
    return block_as_html(dataclasses.replace(picture, caption=_CAPTION))
