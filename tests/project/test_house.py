"""The house rules, held by reading the source of the package.

A rule is a function from a `Package` (parsed files, nothing imported) to a list of complaints,
`path:line: what is wrong`. Every rule is also run on small packages planted in a temporary
directory: each must catch what breaks it, and none may complain about the clean one.
"""

import ast
import dataclasses
import functools
import graphlib
import itertools
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MAX_FILE_LINES = 600
MAX_FUNCTION_LINES = 80  # without the docstring
MAX_ANY = 39  # annotations that say `Any`; to be lowered with what is reached
MAX_PARAMETERS, MAX_OF_CONSTRUCTORS = 8, 12
MAX_IMPORT_SECONDS = 20.0
# Public functions of more arguments, all of them with defaults and by name, and where they stand.
WIDE = {
    ("_simulate", "simulate"),
    ("_solve", "solve"),
    ("_system", "__init__"),
    ("_band", "band"),
    ("_band_along", "band_along"),
    ("_solution_family", "solution_family"),
    ("_tolerance", "tolerance_study"),
    ("_ensemble", "ensemble"),
    ("_identify", "identify"),
    ("_draw", "draw"),
    ("_html", "html"),
    ("_animate", "animate"),
    ("_slider_crank", "slider_crank"),
    ("_planetary", "planetary"),
    ("_countershafts", "countershaft_train"),
    ("_carriage", "carriage"),
    ("_four_bar", "doubled_four_bar"),
    ("_wheels", "cart"),
    ("_governor", "governor"),
    ("_delta", "delta"),
}

# Kept out of `import redundax`: heavy, or needed by one optional part only.
HEAVY = (
    "IPython",
    "diffrax",
    "matplotlib",
    "mujoco",
    "netCDF4",
    "optimistix",
    "pandas",
    "plotly",
    "scipy",
    "tqdm",
    "xarray",
    "yaml",
)
# Not public although no component starts with an underscore.
INTERNAL = ("equinox.internal",)
# Bases that only other parts of the library build on so far, so that an example would be a model of nothing; and parts
# of results, which the example of the whole shows.
NO_EXAMPLE = {
    "Change",
    "Combination",
    "Minimum",
    "Narrow",
    "TrajectoryStats",
    "AbstractBounds",
    "AbstractClosure",
    "AbstractDistribution",
    "AbstractFriction",
    "AbstractFrictionModel",
    "AbstractFrictionalJoint",
    "AbstractLoad",
    "AbstractSolver",
    "AbstractStabilisation",
    "AbstractSystem",
}
# Underscored, but documented: methods of named tuples, and the exit that skips what Python does at its end.
PUBLIC_UNDERSCORED = {"_asdict", "_exit", "_fields", "_make", "_replace"}


# ------------------------------------------------------------------------------------- the source


@dataclasses.dataclass(frozen=True)
class Module:
    """One parsed file."""

    name: str  # dotted, "redundax._solve"; a folder's __init__.py has the folder's name
    path: Path  # relative to the folder that the package lies in
    text: str
    tree: ast.Module

    @property
    def is_package(self) -> bool:
        return self.path.name == "__init__.py"

    def at(self, node: ast.AST | None, complaint: str) -> str:
        return f"{self.path}:{getattr(node, 'lineno', 1)}: {complaint}"

    def walk(self, *kinds: type[ast.AST]) -> Iterator:
        return (node for node in self._nodes if isinstance(node, kinds))

    @functools.cached_property
    def _nodes(self) -> list[ast.AST]:
        return list(ast.walk(self.tree))


@dataclasses.dataclass(frozen=True)
class Package:
    """All files of the package, by dotted name."""

    name: str
    modules: dict[str, Module]

    def own(self, dotted: str) -> bool:
        return dotted.split(".")[0] == self.name

    def nearest(self, dotted: str) -> str:
        """The module that a dotted path lies in: itself, or the closest parent that is a file."""
        while dotted not in self.modules and "." in dotted:
            dotted = dotted.rpartition(".")[0]
        return dotted

    def imports(self, module: Module) -> Iterator[tuple[ast.stmt, str, str]]:
        """Every import anywhere in a file: the node, the absolute dotted path, the bound name."""
        for node in module.walk(ast.Import, ast.ImportFrom):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    yield node, alias.name, alias.asname or alias.name.split(".")[0]
                continue
            parts = module.name.split(".")
            keep = len(parts) + module.is_package - node.level
            base = [*(parts[:keep] if node.level else []), *filter(None, [node.module])]
            for alias in node.names:
                yield node, ".".join([*base, alias.name]), alias.asname or alias.name

    def edges(self) -> dict[str, dict[str, ast.stmt]]:
        """For each module, the modules of the package that it imports, and where.

        What Python imports on the way, the `__init__` of the folders above, does not count.
        """
        return {
            name: {self.nearest(target): node for node, target, _ in self.imports(module) if self.own(target)}
            for name, module in self.modules.items()
        }


def load(root: Path, name: str = "redundax") -> Package:
    modules = {}
    for path in sorted((root / name).rglob("*.py")):
        relative = path.relative_to(root)
        parts = relative.with_suffix("").parts
        dotted = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = path.read_text(encoding="utf-8")
        modules[dotted] = Module(dotted, relative, text, ast.parse(text, filename=str(relative)))
    return Package(name, modules)


def dotted_path(node: ast.AST) -> str | None:
    """`a.b.c` as a string, if the node is nothing but names and dots."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and (left := dotted_path(node.value)):
        return f"{left}.{node.attr}"
    return None


# -------------------------------------------------------------------------------------- the rules


def _cycle(graph: dict[str, set[str]]) -> list[str]:
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return error.args[1][::-1]  # graphlib lists predecessors first; each imports the next here
    return []


def imports_are_acyclic(package: Package) -> list[str]:
    """No module imports itself through others, not even inside a function."""
    graph = {name: set(targets) for name, targets in package.edges().items()}
    cycle = _cycle(graph)
    return [f"import cycle: {' -> '.join(cycle)}"] if cycle else []


def imports_point_one_way(package: Package) -> list[str]:
    """No file imports the package's own face, and folders do not import each other in a ring."""
    complaints = []
    rings: dict[str, dict[str, set[str]]] = {}
    for name, targets in package.edges().items():
        module = package.modules[name]
        for target, node in targets.items():
            if target == package.name and name != f"{package.name}.__main__":
                complaints.append(module.at(node, f"imports from `{target}` itself, not a module"))
            if target == f"{package.name}.__main__":
                complaints.append(module.at(node, "imports the command"))
            folder, own, other = _parting(name, target)
            rings.setdefault(folder, {}).setdefault(own, set()).add(other)
    for graph in rings.values():
        cycle = _cycle({unit: targets - {unit} for unit, targets in graph.items()})
        if cycle:
            complaints.append(f"import cycle between folders: {' -> '.join(cycle)}")
    return complaints


def _parting(name: str, target: str) -> tuple[str, str, str]:
    """The innermost folder that holds both modules, and the files or folders in it that they lie in."""
    a, b = name.split("."), target.split(".")
    shared = sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], zip(a, b, strict=False)))
    folder = min(shared, len(a) - 1, len(b) - 1)
    return ".".join(a[:folder]), ".".join(a[: folder + 1]), ".".join(b[: folder + 1])


def lives_in_rooms(package: Package) -> list[str]:
    """Beside the face and the command every file lies in a folder that says what it is a part of."""
    return [
        module.at(None, "lies loose; put it into a folder")
        for name, module in package.modules.items()
        if name.count(".") == 1 and not module.is_package and not name.endswith("__main__")
    ]


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__") and name not in PUBLIC_UNDERSCORED


def _is_foreign_private(dotted: str) -> bool:
    return any(map(_is_private, dotted.split("."))) or any(f"{dotted}.".startswith(f"{path}.") for path in INTERNAL)


def uses_public_interfaces(package: Package) -> list[str]:
    """Nothing from `equinox.internal`, `jax._src` or any other private part of another package.

    Three ways lead there: an import, an attribute, a name in a string. A private attribute is asked for of `self`
    and `cls` only: what a class inherits or takes in is often another package's.
    """
    complaints = []
    for module in package.modules.values():
        bound = {}
        for node, target, name in package.imports(module):
            if package.own(target):
                continue
            if _is_foreign_private(target):
                complaints.append(module.at(node, f"imports `{target}`, which is private"))
            plain = isinstance(node, ast.Import) and name == target.split(".")[0]
            bound[name] = name if plain else target
        for node in module.walk(ast.Attribute):
            head, _, rest = (dotted_path(node) or "").partition(".")
            internal = head in bound and _is_foreign_private(f"{bound[head]}.{rest}")
            if internal or (_is_private(node.attr) and ast.unparse(node.value) not in ("self", "cls")):
                complaints.append(module.at(node, f"uses `{ast.unparse(node)}`, which is private"))
        for node in module.walk(ast.Constant):
            if isinstance(node.value, str) and node.value.startswith(("jax._src", *INTERNAL)):
                complaints.append(module.at(node, f"names `{node.value}`, which is private"))
    return complaints


def has_no_star_imports(package: Package) -> list[str]:
    """Every imported name is written out."""
    return [
        module.at(node, "star import")
        for module in package.modules.values()
        for node in module.walk(ast.ImportFrom)
        if any(alias.name == "*" for alias in node.names)
    ]


def has_no_asserts(package: Package) -> list[str]:
    """Validation raises: `python -O` drops assert statements."""
    return [
        module.at(node, "assert statement; raise an error with a message instead")
        for module in package.modules.values()
        for node in module.walk(ast.Assert)
    ]


def has_no_super(package: Package) -> list[str]:
    """Wrap rather than subclass."""
    return [
        module.at(node, "super(); wrap the object instead of extending its class")
        for module in package.modules.values()
        for node in module.walk(ast.Name)
        if node.id == "super"
    ]


def classes_are_abstract_or_final(package: Package) -> list[str]:
    """A class that another one inherits from is named Abstract..., or is an error: these are caught by kind."""
    defined = {node.name for module in package.modules.values() for node in module.walk(ast.ClassDef)}
    complaints = []
    for module in package.modules.values():
        for node in module.walk(ast.ClassDef):
            for base in node.bases:
                base = base.value if isinstance(base, ast.Subscript) else base
                name = (dotted_path(base) or "").rpartition(".")[2]
                if name in defined and not name.lstrip("_").startswith("Abstract") and not name.endswith("Error"):
                    complaints.append(module.at(node, f"`{node.name}` extends the final `{name}`"))
    return complaints


def has_docstrings(package: Package) -> list[str]:
    """Every module that holds anything, and every public class and function at its top level."""
    complaints = []
    for module in package.modules.values():
        if module.tree.body and not (ast.get_docstring(module.tree) or "").strip():
            complaints.append(module.at(None, "module without a docstring"))
        for node in module.tree.body:
            if (
                isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
                and not node.name.startswith("_")
                and not (ast.get_docstring(node) or "").strip()
                and not any("overload" in ast.unparse(mark) for mark in node.decorator_list)
            ):
                complaints.append(module.at(node, f"`{node.name}` has no docstring"))
    return complaints


def _definition(package: Package, dotted: str) -> tuple[Module, ast.ClassDef | ast.FunctionDef] | None:
    """The class or function that a dotted path leads to, through the imports on the way."""
    module, name = package.modules[package.nearest(dotted)], dotted.rpartition(".")[2]
    for node in module.tree.body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
            return module, node
    further = [target for _, target, bound in package.imports(module) if bound == name and package.own(target)]
    return _definition(package, further[0]) if further and further[0] != dotted else None


def has_examples(package: Package) -> list[str]:
    """Every class and function that the package, or a public folder of it, offers has an example in its docstring."""
    complaints = []
    for face in package.modules.values():
        if not face.is_package or any(part.startswith("_") for part in face.name.split(".")):
            continue
        for _, target, name in package.imports(face):
            found = _definition(package, target) if package.own(target) and name[0] != "_" else None
            if found is None or name in NO_EXAMPLE:
                continue
            module, node = found
            if "```python\n" not in (ast.get_docstring(node) or ""):
                complaints.append(module.at(node, f"`{name}` has no example in its docstring"))
    return complaints


def _literal(node: ast.AST) -> str:
    """The text of a string, with {} for what it takes in; empty if the node is another expression."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_literal(part) if isinstance(part, ast.Constant) else "{}" for part in node.values)
    if isinstance(node, ast.BinOp):
        return (_literal(node.left) or "{}") + (_literal(node.right) or "{}")
    return ""


def errors_say_what_to_do(package: Package) -> list[str]:
    """A message names its argument, or the thing that is wrong, and goes on to say what helps.

    Messages of the command's options are left out: argparse names the option and shows the usage.
    """
    complaints = []
    for module in package.modules.values():
        for node in module.walk(ast.Raise):
            if not (isinstance(node.exc, ast.Call) and node.exc.args) or "argparse" in ast.unparse(node.exc.func):
                continue
            text = _literal(node.exc.args[0])
            if not re.search("[a-z]", text):  # handed on from elsewhere
                continue
            if not re.search(r"[`'{]", text):
                complaints.append(module.at(node, f"the message names nothing: {text}"))
            if not re.search(r"[.:] [A-Za-z`{]", text):
                complaints.append(module.at(node, f"the message does not say what helps: {text}"))
    return complaints


def errors_are_its_own(package: Package) -> list[str]:
    """What the package refuses can be told from a crash by the kind of the error."""
    return [
        module.at(node, f"`raise {name}`: raise RedundaxError, or NoSolutionError")
        for module in package.modules.values()
        for node in module.walk(ast.Raise)
        if isinstance(node.exc, ast.Call) and (name := dotted_path(node.exc.func)) in ("ValueError", "RuntimeError")
    ]


def exports_are_explicit(package: Package) -> list[str]:
    """An `__init__` imports as `X as X`; the package's own defines no public name itself."""
    complaints = []
    for module in package.modules.values():
        if not module.is_package:
            continue
        for node in module.walk(ast.Import, ast.ImportFrom):
            for alias in node.names:
                if not (alias.asname or "").startswith("_") and alias.asname != alias.name:
                    complaints.append(module.at(node, f"`{alias.name}` without `as {alias.name}`"))
        if module.name != package.name:
            continue
        for node in module.tree.body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                names = [node.name]
            else:
                stored = (n for n in ast.walk(node) if isinstance(n, ast.Name))
                names = [n.id for n in stored if isinstance(n.ctx, ast.Store)]
            complaints += [
                module.at(node, f"`{name}` is defined here; import it from a private module")
                for name in names
                if not name.startswith("_")
            ]
    return complaints


def is_short(package: Package) -> list[str]:
    """Files and functions have a length that one can read."""
    complaints = []
    for module in package.modules.values():
        lines = len(module.text.splitlines())
        if lines > MAX_FILE_LINES:
            complaints.append(module.at(None, f"{lines} lines, {MAX_FILE_LINES} at most"))
        for node in module.walk(ast.FunctionDef, ast.AsyncFunctionDef):
            first = node.body[0]
            documented = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) else 0
            lines = node.end_lineno - node.lineno + 1 - documented
            if lines > MAX_FUNCTION_LINES:
                complaint = f"`{node.name}` has {lines} lines, {MAX_FUNCTION_LINES} at most"
                complaints.append(module.at(node, complaint))
    return complaints


def says_types(package: Package) -> list[str]:
    """Arguments, results and variables have a type that tells something."""
    found = []
    for module in package.modules.values():
        nodes = module.walk(ast.arg, ast.AnnAssign, ast.FunctionDef)
        given = ((node, node.returns if isinstance(node, ast.FunctionDef) else node.annotation) for node in nodes)
        found += [
            module.at(node, f"says `{ast.unparse(said)}`")
            for node, said in given
            if said is not None and any(isinstance(part, ast.Name) and part.id == "Any" for part in ast.walk(said))
        ]
    return [f"{len(found)} annotations say `Any`, {MAX_ANY} at most", *found] if len(found) > MAX_ANY else []


def takes_few(package: Package) -> list[str]:
    """Functions take few arguments, and those that users call by name a few more."""
    complaints = []
    for module in package.modules.values():
        for node in module.walk(ast.FunctionDef, ast.AsyncFunctionDef):
            names = [each.arg for each in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]]
            count = len(names) - (names[:1] in (["self"], ["cls"]))
            most = MAX_OF_CONSTRUCTORS if node.name == "__init__" else MAX_PARAMETERS
            if count > most and (module.name.rpartition(".")[2], node.name) not in WIDE:
                complaints.append(module.at(node, f"`{node.name}` takes {count} arguments, {most} at most"))
    return complaints


def protocols_are_checked(package: Package) -> list[str]:
    """What must have methods can be asked for them, as the checks of all calls do."""
    return [
        module.at(node, f"`{node.name}` is a protocol without `@runtime_checkable`")
        for module in package.modules.values()
        for node in module.walk(ast.ClassDef)
        if any((dotted_path(base) or "").endswith("Protocol") for base in node.bases)
        and not any((dotted_path(mark) or "").endswith("runtime_checkable") for mark in node.decorator_list)
    ]


Rule = Callable[[Package], list[str]]
RULES: list[Rule] = [
    imports_are_acyclic,
    imports_point_one_way,
    lives_in_rooms,
    uses_public_interfaces,
    has_no_star_imports,
    has_no_asserts,
    has_no_super,
    classes_are_abstract_or_final,
    has_docstrings,
    has_examples,
    errors_say_what_to_do,
    errors_are_its_own,
    exports_are_explicit,
    is_short,
    says_types,
    takes_few,
    protocols_are_checked,
]


@functools.cache
def the_package() -> Package:
    return load(ROOT)


def test_package_is_read():
    assert "redundax" in the_package().modules


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_rule_holds(rule: Rule):
    complaints = rule(the_package())
    assert not complaints, "\n".join(["", *complaints])


# -------------------------------------------------------------------------- the rules catch breaks

CLEAN = {
    "redundax/__init__.py": '''
        """Face."""
        from importlib.metadata import version as _version
        from . import mechanisms as mechanisms
        from ._joints import Pin as Pin
        from ._solve._solve import solve as solve
        __version__ = _version("redundax")
    ''',
    "redundax/__main__.py": '"""Command."""\nimport redundax as rx\nfrom . import solve\n',
    "redundax/_tools/_base.py": '''
        """Base: the word super and an assert in a docstring harm nobody."""
        import jax.numpy as jnp
        from jax import lax
        class AbstractJoint:
            """A joint."""
            def size(self):
                return self._size
        def half(pair):
            """Half."""
            return lax.mul(jnp.array(0.5), pair._replace(a=1))
        def _quiet(): ...
    ''',
    "redundax/_joints/__init__.py": '"""Joints."""\nfrom ._pin import Pin as Pin\n',
    "redundax/_joints/_pin.py": '''
        """Pin."""
        from .._tools._base import AbstractJoint
        class Pin(AbstractJoint):
            """Pin.

            ```python
            rx.Pin()
            ```
            """
    ''',
    "redundax/_solve/_solve.py": '''
        """Solve."""
        from .._tools import _base
        def solve():
            """Solve.

            ```python
            rx.solve()
            ```
            """
            from .._joints import Pin
            return Pin, _base
    ''',
    "redundax/_tools/__init__.py": "",
    "redundax/_solve/__init__.py": "",
    "redundax/mechanisms/__init__.py": "",
}

DOC = '"""Doc."""\n'
_LONG_FUNCTION = DOC + "def _f():\n" + "    pass\n" * MAX_FUNCTION_LINES
BREAKS: list[tuple[Rule, str, dict[str, str]]] = [
    (imports_are_acyclic, "_a -> ", {"_a": "from ._b import x", "_b": "from . import _a"}),
    (imports_are_acyclic, "_a", {"_a": "def f():\n from ._b import x", "_b": "from ._a import y"}),
    (imports_are_acyclic, "_a", {"_a": "import redundax._b", "_b": "from redundax._a import y"}),
    (imports_are_acyclic, "_c", {"_a": "from ._c import x", "_c": "from ._d import x",
                                 "_d": "if TYPE_CHECKING:\n from ._c import x"}),
    (imports_are_acyclic, "_f._k", {"_f/__init__": "from ._k import X as X",
                                    "_f/_k": "from . import X"}),
    (imports_are_acyclic, "_f", {"_f/_k": "from .._g import x", "_g": "from ._f._k import x"}),
    (imports_point_one_way, "_a.py:1", {"_a": "from redundax import solve"}),
    (imports_point_one_way, "_a.py:1", {"_a": "from . import solve"}),
    (imports_point_one_way, "_a.py:2", {"_a": "def f():\n import redundax as rx"}),
    (imports_point_one_way, "_f/_k.py:1", {"_f/_k": "from .. import solve"}),
    (imports_point_one_way, "command", {"_a": "from .__main__ import main", "__main__": DOC}),
    (imports_point_one_way, "between folders", {"_f/_k": "from .._g._m import x", "_f/_l": "",
                                                "_g/_m": "", "_g/_n": "from .._f._l import x"}),
    (imports_point_one_way, "between folders", {"_f/_g/_k": "from .._h._m import x", "_f/_g/_l": "",
                                                "_f/_h/_m": "", "_f/_h/_n": "from .._g._l import x"}),
    (lives_in_rooms, "_a.py:1", {"_a": ""}),
    (uses_public_interfaces, "equinox.internal", {"_a": "import equinox.internal as eqxi"}),
    (uses_public_interfaces, "equinox.internal", {"_a": "from equinox import internal"}),
    (uses_public_interfaces, "equinox.internal", {"_a": "from equinox.internal import while_loop"}),
    (uses_public_interfaces, "eqx.internal", {"_a": "import equinox as eqx\neqx.internal.f()"}),
    (uses_public_interfaces, "jax._src", {"_a": "import jax._src.core"}),
    (uses_public_interfaces, "jax._src", {"_a": "from jax import _src"}),
    (uses_public_interfaces, "jax._src", {"_a": "def f():\n from jax._src import core"}),
    (uses_public_interfaces, "jax._src", {"_a": "import jax.numpy\njax._src.core.f()"}),
    (uses_public_interfaces, "jax._src", {"_a": "f('jax._src.core')"}),
    (uses_public_interfaces, "diffrax._solver", {"_a": "from diffrax._solver import base"}),
    (uses_public_interfaces, "lax._hidden", {"_a": "from jax import lax\nlax._hidden()"}),
    (uses_public_interfaces, "A._names", {"_a": "import jax\nclass A(jax.B): ...\nfor name in A._names: ..."}),
    (uses_public_interfaces, "f()._x", {"_a": "from jax import f\nf()._x"}),
    (uses_public_interfaces, "self.a._x", {"_a": "class A:\n def f(self):\n  return self.a._x"}),
    (has_no_star_imports, "_a.py:1", {"_a": "from ._b import *"}),
    (has_no_star_imports, "_a.py:1", {"_a": "from jax.numpy import *"}),
    (has_no_asserts, "_a.py:2", {"_a": "def f(x):\n assert x"}),
    (has_no_super, "_a.py:3", {"_a": "class A:\n def f(self):\n  super().f()"}),
    (classes_are_abstract_or_final, "final `A`", {"_a": "class A: ...\nclass B(A): ..."}),
    (classes_are_abstract_or_final, "final `A`",
     {"_a": "class A: ...", "_b": "from . import _a\nclass B(_a.A[int]): ..."}),
    (has_docstrings, "module without", {"_a": "x = 1"}),
    (has_docstrings, "module without", {"_a": '""" """'}),
    (has_docstrings, "`f`", {"_a": DOC + "def f(): ..."}),
    (has_docstrings, "`A`", {"_a": DOC + "class A: ..."}),
    (has_examples, "_solve.py:2: `solve`", {}),
    (has_examples, "_a.py:2: `f`", {"__init__": "from ._f import f as f", "_f/__init__": "from .._a import f as f",
                                    "_a": DOC + "def f(): ..."}),
    (has_examples, "_m.py:1: `A`", {"mechanisms/__init__": "from ._m import A as A", "mechanisms/_m": "class A: ..."}),
    (errors_say_what_to_do, "_a.py:1: the message names nothing", {"_a": "raise ValueError('Wrong. Mend it.')"}),
    (errors_say_what_to_do, "what helps: `x` is {}.", {"_a": "raise TypeError(f'`x` is {x}.')"}),
    (errors_say_what_to_do, "what helps", {"_a": "raise ValueError('`x` is ' + y)"}),
    (errors_are_its_own, "_a.py:1: `raise ValueError`", {"_a": "raise ValueError('`x` is 1. Give 2.')"}),
    (exports_are_explicit, "`f`", {"__init__": "from ._a import f"}),
    (exports_are_explicit, "`f`", {"__init__": "from ._a import f as g"}),
    (exports_are_explicit, "`f`", {"_g/__init__": "from ._a import f"}),
    (exports_are_explicit, "`jax`", {"__init__": "import jax"}),
    (exports_are_explicit, "`f`", {"__init__": "def f(): ..."}),
    (exports_are_explicit, "`LIMIT`", {"__init__": "LIMIT: int = 3"}),
    (is_short, "_a.py:2: `_f`", {"_a": _LONG_FUNCTION}),
    (says_types, f"{MAX_ANY + 1} annotations", {"_a": DOC + "def _f(x: list[Any]): ...\n" * (MAX_ANY + 1)}),
    (takes_few, "_a.py:2: `_f` takes 9 arguments", {"_a": DOC + "def _f(a, b, c, d, e, f, g, h, *, i): ..."}),
    (takes_few, "takes 13", {"_a": "class A:\n def __init__(self, a, b, c, d, e, f, g, h, i, j, k, l, m): ..."}),
    (protocols_are_checked, "`_P` is a protocol", {"_a": DOC + "class _P(typing.Protocol): ..."}),
    (is_short, "_a.py:1: 601 lines", {"_a": "x = 1\n" * (MAX_FILE_LINES + 1)}),
]  # fmt: skip


def plant(root: Path, files: dict[str, str]) -> Package:
    """Write a package below `root`; a text that starts with a line break is indented code."""
    for path, text in files.items():
        path = root / path
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = text.splitlines()
        if lines and not lines[0]:
            lines = [line.removeprefix(" " * 8) for line in lines[1:]]
        path.write_text("\n".join(lines) + "\n" if lines else "", encoding="utf-8")
    return load(root)


def test_clean_package_passes(tmp_path):
    package = plant(tmp_path, CLEAN)
    assert len(package.modules) == len(CLEAN)
    assert {rule.__name__: rule(package) for rule in RULES} == {r.__name__: [] for r in RULES}


def test_empty_package_passes(tmp_path):
    package = plant(tmp_path, {"redundax/__init__.py": ""})
    assert [complaint for rule in RULES for complaint in rule(package)] == []


@pytest.mark.parametrize(
    ("rule", "complaint", "files"),
    [pytest.param(*case, id=f"{case[0].__name__}-{i}") for i, case in enumerate(BREAKS)],
)
def test_rule_catches(rule: Rule, complaint: str, files: dict[str, str], tmp_path):
    face = {"redundax/__init__.py": '"""Face."""\nfrom ._solve import solve as solve\n'}
    solve = {"redundax/_solve.py": '"""Solve."""\ndef solve():\n    """Solve."""\n'}
    planted = {f"redundax/{name}.py": text for name, text in files.items()}
    package = plant(tmp_path, {**face, **solve, **planted})
    assert any(complaint in found for found in rule(package)), rule(package)


def test_every_rule_is_seen_to_catch():
    assert {case[0] for case in BREAKS} == set(RULES)


# ----------------------------------------------------------------------- what an import sets going

# `jax_num_cpu_devices` can be set only as long as no backend has started, so setting it shows
# whether one has: an array made at import would fix its precision before the user can choose.
PROBE = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
start = time.process_time()
import redundax
seconds = time.process_time() - start
import jax
x64 = jax.config.jax_enable_x64
try:
    jax.config.update("jax_num_cpu_devices", 2)
    backend = False
except RuntimeError:
    backend = True
roots = sorted({name.split(".")[0] for name in sys.modules})
result = dict(seconds=seconds, x64=x64, backend=backend, roots=roots)
print(json.dumps({"file": redundax.__file__, **result}))
"""


def probe(root: Path) -> dict:
    """Import the package that lies in `root` in a process of its own, with JAX as installed."""
    ours = ("JAX_ENABLE_X64", "JAX_NUM_CPU_DEVICES")
    environment = {key: value for key, value in os.environ.items() if key not in ours}
    done = subprocess.run(
        [sys.executable, "-c", PROBE, str(root)],
        env=environment,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)  # so an import must not print anything either
    assert Path(result["file"]).is_relative_to(root)
    return result


@pytest.fixture(scope="module")
def imported() -> dict:
    return probe(ROOT)


def test_import_leaves_precision_alone(imported):
    assert not imported["x64"]


def test_import_starts_no_backend(imported):
    assert not imported["backend"], "an array is made at import; make it where it is used"


def test_import_is_light(imported):
    assert not set(imported["roots"]) & set(HEAVY)


def test_import_is_quick(imported):
    # Time of the processor, as the machine may be busy. A first import compiles byte code too: the better of two.
    seconds = imported["seconds"]
    if seconds > MAX_IMPORT_SECONDS:
        seconds = min(seconds, probe(ROOT)["seconds"])
    assert seconds < MAX_IMPORT_SECONDS


def test_probe_catches(tmp_path):
    face = """
        import jax, jax.numpy as jnp, xarray
        jax.config.update("jax_enable_x64", True)
        ONE = jnp.ones(())
    """
    plant(tmp_path, {"redundax/__init__.py": face, "xarray.py": "", "redundax/_a.py": ""})
    result = probe(tmp_path)
    assert result["x64"] and result["backend"] and "xarray" in result["roots"]
