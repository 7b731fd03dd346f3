"""A recording some channels of which are envelopes, computed only while somebody reads them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm._checks import located
from emacm.recordings.digests import content_digest
from emacm.recordings.envelope import Band, EnvelopeSeries
from emacm.recordings.inputs import check_channel_names
from emacm.recordings.recording import Recording
from emacm.shaft.motion import Series


class EnvelopeRecording(Recording):
    """A recording with envelopes in the place of channels, or beside them.

    It holds the measured recording and the bands, not the result: `signals` computes a channel
    whenever it is read, `series` slice by slice. In all else it is as the measured recording is.

    Parameters
    ----------
    measured : Recording
        What was measured.
    bands : mapping of str to (low, high)
        Band of each channel of which an envelope is wanted [Hz].
    squared : bool
        Squared envelopes [U²], or envelopes [U].
    suffix : str, optional
        What the name of an envelope has behind that of its channel, to stand at the end, beside the
        measured one. Default: envelopes take the place of their channels.

    Raises
    ------
    TypeError, ValueError
        If there is no such channel, its sampling rate does not hold its band, or a name is
        there already. The message names the channel.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(10_000) / 10_000
    >>> run = Recording({"sound": np.sin(6000 * t)}, 10_000, velocity=np.full(10_000, 60.0))
    >>> heard = EnvelopeRecording(run, {"sound": (500, 1500)}, suffix="_envelope")
    >>> heard.channels, round(float(heard.signals["sound_envelope"][5000]), 3)
    (('sound', 'sound_envelope'), 1.0)
    """

    __slots__ = ("_bands", "_series", "_squared", "_suffix", "measured")

    _series: Mapping[str, Series]
    _bands: dict[str, Band]
    _squared: bool
    _suffix: str | None
    measured: Recording

    def __init__(
        self,
        measured: Recording,
        bands: Mapping[str, Band],
        *,
        squared: bool = True,
        suffix: str | None = None,
    ) -> None:
        state = {"measured": measured, "bands": dict(bands), "squared": squared, "suffix": suffix}
        self.__setstate__(state)

    @property
    def series(self) -> Mapping[str, Series]:
        """The channels by name, to be read slice by slice."""
        return MappingProxyType(self._series)

    def __eq__(self, other: object) -> bool:
        """Two are equal if measured recordings, bands and names are."""
        if not isinstance(other, EnvelopeRecording):
            return False
        return self._facts == other._facts and self.measured == other.measured

    __hash__ = Recording.__hash__

    def __getstate__(self) -> dict[str, Any]:
        """Return what was measured, and of which bands envelopes are wanted."""
        return {
            "measured": self.measured,
            "bands": self._bands,
            "squared": self._squared,
            "suffix": self._suffix,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Work out the channels from what was measured."""
        measured, bands, suffix = state["measured"], state["bands"], state["suffix"]
        series: dict[str, Series] = dict(measured.series)
        rates = dict(measured.fs)
        for channel, band in bands.items():
            name = channel + (suffix or "")
            _check_channel(measured, channel, name if suffix else None)
            rates[name] = measured.fs[channel]
            with located(f"channel {channel!r}"):
                series[name] = EnvelopeSeries(
                    measured.series[channel], rates[name], band, squared=state["squared"]
                )
        content = {
            "measured": measured,
            "reference": measured.reference,
            "shaft_fs": measured.shaft_fs,
            "_bands": bands,
            "_squared": state["squared"],
            "_suffix": suffix,
            "_series": series,
            "_signals": _Computed(series),
            "_fs": rates,
            "_meta": dict(measured.meta),
            "_shaft": getattr(measured, measured.reference),
            "_remembered": {},
        }
        for name, value in content.items():
            object.__setattr__(self, name, value)

    @property
    def _facts(self) -> str:
        return repr((self._bands, self._squared, self._suffix))

    def _arrays(self) -> list[NDArray[np.floating]]:
        return self.measured._arrays()

    def _digest(self) -> str:
        return content_digest(f"envelope{self._facts}{self.measured.digest}", [])


class _Computed(Mapping[str, NDArray[np.floating]]):
    """Channels, each computed as a whole when it is asked for."""

    def __init__(self, series: Mapping[str, Series]) -> None:
        self._series = series

    def __getitem__(self, name: str) -> NDArray[np.floating]:
        series = self._series[name]
        if isinstance(series, np.ndarray):
            return series
        whole = series[:]
        whole.flags.writeable = False
        return whole

    def __iter__(self) -> Iterator[str]:
        return iter(self._series)

    def __len__(self) -> int:
        return len(self._series)


def _check_channel(measured: Recording, channel: str, new: str | None) -> None:
    check_channel_names(measured.channels, [channel])
    if new in measured.channels:
        raise ValueError(f"it has a channel {new!r} already. Choose another suffix.")
