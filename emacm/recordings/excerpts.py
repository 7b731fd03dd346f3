"""Parts of a recording: an interval of time, some channels, other names."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

from emacm._checks import check_number
from emacm.recordings.channel_names import check_channel_names, chosen_channels

if TYPE_CHECKING:
    from emacm.recordings.recording import Recording

_ROUNDING = 1e-6  # samples, by which a time in seconds may miss a sample


class Excerpts:
    """Methods of a recording that return parts of it."""

    __slots__ = ()

    def cut(self, start: float = 0.0, stop: float | None = None) -> Recording:
        """Return the part of the recording from one time to another.

        Parameters
        ----------
        start : float
            Start [s]. The part begins at the first sample of the slowest channel from there on;
            the other channels begin at their samples nearest to it.
        stop : float, optional
            End [s], exclusive. Default: the end of the recording.

        Returns
        -------
        Recording
            Its time starts at 0; a cumulative shaft angle keeps its values.

        Raises
        ------
        TypeError, ValueError
            If the times are not in order within the recording, or the part has fewer than two
            samples.
        """
        return self._derived(cut_content, start, stop)

    def select(self, channels: Sequence[str]) -> Recording:
        """Return the recording with some of its channels only, in the order given.

        Raises
        ------
        TypeError, ValueError
            If `channels` is not a list of channels of the recording, each named once.
        """
        return self._derived(selected_content, channels)

    def rename(self, names: Mapping[str, str]) -> Recording:
        """Return the recording with other names for its channels, as ``{"X097_DE_time": "DE"}``.

        Raises
        ------
        TypeError, ValueError
            If a name is not a channel, a new name is not a text, or two channels get the same name.
        """
        return self._derived(renamed_content, names)

    def _derived(self, change: Callable[..., dict[str, Any]], *arguments: Any) -> Recording:
        """Return the recording with the changes of content that a function returns."""
        raise NotImplementedError


def cut_content(recording: Recording, start: Any, stop: Any) -> dict[str, Any]:
    """Return what changes in a recording that is cut, see `Recording.cut`."""
    duration = recording.duration
    begin = check_number(start, "start", at_least=0, unit="s")
    end = duration if stop is None else check_number(stop, "stop", above=0, unit="s")
    if not begin < end or end > duration * (1 + 1e-9):
        raise ValueError(
            f"start and stop must be in this order and within the recording of {duration:.9g} s, "
            f"got {start!r} and {stop!r}."
        )
    rates = {**recording.fs, "the shaft": recording.shaft_fs}
    slowest = min(rates.values())
    begin = ceil(begin * slowest - _ROUNDING) / slowest

    def part(name: str, series: Any, fs: float) -> Any:
        first, last = round(begin * fs), ceil(end * fs - _ROUNDING)
        if last - first < 2:
            raise ValueError(
                f"between {start!r} and {end:.9g} s there are {max(last - first, 0)} samples of "
                f"{name} ({fs:g} Hz); at least 2 are needed."
            )
        return series[first:last]

    series = {
        name: part(f"channel {name!r}", values, rates[name])
        for name, values in recording.series.items()
    }
    shaft = recording.angle if recording.reference == "angle" else recording.velocity
    return {"_series": series, "_shaft": part("the shaft", shaft, recording.shaft_fs)}


def selected_content(recording: Recording, channels: Any) -> dict[str, Any]:
    """Return what changes in a recording of which channels are selected."""
    chosen = chosen_channels(channels, recording.channels)
    check_channel_names(recording.channels, chosen, "the recording")
    return _by_names(recording, {name: name for name in chosen})


def renamed_content(recording: Recording, names: Any) -> dict[str, Any]:
    """Return what changes in a recording whose channels are renamed."""
    if not isinstance(names, Mapping):
        raise TypeError(f"names must map channels to new names, got {names!r}.")
    check_channel_names(recording.channels, list(names), "the recording")
    new = {name: names.get(name, name) for name in recording.channels}
    for name in new.values():
        if not isinstance(name, str) or not name:
            raise TypeError(f"channel names must be non-empty strings, got {name!r}.")
    if len(set(new.values())) < len(new):
        raise ValueError(f"two channels would have the same name: {list(new.values())}.")
    return _by_names(recording, new)


def _by_names(recording: Recording, new: Mapping[str, str]) -> dict[str, Any]:
    """Return series, rates and units of the channels in `new`, under their new names."""
    return {
        "_series": {after: recording.series[name] for name, after in new.items()},
        "_fs": {after: recording.fs[name] for name, after in new.items()},
        "_units": {after: recording.units[k] for k, after in new.items() if k in recording.units},
    }
