"""Scoring: the results of the model itself, and a row that says what and where for each failure."""

import os
import pickle
import re
import warnings
from functools import partial
from threading import Barrier

import numpy as np
import pandas as pd
import pytest
from order_models import log, order_bins
from sklearn.pipeline import make_pipeline

from emacm import (
    ConditionRouter,
    CostSensitiveGaussianBayes,
    Layout,
    OrderResampler,
    Recording,
    RecordingFolder,
    RecordingStatistics,
    open_recording,
    score,
)
from emacm.files import folder as files
from emacm.models.scoring import scored_rows

RNG = np.random.default_rng(4)
FS, N = 1000.0, 3000
SPEED = 80 + 5 * np.sin(np.arange(N) / 300)
ANGLE = np.cumsum(SPEED) / FS
LAYOUT = Layout(fs=FS, channels=["vib", "amp"], velocity="speed", units={"vib": "g"})


def signals(worn=False, seed=None):
    rng = RNG if seed is None else np.random.default_rng(seed)
    line = (2.0 if worn else 0.1) * np.sin(4.7 * ANGLE)
    return {"vib": rng.normal(size=N) + line, "amp": 3 + 0.2 * rng.normal(size=N), "speed": SPEED}


def in_memory(number):
    found = signals(worn=number % 2 == 1, seed=number)
    speed = found.pop("speed")
    return Recording(found, FS, velocity=speed, meta={"load": (10, 30)[number // 2 % 2]})


X = [in_memory(number) for number in range(24)]
Y = ["healthy", "worn"] * 12
COST = {("healthy", "worn"): 10, ("inspect", "healthy"): 0.3, ("inspect", "worn"): 0.3}


def pipeline(**options):
    bayes = CostSensitiveGaussianBayes(COST, covariance="tied", shrinkage="auto", **options)
    return order_bins(log(), bayes, samples=24, bin_size=0.5, max_order=9)


@pytest.fixture(scope="module")
def model():
    groups = {"costsensitivegaussianbayes__groups": np.arange(24) // 4}
    return pipeline(unknown="unknown").fit(X, Y, **groups)


# The results of the model


def test_the_row_holds_the_results_of_the_model(model):
    table = score(model, X)
    assert list(table.columns) == [
        *("recording", "decision", "expected_cost", "typicality"),
        *("P(healthy)", "P(worn)", "P(unknown)", "warnings", "outside_training", "error"),
    ]
    assert table["recording"].tolist() == list(range(24))
    assert table["decision"].tolist() == model.predict(X).tolist()
    features = model[:-1].transform(X)
    unknown = model[-1].unknown_proba(features)
    assert unknown.min() > 0
    posterior = model.predict_proba(X)
    np.testing.assert_allclose(table[["P(healthy)", "P(worn)"]], posterior, rtol=1e-9)
    np.testing.assert_allclose(table["P(unknown)"], unknown, rtol=1e-9)
    risk = model[-1].risk(features).min(axis=1)
    np.testing.assert_allclose(table["expected_cost"], risk, rtol=1e-9)
    np.testing.assert_allclose(table["typicality"], model[-1].typicality(features), rtol=1e-9)
    assert not table["error"].any()


def test_parallel_scoring_gives_the_same_table(model):
    pd.testing.assert_frame_equal(score(model, X, n_jobs=3), score(model, X))


def test_threads_keep_the_warnings_of_their_own_recordings(model):
    both = Barrier(2)

    def opened(number):
        both.wait(10)
        warnings.warn(f"{number} has a gap.", UserWarning, stacklevel=1)
        both.wait(10)
        return X[number]

    rows = scored_rows(model, [partial(opened, number) for number in (0, 1)], "AB", n_jobs=2)
    assert [row["warnings"] for row in rows] == ["0 has a gap.", "1 has a gap."]


def test_the_direction_is_stated_of_features_over_time():
    model = make_pipeline(RecordingStatistics(), CostSensitiveGaussianBayes(shrinkage=0.5))
    reverse = Recording(X[0].signals, FS, velocity=-X[0].velocity, meta=X[0].meta)
    table = score(model.fit(X, Y), [X[0], reverse])
    assert table["outside_training"][0] == ""
    assert table["outside_training"][1].startswith("100 % of the revolutions are in reverse")


def test_a_router_decides_as_it_predicts():
    router = ConditionRouter(pipeline(), "load").fit(X, Y)
    router.set_params(estimator__costsensitivegaussianbayes__cost={("worn", "healthy"): 50})
    table = score(router, X)
    assert table["decision"].tolist() == router.predict(X).tolist()
    posterior = table[["P(healthy)", "P(worn)"]].to_numpy()
    np.testing.assert_allclose(posterior, router.predict_proba(X), rtol=1e-9)
    np.testing.assert_allclose(table["expected_cost"], router.risk(X).min(axis=1), rtol=1e-9)
    assert table["typicality"].isna().all()


def test_the_unknown_state_of_a_router_stands_beside_its_classes():
    router = ConditionRouter(pipeline(unknown="new"), "load")
    router.fit(X, Y, costsensitivegaussianbayes__groups=np.arange(24) // 4)
    table = score(router, X)
    np.testing.assert_allclose(table[["P(healthy)", "P(worn)"]].sum(axis=1), 1, rtol=1e-9)
    np.testing.assert_allclose(table["P(unknown)"], router.unknown_proba(X), rtol=1e-9)


def test_what_is_outside_of_the_training_is_stated(model):
    loud = {"vib": 1000 * X[0].signals["vib"], "amp": X[0].signals["amp"]}
    row = score(model, [Recording(loud, FS, velocity=SPEED / 4)]).iloc[0]
    assert re.search(r"channel 'vib' \d\d dB above training", row["outside_training"])
    assert "is below that of the training" in row["outside_training"]
    assert row["decision"] in ("unknown", "inspect", "worn")
    assert row["error"] == ""


def test_a_clipped_channel_is_a_warning(model):
    clipped = np.clip(X[1].signals["vib"], -0.8, 0.8)
    recording = Recording({"vib": clipped, "amp": X[1].signals["amp"]}, FS, velocity=SPEED)
    assert "vib" in score(model, [recording])["warnings"][0]


@pytest.mark.filterwarnings("ignore:divide by zero")  # of the logarithm
def test_a_recording_without_decision_has_its_warnings(model):
    dead = Recording({"vib": np.zeros(N), "amp": X[1].signals["amp"]}, FS, velocity=SPEED)
    (row,) = score(model, [dead]).to_dict("records")
    assert row["error"].startswith("the logarithm of recording 0, column 'vib@0-0.5'")
    assert row["warnings"] == "channel 'vib' is constant (0): cable or sensor?"
    assert row["outside_training"].startswith("channel 'vib' without signal, unlike training")


@pytest.mark.parametrize(
    ("wrong", "recordings", "error"),
    [
        (pipeline(), X, ValueError),
        (CostSensitiveGaussianBayes, X, TypeError),
        (OrderResampler().fit(X), X, TypeError),
        (None, X[0], TypeError),
        (None, "folder", TypeError),
    ],
)
def test_a_wrong_model_or_no_list_is_an_error(model, wrong, recordings, error):
    with pytest.raises(error):
        score(model if wrong is None else wrong, recordings)


def test_no_recordings_give_an_empty_table(model):
    assert score(model, []).empty


# Kinds of failure


def npz(path, **changes):
    np.savez(path, **(signals() | changes))


def csv(path, frame=None, text=None):
    if text is None:
        frame = pd.DataFrame(signals()) if frame is None else frame
        text = frame.to_csv(index=False)
    path.write_text(text)


def with_value(name, sample, value):
    values = np.array(signals()[name], float)
    values[sample] = value
    return {name: values}


FRAME = pd.DataFrame(signals())


OTHER = {"velocity": "speed", "fs": FS}

# how the file is written, layout, what the error must say
FAILURES = {
    "missing": (lambda p: None, LAYOUT, "no file"),
    "NaN": (lambda p: npz(p, **with_value("vib", 123, np.nan)), LAYOUT, "'vib'.*123"),
    "standing still": (lambda p: npz(p, speed=np.zeros(N)), LAYOUT, "never turns"),
    "short": (lambda p: npz(p, **{k: v[:200] for k, v in signals().items()}), LAYOUT, "no stroke"),
    "channel missing": (lambda p: np.savez(p, vib=SPEED, speed=SPEED), LAYOUT, "no column 'amp'"),
    "one channel more": (lambda p: npz(p, sound=SPEED), Layout(**OTHER), "'sound' besides"),
}


@pytest.mark.parametrize("kind", FAILURES)
def test_a_failure_gives_a_row_that_says_what_and_where(model, tmp_path, kind):
    (write, layout, message), path = FAILURES[kind], tmp_path / "a.npz"
    write(path)
    (row,) = scored_rows(model, [lambda: open_recording(path, layout)], [str(path)])
    assert row["decision"] is None
    assert np.isnan([row["expected_cost"], row["typicality"], row["P(worn)"]]).all()
    assert pd.Series([row["error"]]).str.contains(message).all(), row["error"]
    assert row["recording"] == str(path)
    assert "\n" not in row["error"]


def test_a_row_states_that_its_file_ends_within_a_row(model, tmp_path):
    path = tmp_path / "a.csv"
    csv(path, text=FRAME.to_csv(index=False)[:-40])
    (row,) = scored_rows(model, [lambda: open_recording(path, LAYOUT)], ["a"])
    assert row["decision"] == "healthy"
    assert "a.csv: its last row has no line end" in row["warnings"]


@pytest.mark.parametrize("entry", [None, 3, "a.npz", np.ones((2, 50)), {"vib": [1, 2]}])
def test_an_entry_that_is_no_recording_gives_a_row(model, entry):
    table = score(model, [X[0], entry, X[1]])
    assert table["error"].astype(bool).tolist() == [False, True, False]
    assert "recording" in table["error"][1]


def test_a_folder_with_bad_files_gives_rows_for_all(model, tmp_path):
    for number in range(6):
        npz(tmp_path / f"{number}.npz", **signals(worn=number > 2, seed=100 + number))
    folder = RecordingFolder(tmp_path, LAYOUT)
    (tmp_path / "3.npz").write_bytes(b"PK")
    table = score(model, folder, n_jobs=2)
    assert table["recording"].tolist() == [str(path.absolute()) for path in folder.paths]
    assert np.flatnonzero(table["error"]).tolist() == [3]
    assert table["decision"].drop(3).tolist() == ["healthy"] * 3 + ["worn"] * 2
    assert len(pickle.dumps(folder[0])) < 1000


def test_no_file_stays_in_memory_when_its_row_is_known(model, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_recent", files.Recent(1 << 24))
    for number in range(3):
        npz(tmp_path / f"{number}.npz")
    (tmp_path / "3.npz").write_bytes(b"damaged")
    recordings = RecordingFolder(tmp_path, LAYOUT)
    table = score(model, recordings)
    assert table["error"].ne("").tolist() == [False, False, False, True]
    assert files._recent._bytes == 0
    recordings[0].content()
    assert files._recent._bytes > 0


def test_recordings_do_not_depend_on_the_others_of_their_batch(model):
    """Invalid ones, other conditions, and a defect that is found at the end of the pipeline."""
    speed = {"velocity": SPEED, "meta": {"load": 10}}
    dead = Recording({"vib": np.zeros(N), "amp": X[1].signals["amp"]}, FS, **speed)
    nowhere = Recording(X[2].signals, FS, velocity=SPEED, meta={"load": 70})
    router = ConditionRouter(pipeline(), "load").fit(X, Y)
    mixed = [*X[:3], None, *X[3:7], dead, nowhere, *X[7:9]]
    for estimator, n_failed in ((model, 2), (router, 3)):
        together = score(estimator, mixed)
        alone = [score(estimator, [entry]).to_dict("records")[0] for entry in mixed]
        expected = pd.DataFrame(alone).assign(recording=range(len(mixed)))
        pd.testing.assert_frame_equal(together, expected, rtol=1e-11)
        assert together["error"].ne("").sum() == n_failed


def test_few_large_files_are_in_memory_at_once(model, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_recent", files.Recent(1 << 28))
    ones = np.ones(900_000)  # 22 MB in the three columns
    np.savez(tmp_path / "0.npz", vib=ones, amp=ones, speed=ones)
    held = []

    def source(number):
        held.append(files._recent._bytes)
        path = tmp_path / f"{number}.npz"
        if number:
            os.link(tmp_path / "0.npz", path)
        return open_recording(path, LAYOUT)

    scored_rows(model, [partial(source, number) for number in range(5)], range(5))
    assert held[0] == held[3] == 0
    assert held[4] == held[1] > 0


def test_an_unknown_state_is_explained_in_the_row():
    priors = {"healthy": 0.5, "worn": 0.3, "unknown": 0.2}  # little is proven by 12 groups
    model = pipeline(unknown="unknown", priors=priors)
    model.fit(X, Y, costsensitivegaussianbayes__groups=np.arange(24) // 2)
    found = signals(seed=5)
    found["vib"] = found["vib"] + 30 * np.sin(7.3 * ANGLE)
    new = Recording(found, FS, velocity=found.pop("speed"), meta={"load": 10})
    table = score(model, [X[0], new])
    assert table["decision"].tolist() == ["healthy", "unknown"]
    assert table["P(unknown)"][0] < 0.5 < table["P(unknown)"][1]
    np.testing.assert_allclose(table[["P(healthy)", "P(worn)"]], model.predict_proba([X[0], new]))
    assert table.loc[0, "outside_training"] == ""
    assert re.search(
        r"orders 7 to 7.5 of 'vib' .* above the training", table["outside_training"][1]
    )
