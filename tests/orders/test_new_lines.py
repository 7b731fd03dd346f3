"""Facts about new spectral lines, which a bin beside a strong line hides."""

import warnings

import numpy as np
import pytest
import sklearn
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeClassifier

from emacm import BinTransformer
from emacm.orders.columns import OrderBlock, OrderTable, order_columns
from emacm.orders.new_lines import (
    collected_statements,
    excess_limit,
    largest_medians,
    line_maxima,
    state_new_lines,
)

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
    texts = []
    for row in psd:
        with collected_statements() as found:
            bins.transform(table(row[np.newaxis]))
        texts.append(found)
    return texts


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
    with pytest.warns(UserWarning, match=r"line at order 4.5 of 'c0', \d+ dB above the training"):
        changed = np.asarray(fitted.transform(table(new)))
    assert (np.abs(np.log10(changed / bins[0])) < 2 * spread).all()  # the bins hardly show it
    assert all(any("order 4.5 " in text for text in texts) for texts in stated(fitted, new))
    assert stated(fitted, known) == [[]] * len(known)


def test_the_values_of_the_bins_do_not_depend_on_the_training(training, fitted):
    psd = with_line(spectra(3, 2), 9.0, 30, training)
    with pytest.warns(UserWarning, match="line at order 9 "):
        found = np.asarray(fitted.transform(table(psd)))
    own = BinTransformer(1.0, max_order=12).fit_transform(table(psd))
    np.testing.assert_array_equal(found, np.asarray(own))


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


def test_recordings_of_one_unit_are_left_out_together():
    units = spectra(8, 3)
    rng = np.random.default_rng(0)
    copies = np.repeat(units, 5, axis=0) * rng.gamma(5000, 1 / 5000, (40, units.shape[1]))
    groups = [f"unit {k // 5}" for k in range(40)]
    single = BinTransformer(max_order=12).fit(table(copies)).new_line_limit_
    together = BinTransformer(max_order=12).fit(table(copies), groups=groups).new_line_limit_
    of_units = BinTransformer(max_order=12).fit(table(units)).new_line_limit_
    assert single == 6.0
    assert together == pytest.approx(of_units, rel=0.1)
    assert together > 10


def test_fewer_than_five_groups_give_no_limit(training):
    for psd, groups in ((training[:4], None), (training, np.arange(60) % 4)):
        bins = BinTransformer(max_order=12).fit(table(psd), groups=groups)
        assert np.isinf(bins.new_line_limit_)
        assert stated(bins, 1e9 * training[:2]) == [[], []]


def test_equal_training_recordings_have_the_least_limit():
    psd = np.repeat(spectra(1, 0), 9, axis=0)
    assert BinTransformer(max_order=12).fit(table(psd)).new_line_limit_ == 6.0


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


def test_a_wide_range_is_one_statement_and_a_whole_spectrum_none(training, fitted):
    known = spectra(1, 2)
    wide, many = known.copy(), known.copy()
    wide[:, column(6) : column(7) + 1] += 1e4
    many[:, column(5) :: 8] += 1e5
    assert stated(fitted, known * 1e4) == [[]]  # a gain
    assert stated(fitted, with_line(known, 9.0, 20, training) * 30)[0][0].startswith(
        "line at order"
    )
    assert stated(fitted, wide)[0][0].startswith("orders 6 to 7 of 'c0', up to ")
    texts = stated(fitted, many)[0]
    assert len(texts) == 6
    assert texts[-1] == "and at 3 more orders"


def test_a_warning_lists_five_recordings(training, fitted):
    new = with_line(spectra(8, 2), 9.0, 20, training)
    with pytest.warns(UserWarning, match="and 3 more recordings") as caught:
        fitted.transform(table(new))
    (warning,) = caught
    lines = str(warning.message).split("\n")
    assert lines[0].startswith("recording 0: line at order 9 of 'c0', ")
    assert lines[-1] == "and 3 more recordings"
    assert len(lines) == 6


def test_one_group_for_each_recording_is_needed(training):
    with pytest.raises(ValueError, match="one label for each of the 60 recordings, got 2"):
        BinTransformer(max_order=12).fit(table(training), groups=["a", "b"])
    with pytest.raises(ValueError, match=r"one-dimensional.*shape \(60, 2\). Pass one column"):
        BinTransformer(max_order=12).fit(table(training), groups=np.zeros((60, 2)))
    with pytest.raises(ValueError, match="that of recording 3 is missing"):
        BinTransformer(max_order=12).fit(table(training), groups=["a"] * 3 + [None] + ["b"] * 56)


def test_a_model_of_an_earlier_version_states_nothing(training, fitted):
    state = dict(vars(fitted))
    old = BinTransformer()
    vars(old).update({k: v for k, v in state.items() if k not in ("line_maxima_",)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        old.transform(table(training * 1e6))


def test_with_metadata_routing_the_groups_of_a_search_reach_the_bins(training):
    groups, y = np.arange(60) % 10, np.arange(60) // 30
    with sklearn.config_context(enable_metadata_routing=True):
        pipe = make_pipeline(BinTransformer(max_order=12), DecisionTreeClassifier())
        search = GridSearchCV(pipe, {}, cv=GroupKFold(2)).fit(table(training), y, groups=groups)
    own = BinTransformer(max_order=12).fit(table(training), groups=groups).new_line_limit_
    assert search.best_estimator_[0].new_line_limit_ == own


# Numbers, computed in another way


@pytest.mark.parametrize(("n_groups", "n_columns"), [(5, 2), (7, 2), (8, 40), (30, 3)])
def test_the_limit_is_that_of_each_group_beside_all_others(n_groups, n_columns):
    psd = np.random.default_rng(n_groups).gamma(2, size=(n_groups, n_columns)) ** 3
    psd[: n_groups - 1, 1] = 0  # a line of a single group
    psd *= 1e5
    maxima = psd.max(axis=0)
    others = [
        np.maximum(np.delete(psd, k, axis=0).max(axis=0), 1e-12 * maxima) for k in range(n_groups)
    ]
    excess = 10 * np.log10((psd / others).max(axis=1))
    median = np.median(excess)
    peaks = excess[excess > median] - median
    # Lomax: P(excess > limit) = half (1 + limit / sum)^-n, which is to be 0.01.
    limit = median + peaks.sum() * (50 ** (1 / len(peaks)) - 1)
    assert excess_limit(psd, psd.max(axis=0)) == pytest.approx(max(limit, 6))
    assert limit > 6
    rows = np.repeat(psd, 3, axis=0) * np.tile([0.5, 1, 0.2], n_groups)[:, np.newaxis]
    labels = np.repeat([f"unit {9 * k % 31}" for k in range(n_groups)], 3)
    mixed = np.random.default_rng(0).permutation(len(rows))
    found = excess_limit(rows[mixed], psd.max(axis=0), labels[mixed])
    assert found == pytest.approx(limit)
    assert excess_limit(psd[:4], psd[:4].max(axis=0)) == np.inf


def test_columns_that_are_not_compared_do_not_change_the_limit():
    psd = np.random.default_rng(3).gamma(2, size=(9, 6)) ** 3
    maxima = psd.max(axis=0)
    maxima[[0, 4]] = np.inf
    kept = [1, 2, 3, 5]
    assert excess_limit(psd, maxima) == excess_limit(psd[:, kept], maxima[kept])
    assert excess_limit(psd, np.full(6, np.inf)) == np.inf


BLOCKS = (
    OrderBlock("z", np.array([0.0, 0.5, 1.0, 1.5]), slice(0, 4)),
    OrderBlock("a", np.array([0.0, 2.0, 4.0]), slice(4, 7)),
)


def test_the_least_maximum_is_a_trillionth_of_the_largest_of_its_channel():
    psd = np.array([[0.0, 5, 2, 1e-20, 0, 3e4, 1], [0.0, 4, 8, 0, 0, 2e4, 1]])
    expected = [8e-12, 5, 8, 8e-12, 3e-8, 3e4, 1]
    np.testing.assert_allclose(line_maxima(psd, BLOCKS), expected, rtol=1e-12)
    psd[:, 4:] = 0
    expected[4:] = [np.inf] * 3
    np.testing.assert_allclose(line_maxima(psd, BLOCKS), expected, rtol=1e-12)


def test_the_largest_median_is_that_of_one_recording_relative_to_the_maxima():
    maxima = np.array([10.0, 10, 10, np.inf, np.inf, np.inf, np.inf])
    psd = np.array([[1, 2, 9, 99, 1, 1, 1], [9, 4, 1, 99, 1, 1, 1], [3, 3, 1, 99, 1, 1, 1.0]])
    found = largest_medians(psd, maxima, BLOCKS)
    assert found == pytest.approx([10 * np.log10(0.4), np.nan], nan_ok=True)
    assert largest_medians(0 * psd, maxima, BLOCKS)[0] == -120


def excess_of(*decibels):
    """A spectrum that lies so far above maxima of 2."""
    return 2.0 * 10 ** (np.array(decibels) / 10)


@pytest.mark.parametrize(
    ("decibels", "median", "texts"),
    [
        ([-3, 9, -2, 0], -3.0, ["line at order 0.5 of 'z', 9 dB"]),  # 1 dB higher as a whole
        ([9.4, -9, -9, 12], -3.0, ["line at order 1.5 of 'z', 12 dB", "line at order 0 of 'z', 9"]),
        ([6.9, -9, 6.1, 7], -3.0, []),  # the rest, too, is higher
        ([6.9, -9, -9, -9], -3.0, ["line at order 0 of 'z', 7 dB"]),
        ([5.9, -9, -9, -9], -3.0, []),
    ],
)
def test_lines_above_the_limit_are_stated_the_farthest_first(decibels, median, texts):
    maxima = np.array([2.0] * 4 + [np.inf] * 3)  # a second channel, which is not compared
    psd = np.r_[excess_of(*decibels), [1.0, 1e9, 1]][np.newaxis]
    (found,) = state_new_lines(psd, maxima, 6.0, np.array([median, np.nan]), BLOCKS)
    assert len(found) == len(texts)
    for text, start in zip(found, texts, strict=True):
        assert text.startswith(start)
        assert text.endswith(" dB above the training maximum")


@pytest.mark.parametrize(
    ("n_lines", "start"), [(4, "line at order 1.75 "), (5, "orders 1 to 2 of 'z', up to 13 dB ")]
)
def test_more_than_four_adjacent_orders_are_a_range(n_lines, start):
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    psd = np.full(40, 0.1)
    psd[4 : 4 + n_lines] = 10
    psd[7] = 20
    ((text,),) = state_new_lines(psd[np.newaxis], np.ones(40), 6.0, np.array([-10.0]), [block])
    assert text.startswith(start)


@pytest.mark.parametrize(("n_lines", "last"), [(5, "line"), (6, "and at 1 more orders")])
def test_five_statements_are_made_of_a_recording(n_lines, last):
    block = OrderBlock("z", np.arange(40.0), slice(0, 40))
    psd = np.full(40, 0.1)
    psd[2 : 2 + 4 * n_lines : 4] = 10
    (texts,) = state_new_lines(psd[np.newaxis], np.ones(40), 6.0, np.array([-10.0]), [block])
    assert texts[-1].startswith(last)
    assert len(texts) == n_lines


def test_only_recordings_with_new_lines_are_warned_of():
    same = np.repeat(spectra(1, 0), 9, axis=0)
    bins = BinTransformer(max_order=12).fit(table(same))
    assert bins.new_line_limit_ == 6.0
    rows = np.repeat(same[:1], 4, axis=0)
    rows[2, column(9)] *= 10**0.61  # 6.1 dB
    rows[1, column(9)] *= 10**0.59
    with pytest.warns(UserWarning, match="line at order 9 ") as caught:
        bins.transform(table(rows))
    assert str(caught[0].message) == (
        "recording 2: line at order 9 of 'c0', 6 dB above the training maximum"
    )
    assert caught[0].filename == __file__


def test_lines_of_a_table_without_names_are_compared():
    same = np.repeat(spectra(1, 0), 9, axis=0)
    bins = BinTransformer(max_order=12, order_step=0.125).fit(same)
    new = same[:1].copy()
    new[0, column(9)] *= 100
    with pytest.warns(UserWarning, match="recording 0: line at order 9 of 'signal', 20 dB above"):
        bins.transform(new)


def test_a_statement_is_collected_once(training, fitted):
    new = with_line(spectra(1, 2), 9.0, 20, training)
    with collected_statements() as found:
        for _ in range(3):
            fitted.transform(table(new))
    assert len(found) == 1
