"""Facts about profiles: exact integrals of straight pieces, and the course along strokes."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from emacm import Recording, StrokeProfile
from emacm.stroke_features.profile import cosine_coefficients, stroke_positions

FS = 1000
TURN = 2 * np.pi
SPEED = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], FS)


def out_and_back(shape, speed=None):
    """A channel that is `shape` of the position of the screw, out as back."""
    speed = SPEED if speed is None else speed
    angle = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) / FS
    return Recording({"force": shape(angle / np.ptp(angle))}, FS, angle=angle)


def profile(recording, n=4, **options):
    options = {"min_speed": 10, **options}
    return StrokeProfile(n, **options).fit_transform([recording])[0].reshape(-1, n)


def test_speed_does_not_change_a_profile_over_the_position():
    def shape(p):
        return np.sin(3 * p) + p**2

    steady = np.repeat([40.0, -40.0], 2 * FS)
    swinging = 40 * np.pi / 2 * np.sin(np.pi * np.arange(4 * FS) / FS / 2)
    found = [profile(out_and_back(shape, speed), 5, min_speed=0)[0] for speed in (steady, swinging)]
    np.testing.assert_allclose(found[1], found[0], atol=2e-3)


def test_few_coefficients_do_not_see_the_phase_of_the_first_order():
    angle = np.linspace(0, 24 * TURN, 5000)
    waves = [Recording({"force": np.sin(angle + phase)}, FS, angle=angle) for phase in (0, 1, 2, 3)]
    found = StrokeProfile(8, by_direction=False).fit_transform(waves)
    # A wave of amplitude 1; all low cosines together see less than a hundredth of its power.
    assert np.max(np.sum(found**2, axis=1)) < 0.005


def test_strokes_of_one_direction_are_averaged_by_their_lengths():
    speed = np.repeat([40.0, -40.0, 40.0], [1000, 4000, 3000])
    force = np.repeat([8.0, 0.0, 0.0], [1000, 4000, 3000])
    found = StrokeProfile(1).fit_transform([Recording({"force": force}, FS, velocity=speed)])
    assert found[0, 0] == pytest.approx(2, rel=2e-3)


# Coefficients

RNG = np.random.default_rng(0)
UNEVEN = np.concatenate([[0.0], np.sort(RNG.uniform(size=30)), [1.0]])
WALK = np.cumsum(RNG.normal(size=32))


def test_a_constant_is_its_mean_and_nothing_else():
    found = cosine_coefficients(UNEVEN, np.full(32, 2.5), 5)
    np.testing.assert_allclose(found, [2.5, 0, 0, 0, 0], atol=1e-15)


def test_the_cosines_of_a_ramp_are_known():
    k = np.arange(1, 9)
    known = np.where(k % 2, -2 * np.sqrt(2) / (np.pi * k) ** 2, 0)
    found = cosine_coefficients(UNEVEN, UNEVEN, 9)
    np.testing.assert_allclose(found, [0.5, *known], atol=1e-15)


@pytest.mark.parametrize("k", [0, 1, 2, 5])
def test_coefficients_are_integrals_over_the_position(k):
    def integrand(p):
        wave = np.sqrt(2) * np.cos(np.pi * k * p) if k else 1.0
        return np.interp(p, UNEVEN, WALK) * wave

    known = sum(quad(integrand, a, b)[0] for a, b in itertools.pairwise(UNEVEN))
    assert cosine_coefficients(UNEVEN, WALK, k + 1)[k] == pytest.approx(known, abs=1e-12)


def test_the_squares_of_all_coefficients_add_up_to_the_mean_square():
    width = np.diff(UNEVEN)
    a, b = WALK[:-1], WALK[1:]
    mean_square = np.sum(width * (a**2 + a * b + b**2)) / 3
    found = cosine_coefficients(UNEVEN, WALK, 20_000)
    # Of broken lines, what is missing falls as the third power of their number.
    assert np.sum(found**2) == pytest.approx(mean_square, rel=1e-8)
    assert np.sum(found[:10] ** 2) < mean_square


def test_samples_in_between_on_the_line_change_nothing():
    more = np.sort(np.concatenate([UNEVEN, RNG.uniform(size=50)]))
    found = cosine_coefficients(more, np.interp(more, UNEVEN, WALK), 6)
    np.testing.assert_allclose(found, cosine_coefficients(UNEVEN, WALK, 6), atol=1e-13)


def test_a_standstill_in_the_stroke_weighs_nothing():
    p = np.array([0.0, 0.5, 0.5, 0.5, 1.0])
    found = cosine_coefficients(p, np.array([0.0, 0.5, 70.0, 0.5, 1.0]), 6)
    np.testing.assert_allclose(found, cosine_coefficients([0, 1], [0, 1], 6), atol=1e-13)


def test_a_stroke_run_backwards_turns_the_sign_of_odd_cosines():
    forth = cosine_coefficients(UNEVEN, WALK, 6)
    back = cosine_coefficients(1 - UNEVEN[::-1], WALK[::-1], 6)
    np.testing.assert_allclose(back, forth * [1, -1, 1, -1, 1, -1], atol=1e-13)


def test_positions_run_from_zero_to_one():
    np.testing.assert_array_equal(stroke_positions([5.0, 7.0, 9.0]), [0, 0.5, 1])
