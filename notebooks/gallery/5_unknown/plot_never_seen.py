"""
What if the model never saw this fault?
=======================================

Without `unknown=` it decides for one of the states it knows, often with certainty. With it, what
is too far from all training data is "unknown", where `unknown_rate` of the known recordings may
be called so too. A fault may still lie near a known state: not all are found.
"""

import numpy as np
from matplotlib import pyplot as plt

from emacm import CostSensitiveGaussianBayes
from emacm.displays import DecisionRegionsDisplay

rng = np.random.default_rng(0)
states = np.repeat(["healthy", "worn"], 60)
features = rng.normal(size=(120, 2)) + 4 * (states == "worn")[:, np.newaxis]
never_seen = rng.normal(size=(12, 2)) + [9, -2]

everything, names = np.vstack([features, never_seen]), [*states, *["never seen"] * 12]
fig, axes = plt.subplots(1, 2, figsize=(8, 3.8), layout="constrained")
for ax, options in zip(axes, ({}, {"unknown": "unknown", "unknown_rate": 0.02}), strict=True):
    classifier = CostSensitiveGaussianBayes(**options)
    classifier.fit(features, states, groups=np.arange(120))  # each recording is a unit of its own
    DecisionRegionsDisplay.from_estimator(classifier, everything, names, ax=ax)
    ax.set_xlabel("with unknown=" if options else "without unknown=")
    decisions, counts = np.unique(classifier.predict(never_seen), return_counts=True)
    print(*options, "never seen:", *counts, *decisions)
