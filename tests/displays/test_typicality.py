"""Typicality is drawn over the posterior probability, for known and unknown states."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from sklearn.naive_bayes import GaussianNB
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from emacm import CostSensitiveGaussianBayes
from emacm.decisions.unknown import unknown_probability
from emacm.displays import COLOURS, TypicalityDisplay
from emacm.evaluation.evaluate import evaluate

TABLE = pd.DataFrame(
    {
        "confidence": [0.9, 0.99, 0.5, 1.0, 0.999],
        "typicality": [0.6, 0.02, 0.3, 1e-5, 1e-300],
        "label": ["dry", "new", "new", "worn", "worn"],
        "is_unknown": [False, False, False, True, True],
    }
)


@pytest.fixture
def ax():
    return Figure().subplots()


def drawn_points(ax):
    """Return the drawn points by the name in the legend."""
    return {
        marks.get_label(): np.asarray(marks.get_offsets())
        for marks in ax.collections
        if isinstance(marks, PathCollection)
    }


def test_points_stand_at_their_posterior_and_typicality(ax):
    TypicalityDisplay(TABLE, healthy="new").plot(ax=ax)
    points = drawn_points(ax)
    assert np.allclose(points["dry"], [[1, 0.6]])
    assert np.allclose(points["new"], [[2, 0.02], [-np.log10(0.5), 0.3]])
    assert np.allclose(points["not in training"], [[6, 1e-5], [3, 1e-12]])
    assert ax.get_yscale() == "log"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("highest posterior [%]", "typicality")


def test_ticks_state_the_posterior_in_per_cent(ax):
    TypicalityDisplay(TABLE).plot(ax=ax)
    ticks = {label.get_text(): label.get_position()[0] for label in ax.get_xticklabels()}
    assert [*ticks][:5] == ["0", "50", "90", "99", "99.9"]
    assert np.allclose([ticks["0"], ticks["90"], ticks["99.9"]], [0, 1, 3])


def test_healthy_is_first_in_the_legend_and_has_its_colour(ax):
    TypicalityDisplay(TABLE, {"limit": 0.02}, healthy="new").plot(ax=ax)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["new", "dry", "not in training", "limit"]
    (healthy,) = [marks for marks in ax.collections if marks.get_label() == "new"]
    assert to_hex(healthy.get_facecolor()[0]).upper() == COLOURS[0]


def test_thresholds_are_horizontal_lines(ax):
    TypicalityDisplay(TABLE, {"a": 0.02, "b": 1e-6}).plot(ax=ax)
    assert [line.get_ydata()[0] for line in ax.lines] == [0.02, 1e-6]
    assert len({line.get_linestyle() for line in ax.lines}) == 2
    assert ax.get_ylim()[0] < 1e-12


def fleet():
    rng = np.random.default_rng(1)
    units = np.repeat(np.arange(15), 6)
    y = np.array(["worn", "new", "dry"])[units % 3]
    X = rng.normal(size=(90, 2)) + 6 * np.column_stack([y == "worn", y == "dry"])
    return X, y, units


@pytest.mark.slow
def test_an_evaluation_is_drawn_with_one_panel_for_each_family_left_out():
    X, y, units = fleet()
    model = CostSensitiveGaussianBayes(unknown="unknown", covariance="tied")
    result = evaluate(model, X, y, units=units, healthy="new", n_splits=5)
    panels = Figure(figsize=(6, 8)).subplots(2)
    display = TypicalityDisplay.from_evaluation(result, ax=panels)
    assert [p.get_title(loc="left") for p in panels] == [
        "dry left out of training",
        "worn left out of training",
    ]
    held = result.novelty_predictions.query("left_out == 'worn' and is_unknown")
    points = drawn_points(panels[1])
    assert set(points) == {"new", "dry", "not in training"}
    assert np.allclose(points["not in training"][:, 1], held["typicality"])
    labels = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert labels[:4] == ["new", "dry", "worn", "not in training"]
    alone = TypicalityDisplay.from_evaluation(result, left_out="dry", ax=Figure().subplots())
    assert len(alone.frame()) == 90
    assert display.thresholds["typicality 0.01"] == 0.01
    even = display.thresholds["P(unknown) = 50 %"]
    assert unknown_probability(np.array(even), 0.01) == pytest.approx(0.5, abs=1e-3)


def test_a_classifier_is_drawn_with_states_that_it_does_not_know(ax):
    X, y, units = fleet()
    known = y != "dry"
    model = make_pipeline(
        StandardScaler(), CostSensitiveGaussianBayes(unknown="unknown", covariance="tied")
    )
    model.fit(X[known], y[known], costsensitivegaussianbayes__groups=units[known])
    display = TypicalityDisplay.from_estimator(model, X, y, healthy="new", ax=ax)
    frame = display.frame()
    assert (frame["is_unknown"] == ~known).all()
    scaled = model[:-1].transform(X)
    assert frame["typicality"].to_numpy() == pytest.approx(model[-1].typicality(scaled))
    assert frame["confidence"].to_numpy() == pytest.approx(model.predict_proba(X).max(axis=1))
    assert len(drawn_points(ax)["not in training"]) == 30


def test_invalid_tables_and_classifiers_are_refused():
    with pytest.raises(ValueError, match=r"it has no \['label'\]"):
        TypicalityDisplay(TABLE.drop(columns="label"))
    with pytest.raises(ValueError, match="it has no recording"):
        TypicalityDisplay(TABLE.iloc[:0])
    with pytest.raises(ValueError, match=r"typicality must be at most 1, got 3"):
        TypicalityDisplay(TABLE.assign(typicality=3.0))
    with pytest.raises(TypeError, match=r"thresholds must map names to numbers, got 0\.01"):
        TypicalityDisplay(TABLE, 0.01)
    with pytest.raises(ValueError, match="the threshold 'a' must be a number above 0"):
        TypicalityDisplay(TABLE, {"a": 0})
    X, y, units = fleet()
    with pytest.raises(TypeError, match="must have typicality and unknown_proba"):
        TypicalityDisplay.from_estimator(GaussianNB().fit(X, y), X, y)
    result = evaluate(GaussianNB(), X, y, units=units)
    with pytest.raises(ValueError, match="left no family of faults out of training"):
        TypicalityDisplay.from_evaluation(result)
    with pytest.raises(TypeError, match="must be the result of evaluate, got DataFrame"):
        TypicalityDisplay.from_evaluation(TABLE)
