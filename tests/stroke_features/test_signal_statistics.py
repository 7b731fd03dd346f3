"""Facts about level and shape: known answers, invariances, and SciPy's moments."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from emacm.stroke_features.statistics import STATISTICS, common_slope

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
    with pytest.raises(ValueError, match="signal of zeros has no crest factor"):
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
    with pytest.raises(ValueError, match="samples at two angles"):
        common_slope([[1.0], [2.0]], [[0.0], [5.0]])
