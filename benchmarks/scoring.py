"""Scoring 10,000 files: CPU time for each file, and memory.

    python benchmarks/scoring.py [--quick] [--files N] [--json [FILE]]

One file of 3 s at 12 kHz (vibration and speed, float32, 288 kB) is written 100 times with different
noise, and linked under 10,000 names, so that the disk holds 29 MB. `emacm score` runs in a process
of its own; its CPU time is that of the system (user and system), its memory the largest resident
set (Linux). The time of a run on one file (imports, model) is subtracted. Once for each
implementation of the inner loops: numba takes 100 MB when it is loaded, and pandas loads pyarrow
(25 MB) where it is installed.

Before that, 64 such recordings in one process, medians of interleaved repeats: `score` beside
`predict` on all of them, both of new recordings in memory; and of CSV files beside reading alone.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from measure import json_option, medians, write_json
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    Layout,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingFolder,
    load_model,
    save_model,
    score,
)

FS, N_TIMES, N_DIFFERENT = 12_000, 36_000, 100
LIMITS = {"CPU time [ms per file]": 5.0, "memory [MB]": 350.0}
WANTED = {"score over predict": 1.6, "score of CSV files over reading": 1.5}
LAYOUT = 'fs = 12000\nvelocity = "speed"\n'


def write_files(folder: Path, n_files: int) -> None:
    """Write some files, and link them under many names."""
    rng = np.random.default_rng(0)
    angle = 2 * np.pi * 25 * np.arange(N_TIMES) / FS
    for number in range(min(N_DIFFERENT, n_files)):
        line = (0.1 + 0.9 * (number % 2)) * np.sin(3.58 * angle)
        vibration = (rng.normal(size=N_TIMES) + line).astype(np.float32)
        speed = np.full(N_TIMES, 2 * np.pi * 25, np.float32)
        np.savez(folder / f"{number:05d}.npz", vibration=vibration, speed=speed)
    for number in range(N_DIFFERENT, n_files):
        os.link(folder / f"{number % N_DIFFERENT:05d}.npz", folder / f"{number:05d}.npz")


def write_model(folder: Path) -> None:
    """Fit a model on the first 40 files, and save it."""
    (folder / "layout.toml").write_text(LAYOUT)
    layout = Layout.from_toml(folder / "layout.toml")
    recordings = RecordingFolder(folder / "files", layout, "0000*.npz")[:10]
    recordings += RecordingFolder(folder / "files", layout, "0001*.npz")[:10]
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", unknown="unknown")
    model = make_pipeline(
        OrderResampler(2 * np.pi / 64),
        OrderPSD(16),
        BinTransformer(max_order=20),
        FunctionTransformer(np.log10),
        bayes,
    )
    states = ["healthy", "worn"] * (len(recordings) // 2)
    groups = np.arange(len(recordings)) // 4
    model.fit(recordings, states, costsensitivegaussianbayes__groups=groups)
    save_model(model, folder / "model.emacm")


def measured(folder: Path, paths: list[str], kernels: str) -> tuple[float, float]:
    """Return CPU time [s] and largest memory [MB] of `emacm score` on some paths."""
    command = [sys.executable, "-c", CHILD, *paths]
    environment = os.environ | {"EMACM_KERNELS": kernels}
    printed = subprocess.run(
        command, cwd=folder, check=True, capture_output=True, text=True, env=environment
    ).stderr.split()
    return float(printed[-2]), float(printed[-1])


def ratios(folder: Path, n_recordings: int, repeats: int) -> dict[str, float]:
    """Print the processor's time of `score`, `predict` and reading, and return its ratios."""
    model = load_model(folder / "model.emacm")
    layout = Layout.from_toml(folder / "layout.toml")
    columns = [dict(np.load(path)) for path in sorted((folder / "files").iterdir())[:n_recordings]]
    (folder / "csv").mkdir()
    for number, own in enumerate(columns):
        pd.DataFrame(own).to_csv(folder / "csv" / f"{number:02d}.csv", index=False)
    files = RecordingFolder(folder / "csv", layout)

    def new() -> list[Recording]:
        return [
            Recording({"vibration": own["vibration"]}, FS, velocity=own["speed"]) for own in columns
        ]

    def read() -> None:
        for recording in files:
            recording.content()
            recording.release()

    runs = {
        "predict": lambda: model.predict(new()),
        "score": lambda: score(model, new()),
        "reading CSV files": read,
        "score of CSV files": lambda: score(model, files),
    }
    spent = medians(runs, repeats, clock=time.process_time)
    for name, seconds in spent.items():
        print(f"  {name:24} {1000 * seconds / n_recordings:8.2f} ms per recording")
    return {
        "score over predict": spent["score"] / spent["predict"],
        "score of CSV files over reading": spent["score of CSV files"] / spent["reading CSV files"],
    }


CHILD = """
import resource, sys
from pathlib import Path
from emacm.__main__ import main
status = main(["score", "model.emacm", *sys.argv[1:], "--layout", "layout.toml",
               "--out", "table.csv", "--again"])
assert status == 0, status
used = resource.getrusage(resource.RUSAGE_SELF)
status = Path("/proc/self/status").read_text()
largest = int(status.split("VmHWM:")[1].split()[0]) / 1024
print(used.ru_utime + used.ru_stime, largest, file=sys.stderr)
"""


def main() -> None:
    """Print the CPU time for each file and the memory."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="20 files, once, in NumPy")
    parser.add_argument("--files", type=int, default=10_000)
    json_option(parser)
    options = parser.parse_args()
    full = options.files, 7, ("numba", "numpy")
    n_files, repeats, implementations = (20, 1, ("numpy",)) if options.quick else full
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "files").mkdir()
        write_files(folder / "files", n_files)
        write_model(folder)
        found = ratios(folder, min(64, n_files), repeats)
        rows: list[dict[str, Any]] = [{"of": title, "ratio": r} for title, r in found.items()]
        for title, ratio in found.items():
            print(f"  {title:31} {ratio:5.2f}   wanted {WANTED[title]:g}")
        print(f"{n_files} files of 3 s at 12 kHz")
        for kernels in implementations:
            start, small = measured(folder, ["files/00000.npz"], kernels)
            total, memory = measured(folder, ["files"], kernels)
            n_rows = (folder / "table.csv").read_text().count("\n") - 1
            assert n_rows == n_files
            per_file = 1000 * (total - start) / (n_files - 1)
            print(f"{kernels}: start {start:.2f} s, {small:.0f} MB")
            rows.append({"of": kernels} | dict(zip(LIMITS, (per_file, memory), strict=True)))
            for title, value in zip(LIMITS, (per_file, memory), strict=True):
                print(f"  {title:24} {value:8.2f}   limit {LIMITS[title]:g}")
    write_json(options, rows)


if __name__ == "__main__":
    main()
