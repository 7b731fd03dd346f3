"""
How do I read a CSV file with decimal commas?
=============================================

As any other one: separator, decimal commas and the line of the header are found. A `Layout`
states what the file does not: which column is the shaft speed. Units in brackets are read from
the header.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from emacm import Layout, open_recording
from emacm.displays import RecordingDisplay

# A file as a logger with German settings writes it.
time = np.arange(8000) / 2000
speed = 900 + 150 * time
angle = np.cumsum(speed) * 2 * np.pi / 60 / 2000
vibration = np.sin(3 * angle) + 0.2 * np.random.default_rng(0).normal(size=8000)
table = pd.DataFrame({"Zeit [s]": time, "Gehäuse [g]": vibration, "Drehzahl [rpm]": speed})

with TemporaryDirectory() as folder:
    path = Path(folder, "run.csv")
    table.round(5).to_csv(path, sep=";", decimal=",", index=False)
    print(path.read_text(encoding="utf-8")[:90])

    layout = Layout(time="Zeit", channels=["Gehäuse"], velocity="Drehzahl")
    recording = open_recording(path, layout)
    RecordingDisplay.from_recording(recording, between=(0, 0.5))
