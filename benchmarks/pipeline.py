"""Time from a recording to its order bins, compared with the code a user would write otherwise.

Five channels at 48 kHz, the shaft at 48 rev/s with 15 % ripple; Hann windows of 4.096
revolutions, half overlapping; bins of one order up to 50. Then 32 recordings
with two channels of 2,560 samples at 2,560 Hz, at 20 rev/s, one after the other in scripts, and as
one list in emacm. Recordings are new to pipelines that were fitted before: each repeat constructs
the `Recording`, checks its quality and transforms it, as `score` does. Its arrays are read-only, as
those that emacm reads from files; "copied" are arrays that can be written to. "Used before" is a
recording that remembers its strokes and its quality. Prints the processor's time, medians of
interleaved repeats, and its ratios to scripts (b) and (c), and the errors of each variant: power of
a tone at order 49.5, noise floor, and power aliased from a tone at order 130.5. "Defaults" has the
package's own segments of 16 revolutions; "as in the thesis" is `OrderPSD(n_per_segment=4096)`,
without `max_order`. Run from the repository, with one thread:

    OPENBLAS_NUM_THREADS=1 python benchmarks/pipeline.py [--quick] [--json [FILE]]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from measure import header, json_option, medians, table, write_json
from numpy.typing import NDArray
from scipy import fft
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.interpolate import interp1d
from scipy.signal import welch
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm._kernels import NAMES, using

SEGMENT = 4.096  # revolutions, so that the variants have the same order step
TOP = 50
TONE, ALIASED = 49.5, 130.5  # orders; the second is aliased to 2.5 at 128 samples per revolution
LINEAR = {"antialias": False, "interpolation": "linear"}  # the thesis' own setting


class Measured(NamedTuple):
    """Signals as a user has them: channels in rows, sampling rate [Hz], speed [rad/s]."""

    rows: NDArray[np.floating]
    fs: float
    velocity: NDArray[np.floating]

    def recording(self) -> Recording:
        """Return a new recording."""
        channels = {f"channel {i}": row for i, row in enumerate(self.rows)}
        return Recording(channels, self.fs, velocity=self.velocity)


Bins = Callable[[Measured], NDArray[np.floating]]


def naive(measured: Measured, nrev: int) -> NDArray[np.floating]:
    """Bins by a naive script: one channel and one bin after the other."""
    angle = cumulative_trapezoid(measured.velocity, dx=1 / measured.fs, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    rows = []
    for signal in measured.rows:
        orders, psd = welch(interp1d(angle, signal)(grid), nrev, nperseg=round(SEGMENT * nrev))
        for low in range(TOP):
            inside = (orders >= low) & (orders < low + 1)
            rows.append(trapezoid(psd[inside], orders[inside]))
    return np.array(rows)


def vectorised(measured: Measured, nrev: int) -> NDArray[np.floating]:
    """Bins by a vectorised script: np.interp, one welch, bins from the cumulative integral."""
    angle = cumulative_trapezoid(measured.velocity, dx=1 / measured.fs, initial=0)
    grid = np.arange(0, angle[-1], 2 * np.pi / nrev)
    resampled = np.stack([np.interp(grid, angle, x) for x in measured.rows])
    orders, psd = welch(resampled, nrev, nperseg=round(SEGMENT * nrev))
    # The integral from 0 to any order, of straight lines between the spectral lines.
    running = cumulative_trapezoid(psd, orders, initial=0)
    edges = np.arange(TOP + 1.0)
    below = np.searchsorted(orders, edges, side="right") - 1
    past = edges - orders[below]
    slope = (psd[:, below + 1] - psd[:, below]) / (orders[below + 1] - orders[below])
    return np.diff(running[:, below] + past * psd[:, below] + past**2 / 2 * slope).ravel()


def by_emacm(nrev: int, kernels: str, psd: OrderPSD | None = None, **options: object) -> Bins:
    """Bins by the three transformers; also of a recording that was used before."""
    pipeline = make_pipeline(
        OrderResampler(2 * np.pi / nrev, **options),
        OrderPSD(SEGMENT, max_order=TOP, memory=False) if psd is None else psd,
        BinTransformer(max_order=TOP),
    )

    def bins(*given: Measured | Recording) -> NDArray[np.floating]:
        with using(kernels):
            recordings = [x.recording() if isinstance(x, Measured) else x for x in given]
            if getattr(pipeline[0], "channels_", None) != recordings[0].channels:
                pipeline.fit(recordings)
            pipeline[0].outside_training(recordings)
            return pipeline.transform(recordings)[0]

    return bins


def least(measured: Measured) -> None:
    """Read the signals once, and transform the segments that 1000 samples/rev make of them."""
    nrev, length = 1000, round(SEGMENT * 1000)
    n_angles = int(measured.velocity.sum() / measured.fs * nrev / (2 * np.pi))
    n_segments = (n_angles - length) // (length // 2) + 1
    at_once = max(1, (1 << 19) // (length * measured.rows.itemsize))
    segments = np.ones((at_once, length), measured.rows.dtype)
    for signal in measured.rows:
        signal.sum()
        for start in range(0, n_segments, at_once):
            fft.rfft(segments[: n_segments - start])


def made(
    seconds: float, kind: str, n_channels: int = 5, fs: float = 48_000.0, rate: float = 48.0
) -> tuple[Measured, float]:
    """Make channels of noise or of one tone; also the power that the bins should hold."""
    rng = np.random.default_rng(0)
    times = np.arange(int(seconds * fs)) / fs
    ripple = 0.15
    velocity = 2 * np.pi * rate * (1 + ripple * np.sin(2 * np.pi * times))
    angle = 2 * np.pi * rate * (times + ripple * (1 - np.cos(2 * np.pi * times)) / (2 * np.pi))
    if kind == "noise":
        rows = rng.standard_normal((n_channels, len(times)))
        # One-sided density over orders, averaged over the angle.
        true = 2 / fs * np.mean(velocity**2) / np.mean(velocity) / (2 * np.pi)
    else:
        rows = np.tile(np.sin((TONE if kind == "tone" else ALIASED) * angle), (n_channels, 1))
        true = 0.5
    rows.flags.writeable = velocity.flags.writeable = False
    return Measured(rows, fs, velocity), true


def errors(variant: Bins, seconds: float) -> dict[str, float]:
    """Error [dB] of a tone's power and of the noise floor, and power of the aliased tone [dB]."""
    found = {}
    parts = {"tone": slice(47, 50), "noise": slice(1, 48), "aliased": slice(0, 50)}
    for kind, chosen in parts.items():
        measured, true = made(seconds, kind, n_channels=1)
        bins = variant(measured)[chosen]
        power = bins.mean() if kind == "noise" else bins.sum()
        found[f"{kind} [dB]"] = float(10 * np.log10(max(power, 1e-20) / true))
    return found


def timed(
    runs: Mapping[str, Callable[[], object]], repeats: int, n_recordings: int = 1
) -> list[dict[str, Any]]:
    """Measure in turns; also the ratios to the scripts."""
    spent = medians(runs, repeats, clock=time.process_time)
    return [
        {"variant": name, "ms": 1e3 * own / n_recordings}
        | {f"x ({mark})": spent[SCRIPTS[mark]] / own for mark in "bc"}
        for name, own in spent.items()
    ]


def map_to_list(function: Bins, many: list[Measured]) -> list[NDArray[np.floating]]:
    """Call a function for each, as scripts do."""
    return [function(each) for each in many]


SCRIPTS = {
    "a": "(a) naive script, 1000/rev",
    "b": "(b) vectorised script, 1000/rev",
    "c": "(c) vectorised script, 128/rev",
}


def main() -> None:
    """Measure, print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short recordings, two repeats")
    json_option(parser)
    options = parser.parse_args()
    seconds, repeats = (2.0, 2) if options.quick else (10.0, 15)

    kernels = [name for name in NAMES if name == "numpy" or find_spec(name)]
    variants: dict[str, Bins] = {
        SCRIPTS["a"]: lambda r: naive(r, 1000),
        SCRIPTS["b"]: lambda r: vectorised(r, 1000),
        SCRIPTS["c"]: lambda r: vectorised(r, 128),
    }
    for name in kernels:
        as_thesis = OrderPSD(n_per_segment=4096, memory=False)
        variants |= {
            f"emacm, linear, 1000/rev, {name}": by_emacm(1000, name, **LINEAR),
            f"emacm, linear, as in the thesis, {name}": by_emacm(1000, name, as_thesis, **LINEAR),
            f"emacm, 128/rev, {name}": by_emacm(128, name),
            f"emacm, defaults, {name}": by_emacm(128, name, OrderPSD(memory=False)),
        }
    measured, _ = made(seconds, "noise")
    used, halved = measured.recording(), measured._replace(rows=measured.rows.astype(np.float32))
    writable = Measured(measured.rows.copy(), measured.fs, measured.velocity.copy())
    runs = {name: partial(f, measured) for name, f in variants.items()}
    for name in kernels:
        for kind in ("linear, as in the thesis", "defaults"):
            f = variants[f"emacm, {kind}, {name}"]
            runs[f"emacm, {kind}, {name}, used before"] = partial(f, used)
        runs[f"emacm, defaults, {name}, copied"] = partial(f, writable)
        runs[f"emacm, defaults, {name}, float32"] = partial(f, halved)
    runs["one read and the bare transforms, 1000/rev"] = partial(least, measured)
    rows = timed(runs, repeats)
    reference = vectorised(measured, 1000)
    for row in rows:
        name = row["variant"]
        if name in variants:
            row |= errors(variants[name], seconds)
        if name.startswith("emacm, linear, 1000/rev"):
            row["off (b)"] = float(np.max(np.abs(variants[name](measured) / reference - 1)))
        if name.endswith("float32"):
            f = variants[name.removesuffix(", float32")]
            row["off float64"] = float(np.max(np.abs(f(halved) / f(measured) - 1)))
    print(header())
    print(f"5 channels of {seconds:g} s at 48 kHz; medians of {repeats}")
    print(table(rows))
    many = 32 * [made(1.0, "noise", 2, fs=2560.0, rate=20.0)[0]]
    of_many = {name: partial(map_to_list, variants[name], many) for name in SCRIPTS.values()}
    for name in kernels:
        of_many[f"emacm, defaults, {name}"] = partial(variants[f"emacm, defaults, {name}"], *many)
    of_short = timed(of_many, repeats, len(many))
    print("\n2 channels of 2,560 samples at 2,560 Hz, 20 rev/s; 32 recordings")
    print(table(of_short))
    rows += [row | {"variant": f"2 x 2,560 samples: {row['variant']}"} for row in of_short]
    write_json(options, rows)


if __name__ == "__main__":
    main()
