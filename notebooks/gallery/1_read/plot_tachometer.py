"""
How do I get the shaft angle from a tachometer that misses pulses?
==================================================================

`angle_from_tacho` finds the pulses, and repairs missing and double ones where the speed around
them leaves no doubt. It states how many it repaired.
"""

import numpy as np
from matplotlib import pyplot as plt

from emacm import angle_from_tacho, pulse_times

fs = 5_000  # Hz
time = np.arange(4 * fs) / fs
true_angle = 2 * np.pi * (8 * time + 1.5 * time**2)
tacho = (true_angle % (2 * np.pi) < 0.3).astype(float) * 5  # V, one pulse per revolution
tacho[(true_angle > 2 * np.pi * 20) & (true_angle < 2 * np.pi * 21)] = 0  # one is missing
tacho += 0.1 * np.random.default_rng(0).normal(size=len(time))

found = angle_from_tacho(tacho, fs)
print(found)
pulses = pulse_times(tacho, fs)

fig, (top, bottom) = plt.subplots(2, 1, figsize=(6.3, 4), sharex=True, layout="constrained")
top.plot(time, tacho, lw=0.7)
top.set(ylabel="tachometer [V]", xlim=(1, 3))
bottom.plot(pulses[1:], 1 / np.diff(pulses), "o:", color="C1", label="between pulses")
bottom.plot(time, np.gradient(found.angle, 1 / fs) / (2 * np.pi), label="repaired")
bottom.set(xlabel="time [s]", ylabel="speed [rev/s]", ylim=(0, 20))
bottom.legend(loc="lower right")
