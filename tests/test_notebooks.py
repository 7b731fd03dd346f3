"""The notebooks are committed with their pictures, and still run without a warning."""

import json
import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
REAL = [path for path in NOTEBOOKS if "load_cranfield" in path.read_text(encoding="utf-8")]
SIMULATED = [path for path in NOTEBOOKS if path not in REAL]
NAMES = {"argvalues": NOTEBOOKS, "ids": lambda path: path.stem}
OF_REAL = {"argvalues": REAL, "ids": lambda path: path.stem}
LARGEST = 300_000  # bytes


def outputs(notebook):
    return [output for cell in notebook.cells for output in cell.get("outputs", [])]


@pytest.fixture(scope="module")
def kernel():
    """One kernel for all notebooks: most of them import the same packages, for seconds."""
    client = NotebookClient(nbformat.v4.new_notebook(), timeout=600)
    with client.setup_kernel(env={k: v for k, v in os.environ.items() if k != "MPLBACKEND"}):
        yield client


def execute(path, kernel, folder, recordings="."):
    """Run a notebook in a folder, without the names of another one; return it with its outputs."""
    notebook = kernel.nb = nbformat.read(path, as_version=4)
    fresh = f"%reset -f\n%cd -q {folder}\n%env EMACM_DATA={recordings}"
    notebook.cells.insert(0, nbformat.v4.new_code_cell(fresh))
    kernel.execute(cleanup_kc=False)
    del notebook.cells[0]
    return notebook


def assert_runs_as_kept(path, *where):
    """Run a notebook: nothing on stderr, and outputs of the same kinds as in the repository."""
    again, kept = execute(path, *where), nbformat.read(path, as_version=4)
    assert "".join(o.text for o in outputs(again) if o.get("name") == "stderr") == ""
    for cell, cell_kept in zip(again.cells, kept.cells, strict=True):
        kinds, kinds_kept = (
            [(o.output_type, sorted(o.get("data", {}))) for o in c.get("outputs", [])]
            for c in (cell, cell_kept)
        )
        assert kinds == kinds_kept, cell.source


def test_the_notebooks_are_numbered_as_they_are_read():
    assert [path.stem[:2] for path in NOTEBOOKS] == [f"{n:02}" for n in range(1, 14)]


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_kept_with_its_pictures_and_small(path):
    notebook = nbformat.read(path, as_version=4)
    data = [output.get("data", {}) for output in outputs(notebook)]
    assert any("image/png" in kinds for kinds in data)
    assert not any(output.get("name") == "stderr" for output in outputs(notebook))
    assert not any(output.output_type == "error" for output in outputs(notebook))
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_kept_without_counts_and_times_of_its_execution(path):
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        assert cell.metadata == {}
        assert cell.get("execution_count") is None
    assert all(output.get("execution_count") is None for output in outputs(notebook))
    assert "/root/" not in path.read_text(encoding="utf-8")
    assert "/tmp/" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_valid_and_its_cells_have_unique_ids(path):
    kept = json.loads(path.read_text(encoding="utf-8"))
    nbformat.validate(kept)  # of the file: reading it would give missing ids
    ids = [cell["id"] for cell in kept["cells"]]
    assert len(set(ids)) == len(ids)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the packages of the notebook server
@pytest.mark.parametrize("path", SIMULATED, ids=lambda path: path.stem)
def test_a_notebook_runs_and_warns_of_nothing(path, kernel, tmp_path):
    assert_runs_as_kept(path, kernel, tmp_path)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", **OF_REAL)
def test_a_notebook_of_the_real_actuator_runs_with_its_recordings(
    path, kernel, cranfield_file, tmp_path
):
    assert_runs_as_kept(path, kernel, tmp_path, cranfield_file.parents[1].resolve())


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", **OF_REAL)
def test_without_recordings_of_the_real_actuator_a_notebook_states_what_it_needs(
    path, kernel, tmp_path
):
    with pytest.raises(CellExecutionError) as stopped:
        execute(path, kernel, tmp_path, tmp_path)
    assert stopped.value.ename == "NoRecordings"
    assert "set EMACM_DATA to the folder that holds cranfield_ema/*.npz" in stopped.value.evalue
    assert "Traceback (most recent call last)" not in stopped.value.traceback
