"""
Which parts should be opened?
=============================

Several parts may be faulty at once. `set_costs` adds what opening a part costs and what a faulty
part that is left costs; a part is opened where its probability exceeds the ratio of the two.
"""

import numpy as np
from matplotlib import pyplot as plt

from emacm import CostSensitiveGaussianBayes, set_costs
from emacm.displays import DecisionRegionsDisplay

rng = np.random.default_rng(0)
states = np.repeat(["healthy", "screw", "bearing", "bearing + screw"], 40)
centres = {"healthy": (0, 0), "screw": (2, 0), "bearing": (0, 2), "bearing + screw": (2, 2)}
levels = np.array([centres[state] for state in states]) + 0.6 * rng.normal(size=(160, 2))

cost = set_costs(states, opening={"screw": 2, "bearing": 1}, left={"screw": 9, "bearing": 20})
print(cost)

classifier = CostSensitiveGaussianBayes(cost, covariance="tied").fit(levels, states)
fig, ax = plt.subplots(figsize=(6.3, 4.5), layout="constrained")
DecisionRegionsDisplay.from_estimator(
    classifier, levels, states, ax=ax, names=("level of the screw", "level of the bearing")
)
