"""What a search costs, and how often it estimates the same spectrum.

A plain `GridSearchCV` over the angle between samples, the length of a segment and the width of a
bin, against the least that it can cost, which is a loop by hand: the spectra alone, each once, and
the same grid with the spectra given. Then with `OrderPSD(memory=folder)`, also of recordings that
the process has not seen, and with ``memory=False``, of which a small part of the grid is timed and
scaled. Run from the repository:

    python benchmarks/search.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
)
from emacm.orders.segment_plan import SegmentPlan

FS = 48_000.0
TOP = 20.0  # highest order of a bin
FOLDS = KFold(5, shuffle=True, random_state=0)
GRID = {
    "orderresampler__theta_s": [2 * np.pi / n for n in (64, 80, 100, 128, 160)],
    "orderpsd__revolutions": [4, 6, 8, 12, 16],
    "bintransformer__bin_size": [0.5, 1.0, 2.0, 4.0, 5.0],
}
QUICK = {name: values[:2] for name, values in GRID.items()}


def recordings(n_recordings: int, n_times: int) -> tuple[list[Recording], NDArray[np.str_]]:
    """Make runs of 2 healthy and worn drives, 5 channels; a worn one has a line at order 5.4."""
    y = np.array(["healthy", "worn"] * (n_recordings // 2))
    X = []
    for seed, condition in enumerate(y):
        rng = np.random.default_rng(seed)
        times = np.arange(n_times) / FS
        velocity = 2 * np.pi * 48 * (1 + 0.15 * np.sin(2 * np.pi * times + rng.uniform(0, 6)))
        angle = np.cumsum(velocity) / FS
        line = 0.1 * (condition == "worn") * np.sin(5.4 * angle)
        noise = rng.standard_normal((5, n_times))
        channels = dict(zip("abcxy", noise + np.sin(6 * angle) + line, strict=True))
        X.append(Recording(channels, FS, velocity=velocity, meta={"run": seed}))
    return X, y


def classifier() -> list[Any]:
    """Make the steps that follow the bins."""
    return [
        FunctionTransformer(np.log10),
        StandardScaler(),
        PCA(5),
        CostSensitiveGaussianBayes({("healthy", "worn"): 10.0}, shrinkage="oas"),
    ]


def pipeline(**options: Any) -> Pipeline:
    """Make the whole pipeline; options are those of OrderPSD."""
    return make_pipeline(
        OrderResampler(), OrderPSD(**options), BinTransformer(max_order=TOP), *classifier()
    )


def searched(steps: Pipeline, grid: dict[str, Any], X: Any, y: Any, **options: Any) -> Any:
    """Run the search."""
    return GridSearchCV(steps, grid, cv=FOLDS, error_score="raise", **options).fit(X, y)


@contextmanager
def counted() -> Iterator[list[int]]:
    """Count the calls of the method that resamples a recording and estimates its spectra."""
    original, calls = SegmentPlan.spectra_of, []

    def counting(*args: Any, **kwargs: Any) -> Any:
        calls.append(1)
        return original(*args, **kwargs)

    SegmentPlan.spectra_of = counting
    try:
        yield calls
    finally:
        SegmentPlan.spectra_of = original


def timed(run: Callable[[], Any]) -> dict[str, Any]:
    """Return seconds, those of the processor, number of spectra and result of a run."""
    with counted() as calls:
        start, worked = time.perf_counter(), time.process_time()
        result = run()
        seconds, cpu = time.perf_counter() - start, time.process_time() - worked
    return {"s": seconds, "cpu s": cpu, "spectra": len(calls), "result": result}


def every_spectrum(X: list[Recording], grid: dict[str, Any]) -> dict[tuple[float, float], Any]:
    """Estimate each spectrum once, and nothing else."""
    tables = {}
    for theta_s in grid["orderresampler__theta_s"]:
        over_angle = OrderResampler(theta_s).fit_transform(X)
        for revolutions in grid["orderpsd__revolutions"]:
            spectra = OrderPSD(revolutions, memory=False).fit_transform(over_angle)
            tables[theta_s, revolutions] = spectra
    return tables


def given_spectra(tables: dict[tuple[float, float], Any], grid: dict[str, Any], y: Any) -> float:
    """Search the same grid with the spectra given; return the best score."""
    sizes = {"bintransformer__bin_size": grid["bintransformer__bin_size"]}
    steps = make_pipeline(BinTransformer(max_order=TOP), *classifier())
    return max(searched(steps, sizes, spectra, y).best_score_ for spectra in tables.values())


def part_of(grid: dict[str, Any]) -> dict[str, Any]:
    """Keep one setting of the spectra, and all bins."""
    return {
        name: values if name.startswith("bin") else values[2:3] or values[:1]
        for name, values in grid.items()
    }


def measured(X: list[Recording], y: Any, grid: dict[str, Any]) -> list[dict[str, Any]]:
    """Run all variants; seconds of those that would take too long are scaled from a part."""
    small = part_of(grid)
    scale = len(grid["orderresampler__theta_s"]) * len(grid["orderpsd__revolutions"])
    rows = []

    def add(variant: str, run: Callable[[], Any], times: int = 1) -> Any:
        row = timed(run)
        result = row.pop("result")
        rows.append({"variant": variant, "scaled": times} | {k: v * times for k, v in row.items()})
        return result

    searched(pipeline(), small, X[:10], y[:10])  # warms up
    tables = add("each spectrum once, no search", lambda: every_spectrum(X, grid))
    best = add("search, spectra given", lambda: given_spectra(tables, grid, y))
    found = add("search", lambda: searched(pipeline(), grid, X, y))
    assert found.best_score_ == best
    add("the same again", lambda: searched(pipeline(), grid, X, y))
    with tempfile.TemporaryDirectory() as folder:
        for variant in ("search, OrderPSD(memory=folder)", "the same in another process"):
            copies = pickle.loads(pickle.dumps(X))  # whose spectra are not in memory
            kept_by = pipeline(memory=folder)
            add(variant, partial(searched, kept_by, grid, copies, y))
        kept = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
        rows[-1]["MB kept"] = kept / 1e6
    unkept = pipeline(memory=False)
    add("search, memory=False", lambda: searched(unkept, small, X, y, refit=False), scale)
    return rows


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a small grid, short recordings")
    json_option(parser)
    options = parser.parse_args()
    grid = QUICK if options.quick else GRID
    X, y = recordings(10, 12_000) if options.quick else recordings(40, 96_000)
    rows = measured(X, y, grid)
    least = rows[0]["cpu s"] + rows[1]["cpu s"]  # the spectra, and the grid without them
    for row in rows:
        row["of least"] = row["cpu s"] / least  # on a busy machine, steadier than the seconds
    print(header())
    candidates = " x ".join(str(len(values)) for values in grid.values())
    print(
        f"{len(X)} recordings of {len(X[0].channels)} channels, {len(X[0].velocity)} samples; "
        f"{candidates} candidates x {FOLDS.n_splits} folds; scaled: times what was timed"
    )
    print(table(rows))
    write_json(options, rows)


if __name__ == "__main__":
    main()
