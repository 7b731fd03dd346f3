"""The summary of a reproduction has the number of findings, and of agreements, that are known."""

import json
from collections import Counter

import pytest

from emacm.thesis import reproduce


@pytest.mark.slow
def test_the_counts_of_the_summary_are_those_of_the_chapters(tmp_path, capsys):
    findings = reproduce(tmp_path / "out", [2, 3], quick=True)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert len(summary) == len(findings) == 30 + 14
    chapters = [2 if "2." in entry["where"].partition(",")[0] else 3 for entry in summary]
    assert Counter(chapters) == {2: 30, 3: 14}
    agreeing = Counter(
        chapter for chapter, entry in zip(chapters, summary, strict=True) if entry["agrees"]
    )
    assert agreeing[2] == 29  # all but the order step of Fig. 2.7
    assert agreeing[3] >= 8  # the rest is random with three draws
    for entry in summary:
        assert entry["agrees"] == (entry["low"] <= entry["published"] <= entry["high"])
    n_agreeing = sum(agreeing.values())
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"{n_agreeing} of 44 published figures lie within the range of ours"
