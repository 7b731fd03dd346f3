"""Facts about units that wear out: the law is the stated one, and recordings follow it."""

import numpy as np
import pytest
from scipy.stats import kstest, weibull_min

from emacm.simulation import LaboratoryBench, WearLaw, run_to_failure_fleet


def test_onset_and_growth_have_the_stated_law():
    law = WearLaw(onset_shape=1.5, onset_scale=90.0, drift=0.05, drift_spread=0.0, diffusion=0.01)
    lives = [law.draw(unit, 5.0) for unit in range(800)]
    onsets = [life.onset for life in lives]
    assert kstest(onsets, weibull_min(1.5, scale=90.0).cdf).pvalue > 0.01
    # First passage of a Wiener process with drift: mean distance / drift.
    durations = np.array([life.life - life.onset for life in lives])
    mean = -np.log(0.05) / 0.05
    error = np.sqrt(mean * 0.01 / 0.05**2 / 800)
    assert durations.mean() == pytest.approx(mean, abs=3 * error)


def test_without_scatter_the_severity_grows_exponentially():
    law = WearLaw(drift=0.02, drift_spread=0.0, diffusion=0.0, start=0.1)
    life = law.draw(7, 8.0)
    damaged = life.severity > 0
    expected = 0.1 * np.exp(0.02 * (life.ages[damaged] - life.onset))
    np.testing.assert_allclose(life.severity[damaged], expected, rtol=1e-9)
    assert life.life == pytest.approx(life.onset + np.log(10) / 0.02, abs=8.0 / 64)
    assert life.ages[-1] < life.life <= life.ages[-1] + 8.0


def test_the_same_unit_has_the_same_life_also_if_it_is_observed_for_less():
    law = WearLaw()
    whole, part = law.draw(11, 10.0), law.draw(11, 10.0, observed=55.0)
    assert (whole.life, whole.onset) == (part.life, part.onset)
    assert part.censored
    assert part.ages[-1] == 50.0
    np.testing.assert_array_equal(part.severity, whole.severity[:6])
    assert law.draw(12, 10.0).life != whole.life
    assert law.draw(11, 10.0, seed=1).life != whole.life


def test_recordings_state_the_true_life_and_the_severity_is_that_of_the_law():
    fleet = run_to_failure_fleet(3, interval=60.0, duration=0.3, fault="outer ring", first_unit=4)
    meta = [recording.meta for recording in fleet]
    assert [m["unit"] for m in meta] == sorted(m["unit"] for m in meta)
    for m in meta:
        life = WearLaw().draw(m["unit"], 60.0)
        assert m["severity"] == life.severity[round(m["age"] / 60)]
        assert m["remaining_life"] == life.life - m["age"]
        assert m["label"] == ("outer ring" if m["age"] >= life.onset else "healthy")
        assert m["censored"] is False


def test_a_recording_is_that_of_the_bench_with_this_fault():
    last = run_to_failure_fleet(1, interval=40.0, duration=0.3, seed=5)[-1]
    bench = LaboratoryBench(
        unit=0, faults=last.meta["faults"], duration=0.3, fs=4000.0, cutoff=1500.0, seed=5
    )
    same = bench.record(4, last.meta["run"])
    for channel in same.channels:
        np.testing.assert_array_equal(last.signals[channel], same.signals[channel])


def test_censored_units_end_before_they_fail():
    fleet = run_to_failure_fleet(4, interval=80.0, duration=0.2, censored=1.0)
    assert all(recording.meta["censored"] for recording in fleet)
    for m in (recording.meta for recording in fleet):
        assert 0.3 * m["life"] <= m["observed_life"] < m["life"]
        assert m["age"] + m["remaining_life"] == pytest.approx(m["observed_life"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"law": 3}, "law must be a WearLaw"),
        ({"fault": "rust"}, "fault must be one of"),
        ({"censored": 1.2}, "censored must be a number at least 0 and at most 1"),
        ({"interval": 0.0}, "interval must be a number of h, above 0"),
    ],
)
def test_invalid_parameters_are_named(options, message):
    with pytest.raises((TypeError, ValueError), match=message):
        run_to_failure_fleet(1, **options)


def test_an_invalid_law_is_named():
    with pytest.raises(ValueError, match="start must be a number above 0 and below 1"):
        WearLaw(start=1.0)
