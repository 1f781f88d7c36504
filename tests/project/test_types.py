"""Constructors as a checker of types and an editor see them."""

import inspect
import re
import subprocess
import sys

import pytest

import redundax as rx

MODULES = {"rx": rx, "rx.spatial": rx.spatial}


def split(arguments):
    """At commas outside of brackets."""
    parts, depth = [""], 0
    for letter in arguments:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


@pytest.mark.slow
def test_a_checker_of_types_sees_the_arguments_of_parts_in_their_order(tmp_path):
    """It took the words of Equinox for fields, `friction` for the first argument of all joints."""
    pytest.importorskip("pyright")
    parts = {
        f"{module}.{name}": list(inspect.signature(kind).parameters)
        for module, names in MODULES.items()
        for name, kind in vars(names).items()
        if inspect.isclass(kind) and issubclass(kind, rx.AbstractJoint | rx.AbstractLoad | rx.Body)
        if not name.startswith("Abstract")
    }
    asked = "".join(f"reveal_type({name}.__init__)\n" for name in parts)
    (tmp_path / "asked.py").write_text(f"import redundax as rx\n{asked}")
    (tmp_path / "pyrightconfig.json").write_text("{}")
    given = {"cwd": tmp_path, "capture_output": True, "text": True, "check": False}
    told = subprocess.run([sys.executable, "-m", "pyright", "-p", "."], **given).stdout
    seen = {
        name: [re.split("[:=]", part)[0].strip().lstrip("*") for part in split(arguments)][1:]
        for name, arguments in re.findall(r'Type of "(\S+)\.__init__" is "\((.*)\) -> None"', told)
    }
    assert len(parts) > 20
    assert {name: [x for x in arguments if x] for name, arguments in seen.items()} == parts
