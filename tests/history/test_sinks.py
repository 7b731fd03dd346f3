"""Facts about the formats of records for other programs, by parsers that are not ours."""

import io
import re

import pytest

from emacm.history.records import record_of
from emacm.history.sinks import PrometheusFile, sink_of, sinks_of
from emacm.history.sqlite_history import History

NASTY = ["pump 3", 'a,b=c "d" e', "back\\slash\\", "two\nlines\t", "ü°\udcff", "#{x}", "\\n", "+/#"]
END = "2026-03-01T12:00:00.000Z"


def a_record(unit="pump 3", recording="1.csv", state="", **others):
    """Return a record; with a change of an alarm if a state is given."""
    alarm = {"id": "0" * 12, "unit": unit, "channel": "x", "kind": "decision", "severity": "alarm"}
    alarm |= {"state": state, "since": END, "time": END, "by": "", "text": "worn"}
    found = {"decision": "worn", "expected_cost": 0.5, "P(worn)": 0.75, "P(healthy)": 0.25}
    found |= {"alarms": [alarm] if state else [], "end": END}
    return record_of(found | others, unit=unit, recording=recording)


def split_outside(text, separator, quotes=False):
    """Split at separators that are not escaped; nor, if asked for, in quotation marks."""
    parts, inside, i = [""], False, 0
    while i < len(text):
        if text[i] == "\\" and i + 1 < len(text):
            parts[-1] += text[i : i + 2]
            i += 2
            continue
        inside ^= quotes and text[i] == '"'
        if text[i] == separator and not inside:
            parts.append("")
        else:
            parts[-1] += text[i]
        i += 1
    return parts


def parsed_point(line):
    """Parse a line by the rules of the reference of the line protocol."""
    series, fields, *time = split_outside(line, " ", quotes=True)
    name, *tags = split_outside(series, ",")
    plain = {k: re.sub(r"\\([,= ])", r"\1", v) for k, v in (split_outside(t, "=") for t in tags)}
    values = {}
    for field in split_outside(fields, ",", quotes=True):
        key, value = split_outside(field, "=", quotes=True)
        text = value.startswith('"') and re.sub(r'\\(["\\])', r"\1", value[1:-1])
        values[re.sub(r"\\([,= ])", r"\1", key)] = value if text is False else text
    return name, plain, values, [int(t) for t in time]


def influx_points(record, folder):
    sink = sink_of(f"influx:{folder / 'points.txt'}")
    sink.write(record)
    sink.close()
    lines = (folder / "points.txt").read_text(encoding="utf-8").split("\n")
    assert lines.pop() == ""
    return [parsed_point(line) for line in lines]


@pytest.mark.parametrize("text", NASTY)
def test_a_point_of_influx_has_its_texts_back(text, tmp_path):
    record = a_record(text, f"file {text}", "raised", warnings=text, **{f"P({text})": 0.125})
    (name, tags, fields, _), (_, of_alarm, change, time) = influx_points(record, tmp_path)

    def as_url(part, characters=r"[\x00-\x1f\udcff]"):
        codes = {"\n": "%0A", "\t": "%09", "\\": "%5C", "\udcff": "%ED%B3%BF"}
        return re.sub(characters, lambda found: codes[found[0]], part)

    backslashes = as_url(text, r"[\\\x00-\x1f\udcff]")
    assert (name, tags["unit"], of_alarm["unit"]) == ("emacm", backslashes, backslashes)
    assert (fields["warnings"], fields["recording"]) == (as_url(text), as_url(f"file {text}"))
    assert float(fields[f"P({backslashes})"]) == 0.125
    assert (change["state"], time) == ("raised", [1772366400_000000000])


def test_other_recordings_of_the_same_end_are_other_points_of_influx(tmp_path):
    points = [influx_points(a_record(recording=f"{i}.csv"), tmp_path)[-1] for i in (1, 2, 1)]
    times = [time for *_, (time,) in points]
    assert times[0] == times[2] != times[1]
    assert {time // 1_000_000 for time in times} == {1772366400_000}


def test_a_record_without_values_is_still_a_point_of_influx(tmp_path):
    record = record_of({"error": 'no "speed"'})
    ((_, tags, fields, time),) = influx_points(record, tmp_path)
    assert (tags, time) == ({}, [])
    assert fields == {"complete": "true", "error": 'no "speed"'}


def gauges(path):
    """Return the values of a file of Prometheus, by name and labels."""
    parser = pytest.importorskip("prometheus_client.parser", reason="extra 'test'")
    families = parser.text_fd_to_metric_families(io.StringIO(path.read_text(encoding="utf-8")))
    samples = [sample for family in families for sample in family.samples]
    found = {(s.name, *sorted(s.labels.items())): s.value for s in samples}
    assert len(found) == len(samples)
    return found


@pytest.mark.parametrize("text", NASTY)
def test_a_gauge_has_the_labels_of_its_unit(text, tmp_path):
    sink = sink_of(f"prometheus:{tmp_path / 'a.prom'}")
    sink.write(a_record(text, decision=text))
    label = text.replace("\n", "%0A").replace("\t", "%09").replace("\udcff", "%ED%B3%BF")
    found = gauges(tmp_path / "a.prom")
    assert found["emacm_decision", ("decision", label), ("unit", label)] == 1
    assert found["emacm_expected_cost", ("unit", label)] == 0.5
    assert found["emacm_probability", ("state", "worn"), ("unit", label)] == 0.75
    assert found["emacm_last_record_timestamp_seconds", ("unit", label)] == 1772366400
    assert not any(name == "emacm_typicality" for name, *_ in found)


def test_open_alarms_are_counted_also_those_from_before(tmp_path):
    history, path = History(tmp_path / "h.sqlite"), tmp_path / "a.prom"
    counted = []
    for state in ("raised", "acknowledged", "cleared"):
        record = a_record("a", state, state)
        PrometheusFile(str(path), history).write(record)
        counted.append(gauges(path)["emacm_open_alarms", ("unit", "a")])
        history.write(record)
        PrometheusFile(str(path), history)
        assert gauges(path)["emacm_open_alarms", ("unit", "a")] == counted[-1]
    history.close()
    assert counted == [1, 1, 0]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("results.csv", "one of"),
        ("influx:", "one of"),
        ("prometheus:results.txt", r"FILE\.prom"),
        ("mqtt://host/topic", "history"),
    ],
)
def test_a_sink_of_another_form_is_refused(text, word):
    with pytest.raises(ValueError, match=word):
        sink_of(text)


@pytest.mark.parametrize("address", ["host", "/topic", "a:secret@host/topic", "host/a/+"])
def test_an_address_that_is_no_topic_of_a_broker_is_refused(address, tmp_path):
    pytest.importorskip("paho.mqtt", reason="extra 'mqtt'")
    with pytest.raises(ValueError, match="EMACM_MQTT_PASSWORD"):
        sinks_of([f"mqtt://{address}", str(tmp_path / "h.sqlite")])


def test_two_histories_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"a\.sqlite, b\.sqlite"):
        sinks_of(["a.sqlite", "b.sqlite"])


def test_a_sink_whose_folder_is_missing_is_named(tmp_path):
    for kind in ("influx:", "prometheus:"):
        with pytest.raises(OSError, match=r"none.a\.prom"):
            sink_of(f"{kind}{tmp_path / 'none' / 'a.prom'}")
