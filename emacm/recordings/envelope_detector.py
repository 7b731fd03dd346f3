"""Envelopes of bands of frequencies, before recordings are resampled over the shaft angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from sklearn.utils.validation import check_is_fitted

from emacm._checks import check_choice, located
from emacm.recordings.envelope import Band, check_band, envelope_recording
from emacm.recordings.inputs import as_recordings, chosen_channels, described
from emacm.recordings.recording import Recording
from emacm.recordings.transformer import RecordingTransformer


class EnvelopeDetector(RecordingTransformer, auto_wrap_output_keys=None):  # type: ignore[call-arg]
    """Take the envelope of a band of frequencies, in which a fault makes a resonance ring.

    Put it before `OrderResampler`: what `OrderPSD` then gives is the (squared) envelope spectrum
    over orders, in which a damaged bearing has its fault orders.

    Parameters
    ----------
    band : (low, high) or mapping of str to (low, high)
        Edges of the band [Hz], where half of the amplitude passes, or a band for each channel by
        name.
    channels : sequence of str, optional
        Channels of which the envelope is taken. Default: all of the first recording, or all that
        `band` names.
    squared : bool
        Squared envelopes [U²], or envelopes [U].
    suffix : str, optional
        Stand beside the measured channel, under its name with this behind it
        (such as "_envelope"). Default: envelopes take the place and the name of their channels.

    Attributes
    ----------
    bands_ : dict of str to (low, high)
        Band of each channel [Hz].
    channels_ : tuple of str
        Channels of the result.

    Notes
    -----
    `X` is a list of `Recording`. What comes out are such too, with the same shaft and meta;
    their envelopes are computed slice by slice when they are read, and not kept.

    The filter has no delay. A value depends on the signal within 10 / (high - low) seconds,
    so near the ends of a recording (where the signal is taken as its own mirror image) envelopes
    err, and a turn of the shaft is smeared by as much. It is longer where an edge is nearer
    than an eighth of the band's width to 0 or to half the sampling rate.

    A squared envelope holds frequencies up to high - low, in Hz: while the shaft turns at f rev/s,
    there is nothing above order (high - low) / f.

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
        self,
        band: Band | Mapping[str, Band],
        *,
        channels: Sequence[str] | None = None,
        squared: bool = True,
        suffix: str | None = None,
    ) -> None:
        self.band = band
        self.channels = channels
        self.squared = squared
        self.suffix = suffix

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
            If a parameter is not what it should be, or a recording lacks a channel or is sampled
            too slowly for a band; the message names both.
        """
        recordings = as_recordings(X, "EnvelopeDetector")
        check_choice(self.squared, "squared", (True, False))
        if self.suffix is not None and not (isinstance(self.suffix, str) and self.suffix):
            raise TypeError(f"suffix must be text, such as '_envelope', got {self.suffix!r}.")
        self.bands_ = self._checked_bands(recordings[0].channels)
        self.channels_ = self._detected(recordings)[0].channels
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
        return self._detected(as_recordings(X, "EnvelopeDetector"))

    def _checked_bands(self, first: Sequence[str]) -> dict[str, Band]:
        """Return the band of each channel."""
        chosen = None if self.channels is None else chosen_channels(self.channels, first)
        if not isinstance(self.band, Mapping):
            band = check_band(self.band)
            bands = dict.fromkeys(first if chosen is None else chosen, band)
        else:
            named = {name: check_band(b, name=f"band of {name!r}") for name, b in self.band.items()}
            missing = [name for name in chosen or () if name not in named]
            if missing:
                raise ValueError(f"band names no band of channel {missing[0]!r}: {self.band!r}.")
            bands = named if chosen is None else {name: named[name] for name in chosen}
        if not bands:
            raise ValueError("band must name at least one channel.")
        return bands

    def _detected(self, recordings: list[Recording]) -> list[Recording]:
        options: dict[str, Any] = {"squared": bool(self.squared), "suffix": self.suffix}
        detected = []
        for index, recording in enumerate(recordings):
            with located(partial(described, recording, index)):
                detected.append(envelope_recording(recording, self.bands_, **options))
        return detected
