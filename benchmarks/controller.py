"""An exported model on this computer, compared with Python: decisions, features, memory, time.

Needs a C compiler (cc). Readings are those of simulated actuators with reversals and rests, and,
where EMACM_DATA is set, of the actuator of Cranfield University. Run from the repository:

    OPENBLAS_NUM_THREADS=1 python benchmarks/controller.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from measure import header, json_option, table, write_json
from sklearn.decomposition import PCA
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderMonitor,
    OrderPSD,
    OrderResampler,
    Recording,
    export_c,
)

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
FS = 2000.0
STATES = ("healthy", "screw", "bearing")
LINES = {"healthy": 2.0, "screw": 5.3, "bearing": 7.7}  # orders


class Program:
    """An exported model, compiled with the driver.

    Parameters
    ----------
    folder : Path
        Of `export_c`.
    precision : {"float32", "float64"}
        Of the export.
    options : sequence of str
        Of the compiler.
    """

    def __init__(self, folder: Path, precision: str, options: Sequence[str] = ("-O2",)) -> None:
        self._dtype, self._data, self.path = np.dtype(precision), folder / "rows", folder / "driver"
        driver = Path(__file__).parent / "controller_driver.c"
        sources = [driver, folder / "emacm_model.c", "-I", folder, "-o", self.path, "-lm"]
        subprocess.run(["cc", *STRICT, *options, *map(str, sources)], check=True)

    def output(self, recordings: Sequence[np.ndarray], *more: str, before: Sequence[str] = ()):
        """Return what the driver writes for recordings of shape (n_times, n_channels + 1)."""
        with self._data.open("wb") as file:
            for rows in recordings:
                file.write(np.uint32(len(rows)).tobytes() + rows.astype(self._dtype).tobytes())
        command = [*before, str(self.path), str(self._data), *more]
        return subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout

    def readings(self, model: Pipeline, recordings: Sequence[np.ndarray], **how: Any) -> list[dict]:
        """Return the readings of recordings."""
        final = model[-1]
        widths = [1, 1, 1, 1, 1, len(final.classes_), len(final.decisions_), final.n_features_in_]
        names = ["recording", "decision", "flags", "typicality", "unknown"]
        names += ["posterior", "risk", "features"]
        found = np.frombuffer(self.output(recordings, **how)).reshape(-1, sum(widths))
        parts = np.split(found, np.cumsum(widths)[:-1], axis=1)
        return [dict(zip(names, values, strict=True)) for values in zip(*parts, strict=True)]


def rows_of(recording: Recording) -> np.ndarray:
    """Return channels and velocity as columns."""
    return np.column_stack([*recording.signals.values(), recording.velocity])


def simulated(state: str, seed: int, seconds: float = 3.0, fs: float = FS) -> Recording:
    """Return an actuator that travels there and back, with rests that an encoder's noise fills."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * fs)) / fs
    period, top = rng.uniform(1.6, 2.4), rng.uniform(60, 100)
    wave = np.sin(2 * np.pi * t / period + rng.uniform(0, 6))
    velocity = top * np.clip(1.5 * wave, -1, 1) * (1 + 0.05 * np.sin(2 * np.pi * 3 * t))
    at_rest = np.abs(velocity) < 0.2 * top
    velocity[at_rest] = 0.3 * rng.normal(size=at_rest.sum())
    angle = np.cumsum(velocity) / fs
    line = rng.uniform(0.02, 0.25) * np.sin(LINES[state] * angle + rng.uniform(0, 6))
    signals = {
        "torque": 20 + line + rng.normal(size=len(t)),
        "current": -3 + 0.5 * line + 0.5 * rng.normal(size=len(t)),
    }
    return Recording(signals, fs, velocity=velocity, meta={"unit": seed // 3})


def classifier(states: Sequence[str], **options: Any) -> CostSensitiveGaussianBayes:
    """Return one with unequal costs, inspections and an unknown state."""
    cost = {(states[0], state): 10 + k for k, state in enumerate(states[1:])}
    cost |= {("inspect", state): 0.3 + 0.1 * k for k, state in enumerate(states)}
    return CostSensitiveGaussianBayes(
        cost,
        covariance="tied",
        shrinkage="auto",
        unknown="unknown",
        unknown_rate=0.05,
        temperature="groups",
        **options,
    )


def simulated_model(n_recordings: int = 60) -> Pipeline:
    """Return a model of three states of simulated actuators."""
    y = [STATES[k % 3] for k in range(n_recordings)]
    X = [simulated(state, seed) for seed, state in enumerate(y)]
    steps = OrderResampler(2 * np.pi / 52, min_speed=2.0), OrderPSD(4), BinTransformer(max_order=20)
    log, scale = FunctionTransformer(np.log10), StandardScaler()
    model = make_pipeline(*steps, log, scale, PCA(12), classifier(STATES))
    units = [recording.meta["unit"] for recording in X]
    return model.fit(X, y, costsensitivegaussianbayes__groups=units)


def cranfield(file: Path) -> tuple[list[Recording], np.ndarray, np.ndarray]:
    """Return recordings, families of states and runs of the actuator of Cranfield University."""
    data = dict(np.load(file))
    fs, X = float(data["fs"]), []
    for row in range(len(data["state"])):
        position = (data["set_point"][row] - data["position_error"][row]).astype(float)
        velocity = np.gradient(2 * np.pi * position / float(data["lead_mm"])) * fs
        signals = {"current": data["current"][row].astype(float)}
        signals["error"] = data["position_error"][row].astype(float)
        X.append(Recording(signals, fs, velocity=velocity))
    families = np.array([state.rstrip("0123456789") for state in data["state"].astype(str)])
    return X, families, data["run"]


def cranfield_model(X: Sequence[Recording], y: np.ndarray, runs: np.ndarray) -> Pipeline:
    """Return a model of its families of states, fitted on runs 1 to 4."""
    resampler = OrderResampler(2 * np.pi / 8, min_speed=1.0)
    spectra = OrderPSD(4, by_direction=True), BinTransformer(0.25, max_order=2.5)
    states = sorted(set(y), key=lambda state: (state != "normal", state))
    model = make_pipeline(resampler, *spectra, FunctionTransformer(np.log), classifier(states))
    some = np.flatnonzero(runs <= 4)
    train = [X[k] for k in some]
    return model.fit(train, y[some], costsensitivegaussianbayes__groups=runs[some])


def compared(
    model: Pipeline, X: Sequence[Recording], precision: str, folder: Path, every: float = 0
) -> dict[str, Any]:
    """Return how the readings of the program differ from those of Python."""
    fs, names = X[0].fs[next(iter(X[0].signals))], list(X[0].signals)
    top = 1.01 * max(np.abs(recording.velocity[:]).max() for recording in X)
    options = {"fs": fs, "channels": names, "max_speed": top, "every": every}
    exported = export_c(model, folder, **options, precision=precision)
    # Python decides on the numbers that the program gets.
    rows = [rows_of(recording).astype(precision).astype(float) for recording in X]
    found = Program(folder, precision).readings(model, rows)
    monitor = OrderMonitor(model, **{**options, "every": every or None})
    expected = []
    for part in rows:
        expected += monitor.push(part[:, :-1].T, velocity=part[:, -1])
        expected += monitor.flush(complete=True)
    decisions = model[-1].decisions_.tolist()
    n_equal, feature, probability, without = 0, 0.0, 0.0, 0
    for one, other in zip(found, expected, strict=True):
        place = -1 if other.decision is None else decisions.index(other.decision)
        n_equal += int(one["decision"][0]) == place
        without += place < 0
        if place >= 0 and one["decision"][0] >= 0:
            scale = np.maximum(np.abs(other.features), 1.0)
            feature = max(feature, (np.abs(one["features"] - other.features) / scale).max())
            of_python = [*other.posterior.values(), other.unknown_proba or 0.0]
            apart = np.append(one["posterior"], one["unknown"]) - of_python
            probability = max(probability, np.abs(apart).max())
    return {
        "readings": len(expected),
        "decisions equal": n_equal,
        "without a decision": without,
        "largest deviation of a feature": float(feature),
        "of a probability": float(probability),
        "different decisions": len({int(one["decision"][0]) for one in found}),
        "RAM [KB]": exported.ram / 1024,
    }


def noise_model(n_channels: int, per_revolution: int, fs: float) -> tuple[Pipeline, np.ndarray]:
    """Return a model of two states of noise, and rows of 4 s at 48 rev/s with ripple."""
    t = np.arange(int(4 * fs)) / fs
    velocity = 2 * np.pi * 48 * (1 + 0.15 * np.sin(2 * np.pi * t))
    names = [f"channel {k}" for k in range(n_channels)]
    X, rng, short = [], np.random.default_rng(0), velocity[: len(t) // 4]
    for k in range(12):
        rows = (1 + k % 2) * rng.normal(size=(n_channels, len(short)))
        X.append(Recording(dict(zip(names, rows, strict=True)), fs, velocity=short))
    steps = OrderResampler(2 * np.pi / per_revolution), OrderPSD(16)
    bins = BinTransformer(max_order=0.39 * per_revolution)
    diagonal = CostSensitiveGaussianBayes(covariance="diag")
    model = make_pipeline(*steps, bins, FunctionTransformer(np.log10), diagonal)
    model.fit(X, ["new", "worn"] * 6)
    return model, np.column_stack([*rng.normal(size=(n_channels, len(t))), velocity])


def size_and_speed(n_channels: int, per_revolution: int, precision: str, fs: float) -> dict:
    """Return memory, operations, and how much faster than real time one core is."""
    model, rows = noise_model(n_channels, per_revolution, fs)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        exported = export_c(model, folder, fs=fs, max_speed=360, every=64, precision=precision)
        spent = float(Program(folder, precision).output([rows], "time"))
    return {
        "channels": n_channels,
        "per revolution": per_revolution,
        "precision": precision,
        "RAM [KB]": exported.ram / 1024,
        "tables [KB]": exported.constants / 1024,
        "operations per sample": exported.operations,
        "longest call": exported.longest,
        "times real time": len(rows) / fs / spent,
        # Counted, not measured there: 4 cycles of 10 ns for an operation and its two numbers.
        "load of 100 MHz [%]": 100 * 4 * exported.operations * fs / 1e8,
        "longest call at 100 MHz [ms]": 1e3 * 4 * exported.longest / 1e8,
    }


def main() -> None:
    """Compare, measure, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few readings, few sizes")
    json_option(parser)
    options = parser.parse_args()
    print(header())
    few, rows = options.quick, []
    model = simulated_model()
    X = [simulated(STATES[k % 3], 10_000 + k) for k in range(12 if few else 2100)]
    named = [("simulated, 7.5 revolutions each", model, X, 7.5)]
    files = sorted(Path(os.environ.get("EMACM_DATA", "")).glob("cranfield_ema/*.npz"))
    if files:
        real, y, runs = cranfield(files[0])
        fitted = cranfield_model(real, y, runs)
        named.append(("real actuator, each recording", fitted, real[:: 200 if few else 1], 0))
    for name, model, recordings, every in named:
        for precision in ("float64", "float32"):
            with tempfile.TemporaryDirectory() as folder:
                found = compared(model, recordings, precision, Path(folder), every)
            rows.append({"kind": name, "precision": precision, **found})
    print(table(rows))
    sizes = [(n, per, "float32") for n in (1, 2, 3, 5, 8) for per in (64, 128, 256)]
    sizes = [(3, 128, "float32")] if few else [*sizes, (3, 128, "float64"), (5, 128, "float64")]
    measured = [
        {"kind": f"{n} at {per}", **size_and_speed(n, per, precision, 48_000.0)}
        for n, per, precision in sizes
    ]
    print(table(measured))
    write_json(options, [*rows, *measured])


if __name__ == "__main__":
    main()
