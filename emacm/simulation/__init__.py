"""Simulated recordings with known faults, for tests and studies.

- `chapter3_recordings`: the signals of chapter 3 of the thesis, Eqs. (3.1) to (3.6).
- `simulate_fleet`: actuators with unit-to-unit variation, healthy or with one of two faults.
- `WearLaw`, `run_to_failure_fleet`: units whose damage grows by a known law until they fail.

`meta` of a recording contains the truth: unit, run, label, severity, and the orders of the fault.
The same seed gives the same recordings, in any order of simulation. The laboratory of chapter 4 of
the thesis is simulated by `benchmarks/laboratory`, in a copy of the repository.

Examples
--------
>>> from emacm.simulation import simulate_fleet
>>> recordings, states, units = simulate_fleet(1, 1)
>>> recordings[1].meta["label"], recordings[1].meta["orders"]
('screw', {'screw': (9.064,)})
"""

from emacm.simulation.chapter3 import CHAPTER3_ORDERS, chapter3_recording, chapter3_recordings
from emacm.simulation.fleet import WearLaw, run_to_failure_fleet, simulate_fleet

__all__ = [
    "CHAPTER3_ORDERS",
    "WearLaw",
    "chapter3_recording",
    "chapter3_recordings",
    "run_to_failure_fleet",
    "simulate_fleet",
]
