"""Facts about new spectral lines, which a bin beside a strong line hides."""

import warnings
from itertools import pairwise

import numpy as np
import pytest
import sklearn
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.tree import DecisionTreeClassifier

from emacm import BinTransformer
from emacm.orders import new_lines
from emacm.orders.columns import OrderBlock, OrderTable, order_columns
from emacm.orders.line_heights import line_heights
from emacm.orders.new_lines import (
    KnownLines,
    collected_statements,
    learn_lines,
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
    with pytest.warns(UserWarning, match=r"line at order 4.5 of 'c0', \d+ dB above the background"):
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
    return bins.new_line_limits_[np.isfinite(bins.line_maxima_)]


def test_fewer_than_five_groups_give_no_limit(training):
    for psd, groups in ((training[:4], None), (training, np.arange(60) % 4)):
        bins = BinTransformer(max_order=12).fit(table(psd), groups=groups)
        assert np.isinf(bins.new_line_limits_).all()
        assert stated(bins, with_line(training[:2], 9, 60, training)) == [[], []]


def test_equal_training_recordings_have_the_least_limit():
    psd = np.repeat(spectra(1, 0), 9, axis=0)
    assert (limits(BinTransformer(max_order=12).fit(table(psd))) == 4).all()


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


@pytest.mark.parametrize(("decibels", "n_stated"), [(3.9, 0), (4.1, 1)])
def test_what_is_not_above_the_background_is_no_line(decibels, n_stated):
    known = KnownLines(np.full(40, -15.0), np.full(40, 6.0), np.ones(1))
    (found,) = state_new_lines(of_heights(decibels)[np.newaxis], known, [LINES])
    assert len(found) == n_stated


def test_cross_spectra_are_not_compared():
    signed = spectra(20, 5) * np.random.default_rng(0).choice([-1, 1], (20, len(ORDERS)))
    bins = BinTransformer(max_order=12).fit(table(signed))
    assert np.isinf(bins.line_maxima_).all()
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


def test_a_warning_lists_five_recordings(training, fitted):
    new = with_line(spectra(8, 2), 9.0, 20, training)
    with pytest.warns(UserWarning, match="and 3 more recordings") as caught:
        fitted.transform(table(new))
    (warning,) = caught
    lines = str(warning.message).split("\n")
    assert lines[0].startswith("recording 0: line at order 9 of 'c0', ")
    assert lines[-2] == "and 3 more recordings"
    assert lines[-1].startswith("(8 of ")
    assert len(lines) == 7


def test_one_group_for_each_recording_is_needed(training):
    with pytest.raises(ValueError, match="one label for each of the 60 recordings, got 2"):
        BinTransformer(max_order=12).fit(table(training), groups=["a", "b"])
    with pytest.raises(ValueError, match=r"one-dimensional.*shape \(60, 2\). Pass one column"):
        BinTransformer(max_order=12).fit(table(training), groups=np.zeros((60, 2)))
    with pytest.raises(ValueError, match="that of recording 3 is missing"):
        BinTransformer(max_order=12).fit(table(training), groups=["a"] * 3 + [None] + ["b"] * 56)
    with pytest.raises(
        TypeError, match=r"labels, such as names.*got \['unit', 1\]. Join the parts"
    ):
        BinTransformer(max_order=12).fit(table(training), groups=[["unit", 1]] * 60)


def test_a_model_of_an_earlier_version_states_nothing(training, fitted):
    state = dict(vars(fitted))
    old = BinTransformer()
    vars(old).update({k: v for k, v in state.items() if k != "new_line_limits_"})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        old.transform(table(training * 1e6))


def test_with_metadata_routing_the_groups_of_a_search_reach_the_bins(training):
    groups, y = np.arange(60) % 10, np.arange(60) // 30
    with sklearn.config_context(enable_metadata_routing=True):
        pipe = make_pipeline(BinTransformer(max_order=12), DecisionTreeClassifier())
        search = GridSearchCV(pipe, {}, cv=GroupKFold(2)).fit(table(training), y, groups=groups)
    own = BinTransformer(max_order=12).fit(table(training), groups=groups).new_line_limits_
    np.testing.assert_array_equal(search.best_estimator_[0].new_line_limits_, own)


# Numbers, computed in another way


def heights_of(psd, side=8):
    """Lines over the lower quartile of eight lines on either side, mirrored at the ends [dB]."""
    padded = np.pad(psd, ((0, 0), (side, side)), mode="reflect")
    around = np.sort([padded[:, k : k + psd.shape[1]] for k in range(2 * side + 1)], axis=0)
    return np.maximum(10 * np.log10(psd / around[(2 * side + 1) // 4]), -20)


@pytest.mark.parametrize("n_groups", [5, 7, 8, 30])
def test_the_limits_are_those_of_each_group_beside_all_others(n_groups):
    psd = np.random.default_rng(n_groups).gamma(2, size=(n_groups, 40)) ** 3
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    heights = heights_of(psd)
    common = np.median(heights.var(axis=0, ddof=1))

    def spread(highest):
        n = len(highest) - 1
        return np.maximum(np.sqrt((n * highest.var(axis=0, ddof=1) + 5 * common) / (n + 5)), 0.8)

    others = [np.delete(heights, k, axis=0) for k in range(n_groups)]
    excess = np.array(
        [
            ((own - rest.max(axis=0)) / spread(rest)).max()
            for own, rest in zip(heights, others, strict=True)
        ]
    )
    median = np.median(excess)
    peaks = excess[excess > median] - median
    # Lomax: P(excess > limit) = half (1 + limit / sum)^-n, which is to be 0.02.
    limit = median + peaks.sum() * (25 ** (1 / len(peaks)) - 1)
    known = learn_lines(psd, [block], np.full(40, True))
    np.testing.assert_allclose(known.maxima, heights.max(axis=0), rtol=1e-9)
    np.testing.assert_allclose(known.limits, np.maximum(limit * spread(heights), 4), rtol=1e-9)
    assert known.limits.min() > 4

    rows = np.repeat(psd, 3, axis=0) * np.tile([0.5, 1, 0.2], n_groups)[:, np.newaxis]
    labels = np.repeat([f"unit {9 * k % 31}" for k in range(n_groups)], 3)
    mixed = np.random.default_rng(0).permutation(len(rows))
    found = learn_lines(rows[mixed], [block], np.full(40, True), labels[mixed])
    np.testing.assert_allclose(found.maxima, known.maxima, atol=1e-9)
    np.testing.assert_allclose(found.limits, known.limits, rtol=1e-9)
    assert np.isinf(learn_lines(psd[:4], [block], np.full(40, True)).limits).all()


def test_one_limit_in_spreads_holds_for_all_channels_and_only_within_the_bins():
    psd = np.random.default_rng(3).gamma(2, size=(9, 60)) ** 3
    blocks = [
        OrderBlock(name, np.arange(30) / 4, slice(k, k + 30)) for name, k in (("z", 0), ("a", 30))
    ]
    every = np.full(60, True)
    both, first = learn_lines(psd, blocks, every), learn_lines(psd, blocks[:1], every)
    np.testing.assert_array_equal(both.maxima[:30], first.maxima[:30])
    assert np.isinf(first.limits[30:]).all()
    ratio = both.limits[:30] / first.limits[:30]
    assert np.ptp(ratio) < 1e-9
    some = every & (np.arange(60) % 30 < 20)
    within = learn_lines(psd, blocks, some)
    assert np.isinf(within.maxima[~some]).all()
    assert np.isinf(within.limits[~some]).all()
    np.testing.assert_array_equal(within.maxima[some], both.maxima[some])


def test_the_background_is_half_an_order_and_at_least_eight_lines_on_either_side():
    rng = np.random.default_rng(0)
    for step, side in ((1.0, 8), (1 / 16, 8), (1 / 20, 10), (1 / 64, 32)):
        psd = rng.gamma(3, size=(3, 200))
        block = OrderBlock("z", np.arange(200) * step, slice(0, 200))
        known = learn_lines(psd, [block], np.full(200, True))
        np.testing.assert_allclose(known.maxima, heights_of(psd, side).max(axis=0), atol=1e-9)


def test_lines_below_a_trillionth_of_the_largest_are_rounding_errors():
    psd = np.full((2, 40), 1e-20)
    psd[:, 5], psd[:, 20] = 1.0, 1e-15
    psd[1, 30] = 1e-9
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    maxima = learn_lines(psd, [block], np.full(40, True)).maxima
    assert {k: round(v, 9) for k, v in enumerate(maxima) if v > 0} == {5: 120, 30: 30}


def of_heights(*decibels):
    """A spectrum of 40 lines, the first of which lie so far above the others."""
    psd = np.ones(40)
    psd[np.arange(len(decibels)) * 3] = 10 ** (np.array(decibels) / 10)
    return psd


LINES = OrderBlock("z", np.arange(40) / 6, slice(0, 40))


@pytest.mark.parametrize(
    ("decibels", "texts"),
    [
        ([0, 9], ["line at order 0.5 of 'z', 9 dB above the background and 7 dB above the"]),
        ([9.4, 0, 0, 12], ["line at order 1.5 of 'z', 12 dB", "line at order 0 of 'z', 9"]),
        ([8.1, 0, 7.9], ["line at order 0 of 'z', 8 dB above the background and 6 dB"]),
        ([7.9], []),
    ],
)
def test_lines_above_the_limit_are_stated_the_farthest_first(decibels, texts):
    known = KnownLines(np.full(40, 2.0), np.full(40, 6.0), np.ones(1))
    (found,) = state_new_lines(of_heights(*decibels)[np.newaxis], known, [LINES])
    assert len(found) == len(texts)
    for text, start in zip(found, texts, strict=True):
        assert text.startswith(start)
        assert text.endswith(" dB above the training maximum")


@pytest.mark.parametrize(
    ("n_lines", "start"),
    [(4, "line at order 1.75 "), (5, "orders 1 to 2 of 'z', up to 23 dB above the background")],
)
def test_more_than_four_adjacent_high_orders_are_a_range(n_lines, start):
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    psd = np.ones(40)
    psd[4 : 4 + n_lines] = 100
    psd[7] = 200
    known = KnownLines(np.zeros(40), np.full(40, 6.0), np.ones(1))
    ((text,),) = state_new_lines(psd[np.newaxis], known, [block])
    assert text.startswith(start)


def test_the_peak_of_a_new_line_is_above_the_limit_itself():
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    psd = np.ones(40)
    psd[20:24] = [10, 100, 1e4, 1e3]
    maxima = np.zeros(40)
    maxima[22:24] = 50  # the strong lines beside it are known
    known = KnownLines(maxima, np.full(40, 6.0), np.ones(1))
    ((text,),) = state_new_lines(psd[np.newaxis], known, [block])
    assert text.startswith("line at order 5.25 of 'z', 20 dB above the background and 20 dB above")


def test_the_skirt_of_a_strong_line_is_part_of_the_line():
    block = OrderBlock("z", np.arange(40) / 4, slice(0, 40))
    psd = 1 + 1e6 * np.exp(-2.0 * np.abs(np.arange(40) - 20.0))
    known = KnownLines(np.zeros(40), np.full(40, 6.0), np.ones(1))
    ((text,),) = state_new_lines(psd[np.newaxis], known, [block])
    assert text.startswith("line at order 5 of 'z', 51 dB above the background")


@pytest.mark.parametrize(("n_lines", "last"), [(5, "line"), (6, "and at 1 more orders")])
def test_five_statements_are_made_of_a_recording(n_lines, last):
    known = KnownLines(np.zeros(40), np.full(40, 6.0), np.ones(1))
    (texts,) = state_new_lines(of_heights(*[10] * n_lines)[np.newaxis], known, [LINES])
    assert texts[-1].startswith(last)
    assert len(texts) == n_lines


def test_only_recordings_with_new_lines_are_warned_of():
    same = np.repeat(np.ones((1, len(ORDERS))), 9, axis=0)
    bins = BinTransformer(max_order=12).fit(table(same))
    rows = np.repeat(same[:1], 4, axis=0)
    rows[2, column(9)] *= 10**0.41  # 4.1 dB
    rows[1, column(9)] *= 10**0.39
    with pytest.warns(UserWarning, match="line at order 9 ") as caught:
        bins.transform(table(rows))
    assert str(caught[0].message) == (
        "recording 2: line at order 9 of 'c0', 4 dB above the background and 4 dB above the "
        "training maximum\n"
        "(1 of 4; of recordings like those of the training, about 2 in 100 have such lines)"
    )
    assert caught[0].filename == __file__


def test_fitting_and_transforming_at_once_gives_the_same_bins(training):
    at_once = BinTransformer(max_order=12)
    bins = at_once.fit_transform(table(training), groups=np.arange(60) % 10)
    apart = BinTransformer(max_order=12).fit(table(training), groups=np.arange(60) % 10)
    np.testing.assert_array_equal(np.asarray(bins), np.asarray(apart.transform(table(training))))
    np.testing.assert_array_equal(at_once.new_line_limits_, apart.new_line_limits_)


def test_lines_of_a_table_without_names_are_compared():
    same = np.repeat(spectra(1, 0), 9, axis=0)
    bins = BinTransformer(max_order=12, order_step=0.125).fit(same)
    new = same[:1].copy()
    new[0, column(9)] *= 100
    with pytest.warns(UserWarning, match="recording 0: line at order 9 of 'signal'.* 20 dB above"):
        bins.transform(new)


def test_a_statement_is_collected_once(training, fitted):
    new = with_line(spectra(1, 2), 9.0, 20, training)
    with collected_statements() as found:
        for _ in range(3):
            fitted.transform(table(new))
    assert len(found) == 1


def blocks_of(*orders):
    """Return one channel for each axis of orders, side by side."""
    starts = np.cumsum([0, *map(len, orders)])
    pairs = pairwise(starts)
    return [
        OrderBlock(f"c{k}", axis, slice(int(first), int(last)))
        for k, (axis, (first, last)) in enumerate(zip(orders, pairs, strict=True))
    ]


@pytest.mark.parametrize(
    ("n_orders", "n_beside"), [(11, 10), (2, 10), (2, 8), (1, 8), (121, 10), (9, 8)]
)
def test_the_background_is_half_an_order_on_either_side_or_eight_lines(n_orders, n_beside):
    axis = np.arange(n_orders) * (0.05 if n_beside == 10 else 0.5)
    psd = np.random.default_rng(n_orders).gamma(4.0, size=(6, n_orders))
    known = learn_lines(psd, blocks_of(axis), np.ones(n_orders, bool))
    heights = np.maximum(line_heights(psd, 2 * n_beside + 1, 0.25), -20)
    np.testing.assert_allclose(known.maxima, heights.max(axis=0), rtol=1e-12)


def test_a_line_of_power_0_neither_prevents_limits_nor_statements_but_a_negative_one_does():
    psd = spectra(12, 0)
    psd[:, 0] = 0.0  # order 0 without the mean
    compared = np.ones(len(ORDERS), bool)
    blocks = blocks_of(ORDERS)
    known = learn_lines(psd, blocks, compared)
    assert np.isfinite(known.limits).all()
    (statement,) = state_new_lines(with_line(psd[:1], 9.0, 40, psd), known, blocks)
    assert "9" in statement[0]
    psd[3, 5] = -1e-9
    known = learn_lines(psd, blocks, compared)
    assert np.isinf(known.maxima).all()
    assert np.isinf(known.limits).all()


def test_rounding_errors_of_a_recording_are_no_lines_whatever_the_others():
    psd = spectra(12, 0, n_channels=2)
    blocks = blocks_of(ORDERS, ORDERS)
    known = learn_lines(psd, blocks, np.ones(psd.shape[1], bool))
    first, second = psd[:, : len(ORDERS)], psd[:, len(ORDERS) :]
    assert known.largest.tolist() == [first.max(), second.max()]
    new = np.hstack([with_line(part[:2], 9.0, 40, part) for part in (first, second)])
    new[1, len(ORDERS) :] *= 1e-13 * second.max() / new[1, len(ORDERS) :].max()
    found = state_new_lines(new, known, blocks)
    assert [len(own) for own in found] == [2, 1]


def test_a_channel_that_is_dead_in_training_and_test_has_no_lines():
    psd = np.hstack([spectra(12, 0), np.zeros((12, len(ORDERS)))])
    blocks = blocks_of(ORDERS, ORDERS)
    known = learn_lines(psd, blocks, np.ones(psd.shape[1], bool))
    assert np.isfinite(known.limits[: len(ORDERS)]).all()
    assert np.isinf(known.limits[len(ORDERS) :]).all()
    alive = with_line(psd[:2, : len(ORDERS)], 9.0, 40, psd[:, : len(ORDERS)])
    found = state_new_lines(np.hstack([alive, psd[:2, len(ORDERS) :]]), known, blocks)
    assert [len(own) for own in found] == [1, 1]


@pytest.mark.parametrize(
    ("excess", "limit"),
    [
        ([3.0] * 6, 3.0),  # no excess is above the median
        ([0.5] * 6, 0.5),
        ([-1.0] * 6, 0.0),
        ([-9.0, -9.0, -9.0, -8.99], 0.0),
        # Pickands' tail of one value 2 above the median: 2 (0.04^-1 - 1) = 48
        ([1.0, 1.0, 1.0, 3.0], 49.0),
    ],
)
def test_the_limit_of_the_excess_by_hand(excess, limit):
    assert new_lines._limit(np.array(excess)) == pytest.approx(limit)
