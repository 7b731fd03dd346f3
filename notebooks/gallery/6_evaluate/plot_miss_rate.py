"""
How dear must a missed fault be, so that at most one in ten is missed?
======================================================================

`miss_rate_limit` chooses the cost of missed detections so that their rate stays below a limit
with a stated confidence. It needs units that were not in training; the price are more false
alarms.
"""

import numpy as np
from matplotlib import pyplot as plt

from emacm import CostSensitiveGaussianBayes, miss_rate_limit

rng = np.random.default_rng(0)
states = np.repeat(["healthy", "worn"], 200)
features = rng.normal(size=(400, 1)) + 2 * (states == "worn")[:, np.newaxis]
training, later = slice(0, None, 2), slice(1, None, 2)

model = CostSensitiveGaussianBayes().fit(features[training], states[training])
units = np.arange(200)  # one recording of each unit
found = miss_rate_limit(model, features[later], states[later], units, rate=0.1, healthy="healthy")
print(f"a missed fault costs {found.factor:.2f} times as much; {found.n_units} faulty units")

rates = found.table[["missed_detection_rate", "false_alarm_rate"]]
fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
(100 * rates).plot.bar(ax=ax, rot=0)
ax.axhline(10, color="0.4", ls="--")
ax.set(ylabel="rate [%]")
