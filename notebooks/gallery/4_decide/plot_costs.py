"""
How do I decide with costs?
===========================

State what each decision costs in each state. With a missed fault ten times as dear as a false
alarm, the region of "healthy" shrinks; with an inspection at 0.3, what is doubtful is inspected.
"""

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt

from emacm import CostSensitiveGaussianBayes
from emacm.displays import DecisionRegionsDisplay

rng = np.random.default_rng(0)
states = np.repeat(["healthy", "worn"], 60)
features = rng.normal(size=(120, 2)) + 2.5 * (states == "worn")[:, np.newaxis]

prices = pd.DataFrame(
    [[0, 10], [1, 0], [0.3, 0.3]],
    index=["healthy", "worn", "inspect"],  # decisions
    columns=["healthy", "worn"],  # true states
)
print(prices)

fig, axes = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained", sharey=True)
for ax, cost in zip(axes, (None, prices), strict=True):
    classifier = CostSensitiveGaussianBayes(cost, covariance="tied").fit(features, states)
    DecisionRegionsDisplay.from_estimator(classifier, features, states, ax=ax)
