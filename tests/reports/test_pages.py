"""What the pages of maintenance reports state."""

import re

import numpy as np
import pytest
from bearing_models import BEARING, COST, STATES, bins_model, fitted, recording, runs, steps
from sklearn.ensemble import RandomForestClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from emacm import (
    BinTransformer,
    ConditionRouter,
    CostSensitiveGaussianBayes,
    FaultLines,
    Gear,
    LeastRiskClassifier,
    OrderPSD,
    OrderResampler,
    Recording,
    RecordingStatistics,
    bearing_recipe,
    describe_model,
    family_costs,
    save_model,
)
from emacm.reports.maintenance import read_settings
from emacm.reports.pages import Page, lines_of_envelopes, page_of
from emacm.reports.pictures import drawn


def page(model, new, name="run 7", **options):
    options.setdefault("parts", BEARING)
    return page_of(read_settings(model, **options), lambda: new, name)


def bin_deviation(state, line, model):
    """Return by how many dB the bin of a line is above the mean of the healthy ones."""
    names = list(model[2].get_feature_names_out())
    levels = 10 * np.log10(model[:3].transform([*runs()[::3], recording(state, 99)]))
    (column,) = [k for k, n in enumerate(names) if n.startswith(f"vib@{line}-")]
    return levels[-1, column] - levels[:-1, column].mean()


def rises(row):
    """Return the rises of the lines in a row [dB]."""
    return [float(text) for text in re.findall(r"\+(\d+)", row.raised)]


def test_a_page_states_which_lines_of_which_component_rose_by_how_many_decibels():
    found = page(bins_model(), recording("outer race", 99))
    assert (found.decision, found.kind) == ("outer race", "fault")
    first = found.findings.rows[0]
    assert first.component == "outer ring (drive end BPFO)"
    assert (first.channel, first.orders) == ("vib", "3.562 (1x), 7.125 (2x), 10.69 (3x)")
    assert first.raised.startswith("at least +")
    sizes = [bin_deviation("outer race", line, bins_model()) for line in ("3.5", "7", "10.5")]
    for rise, size in zip(rises(first), sizes, strict=True):
        assert size - 3.5 < rise <= size + 0.5  # at the edge of a bin, both may hold the line
    assert len(found.findings.rows) == 1
    assert not any("lines of" in text for text in found.normal)  # it is faulty
    assert "no order band and no feature of amps deviates from 'healthy'" in found.normal
    exact = page(bins_model(), recording("outer race", 99), background=runs()[::3]).findings.rows[0]
    assert (exact.component, exact.orders) == (first.component, first.orders)
    assert not exact.raised.startswith("at least")
    assert min(rises(exact)) > max(rises(first))  # above the noise at the line alone


def test_pages_refer_to_the_healthy_state_that_is_stored_with_the_model(tmp_path):
    german = {"healthy": "gut", "outer race": "aussenring", "inner race": "innenring"}
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    model = make_pipeline(*steps(FunctionTransformer(np.log10), bayes=bayes))
    model.fit(runs(), [german[label] for label in STATES])
    with pytest.raises(ValueError, match="healthy"):
        save_model(model, tmp_path / "german.emacm", healthy="normal")
    save_model(model, tmp_path / "german.emacm", healthy="gut")
    assert describe_model(tmp_path / "german.emacm")["healthy"] == "gut"
    found = page(tmp_path / "german.emacm", recording("healthy", 99))
    assert (found.decision, found.kind, found.reference) == ("gut", "healthy", "gut")
    found = page(tmp_path / "german.emacm", recording("outer race", 99))
    assert (found.decision, found.kind, found.reference) == ("aussenring", "fault", "gut")


@pytest.mark.slow
def test_lines_in_the_envelope_are_stated_whatever_the_model_decides():
    rng, turns = np.random.default_rng(0), 3.57 * 30 * np.arange(60_000) / 12_000
    turns += 0.001 * np.cumsum(rng.normal(size=len(turns)))
    hits = np.diff(np.floor(turns), prepend=0)
    ring = np.exp(-np.arange(90) / 12) * np.sin(1.9 * np.arange(90))
    signal = 20 * np.convolve(hits, ring)[: len(hits)] + rng.normal(size=len(hits))
    run = Recording({"vib": signal}, 12_000, velocity=2 * np.pi * 30)
    shaken = Page("run", "healthy", "healthy")
    assert lines_of_envelopes(shaken, BEARING, run) == ["drive end BPFO"]
    assert shaken.sentences[0].startswith("In the envelope of vib, without training: drive end")
    in_amperes = Recording({"vib": signal}, 12_000, velocity=188.5, units={"vib": "A"})
    assert lines_of_envelopes(shaken, BEARING, in_amperes) == []


def test_a_healthy_recording_has_nothing_raised_and_much_that_is_normal():
    found = page(bins_model(), recording("healthy", 97))
    assert (found.decision, found.kind) == ("healthy", "healthy")
    assert found.findings.rows == found.first == []
    assert any("speed, sampling rates, levels and length" in text for text in found.normal)
    assert any("without clipping" in text for text in found.normal)
    assert any("of the training recordings are as far" in text for text in found.normal)


GEAR = Gear(18, 67)  # hunting tooth at order 0.0149
PINION = {1: 0.1, 2: 0.1, 3: 0.1, 18: 0.3}
RISES = {1: 4.5, 2: 20.8, 3: 0.0}  # dB
WORN = {k: size * 10 ** (RISES.get(k, 0.0) / 20) for k, size in PINION.items()}


def turning(lines, seed):
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * 200 * np.arange(20_000) / 20_000
    wave = 0.1 * rng.normal(size=len(angle))
    for order, size in lines.items():
        wave += size * (1 + 0.05 * rng.normal()) * np.sin(order * angle + rng.uniform(0, 6))
    return Recording({"vib": wave}, 2000, velocity=40 * np.pi, units={"vib": "V"})


def test_only_lines_that_rose_are_named_and_none_below_the_resolution():
    X = [turning(lines, seed) for seed, lines in enumerate([PINION, WORN] * 8)]
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    table = BinTransformer(1.0, max_order=24), FunctionTransformer(np.log10)
    spectra = OrderResampler(2 * np.pi / 64), OrderPSD(25, max_order=24)
    model = make_pipeline(*spectra, *table, bayes).fit(X, ["healthy", "worn"] * 8)
    found = page(model, turning(WORN, 99), parts=GEAR)
    assert [row[:3] for row in found.findings.rows] == [("pinion", "vib", "2 (2x)")]
    assert 15 < rises(found.findings.rows[0])[0] <= 21
    assert any("do not resolve the lines of hunting tooth (hunting)" in n for n in found.notes)
    found = page(model, turning(WORN, 99), parts=GEAR, background=X[::2])
    assert [row[:3] for row in found.findings.rows] == [("pinion", "vib", "1 (1x), 2 (2x)")]
    assert rises(found.findings.rows[0]) == pytest.approx([RISES[1], RISES[2]], abs=1)


@pytest.mark.parametrize(("decibel", "text"), [(-2.0, "−2 dB"), (2.0, "+2 dB")])
def test_a_gain_of_all_orders_is_one_row_and_no_band_deviates(decibel, text):
    found = page(bins_model(), recording("healthy", 97, gain=10 ** (decibel / 20)))
    assert found.findings.rows == [("all orders together", "vib", "all", text)]


def test_an_unknown_state_states_what_deviates_and_that_it_is_not_known():
    found = page(bins_model(), recording("healthy", 96, order=4.2))
    assert (found.decision, found.kind) == ("unknown", "unknown")
    assert "unlike all states that the model knows (healthy, inner race and" in found.sentences[0]
    assert any("orders 4 to 4.5 of 'vib'" in text for text in found.statements)
    assert [(row.component, row.orders) for row in found.findings.rows] == [
        ("no known part", "4.188, 8.375, 12.56")
    ]


def test_a_weak_new_line_is_stated_although_the_decision_is_healthy():
    known = recording("healthy", 93)
    wave = 0.2 * np.sin(4.2 * 110.0 * np.arange(9000) / 2000)
    signals = {"vib": known.signals["vib"] + wave, "amps": known.signals["amps"]}
    found = page(bins_model(), Recording(signals, 2000, velocity=110.0, units=known.units))
    assert (found.decision, found.kind, found.doubtful) == ("healthy", "healthy", False)
    (text,) = found.first
    assert text.startswith("line at order 4.188 of 'vib', ")
    assert text.endswith(" dB above the training maximum")


def test_wrong_input_is_stated_first_and_makes_the_decision_doubtful():
    found = page(bins_model(), recording("outer race", 95, gain=1000))
    assert found.doubtful
    assert "channel 'vib' 60 dB above training" in found.first[0]
    assert found.findings.rows[0] == ("all orders together", "vib", "all", "+60 dB")
    assert found.findings.rows[1].component == "outer ring (drive end BPFO)"  # beyond the gain
    assert not any("levels and length within" in text for text in found.normal)
    signals = dict(recording("healthy", 94).signals)
    signals["vib"] = np.clip(signals["vib"], -0.8, 0.8)
    found = page(bins_model(), Recording(signals, 2000, velocity=110.0))
    assert found.doubtful
    assert "clipped" in found.first[0]
    assert not any("without clipping" in text for text in found.normal)


def test_a_family_has_the_probability_of_its_states():
    families = {"healthy": ["healthy"], "bearing": ["outer race", "inner race"]}
    bayes = CostSensitiveGaussianBayes(family_costs(families), covariance="tied", shrinkage="auto")
    model = fitted(make_pipeline(*steps(FunctionTransformer(np.log10), bayes=bayes)))
    found = page(model, recording("outer race", 91))
    assert (found.decision, found.kind) == ("bearing", "fault")
    assert "above 99 %" in found.sentences[0]
    assert any("not calibrated" in text for text in found.sentences)


def test_an_improbable_decision_states_that_its_reason_are_the_costs():
    model = fitted(make_pipeline(*steps(FunctionTransformer(np.log10))))
    model.set_params(costsensitivegaussianbayes__cost={("healthy", "outer race"): 1e9})
    model.set_params(costsensitivegaussianbayes__temperature=1e3)
    found = page(model, recording("healthy", 90))
    assert found.decision == "outer race"
    assert any("because the costs of the other decisions" in text for text in found.sentences)
    assert found.sentences[0].startswith("Confidence: low")


# Models of other kinds


@pytest.mark.parametrize("parts", [None, BEARING])
def test_fault_lines_name_the_component(parts):
    lines = FaultLines(BEARING, harmonics=2)
    model = fitted(make_pipeline(*steps(StandardScaler(), table=lines)))
    found = page(model, recording("outer race", 99), parts=parts)
    assert found.decision == "outer race"
    first = found.findings.rows[0]
    assert (first.component, first.channel) == ("outer ring (drive end BPFO)", "vib")
    levels = model[:3].transform([*runs()[::3], recording("outer race", 99)])[:, 0]
    assert first.raised == f"+{levels[-1] - levels[:-1].mean():.0f} dB"
    # The third line of BPFO is where the second one of BPFI may be; the spectrum decides.
    assert not any("BPFI" in row.component for row in found.findings.rows)


def test_a_router_is_stated_by_the_model_of_the_condition():
    router = ConditionRouter(make_pipeline(*steps(FunctionTransformer(np.log10))), condition="load")
    X = [recording(s, k, meta={"load": 40 * (k % 2)}) for k, s in enumerate(np.repeat(STATES, 2))]
    groups = np.arange(48) // 6
    router.fit(X, np.repeat(STATES, 2), costsensitivegaussianbayes__groups=groups)
    found = page(router, recording("outer race", 99, meta={"load": 40}))
    assert found.findings.rows[0].component == "outer ring (drive end BPFO)"
    assert list(found.spectra)
    assert ("Meta", "load = 40") in found.recording


def test_a_finding_that_the_training_has_too_is_a_note():
    options = {"theta_s": 2 * np.pi / 200}  # reaches orders that the sampling rate does not contain
    model = fitted(make_pipeline(*steps(FunctionTransformer(np.log10), **options)))
    assert model[0].training_range_.defects
    found = page(model, recording("outer race", 99))
    assert found.first == []
    assert not found.doubtful
    assert any(text.startswith("As in the training: ") for text in found.notes)


def test_an_envelope_is_named_as_such():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    bayes = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    recipe = bearing_recipe({"line": 3.6}, revolutions=16, harmonics=1, classifier=bayes)
    model = recipe.set_params(envelopedetector__squared=True).fit(runs(), STATES)
    found = page(model, recording("outer race", 99), parts=None)
    figure, _ = drawn(found)
    label = figure.axes[0].get_ylabel().replace("\n", " ")
    assert label.startswith("squared envelope order spectrum of ")
    assert figure.axes[1].get_xticklabels()[0].get_text().endswith("@line")


def test_an_order_with_a_name_of_two_words_is_marked_by_all_of_it():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    model = fitted(make_pipeline(*steps(FunctionTransformer(np.log10))))
    figure, _ = drawn(page(model, recording("outer race", 99), parts={"fan blade": 3.6}))
    marks = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert "fan blade" in marks


def test_a_model_without_densities_states_why_no_orders_are_given():
    forest = LeastRiskClassifier(RandomForestClassifier(30, random_state=0), COST)
    model = fitted(make_pipeline(*steps(FunctionTransformer(np.log10), bayes=forest)))
    found = page(model, recording("outer race", 99))
    assert found.decision == "outer race"
    assert found.findings is None
    assert any(text.startswith("Which orders are raised is not known") for text in found.notes)


def test_features_without_orders_are_in_standard_deviations():
    model = make_pipeline(
        RecordingStatistics(("std", "kurtosis")),
        CostSensitiveGaussianBayes(covariance="tied", shrinkage=0.1),
    ).fit(runs(), STATES)
    found = page(model, recording("outer race", 99, gain=30.0))
    assert found.findings.rows[0].orders == "std"
    assert found.findings.rows[0].channel == "vib"
    assert found.findings.rows[0].raised.endswith("standard deviations")
    assert not found.spectra


def test_without_a_healthy_state_the_most_probable_other_one_is_the_reference():
    faulty = STATES != "healthy"
    model = make_pipeline(*steps(FunctionTransformer(np.log10)))
    model.set_params(costsensitivegaussianbayes__cost=None)
    X = [run for run, chosen in zip(runs(), faulty, strict=True) if chosen]
    model.fit(X, STATES[faulty], costsensitivegaussianbayes__groups=np.arange(16) // 2)
    found = page(model, recording("outer race", 99))
    assert found.reference == "inner race"
    assert {row.component for row in found.findings.rows} >= {"outer ring (drive end BPFO)"}


# Facts and settings


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"actions": {"worn": "Look."}}, ValueError, "action for 'worn'"),
        ({"actions": {"healthy": 3}}, ValueError, "action for 'healthy'"),
        ({"actions": "none"}, TypeError, "must map decisions to texts"),
        ({"healthy": "good"}, ValueError, "healthy must name the healthy state"),
        ({"parts": "bearing"}, TypeError, "parts must be a part such as a Bearing"),
    ],
)
def test_invalid_settings_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        read_settings(bins_model(), **options)
