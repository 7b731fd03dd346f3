"""The notebooks are committed with their pictures, and still run without a warning."""

import json
import os
import re
from pathlib import Path

import nbformat
import numpy as np
import pandas as pd
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
REAL = [path for path in NOTEBOOKS if "load_cranfield" in path.read_text(encoding="utf-8")]
SIMULATED = [path for path in NOTEBOOKS if path not in REAL]
NAMES = {"argvalues": NOTEBOOKS, "ids": lambda path: path.stem}
OF_REAL = {"argvalues": REAL, "ids": lambda path: path.stem}
LARGEST = 300_000  # bytes
# Simulations are run for a shorter time than in the notebook: what is compared does not change.
SHORTER = {
    "07_what_chapter_4_decides_on": (
        "thesis_benches(duration=3.0)",
        "thesis_benches(duration=1.0)",
    ),
    "08_load_speed_and_unit": ('"duration": 3,', '"duration": 2,'),
}
# Numbers of equations, sections, orders and notebooks are no results; nor are those of these texts:
# inputs of the simulation, and figures of the thesis.
NAMED = re.compile(r"(?:Eqs?\. \(|[Ss]ection |[Oo]rders? |doi:|\|6 ± |twice )[\d.]+")
# Whole numbers below 100 are quantities only with a unit.
UNITS = "%|dB|m?s|h|min|k?Hz|rev/s|rad/s|rpm|[KMG]B|m?[AgV]|kgf|times|years|units|runs|revolutions"
NUMBER = re.compile(rf"(?<![\w.^-])(\d+\.\d+|\d{{3,}}|\d+(?= (?:{UNITS})(?!\w)))(?![\w.]*\d)( %)?")
NOT_RESULTS = """
0.1 A|0.25 A RMS|513 values|12.5 A², a defect 0.005 A²|√½ = 0.71|reports 72 %|0.72 (bin 11
0.77 (bin 4|the 600 test runs|turns at 4.8 rev/s|25/2/4.8 = 2.6|severity 0.5 and|severity 0.25 in
level 1.0 for|0.2 for the degraded|420, 1900 and 5200 Hz|is order 6.25|(14.14)|to 1000 Hz
rises from 0 to 120 Hz|each power by 0.36|of the 120 runs|ISO 20816-3|IEC 61260-1
34 dB stronger|of the thesis contain 21|thesis contains 21|on 40 runs of
of 28 revolutions, at most 62 rev/s|named from 6 dB on
"""


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


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
    long, short = SHORTER.get(path.stem, ("", ""))
    assert not long or sum(cell.source.count(long) for cell in notebook.cells) == 1
    for cell in notebook.cells if long else []:
        cell.source = cell.source.replace(long, short)
    kernel.execute(cleanup_kc=False)
    del notebook.cells[0]
    return notebook


def assert_runs_as_kept(path, *where):
    """Run a notebook: nothing on stderr, and outputs of the same kinds as in the repository."""
    again, kept = execute(path, *where), nbformat.read(path, as_version=4)
    assert "".join(o.text for o in outputs(again.cells) if o.get("name") == "stderr") == ""
    for cell, cell_kept in zip(again.cells, kept.cells, strict=True):
        kinds, kinds_kept = (
            [(o.output_type, sorted(o.get("data", {}))) for o in c.get("outputs", [])]
            for c in (cell, cell_kept)
        )
        assert kinds == kinds_kept, cell.source


@pytest.mark.parametrize("path", **NAMES)
def test_a_notebook_is_kept_small_with_its_pictures_and_without_traces_of_its_execution(path):
    text = path.read_text(encoding="utf-8")
    kept = json.loads(text)
    nbformat.validate(kept)  # of the file: reading it would give missing ids
    cells, found = kept["cells"], outputs(kept["cells"])
    assert len({cell["id"] for cell in cells}) == len(cells)
    assert len(text.encode()) < LARGEST
    assert any("image/png" in output.get("data", {}) for output in found)
    assert not any(o.get("name") == "stderr" or o["output_type"] == "error" for o in found)
    assert all(cell["metadata"] == {} for cell in cells)
    assert all(part.get("execution_count") is None for part in [*cells, *found])
    assert not re.search("/root/|/tmp/", text)


def numbers(text):
    return [abs(float(n)) for n in re.findall(r"(?<![\w.])-?\d*\.?\d+(?:e[+-]\d+)?", text)]


def printed(cells):
    texts = [o.get("text", "") + o.get("data", {}).get("text/plain", "") for o in outputs(cells)]
    return numbers("\n".join(texts))


@pytest.mark.parametrize("path", **NAMES)
def test_a_number_in_the_text_is_in_the_code_or_in_an_output_beside_it(path):
    notebook = nbformat.read(path, as_version=4)
    code = numbers("\n".join(cell.source for cell in notebook.cells if cell.cell_type == "code"))
    for place, cell in enumerate(notebook.cells):
        if cell.cell_type != "markdown":
            continue
        text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", NAMED.sub("", " ".join(cell.source.split())))
        for words in filter(None, re.split(r"[|\n]", NOT_RESULTS)):
            text = text.replace(words, "")
        near = printed(notebook.cells[max(0, place - 3) : place + 3])
        for found in NUMBER.finditer(text):
            value, half = float(found[1]), 0.5001 / 10 ** len(found[1].partition(".")[2])
            scales = (1, 100) if found[2] else (1,)  # a fraction may be printed
            shown = any(abs(value - scale * n) <= half for n in near for scale in scales)
            given = any(abs(value - scale * n) < 1e-9 for n in code for scale in scales)
            assert shown or given, text[max(0, found.start() - 60) : found.end() + 20]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the packages of the notebook server
@pytest.mark.parametrize("path", SIMULATED, ids=lambda path: path.stem)
def test_a_notebook_runs_and_warns_of_nothing(path, kernel, tmp_path):
    assert_runs_as_kept(path, kernel, tmp_path)


@pytest.fixture(scope="module")
def few_recordings(cranfield_file, tmp_path_factory):
    """Write two of the five sequences of each state, load and odd run; return the folder."""
    with np.load(cranfield_file) as stored:
        arrays = dict(stored)
    frame = pd.DataFrame({name: arrays[name] for name in ("state", "load_kgf", "run")})
    few = frame.groupby([*frame]).cumcount() < 2
    kept = np.flatnonzero(few & (frame["run"] % 2 == 1))
    folder = tmp_path_factory.mktemp("data") / "cranfield_ema"
    folder.mkdir()
    few = {name: values[kept] if values.ndim else values for name, values in arrays.items()}
    np.savez(folder / cranfield_file.name, **few)
    return folder.parent


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", **OF_REAL)
def test_a_notebook_of_the_real_actuator_runs_with_its_recordings(
    path, kernel, few_recordings, tmp_path
):
    assert_runs_as_kept(path, kernel, tmp_path, few_recordings)


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
