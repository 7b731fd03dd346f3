"""The command example: files that state all that is needed, with known faults."""

import pytest

from emacm import Layout, RecordingFolder, find_faults
from emacm.__main__ import main
from emacm.machine.rolling import bearing_of
from emacm.reports.inputs import read_parts


@pytest.mark.slow
def test_the_faults_of_the_example_are_found_and_its_healthy_runs_are_not(tmp_path, capsys):
    folder = tmp_path / "example"
    assert main(["example", str(folder)]) == 0
    assert str(folder / "run.csv") in capsys.readouterr().out
    bearing = read_parts(folder / "parts.toml")
    assert bearing == [bearing_of("6205")]
    layout = Layout(velocity="speed", meta="{unit}_{state}_{run:d}")
    every_fourth_unit = list(RecordingFolder(folder / "bench", layout))[::12]  # a run of each
    runs = [*every_fourth_unit, *RecordingFolder(folder / "new", layout)]
    kinds = {"healthy": "none", "outer": "BPFO", "inner": "BPFI"}
    named = find_faults(runs, bearing)["named"].tolist()
    states = [run.meta["state"] for run in runs[:-6]]
    states += ["healthy", "healthy", "outer", "healthy", "healthy", "inner"]
    assert named == [kinds[state] for state in states]
    assert main(["example", str(folder)]) == 2
    assert "has files. Name an empty one" in capsys.readouterr().err
