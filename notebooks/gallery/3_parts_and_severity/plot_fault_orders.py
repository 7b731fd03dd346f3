"""
At which orders would the parts of my machine show a fault?
===========================================================

`fault_orders` computes them from the geometry: bearings, ball screws, gears, planetary stages,
motors. `ratio` relates a part on another shaft to the shaft that is measured.
"""

from matplotlib import pyplot as plt

from emacm import BallScrew, Bearing, Gear, Motor, fault_orders

parts = [
    Bearing(10, 0.2478, 1.0, 0.436, name="bearing"),
    BallScrew(20, 0.1323, 1.0, 0.2, name="screw"),
    Gear(13, 31, name="gear"),
    Motor(pole_pairs=6, name="motor"),
]
table = fault_orders(*parts)
print(table.to_string())

fig, ax = plt.subplots(figsize=(6.3, 3.6), layout="constrained")
ax.barh([str(name) for name in table.index], table["order"])
ax.bar_label(ax.containers[0], fmt="%.3f", padding=3)
ax.set(xlabel="order [cycles per revolution]", xlim=(0, 1.15 * table["order"].max()))
