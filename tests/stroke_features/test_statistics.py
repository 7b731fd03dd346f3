"""Facts about level and shape of the strokes of recordings."""

import numpy as np
import pytest

from emacm import OrderResampler, Recording, RecordingStatistics
from emacm.stroke_features.statistics import STATISTICS

FS = 1000
TURN = 2 * np.pi
ALL = (*STATISTICS, "slope")
# Rest, out at 40 rad/s, rest, back at 40 rad/s, rest: a second each.
SPEED = np.repeat([0.0, 40.0, 0.0, -40.0, 0.0], FS)
ANGLE = np.cumsum(SPEED) / FS


def described(signal, statistics=ALL, *, angle=ANGLE, **options):
    levels = RecordingStatistics(statistics, **options).set_output(transform="pandas")
    return levels.fit_transform([Recording({"current": signal}, FS, angle=angle)]).iloc[0]


def test_forward_and_reverse_strokes_have_levels_of_their_own():
    found = described(3 + 2 * np.sign(SPEED), ("mean", "peak"), min_speed=30)
    assert found["current+:mean"] == pytest.approx(5)
    assert found["current-:mean"] == pytest.approx(1)
    assert found["current-:peak"] == pytest.approx(1)


def test_the_slope_is_per_revolution_along_each_strokes_own_motion():
    found = described(0.25 * ANGLE / TURN, ("slope",), min_speed=30)
    assert found["current+:slope"] == pytest.approx(0.25)
    assert found["current-:slope"] == pytest.approx(-0.25)


@pytest.mark.parametrize("resample", [False, True])
def test_the_slope_knows_no_speed(resample):
    angle = 60 * np.linspace(0.1, 1, 4000) ** 2
    X = [Recording({"force": 7 - 2 * angle / TURN}, FS, angle=angle)]
    X = OrderResampler(TURN / 32).fit_transform(X) if resample else X
    slope = RecordingStatistics(("slope",), by_direction=False).fit_transform(X)
    # Over the angle the filter bends the ends of a ramp a little.
    assert slope[0, 0] == pytest.approx(-2, rel=0.01 if resample else 1e-9)


def test_over_time_samples_count_by_time_and_over_the_angle_by_angle():
    # Half the time at a tenth of the speed, where the signal is 1; else it is 0.
    speed = np.repeat([4.0, 40.0], 5 * FS)
    X = [Recording({"force": np.repeat([1.0, 0.0], 5 * FS)}, FS, velocity=speed)]
    mean = RecordingStatistics(("mean",), by_direction=False)
    assert mean.fit_transform(X)[0, 0] == pytest.approx(1 / 2, abs=1e-3)
    over_angle = OrderResampler(TURN / 32).fit_transform(X)
    assert mean.fit_transform(over_angle)[0, 0] == pytest.approx(1 / 11, abs=1e-3)


def test_strokes_of_one_direction_are_pooled_as_if_they_were_one():
    speed = np.repeat([40.0, -40.0, 40.0], [1000, 500, 3000])
    signal = np.random.default_rng(0).normal(np.repeat([1.0, 5.0, 2.0], [1000, 500, 3000]))
    X = [Recording({"force": signal}, FS, velocity=speed)]
    levels = RecordingStatistics(("mean", "kurtosis")).fit_transform(X)[0]
    forth = np.concatenate([signal[:1000], signal[1500:]])
    z = (forth - forth.mean()) / forth.std()
    np.testing.assert_allclose(levels[:2], [forth.mean(), np.mean(z**4)], rtol=1e-12)


def test_a_slope_lets_each_stroke_have_a_level_of_its_own():
    speed = np.repeat([40.0, -40.0, 40.0], 1000)
    ramp = np.cumsum(np.abs(speed)) / FS / TURN
    signal = ramp + np.repeat([0.0, 7.0, -50.0], 1000)
    X = [Recording({"force": signal}, FS, velocity=speed)]
    np.testing.assert_allclose(RecordingStatistics(("slope",)).fit_transform(X), 1, rtol=1e-3)


def test_a_constant_channel_is_named_with_its_strokes():
    with pytest.raises(
        ValueError,
        match="recording 0: channel 'current', forward strokes: the kurtosis of a",
    ):
        described(np.full(SPEED.size, 2.0))


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({"statistics": "rms"}, TypeError, "statistics must be a list of names"),
        ({"statistics": ("median",)}, ValueError, "a statistic must be one of .*; got 'median'"),
        ({"statistics": ()}, ValueError, "statistics must contain each name once"),
    ],
)
def test_wrong_parameters_are_refused(parameters, error, message):
    X = [Recording({"current": SPEED}, FS, angle=ANGLE)]
    with pytest.raises(error, match=message):
        RecordingStatistics(**parameters).fit(X)
