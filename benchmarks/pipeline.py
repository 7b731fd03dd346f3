"""Time from a recording to its order bins, compared with the code a user would write otherwise.

Five channels at 48 kHz, the shaft at 48 rev/s with 15 % ripple; Hann windows of 4.096
revolutions, half overlapping; bins of one order up to 50. Prints the processor's time, medians of
interleaved repeats, and its ratios, and the errors of each variant: power of a tone at order 49.5,
noise floor, and power aliased from a tone at order 130.5. "Defaults" has the package's own segments
of 16 revolutions; "as in the thesis" is `OrderPSD(n_per_segment=4096)`, without `max_order`. Run
from the repository, with one thread:

    OPENBLAS_NUM_THREADS=1 python benchmarks/pipeline.py [--quick] [--json FILE]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from measure import header, medians, table, write_json
from numpy.typing import NDArray
from scipy import fft
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.interpolate import interp1d
from scipy.signal import welch
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm._kernels import NAMES, using

FS = 48_000.0
SEGMENT = 4.096  # revolutions, so that the variants have the same order step
TOP = 50
TONE, ALIASED = 49.5, 130.5  # orders; the second is aliased to 2.5 at 128 samples per revolution
LINEAR = {"antialias": False, "interpolation": "linear"}  # the thesis' own setting

Bins = Callable[[Recording], NDArray[np.floating]]


def naive(recording: Recording, nrev: int) -> NDArray[np.floating]:
    """Bins by a naive script: one channel and one bin after the other."""
    angle = cumulative_trapezoid(recording.velocity, dx=1 / FS, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    rows = []
    for signal in recording.signals.values():
        orders, psd = welch(interp1d(angle, signal)(grid), nrev, nperseg=round(SEGMENT * nrev))
        for low in range(TOP):
            inside = (orders >= low) & (orders < low + 1)
            rows.append(trapezoid(psd[inside], orders[inside]))
    return np.array(rows)


def vectorised(recording: Recording, nrev: int) -> NDArray[np.floating]:
    """Bins by a vectorised script: np.interp, one welch, bins from the cumulative integral."""
    angle = cumulative_trapezoid(recording.velocity, dx=1 / FS, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    resampled = np.stack([np.interp(grid, angle, x) for x in recording.signals.values()])
    orders, psd = welch(resampled, nrev, nperseg=round(SEGMENT * nrev))
    # The integral from 0 to any order, of straight lines between the spectral lines.
    running = cumulative_trapezoid(psd, orders, initial=0)
    edges = np.arange(TOP + 1.0)
    below = np.searchsorted(orders, edges, side="right") - 1
    past = edges - orders[below]
    slope = (psd[:, below + 1] - psd[:, below]) / (orders[below + 1] - orders[below])
    return np.diff(running[:, below] + past * psd[:, below] + past**2 / 2 * slope).ravel()


def by_emacm(nrev: int, kernels: str, psd: OrderPSD | None = None, **options: object) -> Bins:
    """Bins by the three transformers."""
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / nrev, **options),
        OrderPSD(SEGMENT, max_order=TOP) if psd is None else psd,
        BinTransformer(max_order=TOP),
    )

    def bins(recording: Recording) -> NDArray[np.floating]:
        with using(kernels):
            return pipeline.fit_transform([recording])[0]

    return bins


def least(recording: Recording) -> None:
    """Read the recording once, and transform the segments that 1000 samples/rev make of it."""
    nrev, length = 1000, round(SEGMENT * 1000)
    n_angles = int(recording.motion[0][-1] * nrev / (2 * np.pi))
    n_segments = (n_angles - length) // (length // 2) + 1
    dtype = next(iter(recording.signals.values())).dtype
    at_once = max(1, (1 << 19) // (length * dtype.itemsize))
    segments = np.ones((at_once, length), dtype)
    recording.velocity.sum()
    for signal in recording.signals.values():
        signal.sum()
        for start in range(0, n_segments, at_once):
            fft.rfft(segments[: n_segments - start])


def made(seconds: float, kind: str, n_channels: int = 5) -> tuple[Recording, float]:
    """Make channels of noise or of one tone; also the power that the bins should hold."""
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
        rows = np.tile(np.sin((TONE if kind == "tone" else ALIASED) * angle), (n_channels, 1))
        true = 0.5
    signals = {f"channel {i}": row for i, row in enumerate(rows)}
    return Recording(signals, FS, velocity=velocity), true


def single(recording: Recording) -> Recording:
    """Return the same in float32."""
    signals = {name: row.astype(np.float32) for name, row in recording.signals.items()}
    return Recording(signals, FS, velocity=recording.velocity)


def errors(variant: Bins, seconds: float) -> dict[str, float]:
    """Error [dB] of a tone's power and of the noise floor, and power of the aliased tone [dB]."""
    found = {}
    parts = {"tone": slice(47, 50), "noise": slice(1, 48), "aliased": slice(0, 50)}
    for kind, chosen in parts.items():
        recording, true = made(seconds, kind, n_channels=1)
        bins = variant(recording)[chosen]
        power = bins.mean() if kind == "noise" else bins.sum()
        found[f"{kind} [dB]"] = float(10 * np.log10(max(power, 1e-20) / true))
    return found


def main() -> None:
    """Measure, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short recordings, two repeats")
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args()
    seconds, repeats = (2.0, 2) if options.quick else (10.0, 15)

    kernels = [name for name in NAMES if name == "numpy" or find_spec(name)]
    variants: dict[str, Bins] = {
        "(a) naive script, 1000/rev": lambda r: naive(r, 1000),
        "(b) vectorised script, 1000/rev": lambda r: vectorised(r, 1000),
        "    vectorised script, 128/rev": lambda r: vectorised(r, 128),
    }
    for name in kernels:
        as_thesis = OrderPSD(n_per_segment=4096)
        variants[f"emacm, linear, 1000/rev, {name}"] = by_emacm(1000, name, **LINEAR)
        variants[f"emacm, linear, as in the thesis, {name}"] = by_emacm(
            1000, name, as_thesis, **LINEAR
        )
        variants[f"emacm, 128/rev, {name}"] = by_emacm(128, name)
        variants[f"emacm, defaults, {name}"] = by_emacm(128, name, OrderPSD())
    recording, _ = made(seconds, "noise")
    halved = single(recording)
    runs = {name: (lambda f=f: f(recording)) for name, f in variants.items()}
    for name in kernels:
        f = variants[f"emacm, 128/rev, {name}"]
        runs[f"emacm, 128/rev, {name}, float32"] = lambda f=f: f(halved)
    runs["one read and the bare transforms, 1000/rev"] = lambda: least(recording)
    spent = medians(runs, repeats, clock=time.process_time)

    first, well = (spent[name] for name in list(variants)[:2])
    bare = spent["one read and the bare transforms, 1000/rev"]
    reference = vectorised(recording, 1000)
    rows = []
    for name in runs:
        row: dict[str, object] = {"variant": name, "ms": 1e3 * spent[name]}
        row |= {"x (a)": first / spent[name], "x (b)": well / spent[name]}
        row["of bare"] = spent[name] / bare
        if name in variants:
            row |= errors(variants[name], seconds)
        if "linear" in name:
            bins = variants[name](recording)
            row["off (b)"] = float(np.max(np.abs(bins / reference - 1)))
        if "float32" in name:
            exact = variants[name.removesuffix(", float32")](recording)
            row["off float64"] = float(
                np.max(np.abs(variants[name.removesuffix(", float32")](halved) / exact - 1))
            )
        rows.append(row)
    print(header())
    print(f"5 channels of {seconds:g} s at 48 kHz; medians of {repeats}")
    print(table(rows))
    write_json(options.json, rows)


if __name__ == "__main__":
    main()
