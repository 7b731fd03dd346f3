"""
What if the shaft reverses?
===========================

The motion is cut into strokes, which are resampled each along its own direction; no segment of a
spectrum spans two of them. With `by_direction=True` forward and reverse strokes have spectra of
their own.
"""

from emacm.displays import RecordingDisplay
from emacm.simulation import simulate_fleet

recordings, *_ = simulate_fleet(1, 1)
RecordingDisplay.from_recording(
    recordings[0], channels=["lvdt", "current_a"], shade_strokes=True, min_speed=1.0
)
