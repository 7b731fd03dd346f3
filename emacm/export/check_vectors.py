"""Readings that a program on a controller can make again, and what Python decides on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm.export.exported_model import ExportedModel
from emacm.streams.order_monitor import OrderMonitor

# Speed in 16 sections of equal length, in 64ths of the highest: forward, at rest, and in reverse.
_SECTIONS = np.array([0, 20, 64, 61, 58, 55, 52, 48, 20, 0, -20, -64, -60, -56, -52, -48])


def check_tables(
    model: Any, channels: Sequence[str], precision: str, fs: float, max_speed: float, every: float
) -> dict[str, Any]:
    """Return what check.c makes twelve recordings of, and the readings of Python.

    Noise comes from a linear congruential generator, speeds are whole multiples of a number: the
    samples are the same, bit for bit, on any computer. Levels and speeds are within those of the
    training, but for one level in three, which is twice as large.

    Parameters
    ----------
    model : estimator
        Fitted pipeline.
    channels : sequence of str
        In the order of a sample.
    precision : {"float32", "float64"}
        Numbers of the samples.
    fs, max_speed, every : float
        As for `export_c`.

    Returns
    -------
    dict
    """
    monitor = OrderMonitor(
        model, fs=fs, channels=channels, max_speed=max_speed, every=every if every else None
    )
    known = ExportedModel(model)
    ranges, ratio = known.resampler.training_range_.ranges, known.resampler.ratio
    rng, dtype = np.random.default_rng(12), np.dtype(precision).type
    levels, speeds, sizes, readings = [], [], [], []
    for number in range(12):
        low, high = np.array([ranges[f"level of {name}"] for name in channels]).T
        level = low * (high / np.maximum(low, 1e-30)) ** rng.uniform(size=len(channels))
        level *= 2 if number % 3 == 2 else 1
        slowest, fastest = ranges["fastest"]
        speed = min(rng.uniform(slowest, fastest) / ratio, 0.999 * max_speed)
        turns = every or ranges["revolutions"][0]
        size = int(2 * turns * 2 * np.pi / ratio / speed * fs) + 64
        levels.append((level * np.sqrt(3) / 2**23).astype(dtype))
        speeds.append(dtype(speed / 64))
        sizes.append(size)
        noise = _noise(number + 1, size * len(channels)).reshape(size, -1)
        signals = (noise.astype(dtype) * levels[-1]).T
        velocity = _SECTIONS.astype(dtype)[16 * np.arange(size) // size] * speeds[-1]
        found = monitor.push(signals, velocity=velocity)
        readings.append([*found, *monitor.flush(complete=True)][0])
    decisions = known.classifier.decisions_.tolist()
    n_features = known.classifier.n_features_in_
    return {
        "N_READINGS": len(readings),
        "N_SAMPLES": np.array(sizes, np.uint32),
        "LEVEL": np.array(levels),
        "SPEED": np.array(speeds),
        "SECTIONS": _SECTIONS,
        "DECISION": np.array(
            [-1 if r.decision is None else decisions.index(r.decision) for r in readings]
        ),
        "FEATURES": np.array(
            [np.zeros(n_features) if r.features is None else r.features for r in readings]
        ),
        "TYPICALITY": np.array([-1.0 if r.typicality is None else r.typicality for r in readings]),
    }


def _noise(seed: int, size: int) -> NDArray[np.int32]:
    """Return whole numbers of 24 bits, of the generator of Numerical Recipes."""
    powers = np.full(size, 1664525, np.uint32).cumprod(dtype=np.uint32)
    sums = np.append(np.uint32(1), powers[:-1]).cumsum(dtype=np.uint32)
    state: Any = powers * np.uint32(seed) + np.uint32(1013904223) * sums
    return (state >> 8).astype(np.int32) - 2**23
