"""The summary of a reproduction has the number of findings, and of agreements, that are known."""

import json
from collections import Counter

import pytest

from emacm.thesis import reproduce


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
