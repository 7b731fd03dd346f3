"""Recordings that a model should not decide on: wrong inputs and unknown states, by kind.

Each kind is a function of a recording and a random generator, and returns a changed recording.
`WRONG` are errors of sensors and of the acquisition, `OWN` further ones; `new_lines` are spectral
lines at orders that no state of the training has. Changes that no power spectrum shows (an offset,
a reversed sign, a delay of all channels) are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from emacm import Recording

Array = NDArray[np.float64]
Kind = Callable[[Recording, np.random.Generator], Recording]
ORDERS = (4.4, 9.4, 15.7, 21.3)  # of new lines
FACTORS = (1, 2, 5, 10)  # of the largest amplitude that a fault of the training has


def changed(recording: Recording, signals: Mapping[str, Array], **shaft: Any) -> Recording:
    """Return a recording with other signals, rate or shaft angle."""
    options = {
        "fs": float(recording.fs[recording.channels[0]]),
        "angle": np.asarray(recording.angle),
        "shaft_fs": float(recording.shaft_fs),
    } | shaft
    return Recording(signals, options.pop("fs"), meta=recording.meta, **options)


def signals_of(recording: Recording) -> dict[str, Array]:
    """Return all channels as arrays of float."""
    return {name: np.asarray(recording.signals[name], float) for name in recording.channels}


def each(change: Callable[..., Array], *channels: str) -> Kind:
    """Change some channels, or all of them."""

    def kind(recording: Recording, rng: np.random.Generator) -> Recording:
        signals = signals_of(recording)
        chosen = channels or tuple(signals)
        times = np.arange(len(signals[chosen[0]])) / float(recording.fs[chosen[0]])
        new = {name: change(signals[name], times, rng) for name in chosen}
        return changed(recording, signals | new)

    return kind


def shaft(change: Callable[[Array, np.random.Generator], Array], **options: Any) -> Kind:
    """Change the shaft angle."""
    return lambda recording, rng: changed(
        recording, signals_of(recording), angle=change(np.asarray(recording.angle), rng), **options
    )


def exchanged(first: str, second: str) -> Kind:
    """Swap the cables of two channels."""

    def kind(recording: Recording, rng: np.random.Generator) -> Recording:
        signals = signals_of(recording)
        return changed(recording, signals | {first: signals[second], second: signals[first]})

    return kind


def at_rate(factor: float) -> Kind:
    """State a wrong sampling rate of the signals; the shaft angle is right."""

    def kind(recording: Recording, rng: np.random.Generator) -> Recording:
        n_times = round(len(recording.signals[recording.channels[0]]) / factor)
        resampled = {k: filters.resample(x, n_times) for k, x in signals_of(recording).items()}
        return changed(recording, resampled, angle=cut(recording, n_times))

    return kind


def cut(recording: Recording, n_times: int) -> Array:
    """Return the shaft angle, as long as n_times samples of the signals."""
    fs = float(recording.fs[recording.channels[0]])
    n_angles = round(n_times / fs * float(recording.shaft_fs))
    angle = np.asarray(recording.angle)
    return np.interp(np.arange(n_angles), np.arange(len(angle)), angle)


def tone(frequency: float, share: float) -> Callable[..., Array]:
    """Add a tone at a frequency, with a share of the root mean square."""
    wave = 2 * np.pi * frequency
    return lambda x, t, rng: (
        x + np.sqrt(2) * share * np.std(x) * np.sin(wave * t + rng.uniform(0, 6))
    )


def noise(share: float) -> Callable[..., Array]:
    """Add white noise with a share of the root mean square."""
    return lambda x, t, rng: x + share * np.std(x) * rng.standard_normal(len(x))


def limited(share: float) -> Callable[..., Array]:
    """Clip at a share of the largest value."""
    return lambda x, t, rng: np.clip(x, -share * np.abs(x).max(), share * np.abs(x).max())


def filtered(kind: str, frequency: float) -> Callable[..., Array]:
    """Apply a Butterworth filter of order 4."""
    return lambda x, t, rng: filters.sosfilt(
        filters.butter(4, frequency, kind, fs=1 / (t[1] - t[0]), output="sos"), x
    )


def gated(share: float) -> Callable[..., Array]:
    """Lose a share of each half second."""
    return lambda x, t, rng: np.where((2 * t) % 1 < share, 0.0, x)


def spikes(x: Array, t: Array, rng: np.random.Generator) -> Array:
    """Add ten spikes per second."""
    return x + 20 * np.std(x) * (rng.uniform(size=len(x)) < 10 * (t[1] - t[0]))


def repeated(x: Array, t: Array, rng: np.random.Generator) -> Array:
    """Send every packet of 250 samples twice, and lose the next."""
    first = np.arange(len(x)) // 500 * 500
    return x[np.minimum(first + (np.arange(len(x)) - first) % 250, len(x) - 1)]


def overflow(share: float) -> Callable[..., Array]:
    """Wrap at a share of the largest value, as integers do."""

    def change(x: Array, t: Array, rng: np.random.Generator) -> Array:
        top = share * np.abs(x).max()
        return (x + top) % (2 * top) - top

    return change


def one_gap(duration: float) -> Callable[..., Array]:
    """Lose one part [s]."""

    def change(x: Array, t: Array, rng: np.random.Generator) -> Array:
        start = rng.uniform(0, t[-1] - duration)
        return np.where((t >= start) & (t < start + duration), 0.0, x)

    return change


def lost(share: float) -> Kind:
    """Lose a share of the samples of all channels; the shaft angle is complete."""

    def kind(recording: Recording, rng: np.random.Generator) -> Recording:
        signals = signals_of(recording)
        kept = rng.uniform(size=len(signals[recording.channels[0]])) >= share
        left = {name: x[kept] for name, x in signals.items()}
        return changed(recording, left, angle=cut(recording, int(kept.sum())))

    return kind


CURRENT, SHAKING = "current_a", "accelerometer"
WRONG: dict[str, Kind] = {
    "gain 1000": each(lambda x, t, rng: 1000 * x),
    "gain 0.3": each(lambda x, t, rng: 0.3 * x),
    "gain 0.5": each(lambda x, t, rng: 0.5 * x),
    "current: cable off": each(lambda x, t, rng: 0.01 * rng.standard_normal(len(x)), CURRENT),
    "accelerometer: cable off": each(lambda x, t, rng: 0.01 * rng.standard_normal(len(x)), SHAKING),
    "channels swapped": exchanged(CURRENT, SHAKING),
    "pulses per revolution doubled": shaft(lambda a, rng: a / 2),
    "pulses per revolution halved": shaft(lambda a, rng: a * 2),
    "sampling rate 1.25 times": at_rate(1.25),
    "sampling rate 0.8 times": at_rate(0.8),
    "clipping at half": each(limited(0.5)),
    "mains 50 Hz": each(tone(50, 0.3)),
    "noise ten times": each(noise(10.0)),
    "dead channel": each(lambda x, t, rng: np.zeros_like(x), CURRENT),
}
OWN: dict[str, Kind] = {
    "gain 1.5": each(lambda x, t, rng: 1.5 * x),
    "current: gain 2": each(lambda x, t, rng: 2 * x, CURRENT),
    "current: gain 0.6": each(lambda x, t, rng: 0.6 * x, CURRENT),
    "accelerometer: gain 2": each(lambda x, t, rng: 2 * x, SHAKING),
    "accelerometer: gain 0.5": each(lambda x, t, rng: 0.5 * x, SHAKING),
    "velocity: gain 1.3": each(lambda x, t, rng: 1.3 * x, "velocity"),
    "lvdt: gain 1.5": each(lambda x, t, rng: 1.5 * x, "lvdt"),
    "current: rectified": each(lambda x, t, rng: np.abs(x), CURRENT),
    "current: squared": each(lambda x, t, rng: x**2, CURRENT),
    "differentiated": each(lambda x, t, rng: np.gradient(x, t)),
    "integrated": each(lambda x, t, rng: np.cumsum(x - x.mean()) * (t[1] - t[0])),
    "accelerometer: low-pass 500 Hz": each(filtered("low", 500), SHAKING),
    "accelerometer: high-pass 500 Hz": each(filtered("high", 500), SHAKING),
    "current: high-pass 200 Hz": each(filtered("high", 200), CURRENT),
    "drop-outs of 10 %": each(gated(0.1)),
    "current: drop-outs of 5 %": each(gated(0.05), CURRENT),
    "accelerometer: drop-outs of 50 %": each(gated(0.5), SHAKING),
    "spikes": each(spikes),
    "current: spikes": each(spikes, CURRENT),
    "quantised to 3 bits": each(lambda x, t, rng: np.round(x / np.std(x)) * np.std(x)),
    "saturated": each(lambda x, t, rng: np.tanh(2 * x / np.std(x)) * np.std(x)),
    "clipping at 0.7": each(limited(0.7)),
    "packets repeated": each(repeated),
    "sample and hold, 4 samples": each(lambda x, t, rng: np.repeat(x[::4], 4)[: len(x)]),
    "every fourth sample, aliased": each(lambda x, t, rng: np.resize(x[::4], len(x))),
    "echo of 5 ms": each(lambda x, t, rng: x + 0.7 * np.roll(x, round(0.005 / (t[1] - t[0])))),
    "modulated at 10 Hz": each(lambda x, t, rng: x * (1 + 0.8 * np.sin(20 * np.pi * t))),
    "hum 100 Hz, accelerometer": each(tone(100, 0.5), SHAKING),
    "tone 400 Hz": each(tone(400, 0.5)),
    "current: noise": each(noise(0.3), CURRENT),
    "accelerometer: noise twice": each(noise(2.0), SHAKING),
    "crosstalk": lambda r, rng: changed(
        r,
        (s := signals_of(r)) | {SHAKING: s[SHAKING] + np.std(s[SHAKING]) * _unit(s[CURRENT])},
    ),
    "current on all channels": lambda r, rng: changed(
        r, dict.fromkeys(r.channels, signals_of(r)[CURRENT])
    ),
    "lvdt and velocity swapped": exchanged("lvdt", "velocity"),
    "angle in degrees": shaft(lambda a, rng: np.degrees(a)),
    "angle in revolutions": shaft(lambda a, rng: a / (2 * np.pi)),
    "gear of 10:11 ignored": shaft(lambda a, rng: 1.1 * a),
    "unsigned travel": shaft(lambda a, rng: np.cumsum(np.abs(np.diff(a, prepend=a[0])))),
    "angle delayed by 0.2 s": shaft(lambda a, rng: np.roll(a, len(a) // 30)),
    "angle of another run": shaft(lambda a, rng: a[::-1]),
    "constant speed assumed": shaft(lambda a, rng: np.linspace(0, np.ptp(a) * 4, len(a))),
    "0.1 % of the samples lost": lost(0.001),
    "overflow at half": each(overflow(0.5)),
    "accelerometer: gap of 1.5 s": each(one_gap(1.5), SHAKING),
    "only noise": each(lambda x, t, rng: np.std(x) * rng.standard_normal(len(x))),
}


def _unit(x: Array) -> Array:
    return (x - x.mean()) / np.std(x)


def new_lines(amplitudes: Mapping[str, float]) -> dict[str, Kind]:
    """Return lines at new orders, with amplitudes relative to the largest of known faults.

    Parameters
    ----------
    amplitudes : mapping
        Largest amplitude of a line of a known fault, by channel.

    Returns
    -------
    dict
        One kind for each channel, order and factor.
    """
    return {
        f"{channel}: {factor} x line at order {order:g}": line(channel, order, factor * size)
        for channel, size in amplitudes.items()
        for order in ORDERS
        for factor in FACTORS
    }


def line(channel: str, order: float, amplitude: float) -> Kind:
    """Add a line at an order to a channel, of an amplitude in its unit."""

    def kind(recording: Recording, rng: np.random.Generator) -> Recording:
        signals = signals_of(recording)
        n_times, angle = len(signals[channel]), np.asarray(recording.angle)
        places = np.arange(n_times) / recording.fs[channel] * recording.shaft_fs
        phase = order * np.interp(places, np.arange(len(angle)), angle) + rng.uniform(0, 6)
        return changed(recording, signals | {channel: signals[channel] + amplitude * np.sin(phase)})

    return kind
