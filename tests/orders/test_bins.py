"""Facts about bins: they add up to the integral of the PSD, whatever their edges."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm.orders.bins import bin_edges, bin_operator, check_edges, check_stop_bands
from emacm.orders.columns import OrderTable

TURN = 2 * np.pi


def integral(orders, psd, low, high):
    """Integrate the straight lines between spectral values, by adding points at the edges."""
    points = np.concatenate([[low], orders[(orders > low) & (orders < high)], [high]])
    return trapezoid(np.interp(points, orders, psd), points)


@st.composite
def spectra(draw):
    """Lines evenly spaced from order 0, and a PSD of several decades."""
    n_orders = draw(st.integers(2, 80))
    step = draw(st.floats(0.01, 2))
    psd = np.random.default_rng(draw(st.integers(0, 2**32 - 1))).lognormal(0, 3, n_orders)
    return step * np.arange(n_orders), psd


def bands_within(top):
    edges = st.floats(0, 1)
    return st.tuples(edges, edges).filter(lambda pair: pair[1] - pair[0] > 1e-3).map(
        lambda pair: (pair[0] * top, pair[1] * top)
    )  # fmt: skip


def table(orders, *rows, channel="current"):
    return pd.DataFrame(list(rows), columns=[f"{channel}@{float(order)!r}" for order in orders])


# Edges


@given(st.floats(0.01, 100), st.floats(0.01, 100))
def test_bins_adjoin_from_0_to_the_highest_order(bin_size, max_order):
    edges = bin_edges(bin_size, max_order)
    assert edges[0][0] == 0
    assert edges[-1][1] == pytest.approx(max_order, rel=1e-11)
    assert all(low < high for low, high in edges)
    assert all(before[1] == after[0] for before, after in pairwise(edges))
    widths = [high - low for low, high in edges]
    np.testing.assert_allclose(widths[:-1], bin_size, rtol=1e-6)
    assert widths[-1] <= bin_size + 1e-7


# The integral


@given(spectrum=spectra(), seed=st.integers(0, 2**32 - 1), n_edges=st.integers(2, 40))
@example(
    spectrum=(np.array([0, 2.0]), np.array([1.458, 0.673])), seed=124, n_edges=2
)  # close edges
def test_bins_of_any_edges_are_the_integrals_between_them(spectrum, seed, n_edges):
    orders, psd = spectrum
    edges = np.sort(np.random.default_rng(seed).uniform(0, orders[-1], n_edges))
    assume(np.diff(edges).min() > 1e-6)
    bands = check_edges(edges)
    each = bin_operator(orders, bands) @ psd
    # Edges are rounded to 12 digits: between two that are close, this is more than 1e-9.
    whole = integral(orders, psd, bands[0][0], bands[-1][1])
    assert each.sum() == pytest.approx(whole, rel=1e-9, abs=1e-14 * psd.max() * orders[-1])
    expected = [integral(orders, psd, low, high) for low, high in bands]
    np.testing.assert_allclose(each, expected, rtol=1e-9, atol=1e-11 * psd.max() * orders[-1])


def test_a_bin_between_two_lines_is_a_slice_of_the_straight_line():
    # The PSD rises from 0 to 1 over one order: its integral to x is x²/2.
    operator = bin_operator([0, 1], [(0.2, 0.3), (0.5, 1)])
    np.testing.assert_allclose(operator @ [0, 1], [(0.09 - 0.04) / 2, (1 - 0.25) / 2], rtol=1e-14)


# Stop bands


@given(spectrum=spectra(), data=st.data())
def test_a_stop_band_takes_out_exactly_what_lies_in_it(spectrum, data):
    orders, psd = spectrum
    low, high = data.draw(bands_within(orders[-1]))
    bins = bin_edges(orders[-1] / 7, orders[-1])
    whole = bin_operator(orders, bins) @ psd
    left = bin_operator(orders, bins, stop_bands=[(low, high)]) @ psd
    lost = np.array([
        integral(orders, psd, max(low, a), min(high, b)) if min(high, b) > max(low, a) else 0
        for a, b in bins
    ])  # fmt: skip
    np.testing.assert_allclose(whole - left, lost, atol=1e-9 * whole.sum())


@given(spectrum=spectra(), data=st.data())
def test_stop_bands_that_overlap_take_out_their_union_once(spectrum, data):
    orders, psd = spectrum
    bands = data.draw(st.lists(bands_within(orders[-1]), min_size=1, max_size=5))
    union = check_stop_bands(bands)
    whole = [(0, orders[-1])]
    taken = bin_operator(orders, whole) @ psd - bin_operator(orders, whole, stop_bands=bands) @ psd
    expected = sum(integral(orders, psd, low, high) for low, high in union)
    assert taken[0] == pytest.approx(expected, rel=1e-9, abs=1e-9 * trapezoid(psd, orders))


# BinTransformer


@given(spectrum=spectra(), bin_size=st.floats(0.05, 50), data=st.data())
def test_the_transformer_adds_up_to_the_integral_less_the_stop_band(spectrum, bin_size, data):
    orders, psd = spectrum
    assume(orders[-1] / bin_size < 200)
    stop = data.draw(bands_within(orders[-1]))
    assume(orders[-1] - (stop[1] - stop[0]) > 1e-3)
    bins = BinTransformer(bin_size, max_order=orders[-1], stop_bands=(stop,))
    power = bins.fit_transform(table(orders, psd)).sum()
    whole = trapezoid(psd, orders)
    assert power == pytest.approx(whole - integral(orders, psd, *stop), rel=1e-9, abs=1e-9 * whole)


@pytest.mark.parametrize(
    ("bin_size", "max_order", "names"),
    [
        (0.5, 1, ["current@0-0.5", "current@0.5-1"]),
        (0.1, 0.4, ["current@0-0.1", "current@0.1-0.2", "current@0.2-0.3", "current@0.3-0.4"]),
        (0.4, 1, ["current@0-0.4", "current@0.4-0.8", "current@0.8-1"]),
        (1 / 3, 1, ["current@0-0.333333333333", "current@0.333333333333-0.666666666667",
                    "current@0.666666666667-1"]),
    ],
)  # fmt: skip
def test_numbers_in_names_are_the_shortest_exact_ones(bin_size, max_order, names):
    bins = BinTransformer(bin_size, max_order=max_order).fit(table(np.arange(3.0), np.ones(3)))
    assert bins.get_feature_names_out().tolist() == names


def test_named_bands_may_overlap_and_give_their_names():
    edges = {"BPFI": (6.0, 6.25), "around it": (5.5, 7)}
    bins = BinTransformer(edges=edges).set_output(transform="pandas")
    power = bins.fit_transform(table(np.arange(11.0), np.ones(11), channel="vibration"))
    assert power.columns.tolist() == ["vibration@BPFI", "vibration@around it"]
    np.testing.assert_allclose(power, [[0.25, 1.5]], rtol=1e-12)


def test_edges_of_ones_own_need_not_start_at_0():
    bins = BinTransformer(edges=[2, 2.5, 7])
    power = bins.fit_transform(table(np.arange(11.0), np.ones(11)))
    assert bins.get_feature_names_out().tolist() == ["current@2-2.5", "current@2.5-7"]
    np.testing.assert_allclose(power, [[0.5, 4.5]], rtol=1e-12)


def test_a_bin_inside_a_stop_band_has_no_column():
    bins = BinTransformer(1, max_order=5, stop_bands=((0.9, 2), (4.5, 4.6)))
    power = bins.fit_transform(table(np.arange(6.0), np.ones(6)))
    names = ["current@0-1", "current@2-3", "current@3-4", "current@4-5"]
    assert bins.get_feature_names_out().tolist() == names
    assert bins.bins_ == ((0, 1), (2, 3), (3, 4), (4, 5))
    np.testing.assert_allclose(power, [[0.9, 1, 1, 0.9]], rtol=1e-12)


def test_a_table_without_an_axis_runs_evenly_up_to_the_highest_order():
    bins = BinTransformer(1, max_order=50)
    power = bins.fit_transform(np.ones((1, 401)))
    assert power.shape == (1, 50)
    np.testing.assert_allclose(power, 1, rtol=1e-9)


def test_a_table_without_an_axis_may_be_told_its_step():
    power = BinTransformer(1, max_order=2, order_step=0.25).fit_transform(np.ones((1, 41)))
    np.testing.assert_allclose(power, [[1, 1]], rtol=1e-12)


@pytest.mark.parametrize("window", ["hann", "boxcar", "flattop"])
def test_bins_of_a_recording_add_up_to_its_mean_square(window):
    fs = 10_000
    time = np.arange(8 * fs) / fs
    angle = TURN * (5 * time + time**2)
    signal = 2 * np.sin(6 * angle) + np.sin(20.3 * angle)
    recording = Recording({"x": signal}, fs, angle=angle)
    psd = OrderPSD(8, window=window)
    spectra = psd.fit_transform(OrderResampler().fit_transform([recording]))
    for bin_size in (0.06, 0.3, 1, 7):
        power = BinTransformer(bin_size, max_order=50).fit_transform(spectra)
        assert power.sum() == pytest.approx(4 / 2 + 1 / 2, rel=0.005)


# Errors


def test_the_logarithm_of_bins_without_power_names_recording_and_bin():
    psd = np.ones((3, 6))
    psd[1, 3:] = 0
    table = OrderTable(psd, ["torque@0", "torque@1", "torque@2", "a@0", "a@1", "a@2"])
    bins = BinTransformer(1, max_order=2).fit(table)
    with np.errstate(all="ignore"), pytest.raises(ValueError, match=r"recording 1, column 'a@0-1'"):
        np.log10(bins.transform(table))
    assert type(np.log10(bins.transform(table[::2]))) is np.ndarray
    assert type(2 * bins.transform(table)) is np.ndarray


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("form", [list, np.asarray, pd.DataFrame])
def test_a_value_that_is_not_finite_is_named_with_recording_and_column(form, value):
    columns = [f"z@{k}" for k in range(3)]
    psd = pd.DataFrame(np.ones((4, 3)), columns=columns)
    bins = BinTransformer(max_order=2).fit(psd if form is pd.DataFrame else form(psd.to_numpy()))
    psd.iloc[2, 1] = value
    where = "'z@1'" if form is pd.DataFrame else "1"
    bad = psd if form is pd.DataFrame else form(psd.to_numpy())
    for use in (bins.transform, bins.fit):
        with pytest.raises(ValueError, match=rf"X must be finite.*recording 2.*{where}"):
            use(bad)


def test_a_step_that_contradicts_two_orders_is_refused():
    two = OrderTable(np.ones((1, 2)), ["a@0", "a@0.75"])
    with pytest.raises(ValueError, match=r"order_step = 0.5 contradicts .*'a'.* are \[0.0, 0.75\]"):
        BinTransformer(0.5, max_order=0.5, order_step=0.5).fit(two)
