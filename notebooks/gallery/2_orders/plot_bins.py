"""
How do I turn a spectrum into few features?
===========================================

`BinTransformer` integrates it over bins, so that the features add up to the mean square. Named
bands of a machine and stop bands for what is not a fault can be given as well.
"""

import numpy as np
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler
from emacm.displays import OrderBinsDisplay
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(2, 2, severity=(0.4, 0.6))
bins = make_pipeline(
    OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    OrderPSD(8),
    BinTransformer(1.0, max_order=20, stop_bands=((11.5, 12.5),)),
).set_output(transform="pandas")
table = bins.fit_transform(recordings)
OrderBinsDisplay.from_table(table, labels=states, unit="g", stop_bands=((11.5, 12.5),))
