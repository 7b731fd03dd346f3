"""
How long will this unit last?
=============================

`RemainingLife` learns from units that failed, and states an interval that is calibrated by unit.
Before the onset of damage it only knows the life of the population.
"""

import numpy as np
import pandas as pd

from emacm.displays import RemainingLifeDisplay
from emacm.monitoring import RemainingLife
from emacm.simulation import WearLaw

law, rows = WearLaw(start=0.15, drift=0.02, drift_spread=0.005, diffusion=0.002), []
rng = np.random.default_rng(0)
for unit in range(31):
    drawn = law.draw(unit, 10.0)
    index = 1 + 20 * drawn.severity + 0.2 * rng.normal(size=len(drawn.ages))
    left = drawn.life - drawn.ages
    rows.append(pd.DataFrame({"unit": unit, "age": drawn.ages, "index": index, "left": left}))
table = pd.concat(rows, ignore_index=True)

past, followed = table[table["unit"] < 30], table[table["unit"] == 30]
model = RemainingLife(onset=2.5)
model.fit(past[["age", "index"]], past["left"], groups=past["unit"])
RemainingLifeDisplay.from_estimator(model, followed[["age", "index"]], followed["left"])
