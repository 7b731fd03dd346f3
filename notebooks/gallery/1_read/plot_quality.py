"""
Up to which order is my recording valid?
========================================

Half the sampling rate over the highest speed: at 500 Hz and 12 rev/s nothing above order 20.8 was
measured. `OrderResampler.quality` states it for each recording, with revolutions, speeds and
defects such as clipping.
"""

import numpy as np
from matplotlib import pyplot as plt

from emacm import OrderResampler, Recording

fastest = np.array([4, 8, 12, 16])  # rev/s
recordings = []
for highest in fastest:
    speed = 2 * np.pi * np.linspace(1, highest, 10_000)  # rad/s
    wave = np.sin(3 * np.cumsum(speed) / 500)
    recordings.append(Recording({"vibration": wave}, 500, velocity=speed))

table = OrderResampler(2 * np.pi / 64).fit(recordings).quality(recordings)
print(table["warnings"].iloc[-1])

fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
ax.bar([f"{speed} rev/s" for speed in fastest], table["max_order"])
ax.axhline(32, color="0.4", ls="--")
ax.annotate("highest order of 64 samples per revolution", (3.4, 33), ha="right")
ax.set(xlabel="highest speed of the recording", ylabel="highest valid order")
