"""
Which tooth of a gear is damaged?
=================================

The time-synchronous average keeps what repeats with the shaft, and averages out the rest. A
cracked tooth is a dent in the mesh at its own angle, in noise that hides it in the signal.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline

from emacm import OrderResampler, Recording, SynchronousAverage

fs, teeth = 10_000, 20
time = np.arange(20 * fs) / fs
angle = 2 * np.pi * (10 * time + 0.2 * time**2)
place = (angle / (2 * np.pi)) % 1  # fraction of the revolution
crack = 1 - 0.6 * np.exp(-(((place - 0.3) / 0.02) ** 2))  # at 0.3 revolutions
signal = crack * np.cos(teeth * angle) + 2 * np.random.default_rng(0).normal(size=len(time))
recording = Recording({"gearbox": signal}, fs, angle=angle)

average = make_pipeline(OrderResampler(2 * np.pi / 256), SynchronousAverage())
values = np.asarray(average.fit_transform([recording]))[0]

fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
ax.plot(np.arange(256) * 360 / 256, values)
ax.axvspan(100, 116, color="C1", alpha=0.3, label="cracked tooth")
ax.set(xlabel="shaft angle [°]", ylabel="synchronous average", xlim=(0, 360))
ax.legend(loc="upper right")
