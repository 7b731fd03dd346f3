"""Defects of machine, trend and life that were found in use, one test for each."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from emacm import BallScrew, Bearing, InductionMotor, Recording, find_faults
from emacm.__main__ import main
from emacm._statements import EmacmWarning
from emacm.displays import DomainDisplay, TrendDisplay
from emacm.machine.rolling import bearing_of
from emacm.monitoring import (
    RemainingLife,
    severity_zone,
    vibration_indicators,
    vibration_severity,
    vibration_velocity,
)

# Severity by the standard


def unbalance(rpm, velocity, *, seconds=12.0, fs=2560.0, unit="m/s2", extra=0.0):
    """A machine whose 1x component has a velocity [mm/s rms]."""
    turning, times = 2 * np.pi * rpm / 60, np.arange(int(seconds * fs)) / fs
    wave = 1e-3 * np.sqrt(2) * velocity * turning * np.cos(turning * times + 0.3)
    scale = {"m/s2": 1.0, "mm/s²": 1e3, "g": 1 / 9.80665}[unit]
    return Recording({"b": scale * (wave + extra)}, fs, velocity=turning, units={"b": unit})


# Speed [rpm], velocity [mm/s rms], and the zones of groups 1 rigid, 1 flexible, 2 rigid and 2
# flexible by ISO 10816-3, Annex A, of the velocity and of the displacement velocity / (2 pi f).
KNOWN = [
    (120, 0.2, "AAAA"),  # 16 um
    (120, 0.5, "BABB"),  # 40 um
    (150, 1.0, "CBCB"),  # 64 um
    (300, 2.0, "CBCB"),  # 64 um
    (300, 10.0, "DDDD"),
    (450, 1.2, "AABA"),  # 25 um
    (580, 2.0, "BABA"),  # 33 um
    (600, 4.4, "CBCB"),  # 70 um
    (601, 3.0, "BBCB"),  # 48 um
    (900, 5.0, "CBDC"),
    (1500, 2.5, "BABB"),
    (2980, 7.0, "CBDC"),
    (6000, 2.0, "AABA"),
    (15_000, 12.0, "DDDD"),
]
GROUPS = ["group 1 rigid", "group 1 flexible", "group 2 rigid", "group 2 flexible"]


@pytest.mark.parametrize(("rpm", "velocity", "zones"), KNOWN)
def test_zones_from_120_to_15000_rpm_are_those_of_the_standard(rpm, velocity, zones):
    recording = unbalance(rpm, velocity)
    tables = [vibration_severity(recording, group) for group in GROUPS]
    assert "".join(table["zone"].item() for table in tables) == zones
    assert tables[0]["velocity"].item() == pytest.approx(velocity, rel=0.01)
    displacement = 1e3 * velocity / (2 * np.pi * rpm / 60)
    assert tables[0]["displacement"].item() == pytest.approx(displacement, rel=0.01)
    found = vibration_indicators(recording, GROUPS[2])
    assert found["b:zone"] == zones[2]


def test_the_stricter_zone_of_velocity_and_displacement_holds():
    assert severity_zone(2.0, "group 2 rigid", 50.0) == "C"
    assert severity_zone([2.0, 5.0], "group 2 rigid", [50.0, 1.0]).tolist() == ["C", "D"]
    assert severity_zone(1.0, "class II", 500.0) == "A"  # it has no limits of displacement


def test_a_run_up_through_600_rpm_is_judged_from_2_hz():
    speed = 2 * np.pi * np.linspace(400, 1500, 30_720) / 60
    wave = 0.014 * speed * np.cos(np.cumsum(speed) / 2560)  # 10 mm/s rms
    recording = Recording({"b": wave}, 2560, velocity=speed, units={"b": "m/s2"})
    assert vibration_severity(recording, "class II")["velocity"].item() > 9.0


@pytest.mark.parametrize(
    ("recording", "reason"),
    [
        (unbalance(300, 5.0, seconds=4.0), "channel 'b': .* at least 5 s, ten periods of 2 Hz"),
        (unbalance(900, 5.0, seconds=0.8), "at least 1 s, ten periods of 10 Hz"),
        (unbalance(100, 5.0), "speed of 100 rpm is outside of 120 to 30,000 rpm"),
        (unbalance(40_000, 5.0), "speed of 40000 rpm is outside"),
        (Recording({"b": np.full(9000, 0.1)}, 3000, velocity=99.0, units={"b": "g"}), "constant"),
    ],
)
def test_what_the_standard_cannot_judge_is_refused_and_stated(recording, reason):
    with pytest.raises(ValueError, match=reason):
        vibration_severity(recording, "group 2 rigid")
    with pytest.warns(EmacmWarning, match=f"no zone: .*{reason.split('.*')[-1]}"):
        assert "b:zone" not in vibration_indicators(recording, "group 2 rigid")


@pytest.mark.parametrize(("rpm", "places"), [(1500, [9000]), (300, [50, 20_001, 20_000])])
def test_spikes_that_change_the_velocity_are_stated_with_their_place(rpm, places):
    spikes = np.zeros(30_720)
    spikes[places] = 1000.0
    recording = unbalance(rpm, 1.0, extra=spikes)
    with pytest.warns(EmacmWarning, match=rf"'b' has spikes, .* sample {places[-1]} .* but 1 mm"):
        vibration_severity(recording, "group 2 rigid")


def test_a_clipped_acceleration_is_stated():
    wave = unbalance(1500, 5.0, extra=0.2 * np.random.default_rng(0).normal(size=30_720))
    clipped = np.clip(wave.signals["b"], -0.5, 0.5)
    recording = Recording({"b": clipped}, 2560, velocity=wave.velocity, units={"b": "m/s2"})
    with pytest.warns(EmacmWarning, match="clipped at .*: its velocity is uncertain"):
        vibration_severity(recording, "group 2 rigid")


@pytest.mark.parametrize("unit", ["mm/s2", "mm/s²", "mm/s^2", "mm/s**2"])
def test_every_way_of_writing_a_unit_of_acceleration_is_known(unit):
    wave = unbalance(1500, 4.0).signals["b"]
    assert vibration_velocity(1e3 * wave, 2560, unit=unit) == pytest.approx(4.0, rel=1e-3)
    in_mm = unbalance(1500, 4.0, unit="mm/s²")
    assert vibration_severity(in_mm, "class II")["velocity"].item() == pytest.approx(4.0, rel=1e-3)
    with pytest.raises(ValueError, match="unit must be an acceleration"):
        vibration_velocity(wave, 2560, unit="mm/s")


# Times of a trend

RUNS = [f"fan_{number}.npz" for number in (8, 9, 10, 11)]
DATES = [f"fan_2026-{day}.npz" for day in ("02-27", "02-28", "03-01", "03-02")]
OTHERS = [f"fan_{letter}.npz" for letter in "abcd"]
LOADS = [f"{rpm}rpm_{number}.npz" for number, rpm in enumerate((900, 1500, 900, 1500))]


@pytest.mark.parametrize(
    ("names", "hours", "judged", "stated", "status"),
    [
        (RUNS, [0, 24, 48, 72], "latest written", "4 of 4 files state no time", 1),
        (RUNS, [72, 48, 24, 0], "highest", "fan_10.npz follows fan_11.npz", 1),
        (RUNS, [24, 72, 0, 48], "highest", "fan_8.npz follows fan_10.npz", 1),
        (DATES, [72, 48, 24, 0], "highest", "03-01.npz follows fan_2026-03-02.npz", 1),
        (LOADS, [0, 24, 48, 72], "latest written", "4 of 4 files state no time", 1),
        (OTHERS, [72, 48, 24, 0], "latest written", "4 of 4 files state no time", 0),
        (OTHERS, [1e-4, 6e-5, 3e-5, 0], "highest", "2 s long, follows fan_d.npz after 0.1", 1),
    ],
)
def test_times_of_writing_are_stated_and_not_used_where_they_cannot_be_right(
    names, hours, judged, stated, status, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    rng, angle = np.random.default_rng(0), 90.0 * np.arange(2000) / 1000
    Path("healthy").mkdir()
    for number in range(20):
        np.savez(f"healthy/run_{number}.npz", vib=rng.normal(size=2000))
    for name, hour, wear in zip(names, hours, (0.0, 0.3, 0.8, 1.5), strict=True):
        np.savez(name, vib=rng.normal(size=2000) + wear * np.sin(3.3 * angle))
        os.utime(name, (1.7e9 + 3600 * hour,) * 2)
    Path("layout.toml").write_text('fs = 1000\nvelocity = "90 rad/s"\nmeta = "{run}"\n')
    options = ["--layout", "layout.toml", "--groups", "run", "--out", "trend.csv"]
    assert main(["trend", "healthy", *names, *options, "--fail-on-alarm"]) == status
    printed = capsys.readouterr().out
    assert f"all: {judged} " in printed
    assert stated in printed
    assert pd.read_csv("trend.csv")["time"].isna().all() == (judged == "highest")


# Remaining life


@pytest.mark.parametrize(("column", "onset"), [("noise", None), ("flat", None), ("noise", -9.0)])
def test_a_remaining_life_is_that_of_units_which_survived_to_this_age(column, onset):
    rng, shape = np.random.default_rng(0), 2.5
    lives = 1000 * (-np.log(1 - (np.arange(60) + 0.5) / 60)) ** (1 / shape)
    units = np.repeat(np.arange(60), (lives // 25 + 1).astype(int))
    ages = 25.0 * np.concatenate([np.arange(n) for n in np.bincount(units)])
    end = np.maximum(ages / lives[units] - 0.95, 0) / 0.05  # 0 until 95 % of the life
    index = rng.normal(size=len(ages)) if column == "noise" else end
    model = RemainingLife(onset=onset).fit(np.c_[ages, index], lives[units] - ages, groups=units)
    new = np.array([0.0, 300.0, 600.0, 900.0])
    reached = new / 0.95 if column == "flat" else new  # at least: the index is still 0
    medians = 1000 * ((reached / 1000) ** shape + np.log(2)) ** (1 / shape) - new
    table = model.predict_interval(np.c_[new, 0 * new])
    np.testing.assert_allclose(table["median"], medians, rtol=0.08)
    np.testing.assert_allclose(model.predict(np.c_[new, 0 * new]), table["median"], rtol=1e-6)
    assert "follows from health index, and age if no onset was seen" in table["statement"][0]


# Geometry of a machine


@pytest.mark.parametrize("geometry", [(9, 0.794, 39.04), (9, 7.94, 390.4), (8, 0.2656, 28.5)])
def test_diameters_in_two_units_are_refused_unless_they_are_confirmed(geometry):
    with pytest.raises(ValueError, match=r"both diameters in one unit, .* few_balls=True"):
        Bearing(*geometry)
    with pytest.raises(ValueError, match="both diameters in one unit"):
        BallScrew(*geometry, 5.0)
    with pytest.raises(ValueError, match="both diameters in one unit"):
        bearing_of(",".join(map(str, geometry)))
    assert Bearing(*geometry, few_balls=True).lines()[0].name == "BPFO"


@pytest.mark.parametrize(
    "geometry",
    [(7, 3.969, 15.0), (13, 3.5, 25.6), (24, 2.0, 18.0), (90, 3.175, 160.0), (16, 22.0, 160.0)],
)
def test_skate_thin_section_needle_and_roller_bearings_are_accepted(geometry):
    assert len(Bearing(*geometry).lines()) == 4


@pytest.mark.parametrize(("slip", "supply"), [(0.012, 50.0), (0.041, 60.0), (0.08, 31.7)])
def test_the_slip_of_an_induction_motor_is_found_from_its_current(slip, supply):
    times, rotor = np.arange(24_000) / 2000, supply * (1 - slip) / 2  # Hz, two pole pairs
    current = np.sin(2 * np.pi * supply * times)
    current += 0.01 * np.random.default_rng(0).normal(size=len(times))
    recording = Recording({"phase": 3 + current}, 2000, velocity=2 * np.pi * rotor)
    motor = InductionMotor.from_current(recording, "phase", 2, bars=28)
    assert motor.slip == pytest.approx(slip, abs=1e-4)
    with pytest.raises(ValueError, match=r"Check pole_pairs, the speed"):
        InductionMotor.from_current(recording, "phase", 3)


# What find states


def test_a_recording_without_a_fault_has_its_highest_lines_and_how_often_noise_reaches_them():
    noise = np.random.default_rng(0).normal(size=80_000)
    recording = Recording({"b": noise}, 10_000, velocity=2 * np.pi * 25)
    row = find_faults([recording], Bearing(9, 7.94, 39.04)).iloc[0]
    fault = row[["BPFO", "BPFI", "BSF"]].astype(float).idxmax()
    share = f"which noise alone reaches in {100 * row[f'p({fault})']:.0f} % of cases"
    assert row["explanation"].startswith(f"no fault: highest are {fault} and its harmonics (")
    assert row["explanation"].endswith(share)


@pytest.mark.parametrize(("fs", "stated"), [(86.4e6, "0.000231 s"), (1.0, "sampled at 1 Hz")])
def test_a_wrong_unit_of_time_is_not_blamed_on_the_speed_alone(fs, stated):
    recording = Recording({"b": np.ones(20_000)}, fs, velocity=2 * np.pi * 25)
    with pytest.raises(ValueError, match=f"{stated}.*the units of both"):
        find_faults([recording], Bearing(9, 7.94, 39.04))


# Pictures


def test_conditions_are_drawn_at_their_values_and_states_beside_each_other():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plot')")
    states = ["healthy", "ball", "ball", "inner"]
    points = pd.DataFrame({"state": states, "severity": [0, 0.1, 0.4, 0.4]})
    axes = DomainDisplay(points.assign(slowest=50.0, fastest=99.0)).plot().ax_
    drawn = {line.get_label(): line.get_ydata()[0] for line in axes.lines}
    assert drawn["healthy"] == 0
    assert drawn["ball"] == pytest.approx(0.1)
    by_state = np.array([line.get_ydata()[0] for line in axes.lines[2:]])
    assert by_state.mean() == pytest.approx(0.4)
    assert by_state[0] < by_state[1]


@pytest.mark.parametrize("seconds", [2.0, 86_400.0])
def test_a_trend_fills_its_time_axis(seconds):
    dates = pytest.importorskip("matplotlib.dates", reason="matplotlib is not installed")
    times = pd.Timestamp("2026-03-01") + pd.to_timedelta(np.linspace(0, seconds, 5), unit="s")
    table = pd.DataFrame({"unit": "A", "time": times, "index": 1.0, "limit": 2.0, "alarm": False})
    low, high = TrendDisplay(table).plot().ax_.get_xlim()
    share = (dates.date2num(times[-1]) - dates.date2num(times[0])) / (high - low)
    assert share == pytest.approx(1 / 1.1, abs=0.01)
