"""A fault is named from the geometry, and a machine without one is not."""

import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import (
    Bearing,
    CostSensitiveGaussianBayes,
    Gear,
    Motor,
    Recording,
    bearing_recipe,
    find_faults,
)
from emacm.machine.fault_spectra import healthy_scores
from emacm.machine.find_faults import NamingSettings

FS = 12_000
BEARING = Bearing(9, 7.94, 39.04)  # 6205
ORDERS = {"BPFO": 3.5848, "BPFI": 5.4152, "BSF": 2.3567, "FTF": 0.3983}
TURN = 2 * np.pi
RING = np.exp(-np.arange(150) / 20) * np.sin(TURN * 3100 / FS * np.arange(150))


def running(fault=None, *, seed=0, slip=-0.008, seconds=5, strength=1.0, resonance=RING, **meta):
    """A bearing at 27 to 31 rev/s, under noise and a shaft harmonic far above both."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * FS) / FS
    velocity = TURN * (29 + 2 * np.sin(0.7 * t))
    angle = np.cumsum(velocity) / FS
    signal = rng.standard_normal(len(t)) + 30 * np.sin(angle) + 5 * np.sin(7 * angle + 1)
    if fault is not None:
        order = ORDERS.get(fault, 23 / 67) * (1 + slip) * (2 if fault == "BSF" else 1)
        struck = np.diff(np.floor(order * angle / TURN), prepend=0) > 0
        load = {"BPFI": 1 + np.cos(angle), "BSF": 1 + np.cos(ORDERS["FTF"] * angle)}
        struck = struck * load.get(fault, 1.0)
        signal += 12 * strength * np.convolve(struck, resonance)[: len(t)]
    return Recording({"casing": signal}, FS, velocity=velocity, meta=meta)


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        ("BPFO", "outer ring"),
        pytest.param("BPFI", "inner ring", marks=pytest.mark.slow),
        pytest.param("BSF", "ball", marks=pytest.mark.slow),
    ],
)
def test_each_fault_is_named_at_varying_speed_beside_strong_harmonics(fault, kind):
    found = find_faults([running(fault)], BEARING)
    row = found.iloc[0]
    assert row["named"] == fault
    assert f"<td>{fault}</td>" in found._repr_html_()
    assert row[fault] > 6
    assert row[f"p({fault})"] < 0.001
    assert row["slip"] == pytest.approx(-0.008, abs=0.006)
    assert row["explanation"].startswith(f"{fault} and its harmonics are ")
    assert row["explanation"].endswith(f": {kind}")


PAIRS = [("BPFO", "BPFI"), ("BPFO", "BSF"), ("BPFI", "BSF")]


@pytest.mark.parametrize(
    ("pair", "strengths"),
    [(PAIRS[0], (1.0, 1.0))]
    + [
        pytest.param(PAIRS[k], strengths, marks=pytest.mark.slow)
        for k, strengths in ((0, (1.0, 0.5)), (1, (0.5, 1.0)), (2, (1.0, 0.5)), (2, (0.5, 1.0)))
    ],
)
def test_two_faults_are_named_together(pair, strengths):
    parts = [running(f, strength=s) for f, s in zip(pair, strengths, strict=True)]
    both = sum(part.signals["casing"] for part in parts) - running().signals["casing"]
    run = Recording({"casing": both}, FS, velocity=parts[0].velocity)
    assert set(find_faults([run], BEARING)["named"][0].split(" + ")) == set(pair)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda x: 0 * x, "is constant"),
        (lambda x: np.where(np.arange(len(x)) < len(x) / 4, x, 0.0), "drop-outs"),
        (lambda x: np.clip(x, -20, 20), "is clipped"),
        (lambda x: np.sign(x) * (np.abs(x) > 20), "at most 3 values"),
    ],
)
def test_a_channel_without_an_answer_is_not_assessed(change, reason):
    run = running("BPFO")
    changed = Recording({"casing": change(run.signals["casing"])}, FS, velocity=run.velocity)
    found = find_faults([changed], BEARING).iloc[0]
    assert found["named"] == "not assessed"
    assert reason in found["explanation"]


@pytest.mark.parametrize("error", [0.95, 1.06])
def test_a_wrong_speed_is_noticed_and_the_right_one_is_stated(error):
    t = np.arange(5 * FS) / FS
    struck = np.diff(np.floor(3.56 * 30 * t), prepend=0) > 0
    signal = np.convolve(struck, 12 * RING)[: len(t)] + np.random.default_rng(0).normal(size=len(t))
    run = Recording({"casing": signal}, FS, velocity=TURN * 30 * error)
    found = find_faults([run], BEARING).iloc[0]
    assert (found["named"], found["suspected"]) == ("not assessed", "BPFO")
    stated = float(re.search(r"is the speed (\d+) rpm", found["explanation"])[1])
    assert stated == pytest.approx(1800, rel=0.015)  # 0.7 % of slip


def with_harmonics(run, factor=1.0):
    """Add six harmonics of the shaft, and state a speed that is wrong by a factor."""
    signal = run.signals["casing"] + sum(0.4 * np.sin(k * run.angle) for k in range(1, 7))
    return Recording({"casing": signal}, FS, velocity=factor * run.velocity)


@pytest.mark.parametrize("factor", [0.96, 1.04])
def test_a_healthy_machine_at_a_wrong_speed_is_not_assessed(factor):
    run = running()
    right, wrong = find_faults([with_harmonics(run, f) for f in (1, factor)], BEARING).itertuples()
    assert (right.named, right.suspected) == ("none", "none")
    assert (wrong.named, wrong.suspected) == ("not assessed", "none")
    stated = float(re.search(r"harmonics of .* is the speed (\d+) rpm", wrong.explanation)[1])
    assert stated == pytest.approx(60 * run.velocity.mean() / TURN, rel=0.003)


def ring_fault(fault, seed, factor):
    """Return 8 s of a bearing at 900 rpm, whose stated speed is wrong by a factor."""
    rng, t = np.random.default_rng(seed), np.arange(8 * FS) / FS
    signal = rng.standard_normal(len(t))
    if fault is not None:
        struck = np.diff(np.floor(0.995 * ORDERS[fault] * 15 * t), prepend=0) > 0
        load = 1 + np.cos(TURN * 15 * t) if fault == "BPFI" else 1.0
        signal += np.convolve(12 * struck * load, RING)[: len(t)]
    return Recording({"casing": signal}, FS, velocity=TURN * 15 * factor)


@pytest.fixture(scope="module")
def healthy_at_900_rpm():
    return healthy_scores([ring_fault(None, seed, 1.0) for seed in range(20, 24)], BEARING)


@pytest.mark.parametrize("factor", [1.0, 0.96, 1.07])
def test_a_wrong_speed_is_noticed_with_healthy_recordings_too(factor, healthy_at_900_rpm):
    faults = ["BPFO", "BPFI"] * 3
    runs = [ring_fault(fault, seed, factor) for seed, fault in enumerate(faults)]
    found = find_faults(runs, BEARING, healthy=healthy_at_900_rpm)
    assert found["named"].tolist() == (faults if factor == 1.0 else ["not assessed"] * 6)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_table_beside_a_healthy_one_has_no_answer_at_a_wrong_speed(factor):
    spectra = bearing_recipe(BEARING)[:-1]
    healthy = spectra.fit_transform([ring_fault(None, seed, 1.0) for seed in (20, 21)])
    table = spectra.fit_transform([ring_fault("BPFI", 1, factor)])
    expected = "BPFI" if factor == 1.0 else "not assessed"
    assert find_faults(table, BEARING, healthy=healthy)["named"].tolist() == [expected]


def test_healthy_recordings_at_a_wrong_speed_are_refused():
    healthy = [running(seed=1), with_harmonics(running(seed=2), 1.05)]
    with pytest.raises(ValueError, match=r"healthy: recording 1: harmonics of .* is the speed 1"):
        find_faults([running()], BEARING, healthy=healthy)


def test_lines_of_healthy_recordings_are_no_evidence_of_another_speed():
    second = {"BPFO": ORDERS["BPFO"] / 1.05}  # the healthy machine has lines 5 % above it
    run, *healthy = [running("BPFO", seed=seed) for seed in range(3)]
    assert find_faults([run], second)["named"].tolist() == ["not assessed"]
    assert find_faults([run], second, healthy=healthy)["named"].tolist() == ["none"]


def test_without_slip_an_error_of_the_speed_that_is_rounding_changes_nothing():
    run = with_harmonics(running("BPFO", slip=0.0), 1.001)
    assert find_faults([run], BEARING, slip=0.0)["named"][0] == "BPFO"


@pytest.mark.parametrize("factor", [0.981, 1.019])
def test_a_small_error_of_the_speed_is_corrected(factor):
    run = running("BPFI", strength=2)
    right, wrong = find_faults([with_harmonics(run, f) for f in (1, factor)], BEARING).itertuples()
    assert right.named == wrong.named == "BPFI"
    assert "by the harmonics of the shaft" not in right.explanation
    assert wrong.slip == pytest.approx(right.slip, abs=0.003)
    stated = float(re.search(r"corrected to (\d+) rpm by the harmonics", wrong.explanation)[1])
    assert stated == pytest.approx(60 * run.velocity.mean() / TURN, rel=0.003)


def test_a_wrong_geometry_is_stated_by_the_corrected_speed():
    run = with_harmonics(running("BPFO", slip=0.0), 0.985)
    found = find_faults([run], {"BPFO": ORDERS["BPFO"] / 1.05, "other": 5.1}).iloc[0]
    assert (found["named"], found["suspected"]) == ("not assessed", "BPFO")
    asked = float(re.search(r"is the speed (\d+) rpm", found["explanation"])[1])
    assert asked == pytest.approx(1.05 * 60 * running().velocity.mean() / TURN, rel=0.005)


def test_impacts_of_a_bearing_of_another_size_are_stated():
    runs = [running("BPFO", slip=order / ORDERS["BPFO"] - 1) for order in (3.04, 4.2)]
    found = find_faults([*runs, running()], [BEARING, {"imbalance": 1.0}])
    small, large, own = found["explanation"]
    assert re.search("lines near 3.0[2-6] .* belong to no part", small)
    assert re.search("lines near 4.(1[89]|2[0-2]) .* belong to no part", large)
    assert "belong to no part" not in own


@pytest.mark.slow
def test_machines_without_a_fault_are_rarely_named():
    runs = [running(seed=seed, seconds=2) for seed in range(40)]
    found = find_faults(runs, BEARING)
    assert (found["named"] != "none").sum() <= 1  # at a false alarm rate of 1 % or less
    assert found["explanation"].str.startswith("no fault: ").sum() >= 39
    assert np.abs(found[list(ORDERS)].to_numpy().mean(axis=0)).max() < 0.6  # background scores 0


def test_without_a_threshold_the_highest_score_is_named():
    found = find_faults([running(seed=3)], BEARING, false_alarm=1).iloc[0]
    assert found["named"] == found[["BPFO", "BPFI", "BSF"]].astype(float).idxmax()


def test_a_fault_below_the_limit_that_is_set_is_suspected():
    found = find_faults([running("BPFO")], BEARING, settings=NamingSettings(named=40.0)).iloc[0]
    assert (found["named"], found["suspected"]) == ("none", "BPFO")
    assert "is below 40.0 dB" in found["explanation"]


@pytest.mark.slow
def test_a_healthy_machine_with_lines_of_its_own_raises_the_threshold():
    run = running("BPFO", strength=0.5)
    own = [running("BPFO", strength=0.5, seed=seed) for seed in (5, 6)]
    assert find_faults([run], BEARING)["named"].tolist() == ["BPFO"]
    calibrated = find_faults([run, running("BPFI")], BEARING, healthy=own)
    assert calibrated["named"].tolist() == ["none", "BPFI"]
    assert calibrated["calibrated"].all()
    assert "is below" in calibrated["explanation"][0]


def test_a_table_of_order_spectra_gives_what_the_recordings_give():
    runs = [running("BPFO"), running(seed=1)]
    expected = find_faults(runs, BEARING)
    table = bearing_recipe(BEARING)[:-1].fit_transform(runs)
    pd.testing.assert_frame_equal(find_faults(table, BEARING), expected)
    frame = pd.DataFrame(np.asarray(table), columns=table.columns)
    pd.testing.assert_frame_equal(find_faults(frame, BEARING), expected)


def test_each_channel_has_a_row_and_each_recording_is_judged_alone():
    run = running("BPFO")
    signals = {"z": run.signals["casing"], "a": running(seed=9).signals["casing"]}
    two = Recording(signals, FS, velocity=run.velocity)
    found = find_faults([two, two], BEARING)
    assert found["recording"].tolist() == [0, 0, 1, 1]
    assert found["channel"].tolist() == ["z", "a", "z", "a"]
    assert found["named"].tolist() == ["BPFO", "none"] * 2
    (alone,) = find_faults([two], BEARING, channels=["z"])["BPFO"]
    assert alone == found["BPFO"][0]


def test_the_cage_alone_makes_the_ball_suspected():
    orders = np.arange(0, 501) / 25
    psd = np.random.default_rng(4).standard_gamma(6, len(orders))
    for k in (1, 2, 3):
        psd[round(k * ORDERS["FTF"] * 25)] *= 60
    columns = [f"casing@{order!r}" for order in orders.tolist()]
    cage = find_faults(pd.DataFrame([psd], columns=columns), BEARING).iloc[0]
    assert (cage["named"], cage["suspected"]) == ("none", "BSF")
    assert ": cage, or the modulation of BSF" in cage["explanation"]
    for k in (2, 4, 6):
        psd[round(k * ORDERS["BSF"] * 25)] *= 20
    assert find_faults(pd.DataFrame([psd], columns=columns), BEARING)["named"].tolist() == ["BSF"]


def test_a_line_below_the_resolution_of_the_spectrum_is_not_measured():
    # Of a shaft that turns once in ten revolutions, the cage has a line at order 0.04.
    parts = [BEARING, Bearing(9, 7.94, 39.04, ratio=0.1, name="slow")]
    found = find_faults([running("BPFO")], parts).iloc[0]
    assert found["named"] == "BPFO"
    assert found[["slow FTF", "slow BPFO"]].isna().tolist() == [True, False]
    with pytest.raises(ValueError, match=r"first line of 'slow'.*Raise revolutions"):
        bearing_recipe({"slow": 0.04, "BPFO": 3.58}).fit([running()])


def test_of_two_equal_bearings_both_are_stated():
    parts = [Bearing(9, 7.94, 39.04, name=name) for name in ("drive end", "fan end")]
    text = find_faults([running("BPFO")], parts)["explanation"][0]
    assert text.startswith("drive end BPFO (or fan end BPFO: the same lines) and its harmonics are")
    assert text.endswith(": outer ring")


def test_lines_of_a_wheel_and_of_the_pinion_behind_it_are_not_said_to_be_of_one():
    stages = [Gear(23, 67, name="first"), Gear(20, 50, ratio=23 / 67, name="second")]
    text = find_faults([running("wheel", slip=0)], stages)["explanation"][0]
    assert "first wheel (or second pinion: the same lines) and its harmonics, " in text


def test_a_cage_beside_healthy_recordings_is_no_ring_and_a_new_belt_is_suspected():
    healthy = [running(seed=seed) for seed in (1, 2)]
    cage = find_faults([running("FTF", strength=0.5)], BEARING, healthy=healthy)
    assert cage["named"].tolist() == ["FTF"]
    still = [healthy_machine(None, seed=seed) for seed in (12, 13)]
    belt = find_faults([healthy_machine("a belt")], BEARING, healthy=still)
    assert belt[["named", "suspected"]].to_numpy().tolist() == [["none", "BSF"]]


def test_a_gear_beside_a_bearing_needs_healthy_recordings():
    parts, runs = [BEARING, Gear(23, 67), Motor(4)], [running("wheel", slip=0), running("BPFI")]
    found = find_faults(runs, parts)
    assert found[["named", "suspected"]].to_numpy().tolist() == [["none"] * 2, ["BPFI", "none"]]
    assert found["explanation"][0].endswith("a gear needs healthy recordings")
    assert not {"mesh", "hunting", "shaft"} & set(found)
    calibrated = find_faults(runs, parts, healthy=[running(seed=s) for s in (1, 2)])
    assert calibrated["named"].tolist() == ["wheel", "BPFI"]


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"parts": Motor(4)}, ValueError, "no lines of damage. Add a Bearing"),
        ({"X": running(seconds=1)}, TypeError, r"write \[recording\]"),
        ({"channels": ["lvdt"]}, ValueError, "recording 0.*no channel 'lvdt'"),
        ({"false_alarm": 1e-4}, ValueError, "false_alarm = 0.0001 is below 0.002"),
        ({"X": [running(seconds=0.2)]}, ValueError, "5.83 revolutions; 10 are needed"),
        ({"parts": {"mesh": 61.0}}, ValueError, r"channel 'casing', sampled at 12000 Hz, ends at"),
        ({"healthy": [running(seconds=0.2)]}, ValueError, "healthy: recording 0: its longest"),
        ({"healthy": {"foot": None}}, ValueError, "healthy has no channel 'casing'"),
    ],
)
def test_what_cannot_be_judged_is_refused(options, error, match):
    arguments = {"X": [running(seconds=1)], "parts": BEARING} | options
    with pytest.raises(error, match=match):
        find_faults(**arguments)


# The recipe


def test_trained_on_one_bearing_it_names_the_faults_of_another_with_another_resonance():
    faults = ["BPFO", "BPFI", "BSF"] * 4
    runs = [running(fault, seed=seed, seconds=2) for seed, fault in enumerate(faults)]
    classifier = CostSensitiveGaussianBayes(covariance="tied", shrinkage="auto")
    model = bearing_recipe(BEARING, classifier=classifier).fit(runs, faults)
    ring = np.exp(-np.arange(150) / 9) * np.sin(TURN * 1400 / FS * np.arange(150))
    others = [running(f, seed=40 + k, seconds=2, resonance=ring) for k, f in enumerate(faults)]
    assert (model.predict(others) == faults).mean() >= 0.9


# Real bearings

DATA = Path(os.environ.get("EMACM_DATA", Path(__file__).parents[3] / "shared" / "data"))


@pytest.mark.slow
def test_the_rings_of_the_mfpt_rig_are_named_and_its_healthy_bearings_are_not():
    file = DATA / "bearings" / "mfpt_train.npz"
    if not file.exists():
        pytest.skip("no MFPT recordings; set EMACM_DATA to their folder")
    kinds = {"b": "none", "O": "BPFO", "I": "BPFI"}
    with np.load(file) as stored:
        names = sorted({name.partition("/")[0] for name in stored.files})
        # Healthy ones, and of each ring the lowest and the highest load: the benchmark has all.
        names = [name for name in names if re.search("baseline|Fault_1$|vload_[15]$", name)]
        assert len(names) == 7
        runs = [
            Recording(
                {"casing": stored[f"{name}/gs"].ravel()[: int(3 * stored[f"{name}/fs"])]},
                float(stored[f"{name}/fs"]),
                velocity=TURN * float(stored[f"{name}/rate"]),
            )
            for name in names
        ]
    found = find_faults(runs, Bearing(8, 0.235, 1.245))
    assert found["named"].tolist() == [kinds[name[0]] for name in names]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1772_IR_14_DE12", "1750_OR@3_14_FE"])
def test_a_damaged_ring_of_the_cwru_rig_has_no_damaged_ball(name):
    file = DATA / "bearings" / "cwru_faults_12k.npz"
    if not file.exists():
        pytest.skip("no CWRU recordings; set EMACM_DATA to their folder")
    speed, kind, _, end = name.split("_")
    with np.load(file) as stored:
        run = Recording({"casing": stored[name].ravel()}, 12_000, velocity=TURN * int(speed) / 60)
    bearing = Bearing(8, 6.746, 28.499) if end == "FE" else Bearing(9, 7.94, 39.04)
    assert find_faults([run], bearing)["named"][0] == {"IR": "BPFI"}.get(kind, "BPFO")


def test_scores_of_healthy_recordings_stand_for_them_and_the_table_shows_itself():
    healthy = [running(seed=seed) for seed in (1, 2)]
    runs = [running("BPFO"), running(seed=5)]
    by_recordings = find_faults(runs, BEARING, healthy=healthy)
    by_scores = find_faults(runs, BEARING, healthy=healthy_scores(healthy, BEARING))
    pd.testing.assert_frame_equal(by_scores, by_recordings)
    assert by_scores["named"].tolist() == ["BPFO", "none"]
    assert "outer ring</td>" in by_scores._repr_html_()


def test_a_weak_fault_at_a_load_that_no_healthy_recording_has_is_suspected():
    healthy = healthy_scores([running(seed=seed, load=1.0) for seed in (1, 2, 3)], BEARING)
    weak = {"strength": 0.13}
    runs = [running("BPFO", load=1.0, **weak), running("BPFO", load=5.0, **weak)]
    found = find_faults([*runs, running("BPFO", load=5.0)], BEARING, healthy=healthy)
    assert found["named"].tolist() == ["BPFO", "none", "BPFO"]
    assert found["suspected"].tolist() == ["none", "BPFO", "none"]
    assert found["explanation"][1].endswith("; none of them has a load like 5.0")


def test_healthy_recordings_of_another_sampling_rate_and_their_spectra_are_refused():
    slow = Recording({"casing": running().signals["casing"]}, FS / 2, velocity=30.0)
    spectra = bearing_recipe(BEARING)[:-1].fit_transform([running(seed=1)])
    for healthy in ([slow], healthy_scores([slow], BEARING), spectra):
        with pytest.raises(ValueError, match=r"recording 0: channel 'casing' is sampled at 12000"):
            find_faults([running()], BEARING, healthy=healthy)


# Bearings whose outer ring is near whole orders (4.91 with 2 % of slip includes 5) and near half
# orders (4.513), and one whose ball pass order of the outer ring is near twice the mains frequency
# at the speed below.
NEAR_FIVE, NEAR_HALF = Bearing(12, 6, 33), Bearing(11, 7, 39)
RATE = 28.2
# Per revolution.
STRIKES = {"a loose part": 1.0, "a belt": 0.4, "a piston": 0.5, "three pistons": 1.5, "a ring": 4.5}
NEAR = {"a loose part": NEAR_FIVE, "a piston": NEAR_FIVE, "blades": NEAR_FIVE}
NEAR |= {"a belt": BEARING, "another shaft": BEARING}  # the cage


def healthy_machine(cause, fs=20_000, seconds=6, seed=11):
    """Noise without any fault of a bearing, modulated by something else."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds * fs) / fs
    turns = np.cumsum(RATE + 0.2 * np.sin(2 * t)) / fs
    noise = rng.standard_normal(len(t))
    if cause in STRIKES:
        struck = np.diff(np.floor(STRIKES[cause] * turns), prepend=0) * rng.uniform(5, 11, len(t))
        noise += np.convolve(struck, RING)[: len(t)]
    modulation = {
        "blades": 0.6 * np.cos(TURN * 5 * turns) + 0.3 * np.cos(TURN * turns),
        "another shaft": 0.5 * np.cos(TURN * 0.407 * turns),
        "the mains": 0.5 * np.cos(TURN * 100 * t),
    }
    noise *= 1 + modulation.get(cause, 0.0)
    return Recording({"casing": noise}, fs, velocity=TURN * (RATE + 0.2 * np.sin(2 * t)))


@pytest.mark.parametrize(("cause", "bearing"), NEAR.items())
def test_lines_that_are_not_of_the_bearing_are_not_named(cause, bearing):
    assert find_faults([healthy_machine(cause)], bearing)["named"].tolist() == ["none"]


def test_a_ring_at_half_an_order_is_told_from_pistons_by_the_lines_between():
    runs = [healthy_machine(cause) for cause in ("three pistons", "a ring")]
    found = find_faults(runs, NEAR_HALF)
    assert found["named"].tolist() == ["none", "BPFO"]
    assert found["explanation"][0].endswith("as high, as with impacts of another source")


def test_the_sentence_tells_that_a_single_line_is_a_modulation():
    row = find_faults([healthy_machine("the mains")], BEARING).iloc[0]
    assert row["named"] == "none"
    assert row["BPFO"] > 6  # 100 Hz is order 3.55
    assert row["explanation"].endswith("a single line is a modulation, impacts have harmonics")
