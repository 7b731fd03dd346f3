"""
How many recordings do I need?
==============================

Count units, not recordings: each unit in a state is one observation, however often it is recorded.
To show that at most a given share of faults is missed, with a confidence of 95 %, a number of
faulty units is needed even if none of them is missed; `miss_rate_limit` refuses fewer. From then on
each further unit makes the interval of the false alarm rate narrower: 95 % confidence intervals.
"""

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt

from emacm import CostSensitiveGaussianBayes, miss_rate_limit

print("faulty units needed for a missed detection rate of at most")
for rate in (0.2, 0.1, 0.05, 0.01):
    print(f"{rate:4.0%}: {np.ceil(np.log(1 - 0.95) / np.log(1 - rate)):3.0f}, if none is missed")


def measured(n_units, seed):
    """Return one feature of n healthy and n worn units, their states and numbers."""
    states = np.repeat(["healthy", "worn"], n_units)
    values = np.random.default_rng(seed).normal(size=2 * n_units) + 2.5 * (states == "worn")
    return values[:, np.newaxis], states, np.arange(2 * n_units)


features, states, _ = measured(100, seed=0)
model = CostSensitiveGaussianBayes().fit(features, states)
rows = {}
for n_units in (20, 30, 50, 100, 200, 400):
    try:
        found = miss_rate_limit(model, *measured(n_units, seed=1), rate=0.1, healthy="healthy")
        rows[n_units] = found.table.loc["limit"].filter(regex="^false")
    except ValueError as refused:
        print(f"{n_units} units of each state: {refused}")
percent = 100 * pd.DataFrame(rows).T
print(percent.rename_axis("units").set_axis(["false alarms [%]", "low", "high"], axis=1).round(0))

fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
middle, low, high = percent.T.to_numpy()
ax.errorbar(percent.index, middle, [middle - low, high - middle], fmt="o", capsize=4)
ax.set(xscale="log", xlabel="units of each state", ylabel="false alarms [%]", ylim=(0, None))
ax.set_xticks(percent.index, percent.index)
ax.minorticks_off()
