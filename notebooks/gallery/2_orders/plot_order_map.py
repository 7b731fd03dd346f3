"""
Does a line follow the shaft, or is it a resonance?
===================================================

In an order map a line of the shaft is straight, and everything of fixed frequency, such as mains
hum or a resonance, is curved.
"""

import numpy as np

from emacm import Recording
from emacm.displays import OrderMapDisplay

fs = 4_000  # Hz
time = np.arange(20 * fs) / fs
angle = 2 * np.pi * (5 * time + 0.75 * time**2)
vibration = np.sin(6 * angle) + np.sin(2 * np.pi * 150 * time)
vibration += 0.5 * np.random.default_rng(0).normal(size=len(time))
recording = Recording({"vibration": vibration}, fs, angle=angle, units={"vibration": "g"})

OrderMapDisplay.from_recording(recording, max_order=25)
