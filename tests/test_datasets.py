"""The Cranfield actuator is read as it was recorded; the real file only where there is one."""

import numpy as np
import pytest

from emacm import OrderResampler
from emacm.datasets import load_cranfield


def sequences(n=6, n_times=60, seed=0):
    """Arrays of the file's layout: out for half of the time, and back."""
    rng = np.random.default_rng(seed)
    out = np.linspace(0, 24, n_times // 2)
    position = np.concatenate([out, out[::-1]])
    return {
        "set_point": np.tile(position, (n, 1)).astype(np.float32),
        "position_error": rng.normal(0, 0.01, (n, n_times)).astype(np.float32),
        "current": rng.normal(0, 0.1, (n, n_times)).astype(np.float32),
        "state": np.array(["normal", "spalling1"] * (n // 2)),
        "load_kgf": np.full(n, 20, dtype=np.int16),
        "run": np.arange(n, dtype=np.int16) // 2 + 1,
        "group": np.arange(n, dtype=np.int16),
        "fs": np.array(25.0),
        "lead_mm": np.array(5.0),
    }


def written(tmp_path, arrays):
    np.savez(tmp_path / "actuator.npz", **arrays)
    return tmp_path / "actuator.npz"


def test_any_file_of_the_layout_is_read(tmp_path):
    arrays = sequences()
    recordings, labels, frame = load_cranfield(written(tmp_path, arrays))
    assert list(labels) == ["normal", "spalling1"] * 3
    assert list(frame.columns) == ["load", "run", "group"]
    assert frame["run"].tolist() == [1, 1, 2, 2, 3, 3]
    assert recordings[3].meta == {"state": "spalling1", "load": 20, "run": 2, "group": 3}
    assert np.array_equal(recordings[3].signals["current"], arrays["current"][3])
    position = arrays["set_point"][3] - arrays["position_error"][3]
    assert np.allclose(recordings[3].angle, 2 * np.pi * position / 5)


def test_of_two_copies_that_of_the_later_run_is_left_out(tmp_path):
    arrays = sequences()
    arrays["current"][0] = arrays["current"][4]
    arrays["run"][[0, 4]] = [7, 2]
    with pytest.warns(UserWarning, match=r"1 sequences .* later runs .*\[0\]"):
        recordings, _, frame = load_cranfield(written(tmp_path, arrays))
    assert len(recordings) == 5
    assert 0 not in set(frame["group"])


def test_a_file_that_is_not_there_or_of_another_kind_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.npz"):
        load_cranfield(tmp_path / "nothing.npz")
    (tmp_path / "notes.npz").write_text("no arrays")
    with pytest.raises(ValueError, match=r"notes\.npz: "):
        load_cranfield(tmp_path / "notes.npz")


@pytest.mark.filterwarnings("ignore:.*in the file twice:UserWarning")
def test_the_real_actuator_runs_out_and_back_at_five_turns_a_second(cranfield_file):
    recordings, labels, _ = load_cranfield(cranfield_file)
    assert "normal" in labels
    quality = OrderResampler(2 * np.pi / 6, min_speed=8).quality(recordings[:5])
    assert quality["longest_stroke"].between(23, 26).all()  # 120 mm at 5 mm lead
    assert quality["revolutions"].between(46, 53).all()
