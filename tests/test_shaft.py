"""Facts about shaft angle sources: each method follows known motions to the error it states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from emacm.shaft import (
    TachoAngle,
    angle_from_currents,
    angle_from_position,
    angle_from_pulses,
    angle_from_resolver,
    angle_from_tacho,
    angle_from_velocity,
    angle_from_wrapped,
    is_wrapped,
    pulse_times,
)

TURN = 2 * np.pi
FS = 10_000.0
TIME = np.arange(int(3 * FS)) / FS

# Motion: angle [rad] and its speed [rad/s], as functions of time.
MOTIONS = {
    "constant": (lambda t: TURN * 10 * t, lambda t: TURN * 10 + 0 * t),
    "ramp": (lambda t: TURN * (2 * t + 3 * t**2), lambda t: TURN * (2 + 6 * t)),
    "sinusoidal": (
        lambda t: TURN * (10 * t + np.sin(TURN * t) / np.pi),
        lambda t: TURN * (10 + 2 * np.cos(TURN * t)),
    ),
    "reversing": (
        lambda t: 30 / TURN * (1 - np.cos(TURN * t)),
        lambda t: 30 * np.sin(TURN * t),
    ),
}
every_motion = pytest.mark.parametrize("motion", MOTIONS)
one_way = pytest.mark.parametrize("motion", ["constant", "ramp", "sinusoidal"])


def turned(motion):
    return MOTIONS[motion][0](TIME)


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


def currents_of(electrical, torque=1.0, zero=0.0):
    return np.array([torque * np.sin(electrical - k * TURN / 3) + zero for k in range(3)])


def relative(angle):
    return angle - angle[0]


# Velocity


@pytest.mark.parametrize(
    ("motion", "bound"),
    [("constant", 1e-10), ("ramp", 1e-10), ("sinusoidal", 7e-8), ("reversing", 3.2e-7)],
)
def test_velocity_integrates_to_the_angle(motion, bound):
    velocity = MOTIONS[motion][1](TIME)
    assert np.abs(angle_from_velocity(velocity, FS) - turned(motion)).max() < bound


def test_velocity_starts_at_the_initial_angle_and_keeps_its_length():
    angle = angle_from_velocity([1.0, 1.0, 1.0], 1, initial=5)
    np.testing.assert_array_equal(angle, [5, 6, 7])


def test_velocity_in_float32_is_summed_in_float64():
    velocity = np.full(100_000, 100, dtype=np.float32)
    angle = angle_from_velocity(velocity, FS)
    assert angle.dtype == np.float64
    assert abs(angle[-1] - 999.99) < 1e-8


@given(st.lists(st.floats(-100, 100), min_size=3, max_size=50))
def test_velocity_of_chords_gives_back_the_angle(values):
    angle = np.array(values)
    speeds = np.diff(angle)
    halves = np.repeat(speeds, 2)  # each chord sampled at its two ends, one trapezoid each
    summed = angle_from_velocity(halves, 1)[1::2] - angle_from_velocity(halves, 1)[::2]
    np.testing.assert_allclose(np.cumsum(summed), angle[1:] - angle[0], atol=1e-9)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=3))
def test_velocity_of_the_derivative_gives_back_the_motion(coefficients):
    motion = np.polynomial.Polynomial([0.5, *coefficients])
    t = np.linspace(0, 1, 1001)
    angle = angle_from_velocity(motion.deriv()(t), 1000, initial=0.5)
    np.testing.assert_allclose(angle, motion(t), rtol=0, atol=4e-6)


def test_velocity_with_a_nan_names_the_sample():
    with pytest.raises(ValueError, match=r"velocity must be finite, got nan at sample 2"):
        angle_from_velocity([1, 2, np.nan], 1)


def test_velocity_needs_a_positive_rate():
    with pytest.raises(ValueError, match=r"fs must be a number of Hz, above 0, got 0"):
        angle_from_velocity([1, 2], 0)


def test_velocity_needs_a_numeric_initial_angle():
    with pytest.raises(TypeError, match=r"initial must be a number"):
        angle_from_velocity([1, 2], 1, initial="zero")


# Wrapped angle


@every_motion
def test_wrapped_angle_unwraps_to_the_motion(motion):
    wrapped = np.mod(turned(motion), TURN)
    assert np.abs(angle_from_wrapped(wrapped) - turned(motion)).max() < 1e-11


@pytest.mark.parametrize("period", [360, 4096])
def test_wrapped_angle_in_degrees_or_counts_comes_out_in_radians(period):
    wrapped = np.mod(turned("reversing") / TURN * period, period)
    np.testing.assert_allclose(
        angle_from_wrapped(wrapped, period=period), turned("reversing"), atol=1e-11
    )


def test_whole_counts_err_by_at_most_one_count():
    counts = np.floor(np.mod(turned("ramp") / TURN * 4096, 4096)).astype(np.uint16)
    error = np.abs(angle_from_wrapped(counts, period=4096) - turned("ramp"))
    assert error.max() < TURN / 4096 + 1e-11


@given(st.floats(-3, 3), st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=100))
def test_wrapping_and_unwrapping_is_a_round_trip(start, steps):
    angle = start + np.concatenate(([0], np.cumsum(steps)))
    wrapped = np.angle(np.exp(1j * angle))
    np.testing.assert_allclose(angle_from_wrapped(wrapped), angle, atol=1e-10)


def test_wrapped_angle_needs_a_positive_period():
    with pytest.raises(ValueError, match=r"period must be a number above 0, got -360"):
        angle_from_wrapped([1, 2], period=-360)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_angle_wrapped_at_two_pi_or_at_pi_is_wrapped(dtype):
    assert is_wrapped(np.array([0, TURN, 0.1], dtype=dtype))
    assert is_wrapped(np.array([-np.pi, np.pi, -3], dtype=dtype))


@pytest.mark.parametrize("angle", [[0, 3, 6], [0, 4, 8], [1, 1], [0, TURN * (1 + 1e-6)]])
def test_an_angle_with_small_steps_or_a_wide_span_is_not_wrapped(angle):
    assert not is_wrapped(angle)


def test_is_wrapped_names_a_bad_sample():
    with pytest.raises(ValueError, match=r"angle must be finite, got inf at sample 1"):
        is_wrapped([0, np.inf])


# Raw tacho channel


def test_pulse_times_are_interpolated_between_samples():
    wave = np.sin(TURN * (10 * TIME - 0.123))
    expected = (np.arange(30) + 0.123) / 10
    np.testing.assert_allclose(pulse_times(wave, FS), expected, atol=1e-7)


def test_falling_edges_are_rising_edges_of_the_negative():
    wave = np.sin(TURN * 10 * TIME + 1)
    np.testing.assert_allclose(
        pulse_times(wave, FS, edge="falling"), pulse_times(-wave, FS), atol=1e-12
    )


def test_noise_on_a_tacho_makes_no_double_pulses():
    noise = np.random.default_rng(0).normal(0, 0.05, len(TIME))
    times = pulse_times(np.sin(TURN * (10 * TIME - 0.123)) + noise, FS)
    assert len(times) == 30
    assert np.abs(times - (np.arange(30) + 0.123) / 10).max() < 3e-3


def test_square_pulses_err_by_half_a_sample():
    expected = (np.arange(30) + 0.12345) / 10
    square = np.mod(10 * TIME - 0.12345, 1) < 0.2
    times = pulse_times(square[TIME > 0.005], FS) + np.argmax(TIME > 0.005) / FS
    assert np.abs(times - expected).max() <= 0.5 / FS + 1e-12


def test_a_lone_spike_does_not_move_the_threshold():
    wave = np.sin(TURN * (10 * TIME - 0.123))
    spiked = wave.copy()
    spiked[1373] = 2.5
    np.testing.assert_allclose(pulse_times(spiked, FS), pulse_times(wave, FS), atol=1e-6)


def test_threshold_and_hysteresis_may_be_given():
    times = pulse_times([0, 1, 0, 5, 0, 1, 0, 5], 1, threshold=2.5, hysteresis=1)
    np.testing.assert_allclose(times, [2.5, 6.5])


def test_a_flat_tacho_is_an_error():
    with pytest.raises(ValueError, match=r"got a flat channel, 3 throughout. Check the sensor"):
        pulse_times(np.full(100, 3), FS)


def test_a_tacho_without_an_edge_is_an_error():
    with pytest.raises(ValueError, match=r"at least one rising edge through 4 ± 0.5, got none in"):
        pulse_times([0, 1, 0, 1], FS, threshold=4, hysteresis=1)


def test_peaks_too_rare_for_levels_are_an_error():
    rare = np.random.default_rng(0).normal(0, 0.01, 30_000)
    rare[[5000, 15000]] = 1
    with pytest.raises(ValueError, match=r"must have two levels.* Set threshold and hysteresis"):
        pulse_times(rare, FS)


def test_an_unknown_edge_is_an_error():
    with pytest.raises(ValueError, match=r"edge must be one of 'rising', 'falling'; got 'up'"):
        pulse_times([0, 1, 0], FS, edge="up")


def test_a_negative_hysteresis_is_an_error():
    with pytest.raises(ValueError, match=r"hysteresis must be a number at least 0, got -1"):
        pulse_times([0, 1, 0], FS, hysteresis=-1)


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


@pytest.mark.parametrize("share", [0.05, 0.3, 0.5, 0.7, 0.95])
@pytest.mark.parametrize("motion", ["constant", "ramp"])
def test_every_double_pulse_away_from_the_ends_is_found_and_taken_out(motion, share):
    pulses = pulses_of(motion)
    for before in range(3, len(pulses) - 4):
        stray = pulses[before] + share * (pulses[before + 1] - pulses[before])
        tacho = angle_from_pulses(np.insert(pulses, before + 1, stray), FS, len(TIME))
        assert len(tacho.missing) == 0
        np.testing.assert_array_equal(tacho.double, [stray])
        assert worst(tacho, pulses, motion) < BOUND[motion]


def test_a_gap_of_several_pulses_is_filled():
    pulses = pulses_of("ramp")
    tacho = angle_from_pulses(np.delete(pulses, [12, 13, 14]), FS, len(TIME))
    np.testing.assert_allclose(tacho.missing, pulses[12:15], atol=0.01)
    assert worst(tacho, pulses, "ramp") < 1e-10


@one_way
@pytest.mark.parametrize("apart", [2, 3])
def test_two_gaps_close_together_are_both_filled(motion, apart):
    pulses = pulses_of(motion)
    lost = [8, 8 + apart]
    tacho = angle_from_pulses(np.delete(pulses, lost), FS, len(TIME))
    np.testing.assert_allclose(tacho.missing, pulses[lost], atol=0.02)
    assert len(tacho.double) == 0


@pytest.mark.parametrize("lost", [1, 2, -3, -2])
def test_a_pulse_lost_in_the_end_intervals_is_found_at_constant_speed(lost):
    pulses = pulses_of("constant")
    tacho = angle_from_pulses(np.delete(pulses, lost), FS, len(TIME))
    np.testing.assert_allclose(tacho.missing, pulses[[lost]], atol=1e-9)


def test_missing_and_double_pulses_are_repaired_together():
    pulses = pulses_of("ramp")
    stray = 0.6 * pulses[8] + 0.4 * pulses[9]
    tacho = angle_from_pulses(np.delete(np.insert(pulses, 9, stray), 16), FS, len(TIME))
    assert worst(tacho, pulses, "ramp") < 1e-10
    assert (len(tacho.missing), len(tacho.double)) == (1, 1)


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


@given(st.lists(st.floats(0.01, 10), min_size=1, max_size=20), st.floats(1, 60))
def test_the_angle_never_falls(intervals, pulses_per_rev):
    pulses = np.concatenate(([0], np.cumsum(intervals)))
    n_times = int(pulses[-1] * 100) + 2
    try:
        tacho = angle_from_pulses(pulses, 100, n_times, pulses_per_rev=pulses_per_rev)
    except ValueError as error:
        assert "gaps of at most 10 intervals" in str(error)  # noqa: PT017
    else:
        assert np.diff(tacho.angle).min() > -1e-9


def test_beyond_the_pulses_the_speed_is_held():
    tacho = angle_from_pulses([1.0, 1.5, 2.0, 2.5], 10, 41)
    np.testing.assert_allclose(tacho.angle, 2 * TURN * (np.arange(41) / 10 - 1), atol=1e-12)


@pytest.mark.parametrize("pulses_per_rev", [60, 2.5])
def test_pulses_per_revolution_divide_the_angle(pulses_per_rev):
    tacho = angle_from_pulses(np.arange(11.0), 1, 11, pulses_per_rev=pulses_per_rev)
    np.testing.assert_allclose(tacho.angle, TURN * np.arange(11) / pulses_per_rev)


def test_the_report_reads_well():
    tacho = angle_from_pulses(np.delete(np.arange(9.0), 4), 1, 9)
    assert str(tacho) == "TachoAngle(9 samples, 8 revolutions, 1 (at 4 s) missing, 0 double)"


def test_a_long_report_is_cut_short():
    tacho = TachoAngle(np.zeros(2), np.arange(6.0), np.array([]))
    assert "6 (at 0, 1, 2, 3, 4, ... s) missing" in repr(tacho)


def test_a_tacho_angle_cannot_be_changed():
    tacho = angle_from_pulses([0, 1, 2], 1, 3)
    with pytest.raises(AttributeError):
        tacho.angle = np.zeros(3)


def test_without_repair_a_missing_pulse_is_an_error():
    with pytest.raises(
        ValueError, match=r"got a pulse missing after pulse 3, 3 s .1 missing and 0"
    ):
        angle_from_pulses(np.delete(np.arange(9.0), 4), 1, 9, repair=False)


def test_without_repair_a_double_pulse_is_an_error():
    pulses = np.insert(np.arange(9.0), 4, 3.2)
    with pytest.raises(ValueError, match=r"got a pulse double: pulse 4, 3.2 s .*repair=True"):
        angle_from_pulses(pulses, 1, 9, repair=False)


def test_without_repair_clean_pulses_pass():
    assert angle_from_pulses(np.arange(9.0), 1, 9, repair=False).angle[-1] == pytest.approx(
        8 * TURN
    )


def test_a_standstill_is_an_error_that_says_where():
    pulses = np.concatenate((np.arange(10.0), np.arange(10.0) + 40))
    with pytest.raises(
        ValueError, match=r"at most 10 intervals, got one of 31 after pulse 9 at 9 s"
    ):
        angle_from_pulses(pulses, 1, 60)


def test_a_raw_channel_in_place_of_pulse_times_is_told_apart():
    with pytest.raises(
        ValueError, match=r"got 0 after 5 at pulse 2. If this is a raw tacho channel"
    ):
        angle_from_pulses([0, 5, 0, 5], FS, 100)


def test_pulse_times_that_are_sample_numbers_are_told_apart():
    with pytest.raises(ValueError, match=r"at least two pulses within .* Are they in s"):
        angle_from_pulses([1000, 2000, 3000], FS, 10_000)


def test_a_single_pulse_is_an_error():
    with pytest.raises(ValueError, match=r"times must hold at least 2 samples, got 1"):
        angle_from_pulses([1.0], FS, 100)


def test_the_number_of_samples_must_be_whole():
    with pytest.raises(TypeError, match=r"n_times must be a whole number of at least 1, got 9.5"):
        angle_from_pulses([0, 1, 2], 1, 9.5)


def test_pulses_per_revolution_must_be_positive():
    with pytest.raises(ValueError, match=r"pulses_per_rev must be a number above 0, got 0"):
        angle_from_pulses([0, 1, 2], 1, 3, pulses_per_rev=0)


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


def test_a_tacho_sensor_with_a_blind_mark_is_reported():
    wave = np.sin(turned("constant"))
    wave[(TIME > 0.98) & (TIME < 1.06)] = -1
    tacho = angle_from_tacho(wave, FS)
    np.testing.assert_allclose(tacho.missing, [1.0], atol=1e-3)


# Resolver


@every_motion
@pytest.mark.parametrize("pole_pairs", [1, 4])
def test_a_perfect_resolver_gives_the_motion(motion, pole_pairs):
    electrical = pole_pairs * turned(motion)
    angle = angle_from_resolver(
        3 * np.sin(electrical), 3 * np.cos(electrical), pole_pairs=pole_pairs
    )
    assert np.abs(angle - turned(motion)).max() < 1e-11


ELECTRICAL = np.linspace(0, TURN, 2001)
SINE, COSINE = np.sin(ELECTRICAL), np.cos(ELECTRICAL)


@pytest.mark.parametrize(
    ("sine", "cosine", "first_order"),
    [
        (1.01 * SINE, COSINE, 0.01 / 2 * np.sin(2 * ELECTRICAL)),
        (SINE + 0.01, COSINE, 0.01 * COSINE),
        (SINE, COSINE + 0.01, -0.01 * SINE),
        (np.sin(ELECTRICAL + 0.01), COSINE, 0.01 / 2 * (1 + np.cos(2 * ELECTRICAL))),
    ],
    ids=["amplitude", "sine offset", "cosine offset", "quadrature"],
)
def test_resolver_faults_of_one_percent_err_as_stated(sine, cosine, first_order):
    error = angle_from_resolver(sine, cosine, pole_pairs=1) - ELECTRICAL
    assert np.abs(error - first_order).max() < 1e-4


def test_a_resolver_dropout_names_the_sample():
    sine, cosine = SINE.copy(), COSINE.copy()
    sine[7] = cosine[7] = 0
    with pytest.raises(ValueError, match=r"vanish together, got 0 and 0 at sample 7.* Demodulate"):
        angle_from_resolver(sine, cosine)


def test_a_dead_resolver_is_an_error():
    with pytest.raises(ValueError, match=r"at sample 0"):
        angle_from_resolver(np.zeros(5), np.zeros(5))


def test_resolver_outputs_must_be_equally_long():
    with pytest.raises(ValueError, match=r"equally long, got 2 and 3 samples"):
        angle_from_resolver([0, 1], [1, 0, 1])


def test_resolver_pole_pairs_must_be_whole():
    with pytest.raises(
        TypeError, match=r"pole_pairs must be a whole number of at least 1, got 1.5"
    ):
        angle_from_resolver([0, 1], [1, 0], pole_pairs=1.5)


# Position


@every_motion
@pytest.mark.parametrize("lead", [5.0, -2.0])
def test_position_over_lead_gives_the_motion(motion, lead):
    position = turned(motion) / TURN * lead
    assert np.abs(angle_from_position(position, lead) - turned(motion)).max() < 1e-11


def test_a_screw_without_lead_is_an_error():
    with pytest.raises(ValueError, match=r"lead must be the travel per revolution.*not 0, got 0"):
        angle_from_position([0, 1], 0)


def test_position_must_be_one_dimensional():
    with pytest.raises(ValueError, match=r"position must be one-dimensional, got shape \(1, 2\)"):
        angle_from_position([[0, 1]], 5)


# Currents


@every_motion
@pytest.mark.parametrize("n_phases", [2, 3])
def test_clean_currents_give_the_motion(motion, n_phases):
    currents = currents_of(4 * turned(motion))[:n_phases]
    angle = angle_from_currents(currents, pole_pairs=4)
    assert np.abs(relative(angle) - turned(motion)).max() < 1e-11


def test_the_zero_sequence_drops_out_of_three_phases():
    wobble = np.cos(TURN * 50 * TIME)
    angle = angle_from_currents(currents_of(4 * turned("ramp"), zero=wobble), pole_pairs=4)
    assert np.abs(relative(angle) - turned("ramp")).max() < 1e-11


def test_exchanging_two_phases_changes_the_sign():
    currents = currents_of(4 * turned("ramp"))
    angle = angle_from_currents(currents[[0, 2, 1]], pole_pairs=4)
    np.testing.assert_allclose(relative(angle), -turned("ramp"), atol=1e-11)


@every_motion
def test_a_reversal_of_torque_leaves_no_jump(motion):
    currents = currents_of(4 * turned(motion), torque=np.sin(TURN * 1.5 * TIME + 0.4))
    angle = angle_from_currents(currents, pole_pairs=4)
    assert np.abs(relative(angle) - turned(motion)).max() < 1.4e-3


@every_motion
@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_reversal_of_torque_makes_no_slip(motion, seed):
    noise = np.random.default_rng(seed).normal(0, 0.005, (3, len(TIME)))
    currents = currents_of(4 * turned(motion), torque=np.sin(TURN * 1.5 * TIME + 0.4))
    error = angle_from_currents(currents + noise, pole_pairs=4) - turned(motion)
    assert np.abs(error - np.median(error)).max() < 0.12


def test_noise_of_two_percent_errs_by_two_hundredths():
    noise = np.random.default_rng(0).normal(0, 0.02, (3, len(TIME)))
    angle = angle_from_currents(currents_of(4 * turned("constant")) + noise, pole_pairs=4)
    error = angle - turned("constant")
    assert np.abs(error - error.mean()).max() < 0.02


def test_a_current_that_is_weak_for_a_while_is_bridged():
    torque = np.where((TIME > 1) & (TIME < 1.02), 0.0, 1.0)
    currents = currents_of(4 * turned("constant"), torque=torque)
    angle = angle_from_currents(currents, pole_pairs=4)
    assert np.abs(relative(angle) - turned("constant")).max() < 1e-10


def test_dead_currents_are_an_error():
    with pytest.raises(
        ValueError, match=r"angle at two samples at least, got 0 of 5. Is the motor"
    ):
        angle_from_currents(np.zeros((3, 5)), pole_pairs=4)


def test_currents_in_columns_are_told_apart():
    with pytest.raises(ValueError, match=r"one row a phase, got \(100, 3\). Transpose"):
        angle_from_currents(np.zeros((100, 3)), pole_pairs=4)


def test_a_bad_current_names_its_phase():
    with pytest.raises(ValueError, match=r"current of phase b must be finite, got nan at sample 1"):
        angle_from_currents([[1, 2, 3], [1, np.nan, 3]], pole_pairs=4)


def test_weak_must_be_a_share():
    with pytest.raises(ValueError, match=r"weak must be a number at least 0 and below 1, got 1"):
        angle_from_currents(np.ones((2, 5)), pole_pairs=4, weak=1)


def test_no_function_changes_its_input():
    values = np.array([0.0, 1.0, 2.0, 3.5])
    before = values.copy()
    angle_from_velocity(values, 1)
    angle_from_wrapped(values)
    angle_from_pulses(values, 1, 4)
    angle_from_position(values, 5)
    np.testing.assert_array_equal(values, before)
