"""Recordings are drawn with their samples, units and strokes."""

import numpy as np
from matplotlib.figure import Figure

from emacm import Recording
from emacm.displays import RecordingDisplay


def recording(n_times=400):
    times = np.arange(n_times) / 100
    speed = 5 * np.cos(2 * np.pi * times[::10] / 4)
    return Recording(
        {"current": np.sin(times), "force": times[::2]},
        {"current": 100, "force": 50},
        velocity=speed,
        shaft_fs=10,
    )


def axes(n_panels=3):
    return Figure(figsize=(6, 9)).subplots(n_panels, squeeze=False)[:, 0]


def test_each_channel_is_drawn_at_its_own_rate_and_the_shaft_below():
    run, panels = recording(), axes()
    RecordingDisplay.from_recording(run, units={"current": "A", "force": "N"}, ax=panels)
    for panel, name in zip(panels, run.channels, strict=False):
        assert np.array_equal(panel.lines[0].get_ydata(), run.signals[name])
        assert np.allclose(np.diff(panel.lines[0].get_xdata()), 1 / run.fs[name])
    assert np.array_equal(panels[2].lines[0].get_ydata(), run.velocity)
    labels = [panel.get_ylabel() for panel in panels]
    assert labels == ["current [A]", "force [N]", "shaft speed [rad/s]"]
    assert panels[2].get_xlabel() == "time [s]"


def test_only_the_samples_of_the_interval_are_drawn():
    panels = axes(2)
    run = recording()
    RecordingDisplay.from_recording(run, channels=["current"], between=(1.0, 2.0), ax=panels)
    line = panels[0].lines[0]
    assert line.get_xdata()[[0, -1]].tolist() == [1.0, 1.99]
    assert np.array_equal(line.get_ydata(), run.signals["current"][100:200])


def test_forward_and_reverse_strokes_are_shaded():
    panels = axes()
    display = RecordingDisplay.from_recording(recording(), shade_strokes=True, ax=panels)
    assert [direction for _, _, direction in display.strokes] == [1, -1, 1]
    assert len(panels[0].patches) == 3
    hatches = [patch.get_hatch() for patch in panels[0].patches]
    assert hatches[0] == hatches[2] != hatches[1]
    legend = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert legend == ["forward stroke", "reverse stroke"]
