"""Simulated recordings with known faults, for tests and studies.

- `chapter3_recordings`: the signals of chapter 3 of the thesis, Eqs. (3.1) to (3.6).
- `LaboratoryBench`: the laboratory of chapter 4, with ten kinds of faults and unit-to-unit
  variation. `meta` of a recording contains the truth: unit, condition, run, label, severity, and
  the orders of the fault.
- `simulate_fleet`: a preset of the bench with short runs at 4 kHz, to try a pipeline within
  seconds.
- `WearLaw`, `run_to_failure_fleet`: units whose damage grows by a known law until they fail.

The same seed gives the same recordings, in any order of simulation.

Examples
--------
>>> from emacm.simulation import LaboratoryBench
>>> bench = LaboratoryBench(unit=7, faults={"screw": 0.8}, duration=0.5)
>>> bench.record(condition=4, run=2).meta["label"]
'screw'
"""

from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.chapter3 import CHAPTER3_ORDERS, chapter3_recording, chapter3_recordings
from emacm.simulation.faults import FAULT_ORDERS
from emacm.simulation.fleet import WearLaw, run_to_failure_fleet, simulate_fleet, thesis_benches
from emacm.simulation.laboratory import CONDITIONS

__all__ = [
    "CHAPTER3_ORDERS",
    "CONDITIONS",
    "FAULT_ORDERS",
    "LaboratoryBench",
    "WearLaw",
    "chapter3_recording",
    "chapter3_recordings",
    "run_to_failure_fleet",
    "simulate_fleet",
    "thesis_benches",
]
