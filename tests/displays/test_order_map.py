"""Order maps consist of the segments that Welch's method averages."""

import numpy as np

from emacm import OrderPSD, OrderResampler, Recording
from emacm.displays import OrderMapDisplay
from emacm.simulation.fleet import simulate_actuator

TURN = 2 * np.pi
FS = 2000


def ramp(order=5.0):
    times = np.arange(8 * FS) / FS
    velocity = TURN * (2 + 2 * times)
    angle = TURN * (2 * times + times**2)
    return Recording({"vibration": np.sin(order * angle)}, FS, velocity=velocity)


def drawn(ax):
    """Return the colours of the map, n_orders by n_columns, and its edges along x."""
    (mesh,) = ax.collections
    return mesh.get_array(), mesh.get_coordinates()[0, :, 0]


def test_colours_are_the_segments_in_db_and_gaps_stay_empty(ax):
    psd = np.array([[1.0, 10.0, 100.0], [1.0, 1.0, 0.0]])
    OrderMapDisplay([0, 1, 2], psd, [[0, 2], [3, 4]], [1.0, 1.0], unit="A").plot(ax=ax)
    power, edges = drawn(ax)
    assert edges.tolist() == [0, 2, 3, 4]
    assert power[:, 0].tolist() == [10, 20]
    assert power.mask.tolist() == [[False, True, False], [False, True, True]]
    assert ax.get_xlabel() == "time [s]"
    assert "order" in ax.get_ylabel()


def test_over_speed_segments_of_one_speed_are_averaged(ax):
    psd = np.array([[1.0, 1.0], [1.0, 3.0], [1.0, 10.0]])
    times = [[0, 1], [1, 2], [2, 3]]
    display = OrderMapDisplay([0, 1], psd, times, [-10, -9.9, 10], over="speed", n_speeds=4)
    display.plot(ax=ax)
    power, edges = drawn(ax)
    np.testing.assert_allclose(edges * np.pi / 30, [-10, -5, 0, 5, 10])
    assert np.allclose(power[0].filled(-1), [10 * np.log10(2), -1, -1, 10])
    assert ax.get_xlabel() == "shaft speed [rpm]"


def test_fault_orders_are_named_beside_the_map_and_the_scale_carries_the_unit(ax):
    marks = {"fault_orders": {"BPFI": 5.0, "beyond": 30.0}, "slip": 0.1, "max_order": 20}
    display = OrderMapDisplay.from_recording(ramp(), unit="m/s²", ax=ax, **marks)
    (bar,) = ax.lines
    assert np.allclose(bar.get_ydata(), [4.5, 5.5])
    assert min(bar.get_xdata()) > 1  # axes coordinates: beyond the right edge
    assert [text.get_text() for text in ax.texts] == ["BPFI"]
    assert ax.get_ylim()[1] == 20
    label = display.colorbar_.ax.get_ylabel()
    assert label == "PSD of vibration [dB re 1 (m/s²)²/order]"


def test_the_mean_of_all_segments_is_the_spectrum_of_the_recording(ax):
    run = simulate_actuator("inner ring", seed=3)
    display = OrderMapDisplay.from_recording(run, "accelerometer", revolutions=4, ax=ax)
    over_angle = OrderResampler(channels=["accelerometer"]).fit_transform([run])
    expected = OrderPSD(4).fit_transform(over_angle)
    assert np.allclose(display.frame().mean(), np.asarray(expected)[0])
