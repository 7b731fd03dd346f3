"""ROC curves of families that were left out of training."""

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import roc_auc_score

from emacm import CostSensitiveGaussianBayes
from emacm.displays import UnknownRocDisplay
from emacm.evaluation.novelty import evaluate_unknown

TABLE = pd.DataFrame(
    {
        "left_out": ["worn"] * 6 + ["dry"] * 3,
        "typicality": [0.8, 0.3, 0.3, 0.009, 0.3, 0.002, 0.4, 0.01, 0.7],
        "is_unknown": [False, False, False, False, True, True, False, True, True],
    }
)


def curves(ax):
    return {line.get_label().partition(":")[0]: line for line in ax.lines}


def test_unknown_recordings_flagged_are_drawn_over_known_ones(ax):
    display = UnknownRocDisplay(TABLE).plot(ax=ax)
    worn = curves(ax)["worn"].get_xydata()
    # Thresholds 0.002: one of two unknown; 0.009: one of four known; 0.3: all but one known.
    assert np.allclose(worn, [[0, 0], [0, 50], [25, 50], [75, 100], [100, 100]])
    assert ax.get_xlabel() == "known recordings flagged [%]"
    assert ax.get_ylabel() == "unknown recordings flagged [%]"
    frame = display.frame().query("left_out == 'worn'")
    assert frame["threshold"].tolist() == [0, 0.002, 0.009, 0.3, 0.8]


def test_areas_are_those_of_scikit_learn_and_stand_in_the_legend(ax):
    intervals = pd.DataFrame(
        {"auroc_low": [0.4, np.nan], "auroc_high": [0.9, np.nan]}, index=["worn", "dry"]
    )
    display = UnknownRocDisplay(TABLE, intervals).plot(ax=ax)
    for family, part in TABLE.groupby("left_out"):
        expected = roc_auc_score(part["is_unknown"], -part["typicality"])
        assert display.areas()[family] == pytest.approx(expected)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert names[:2] == ["dry: AUROC 0.500", "worn: AUROC 0.750 (0.400 to 0.900)"]


@pytest.mark.slow
def test_an_evaluation_is_drawn_as_it_was_computed(ax):
    rng = np.random.default_rng(1)
    units = np.repeat(np.arange(15), 6)
    y = np.array(["worn", "new", "dry"])[units % 3]
    X = rng.normal(size=(90, 2)) + 5 * np.column_stack([y == "worn", y == "dry"])
    model = CostSensitiveGaussianBayes(unknown="unknown", covariance="tied")
    result = evaluate_unknown(model, X, y, units=units, healthy="new", n_splits=5)
    display = UnknownRocDisplay.from_evaluation(result, ax=ax)
    for family, row in result.table.iterrows():
        assert display.areas()[family] == pytest.approx(row["auroc"])
        (name,) = [label for label in display.ax_.get_legend_handles_labels()[1] if family in label]
        assert f"({row['auroc_low']:.3f} to {row['auroc_high']:.3f})" in name
