"""
Why not just interpolate the signal?
====================================

Interpolation at equal angles folds what lies above the new Nyquist order into the spectrum. Here
a tone at order 27.3 appears at order 4.7 of 32 samples per revolution. `OrderResampler` filters
over the angle first.
"""

import numpy as np
import pandas as pd

from emacm import OrderPSD, OrderResampler, Recording
from emacm.displays import OrderSpectrumDisplay

fs = 10_000  # Hz
time = np.arange(10 * fs) / fs
angle = 2 * np.pi * (20 * time + 0.5 * time**2)
signal = np.sin(3 * angle) + np.sin(27.3 * angle)
signal += 0.1 * np.random.default_rng(0).normal(size=len(time))
recording = Recording({"vibration": signal}, fs, angle=angle)

spectra = []
for options in ({"interpolation": "linear", "antialias": False}, {}):
    over_angle = OrderResampler(2 * np.pi / 32, **options).fit_transform([recording])
    psd = OrderPSD(16, max_order=12).set_output(transform="pandas")
    spectra.append(psd.fit_transform(over_angle))
labels = ["interpolated", "band-limited (default)"]
OrderSpectrumDisplay.from_table(pd.concat(spectra), labels=labels)
