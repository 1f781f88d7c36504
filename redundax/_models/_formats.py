"""Which files are models, and what is told of others: by their names, their first bytes and their first element"""

import pathlib
import re
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from .._tools._errors import RedundaxError
from .._tools._words import did_you_mean, ended, short

MODELS = (".xml", ".mjcf", ".urdf")
_READ = "MJCF (.xml) and URDF (.urdf) are read"
_CONVERT = f"{_READ}: convert it, with loops in `equality` of MJCF or in a file of closures beside a URDF"
_EXPORT = f"{_READ}: export one of these, or describe the mechanism in Python"
_UNPACK = "Unpack it first"
_OTHERS = (  # endings, what such a file is, and what to do
    (".sdf .world", "SDF, which is not read", _CONVERT),
    (".usd .usda .usdc .usdz", "USD, which is not read", _CONVERT),
    (".wbt .proto", "a model of Webots, which is not read", _CONVERT),
    (".slx .mdl", "a model of Simulink, which is not read", _CONVERT),
    (".adm", "a model of Adams, which is not read", _CONVERT),
    (".mo", "a model of Modelica, which is not read", _CONVERT),
    (".asmt", "an assembly in ASMT, which is not read", _CONVERT),
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
_ROOTS = {"mujoco": (".xml", ".mjcf"), "robot": (".urdf",)}  # first elements, and the endings that go with them
_MARK = b"\xef\xbb\xbf"  # that some editors put before UTF-8
_FIRST = re.compile(rb"(?:\s+|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^\[>]*+(?:\[.*?\]\s*)?>)*+<([A-Za-z_][\w.:-]*)", re.DOTALL)
_PARTS = ("mujocoinclude", "worldbody", "body", "default", "asset")


def not_a_model(path: str | pathlib.Path) -> str:
    """What a file is that has the ending of another format, and what to do; nothing for other endings."""
    ending = pathlib.Path(path).suffix.lower()
    for endings, what, advice in _OTHERS:
        if ending in endings.split():
            return f"is {what}. {advice}"
    return ""


def check_content(path: pathlib.Path) -> bytes:
    """Refuse a file that is no XML of a model, and return what it holds."""

    def refuse(why: str) -> RedundaxError:
        return RedundaxError(f"Argument `path`: '{path}' {ended(why)}")

    try:
        content = path.read_bytes()
    except OSError as error:
        raise refuse(f"cannot be read: {error.strerror}. Check who may read it") from error
    if not content.strip():
        raise refuse("is empty, without `mujoco` or `robot`. Check whether it was saved, or exported")
    for start, what, advice in _STARTS:
        if content.startswith(start):
            raise refuse(f"{what}. {advice}")
    if b"\0" in content[:4]:
        raise refuse(f"is in UTF-16 or UTF-32, or no text: it begins with {short(content[:4])}. Save it in UTF-8")
    root = _first_element(content)
    if not root:
        raise refuse(f"holds no XML: it begins with {short(content[:30])}. Name a file of MJCF or URDF")
    ending = path.suffix.lower()
    if root in _PARTS:
        raise refuse(f"is a part of MJCF, <{root}>. Name the file that includes it")
    if root not in _ROOTS:
        hint = did_you_mean(root, _ROOTS) or "Name a file of MJCF or URDF"
        raise refuse(not_a_model(f"model.{root}") or f"is no model: its first element is <{root}>. {hint}")
    if ending not in _ROOTS[root]:
        kind = "URDF" if root == "robot" else "MJCF"
        raise refuse(f"holds {kind}, by its first element <{root}>. Rename it to end in {_ROOTS[root][0]}")
    return content


def document(path: pathlib.Path) -> Any:
    """The first element of a file of XML; prefixes of names stay as they are written, declared or not."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    content = path.read_bytes()
    try:
        parser.Parse(content, True)
        return builder.close()
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise RedundaxError(f"Argument `path`: '{path}' is no well-formed XML: {error}. {_advice(content)}.") from error


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


def _first_element(content: bytes) -> str:
    """The name of the first element; nothing where other text comes before."""
    found = _FIRST.match(content.removeprefix(_MARK))
    return found[1].decode() if found else ""
