"""What healthy recordings of a machine have at the lines of its faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from emacm._checks import located
from emacm.machine.fault_lines import FaultLines
from emacm.machine.fault_spectra import measured_spectra
from emacm.machine.plain_lines import PlainLines
from emacm.recordings.inputs import entry_name


class HealthyScores(NamedTuple):
    """Highest score of each fault in healthy recordings, not below 0 dB, of one channel.

    Attributes
    ----------
    fs : float
        Sampling rate [Hz]; NaN for a table.
    within_slip, other_speeds, in_bands : dict of str to float
        Score at the stated speed, within the largest error of it, and at the stated speed in the
        envelopes of bands without prewhitening [dB].
    plain : list of PlainLines
        Lines of the signals themselves.
    """

    fs: float
    within_slip: dict[str, float]
    other_speeds: dict[str, float]
    in_bands: dict[str, float]
    plain: list[PlainLines]


def healthy_scores(
    healthy: Any,
    parts: Any,
    *,
    harmonics: int = 3,
    slip: float = 0.02,
    channels: Sequence[str] | None = None,
) -> dict[str, HealthyScores]:
    """Return the highest score of each fault in healthy recordings, not below 0 dB, by channel.

    `find_faults` takes the result as `healthy`, so that many recordings can be judged one by one.

    Raises
    ------
    TypeError, ValueError
        As `find_faults`; also if the harmonics of the shaft show that a speed is wrong.
    """
    by_channel: dict[str, HealthyScores] = {}
    levels = FaultLines(parts, harmonics=harmonics, slip=slip, channels=channels)
    with located("healthy"):
        for measured in measured_spectra(healthy, levels):
            if measured.is_shifted:
                name = entry_name(healthy, measured.number)
                raise ValueError(f"{name}: {measured.speed_text(None)}")
            nothing = HealthyScores(measured.fs, {}, {}, {}, [])
            own = by_channel.setdefault(measured.channel, nothing)
            if measured.plain is not None:
                own.plain.append(measured.plain)
            spectrum = measured.spectrum
            for scores, faults in (
                (own.within_slip, spectrum.faults()),
                (own.other_speeds, spectrum.faults_at_other_speeds()),
                *((own.in_bands, coarse.faults()) for _, coarse, _ in measured.bands()),
            ):
                scores |= {f.name: max(f.score, scores.get(f.name, 0.0)) for f in faults}
    return by_channel
