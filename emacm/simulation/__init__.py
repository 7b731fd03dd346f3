"""Simulated recordings with known faults, for tests and studies.

- `chapter3_recordings`: the signals of chapter 3 of the thesis, Eqs. (3.1) to (3.6).
- `LaboratoryBench`, `laboratory_recordings`: the laboratory of chapter 4, with ten kinds of faults
  and unit-to-unit variation. `meta` of a recording contains the truth: unit, condition, run,
  label, severity, and the orders of the fault.
- `simulate_actuator`, `simulate_fleet`: a preset of the bench with short runs at 4 kHz, to try a
  pipeline within seconds.
- `WearLaw`, `run_to_failure_fleet`: units whose damage grows by a known law until they fail.

The same seed gives the same recordings, in any order of simulation.

Examples
--------
>>> from emacm.simulation import LaboratoryBench
>>> bench = LaboratoryBench(unit=7, faults={"screw": 0.8}, duration=0.5)
>>> bench.record(condition=4, run=2).meta["label"]
'screw'
"""

from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.bench import BenchTruth, LaboratoryBench
from emacm.simulation.campaign import LaboratoryRecordings, laboratory_recordings, thesis_benches
from emacm.simulation.chapter3 import (
    CHAPTER3_ORDERS,
    chapter3_motion,
    chapter3_recording,
    chapter3_recordings,
)
from emacm.simulation.conditions import CONDITIONS, TRANSDUCERS, Condition, Transducer
from emacm.simulation.faults import BEARING, FAULT_ORDERS, FAULTS, SCREW, Fault
from emacm.simulation.fleet import STATES, simulate_actuator, simulate_fleet
from emacm.simulation.wear import UnitLife, WearLaw, run_to_failure_fleet

__all__ = [
    "BEARING",
    "CHAPTER3_ORDERS",
    "CONDITIONS",
    "FAULTS",
    "FAULT_ORDERS",
    "PEAK_SPEED",
    "SCREW",
    "STATES",
    "TRANSDUCERS",
    "Actuator",
    "BenchTruth",
    "Condition",
    "Fault",
    "LaboratoryBench",
    "LaboratoryRecordings",
    "Transducer",
    "UnitLife",
    "WearLaw",
    "chapter3_motion",
    "chapter3_recording",
    "chapter3_recordings",
    "laboratory_recordings",
    "run_to_failure_fleet",
    "simulate_actuator",
    "simulate_fleet",
    "thesis_benches",
]
