"""The laboratory of chapter 4 of the thesis, simulated: a test bench with one actuator on it.

- `LaboratoryBench`: the bench, with ten kinds of faults and unit-to-unit variation. `meta` of a
  recording contains the truth: unit, condition, run, label, severity, and the orders of the fault.
- `thesis_benches`: the two units of the thesis.
- `simulate_actuator`, `simulate_fleet`: short runs at 4 kHz in condition 4.

The same seed gives the same recordings, in any order of simulation. Benchmarks, and notebooks about
chapter 4, import this package from their copy of the repository.
"""

from laboratory.bench import LaboratoryBench
from laboratory.constants import CONDITIONS
from laboratory.faults import FAULT_ORDERS, FAULTS
from laboratory.fleet import simulate_actuator, simulate_fleet, thesis_benches

__all__ = [
    "CONDITIONS",
    "FAULTS",
    "FAULT_ORDERS",
    "LaboratoryBench",
    "simulate_actuator",
    "simulate_fleet",
    "thesis_benches",
]
