"""The bench: tables 4.1 to 4.3 of the thesis, assumed constants, and the actuator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.constants import inch, lbf

Array = NDArray[np.floating]

RPM = 2 * np.pi / 60  # rad/s

PEAK_SPEED = 4572 * RPM  # rad/s, Table 4.1
RATED_FORCE = 3700 * lbf  # N, Table 4.1
RATED_CURRENT = 15.6 * float(np.sqrt(2))  # A peak, Table 4.1
SUPPLY_VOLTAGE = 220.0  # V RMS between phases, Table 4.1


class Condition(NamedTuple):
    """One row of Table 4.3 of the thesis: a position command and a load.

    Attributes
    ----------
    shape : {"sine", "triangle"}
        Shape of the position command.
    bias, amplitude : float
        Centre and amplitude of the position [in].
    frequency : float
        Frequency of the command [Hz].
    spring_rate : float
        Load force per position [lbf/in], relative to position 0 (assumed: the middle of the
        stroke, where the LVDT reads 0).
    load_bias : float
        Load force at position 0 [lbf].

    Examples
    --------
    >>> CONDITIONS[3].position(np.array([0.0, 0.25, 0.5, 0.75]) / 2.14).round(9)
    array([ 0.25,  2.3 ,  0.25, -1.8 ])
    """

    shape: str
    bias: float
    amplitude: float
    frequency: float
    spring_rate: float
    load_bias: float

    def position(self, times: Array, phase: float = 0.0) -> Array:
        """Return the commanded position [in] at some times [s]; `phase` is that at time 0 [rad]."""
        wave = np.sin(2 * np.pi * self.frequency * times + phase)
        if self.shape == "triangle":
            wave = 2 / np.pi * np.arcsin(wave)
        return self.bias + self.amplitude * wave

    def load(self, position: Any) -> Any:
        """Return the load against motion to larger positions [lbf], at a position [in]."""
        return self.load_bias + self.spring_rate * position


CONDITIONS: Mapping[int, Condition] = {
    1: Condition("sine", 1.90, 0.10, 0.70, 0.0, 116.0),
    2: Condition("triangle", 1.40, -0.90, 1.00, 0.0, 278.0),
    3: Condition("triangle", 0.25, 2.05, 2.14, 0.0, 660.0),
    4: Condition("sine", 0.10, -2.20, 0.70, -1210.0, -1867.0),
    5: Condition("triangle", 1.15, -1.55, 0.41, -550.0, 255.0),
}


class Transducer(NamedTuple):
    """One row of Table 4.2 of the thesis, and assumed disturbances [V].

    Attributes
    ----------
    scale, peak : float
        Units per volt, and full scale in the same units.
    noise : float
        RMS noise up to half of 48 kHz.
    mains, carrier : float
        Amplitude of the mains, and of the switching of the inverter, in the cable. The phase
        current contains the switching as ripple instead.
    bandwidth : float
        -3 dB bandwidth [Hz] of the demodulator of the LVDT (excitation of some kHz) and of the
        velocity output of the resolver converter (tracking loop of 14 bits); Butterworth of
        second order. The others have more than the conditioning filter passes.
    pickup : tuple of float
        Electrical noise of the motor in the cable at rated current, at 2 and 6 times the
        electrical order: section 4.5 of the thesis reports orders 12 and 36.
    """

    scale: float
    peak: float
    noise: float
    mains: float
    carrier: float = 0.0
    bandwidth: float = np.inf
    pickup: tuple[float, ...] = ()


TRANSDUCERS: Mapping[str, Transducer] = {
    "lvdt": Transducer(0.5, 3.0, 1e-3, 1e-3, 2e-3, 250.0, (2e-3, 1.5e-3)),  # in
    "velocity": Transducer(500 * RPM, 4700 * RPM, 2e-3, 1e-3, 3e-3, 800.0, (6e-3, 4e-3)),
    "current": Transducer(5.0, 50.0, 5e-3, 1e-3),  # A
    "accelerometer": Transducer(1.0, 10.0, 3e-3, 5e-4, 1e-3),  # g
}


class Variation(NamedTuple):
    """Variation of a constant of `Actuator`.

    Parts of the same design agree within per cents, except for friction and the effects of shape
    deviations.

    Attributes
    ----------
    units, runs : float
        Standard deviation of the logarithm, from unit to unit and from run to run.
    warm : float
        Change of the logarithm from the cold to the warm unit, about 30 K: grease, magnets (-0.1
        %/K), stiffness of the fixture, sensors.
    """

    units: float
    runs: float = 0.0
    warm: float = 0.0


VARIATIONS: Mapping[str, Variation] = {
    "coulomb": Variation(0.15, 0.03, -0.15),
    "viscous": Variation(0.15, 0.03, -0.4),
    "torque_gain": Variation(0.02, warm=-0.03),
    "ripple": Variation(0.4),
    "cogging": Variation(0.3),
    "unbalance": Variation(0.4),
    "rolling_noise": Variation(0.2, 0.03),
    "resonance": Variation(0.03, warm=-0.01),
    "damping": Variation(0.2),
    "lvdt_gain": Variation(0.003, warm=0.002),
    "accelerometer_gain": Variation(0.03, warm=0.01),
    "electrical_noise": Variation(0.3, 0.05),
}


class Assumed(NamedTuple):
    """Assumed constants of the acquisition, drive and housing of the bench.

    Constants of the actuator are in `Actuator`, of faults in `FAULTS`, and of the tables of the
    thesis in `CONDITIONS` and `TRANSDUCERS`. All constants below are assumed unless they name a
    source. All but drift, warm-up and mounting were written down before any classification.
    """

    # Acquisition
    noise_rate: float = 48_000.0  # Hz: sampling rate to which noise and the rolling noise refer
    pickup_floor: float = 0.3  # fraction of the motor's electrical noise without current
    # Mains in the cables, fixed in time: frequency [Hz], relative amplitude.
    mains_lines: tuple[tuple[float, float], ...] = ((60.0, 1.0), (180.0, 0.4), (300.0, 0.2))
    range: float = 10.0  # V, of the converter
    bits: int = 16  # of the converter
    filter_order: int = 4  # Butterworth conditioning filter
    shaft_decimation: int = 10  # samples of the channels per sample of the shaft angle
    resolver_noise: float = 5e-5  # RMS relative to the amplitude: 14 bits
    # Orders of the error of the resolver, and amplitudes relative to `Actuator.resolver_error`:
    # eccentric mounting; unequal amplitudes of sine and cosine; and saturation of its core by the
    # stray field of the motor, twice in each electrical period: 2 x 6 pole pairs.
    resolver_errors: tuple[tuple[int, float], ...] = ((1, 1.0), (2, 1.0), (12, 1 / 3))

    # Motor and inverter
    stiction_speed: float = 1.0  # rad/s: range over which friction changes its sign
    damping: float = 0.8  # damping ratio of the velocity loop
    dead_time: tuple[float, float] = (0.010, 0.007)  # 5th and 7th harmonic of the current
    cogging_order: int = 36  # least common multiple of 12 poles (Table 4.1) and 18 slots (assumed)
    voltage_reserve: float = 0.95  # part of the voltage for the planned motion: ripple needs more
    carrier: float = 10_000.0  # Hz: switching frequency of the inverter
    control_rate: float = 2000.0  # Hz
    headroom: float = 0.99  # limit of the velocity command relative to the peak speed: ripple adds
    load_error: float = 3.0  # lbf RMS: control error of the load actuator
    load_bandwidth: float = 10.0  # Hz, of this error
    holding_force: float = 10.0  # lbf: friction that holds the nut at its flank
    crossing_time: float = 0.002  # s, of the nut from flank to flank

    # Housing
    # Modes: frequency relative to the first, participation: fixture, housing and end shield, at
    # 420, 1900 and 5200 Hz.
    modes: tuple[tuple[float, float], ...] = ((1.0, 0.3), (1900 / 420, 0.4), (5200 / 420, 0.3))
    highest_mode: float = 0.45  # modal frequency, relative to the sampling rate
    contact: float = 1e-4  # s: duration of an impact
    impact_scatter: float = 0.2  # standard deviation of the logarithm of the size of an impact
    radial: float = 4.0  # N: force of the motor at rated current, at twice its electrical order
    preload: float = 0.2  # relative to the rated force
    free_torque: float = 0.3  # varying friction torque without load, relative to that at rated load

    # Rolling elements of a healthy unit
    # Lines of waviness and of the passage of balls: part and harmonic; force relative to
    # `Actuator.waviness`; torque relative to `Actuator.recirculation`. The balls of the screw enter
    # and leave their return channel at the order at which they pass a point of the nut.
    healthy_lines: tuple[tuple[str, int, float, float], ...] = (
        ("FTF", 1, 0.3, 0.2),
        ("BPFO", 1, 1.0, 0.3),
        ("BPFO", 2, 0.5, 0.1),
        ("BPFI", 1, 1.0, 0.3),
        ("BPFI", 2, 0.5, 0.1),
        ("2xBSF", 1, 0.7, 0.2),
        ("screw", 1, 1.0, 1.0),
        ("screw", 2, 0.5, 0.3),
    )
    slip: float = 0.005  # standard deviation of the interval between two balls, relative to it
    # Stribeck's epsilon of `ball_passage`; above 1 the whole ring is loaded, as under thrust.
    load_zone: float = 1.2
    line_rate: float = 12_000.0  # Hz, at which the lines of the rolling elements are computed
    walk_steps: int = 20  # samples at that rate per step of the slip

    # Variation
    of_lines: float = 0.5  # log of each line of healthy_lines and resolver_errors, over units
    warm_up: float = 8.0  # runs: time constant of the temperature
    coldest: tuple[float, float] = (0.0, 0.5)  # warmth at the first run of a unit in a condition
    # 1/s: warmth gained while a unit moves, 1.5 K in 10 s at the contacts; it cools between the
    # runs. Friction and the gains of LVDT and accelerometer drift with it; rotor and fixture are
    # too heavy.
    heating: float = 0.005
    mounting: float = 0.05  # standard deviation of the log of the gain of a mounted accelerometer
    runs_per_mounting: int = 5  # runs after which the accelerometer is mounted again
    before: float = 0.1  # s simulated before the recording, so that filters and resonances settle


ASSUMED = Assumed()


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """Constants of one electro-mechanical actuator on the bench.

    The thesis states 12 poles, a peak speed of 4572 RPM at 220 V, and 3700 lbf at 15.6 A RMS
    (Table 4.1). All constants below are assumed; constants of sensors and drive are in
    `laboratory.constants`.

    Attributes
    ----------
    screw_lead : float
        Travel per revolution [in]. By Table 4.1 the back-EMF between phases at 4572 RPM is
        1310 V per inch of lead at the efficiency below: 220 V allow 0.168 in. The default is
        4 mm, a common lead: 206 V.
    efficiency : float
        Efficiency of the ball screw; the loss is friction in proportion to the load.
    inertia : float
        Moment of inertia of all rotating parts [kg m²].
    coulomb, viscous : float
        Coulomb [N m] and viscous friction [N m s/rad] without load.
    stiffness : float
        Stiffness of nut, rod and clevis [N/m].
    winding_resistance : float
        Resistance of a phase [Ohm].
    winding_inductance : float
        Inductance of a phase [H]; the same in both axes.
    max_current : float
        Current limit of the controller [A].
    torque_gain : float
        Torque constant relative to that of Table 4.1.
    position_gain : float
        Velocity command per position error [1/s].
    velocity_bandwidth : float
        Bandwidth of the velocity loop [Hz].
    ripple : float
        Amplitude of the 1x torque ripple (alignment) [N m].
    cogging : float
        Cogging torque [N m], at order 36: the least common multiple of 12 poles and 18 slots.
    unbalance : float
        Mass times radius of the rotor [kg m]; 4e-5 is the balance grade G 6.3 of 3 kg.
    waviness : float
        Amplitude of the force of a ball-pass line of a healthy unit, with load and preload equal
        to the rated force [N]: some 10 nm of waviness on a contact of 5e7 N/m.
    recirculation : float
        Amplitude of the friction torque of balls that enter the return of the screw [N m].
    resolver_error : float
        Amplitude of the error of the resolver at orders 1 and 2 [arcmin]; a third at order 12.
    rolling_noise : float
        RMS force of the rolling elements on the housing, white up to 24 kHz, at peak speed and
        with load and preload equal to the rated force [N].
    housing_mass : float
        Mass of the housing [kg].
    resonance, damping : float
        Frequency [Hz] and damping ratio of the first mode of the housing (fixture).
    lvdt_gain, lvdt_offset : float
        Reading per position, and reading at position 0 [in].
    accelerometer_gain : float
        Reading per acceleration.
    phase_mismatch : float
        Negative-sequence current relative to the positive sequence: relative excess of the
        current of phase A.
    electrical_noise : float
        Electrical noise of the motor in the cables of LVDT and velocity, relative to the default.
    mark : float
        Angular position of ripple, unbalance and defects on the shaft [rad].

    Examples
    --------
    >>> round(Actuator().torque_constant, 3)
    0.528
    """

    screw_lead: float = 0.1575
    efficiency: float = 0.9
    inertia: float = 1.5e-3
    coulomb: float = 0.4
    viscous: float = 1e-3
    stiffness: float = 1e8
    winding_resistance: float = 0.25
    winding_inductance: float = 1.5e-3
    max_current: float = 40.0
    torque_gain: float = 1.0
    position_gain: float = 40.0
    velocity_bandwidth: float = 60.0
    ripple: float = 0.05
    cogging: float = 0.02
    unbalance: float = 4e-5
    waviness: float = 1.0
    recirculation: float = 0.01
    resolver_error: float = 3.0
    rolling_noise: float = 20.0
    housing_mass: float = 12.0
    resonance: float = 420.0
    damping: float = 0.04
    lvdt_gain: float = 1.0
    lvdt_offset: float = 0.0
    accelerometer_gain: float = 1.0
    phase_mismatch: float = 0.0
    electrical_noise: float = 1.0
    mark: float = 0.0

    @cached_property
    def torque_per_force(self) -> float:
        """Torque per force without friction [m]: ``lead / 2 pi``."""
        return self.screw_lead * inch / (2 * np.pi)

    @cached_property
    def torque_constant(self) -> float:
        """Torque per ampere of the current vector [N m/A], by Table 4.1."""
        rated = RATED_FORCE * self.torque_per_force / 0.9  # at the nominal efficiency
        return self.torque_gain * rated / RATED_CURRENT

    @cached_property
    def emf_constant(self) -> float:
        """Peak back-EMF of a phase per speed [V s/rad]: ``2/3`` of the torque constant."""
        return 2 / 3 * self.torque_constant

    @cached_property
    def max_torque(self) -> float:
        """Torque at the current limit [N m]."""
        return self.torque_constant * self.max_current

    @cached_property
    def angle_per_inch(self) -> float:
        """Shaft angle per position [rad/in]."""
        return 2 * np.pi / self.screw_lead


def draw_unit(rng: np.random.Generator, spread: float = 1.0) -> Actuator:
    """Draw the constants of one unit; `spread` 0 gives the nominal actuator.

    Examples
    --------
    >>> draw_unit(np.random.default_rng(0), spread=0) == Actuator()
    True
    """
    logarithms = rng.normal(0, [by.units for by in VARIATIONS.values()])
    unit = _multiplied(Actuator(), dict(zip(VARIATIONS, logarithms, strict=True)), spread)
    offset, mismatch, turn = (spread * rng.normal(0, [0.002, 0.003, 2.0])).tolist()
    return replace(unit, lvdt_offset=offset, phase_mismatch=mismatch, mark=turn)


def draw_run(
    unit: Actuator, rng: np.random.Generator, spread: float, warmth: float, mounting: float
) -> Actuator:
    """Draw the constants of a unit in one run: friction, electrical noise, temperature, mounting.

    `spread` 0 gives the unit itself. With `warmth`, between 0 (cold) and 1 (warm), friction,
    torque constant and resonance fall; `mounting` is a standard normal deviate.
    """
    logarithms = {name: warmth * by.warm for name, by in VARIATIONS.items()}
    logarithms["accelerometer_gain"] += ASSUMED.mounting * mounting
    runs = {name: by.runs for name, by in VARIATIONS.items() if by.runs}
    for name, drawn in zip(runs, rng.normal(0, list(runs.values())), strict=True):
        logarithms[name] += drawn
    return _multiplied(unit, logarithms, spread)


def _multiplied(actuator: Actuator, logarithms: Mapping[str, float], spread: float) -> Actuator:
    """Return an actuator whose constants are multiplied by factors with these logarithms."""
    changed = {
        name: getattr(actuator, name) * float(np.exp(spread * logarithm))
        for name, logarithm in logarithms.items()
    }
    changed["damping"] = min(changed["damping"], 1.0)
    return replace(actuator, **changed)


def warmth(rng: np.random.Generator, run: int) -> float:
    """Return how warm a unit is in a run, from 1: 0 cold, 1 warm.

    Examples
    --------
    >>> [round(warmth(np.random.default_rng(0), run), 2) for run in (1, 10, 100)]
    [0.32, 0.78, 1.0]
    """
    first = rng.uniform(*ASSUMED.coldest)
    return float(1 - (1 - first) * np.exp(-(run - 1) / ASSUMED.warm_up))


def drift(name: str, times: Array, spread: float = 1.0) -> Array:
    """Return a constant of `VARIATIONS` during a recording, relative to its value at time 0 [s].

    Examples
    --------
    >>> drift("viscous", np.array([0.0, 10.0]))
    array([1.  , 0.98])
    """
    return 1 + spread * ASSUMED.heating * VARIATIONS[name].warm * times


def sines(angle: Array, *terms: tuple[float, float, float]) -> Array:
    """Return the sum of sines ``size * sin(order * angle + phase)``.

    Parameters
    ----------
    angle : ndarray of shape (n_times,)
        Angle of the shaft, or 2 pi times the time [rad].
    *terms : (float, float, float)
        Order (or frequency), size and phase [rad] of each sine.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> angle = np.array([0.0, np.pi / 6])
    >>> sines(angle, (3, 1.0, 0.0)).round(9), sines(angle, (3, 2.0, np.pi / 2)).round(9)
    (array([0., 1.]), array([2., 0.]))
    """
    total = np.zeros_like(angle)
    for order, size, phase in terms:
        if size:
            total += size * np.sin(order * angle + phase)
    return total
