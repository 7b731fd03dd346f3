"""The summary of a reproduction has the number of findings, and of agreements, that are known."""

import json
from collections import Counter

import pytest

from emacm.simulation import thesis_benches
from emacm.thesis import reproduce, run_campaign, shares_table, study


@pytest.mark.slow
def test_the_counts_of_the_summary_are_those_of_the_chapters(tmp_path, capsys):
    findings = reproduce(tmp_path / "out", [2, 3], quick=True)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert len(summary) == len(findings) == 31 + 16
    chapters = [2 if "2." in entry["where"].partition(",")[0] else 3 for entry in summary]
    assert Counter(chapters) == {2: 31, 3: 16}
    agreeing = Counter(
        chapter
        for chapter, entry in zip(chapters, summary, strict=True)
        if entry["agrees_by_range"]
    )
    assert agreeing[2] == 29  # all but Fig. 2.6 and the order step of Fig. 2.7
    assert agreeing[3] >= 8  # the rest is random with three draws
    for entry in summary:
        within = entry["low"] <= entry["published"] <= entry["high"]
        # A leading bin between two others need not lead in any draw.
        assert within >= entry["agrees_by_range"]
    random = [entry for entry in summary if entry["kind"] == "random"]
    within, middle = (
        sum(entry[f"agrees_by_{by}"] for entry in random) for by in ("range", "median")
    )
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == (
        f"{within} of 22 random figures within the range of ours, {middle} within its middle "
        f"half; 25 other figures"
    )


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"chapters": 3}, TypeError, r"chapters must be a list of numbers.*got 3"),
        ({"chapters": "3"}, TypeError, r"chapters must be a list of numbers.*got '3'"),
        (
            {"chapters": [3, 7]},
            ValueError,
            r"chapter 7 is not reproduced; available are 2, 3, 4, 5",
        ),
        ({"out": None}, TypeError, r"out must be the path of a folder, got None"),
        ({"quick": "no"}, ValueError, r"quick must be one of True, False; got 'no'"),
    ],
)
def test_an_invalid_reproduction_is_refused_before_it_starts(options, error, words, tmp_path):
    with pytest.raises(error, match=words):
        reproduce(**({"out": tmp_path / "out"} | options))
    assert not (tmp_path / "out").exists()


def test_an_invalid_campaign_is_refused():
    benches = thesis_benches(duration=0.1)
    with pytest.raises(ValueError, match="at least one LaboratoryBench, got none"):
        run_campaign([])
    with pytest.raises(ValueError, match=r"a reading must be one of 'thesis',.*got 'book'"):
        run_campaign(benches, n_runs=2, readings=["thesis", "book"])
    with pytest.raises(TypeError, match="campaign must be the result of run_campaign, got 3"):
        study(3)
    with pytest.raises(ValueError, match="at least one Study, got none"):
        shares_table([])
