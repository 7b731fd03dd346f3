"""Envelopes of bands of frequencies, before recordings are resampled over the shaft angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, located
from emacm.envelopes.envelope import EnvelopeSeries, check_bands, warn_of_long_filter
from emacm.envelopes.kurtogram import kurtogram
from emacm.recordings.inputs import RecordingTransformer, as_recordings, for_each
from emacm.recordings.names import check_channel_names, chosen_channels
from emacm.recordings.recording import Recording
from emacm.shaft.motion import Series


class EnvelopeDetector(RecordingTransformer, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Compute the envelope of a frequency band in which the impacts of a fault excite a resonance.

    Put it before `OrderResampler`: `OrderPSD` then computes the (squared) envelope order spectrum,
    in which a damaged bearing has lines at its fault orders.

    Parameters
    ----------
    band : (low, high), list of (low, high), "full" or "kurtogram"
        Edges of the band [Hz], where half of the amplitude passes. Of several bands, each envelope
        is a channel of its own, such as "sound_500-1500Hz". "full": 1/32 to 15/32 of the sampling
        rate, for signals after `CepstralPrewhitening`. "kurtogram": for each recording the band
        with the largest spectral kurtosis (`kurtogram`); its signals are read in `transform`.
    channels : sequence of str, optional
        Channels whose envelope is computed; the others are kept, for a second `EnvelopeDetector`
        with another band, say. Default: all of the first recording.
    squared : bool
        Squared envelopes [U²], or envelopes [U].

    Attributes
    ----------
    bands_ : dict of str to (low, high), list of (low, high) or str
        Band of each channel [Hz].
    channels_ : tuple of str
        Channels of the result.

    See Also
    --------
    emacm.kurtogram : The band with the most impulsive signal.
    emacm.CepstralPrewhitening : The step before, for machines with strong shaft lines.
    emacm.bearing_recipe : Both in a pipeline.

    Notes
    -----
    `X` is a list of `Recording`, and so is the result, with the same shaft and meta. Envelopes are
    computed slice by slice when they are read, and are not kept.

    The filter has no delay. A value depends on the signal within 10 / (high - low) seconds. Near
    the ends of a recording, where the signal is extended by its mirror image, envelopes are
    therefore inaccurate, and a reversal of the shaft is smeared over this time. The time is longer
    if an edge is nearer than an eighth of the bandwidth to 0 or to the Nyquist frequency.

    Of a channel that `CepstralPrewhitening` whitens, the band is filtered in the spectra of the
    whitened segments, if the filter is not longer than the part in which segments overlap (0.02 to
    0.04 s). Prewhitening then takes little additional time. The envelope differs from that of the
    whitened signal, on the root mean square, by up to 0.5 % for "full" and by up to 3 % for a
    filter of that length; within half the filter length of the ends it differs more.

    A squared envelope contains frequencies up to high - low [Hz]: while the shaft turns at f rev/s,
    it has no content above order (high - low) / f.

    Source: Randall and Antoni, Mech. Syst. Signal Process. 25(2), 485-520, 2011.

    Examples
    --------
    >>> import numpy as np
    >>> from emacm import EnvelopeDetector, OrderPSD, OrderResampler, Recording
    >>> from sklearn.pipeline import make_pipeline
    >>> t = np.arange(40_000) / 10_000
    >>> ringing = (1 + np.cos(3.1 * 60 * t)) * np.sin(2 * np.pi * 2000 * t)
    >>> run = Recording({"sound": ringing}, 10_000, velocity=np.full(40_000, 60.0))
    >>> spectrum = make_pipeline(
    ...     EnvelopeDetector((1500, 2500)), OrderResampler(), OrderPSD(10, max_order=20)
    ... )
    >>> spectrum.fit_transform([run]).columns[31], int(spectrum.transform([run]).argmax())
    ('sound@3.1', 31)
    """

    def __init__(
        self, band: Any, *, channels: Sequence[str] | None = None, squared: bool = True
    ) -> None:
        self.band = band
        self.channels = channels
        self.squared = squared

    def fit(self, X: Any, y: Any = None) -> EnvelopeDetector:
        """Learn which channels have which band; nothing is computed.

        Parameters
        ----------
        X : list of Recording
            Recordings.
        y : ignored

        Returns
        -------
        EnvelopeDetector
            Itself.

        Raises
        ------
        TypeError, ValueError
            If a parameter is invalid, or a recording lacks a channel or its sampling rate is too
            low for a band; the message names both.
        """
        recordings = as_recordings(X, "EnvelopeDetector")
        check_choice(self.squared, "squared", (True, False))
        chosen = chosen_channels(self.channels, recordings[0].channels)
        self.bands_ = dict.fromkeys(chosen, check_bands(self.band))
        # The names of the channels do not depend on the band that a kurtogram selects.
        self.channels_ = for_each(partial(self._detected, select=False), recordings)[0].channels
        return self

    def transform(self, X: Any) -> list[Recording]:
        """Return the recordings with their envelopes, to be computed when read.

        Parameters
        ----------
        X : list of Recording
            Recordings that have the channels of `bands_`.

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
        return for_each(self._detected, as_recordings(X, "EnvelopeDetector"))

    def _detected(self, recording: Recording, *, select: bool = True) -> Recording:
        bands = dict(self.bands_)
        check_channel_names(recording.channels, list(bands))
        for channel in [c for c, band in bands.items() if select and band == "kurtogram"]:
            with located(f"channel {channel!r}"):
                bands[channel] = kurtogram(recording.signals[channel], recording.fs[channel]).band
        return recording._derived(_envelope_content, bands, bool(self.squared))


def _envelope_content(
    measured: Recording, bands: Mapping[str, Any], squared: bool
) -> dict[str, Any]:
    """Return what changes in a recording of which envelopes are taken."""
    found: dict[str, Series] = {}
    rates: dict[str, float] = {}
    for channel, signal in measured.series.items():
        fs, band = measured.fs[channel], bands.get(channel)
        if band is None:
            found[channel], rates[channel] = signal, fs
            continue
        if isinstance(band, str):
            band = fs / 32, 15 * fs / 32  # the widest that has a short filter
        with located(f"channel {channel!r}"):
            edges = band if isinstance(band, list) else [band]
            for name, (low, high) in zip(envelope_names(channel, band), edges, strict=True):
                found[name] = EnvelopeSeries(signal, fs, (low, high), squared=squared)
                rates[name] = fs
                warn_of_long_filter(low, high, fs)
    return {"_series": found, "_fs": rates}


def envelope_names(channel: str, band: Any) -> list[str]:
    """Return the names of the envelopes of a channel.

    Examples
    --------
    >>> envelope_names("sound", [(500.0, 1500.0)]), envelope_names("sound", "full")
    (['sound_500-1500Hz'], ['sound'])
    """
    if not isinstance(band, list):
        return [channel]
    return [f"{channel}_{low:g}-{high:g}Hz" for low, high in band]
