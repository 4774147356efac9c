"""The notebooks in examples/ run from top to bottom. Run by tests/python.sh where nbclient is installed."""

import nbclient
import nbformat
import pytest
from conftest import ROOT

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_models(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "clear its outputs before a commit"
    # A busy machine is slow; what hangs ends all the same.
    limits = {"timeout": 1200, "startup_timeout": 600}
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(tmp_path)}}, **limits).execute()
    shown = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("<svg" in data.get("text/html", "") for data in shown)


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 3


def test_progress_is_one_bar_below_the_cell():
    code = (
        "import numpy as np, roscausal as rc\n"
        "_ = rc.discover(np.random.default_rng(1).normal(size=(200, 3)), method='pcmci', test='parcorr', progress=True)"
    )
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbclient.NotebookClient(notebook, timeout=1200, startup_timeout=600).execute()
    (shown,) = notebook.cells[0].outputs
    assert "<progress" in shown["data"]["text/html"] and "tests" in shown["data"]["text/plain"]
