"""
How do I save a model, and where is it valid?
=============================================

`save_model` writes the whole pipeline to one file that executes no code when it is loaded.
`describe_model` reads what the file states; the map shows the speeds and severities of the
training.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.displays import DomainDisplay
from emacm.simulation import simulate_fleet

recordings, states, units = simulate_fleet(3, 2, severity=(0.2, 0.6))
model = make_pipeline(
    emacm.OrderResampler(2 * np.pi / 64, channels=["accelerometer"], min_speed=1.0),
    emacm.OrderPSD(8),
    emacm.BinTransformer(2.0, max_order=20),
    FunctionTransformer(np.log10, feature_names_out="one-to-one"),
    emacm.CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto"),
).fit(recordings, states)

with TemporaryDirectory() as folder:
    path = Path(folder, "model.skops")
    emacm.save_model(model, path, note="three states, accelerometer")
    loaded = emacm.load_model(path)
    print(emacm.describe_model(path))
print((loaded.predict(recordings) == model.predict(recordings)).all())
DomainDisplay.from_recordings(recordings, states, condition="severity")
