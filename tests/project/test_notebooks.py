"""The notebooks run from top to bottom, in a fresh kernel of the interpreter that runs the tests."""

import pathlib
import re

import nbformat
import numpy as np
import pytest
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

FOLDER = pathlib.Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
CELL_TIMEOUT = 1000  # seconds; on a machine that has nothing else to do a whole notebook takes less than 60


def read(path):
    return nbformat.read(path, as_version=4)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_notebooks_are_there():
    names = "own_mechanism paper_step_by_step solution_family physical_closures sensitivities motion own_constraint"
    more = "speed_against_error spatial_linkage door_on_three_hinges loads_at_rest audit_of_a_model torque_of_drives"
    more += " four_legged_table check_a_log backlash_turned_round"
    assert {path.stem for path in NOTEBOOKS} >= {*names.split(), *more.split()}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_as_run(path):
    """From top to bottom, once, with its pictures; no warning, no object without a name, no place on a disk."""
    notebook = read(path)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert [cell.execution_count for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))
    assert not any(output.output_type == "error" for cell in code(notebook) for output in cell.outputs)
    outputs = [output for cell in code(notebook) for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not any(output.get("name") == "stderr" for output in outputs)
    printed = "".join(output.get("text", "") for output in outputs)
    assert not re.search(r" at 0x[0-9a-f]{4}|(?<!\w)/(?:home|root|tmp|usr|Users)/|\bnan\b", printed, re.IGNORECASE)
    assert path.stat().st_size < 600_000
    assert 'jax.config.update("jax_enable_x64", True)' in code(notebook)[0].source


# Speed and error of the benchmarks' page, the README and what a notebook prints --------------------------------

README = (FOLDER.parent / "README.md").read_text(encoding="utf8")
PAGE = (FOLDER.parent / "benchmarks" / "README.md").read_text(encoding="utf8")
NUMBER = r"([\d.,]+(?:e[+-]?\d+)?)"


def numbers(pattern, text):
    """The numbers in each place where a pattern with N for a number occurs."""
    found = [match.groups() for match in re.finditer(re.sub(r"\bN\b", lambda _: NUMBER, pattern), text)]
    assert found, pattern
    return np.array([[float(one.replace(",", "")) for one in row] for row in found])


def agrees_with_the_page(printed):
    """What the notebook of speeds prints: errors and steps as the page tells them; they move by a few roundings."""
    for kind, program in (("NumPy, one array program", "vectorised"), ("redundax, `vmap`", "redundax, vmap")):
        ((_, claim),) = numbers(rf"\| {kind}[^|]*\| N us[^|]*\|[^|]*\| N \|", PAGE)[:1]
        for *_, found in numbers(rf"N .*{program} +N µs per solve, error N", printed):
            assert found < 10 * claim
    ((steps, rtol, _, error),) = numbers(r"redundax, N steps at `rtol=N`[^|]*\| N s \|[^|]*\| N rad", PAGE)
    rows = numbers(r"rtol N: N s, N steps, error N rad", printed)
    coarse, fine = rows[rows[:, 0] > rtol][-1], rows[rows[:, 0] < rtol][0]
    assert coarse[2] < steps < fine[2]
    assert fine[3] < error < coarse[3]
    rows = dict(re.findall(r"the paper's mechanism +(\S.*?)  +([\d.e+-]+)", printed))
    assert float(rows["Cholesky, reg., refined"]) > 1e3 * float(rows["redundax, solve"])  # it loses digits


def test_the_stored_notebook_of_speeds_agrees_with_the_page():
    """Its times are held here, where they were measured: beside another test the order may turn."""
    outputs = [output for cell in code(read(FOLDER / "speed_against_error.ipynb")) for output in cell.outputs]
    printed = "".join(output.get("text", "") for output in outputs)
    agrees_with_the_page(printed)
    assert np.all(numbers("in one call is N times as fast", printed) > 1)
    assert np.all(numbers("at its best size is N times as fast", printed) > 1)


def test_every_hard_case_is_counted():
    ((lines, right, flagged),) = numbers(r"N lines each. float64: N right[^.]*?\s+does, N flagged", PAGE)
    ((right_32, flagged_32, needless),) = numbers(r"float32: N, N, and N flagged without need. None wrong", PAGE)
    assert right + flagged == right_32 + flagged_32 + needless == lines
    text = "".join(cell.source for cell in read(FOLDER / "speed_against_error.ipynb").cells)
    assert f"each of {lines:.0f} lines" in text.replace("\n", " ").replace("for ", "")


def test_the_readme_says_what_the_page_says():
    ((error, time, ratio),) = numbers(r"error of a solve is N\. It takes N µs in a batch, N times less than", README)
    ((by_numpy, _),) = numbers(r"\| NumPy, one array program[^|]*\| N us[^|]*\|[^|]*\| N \|", PAGE)
    ((own, own_error),) = numbers(r"\| redundax, `vmap`[^|]*\| N us[^|]*\|[^|]*\| N \|", PAGE)
    assert error == own_error and abs(time - own) < 0.00501 and ratio == round(by_numpy / own)
    ((lines, flagged),) = numbers(r"Of N hard cases none is wrong; N are refused", README)
    assert [lines, flagged] == numbers(r"N lines each. float64: N right[^.]*?\s+does, N flagged", PAGE)[0, ::2].tolist()


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_runs(path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = read(path)
    # Without folders to look in, "python3" is ipykernel's own specification, whose interpreter is this one.
    kernel = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=KernelSpecManager(kernel_dirs=[]))
    client = NotebookClient(notebook, km=kernel, timeout=CELL_TIMEOUT, resources={"metadata": {"path": FOLDER}})
    client.execute()  # raises CellExecutionError, which shows the cell and the traceback
    outputs = [output for cell in code(notebook) for output in cell.outputs]
    printed = "".join(output.get("text", "") for output in outputs)
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert printed and not re.search(r"\bnan\b", printed, re.IGNORECASE)
    if path.stem == "speed_against_error":
        agrees_with_the_page(printed)
