"""Many recordings: what threads gain, and how much memory a pass takes.

The recordings are those of `pipeline.py`: 5 channels of 10 s at 48 kHz. Threads share the work of
16 of them. Memory is what is in use at the peak beyond what was before, counted by tracemalloc, for
24 of them, in recordings; the feature table is left out. Run from the repository, with one thread
of the linear algebra:

    OPENBLAS_NUM_THREADS=1 python benchmarks/many.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import os
import tracemalloc
from typing import Any

import numpy as np
from measure import header, json_option, medians, table, write_json
from pipeline import LINEAR, SEGMENT, TOP, made
from sklearn.pipeline import Pipeline, make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm._kernels import NAMES, using

SETTINGS: dict[str, tuple[int, dict[str, Any]]] = {"default": (128, {}), "linear": (1000, LINEAR)}


def steps(setting: str) -> Pipeline:
    """Return the three transformers."""
    nrev, options = SETTINGS[setting]
    return make_pipeline(
        OrderResampler(2 * np.pi / nrev, **options),
        OrderPSD(SEGMENT, max_order=TOP, memory=False),
        BinTransformer(max_order=TOP),
    )


def peak(pipeline: Pipeline, recordings: list[Recording]) -> float:
    """Most memory that a pass takes, in recordings."""
    first = recordings[0]
    size = sum(row.nbytes for row in first.signals.values()) + first.velocity.nbytes
    features = pipeline.transform(recordings)  # and whatever is made once
    tracemalloc.start()
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    pipeline.transform(recordings)
    used = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    return (used - features.nbytes) / size


def main() -> None:
    """Measure, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short recordings, one repeat")
    json_option(parser)
    options = parser.parse_args()
    seconds, repeats = (1.0, 1) if options.quick else (10.0, 7)
    cores = [n for n in (1, 2, 4, 8) if n <= (os.cpu_count() or 1)]

    # Content of their own, as recordings in memory have it.
    recordings = [made(seconds, "noise")[0].recording() for _ in range(16)]
    print(header())
    rows = []
    for kernels in NAMES:
        for setting in SETTINGS:
            pipelines = {n: steps(setting).set_params(orderpsd__n_jobs=n) for n in cores}
            with using(kernels):
                for pipeline in pipelines.values():
                    pipeline.fit(recordings)
                runs = {n: (lambda p=p: p.transform(recordings)) for n, p in pipelines.items()}
                spent = medians(runs, repeats)
                memory = peak(pipelines[1], (recordings * 2)[:24])
            row: dict[str, Any] = {"setting": setting, "kernels": kernels}
            row["ms per recording"] = 1e3 * spent[1] / len(recordings)
            row |= {f"{n} threads": spent[1] / spent[n] for n in cores[1:]}
            rows.append(row | {"memory of 24 [recordings]": memory})
    print(f"16 recordings of {seconds:g} s, medians of {repeats}; threads: speed relative to one")
    print(table(rows))
    write_json(options, rows)


if __name__ == "__main__":
    main()
