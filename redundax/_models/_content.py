"""What files of models hold: their first element, their encoding, their elements"""

import pathlib
import re
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from .._tools._errors import RedundaxError
from .._tools._words import ended

_MARK = b"\xef\xbb\xbf"  # that some editors put before UTF-8
_COMMENT = re.compile(rb"<!--(.*?)-->", re.DOTALL)
_FIRST = re.compile(rb"(?:\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^\[>]*+(?:\[.*?\]\s*)?>)*+<([A-Za-z_][\w.:-]*)", re.DOTALL)


def refusal(path: str | pathlib.Path, why: str, argument: str = "path") -> RedundaxError:
    """What a file is refused by: what is wrong of it, and what to do."""
    return RedundaxError(f"Argument `{argument}`: '{path}' {ended(why)}")


def numbers_in(text: str | None, count: int, largest: float = np.inf) -> np.ndarray | None:
    """So many numbers of a text, each below a largest; None where it has others."""
    try:
        found = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        return None
    return found if found.size == count and np.all(np.abs(found) < largest) else None


def document(path: pathlib.Path) -> ElementTree.Element:
    """The first element of a file of XML; prefixes of names stay as they are written, declared or not."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    content = path.read_bytes()
    try:
        parser.Parse(strict(content), True)
        return builder.close()
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise refusal(path, f"is no well-formed XML: {error}. {_advice(content)}") from error


def strict(content: bytes) -> bytes:
    """A file of XML of the same length without dashes in comments, which Gazebo and MuJoCo read and expat does not."""
    return _COMMENT.sub(lambda found: b"<!--" + found[1].replace(b"-", b" ") + b"-->", content)


def encoding_of(content: bytes) -> str:
    """The encoding that a file of XML declares."""
    found = re.match(rb"\s*<\?xml[^>]*?encoding\s*=\s*[\"']([\w.:-]+)", content.removeprefix(_MARK))
    return found[1].decode("ascii", "replace") if found else ""


def not_in_utf8(content: bytes) -> str:
    """Where bytes are not in UTF-8; nothing if they are."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line, declared = content.count(b"\n", 0, error.start) + 1, encoding_of(content)
        as_said = f", but in {declared} as it says" if declared.upper() not in ("", "UTF-8", "UTF8") else ""
        return f"is not in UTF-8{as_said}: see line {line}"
    return ""


def _advice(content: bytes) -> str:
    wrong = not_in_utf8(content)
    return f"It {wrong}. Save it in UTF-8" if wrong else "Correct the file"


def first_element(content: bytes) -> str:
    """The name of the first element; nothing where other text comes before."""
    found = _FIRST.match(content.removeprefix(_MARK))
    return found[1].decode() if found else ""
