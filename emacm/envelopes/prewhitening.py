"""Cepstral prewhitening: all frequencies of a signal are set to one level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy  # scipy.fft is imported when it is used
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted

from emacm.recordings.inputs import RecordingTransformer, as_recordings, for_each
from emacm.recordings.names import check_channel_names, chosen_channels
from emacm.recordings.recording import ComputedSeries, Recording
from emacm.shaft.motion import Series, mirrored


class WhitenedSeries(ComputedSeries):
    """A prewhitened signal of any length, computed segment by segment when it is read.

    Parameters
    ----------
    signal : ndarray of shape (n_times,), or an object that can be sliced like one
        Finite; it may be a memory map.
    fs : float
        Its sampling rate [Hz].
    taps : ndarray of shape (n_taps,), optional
        A filter without delay of an analytic signal, which reaches no further than half of `fade`:
        no end of a segment reaches its beginning. Each spectrum is multiplied by its gain before it
        is transformed back: two transforms and not four. Where segments overlap, they fade after
        the filter, not before it.

    Attributes
    ----------
    fade : int
        Samples within which a segment fades over into the next one.
    """

    def __init__(
        self, signal: Series, fs: float, taps: NDArray[np.complexfloating] | None = None
    ) -> None:
        super().__init__(signal)
        self._fs = fs
        # One segment begins every `_hop` samples, `fade` before that.
        self.fade, self._hop = _segments(len(self), fs)
        # The taper before and after whitening: squares of two that overlap add up to one.
        places = (np.arange(self.fade) + 0.5) / max(self.fade, 1)
        self._rise = np.sin(np.pi / 2 * places).astype(self.dtype)
        self._gain: NDArray[np.floating] | None = None
        if taps is not None:
            n_times = self._hop + self.fade
            # Real, because the filter has no delay.
            gain = scipy.fft.hfft(taps[len(taps) // 2 :], n_times)[: n_times // 2 + 1]
            self._gain = gain.astype(self.dtype)
            self.dtype = np.result_type(self.dtype, np.complex64)

    def __repr__(self) -> str:
        """Return class and sampling rate, of which digests are made."""
        return self._described(self._fs)

    def read(self, start: int, stop: int) -> NDArray[Any]:
        """Return the whitened signal at samples `start` to `stop` (exclusive)."""
        fade, hop = self.fade, self._hop
        begin = start // hop * hop - fade
        end = ((stop - 1 + fade) // hop + 1) * hop
        near = mirrored(self._signal, begin, end)
        segments = np.lib.stride_tricks.sliding_window_view(near, hop + fade)[::hop]
        levels = segments.mean(axis=1, dtype=np.float64)
        segments = segments - levels.astype(near.dtype)[:, np.newaxis]
        # Without a taper, the cut ends of a strong tone would be impacts.
        self._fade_ends(segments)
        rms = np.sqrt(1 - fade / (hop + fade))
        white: Any = whiten(segments, levels, rms=rms, gain=self._gain)
        self._fade_ends(white)
        white[1:, :fade] += white[:-1, hop:]
        return white[:, :hop].ravel()[start - begin : stop - begin]

    def _fade_ends(self, segments: NDArray[Any]) -> None:
        """Let the ends of segments rise from 0 and fall to 0, in place."""
        segments[:, : self.fade] *= self._rise
        segments[:, self._hop :] *= self._rise[::-1]


def _segments(n_times: int, fs: float) -> tuple[int, int]:
    """Return by how many samples segments overlap, and from one beginning to the next.

    A segment has the power of two of samples nearest to 0.5 s, at least 256, so that lines some Hz
    apart are separated; it fades within a sixteenth of its length. If there are at most four, they
    are made equally long: otherwise much of the last one may be a mirror image.
    """
    n_segment = max(256, 1 << round(np.log2(max(0.5 * fs, 1))))
    fade = n_segment // 16
    count = -(-(n_times + fade) // (n_segment - fade))
    if count <= 4:
        fade = n_times // (15 * count - 1)
        hop = -(-(n_times + fade) // count)
        n_segment = 2 * scipy.fft.next_fast_len(-(-(hop + fade) // 2), real=True)
    return fade, n_segment - fade


def whiten(
    segments: NDArray[np.floating],
    removed: ArrayLike = 0.0,
    *,
    rms: float = 1.0,
    gain: NDArray[np.floating] | None = None,
) -> NDArray[np.inexact]:
    """Return segments whose Fourier coefficients all have the same magnitude [1]_.

    Parameters
    ----------
    segments : ndarray of shape (n_times,) or (n_segments, n_times)
        Finite signals, in any unit.
    removed : float, or array-like of shape (n_segments,)
        Constants that were subtracted from them; they left rounding errors.
    rms : float
        Root mean square of the result.
    gain : ndarray of shape (n_times // 2 + 1,), optional
        Gain of a filter without delay at the frequencies from 0 to half the sampling rate; the
        result is then an analytic signal, without negative frequencies and half the sampling rate.
        `n_times` is even.

    Returns
    -------
    ndarray of the same shape
        Without unit, with mean 0; coefficients of no more than rounding errors are set to 0. Of the
        precision of the segments; complex with a gain.

    References
    ----------
    .. [1] P. Borghesani, P. Pennacchi, R. B. Randall, N. Sawalhi and R. Ricci, Mech. Syst. Signal
       Process. 36(2), 370-384, 2013: all of the real cepstrum but its first value is set to 0,
       that is, X / \\|X\\|.

    Examples
    --------
    >>> import numpy as np
    >>> tone = 40 * np.sin(2 * np.pi * 0.1 * np.arange(1000))
    >>> noise = np.random.default_rng(0).standard_normal(1000)
    >>> magnitude = abs(np.fft.rfft(whiten(tone + noise)))
    >>> print(round(magnitude[100] / magnitude[37], 9))  # that of the tone beside another one
    1.0
    """
    n_times = segments.shape[-1]
    lines = scipy.fft.rfft(segments)
    lines[..., 0] = 0  # the mean is no vibration
    power = lines.real**2 + lines.imag**2
    # Rounding leaves some 8 times the resolution of the type beside the largest line.
    resolution = 8 * np.finfo(segments.dtype).eps
    largest = np.maximum(power.max(axis=-1), n_times * np.asarray(removed) ** 2)
    power[power <= resolution**2 * largest[..., np.newaxis]] = np.inf
    lines *= np.divide(rms, np.sqrt(power, out=power), out=power)
    if gain is None:
        return scipy.fft.irfft(lines, n_times, norm="ortho", overwrite_x=True)
    positive = np.zeros(segments.shape, lines.dtype)
    positive[..., : n_times // 2] = lines[..., :-1] * gain[:-1]
    return scipy.fft.ifft(positive, norm="ortho", overwrite_x=True)


class CepstralPrewhitening(  # type: ignore[call-arg]
    RecordingTransformer, auto_wrap_output_keys=None
):
    """Set all frequencies of the signals to one level, so that no band has to be selected.

    Put it before `EnvelopeDetector`. The lines of shafts and gears and the resonances of the
    housing are reduced to the level of the noise; the impacts of a damaged bearing, which cover
    all frequencies, remain [1]_.

    Parameters
    ----------
    channels : sequence of str, optional
        Channels that are whitened. Default: all of the first recording.

    Attributes
    ----------
    channels_ : tuple of str
        Channels of the result.
    whitened_ : tuple of str
        Channels that are whitened.

    See Also
    --------
    emacm.EnvelopeDetector : The step after.

    Notes
    -----
    `X` is a list of `Recording`, and so is the result, with the same shaft and meta. The signals
    are computed when they are read, in segments of a power of two of samples, 0.35 to 0.71 s
    long. Each is tapered within a sixteenth of its length at both ends, divided by the magnitude
    of its Fourier transform, tapered again and added to its neighbours (weighted overlap-add).
    Segments of time are used, and not of shaft angle, because resonances are at fixed frequencies
    and because the envelope is taken before the signal is resampled. While the speed changes, a
    harmonic of the shaft is spread over several frequencies of a segment and each of them is set to
    the common level. If the whole recording were whitened at once, each event would affect all
    samples, and a long recording would not fit into memory. A recording that is shorter than a
    segment is one segment; up to four segments are made equally long, at least 0.17 s. Beyond its
    ends the signal is extended by its mirror image.

    The result has no unit and a mean square of 1. It does not depend on the gain of the channel.
    Frequencies with nothing but rounding errors, such as those removed by a filter in 64-bit
    arithmetic, stay without power.

    References
    ----------
    .. [1] P. Borghesani, P. Pennacchi, R. B. Randall, N. Sawalhi and R. Ricci, Application of
       cepstrum pre-whitening for the diagnosis of bearing faults under variable speed conditions,
       Mech. Syst. Signal Process. 36(2), 370-384, 2013.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import CepstralPrewhitening, Recording
    >>> t = np.arange(20_000) / 10_000
    >>> noise = np.random.default_rng(0).standard_normal(len(t))
    >>> signal = 100 * np.sin(2 * np.pi * 50 * t) + noise
    >>> run = Recording({"vibration": signal}, 10_000, velocity=60.0 + 0 * t)
    >>> (white,) = CepstralPrewhitening().fit_transform([run])
    >>> round(float(white.signals["vibration"].std()), 1)
    1.0
    """

    def __init__(self, *, channels: Sequence[str] | None = None) -> None:
        self.channels = channels

    def fit(self, X: Any, y: Any = None) -> CepstralPrewhitening:
        """Learn the channels; nothing is computed.

        Parameters
        ----------
        X : list of Recording
            Recordings.
        y : ignored

        Returns
        -------
        CepstralPrewhitening
            Itself.

        Raises
        ------
        TypeError, ValueError
            If X is not a list of recordings, or a recording lacks a channel; the message gives
            both.
        """
        recordings = as_recordings(X, "CepstralPrewhitening")
        self.whitened_ = chosen_channels(self.channels, recordings[0].channels)
        self.channels_ = for_each(self._whitened, recordings)[0].channels
        return self

    def transform(self, X: Any) -> list[Recording]:
        """Return the recordings with whitened channels, to be computed when read.

        Parameters
        ----------
        X : list of Recording
            Recordings that have the channels of `whitened_`.

        Returns
        -------
        list of Recording
            One for each recording.

        Raises
        ------
        TypeError, ValueError
            As for `fit`.
        """
        check_is_fitted(self)
        return for_each(self._whitened, as_recordings(X, "CepstralPrewhitening"))

    def _whitened(self, recording: Recording) -> Recording:
        check_channel_names(recording.channels, self.whitened_)
        return recording._derived(_whitened_content, self.whitened_)


def _whitened_content(measured: Recording, names: tuple[str, ...]) -> dict[str, Any]:
    """Return what changes in a recording of which channels are whitened."""
    whitened = {name: WhitenedSeries(measured.series[name], measured.fs[name]) for name in names}
    units = dict(measured.units) | dict.fromkeys(names, "1")
    return {"_series": dict(measured.series) | whitened, "_units": units}
