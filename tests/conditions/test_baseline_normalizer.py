"""Facts about baselines: what is left of a recording beside healthy ones of its condition."""

import pickle

import joblib
import numpy as np
import pandas as pd
import polars as pl
import pytest
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

import emacm.resampling.angle_recording
from emacm import (
    BaselineNormalizer,
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
)
from emacm.conditions.feature_baselines import (
    linear_baseline_of_features,
    mean_baseline_of_features,
)
from emacm.conditions.mean_signals import (
    AngleBaseline,
    NormalizedRecording,
    Stretch,
    mean_stretches,
)
from emacm.orders.columns import OrderTable
from emacm.orders.recalled_spectra import spectrum_key
from emacm.resampling.angle_recording import AngleRecording

TURN = 2 * np.pi
THETA_S = TURN / 32
FS = 500
LINE = 3.5  # order of the fault


def motion(offset=0.0, cycles=1, seconds=4.0):
    """To and fro between `offset` and 15 turns on, `cycles` times."""
    times = np.arange(int(FS * seconds * cycles)) / FS
    return offset + TURN * 7.5 * (1 - np.cos(TURN * times / seconds))


def profile(angle, way, load):
    """What a healthy actuator shows: it depends on angle, direction and load."""
    shape = np.sin(2 * angle) + 0.02 * angle
    return shape * (1 + load / 40) + np.where(way > 0, 0.8, -0.3) * np.cos(3 * angle)


def run(load=20, fault=0.0, *, offset=0.0, noise=0.0, seed=0, cycles=1, names=("current",), **meta):
    rng = np.random.default_rng(seed)
    angle = motion(offset, cycles)
    way = np.gradient(angle)
    signal = profile(angle, way, load) + fault * np.sin(LINE * angle)
    signal = signal + noise * rng.standard_normal(len(angle))
    signals = {name: signal * (1 + k) for k, name in enumerate(names)}
    return Recording(signals, FS, angle=angle, meta={"load": load, **meta})


def over_angle(runs, **options):
    return OrderResampler(**{"theta_s": THETA_S, "min_speed": 2.0} | options).fit_transform(runs)


OFFSETS = (0.0, 0.013, -0.08, 0.11)


@pytest.fixture(scope="module")
def fleet():
    """Healthy and worn recordings under two loads, which start at nearly the same angle."""
    cases = [
        (load, fault, offset, seed)
        for seed, offset in enumerate(OFFSETS)
        for load in (20, 40)
        for fault in (0.0, 0.3)
    ]
    runs = [
        run(load, fault, offset=offset, noise=0.02, seed=10 * seed + i)
        for i, (load, fault, offset, seed) in enumerate(cases)
    ]
    return runs, np.array(["worn" if fault else "normal" for _, fault, _, _ in cases])


def inside(stroke, margin=16):
    """The signals of a stroke without its ends, where resampling sees no neighbours."""
    return stroke.signals[:, margin:-margin]


# Signals


@pytest.mark.parametrize("antialias", [True, False])
def test_nothing_is_left_of_a_healthy_recording_without_noise(antialias):
    X = over_angle([run(offset=offset) for offset in OFFSETS], antialias=antialias)
    new = over_angle([run(offset=0.05)], antialias=antialias)
    model = BaselineNormalizer(healthy=lambda recording: True).fit(X)
    for stroke in model.transform(new)[0].strokes:
        assert np.abs(inside(stroke)).max() < 1e-3 < 0.5 < np.abs(inside(new[0].strokes[0])).max()


def test_a_fault_is_left_whole():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    new = over_angle([run(fault=0.3, offset=0.05)])
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit(X).transform(new)
    for stroke in left.strokes:
        fault = 0.3 * np.sin(LINE * stroke.angles)[np.newaxis, 16:-16]
        np.testing.assert_allclose(inside(stroke), fault, atol=2e-3)


def test_samples_lie_at_whole_multiples_of_the_angle_between_them():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    for recording in BaselineNormalizer(healthy=lambda recording: True).fit(X).transform(X):
        for stroke in recording.strokes:
            places = stroke.angles / THETA_S
            np.testing.assert_allclose(places, np.rint(places), atol=1e-6)
            assert np.all(np.diff(places) * stroke.direction > 0)
            assert stroke.n_angles == stroke.signals.shape[1] == len(stroke.angles)


def test_a_stroke_gets_no_sample_before_its_start_or_after_its_end():
    (plain,) = over_angle([run(offset=0.05)])
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit_transform([plain])
    for before, after in zip(plain.strokes, left.strokes, strict=True):
        limits = sorted((before.angles[0], before.angles[-1] + before.direction * THETA_S))
        assert limits[0] - 1e-9 <= after.angles.min()
        assert after.angles.max() <= limits[1] + 1e-9
        assert before.n_angles - after.n_angles in (-1, 0, 1)


def test_each_direction_has_a_baseline_of_its_own():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    baseline = BaselineNormalizer(healthy=lambda recording: True).fit(X).baselines_[20]
    (forward,), (reverse,) = baseline.stretches[1], baseline.stretches[-1]
    angle = THETA_S * np.arange(forward.first, forward.stop)
    expected = profile(angle, 1, 20)[np.newaxis]
    np.testing.assert_allclose(forward.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)
    angle = -THETA_S * np.arange(reverse.first, reverse.stop)
    expected = profile(angle, -1, 20)[np.newaxis]
    np.testing.assert_allclose(reverse.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)


def test_each_load_has_a_baseline_of_its_own(fleet):
    runs, y = fleet
    left = BaselineNormalizer().fit_transform(over_angle(runs), y)
    sizes = np.array([np.mean(inside(recording.strokes[0]) ** 2) for recording in left])
    assert sizes[y == "normal"].max() < 0.01 < 0.03 < sizes[y == "worn"].min()


def test_the_mean_of_one_direction_shifts_with_the_mean_of_its_signals():
    X = over_angle([run(offset=offset, noise=0.1, seed=i) for i, offset in enumerate(OFFSETS)])
    left = BaselineNormalizer(healthy=lambda recording: True).fit_transform(X)
    low = max(recording.strokes[0].angles[0] for recording in left)
    high = min(recording.strokes[0].angles[-1] for recording in left)
    total = 0
    for recording in left:
        stroke = recording.strokes[0]
        common = (stroke.angles > low - 1e-6) & (stroke.angles < high + 1e-6)
        total = total + stroke.signals[:, common]
    np.testing.assert_allclose(total, 0, atol=1e-12)


def test_a_recording_may_go_to_and_fro_many_times():
    X = over_angle([run(cycles=3, offset=offset) for offset in OFFSETS])
    new = over_angle([run(cycles=5, fault=0.3, offset=0.04)])
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit(X).transform(new)
    assert [stroke.direction for stroke in left.strokes] == [1, -1] * 5
    for stroke in left.strokes:
        fault = 0.3 * np.sin(LINE * stroke.angles)[np.newaxis, 16:-16]
        np.testing.assert_allclose(inside(stroke), fault, atol=2e-3)


def test_strokes_are_cut_to_where_healthy_ones_have_been():
    half = motion()[: FS * 2]
    short = Recording({"current": profile(half, 1, 20)}, FS, angle=half, meta={"load": 20})
    far = motion() * 2
    long = Recording({"current": np.sin(far)}, FS, angle=far, meta={"load": 20})
    X, new = over_angle([short]), over_angle([long])
    model = BaselineNormalizer(healthy=lambda recording: True).fit(X)
    (left,) = model.transform(new)
    assert [stroke.direction for stroke in left.strokes] == [1]  # there was no reverse stroke
    low, high = model.baselines_[20].reach(1)[0]
    assert left.strokes[0].angles[0] >= low - 1e-9
    assert left.strokes[0].angles[-1] <= high + 1e-9
    covered = model.coverage(new)
    assert covered["share"][0] == pytest.approx(0.25, abs=0.01)
    assert covered["revolutions"][0] == pytest.approx(60, abs=0.1)
    assert model.coverage(X)["share"][0] == pytest.approx(1, abs=0.01)


def test_a_recording_where_no_healthy_one_has_been_says_so():
    X = over_angle([run()])
    (left,) = (
        BaselineNormalizer(healthy=lambda recording: True)
        .fit(X)
        .transform(over_angle([run(offset=500.0)]))
    )
    with pytest.raises(ValueError, match=r"no stroke of it \(forward from 500.* of load=20 have"):
        left.strokes  # noqa: B018
    with pytest.raises(ValueError, match=r"recording 0 \(load=20\): no stroke of it"):
        OrderPSD(4).fit_transform([left])


def test_without_a_zero_of_the_angle_strokes_are_aligned_by_their_start():
    def made(turned):
        angle = motion()
        signal = np.sin(2 * angle) + 0.3 * np.cos(5 * angle)
        return Recording({"current": signal}, FS, angle=angle + turned, meta={"load": 20})

    X, new = over_angle([made(0.0), made(1000.3)]), over_angle([made(-77.7)])
    model = BaselineNormalizer(healthy=lambda recording: True, align="start").fit(X)
    for stroke in model.transform(new)[0].strokes:
        assert np.abs(inside(stroke)).max() < 1e-6


def test_one_path_of_both_directions_has_a_baseline_by_its_start():
    X = over_angle([run(), run()], direction="travel")
    model = BaselineNormalizer(healthy=lambda recording: True, align="start").fit(X)
    (stroke,) = model.transform(X)[0].strokes
    assert stroke.direction == 0
    np.testing.assert_allclose(stroke.signals, 0, atol=1e-12)


def test_channels_of_two_rates_are_each_taken_off():
    def made(fault):
        angle = motion()
        fast = np.sin(2 * angle) + fault * np.sin(LINE * angle)
        return Recording(
            {"current": fast, "position": np.cos(angle[::2])},
            {"current": FS, "position": FS / 2},
            angle=angle,
            shaft_fs=FS,
            meta={"load": 20},
        )

    X, new = over_angle([made(0.0)]), over_angle([made(0.3)])
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit(X).transform(new)
    assert left.rate_groups == [[0], [1]]
    current, position = inside(left.strokes[0])
    assert np.abs(position).max() < 1e-12
    assert np.abs(current).max() == pytest.approx(0.3, abs=0.01)


def test_single_precision_stays_and_blocks_continue_one_another():
    angle = motion(cycles=40)
    signal = profile(angle, np.gradient(angle), 20).astype(np.float32)
    one = Recording({"current": signal}, FS, angle=angle, meta={"load": 20})
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit_transform(over_angle([one]))
    stroke = left.strokes[3]
    assert stroke.signals.dtype == np.float32
    np.testing.assert_array_equal(np.concatenate([*stroke.blocks([0])], axis=1), stroke.signals)


def test_nothing_is_resampled_before_it_is_read(fleet, monkeypatch):
    X, y = fleet
    rows = over_angle(X)
    model = BaselineNormalizer().fit(rows, y)
    calls = []
    original = emacm.resampling.angle_recording.angle_blocks
    monkeypatch.setattr(
        emacm.resampling.angle_recording,
        "angle_blocks",
        lambda *args, **options: calls.append(1) or original(*args, **options),
    )
    left = model.transform(rows)
    assert all(isinstance(entry, AngleRecording) for entry in left)
    assert not calls
    assert left[0].strokes[0].signals.shape[0] == 1
    assert len(calls) == 1


def test_a_frame_of_what_is_left_has_its_angles():
    (left,) = BaselineNormalizer(healthy=lambda recording: True).fit_transform(over_angle([run()]))
    frame = left.frame()
    assert frame.columns.tolist() == ["current"]
    assert frame.loc[0].index.tolist() == left.strokes[0].angles.tolist()
    assert left.meta["load"] == 20


# Spectra, pipelines


def chain(**options):
    return make_pipeline(
        OrderResampler(THETA_S, min_speed=2.0),
        BaselineNormalizer(),
        OrderPSD(4, by_direction=True, **options),
        BinTransformer(1, max_order=8),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage="oas"),
    )


def test_only_the_fault_is_left_in_the_spectrum(fleet):
    X, y = fleet
    rows = over_angle(X)
    left = BaselineNormalizer().fit_transform(rows, y)
    psd = OrderPSD(4)
    before, after = psd.fit_transform(rows), psd.fit_transform(left)
    worn = y == "worn"
    assert np.all(psd.orders_[before[worn].argmax(axis=1)] != LINE)
    assert np.all(psd.orders_[after[worn].argmax(axis=1)] == LINE)


def test_the_pipeline_cross_validates_and_searches(fleet):
    X, y = fleet
    scores = cross_validate(chain(), X, y, cv=2)["test_score"]
    assert scores.tolist() == [1, 1]
    name = "baselinenormalizer__align"
    search = GridSearchCV(chain(), {name: ["angle", "start"]}, cv=2).fit(X, y)
    assert search.cv_results_["mean_test_score"][0] == 1


def test_the_whole_pipeline_gives_frames(fleet):
    X, y = fleet
    frame = chain()[:-1].set_output(transform="pandas").fit_transform(X, y)
    assert frame.columns[0] == "current+@0-1"


def test_kept_spectra_are_told_apart_by_their_baseline(fleet, tmp_path):
    X, y = fleet
    rows = over_angle(X)
    psd = OrderPSD(4, memory=tmp_path).fit(rows)
    fresh = OrderPSD(4).fit(rows)
    halves = [BaselineNormalizer().fit(rows[part], y[part]) for part in (slice(8), slice(8, 16))]
    for left in [rows, *(model.transform(rows) for model in halves)]:
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
    keys = {spectrum_key(model.transform(rows)[0], "") for model in halves}
    assert len(keys | {spectrum_key(rows[0], "")}) == 3


def test_the_same_baseline_finds_the_same_spectra(fleet):
    X, y = fleet
    one, two = (BaselineNormalizer().fit(over_angle(X), y) for _ in range(2))
    keys = [spectrum_key(model.transform(over_angle(X))[0], "") for model in (one, two)]
    assert keys[0] == keys[1]
    assert one.baselines_[20] == two.baselines_[20] != one.baselines_[40]
    assert hash(one.baselines_[20]) == hash(two.baselines_[20])


def test_files_and_hashes_know_the_baseline(fleet, tmp_path):
    X, y = fleet
    rows = over_angle(X)
    model = BaselineNormalizer().fit(rows, y)
    (left,) = model.transform(rows[:1])
    copy = pickle.loads(pickle.dumps(left))
    assert copy == left
    np.testing.assert_array_equal(copy.strokes[0].signals, left.strokes[0].signals)
    other = BaselineNormalizer().fit(rows[:8], y[:8]).transform(rows[:1])[0]
    assert joblib.hash(other) != joblib.hash(left) == joblib.hash(copy)
    joblib.dump(model, tmp_path / "model.joblib")
    again = joblib.load(tmp_path / "model.joblib").transform(rows[:1])[0]
    np.testing.assert_array_equal(again.strokes[0].signals, left.strokes[0].signals)


def test_processes_change_nothing(fleet):
    X, y = fleet
    left = BaselineNormalizer().fit_transform(over_angle(X), y)
    with joblib.parallel_backend("loky"):
        many = OrderPSD(4, n_jobs=2).fit_transform(left)
    np.testing.assert_array_equal(many, OrderPSD(4).fit_transform(left))


def test_cloning_forgets_baselines(fleet):
    model = BaselineNormalizer(align="start").fit(over_angle(fleet[0]), fleet[1])
    assert not hasattr(clone(model), "baselines_")
    assert clone(model).align == "start"
    assert model.get_feature_names_out().tolist() == ["current"]


def test_recordings_of_commissioning_serve_a_load_that_training_has_not(fleet):
    X, y = fleet
    at_20 = [i for i, recording in enumerate(X) if recording.meta["load"] == 20]
    new = over_angle([run(60, offset=0.05), run(60, fault=0.3, offset=0.05)])
    reference = [run(60, offset=offset) for offset in OFFSETS]
    model = BaselineNormalizer(reference=reference)
    model.fit(over_angle([X[i] for i in at_20]), y[at_20])
    assert model.conditions_ == (20, 60)
    healthy, worn = model.transform(new)
    assert np.abs(inside(healthy.strokes[0])).max() < 2e-3
    assert np.abs(inside(worn.strokes[0])).max() > 0.25
    assert clone(model).reference is not None


# Who is healthy, under which condition


def test_healthy_may_be_told_by_labels_meta_or_a_function():
    runs = [run(fault=0.1 * i, hours=100 * i, unit="AB"[i % 2]) for i in range(4)]
    X, y = over_angle(runs), ["new", "run in", "worn", "worn"]
    for healthy in (
        ["new", "run in"],
        {"hours": [0, 100]},
        {"hours": {0, 100}, "unit": ["A", "B"]},
        lambda recording: recording.meta["hours"] < 150,
    ):
        model = BaselineNormalizer(healthy=healthy).fit(X, y)
        by_hand = BaselineNormalizer(healthy=lambda recording: True).fit(X[:2])
        assert model.baselines_[20] == by_hand.baselines_[20]


def test_conditions_may_have_several_keys():
    runs = [run(load, unit=unit) for load in (20, 40) for unit in "AB"]
    model = BaselineNormalizer(condition=("load", "unit"), healthy="ok")
    model.fit(over_angle(runs), ["ok"] * 4)
    assert model.conditions_ == ((20, "A"), (20, "B"), (40, "A"), (40, "B"))
    with pytest.raises(ValueError, match=r"recording 0 .* has load=20, unit='C', but healthy"):
        model.transform(over_angle([run(20, unit="C")]))


# Features


class Levels(BaseEstimator):
    """Mean square and mean size, as a DataFrame or an array."""

    def __init__(self, frame=True):
        self.frame = frame

    def fit(self, X, y=None):
        self.fitted_ = True
        return self

    def fit_transform(self, X, y=None):
        return self.fit(X).transform(X)

    def transform(self, X):
        signals = [recording.signals["current"] for recording in X]
        table = np.array([[np.mean(s**2), np.mean(np.abs(s))] for s in signals])
        return pd.DataFrame(table, columns=["power", "size"]) if self.frame else table

    def get_feature_names_out(self, input_features=None):
        return np.array(["power", "size"], dtype=object)


def constant(load, extra=0.0, seed=None):
    """A recording whose level is a straight line over the load."""
    noise = 0.0 if seed is None else 0.01 * np.random.default_rng(seed).standard_normal()
    level = 2 + load / 20 + extra + noise
    return Recording({"current": [level] * 3}, 1, velocity=[1.0] * 3, meta={"load": load})


def test_features_of_healthy_recordings_are_zero_on_average():
    runs = [constant(load, seed=i) for i, load in enumerate([20, 40] * 5)]
    table = BaselineNormalizer(Levels(frame=False)).fit_transform(runs, ["normal"] * 10)
    np.testing.assert_allclose([table[::2].mean(axis=0), table[1::2].mean(axis=0)], 0, atol=1e-12)


def test_scaled_features_of_healthy_recordings_have_unit_variance():
    runs = [constant(load, seed=i) for i, load in enumerate([20, 40] * 5)]
    table = BaselineNormalizer(Levels(), scale=True).fit_transform(runs, ["normal"] * 10)
    by_load = [table[::2].std(ddof=1), table[1::2].std(ddof=1)]
    np.testing.assert_allclose(by_load, 1)


def test_one_condition_and_scale_are_a_standard_scaler_fitted_on_the_healthy():
    runs = [constant(20, extra=0.1 * i) for i in range(6)]
    y = ["normal"] * 4 + ["worn"] * 2
    table = BaselineNormalizer(Levels(frame=False), scale=True).fit_transform(runs, y)
    features = Levels(frame=False).fit_transform(runs)
    scaler = StandardScaler().fit(features[:4])
    np.testing.assert_allclose(table, scaler.transform(features) * np.sqrt(3 / 4))


def test_a_line_over_the_load_serves_loads_never_seen():
    runs = [constant(load) for load in (20, 40, 60)]
    size = FunctionTransformer(lambda X: [[x.signals["current"].mean()] for x in X])
    model = BaselineNormalizer(size, regression=True).fit(runs, ["normal"] * 3)
    left = model.transform([constant(30), constant(100, extra=0.5), constant(-500)])
    np.testing.assert_allclose(left[:, 0], [0, 0.5, 0], atol=1e-9)


def test_a_line_over_two_conditions_is_found_whatever_their_units():
    rng = np.random.default_rng(0)
    conditions = rng.uniform(1, 2, (20, 2)) * [1e6, 1e-6]
    table = np.column_stack([3 + conditions @ [2e-6, 5e6], conditions @ [1e-6, -1e6]])
    baseline = linear_baseline_of_features(table, conditions)
    np.testing.assert_allclose(baseline.coefficients[1:], [[2e-6, 1e-6], [5e6, -1e6]], rtol=1e-6)
    np.testing.assert_allclose(baseline.subtracted_from(table, conditions), 0, atol=1e-9)


def test_residuals_of_a_line_are_scaled_by_what_is_left_after_its_coefficients():
    rng = np.random.default_rng(0)
    load = np.repeat([10.0, 20.0, 30.0], 4)
    table = load[:, np.newaxis] * [1.0, 2.0] + rng.standard_normal((12, 2))
    baseline = linear_baseline_of_features(table, load, scale=True)
    left = baseline.subtracted_from(table, load)
    np.testing.assert_allclose((left**2).sum(axis=0) / 10, 1)


def test_the_axis_of_order_tables_survives(fleet):
    X, y = fleet
    inner = make_pipeline(OrderResampler(THETA_S, min_speed=2.0), OrderPSD(4))
    table = BaselineNormalizer(inner).fit_transform(X, y)
    assert isinstance(table, OrderTable)
    assert table.columns[:2] == ("current@0", "current@0.25")
    psd = inner.fit_transform(X)
    loads = np.array([recording.meta["load"] for recording in X])
    healthy = np.asarray(psd)[(y == "normal") & (loads == 40)].mean(axis=0)
    np.testing.assert_allclose(table[loads == 40], np.asarray(psd)[loads == 40] - healthy)


def bins():
    return make_pipeline(
        OrderResampler(THETA_S, min_speed=2.0), OrderPSD(4), BinTransformer(1, max_order=8)
    )


def test_frames_keep_names_and_index(fleet):
    X, y = fleet
    model = BaselineNormalizer(bins()).set_output(transform="pandas").fit(X, y)
    frame = model.transform(X)
    assert frame.columns.tolist() == model.get_feature_names_out().tolist()
    assert frame.columns[0] == "current@0-1"
    bare = BaselineNormalizer(bins()).fit(X, y).transform(X)
    np.testing.assert_allclose(frame, bare)
    polars = BaselineNormalizer(bins()).set_output(transform="polars").fit_transform(X, y)
    assert isinstance(polars, pl.DataFrame)
    np.testing.assert_allclose(polars.to_numpy(), bare)


def test_features_are_made_once_in_training(fleet):
    calls = []
    made = FunctionTransformer(lambda X: calls.append(len(X)) or [[1.0 * i] for i in range(len(X))])
    BaselineNormalizer(made).fit_transform(*fleet)
    assert calls == [16]


def test_a_search_reaches_the_steps_of_the_transformer(fleet):
    X, y = fleet
    pipe = make_pipeline(
        BaselineNormalizer(bins()), CostSensitiveGaussianBayes(covariance="tied", shrinkage="oas")
    )
    name = "baselinenormalizer__transformer__bintransformer__bin_size"
    search = GridSearchCV(pipe, {name: [1, 2]}, cv=2).fit(X, y)
    assert search.best_estimator_[0].transformer_[-1].bin_size == search.best_params_[name]


def test_commissioning_serves_features_too():
    reference = [constant(60), constant(60, extra=0.2)]
    model = BaselineNormalizer(Levels(), reference=reference).fit([constant(20)], ["normal"])
    left = model.transform([constant(60, extra=0.1)])
    assert left["size"][0] == pytest.approx(0)


# Functions on arrays


def test_a_mean_is_known_where_half_of_the_recordings_have_been():
    ones = [[Stretch(0, np.ones((1, 4)))], [Stretch(2, np.ones((1, 4)) * 3)]]
    third = [Stretch(2, np.ones((1, 2)) * 5), Stretch(2, np.ones((1, 2)) * 7)]
    (mean,) = mean_stretches([*ones, third])
    assert (mean.first, mean.signals.tolist()) == (2, [[4.0, 4.0]])


def test_places_apart_make_stretches_of_their_own():
    parts = mean_stretches([[Stretch(5, np.ones((2, 2))), Stretch(-3, np.zeros((2, 3)))]])
    assert [(part.first, part.stop) for part in parts] == [(-3, 0), (5, 7)]


def test_no_strokes_have_no_mean():
    assert mean_stretches([]) == ()


def test_a_baseline_says_where_it_is_known():
    stretches = {1: (Stretch(2, np.ones((1, 3))),), -1: (Stretch(-4, np.ones((1, 3))),)}
    baseline = AngleBaseline(0.5, "angle", stretches, "load=20")
    assert baseline.reach(1) == ((1.0, 2.0),)
    assert baseline.reach(-1) == ((2.0, 1.0),)
    assert baseline.reach(0) == ()
    assert repr(baseline).startswith("AngleBaseline(load=20; ")


# Errors


def refused(message, *, error=ValueError, y=None, X=None, **options):
    X = over_angle([run(20), run(40)]) if X is None else X
    with pytest.raises(error, match=message):
        BaselineNormalizer(**options).fit(X, ["normal", "worn"] if y is None else y)


def test_a_condition_without_healthy_recordings_is_named():
    refused(r"none of the 1 recordings of load=40 is healthy \(healthy = 'normal'\)")


def test_a_label_that_is_not_in_y_is_named():
    refused(
        r"healthy names 'fine', which is not in y. y holds \['normal', 'worn'\]", healthy="fine"
    )
    refused("healthy names 'fine', which", healthy=["normal", "fine"])


def test_labels_need_y():
    with pytest.raises(ValueError, match=r"names labels of y, but no y was given. Call fit\(X, y"):
        BaselineNormalizer().fit(over_angle([run()]))


def test_as_many_labels_as_recordings_are_needed():
    refused("y has 1 labels for 2 recordings", y=["normal"])


def test_some_label_must_be_healthy():
    refused("healthy must name at least one label of y", healthy=[])


def test_a_function_must_answer_yes_or_no():
    refused("must return True or False, got 'yes' for recording 0", error=TypeError,
            healthy=lambda recording: "yes")  # fmt: skip


def test_a_mapping_of_a_key_that_a_recording_has_not_is_refused():
    refused(r"recording 0 \(load=20\) has no meta key 'hours'", healthy={"hours": 0})


def test_nobody_healthy_at_all_is_refused_for_lines_too():
    runs = [constant(20), constant(40)]
    refused("holds for none of the recordings", X=runs, healthy={"load": 7},
            transformer=Levels(), regression=True)  # fmt: skip


def test_an_unseen_condition_names_recording_key_and_value(fleet):
    model = BaselineNormalizer().fit(over_angle(fleet[0]), fleet[1])
    message = r"recording 1 \(load=60\) has load=60, but healthy recordings .* under \[20, 40\]"
    with pytest.raises(ValueError, match=message):
        model.transform(over_angle([run(20), run(60)]))


def test_recordings_over_time_are_refused_where_signals_are_wanted():
    refused(r"recording 0 \(load=20\) is over time; put an OrderResampler before",
            error=TypeError, X=[run(), run()])  # fmt: skip


def test_a_recording_with_other_channels_is_named():
    X = over_angle([run(names=("current", "torque"))])
    model = BaselineNormalizer(healthy="ok").fit(X, ["ok"])
    with pytest.raises(ValueError, match=r"recording 0 \(load=20\) has no channel 'torque'"):
        model.transform(over_angle([run()]))
    with pytest.raises(ValueError, match="has a channel 'speed'"):
        model.transform(over_angle([run(names=("current", "torque", "speed"))]))
    with pytest.raises(ValueError, match="its channels in the order"):
        model.transform(over_angle([run(names=("torque", "current"))]))
    with pytest.raises(ValueError, match=r"recording 1 \(load=20\) has no channel 'torque'"):
        BaselineNormalizer(healthy="ok").fit([*X, *over_angle([run()])], ["ok"] * 2)


def test_another_angle_between_samples_is_refused():
    model = BaselineNormalizer(healthy="ok").fit(over_angle([run()]), ["ok"])
    with pytest.raises(ValueError, match=r"it was resampled with theta_s = 0\.1, the baseline"):
        model.transform(over_angle([run()], theta_s=0.1))


def test_a_baseline_is_not_subtracted_twice():
    model = BaselineNormalizer(healthy="ok").fit(over_angle([run()]), ["ok"])
    left = model.transform(over_angle([run()]))
    assert isinstance(left[0], NormalizedRecording)
    with pytest.raises(TypeError, match="a baseline has been subtracted from it already"):
        model.transform(left)


def test_travel_has_no_shaft_angle_to_align_by():
    X = over_angle([run()], direction="travel")
    refused("align='angle' needs strokes of one direction each", X=X, y=["normal"])


def test_reference_recordings_are_checked():
    X = over_angle([run()])
    other = Recording({"x": [0.0, 1]}, 1, velocity=[1.0, 1.0], meta={"load": 60})
    message = r"reference: recording 0 \(load=60\) has no channel 'current'"
    refused(message, X=X, y=["normal"], reference=[other])
    refused("reference: recording 0 .*: it was resampled with theta_s", X=X, y=["normal"],
            reference=over_angle([run()], theta_s=0.1))  # fmt: skip


def test_scale_and_regression_are_for_features():
    refused("scale and regression are for features; state the transformer", scale=True)
    refused("scale and regression are for features", regression=True)
    model = BaselineNormalizer(Levels()).fit([constant(20)], ["normal"])
    with pytest.raises(TypeError, match="coverage is of signals"):
        model.coverage([constant(20)])


@pytest.mark.parametrize("name", ["align", "scale", "regression"])
def test_unknown_choices_are_refused(name):
    refused(f"{name} must be one of", **{name: "perhaps"})


def test_a_line_needs_conditions_that_are_numbers():
    runs = [
        Recording({"current": [1.0, 2.0]}, 1, velocity=[1.0, 1.0], meta={"load": load})
        for load in ("low", "high")
    ]
    refused("regression needs conditions that are numbers, but there is load='low'", X=runs,
            y=["normal"] * 2, transformer=Levels(), regression=True)  # fmt: skip


def test_a_line_needs_two_conditions():
    refused("1 different conditions of healthy recordings do not determine 2 coefficients",
            X=[constant(20)] * 2, y=["normal"] * 2, transformer=Levels(),
            regression=True)  # fmt: skip


@pytest.mark.parametrize(
    ("fit", "table", "conditions", "message"),
    [
        (mean_baseline_of_features, [[1.0]], [20], "condition 20 has one healthy recording"),
        (mean_baseline_of_features, [[1.0, 2]] * 2, [20, 20], "feature 0 in 20 is the same in all"),
        (linear_baseline_of_features, [[1.0], [2]], [1, 2], "2 healthy recordings leave no resid"),
        (linear_baseline_of_features, [[1.0]] * 3, [0, 1, 2], "feature 0 is the same in all"),
    ],
)
def test_nothing_is_divided_by_a_deviation_that_is_not_known(fit, table, conditions, message):
    with pytest.raises(ValueError, match=message):
        fit(np.array(table), conditions, scale=True)


def test_a_transformer_must_make_a_finite_table():
    one_dimensional = FunctionTransformer(lambda X: [1.0 for _ in X])
    refused("must make a table of shape", X=[constant(20)], y=["normal"],
            transformer=one_dimensional)  # fmt: skip
    not_finite = FunctionTransformer(lambda X: [[np.nan] for _ in X])
    refused("X must be finite, got NaN in recording 0", X=[constant(20)], y=["normal"],
            transformer=not_finite)  # fmt: skip


def test_what_rounding_leaves_of_a_constant_feature_is_no_deviation():
    table = np.full((3, 1), 0.1)  # whose mean is 0.1 and a rounding error
    assert table.std(axis=0)[0] > 0
    with pytest.raises(ValueError, match="feature 0 in 20 is the same in all"):
        mean_baseline_of_features(table, [20] * 3, scale=True)


@pytest.mark.parametrize("transformer", [3, "levels", StandardScaler, Recording])
def test_what_makes_no_table_is_no_transformer(transformer):
    with pytest.raises(TypeError, match="transformer must be None or one that makes a table of"):
        BaselineNormalizer(transformer).fit([constant(20)], ["normal"])


@pytest.mark.parametrize("reference", [3, run()])
def test_a_reference_is_a_list(reference):
    with pytest.raises(TypeError, match="reference must be None or a list of recordings, got"):
        BaselineNormalizer(reference=reference).fit(over_angle([run()]), ["normal"])


def test_a_reference_without_its_condition_is_told_from_a_recording_of_X():
    other = Recording({"current": [0.0, 1]}, 1, angle=[0.0, 1.0])
    refused("reference: recording 0 has no meta key 'load'", X=over_angle([run()]), y=["normal"],
            reference=[other])  # fmt: skip


def test_a_mapping_of_no_keys_calls_nothing_healthy():
    refused("healthy must name at least one key of meta", X=over_angle([run()]), healthy={})


@pytest.mark.parametrize("y", [3, "normal", {"a": 1}, np.array([["normal"] * 2])])
def test_labels_that_are_no_list_are_refused(y):
    with pytest.raises(TypeError, match="y must hold one label for each recording, got"):
        BaselineNormalizer().fit(over_angle([run()]), y)


def test_no_line_reaches_an_infinite_load():
    model = BaselineNormalizer(Levels(), regression=True)
    model.fit([constant(20), constant(40)], ["normal"] * 2)
    far = Recording({"current": [1.0] * 3}, 1, velocity=[1.0] * 3, meta={"load": np.inf})
    with pytest.raises(ValueError, match=r"recording 0 .* is inf. Set it"):
        model.transform([far])


@pytest.mark.parametrize("X", [None, 3, "runs"])
def test_what_is_no_list_is_refused_in_transform_too(X):
    model = BaselineNormalizer().fit(over_angle([run()]), ["normal"])
    with pytest.raises(TypeError, match="X must be a list of recordings, got"):
        model.transform(X)


def test_a_fit_that_fails_leaves_nothing_fitted():
    model = BaselineNormalizer()
    X = over_angle([run()])
    with pytest.raises(ValueError, match="has a channel 'error'"):
        model.fit([*X, *over_angle([run(names=("current", "error"))])], ["normal"] * 2)
    with pytest.raises(NotFittedError):
        model.transform(X)
