"""Spectra and maps over frequency in Hz, beside those over orders: a resonance stays at its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy  # scipy.signal is imported when it is used

from emacm.displays import drawing
from emacm.displays.recording import OrderMapDisplay
from emacm.recordings.recording import Recording


def draw_spectra(
    recordings: Mapping[str, Recording], channel: str, highest: float, ax: Any
) -> None:
    """Draw the power spectra of a channel, up to the frequency of the highest order."""
    several = len(recordings) > 1
    tops = []
    for number, recording in enumerate(recordings.values(), several):
        fs, signal = recording.fs[channel], recording.signals[channel]
        frequency, psd = scipy.signal.welch(signal, fs, nperseg=min(len(signal), int(2 * fs)))
        style = drawing.line_style(number) if several else {"color": drawing.PLAIN}
        ax.plot(frequency[1:], drawing.decibels(psd[1:]), linewidth=0.8, **style)
        tops.append(min(_frequency(recording, highest), frequency[-1]))
    ax.set_xlim(0, max(tops))
    unit = next(iter(recordings.values())).units.get(channel, "unit")
    drawing.label_axes(ax, "frequency [Hz]", f"PSD [dB re 1 {drawing.squared(unit)}/Hz]")


def draw_map(recording: Recording, display: OrderMapDisplay, highest: float, ax: Any) -> None:
    """Draw an order map over frequency, in segments as long in time as its middle one."""
    channel, fs = display.channel, recording.fs[display.channel]
    length = int(np.median(np.diff(display.intervals, axis=1)) * fs)
    frequency, times, psd = scipy.signal.spectrogram(
        recording.signals[channel], fs, "hann", length, length // 2
    )
    inside = frequency <= _frequency(recording, highest)
    known = np.arange(len(recording.velocity)) / recording.shaft_fs
    speeds = np.interp(times, known, recording.velocity)
    intervals = times[:, np.newaxis] + length / fs * np.array([-0.5, 0.5])
    options: Any = {"over": display.over, "channel": channel, "unit": display.unit}
    lower = OrderMapDisplay(frequency[inside], psd[inside].T, intervals, speeds, **options)
    lower.plot(ax=ax)
    ax.set_ylabel("frequency [Hz]")
    lower.colorbar_.set_label(f"PSD of {channel} [dB re 1 {drawing.squared(display.unit)}/Hz]")


def _frequency(recording: Recording, order: float) -> float:
    """Return the frequency of an order at the highest speed [Hz]."""
    return float(order * np.abs(recording.velocity).max() / (2 * np.pi))
