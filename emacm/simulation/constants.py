"""Assumed constants of sensors, drive and housing of the bench, and their variation.

Constants of the actuator are in `Actuator`, of faults in `FAULTS`, and of the tables of the thesis
in `CONDITIONS` and `TRANSDUCERS`. All constants below are assumed unless they name a source. They
were written down before any classification of the recordings, and depend on none.
"""

from __future__ import annotations

# --- Sensors ------------------------------------------------------------------------------------
# RMS noise of each sensor up to half of 48 kHz [V].
NOISE = {"lvdt": 1e-3, "velocity": 2e-3, "current": 5e-3, "accelerometer": 3e-3, "load": 1e-3}
NOISE_RATE = 48_000.0  # Hz: sampling rate to which NOISE and the rolling noise refer
# -3 dB bandwidth [Hz] of the demodulator of the LVDT (excitation of some kHz) and of the velocity
# output of the resolver converter (tracking loop of 14 bits); Butterworth of second order. Current
# sensor and accelerometer have more than the conditioning filter passes.
BANDWIDTH = {"lvdt": 250.0, "velocity": 800.0}
# Electrical noise of the motor in the cables [V at rated current], at 2 and 6 times the electrical
# order: section 4.5 of the thesis reports orders 12 and 36. Sizes assumed.
PICKUP = {"lvdt": (2e-3, 1.5e-3), "velocity": (6e-3, 4e-3)}
PICKUP_FLOOR = 0.3  # fraction without current
# Mains in the cables [V]: 60 Hz, with its third and fifth harmonic; fixed in time.
MAINS = {"lvdt": 1e-3, "velocity": 1e-3, "current": 1e-3, "accelerometer": 5e-4, "load": 1e-3}
MAINS_LINES = ((60.0, 1.0), (180.0, 0.4), (300.0, 0.2))  # frequency [Hz], relative amplitude
# Switching of the inverter in the cables [V]. The phase current contains it as ripple instead.
CARRIER_PICKUP = {"lvdt": 2e-3, "velocity": 3e-3, "accelerometer": 1e-3, "load": 1e-3}
RANGE, BITS = 10.0, 16  # range [V] and resolution of the converter
FILTER_ORDER = 4  # Butterworth conditioning filter
SHORT_RUN_CUTOFF = 0.375  # of that filter at low rates, relative to the sampling rate
SHAFT_DECIMATION = 10  # samples of the channels per sample of the shaft angle
RESOLVER_NOISE = 5e-5  # RMS relative to the amplitude: 14 bits
# Orders of the error of the resolver, and amplitudes relative to `Actuator.resolver_error`:
# eccentric mounting; unequal amplitudes of sine and cosine; and saturation of its core by the
# stray field of the motor, twice in each electrical period: 2 x 6 pole pairs.
RESOLVER_ERRORS = ((1, 1.0), (2, 1.0), (12, 1 / 3))

# --- Motor and inverter -------------------------------------------------------------------------
STICTION_SPEED = 1.0  # rad/s: range over which friction changes its sign
DAMPING = 0.8  # damping ratio of the velocity loop
DEAD_TIME = (0.010, 0.007)  # 5th and 7th harmonic of the current
COGGING_ORDER = 36  # least common multiple of 12 poles (Table 4.1) and 18 slots (assumed)
VOLTAGE_RESERVE = 0.95  # part of the voltage up to which the motion is planned: ripple needs more
CARRIER = 10_000.0  # Hz: switching frequency of the inverter

# --- Housing ------------------------------------------------------------------------------------
# Modes of the housing: frequency relative to the first, participation: fixture, housing and end
# shield, at 420, 1900 and 5200 Hz.
MODES = ((1.0, 0.3), (1900 / 420, 0.4), (5200 / 420, 0.3))
CONTACT = 1e-4  # s: duration of an impact
RADIAL = 4.0  # N: force of the motor at rated current, at twice its electrical order
PRELOAD = 0.2  # relative to the rated force
FREE_TORQUE = 0.3  # part of the varying friction torque without load, relative to rated load

# --- Rolling elements of a healthy unit ----------------------------------------------------------
# Lines of waviness and of the passage of balls: part and harmonic; force relative to
# `Actuator.waviness`; torque relative to `Actuator.recirculation`. The balls of the screw enter
# and leave their return channel at the order at which they pass a point of the nut.
HEALTHY_LINES = (
    ("FTF", 1, 0.3, 0.2),
    ("BPFO", 1, 1.0, 0.3),
    ("BPFO", 2, 0.5, 0.1),
    ("BPFI", 1, 1.0, 0.3),
    ("BPFI", 2, 0.5, 0.1),
    ("2xBSF", 1, 0.7, 0.2),
    ("screw", 1, 1.0, 1.0),
    ("screw", 2, 0.5, 0.3),
)
SLIP = 0.005  # standard deviation of the interval between two balls, relative to it

# --- Variation -----------------------------------------------------------------------------------
# Standard deviations of the logarithm, from unit to unit and from run to run: parts of the same
# design agree within per cents, except for friction and the effects of shape deviations.
OF_UNITS = {
    "coulomb": 0.15,
    "viscous": 0.15,
    "torque_gain": 0.02,
    "ripple": 0.4,
    "cogging": 0.3,
    "unbalance": 0.4,
    "rolling_noise": 0.2,
    "resonance": 0.03,
    "damping": 0.2,
    "lvdt_gain": 0.003,
    "accelerometer_gain": 0.03,
    "electrical_noise": 0.3,
}
OF_LINES = 0.5  # each line of HEALTHY_LINES and RESOLVER_ERRORS, from unit to unit
OF_RUNS = {"coulomb": 0.03, "viscous": 0.03, "rolling_noise": 0.03, "electrical_noise": 0.05}
# Change of the logarithm from the cold to the warm unit, about 30 K: grease, magnets (-0.1 %/K),
# stiffness of the fixture, sensors.
WARM = {
    "coulomb": -0.15,
    "viscous": -0.4,
    "torque_gain": -0.03,
    "resonance": -0.01,
    "lvdt_gain": 0.002,
    "accelerometer_gain": 0.01,
}
WARM_UP = 8.0  # runs: time constant of the temperature
# 1/s: warmth gained while a unit moves, 1.5 K in 10 s at the contacts; it cools between the runs.
# Friction and the gains of LVDT and accelerometer drift with it; rotor and fixture are too heavy.
HEATING = 0.005
COLDEST = (0.0, 0.5)  # range of the warmth at the first run of a unit in a condition
MOUNTING = 0.05  # standard deviation of the logarithm of the gain of a mounted accelerometer
RUNS_PER_MOUNTING = 5  # runs after which the accelerometer is mounted again
