"""
What differs from the training, if the answer is "unknown"?
===========================================================

Often not the machine: a gain, a speed, a sampling rate. `outside_training` compares a recording
with the ranges of the training, and returns what is outside as values: `Statement`.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording, outside_training

rng = np.random.default_rng(0)


def measured(speed, gain=1.0):
    """A recording at about a speed [rad/s]."""
    angle = speed * np.arange(8000) / 2000
    signal = gain * (np.sin(3 * angle) + 0.3 * rng.normal(size=8000))
    return Recording({"vibration": signal}, 2000, angle=angle)


model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(4), BinTransformer(1, max_order=6))
model.fit([measured(speed) for speed in rng.uniform(90, 110, 20)])
new = {"as trained": measured(100), "in mV": measured(100, 1000), "too slow": measured(40)}
for name, statements in zip(new, outside_training(model, list(new.values())), strict=True):
    print(name, *statements, sep="\n   ")

powers = 10 * np.log10(model.transform(list(new.values())))
fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
ax.stairs(powers[1], np.arange(7), label="in mV", lw=2)
ax.stairs(powers[0], np.arange(7), label="as trained", lw=2)
ax.set(xlabel="order [cycles per revolution]", ylabel="power [dB]")
ax.legend()
