"""
In which condition does it fail?
================================

One accuracy hides where the errors are. The outcomes of all decisions by condition: correct,
false alarm, missed detection, wrong fault, inspection.
"""

import numpy as np

from emacm.displays import OutcomesDisplay

rng = np.random.default_rng(0)
conditions = np.repeat(["low load", "medium load", "high load"], 60)
truths = rng.choice(["healthy", "inner ring", "screw"], 180)
reliability = {"low load": 0.7, "medium load": 0.9, "high load": 0.97}
decisions = truths.copy()
for row in range(180):
    if rng.uniform() > reliability[conditions[row]]:
        decisions[row] = rng.choice(["healthy", "inner ring", "screw", "inspect"])

OutcomesDisplay.from_predictions(truths, decisions, healthy="healthy", conditions=conditions)
