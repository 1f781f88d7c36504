"""Code of pages and docstrings as printed: found, and run to what it shows."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from shown import BLOCK

import redundax as rx

PAGES = Path(__file__).parent / "pages"
FACES = {"": rx, **{f"{face}.": getattr(rx, face) for face in ("mechanisms", "plot", "spatial", "types", "units")}}


def blocks(text: str) -> list[str]:
    """The code in a text."""
    return [textwrap.dedent(code) for _, code in BLOCK.findall(text)]


(START,) = blocks(inspect.getdoc(rx) or "")  # which examples of docstrings go on from


def examples() -> Iterator[tuple[str, list[str]]]:
    """Names of public things, with the code of their docstrings behind `START`, and of pages, with all of theirs."""
    for place, face in FACES.items():
        for name, thing in vars(face).items():
            if name[0] != "_" and (inspect.isclass(thing) or inspect.isfunction(thing)):
                for code in blocks(inspect.getdoc(thing) or ""):
                    yield f"{place}{name}", [START, code]
    for page in sorted(PAGES.glob("*.md")):
        if code := blocks(page.read_text(encoding="utf8")):
            yield page.stem, code


def steps(code: str, scene: dict[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Runs code; each value that it shows, with the figures in the comment behind it, None where there are none."""
    lines = code.splitlines()
    for statement in ast.parse(code).body:
        if not isinstance(statement, ast.Expr):
            exec(compile(ast.Module([statement], []), "example", "exec"), scene)
            continue
        value = eval(compile(ast.Expression(statement.value), "example", "eval"), scene)
        if isinstance(statement.value, ast.Call) and ast.unparse(statement.value.func).endswith(".write_text"):
            continue  # how many characters a file has says nothing
        comment = lines[(statement.end_lineno or 0) - 1].partition("# ")[2]
        try:
            yield value, ast.literal_eval(re.sub(r"^[\d\s.+*/()-]+= ", "", comment))
        except (SyntaxError, ValueError):  # words
            yield value, None
