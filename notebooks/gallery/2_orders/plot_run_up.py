"""
How do I get the order spectrum of a run-up?
============================================

In hertz the lines of a run-up smear, since their frequencies follow the speed. Over the shaft
angle they stay sharp: `OrderResampler` (computed order tracking), then `OrderPSD`.
"""

import numpy as np
from matplotlib import pyplot as plt
from scipy.signal import welch

from emacm import OrderPSD, OrderResampler, Recording
from emacm.displays import OrderSpectrumDisplay

fs = 5_000  # Hz
time = np.arange(10 * fs) / fs
speed = 2 * np.pi * (5 + 2 * time)  # rad/s: from 5 to 25 rev/s
angle = 2 * np.pi * (5 * time + time**2)
vibration = np.sin(3.5 * angle) + 0.5 * np.sin(9 * angle)
vibration += np.random.default_rng(0).normal(size=len(time))
recording = Recording({"vibration": vibration}, fs, velocity=speed, units={"vibration": "g"})

over_angle = OrderResampler(2 * np.pi / 64).fit_transform([recording])
psd = OrderPSD(16, max_order=12).set_output(transform="pandas").fit_transform(over_angle)

fig, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained", sharey=True)
frequencies, in_hertz = welch(vibration, fs, nperseg=4096)
left.plot(frequencies, 10 * np.log10(in_hertz))
left.set(xlabel="frequency [Hz]", ylabel="PSD [dB re 1 g²/Hz]", xlim=(0, 300))
OrderSpectrumDisplay.from_table(psd, unit="g", ax=right)
