"""
In which frequency band are the impacts?
========================================

A kurtogram shows how impulsive each band is. Its best band may be given to `EnvelopeDetector`;
after `CepstralPrewhitening` the whole band can be used and none has to be selected.
"""

import numpy as np

from emacm.displays import KurtogramDisplay

fs = 20_000
noise = np.random.default_rng(0).normal(size=5 * fs)
struck = np.zeros(5 * fs)
struck[::231] = 1.0
ringing = np.exp(-np.arange(200) / 25) * np.sin(2 * np.pi * 6200 / fs * np.arange(200))
vibration = 4 * np.convolve(struck, ringing)[: 5 * fs] + noise

display = KurtogramDisplay.from_signal(vibration, fs, channel="casing")
