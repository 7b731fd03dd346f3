"""
Which states overlap in my features?
====================================

The classifier describes each state by a Gaussian. `FeatureDensityDisplay` draws the ellipses that
hold given shares of each: where those of two states cross, no decision boundary is free of errors.
"""

import numpy as np

from emacm import CostSensitiveGaussianBayes
from emacm.displays import FeatureDensityDisplay

rng = np.random.default_rng(0)
centres = {"healthy": (0, 0), "inner ring": (2.2, 0.5), "screw": (1, 5)}
states = np.repeat(list(centres), 60)
features = rng.normal(size=(180, 2)) + np.repeat(list(centres.values()), 60, axis=0)

classifier = CostSensitiveGaussianBayes().fit(features, states)
names = ("rise of the line of the ring", "rise of the line of the screw")
FeatureDensityDisplay.from_estimator(classifier, features, states, names=names)

posterior = classifier.predict_proba(features)
doubtful = (posterior.max(axis=1) < 0.9)[states != "screw"].mean()
print(f"{doubtful:.0%} of 'healthy' and 'inner ring' have no state with a posterior of 0.9")
