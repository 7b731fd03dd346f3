"""Warnings that a stated rate does not hold: how often they come rightly, and how often wrongly.

- Trend of a baseline (`trend_probability`, p < 0.01): autoregressive series, stationary ones, and
  those with a linear drift or a run-in that decays by exp(-4); sizes in standard deviations.
- `HealthIndex(0.05)` on simulated baselines whose successive groups are correlated: alarm rate
  of further healthy recordings, and share of the baselines with a warning. "level": 24 bands with a
  common level. Charts (`CUSUM` 0.5, limit 5): false alarms within 200 healthy readings if
  the baseline is the index of the rows of the fit, and of `left_out_`.
- The same limit from 3 to 18 groups (``few_groups="log-normal"``).
- PRONOSTIA (if --pronostia gives its folder): `HealthIndex(0.05)` of levels of 12 bands and the
  whole of both directions; 20 records 100 s apart are the baseline. Settings were chosen on every
  second bearing (development), the others are the check.
- Prediction sets of units that are shifted from the training (fleets as in new_units.py).
- Gears whose shaft angle has an error once per revolution.

    python benchmarks/stated_limits.py [--quick] [--pronostia FOLDER]
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from measure import header, table
from numpy.typing import NDArray
from remaining_life import SETS
from scipy.signal import lfilter

from emacm import NewUnitClassifier
from emacm.alarms.stationarity import trend_probability
from emacm.monitoring import CUSUM, HealthIndex
from emacm.stroke_features.gears import (
    mesh_envelope,
    phase_modulation,
    residual_signal,
)
from emacm.stroke_features.statistics import normalized_moment

Array = NDArray[np.float64]
EDGES = np.geomspace(100, 12_800, 13)  # Hz, bands of PRONOSTIA at 25.6 kHz
N_BASELINE = 20


def autoregressive(rng: np.random.Generator, shape: tuple[int, int], rho: float) -> Array:
    """Return stationary columns of unit variance, and of this correlation of successive rows."""
    noise = rng.normal(size=(shape[0] + 100, shape[1]))
    return lfilter([np.sqrt(1 - rho**2)], [1, -rho], noise, axis=0)[100:]


def warned(call: Callable[[], Any]) -> tuple[Any, bool]:
    """Return a result, and whether there was a warning."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return call(), bool(caught)


def trends(n_trials: int) -> Iterator[dict[str, Any]]:
    """Yield the share of series with a trend, by shape of the drift."""
    for n in (20, 60, 200):
        for rho in (0.0, 0.3, 0.6, 0.8):
            row: dict[str, Any] = {"readings": n, "correlation": rho}
            times, one = np.linspace(0, 1, n), np.zeros(n, dtype=np.intp)
            drifts = {"none": 0 * times, "linear 2": 2 * times, "linear 4": 4 * times}
            drifts |= {"run-in 4": 4 * np.exp(-4 * times), "run-in 8": 8 * np.exp(-4 * times)}
            series = autoregressive(np.random.default_rng(n), (n, n_trials), rho).T
            for name, drift in drifts.items():
                found = [trend_probability(x + drift, one) < 0.01 for x in series]
                row[name] = f"{np.mean(found):.3f}"
            yield row


def indices(n_trials: int) -> Iterator[dict[str, Any]]:
    """Yield alarm rates of a `HealthIndex` whose groups are correlated."""
    for n, n_features in ((20, 4), (20, 24), (60, 4), (60, 24)):
        for rho in (0.0, 0.2, 0.3, 0.6, 0.8):
            rng, found = np.random.default_rng(n), []
            for _ in range(n_trials):
                X = autoregressive(rng, (n + 200, n_features), rho)
                if n_features == 24:
                    X = 0.5 * X + autoregressive(rng, (n + 200, 1), rho)
                fit = HealthIndex(0.05).fit
                index, stated = warned(lambda X=X[:n], fit=fit, n=n: fit(X, groups=range(n)))
                found.append((np.mean(index.transform(X[n:]) > index.limit()), stated))
            rate, share = np.mean(found, axis=0)
            kind = "level" if n_features == 24 else "independent"
            row = {"groups": n, "features": f"{n_features} {kind}", "correlation": rho}
            yield row | {"alarm rate": f"{rate:.3f}", "warned": f"{share:.2f}"}


def few_groups(n_trials: int) -> Iterator[dict[str, Any]]:
    """Yield alarm rates of a `HealthIndex` of 5 % whose limit is extrapolated from few groups."""
    for n_groups in (3, 5, 8, 12, 18):
        for n_features in (3, 12, 30):
            rng = np.random.default_rng(n_groups)
            draws = {"normal": rng.normal, "t": lambda size, rng=rng: rng.standard_t(4, size)}
            row: dict[str, Any] = {"groups of 3": n_groups, "features": n_features}
            for kind, draw in draws.items():
                for between in (0, 1, 3):
                    found = []
                    for _ in range(n_trials):
                        groups = np.arange(3 * (n_groups + 100)) // 3
                        X = between * draw(size=(n_groups + 100, n_features))[groups]
                        X, n = X + draw(size=X.shape), 3 * n_groups
                        index = HealthIndex(0.05, few_groups="log-normal")
                        warned(lambda i=index, x=X[:n], g=groups[:n]: i.fit(x, groups=g))
                        found.append(np.mean(index.transform(X[n:])[:, 0] > index.limit()))
                    row[f"{kind}, groups differ by {between}"] = f"{np.mean(found):.3f}"
            yield row


def charts(n_trials: int) -> Iterator[dict[str, Any]]:
    """Yield the share of charts with a false alarm within 200 readings, by their baseline."""
    for n, n_features in ((20, 4), (20, 24), (60, 4), (60, 24)):
        rng, found = np.random.default_rng(n), []
        for _ in range(n_trials):
            X = rng.normal(size=(n + 200, n_features))
            index, _ = warned(lambda X=X[:n], n=n: HealthIndex(0.05).fit(X, groups=range(n)))
            known, _ = warned(lambda index=index, X=X[:n]: index.transform(X))
            left, new = index.left_out_[["index"]].to_numpy(), index.transform(X[n:])
            alarms = []
            for baseline in (known, left):
                chart, _ = warned(lambda x=baseline: CUSUM(0.5, limit=5).fit(x))
                alarms.append(chart.update(new).alarm.any())
            found.append(alarms)
        rows, left_out = np.mean(found, axis=0)
        row = {"rows": n, "features": n_features}
        yield row | {"rows of fit": f"{rows:.2f}", "left_out_": f"{left_out:.2f}"}


def band_levels(file: Path) -> list[float]:
    """Return levels of bands and of both directions of a record [dB]."""
    lines = file.read_bytes().replace(b";", b",").split()
    signals = np.array([line.split(b",")[4:6] for line in lines], dtype=np.float64).T
    levels = []
    for signal in signals - signals.mean(axis=1, keepdims=True):
        power = np.abs(np.fft.rfft(signal * np.hanning(len(signal)))) ** 2
        frequencies = np.fft.rfftfreq(len(signal), 1 / 25_600)
        bands = np.histogram(frequencies, EDGES, weights=power)[0]
        levels += [*10 * np.log10(bands), 20 * np.log10(signal.std())]
    return levels


def run_in(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield alarm rate and warning of each bearing with at least 60 records, 100 s apart."""
    paths = sorted(p for name in SETS for p in (folder / name).glob("Bearing*"))
    for k, path in enumerate(sorted(paths, key=lambda path: path.name)):
        X = np.array([band_levels(file) for file in sorted(path.glob("acc_*.csv"))[::10]])
        if len(X) < 60:
            continue
        first = X[:N_BASELINE]
        index, stated = warned(lambda X=first: HealthIndex(0.05).fit(X, groups=range(len(X))))
        rate = np.mean(index.transform(X[N_BASELINE : len(X) // 2]) > index.limit())
        part = "check" if k % 2 else "development"
        yield {"part": part, "bearing": path.name, "alarm rate": rate, "warned": stated}


def shifted_units(n_fleets: int) -> Iterator[dict[str, Any]]:
    """Yield coverage of sets of 90 %, and share of calls with a warning, by shift and units."""
    states, found = np.array(["healthy", "screw", "inner ring"]), []
    for seed in range(n_fleets):
        rng = np.random.default_rng(seed)
        within, between = (a @ a.T / 16 for a in rng.normal(size=(2, 8, 16)))
        between *= 16
        centres = np.array([np.zeros(8), *2.5 * rng.normal(size=(2, 8))])

        def draw(codes, units, w=within, b=between, centres=centres, rng=rng):
            offsets = rng.multivariate_normal(np.zeros(8), b, units.max() + 1)[units]
            return centres[codes] + offsets + rng.multivariate_normal(np.zeros(8), w, len(units))

        units = np.repeat(np.arange(50), 5)
        model = NewUnitClassifier(priors="uniform")
        model.fit(draw(units % 3, units), states[units % 3], groups=units)
        scale = np.sqrt(np.diag(within + between))
        for shift in (0.0, 0.5, 1.0):
            for n_units in (1, 3, 10, 40):
                for _ in range(10):
                    units = np.repeat(np.arange(n_units), 5)
                    codes = rng.integers(3, size=n_units)[units]
                    way = rng.normal(size=8)
                    X = draw(codes, units) + shift * scale * way / np.sqrt(np.mean(way**2))
                    sets, stated = warned(
                        lambda X=X, u=units, m=model: m.prediction_sets(X, groups=u)
                    )
                    places = np.searchsorted(model.classes_, states[codes])
                    covered = sets[np.arange(len(X)), places].mean()
                    found.append((shift, n_units, covered, stated))
    columns = ["shift", "units", "coverage", "warned"]
    means = pd.DataFrame(found, columns=columns).groupby(columns[:2]).mean()
    yield from means.round(3).reset_index().to_dict("records")


def modulated_gears(n_trials: int) -> Iterator[dict[str, Any]]:
    """Yield indicators of gears by the phase modulation that an error of the angle causes."""
    for teeth in (13, 40):
        rng = np.random.default_rng(teeth)
        angle = 2 * np.pi * np.arange(16 * teeth) / (16 * teeth)
        plain = 0.0
        for beta in (0.0, 0.02, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2):
            row: dict[str, Any] = {"teeth": teeth, "beta": beta}
            for missing in (0.0, 0.05, 0.1, 0.8):
                found = []
                for phase in rng.uniform(0, 2 * np.pi, n_trials):
                    wrong = angle + beta / teeth * np.sin(angle + phase)
                    place = np.mod(wrong, 2 * np.pi) * teeth / (2 * np.pi)
                    mesh = np.cos(teeth * wrong) * (1 - missing * ((place >= 4) & (place < 5)))
                    mesh += 0.3 * np.cos(2 * teeth * wrong + 1)
                    average = mesh + 0.1 * np.cos(3 * teeth * wrong + 2)
                    average += 0.005 * rng.normal(size=len(angle))
                    difference = residual_signal(average, teeth, sidebands=1)
                    envelope = mesh_envelope(average, teeth)
                    na4 = np.mean(residual_signal(average, teeth) ** 4)
                    nb4 = np.mean((envelope - envelope.mean()) ** 4)
                    values = phase_modulation(average, teeth), normalized_moment(difference, 4)
                    found.append((*values, na4, nb4))
                estimate, fm4, na4, nb4 = np.mean(found, axis=0)
                if not missing:
                    plain, sound = plain or na4, nb4
                    row |= {"estimate": f"{estimate:.3f}", "NA4, times": f"{na4 / plain:.3g}"}
                row[f"FM4, {missing:.0%} missing"] = f"{fm4:.1f}"
                if missing == 0.05:
                    row["NB4, 5%, times"] = f"{nb4 / sound:.2g}"
            yield row


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few trials, to see that it runs")
    parser.add_argument("--pronostia", type=Path)
    options = parser.parse_args()
    print(header())
    parts = [
        ("Share of series in which a trend is found", trends, 1000),
        ("HealthIndex, limit of 5 %", indices, 100),
        ("HealthIndex, alarm rate at a limit of 5 % from few groups", few_groups, 60),
        ("Charts on a health index", charts, 100),
        ("Units shifted from the training", shifted_units, 16),
        ("Gears with an error of the angle", modulated_gears, 10),
    ]
    for title, rows, n_trials in parts:
        print(f"\n{title}\n{table([*rows(1 if options.quick else n_trials)])}", flush=True)
    if options.pronostia is None or not options.pronostia.is_dir():
        print("\nPRONOSTIA: skipped; give the folder of the data by --pronostia.")
        return
    found = pd.DataFrame(run_in(options.pronostia))
    print(f"\nPRONOSTIA, first half of the life\n{found.round(2).to_string(index=False)}")
    print(found.groupby("part").agg({"alarm rate": "median", "warned": "sum", "bearing": "size"}))


if __name__ == "__main__":
    main()
