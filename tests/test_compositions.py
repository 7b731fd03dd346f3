"""Promises that survive composition: each cell of the table in notebooks/compositions.md is tried.

"kept": the promise holds there as it does in a `Pipeline`. "refused": an error names the remedy.
"""

import re
from copy import deepcopy
from functools import cache, partial
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
import sklearn
from sklearn.calibration import CalibratedClassifierCV
from sklearn.compose import ColumnTransformer, make_column_selector
from sklearn.frozen import FrozenEstimator
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_predict
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import FunctionTransformer

import emacm
from emacm.decisions.pipelines import parts_of
from emacm.machine.rolling import bearing_of
from emacm.simulation.example_files import simulate_pump

PAGE = Path(__file__).parents[1] / "notebooks" / "compositions.md"
FS, SPEED, N = 3_000, 47.0, 12_000  # 30 revolutions in 4 s
STATES = ("healthy", "inner", "outer")


def prices(inspection):
    """Return unequal costs; rows are decisions."""
    costs = [[0, 20, 8], [0.9, 0, 3], [2, 5, 0], [inspection] * 3]
    return pd.DataFrame(costs, index=[*STATES, "inspect"], columns=STATES)


def run(seed, state="healthy", *, gain=1, noise=0, line=0, factor=1, unit="g", second=0, load=20):
    """Two channels at nearly constant speed; an inner fault is a line at order 3.4, outer 5.6."""
    rng = np.random.default_rng([seed, STATES.index(state)])
    velocity = SPEED * (1 + 0.02 * np.sin(2 * np.pi * np.arange(N) / N))
    angle = np.cumsum(velocity) / FS
    level = np.exp(0.15 * rng.standard_normal(3))
    vibration = 0.3 * rng.standard_normal(N) + line * np.sin(9.25 * angle)
    for order, size in ((3.4, state == "inner"), (5.6, state == "outer" or second)):
        vibration += (0.1 + 0.9 * level[0] * size) * np.sin(order * angle)
    current = 15 * level[1] * np.cos(7 * angle) + 2 * level[2] * rng.standard_normal(N)
    if noise:  # of the converter alone: the sensor has no signal
        vibration = noise * rng.standard_normal(N)
    signals = {"vibration": gain * vibration, "current": current}
    units, meta = {"vibration": unit, "current": "A"}, {"load": load, "unit": seed}
    return emacm.Recording(signals, FS, velocity=factor * velocity, units=units, meta=meta)


GROUPS = np.repeat(np.arange(10), 3)
Y = np.tile(STATES, 10)
X = [run(int(group), state) for group, state in zip(GROUPS, Y, strict=True)]
LIKE_NOTHING, WITH_LINE, LOUD = run(50, gain=7), run(50, line=0.3), run(50, gain=10)
DEAD = [run(50, "inner", noise=1e-6), run(51, "outer", noise=1e-6)]
IN_RPM, IN_MV = run(50, factor=30 / np.pi), run(50, unit="mV")
TWO_FAULTS = [run(seed, "inner", second=0.1) for seed in (50, 51, 52)]


def bayes(**options):
    given = {"covariance": "tied", "shrinkage": "auto", "unknown": "unknown", "unknown_rate": 0.02}
    return emacm.CostSensitiveGaussianBayes(
        **given | {"temperature": "groups", "cost": prices(0.5)} | options
    )


def bins():
    log = FunctionTransformer(np.log10, feature_names_out="one-to-one")
    return make_pipeline(emacm.BinTransformer(1, max_order=12), log)


def features(*channels):
    return make_pipeline(
        emacm.OrderResampler(2 * np.pi / 32, channels=channels or None), emacm.OrderPSD(4), bins()
    )


def pipeline(**options):
    return make_pipeline(features(), bayes(**options))


def by_columns():
    selected = [(name, bins(), make_column_selector(name)) for name in ("vibration", "current")]
    spectra = make_pipeline(emacm.OrderResampler(2 * np.pi / 32), emacm.OrderPSD(4)).set_output(
        transform="pandas"
    )
    return make_pipeline(spectra, ColumnTransformer(selected), bayes())


def bands():
    log = FunctionTransformer(np.log10, feature_names_out="one-to-one")
    return make_pipeline(emacm.BandPowers(), log)


def by_channel(make):
    return [(name, make(name)) for name in ("vibration", "current")]


def calibrated(**options):
    inner = pipeline(cost=None, temperature=None, **options)
    return emacm.LeastRiskClassifier(CalibratedClassifierCV(inner, cv=3), prices(0.5))


MODELS = {
    "Pipeline": pipeline,
    "FeatureUnion(n_jobs=2)": lambda: make_pipeline(
        FeatureUnion(by_channel(features), n_jobs=2), bayes()
    ),
    "BandPowers": lambda: make_pipeline(bands(), bayes()),
    "orders and BandPowers": lambda: make_pipeline(
        FeatureUnion([("orders", features()), ("bands", bands())]), bayes()
    ),
    "FeatureBaseline": lambda: make_pipeline(
        emacm.FeatureBaseline(features(), condition="load"), bayes()
    ),
    "ColumnTransformer": by_columns,
    "PosteriorProduct": lambda: emacm.PosteriorProduct(
        by_channel(lambda name: make_pipeline(features(name), bayes(cost=None))), prices(0.5)
    ),
    "LeastRiskClassifier": lambda: emacm.LeastRiskClassifier(pipeline(cost=None), prices(0.5)),
    "ConditionRouter": lambda: emacm.ConditionRouter(pipeline(), "load"),
    "NewUnitClassifier": lambda: make_pipeline(
        features(), emacm.NewUnitClassifier(prices(0.5), unknown="unknown", temperature="groups")
    ),
    "CalibratedClassifierCV": lambda: calibrated(unknown=None, unknown_rate=None),
    "GridSearchCV": lambda: GridSearchCV(
        pipeline(), {"pipeline__pipeline__bintransformer__bin_size": [1, 2]}, cv=GroupKFold(2)
    ),
    "joblib": pipeline,
    "skops": pipeline,
}


@cache
def fitted(name, n_groups=10):
    """Fit a model; the groups are given once."""
    with sklearn.config_context(enable_metadata_routing=True):
        return MODELS[name]().fit(X, Y, groups=GROUPS % n_groups)


@pytest.fixture
def model(composition, tmp_path):
    if composition == "joblib":
        joblib.dump(fitted(composition), tmp_path / "model.joblib")
        return joblib.load(tmp_path / "model.joblib")
    if composition == "skops":
        emacm.save_model(fitted(composition), tmp_path / "model.skops")
        return emacm.load_model(tmp_path / "model.skops")
    return fitted(composition if composition in MODELS else "Pipeline")


@pytest.fixture
def model_of_all():
    return deepcopy(fitted("Pipeline"))


def stated(model, recording):
    return {(s.kind, s.channel) for s in emacm.outside_training(model, [recording])[0]}


def classifiers(model):
    """Return the Gaussian classifiers of a model."""
    return [part for part in parts_of(model) if hasattr(part, "covariances_")]


def reading(model, recording):
    monitor = emacm.OrderMonitor(model, fs=FS, channels=recording.channels, max_speed=900.0)
    monitor.push(dict(recording.signals), velocity=recording.velocity)
    return monitor.flush()[-1]


def unknown_state(model):
    assert model.predict([LIKE_NOTHING, X[1]]).tolist() == ["unknown", "inner"]
    if not any(isinstance(part, ColumnTransformer) for part in parts_of(model)):
        reason = emacm.score(model, [LIKE_NOTHING])["outside_training"][0]
        assert "dB above the training maximum" in reason


def dead_channel(model):
    assert not set(model.predict(DEAD)) & set(STATES)


def new_line(model):
    assert stated(model, WITH_LINE) == {("new line", "vibration")}
    assert stated(model, X[0]) == set()


def outside_the_range(model):
    assert ("level", "vibration") in stated(model, LOUD)


def wrong_speed(model):
    assert ("speed", "") in stated(model, IN_RPM)


def costs_by_name(model):
    before, inner = model.predict_proba(X[:3]), getattr(model, "best_estimator_", model)
    name = min((key for key in inner.get_params() if key.endswith("cost")), key=len)
    try:
        for price, is_cheap in ((1e-6, True), (100, False)):
            inner.set_params(**{name: prices(price)})
            assert ((model.predict(X[:3]) == "inspect") == is_cheap).all()
            np.testing.assert_array_equal(model.predict_proba(X[:3]), before)
    finally:
        inner.set_params(**{name: prices(0.5)})


def units_of_channels(model):
    assert ("unit", "vibration") in stated(model, IN_MV)


def typicality(model):
    known, other = emacm.score(model, [X[0], LIKE_NOTHING])["typicality"]
    assert known > 0.02 > other


def second_state(model):
    for row in emacm.score(model, TWO_FAULTS).itertuples():
        assert row.decision == "unknown" or "as of 'outer'" in row.outside_training


def calibrated_temperature(model):
    assert all(classifier.temperature_ != 1 for classifier in classifiers(model))


CHECKS = {
    "unknown state": unknown_state,
    "dead channel": dead_channel,
    "new line": new_line,
    "outside the range": outside_the_range,
    "wrong speed": wrong_speed,
    "costs by name": costs_by_name,
    "units of channels": units_of_channels,
    "typicality": typicality,
    "second state": second_state,
    "calibrated temperature": calibrated_temperature,
}


def table_of(columns):
    """Return the cells of the page's table that has some columns, by promise and composition."""
    rows = [
        re.split(r" *\| *", line)[1:-1] for line in PAGE.read_text().splitlines() if "|" in line
    ]
    head = next(k for k, row in enumerate(rows) if row[0] == "promise" and columns in row[1])
    names = [name.replace("`", "") for name in rows[head]]
    cells = {}
    for row in rows[head + 2 :]:
        if row[0] == "promise":
            break
        cells |= {(row[0], name): cell for name, cell in zip(names[1:], row[1:], strict=True)}
    return cells


MADE, USED = table_of("Pipeline"), table_of("cross_val_predict")
KEPT = [cell for cell, word in MADE.items() if word == "kept"]


def test_the_table_has_every_promise_and_every_composition():
    assert (
        {promise for promise, _ in MADE} == {promise for promise, _ in USED} == {*CHECKS, "groups"}
    )
    assert {name for _, name in MADE} == set(MODELS)
    assert {*MADE.values(), *USED.values()} == {"kept", "refused", "–"}


@pytest.mark.parametrize(("promise", "composition"), [cell for cell in KEPT if cell[0] != "groups"])
def test_a_promise_is_kept(promise, composition, model):
    CHECKS[promise](model)


@pytest.mark.parametrize("composition", [name for promise, name in KEPT if promise == "groups"])
def test_groups_given_once_reach_all_that_learn_from_them(composition):
    """That a classifier lacks groups is a warning; of four groups, no line is known to be new."""
    assert stated(fitted(composition, n_groups=4), WITH_LINE) == set()


def test_what_is_refused_names_the_remedy():
    refused = [cell for cell, word in (MADE | USED).items() if word == "refused"]
    assert refused == [
        ("unknown state", "CalibratedClassifierCV"),
        ("costs by name", "cross_val_predict"),
    ]
    with pytest.raises(ValueError, match=r'loses the unknown state .*temperature="groups"'):
        calibrated(unknown="unknown").fit(X, Y)
    with pytest.raises(ValueError, match=r"priors outside: LeastRiskClassifier.*needs no costs"):
        cross_val_predict(pipeline(), X, Y, method="predict_proba", cv=2)


def test_cross_val_predict():
    labels, groups = [*Y, "healthy", "inner"], [*GROUPS, 10, 10]
    with sklearn.config_context(enable_metadata_routing=True):
        options = {"cv": GroupKFold(11), "params": {"groups": groups}}
        found = cross_val_predict(pipeline(), [*X, LIKE_NOTHING, DEAD[0]], labels, **options)
    assert found[-2] == "unknown"
    assert found[-1] not in STATES


def test_score_in_two_processes(model_of_all):
    with joblib.parallel_config("loky"):
        table = emacm.score(
            model_of_all, [LIKE_NOTHING, *DEAD, WITH_LINE, LOUD, IN_RPM, IN_MV], n_jobs=2
        )
    assert table["decision"][0] == "unknown"
    assert not set(table["decision"][1:3]) & set(STATES)
    assert (table["typicality"][:3] < 0.02).all()
    for row, text in enumerate(("order 9.25", "dB above training", "in rpm", "is in mV"), 3):
        assert text in table["outside_training"][row]
    model_of_all.set_params(costsensitivegaussianbayes__cost=prices(1e-6))
    assert emacm.score(model_of_all, X[:1])["decision"].tolist() == ["inspect"]


def test_maintenance_report(model_of_all, tmp_path):
    def page(recording):
        (file, _) = emacm.maintenance_report(model_of_all, [recording], tmp_path / "pages")
        return file.read_text(encoding="utf-8")

    assert "unlike all states" in page(LIKE_NOTHING)
    assert "fewer than 1 in 100 training recordings" in page(LIKE_NOTHING)
    assert not any(f"decided: {state}" in page(DEAD[0]) for state in STATES)
    for recording, text in (
        (WITH_LINE, "order 9.25"),
        (LOUD, "dB above training"),
        (IN_MV, "is in mV"),
    ):
        assert text in page(recording)
    assert "is it in rpm" in page(IN_RPM)
    assert any("as of &#39;outer&#39;" in page(x) or "unlike all" in page(x) for x in TWO_FAULTS)
    assert "not calibrated" not in page(X[0])
    model_of_all.set_params(costsensitivegaussianbayes__cost=prices(1e-6))
    assert "has the lowest expected cost" in page(X[0])


def test_order_monitor(model_of_all):
    found = partial(reading, model_of_all)
    assert found(LIKE_NOTHING).decision == "unknown"
    assert found(LIKE_NOTHING).typicality < 0.02 < found(X[0]).typicality
    assert found(DEAD[0]).decision not in STATES
    for recording, kind in ((WITH_LINE, "new line"), (LOUD, "level"), (IN_RPM, "speed")):
        assert kind in {statement.kind for statement in found(recording).outside_training}
    for second in map(found, TWO_FAULTS):
        kinds = {statement.kind for statement in second.outside_training}
        assert second.decision == "unknown" or "second state" in kinds
    model_of_all.set_params(costsensitivegaussianbayes__cost=prices(1e-6))
    assert found(X[0]).decision == "inspect"


def test_order_monitor_of_a_search_after_the_spectra():
    search = GridSearchCV(
        make_pipeline(bins(), bayes(unknown="new")),
        {"pipeline__bintransformer__bin_size": [1, 2]},
        cv=GroupKFold(2),
    )
    model = make_pipeline(emacm.OrderResampler(2 * np.pi / 32), emacm.OrderPSD(4), search)
    with sklearn.config_context(enable_metadata_routing=True):
        found = reading(model.fit(X, Y, groups=GROUPS), LIKE_NOTHING)
    assert found.decision == "new"
    assert found.alarms == ("unknown state",)
    assert found.typicality < 0.02 < found.unknown_proba
    assert found.expected_cost == 0.5


@pytest.mark.parametrize(
    "columns",
    [slice(65), list(range(65)), np.arange(130) < 65, slice("vibration@0", "vibration@16")],
)
def test_a_new_line_is_stated_of_columns_in_any_form(columns):
    model = by_columns()
    # The remainder, the current, is given by positions.
    model[1].set_params(transformers=[("first", bins(), columns)], remainder=bins())
    with sklearn.config_context(enable_metadata_routing=True):
        new_line(model.fit(X, Y, groups=GROUPS))


FROZEN = {
    "as a whole": lambda model: FrozenEstimator(model),
    "with other costs": lambda model: emacm.LeastRiskClassifier(
        FrozenEstimator(model), prices(0.5)
    ).fit(X, Y),
    "as features": lambda model: make_pipeline(FrozenEstimator(model[:-1]), bayes()).fit(
        X, Y, costsensitivegaussianbayes__groups=GROUPS
    ),
}


@pytest.mark.parametrize("part", FROZEN)
def test_a_frozen_model_keeps_its_promises(part):
    model = FROZEN[part](fitted("Pipeline"))
    for check in (unknown_state, dead_channel, new_line, typicality, second_state):
        check(model)


ROUTERS = {
    "behind the resampler": lambda: make_pipeline(
        emacm.OrderResampler(2 * np.pi / 32),
        emacm.ConditionRouter(make_pipeline(emacm.OrderPSD(4), bins(), bayes())),
    ),
    "of routers": lambda: emacm.ConditionRouter(
        emacm.ConditionRouter(pipeline()), lambda recording: recording.meta["unit"] % 2
    ),
}


@pytest.mark.parametrize("place", ROUTERS)
def test_each_recording_of_a_batch_is_decided_for_its_condition(place):
    heavy = [run(int(unit), state, gain=2, load=40) for unit, state in zip(GROUPS, Y, strict=True)]
    with sklearn.config_context(enable_metadata_routing=True):
        model = ROUTERS[place]().fit([*X, *heavy], [*Y, *Y], groups=[*GROUPS, *GROUPS])
    new = [run(50, "inner"), run(50, "inner", gain=2, load=40), run(50), run(50, gain=2, load=40)]
    decided = ["inner", "inner", "healthy", "healthy"]
    assert emacm.score(model, new)["decision"].tolist() == model.predict(new).tolist() == decided
    assert stated(model, run(50, gain=2, load=40, line=0.3)) == {("new line", "vibration")}
    (name,) = (key for key in model.get_params() if key.endswith("bayes__cost"))
    model.set_params(**{name: prices(1e-6)})
    assert emacm.score(model, new)["decision"].tolist() == model.predict(new).tolist()
    assert {*model.predict(new)} == {"inspect"}


@pytest.mark.parametrize("with_healthy", [False, True])
def test_find_faults(with_healthy):
    def pump(seed, state, factor=1.0, gain=1.0):
        made = simulate_pump(state, np.random.default_rng(seed), duration=4)
        speed = factor * made["speed [rpm]"] * np.pi / 30
        return emacm.Recording({"vibration": gain * made["vibration [g]"]}, 4000, velocity=speed)

    healthy = [pump(seed, "healthy") for seed in range(3)] if with_healthy else None
    faulty = [pump(10, "outer"), pump(10, "outer", 1.06), pump(10, "outer", gain=0.0)]
    named = emacm.find_faults(faulty, bearing_of("6205"), healthy=healthy)["named"].tolist()
    assert named == ["BPFO", "not assessed", "not assessed"]
