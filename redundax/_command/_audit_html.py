"""An audit as a page for a browser: its text beside the mechanism, with joints in the colours of the verdict."""

import base64
import html
import pathlib

from .._bodies._mechanism import Mechanism
from .._models._audit import Audit
from .._system._state import State
from .._system._system import AbstractSystem
from .._tools._optional import optional
from ..plot._draw import html as turning
from ..plot._page._pictures import drawing
from ._file import FileError, writing

_CAPTION = "Joints, not bodies: green where the load is unique, red where it is not."
_STYLE = """
body { font: 1rem/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; margin: 0; padding: 1rem; }
h1 { font-size: 1.3rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
main { display: flex; flex-wrap: wrap; gap: 1rem; } figure { flex: 1 1 40rem; min-width: 0; margin: 0; }
pre { flex: 0 1 auto; max-width: 100%; margin: 0; font-size: .8rem; overflow-x: auto; } img { max-width: 100%; }
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
    words, head = html.escape(text), html.escape(title)
    page = [
        "<!DOCTYPE html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{head}</title>',
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{_STYLE}</style></head>',
        f"<body><h1>{head}</h1><main><pre>{words}</pre>{_picture(system, state, found)}</main></body></html>",
        "",
    ]
    with writing(file):
        file.write_text("\n".join(page), encoding="utf-8")


def _picture(system: AbstractSystem, state: State, found: Audit) -> str:
    if not isinstance(system, Mechanism):
        return ""
    loose = [part.name for part in found.parts if part.loose]
    if system.frame.word == "spatial":
        figure = turning(system, state, report=loose)
        inside = figure.to_html(
            full_html=False, include_plotlyjs=True, default_height="75vh", config={"displaylogo": False}
        )
    else:
        (picture,) = drawing(system, state, _CAPTION, report=loose)
        inside = f'<img alt="{html.escape(picture.alt)}" src="data:image/png;base64,{_text(picture.png)}">'
    return f"<figure>{inside}<figcaption>{_CAPTION}</figcaption></figure>"


def _text(png: bytes) -> str:
    return base64.b64encode(png).decode("ascii")
