"""The notebooks run from top to bottom, have pictures, and print what stands in them."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def outputs(notebook):
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


def pictures(notebook):
    return sum("image/png" in output.get("data", {}) for output in outputs(notebook))


def printed(notebook):
    """What the cells print, as words and as numbers."""
    text = "".join(output.get("text", "") for output in outputs(notebook) if output.get("name") == "stdout")
    return NUMBER.sub("#", text).split(), [float(number) for number in NUMBER.findall(text)]


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["flight_log", "heater_step", "paper_table"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path):
    notebook = nbformat.read(path, as_version=4)
    kept, (words, numbers) = pictures(notebook), printed(notebook)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(path.parent)}}).execute()
    assert pictures(notebook) == kept > 0
    # Other compilers and libraries of mathematics may round the last digits otherwise.
    assert printed(notebook)[0] == words
    assert printed(notebook)[1] == pytest.approx(numbers, rel=1e-6) and len(numbers) > 10
    assert path.stat().st_size < 300_000
