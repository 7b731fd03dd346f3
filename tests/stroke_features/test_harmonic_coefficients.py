"""Facts about lines that are locked to the shaft."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emacm.stroke_features.harmonics import harmonic_coefficients, whole_revolutions

TURN = 2 * np.pi
STEP = TURN / 64
EVEN = 0.7 + STEP * np.arange(64 * 5)
ACCELERATING = 0.7 + 30 * np.linspace(0.1, 1.2, 900) ** 2


def lines(angle, amplitude=2.0, phase=0.4):
    return amplitude * np.cos(angle - phase) + 0.5 * np.sin(2.5 * angle)


@pytest.mark.parametrize("angle", [EVEN, EVEN[::-1], ACCELERATING, -ACCELERATING])
def test_lines_are_found_exactly_at_any_motion_beside_level_and_trend(angle):
    found = harmonic_coefficients([angle], [40 - 0.3 * angle + lines(angle)], (1, 2.5))
    np.testing.assert_allclose(found[0], [2 * np.cos(0.4), 0], atol=1e-10)
    np.testing.assert_allclose(found[1], [2 * np.sin(0.4), 0.5], atol=1e-10)


def test_over_whole_revolutions_they_are_fourier_coefficients_of_the_synchronous_average():
    noise = np.random.default_rng(0).normal(size=EVEN.size)
    # Without its trend along the cosine and the sine, which the fit takes out.
    trend = EVEN - EVEN.mean()
    waves = np.array([np.cos(EVEN), np.sin(EVEN)]) * 2 / EVEN.size
    left = trend - (waves @ trend) @ np.array([np.cos(EVEN), np.sin(EVEN)])
    noise = noise - left * (left @ noise) / (left @ left)
    average = noise.reshape(5, 64).mean(axis=0)
    found = harmonic_coefficients([EVEN], [noise], (1,))
    assert found[0, 0] == pytest.approx(2 * np.mean(average * np.cos(EVEN[:64])), abs=1e-12)
    assert found[1, 0] == pytest.approx(2 * np.mean(average * np.sin(EVEN[:64])), abs=1e-12)


@pytest.mark.parametrize("other", [2, 3, 7.4])
def test_other_orders_stay_out_over_whole_revolutions(other):
    found = harmonic_coefficients([EVEN], [5 * np.cos(other * (EVEN - EVEN.mean()))], (1,))
    # An even function about the middle has no trend; what 7.4 leaks falls with the distance.
    size = np.hypot(*found[:, 0])
    assert size < (1e-12 if other == int(other) else 0.05)


def test_other_orders_stay_out_at_changing_speed_as_samples_count_by_their_angle():
    angle = TURN * 10 * np.linspace(0.2, 1, 4000) ** 2
    angle = angle[whole_revolutions(angle - angle[0])]
    found = harmonic_coefficients([angle], [5 * np.cos(3 * angle)], (1,))
    plain = np.linalg.lstsq(
        np.column_stack([np.ones_like(angle), angle, np.cos(angle), np.sin(angle)]),
        5 * np.cos(3 * angle),
        rcond=None,
    )[0]
    leaked = np.hypot(*found[:, 0])
    assert leaked < 0.02
    assert leaked < np.hypot(*plain[2:]) / 3


@given(st.floats(-10, 10))
def test_turning_the_zero_of_the_shaft_turns_the_vector_and_keeps_the_amplitude(shift):
    found = harmonic_coefficients([EVEN + shift], [lines(EVEN)], (1, 2.5))
    vector = (found[0] + 1j * found[1]) * np.exp(-1j * shift * np.array([1, 2.5]))
    np.testing.assert_allclose(vector, [2 * np.exp(0.4j), 0.5j], atol=1e-9)


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_coefficients_scale_with_the_signal_and_know_no_offset(scale, offset):
    found = harmonic_coefficients([EVEN], [scale * lines(EVEN) + offset], (1, 2.5))
    np.testing.assert_allclose(found[0], scale * np.array([2 * np.cos(0.4), 0]), atol=1e-9)
    np.testing.assert_allclose(found[1], scale * np.array([2 * np.sin(0.4), 0.5]), atol=1e-9)


def test_stretches_are_fitted_together_each_with_a_level_and_a_trend_of_its_own():
    rng = np.random.default_rng(1)
    angles = [EVEN[:200], EVEN[::-1][:90] + 2, EVEN[:5]]
    signals = [rng.normal(size=angle.size) for angle in angles]
    model = np.zeros((295, 8))
    stops = np.cumsum([0, *(angle.size for angle in angles)])
    for k, angle in enumerate(angles):
        rows = slice(stops[k], stops[k + 1])
        model[rows, :2] = np.column_stack([np.cos(angle), np.sin(angle)])
        model[rows, 2 + 2 * k : 4 + 2 * k] = np.column_stack([np.ones_like(angle), angle])
    known = np.linalg.lstsq(model, np.concatenate(signals), rcond=None)[0]
    found = harmonic_coefficients(angles, signals, (1,))
    np.testing.assert_allclose(found[:, 0], known[:2], atol=1e-12)


def test_whole_revolutions_lie_in_the_middle():
    travel = STEP * np.arange(64 * 4 + 32)
    assert whole_revolutions(travel) == slice(16, 16 + 64 * 4)


@pytest.mark.parametrize("n_sections", [1, 2, 3, 4])
def test_parts_of_whole_revolutions_share_no_sample(n_sections):
    travel = STEP * np.arange(64 * 12 + 20)
    parts = [whole_revolutions(travel, part, n_sections) for part in range(n_sections)]
    assert all((part.stop - part.start) % 64 == 0 for part in parts)
    assert all(a.stop <= b.start for a, b in itertools.pairwise(parts))
    assert parts[0].start >= 0
    assert parts[-1].stop <= len(travel)


def test_less_than_a_revolution_holds_none():
    assert whole_revolutions(STEP * np.arange(60)) is None
    assert whole_revolutions([0.0]) is None
    assert whole_revolutions([0.0, 7.0], 1, 2) is None
    assert whole_revolutions(STEP * np.arange(64 * 2), 0, 3) is None


def test_orders_above_half_the_samples_of_a_revolution_are_refused():
    with pytest.raises(ValueError, match=r"order 32 is above the Nyquist order 32 of 64 samples"):
        harmonic_coefficients([EVEN], [lines(EVEN)], (1, 32))


def test_orders_that_the_angle_cannot_tell_apart_are_refused():
    with pytest.raises(ValueError, match=r"do not separate the orders .* fewer orders"):
        harmonic_coefficients([EVEN], [lines(EVEN)], (1, 1 + 1e-12))
