"""Chapter 4 on the bench: its protocol, its tables, and what its decisions rest on."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest

from emacm.bench import LaboratoryBench
from emacm.chapter4_spectra import READINGS, SIGNALS, run_campaign
from emacm.chapter4_study import (
    decide,
    expected_orders,
    explain,
    explained_shares,
    outcome_shares,
    train,
)
from emacm.reproduce_chapter4 import OUTCOME_NAMES, PUBLISHED, QUICK, chapter4


@pytest.fixture(scope="module")
def quick():
    """The quick chapter, and how often each recording was simulated for it."""
    simulated = Counter()
    record = LaboratoryBench.record

    def counted(bench, condition, run=1):
        simulated[bench.unit, bench.seed, condition, run] += 1
        return record(bench, condition, run)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LaboratoryBench, "record", counted)
        return chapter4(quick=True), simulated


@pytest.fixture(scope="module")
def chapter(quick):
    return quick[0]


@pytest.fixture(scope="module")
def campaign():
    return run_campaign(3, n_runs=6, duration=1.0)


@pytest.fixture(scope="module")
def models(campaign):
    return train(campaign)


def test_each_recording_is_simulated_once(quick):
    _, simulated = quick
    assert set(simulated.values()) == {1}
    assert len(simulated) == 2 * 5 * QUICK.n_runs


def test_every_cell_of_both_tables_has_its_finding(chapter):
    assert len(chapter.findings) == 24
    expected = [v for scheme in PUBLISHED.values() for cells in scheme.values() for v in cells]
    assert [finding.published for finding in chapter.findings] == expected


def test_published_percentages_are_shares_of_all_test_runs():
    for cells in (cells for scheme in PUBLISHED.values() for cells in scheme.values()):
        assert sum(cells) == 100


def test_our_percentages_add_up_to_all_test_runs(chapter):
    by_condition = chapter.tables["outcomes by condition"]
    assert list(by_condition.columns) == list(OUTCOME_NAMES)
    np.testing.assert_allclose(by_condition.sum(axis=1), 100)
    ours = np.reshape([finding.ours for finding in chapter.findings], (8, 3))
    np.testing.assert_allclose(ours.sum(axis=1), 100)


def test_a_table_is_the_mean_of_its_conditions(chapter):
    by_condition = chapter.tables["outcomes by condition"]["correct"]
    means = by_condition.groupby(level=["classifier", "signal"]).mean()
    for finding in chapter.findings[::3]:
        scheme = "per condition" if "4.5" in finding.where else "single"
        signal = finding.where.split(", ")[1]
        assert finding.ours == pytest.approx(means[scheme, signal])


def test_no_run_is_both_for_training_and_for_test(campaign):
    frame = campaign.frame
    runs = {
        training: set(map(tuple, part[["unit", "condition", "run"]].to_numpy()))
        for training, part in frame.groupby("training")
    }
    assert not runs[True] & runs[False]
    assert len(runs[True]) == len(runs[False]) == len(frame) // 2
    assert frame[frame["training"]]["run"].max() < frame[~frame["training"]]["run"].min()


def test_a_classifier_decides_only_in_its_conditions_and_on_test_runs(campaign, models):
    decisions = decide(campaign, models)
    assert len(decisions) == 2 * len(SIGNALS) * 30  # two schemes; 2 units, 5 conditions, 3 runs
    assert set(decisions["run"]) == {4, 5, 6}
    assert not decisions.duplicated(["scheme", "channel", "condition", "run", "health"]).any()


def test_classifiers_are_of_two_features_equal_priors_and_uniform_cost(models):
    for model in models:
        classifier = model.pipeline[-1]
        assert classifier.n_features_in_ == 2
        assert classifier.priors_.tolist() == [0.5, 0.5]
        assert classifier.cost_.tolist() == [[0, 1], [1, 0]]


def test_table_4_4_is_read_as_100_bins_of_one_order(models):
    columns = {m.channel: m.pipeline[0].get_feature_names_out() for m in models}
    assert columns["current_a"].tolist()[:2] == ["current_a@0-1", "current_a@1-2"]
    assert len(columns["current_a"]) == 100
    assert len(columns["lvdt"]) == 99  # the slow command is filtered out with its bin
    assert READINGS["50 orders"].max_order == 50


def test_the_filter_takes_out_the_fundamental_of_the_current(campaign, models):
    (model,) = [m for m in models if m.channel == "current_a" and m.scheme == "single"]
    spectrum = campaign.spectra["thesis"]["current_a"].iloc[[0]].copy()
    orders = [float(name.partition("@")[2]) for name in spectrum]
    # A line reaches to its neighbours, an eighth away.
    inside = [abs(order - 6) + 0.125 < 0.4 for order in orders]
    assert sum(inside) == 5
    louder = spectrum.copy()
    louder.loc[:, inside] = 1e6
    binning = model.pipeline[0]
    np.testing.assert_allclose(binning.transform(louder), binning.transform(spectrum))


def test_the_lvdt_is_exposed_as_deciding_on_orders_12_and_36_of_the_healthy_unit(chapter):
    lines = chapter.tables["lines that carry the decisions"]
    lvdt = lines[lines["signal"] == "LVDT"]
    for condition in ("2", "3", "4", "5"):
        strongest = lvdt[lvdt["conditions"] == condition].head(4)
        assert (np.abs(strongest["order"].iloc[0] - 12) < 0.2) or (
            np.abs(strongest["order"].iloc[0] - 36) < 0.2
        )
        assert {"2xsupply", "6xsupply"} <= set(lvdt[lvdt["conditions"] == condition]["expected"])
        assert set(strongest["louder"]) == {"healthy"}
    carried = chapter.tables["what carries the decisions"].xs("LVDT", level="signal")
    fast = carried.loc[["2", "3", "4", "5"]]
    assert (fast["electrical noise [%]"] > 20 * fast["electrical noise, by chance [%]"]).all()
    assert (fast["inner ring [%]"] < fast["inner ring, by chance [%]"]).all()


def test_the_accelerometer_is_exposed_as_deciding_on_multiples_of_6_123(chapter):
    lines = chapter.tables["lines that carry the decisions"]
    ring = lines[(lines["signal"] == "Y Accelerometer") & (lines["conditions"] == "3")]
    strongest = ring.iloc[0]
    assert strongest["group"] == "inner ring"
    assert strongest["louder"] == "degraded"
    carried = chapter.tables["what carries the decisions"].xs("Y Accelerometer", level="signal")
    for conditions in ("3", "4", "all"):
        row = carried.loc[conditions]
        assert row["inner ring [%]"] > 2 * row["inner ring, by chance [%]"]
        assert row["electrical noise [%]"] < 5


def test_lines_keep_the_shares_of_their_bins(campaign, models):
    for model in models[:2]:
        lines = explain(campaign, model)
        bins = lines.attrs["bins"]
        assert lines["share"].sum() == pytest.approx(1)
        top = bins.iloc[0]
        inside = lines[(lines["low"] > top["low"]) & (lines["low"] < top["high"])]
        around = lines[(lines["low"] >= top["low"]) & (lines["low"] <= top["high"])]
        assert inside["share"].sum() <= top["share"] * (1 + 1e-9) + 1e-12
        assert around["share"].sum() >= top["share"] * (1 - 1e-9)


def test_no_line_where_the_healthy_unit_is_louder_counts_for_the_fault(campaign, models):
    for model in models[::5]:
        lines = explain(campaign, model)
        healthy = lines[lines["louder"] == "healthy"]
        assert "inner ring" not in set(healthy["group"])


def test_shares_by_group_are_per_cent_of_the_decision(campaign, models):
    shares = explained_shares(explain(campaign, models[0]))
    assert all(0 <= share <= 100 for share in shares.values())
    assert sum(shares.values()) <= 100 + 1e-9


def test_expected_orders_of_vibration_and_current_differ_by_the_supply():
    mechanical, electrical = (expected_orders(name, 100) for name in ("lvdt", "current_a"))
    assert mechanical["inner ring"]["BPFI"] == pytest.approx(6.123, abs=1e-4)
    assert electrical["inner ring"]["supply+BPFI"] == pytest.approx(12.123, abs=1e-4)
    assert electrical["inner ring"]["supply-BPFI"] == pytest.approx(0.123, abs=1e-4)
    assert electrical["shaft"]["supply+shaft"] == 7
    assert mechanical["electrical noise"] == {"2xsupply": 12, "6xsupply": 36}


def test_one_process_or_two_give_the_same_spectra():
    one, two = (run_campaign(3, n_runs=1, duration=0.5, n_jobs=n) for n in (1, 2))
    for channel in SIGNALS:
        pd.testing.assert_frame_equal(
            one.spectra["thesis"][channel], two.spectra["thesis"][channel]
        )


def test_trained_again_it_decides_alike(campaign, models):
    pd.testing.assert_frame_equal(decide(campaign, train(campaign)), decide(campaign, models))


def test_outcomes_are_named_by_the_truth():
    decisions = pd.DataFrame(
        {
            "scheme": "single",
            "outcome": ["correct", "false positive", "false negative", "correct"],
        }
    )
    (row,) = outcome_shares(decisions, ["scheme"]).to_numpy()
    assert row.tolist() == [50, 25, 25]


def test_the_first_remark_says_that_no_data_were_published(chapter):
    assert chapter.opening.startswith("No data of the laboratory were published.")
    text = " ".join([chapter.opening, *chapter.remarks])
    for word in ("0.01π", "quick form", "travel", "condition 1 is", "nan"):
        assert (word in text) == (word != "nan")


def test_every_kind_of_picture_is_drawn_of_one_condition_and_has_a_caption(chapter):
    names = {f"Fig. 4.{n}" for n in (31, 32)}
    names |= {f"Figs. 4.{n} and 4.{n + 1}" for n in (33, 35, 37, 39)}
    names |= {"Figs. 4.65-4.68", "Figs. 4.69-4.72"}
    for where in ("condition 3", "all conditions"):
        names |= {f"Explained variance, {where}", f"What carries the decisions, {where}"}
    assert set(chapter.figures) == set(chapter.captions) == names
    assert all(chapter.captions.values())


def test_pictures_are_light(chapter):
    pixels = [f.get_size_inches().prod() * f.dpi**2 for f in chapter.figures.values()]
    assert max(pixels) < 1.5e6


def test_progress_is_reported_in_lines():
    lines = []
    run_campaign(1, n_runs=5, duration=0.05, report=lines.append)
    assert lines == ["chapter 4, units of seed 1: 50 of 50 recordings"]


def test_a_finding_that_does_not_agree_says_what_was_decided_on(chapter):
    for finding in chapter.findings:
        assert ("decided on inner ring" in finding.note) == (not finding.agrees)
