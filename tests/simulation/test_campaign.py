"""Sets of bench recordings know everything about themselves, and simulate only what is read."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline

from emacm import BinTransformer, OrderPSD, OrderResampler, Recording
from emacm.simulation.bench import LaboratoryBench
from emacm.simulation.campaign import LaboratoryRecordings, laboratory_recordings, thesis_benches


@pytest.fixture
def simulated(monkeypatch):
    """Return the list of what was simulated."""
    done = []
    record = LaboratoryBench.record

    def noted(self, condition, run=1):
        done.append((self.unit, condition, run))
        return record(self, condition, run)

    monkeypatch.setattr(LaboratoryBench, "record", noted)
    return done


def short(n_runs=2, conditions=(4, 5), **constants):
    benches = thesis_benches(duration=0.5, **constants)
    return laboratory_recordings(benches, conditions=conditions, n_runs=n_runs)


def test_the_campaign_of_the_thesis_is_5_conditions_20_runs_and_2_units(simulated):
    runs = laboratory_recordings()
    assert len(runs) == 200
    assert runs.frame.groupby(["unit", "condition"]).size().tolist() == [20] * 10
    assert runs.frame["run"].min() == 1
    assert runs.frame["run"].max() == 20
    assert not simulated


def test_the_degraded_unit_has_a_bad_inner_ring_and_three_quarters_of_its_grease():
    healthy, degraded = thesis_benches()
    assert healthy.faults == {}
    assert degraded.faults == {"inner ring": 0.5, "lubrication": 0.25}
    assert degraded.orders["inner ring"][0] == pytest.approx(6.123, abs=5e-4)
    assert degraded.electrical_noise < healthy.electrical_noise


def test_labels_groups_and_frame_cost_no_simulation(simulated):
    runs = short()
    assert runs.labels.tolist() == ["healthy"] * 4 + ["inner ring + lubrication"] * 4
    assert runs.groups.tolist() == [0] * 4 + [1] * 4
    assert runs.frame.columns.tolist() == ["unit", "condition", "run", "label", "severity"]
    assert runs.frame["severity"].tolist() == [0.0] * 4 + [0.5] * 4
    assert "8 LaboratoryRecordings" in repr(runs)
    assert not simulated


def test_a_recording_is_simulated_when_it_is_read_and_each_time(simulated):
    runs = short()
    assert isinstance(runs[5], Recording)
    assert simulated == [(1, 4, 2)]
    assert runs[-3] == runs[5]
    assert len(simulated) == 3


def test_what_is_read_is_what_the_frame_says():
    runs = short(1)
    for recording, (_, row) in zip(runs, runs.frame.iterrows(), strict=True):
        assert {name: recording.meta[name] for name in row.index} == row.to_dict()


def test_the_order_of_reading_does_not_matter():
    runs = short(1)
    backwards = [runs[i] for i in (3, 2, 1, 0)]
    assert backwards[::-1] == list(runs)


@pytest.mark.parametrize(
    ("index", "places"),
    [
        (slice(1, None, 3), [1, 4, 7]),
        ([7, 0], [7, 0]),
        (np.array([-1, 2]), [7, 2]),
        (np.arange(8) > 5, [6, 7]),
        (pd.Series(np.arange(8) < 2), [0, 1]),
        ([], []),
    ],
)
def test_a_part_of_a_set_is_a_set(simulated, index, places):
    runs = short()
    part = runs[index]
    assert isinstance(part, LaboratoryRecordings)
    expected = runs.frame.iloc[places].reset_index(drop=True)
    assert part.frame.to_dict() == expected.to_dict()
    assert not simulated


def test_a_set_pickles_small_and_equals_its_copy(simulated):
    runs = laboratory_recordings()
    frozen = pickle.dumps(runs)
    assert len(frozen) < 20_000
    assert pickle.loads(frozen) == runs
    assert hash(pickle.loads(frozen)) == hash(runs)
    assert runs != runs[:5]
    assert not simulated


def test_the_thesis_splits_by_run():
    runs = laboratory_recordings()
    learnt, tested = runs[runs.frame["run"] <= 10], runs[runs.frame["run"] > 10]
    assert len(learnt) == len(tested) == 100


def test_a_set_goes_through_a_pipeline_piece_by_piece(simulated):
    runs = short(1)
    chain = make_pipeline(
        OrderResampler(2 * np.pi / 64, min_speed=1.0),
        OrderPSD(2, max_order=20),
        BinTransformer(2.0, max_order=20),
    )
    chain.fit(runs[:1])
    simulated.clear()
    rows = [chain.transform(runs[i : i + 1]) for i in range(len(runs))]
    assert len(simulated) == len(runs)
    assert np.array_equal(np.vstack(rows), chain.transform(runs))


def test_groups_hold_units_together():
    benches = [
        LaboratoryBench(unit=unit, faults=faults, duration=0.1)
        for unit in range(4)
        for faults in ({}, {"screw": 1.0})
    ]
    runs = laboratory_recordings(benches, conditions=[3], n_runs=2)
    for learnt, tested in GroupKFold(4).split(runs, runs.labels, runs.groups):
        assert not set(runs[learnt].groups) & set(runs[tested].groups)
        assert sorted(runs[tested].labels) == ["healthy"] * 2 + ["screw"] * 2


def test_one_bench_is_a_campaign_too():
    runs = laboratory_recordings(LaboratoryBench(unit=4), conditions=[1], n_runs=3, first_run=7)
    assert runs.frame[["unit", "run"]].to_numpy().tolist() == [[4, 7], [4, 8], [4, 9]]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"conditions": [1, 9]}, ValueError, "condition must be one of 1, 2, 3, 4, 5; got 9"),
        ({"n_runs": 0}, ValueError, "n_runs must be a whole number of at least 1, got 0"),
        ({"first_run": 0}, ValueError, "first_run must be a whole number of at least 1, got 0"),
        ({"benches": ["a"]}, TypeError, "bench of run 0 must be a LaboratoryBench, got 'a'"),
    ],
)
def test_a_wrong_campaign_is_named(arguments, error, message):
    with pytest.raises(error, match=message):
        laboratory_recordings(**arguments)


def test_a_wrong_triple_is_named():
    with pytest.raises(TypeError, match=r"run 0 must be \(bench, condition, run\), got 3"):
        LaboratoryRecordings([3])


@pytest.mark.parametrize("index", ["label", 1.5, [0.5], np.zeros((2, 2), dtype=int), [True, False]])
def test_a_wrong_index_is_refused(index):
    with pytest.raises(TypeError, match="an index must be a number, a slice, an array of numbers"):
        short()[index]


def test_an_index_beyond_the_set_is_refused():
    with pytest.raises(IndexError):
        short()[8]


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"grease": 1.2}, ValueError, "grease must be a number at least 0 and at most 1, got 1.2"),
        ({"severity": 2}, ValueError, "severity of 'inner ring' must be a number"),
        ({"electrical_noise": 1.0}, TypeError, "electrical_noise must be a pair, .* got 1.0"),
    ],
)
def test_a_wrong_unit_of_the_thesis_is_named(arguments, error, message):
    with pytest.raises(error, match=message):
        thesis_benches(**arguments)
