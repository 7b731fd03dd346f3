"""
Is the overall vibration acceptable?
====================================

ISO 20816-3 judges the velocity from 10 to 1000 Hz, and the displacement, in zones A to D; the
stricter zone holds. Below 600 rpm the band starts at 2 Hz, and the displacement decides: the table
shows an unbalance of 2 mm/s at several speeds. A healthy zone does not exclude a bearing fault,
which hardly changes velocity and displacement.
"""

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt

from emacm import Recording
from emacm.monitoring import (
    severity_zone,
    severity_zones,
    vibration_severity,
    vibration_velocity,
)

fs = 10_000
time = np.arange(10 * fs) / fs
machine = "group 2 rigid"

tables = {}
for rpm in (120, 300, 450, 600, 900, 1500, 15_000):
    turning = 2 * np.pi * rpm / 60  # rad/s
    wave = 0.002 * np.sqrt(2) * turning * np.cos(turning * time)  # m/s²
    recording = Recording({"housing": wave}, fs, velocity=turning, units={"housing": "m/s2"})
    tables[f"{rpm} rpm"] = vibration_severity(recording, machine)
print(pd.concat(tables)[["velocity", "displacement", "zone"]].round(1))

limits = severity_zones().loc[machine, ["A/B", "B/C", "C/D"]].astype(float)
unbalances = np.array([0.05, 0.2, 0.4, 0.7, 1.1])  # m/s² at 24 Hz
velocities = [vibration_velocity(size * np.sin(2 * np.pi * 24 * time), fs) for size in unbalances]
zones = [severity_zone(velocity, machine) for velocity in velocities]

fig, ax = plt.subplots(figsize=(6.3, 3), layout="constrained")
ax.plot(unbalances, velocities, "o-")
for place, zone, velocity in zip(unbalances, zones, velocities, strict=True):
    ax.annotate(zone, (place, velocity), xytext=(-12, 4), textcoords="offset points")
for name, limit in limits.items():
    ax.axhline(limit, color="0.5", ls="--")
    ax.annotate(name, (0.04, limit), va="bottom")
ax.set(xlabel="unbalance [m/s² at 24 Hz]", ylabel="velocity [mm/s RMS]", ylim=(0, 6))
