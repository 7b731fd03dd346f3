"""The health index: a distance with known values, limits from left-out groups, trends."""

import numpy as np
import pandas as pd
import pytest
from order_models import log, order_bins
from scipy.signal import lfilter
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import parametrize_with_checks

from emacm import Recording, load_model, save_model
from emacm.alarms.stationarity import instability
from emacm.displays import TrendDisplay
from emacm.monitoring import CUSUM, HealthIndex, health_trend

UNITS = np.repeat(["press", "drill", "axis"], [12, 3, 9])
OFFSETS = {"press": 4.0, "drill": -3.0, "axis": 0.0, "new": 2.0}


def healthy(rng, units=UNITS, width=4):
    """Return features that differ between units more than within one."""
    offsets = np.array([OFFSETS[unit] for unit in units])
    return rng.normal(size=(len(units), width)) + offsets[:, np.newaxis] * [1, 0, 0, 0][:width]


def fleet(n_units, n_each, rng, spread=2.0):
    """Return features of many units, and their numbers."""
    units = np.repeat(np.arange(n_units), n_each)
    offsets = spread * rng.normal(size=(n_units, 3))[units]
    return offsets + rng.normal(size=(len(units), 3)), units


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:without groups", "ignore:.* those of fit", "ignore:the base")
@parametrize_with_checks([HealthIndex()])
def test_scikit_learns_checks_pass(estimator, check):
    check(estimator)


def test_the_index_is_the_mahalanobis_distance_in_usual_healthy_distances():
    X = np.random.default_rng(0).normal(size=(4000, 3)) * [1, 20, 0.1] + [5, 0, 1]
    index = HealthIndex().fit(X, groups=np.arange(4000) // 100)
    found = index.transform([[5, 0, 1], [5, 60, 1], [5, 0, 0.7], [8, 60, 1.3]])[:, 0]
    np.testing.assert_allclose(found, [0, np.sqrt(3), np.sqrt(3), 3], rtol=0.05, atol=0.05)
    new = X + 1e-9  # not the rows of fit themselves
    squares = index.transform(new)[:, 0] ** 2
    assert squares.mean() == pytest.approx(1, abs=0.01)


def trend(index, X, times, units=None):
    """Return the trend of rows of features."""
    model = make_pipeline(FunctionTransformer(), index)
    return health_trend(model, list(X), unit=units, time=times)


def test_the_unit_of_a_feature_changes_nothing():
    rng = np.random.default_rng(1)
    X, new, scale = healthy(rng), rng.normal(size=(5, 4)), [1e-6, 3, 1e5, 0.2]
    groups = np.arange(24) // 2
    index = HealthIndex().fit(X, groups=groups).transform(new)
    other = HealthIndex().fit(X * scale, groups=groups).transform(new * scale)
    np.testing.assert_allclose(index, other, rtol=1e-9)


def test_a_unit_with_enough_healthy_recordings_is_compared_with_itself():
    X = healthy(np.random.default_rng(2))
    index = HealthIndex().fit(X, groups=np.arange(24), units=UNITS)
    assert index.units_ == ("press", "axis")
    usual, shifted = [4.0, 0, 0, 0], [0.0, 0, 0, 0]  # of the press; healthy for the axis
    found = index.transform([usual, shifted, shifted], units=["press", "press", "axis"])[:, 0]
    assert found[0] < 0.5
    assert found[1] > 1.5
    assert found[2] < 0.5
    unknown = index.transform([shifted, shifted], units=["drill", "elsewhere"])[:, 0]
    np.testing.assert_array_equal(unknown, index.transform([shifted, shifted])[:, 0])
    assert unknown[0] < 0.5  # units usually differ as much


def test_a_short_baseline_counts_as_uncertain():
    X, units = fleet(10, 5, np.random.default_rng(3))
    index = HealthIndex().fit(X, groups=np.arange(50), units=units)
    new = np.array([index._baselines.means[7][0] + [3.0, 0, 0]])
    white = (new - index._baselines.means[7][0]) @ index._baselines.within
    plain = np.sqrt((white**2).sum() / 3)
    assert index.transform(new, units=[7])[0, 0] == pytest.approx(plain / np.sqrt(1 + 1 / 5))


@pytest.mark.slow
def test_the_false_alarm_rate_holds_for_new_recordings():
    rng, own, other, n_fleets = np.random.default_rng(4), [], [], 20
    for _ in range(n_fleets):
        X, units = fleet(20, 6, rng)
        index = HealthIndex(0.1).fit(X[units < 19], groups=np.arange(114), units=units[units < 19])
        # Further recordings of a known unit, and a unit that was not in the training.
        new = X[units == 7].mean(axis=0) + rng.normal(size=(40, 3))
        own.append(np.mean(index.transform(new, units=[7] * 40)[:, 0] > index.limit(7)))
        other.append(np.mean(index.transform(X[units == 19])[:, 0] > index.limit()))
    for alarms in (np.mean(own), np.mean(other)):
        assert alarms < 0.1 + 3 * np.sqrt(0.1 * 0.9 / n_fleets)
        assert alarms > 0.01  # the limit is not far too high either


def test_limits_from_single_recordings_are_too_low_where_runs_differ():
    rng = np.random.default_rng(5)
    X, runs = fleet(25, 6, rng, spread=3.0)
    grouped = HealthIndex(0.1).fit(X, groups=runs)
    with (
        pytest.warns(UserWarning, match="without groups, single recordings are left out"),
        pytest.warns(UserWarning, match="150 groups, successive groups are alike"),
    ):
        single = HealthIndex(0.1).fit(X)
    assert grouped.limit() > 1.02 * single.limit()


@pytest.mark.parametrize(("n_groups", "supported"), [(19, True), (18, False)])
def test_a_limit_that_the_groups_cannot_support_is_refused(n_groups, supported):
    X = np.random.default_rng(6).normal(size=(2 * n_groups, 3))
    index = HealthIndex(0.05).fit(X, groups=np.arange(2 * n_groups) // 2)
    if supported:
        assert index.limit() == index.left_out_["index"].max()
        return
    with pytest.raises(ValueError, match=r"18 units or groups cannot .* at least 19"):
        index.limit()
    with pytest.raises(ValueError, match=r"0\.05 \(1 - coverage; raise it, .*\): 18 units"):
        trend(index, X[:2], [1, 2])
    assert index.set_params(false_alarm=0.053).limit() > 0


def test_a_limit_from_few_groups_is_a_prediction_limit_of_their_largest_readings():
    exceeded = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        X = rng.normal(size=(106, 4)) + np.repeat(rng.normal(size=(53, 4)), 2, axis=0)
        groups = np.arange(12) // 2
        index = HealthIndex(0.2, few_groups="log-normal").fit(X[:6], groups=groups[:6])
        exceeded.append(index.transform(X[12:])[:, 0] > index.limit())
    largest = np.log(index.left_out_.groupby("group")["index"].max())
    t_of_2_degrees = 1.0607  # 0.8 quantile, from tables
    expected = largest.mean() + t_of_2_degrees * largest.std() * np.sqrt(4 / 3)
    assert np.log(index.limit()) == pytest.approx(expected, rel=1e-4)
    assert 0.01 < np.mean(exceeded) < 0.2
    with pytest.raises(ValueError, match="at least 4"):
        HealthIndex(0.2).fit(X[:6], groups=groups[:6]).limit()


def test_few_units_refuse_a_limit_for_the_population_but_not_for_a_known_unit():
    X = healthy(np.random.default_rng(7), np.repeat(["press", "axis"], 12))
    units = np.repeat(["press", "axis"], 12)
    index = HealthIndex(0.1).fit(X, groups=np.tile(np.arange(12), 2), units=units)
    assert index.limit("press") == index.limit("axis") > 1
    with pytest.raises(ValueError, match=r"2 units or groups cannot .* at least 9"):
        index.limit("drill")


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("run-in", r"20 groups, the features drift \(Mann-Kendall"),
        ("wandering", r"20 groups, successive groups are alike \(correlation 0\.[5-9]"),
    ],
)
def test_a_baseline_that_runs_in_or_wanders_is_stated(kind, reason):
    rng = np.random.default_rng(11)
    X = rng.normal(size=(20, 6))
    if kind == "run-in":
        X += 6 * np.exp(-np.arange(20) / 8)[:, np.newaxis]
    else:
        X = lfilter([0.6], [1, -0.8], rng.normal(size=(120, 6)), axis=0)[100:]
    with pytest.warns(UserWarning, match=reason):
        HealthIndex().fit(X, groups=range(20))


@pytest.mark.slow
def test_rows_of_fit_are_no_baseline_of_a_chart():
    rng, alarmed = np.random.default_rng(12), []
    for _ in range(20):
        healthy, new = rng.normal(size=(20, 12)), rng.normal(size=(100, 12))
        index = HealthIndex().fit(healthy, groups=range(20))
        with pytest.warns(UserWarning, match=r"20 of 21 rows are those of fit.*left_out_"):
            known = index.transform(np.vstack([healthy, new[:1]]))[:20]
        left = index.left_out_[["index"]].to_numpy()
        charts = [CUSUM(0.5, 5.0).fit(x) for x in (known, left)]
        alarmed.append([c.update(np.asarray(index.transform(new))).alarm.any() for c in charts])
    assert np.mean(alarmed, axis=0)[0] > 0.8
    assert np.mean(alarmed, axis=0)[1] < 0.5


@pytest.mark.slow
def test_few_exchangeable_baselines_are_called_unstable():
    rng, parts = np.random.default_rng(13), np.repeat([0, 1], 15)
    found = [instability(x, parts) for x in rng.normal(size=(100, 30, 5))]
    assert np.mean([bool(text) for text in found]) < 0.02


def test_constant_features_are_not_used():
    X = healthy(np.random.default_rng(8))
    wide = np.hstack([X, np.full((24, 2), 7.0)])
    groups = np.arange(24) // 3
    index = HealthIndex().fit(wide, groups=groups)
    new = np.array([[1.0, 2, 3, 4, 7, -1e9]])
    expected = HealthIndex().fit(X, groups=groups).transform(new[:, :4])
    np.testing.assert_allclose(index.transform(new), expected)


def test_a_trend_is_sorted_by_unit_and_time_and_states_alarms():
    rng = np.random.default_rng(9)
    X = healthy(rng, np.repeat(["press", "axis"], 12))
    units = np.repeat(["press", "axis"], 12)
    index = HealthIndex(0.1).fit(X, groups=np.tile(np.arange(12), 2), units=units)
    wear = np.array([0.0, 0.0, 9.0, 6.0])[:, np.newaxis] * [0, 1, 0, 0]
    new = healthy(rng, ["press", "axis", "press", "press"]) + wear
    times = ["2024-05-03", "2024-05-01", "2024-05-09", "2024-05-07"]
    table = trend(index, new, times, ["press", "axis", "press", "press"])
    assert table["unit"].tolist() == ["axis", "press", "press", "press"]
    assert table["time"].tolist() == ["2024-05-01", "2024-05-03", "2024-05-07", "2024-05-09"]
    assert table["alarm"].tolist() == [False, False, True, True]
    assert table["index"].is_monotonic_increasing or table["index"].iloc[-1] > 3
    assert set(table["false_alarm"]) == {0.1}
    assert set(table["baseline"]) == {"unit"}


@pytest.mark.parametrize(
    ("false_alarm", "options", "message"),
    [
        (0.1, {"units": ["a"]}, "units must hold one label for each of 24"),
        (0.1, {"groups": ["a"]}, "groups must hold one label for each of 24"),
        (0.1, {"groups": [np.nan] * 24}, "groups is nan"),
        (0, {}, "false_alarm"),
        (1, {}, "false_alarm"),
        ("low", {}, "false_alarm"),
    ],
)
def test_invalid_labels_and_rates_are_refused(false_alarm, options, message):
    X, options = healthy(np.random.default_rng(0)), {"groups": range(24)} | options
    with pytest.raises((ValueError, TypeError), match=message):
        HealthIndex(false_alarm).fit(X, **options)


def test_features_without_variation_are_refused():
    with pytest.raises(ValueError, match="no variation in its features"):
        HealthIndex(0.2).fit(np.ones((24, 4)), groups=range(24))
    copies = np.repeat(healthy(np.random.default_rng(0))[:4], 6, axis=0)
    with pytest.raises(ValueError, match="within units: are recordings copies"):
        HealthIndex(0.2).fit(copies, groups=range(24), units=np.repeat(range(4), 6))


@pytest.mark.parametrize(
    "times", [[1, "a", 3], [pd.Timestamp("2024", tz="UTC"), pd.Timestamp("2025"), pd.Timestamp(0)]]
)
def test_times_without_an_order_are_refused(times):
    X = healthy(np.random.default_rng(0))
    index = HealthIndex(0.2).fit(X, groups=range(24))
    with pytest.raises(TypeError, match="times must hold labels of one kind, got"):
        trend(index, X[:3], times)


# From recordings


def recording(seed, unit, day, wear=0.0, n=3000):
    rng = np.random.default_rng(seed)
    angle = 80.0 * np.arange(n) / 900
    wave = rng.normal(size=n) + wear * np.sin(2.3 * angle)
    return Recording({"vib": wave}, 900, velocity=80.0, meta={"unit": unit, "day": day})


def pipeline():
    return order_bins(log(), HealthIndex(0.1), samples=18, max_order=6)


@pytest.fixture(scope="module")
def model():
    runs = [recording(k, "A", k) for k in range(10)]
    return pipeline().fit(runs, healthindex__groups=np.arange(10), healthindex__units=["A"] * 10)


def test_recordings_of_every_night_give_a_trend_and_a_bad_one_a_row(model):
    new = [recording(20 + k, "A", 30 - k, wear) for k, wear in enumerate([2.0, 1.0, 0.0, 0.0])]
    new.insert(1, recording(40, "A", 35, n=30))
    new.insert(0, None)
    with pytest.raises(TypeError, match="without meta"):
        health_trend(model, new, unit="unit", time="day")
    table = health_trend(model, new[1:], unit="unit", time="day")
    assert table["time"].tolist() == [27, 28, 29, 30, 35]
    assert table["recording"].tolist() == [4, 3, 2, 0, 1]
    assert table["alarm"].tolist() == [False, False, True, True, False]
    assert "no stroke holds" in table["error"].iloc[-1]
    assert np.isnan(table["index"].iloc[-1])
    expected = model[-1].transform(model[:-1].transform(new[1:2]), units=["A"])[0, 0]
    assert table["index"].iloc[3] == expected


def test_only_bad_recordings_give_rows_too(model):
    table = health_trend(model, [recording(1, "A", 3, n=30)], time="day")
    assert table["error"].iloc[0]
    assert not table["alarm"].any()


def test_another_model_is_refused(model):
    with pytest.raises(TypeError, match="Pipeline that ends in a HealthIndex, got HealthIndex"):
        health_trend(model[-1], [recording(0, "A", 1)], time="day")


def test_a_model_of_a_health_index_can_be_saved(model, tmp_path):
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    save_model(model, tmp_path / "index.emacm")
    loaded, new = load_model(tmp_path / "index.emacm"), [recording(9, "A", 3, 0.7)]
    expected = health_trend(model, new, unit="unit", time="day")
    pd.testing.assert_frame_equal(health_trend(loaded, new, unit="unit", time="day"), expected)


# The picture


def test_the_picture_has_a_panel_for_each_unit_and_states_the_false_alarm_rate():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    X = healthy(np.random.default_rng(9), np.repeat(["press", "axis"], 12))
    units = np.repeat(["press", "axis"], 12)
    index = HealthIndex(0.1).fit(X, groups=np.tile(np.arange(12), 2), units=units)
    times = pd.date_range("2024-05-01", periods=24)
    display = TrendDisplay(trend(index, X, times, units)).plot()
    assert [ax.get_ylabel() for ax in display.ax_] == ["axis", "press"]
    display.figure_.canvas.draw()
    assert display.ax_[-1].xaxis.get_offset_text().get_text() == "2024-May"
    labels = [text.get_text() for text in display.ax_[0].get_legend().get_texts()]
    assert "limit (10 % false alarms)" in labels
    limits = [line for line in display.ax_[1].lines if line.get_linestyle() == "--"]
    assert limits[0].get_ydata()[0] == index.limit("press")
    assert len(display.frame()) == 24
    press = display.table[display.table["unit"] == "press"]
    (single,) = np.ravel(TrendDisplay(press).plot().ax_)
    assert single.get_ylabel() == "health index"


def test_a_limit_needs_more_than_one_group():
    X = np.random.default_rng(0).normal(size=(30, 3))
    index = HealthIndex().fit(X, groups=["run 1"] * 30)
    with pytest.raises(ValueError, match="no healthy group can be left out"):
        index.limit()
    index.fit(X, groups=np.arange(30), units=["press"] * 30)
    assert index.limit("press") > 0
    with pytest.raises(ValueError, match="a unit without any needs those of two others"):
        index.limit("lathe")
