"""The notebooks run from top to bottom, in a fresh kernel of the interpreter that runs the tests."""

import pathlib
import re

import nbformat
import pytest
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

FOLDER = pathlib.Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
CELL_TIMEOUT = 300  # seconds; on a machine that has nothing else to do a whole notebook takes less than 60


def read(path):
    return nbformat.read(path, as_version=4)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def test_notebooks_are_there():
    names = "own_mechanism paper_step_by_step solution_family physical_closures sensitivities motion own_constraint"
    assert {path.stem for path in NOTEBOOKS} >= {*names.split(), "speed_against_error", "spatial_linkage"}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_as_run(path):
    """From top to bottom, once, with its pictures."""
    notebook = read(path)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert [cell.execution_count for cell in code(notebook)] == list(range(1, len(code(notebook)) + 1))
    assert not any(output.output_type == "error" for cell in code(notebook) for output in cell.outputs)
    assert path.stat().st_size < 600_000
    assert 'jax.config.update("jax_enable_x64", True)' in code(notebook)[0].source


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
