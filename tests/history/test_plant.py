"""The commands of the plant's README, as printed, with the pump faster than there."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PLANT = Path(__file__).parents[2] / "notebooks" / "plant"


@pytest.mark.slow
def test_the_pump_of_the_readme_is_healthy_then_unknown_and_then_damaged(tmp_path):
    if not shutil.which("sqlite3"):
        pytest.skip("sqlite3 is not installed")
    block = re.search("```sh\n(.*?)```", (PLANT / "README.md").read_text(encoding="utf-8"), re.S)[1]
    activate, commands = block.replace("--factor 5", "--factor 500").split("\n", 1)
    assert activate == ". .venv/bin/activate"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    options = {"cwd": tmp_path, "env": os.environ | {"PATH": path}, "timeout": 300}
    text = commands.replace("../notebooks/plant", str(PLANT))
    result = subprocess.run(["bash", "-ec", text], capture_output=True, text=True, **options)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    decisions = [json.loads(line)["decision"] for line in lines if line.startswith("{")]
    assert len(decisions) == 30
    assert decisions[:10] == ["healthy"] * 10
    assert decisions[-5:] == ["outer"] * 5
    assert list(dict.fromkeys(decisions)) == ["healthy", "unknown", "outer"]
    assert re.search(r"\|decision\|raised\|unknown", lines[-1])  # printed by sqlite3, once
    assert not lines[-2].count("|raised|")
    points = (tmp_path / "plant" / "points.txt").read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("emacm,") for line in points) == 30
    gauges = (tmp_path / "plant" / "metrics" / "pump.prom").read_text(encoding="utf-8")
    assert 'emacm_decision{unit="pump 3",decision="outer"} 1.0' in gauges
