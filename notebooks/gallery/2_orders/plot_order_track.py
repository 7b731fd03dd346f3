"""
Where is the critical speed of a rotor?
=======================================

`order_track` follows amplitude and phase of 1x in a run-up: at the resonance the amplitude is
highest, and the phase has fallen by 90 degrees. It is no Vold-Kalman filter: it does not separate
orders of two shafts that cross.
"""

import numpy as np

from emacm import Recording
from emacm.displays import OrderTrackDisplay

fs = 4_000  # Hz
time = np.arange(100 * fs) / fs
speed = 2 * np.pi * (2 + 0.4 * time)  # 120 to 2520 rpm
angle = 2 * np.pi * (2 * time + 0.2 * time**2)
# A rotor with a critical speed of 1500 rpm, in balance with its speed at any time; and 2x.
ratio = speed / (2 * np.pi * 25)
rotor = 0.3 * ratio**2 / (1 - ratio**2 + 0.1j * ratio)
vibration = np.real(rotor * np.exp(1j * angle)) + 0.2 * np.cos(2 * angle + 1)
vibration += 0.5 * np.random.default_rng(0).normal(size=len(time))
recording = Recording({"vibration": vibration}, fs, angle=angle, units={"vibration": "mm/s"})

OrderTrackDisplay.from_recording(recording, [1, 2])

# %%
# The polar plot of a resonance is a circle through 0.

OrderTrackDisplay.from_recording(recording, 1, polar=True)
