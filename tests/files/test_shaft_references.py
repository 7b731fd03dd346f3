"""Shaft references and sensitivities that a layout states; each finds the same known motion."""

import numpy as np
import pytest

from emacm import Layout, RecordingFolder, open_recording
from emacm.__main__ import main

FS = 2000
TIME = np.arange(8000) / FS
ANGLE = 2 * np.pi * 6 * np.sin(2 * np.pi * TIME / 4)  # back and forth
THIRDS = 2 * np.pi / 3 * np.arange(3)
COLUMNS = {
    "vibration": np.random.default_rng(0).normal(size=len(TIME)),
    "position": 5 * ANGLE / (2 * np.pi),
    "counts": np.degrees(ANGLE) % 360,
    "s": np.sin(ANGLE),
    "c": np.cos(ANGLE),
    **{f"i{n}": np.cos(3 * ANGLE - third) for n, third in zip("abc", THIRDS, strict=True)},
    "key": (ANGLE % (2 * np.pi) < 0.5).astype(float),
}


def angle_by(tmp_path, **stated):
    np.savez(tmp_path / "A_1.npz", **COLUMNS)
    layout = Layout(fs=FS, **{"channels": ["vibration"]} | stated)
    return open_recording(tmp_path / "A_1.npz", layout)


@pytest.mark.parametrize(
    "angle",
    [
        {"column": "position", "lead": 5.0},
        {"column": "counts", "unit": "deg", "wrapped": True},
        {"resolver": ["s", "c"]},
        {"currents": ["ia", "ib", "ic"], "pole_pairs": 3},
        {"currents": ["ia", "ib"], "pole_pairs": 3},
    ],
    ids=lambda angle: str([*angle]),
)
@pytest.mark.parametrize("ratio", [1.0, 2.5])
def test_a_layout_states_the_shaft_angle_as_it_was_measured(tmp_path, angle, ratio):
    found = angle_by(tmp_path, angle=angle, ratio=ratio).angle
    np.testing.assert_allclose(found - found[0], ratio * (ANGLE - ANGLE[0]), atol=1e-6)


def test_an_angle_of_columns_of_two_rates_is_refused(tmp_path):
    np.savez(tmp_path / "r.npz", **COLUMNS, ia_fs=FS, ib_fs=FS / 2, vibration_fs=FS)
    layout = Layout(angle={"currents": ["ia", "ib"], "pole_pairs": 3}, channels=["vibration"])
    recording = open_recording(tmp_path / "r.npz", layout)
    with pytest.raises(ValueError, match=r"\['ia', 'ib'\] of the angle have several rates"):
        recording.strokes()


def test_a_ratio_holds_for_speeds_and_tachometers(tmp_path):
    constant = angle_by(tmp_path, velocity="600 rpm", ratio=0.25)
    np.testing.assert_allclose(constant.velocity, 5 * np.pi)
    turning = 2 * np.pi * 20 * TIME
    np.savez(tmp_path / "t.npz", x=COLUMNS["s"], key=1.0 * (turning % np.pi < 0.4))
    layout = Layout(fs=FS, tacho={"column": "key", "pulses": 2}, ratio=3)
    speed = open_recording(tmp_path / "t.npz", layout).velocity
    assert np.median(speed) == pytest.approx(2 * np.pi * 60, rel=1e-3)


def test_currents_are_channels_and_columns_of_a_sensor_are_not(tmp_path):
    currents = {"currents": ["ia", "ib", "ic"], "pole_pairs": 3}
    assert {"ia", "ib", "ic"} < {*angle_by(tmp_path, angle=currents, channels=None).channels}
    resolver = {"resolver": ["s", "c"]}
    assert {"s", "c"}.isdisjoint(angle_by(tmp_path, angle=resolver, channels=None).channels)


def test_the_angle_may_be_found_in_a_vibration_whose_speed_is_known_in_rev_per_s(tmp_path):
    time = np.arange(20 * FS) / FS
    waves = sum(np.cos(2 * np.pi * 24.7 * k * time + k) for k in (1, 2, 3, 5))
    noise = 0.3 * np.random.default_rng(1).normal(size=len(time))
    np.savez(tmp_path / "v.npz", x=waves + noise)
    layout = Layout(fs=FS, angle={"vibration": "x", "speeds": [22, 28]})
    recording = open_recording(tmp_path / "v.npz", layout)
    assert recording.channels == ("x",)
    assert np.median(recording.velocity) == pytest.approx(2 * np.pi * 24.7, rel=2e-3)
    in_rpm = {"vibration": "x", "speeds": [22 * 60, 28 * 60], "unit": "rpm"}
    other = open_recording(tmp_path / "v.npz", Layout(fs=FS, angle=in_rpm))
    np.testing.assert_allclose(other.angle, recording.angle)


def test_a_position_of_a_second_file_has_a_lead(tmp_path):
    np.savez(tmp_path / "A_1.npz", x=COLUMNS["s"], t=TIME)
    np.savez(tmp_path / "A_1_pos.npz", position=COLUMNS["position"][::4], t=TIME[::4])
    second = {"file": "{stem}_pos.npz", "column": "position", "lead": 5.0}
    found = open_recording(tmp_path / "A_1.npz", Layout(angle=second)).angle
    np.testing.assert_allclose(found, ANGLE[::4], atol=1e-9)


@pytest.mark.parametrize(
    "angle",
    [
        {"lead": 5},
        {"column": "position", "lead": 5.0, "wrapped": True},
        {"currents": ["ia", "ib", "ic"]},
        {"resolver": ["s"]},
        {"vibration": "x"},
        {"vibration": "x", "speeds": 20},
        {"currents": ["ia", "ib"], "pole_pairs": 3, "file": "b"},
    ],
)
def test_a_reference_that_does_not_state_all_is_refused(angle):
    with pytest.raises(TypeError, match="angle must be"):
        Layout(angle=angle)


# Sensitivity


def test_a_sensitivity_gives_a_channel_the_unit_of_the_sensor(tmp_path):
    known = {"velocity": "600 rpm", "units": {"vibration": "V"}}
    found = angle_by(tmp_path, scale="100 mV/g", **known)
    np.testing.assert_allclose(found.signals["vibration"], 10 * COLUMNS["vibration"])
    assert found.units["vibration"] == "g"
    with pytest.raises(ValueError, match="State the unit"):
        _ = angle_by(tmp_path, scale={"vibration": "100 mV/g"}, velocity="600 rpm").signals
    with pytest.raises(TypeError, match="sensitivity"):
        Layout(scale="100 mV")


# Drafts


def test_a_position_is_proposed_with_its_lead_to_be_filled_in(tmp_path, capsys):
    path, draft = tmp_path / "A_1.csv", tmp_path / "layout.toml"
    rows = np.column_stack([TIME, COLUMNS["vibration"], COLUMNS["position"]])
    np.savetxt(path, rows, delimiter=",", header="t,vibration [g],position [mm]", comments="")
    assert main(["inspect", str(path), "--draft", str(draft), "--meta", "{unit}_{run}"]) == 0
    assert "lead of angle: 'position'" in capsys.readouterr().out
    text = draft.read_text(encoding="utf-8")
    assert "travel per revolution [mm]" in text
    draft.write_text(text.replace("# angle = ", "angle = "), encoding="utf-8")
    (recording,) = RecordingFolder(tmp_path, Layout.from_toml(draft), "*.csv")
    assert recording.channels == ("vibration",)
    np.testing.assert_allclose(recording.angle, ANGLE, atol=1e-6)
