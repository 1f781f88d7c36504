"""MJCF without plugins and attributes of defaults that MuJoCo does not know: none of them constrains"""

import pathlib
from xml.sax.saxutils import quoteattr

from ._source import Element, Source, tag_of

_DRIVEN = ("name", "class", "joint", "jointinparent", "tendon", "site", "refsite", "body", "cranksite", "slidersite")
_DRIVEN += ("cranklength", "gear")  # of an actuator: what it moves
_NAMING = ("include", "model")  # elements that name files with elements


def known_part(path: pathlib.Path, folder: pathlib.Path) -> tuple[pathlib.Path, list[str]]:
    """A copy in a folder of a file and of those that it includes, and what they are without."""
    copies = _Copies(path.parent.absolute(), folder)
    copy = copies.of(path)
    notes = []
    if copies.plugins:
        notes.append(f"plugins: {', '.join(dict.fromkeys(copies.plugins))}, whose forces do not act here")
    if copies.attributes:
        notes.append(
            f"attributes of defaults, which MuJoCo does not know: {', '.join(dict.fromkeys(copies.attributes))}"
        )
    return copy, notes


class _Copies:
    """Copies of files in a folder; paths in them are from the folder `base`, or from where they are."""

    def __init__(self, base: pathlib.Path, folder: pathlib.Path):
        self._base, self._folder = base, folder
        self._made: dict[pathlib.Path, pathlib.Path] = {}
        self.plugins: list[str] = []
        self.attributes: list[str] = []

    def of(self, path: pathlib.Path) -> pathlib.Path:
        """The copy of a file."""
        if path in self._made:
            return self._made[path]
        self._made[path] = self._folder / f"{len(self._made)}.xml"
        source = Source(path)
        for element in source.root.all():
            if element.tag in _NAMING and element.get("file"):
                places = [each / element.get("file") for each in (self._base, path.parent)]
                there = next((each for each in places if each.is_file()), None)
                if there is not None:
                    _rewrite(source, element, element.attributes | {"file": str(self.of(there))})
            elif element.tag == "default" and (others := element.attributes.keys() - {"class"}):
                self.attributes += [f"{name}={quoteattr(element.get(name))}" for name in sorted(others)]
                _rewrite(source, element, {"class": element.get("class")} if "class" in element.attributes else {})
            elif element.tag in ("plugin", "extension") and not _is_within(element, "plugin", "extension"):
                self.plugins += [name for each in element.all() if (name := each.get("plugin"))]
                is_drive = element.parent is not None and element.parent.tag == "actuator"
                words = {name: text for name, text in element.attributes.items() if name in _DRIVEN}
                source.put(element.start, tag_of("general", words) if is_drive else "", element.end)
        self._made[path].write_bytes(source.changed())
        return self._made[path]


def _rewrite(source: Source, element: Element, attributes: dict[str, str]) -> None:
    """Change the attributes of an element."""
    close = "/>" if source.content[: element.opened].endswith(b"/>") else ">"
    source.put(element.start, tag_of(element.tag, attributes, close), element.opened)


def _is_within(element: Element, *tags: str) -> bool:
    """Whether an element is in another one of some names."""
    return element.parent is not None and (element.parent.tag in tags or _is_within(element.parent, *tags))
