"""New units: coverage and size of prediction sets of units that were not in training.

`NewUnitClassifier` beside `CostSensitiveGaussianBayes` with a tied covariance, which knows no
difference between units. Sets of both contain the classes above a threshold from training units
that were left out, for a coverage of 90 %.

Fleets: Gaussian units with random covariances between and within units (50 units, 5 recordings
each), each unit in one state, or every unit in all states; simulated actuators on the bench
(51 units of three states, 4 recordings each). Real recordings, Cranfield: one actuator. Seven runs
are the groups, one is left out at a time, and six runs support sets of 80 % only: it shows
differences between runs, not units.

    python benchmarks/new_units.py [--data FILE] [--quick]
"""

from __future__ import annotations

import argparse
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from laboratory import simulate_actuator, simulate_fleet
from measure import header, table
from numpy.typing import NDArray
from sklearn.model_selection import GroupKFold
from threadpoolctl import threadpool_limits
from unknown import cranfield, features

from emacm import CostSensitiveGaussianBayes, NewUnitClassifier
from emacm.decisions.new_units import classes_above, probability_threshold

Array = NDArray[np.float64]
STATES = np.array(["healthy", "screw", "inner ring"])
SEVERITIES = (0.02, 0.1), (0.05, 0.2)  # of incipient faults; larger ones are recognised anyway


class Trial(NamedTuple):
    """Training recordings, and test recordings of other units."""

    X: Array
    y: NDArray[Any]
    units: NDArray[Any]
    later: Array
    truth: NDArray[Any]


def gaussian_fleets(n_fleets: int, *, crossed: bool) -> Iterator[Trial]:
    """Draw fleets of 50 units with eight features; a fault changes some of them."""
    for seed in range(n_fleets):
        rng = np.random.default_rng(seed)
        within, between = (a @ a.T / 16 for a in rng.normal(size=(2, 8, 16)))
        centres = np.array([np.zeros(8), 2.5 * rng.normal(size=8), 2.5 * rng.normal(size=8)])
        scales = np.linalg.cholesky(within), np.linalg.cholesky(16 * between)

        def draw(codes, offsets, centres=centres, scale=scales[0], rng=rng):
            return centres[codes] + offsets + rng.normal(size=offsets.shape) @ scale.T

        units = np.repeat(np.arange(50), 5)
        codes = np.tile([0, 1, 2, 0, 1], 50) if crossed else units % 3
        X = draw(codes, (rng.normal(size=(50, 8)) @ scales[1].T)[units])
        truth = np.arange(120) % 3
        offsets = rng.normal(size=(120, 8)) @ scales[1].T
        yield Trial(X, STATES[codes], units, draw(truth, offsets), STATES[truth])


def bench_fleets(
    n_fleets: int, n_units: int, n_test: int, severity: tuple[float, float]
) -> Iterator[Trial]:
    """Simulate actuators with faults of some severity; features are levels of order bins."""
    pipeline = features()
    for seed in range(n_fleets):
        recordings, y, units = simulate_fleet(n_units, 4, severity=severity, seed=seed)
        X = np.asarray(pipeline.fit_transform(recordings))
        truth, later = STATES[np.arange(n_test) % 3], []
        for unit, state in enumerate(truth, start=5000):
            size = np.random.default_rng([seed, unit]).uniform(*severity)
            later.append(simulate_actuator(state, severity=size, unit=unit, run=11, seed=seed))
        yield Trial(X, y, units, np.asarray(pipeline.transform(later)), truth)


def cranfield_runs(file: Path, *, quick: bool) -> Iterator[Trial]:
    """Leave out one run at a time."""
    data = cranfield(file, phase=False, quick=quick)
    for load in np.unique(data.load):
        here = data.take(data.load == load)
        for run in np.unique(here.run):
            train, test = here.take(here.run != run), here.take(here.run == run)
            yield Trial(train.X, train.family, train.run, test.X, test.family)


def plain_sets(trial: Trial, coverage: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return posteriors and sets of the classifier without a model of units."""
    model = CostSensitiveGaussianBayes(priors="uniform", covariance="tied", shrinkage="auto")
    classes, codes = np.unique(trial.y, return_inverse=True)
    units = np.unique(trial.units, return_inverse=True)[1]
    logs = np.empty((len(codes), len(classes)))
    for train, test in GroupKFold(min(10, units.max() + 1)).split(trial.X, groups=units):
        logs[test] = model.fit(trial.X[train], codes[train]).predict_log_proba(trial.X[test])
    priors = np.full(len(classes), 1 / len(classes))
    threshold = probability_threshold(logs, codes, units, priors, 1.0, coverage)
    posterior = model.fit(trial.X, codes).predict_proba(trial.later)
    return posterior, classes_above(posterior, threshold)


def new_unit_sets(trial: Trial, coverage: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return posteriors and sets of the classifier with a model of units."""
    model = NewUnitClassifier(priors="uniform").fit(trial.X, trial.y, groups=trial.units)
    return model.predict_proba(trial.later), model.prediction_sets(trial.later, coverage)


METHODS = {"no unit model": plain_sets, "NewUnitClassifier": new_unit_sets}


def rows(name: str, trials: Iterator[Trial], coverage: float = 0.9) -> list[dict[str, Any]]:
    """Return means over trials, one row for each method."""
    found: dict[str, list[Any]] = {method: [] for method in METHODS}
    for trial in trials:
        place = np.searchsorted(np.unique(trial.y), trial.truth)[:, np.newaxis]
        for method, function in METHODS.items():
            posterior, sets = function(trial, coverage)
            correct = posterior.argmax(axis=1) == place[:, 0]
            covered = np.take_along_axis(sets, place, 1)
            found[method].append((covered.mean(), sets.sum(axis=1).mean(), correct.mean()))
    table_rows = []
    for method, values in found.items():
        row: dict[str, Any] = {"fleet": name, "method": method, "sets": f"{100 * coverage:g} %"}
        means = dict(zip(("cover", "size", "accuracy"), np.mean(values, axis=0), strict=True))
        row |= {figure: f"{mean:.3f}" for figure, mean in means.items()}
        table_rows.append(row)
    return table_rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="file; default: the one below EMACM_DATA")
    parser.add_argument("--quick", action="store_true", help="one small fleet each, one load")
    options = parser.parse_args()
    print(header())
    folder = os.environ.get("EMACM_DATA")
    files = sorted(Path(folder).glob("cranfield_ema/cranfield*.npz")) if folder else []
    file = options.data or (files[0] if files else None)
    small, full = (1, (1, 3, 3), SEVERITIES[:1]), (40, (1, 17, 48), SEVERITIES)
    n_fleets, sizes, severities = small if options.quick else full
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # sequences that are in the file twice
        found = rows("Gaussian, one state each", gaussian_fleets(n_fleets, crossed=False))
        found += rows("Gaussian, all states", gaussian_fleets(n_fleets, crossed=True))
        for severity in severities:
            name = f"bench, severity {severity[0]} to {severity[1]}"
            found += rows(name, bench_fleets(*sizes, severity))
        if file:
            runs = cranfield_runs(file, quick=options.quick)
            found += rows("Cranfield, runs of one unit", runs, 0.5 if options.quick else 0.8)
    print(table(found))
    if not file:
        print("no recordings of the Cranfield actuator: give --data, or set EMACM_DATA")


if __name__ == "__main__":
    main()
