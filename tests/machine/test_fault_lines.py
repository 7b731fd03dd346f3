"""Fault lines stand out of their local background by as much as they were put above it."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from emacm import Bearing, FaultLines, Gear
from emacm.machine.fault_lines import LineLevels
from emacm.machine.fault_orders import FaultSeries, fault_series

STEP = 1 / 25
ORDERS = STEP * np.arange(0, 501)
BEARING = Bearing(9, 7.94, 39.04)  # 6205


def table(psd, channels=("vibration",)):
    names = [f"{channel}@{float(order)!r}" for channel in channels for order in ORDERS]
    return pd.DataFrame(np.atleast_2d(psd), columns=names)


def spectrum(lines, height=100.0, *, floor=1.0):
    """A flat background with lines at the nearest orders of the axis."""
    psd = np.full(len(ORDERS), floor)
    for order in lines:
        psd[round(order / STEP)] = floor * height
    return psd


def levels(psd, **options):
    return FaultLines(BEARING, **options).set_output(transform="pandas").fit_transform(table(psd))


def test_the_level_of_a_fault_is_the_mean_height_of_its_lines():
    psd = spectrum([3.584785])  # one line of three: 20 dB, 0, 0
    found = levels(psd)
    assert found["vibration@BPFO"][0] == pytest.approx(20 / 3)
    assert found["vibration@BPFI"][0] == pytest.approx(0)


def test_a_ball_shows_at_even_multiples_of_its_spin():
    assert levels(spectrum([2.356748, 7.070243]))["vibration@BSF"][0] == pytest.approx(0)
    even = spectrum([2 * 2.356748, 4 * 2.356748, 6 * 2.356748])
    assert levels(even)["vibration@BSF"][0] == pytest.approx(20)


@pytest.mark.slow
@given(st.floats(-0.019, 0.019), st.floats(1e-6, 1e6))
@example(0.0, 1e6)
@example(-0.019, 1e-6)
@example(0.015625, 1.0)  # the second line at order 11
def test_neither_slip_nor_gain_changes_the_level(slip, gain):
    lines = [5.415215 * (1 + slip) * k for k in (1, 2, 3)]
    assert levels(gain * spectrum(lines))["vibration@BPFI"][0] == pytest.approx(20)


def test_lines_that_slip_apart_are_no_series():
    slipped = [5.415215 * 1.02, 2 * 5.415215 * 0.98, 3 * 5.415215]
    assert levels(spectrum(slipped))["vibration@BPFI"][0] < 10


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"harmonics": 5}, ["'BPFI'", "order 27.6", "0 to 20", "max_order"]),
        ({"background": 0.03}, ["background of 0.03 orders", "revolutions=167"]),
        ({"channels": ["sound"]}, ["'sound'", "vibration"]),
        ({"parts": None}, ["parts must be", "Bearing", "None"]),
        ({"parts": [BEARING, 3.5]}, ["part 1", "3.5"]),
        ({"parts": {"cage": 0.004}}, ["'cage'", "order 0.004", "revolutions of OrderPSD"]),
        ({"parts": [BEARING, BEARING]}, ["'BPFO'", "name="]),
    ],
)
def test_what_cannot_be_measured_is_refused(options, words):
    lines = FaultLines(**{"parts": BEARING, **options})
    with pytest.raises((TypeError, ValueError)) as refusal:
        lines.fit(table(spectrum([])))
    for word in words:
        assert word in str(refusal.value)


def test_the_hunting_tooth_is_left_out_where_the_spectra_do_not_resolve_it():
    gear = Gear(5, 12)  # at order 1/12: two lines of the axis
    assert FaultLines(gear).fit(table(spectrum([]))).faults_ == ("mesh", "pinion", "wheel")


def test_the_background_is_the_median_around_each_line_and_mirrored_at_the_ends():
    psd = np.random.default_rng(5).gamma(3.0, size=(2, len(ORDERS)))
    psd[1, 7] = 0.0
    measure = LineLevels(ORDERS, [FaultSeries("wear", (4.0,), False)], 0.0, 0.2)
    padded = np.pad(psd, ((0, 0), (5, 5)), mode="reflect")
    medians = np.median([padded[:, k : k + len(ORDERS)] for k in range(11)], axis=0)
    expected = 10 * np.log10(np.maximum(psd, np.finfo(float).tiny) / medians)
    np.testing.assert_allclose(measure.heights(psd), expected, rtol=1e-12, atol=1e-12)
    there = psd > 0
    np.testing.assert_allclose(measure.background(psd)[there], medians[there], rtol=1e-12)


@pytest.mark.parametrize(
    ("order", "without_shaft", "level"),
    [(5.08, False, 20), (5.08, True, 0), (5.04, True, 20), (4.98, True, 20)],
)
def test_lines_of_the_shaft_count_only_where_they_are_predicted(order, without_shaft, level):
    slipping = FaultSeries("wear", (order, 2 * order, 3 * order), True)
    measure = LineLevels(ORDERS, [slipping], 0.02, 0.5, without_shaft=without_shaft)
    found, slips, lines = measure.measure(spectrum([5, 10, 15])[np.newaxis])
    assert found == pytest.approx(level, abs=1e-9)
    np.testing.assert_allclose(lines[0], [[level] * 3], atol=1e-9)
    assert slips[0, 0] == pytest.approx(5 / order - 1 if level else 0, abs=STEP / 5)


def test_sidebands_are_averaged_where_the_spectrum_has_them():
    heights = {102: 10, 152: 20, 229: 30, 427: 8}  # orders 4.08, 6.08, 9.16 and 17.08
    psd = np.ones((1, len(ORDERS)))
    for place, height in heights.items():
        psd[0, place] = 10 ** (height / 10)
    fault = FaultSeries("wear", (5.0, 10.0), True, "", (("cage", 1), ("far", 12), ("none", 30)))
    found = LineLevels(ORDERS, [fault], 0.02, 0.5).sidebands(psd, fault, 0.016)
    assert found == {"cage": pytest.approx(15), "far": pytest.approx(8)}


@pytest.mark.slow
@pytest.mark.parametrize("shape", [1.0, 40.0])
def test_background_alone_is_named_as_often_as_its_p_value_says(shape):
    series = [fault for fault in fault_series(BEARING, 3) if fault.name != "FTF"]
    measure = LineLevels(ORDERS, series, 0.02, 0.5)
    psd = np.random.default_rng(7).standard_gamma(shape, (400, len(ORDERS)))
    p = measure.compare(psd, measure.measure(psd)[0])[1]
    for limit in (0.05, 0.2):
        share = (p <= limit).mean(axis=0)  # of 400: standard error of 0.011 at 0.05, 0.02 at 0.2
        assert np.all(np.abs(share - limit) < 0.06)


def test_the_shape_of_the_background_is_found_beside_strong_lines():
    measure = LineLevels(ORDERS, fault_series(BEARING, 3), 0.02, 0.5)
    shapes = np.repeat([3.0, 25.0], 200)
    psd = np.random.default_rng(1).standard_gamma(shapes[:, np.newaxis], (400, len(ORDERS)))
    psd[:, ::60] *= 1_000
    found = measure.background_shapes(psd).reshape(2, 200)
    assert np.median(found, axis=1) == pytest.approx([3, 25], rel=0.1)


def test_the_least_p_value_is_one_in_2001_and_is_the_same_in_every_run():
    def measure():
        return LineLevels(ORDERS[:60], [FaultSeries("wear", (1.0,), False)], 0.0, 0.5)

    psd = np.random.default_rng(0).standard_gamma(4.0, (1, 60))
    excess, p = measure().compare(psd, np.array([[100.0]]))
    assert p == pytest.approx(1 / 2001, rel=1e-12)
    assert measure().compare(psd, np.array([[100.0]]))[0] == excess
