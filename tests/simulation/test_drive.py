"""The drive keeps its voltage, balances its power, and switches at its carrier."""

import numpy as np
import pytest
from scipy import special

from emacm import _kernels
from emacm.simulation.actuator import PEAK_SPEED, Actuator
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.conditions import CONDITIONS
from emacm.simulation.drive import (
    VOLTAGE_LIMIT,
    carrier_ripple,
    drive_limits,
    phase_voltage,
    voltage_free_speed,
)

FS = 48_000


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("faults", [{}, {"jam": 1.0}, {"lubrication": 1.0, "phase imbalance": 1.0}])
def test_the_voltage_stays_below_that_of_the_supply(condition, faults):
    truth = LaboratoryBench(unit=1, faults=faults, duration=2.0).truth(condition)
    assert truth.voltage.max() < VOLTAGE_LIMIT
    assert VOLTAGE_LIMIT * np.sqrt(3 / 2) == pytest.approx(220)


def test_a_lead_of_0_2_in_would_need_262_volt():
    # 3700 lbf at 15.6 A and an efficiency of 0.9 determine the torque constant, and it the EMF.
    coarse, fine = (
        phase_voltage(np.zeros(1), np.array([PEAK_SPEED]), Actuator(screw_lead=lead))[0]
        for lead in (0.2, 4 / 25.4)
    )
    assert coarse * np.sqrt(3 / 2) == pytest.approx(262, abs=0.5)
    assert fine * np.sqrt(3 / 2) == pytest.approx(206.3, abs=0.5)
    assert coarse > VOLTAGE_LIMIT > fine


@pytest.mark.parametrize("condition", [3, 5])
def test_electrical_power_is_mechanical_power_and_copper_loss(condition):
    truth = LaboratoryBench(unit=2, faults={"screw": 0.6}, duration=1.0).truth(condition)
    unit, torques = truth.actuator, truth.torques
    current = torques.motor / unit.torque_constant
    across = unit.emf_constant * torques.velocity + unit.winding_resistance * current
    electrical = 1.5 * across * current  # the voltage along the flux meets no current
    mechanical = torques.motor * torques.velocity
    assert electrical - mechanical == pytest.approx(1.5 * unit.winding_resistance * current**2)
    along = 6 * torques.velocity * unit.winding_inductance * current
    assert truth.voltage == pytest.approx(np.hypot(across, along))


@pytest.mark.parametrize("velocity", [-474.0, -300.0, 0.0, 410.0, 474.0])
@pytest.mark.parametrize("wanted", [-30.0, -3.0, 2.0, 30.0])
def test_a_limited_torque_is_the_nearest_within_both_limits(velocity, wanted):
    actuator = Actuator()
    limited = _kernels.loops.limited_torque(wanted, velocity, drive_limits(actuator))
    candidates = np.linspace(-1.2, 1.2, 48_001) * actuator.max_torque
    volts = phase_voltage(candidates, np.full_like(candidates, velocity), actuator)
    allowed = candidates[
        (volts <= 0.95 * VOLTAGE_LIMIT) & (np.abs(candidates) <= actuator.max_torque)
    ]
    assert limited == pytest.approx(allowed[np.abs(allowed - wanted).argmin()], abs=2e-3)


def test_below_the_free_speed_any_torque_of_that_current_is_allowed():
    actuator = Actuator(screw_lead=0.14)
    speed = voltage_free_speed(actuator, 17.0)
    for torque in np.array([-17.0, 17.0]) * actuator.torque_constant:
        assert (
            _kernels.loops.limited_torque(torque, 0.999 * speed, drive_limits(actuator)) == torque
        )


def test_the_inverter_ripples_beside_its_carrier_and_sums_to_zero():
    # A constant 60 rev/s: lines at 10 kHz +- 2 x 6 x 60 Hz, by Holmes and Lipo.
    times = np.arange(FS) / FS
    volts, actuator = 120.0, Actuator()
    ripple = carrier_ripple(np.full(FS, volts), 2 * np.pi * 60 * times, times, 0.4, actuator)
    assert np.abs(ripple.sum(axis=0)).max() < 1e-12
    lines = np.abs(np.fft.rfft(ripple, axis=1)) / (FS / 2)
    assert np.flatnonzero(lines[0] > 1e-9).tolist() == [9280, 10_720]
    link = 220 * np.sqrt(2)
    size = 2 * link / np.pi * special.jv(2, np.pi / 2 * volts / (link / 2))
    expected = size / (2 * np.pi * 10_000 * actuator.winding_inductance)
    assert lines[:, [9280, 10_720]] == pytest.approx(np.full((3, 2), expected), rel=0.01)


def test_a_recording_contains_the_carrier_only_if_its_rate_can():
    def near_carrier(fs, cutoff):
        bench = LaboratoryBench(fs=fs, cutoff=cutoff, duration=1.0, phases="abc")
        current = bench.record(4).signals["current_b"].astype(float)
        power = np.abs(np.fft.rfft(current * np.hanning(len(current)))) ** 2
        hertz = np.fft.rfftfreq(len(current), 1 / fs)
        band = (hertz > 9000) & (hertz < 11_000)
        return power[band].max() / np.median(power[hertz > 5000]) if band.any() else None

    assert near_carrier(48_000, 15_000) > 100
    assert near_carrier(16_000, 6000) is None
