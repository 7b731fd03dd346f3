"""Chapter 4 on the bench: its protocol, its tables, and what its decisions rest on."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest
from scipy import signal as filters
from scipy.integrate import trapezoid

from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.campaign import thesis_benches
from emacm.simulation.sensors import NOISE
from emacm.thesis.chapter4 import OUTCOME_NAMES, PUBLISHED, QUICK, chapter4
from emacm.thesis.chapter4_control import control_campaign, equally_noisy
from emacm.thesis.chapter4_exposure import exposed_in
from emacm.thesis.chapter4_spectra import READINGS, SIGNALS, Campaign, run_campaign
from emacm.thesis.chapter4_study import (
    decide,
    expected_orders,
    explain,
    explained_shares,
    outcome_shares,
    train,
)


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
    # Both units, and the degraded one again with the cables of the healthy one.
    assert len(simulated) == 3 * 5 * QUICK.n_runs
    assert len({(unit, noise) for unit, noise, _, _ in simulated}) == 3


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
    names = {f"Fig. 4.{n}" for n in (29, 30, 31, 32)}
    names |= {f"Figs. 4.{n} and 4.{n + 1}" for n in (33, 35, 37, 39)}
    names |= {"Figs. 4.65-4.68", "Figs. 4.69-4.72"}
    for where in ("condition 3", "all conditions"):
        carried = f"What carries the decisions, {where}"
        names |= {f"Explained variance, {where}", carried, f"{carried}, stroke by stroke"}
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


# Commands


def test_the_command_figures_show_command_and_feedback_of_position_and_load(chapter):
    for name in ("Fig. 4.29", "Fig. 4.30"):
        position, load = chapter.figures[name].axes
        assert (position.get_ylabel(), load.get_ylabel()) == ("position [in]", "load [lbf]")
        for ax in (position, load):
            told, asked = (line.get_ydata() for line in ax.get_lines())
            assert [line.get_label() for line in ax.get_lines()] == ["feedback", "command"]
            assert len(told) == len(asked) > 1000
        asked = position.get_lines()[1].get_ydata()
        assert np.ptp(asked) == pytest.approx(2 * 2.05, rel=1e-2)  # condition 3 of Table 4.3
        assert np.median(load.get_lines()[1].get_ydata()) == pytest.approx(660)


def test_no_classifier_sees_a_command():
    kept = run_campaign(3, n_runs=1, duration=0.5, keep=True)
    assert "load_command" in kept.kept[0].channels
    assert set(kept.spectra["thesis"]) == set(SIGNALS)
    pd.testing.assert_frame_equal(
        kept.spectra["thesis"]["lvdt"],
        run_campaign(3, n_runs=1, duration=0.5).spectra["thesis"]["lvdt"],
    )


# What is exposed, and why


def test_velocity_stroke_by_stroke_is_exposed_where_strokes_are_longer_than_segments(chapter):
    table = chapter.tables["motion against cables"].loc["Motor Velocity"].drop("all")
    exposed = table["12 and 36, strokes [%]"] > 50
    assert (exposed == (table["longest stroke [rev]"] > 8)).all()
    assert exposed.sum() == 4


def test_velocity_over_the_travel_is_exposed_only_by_the_sine_of_long_strokes(chapter):
    table = chapter.tables["motion against cables"].loc["Motor Velocity"].drop("all")
    assert table.index[table["12 and 36, travel [%]"] > 50].tolist() == ["4"]


def test_cables_carry_where_they_exceed_the_second_pattern_of_all_else(chapter):
    table = chapter.tables["motion against cables"]
    for called in ("travel", "strokes"):
        ratio = table[f"cables, {called} [unit²]"] / table[f"second scatter, {called} [unit²]"]
        share = table[f"12 and 36, {called} [%]"]
        assert (share[ratio < 0.5] < 50).all()
        assert (ratio[share > 50] > 1).all()


def test_less_of_the_bearing_is_folded_in_the_faster_the_shaft_turns(chapter):
    table = chapter.tables["linear and band-limited"].drop("all")
    ranked = table.sort_values("order 100 at most [Hz]")
    assert ranked["folded in [%]"].is_monotonic_decreasing
    assert ranked.index.tolist() == ["1", "5", "2", "4", "3"]
    assert ranked["modes above [Hz]"].tolist() == [
        "420, 1900, 5200",
        "1900, 5200",
        "1900, 5200",
        "5200",
        "none",
    ]


def test_without_folding_the_bearing_shows_wherever_a_mode_is_below_order_100(chapter):
    table = chapter.tables["linear and band-limited"].drop("all")
    assert table.index[table["inner ring, band-limited [%]"] > 50].tolist() == ["2", "3", "4", "5"]
    assert table.loc["1", "inner ring, band-limited [%]"] < 24  # by chance


def test_the_opening_names_what_is_exposed(chapter):
    for words in (
        "motor velocity, over the travel: condition 4;",
        "motor velocity, stroke by stroke: conditions 2, 3, 4 and 5",
        "without folding: conditions 2, 3, 4 and 5, and all together",
    ):
        assert words in chapter.opening
    text = " ".join(chapter.remarks)
    assert "what is not exposed is condition 1 (0.99 revolutions)" in text
    assert "modes above it 420 and 1900 and 5200" in text


def test_in_condition_1_the_housing_shakes_below_order_100_by_less_than_the_channel_s_noise():
    for bench in thesis_benches(duration=5.0):
        truth = bench.truth(1)
        top = 100 * np.abs(truth.torques.velocity).max() / (2 * np.pi)  # Hz
        hertz, psd = filters.welch(truth.acceleration, bench.fs, nperseg=12_000)
        shaken = trapezoid(psd[hertz <= top], hertz[hertz <= top])
        noise = NOISE["accelerometer"] ** 2 * top / 24_000  # white up to half of 48 kHz
        assert shaken < 0.01 * noise
        assert trapezoid(psd, hertz) > 10 * shaken  # the ringing lies above


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ({"1": 0, "all": 51}, "all together"),
        ({"1": 51, "2": 50}, "condition 1"),
        ({"1": 51, "2": 52, "5": 53, "all": 99}, "conditions 1, 2 and 5, and all together"),
        ({"1": 0}, "none"),
    ],
)
def test_exposed_is_more_than_half(shares, words):
    assert exposed_in(pd.Series(shares)) == words


def test_the_shares_of_the_main_reading_are_told_once(chapter):
    shares = chapter.tables["shares by reading"]
    carried = chapter.tables["what carries the decisions"]
    for group in ("inner ring", "electrical noise", "shaft"):
        thesis = shares.xs("thesis")[f"{group} [%]"]
        pd.testing.assert_series_equal(thesis, carried[f"{group} [%]"], check_like=True)
    strokes = shares.xs("strokes")["electrical noise [%]"]
    pd.testing.assert_series_equal(
        strokes, carried["electrical noise, strokes [%]"], check_names=False, check_like=True
    )


# The control


def test_the_control_makes_cables_equal_and_nothing_else():
    healthy, degraded = thesis_benches(seed=4, duration=0.2)
    one, other = equally_noisy(healthy, degraded)
    assert one is healthy
    levels = [bench.electrical_noise * bench.built.electrical_noise for bench in (one, other)]
    assert levels[0] == pytest.approx(levels[1])
    before, after = degraded.record(3), other.record(3)
    for name in ("current_a", "accelerometer"):
        assert np.array_equal(before.signals[name], after.signals[name])
    for name in ("lvdt", "velocity"):
        assert not np.array_equal(before.signals[name], after.signals[name])


def test_the_control_keeps_the_healthy_unit_and_its_other_channels(campaign):
    again = control_campaign(campaign, 3, readings=["thesis"], duration=1.0)
    healthy = (campaign.frame["health"] == "healthy").to_numpy()
    before, after = campaign.spectra["thesis"], again.spectra["thesis"]
    for channel in SIGNALS:
        pd.testing.assert_frame_equal(before[channel][healthy], after[channel][healthy])
    pd.testing.assert_frame_equal(before["accelerometer"], after["accelerometer"])
    assert not np.allclose(before["lvdt"][~healthy], after["lvdt"][~healthy])


def test_with_equal_cables_lines_at_12_and_36_are_alike_in_both_units(campaign):
    again = control_campaign(campaign, 3, readings=["thesis"], duration=1.0)
    table = again.spectra["thesis"]["lvdt"]
    orders = np.array([float(name.partition("@")[2]) for name in table])
    health = campaign.frame["health"]
    fast = campaign.frame["condition"] == 4
    for order in (12, 36):
        near = np.abs(orders - order) < 0.3
        level = {
            name: table.loc[(health == name) & fast, near].to_numpy().sum(axis=1).mean()
            for name in ("healthy", "degraded")
        }
        assert level["degraded"] == pytest.approx(level["healthy"], rel=0.3)


def test_a_campaign_in_another_order_is_refused(campaign):
    turned = Campaign(campaign.frame[::-1].reset_index(drop=True), campaign.spectra, {})
    with pytest.raises(ValueError, match="must list the healthy unit first"):
        control_campaign(turned, 3, readings=["thesis"], duration=1.0)


def test_without_the_cable_the_lvdt_over_the_travel_falls_to_chance(chapter):
    table = chapter.tables["control: equal noise in the cables"]
    lvdt = table.loc["LVDT"].drop("all")
    assert lvdt["correct, travel [%]"].mean() > 90
    # 40 decisions of chance are right in 50 +- 8 %.
    assert abs(lvdt["correct, travel, equal noise [%]"].mean() - 50) < 24
    assert (lvdt["12 and 36, travel, equal noise [%]"] < lvdt["12 and 36, travel [%]"])[1:].all()
    assert "Control: the first pair" in chapter.remarks[-1]
