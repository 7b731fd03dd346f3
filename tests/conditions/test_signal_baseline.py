"""Facts about residual signals: what is left of a recording after the healthy mean."""

import pickle

import joblib
import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import GridSearchCV, cross_validate
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from strokes_under_load import (
    FS,
    LINE,
    OFFSETS,
    THETA_S,
    inside,
    made_fleet,
    motion,
    over_angle,
    profile,
    run,
)

import emacm.resampling.angle_recording
from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    SignalBaseline,
)
from emacm.conditions.signal_baseline import ResidualRecording
from emacm.orders.store import spectrum_key
from emacm.resampling.angle_recording import AngleRecording


@pytest.fixture(scope="module")
def fleet():
    return made_fleet()


# Signals


@pytest.mark.parametrize("antialias", [True, False])
def test_nothing_is_left_of_a_healthy_recording_without_noise(antialias):
    X = over_angle([run(offset=offset) for offset in OFFSETS], antialias=antialias)
    new = over_angle([run(offset=0.05)], antialias=antialias)
    model = SignalBaseline(healthy=lambda recording: True).fit(X)
    for stroke in model.transform(new)[0].strokes:
        assert np.abs(inside(stroke)).max() < 1e-3 < 0.5 < np.abs(inside(new[0].strokes[0])).max()


def test_a_fault_is_left_whole():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    new = over_angle([run(fault=0.3, offset=0.05)])
    (left,) = SignalBaseline(healthy=lambda recording: True).fit(X).transform(new)
    for stroke in left.strokes:
        fault = 0.3 * np.sin(LINE * stroke.angles)[np.newaxis, 16:-16]
        np.testing.assert_allclose(inside(stroke), fault, atol=2e-3)


def test_samples_lie_at_whole_multiples_of_the_angle_between_them():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    for recording in SignalBaseline(healthy=lambda recording: True).fit(X).transform(X):
        for stroke in recording.strokes:
            places = stroke.angles / THETA_S
            np.testing.assert_allclose(places, np.rint(places), atol=1e-6)
            assert np.all(np.diff(places) * stroke.direction > 0)
            assert stroke.n_angles == stroke.signals.shape[1] == len(stroke.angles)


def test_a_stroke_gets_no_sample_before_its_start_or_after_its_end():
    (plain,) = over_angle([run(offset=0.05)])
    (left,) = SignalBaseline(healthy=lambda recording: True).fit_transform([plain])
    for before, after in zip(plain.strokes, left.strokes, strict=True):
        limits = sorted((before.angles[0], before.angles[-1] + before.direction * THETA_S))
        assert limits[0] - 1e-9 <= after.angles.min()
        assert after.angles.max() <= limits[1] + 1e-9
        assert before.n_angles - after.n_angles in (-1, 0, 1)


def test_each_direction_has_a_baseline_of_its_own():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    baseline = SignalBaseline(healthy=lambda recording: True).fit(X).baselines_[20]
    (forward,), (reverse,) = baseline.sections[1], baseline.sections[-1]
    angle = THETA_S * np.arange(forward.first, forward.stop)
    expected = profile(angle, 1, 20)[np.newaxis]
    np.testing.assert_allclose(forward.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)
    angle = -THETA_S * np.arange(reverse.first, reverse.stop)
    expected = profile(angle, -1, 20)[np.newaxis]
    np.testing.assert_allclose(reverse.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)


def test_each_load_has_a_baseline_of_its_own(fleet):
    runs, y = fleet
    left = SignalBaseline().fit_transform(over_angle(runs), y)
    sizes = np.array([np.mean(inside(recording.strokes[0]) ** 2) for recording in left])
    assert sizes[y == "normal"].max() < 0.01 < 0.03 < sizes[y == "worn"].min()


def test_the_mean_of_one_direction_shifts_with_the_mean_of_its_signals():
    X = over_angle([run(offset=offset, noise=0.1, seed=i) for i, offset in enumerate(OFFSETS)])
    left = SignalBaseline(healthy=lambda recording: True).fit_transform(X)
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
    (left,) = SignalBaseline(healthy=lambda recording: True).fit(X).transform(new)
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
    model = SignalBaseline(healthy=lambda recording: True).fit(X)
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
        SignalBaseline(healthy=lambda recording: True)
        .fit(X)
        .transform(over_angle([run(offset=500.0)]))
    )
    with pytest.raises(
        ValueError, match=r"no stroke of it \(forward from 500.* of load=20 \(forward 0\.1"
    ):
        left.strokes  # noqa: B018
    with pytest.raises(ValueError, match=r"recording 0 \(load=20\): no stroke of it"):
        OrderPSD(4).fit_transform([left])


def test_without_a_zero_of_the_angle_strokes_are_aligned_by_their_start():
    def made(turned):
        angle = motion()
        signal = np.sin(2 * angle) + 0.3 * np.cos(5 * angle)
        return Recording({"current": signal}, FS, angle=angle + turned, meta={"load": 20})

    X, new = over_angle([made(0.0), made(1000.3)]), over_angle([made(-77.7)])
    model = SignalBaseline(healthy=lambda recording: True, align="start").fit(X)
    for stroke in model.transform(new)[0].strokes:
        assert np.abs(inside(stroke)).max() < 1e-6


def test_one_path_of_both_directions_has_a_baseline_by_its_start():
    X = over_angle([run(), run()], direction="travel")
    model = SignalBaseline(healthy=lambda recording: True, align="start").fit(X)
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
    (left,) = SignalBaseline(healthy=lambda recording: True).fit(X).transform(new)
    assert left.rate_groups == [[0], [1]]
    current, position = inside(left.strokes[0])
    assert np.abs(position).max() < 1e-12
    assert np.abs(current).max() == pytest.approx(0.3, abs=0.01)


def test_another_sampling_rate_than_that_of_the_healthy_recordings_is_refused():
    def made(fs):
        angle = np.linspace(0, 60, round(6 * fs))
        return Recording({"current": np.sin(angle)}, fs, angle=angle, meta={"load": 35})

    slow, fast = over_angle([made(500)]), over_angle([made(800)])
    match = r"recording 0 .*: channel 'current' is sampled at 800 Hz, .* healthy .* at 500 Hz"
    fitted = SignalBaseline(healthy=lambda recording: True).fit(slow)
    assert len(fitted.transform(slow)) == 1
    with pytest.raises(ValueError, match=match):
        fitted.transform(fast)
    with pytest.raises(ValueError, match=r"recording 1 .* 800 Hz"):
        SignalBaseline().fit([*slow, *fast], ["normal", "worn"])
    with pytest.raises(ValueError, match=r"recording 1 .* 800 Hz"):
        SignalBaseline(healthy=lambda recording: True).fit([*slow, *fast])


def test_single_precision_stays_and_blocks_continue_one_another():
    angle = motion(cycles=40)
    signal = profile(angle, np.gradient(angle), 20).astype(np.float32)
    one = Recording({"current": signal}, FS, angle=angle, meta={"load": 20})
    (left,) = SignalBaseline(healthy=lambda recording: True).fit_transform(over_angle([one]))
    stroke = left.strokes[3]
    assert stroke.signals.dtype == np.float32
    blocks = np.concatenate([*stroke.blocks([0])], axis=1)  # in float64, for what follows
    np.testing.assert_array_equal(blocks.astype(np.float32), stroke.signals)


def test_nothing_is_resampled_before_it_is_read(fleet, monkeypatch):
    X, y = fleet
    rows = over_angle(X)
    model = SignalBaseline().fit(rows, y)
    calls = []
    original = emacm.resampling.angle_recording.spread_rows
    monkeypatch.setattr(
        emacm.resampling.angle_recording,
        "spread_rows",
        lambda *args, **options: calls.append(1) or original(*args, **options),
    )
    left = model.transform(rows)
    assert all(isinstance(entry, AngleRecording) for entry in left)
    assert not calls
    assert left[0].strokes[0].signals.shape[0] == 1
    assert len(calls) == 1


def test_a_frame_of_what_is_left_has_its_angles():
    (left,) = SignalBaseline(healthy=lambda recording: True).fit_transform(over_angle([run()]))
    frame = left.frame()
    assert frame.columns.tolist() == ["current"]
    assert frame.loc[0].index.tolist() == left.strokes[0].angles.tolist()
    assert left.meta["load"] == 20


# Spectra, pipelines


def chain(**options):
    return make_pipeline(
        OrderResampler(THETA_S, min_speed=2.0),
        SignalBaseline(),
        OrderPSD(4, by_direction=True, **options),
        BinTransformer(1, max_order=8),
        FunctionTransformer(np.log10, feature_names_out="one-to-one"),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage="oas"),
    )


def test_only_the_fault_is_left_in_the_spectrum(fleet):
    X, y = fleet
    rows = over_angle(X)
    left = SignalBaseline().fit_transform(rows, y)
    psd = OrderPSD(4)
    before, after = psd.fit_transform(rows), psd.fit_transform(left)
    worn = y == "worn"
    assert np.all(psd.orders_[before[worn].argmax(axis=1)] != LINE)
    assert np.all(psd.orders_[after[worn].argmax(axis=1)] == LINE)


# Residuals of training recordings without noise are next to nothing, unlike those of others.
@pytest.mark.filterwarnings("ignore:recording [0-9]+. line at order")
def test_the_pipeline_cross_validates_and_searches(fleet):
    X, y = fleet
    scores = cross_validate(chain(), X, y, cv=2)["test_score"]
    assert scores.tolist() == [1, 1]
    name = "signalbaseline__align"
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
    halves = [SignalBaseline().fit(rows[part], y[part]) for part in (slice(8), slice(8, 16))]
    for left in [rows, *(model.transform(rows) for model in halves)]:
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
    keys = {spectrum_key(model.transform(rows)[0], "") for model in halves}
    assert len(keys | {spectrum_key(rows[0], "")}) == 3


def test_the_same_baseline_finds_the_same_spectra(fleet):
    X, y = fleet
    one, two = (SignalBaseline().fit(over_angle(X), y) for _ in range(2))
    keys = [spectrum_key(model.transform(over_angle(X))[0], "") for model in (one, two)]
    assert keys[0] == keys[1]
    assert one.baselines_[20] == two.baselines_[20] != one.baselines_[40]
    assert hash(one.baselines_[20]) == hash(two.baselines_[20])


def test_files_and_hashes_know_the_baseline(fleet, tmp_path):
    X, y = fleet
    rows = over_angle(X)
    model = SignalBaseline().fit(rows, y)
    (left,) = model.transform(rows[:1])
    copy = pickle.loads(pickle.dumps(left))
    assert copy == left
    np.testing.assert_array_equal(copy.strokes[0].signals, left.strokes[0].signals)
    other = SignalBaseline().fit(rows[:8], y[:8]).transform(rows[:1])[0]
    assert joblib.hash(other) != joblib.hash(left) == joblib.hash(copy)
    joblib.dump(model, tmp_path / "model.joblib")
    again = joblib.load(tmp_path / "model.joblib").transform(rows[:1])[0]
    np.testing.assert_array_equal(again.strokes[0].signals, left.strokes[0].signals)


@pytest.mark.slow
def test_processes_change_nothing(fleet):
    X, y = fleet
    left = SignalBaseline().fit_transform(over_angle(X), y)
    with joblib.parallel_backend("loky"):
        many = OrderPSD(4, n_jobs=2).fit_transform(left)
    np.testing.assert_array_equal(many, OrderPSD(4).fit_transform(left))


def test_cloning_forgets_baselines(fleet):
    model = SignalBaseline(align="start").fit(over_angle(fleet[0]), fleet[1])
    assert not hasattr(clone(model), "baselines_")
    assert clone(model).align == "start"
    assert model.get_feature_names_out().tolist() == ["current"]


def test_recordings_of_commissioning_serve_a_load_that_training_has_not(fleet):
    X, y = fleet
    at_20 = [i for i, recording in enumerate(X) if recording.meta["load"] == 20]
    new = over_angle([run(60, offset=0.05), run(60, fault=0.3, offset=0.05)])
    reference = [run(60, offset=offset) for offset in OFFSETS]
    model = SignalBaseline(baseline_recordings=reference)
    model.fit(over_angle([X[i] for i in at_20]), y[at_20])
    assert model.conditions_ == (20, 60)
    healthy, worn = model.transform(new)
    assert np.abs(inside(healthy.strokes[0])).max() < 2e-3
    assert np.abs(inside(worn.strokes[0])).max() > 0.25
    assert clone(model).baseline_recordings == reference


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
        model = SignalBaseline(healthy=healthy).fit(X, y)
        by_hand = SignalBaseline(healthy=lambda recording: True).fit(X[:2])
        assert model.baselines_[20] == by_hand.baselines_[20]


def test_conditions_may_have_several_keys():
    runs = [run(load, unit=unit) for load in (20, 40) for unit in "AB"]
    model = SignalBaseline(condition=("load", "unit"), healthy="ok")
    model.fit(over_angle(runs), ["ok"] * 4)
    assert model.conditions_ == ((20, "A"), (20, "B"), (40, "A"), (40, "B"))
    with pytest.raises(
        ValueError, match=r"recording 0 .* has load=20, unit='C', but there are healthy"
    ):
        model.transform(over_angle([run(20, unit="C")]))


# Errors


def refused(message, *, error=ValueError, y=None, X=None, **options):
    X = over_angle([run(20), run(40)]) if X is None else X
    with pytest.raises(error, match=message):
        SignalBaseline(**options).fit(X, ["normal", "worn"] if y is None else y)


def test_a_condition_without_healthy_recordings_is_named():
    refused(r"none of the 1 recordings of load=40 is healthy \(healthy = 'normal'\)")


def test_a_label_that_is_not_in_y_is_named():
    refused(
        r"healthy names 'fine', which is not in y. y holds \['normal', 'worn'\]", healthy="fine"
    )
    refused("healthy names 'fine', which", healthy=["normal", "fine"])


def test_labels_need_y():
    with pytest.raises(ValueError, match=r"names labels of y, but no y was given. Call fit\(X, y"):
        SignalBaseline().fit(over_angle([run()]))


def test_as_many_labels_as_recordings_are_needed():
    refused("y has 1 labels for 2 recordings", y=["normal"])


def test_some_label_must_be_healthy():
    refused("healthy must name at least one label of y", healthy=[])


def test_a_function_must_answer_yes_or_no():
    refused("must return True or False, got 'yes' for recording 0", error=TypeError,
            healthy=lambda recording: "yes")  # fmt: skip


def test_a_mapping_of_a_key_that_a_recording_has_not_is_refused():
    refused(r"recording 0 \(load=20\) has no meta key 'hours'", healthy={"hours": 0})


def test_an_unseen_condition_names_recording_key_and_value(fleet):
    model = SignalBaseline().fit(over_angle(fleet[0]), fleet[1])
    message = r"recording 1 \(load=60\) has load=60, .* healthy recordings of \[20, 40\] only"
    with pytest.raises(ValueError, match=message):
        model.transform(over_angle([run(20), run(60)]))


def test_recordings_over_time_are_refused_where_signals_are_wanted():
    refused(r"recording 0 \(load=20\) is over time; put an OrderResampler before",
            error=TypeError, X=[run(), run()])  # fmt: skip


def test_a_recording_with_other_channels_is_named():
    X = over_angle([run(names=("current", "torque"))])
    model = SignalBaseline(healthy="ok").fit(X, ["ok"])
    with pytest.raises(ValueError, match=r"recording 0 \(load=20\) has no channel 'torque'"):
        model.transform(over_angle([run()]))
    with pytest.raises(ValueError, match="has a channel 'speed'"):
        model.transform(over_angle([run(names=("current", "torque", "speed"))]))
    with pytest.raises(ValueError, match="its channels in the order"):
        model.transform(over_angle([run(names=("torque", "current"))]))
    with pytest.raises(ValueError, match=r"recording 1 \(load=20\) has no channel 'torque'"):
        SignalBaseline(healthy="ok").fit([*X, *over_angle([run()])], ["ok"] * 2)


def test_another_angle_between_samples_is_refused():
    model = SignalBaseline(healthy="ok").fit(over_angle([run()]), ["ok"])
    with pytest.raises(ValueError, match=r"recording 0 .* was resampled with theta_s = 0\.1, but"):
        model.transform(over_angle([run()], theta_s=0.1))


def test_a_baseline_is_not_subtracted_twice():
    model = SignalBaseline(healthy="ok").fit(over_angle([run()]), ["ok"])
    left = model.transform(over_angle([run()]))
    assert isinstance(left[0], ResidualRecording)
    with pytest.raises(TypeError, match=r"recording 0 .*: it is a residual already"):
        model.transform(left)


def test_travel_has_no_shaft_angle_to_align_by():
    X = over_angle([run()], direction="travel")
    refused("align='angle' needs strokes of one direction each", X=X, y=["normal"])


def test_reference_recordings_are_checked():
    X = over_angle([run()])
    other = Recording({"x": [0.0, 1]}, 1, velocity=[1.0, 1.0], meta={"load": 60})
    message = r"baseline_recordings: recording 0 \(load=60\) has no channel 'current'"
    refused(message, X=X, y=["normal"], baseline_recordings=[other])
    refused("baseline_recordings: recording 0 .* was resampled with theta_s", X=X, y=["normal"],
            baseline_recordings=over_angle([run()], theta_s=0.1))  # fmt: skip


@pytest.mark.parametrize("name", ["align"])
def test_unknown_choices_are_refused(name):
    refused(f"{name} must be one of", **{name: "perhaps"})


@pytest.mark.parametrize("reference", [3, run()])
def test_a_reference_is_a_list(reference):
    with pytest.raises(
        TypeError, match="baseline_recordings must be None or a list of recordings, got"
    ):
        SignalBaseline(baseline_recordings=reference).fit(over_angle([run()]), ["normal"])


def test_a_reference_without_its_condition_is_told_from_a_recording_of_X():
    other = Recording({"current": [0.0, 1]}, 1, angle=[0.0, 1.0])
    message = "baseline_recordings: recording 0 has no meta key 'load'"
    refused(message, X=over_angle([run()]), y=["normal"], baseline_recordings=[other])


def test_a_mapping_of_no_keys_calls_nothing_healthy():
    refused("healthy must name at least one key of meta", X=over_angle([run()]), healthy={})


@pytest.mark.parametrize("y", [3, "normal", {"a": 1}, np.array([["normal"] * 2])])
def test_labels_that_are_no_list_are_refused(y):
    with pytest.raises(TypeError, match="y must hold one label for each recording, got"):
        SignalBaseline().fit(over_angle([run()]), y)


@pytest.mark.parametrize("X", [None, 3, "runs"])
def test_what_is_no_list_is_refused_in_transform_too(X):
    model = SignalBaseline().fit(over_angle([run()]), ["normal"])
    with pytest.raises(TypeError, match="X must be a list of recordings, got"):
        model.transform(X)


def test_a_fit_that_fails_leaves_nothing_fitted():
    model = SignalBaseline()
    X = over_angle([run()])
    with pytest.raises(ValueError, match="has a channel 'error'"):
        model.fit([*X, *over_angle([run(names=("current", "error"))])], ["normal"] * 2)
    with pytest.raises(NotFittedError):
        model.transform(X)


def test_a_second_fit_and_a_clone_use_the_baseline_recordings_again():
    X = over_angle([run(20)])
    model = SignalBaseline(baseline_recordings=[run(60), run(60, offset=0.11)]).fit(X, ["normal"])
    baseline = model.baselines_[60]
    assert model.fit(X, ["normal"]).baselines_[60] == baseline
    assert clone(model).fit(X, ["normal"]).baselines_[60] == baseline


def test_baseline_recordings_that_can_be_read_only_once_are_refused():
    model = SignalBaseline(baseline_recordings=(run(load) for load in (20, 60)))
    with pytest.raises(
        TypeError, match=r"baseline_recordings must be .*generator.*write list\(\.\.\.\)"
    ):
        model.fit(over_angle([run(20)]), ["normal"])


def test_a_fit_that_fails_keeps_the_fitted_baselines():
    X = over_angle([run(offset=0.05)])
    model = SignalBaseline().fit(X, ["normal"])
    known = model.transform(X)[0]
    with pytest.raises(ValueError, match="has a channel 'error'"):
        model.fit([*X, *over_angle([run(names=("current", "error"))])], ["normal"] * 2)
    assert model.transform(X)[0] == known
