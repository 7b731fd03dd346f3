"""The commands of the plant's README, as printed, with the pump faster than there."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PLANT = Path(__file__).parents[2] / "notebooks" / "plant"


@pytest.mark.slow
def test_the_pump_of_the_readme_is_healthy_then_unknown_and_then_damaged(tmp_path):
    block = re.search("```sh\n(.*?)```", (PLANT / "README.md").read_text(encoding="utf-8"), re.S)[1]
    activate, *commands = block.replace("--factor 5", "--factor 500").splitlines()
    assert activate == ". .venv/bin/activate"
    text = "\n".join(commands).replace("../notebooks/plant", str(PLANT))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    options = {"cwd": tmp_path, "env": os.environ | {"PATH": path}, "timeout": 300}
    result = subprocess.run(["bash", "-ec", text], capture_output=True, text=True, **options)
    assert (result.returncode, result.stderr) == (0, "")
    lines = [line for line in result.stdout.splitlines() if line.startswith("{")]
    decisions = [json.loads(line)["decision"] for line in lines]
    assert len(decisions) == 30
    assert decisions[:10] == ["healthy"] * 10
    assert decisions[-5:] == ["outer"] * 5
    assert list(dict.fromkeys(decisions)) == ["healthy", "unknown", "outer"]
