"""A page as HTML, in one file with its pictures, or as Markdown with its pictures beside it."""

import base64
import html
import pathlib
import re

from ._blocks import Block, Code, Items, Page, Picture, Table, Text

FORMATS = (".html", ".md")

_STYLE = """
:root { color-scheme: light; }
body { font: 1rem/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff; max-width: 58rem; margin: 0 auto;
  padding: 1rem; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin-top: 2rem; border-bottom: 1px solid #bbb; }
.warning { border-left: 4px solid #D55E00; padding-left: .75rem; font-weight: 600; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .75rem 0; font-size: .9rem; }
caption { text-align: left; white-space: nowrap; font-weight: 600; padding-bottom: .25rem; }
th, td { text-align: left; vertical-align: top; padding: .2rem .7rem .2rem 0; border-bottom: 1px solid #ddd; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
nav { font-size: .9rem; } figure { margin: 1rem 0; } figcaption { font-size: .9rem; color: #444; }
img { max-width: 100%; height: auto; }
pre { background: #f4f4f4; padding: .6rem; white-space: pre-wrap; overflow-wrap: anywhere; }
@media print { body { max-width: none; padding: 0; font-size: 10pt; } .wide { overflow: visible; }
  figure, tr { break-inside: avoid; } h2 { break-after: avoid; } }
"""


def write(page: Page, file: pathlib.Path) -> list[pathlib.Path]:
    """Write the page in the format that the file's ending names, and return the files made."""
    if file.suffix == ".html":
        file.write_text(as_html(page), encoding="utf-8")
        return [file]
    blocks = [block for section in page.sections for block in section.blocks]
    pictures = [block for block in blocks if isinstance(block, Picture)]
    names = [f"{file.stem}_{number}.png" for number in range(1, len(pictures) + 1)]
    for picture, name in zip(pictures, names, strict=True):
        file.with_name(name).write_bytes(picture.png)
    file.write_text(as_markdown(page, names), encoding="utf-8")
    return [file, *map(file.with_name, names)]


def as_html(page: Page) -> str:
    """One file without scripts that loads nothing from elsewhere."""
    titles = [html.escape(section.title) for section in page.sections]
    links = (f'<li><a href="#section-{number}">{each}</a></li>' for number, each in enumerate(titles, 1))
    parts = [f"<nav><ol>{''.join(links)}</ol></nav>"]
    for number, (each, section) in enumerate(zip(titles, page.sections, strict=True), 1):
        parts += [f'<section id="section-{number}"><h2>{each}</h2>', *map(block_as_html, section.blocks), "</section>"]
    return document(page.title, _STYLE, "\n".join(parts))


def document(title: str, style: str, body: str) -> str:
    """A page of this style."""
    title = html.escape(title)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>{style}</style></head>
<body><h1>{title}</h1><main>{body}</main></body></html>
"""


def block_as_html(block: Block) -> str:
    """A part of a page."""
    text = html.escape
    if isinstance(block, Text):
        return f'<p class="warning">{text(block.text)}</p>' if block.warning else f"<p>{text(block.text)}</p>"
    if isinstance(block, Items):
        return f"<ul>{''.join(f'<li>{text(item)}</li>' for item in block.items)}</ul>"
    if isinstance(block, Picture):
        data = base64.b64encode(block.png).decode("ascii")
        image = f'<img alt="{text(block.alt)}" src="data:image/png;base64,{data}">'
        return f"<figure>{image}<figcaption>{text(block.caption)}</figcaption></figure>"
    if isinstance(block, Code):
        return f"<pre>{text(block.text)}</pre>"
    marks = [' class="number"' if right else "" for right in _numeric(block)]

    def line(tag: str, cells: tuple[str, ...]) -> str:
        filled = (f"<{tag}{mark}>{text(cell)}</{tag}>" for mark, cell in zip(marks, cells, strict=True))
        return f"<tr>{''.join(filled)}</tr>"

    rows = "\n".join(line("td", row) for row in block.rows)
    caption = f"<caption>{text(block.caption)}</caption>"
    head = f"<thead>{line('th', block.head)}</thead>"
    return f'<div class="wide"><table>{caption}{head}<tbody>\n{rows}\n</tbody></table></div>'


def as_markdown(page: Page, pictures: list[str]) -> str:
    """The same in Markdown; `pictures` are the names of the files of its pictures, one after the other."""
    names = iter(pictures)
    parts = [f"# {_plain(page.title)}"]
    for section in page.sections:
        parts.append(f"## {_plain(section.title)}")
        parts += [_markdown(block, next(names) if isinstance(block, Picture) else "") for block in section.blocks]
    return "\n\n".join(parts) + "\n"


def _markdown(block: Block, file: str) -> str:
    if isinstance(block, Text):
        return f"**{_plain(block.text)}**" if block.warning else _plain(block.text)
    if isinstance(block, Items):
        return "\n".join(f"- {_plain(item)}" for item in block.items)
    if isinstance(block, Picture):
        return f"![{_plain(block.alt)}](<{file}>)\n\n{_plain(block.caption)}"
    if isinstance(block, Code):
        return "\n".join(f"    {line}" for line in block.text.splitlines())
    rule = ["---:" if right else "---" for right in _numeric(block)]
    lines = [tuple(map(_plain, block.head)), tuple(rule), *(tuple(map(_plain, row)) for row in block.rows)]
    return f"**{_plain(block.caption)}**\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _plain(text: str) -> str:
    """Text with what Markdown would take for its signs marked as text."""
    return re.sub(r"([\\`*_\[\]<>|#&~$])", r"\\\1", " ".join(text.split()))


def _numeric(table: Table) -> list[bool]:
    """Which columns hold numbers alone."""
    return [all(_is_number(row[k]) for row in table.rows) for k in range(len(table.head))]


def _is_number(text: str) -> bool:
    try:
        float(text or "0")
    except ValueError:
        return False
    return True
