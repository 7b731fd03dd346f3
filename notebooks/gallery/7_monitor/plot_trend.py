"""
Since when has this unit been getting worse?
============================================

`HealthIndex` is the distance from the healthy recordings of the same unit. It needs no faults in
training. Its limit is computed from left-out healthy recordings for an accepted rate of false
alarms.
"""

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from emacm import BinTransformer, OrderPSD, OrderResampler
from emacm.displays import TrendDisplay
from emacm.monitoring import HealthIndex, health_trend
from emacm.simulation import WearLaw, run_to_failure_fleet

law = WearLaw(start=0.1, drift=0.02, drift_spread=0.005, diffusion=0.002)
fleet = run_to_failure_fleet(3, law=law, interval=10.0, seed=4)
baseline = [recording for recording in fleet if recording.meta["age"] < 80]  # hours
model = make_pipeline(
    OrderResampler(2 * np.pi / 64, channels=["accelerometer"]),
    OrderPSD(4),
    BinTransformer(2.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    HealthIndex(),
)
units = [recording.meta["unit"] for recording in baseline]
model.fit(baseline, healthindex__groups=range(len(baseline)), healthindex__units=units)

later = [recording for recording in fleet if recording.meta["age"] >= 80]
trend = health_trend(model, later, unit="unit", time="age")
TrendDisplay(trend, time_label="age [h]").plot()
