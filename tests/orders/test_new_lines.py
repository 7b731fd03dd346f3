"""Facts about new spectral lines, which a bin beside a strong line hides."""

import numpy as np
import pytest

from emacm import BinTransformer
from emacm.orders.columns import OrderTable, order_columns

ORDERS = np.arange(0, 12.01, 0.125)
STRONG = 4.0


def spectra(n, seed, *, spread=3.0, n_segments=20, n_channels=1):
    """Draw spectra with a strong line, of units whose level differs [dB]."""
    rng = np.random.default_rng(seed)
    shape = np.tile(1 + 1000 * np.exp(-(((ORDERS - STRONG) / 0.1) ** 2)), n_channels)
    level = 10 ** (rng.normal(0, spread, (n, 1)) / 10)
    return level * shape * rng.gamma(n_segments, 1 / n_segments, (n, len(shape)))


def table(psd):
    channels = [f"c{k}" for k in range(psd.shape[1] // len(ORDERS))]
    return OrderTable(psd, order_columns(channels, ORDERS))


def column(order):
    return int(np.argmin(np.abs(ORDERS - order)))


def with_line(psd, order, decibels, above):
    """Add a line at one order, of a level relative to the largest value there."""
    changed = psd.copy()
    changed[:, column(order)] += above[:, column(order)].max() * 10 ** (decibels / 10)
    return changed


def stated(bins, psd):
    """Return what is stated of each recording."""
    return [[line.text for line in lines] for lines in bins.new_lines(table(psd))]


@pytest.fixture(scope="module")
def training():
    return spectra(60, 1)


@pytest.fixture(scope="module")
def fitted(training):
    return BinTransformer(1.0, max_order=12).fit(table(training))


def test_a_new_line_in_the_bin_of_a_strong_line_is_stated_at_its_order(training, fitted):
    known = spectra(20, 2)
    new = with_line(known, 4.5, 12, training)
    bins = [np.asarray(fitted.transform(table(psd))) for psd in (known, training)]
    spread = np.log10(bins[1]).std(axis=0)
    changed = np.asarray(fitted.transform(table(new)))
    assert (np.abs(np.log10(changed / bins[0])) < 2 * spread).all()  # the bins hardly show it
    assert all(any("order 4.5 " in text for text in texts) for texts in stated(fitted, new))
    assert stated(fitted, known) == [[]] * len(known)


@pytest.mark.slow
@pytest.mark.parametrize("n_segments", [1, 4, 40])
@pytest.mark.parametrize("n_units", [6, 12, 40])
def test_at_most_two_per_cent_of_the_recordings_of_new_units_exceed_the_limit(n_units, n_segments):
    rates = []
    for seed in range(25):
        psd = spectra(n_units, [seed, 0], n_segments=n_segments)
        bins = BinTransformer(1.0, max_order=12).fit(table(psd))
        new = spectra(40, [seed, 1], n_segments=n_segments)
        rates.append(np.mean([bool(texts) for texts in stated(bins, new)]))
    assert np.mean(rates) <= 0.02


def test_a_weak_line_is_stated_whatever_the_level_of_the_recording(training, fitted):
    known = spectra(40, 2)
    psd = known.copy()
    psd[:, column(9)] *= 10**0.9  # 9 dB above the background
    assert (psd[:, column(9)] < training[:, column(9)].max()).mean() > 0.1  # of quiet units
    found = stated(fitted, psd)
    assert np.mean(["order 9 " in "".join(texts) for texts in found]) > 0.95
    assert stated(fitted, 1e4 * psd) == found  # a gain changes nothing
    assert stated(fitted, known) == [[]] * len(known)


def test_recordings_of_one_unit_are_left_out_together():
    units = spectra(8, 3, n_segments=4)
    rng = np.random.default_rng(0)
    copies = np.repeat(units, 5, axis=0) * rng.gamma(5000, 1 / 5000, (40, units.shape[1]))
    groups = [f"unit {k // 5}" for k in range(40)]
    single = limits(BinTransformer(max_order=12).fit(table(copies)))
    together = limits(BinTransformer(max_order=12).fit(table(copies), groups=groups))
    of_units = limits(BinTransformer(max_order=12).fit(table(units)))
    assert np.median(single) == 4
    assert np.median(together) > 10
    np.testing.assert_allclose(together, of_units, rtol=0.15)


def limits(bins):
    known = bins.known_lines_
    return known.limits[np.isfinite(known.maxima)]


def test_fewer_than_five_groups_give_no_limit(training):
    for psd, groups in ((training[:4], None), (training, np.arange(60) % 4)):
        bins = BinTransformer(max_order=12).fit(table(psd), groups=groups)
        assert np.isinf(bins.known_lines_.limits).all()
        assert stated(bins, with_line(training[:2], 9, 60, training)) == [[], []]


def test_lines_in_stop_bands_and_above_the_last_bin_are_not_compared(training):
    bins = BinTransformer(max_order=10, stop_bands=[(5.5, 6.5)]).fit(table(training))
    known = spectra(1, 2)
    for order, is_new in ((6.0, False), (11.0, False), (7.0, True)):
        assert bool(stated(bins, with_line(known, order, 20, training))[0]) == is_new


def test_a_channel_without_signal_in_the_training_is_not_compared():
    psd = spectra(20, 5, n_channels=2)
    psd[:, len(ORDERS) :] = 0
    bins = BinTransformer(max_order=12).fit(table(psd))
    assert stated(bins, spectra(1, 6, n_channels=2)) == [[]]
    silent = BinTransformer(max_order=12).fit(table(np.zeros((20, len(ORDERS)))))
    assert stated(silent, spectra(1, 6)) == [[]]


def test_a_channel_that_fails_has_no_new_lines():
    bins = BinTransformer(max_order=12).fit(table(spectra(20, 5, n_channels=2)))
    psd = spectra(1, 6, n_channels=2)
    for lines in (0.0, 1e-30 * np.where(ORDERS == 0, 1e6, 1)):  # also of rounding errors
        psd[:, len(ORDERS) :] = lines
        assert stated(bins, psd) == [[]]


def test_cross_spectra_are_not_compared():
    signed = spectra(20, 5) * np.random.default_rng(0).choice([-1, 1], (20, len(ORDERS)))
    bins = BinTransformer(max_order=12).fit(table(signed))
    assert np.isinf(bins.known_lines_.maxima).all()
    assert stated(bins, spectra(1, 6)) == [[]]


def test_a_wide_range_is_one_statement_and_a_whole_spectrum_none(training, fitted):
    known = spectra(1, 2)
    wide, many, loud = known.copy(), known.copy(), with_line(known, 9.0, 20, training)
    wide[:, column(6) : column(6) + 7] *= 1e4
    many[:, column(5) :: 8] += 1e5
    assert stated(fitted, known * 1e4) == [[]]  # a gain
    assert stated(fitted, loud * 30) == stated(fitted, loud)
    assert stated(fitted, loud)[0][0].startswith("line at order 9 of 'c0', ")
    assert stated(fitted, wide)[0][0].startswith("orders 6 to 6.75 of 'c0', up to ")
    texts = stated(fitted, many)[0]
    assert len(texts) == 6
    assert texts[-1] == "and at 3 more orders"


def test_a_statement_has_the_channel_and_how_far_the_limit_is_exceeded(training):
    psd = np.hstack([spectra(60, 1), spectra(60, 4)])
    bins = BinTransformer(max_order=12).fit(table(psd))
    new = np.hstack([spectra(1, 2), with_line(spectra(1, 3), 9.0, 20, psd[:, len(ORDERS) :])])
    ((line,),) = bins.new_lines(table(new))
    assert (line.kind, line.channel) == ("new line", "c1")
    assert line.value > line.limit >= 4


def test_one_group_for_each_recording_is_needed(training):
    with pytest.raises(ValueError, match="a label for each of 60 recordings, got 2"):
        BinTransformer(max_order=12).fit(table(training), groups=["a", "b"])
    with pytest.raises(ValueError, match=r"must be one column.*shape \(60, 2\)"):
        BinTransformer(max_order=12).fit(table(training), groups=np.zeros((60, 2)))
    with pytest.raises(ValueError, match="that of recording 3 is missing"):
        BinTransformer(max_order=12).fit(table(training), groups=["a"] * 3 + [None] + ["b"] * 56)
