"""A fleet of 1,000 machines, one recording per hour, for a month: time, history, alarms.

A few actuators of the bench are really simulated, healthy and with defects of eight sizes; their
features are logarithmic levels of order bins of current and vibration, less those of the same unit
when it was healthy. 720,000 such recordings would take a day to simulate. Instead, features are
drawn from the normal distribution of the healthy ones (runs of a unit), plus the mean change of one
of the simulated units at the present size of the defect. What follows is real: the classifier,
records, alarms as states, and the history in SQLite. As on a real machine, the levels that features
are relative to are known from its first day only (24 recordings).

False alarms are counted on 200 healthy machine-years: 20 models of 10 machines each, for each
setting. "upper": 99.5 % quantile of the binomial distribution at the setting, which is the limit of
what is accepted; "stated": mean over the models of the rate that they state; "in the stated
interval": models whose count is possible (95 %) for a rate in the interval that they state.
"correlation": of successive readings, which the statement takes as independent.

In the month, a tenth of the machines get a defect (onset and growth as `WearLaw()`). It is detected
if the alarm is raised between onset and failure; the delay is counted from the onset. Defects of
the training are those of every other simulated unit, defects of the month those of the rest. What
is not in the figures: the machines run at one load and speed, their healthy features do not drift,
and are normal in training and month.

    OPENBLAS_NUM_THREADS=1 python benchmarks/fleet.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from laboratory import simulate_actuator
from measure import header, table, write_json
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import BinTransformer, CostSensitiveGaussianBayes, OrderPSD, OrderResampler
from emacm.history.alarm_states import AlarmSetting, AlarmStates, alarm_setting, reasons_of
from emacm.history.records import record_of, utc
from emacm.history.sqlite_history import History
from emacm.simulation.fleet import UnitLife, WearLaw

Array = NDArray[np.float64]
FAULTS = ("screw", "inner ring")
SIZES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
FIRST_DAY = 24  # recordings
START = pd.Timestamp("2026-03-01")


class Features(NamedTuple):
    """Distribution of features: Cholesky-like root of healthy runs, and changes by a defect.

    `changes` has for each fault an array of shape (n_units, n_sizes, n_features), from size 0.
    """

    root: Array
    sizes: Array
    changes: dict[str, Array]
    seconds: float  # processor time of one recording, from signals to features

    def change(self, fault: str, sizes: Any, unit: int) -> Array:
        """Return the change of the features of a simulated unit at some sizes of a defect."""
        curves = self.changes[fault][unit % len(self.changes[fault])]
        return np.column_stack([np.interp(sizes, self.sizes, curve) for curve in curves.T])

    def healthy(self, rng: Any, n_units: int, n_runs: int, correlation: float = 0.0) -> Array:
        """Draw features of healthy units, of shape (n_units, n_runs, n_features)."""
        noise = rng.normal(size=(n_units, FIRST_DAY + n_runs, len(self.root)))
        noise[:, 1:] *= np.sqrt(1 - correlation**2)
        X = lfilter([1], [1, -correlation], noise, axis=1) @ self.root.T
        return X[:, FIRST_DAY:] - X[:, :FIRST_DAY].mean(axis=1, keepdims=True)


def simulated(n_units: int, n_runs: int, sizes: tuple[float, ...]) -> Features:
    """Simulate actuators, and return the distribution of their features."""
    resampler = OrderResampler(2 * np.pi / 64, channels=["current_a", "accelerometer"])
    levels = FunctionTransformer(np.log10, feature_names_out="one-to-one")
    pipeline = make_pipeline(resampler, OrderPSD(8), BinTransformer(2, max_order=24), levels)
    states = [("healthy", 0.0), *((fault, size) for fault in FAULTS for size in sizes)]
    recordings = [
        simulate_actuator(state, severity=size, unit=unit, run=run)
        for state, size in states
        for unit in range(n_units)
        for run in range(1, n_runs + 1)
    ]
    begun = time.process_time()
    X = np.asarray(pipeline.fit_transform(recordings))
    seconds = (time.process_time() - begun) / len(recordings)
    X = X.reshape(len(states), n_units, n_runs, -1)
    runs = (X[0] - X[0].mean(axis=1, keepdims=True)).reshape(n_units * n_runs, -1)
    values, vectors = np.linalg.eigh(runs.T @ runs / (n_units * (n_runs - 1)))
    means = X.mean(axis=2) - X[0].mean(axis=1)
    changes = {
        fault: means[[0, *range(1 + k * len(sizes), 1 + (k + 1) * len(sizes))]].swapaxes(0, 1)
        for k, fault in enumerate(FAULTS)
    }
    root = vectors * np.sqrt(np.maximum(values, 0))
    return Features(root, np.array([0.0, *sizes]), changes, seconds)


def fitted(features: Features, n_healthy: int, seed: int) -> CostSensitiveGaussianBayes:
    """Return a model of healthy units, and half as many of each fault, three recordings each."""
    rng = np.random.default_rng([seed, 0])
    X, y = [features.healthy(rng, n_healthy, 3)], ["healthy"] * n_healthy
    for fault in FAULTS:
        for unit in range(n_healthy // 2):
            change = features.change(fault, [rng.uniform(0.3, 0.7)], 2 * unit)
            X.append(features.healthy(rng, 1, 3) + change)
            y.append(fault)
    options: dict[str, Any] = {"unknown": "unknown", "unknown_rate": 0.02, "temperature": "groups"}
    model = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto", **options)
    groups = np.repeat(np.arange(len(y)), 3)
    return model.fit(np.concatenate(X).reshape(3 * len(y), -1), np.repeat(y, 3), groups=groups)


def n_raised(is_reason: NDArray[np.bool_], setting: AlarmSetting) -> int:
    """Return how often the alarm of one machine is raised."""
    alarms, reason = AlarmStates("", setting.rule), {("", "decision"): ""}
    changes = (alarms.update(reason if found else {}, "") for found in is_reason.tolist())
    return sum(change["state"] == "raised" for found in changes for change in found)


def healthy_years(
    features: Features,
    accepted: tuple[float, ...],
    n_models: int,
    n_machines: int,
    n_hours: int,
    n_healthy: int,
    correlation: float = 0.0,
) -> Iterator[dict[str, Any]]:
    """Yield the false alarms in 1,000 h for each number of them that is accepted."""
    counts, stated, within = np.zeros((3, len(accepted), n_models))
    for seed in range(n_models):
        model = fitted(features, n_healthy, seed)
        X = features.healthy(np.random.default_rng([seed, 1]), n_machines, n_hours, correlation)
        rows = X.reshape(n_machines * n_hours, -1)
        other, typicality = model.predict(rows) != "healthy", model.typicality(rows)
        for k, rate in enumerate(accepted):
            setting = alarm_setting(model, "healthy", rate / 1000)
            is_reason = (other | (typicality <= setting.typicality)).reshape(n_machines, n_hours)
            counts[k, seed] = sum(n_raised(machine, setting) for machine in is_reason)
            assert setting.rate is not None
            stated[k, seed] = 1000 * setting.rate.expected
            low, high = setting.rate.low, setting.rate.high
            ends = binom.ppf([0.025, 0.975], n_machines * n_hours, [low, high])
            within[k, seed] = ends[0] <= counts[k, seed] <= ends[1]
    hours = n_models * n_machines * n_hours
    for k, rate in enumerate(accepted):
        yield {
            "healthy units": n_healthy,
            "correlation": correlation,
            "accepted": rate,
            "stated": float(stated[k].mean()),
            "found": counts[k].sum() / hours * 1000,
            "upper": binom.ppf(0.995, hours, rate / 1000) / hours * 1000,
            "worst model": counts[k].max() * n_models / hours * 1000,
            "in the stated interval": f"{int(within[k].sum())}/{n_models}",
        }


class Machine(NamedTuple):
    """A machine of the month: its name, its fault, its life, and the features of its readings."""

    name: str
    fault: str | None
    life: UnitLife | None
    X: Array


def machines(features: Features, n_machines: int, n_hours: int) -> Iterator[Machine]:
    """Yield the machines; every tenth has a defect some time, and its readings end with it."""
    for number in range(n_machines):
        rng = np.random.default_rng([number, 2])
        X = features.healthy(rng, 1, n_hours)[0]
        name, fault, life = f"machine {number:04}", None, None
        if number % 10 == 0:
            fault = FAULTS[number // 10 % len(FAULTS)]
            life = WearLaw().draw(number, 1.0, observed=n_hours)
            X = X[: len(life.ages)] + features.change(fault, life.severity, number // 5 + 1)
        yield Machine(name, fault, life, X)


def records_of(model: Any, setting: AlarmSetting, machine: Machine) -> list[dict[str, Any]]:
    """Return the records of a machine, with the changes of its alarm."""
    X, alarms = machine.X, AlarmStates(machine.name, setting.rule)
    typicality = model.typicality(X)
    posterior = model.predict_proba(X)
    found = {"decision": model.predict(X).tolist(), "typicality": typicality.tolist()}
    found["expected_cost"] = model.risk(X).min(axis=1).tolist()
    found |= {
        f"P({state})": posterior[:, k].tolist() for k, state in enumerate(model.classes_.tolist())
    }
    records = []
    for hour, values in enumerate(zip(*found.values(), strict=True)):
        start = START + pd.Timedelta(hours=hour)
        row = dict(zip(found, values, strict=True)) | {"recording": f"{machine.name}/{hour}.npz"}
        times = {"start": start, "end": start + pd.Timedelta(seconds=10), "times": "file"}
        record = record_of(row, unit=machine.name, model="0" * 32, **times)
        reasons = reasons_of(record, [], healthy=["healthy"], typicality=setting.typicality)
        record["alarms"] = alarms.update(reasons, record["end"])
        records.append(record)
    return records


def month(
    features: Features, n_healthy: int, accepted: float, n_machines: int, n_hours: int, path: Path
) -> Iterator[dict[str, Any]]:
    """Yield what a month of a fleet costs, and what is detected in it."""
    model = fitted(features, n_healthy, 0)
    setting = alarm_setting(model, "healthy", accepted / 1000)
    fleet = list(machines(features, n_machines, n_hours))
    begun = time.process_time()
    by_machine = [records_of(model, setting, machine) for machine in fleet]
    decided = time.process_time() - begun
    n_records = sum(map(len, by_machine))
    history, begun = History(path), time.process_time()
    for hour in range(n_hours):
        history.write(*(records[hour] for records in by_machine if hour < len(records)))
    written = time.process_time() - begun
    begun = time.process_time()
    history.last_records(), history.alarms(open_only=True)
    read, alarms = time.process_time() - begun, history.alarms()
    history.close()
    per = 1e6 / n_records
    yield {"what": "records", "value": n_records}
    yield {
        "what": "signals to features, short simulated recording [us]",
        "value": 1e6 * features.seconds,
    }
    yield {"what": "decision, record and alarm [us]", "value": per * decided}
    yield {"what": "history [us]", "value": per * written}
    yield {"what": "last records and open alarms of the fleet [s]", "value": read}
    yield {"what": "history [bytes per record]", "value": path.stat().st_size / n_records}
    yield {"what": "history [MB]", "value": path.stat().st_size / 1e6}
    yield from detected(fleet, alarms, accepted, n_hours)


def detected(
    fleet: list[Machine], alarms: list[dict[str, Any]], accepted: float, n_hours: int
) -> Iterator[dict[str, Any]]:
    """Yield false alarms of the month, and which defects were detected, and when."""
    hour = {utc(START + pd.Timedelta(hours=k, seconds=10)): k for k in range(n_hours)}
    since: dict[str, list[int]] = {machine.name: [] for machine in fleet}
    for alarm in alarms:
        since[alarm["unit"]].append(hour[alarm["since"]])
    onsets = {m.name: min(m.life.onset if m.life else np.inf, len(m.X)) for m in fleet}
    n_false = sum(k < onsets[name] for name, hours in since.items() for k in hours)
    healthy_hours = sum(onsets.values())
    worn = [m for m in fleet if m.life and m.life.onset < n_hours]
    first = {
        m.name: min((k for k in since[m.name] if k >= m.life.onset), default=None) for m in worn
    }
    failed = [m for m in worn if m.life.life < n_hours]
    delays = [first[m.name] - m.life.onset for m in worn if first[m.name] is not None]
    sizes = [m.life.severity[first[m.name]] for m in worn if first[m.name] is not None]
    yield {"what": "false alarms in 1,000 h, accepted", "value": accepted}
    yield {"what": "false alarms in 1,000 h, found", "value": 1000 * n_false / healthy_hours}
    yield {"what": "machines with a defect", "value": len(worn)}
    yield {"what": "machines that failed", "value": len(failed)}
    missed = sum(first[m.name] is None for m in failed)
    yield {"what": "failed without an alarm", "value": missed}
    yield {"what": "detected", "value": len(delays)}
    quantiles = partial(np.quantile, q=(0.5, 0.9)) if delays else lambda _: (np.nan, np.nan)
    for what, values in (("delay [h]", delays), ("size of the defect at the alarm", sizes)):
        for name, value in zip(("median", "90 % quantile"), quantiles(values), strict=True):
            yield {"what": f"{what}, {name}", "value": float(value)}


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small fleet, for a few days")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results there")
    options = parser.parse_args()
    print(header(), flush=True)
    quick = options.quick
    features = simulated(2, 2, (0.1, 1.0)) if quick else simulated(12, 3, SIZES)
    years = (2, 2, 500) if quick else (20, 10, 8760)
    cases = [(20, 0.0)] if quick else [(60, 0.0), (400, 0.0), (60, 0.5)]
    rows = []
    for n_healthy, correlation in cases:
        found = healthy_years(features, (0.1, 1.0, 10.0), *years, n_healthy, correlation)
        rows += list(found)
    print(f"\nFalse alarms in 1,000 h of healthy machines\n{table(rows)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        size = (20, 240) if quick else (1000, 720)
        found = list(month(features, 20 if quick else 60, 1.0, *size, Path(folder) / "h.sqlite"))
    print(f"\nA month of {size[0]} machines, a recording per hour\n{table(found)}")
    write_json(options, rows + found)


if __name__ == "__main__":
    main()
