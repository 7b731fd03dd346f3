"""Control for `real_actuator.py`: dependence of a method on the phase of the 1x component.

In the recordings every stroke starts and ends at the same position of the screw, and the angle is
counted from there. After reassembly both would be different. The control cuts off both ends of
each stroke and changes the zero of the angle: equally in all recordings, or at random over
a whole revolution in each. The accuracy that a method loses between the two, in training and
test, was due to the phase of the 1x component.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emacm import Recording

# Samples of the two strokes, beyond noise at rest: the set point is the same in all recordings.
OUT, BACK = (4, 129), (201, 324)
FEWEST, MOST = 4, 8  # samples cut off; any of these five, as a revolution is 5.2 samples


def cut_alike(recordings: list[Recording]) -> list[Recording]:
    """Cut the strokes of all recordings at the same positions."""
    shape = len(recordings), 4
    return _cut_all(recordings, np.full(shape, (FEWEST + MOST) // 2), np.zeros(shape[0]))


def cut_at_random(recordings: list[Recording], draw: int) -> list[Recording]:
    """Cut the strokes of each recording anywhere within a revolution, and move its zero."""
    rng = np.random.default_rng(draw)
    lost = rng.integers(FEWEST, MOST, (len(recordings), 4), endpoint=True)
    return _cut_all(recordings, lost, rng.uniform(0, 2 * np.pi, len(recordings)))


def _cut_all(
    recordings: list[Recording], lost: NDArray[np.integer], zeros: NDArray[np.floating]
) -> list[Recording]:
    return [_cut(*each) for each in zip(recordings, lost, zeros, strict=True)]


def _cut(recording: Recording, lost: NDArray[np.integer], zero: float) -> Recording:
    """Cut off samples at the ends of both strokes; not for methods that use the rest.

    Between the strokes the angle changes evenly over a rest three times as long: within the
    original rest, the shaft would seem to turn.
    """
    out = np.arange(OUT[0] + lost[0], OUT[1] - lost[1])
    rest = np.repeat(np.arange(OUT[1], BACK[0]), 3)
    back = np.arange(BACK[0] + lost[2], BACK[1] - lost[3])
    kept = np.concatenate([out, rest, back])
    angle: Any = np.asarray(recording.angle)[kept]
    standing = slice(len(out), len(out) + len(rest))
    angle[standing] = np.linspace(angle[len(out) - 1], angle[standing.stop], len(rest))
    signals = {name: np.asarray(signal)[kept] for name, signal in recording.signals.items()}
    return Recording(signals, recording.shaft_fs, angle=angle + zero, meta=recording.meta)
