"""A fleet of machines that are followed while they are measured: speed, latency and memory.

Each machine has 5 channels and the velocity of its shaft at 48 kHz, in blocks of 0.1 s, and one
also in blocks of 1 ms; its
readings are of 320 revolutions, in 50 order bins, decided on by a Gaussian classifier. Speed is the
signal time over the processor time, which is the number of machines that one core follows in real
time. Latency is the time from the last samples of a reading to its decision. Memory is counted by
tracemalloc over 3 s, and is that of a state. Run from the repository, with one thread of
the linear algebra:

    OPENBLAS_NUM_THREADS=1 python benchmarks/monitor.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from sklearn.pipeline import Pipeline, make_pipeline

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
)

FS = 48_000.0
NAMES = ("torque", "current", "axial", "radial", "sound")
BLOCK = 4800
EVERY = 320.0  # revolutions: about 7 s
TOP = 50


def measured(seconds: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return channels and shaft velocity, at 48 rev/s with 15 % ripple."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * FS)) / FS
    velocity = 2 * np.pi * 48 * (1 + 0.15 * np.sin(2 * np.pi * t))
    return (1 + seed % 2) * rng.normal(size=(len(NAMES), len(t))), velocity


def fitted() -> Pipeline:
    """Return a model of two states."""
    X = []
    for seed in range(12):
        rows, velocity = measured(1.0, seed)
        X.append(Recording(dict(zip(NAMES, rows, strict=True)), FS, velocity=velocity))
    classifier = CostSensitiveGaussianBayes(covariance="diag")
    steps = OrderResampler(), OrderPSD(max_order=TOP), BinTransformer(max_order=TOP), classifier
    return make_pipeline(*steps).fit(X, ["new", "worn"] * 6)


def fleet(model: Pipeline, n_machines: int) -> list[OrderMonitor]:
    """Return a monitor for each machine."""
    options = {"fs": FS, "channels": NAMES, "max_speed": 2 * np.pi * 56, "every": EVERY}
    return [OrderMonitor(model, **options) for _ in range(n_machines)]


def row(model: Pipeline, n_machines: int, seconds: float, length: int = BLOCK) -> dict[str, Any]:
    """Follow some machines for a time; one block of each after the other, as they would come."""
    signals, velocity = measured(1.0, 3)
    blocks = [slice(k, k + length) for k in range(0, len(velocity), length)]
    monitors = fleet(model, n_machines)
    pushes, latencies, n_readings = [], [], 0
    begun = time.process_time()
    for k in range(int(seconds * FS / length)):
        part = blocks[k % len(blocks)]
        rows, speed = signals[:, part], velocity[part]
        for monitor in monitors:
            start = time.perf_counter()
            readings = monitor.push(rows, velocity=speed)
            pushes.append(time.perf_counter() - start)
            if readings:
                latencies.append(pushes[-1])
                n_readings += len(readings)
    spent = time.process_time() - begun
    return {
        "machines": n_machines,
        "block [ms]": 1e3 * length / FS,
        "times real time": n_machines * seconds / spent,
        "readings": n_readings,
        "p99 of a block [ms]": 1e3 * float(np.quantile(pushes, 0.99)),
        "p99 of a reading [ms]": 1e3 * float(np.quantile(latencies, 0.99)),
        **memory(model, n_machines),
    }


def memory(model: Pipeline, n_machines: int) -> dict[str, float]:
    """Return the most memory of a machine, in use and as a state [MB]."""
    signals, velocity = measured(1.0, 3)
    fleet(model, 1)  # and whatever is made once
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    monitors = fleet(model, n_machines)
    most, largest = 0, 0
    for k in range(30):
        part = slice(k % 10 * BLOCK, (k % 10 + 1) * BLOCK)
        for monitor in monitors:
            monitor.push(signals[:, part], velocity=velocity[part])
        most = max(most, tracemalloc.get_traced_memory()[0] - before)
        largest = max(largest, len(monitors[0].state()))
    tracemalloc.stop()
    return {"memory per machine [MB]": most / n_machines / 1e6, "state [MB]": largest / 1e6}


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer machines, 8 s each")
    json_option(parser)
    options = parser.parse_args()
    model = fitted()
    full = (1, 60.0), (10, 20.0), (100, 10.0), (1000, 8.0)
    sizes = ((1, 8.0), (2, 8.0)) if options.quick else full
    rows = [row(model, *size) for size in sizes]
    rows.append(row(model, 1, sizes[0][1], length=48))
    print(header())
    print(table(rows))
    write_json(options, rows)


if __name__ == "__main__":
    main()
