"""Healthy recordings of a unit or a sensor that was not in the training: its baseline."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import signal
from sklearn.base import clone
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    CostSensitiveGaussianBayes,
    EmacmWarning,
    FeatureBaseline,
    Recording,
    add_baseline,
    evaluate,
    load_model,
    outside_training,
    save_model,
    score,
    spectrum_recipe,
)
from emacm.__main__ import main
from emacm.conditions.feature_baseline import left_out_differences
from emacm.machine.rolling import bearing_of
from emacm.models.baselines import evaluated_and_fitted
from emacm.models.scoring import batch_statements
from emacm.simulation.example_files import simulate_pump

FS, STATES = 4000, ("normal", "rub", "unbalance")


def machine(seed, state, unit="A"):
    """Sound through a microphone whose sensitivity and response are those of the unit."""
    rng = np.random.default_rng([seed, STATES.index(state)])
    times, hz = np.arange(8000) / FS, 20 + 10 * rng.random()
    x = 2 * rng.normal(size=8000) + np.exp(0.1 * rng.normal()) * np.sin(2 * np.pi * hz * times)
    x += (state == "unbalance") * 3 * np.sin(2 * np.pi * hz * times)
    band = signal.butter(2, [700, 900], "bandpass", fs=FS, output="sos")
    x += (state == "rub") * signal.sosfilt(band, 6 * rng.normal(size=8000))
    if unit == "B":  # 8 dB less below 100 Hz, 6 dB more around 300 Hz, and 26 dB less in all
        low = signal.butter(1, 100, "highpass", fs=FS, output="sos")
        peak = signal.butter(1, [200, 400], "bandpass", fs=FS, output="sos")
        x = 0.05 * (x + signal.sosfilt(peak, x) - 0.6 * (x - signal.sosfilt(low, x)))
    return Recording({"sound": x}, FS, velocity=2 * np.pi * hz, meta={"unit": unit, "run": seed})


Y = np.repeat(STATES, [12, 8, 6])
X = [machine(seed, state) for seed, state in enumerate(Y)]
RUNS = {"costsensitivegaussianbayes__groups": np.arange(len(Y))}
HEALTHY_B = [machine(seed, "normal", "B") for seed in range(100, 105)]
LATER = np.repeat(STATES, [6, 5, 4])
LATER_B = [machine(seed, state, "B") for seed, state in enumerate(LATER, 200)]


@pytest.fixture(scope="module")
def model():
    plain = spectrum_recipe(max_order=8, revolutions=8)
    relative = FeatureBaseline(plain[:-1], condition="unit", healthy="normal")
    return make_pipeline(relative, plain[-1]).fit(X, Y, **RUNS)


@pytest.mark.parametrize("condition", [None, "unit"])
def test_groups_of_a_recipe_reach_its_bins(condition):
    """Of four groups, no line is known to be new."""
    recipe = spectrum_recipe(max_order=8, revolutions=8)
    if condition:
        relative = FeatureBaseline(recipe[:-1], condition=condition, healthy="normal")
        recipe = make_pipeline(relative, recipe[-1])
    _, recipe, _ = evaluated_and_fitted(recipe, X, Y, np.arange(len(Y)) % 4, "normal")
    tone = X[0].signals["sound"] + 0.5 * np.sin(3.4 * X[0].angle)
    found = Recording({"sound": tone}, FS, velocity=X[0].velocity, meta=X[0].meta)
    assert outside_training(recipe, [found]) == [[]]


def test_a_unit_that_was_not_in_the_training_needs_healthy_recordings_and_says_so(model):
    plain = spectrum_recipe("bands").fit(X, Y, **RUNS)
    assert outside_training(plain, X[:1]) == [[]]
    (first, *_) = outside_training(plain, LATER_B)[0]
    assert first.kind == "new unit"
    assert "unit 'B' was not in the training, which has 'A': give healthy" in first.text
    table = score(plain, LATER_B)
    assert (table["decision"] == "unknown").all()
    assert [statement.kind for statement in table.attrs["statements"]] == ["shift"]
    table = score(model, LATER_B)
    assert table["error"].str.contains("Give healthy recordings of it").all()
    assert table["outside_training"].str.contains("give healthy recordings of this unit").all()


def test_a_baseline_of_a_unit_makes_its_states_known(model, tmp_path):
    with pytest.warns(EmacmWarning, match="as those of another sensor .* times as much as"):
        both = add_baseline(model, HEALTHY_B)
    assert both[0].n_healthy_ == {"A": 12, "B": 5}
    assert model[0].conditions_ == ("A",)
    table = score(both, LATER_B)
    assert (table["decision"] == LATER).mean() > 0.9
    assert not table["outside_training"].str.contains("unit 'B'|below training").any()
    assert table.attrs["statements"] == []
    np.testing.assert_array_equal(both.predict(X), model.predict(X))
    save_model(both, tmp_path / "model.emacm")
    loaded = load_model(tmp_path / "model.emacm")
    np.testing.assert_array_equal(loaded.predict_proba(LATER_B), both.predict_proba(LATER_B))


@pytest.mark.parametrize("state", ["rub", "unbalance"])
def test_a_fault_is_not_hidden_in_a_baseline(model, state):
    faulty = [machine(seed, state) for seed in range(300, 304)]
    faulty = [Recording(r.signals, FS, velocity=r.velocity, meta={"unit": "C"}) for r in faulty]
    with pytest.raises(ValueError, match=f"the 4 recordings of unit='C' .* as those of '{state}'"):
        add_baseline(model, faulty)
    with pytest.warns(EmacmWarning, match="a fault in all of them is not seen"):
        add_baseline(model, [machine(seed, state, "B") for seed in range(300, 304)])
    one_of_them = [*HEALTHY_B, machine(300, state, "B")]
    with pytest.raises(ValueError, match=f"recording 5 .* it is most like '{state}'"):
        add_baseline(model, one_of_them)


def test_another_gain_is_not_taken_for_the_fault_that_raises_a_steady_line():
    rng, spread = np.random.default_rng(0), np.array([0.01] + [0.3] * 19)  # of logarithmic levels

    def levels(state, gain=0.0, unit="A"):
        line = 1.2 * (state == "unbalance") * (np.arange(20) == 0)
        samples = gain + line + spread * rng.normal(size=20)
        return Recording({"a": samples}, 1, velocity=1.0, meta={"unit": unit})

    table = FunctionTransformer(lambda X: np.array([run.signals["a"] for run in X]))
    relative = FeatureBaseline(table, condition="unit", healthy="normal")
    y = ["normal"] * 12 + ["unbalance"] * 12
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    model = make_pipeline(relative, bayes).fit([levels(state) for state in y], y)
    both = add_baseline(model, [levels("normal", 0.9, "B") for _ in range(4)])
    assert both[0].n_healthy_ == {"A": 12, "B": 4}
    with pytest.raises(ValueError, match="as those of 'unbalance' do"):
        add_baseline(model, [levels("unbalance", 0.9, "B") for _ in range(4)])


def test_lines_of_a_fault_are_not_hidden_in_a_baseline():
    def pump(seed, state, unit):
        made = simulate_pump(state, np.random.default_rng(seed), duration=4)
        speed = made["speed [rpm]"] * np.pi / 30
        x = {"vibration": made["vibration [g]"]}
        return Recording(x, 4000, velocity=speed, meta={"unit": unit})

    states = np.repeat(["healthy", "outer"], [6, 5])
    plain = spectrum_recipe("bands", unknown=None, temperature=None)
    model = make_pipeline(FeatureBaseline(plain[:-1], condition="unit"), plain[-1])
    model.fit([pump(seed, state, "A") for seed, state in enumerate(states)], states)
    with pytest.raises(ValueError, match=r"is not healthy: its channel 'vibration' has lines of B"):
        add_baseline(model, [pump(20, "outer", "B")], parts=bearing_of("6205"))
    healthy = [pump(seed, "healthy", "B") for seed in range(21, 24)]
    assert add_baseline(model, healthy, parts=bearing_of("6205"))[0].n_healthy_["B"] == 3


@pytest.mark.parametrize("covariance", ["full", "diag"])
def test_other_classifiers_look_for_faults_in_a_baseline_too(model, covariance):
    other = CostSensitiveGaussianBayes(covariance=covariance, shrinkage=0.5)
    other = make_pipeline(clone(model[0]), StandardScaler(), other).fit(X, Y)
    with pytest.raises(ValueError, match="as those of 'unbalance' do"):
        add_baseline(other, [machine(seed, "unbalance", "A") for seed in range(300, 304)])


def test_a_model_without_a_baseline_is_refused():
    plain = spectrum_recipe("bands", unknown=None, temperature=None).fit(X, Y)
    with pytest.raises(TypeError, match=r"the model has no baseline.*emacm train --baseline"):
        add_baseline(plain, HEALTHY_B)


def test_healthy_recordings_left_out_of_their_mean_scatter_like_new_ones():
    rng = np.random.default_rng(0)
    values, units = rng.normal(size=(4000, 2)) + 7, np.repeat(np.arange(1000), 4)
    differences = left_out_differences(values, units, np.full(4000, True))
    assert differences.var() == pytest.approx(1 + 1 / 3, rel=0.03)
    with pytest.raises(ValueError, match="'B' has 1 healthy recordings, but at least two"):
        left_out_differences(values[:3], ["A", "A", "B"], np.full(3, True))


def test_few_or_mixed_recordings_are_no_shift():
    assert batch_statements([0.01] * 9) == []
    assert batch_statements([0.1] * 7 + [0.9] * 3 + [np.nan] * 90) == []
    assert batch_statements([0.1] * 8 + [0.9] * 2)[0].value == 0.8


def test_evaluate_says_what_helps_where_new_units_are_decided_worse():
    rng = np.random.default_rng(1)
    units = np.repeat(np.arange(12), 8)
    y = np.tile(["normal", "rub"], 48)
    features = 4 * rng.normal(size=(12, 6))[units] + 0.3 * rng.normal(size=(96, 6))
    features[:, 0] += y == "rub"
    classifier = KNeighborsClassifier(1)  # which recognises the unit
    caveats = evaluate(classifier, features, y, units=units, healthy="normal").caveats
    assert any("give healthy recordings of each" in text for text in caveats)
    relative = left_out_differences(features, units, y == "normal")
    better = evaluate(classifier, relative, y, units=units, healthy="normal").caveats
    assert not any("give healthy recordings of each" in text for text in better)


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Write files of six microphones that differ, and stand in their folder."""
    pytest.importorskip("skops", reason="skops is not installed (extra 'models')")
    monkeypatch.chdir(tmp_path)
    for folder in ("train", "new", "healthy"):
        Path(folder).mkdir()
    for unit in range(7):
        rng = np.random.default_rng([9, unit])
        edges, gains = 10 ** rng.uniform(2.4, 3.1, 3), 10 ** rng.uniform(0, 1.2, 3)
        peaks = [signal.butter(2, [f, 1.3 * f], "bandpass", fs=FS, output="sos") for f in edges]
        for state, n_runs in zip(STATES, (5, 3, 2), strict=True):
            for run in range(n_runs):
                recording = machine(100 * unit + run, state)
                x = recording.signals["sound"]
                for peak, gain in zip(peaks, gains, strict=True):
                    x = x + gain * signal.sosfilt(peak, x)
                folders = ["train"] if unit < 6 else ["new"]
                folders = ["healthy"] if unit == 6 and state == "normal" and run < 3 else folders
                for folder in folders:
                    name = f"{folder}/M{unit}_{state}_{run}.npz"
                    np.savez(name, sound=x, rpm=recording.velocity * 30 / np.pi)
    Path("layout.toml").write_text(
        'fs = 4000\nvelocity = "rpm"\nmeta = "{unit}_{state}_{run:d}"\n[units]\nrpm = "rpm"\n'
    )


def emacm(*words):
    return main([word for part in words for word in part.split()])


@pytest.mark.filterwarnings(
    "ignore:.*a fault in all of them is not seen"
)  # of a microphone that differs much
def test_the_command_line_trains_with_a_baseline_and_adds_one(files, capsys):
    train = "train layout.toml train --labels state --groups unit --max-order 8 --revolutions 8"
    assert emacm(train, "--out plain.emacm --features both") == 0
    printed = capsys.readouterr().out
    assert "This holds for recordings like those that were left out, each unit in turn" in printed
    assert "cost above that of 'both'" in printed
    assert "- Relative to healthy recordings of the same unit the decisions cost less" in printed
    options = "--out model.emacm --features both --healthy-label normal --baseline unit"
    assert emacm(train, options) == 0
    printed = capsys.readouterr().out
    assert "Healthy recordings in the baseline of each unit: M0: 5, M1: 5" in printed
    score_new = "score model.emacm new --layout layout.toml"
    assert emacm(score_new) == 3  # of a new unit without healthy files
    assert "Give healthy recordings of it" in capsys.readouterr().out
    assert emacm(score_new, "--healthy healthy --out made.csv --report pages") == 0
    assert "unit='M6': a baseline of 3 healthy files." in capsys.readouterr().err
    made = pd.read_csv("made.csv")
    for recording, decision in zip(made["recording"], made["decision"], strict=True):
        html = Path(f"pages/{Path(recording).stem}.html").read_text(encoding="utf-8")
        assert f"<strong>{decision}</strong>" in html
    right = [name.split("_")[1] == d for name, d in made[["recording", "decision"]].to_numpy()]
    assert np.mean(right) > 0.8
    assert emacm("score plain.emacm new --layout layout.toml --healthy healthy") == 2
    assert emacm("verify model.emacm --layout layout.toml --data train") == 0
