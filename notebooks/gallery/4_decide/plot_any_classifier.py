"""
Can I use costs with my own classifier?
=======================================

With any that states probabilities: `LeastRiskClassifier` takes the decision of least expected cost.
"""

import numpy as np
from matplotlib import pyplot as plt
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from emacm import LeastRiskClassifier
from emacm.displays import DecisionRegionsDisplay

rng = np.random.default_rng(0)
radius = np.concatenate([rng.normal(1, 0.3, 80), rng.normal(2.2, 0.3, 80)])
angle = rng.uniform(0, 2 * np.pi, 160)
features = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
states = np.repeat(["healthy", "worn"], 80)

own = make_pipeline(PolynomialFeatures(2), LogisticRegression())
classifier = LeastRiskClassifier(own, {("healthy", "worn"): 20}).fit(features, states)
fig, ax = plt.subplots(figsize=(5, 4.5), layout="constrained")
DecisionRegionsDisplay.from_estimator(classifier, features, states, ax=ax)
