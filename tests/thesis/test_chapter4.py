"""Chapter 4 on the bench: its procedure, its tables, and the orders of its decisions."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from scipy import signal as filters
from scipy.integrate import trapezoid
from sklearn.pipeline import make_pipeline

from emacm.explanations.explain import explain_model
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.campaign import thesis_benches
from emacm.simulation.sensors import NOISE
from emacm.thesis.chapter4 import PUBLISHED, QUICK, reproduce_chapter4
from emacm.thesis.chapter4_spectra import READINGS, SIGNALS, run_campaign
from emacm.thesis.chapter4_study import (
    GROUPS,
    OUTCOMES,
    decide,
    expected_orders,
    explain,
    explained_shares,
    outcome_shares,
    study,
    train,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def quick():
    """The quick chapter, and how often each recording was simulated for it."""
    simulated = Counter()
    record = LaboratoryBench.record

    def counted(bench, condition, run=1):
        simulated[bench.unit, bench.electrical_noise, condition, run] += 1
        return record(bench, condition, run)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LaboratoryBench, "record", counted)
        return reproduce_chapter4(quick=True), simulated


@pytest.fixture(scope="module")
def chapter(quick):
    return quick[0]


@pytest.fixture(scope="module")
def shares(chapter):
    table = chapter.tables["orders that determine the decisions"].copy()
    for group in GROUPS:
        parts = table[f"{group} [%]"].str.extract(r"^(\d+) \((\d+) to (\d+)\)$").astype(float)
        assert ((parts[1] <= parts[0]) & (parts[0] <= parts[2])).all()
        table[f"{group} [%]"] = parts[0]
    return table


@pytest.fixture(scope="module")
def campaign():
    return run_campaign(thesis_benches(seed=3, duration=1.0), n_runs=6)


@pytest.fixture(scope="module")
def models(campaign):
    return study(campaign).models


def test_each_recording_is_simulated_once(quick):
    _, simulated = quick
    assert set(simulated.values()) == {1}
    assert len(simulated) == 2 * 5 * QUICK.n_runs


def test_every_cell_of_both_tables_has_its_finding(chapter):
    assert len(chapter.findings) == 24 + 4 + 1
    expected = [v for scheme in PUBLISHED.values() for cells in scheme.values() for v in cells]
    assert [finding.published for finding in chapter.findings] == [*expected, 100, 100, 100, 100, 3]
    assert {(f.kind, f.draws, f.probability_of_a_miss) for f in chapter.findings} == {
        ("random", 1, 1.0)
    }


def test_published_percentages_are_shares_of_all_test_runs():
    for cells in (cells for scheme in PUBLISHED.values() for cells in scheme.values()):
        assert sum(cells) == 100


def test_our_percentages_add_up_to_all_test_runs(chapter):
    by_condition = chapter.tables["outcomes by condition"]
    assert list(by_condition.columns) == list(OUTCOMES)
    np.testing.assert_allclose(by_condition.sum(axis=1), 100)
    ours = np.reshape([finding.ours for finding in chapter.findings[:24]], (8, 3))
    np.testing.assert_allclose(ours.sum(axis=1), 100)


def test_a_table_is_the_mean_of_its_conditions(chapter):
    by_condition = chapter.tables["outcomes by condition"]["correct"]
    means = by_condition.groupby(level=["classifier", "signal"]).mean()
    for finding in chapter.findings[:24:3]:
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
    decisions = decide(models)
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
    columns = {m.signal.channel: m.signal.bins.columns for m in models}
    assert columns["current_a"].tolist()[:2] == ["current_a@0-1", "current_a@1-2"]
    assert len(columns["current_a"]) == 100
    assert len(columns["lvdt"]) == 99  # the slow command is filtered out with its bin
    assert READINGS["50 orders"].max_order == 50


def test_the_filter_takes_out_the_fundamental_of_the_current(campaign):
    signal = campaign.signal("thesis", "current_a")
    spectrum = signal.spectra.iloc[[0]].copy()
    orders = [float(name.partition("@")[2]) for name in spectrum]
    # A line reaches to its neighbours, an eighth away.
    inside = [abs(order - 6) + 0.125 < 0.4 for order in orders]
    assert sum(inside) == 5
    louder = spectrum.copy()
    louder.loc[:, inside] = 1e6
    np.testing.assert_allclose(signal.binning.transform(louder), signal.binning.transform(spectrum))
    np.testing.assert_array_equal(signal.binning.transform(spectrum), signal.bins.iloc[[0]])


def test_the_lvdt_is_exposed_as_deciding_on_orders_12_and_36_of_the_healthy_unit(chapter, shares):
    lines = chapter.tables["lines that determine the decisions"]
    lvdt = lines[lines["signal"] == "LVDT"]
    for condition in ("2", "3", "4", "5"):
        strongest = lvdt[lvdt["conditions"] == condition].head(4)
        assert (np.abs(strongest["order"].iloc[0] - 12) < 0.2) or (
            np.abs(strongest["order"].iloc[0] - 36) < 0.2
        )
        assert {"2xsupply", "6xsupply"} <= set(lvdt[lvdt["conditions"] == condition]["predicted"])
        assert strongest["louder"].iloc[0] == "healthy"
    carried = shares.xs("LVDT", level="signal")
    fast = carried.loc[["2", "3", "4", "5"]]
    assert (fast["electrical noise [%]"] > 20 * fast["electrical noise, by chance [%]"]).all()
    assert (fast["inner ring [%]"] < fast["inner ring, by chance [%]"]).all()


def test_the_accelerometer_is_exposed_as_deciding_on_multiples_of_6_123(chapter, shares):
    lines = chapter.tables["lines that determine the decisions"]
    ring = lines[(lines["signal"] == "Y Accelerometer") & (lines["conditions"] == "3")]
    strongest = ring.iloc[0]
    assert strongest["group"] == "inner ring"
    assert strongest["louder"] == "degraded"
    carried = shares.xs("Y Accelerometer", level="signal")
    # In condition 3 the shaft is fastest; in condition 4 folded resonances take a part. Mean and
    # standard deviation of the share over 20 draws of units; three deviations below is more than
    # the 24 % by chance.
    for conditions, mean, deviation in (("3", 85, 7), ("4", 56, 10), ("all", 83, 8)):
        row = carried.loc[conditions]
        assert row["inner ring [%]"] == pytest.approx(mean, abs=3 * deviation)
        assert mean - 3 * deviation > row["inner ring, by chance [%]"] > 20
        assert row["electrical noise [%]"] < 5


def test_lines_keep_the_shares_of_their_bins(models):
    for model in models[:2]:
        lines = explain(model)
        bins = lines.attrs["bins"]
        assert lines["share"].sum() == pytest.approx(1)
        top = bins.iloc[0]
        inside = lines[(lines["low"] > top["low"]) & (lines["low"] < top["high"])]
        around = lines[(lines["low"] >= top["low"]) & (lines["low"] <= top["high"])]
        assert inside["share"].sum() <= top["share"] * (1 + 1e-9) + 1e-12
        assert around["share"].sum() >= top["share"] * (1 - 1e-9)


def test_no_line_where_the_healthy_unit_is_louder_counts_for_the_fault(models):
    for model in models[::5]:
        lines = explain(model)
        healthy = lines[lines["louder"] == "healthy"]
        assert "inner ring" not in set(healthy["group"])


def test_shares_by_group_are_per_cent_of_the_decision(models):
    shares = explained_shares(explain(models[0]))
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
    benches = thesis_benches(seed=3, duration=0.5)
    one, two = (run_campaign(benches, n_runs=1, n_jobs=n) for n in (1, 2))
    for channel in SIGNALS:
        pd.testing.assert_frame_equal(
            one.spectra["thesis"][channel], two.spectra["thesis"][channel]
        )


def test_trained_again_it_decides_alike(campaign, models):
    again = [model for channel in SIGNALS for model in train(campaign.signal("thesis", channel))]
    pd.testing.assert_frame_equal(decide(again), decide(models))


def test_outcomes_are_named_by_the_truth():
    decisions = pd.DataFrame(
        {
            "scheme": "single",
            "outcome": ["correct", "false alarm", "missed detection", "correct"],
        }
    )
    (row,) = outcome_shares(decisions, ["scheme"]).to_numpy()
    assert row.tolist() == [50, 25, 25]


def test_the_result_comes_first_and_inputs_are_stated(chapter):
    correct = chapter.findings[0].ours
    assert chapter.opening.startswith("Result on the simulated bench: ")
    assert f"LVDT {correct:.0f} %" in chapter.opening
    assert "No data of the laboratory were published." in chapter.opening
    table = chapter.inputs
    assert table.loc["θ_s", "value"].startswith("0.01π")
    assert table.loc["electrical noise at orders 12 and 36, LVDT", "value"] == (
        "1.0 healthy, 0.2 degraded unit"
    )
    assert "severity 0.5" in table.loc["degraded unit: defect of the inner ring", "value"]
    assert "Eq. (2.1)" in table.loc["order of the inner ring", "source"]
    assert "quick form" in " ".join(chapter.remarks)


def test_stated_inputs_are_those_of_the_bench():
    healthy, degraded = thesis_benches()
    assert (healthy.electrical_noise, degraded.electrical_noise) == (1.0, 0.2)
    assert dict(degraded.faults) == {"inner ring": 0.5, "lubrication": 0.25}
    assert not healthy.faults


def test_condition_3_requires_more_than_the_peak_speed(chapter):
    table = chapter.tables["conditions"]
    # A triangle of 2.05 in at 2.14 Hz and 0.1575 in per revolution: 4 x 2.05 x 2.14 / 0.1575 rev/s.
    assert table.loc[3, "commanded speed [rev/min]"] == pytest.approx(6685, abs=1)
    assert table.loc[4, "commanded speed [rev/min]"] == pytest.approx(
        60 * 2 * np.pi * 2.2 * 0.7 / 0.1575
    )
    # 4526 of 6685 rev/min, and the time to reverse at the current limit.
    assert 55 < table.loc[3, "stroke reached [%]"] < 62
    (stated,) = (text for text in chapter.remarks if text.startswith("Condition "))
    assert stated.startswith("Condition 3 requires 6685 rev/min with the assumed lead")


def test_the_readings_stand_side_by_side_with_their_meaning(chapter):
    (name,) = (name for name in chapter.tables if name.startswith("readings"))
    table = chapter.tables[name]
    assert table.columns.tolist() == ["meaning", *SIGNALS.values()]
    assert set(table.index) == {
        (r, s) for r in ("thesis", "50 orders") for s in ("per condition", "single")
    }
    for shares in table["Current"].str.split(" / "):
        assert sum(map(float, shares)) == pytest.approx(100, abs=1)


def test_only_a_classifier_of_all_conditions_has_a_part_between_conditions(chapter):
    table = chapter.tables["orders that determine the decisions"].reset_index()
    between = table.set_index("conditions")["feature 1 between conditions [%]"]
    assert between.drop("all").isna().all()
    assert between["all"].between(0, 100).all()


def test_every_kind_of_picture_is_drawn_of_one_condition_and_has_a_caption(chapter):
    names = {f"Fig. 4.{n}" for n in (1, 2, 3, 4, 29, 30, 31, 32)}
    names |= {f"Figs. 4.{n} and 4.{n + 1}" for n in (33, 35, 37, 39)}
    names |= {"Figs. 4.65-4.68", "Figs. 4.69-4.72"}
    for where in ("condition 3", "all conditions"):
        names |= {f"Explained variance, {where}", f"Orders that determine the decisions, {where}"}
    assert set(chapter.figures) == set(chapter.captions) == names
    assert all(chapter.captions.values())


def test_pictures_are_light(chapter):
    pixels = [f.get_size_inches().prod() * f.dpi**2 for f in chapter.figures.values()]
    assert max(pixels) < 1.5e6


def test_progress_is_reported_in_lines():
    lines = []
    run_campaign(thesis_benches(duration=0.05)[:1], n_runs=5, report=lines.append)
    assert lines == [f"chapter 4: {n} of 25 recordings" for n in (10, 20, 25)]


def test_a_finding_that_does_not_agree_says_what_was_decided_on(chapter):
    for finding in chapter.findings[:24]:
        assert ("share of the decision: inner ring" in finding.note) == (
            not finding.agrees_by_range
        )


# Commands


def test_the_command_figures_show_command_and_feedback_of_position_and_load(chapter):
    for name in ("Fig. 4.29", "Fig. 4.30"):
        position, load = chapter.figures[name].axes
        assert (position.get_ylabel(), load.get_ylabel()) == ("position [in]", "load [lbf]")
        for ax in (position, load):
            feedback, command = (line.get_ydata() for line in ax.get_lines())
            assert [line.get_label() for line in ax.get_lines()] == ["feedback", "command"]
            assert len(feedback) == len(command) > 1000
        command = position.get_lines()[1].get_ydata()
        assert np.ptp(command) == pytest.approx(2 * 2.05, rel=1e-2)  # condition 3 of Table 4.3
        assert np.median(load.get_lines()[1].get_ydata()) == pytest.approx(660)


def test_no_classifier_sees_a_command():
    benches = (thesis_benches(seed=3, duration=0.5, commands=c) for c in (True, False))
    kept, plain = (run_campaign(pair, n_runs=1, keep=True) for pair in benches)
    assert "load_command" in kept.kept[0].channels
    assert set(kept.spectra["thesis"]) == set(SIGNALS)
    pd.testing.assert_frame_equal(
        kept.spectra["thesis"]["lvdt"],
        plain.spectra["thesis"]["lvdt"],
    )


def test_in_condition_1_the_housing_shakes_below_order_100_by_less_than_the_channel_s_noise():
    for bench in thesis_benches(duration=5.0):
        truth = bench.truth(1)
        top = 100 * np.abs(truth.torques.velocity).max() / (2 * np.pi)  # Hz
        hertz, psd = filters.welch(truth.acceleration, bench.fs, nperseg=12_000)
        shaken = trapezoid(psd[hertz <= top], hertz[hertz <= top])
        noise = NOISE["accelerometer"] ** 2 * top / 24_000  # white up to half of 48 kHz
        assert shaken < 0.05 * noise  # with the lines of healthy rolling elements
        assert trapezoid(psd, hertz) > 10 * shaken  # the ringing lies above


def test_an_explanation_of_bins_is_that_of_the_whole_pipeline(models):
    model = models[0]
    rows = model.signal.rows(model.conditions, training=False)
    health = model.signal.frame["health"][rows]
    whole = make_pipeline(model.signal.binning, *model.pipeline)
    expected = explain_model(whole, model.signal.spectra[rows], health)
    bins = explain(model).attrs["bins"]
    found = bins.set_index("column")["share"].sort_index()
    pd.testing.assert_series_equal(found, expected.set_index("column")["share"].sort_index())
