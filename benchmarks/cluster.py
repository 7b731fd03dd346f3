"""When a cluster pays: a search in one process, in two, and on two workers of Dask and of Ray.

The recordings are files that the workers read. For short and long recordings, the time of a
search relative to one process, and for Dask what all processes sent, relative to the size of the
files; then the time of a task that does nothing. A cluster on one computer has no more cores than
processes have: what it costs beside "2 processes" is the cost of the cluster. A fit sends some
40 kB, whatever the length of the recordings. It pays where a fit takes much longer than a task that
does nothing, and where the files are stored elsewhere or one computer has too few cores. Run from
the repository; without the packages distributed and ray, their rows are missing:

    OPENBLAS_NUM_THREADS=1 python benchmarks/cluster.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from measure import header, json_option, table, write_json
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    Layout,
    OrderPSD,
    OrderResampler,
    RecordingFolder,
)

FS = 12_000.0
GRID = {"orderpsd__revolutions": [5, 8], "bintransformer__bin_size": [0.5, 1.0, 2.0]}
N_TASKS = 100


def write_folder(folder: Path, seconds: float, n_files: int) -> RecordingFolder:
    """Write recordings of two channels; every other one has a line at order 3.58."""
    rng = np.random.default_rng(0)
    n_times = int(seconds * FS)
    speed = 150 + 20 * np.sin(np.arange(n_times) / FS)
    angle = np.cumsum(speed) / FS
    for number in range(n_files):
        state = ("healthy", "worn")[number % 2]
        channels = rng.normal(size=(2, n_times)).astype(np.float32)
        channels[0] += 0.1 * (number % 2) * np.sin(3.58 * angle)
        path = folder / f"{'ABCD'[number // 2 % 4]}_{state}_{number}.npz"
        np.savez(path, vibration=channels[0], current=channels[1], speed=speed)
    return RecordingFolder(folder, Layout(fs=FS, velocity="speed", meta="{unit}_{state}_{run:d}"))


def search(folder: RecordingFolder) -> Any:
    """Search on the files; the best pipeline is fitted in a task of its own."""
    states = [recording.meta["state"] for recording in folder]
    units = [recording.meta["unit"] for recording in folder]
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / 50),
        OrderPSD(),
        BinTransformer(max_order=20),
        FunctionTransformer(np.log10),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto"),
    )
    found = GridSearchCV(pipeline, GRID, cv=GroupKFold(4), scoring="neg_log_loss", refit=False)
    found.fit(folder, states, groups=units)
    best = pipeline.set_params(**found.best_params_)
    joblib.Parallel()([joblib.delayed(best.fit)(folder, states)])
    return found.cv_results_["mean_test_score"]


def nothing() -> None:
    """Do nothing."""


def count_sent_bytes() -> None:
    """Count what this process sends by any connection of Dask, except heartbeats."""
    from distributed.comm.tcp import TCP

    TCP.sent, write = 0, TCP.write

    async def counted(self: Any, message: Any, *args: Any, **options: Any) -> int:
        n_bytes = await write(self, message, *args, **options)
        parts = message if isinstance(message, list | tuple) else [message]
        if not all(isinstance(p, dict) and "heartbeat" in str(p.get("op")) for p in parts):
            TCP.sent += n_bytes
        return n_bytes

    TCP.write = counted


def sent_bytes() -> int:
    """Return what this process has sent."""
    from distributed.comm.tcp import TCP

    return TCP.sent


@contextmanager
def dask() -> Iterator[Any]:
    """Yield a function that returns what all processes of a cluster of two workers have sent."""
    from distributed import Client, LocalCluster

    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    count_sent_bytes()
    with (
        LocalCluster(**options, silence_logs=50) as cluster,
        Client(cluster) as client,
        joblib.parallel_config("dask"),
    ):
        client.wait_for_workers(2)
        client.run(count_sent_bytes)
        yield lambda: sent_bytes() + sum(client.run(sent_bytes).values())


@contextmanager
def ray() -> Iterator[None]:
    """Start two workers."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    import ray as package
    from ray.util.joblib import register_ray

    register_ray()
    package.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        with joblib.parallel_config("ray", n_jobs=2):
            yield None
    finally:
        package.shutdown()


CLUSTERS = {
    "1 process": ("joblib", lambda: joblib.parallel_config("sequential")),
    "2 processes": ("joblib", lambda: joblib.parallel_config("loky", n_jobs=2)),
    "Dask, 2 workers": ("distributed", dask),
    "Ray, 2 workers": ("ray", ray),
}


def measured(name: str, folders: dict[str, RecordingFolder], repeats: int) -> dict[str, Any]:
    """Time the searches (the least of some repeats) and empty tasks under a cluster."""
    row: dict[str, Any] = {"": name}
    with CLUSTERS[name][1]() as sent:
        counted = callable(sent)
        joblib.Parallel()(joblib.delayed(nothing)() for _ in range(4))
        for title, folder in folders.items():
            before = sent() if counted else 0
            spent = []
            for _ in range(repeats):
                start = time.perf_counter()
                row[f"scores {title}"] = search(folder)
                spent.append(time.perf_counter() - start)
            row[title] = min(spent)
            if counted:
                n_bytes = sum(path.stat().st_size for path in folder.paths)
                row[f"sent {title} [%]"] = 100 * (sent() - before) / repeats / n_bytes
        start = time.perf_counter()
        joblib.Parallel(batch_size=1)(joblib.delayed(nothing)() for _ in range(N_TASKS))
        row["task [ms]"] = 1000 * (time.perf_counter() - start) / N_TASKS
    return row


def main() -> None:
    """Measure, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="shorter recordings, once")
    json_option(parser)
    options = parser.parse_args()
    lengths = {"1 s": 1.0, "2 s": 2.0} if options.quick else {"3 s": 3.0, "30 s": 30.0}
    with tempfile.TemporaryDirectory() as name:
        folders = {}
        for title, seconds in lengths.items():
            path = Path(name, title)
            path.mkdir()
            folders[title] = write_folder(path, seconds, 8 if options.quick else 16)
        wanted = [name for name, (package, _) in CLUSTERS.items() if find_spec(package)]
        rows = [measured(name, folders, 1 if options.quick else 2) for name in wanted]
    first = rows[0].copy()
    for row in rows:
        for title in lengths:
            assert np.array_equal(row[f"scores {title}"], first[f"scores {title}"])
            del row[f"scores {title}"]
            row[title] = f"{row[title] / first[title]:.2f}"
    print(header())
    print("Time of a search of 24 fits on 2 channels and speed at 12 kHz, 1 process = 1;")
    print("what Dask sent, relative to the files; time of a task that does nothing")
    print(table(rows))
    write_json(options, rows)


if __name__ == "__main__":
    main()
