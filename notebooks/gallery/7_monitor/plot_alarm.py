"""
How often does an alarm ring for nothing?
=========================================

Once in `arl` readings, if the baseline were known. `run_length_` states beside it what a baseline
of this length really gives. Here the machine changes at reading 40; the alarms just before it are
false.
"""

import numpy as np

from emacm.displays import AlarmDisplay
from emacm.monitoring import EWMA

rng = np.random.default_rng(0)
baseline = rng.normal(5.0, 0.4, size=(200, 1))  # readings of the healthy machine
alarm = EWMA(0.2, arl=1000).fit(baseline)
print(alarm.run_length_)

shifted = rng.normal(5.0, 0.4, size=(80, 1))
shifted[40:] += 0.4  # one standard deviation, from reading 40 on
AlarmDisplay.from_estimator(alarm, shifted, np.arange(80))
