"""Whole outputs of one plant: three units, three states, unequal costs, unequal severities.

Each command is compared as a whole with tests/golden: words and the order of what is listed
exactly, numbers to 1 %. ``python tests/test_golden.py`` writes these files again; read the change.
"""

import contextlib
import html
import io
import json
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm.__main__ import main

GOLDEN = Path(__file__).parent / "golden"
FS, SPEED, N = 1000, 90.0, 4000  # 57 revolutions, 859 rpm
INNER, OUTER = 5.3, 3.7
LAYOUT = """
fs = 1000
velocity = "speed"
meta = "{unit}_{state}_{day:d}"
[units]
speed = "rpm"
vibration = "g"
"""
PARTS = f"""
[orders]
"inner ring" = {INNER}
"outer ring" = {OUTER}
"cage" = 0.4
"""
COSTS = "decision,healthy,inner,outer\nhealthy,0,9,6\ninner,2,0,5\nouter,3,4,0\ninspect,.7,.8,.9\n"
# Lines that differ from run to run, or by how scikit-learn divides the other families.
RUN = ("Model | ", "Saved: ", "Digest", "Versions", "auroc")
RUN += ("known flagged", "unknown flagged", "unknown called")
# Of the new recordings: unit, day, sizes of the lines of inner and outer ring, factor of the speed.
NEW = [
    ("drive", 3, 0.0, 0.0, 1.0),
    ("drive", 4, 0.0, 0.0, 1.0),
    ("fan", 1, 0.0, 0.0, 1.0),
    ("fan", 2, 0.0, 0.5, 1.0),
    ("fan", 3, 0.0, 0.15, 1.25),
    ("pump", 1, 0.0, 0.0, 0.7),
    ("pump", 2, 0.4, 0.0, 1.0),
    ("pump", 5, 1.6, 0.8, 1.0),
    ("pump", 6, 4.0, 0.0, 1.0),
]


def write(path, seed, inner=0.0, outer=0.0, factor=1.0):
    """Write a vibration with lines, a second harmonic of half their size, and noise in bursts."""
    rng = np.random.default_rng(seed)
    velocity = factor * SPEED * (1 + 0.05 * np.sin(2 * np.pi * np.arange(N) / N))
    angle = np.cumsum(velocity) / FS
    signal = 0.5 * rng.standard_normal(N) + 0.2 * np.sin(angle)
    for order, size in ((INNER, inner), (OUTER, outer)):
        signal += size * (np.sin(order * angle) + 0.5 * np.sin(2 * order * angle))
        signal += size * rng.standard_normal(N) * np.maximum(np.cos(order * angle), 0)
    np.savez(path, vibration=signal, speed=velocity * 30 / np.pi)


def make_plant():
    """Write the files of the plant into the present folder, with fixed times."""
    for folder in ("bench", "new", "healthy"):
        Path(folder).mkdir()
    for unit in range(9):
        for day in range(3):
            state = ("healthy", "inner", "outer")[unit % 3]
            size = (0.15, 0.4, 1.0)[day] * (1 + 0.1 * unit)
            sizes = {"inner": (size, 0.0), "outer": (0.0, size)}.get(state, (0.0, 0.0))
            write(f"bench/u{unit}_{state}_{day}.npz", 10 * unit + day, *sizes)
            if state == "healthy":
                shutil.copy(f"bench/u{unit}_{state}_{day}.npz", "healthy")
    for number, (unit, day, *options) in enumerate(NEW):
        write(f"new/{unit}_x_{day}.npz", 100 + number, *options)
    np.savez("new/fan_x_4.npz", vibration=np.ones(N))  # without a speed
    for name, text in (("layout", LAYOUT), ("parts", PARTS)):
        Path(f"{name}.toml").write_text(text)
    Path("actions.toml").write_text('inner = "Replace it."\nouter = "Grease it."\n')
    Path("costs.csv").write_text(COSTS)
    live = [path for path in ("drive_x_3", *["pump_x_6"] * 4, *["drive_x_4", "fan_x_1"] * 4)]
    signals = [np.load(f"new/{name}.npz") for name in live]
    columns = {name: np.concatenate([s[name] for s in signals]) for name in ("vibration", "speed")}
    pd.DataFrame(columns).round(4).to_csv("live.csv", index=False)
    for path in Path().rglob("*.npz"):
        os.utime(path, (1_800_000_000, 1_800_000_000))


def printed(*arguments):
    """Return the exit status of a command and what it prints."""
    streams = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        status = main([*arguments])
    texts = [f"[{status}] emacm {' '.join(arguments)}", *(s.getvalue() for s in streams)]
    return "\n".join(text.rstrip() for text in texts if text)


def page_text(path):
    """Return what a reader of a page sees, one line for each element; pictures by their labels."""
    page = Path(path).read_text(encoding="utf-8")
    page = re.sub(r"(?s)<(style|script)\b.*?</\1>", "", page)
    page = re.sub(r'<svg[^>]*?aria-label="([^"]*)".*?</svg>', r"[\1]", page, flags=re.DOTALL)
    page = re.sub(r"(?s)<svg.*?</svg>", "", page)
    page = re.sub(r"</t[dh]>\s*<t[dh][^>]*>", " | ", page)
    lines = re.sub(r"</?(?:p|h\d|li|tr|[uod]l|dt|dd|table|summary|details|div)\b[^>]*>", "\n", page)
    text = html.unescape(re.sub(r"<[^>]*>", "", lines))
    kept = (" ".join(line.split()) for line in text.splitlines())
    return "\n".join(line for line in kept if line and not line.startswith(RUN))


def outputs():
    """Return the outputs of the commands, by name of the golden file."""
    make_plant()
    made = {}
    with_layout = ("--layout", "layout.toml")
    learn = ("--labels", "state", "--groups", "unit", "--cost", "costs.csv")
    made["train"] = printed("train", "layout.toml", "bench", *learn, "--out", "model.skops")
    card = printed("describe", "model.skops").splitlines()
    made["describe"] = "\n".join(line for line in card if not line.startswith(RUN))
    scores = ("score", "model.skops", "new", *with_layout, "--unit", "unit", "--out", "seen.csv")
    made["score"] = printed(*scores)
    columns = ["recording", "decision", "expected_cost", "typicality"]
    columns += ["P(healthy)", "P(inner)", "P(outer)", "P(unknown)", "outside_training"]
    table = pd.read_csv("seen.csv")[columns].sort_values("recording").round(4)
    made["score"] += "\n" + table.to_csv(index=False)
    for state in ("inner", "healthy", "unknown"):
        made["score"] += "\n" + printed(*scores, "--fail-on", state)
    options = ("--actions", "actions.toml", "--parts", "parts.toml", "--unit", "unit")
    made["report"] = printed(
        "report", "model.skops", "new", *with_layout, *options, "--time", "day"
    )
    for page in ("index", "fleet", "pump_x_5", "fan_x_3", "pump_x_6", "fan_x_4"):
        made["report"] += f"\n\n== {page}\n{page_text(f'report/{page}.html')}"
    one = ("report", "model.skops", "new/pump_x_6.npz", *with_layout, "--out", "one.html")
    made["report"] += f"\n\n{printed(*one)}\n{page_text('one.html')}"
    trend = ("trend", "healthy", "new", *with_layout, "--groups", "unit", "--parts", "parts.toml")
    trend += ("--unit", "unit", "--time", "day", "--out", "trend.csv")
    for more in ((), ("--fail-on-alarm",)):
        made["trend"] = made.get("trend", "") + printed(*trend, *more) + "\n"
    table = pd.read_csv("trend.csv")[["unit", "time", "index", "limit", "alarm", "error"]]
    made["trend"] += table.round(3).to_csv(index=False)
    watch = ("monitor", "model.skops", "live.csv", *with_layout, "--max-speed", "2000")
    watch += ("--idle", "0.1", "--every", "57", "--name", "pump", "--start", "2027-01-15T08:00")
    records = [json.loads(line) for line in printed(*watch).splitlines() if line.startswith("{")]
    keys = ("start", "end", "decision", "P(outer)", "P(unknown)", "alarms", "outside_training")
    made["monitor"] = pd.DataFrame(records)[[*keys]].round(4).to_csv(index=False)
    made["find"] = printed("find", "new", *with_layout, "--parts", "parts.toml")
    return {name: text.replace(f"{Path.cwd()}/", "") for name, text in made.items()}


def parts(text):
    """Return the words of a text, and its numbers; tables of other versions have other gaps."""
    text = re.sub(" +", " ", text)
    number = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])"
    return re.sub(number, "#", text).splitlines(), [float(n) for n in re.findall(number, text)]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    pytest.importorskip("jinja2", reason="jinja2 is not installed (extra 'report')")
    with contextlib.chdir(tmp_path_factory.mktemp("plant")):
        return outputs()


@pytest.mark.parametrize("name", sorted(path.stem for path in GOLDEN.iterdir()))
def test_an_output_is_as_it_was_read(made, name):
    words, numbers = parts(made[name])
    expected_words, expected = parts((GOLDEN / f"{name}.txt").read_text(encoding="utf-8"))
    assert words == expected_words
    np.testing.assert_allclose(numbers, expected, rtol=0.01, atol=1e-3)


if __name__ == "__main__":
    import tempfile

    os.environ["MPLBACKEND"] = "Agg"
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        results = outputs()
    for name, text in results.items():
        (GOLDEN / f"{name}.txt").write_text(text.rstrip() + "\n", encoding="utf-8")
    sys.exit()
