"""Seconds are steady where the lines of a shaft keep level and phase from block to block."""

import numpy as np
import pytest

from emacm.shaft.phase_refinement import steady_seconds

FS = 1000
N_SECONDS = 8
TIMES = np.arange(N_SECONDS * FS) / FS
SPEED = 20.0


def lines(n_lines, *, noise=0.1, seed=0):
    """Demodulated lines of a steady shaft in noise."""
    rng = np.random.default_rng(seed)
    shape = (n_lines, len(TIMES))
    level = rng.uniform(0.5, 1, (n_lines, 1)) * np.exp(1j * rng.uniform(0, 6, (n_lines, 1)))
    return level + noise * (rng.normal(size=shape) + 1j * rng.normal(size=shape))


def steady(found, *, speed=SPEED, gap=1.0, reliable=None):
    reliable = np.ones(N_SECONDS, bool) if reliable is None else reliable
    return steady_seconds(list(found), speed * TIMES, gap, reliable, FS).tolist()


def all_but(*seconds):
    return [second not in seconds for second in range(N_SECONDS)]


@pytest.mark.parametrize("n_lines", [1, 3, 12])
@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0])
def test_a_steady_shaft_is_steady(n_lines, noise):
    assert steady(lines(n_lines, noise=noise)) == all_but()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n_lines", "noise", "least"),
    [(1, 0.1, 0.7), (2, 0.1, 0.85), (4, 0.1, 0.96), (6, 1.0, 0.98), (12, 1.0, 1), (12, 3.0, 0.96)],
)
def test_other_phases_after_a_reversal_are_noticed(n_lines, noise, least):
    # Here a reversal takes no time. By chance, the phase of a single line changes by so little that
    # its change, 1 - cos, is below 0.2, with a probability of acos(0.8) / pi, which is 0.2.
    noticed = []
    for seed in range(100):
        found = lines(n_lines, noise=noise, seed=seed)
        turned = np.random.default_rng(seed + 999).uniform(0, 2 * np.pi, (n_lines, 1))
        found[:, 3500:] *= np.exp(1j * turned)
        noticed.append(not steady(found)[3])
    assert np.mean(noticed) >= least


def test_lines_that_vanish_for_a_moment_are_noticed():
    for n_lines in (1, 6):
        found = lines(n_lines)
        found[:, 5450:5550] = 0
        assert steady(found) == all_but(5)


def test_another_level_is_noticed():
    found = lines(1)
    found[:, 2500:] *= 0.2
    assert steady(found) == all_but(2)


def test_a_reversal_between_two_seconds_is_noticed_in_both():
    found = lines(3)
    found[:, 3960:4040] = 0
    assert steady(found) == all_but(3, 4)


def test_noise_alone_is_not_steady():
    found = lines(12, noise=1.0) - lines(12, noise=0.0)
    assert not any(steady(found))


def test_a_single_line_of_a_slow_shaft_cannot_show_a_short_reversal():
    assert not any(steady(lines(1), speed=2.0))
    assert all(steady(lines(1), speed=2.0, gap=6.0))  # blocks of a sixth of a revolution
    assert all(steady(lines(6), speed=2.0))
