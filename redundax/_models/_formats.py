"""Formats of models: how their files are known and read, and what is told of others

A format is one entry of `FORMATS`; all else asks a `Description`.
"""

import pathlib
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from .._tools._errors import RedundaxError
from .._tools._words import did_you_mean, short
from ._asmt import FIRST_LINES, read_asmt
from ._content import first_element, refusal
from ._description import Description
from ._mjcf import read_mjcf
from ._sdf import read_sdf
from ._urdf import read_urdf
from ._usd import read_usd
from ._usd_stage import FIRST


class Format(NamedTuple):
    """A format: its name, the endings of its files, how they begin, and what reads them.

    - `root`: the first element of a format of XML, or "" of others; `first`: how others begin.
    - `read`: of a path and the file of its loops, which most formats have none of.
    """

    name: str
    endings: tuple[str, ...]
    read: Callable[[pathlib.Path, pathlib.Path | None], Description]
    root: str = ""
    first: tuple[bytes, ...] = ()


FORMATS = (
    Format("MJCF", (".xml", ".mjcf"), lambda path, _: read_mjcf(path), "mujoco"),
    Format("URDF", (".urdf",), read_urdf, "robot"),
    Format("SDF", (".sdf", ".world"), lambda path, _: read_sdf(path), "sdf"),
    Format("ASMT", (".asmt",), lambda path, _: read_asmt(path), first=FIRST_LINES),
    Format("USD", (".usd", ".usda", ".usdc", ".usdz"), lambda path, _: read_usd(path), first=FIRST),
)
NAMES = ", ".join(form.name for form in FORMATS)
MODELS = tuple(ending for form in FORMATS for ending in form.endings)
_WORDS = [f"{form.name} ({form.endings[0]})" for form in FORMATS]
_READ = f"{', '.join(_WORDS[:-1])} and {_WORDS[-1]} are read"
_CONVERT = f"{_READ}: convert it, with loops in `equality` of MJCF or in a file of closures beside a URDF"
_EXPORT = f"{_READ}: export one of these, or describe the mechanism in Python"
_UNPACK = "Unpack it first"
_OTHERS = (  # endings, what such a file is, and what to do
    (".wbt .proto", "a model of Webots, which is not read", _CONVERT),
    (".slx .mdl", "a model of Simulink, which is not read", _CONVERT),
    (".adm", "a model of Adams, which is not read", _CONVERT),
    (".mo", "a model of Modelica, which is not read", _CONVERT),
    (
        ".sldasm .sldprt .iam .ipt .catproduct .catpart .prt .asm .f3d .fcstd",
        "a file of CAD, which is not read",
        _EXPORT,
    ),
    (".step .stp .iges .igs .stl .obj .dae .ply .3mf .glb .gltf .x_t .sat", "geometry without joints", _EXPORT),
    (".xacro", "a template, which is not read", "Expand it: xacro FILE.xacro > FILE.urdf"),
    (".srdf", "SRDF, which goes with a URDF and has no joints", "Name the URDF"),
    (".yaml .yml", "no model", "Name the URDF, and give its loops by --closures FILE"),
    (".mjb .mjz", "a packed model of MuJoCo", "Name its .xml"),
    (".gz .zip .xz .bz2 .7z .tar .tgz .zst .rar", "compressed", _UNPACK),
    (".ipynb", "a notebook", "Save the mechanism in a Python file, and name it FILE.py:NAME"),
)
_STARTS = (  # first bytes, what they tell, and what to do
    (b"\x1f\x8b", "is compressed", _UNPACK),
    (b"PK\x03\x04", "is compressed", _UNPACK),
    (b"BZh", "is compressed", _UNPACK),
    (b"\xfd7zXZ", "is compressed", _UNPACK),
    (b"version https://git-lfs", "stands for a file that Git LFS has not brought yet", "Run `git lfs pull`"),
    (b"\xff\xfe\0\0", "is in UTF-32", "Save it in UTF-8"),
    (b"\xff\xfe", "is in UTF-16", "Save it in UTF-8"),
    (b"\xfe\xff", "is in UTF-16", "Save it in UTF-8"),
)
_PARTS = ("mujocoinclude", "worldbody", "body", "default", "asset")


_TEMPLATES = " or ".join(form.name for form in FORMATS)


def format_of(path: str | pathlib.Path) -> Format | None:
    """The format of a file, by its ending; None of other files."""
    ending = pathlib.Path(path).suffix.lower()
    return next((form for form in FORMATS if ending in form.endings), None)


def not_a_model(path: str | pathlib.Path) -> str:
    """What a file is that has the ending of another format, and what to do; nothing for other endings."""
    ending = pathlib.Path(path).suffix.lower()
    for endings, what, advice in _OTHERS:
        if ending in endings.split():
            return f"is {what}. {advice}"
    return ""


def describe(path: pathlib.Path, closures: pathlib.Path | None = None) -> Description:
    """What a file of a model says, with that of its loops, if there is one.

    **Raises:** `ValueError` for a file that is none of a model or cannot be read, in one line.
    """
    if not path.is_file():
        raise RedundaxError(
            f"Argument `path`: there is no file '{path}'. Check the path and the folder that you are in."
        )
    form = format_of(path)
    if form is None:
        what = not_a_model(path) or f"must end in {', '.join(MODELS[:-1])} or {MODELS[-1]}. Rename the file"
        raise refusal(path, what)
    _check_content(path, form)
    return form.read(path, closures)


def _check_content(path: pathlib.Path, form: Format) -> None:
    """Refuse a file that does not begin as those of its format do."""
    refuse = partial(refusal, path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}. Check who may read it") from error
    if not content.strip():
        begins = " or ".join(f"`{each.root}`" for each in FORMATS if each.root) if form.root else "any line"
        raise refuse(f"is empty, without {begins}. Check whether it was saved, or exported")
    for start, what, advice in _STARTS:
        if content.startswith(start) and start not in form.first:
            raise refuse(f"{what}. {advice}")
    if b"\0" in content[:4]:
        raise refuse(f"is in UTF-16 or UTF-32, or no text: it begins with {short(content[:4])}. Save it in UTF-8")
    line, root = content.lstrip().split(b"\n", 1)[0].strip(), first_element(content)
    own = next((each for each in FORMATS if (root and root == each.root) or line.startswith(each.first)), None)
    if own is not None and own is not form:
        by = f"first element <{root}>" if root else f"first line {short(line.decode(errors='replace'))}"
        raise refuse(f"holds {own.name}, by its {by}. Rename it to end in {own.endings[0]}")
    if own is not None:
        return
    if not form.root:
        raise refuse(f"is no {form.name}: it begins with {short(content[:30])}. Name a file of {form.name}")
    if not root:
        raise refuse(f"holds no XML: it begins with {short(content[:30])}. Name a file of {_TEMPLATES}")
    if root in _PARTS:
        raise refuse(f"is a part of MJCF, <{root}>. Name the file that includes it")
    hint = did_you_mean(root, [each.root for each in FORMATS if each.root]) or f"Name a file of {_TEMPLATES}"
    raise refuse(not_a_model(f"model.{root}") or f"is no model: its first element is <{root}>. {hint}")
