"""What is printed of an evaluation."""

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pandas as pd
import pytest

from emacm.evaluation.comparison import Comparison
from emacm.evaluation.held_out import Decided
from emacm.evaluation.miss_rate import MissRateLimit
from emacm.evaluation.nuisances import Nuisance
from emacm.evaluation.results import Evaluation, as_texts
from emacm.evaluation.scheme_scores import SchemeScore
from emacm.evaluation.schemes import Fold, Scheme
from emacm.evaluation.scoring import scoring_rule
from emacm.recordings.meta import Grouping

SCHEMES = pd.Index(["random split", "by run"], name="scheme")
TABLE = pd.DataFrame(
    {
        "accuracy": [0.98765, 0.5],
        "accuracy_low": [0.91234, np.nan],
        "accuracy_high": [1.0, np.nan],
        "log_loss": [np.nan, 12345.678],
        "log_loss_low": [np.nan, 0.00012345],
        "log_loss_high": [np.nan, 20000.0],
        "groups": [12, 3],
        "resampled": ["run", "unit"],
    },
    SCHEMES,
)
NOVELTY = {"auroc": 0.95, "known_flagged": 0.01, "unknown_flagged": 0.62}
NUISANCES = {
    "nuisance": ["day", "day"], "scheme": [*SCHEMES], "alone": [0.7, 0.7],
    "alone_low": [0.6, 0.6], "alone_high": [0.8, 0.8], "chance": [0.5, 0.5],
    "balanced_accuracy": [0.91234, 1.0], "within": [0.8, np.nan], "within_low": [0.75, np.nan],
    "within_high": [0.9, np.nan], "within_chance": [1 / 3, np.nan],
}  # fmt: skip


def evaluation(**changes):
    parts = {
        "table": TABLE,
        "predictions": pd.DataFrame(),
        "confusions": {},
        "calibration": pd.DataFrame(),
        "caveats": ["First <caveat>.", "Second, " + "long " * 30 + "caveat."],
        "confidence": 0.9,
        "scoring": scoring_rule(np.array(["new", "worn"])),
        "bootstrap": {},
    }
    return Evaluation(**parts | changes)


def novelty():
    row = {f"{name}{end}": v for name, v in NOVELTY.items() for end in ("", "_low", "_high")}
    return pd.DataFrame([row], ["dry"])


def test_results_cannot_be_changed():
    differences = pd.DataFrame(index=["b"])
    group = Grouping("run", np.arange(2))
    fold = Fold(np.array([0]), np.array([1]))
    scheme = Scheme("s", [fold], group)
    results = [
        evaluation(), Comparison(TABLE, differences, [], "by run", "a", 0.5), fold, scheme,
        Decided(["new"]), Nuisance("day", np.array([0])), scoring_rule(np.array(["new", "worn"])),
        SchemeScore({}, *[pd.DataFrame()] * 3),
        MissRateLimit(TABLE, 1.0, TABLE, 0.01, 0.95, 300),
    ]  # fmt: skip
    for result in results:
        name = fields(result)[0].name
        with pytest.raises(FrozenInstanceError):
            setattr(result, name, None)
    assert results[1].healthy is None
    assert (fold.left_out, scheme.impossible, scheme.may_refuse) == ("", "", ())


def test_figures_have_three_digits_and_their_limits_in_brackets():
    texts = as_texts(TABLE, ["log_loss", "accuracy"])
    assert texts.columns.tolist() == ["log loss", "accuracy"]
    assert texts.index.equals(SCHEMES)
    assert texts["accuracy"].tolist() == ["0.988 (0.912 to 1)", "0.5"]
    assert texts["log loss"].tolist() == ["-", "1.23e+04 (0.000123 to 2e+04)"]


def test_a_summary_is_in_the_order_of_the_figures_and_ends_with_the_groups():
    found = evaluation().summary()
    assert found.columns.tolist() == ["accuracy", "log loss", "bootstrap groups"]
    assert found["bootstrap groups"].tolist() == ["12 (run)", "3 (unit)"]
    assert evaluation(table=TABLE[["groups"]]).summary().columns.tolist() == []


def test_other_tables_are_printed_only_if_they_have_rows():
    plain = evaluation()
    assert plain.novelty_summary().empty
    assert plain.nuisance_summary().empty
    assert str(plain).count(":") == 1  # of the confidence interval
    full = evaluation(novelty=novelty(), nuisances=pd.DataFrame(NUISANCES))
    assert full.novelty_summary().loc["dry"].to_dict() == {
        "AUROC, unknown from known": "0.95 (0.95 to 0.95)",
        "known with typicality <= 0.01": "0.01 (0.01 to 0.01)",
        "unknown with typicality <= 0.01": "0.62 (0.62 to 0.62)",
    }
    table = full.nuisance_summary()
    assert table.index.names == ["nuisance", "scheme"]
    assert table.loc[("day", "random split")].to_dict() == {
        "nuisance alone": "0.7 (0.6 to 0.8)", "chance": "0.5", "classifier": "0.912",
        "within one level": "0.8 (0.75 to 0.9)", "chance within": "0.333",
    }  # fmt: skip
    assert table.loc[("day", "by run")].tolist()[2:] == ["1", "-", "-"]
    text, page = str(full), full._repr_html_()
    for title in ("families of faults left out of training:", "balanced accuracy by nuisance:"):
        assert f"\n\n{title}\n" in text
        assert f"<p>{title}</p><table" in page


def test_caveats_come_first_in_lines_of_98_characters():
    found = evaluation()
    lines = str(found).splitlines()
    assert lines[0] == "- First <caveat>."
    assert lines[1].startswith("- Second, long")
    assert lines[2].startswith("  long")
    assert 93 < len(lines[1]) <= 98
    assert [line.split("  ")[0] for line in lines[4:7]] == [
        "accuracy",
        "log loss",
        "bootstrap groups",
    ]
    closing = "in brackets: 90 % confidence interval, from a bootstrap over whole groups"
    assert lines[-1] == f"({closing})"
    assert repr(found) == str(found)
    page = found._repr_html_()
    assert page.startswith("<ul><li>First &lt;caveat&gt;.</li><li>Second")
    assert page.endswith(f"</table><p>{closing}</p>")


def test_a_comparison_is_printed_like_an_evaluation():
    columns = ["accuracy", "accuracy_low", "accuracy_high"]
    differences = pd.DataFrame([[-0.25, -0.5, 0.125]], ["<b>"], columns)
    table = TABLE.set_axis(["a", "<b>"])
    found = Comparison(table, differences, ["One <caveat>."], "by run", "a", 0.5)
    assert found.summary().columns.tolist() == ["accuracy", "log loss"]
    assert found.difference_summary().loc["<b>"].tolist() == ["-0.25 (-0.5 to 0.125)"]
    lines = str(found).splitlines()
    assert lines[:2] == ["- One <caveat>.", "by run:"]
    assert lines[5:] == [
        "difference from 'a':", "                            <b>",
        "accuracy  -0.25 (-0.5 to 0.125)",
        "(in brackets: 50 % confidence interval, from a bootstrap over whole groups)",
    ]  # fmt: skip
    assert repr(found) == str(found)
    page = found._repr_html_()
    assert page.startswith("<ul><li>One &lt;caveat&gt;.</li></ul><p>by run:</p><table")
    assert "<p>difference from &#x27;a&#x27;:</p><table" in page
    assert page.endswith("</table><p>" + lines[-1] + "</p>")
