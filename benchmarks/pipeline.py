"""Time from a recording to its order bins, against what a user would write otherwise.

Prints medians of interleaved repeats and their ratios, and for each variant the error of a tone, of
the noise floor and of a tone that folds, so that nothing fast is wrong. Run from the repository:

    python benchmarks/pipeline.py [--quick] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy
import sklearn
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.interpolate import interp1d
from scipy.signal import welch
from sklearn.pipeline import make_pipeline

import emacm
from emacm import BinTransformer, OrderPSD, OrderResampler, Recording

FS = 48_000.0
SEGMENT = 4.096  # revolutions, so that all variants have the same order step
TOP = 50
TONE, FOLDING = 31.5, 130.5  # orders; the second folds to 2.5 at 128 samples per revolution

Signals = dict[str, NDArray[np.floating]]


def written_first(signals: Signals, velocity: NDArray[np.floating], nrev: int) -> NDArray:
    """Bins as a user writes them first: one channel and one bin after the other."""
    angle = cumulative_trapezoid(velocity, dx=1 / FS, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    rows = []
    for signal in signals.values():
        orders, psd = welch(interp1d(angle, signal)(grid), nrev, nperseg=round(SEGMENT * nrev))
        for low in range(TOP):
            inside = (orders >= low) & (orders < low + 1)
            rows.append(trapezoid(psd[inside], orders[inside]))
    return np.array(rows)


def written_well(signals: Signals, velocity: NDArray[np.floating], nrev: int) -> NDArray:
    """Bins as a good user writes them: np.interp, one welch, bins from the running integral."""
    angle = cumulative_trapezoid(velocity, dx=1 / FS, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    resampled = np.stack([np.interp(grid, angle, signal) for signal in signals.values()])
    orders, psd = welch(resampled, nrev, nperseg=round(SEGMENT * nrev))
    running = cumulative_trapezoid(psd, orders, initial=0)
    edges = np.stack([np.interp(np.arange(TOP + 1), orders, row) for row in running])
    return np.diff(edges).ravel()


def by_emacm(nrev: int, **options: object) -> Callable[[Signals, NDArray], NDArray]:
    """Bins by the three transformers."""
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / nrev, **options),
        OrderPSD(SEGMENT, max_order=TOP),
        BinTransformer(max_order=TOP),
    )

    def bins(signals: Signals, velocity: NDArray) -> NDArray:
        return pipeline.fit_transform([Recording(signals, FS, velocity=velocity)])[0]

    return bins


def recording(seconds: float, kind: str, n_channels: int = 5) -> tuple[Signals, NDArray, float]:
    """Channels of noise or of one tone, the velocity, and the power that the bins should hold."""
    rng = np.random.default_rng(0)
    times = np.arange(int(seconds * FS)) / FS
    rate, ripple = 48.0, 0.15  # rev/s
    velocity = 2 * np.pi * rate * (1 + ripple * np.sin(2 * np.pi * times))
    angle = 2 * np.pi * rate * (times + ripple * (1 - np.cos(2 * np.pi * times)) / (2 * np.pi))
    if kind == "noise":
        rows = rng.standard_normal((n_channels, len(times)))
        # One-sided density over orders, averaged over the angle.
        true = 2 / FS * np.mean(velocity**2) / np.mean(velocity) / (2 * np.pi)
    else:
        order = TONE if kind == "tone" else FOLDING
        rows = np.tile(np.sin(order * angle), (n_channels, 1))
        true = 0.5
    return {f"channel {i}": row for i, row in enumerate(rows)}, velocity, true


def errors(variant: Callable[..., NDArray], nrev: int, seconds: float) -> dict[str, float]:
    """Error [dB] of a tone's power and of the noise floor, and power of what folds in [dB]."""
    found = {}
    for kind in ("tone", "noise", "fold"):
        signals, velocity, true = recording(seconds, kind, n_channels=1)
        bins = variant(signals, velocity)
        power = {"tone": bins[30:33].sum(), "noise": bins[1:48].mean(), "fold": bins.sum()}[kind]
        found[f"{kind} [dB]"] = float(10 * np.log10(max(power, 1e-20) / true))
    return found


def medians(variants: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Median seconds of each, measured in turns."""
    spent: dict[str, list[float]] = {name: [] for name in variants}
    for turn in range(repeats + 1):
        for name, run in variants.items():
            start = time.perf_counter()
            run()
            if turn:  # the first turn warms up
                spent[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in spent.items()}


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short recordings, two repeats")
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    seconds, repeats = (2.0, 2) if options.quick else (10.0, 9)

    linear = {"antialias": False, "interpolation": "linear"}
    variants = {
        "written first, 1000/rev": (lambda s, v: written_first(s, v, 1000), 1000),
        "written well, 1000/rev": (lambda s, v: written_well(s, v, 1000), 1000),
        "written well, 128/rev": (lambda s, v: written_well(s, v, 128), 128),
        "emacm, thesis' linear, 1000/rev": (by_emacm(1000, **linear), 1000),
        "emacm, default, 128/rev": (by_emacm(128), 128),
    }
    signals, velocity, _ = recording(seconds, "noise")
    spent = medians(
        {name: (lambda f=f: f(signals, velocity)) for name, (f, _) in variants.items()}, repeats
    )
    base = spent["written well, 1000/rev"]
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, ",
        end="",
    )
    print(f"numpy {np.__version__}, scipy {scipy.__version__}, scikit-learn {sklearn.__version__}")
    print(f"5 channels of {seconds:g} s at 48 kHz, emacm {emacm.__version__}; medians of {repeats}")
    print(f"{'':34}{'ms':>8}{'speed':>8}{'tone dB':>10}{'noise dB':>10}{'fold dB':>10}")
    rows = []
    for name, (variant, nrev) in variants.items():
        row = {"variant": name, "ms": 1e3 * spent[name], "speed": base / spent[name]}
        row |= errors(variant, nrev, seconds)
        rows.append(row)
        figures = [row[f"{kind} [dB]"] for kind in ("tone", "noise", "fold")]
        print(f"{name:34}{row['ms']:8.1f}{row['speed']:8.2f}", *(f"{x:9.3f}" for x in figures))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
