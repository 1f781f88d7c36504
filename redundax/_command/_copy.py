"""Copies of models that `redundax audit --fix` must not write: over files of the model, or away from what it names."""

import pathlib
from collections.abc import Iterable, Iterator

from .._models._content import document
from .._models._edit_usd import layers_of
from .._models._formats import FORMATS, format_of
from .._models._repair import WRITTEN
from .._models._urdf import closures_of
from ._file import FileError, check_target

_LAYERS = (".usda", ".usd", ".usdc")
_PICTURES = ("texture",)  # of the elements that name files, those that `texturedir` is for


def check_copy(system: str, closures: str | None, file: pathlib.Path) -> None:
    """Refuse a copy that cannot be of this model, or would cost a file of it."""
    source, form = pathlib.Path(system), format_of(system)
    kind = source.suffix.lower()
    if form is None or form.name not in WRITTEN:
        copied = ", ".join(ending for each in FORMATS if each.name in WRITTEN for ending in each.endings)
        raise FileError(f"Argument `--fix` copies {copied}, but '{system}' is none. Leave it out.")
    is_usd = form.name == "USD"
    if is_usd and file.suffix.lower() not in _LAYERS:
        raise FileError(f"Argument `--fix` must end in {', '.join(_LAYERS)} for USD, but is '{file}'. Rename it.")
    if not is_usd and file.suffix.lower() != kind:
        raise FileError(f"Argument `--fix` must end in {kind} as the model does, but is '{file}'. Rename it.")
    if _same(file, source):
        raise FileError(f"Argument `--fix` must name another file than the model '{source}'. Rename it.")
    check_target(file)
    if kind == ".urdf":
        _check_loops(closures_of(source, closures), file)
    if source.is_file() and (is_usd or form.root):
        _check_named(source, layers_of(source) if is_usd else _named(source), file)


def _check_loops(closures: pathlib.Path | None, file: pathlib.Path) -> None:
    """Refuse to write the loops of a copy over those of the model, or over a file that nobody has named."""
    beside = file.with_suffix(".yaml")
    if closures is not None and _same(beside, closures):
        raise FileError(
            f"Argument `--fix` writes the loops of the copy to '{beside}', which holds those of the model. Rename it."
        )
    if beside.exists() and not file.exists():
        raise FileError(
            f"Argument `--fix` writes the loops of the copy to '{beside}', which is there without '{file}'. Rename it."
        )
    check_target(beside)


def _check_named(source: pathlib.Path, names: Iterable[pathlib.Path], file: pathlib.Path) -> None:
    """Refuse to write over a file that the model names, or where its relative paths lead elsewhere."""
    named = [path for path in names if (source.parent / path).exists()]
    for path in named:
        if _same(file, source.parent / path):
            raise FileError(f"Argument `--fix` must not name '{file}', which the model names as '{path}'. Rename it.")
    relative = next((path for path in named if not path.is_absolute()), None)
    if relative is not None and not _same(file.parent, source.parent):
        raise FileError(
            f"Argument `--fix` must be in the folder of the model, '{source.parent}', but is '{file}': the model names "
            f"'{relative}' from there. Write the copy beside it."
        )


def _named(source: pathlib.Path) -> Iterator[pathlib.Path]:
    """Files that a model names, from its folder on; what a URDF has from a package is no place."""
    root = document(source)
    folders = {name: text for each in root.iter("compiler") for name, text in each.attrib.items()}
    for element in root.iter():
        paths = [text for name, text in element.attrib.items() if name.startswith("file") and "://" not in text]
        folder = folders.get("texturedir" if element.tag in _PICTURES else "meshdir", folders.get("assetdir", ""))
        of = "" if element.tag in ("include", "model") or source.suffix.lower() == ".urdf" else folder
        yield from (pathlib.Path(of, text) for text in paths)
    of_sdf = ((each.text or "").strip() for each in root.iter("uri"))
    yield from (pathlib.Path(text) for text in of_sdf if text and "://" not in text)


def _same(one: pathlib.Path, other: pathlib.Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)
