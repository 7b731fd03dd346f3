"""Facts about strokes: where the shaft's motion is cut, and how far each stroke runs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from motions import stroke_paths

from emacm import Recording
from emacm.shaft.angle import angle_from_velocity
from emacm.shaft.motion import IntegratedAngle, find_strokes

FS = 1000.0
TURN = 2 * np.pi

# Small whole speeds, so that rest, pauses and turns are frequent.
speeds = arrays(float, st.integers(2, 60), elements=st.integers(-3, 3).map(float))
limits = st.sampled_from([0.0, 1.0, 2.5])


def paths_of(velocity, **options):
    velocity = np.asarray(velocity, dtype=float)
    return stroke_paths(angle_from_velocity(velocity, FS), velocity, FS, **options)


def back_and_forth(n_seconds=4):
    """Speed and angle of a shaft that reverses twice a second."""
    time = np.arange(int(n_seconds * FS)) / FS
    return 30 * np.sin(TURN * time), 30 / TURN * (1 - np.cos(TURN * time))


@pytest.mark.parametrize(
    ("velocity", "strokes"),
    [
        ([5, 5, 0, 5], [(0, 4, 1)]),  # a pause of one sample does not cut a stroke
        ([-5, *[0] * 50, -5], [(0, 52, -1)]),  # nor does a long rest within one direction
        ([5, 5, -5, -5, 5], [(0, 2, 1), (2, 4, -1), (4, 5, 1)]),
        ([5, 0, 0, -5], [(0, 1, 1), (3, 4, -1)]),  # this rest belongs to neither
    ],
)
def test_only_a_change_of_direction_cuts(velocity, strokes):
    assert find_strokes(np.array(velocity, float)) == strokes


def test_a_rest_longer_than_allowed_ends_a_stroke():
    speed = np.array([5.0, 5.0, 0.1, 0.2, 5.0, 0.0, 0.0, 0.0, 5.0, -5.0])
    run = Recording({"force": speed}, 10.0, velocity=speed)
    assert run.strokes(0.5) == [(0, 9, 1), (9, 10, -1)]
    assert run.strokes(0.5, max_rest=0.3) == [(0, 9, 1), (9, 10, -1)]
    assert run.strokes(0.5, max_rest=0.2) == [(0, 5, 1), (8, 9, 1), (9, 10, -1)]
    assert run.strokes(0.5, max_rest=0) == [(0, 2, 1), (4, 5, 1), (8, 9, 1), (9, 10, -1)]
    with pytest.raises(ValueError, match=r"max_rest must be .*at least 0"):
        run.strokes(0.5, max_rest=-1)


@pytest.mark.parametrize("direction", ["strokes", "forward", "reverse", "travel"])
def test_a_shaft_at_rest_has_no_paths(direction):
    assert paths_of(np.zeros(10), direction=direction) == []


def test_noise_at_rest_makes_no_strokes():
    rng = np.random.default_rng(0)
    rest = rng.uniform(-0.5, 0.5, 2000)
    moving = np.full(1000, 20.0)
    velocity = np.concatenate([rest, moving, rest, -moving, rest])
    assert len(find_strokes(velocity)) > 1000
    assert find_strokes(velocity, min_speed=0.5) == [(2000, 3000, 1), (5000, 6000, -1)]


@given(speeds, limits)
def test_every_turning_sample_lies_in_one_stroke_of_its_direction(velocity, min_speed):
    strokes = find_strokes(velocity, min_speed=min_speed)
    ways = np.zeros(len(velocity))
    for start, stop, direction in strokes:
        assert np.all(ways[start:stop] == 0)
        ways[start:stop] = direction
    turning = np.abs(velocity) > min_speed
    np.testing.assert_array_equal(ways[turning], np.sign(velocity[turning]))


@given(speeds, limits)
def test_strokes_alternate_and_begin_and_end_in_motion(velocity, min_speed):
    strokes = find_strokes(velocity, min_speed=min_speed)
    for before, after in pairwise(strokes):
        assert before.stop <= after.start
        assert before.direction == -after.direction
    for start, stop, direction in strokes:
        assert direction * velocity[start] > min_speed
        assert direction * velocity[stop - 1] > min_speed


def test_a_stroke_runs_the_integral_of_its_speed():
    velocity, angle = back_and_forth()
    paths = stroke_paths(angle, velocity, FS)
    # Half a period of 30 sin(2 pi t) is 30 / pi; the turns lie on samples, at which speed is 0.
    assert len(paths) == 8
    for path in paths:
        assert path.length == pytest.approx(30 / np.pi, abs=2 * 30 * TURN / FS**2)
        assert path.travel[0] == 0
        assert np.all(np.diff(path.travel) > 0)


def test_travel_is_the_integral_of_the_speed_whichever_way():
    velocity, angle = back_and_forth()
    (path,) = stroke_paths(angle, velocity, FS, direction="travel")
    run = np.interp(path.start_time + np.arange(len(path.travel)) / FS, *integral(np.abs(velocity)))
    np.testing.assert_allclose(path.travel, run - run[0], atol=1e-3)
    assert path.direction == 0
    assert path.length == pytest.approx(8 * 30 / np.pi, rel=1e-4)


def integral(speed):
    time = np.arange(len(speed)) / FS
    return time, np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2)]) / FS


def test_travel_does_not_count_noise_at_rest_between_opposite_strokes():
    rng = np.random.default_rng(1)
    moving, rest = np.full(1000, 20.0), rng.uniform(-0.5, 0.5, 5000)
    (path,) = paths_of(np.concatenate([moving, rest, -moving]), direction="travel", min_speed=0.5)
    assert path.length == pytest.approx(2 * 999 * 20 / FS, abs=1e-9)


def test_a_path_knows_when_and_where_it_starts():
    velocity = np.concatenate([np.zeros(200), np.full(300, 4.0), np.full(300, -8.0)])
    angle = 7.0 + angle_from_velocity(velocity, FS)
    forward, reverse = stroke_paths(angle, velocity, FS)
    assert (forward.start_time, forward.start_angle) == (0.2, angle[200])
    assert (reverse.start_time, reverse.start_angle) == (0.5, angle[500])
    assert reverse.travel[-1] == pytest.approx(8 * 299 / FS)


def test_a_stroke_of_one_sample_has_no_path():
    assert [p.direction for p in paths_of([4.0, 4.0, -1.0, 4.0, 4.0])] == [1, 1]


# What is known of the travel of a stroke


def test_an_integrated_angle_may_reverse_below_min_speed():
    velocity = np.concatenate([np.full(300, 7.0), np.full(50, -0.5), np.full(300, 7.0)])
    angle = IntegratedAngle(velocity, FS)
    (path,) = stroke_paths(angle, velocity, FS, min_speed=1.0)
    assert path.max_reversal == pytest.approx(0.5 * 49 / FS, rel=0.3)
    (path,) = stroke_paths(angle, np.abs(velocity), FS)
    assert path.max_reversal == 0
