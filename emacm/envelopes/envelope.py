"""The envelope of a band of frequencies, over time.

Each impact of a damaged bearing excites a resonance of the housing. The frequency of the resonance
is a property of the housing; the repetition rate of the impacts is a property of the bearing. The
spectrum of the envelope of the resonance band has lines at the repetition rate. The envelope is
computed over time, because the resonance has a constant frequency, and before the signal is
resampled over the shaft angle, in which the repetition rate is constant.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy  # which imports scipy.signal, a tenth of a second, when it is used
from numpy.typing import NDArray

from emacm._checks import check_choice, check_number
from emacm._statements import warn
from emacm.envelopes.prewhitening import WhitenedSeries
from emacm.recordings.recording import ComputedSeries
from emacm.shaft.motion import BLOCK, Series, mirrored

Band = tuple[float, float]


def check_band(band: Any, fs: float | None = None, name: str = "band") -> Band:
    """Return a band as two frequencies, after checking it against the Nyquist frequency.

    Parameters
    ----------
    band : (low, high)
        Edges [Hz].
    fs : float, optional
        Sampling rate [Hz].
    name : str
        What to call the band in a message.

    Returns
    -------
    (float, float)

    Raises
    ------
    TypeError
        If it is not a pair of numbers.
    ValueError
        If low is not between 0 and high, or high not below ``fs / 2``.
    """
    if isinstance(band, str | dict) or not np.iterable(band) or len(list(band)) != 2:
        raise TypeError(f"{name} must be a pair (low, high) of frequencies in Hz, got {band!r}.")
    low, high = (check_number(edge, f"edges of {name}", above=0, unit="Hz") for edge in band)
    if not low < high:
        raise ValueError(f"{name} must run from a lower to a higher frequency, got {band!r}.")
    if fs is not None and not high < fs / 2:
        raise ValueError(
            f"{name} reaches to {high:g} Hz, but at a sampling rate of {fs:g} Hz the Nyquist "
            f"frequency is {fs / 2:g} Hz. Lower its upper edge."
        )
    return low, high


def check_bands(band: Any) -> Any:
    """Return a band, a list of bands, "full" or "kurtogram", after checking them.

    Examples
    --------
    >>> check_bands((200, 900)), check_bands([(200, 900), (900, 2000)])
    ((200.0, 900.0), [(200.0, 900.0), (900.0, 2000.0)])
    """
    if isinstance(band, str):
        return check_choice(band, "band", ("full", "kurtogram"))
    entries = list(band) if np.iterable(band) else []
    if not entries or not all(map(np.iterable, entries)):
        return check_band(band)
    return [check_band(entry, name=f"band {i}") for i, entry in enumerate(entries)]


def kaiser_order(low: float, high: float, fs: float) -> tuple[int, float]:
    """Return the number of taps, an odd number, and the shape of the window of a filter.

    It attenuates by 80 dB outside of the band and its transitions.

    Parameters
    ----------
    low, high : float
        Edges of the band [Hz].
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    n_taps : int
    beta : float
        Shape parameter of the Kaiser window.

    Examples
    --------
    >>> kaiser_order(2000.0, 6000.0, 48_000.0)[0]
    243
    """
    half = min((high - low) / 8, low, fs / 2 - high)  # of a transition, on either side of an edge
    n_taps, beta = scipy.signal.kaiserord(80.0, 4 * half / fs)
    return n_taps | 1, beta


def analytic_filter(low: float, high: float, fs: float) -> NDArray[np.complexfloating]:
    """Return the taps of a filter that makes the analytic signal of a band.

    A low-pass filter with a Kaiser window [1]_, shifted to the centre of the band. The filter has
    no delay (its middle tap is at time 0). Its amplitude is one half at the edges of the band, one
    from an eighth of the bandwidth inside the edges, and below -80 dB from an eighth of the
    bandwidth outside. The transitions are narrower if an edge is close to 0 or to the Nyquist
    frequency. A constant is removed.

    Parameters
    ----------
    low, high : float
        Edges of the band [Hz].
    fs : float
        Sampling rate [Hz].

    Returns
    -------
    ndarray of shape (n_taps,), complex
        `n_taps` is that of `kaiser_order`.

    References
    ----------
    .. [1] A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, 3rd ed., 2010,
       section 7.6.

    Examples
    --------
    >>> taps = analytic_filter(2000.0, 6000.0, 48_000.0)
    >>> bool(abs(taps.sum()) < 1e-12)
    True
    """
    n_taps, beta = kaiser_order(low, high, fs)
    times = np.arange(n_taps) - n_taps // 2
    window = scipy.signal.get_window(("kaiser", beta), n_taps, fftbins=False)
    width = (high - low) / fs
    carrier = np.exp(1j * np.pi * (low + high) / fs * times)
    taps = 2 * width * np.sinc(width * times) * window * carrier
    taps -= window * (taps.sum() / window.sum())  # of a large offset, 80 dB down were too much
    return taps


class EnvelopeSeries(ComputedSeries):
    """The envelope of a band of a signal: the magnitude of its analytic signal [1]_.

    It is computed slice by slice when it is read. The filter has no delay. Beyond its ends the
    signal is extended by its mirror image. Values nearer to an end than half the filter length,
    10 / (high - low) seconds, are therefore inaccurate. (Half the filter length is 2.5 divided by
    the width of a transition, which is a quarter of the bandwidth.)

    Parameters
    ----------
    signal : ndarray of shape (n_times,), or an object that can be sliced like one
        Finite; it may be a memory map.
    fs : float
        Its sampling rate [Hz].
    band : (low, high)
        Edges of the band [Hz], where half of the amplitude passes.
    squared : bool
        The squared envelope [U²], in which periodic impacts have few lines and noise only adds a
        constant level; otherwise the envelope itself [U]. Of a tone of amplitude A in the band: A²,
        or A.

    Attributes
    ----------
    reach : int
        Samples to either side that a value depends on.
    bandwidth : float
        Width of the band: the frequency up to which a squared envelope has content [Hz].

    Raises
    ------
    TypeError, ValueError
        If the band is not below the Nyquist frequency, or its filter is longer than the signal.

    References
    ----------
    .. [1] R. B. Randall and J. Antoni, Mech. Syst. Signal Process. 25(2), 485-520, 2011.

    Examples
    --------
    >>> tone = 3 * np.sin(2 * np.pi * 4000 * np.arange(4800) / 48_000)
    >>> round(float(EnvelopeSeries(tone, 48_000, (2000, 6000))[2400]), 2)
    9.0
    """

    def __init__(self, signal: Series, fs: float, band: Band, *, squared: bool = True) -> None:
        super().__init__(signal)
        low, high = check_band(band, fs)
        n_taps, _ = kaiser_order(low, high, fs)
        if n_taps > len(signal):
            raise ValueError(
                f"the band {low:g} to {high:g} Hz needs a filter of {n_taps / fs:.3g} s, but the "
                f"signal lasts {len(signal) / fs:.3g} s. Make the band wider, and keep its edges "
                f"away from 0 and {fs / 2:g} Hz."
            )
        self._fs, self._band, self.squared = fs, (low, high), squared
        self.bandwidth = high - low
        taps = analytic_filter(low, high, fs)
        self._taps = taps.astype(np.result_type(self.dtype, np.complex64), copy=False)
        self.reach = n_taps // 2
        # A prewhitened signal passes the filter while it is a spectrum.
        self._whitened: WhitenedSeries | None = None
        if isinstance(signal, WhitenedSeries) and 2 * self.reach <= signal.fade:
            self._whitened = WhitenedSeries(signal._signal, fs, taps)

    def __repr__(self) -> str:
        """Band and kind, of which digests are made."""
        return self._described(self._fs, self._band, self.squared)

    def read(self, start: int, stop: int) -> NDArray[np.floating]:
        """Return the envelope at samples `start` to `stop` (exclusive)."""
        values = np.empty(stop - start, self.dtype)
        at_once = max(BLOCK, 2 * len(self._taps))
        for first in range(start, stop, at_once):
            last = min(first + at_once, stop)
            if self._whitened is not None:
                analytic: Any = self._whitened.read(first, last)
            else:
                near: Any = mirrored(self._signal, first - self.reach, last + self.reach)
                analytic = scipy.signal.oaconvolve(near, self._taps, mode="valid")
            size = analytic.real**2 + analytic.imag**2 if self.squared else np.abs(analytic)
            values[first - start : last - start] = size
        return values


def warn_of_long_filter(low: float, high: float, fs: float) -> None:
    """Warn if an edge near 0 or half the sampling rate makes the filter five times as long."""
    usual = (high - low) / 8  # distance from 0 and half the sampling rate
    times = usual / min(usual, low, fs / 2 - high)
    if times > 5:
        warn(
            "filter",
            f"the band {low:g} to {high:g} Hz is so near to 0 or half the sampling rate that its "
            f"filter lasts {kaiser_order(low, high, fs)[0] / fs:.3g} s, {times:.3g} times as long "
            f"as its width requires; impacts are smeared by as much. Keep it within {usual:.3g} "
            f"and {fs / 2 - usual:.6g} Hz.",
            stacklevel=2,
        )
