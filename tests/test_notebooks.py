"""The notebooks run from clean, warn of nothing, and are kept without output."""

import json
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
REAL = "06_a_real_actuator"
SIMULATED = [path for path in NOTEBOOKS if path.stem != REAL]
NAMES = {"argvalues": NOTEBOOKS, "ids": lambda path: path.stem}


def execute(path, folder):
    """Run a notebook in a folder; return it with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=300, resources=resources).execute()
    return notebook


def warnings_of(notebook):
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return "".join(output.text for output in outputs if output.get("name") == "stderr")


def test_the_notebooks_are_numbered_as_they_are_read():
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05", "06"]


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_kept_without_output(path):
    cells = nbformat.read(path, as_version=4).cells
    code = [cell for cell in cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in code)


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_valid_and_its_cells_have_names_of_their_own(path):
    kept = json.loads(path.read_text(encoding="utf-8"))
    nbformat.validate(kept)  # in the file: reading it would give names to nameless cells
    names = [cell["id"] for cell in kept["cells"]]
    assert len(set(names)) == len(names)


@pytest.mark.filterwarnings("default")  # of the notebook server's own packages
@pytest.mark.parametrize("path", SIMULATED, ids=lambda path: path.stem)
def test_a_notebook_runs_from_clean_and_warns_of_nothing(path, tmp_path):
    assert warnings_of(execute(path, tmp_path)) == ""


@pytest.mark.filterwarnings("default")
def test_the_real_actuator_is_judged_where_its_recordings_are(
    cranfield_file, tmp_path, monkeypatch
):
    monkeypatch.setenv("EMACM_DATA", str(cranfield_file.parents[1].resolve()))
    assert warnings_of(execute(NOTEBOOKS[-1], tmp_path)) == ""


@pytest.mark.filterwarnings("default")
def test_without_recordings_of_the_real_actuator_its_notebook_says_what_it_needs(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("EMACM_DATA", str(tmp_path))
    with pytest.raises(CellExecutionError) as stopped:
        execute(NOTEBOOKS[-1], tmp_path)
    assert stopped.value.ename == "NoRecordings"
    assert "set EMACM_DATA to the folder that holds cranfield_ema/*.npz" in stopped.value.evalue
    assert "Traceback (most recent call last)" not in stopped.value.traceback
