"""Facts about residual signals: what is left of a recording after the healthy mean."""

from functools import cache

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from strokes_under_load import FS, LINE, OFFSETS, THETA_S, inside, motion, over_angle, profile, run

from emacm import OrderPSD, OrderResampler, Recording, SignalBaseline
from emacm.conditions.signal_baseline import GridSignals, mean_sections
from emacm.orders.order_psd import spectrum_key


@pytest.mark.parametrize("antialias", [True, False])
def test_nothing_is_left_of_a_healthy_recording_without_noise(antialias):
    X = over_angle([run(offset=offset) for offset in OFFSETS], antialias=antialias)
    new = over_angle([run(offset=0.05)], antialias=antialias)
    model = SignalBaseline().fit(X, ["healthy"] * len(X))
    for stroke in model.transform(new)[0].strokes:
        assert np.abs(inside(stroke)).max() < 1e-3 < 0.5 < np.abs(inside(new[0].strokes[0])).max()


def test_samples_lie_at_whole_multiples_of_the_angle_between_them():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    for recording in SignalBaseline().fit(X, ["healthy"] * len(X)).transform(X):
        for stroke in recording.strokes:
            places = stroke.angles / THETA_S
            np.testing.assert_allclose(places, np.rint(places), atol=1e-6)
            assert np.all(np.diff(places) * stroke.direction > 0)
            assert stroke.n_angles == stroke.signals.shape[1] == len(stroke.angles)


def test_a_stroke_without_a_grid_angle_is_nothing():
    angle = 0.1 + np.cumsum(np.r_[np.full(4, 0.05), np.zeros(30), np.full(400, -0.05)])
    load = {"load": 20}
    run = Recording({"a": np.ones(434)}, 100, angle=angle, meta=load)
    X = OrderResampler(2 * np.pi / 6).fit_transform([run] * 2)
    (left,) = SignalBaseline().fit(X, ["healthy"] * 2).transform(X[:1])
    assert [stroke.direction for stroke in left.strokes] == [-1]


def test_each_direction_has_a_baseline_of_its_own():
    X = over_angle([run(offset=offset) for offset in OFFSETS])
    baseline = SignalBaseline().fit(X, ["healthy"] * len(X)).baselines_[20]
    (forward,), (reverse,) = baseline.sections[1], baseline.sections[-1]
    angle = THETA_S * np.arange(forward.first, forward.stop)
    expected = profile(angle, 1, 20)[np.newaxis]
    np.testing.assert_allclose(forward.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)
    angle = -THETA_S * np.arange(reverse.first, reverse.stop)
    expected = profile(angle, -1, 20)[np.newaxis]
    np.testing.assert_allclose(reverse.signals[:, 16:-16], expected[:, 16:-16], atol=2e-3)


def test_each_load_has_a_baseline_of_its_own(loaded_fleet):
    runs, y = loaded_fleet
    left = SignalBaseline().fit_transform(over_angle(runs), y)
    sizes = np.array([np.mean(inside(recording.strokes[0]) ** 2) for recording in left])
    assert sizes[y == "healthy"].max() < 0.01 < 0.03 < sizes[y == "worn"].min()


def test_a_recording_may_go_to_and_fro_many_times():
    X = over_angle([run(cycles=3, offset=offset) for offset in OFFSETS])
    new = over_angle([run(cycles=5, fault=0.3, offset=0.04)])
    (left,) = SignalBaseline().fit(X, ["healthy"] * len(X)).transform(new)
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
    model = SignalBaseline().fit(X, ["healthy"] * len(X))
    (left,) = model.transform(new)
    assert [stroke.direction for stroke in left.strokes] == [1]  # there was no reverse stroke
    healthy = X[0].strokes[0].angles
    assert left.strokes[0].angles[0] >= healthy[0] - 1e-9
    assert left.strokes[0].angles[-1] <= healthy[-1] + THETA_S + 1e-9
    assert left.strokes[0].revolutions == pytest.approx(15, abs=0.1)  # of 60 in both strokes


def test_a_recording_where_no_healthy_one_has_been_says_so():
    X = over_angle([run()])
    (left,) = SignalBaseline().fit(X, ["healthy"]).transform(over_angle([run(offset=500.0)]))
    with pytest.raises(ValueError, match=r"start at 500.* healthy recordings of load=20"):
        left.strokes  # noqa: B018
    with pytest.raises(ValueError, match=r"recording 0 \(load=20\): no stroke of it"):
        OrderPSD(4).fit_transform([left])


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
    (left,) = SignalBaseline().fit(X, ["healthy"] * len(X)).transform(new)
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
    fitted = SignalBaseline().fit(slow, ["healthy"] * len(slow))
    assert len(fitted.transform(slow)) == 1
    with pytest.raises(ValueError, match=match):
        fitted.transform(fast)
    with pytest.raises(ValueError, match=r"recording 1 .* 800 Hz"):
        SignalBaseline().fit([*slow, *fast], ["healthy", "worn"])
    with pytest.raises(ValueError, match=r"recording 1 .* 800 Hz"):
        SignalBaseline().fit([*slow, *fast], ["healthy"] * len([*slow, *fast]))


def test_only_the_fault_is_left_in_the_spectrum(loaded_fleet):
    X, y = loaded_fleet
    rows = over_angle(X)
    left = SignalBaseline().fit_transform(rows, y)
    psd = OrderPSD(4)
    before, after = psd.fit_transform(rows), psd.fit_transform(left)
    worn = y == "worn"
    assert np.all(psd.orders_[before[worn].argmax(axis=1)] != LINE)
    assert np.all(psd.orders_[after[worn].argmax(axis=1)] == LINE)


# Residuals of training recordings without noise are next to nothing, unlike those of others.
def test_kept_spectra_are_told_apart_by_their_baseline(loaded_fleet, tmp_path):
    X, y = loaded_fleet
    rows = over_angle(X)
    psd = OrderPSD(4, memory=tmp_path).fit(rows)
    fresh = OrderPSD(4).fit(rows)
    halves = [SignalBaseline().fit(rows[part], y[part]) for part in (slice(8), slice(8, 16))]
    for left in [rows, *(model.transform(rows) for model in halves)]:
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
        np.testing.assert_array_equal(psd.transform(left), fresh.transform(left))
    keys = {spectrum_key(model.transform(rows)[0], "") for model in halves}
    assert len(keys | {spectrum_key(rows[0], "")}) == 3


def test_recordings_of_commissioning_serve_a_load_that_training_has_not(loaded_fleet):
    X, y = loaded_fleet
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


def test_healthy_may_have_several_labels():
    X, y = over_angle([run(fault=0.1 * i) for i in range(4)]), ["new", "run in", "worn", "worn"]
    model = SignalBaseline(healthy=["new", "run in"]).fit(X, y)
    by_hand = SignalBaseline().fit(X[:2], ["healthy", "healthy"])
    assert model.baselines_[20] == by_hand.baselines_[20]


def test_a_mean_is_known_where_half_of_the_recordings_have_been():
    ones = [[GridSignals(0, np.ones((1, 4)))], [GridSignals(2, np.ones((1, 4)) * 3)]]
    third = [GridSignals(2, np.ones((1, 2)) * 5), GridSignals(2, np.ones((1, 2)) * 7)]
    (mean,) = mean_sections([*ones, third])
    assert (mean.first, mean.signals.tolist()) == (2, [[4.0, 4.0]])


def test_places_apart_make_sections_of_their_own():
    parts = mean_sections([[GridSignals(5, np.ones((2, 2))), GridSignals(-3, np.zeros((2, 3)))]])
    assert [(part.first, part.stop) for part in parts] == [(-3, 0), (5, 7)]


two_loads = cache(lambda: over_angle([run(20), run(40)]))
new_load = cache(lambda: over_angle([run(20), run(60)]))
one = cache(lambda: over_angle([run()]))
travel = cache(lambda: over_angle([run()], direction="travel"))
coarse = cache(lambda: over_angle([run()], theta_s=0.1))
two_channels = cache(lambda: over_angle([run(names=("current", "torque"))]))
residual = cache(lambda: SignalBaseline().fit_transform(one(), ["healthy"]))
mixed = cache(lambda: [*two_channels(), *one()])
OTHER_CHANNEL = Recording({"x": [0.0, 1]}, 1, velocity=[1.0, 1.0], meta={"load": 60})
NO_LOAD = Recording({"current": [0.0, 1]}, 1, angle=[0.0, 1.0])
BAD_FITS = [
    ({}, two_loads, ["healthy", "worn"], r"none of the 1 recordings of load=40 is healthy"),
    ({"healthy": "fine"}, one, ["healthy"], r"'fine', which is not in y. y holds \['healthy'\]"),
    ({}, one, None, r"names labels of y: call fit\(X, y"),
    ({}, two_loads, ["healthy"], "y has 1 labels for 2 recordings"),
    ({"healthy": []}, one, ["healthy"], "none of the 1 recordings"),
    ({}, [run()], ["healthy"], r"recording 0 \(load=20\) is over time; put an OrderResampler"),
    ({}, travel, ["healthy"], "needs strokes of one direction each"),
    ({}, residual, ["healthy"], "no residuals"),
    ({}, mixed, ["healthy"] * 2, r"recording 1 .* has no channel 'torque'"),
    (
        {"baseline_recordings": run()},
        one,
        ["healthy"],
        r"baseline_recordings: .* write \[recording\]",
    ),
    ({"baseline_recordings": "runs"}, one, ["healthy"], "baseline_recordings: .* got 'runs'"),
    ({"baseline_recordings": [NO_LOAD]}, one, ["healthy"], "baseline_recordings: .* key 'load'"),
    ({"baseline_recordings": [OTHER_CHANNEL]}, one, ["healthy"], "has no channel 'current'"),
    ({"baseline_recordings": coarse}, one, ["healthy"], "baseline_recordings: .* theta_s"),
]


@pytest.mark.parametrize(("options", "X", "y", "message"), BAD_FITS)
def test_what_has_no_baseline_is_refused_and_leaves_nothing_fitted(options, X, y, message):
    options = {name: of() if callable(of) else of for name, of in options.items()}
    model = SignalBaseline(**options)
    with pytest.raises((TypeError, ValueError), match=message):
        model.fit(X() if callable(X) else X, y)
    with pytest.raises(NotFittedError):
        model.transform(one())


@pytest.mark.parametrize(
    ("X", "message"),
    [
        (new_load, r"recording 1 .* has load=60, .* of \[20\] only"),
        (two_channels, "recording 0 .* has a channel 'torque'"),
        (coarse, r"recording 0 .* was resampled with theta_s = 0\.1, but"),
        (residual, "no residuals"),
    ],
)
def test_recordings_unlike_those_of_the_baseline_are_refused(X, message):
    with pytest.raises((TypeError, ValueError), match=message):
        SignalBaseline().fit(one(), ["healthy"]).transform(X())
