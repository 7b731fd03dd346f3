"""
Which bearing ring is damaged?
==============================

The geometry of the bearing determines the orders at which each ring shows itself. `find_faults`
names the fault whose lines rise above their background; no training data is needed.
"""

import numpy as np

from emacm import Bearing, Recording, find_faults
from emacm.displays import FaultLinesDisplay

bearing = Bearing(n_balls=9, ball_diameter=7.94, pitch_diameter=39.04)  # a 6205; mm

# A housing that rings at 3 kHz after each of 5.415 impacts per revolution: the inner ring.
fs = 12_000
angle = 2 * np.pi * 29.2 * np.arange(5 * fs) / fs
struck = np.diff(np.floor(5.415 * angle / (2 * np.pi)), prepend=0) * (1 + np.cos(angle))
ringing = np.exp(-np.arange(150) / 20) * np.sin(2 * np.pi * 3000 / fs * np.arange(150))
vibration = 3 * np.convolve(struck, ringing)[: len(angle)] + 10 * np.sin(angle)
vibration += np.random.default_rng(0).normal(size=len(angle))
recording = Recording({"drive end": vibration}, fs, angle=angle)

found = find_faults([recording], bearing)
print(found["explanation"][0])
FaultLinesDisplay.from_recording(recording, bearing, faults=["BPFO", "BPFI"])
