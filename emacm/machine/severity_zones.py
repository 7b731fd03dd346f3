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
from numpy.typing import ArrayLike, NDArray
from scipy.signal import welch

from emacm._checks import check_choice, check_number, check_real_array, check_signal, located
from emacm._statements import warn
from emacm.findings.quality import check_channel
from emacm.recordings.names import unit_ratio
from emacm.recordings.recording import Recording
from emacm.stroke_features.statistics import RecordingStatistics

_LARGE = ("ISO 20816-3", "above 300 kW, or shaft height from 315 mm")
_MEDIUM = ("ISO 20816-3", "15 to 300 kW, or shaft height 160 to 315 mm")
_NO_DISPLACEMENT = (np.nan, np.nan, np.nan, "ISO 10816-1")
_CLASSES: dict[str, tuple[Any, ...]] = {
    "group 1 rigid": (2.3, 4.5, 7.1, 29.0, 57.0, 90.0, *_LARGE),
    "group 1 flexible": (3.5, 7.1, 11.0, 45.0, 90.0, 140.0, *_LARGE),
    "group 2 rigid": (1.4, 2.8, 4.5, 22.0, 45.0, 71.0, *_MEDIUM),
    "group 2 flexible": (2.3, 4.5, 7.1, 37.0, 71.0, 113.0, *_MEDIUM),
    "class I": (0.71, 1.8, 4.5, *_NO_DISPLACEMENT, "small machines, motors up to 15 kW"),
    "class II": (1.12, 2.8, 7.1, *_NO_DISPLACEMENT, "medium machines, motors of 15 to 75 kW"),
    "class III": (1.8, 4.5, 11.2, *_NO_DISPLACEMENT, "large machines on rigid foundations"),
    "class IV": (2.8, 7.1, 18.0, *_NO_DISPLACEMENT, "large machines on flexible foundations"),
}
_QUANTITIES = ("velocity", "displacement")
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
        One row per machine class: the boundaries of the velocity, "A/B", "B/C" and "C/D" [mm/s
        rms], and of the displacement, "A/B [um]", "B/C [um]" and "C/D [um]" [micrometres rms],
        "source" and "machines". The boundaries of groups 1 and 2 are those of ISO 20816-3 [1]_;
        those of classes I to IV, of ISO 10816-1 [2]_, are informative, and without displacement.

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
    limits = ["A/B", "B/C", "C/D"]
    columns = [*limits, *(f"{name} [um]" for name in limits), "source", "machines"]
    return pd.DataFrame.from_dict(_CLASSES, orient="index", columns=columns)


def severity_zone(
    velocity: ArrayLike, machine_class: str, displacement: ArrayLike | None = None
) -> Any:
    """Return the zone of a broad-band vibration velocity, and of a displacement if it is given.

    Parameters
    ----------
    velocity : float or array-like
        Velocity on a bearing housing [mm/s rms], 10 to 1000 Hz; below 600 rpm, 2 to 1000 Hz.
    machine_class : str
        Row of `severity_zones`, such as "group 2 rigid" or "class I".
    displacement : float or array-like, optional
        Displacement in the same band [micrometres rms]; the stricter of both zones holds. Without
        effect for classes I to IV, which have no limits of it.

    Returns
    -------
    str or ndarray of str
        "A" to "D"; a value on a boundary is in the better zone. General experience with many
        machines, not a diagnosis.

    Raises
    ------
    TypeError, ValueError
        If the class is unknown, or a velocity or displacement is negative or not finite.

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
    limits = np.reshape(_CLASSES[machine_class][:6], (2, 3)).astype(np.float64)
    numbers: Any = 0
    for own, given, name in zip(limits, (velocity, displacement), _QUANTITIES, strict=True):
        values = check_real_array(0.0 if given is None else given, name)
        if not (np.isfinite(values).all() and (values >= 0).all()):
            raise ValueError(f"{name} must be finite and not negative, got {given!r}.")
        numbers = np.maximum(numbers, np.searchsorted(own, values))  # nothing exceeds a NaN
    zones = np.array(list(ZONES))[numbers]
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
    unit : str
        Unit of the acceleration: "m/s2", "mm/s2" (or "m/s²", "mm/s^2" and so on) or "g".
    band : (float, float)
        Lowest and highest frequency [Hz]; of a machine below 600 rpm, (2.0, 1000.0).

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
    emacm.monitoring.vibration_severity : Velocity and displacement, in the band of the speed.

    Examples
    --------
    A tone of 160 Hz and 10 m/s2 has a velocity of 10 / (2 pi 160) m/s:

    >>> times = np.arange(20_000) / 5000
    >>> round(vibration_velocity(10 * np.sin(2 * np.pi * 160 * times), 5000), 2)
    7.03
    """
    return _motion(_in_mm(acceleration, unit), fs, band)[0]


def _in_mm(acceleration: Any, unit: str) -> NDArray[np.float64]:
    """Return an acceleration in mm/s2."""
    factor = unit_ratio(unit, "mm/s2")
    if factor is None:
        raise ValueError(f"unit must be an acceleration, as m/s2, mm/s2 or g, got {unit!r}.")
    return factor * check_signal(acceleration, "acceleration").astype(np.float64)


def _motion(acceleration: Any, fs: float, band: tuple[float, float]) -> tuple[float, float]:
    """Return velocity [mm/s rms] and displacement [um rms] of an acceleration [mm/s2]."""
    fs = check_number(fs, "fs", above=0, unit="Hz")
    low = check_number(band[0], "the lowest frequency of band", above=0, unit="Hz")
    name = "the highest frequency of band, at most half the sampling rate,"
    high = check_number(band[1], name, above=low, at_most=fs / 2, unit="Hz")
    if len(acceleration) < 10 / low * fs:
        raise ValueError(
            f"acceleration must last at least {10 / low:g} s, ten periods of {low:g} Hz, got "
            f"{len(acceleration) / fs:g} s. Record longer."
        )
    n_segment = min(len(acceleration), round(60 / low * fs))  # lines are 1/60 of `low` apart
    frequencies, density = welch(acceleration, fs, nperseg=n_segment, detrend="constant")
    step = frequencies[1]
    # A tone at an end of the band counts in full: the next line has a sixth of its power.
    inside = (frequencies > low - 1.5 * step) & (frequencies < high + 1.5 * step)
    power, speed = density[inside] * step, 2 * np.pi * frequencies[inside]
    return float(np.sqrt(np.sum(power / speed**2))), float(1e3 * np.sqrt(np.sum(power / speed**4)))


def vibration_severity(recording: Recording, machine_class: str) -> pd.DataFrame:
    """Return velocity, displacement and zone of each acceleration channel of a recording.

    Parameters
    ----------
    recording : Recording
        With `units`: channels in "g", "m/s2" or "mm/s2" are accelerations, the others are left
        out. Its speed decides the band: from 10 Hz, below 600 rpm from 2 Hz, up to 1000 Hz.
    machine_class : str
        Row of `severity_zones`.

    Returns
    -------
    DataFrame
        One row per acceleration channel: "velocity" [mm/s rms], "displacement" [micrometres rms],
        "zone" (the stricter one of both), "meaning" and "source".

    Raises
    ------
    TypeError, ValueError
        If no channel is an acceleration, a channel is constant, the speed is outside of 120 to
        30,000 rpm, to which ISO 20816-3 applies, and as for `vibration_velocity`; the message gives
        the channel.

    Warns
    -----
    EmacmWarning
        If a channel has a defect (clipped, drop-outs and so on), or more than 10 % of its velocity
        or displacement is that of samples far beyond the others (spikes).

    See Also
    --------
    emacm.monitoring.severity_zone : The zone of ISO 20816-3.
    emacm.monitoring.vibration_indicators : With crest factor and kurtosis.

    Notes
    -----
    Annex A of ISO 10816-3 lowers the band to 2 Hz below 600 rpm, and 5.2.3 lets the stricter zone
    of velocity and displacement hold. Here it is lowered if a tenth of the motion is not above
    600 rpm; the median of the speed decides whether the standard applies.

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
    channels = [x for x in recording.channels if _is_acceleration(recording, x)]
    if not channels:
        raise ValueError(
            f"no channel of {list(recording.channels)} has a unit of acceleration (as m/s2, mm/s2 "
            f"or g); the units are {dict(recording.units)}. Give units={{...}} to the recording; "
            f"the RMS of a measured velocity is judged by severity_zone."
        )
    motions = [_motion_of(recording, name, 0.0) for name in channels]
    table = pd.DataFrame(motions, channels, _QUANTITIES)
    table["zone"] = severity_zone(table["velocity"], machine_class, table["displacement"])
    table["meaning"] = table["zone"].map(ZONES)
    table["source"] = severity_zones().loc[machine_class, "source"]
    return table


def vibration_indicators(
    recording: Recording, machine_class: str | None = None, *, min_speed: float = 0.0
) -> dict[str, Any]:
    """Return RMS, crest factor and kurtosis of each channel, and velocities of accelerations.

    Parameters
    ----------
    recording : Recording
        If `units` states an acceleration ("g", "m/s2", "mm/s2"), the channel also has a velocity
        and a displacement, as of `vibration_severity`, of the whole recording; the others are of
        the samples in strokes.
    machine_class : str, optional
        Row of `severity_zones`. None: no zone is stated.
    min_speed : float
        Speed up to which the shaft counts as standing still [rad/s].

    Returns
    -------
    dict
        "channel:rms", "channel:crest_factor" and "channel:kurtosis"; "channel:velocity [mm/s]",
        "channel:displacement [um]" and "channel:zone". What is undefined for a channel is left out:
        the kurtosis of a constant, the velocity of a recording that is shorter than 1 s (below
        600 rpm, 5 s), sampled below 2000 Hz or of a speed outside of the standard.

    Raises
    ------
    TypeError, ValueError
        If the class is unknown.

    Warns
    -----
    EmacmWarning
        As `vibration_severity`; with a class, also of an acceleration that has no zone, and why.

    See Also
    --------
    emacm.monitoring.vibration_severity : RMS velocity alone.

    Examples
    --------
    A tone of 25 Hz and 3 m/s2 has a velocity of 3 / (2 pi 25) / sqrt(2) m/s:

    >>> tone = 3 * np.sin(2 * np.pi * 25 * np.arange(8000) / 4000)
    >>> recording = Recording({"b": tone}, 4000, velocity=157.0, units={"b": "m/s2"})
    >>> indicators = vibration_indicators(recording, "class I")
    >>> indicators.pop("b:zone"), list(indicators)[3:]
    ('D', ['b:velocity [mm/s]', 'b:displacement [um]'])
    >>> [round(value, 2) for value in indicators.values()]
    [2.12, 1.41, 1.5, 13.51, 86.03]
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
        if not _is_acceleration(recording, channel):
            continue
        try:
            velocity, displacement = _motion_of(recording, channel, min_speed)
        except ValueError as error:
            if machine_class is not None:
                warn("severity", f"no zone: {error}", channel=channel)
            continue
        indicators[f"{channel}:velocity [mm/s]"] = velocity
        indicators[f"{channel}:displacement [um]"] = displacement
        if machine_class is not None:
            indicators[f"{channel}:zone"] = severity_zone(velocity, machine_class, displacement)
    return indicators


def _is_acceleration(recording: Recording, channel: str) -> bool:
    return unit_ratio(recording.units.get(channel, ""), "m/s2") is not None


def _motion_of(recording: Recording, channel: str, min_speed: float) -> tuple[float, float]:
    """Return velocity [mm/s rms] and displacement [um rms] of a channel of acceleration."""
    fs = recording.fs[channel]
    with located(f"channel {channel!r}"):
        band = _band_of(recording, min_speed)
        defect = check_channel(recording.series[channel], channel).defect
        if defect is not None and defect.kind == "constant":
            raise ValueError(defect.text)
        signal = _in_mm(recording.signals[channel], recording.units[channel])
        velocity, displacement = _motion(signal, fs, band)
        # Spikes are few samples beyond ten standard deviations of normal noise.
        middle = np.median(signal)
        distance = np.abs(signal - middle)
        most = 15 * np.median(distance)
        usual = _motion(np.clip(signal, middle - most, middle + most), fs, band)
    if defect is not None:
        warn(defect.kind, f"{defect.text}: its velocity is uncertain", channel=channel)
    is_smaller = usual[0] < 0.9 * velocity or usual[1] < 0.9 * displacement
    if is_smaller and np.mean(distance > most) < 0.01:
        place = int(distance.argmax())
        text = (
            f"channel {channel!r} has spikes, the largest at sample {place} ({place / fs:.6g} s): "
            f"{velocity:.3g} mm/s and {displacement:.3g} um rms, but {usual[0]:.3g} mm/s and "
            f"{usual[1]:.3g} um without them. If they are no vibration, repair them or cut the "
            f"recording there"
        )
        warn("spike", text, channel=channel)
    return velocity, displacement


def _band_of(recording: Recording, min_speed: float) -> tuple[float, float]:
    """Return the band of the standard for the speed of a recording [Hz]."""
    speeds = np.abs(recording.velocity)
    moving = speeds[speeds > min_speed] if (speeds > min_speed).any() else np.zeros(1)
    low, usual = np.round(np.quantile(moving, [0.1, 0.5]) * 30 / np.pi)
    if not 120 <= usual <= 30_000:
        raise ValueError(
            f"its speed of {usual:g} rpm is outside of 120 to 30,000 rpm, to which ISO 20816-3 "
            f"applies. Check the speed and its unit; judge changes against a baseline."
        )
    return (2.0 if low <= 600 else 10.0), 1000.0
