"""Loops over the segments of Welch's method, compiled.

Where only the lowest lines are wanted, a segment is decimated first: it is filtered by a circular
low pass, and every fourth value is transformed,

    y_m = sum_n h_(n - 4 m) x_(n mod L),    |Y_k| = |H_k X_k + H_(k + L/4) X_(k + L/4) + ...| / 4.

H is the transform of the taps themselves, so that dividing by it is exact, and less than 2e-14 of a
line aliases onto those wanted. To convolve by a Kaiser-Bessel kernel, to transform fewer points and
to divide by the kernel's transform is the gridding of magnetic resonance imaging (Jackson, Meyer,
Nishimura and Macovski, IEEE Trans. Med. Imaging 10(3), 473-478, 1991), here of uniform points.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from emacm._kernels.numba.compilation import compiled

SEGMENT_BYTES = 1 << 20  # of the segments transformed at a time
# Of the low pass; the tests measure what it lets alias onto the lines wanted.
_DECIMATION = 4  # samples for each one that is kept
_HIGHEST = 1 / 16  # of the sampling rate: highest line wanted, half of what is left can represent
_WIDTH = 16  # of the kernel, in samples kept: what aliases is 1e-14
_SHAPE = 0.98  # of the Kaiser-Bessel kernel whose stop band begins where the first line aliases
_SHORTEST = 64  # samples; the low pass must not be longer

Array = NDArray[np.floating]


@lru_cache(maxsize=64)
def low_pass(length: int, n_lines: int) -> tuple[Array, Array, int] | None:
    """Return what segments are filtered by; None where plain transforms are faster."""
    if length % _DECIMATION or length < _SHORTEST or n_lines > length * _HIGHEST:
        return None
    # sinh(sqrt(shape² - w²)) / sqrt(shape² - w²), the transform (Jackson et al.), is small beyond
    # w = shape; w is the angle within half a width, here that of the first line that aliases.
    shape = _SHAPE * np.pi * _WIDTH * (1 - (n_lines - 1) * _DECIMATION / length)
    n_taps = _DECIMATION * _WIDTH
    place = (2 * np.arange(n_taps) + 1) / n_taps - 1
    taps = np.i0(shape * np.sqrt(1 - place**2)) / np.i0(shape)
    response = fft.rfft(taps, length)[:n_lines]
    gains = _DECIMATION**2 / (response.real**2 + response.imag**2)
    return taps, gains, length // _DECIMATION


@compiled
def _mean(part, wanted):
    total = 0.0
    if wanted:
        for i in range(len(part)):
            total += part[i]
    return total / len(part)


@compiled
def _window(part, mean, window, segment):
    for i in range(len(window)):
        segment[i] = (part[i] - mean) * window[i]


@compiled
def set_segments(signals, first, step, window, remove_mean, taps, segments):
    length = len(window)
    overhang = 0 if taps is None else len(taps) - _DECIMATION
    whole = np.empty(length + overhang)
    for c in range(len(signals)):
        for s in range(segments.shape[1]):
            part = signals[c, first + s * step :][:length]
            mean = _mean(part, remove_mean)
            if taps is None:
                _window(part, mean, window, segments[c, s])
            else:
                _window(part, mean, window, whole)
                whole[length:] = whole[:overhang]
                _keep_every_fourth(whole, taps, segments[c, s])


@compiled
def _keep_every_fourth(segment, taps, output):
    for j in range(0, len(output), 8):
        j = min(j, len(output) - 8)
        part, kept = segment[4 * j : 4 * j + len(taps) + 28], output[j : j + 8]
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
        for k in range(len(taps)):  # eight sums, so that a tap and a sample are loaded once for all
            tap = taps[k]
            s0 += tap * part[k]
            s1 += tap * part[k + 4]
            s2 += tap * part[k + 8]
            s3 += tap * part[k + 12]
            s4 += tap * part[k + 16]
            s5 += tap * part[k + 20]
            s6 += tap * part[k + 24]
            s7 += tap * part[k + 28]
        kept[0], kept[1], kept[2], kept[3] = s0, s1, s2, s3
        kept[4], kept[5], kept[6], kept[7] = s4, s5, s6, s7


@compiled
def add_powers(transforms, total):
    for c in range(len(total)):
        row = total[c]
        for s in range(transforms.shape[1]):
            lines = transforms[c, s]
            for k in range(len(row)):
                row[k] += lines[k].real * lines[k].real + lines[k].imag * lines[k].imag
