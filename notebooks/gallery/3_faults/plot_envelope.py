"""
Why an envelope?
================

The impacts of a damaged ring excite a resonance at kilohertz; the spectrum of the signal shows
nothing at the order of the ring. Its envelope does: `EnvelopeDetector` before `OrderResampler`.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.pipeline import make_pipeline

from emacm import EnvelopeDetector, OrderPSD, OrderResampler, Recording

fs, ring_order = 12_000, 3.585
angle = 2 * np.pi * 25 * np.arange(5 * fs) / fs
struck = np.diff(np.floor(ring_order * angle / (2 * np.pi)), prepend=0)
ringing = np.exp(-np.arange(150) / 20) * np.sin(2 * np.pi * 3000 / fs * np.arange(150))
vibration = 3 * np.convolve(struck, ringing)[: len(angle)]
vibration += np.random.default_rng(0).normal(size=len(angle))
recording = Recording({"casing": vibration}, fs, angle=angle)

levels = {}
for name, first in {"signal": [], "envelope": [EnvelopeDetector((2000, 4000))]}.items():
    model = make_pipeline(*first, OrderResampler(2 * np.pi / 64), OrderPSD(25, max_order=12))
    levels[name] = np.asarray(model.fit_transform([recording]))[0]
orders = np.arange(len(levels["signal"])) / 25

fig, axes = plt.subplots(2, 1, figsize=(6.3, 4), sharex=True, layout="constrained")
for ax, (name, psd) in zip(axes, levels.items(), strict=True):
    for harmonic in (1, 2, 3):
        ax.axvline(harmonic * ring_order, color="0.8", lw=4)
    ax.plot(orders[3:], 10 * np.log10(psd[3:]))
    ax.set(ylabel=f"{name} [dB]")
axes[-1].set(xlabel="order [cycles per revolution]; grey: the outer ring")
