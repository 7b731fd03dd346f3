"""Vibration severity zones of ISO 20816 and ISO 10816, and velocity from acceleration.

The zones are general experience with many machines, not a diagnosis: a machine in zone A may have
a bearing fault, which hardly changes the broad-band velocity. Changes of a machine against its
own baseline say more (`emacm.monitoring.EWMA`).
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.signal import welch

from emacm._checks import check_choice, check_number, check_real_array, check_signal, located
from emacm.recordings.recording import Recording
from emacm.stroke_features.statistics import RecordingStatistics

# Standard acceleration of gravity: 9.80665 m/s2.
_TO_MM_PER_S2 = {"m/s2": 1e3, "m/s²": 1e3, "m/s^2": 1e3, "mm/s2": 1.0, "g": 9806.65}

_LARGE = ("ISO 20816-3", "above 300 kW, or shaft height from 315 mm")
_MEDIUM = ("ISO 20816-3", "15 to 300 kW, or shaft height 160 to 315 mm")
_CLASSES: dict[str, tuple[float, float, float, str, str]] = {
    "group 1 rigid": (2.3, 4.5, 7.1, *_LARGE),
    "group 1 flexible": (3.5, 7.1, 11.0, *_LARGE),
    "group 2 rigid": (1.4, 2.8, 4.5, *_MEDIUM),
    "group 2 flexible": (2.3, 4.5, 7.1, *_MEDIUM),
    "class I": (0.71, 1.8, 4.5, "ISO 10816-1", "small machines, electric motors up to 15 kW"),
    "class II": (1.12, 2.8, 7.1, "ISO 10816-1", "medium machines, motors of 15 to 75 kW"),
    "class III": (1.8, 4.5, 11.2, "ISO 10816-1", "large machines on rigid foundations"),
    "class IV": (2.8, 7.1, 18.0, "ISO 10816-1", "large machines on flexible foundations"),
}
ZONES = {
    "A": "newly commissioned machines",
    "B": "acceptable for unrestricted long-term operation",
    "C": "unsatisfactory for continuous operation over a long time",
    "D": "severe enough to cause damage",
}


def severity_zones() -> pd.DataFrame:
    """Return the boundaries of the zones by machine class.

    Returns
    -------
    DataFrame
        One row per machine class: "A/B", "B/C" and "C/D" [mm/s rms, 10 to 1000 Hz], "source" and
        "machines". The boundaries of groups 1 and 2 are those of ISO 20816-3 [1]_; those
        of classes I to IV, of ISO 10816-1 [2]_, are informative.

    References
    ----------
    .. [1] ISO 20816-3:2022, Mechanical vibration - Measurement and evaluation of machine vibration
       - Part 3: Industrial machinery with a power rating above 15 kW and operating speeds between
       120 r/min and 30 000 r/min; the values are those of ISO 10816-3:2009, Annex A.
    .. [2] ISO 10816-1:1995, Annex B (informative), Table B.1. Withdrawn; still in use for machines
       that ISO 20816-3 does not cover, such as those below 15 kW.

    Examples
    --------
    >>> severity_zones().loc["group 2 rigid", ["A/B", "B/C", "C/D"]].tolist()
    [1.4, 2.8, 4.5]
    """
    columns = ["A/B", "B/C", "C/D", "source", "machines"]
    return pd.DataFrame.from_dict(_CLASSES, orient="index", columns=columns)


def severity_zone(velocity: ArrayLike, machine_class: str) -> Any:
    """Return the zone of a broad-band vibration velocity.

    Parameters
    ----------
    velocity : float or array-like
        Velocity on a bearing housing [mm/s rms], 10 to 1000 Hz.
    machine_class : str
        Row of `severity_zones`, such as "group 2 rigid" or "class I".

    Returns
    -------
    str or ndarray of str
        "A" to "D"; a value on a boundary is in the better zone. General experience with many
        machines, not a diagnosis.

    Raises
    ------
    TypeError, ValueError
        If the class is unknown, or a velocity is negative or not finite.

    See Also
    --------
    emacm.monitoring.severity_zones : Limits of the zones.
    emacm.monitoring.vibration_severity : The RMS velocity that is rated.

    Examples
    --------
    >>> severity_zone(3.1, "group 2 rigid"), severity_zone([0.5, 30.0], "class I").tolist()
    ('C', ['A', 'D'])
    """
    check_choice(machine_class, "machine_class", tuple(_CLASSES))
    values = check_real_array(velocity, "velocity")
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ValueError(f"velocity must be finite and not negative, got {velocity!r}.")
    zones = np.array(list(ZONES))[np.searchsorted(_CLASSES[machine_class][:3], values)]
    return str(zones) if zones.ndim == 0 else zones


def vibration_velocity(
    acceleration: ArrayLike,
    fs: float,
    *,
    unit: str = "m/s2",
    band: tuple[float, float] = (10.0, 1000.0),
) -> float:
    """Return the broad-band velocity of an acceleration, integrated over frequency.

    The power spectral density of the acceleration, by Welch's method, is divided by (2 pi f)**2
    and integrated over the band. Integration over time would amplify drift and offset.

    Parameters
    ----------
    acceleration : array-like of shape (n_times,)
        Acceleration.
    fs : float
        Sampling rate [Hz].
    unit : {"m/s2", "g", "mm/s2"}
        Unit of the acceleration.
    band : (float, float)
        Lowest and highest frequency [Hz].

    Returns
    -------
    float
        Velocity [mm/s rms].

    Raises
    ------
    TypeError, ValueError
        If the signal is not finite or shorter than ten periods of the lowest frequency, or the
        band exceeds half the sampling rate.

    See Also
    --------
    emacm.monitoring.vibration_severity : Its RMS.

    Examples
    --------
    A tone of 160 Hz and 10 m/s2 has a velocity of 10 / (2 pi 160) m/s:

    >>> times = np.arange(20_000) / 5000
    >>> round(vibration_velocity(10 * np.sin(2 * np.pi * 160 * times), 5000), 2)
    7.03
    """
    signal = check_signal(acceleration, "acceleration").astype(np.float64)
    fs = check_number(fs, "fs", above=0, unit="Hz")
    check_choice(unit, "unit", tuple(_TO_MM_PER_S2))
    low = check_number(band[0], "the lowest frequency of band", above=0, unit="Hz")
    name = "the highest frequency of band, at most half the sampling rate,"
    high = check_number(band[1], name, above=low, at_most=fs / 2, unit="Hz")
    if len(signal) < 10 / low * fs:
        raise ValueError(
            f"acceleration must last at least {10 / low:g} s, ten periods of {low:g} Hz, got "
            f"{len(signal) / fs:g} s. Record longer."
        )
    n_segment = min(len(signal), round(4 * fs))  # so that lines are 1/4 Hz apart
    frequencies, density = welch(signal, fs, nperseg=n_segment, detrend="constant")
    inside = (frequencies >= low) & (frequencies <= high)
    power = np.sum(density[inside] / (2 * np.pi * frequencies[inside]) ** 2) * frequencies[1]
    return float(_TO_MM_PER_S2[unit] * np.sqrt(power))


def vibration_severity(recording: Recording, machine_class: str) -> pd.DataFrame:
    """Return velocity and zone of each acceleration channel of a recording.

    Parameters
    ----------
    recording : Recording
        With `units`: channels in "g", "m/s2" or "mm/s2" are accelerations, the others are left
        out.
    machine_class : str
        Row of `severity_zones`.

    Returns
    -------
    DataFrame
        One row per acceleration channel: "velocity" [mm/s rms], "zone", "meaning" and "source".

    Raises
    ------
    TypeError, ValueError
        If no channel is an acceleration, and as for `vibration_velocity`; the message gives the
        channel.

    See Also
    --------
    emacm.monitoring.severity_zone : The zone of ISO 20816-3.
    emacm.monitoring.vibration_indicators : With crest factor and kurtosis.

    Examples
    --------
    >>> times = np.arange(8000) / 4000
    >>> shaking = 0.5 * np.sin(2 * np.pi * 25 * times)
    >>> recording = Recording({"bearing": shaking}, 4000, velocity=157.0, units={"bearing": "g"})
    >>> vibration_severity(recording, "group 1 rigid")[["velocity", "zone"]].round(1)
             velocity zone
    bearing      22.1    D
    """
    if not isinstance(recording, Recording):
        raise TypeError(f"recording must be a Recording, got {type(recording).__name__}.")
    channels = [x for x in recording.channels if recording.units.get(x) in _TO_MM_PER_S2]
    if not channels:
        raise ValueError(
            f"no channel of {list(recording.channels)} has a unit of acceleration "
            f"({', '.join(_TO_MM_PER_S2)}); the units are {dict(recording.units)}. Give "
            f"units={{...}} to the recording."
        )
    table = pd.DataFrame({"velocity": {name: _velocity_of(recording, name) for name in channels}})
    table["zone"] = severity_zone(table["velocity"].to_numpy(), machine_class)
    table["meaning"] = table["zone"].map(ZONES)
    table["source"] = _CLASSES[machine_class][3]
    return table


def vibration_indicators(
    recording: Recording, machine_class: str | None = None, *, min_speed: float = 0.0
) -> dict[str, Any]:
    """Return RMS, crest factor and kurtosis of each channel, and velocities of accelerations.

    Parameters
    ----------
    recording : Recording
        If `units` states an acceleration ("g", "m/s2", "mm/s2"), the channel also has a velocity,
        10 to 1000 Hz, of the whole recording; the others are of the samples in strokes.
    machine_class : str, optional
        Row of `severity_zones`. None: no zone is stated.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

    Returns
    -------
    dict
        "channel:rms", "channel:crest_factor" and "channel:kurtosis"; "channel:velocity [mm/s]" and
        "channel:zone". What is undefined for a channel is left out: the kurtosis of a constant, the
        velocity of a recording that is shorter than 1 s or sampled below 2000 Hz.

    Raises
    ------
    TypeError, ValueError
        If the class is unknown.

    See Also
    --------
    emacm.monitoring.vibration_severity : RMS velocity alone.

    Examples
    --------
    A tone of 25 Hz and 3 m/s2 has a velocity of 3 / (2 pi 25) / sqrt(2) m/s:

    >>> tone = 3 * np.sin(2 * np.pi * 25 * np.arange(8000) / 4000)
    >>> recording = Recording({"b": tone}, 4000, velocity=157.0, units={"b": "m/s2"})
    >>> indicators = vibration_indicators(recording, "class I")
    >>> indicators.pop("b:zone"), list(indicators)
    ('D', ['b:rms', 'b:crest_factor', 'b:kurtosis', 'b:velocity [mm/s]'])
    >>> [round(value, 2) for value in indicators.values()]
    [2.12, 1.41, 1.5, 13.51]
    """
    if machine_class is not None:
        check_choice(machine_class, "machine_class", tuple(_CLASSES))
    indicators: dict[str, Any] = {}
    for channel in recording.channels:
        for name in ("rms", "crest_factor", "kurtosis"):
            options: Any = {"channels": [channel], "by_direction": False, "min_speed": min_speed}
            with suppress(ValueError):
                value = RecordingStatistics((name,), **options).fit_transform([recording])
                indicators[f"{channel}:{name}"] = float(np.asarray(value)[0, 0])
        with suppress(ValueError):  # no acceleration, shorter than 1 s, or sampled below 2000 Hz
            velocity = _velocity_of(recording, channel)
            indicators[f"{channel}:velocity [mm/s]"] = velocity
            if machine_class is not None:
                indicators[f"{channel}:zone"] = severity_zone(velocity, machine_class)
    return indicators


def _velocity_of(recording: Recording, channel: str) -> float:
    """Return the velocity of a channel of acceleration [mm/s rms]."""
    signal, fs = recording.signals[channel], recording.fs[channel]
    with located(f"channel {channel!r}"):
        return vibration_velocity(signal, fs, unit=recording.units.get(channel, ""))
