"""XML as it is written: elements with their places in the bytes of a file, and changes that touch nothing else"""

import dataclasses
import pathlib
from collections.abc import Iterator
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from ._content import refusal, strict


@dataclasses.dataclass(eq=False)
class Element:
    """An element: where its first tag begins and ends, and where it ends itself."""

    tag: str
    attributes: dict[str, str]
    parent: "Element | None"
    start: int
    opened: int = 0
    end: int = 0
    children: list["Element"] = dataclasses.field(default_factory=list)

    def all(self) -> Iterator["Element"]:
        """This one and those in it, in order."""
        yield self
        for child in self.children:
            yield from child.all()

    def get(self, name: str, other: str = "") -> str:
        """An attribute."""
        return self.attributes.get(name, other)


class Source:
    """A file of XML that is to be changed in a few places."""

    def __init__(self, path: pathlib.Path):
        self._path, self.content, self._changes = path, path.read_bytes(), []
        self._encoding, self._open = "utf-8", []
        self.root = Element("", {}, None, 0)
        parser = expat.ParserCreate()
        parser.XmlDeclHandler = self._declared
        parser.StartElementHandler = lambda tag, attributes: self._begins(parser.CurrentByteIndex, tag, attributes)
        parser.EndElementHandler = lambda _: self._ends(parser.CurrentByteIndex)
        try:
            parser.Parse(strict(self.content), True)
        except (expat.ExpatError, ValueError) as error:
            raise refusal(path, f"is no well-formed XML: {error}. Correct the file") from error

    def _declared(self, _: str, encoding: str | None, __: int) -> None:
        self._encoding = encoding or self._encoding

    def _begins(self, start: int, tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, self._open[-1] if self._open else self.root, start)
        element.opened = self._tag_ends(start)
        if element.parent:
            element.parent.children.append(element)
        self._open.append(element)

    def _ends(self, place: int) -> None:
        element = self._open.pop()
        is_empty = self.content[element.opened - 2 : element.opened] == b"/>"
        element.end = element.opened if is_empty else self._tag_ends(place)

    def _tag_ends(self, place: int) -> int:
        """Where the tag that begins here ends; quoted values may hold its last sign."""
        quote = 0
        for k in range(place, len(self.content)):
            sign = self.content[k]
            if quote:
                quote = 0 if sign == quote else quote
            elif sign in b"\"'":
                quote = sign
            elif sign == ord(">"):
                return k + 1
        raise refusal(self._path, "is no well-formed XML. Correct the file")

    def text(self, element: Element) -> str:
        """The first tag of an element, as it is written."""
        return self.content[element.start : element.opened].decode(self._encoding)

    def put(self, place: int, text: str, end: int | None = None) -> None:
        """Write text at a place, instead of what is there up to an end."""
        self._changes.append((place, place if end is None else end, text))

    def put_before(self, element: Element, text: str) -> None:
        """Write text before an element, on a line of its own if that stands on one."""
        self.put(element.start, text + self._margin(element))

    def remove(self, element: Element) -> None:
        """Leave an element out, and its line if it stands alone on it."""
        margin, end = self._margin(element), element.end
        rest = self.content[end:].split(b"\n", 1)
        if margin and len(rest) > 1 and not rest[0].strip():
            self.put(element.start - len(margin) + 1, "", end + len(rest[0]) + 1)
        else:
            self.put(element.start, "", end)

    def _margin(self, element: Element) -> str:
        """The line break and the spaces before an element, if nothing else is."""
        before = self.content[: element.start].rpartition(b"\n")[2]
        return "" if before.strip() or len(before) == element.start else "\n" + before.decode(self._encoding)

    def changed(self) -> bytes:
        """The content with all changes."""
        out, last = [], 0
        for start, end, text in sorted(self._changes, key=lambda change: change[0]):
            out += [self.content[last:start], text.encode(self._encoding, "xmlcharrefreplace")]
            last = end
        return b"".join([*out, self.content[last:]])


def tag_of(tag: str, attributes: dict[str, str], close: str = "/>") -> str:
    """A tag as text."""
    return " ".join([f"<{tag}", *(f"{name}={quoteattr(value)}" for name, value in attributes.items())]) + close
