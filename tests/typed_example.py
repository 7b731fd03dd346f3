"""A user's program, checked by mypy --strict against the installed package."""

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import (
    Bearing,
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    evaluate,
    expected_cost,
    fault_orders,
    order_bands,
)
from emacm.displays import OrderSpectrumDisplay
from emacm.shaft import angle_from_tacho
from emacm.simulation import simulate_fleet

time = np.arange(20_000) / 2_000
tacho = np.sign(np.sin(2 * np.pi * 5 * time))
angle = angle_from_tacho(tacho, 2_000.0).angle
recording: Recording = Recording({"vibration": np.sin(angle)}, 2_000.0, angle=angle)
duration: float = recording.duration
channels: tuple[str, ...] = tuple(recording.channels)

recordings, states, units = simulate_fleet(3, 2)
orders: pd.DataFrame = fault_orders(Bearing(9, 7.94, 39.04))
bands: dict[str, tuple[float, float]] = order_bands(orders)
model = make_pipeline(
    OrderResampler(theta_s=2 * np.pi / 64),
    OrderPSD(revolutions=4),
    BinTransformer(bin_size=1.0, max_order=16),
    StandardScaler(),
    CostSensitiveGaussianBayes({("healthy", "screw"): 10.0}, covariance="tied", shrinkage="auto"),
)
model.fit(recordings, states)
cost: float = expected_cost(states, model.predict(recordings))
table: pd.DataFrame = evaluate(model, recordings, states, units=units, n_splits=3).table
OrderSpectrumDisplay.from_estimator(model, recordings, labels=states).plot()
