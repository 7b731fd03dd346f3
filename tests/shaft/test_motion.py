"""Facts about a shaft's motion that is worked out piece by piece."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import stroke_paths

from emacm._kernels import using
from emacm.shaft.angle import angle_from_velocity
from emacm.shaft.motion import DifferentiatedVelocity, IntegratedAngle, ShaftPath

FS = 1000.0
N_TIMES = 3000

VELOCITY = np.random.default_rng(0).standard_normal(N_TIMES).cumsum()
ANGLE = angle_from_velocity(VELOCITY, FS)
slices = st.tuples(st.integers(-N_TIMES - 5, N_TIMES + 5), st.integers(-N_TIMES - 5, N_TIMES + 5))


@pytest.mark.parametrize("name", ["numpy", "numba"])
@given(limits=slices)
def test_any_slice_of_the_integrated_angle_is_that_of_the_whole(name, limits):
    pytest.importorskip(name)
    with using(name):
        part = IntegratedAngle(VELOCITY, FS)[slice(*limits)]
    np.testing.assert_allclose(part, ANGLE[slice(*limits)], atol=1e-9)


@given(limits=slices)
def test_any_slice_of_the_differentiated_velocity_is_that_of_the_whole(limits):
    part = DifferentiatedVelocity(ANGLE, FS)[slice(*limits)]
    np.testing.assert_allclose(part, (np.gradient(ANGLE) * FS)[slice(*limits)], atol=1e-9)


@pytest.mark.parametrize("series", [IntegratedAngle, DifferentiatedVelocity])
@pytest.mark.parametrize("n_times", [2, 3, 255, 256, 257, 513])
def test_a_series_of_any_length_reads_like_an_array(series, n_times):
    lazy = series(VELOCITY[:n_times], FS)
    whole = np.asarray(lazy)
    assert len(lazy) == len(whole) == n_times
    assert lazy[-1] == pytest.approx(whole[-1], rel=1e-12)
    np.testing.assert_allclose(lazy[::2], whole[::2])
    with pytest.raises(IndexError):
        lazy[n_times]


def test_the_speed_limit_is_the_highest_speed():
    angle = IntegratedAngle(VELOCITY, FS)
    for start, stop in ((0, N_TIMES), (300, 301), (1000, 1500), (256, 512), (7, 255), (255, 257)):
        assert angle.speed_limit(start, stop) == np.abs(VELOCITY[start:stop]).max()


@pytest.mark.parametrize("block", [64, 1000])
def test_strokes_do_not_depend_on_the_blocks_they_are_found_in(monkeypatch, block):
    velocity = 5 * np.sin(np.arange(N_TIMES) / 40)
    expected = stroke_paths(angle_from_velocity(velocity, FS), velocity, FS, min_speed=1.0)
    monkeypatch.setattr("emacm.shaft.motion.BLOCK", block)
    found = stroke_paths(IntegratedAngle(velocity, FS), velocity, FS, min_speed=1.0)
    assert len(found) == len(expected) > 10
    for one, other in zip(found, expected, strict=True):
        assert (one.start_time, one.direction) == (other.start_time, other.direction)
        np.testing.assert_allclose(one.travel, other.travel, atol=1e-9)


def test_a_path_knows_how_far_the_shaft_turns_back():
    travel = np.array([0.0, 2, 5, 4, 3.5, 6, 9, 8.9, 10])
    assert ShaftPath(travel, FS, 0.0, 0.0, 1).max_reversal == 1.5


def test_the_largest_step_and_its_place_are_found(monkeypatch):
    travel = np.arange(1000.0)
    travel[700:] += 50
    monkeypatch.setattr("emacm.shaft.motion.BLOCK", 64)
    path = ShaftPath(travel, FS, 0.0, 0.0, 1)
    assert path.largest_step() == (51.0, 699)
    assert path.fastest == 51 * FS


@cache
def cubic_from(k):
    """Return the cubic through the samples k - 1 to k + 2, over the distance from sample k."""
    samples = ANGLE[k - 1 : k + 3] - ANGLE[0]
    return np.polynomial.Polynomial.fit([-1, 0, 1, 2], samples, 3)


@pytest.mark.parametrize("factor", [1, 2, 3, 5])
@pytest.mark.parametrize("start", [0, 40])
@given(limits=st.tuples(st.integers(-9, 260), st.integers(0, 400)))
def test_travel_at_a_multiple_of_the_rate_is_the_cubic_through_the_samples(factor, start, limits):
    travel = ANGLE[:50] - ANGLE[0]
    path = ShaftPath(travel, FS, start / FS, 0.0, 1)
    first, stop = start * factor + limits[0], start * factor + limits[0] + limits[1]
    found = path.travel_at(factor * FS, first, stop)
    position = np.clip(np.arange(first, stop) / factor - start, 0, 49)
    left = np.clip(np.floor(position + 1e-9).astype(int), 1, 47)
    expected = [cubic_from(k)(x - k) for k, x in zip(left.tolist(), position, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("n_times", [2, 3, 4, 5])
def test_between_few_samples_the_travel_is_the_polynomial_through_them(n_times):
    shape = np.polynomial.Polynomial([0.0, 1.0, 0.0, 0.1] if n_times > 3 else [0.0, 1.3])
    path = ShaftPath(shape(np.arange(float(n_times))), 10.0, 0.3, 0.0, 1)
    for fs in (7.0, 25.0, 33.3):
        index = np.arange(-3, 30)
        place = np.clip((index / fs - 0.3) * 10, 0, n_times - 1)
        np.testing.assert_allclose(path.travel_at(fs, -3, 30), shape(place), atol=1e-12)
    assert len(path.travel_at(7.0, 4, 4)) == 0


def test_the_samples_of_a_channel_on_a_path_include_both_ends():
    path = ShaftPath(np.arange(21.0), 100.0, 0.2, 0.0, 1)  # 0.2 to 0.4 s
    assert path.sample_range(50.0, 1000) == (10, 21)
    assert path.sample_range(48.0, 1000) == (10, 20)
    assert path.sample_range(50.0, 15) == (10, 15)
    assert path.sample_range(4.0, 9) == (1, 3)
    assert path.sample_range(4.0, 2) == (0, 2)
    assert path.sample_range(1.0, 1) == (0, 2)  # which the caller must be able to read


def test_samples_over_the_angle_are_counted_from_the_start():
    path = ShaftPath(np.linspace(0, 3.0, 31), 10.0, 0.0, 0.0, 1)
    assert [path.count(step) for step in (1.0, 3.0, 3.1, 0.7)] == [4, 2, 1, 5]
