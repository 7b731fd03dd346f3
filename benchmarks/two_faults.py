"""Two faults at once, decided by a classifier of single faults.

Simulated actuators with damage of the inner ring and of the screw, of severities that are drawn
independently. The model of the page on the method is trained on ten units of each
single state. Tested are units that were not in training: 60 recordings with at most one fault,
and 30 with two. "unknown" counts decisions, "stated" the recordings whose decision is a state,
with a sentence about lines of a second one in the table of `score`; "silent" are all others.
Settings were chosen by the fleets of seeds 0 to 7; the others are the check.

    python benchmarks/two_faults.py [--quick]
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np
from laboratory import LaboratoryBench, simulate_fleet
from measure import header, table
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from threadpoolctl import threadpool_limits

import emacm
from emacm.recordings.recording import Recording

FS = 4000.0  # of `simulate_fleet`
SEVERITIES = (0.3, 0.7), (0.05, 0.4)


def recipe() -> Any:
    """Return the model of that page, without costs and priors."""
    options: dict[str, Any] = {"unknown": "unknown", "unknown_rate": 0.02, "temperature": "groups"}
    return make_pipeline(
        emacm.OrderResampler(2 * np.pi / 64, channels=["current_a", "accelerometer"], min_speed=1),
        emacm.OrderPSD(revolutions=8),
        emacm.BinTransformer(max_order=24, stop_bands=((0, 2.5), (5.5, 6.5), (11.5, 12.5))),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
        StandardScaler(),
        emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **options),
    )


def with_two_faults(n_units: int, severity: tuple[float, float], seed: int) -> list[Recording]:
    """Simulate units with both faults, one recording of each."""
    found = []
    for unit in range(n_units):
        sizes = np.random.default_rng([seed, unit]).uniform(*severity, 2)
        faults = dict(zip(("inner ring", "screw"), sizes, strict=True))
        options = {"duration": 6.0, "fs": FS, "cutoff": 0.375 * FS}
        bench = LaboratoryBench(unit=9_000_000 + unit, seed=seed, faults=faults, **options)
        found.append(bench.record(4))
    return found


def outcomes(severity: tuple[float, float], seed: int, n_units: int) -> list[np.ndarray]:
    """Return the shares unknown, stated and silent, of one fault and of two."""
    runs, states, units = simulate_fleet(n_units, 4, severity=severity, seed=seed)
    model = recipe().fit(runs, states, costsensitivegaussianbayes__groups=units)
    single = simulate_fleet(n_units, 2, severity=severity, seed=seed, first_unit=500)[0]
    found = []
    for recordings in (single, with_two_faults(3 * n_units, severity, seed)):
        features = model[:-1].transform(recordings)
        decisions = model[-1].predict(features)
        second = model[-1].second_states(features, decisions)
        unknown = decisions == "unknown"
        stated = np.array([state is not None for state in second]) & ~unknown
        found.append(np.array([unknown.mean(), stated.mean(), (~unknown & ~stated).mean()]))
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one fleet of three units")
    quick = parser.parse_args().quick
    print(header())
    parts = {"quick": range(1)} if quick else {"chosen": range(8), "check": range(8, 16)}
    n_units, severities = (3, SEVERITIES[:1]) if quick else (10, SEVERITIES)
    rows = []
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for severity in severities:
            for part, seeds in parts.items():
                found = [outcomes(severity, seed, n_units) for seed in seeds]
                for faults, shares in zip(("one", "two"), np.mean(found, axis=0), strict=True):
                    row = {"severity": "{} to {}".format(*severity), "seeds": part}
                    names = "unknown", "stated", "silent"
                    values = {n: f"{s:.3f}" for n, s in zip(names, shares, strict=True)}
                    rows.append(row | {"faults": faults} | values)
    print(table(rows))


if __name__ == "__main__":
    main()
