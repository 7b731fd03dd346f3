"""
How do I add a sensor with its own sampling rate?
=================================================

Name it, and state its rate: the channels of a `Recording` need not have the same one. After
computed order tracking all channels have one axis, that of the shaft angle, and their orders can
be compared.
"""

import numpy as np

from emacm import OrderPSD, OrderResampler, Recording
from emacm.displays import OrderSpectrumDisplay

fs = {"accelerometer": 10_000, "current": 2_000}  # Hz
noise = np.random.default_rng(0)
speed = np.linspace(60, 120, 5 * 500)  # rad/s, at 500 Hz


def angle_at(rate):
    """Shaft angle at the times of a channel [rad]."""
    time = np.arange(5 * rate) / rate
    return 60 * time + 6 * time**2


signals = {
    "accelerometer": np.sin(5.4 * angle_at(10_000)) + noise.normal(size=50_000),
    "current": 4 * np.sin(2 * angle_at(2_000)) + 0.2 * noise.normal(size=10_000),
}
units = {"accelerometer": "g", "current": "A"}
recording = Recording(signals, fs, velocity=speed, shaft_fs=500, units=units)

over_angle = OrderResampler(2 * np.pi / 32).fit_transform([recording])
spectrum = OrderPSD(8, max_order=8).set_output(transform="pandas").fit_transform(over_angle)
OrderSpectrumDisplay.from_table(spectrum, unit=units)
