"""The page of a fleet, from a history."""

import json
import re
from html import unescape
from urllib.parse import unquote

import pytest

from emacm.history.records import record_of
from emacm.history.sqlite_history import History

pytest.importorskip("jinja2", reason="jinja2 is not installed (extra 'report')")
from emacm.reports.fleet import write_fleet

NAMES = ["pump 3", '<b>&"x\'".csv', "a%20#?b", "Prüfstand – 1", "", "A/../b", "pump_3"]


def alarm(unit, state="raised", severity="alarm", by=""):
    found = {"id": unit, "unit": unit, "channel": "", "kind": "decision", "text": "worn <i>"}
    times = dict.fromkeys(("since", "time"), "2026-03-01T09:00:00.000Z")
    return {**found, "severity": severity, "state": state, "by": by, **times}


@pytest.fixture
def history(tmp_path):
    history = History(tmp_path / "h.sqlite")
    yield history
    history.close()


def shown(history):
    return history.last_records(30), history.alarms(open_only=True)


def write(history, unit, *decisions, alarms=()):
    for hour, decision in enumerate(decisions):
        known = {"decision": decision, "expected_cost": 0.5, "P(healthy)": 0.25, "P(worn)": 0.7}
        last = hour == len(decisions) - 1
        others = {"end": f"2026-03-01 {hour:02}:00", "alarms": list(alarms) if last else []}
        history.write(record_of(known, unit=unit, recording=f"{unit}{hour}.csv", **others))


def rows(page):
    return re.findall(r'(?s)<tr class="(\w+)"><td><a href="([^"]*)">([^<]*)</a></td>', page)


def test_the_most_urgent_units_are_first(history, tmp_path):
    write(history, "healthy", "worn", "healthy")
    write(history, "unknown", "unknown")
    write(history, "worn", "healthy", "worn")
    write(history, "unsure", "inspect")
    write(history, "failed", None)
    write(history, "known", "worn", alarms=[alarm("known", "acknowledged", by="Ada")])
    write(history, "dead sensor", "healthy", alarms=[alarm("dead sensor", severity="warning")])
    write(history, "raised", "healthy", alarms=[alarm("raised")])
    write(history, "cleared", "healthy", alarms=[alarm("cleared", "cleared")])
    page = write_fleet(tmp_path / "pages", *shown(history)).read_text()
    expected = ["raised", "dead sensor", "known", "worn", "unknown", "unsure", "failed", "cleared"]
    expected += ["healthy"]
    assert [name for _, _, name in rows(page)] == expected
    words = ["healthy", "healthy", "fault", "fault", "unknown", "uncertain", "undecided", "healthy"]
    words += ["healthy"]
    assert [word for word, _, _ in rows(page)] == words
    assert page.count("<strong>alarm</strong>") == 2
    assert "acknowledged by Ada, since 2026-03-01 09:00 UTC" in page


def test_names_are_escaped_and_each_unit_has_a_page_of_its_own(history, tmp_path):
    for name in NAMES:
        write(history, name, "worn", alarms=[alarm(name, by="<script>")])
    folder = tmp_path / "pages"
    folder.mkdir()
    link = "./a%2520.html"
    (folder / "pages.json").write_text(json.dumps([{"name": "a%20#?b0.csv", "link": link}]))
    page = write_fleet(folder, *shown(history)).read_text(encoding="utf-8")
    assert not re.search("<script|<i>|<b>", page)
    found = {unescape(name): unquote(link) for _, link, name in rows(page)}
    assert set(found) == {name or "unit not stated" for name in NAMES}
    assert len(set(found.values())) == len(NAMES)
    for name, file in found.items():
        text = (folder / file).read_text(encoding="utf-8")
        assert unescape(re.search("<h1>(.*)</h1>", text)[1]) == name
        assert not re.search("<script|<i>|<b>", text)
    assert f'<a href="{link}">a%20#?b0.csv</a>' in (folder / found["a%20#?b"]).read_text()


def test_bars_are_as_high_as_a_fault_is_probable(history, tmp_path):
    write(history, "a", "healthy", "worn", "unknown")
    page = write_fleet(tmp_path, *shown(history)).read_text()
    found = re.findall(r'<path class="(\w+)" d="M(\d+) 24v-(\d+)"/>', page)
    height = str(round(2 + 22 * 0.75))
    words = ("healthy", "fault", "unknown")
    assert found == [(word, str(4 * n + 2), height) for n, word in enumerate(words)]
