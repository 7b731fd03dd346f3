"""Spectral kurtosis: the frequencies at which a signal consists of impacts.

Sources: J. Antoni, The spectral kurtosis: a useful tool for characterising non-stationary signals,
Mech. Syst. Signal Process. 20(2), 282-307, 2006; J. Antoni, Fast computation of the kurtogram for
the detection of transient faults, Mech. Syst. Signal Process. 21(1), 108-124, 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # scipy.signal and scipy.fft are imported when they are used
from numpy.typing import ArrayLike, NDArray

from emacm._checks import check_count, check_number, check_signal
from emacm.shaft.motion import BLOCK

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Kurtogram:
    """Spectral kurtosis by width and centre of the band.

    Attributes
    ----------
    widths : tuple of float
        Width of the bands of each level [Hz], from wide to narrow.
    centres : tuple of ndarray of shape (n_bands,)
        Centres of the bands of each level [Hz].
    kurtosis : tuple of ndarray of shape (n_bands,)
        Spectral kurtosis of each band; 0 for stationary Gaussian noise, -1 for a tone.
    band : (float, float)
        Edges of the band with the largest kurtosis [Hz].
    """

    widths: tuple[float, ...]
    centres: tuple[Array, ...]
    kurtosis: tuple[Array, ...]

    @property
    def fs(self) -> float:
        """Sampling rate [Hz]."""
        return 2 * float(self.centres[0][-1] + self.centres[0][0])  # they are symmetrical

    @property
    def band(self) -> tuple[float, float]:
        """Edges of the band with the largest kurtosis [Hz]; of equal ones, the widest."""
        level = int(np.argmax([values.max() for values in self.kurtosis]))
        centre = float(self.centres[level][self.kurtosis[level].argmax()])
        half = self.widths[level] / 2
        return centre - half, centre + half


def kurtogram(signal: ArrayLike, fs: float) -> Kurtogram:
    """Return the spectral kurtosis of bands of several widths [1]_.

    The bands are fs/8, fs/12, fs/16, fs/24, ... wide: as many widths as have 64 values in each
    band, at most 9.

    Parameters
    ----------
    signal : array-like of shape (n_times,)
        Signal at uniform times, in any unit.
    fs : float
        Its sampling rate [Hz].

    Returns
    -------
    Kurtogram

    Raises
    ------
    TypeError, ValueError
        If the signal is not finite, too short, or has no power.

    See Also
    --------
    emacm.spectral_kurtosis : At each frequency, with one window.
    emacm.EnvelopeDetector : The envelope of the band found.

    Notes
    -----
    The kurtosis of the complex envelope y of a band is mean(\\|y\\|⁴) / mean(\\|y\\|²)² - 2.
    The signal is divided by a uniform filter bank into bands of equal width that overlap by half;
    bands that touch 0 or half the sampling rate are left out.

    References
    ----------
    .. [1] J. Antoni, Mech. Syst. Signal Process. 21(1), 108-124, 2007.

    Examples
    --------
    >>> import numpy as np
    >>> ring = np.exp(-np.arange(80) / 12) * np.sin(2 * np.pi * 0.3 * np.arange(80))
    >>> struck = np.zeros(20_000)
    >>> struck[::500] = 1.0
    >>> noise = np.random.default_rng(0).standard_normal(20_000)
    >>> low, high = kurtogram(np.convolve(struck, ring)[:20_000] + 0.1 * noise, 10_000).band
    >>> low < 3000 < high
    True
    """
    fs = check_number(fs, "fs", above=0, unit="Hz")
    values = check_signal(signal, "signal")
    n_taps = 8  # of the filter of a band, times the number of bands
    most, fewest = 9, 64  # levels; values of a band: of fewer, kurtosis is chance
    halves = [2 ** (k // 2) * (8, 12)[k % 2] for k in range(most)]
    halves = [n for n in halves if len(values) >= (fewest + 2 * n_taps) * n / 2]
    if not halves:
        raise ValueError(
            f"the signal has {len(values)} samples; a kurtogram needs at least "
            f"{(fewest + 2 * n_taps) * 4}. Give a longer recording or a band."
        )
    # Bands of width fs / n, at multiples of half of it from one.
    taps = {n: scipy.signal.firwin(n_taps * n, 0.5, fs=n) for n in halves}
    kurtosis = [_kurtosis(values, taps[n], n // 2, 2 * n, slice(2, -2)) for n in halves]
    centres = tuple(fs / n * (np.arange(len(kurtosis[k])) / 2 + 1) for k, n in enumerate(halves))
    return Kurtogram(tuple(fs / n for n in halves), centres, tuple(kurtosis))


def spectral_kurtosis(
    signal: ArrayLike, fs: float, *, n_per_segment: int = 256
) -> tuple[Array, Array]:
    """Return the kurtosis of the short-time Fourier transform at each frequency [1]_.

    Parameters
    ----------
    signal : array-like of shape (n_times,)
        Signal at uniform times, in any unit.
    fs : float
        Its sampling rate [Hz].
    n_per_segment : int
        Samples of a segment (Hann window, overlapping by three quarters); shorter than the time
        between two impacts.

    Returns
    -------
    frequencies : ndarray of shape (n_frequencies,)
        [Hz], without 0 and half the sampling rate, where the transform is real.
    kurtosis : ndarray of shape (n_frequencies,)
        mean(\\|Y\\|⁴) / mean(\\|Y\\|²)² - 2: 0 for stationary Gaussian noise, -1 for a tone.

    Raises
    ------
    TypeError, ValueError
        If the signal is not finite, has no power at a frequency, or is shorter than 8 segments.

    See Also
    --------
    emacm.kurtogram : Over bands of several widths.

    References
    ----------
    .. [1] J. Antoni, Mech. Syst. Signal Process. 20(2), 282-307, 2006.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(0).standard_normal(200_000)
    >>> frequencies, kurtosis = spectral_kurtosis(noise, 10_000.0)
    >>> bool(abs(kurtosis.mean()) < 0.02)
    True
    """
    fs = check_number(fs, "fs", above=0, unit="Hz")
    values = check_signal(signal, "signal")
    check_count(n_per_segment, "n_per_segment", at_least=8)
    if len(values) < 8 * n_per_segment:
        raise ValueError(
            f"8 segments of {n_per_segment} exceed {len(values)} samples. Lower n_per_segment."
        )
    window = scipy.signal.get_window("hann", n_per_segment)
    inner = slice(1, -(-n_per_segment // 2))
    frequencies = np.arange(inner.stop) * fs / n_per_segment
    return frequencies[1:], _kurtosis(values, window, n_per_segment // 4, n_per_segment, inner)


def _kurtosis(signal: Any, window: Array, hop: int, n_folded: int, inner: slice) -> Array:
    """Return mean(|Y|^4) / mean(|Y|^2)^2 - 2 of some Fourier coefficients Y of windowed frames.

    A frame begins every `hop` samples, and is folded to `n_folded` samples.
    """
    n_frames = 1 + (len(signal) - len(window)) // hop
    moments = np.zeros((2, n_folded // 2 + 1))
    at_once = max(1, BLOCK // hop)
    for first in range(0, n_frames, at_once):
        last = min(first + at_once, n_frames)
        part = np.asarray(signal[first * hop : (last - 1) * hop + len(window)], np.float64)
        frames = np.lib.stride_tricks.sliding_window_view(part, len(window))[::hop] * window
        lines = scipy.fft.rfft(frames.reshape(last - first, -1, n_folded).sum(axis=1))
        power = lines.real**2 + lines.imag**2
        moments += np.stack([power.sum(axis=0), (power**2).sum(axis=0)])
    second, fourth = moments[:, inner]
    if not second.all():
        raise ValueError(
            "the signal has no power at some frequencies. Leave the channel out, or give a band."
        )
    return n_frames * fourth / second**2 - 2
