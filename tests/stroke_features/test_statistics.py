"""Facts about level and shape: known answers, invariances, SciPy's moments, strokes."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from emacm import OrderResampler, Recording, RecordingStatistics
from emacm.stroke_features.statistics import STATISTICS, common_slope

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
    with pytest.raises(ValueError, match=r"recording 0: channel 'current', forward .* kurtosis"):
        described(np.full(SPEED.size, 2.0))


# Signals

CYCLES = np.arange(1000) / 1000 * 2 * np.pi * 5
SINE = 3 * np.sin(CYCLES)

whole = st.integers(-1000, 1000).map(float)
signals = arrays(float, st.integers(3, 40), elements=whole).filter(lambda x: np.ptp(x) > 0)


def one(signal, name):
    return float(STATISTICS[name](np.asarray(signal)))


def several(signal, names):
    return np.array([one(signal, name) for name in names])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mean", 0.0),
        ("rms", 3 / np.sqrt(2)),
        ("std", 3 / np.sqrt(2)),
        ("peak", 3.0),
        ("peak_to_peak", 6.0),
        ("crest_factor", np.sqrt(2)),
        ("kurtosis", 1.5),
        ("skewness", 0.0),
    ],
)
def test_a_sine_has_these_levels(name, value):
    assert one(SINE, name) == pytest.approx(value, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "independent"),
    [
        ("kurtosis", lambda x: stats.kurtosis(x, fisher=False)),
        ("skewness", stats.skew),
        ("std", np.std),
        ("peak_to_peak", np.ptp),
    ],
)
def test_moments_are_those_of_scipy_and_numpy(name, independent):
    x = np.random.default_rng(1).gamma(2.0, size=500)
    assert one(x, name) == pytest.approx(float(independent(x)), rel=1e-12)


@given(signals, st.sampled_from([1e-3, 0.5, 2.0, 1e6]))
@example(np.array([61.0, 62.0, 145.0, 146.0]), 1e-3)
def test_levels_scale_with_the_signal_and_ratios_do_not(x, scale):
    ratios = [name in ("crest_factor", "kurtosis", "skewness") for name in STATISTICS]
    before, after = (several(signal, [*STATISTICS]) for signal in (x, scale * x))
    units = np.where(ratios, 1.0, scale)
    bounds = 1e-12 * units * np.where(ratios, 1.0, np.max(np.abs(x)))
    assert np.all(np.abs(after - before * units) <= 1e-9 * np.abs(before * units) + bounds)


def test_a_long_float32_signal_is_summed_in_float64():
    x = np.full(1 << 20, 0.1, dtype=np.float32)
    assert one(x, "mean") == pytest.approx(float(np.float32(0.1)), rel=1e-12)


@pytest.mark.parametrize("name", ["kurtosis", "skewness"])
@pytest.mark.parametrize("value", [0.0, 0.1, 1e6])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_constant_has_no_shape(name, value, dtype):
    with pytest.raises(ValueError, match=f"{name} of a constant signal .* Leave '{name}' or the"):
        one(np.full(9, value, dtype=dtype), name)


def test_zeros_have_no_crest_factor():
    with pytest.raises(ValueError, match="zeros have no crest factor"):
        one(np.zeros(5), "crest_factor")


def test_the_slope_of_a_ramp_is_its_slope_whatever_the_levels():
    turns = [np.arange(10.0), np.array([3.0, 3.5, 7.0])]
    assert common_slope([2 * turns[0] + 5, 2 * turns[1] - 100], turns) == pytest.approx(2)


def test_a_common_slope_is_the_least_squares_solution_with_levels_of_their_own():
    rng = np.random.default_rng(4)
    x = [rng.normal(size=n) for n in (5, 8)]
    turns = [rng.uniform(size=n) for n in (5, 8)]
    levels = np.kron(np.eye(2), np.ones((8, 1)))[[*range(5), *range(8, 16)]]
    model = np.column_stack([np.concatenate(turns), levels])
    solution = np.linalg.lstsq(model, np.concatenate(x), rcond=None)[0]
    assert common_slope(x, turns) == pytest.approx(solution[0], rel=1e-10)


def test_a_single_angle_has_no_slope():
    with pytest.raises(ValueError, match="a slope needs two angles"):
        common_slope([[1.0], [2.0]], [[0.0], [5.0]])
