"""Facts about shaft angle sources: each method follows known motions to the error it states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import FS, MOTIONS, TIME, TURN, turned

from emacm.shaft.angle import (
    angle_from_currents,
    angle_from_position,
    angle_from_resolver,
    angle_from_velocity,
    angle_from_wrapped,
    is_wrapped,
)

every_motion = pytest.mark.parametrize("motion", MOTIONS)


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


def test_velocity_in_float32_is_summed_in_float64():
    velocity = np.full(100_000, 100, dtype=np.float32)
    angle = angle_from_velocity(velocity, FS)
    assert angle.dtype == np.float64
    assert abs(angle[-1] - 999.99) < 1e-8


# Wrapped angle


@pytest.mark.parametrize("period", [360, 4096])
def test_wrapped_angle_in_degrees_or_counts_comes_out_in_radians(period):
    wrapped = np.mod(turned("reversing") / TURN * period, period)
    found = angle_from_wrapped(wrapped, period=period)
    np.testing.assert_allclose(found, turned("reversing"), atol=1e-11)


@given(st.floats(-3, 3), st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=100))
def test_wrapping_and_unwrapping_is_a_round_trip(start, steps):
    angle = start + np.concatenate(([0], np.cumsum(steps)))
    wrapped = np.angle(np.exp(1j * angle))
    np.testing.assert_allclose(angle_from_wrapped(wrapped), angle, atol=1e-10)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_angle_wrapped_at_two_pi_or_at_pi_is_wrapped(dtype):
    assert is_wrapped(np.array([0, TURN, 0.1], dtype=dtype))
    assert is_wrapped(np.array([-np.pi, np.pi, -3], dtype=dtype))


@pytest.mark.parametrize("angle", [[0, 3, 6], [0, 4, 8], [1, 1], [0, TURN * (1 + 1e-6)]])
def test_an_angle_with_small_steps_or_a_wide_span_is_not_wrapped(angle):
    assert not is_wrapped(angle)


# Resolver


@every_motion
@pytest.mark.parametrize("pole_pairs", [1, 4])
def test_a_perfect_resolver_gives_the_motion(motion, pole_pairs):
    phase = pole_pairs * turned(motion)
    angle = angle_from_resolver(3 * np.sin(phase), 3 * np.cos(phase), pole_pairs=pole_pairs)
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


# Position


@every_motion
@pytest.mark.parametrize("lead", [5.0, -2.0])
def test_position_over_lead_gives_the_motion(motion, lead):
    position = turned(motion) / TURN * lead
    assert np.abs(angle_from_position(position, lead) - turned(motion)).max() < 1e-11


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


# Inputs that would give meaningless angles


@pytest.mark.parametrize(
    ("values", "period", "words"),
    [("degrees", 2 * np.pi, "360 for degrees"), ("counts", 4096, "number of counts")],
)
def test_an_angle_that_spans_more_than_its_period_cannot_be_wrapped_at_it(values, period, words):
    turned = 300 * np.arange(2000) / 1000
    wrapped = {"degrees": np.rad2deg(turned) % 360, "counts": turned * 8192 / TURN % 8192}[values]
    with pytest.raises(ValueError, match=rf"spans .*after sample \d+.*{words}"):
        angle_from_wrapped(wrapped, period=period)


def test_noise_of_an_encoder_where_it_wraps_is_no_contradiction():
    turned = 3 * np.arange(2000) / 100
    noise = 0.2 * np.random.default_rng(1).standard_normal(2000)
    found = angle_from_wrapped(turned % TURN + noise)
    np.testing.assert_allclose(found, turned + noise, atol=1e-9)


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: angle_from_velocity([1, 2, np.nan], 1), ValueError, "velocity .* at sample 2"),
        (lambda: angle_from_velocity([1, 2], 0), ValueError, "fs must be"),
        (lambda: angle_from_wrapped([1, 2], period=-360), ValueError, "period must be"),
        (lambda: is_wrapped([0, np.inf]), ValueError, "angle must be .* at sample 1"),
        (lambda: angle_from_resolver([1, 0], [1, 0]), ValueError, "sample 1.* Demodulate"),
        (lambda: angle_from_resolver([0, 1], [1, 0, 1]), ValueError, "equally long, got 2 and 3"),
        (lambda: angle_from_resolver([0, 1], [1, 0], pole_pairs=1.5), TypeError, "pole_pairs"),
        (lambda: angle_from_position([0, 1], 0), ValueError, "lead must be"),
        (lambda: angle_from_position([[0, 1]], 5), ValueError, "position must be one-dim"),
        (lambda: angle_from_currents(np.zeros((3, 5)), pole_pairs=4), ValueError, "0 of 5"),
        (lambda: angle_from_currents(np.zeros((9, 3)), pole_pairs=4), ValueError, "Transpose"),
        (lambda: angle_from_currents([[1, 2], [1, np.nan]], pole_pairs=4), ValueError, "phase b"),
    ],
)
def test_wrong_input_is_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_whole_counts_err_by_at_most_one_count():
    counts = np.floor(np.mod(turned("ramp") / TURN * 4096, 4096)).astype(np.uint16)
    error = np.abs(angle_from_wrapped(counts, period=4096) - turned("ramp"))
    assert error.max() < TURN / 4096 + 1e-11
