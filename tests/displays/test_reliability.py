"""Reliability is drawn as frequency over confidence, with the number of recordings."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from sklearn.naive_bayes import GaussianNB
from sklearn.svm import LinearSVC

from emacm.displays import ReliabilityDisplay
from emacm.evaluation.evaluate import evaluate

CURVE = pd.DataFrame(
    {
        "from": [0.5, 0.7, 0.9],
        "to": [0.6, 0.8, 1.0],
        "confidence": [0.57, 0.72, 0.96],
        "frequency": [0.4, 0.75, 0.99],
        "low": [0.2, 0.6, np.nan],
        "high": [0.65, 0.85, np.nan],
        "count": [10, 30, 160],
    }
)


def panels():
    return Figure().subplots(2)


def found(model=None):
    rng = np.random.default_rng(0)
    y, runs = np.tile(["new", "new", "worn"], 30), np.repeat(np.arange(18), 5)
    X = rng.normal(size=(90, 1)) + 1.5 * (y == "worn")[:, np.newaxis]
    return evaluate(GaussianNB() if model is None else model, X, y, runs=runs)


def test_frequency_stands_over_confidence_with_its_interval():
    upper, lower = panels()
    ReliabilityDisplay({"by run": CURVE}).plot(ax=[upper, lower])
    diagonal, curve = upper.lines
    assert np.allclose(diagonal.get_xydata(), [[0, 0], [100, 100]])
    assert np.allclose(curve.get_xydata(), [[57, 40], [72, 75], [96, 99]])
    segments = upper.collections[0].get_segments()
    assert np.allclose(segments[0], [[57, 20], [57, 65]])
    assert "observed frequency" in upper.get_ylabel()
    assert lower.get_xlabel() == "confidence (highest posterior) [%]"


def test_the_number_of_recordings_is_drawn_between_the_edges_of_its_bin_and_written():
    upper, lower = panels()
    ReliabilityDisplay({"by run": CURVE}).plot(ax=[upper, lower])
    bars = [(bar.get_x(), bar.get_width(), bar.get_y() + bar.get_height()) for bar in lower.patches]
    assert np.allclose(bars, [(50, 10, 10), (70, 10, 30), (90, 10, 160)])
    assert [text.get_text() for text in lower.texts] == ["10", "30", "160"]
    assert lower.get_yscale() == "log"


def test_the_legend_states_the_calibration_error():
    upper, lower = panels()
    display = ReliabilityDisplay({"by run": CURVE}).plot(ax=[upper, lower])
    expected = (0.17 * 10 + 0.03 * 30 + 0.03 * 160) / 200
    assert display.calibration_error("by run") == pytest.approx(expected)
    labels = [text.get_text() for text in upper.get_legend().get_texts()]
    assert labels == ["calibrated", "by run: calibration error 0.037"]


def test_two_curves_differ_by_colour_and_marker_and_their_bars_stand_side_by_side():
    upper, lower = panels()
    ReliabilityDisplay({"without": CURVE, "with": CURVE.assign(frequency=0.9)}).plot(
        ax=[upper, lower]
    )
    _, first, second = upper.lines
    assert first.get_color() != second.get_color()
    assert first.get_marker() != second.get_marker()
    assert np.allclose([bar.get_x() for bar in lower.patches], [50, 70, 90, 55, 75, 95])


def test_an_evaluation_is_drawn_with_its_first_split_by_groups():
    result = found()
    display = ReliabilityDisplay.from_evaluation(result, ax=panels())
    expected = result.calibration.query("scheme == 'by run'")
    frame = display.frame()
    assert frame["curve"].unique().tolist() == ["by run"]
    assert frame["frequency"].tolist() == expected["frequency"].tolist()
    error = result.table.loc["by run", "calibration_error"]
    assert display.calibration_error("by run") == pytest.approx(error)
    both = ReliabilityDisplay.from_evaluation(
        result, schemes=["by run", "random split"], ax=panels()
    )
    assert list(both.curves) == ["by run", "random split"]


def test_several_evaluations_are_drawn_together():
    results = {"wide": found(GaussianNB(var_smoothing=1)), "narrow": found()}
    display = ReliabilityDisplay.from_evaluations(results, scheme="by run", ax=panels())
    assert list(display.curves) == ["wide", "narrow"]
    expected = results["wide"].calibration.query("scheme == 'by run'")
    assert display.curves["wide"]["confidence"].tolist() == expected["confidence"].tolist()


def test_invalid_curves_are_refused():
    with pytest.raises(TypeError, match="curves must map at least one name"):
        ReliabilityDisplay({})
    with pytest.raises(ValueError, match=r"the curve 'a' must have the columns .*no \['from'\]"):
        ReliabilityDisplay({"a": CURVE.drop(columns="from")})
    with pytest.raises(ValueError, match="the curve 'a' must be finite"):
        ReliabilityDisplay({"a": CURVE.assign(frequency=np.nan)})
    with pytest.raises(TypeError, match="must be the result of evaluate, got DataFrame"):
        ReliabilityDisplay.from_evaluation(CURVE)
    with pytest.raises(ValueError, match="evaluation has no probabilities"):
        ReliabilityDisplay.from_evaluation(found(LinearSVC()))
    with pytest.raises(ValueError, match=r"scored: \['random split', 'by run'\]; got 'by unit'"):
        ReliabilityDisplay.from_evaluation(found(), schemes="by unit")
