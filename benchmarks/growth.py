"""How time and memory grow with the number, the channels, the length and the grid.

An hour of 16 channels in float32 (11 GB, written to a temporary folder) passes from memory-mapped
files, and the anonymous memory of the process is watched. Then one quantity grows at a time, at
48 kHz and 48 rev/s; the last column is what the time grows by when it doubles. Then a search over
the size of bins, of more and more files. All times are of the processor, which other programs of a
shared computer change little. Run from the repository, on Linux:

    OPENBLAS_NUM_THREADS=1 python benchmarks/growth.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from sklearn.model_selection import GridSearchCV
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
)

FS, RATE, TOP = 48_000.0, 48.0, 50  # Hz, rev/s, orders


def made(seconds: float, n_channels: int, seed: int = 0) -> Recording:
    """Make a recording of noise, whose shaft runs with 15 % ripple."""
    times = np.arange(int(seconds * FS)) / FS
    velocity = 2 * np.pi * RATE * (1 + 0.15 * np.sin(2 * np.pi * times))
    rows = np.random.default_rng(seed).standard_normal((n_channels, len(times)))
    return Recording({f"c{i}": row for i, row in enumerate(rows)}, FS, velocity=velocity)


def measured(recordings: list[Recording], nrev: int = 128) -> dict[str, float]:
    """Time of one pass, and the memory that it takes beyond recordings and features."""
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / nrev),
        OrderPSD(4, max_order=TOP, memory=False),
        BinTransformer(max_order=TOP),
    ).fit(recordings[:1])
    pipeline.transform(recordings[:1])
    start = time.process_time()
    features = pipeline.transform(recordings)
    spent = time.process_time() - start
    tracemalloc.start()
    pipeline.transform(recordings)
    used = tracemalloc.get_traced_memory()[1] - features.nbytes
    tracemalloc.stop()
    return {"s": spent, "memory [MB]": used / 1e6}


def growth(quick: bool) -> list[dict[str, Any]]:
    """Let one quantity grow at a time."""
    rows: list[dict[str, Any]] = []
    few = [made(0.5, 1, seed) for seed in range(10)]
    for n in (10, 30) if quick else (10, 100, 1000, 10_000):
        listed = (few * (n // 10))[:n]
        rows.append({"what": "recordings of 0.5 s, 1 channel", "n": n} | measured(listed))
    for n in (1, 2) if quick else (1, 2, 4, 8, 16, 32):
        rows.append({"what": "channels of 10 s", "n": n} | measured([made(10.0, n)]))
    for n in (1, 2) if quick else (1, 10, 100, 600, 3600):
        rows.append({"what": "seconds, 1 channel", "n": n} | measured([made(n, 1)]))
    for n in (128, 256) if quick else (128, 256, 512, 1024):
        row = measured([made(10.0, 5)], nrev=n)
        rows.append({"what": "samples per revolution, 5 channels of 10 s", "n": n} | row)
    for before, row in zip([None, *rows], rows, strict=False):
        if before and before["what"] == row["what"]:
            row["time, doubled"] = (row["s"] / before["s"]) ** (1 / np.log2(row["n"] / before["n"]))
    return rows


def searches(quick: bool) -> list[dict[str, Any]]:
    """Search over two sizes of bins in 3 folds of files, of 0.5 s and 1 channel."""
    steps = make_pipeline(
        OrderResampler(2 * np.pi / 64),
        OrderPSD(4, max_order=20),
        BinTransformer(max_order=20),
        FunctionTransformer(np.log),
        CostSensitiveGaussianBayes(covariance="tied"),
    )
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for n in (90, 180) if quick else (100, 1000, 10_000):
            for seed in range(rows[-1]["n"] if rows else 0, n):
                recording = made(0.5, 1, seed)
                arrays = dict(recording.signals) | {"speed": recording.velocity}
                np.savez(Path(folder) / f"{seed % 2}_{seed:05}.npz", **arrays)
            X = RecordingFolder(folder, Layout(fs=FS, velocity="speed", meta="{state:d}_{run:d}"))
            y = [recording.meta["state"] for recording in X]
            start = time.process_time()
            with AnonymousMemory() as memory:
                GridSearchCV(steps, {"bintransformer__bin_size": [1, 2]}, cv=3).fit(X, y)
            rows.append(
                {
                    "what": "files in a search",
                    "n": n,
                    "s": time.process_time() - start,
                    "MB of the files": n * (made(0.5, 1).velocity.nbytes * 2) / 1e6,
                    "memory [MB]": (memory.peak - memory.before) / 1e6,
                }
            )
    return rows


class AnonymousMemory:
    """Watch the anonymous memory of the process, in a thread."""

    def __init__(self) -> None:
        self.before = self.peak = self._now()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> AnonymousMemory:
        """Begin to watch."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self._done.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._done.wait(0.02):
            self.peak = max(self.peak, self._now())

    def _now(self) -> int:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        line = next(line for line in status.splitlines() if line.startswith("RssAnon"))
        return 1024 * int(line.split()[1])


def long_recording(folder: Path, seconds: int, n_channels: int) -> Recording:
    """Write channels to files, second by second, and map them."""
    rng = np.random.default_rng(0)
    names = [*(f"c{i}" for i in range(n_channels)), "velocity"]
    paths = {name: folder / f"{name}.npy" for name in names}
    arrays = {
        name: np.lib.format.open_memmap(path, "w+", np.float32, (int(seconds * FS),))
        for name, path in paths.items()
    }
    times = np.arange(int(FS)) / FS
    velocity = 2 * np.pi * RATE * (1 + 0.15 * np.sin(2 * np.pi * times))
    noise = rng.standard_normal((n_channels, 2 * int(FS))).astype(np.float32)
    for second in range(seconds):
        part = slice(second * int(FS), (second + 1) * int(FS))
        shift = int(rng.integers(int(FS)))
        for array, row in zip(arrays.values(), noise, strict=False):
            array[part] = row[shift : shift + int(FS)]
        arrays["velocity"][part] = velocity
    for array in arrays.values():
        array.flush()
    del arrays
    mapped = {name: np.load(path, mmap_mode="r") for name, path in paths.items()}
    return Recording({n: mapped[n] for n in names[:-1]}, FS, velocity=mapped["velocity"])


def hour(quick: bool) -> dict[str, Any]:
    """Pass a long recording from memory-mapped files."""
    seconds, n_channels = (20, 2) if quick else (3600, 16)
    pipeline = make_pipeline(
        OrderResampler(), OrderPSD(4, max_order=TOP, memory=False), BinTransformer(max_order=TOP)
    )
    pipeline.fit_transform([made(1.0, 1)])  # compiled by now
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        recording = long_recording(Path(folder), seconds, n_channels)
        written = time.process_time() - start
        with AnonymousMemory() as memory:
            start = time.process_time()
            pipeline.fit_transform([recording])
            spent = time.process_time() - start
        del recording
    return {
        "what": f"{seconds} s of {n_channels} channels, float32, memory-mapped",
        "GB": 4e-9 * seconds * FS * (n_channels + 1),
        "s to write": written,
        "s": spent,
        "anonymous memory before [MB]": memory.before / 1e6,
        "at the peak [MB]": memory.peak / 1e6,
    }


def main() -> None:
    """Measure, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two sizes each, 20 s mapped")
    json_option(parser)
    options = parser.parse_args()
    print(header())
    rows = [hour(options.quick)]  # first, while the process holds nothing else
    print(table(rows))
    rows += growth(options.quick)
    print(table(rows[1:]))
    found = searches(options.quick)
    print(table(found))
    write_json(options, rows + found)


if __name__ == "__main__":
    main()
