"""The index of equations that ends the paper's notebook leads to what exists, and holds what docstrings refer to."""

import inspect
import json
import operator
import pathlib
import re

import redundax as rx

NOTEBOOK = pathlib.Path(__file__).parents[2] / "notebooks" / "paper_step_by_step.ipynb"
LAST = 63  # of the paper's equations
FACES = (rx, rx.mechanisms, rx.plot, rx.types, rx.units)
PUBLIC = [thing for face in FACES for name, thing in vars(face).items() if name[0] != "_"]


def index():
    """For each equation the cell of the index that says where it is."""
    text = "".join(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"][-1]["source"])
    found = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        for first, last in re.findall(r"\((\d+)\)(?: to \((\d+)\))?", cells[0]):
            for number in range(int(first), int(last or first) + 1):
                assert number not in found, number
                found[number] = cells[2]
    return found


def references(thing):
    """Numbers in brackets in a docstring, without its code."""
    text = re.sub(r"```.*?```|`[^`]*`", "", inspect.getdoc(thing) or "", flags=re.DOTALL)
    return {int(number) for number in re.findall(r"\((\d{1,2})\)", text)}


def test_every_equation_is_in_the_index():
    assert sorted(index()) == list(range(1, LAST + 1))


def test_every_name_of_the_index_exists():
    for place in index().values():
        for name in re.findall(r"`([\w.]+)`", place):
            assert operator.attrgetter(name)(rx)


def test_every_reference_is_in_the_index():
    found = index()
    assert references(rx.MinimumNorm) == {9}
    for thing in PUBLIC:
        assert references(thing) <= set(found), thing
