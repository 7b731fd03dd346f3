"""Explanations add up, obey invariances, and reveal a confounded model."""

from itertools import cycle

import numpy as np
import pandas as pd
import pytest
from sklearn.decomposition import PCA, KernelPCA, TruncatedSVD
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.feature_selection import SelectKBest, VarianceThreshold
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import FeatureUnion, make_pipeline
from sklearn.preprocessing import (
    FunctionTransformer,
    Normalizer,
    PowerTransformer,
    QuantileTransformer,
    StandardScaler,
)

from emacm import (
    BinTransformer,
    CostSensitiveGaussianBayes,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    explain_decision,
    explain_model,
    fault_orders,
    match_fault_orders,
)

CHANNELS = ("current", "vibration")
COLUMNS = [f"{channel}@{low}-{low + 1}" for channel in CHANNELS for low in range(4)]
COVARIANCES = ("full", "tied", "diag")


def powers(seed=0, n_classes=3, n_each=15):
    """Make positive powers in bins, correlated, of several classes."""
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(8, 8)) / 2
    rows, labels = [], []
    for k in range(n_classes):
        centre = rng.normal(scale=1.5, size=8)
        rows.append(centre + rng.normal(size=(n_each, 8)) @ (mixing + np.eye(8)))
        labels += [f"state {k}"] * n_each
    return pd.DataFrame(10 ** (np.concatenate(rows) / 3), columns=COLUMNS), np.array(labels)


def log():
    return FunctionTransformer(np.log10, feature_names_out="one-to-one")


def chains():
    return {
        "none": [],
        "log": [log()],
        "log and scaler": [log(), StandardScaler()],
        "PCA": [log(), StandardScaler(), PCA(3)],
        "whitened PCA, scaled": [log(), PCA(3, whiten=True), StandardScaler()],
        "all components": [log(), PCA(8)],
        "LDA": [log(), StandardScaler(), LinearDiscriminantAnalysis()],
        "SVD": [TruncatedSVD(4, random_state=0)],
        "best few": [log(), SelectKBest(k=5), StandardScaler()],
        "best few, projected": [log(), SelectKBest(k=5), PCA(2), VarianceThreshold()],
        "power and quantile": [PowerTransformer(), QuantileTransformer(n_quantiles=10)],
        "pipeline within": [make_pipeline(log(), StandardScaler()), "passthrough", PCA(2)],
    }


def fitted(chain, covariance="full", cost=None, seed=0):
    X, y = powers(seed)
    classifier = CostSensitiveGaussianBayes(cost, covariance=covariance, shrinkage=0.1)
    return make_pipeline(*chains()[chain], classifier).fit(X, y), X, y


def adds_up(table):
    rise = table.attrs["value"] - table.attrs["baseline_value"]
    size = table["contribution"].abs().sum() + 1
    assert table["contribution"].sum() == pytest.approx(rise, rel=1e-9, abs=1e-9 * size)


@pytest.mark.slow
@pytest.mark.parametrize(("chain", "covariance"), zip(chains(), cycle(COVARIANCES), strict=False))
def test_contributions_add_up_to_the_log_odds(chain, covariance):
    model, X, y = fitted(chain, covariance)
    for row in (3, 40):
        for background in (None, X[y == "state 1"]):
            table = explain_decision(
                model, X.iloc[[row]], decision="state 0", against="state 1", background=background
            )
            features = model[:-1].transform(X.iloc[[row]]) if len(model) > 1 else X.iloc[[row]]
            joint = model[-1].predict_joint_log_proba(features)[0]
            assert table.attrs["value"] == pytest.approx(joint[0] - joint[1], rel=1e-9)
            adds_up(table)
            assert len(table) == len(COLUMNS)
            assert table["share"].sum() == pytest.approx(1)


def test_contributions_are_the_integral_of_the_gradient():
    # An independent way: differences of the pipeline's own log odds, summed along the line.
    model, X, _ = fitted("PCA")
    table = explain_decision(model, X.iloc[[3]]).set_index("column")["contribution"]
    classes = model.classes_.tolist()
    odds = explain_decision(model, X.iloc[[3]]).attrs
    pair = classes.index(odds["decision"]), classes.index(odds["against"])
    scaled = model[:2].transform(X.iloc[[3]])
    features = model[2].transform(scaled)
    start = scaled - (features - model[-1].means_[pair[1]]) @ model[2].components_
    line = np.asarray(scaled - start)[0]

    def log_odds(point):
        joint = model[-1].predict_joint_log_proba(model[2].transform(point))
        return joint[:, pair[0]] - joint[:, pair[1]]

    shares = (np.arange(200) + 0.5) / 200
    points = np.asarray(start) + shares[:, np.newaxis] * line
    for j, column in enumerate(COLUMNS):
        nudge = 1e-4 * np.eye(8)[j]
        slopes = (log_odds(points + nudge) - log_odds(points - nudge)) / 2e-4
        assert table[column] == pytest.approx(slopes.mean() * line[j], rel=1e-6, abs=1e-8)


def test_the_default_alternative_is_the_most_probable_other_class():
    model, X, _ = fitted("log and scaler")
    table = explain_decision(model, X.iloc[[20]])
    order = np.argsort(model.predict_proba(X.iloc[[20]])[0])
    assert table.attrs["decision"] == model.predict(X.iloc[[20]])[0]
    assert table.attrs["against"] == model.classes_[order[-2]]
    assert table.attrs["baseline"] == table.attrs["against"]


@pytest.mark.parametrize("covariance", COVARIANCES)
@pytest.mark.parametrize("projection", [[], [PCA(2)], [LinearDiscriminantAnalysis()]])
def test_a_bin_without_difference_and_correlation_contributes_nothing(covariance, projection):
    # Each recording comes twice, with a third bin once low and once high: in both classes the same.
    pairs = np.random.default_rng(1).normal(size=(12, 2)) * [3, 2]
    pairs[6:] += [4, -2]
    idle = np.repeat([-1.0, 1.0], 12)
    X = pd.DataFrame(np.column_stack([np.tile(pairs, (2, 1)), idle]), columns=COLUMNS[:3])
    y = np.tile(np.repeat(["healthy", "worn"], 6), 2)
    model = make_pipeline(*projection, CostSensitiveGaussianBayes(covariance=covariance)).fit(X, y)
    table = explain_decision(model, X.iloc[[3]]).set_index("column")["contribution"]
    assert abs(table[COLUMNS[2]]) < 1e-10 * table.abs().max()
    whole = explain_model(model, X, y).set_index("column")["contribution"]
    assert whole[COLUMNS[2]] < 1e-10 * whole.max()
    assert whole.drop(COLUMNS[2]).min() > 1e-3 * whole.max()


def test_instead_of_a_decision_that_is_no_class_the_two_most_probable_ones_are_compared():
    costs = {("inspect", f"state {k}"): 1e-9 for k in range(3)}
    model, X, _ = fitted("PCA", cost=costs)
    assert model.predict(X.iloc[[20]])[0] == "inspect"
    ranked = model.classes_[np.argsort(-model.predict_proba(X.iloc[[20]])[0])]
    table = explain_decision(model, X.iloc[[20]])
    assert [table.attrs["decision"], table.attrs["against"]] == ranked[:2].tolist()
    adds_up(table)


def test_with_true_classes_their_means_are_the_baselines():
    model, X, y = fitted("PCA")
    X, y = X.iloc[::4], y[::4]
    whole = explain_model(model, X, y).set_index("column")
    pair = (y == "state 0", y == "state 1")
    assert whole["contribution"].is_monotonic_decreasing
    found = [
        explain_decision(
            model, X.iloc[[row]], decision=y[row], against=y[other][0], background=X[other]
        )
        .set_index("column")["contribution"]
        .abs()
        for own, other in (pair, pair[::-1])
        for row in np.flatnonzero(own)
    ]
    mean = pd.concat(found, axis=1).mean(axis=1).loc[whole.index]
    assert np.allclose(whole["state 0 vs state 1"], mean)


# A confounded rig, as in section 4.5: each unit is one class. The healthy unit has electrical
# noise in its position signal at orders 12 and 36; the degraded one a bearing defect at 6.123.


def rig_recording(state, seed):
    rng = np.random.default_rng([seed, state == "degraded"])
    time = np.arange(12_000) / 2_000
    speed = 2 * np.pi * (9 + 3 * np.sin(2 * np.pi * (0.2 + 0.1 * rng.random()) * time))  # rad/s
    angle = np.cumsum(speed) / 2_000
    noise = 0.3 * rng.standard_normal((2, len(time)))
    gain = 1 + 0.1 * rng.standard_normal()
    position = noise[0] + 0.5 * np.sin(angle)
    vibration = noise[1] + 0.5 * np.sin(angle)
    if state == "healthy":
        position += gain * (0.3 * np.sin(12 * angle) + 0.3 * np.sin(36 * angle))
    else:
        vibration += gain * sum(0.3 * np.sin(k * 6.123 * angle) for k in (1, 2, 3))
    return Recording({"position": position, "vibration": vibration}, 2_000, velocity=speed)


@pytest.fixture(scope="module")
def rig():
    states = np.repeat(["healthy", "degraded"], 12)
    return [rig_recording(state, seed) for seed, state in enumerate(states)], states


def rig_pipeline(channel):
    return make_pipeline(
        OrderResampler(2 * np.pi / 128, channels=[channel]),
        OrderPSD(16),
        # Harmonics of the bearing in the middle of a bin; 12 and 36 lie well inside, too.
        BinTransformer(edges=(np.arange(2, 150) + 0.5) * 6.123 / 24),
        log(),
        PCA(2),
        CostSensitiveGaussianBayes(shrinkage="oas"),
    )


@pytest.fixture(scope="module")
def rig_models(rig):
    return {channel: rig_pipeline(channel).fit(*rig) for channel in ("position", "vibration")}


@pytest.fixture(scope="module")
def predicted():
    return fault_orders({"BPFI": 6.123}, harmonics=6)


DEFECT, NOISE = (6.123, 12.246, 18.369), (12.0, 36.0)


def orders_of(table, orders):
    """Tell which of the orders lie in each bin of a table."""
    edges = table[["low", "high"]].to_numpy()
    return [[order for order in orders if low <= order < high] for low, high in edges]


def holds_exactly(leading, orders):
    return sorted(orders_of(leading, orders)) == [[order] for order in orders]


def test_the_model_of_the_noisy_channel_is_exposed(rig, rig_models, predicted):
    table = explain_model(rig_models["position"], *rig)
    assert holds_exactly(table[:2], NOISE)
    assert set(table["channel"]) == {"position"}
    assert table["share"][:2].sum() > 0.5
    matched = match_fault_orders(table, predicted, slip=0.005)
    assert list(matched["fault"][:2]) == ["none", "none"]
    assert matched.attrs["predicted_share"] < matched.attrs["predicted_bins"]


def test_the_model_of_the_bearing_channel_is_confirmed(rig, rig_models, predicted):
    table = explain_model(rig_models["vibration"], *rig)
    assert holds_exactly(table[:3], DEFECT)
    matched = match_fault_orders(table, predicted, slip=0.005)
    assert set(matched["fault"][:3]) == {"BPFI", "2xBPFI", "3xBPFI"}
    assert matched.attrs["predicted_share"] > 0.5 > 3 * matched.attrs["predicted_bins"]


def test_recordings_and_their_table_of_bins_have_the_same_explanation(rig, rig_models):
    model = rig_models["vibration"]
    whole = explain_decision(model, [rig[0][3]])
    X = pd.DataFrame(model[:3].transform(rig[0]), columns=model[2].get_feature_names_out())
    behind = make_pipeline(log(), PCA(2), CostSensitiveGaussianBayes(shrinkage="oas"))
    behind.fit(X, rig[1])
    for row in (X.iloc[3], X.iloc[[3]]):
        table = explain_decision(behind, row)
        pd.testing.assert_frame_equal(table, whole)


def knocking(seed, knocks):
    """A screw drive out and back; where it knocks, the current peaks on the way out."""
    rng = np.random.default_rng(seed)
    speed = np.repeat([0.0, 60.0, 0.0, -60.0], 500)
    current = 3 + rng.normal(size=2000)
    if knocks:
        current[rng.integers(500, 1000, 5)] = 30
    return Recording({"current": current}, 500, velocity=speed)


def named_features(*between, log_names="one-to-one"):
    bins = make_pipeline(
        OrderResampler(2 * np.pi / 16),
        OrderPSD(2, by_direction=True),
        BinTransformer(1, max_order=6),
        FunctionTransformer(np.log10, feature_names_out=log_names),
    )
    union = FeatureUnion([("psd", bins), ("levels", RecordingStatistics(("mean", "kurtosis")))])
    classifier = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    return make_pipeline(union, *between, classifier)


KNOCKING = [knocking(seed, seed % 2) for seed in range(24)]
KNOCKS = np.array(["smooth", "knocking"] * 12)


@pytest.mark.parametrize("between", [(), (StandardScaler(),), (StandardScaler(), PCA(5))])
def test_several_kinds_of_features_are_explained_by_their_names(between):
    model = named_features(*between).fit(KNOCKING, KNOCKS)
    table = explain_decision(model, KNOCKING[1])
    adds_up(table)
    assert set(table["column"]) == set(model[0].get_feature_names_out())
    rows = table.set_index("column")
    assert rows.loc["levels__current+:kurtosis", "channel"] == "levels__current+"
    assert np.isnan(rows.loc["levels__current+:kurtosis", "low"])
    assert rows.loc["psd__current-@1-2", ["low", "high"]].tolist() == [1, 2]
    adds_up(explain_decision(model, KNOCKING[1], background=KNOCKING[::2]))


def test_a_model_of_knocks_is_determined_by_the_kurtosis_of_their_direction():
    model = named_features(StandardScaler()).fit(KNOCKING, KNOCKS)
    table = explain_model(model, KNOCKING, KNOCKS)
    assert table["column"][0] == "levels__current+:kurtosis"
    assert table["share"].sum() == pytest.approx(1)
    named = model.set_output(transform="pandas").fit(KNOCKING, KNOCKS)
    again = explain_model(named, KNOCKING, KNOCKS)
    np.testing.assert_allclose(again["contribution"], table["contribution"])


def test_orders_are_read_from_the_names_of_columns_only_where_they_are_given():
    X, y = powers()
    X.columns = ["a@1e-05-0.5", "a@BPFI", "a@3.5", "plain", *COLUMNS[4:]]
    model = make_pipeline(log(), CostSensitiveGaussianBayes(shrinkage=0.1)).fit(X, y)
    table = explain_decision(model, X.iloc[[0]]).set_index("column")
    assert table.loc["a@1e-05-0.5", ["low", "high"]].tolist() == [1e-5, 0.5]
    assert table.loc["a@3.5", ["low", "high"]].tolist() == [3.5, 3.5]
    assert table.loc[["a@BPFI", "plain"], ["low", "high"]].isna().all(axis=None)
    assert table.loc["plain", "channel"] == ""
    matched = match_fault_orders(table.reset_index(), {"BPFI": 6.123}).set_index("column")
    assert matched.loc["a@BPFI", "fault"] == "BPFI"
    assert matched.loc["plain", "fault"] == "none"


@pytest.mark.parametrize(
    ("steps", "name"),
    [
        ([log(), KernelPCA(3, kernel="rbf")], r"'kernelpca' \(KernelPCA\)"),
        ([Normalizer()], r"'normalizer' \(Normalizer\)"),
        ([log(), PCA(3), PowerTransformer()], r"'powertransformer' \(PowerTransformer\)"),
        (
            [make_pipeline(log(), PCA(3)), FunctionTransformer(np.abs)],
            r"'functiontransformer' \(FunctionTransformer\)",
        ),
    ],
)
def test_a_step_that_cannot_be_traced_is_named(steps, name):
    X, y = powers()
    model = make_pipeline(*steps, CostSensitiveGaussianBayes(shrinkage=0.1)).fit(X, y)
    with pytest.raises(ValueError, match=f"step {name} cannot be traced back"):
        explain_decision(model, X.iloc[[0]])
    with pytest.raises(ValueError, match=f"step {name} cannot be traced back"):
        explain_model(model, X, y)


LOGS = fitted("log")[0]
POWERS, TRUTH = powers()
ONE, RUN = POWERS.iloc[[0]], Recording({"a": np.ones(9)}, 1.0, velocity=np.ones(9))
SAME = {"decision": "state 0", "against": "state 0"}


@pytest.mark.parametrize(
    ("explain", "words"),
    [
        (lambda: explain_decision(LOGS, ONE, decision="broken"), "decision must be one of"),
        (lambda: explain_decision(LOGS, ONE, against=3), "against must be one of"),
        (lambda: explain_decision(LOGS, ONE, **SAME), "differ, both are 'state 0'"),
        (lambda: explain_decision(LOGS, POWERS.iloc[:3]), "x must be one recording"),
        (lambda: explain_decision(LOGS, ONE, background=ONE[:0]), "background"),
        (lambda: explain_decision(LogisticRegression().fit(POWERS, TRUTH), ONE), "Logistic"),
        (lambda: explain_decision(LOGS, ONE.iloc[:, ::-1]), "columns of fit"),
        (lambda: explain_decision(LOGS, ONE * 0), "'functiontransformer'"),
        (lambda: explain_decision(LOGS, RUN), "give no table"),
        (lambda: explain_model(LOGS, POWERS.mask(POWERS.iloc[2, 3] == POWERS), TRUTH), "@3-4"),
        (lambda: explain_model(LOGS, POWERS, ["state 0"] * 44 + ["broken"]), "'broken'"),
        (lambda: explain_model(LOGS, POWERS, ["state 0"] * 45), "one class only"),
        (lambda: explain_model(LOGS, RUN, TRUTH), "a single one"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")  # of the logarithm
def test_invalid_input_is_refused_with_its_place(explain, words):
    with pytest.raises((TypeError, ValueError), match=words):
        explain()
