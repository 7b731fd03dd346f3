"""Facts about profiles: exact integrals of straight pieces, whatever the positions."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from emacm.stroke_features.profile import cosine_coefficients, stroke_positions

RNG = np.random.default_rng(0)
UNEVEN = np.concatenate([[0.0], np.sort(RNG.uniform(size=30)), [1.0]])
WALK = np.cumsum(RNG.normal(size=32))


def test_a_constant_is_its_mean_and_nothing_else():
    np.testing.assert_allclose(
        cosine_coefficients(UNEVEN, np.full(32, 2.5), 5), [2.5, 0, 0, 0, 0], atol=1e-15
    )


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
