"""Facts about vibration severity: a tone has a known velocity, and a velocity a known zone."""

import numpy as np
import pytest

from emacm import Recording
from emacm.monitoring import severity_zone, severity_zones, vibration_severity, vibration_velocity


def tone(frequency, amplitude, fs=5120.0, seconds=6.3):
    return amplitude * np.cos(2 * np.pi * frequency * np.arange(int(seconds * fs)) / fs + 0.4)


def test_tones_outside_the_band_an_offset_and_drift_do_not_count():
    inside = tone(87.0, 3.0)
    outside = tone(4.0, 3.0) + tone(1200.0, 3.0) + 7.0 + np.linspace(0, 1, len(inside))
    expected = vibration_velocity(inside, 5120.0)
    assert vibration_velocity(inside + outside, 5120.0) == pytest.approx(expected, rel=5e-3)


def test_noise_has_the_velocity_of_its_density():
    fs, density = 4096.0, 0.02  # (m/s2)^2 / Hz
    noise = np.random.default_rng(1).standard_normal(400_000) * np.sqrt(density * fs / 2)
    expected = 1e3 * np.sqrt(density / (2 * np.pi) ** 2 * (1 / 10 - 1 / 1000))
    assert vibration_velocity(noise, fs) == pytest.approx(expected, rel=0.03)


def test_boundaries_are_those_of_the_standards():
    table = severity_zones()
    boundaries = table[["A/B", "B/C", "C/D"]]
    assert boundaries.loc["group 1 flexible"].tolist() == [3.5, 7.1, 11.0]
    assert boundaries.loc["class IV"].tolist() == [2.8, 7.1, 18.0]
    assert (boundaries.diff(axis=1).iloc[:, 1:] > 0).all(axis=None)
    assert set(table["source"]) == {"ISO 20816-3", "ISO 10816-1"}


def test_a_boundary_belongs_to_the_better_zone():
    assert severity_zone([2.3, 2.31, 4.5, 7.1, 7.2], "group 1 rigid").tolist() == list("ABBCD")


def test_a_recording_is_judged_by_its_acceleration_channels():
    signals = {"radial": tone(25.0, 0.02), "current": tone(5.0, 9.0), "axial": tone(25.0, 0.9)}
    units = {"radial": "g", "current": "A", "axial": "m/s2"}
    recording = Recording(signals, 5120.0, velocity=160.0, units=units)
    found = vibration_severity(recording, "group 2 rigid")
    assert found.index.tolist() == ["radial", "axial"]
    assert found["zone"].tolist() == ["A", "C"]
    velocities = [9.80665 * 0.02e3 / (2 * np.pi * 25), 0.9e3 / (2 * np.pi * 25)]
    np.testing.assert_allclose(found["velocity"], np.divide(velocities, np.sqrt(2)), rtol=2e-3)


def test_unsuitable_input_is_refused():
    with pytest.raises(ValueError, match=r"half the sampling rate, .* at most 800, got 1000"):
        vibration_velocity(np.ones(5000), 1600.0)
    with pytest.raises(ValueError, match="machine_class must be one of"):
        severity_zone(1.0, "class V")
    with pytest.raises(ValueError, match="velocity must be finite and not negative"):
        severity_zone([1.0, np.nan], "class I")
    with pytest.raises(TypeError, match="must be a Recording, got list"):
        vibration_severity([1.0, 2.0], "class I")
    bare = Recording({"radial": np.ones(9000)}, 3000.0, velocity=9.0)
    with pytest.raises(ValueError, match="no channel of \\['radial'\\] has a unit of acceleration"):
        vibration_severity(bare, "class I")
