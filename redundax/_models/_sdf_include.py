"""Models that a file of SDF includes, put where they are named: from files beside it or in Gazebo's folders of models

A model is the file that a URI names, or that of the folder that it names, "model.sdf" or as "model.config" says.
Nothing is fetched, and nothing is read elsewhere.

What one that is merged holds stands in the model that includes it, without a scope of its own, as of SDF 1.9: a frame
"_merged__NAME__model__" stands where its own frame was, on its canonical link, and what was relative to that is
relative to this.
"""

import os
import pathlib
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from .._tools._errors import RedundaxError
from .._tools._words import short
from ._content import document, refusal
from ._description import WITHOUT

FOLDERS = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH")
# Of Gazebo, with nothing that moves
_SCENERY = re.compile(r"(model://|https?://fuel\.[^/]*/.*/)(sun|ground(_| |%20)plane)(/\d+)?/?", re.IGNORECASE)
_HOLDING_NOTHING = ("light", "actor")  # what a file may have in place of a model
_MOST, _DEEPEST = 1000, 30  # models in all, and one in the other
_OWN = ("static", "self_collide", "enable_wind", "allow_auto_disable", "pose")  # of a model, which merging drops
_NAMED = ("link", "frame", "joint", "model")


def sdf_document(path: pathlib.Path) -> Element:
    """The first element of a file of SDF."""
    content = path.read_bytes()
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise refusal(path, "declares a document type or entities, which SDF has none of. Take them out")
    return document(path)


def is_true(text: str | None) -> bool:
    """Whether a boolean of SDF is true, which Gazebo reads in letters of any case."""
    return (text or "").strip().lower() in ("1", "true")


class Includes:
    """What a file includes; `notes`: what is not read, a line each, and `lost`: why, by URIs."""

    def __init__(self, path: pathlib.Path, root: Element):
        self._path, self._count = path, 0
        self.notes: list[str] = []
        self.lost: dict[str, str] = {}
        given = [pathlib.Path(each) for name in FOLDERS for each in os.environ.get(name, "").split(os.pathsep) if each]
        self._folders = [each.resolve() for each in (path.absolute().parent, path.absolute().parent.parent, *given)]
        self._put(root, path, 0)

    def _refuse(self, uri: str, why: str) -> RedundaxError:
        return refusal(self._path, f"includes {short(uri)}, {why}")

    def _put(self, element: Element, file: pathlib.Path, depth: int) -> None:
        """Put models in the place of what includes them."""
        for child in list(element):
            if child.tag == "include":
                found = self._model(child, file, depth)
                if found is not None:
                    place = list(element).index(child)
                    element[place : place + 1] = (
                        self._merged(found, element, child) if is_true(child.get("merge")) else [found]
                    )
            elif child.tag in ("world", "model"):
                self._put(child, file, depth)

    def _merged(self, model: Element, into: Element, include: Element) -> list[Element]:
        """What a model holds, as elements of another that merges it, or of a world."""
        uri, names = (include.findtext("uri") or "").strip(), [each.get("name") for each in model if each.tag in _NAMED]
        if into.tag not in ("model", "world"):
            raise self._refuse(uri, "and merges it into neither a model nor a world. Take `merge` out")
        if into.tag == "world" and model.find("link") is not None:
            raise self._refuse(uri, "and merges it into a world, which has no links of its own. Take `merge` out")
        placed = model.get("placement_frame", "")
        if placed and placed.partition("::")[0] not in names:
            raise self._refuse(uri, f"and places it by {short(placed)}, which it has none of. Correct the name")
        name = f"_merged__{model.get('name')}__model__"
        frame = Element("frame", name=name, placement_frame=placed)
        frame.set("attached_to", model.get("canonical_link") or _first(model, "link") or _first(model, "model") or "")
        pose = model.find("pose")
        pose = Element("pose") if pose is None else pose
        pose.set("relative_to", pose.get("relative_to") or "__model__")
        frame.append(pose)
        kept = [each for each in model if each.tag not in _OWN]
        for each in kept:
            _moved_to(each, name)
        return [frame, *kept]

    def _model(self, include: Element, file: pathlib.Path, depth: int) -> Element | None:
        """The model that is included, as its place says; None of one that is not there, or holds nothing."""
        uri = (include.findtext("uri") or "").strip()
        if not uri:
            raise refusal(file, "has an <include> without a <uri>. Give it one, or take it out")
        self._count += 1
        if depth > _DEEPEST or self._count > _MOST:
            raise self._refuse(uri, f"one of more than {_MOST} files, or of files in files. Does one include itself?")
        source = self._find(uri, file)
        if source is None:
            if not _SCENERY.fullmatch(uri):
                self._lose(uri, f"it is neither beside the file nor in a folder of {FOLDERS[0]}")
            return None
        root = sdf_document(source)
        inside = list(root) if root.tag == "sdf" else [root]
        models = [each for each in inside if each.tag == "model"]
        if len(models) > 1:
            raise self._refuse(uri, f"which has {len(models)} models. Name a file of one")
        for model in models:
            self._put(model, source, depth + 1)
            _placed(model, include)
        if not any(each.tag in ("model", *_HOLDING_NOTHING) for each in inside):
            self._lose(uri, f"it holds {f'<{inside[0].tag}>' if inside else 'nothing'} in place of a <model>")
        return next(iter(models), None)

    def _lose(self, uri: str, why: str) -> None:
        self.notes.append(f"<include> of {short(uri)} is left out: {why}{WITHOUT}")
        self.lost[uri] = why

    def _find(self, uri: str, file: pathlib.Path) -> pathlib.Path | None:
        """The file that a URI means, if it is there."""
        scheme, mark, rest = uri.partition("://")
        if mark and scheme not in ("model", "package", "file"):
            return None
        near = [file.parent] if not mark else [] if scheme == "file" else [file.parent, file.parent.parent]
        places = [pathlib.Path(rest if mark else uri)] if scheme == "file" else []
        places += [folder / (rest if mark else uri) for folder in (*near, *self._folders)]
        inside = [each for each in places if any(each.resolve().is_relative_to(own) for own in self._folders)]
        if not inside:
            raise self._refuse(uri, f"which is neither beside it nor in a folder of {FOLDERS[0]}. Put it there")
        return next((found for each in inside for found in _files(each) if found.is_file()), None)


def _files(place: pathlib.Path) -> Iterator[pathlib.Path]:
    """A file, or those that a folder may have its model in."""
    if not place.is_dir():
        yield place
        return
    config = place / "model.config"
    if config.is_file():
        own = list(document(config).iterfind("sdf"))
        for each in sorted(own, key=lambda each: _version(each.get("version", "")), reverse=True):
            yield place / pathlib.PurePath((each.text or "").strip()).name
    yield place / "model.sdf"


def _first(model: Element, tag: str) -> str | None:
    """The name of the first element of a kind."""
    found = model.find(tag)
    return None if found is None else found.get("name")


def _moved_to(element: Element, frame: str) -> None:
    """Name a frame where an element of a model means that of its model, by name or by saying nothing."""

    def named(of: Element | None, word: str, *, is_meant: bool = False) -> None:
        if of is not None and (of.get(word, "").strip() or "__model__" * is_meant) == "__model__":
            of.set(word, frame)

    if element.tag in ("link", "model") and element.find("pose") is None:
        element.append(Element("pose"))
    named(element.find("pose"), "relative_to", is_meant=element.tag in ("link", "model"))
    if element.tag == "frame":
        named(element, "attached_to", is_meant=True)
    for end in [element.find(word) for word in ("parent", "child") if element.tag == "joint"]:
        if end is not None and (end.text or "").strip() == "__model__":
            end.text = frame
    for axis in [element.find(word) for word in ("axis", "axis2") if element.tag == "joint"]:
        if axis is not None:
            named(axis.find("xyz"), "expressed_in", is_meant=is_true(axis.findtext("use_parent_model_frame")))


def _version(text: str) -> list[int]:
    return [int(word) for word in text.split(".") if word.isdecimal()]


def _placed(model: Element, include: Element) -> None:
    """Give a model the name and the place that what includes it says."""
    if name := (include.findtext("name") or "").strip():
        model.set("name", name)
    if frame := (include.findtext("placement_frame") or include.get("placement_frame") or "").strip():
        model.set("placement_frame", frame)
    for word in ("pose", "static"):
        given = include.find(word)
        if given is not None:
            for own in model.findall(word):
                model.remove(own)
            model.append(given)
    model.extend(include.findall("plugin"))
