"""Facts about the tacho: pulses are found and repaired, and the angle follows known motions."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import FS, TIME, TURN, turned
from scipy.interpolate import CubicSpline

from emacm.shaft.tacho import angle_from_pulses, angle_from_tacho, pulse_times

one_way = pytest.mark.parametrize("motion", ["constant", "ramp", "sinusoidal"])


def pulses_of(motion, start=0.3):
    """Return the times at which the shaft passes `start`, `start` + 1, ... revolutions."""
    angle = turned(motion)
    marks = np.arange(start, angle[-1] / TURN)
    return CubicSpline(angle, TIME)(marks * TURN)


def between(pulses):
    first, last = np.searchsorted(TIME, pulses[[0, -1]])
    return slice(first, last)


def worst(tacho, pulses, motion, start=0.3):
    """Return the largest error [rad] between the first and the last pulse."""
    return np.abs(tacho.angle + start * TURN - turned(motion))[between(pulses)].max()


# Raw tacho channel


def test_pulse_times_are_interpolated_between_samples():
    wave = np.sin(TURN * (10 * TIME - 0.123))
    expected = (np.arange(30) + 0.123) / 10
    np.testing.assert_allclose(pulse_times(wave, FS), expected, atol=1e-7)


def test_falling_edges_are_rising_edges_of_the_negative():
    wave = np.sin(TURN * 10 * TIME + 1)
    falling = pulse_times(wave, FS, edge="falling")
    np.testing.assert_allclose(falling, pulse_times(-wave, FS), atol=1e-12)


# Pulses to angle

BOUND = {"constant": 1e-10, "ramp": 1e-10, "sinusoidal": 5e-3}
LOST = {"constant": 1e-10, "ramp": 1e-10, "sinusoidal": 0.03}


@one_way
def test_clean_pulses_give_the_angle_and_nothing_to_report(motion):
    pulses = pulses_of(motion)
    tacho = angle_from_pulses(pulses, FS, len(TIME))
    assert worst(tacho, pulses, motion) < BOUND[motion]
    assert len(tacho.missing) == len(tacho.double) == 0


@one_way
def test_every_lost_pulse_away_from_the_ends_is_found_and_put_back(motion):
    pulses = pulses_of(motion)
    for lost in range(4, len(pulses) - 4):
        tacho = angle_from_pulses(np.delete(pulses, lost), FS, len(TIME))
        assert len(tacho.double) == 0
        np.testing.assert_allclose(tacho.missing, pulses[lost], atol=0.01)
        assert worst(tacho, pulses, motion) < LOST[motion]


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
@pytest.mark.parametrize("motion", ["constant", "ramp"])
def test_every_double_pulse_away_from_the_ends_is_found_and_taken_out(motion, share):
    pulses = pulses_of(motion)
    for before in range(3, len(pulses) - 4):
        stray = pulses[before] + share * (pulses[before + 1] - pulses[before])
        tacho = angle_from_pulses(np.insert(pulses, before + 1, stray), FS, len(TIME))
        assert len(tacho.missing) == 0
        np.testing.assert_array_equal(tacho.double, [stray])
        assert worst(tacho, pulses, motion) < BOUND[motion]


@pytest.mark.parametrize("lost", [1, 2, -3, -2])
def test_a_pulse_lost_in_the_end_intervals_is_found_at_constant_speed(lost):
    pulses = pulses_of("constant")
    tacho = angle_from_pulses(np.delete(pulses, lost), FS, len(TIME))
    np.testing.assert_allclose(tacho.missing, pulses[[lost]], atol=1e-9)


@pytest.mark.parametrize("start", [0.01, 0.3, 0.9])
def test_a_start_from_rest_and_a_stop_are_no_faults(start):
    up = np.sqrt(np.arange(20) + start)
    for pulses in (up, up[-1] - up[::-1]):
        tacho = angle_from_pulses(pulses, 100, 500)
        assert len(tacho.missing) == len(tacho.double) == 0


@given(st.integers(0, 2**32 - 1))
def test_jitter_of_three_percent_makes_no_faults(seed):
    jitter = np.random.default_rng(seed).uniform(-0.03, 0.03, 40)
    tacho = angle_from_pulses(np.arange(40) + 1 + jitter, 10, 400)
    assert len(tacho.missing) == len(tacho.double) == 0


@pytest.mark.filterwarnings("ignore")  # of a speed that is no speed
@given(st.lists(st.floats(0.01, 10), min_size=1, max_size=20), st.floats(1, 60))
def test_the_angle_never_falls(intervals, pulses_per_rev):
    pulses = np.concatenate(([0], np.cumsum(intervals)))
    n_times = int(pulses[-1] * 100) + 2
    try:
        tacho = angle_from_pulses(pulses, 100, n_times, pulses_per_rev=pulses_per_rev)
    except ValueError as error:
        assert re.search("gaps of at most 10|follow the speed of", str(error))  # noqa: PT017
    else:
        assert np.diff(tacho.angle).min() > -1e-9


def test_beyond_the_pulses_the_speed_is_held():
    tacho = angle_from_pulses([1.0, 1.5, 2.0, 2.5], 10, 41)
    np.testing.assert_allclose(tacho.angle, 2 * TURN * (np.arange(41) / 10 - 1), atol=1e-12)


@pytest.mark.parametrize("pulses_per_rev", [60, 2.5])
def test_pulses_per_revolution_divide_the_angle(pulses_per_rev):
    tacho = angle_from_pulses(np.arange(11.0), 1, 11, pulses_per_rev=pulses_per_rev)
    np.testing.assert_allclose(tacho.angle, TURN * np.arange(11) / pulses_per_rev)


def test_ends_without_pulses_are_gaps():
    pulses = np.arange(10.0) + 12
    assert len(angle_from_pulses(pulses - 2, 1, 30).angle) == 30
    with pytest.raises(ValueError, match=r"got one of 12 before the first pulse at 12 s: a stand"):
        angle_from_pulses(pulses, 1, 30)
    with pytest.raises(ValueError, match=r"got one of 18 after the last pulse at 11 s: a standst"):
        angle_from_pulses(pulses - 10, 1, 30)
    lost = np.tile([0.0, 0, 1, 1], 20) * (np.arange(80) < 30)
    with pytest.raises(ValueError, match=r"the pulses of tacho: times must leave gaps of at most"):
        angle_from_tacho(lost, 4)


@one_way
def test_a_noisy_raw_tacho_gives_the_angle(motion):
    marks = np.clip(20 * (np.sin(turned(motion)) - 0.5), -1, 1)
    noise = np.random.default_rng(0).normal(0, 0.02, len(TIME))
    tacho = angle_from_tacho(marks + noise, FS)
    first = TURN / 12  # the sine passes 0.5
    pulses = pulse_times(marks, FS)
    error = np.abs(tacho.angle + first - turned(motion))[between(pulses)].max()
    assert error < 6e-3
    assert len(tacho.missing) == len(tacho.double) == 0


# The outermost intervals, where neighbours are on one side only


@pytest.mark.parametrize("sign", [1, -1])
def test_a_double_pulse_in_the_outermost_interval_of_a_ramp_is_taken_out(sign):
    intervals = 0.1 * np.exp(-0.2 * np.arange(9))
    clean = np.concatenate([[0.0], np.cumsum(intervals[::sign])])
    stray = 0.15 * intervals[0]
    stray = clean[-1] - stray if sign < 0 else stray
    spoilt = np.sort(np.append(clean, stray))
    found = angle_from_pulses(spoilt, 1000, int(1000 * clean[-1]))
    assert len(found.missing) == 0
    np.testing.assert_allclose(found.double, [stray])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_shaft_that_slows_down_unevenly_from_its_first_pulse_has_no_double_pulse(sign):
    intervals = [0.05, 0.1, 0.102, 0.131, 0.133, 0.134, 0.135, 0.136]
    pulses = np.concatenate([[0.0], np.cumsum(intervals[::sign])])
    found = angle_from_pulses(pulses, 1000, int(1000 * pulses[-1]))
    assert len(found.double) == len(found.missing) == 0


RARE = np.isin(np.arange(30_000), [5000, 15_000]) * 1.0
REGULAR = np.arange(9.0)


@pytest.mark.parametrize(
    ("function", "arguments", "options", "error", "words"),
    [
        (pulse_times, (np.full(100, 3), FS), {}, ValueError, "flat channel"),
        (pulse_times, ([0, 1, 0, 1], FS), {"threshold": 4, "hysteresis": 1}, ValueError, "none in"),
        (pulse_times, (RARE, FS), {}, ValueError, "two levels"),
        (pulse_times, ([0, 1, 0], FS), {"edge": "up"}, ValueError, "edge must be one of"),
        (pulse_times, ([0, 1, 0], FS), {"hysteresis": -1}, ValueError, "hysteresis must be"),
        (angle_from_tacho, ([0.0, 1.0] * 5, 0), {}, ValueError, "fs must be"),
        (angle_from_pulses, ([0, 5, 0, 5], FS, 100), {}, ValueError, "at pulse 2.* raw tacho"),
        (angle_from_pulses, ([1000, 2000, 3000], FS, 10_000), {}, ValueError, "Are they in s"),
        (angle_from_pulses, ([1.0], FS, 100), {}, ValueError, "at least 2"),
        (angle_from_pulses, (REGULAR, 1, 9.5), {}, TypeError, "n_times"),
        (angle_from_pulses, (REGULAR, 1, 9), {"pulses_per_rev": 0}, ValueError, "pulses_per_rev"),
        (
            angle_from_pulses,
            (np.concatenate((REGULAR, REGULAR + 39)), 1, 50),
            {},
            ValueError,
            "at most 10 intervals, .* after pulse 8 at 8 s",
        ),
    ],
)
def test_wrong_input_is_refused(function, arguments, options, error, words):
    with pytest.raises(error, match=words):
        function(*arguments, **options)


def test_square_pulses_err_by_half_a_sample():
    expected = (np.arange(30) + 0.12345) / 10
    square = np.mod(10 * TIME - 0.12345, 1) < 0.2
    times = pulse_times(square[TIME > 0.005], FS) + np.argmax(TIME > 0.005) / FS
    assert np.abs(times - expected).max() <= 0.5 / FS + 1e-12
