"""Sinks: where records are sent while they are made, in the formats of other programs.

References
----------
.. [1] InfluxDB documentation, Line protocol reference.
.. [2] Prometheus documentation, Exposition formats, text-based format.
.. [3] OASIS, MQTT version 5.0, 2019.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any
from urllib.parse import quote, urlsplit

import pandas as pd

from emacm._saved import locked, write_whole
from emacm._statements import warn
from emacm.history.sqlite_history import History, is_history

# Control characters, and what would be taken for one that is written as in a URL
_CONTROL = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]|%(?=[0-9A-Fa-f]{2})")
_FORMS = "FILE.sqlite, influx:FILE, influx:-, prometheus:FILE.prom, mqtt://[user@]host[:port]/topic"


def sinks_of(texts: Sequence[str]) -> list[Any]:
    """Return the sinks of an option that may be repeated; first a history, to be closed last.

    Parameters
    ----------
    texts : sequence of str
        ``results.sqlite`` (also .db) for a `History`, others as for `sink_of`, which is given the
        history.

    Raises
    ------
    ValueError
        If there are two histories, or see `sink_of`.
    """
    paths = [text for text in texts if is_history(Path(text))]
    if len(paths) > 1:  # alarms are acknowledged in one
        raise ValueError(f"sinks may have one history, got {', '.join(paths)}. Leave out the rest.")
    history = History(paths[0]) if paths else None
    others = [sink_of(text, history) for text in texts if text not in paths]
    return [history, *others] if history else others


def sink_of(text: str, history: History | None = None) -> InfluxLines | PrometheusFile | MqttSink:
    """Return the sink that a text names.

    Parameters
    ----------
    text : str
        ``influx:FILE``: `InfluxLines`, on the standard output if FILE is "-".
        ``prometheus:FILE.prom``: `PrometheusFile`.
        ``mqtt://[user@]host[:port]/topic``, or ``mqtts:`` with TLS: `MqttSink`.
    history : History, optional
        Needed by MQTT; that of the open alarms for Prometheus.

    Returns
    -------
    InfluxLines, PrometheusFile or MqttSink
        With `write` of a record, and `close`.

    Raises
    ------
    ValueError
        If the text is of no such form, or MQTT has no history.
    OSError
        If the file cannot be written.
    ImportError
        If MQTT is wanted, and paho-mqtt is not installed.

    Examples
    --------
    >>> from emacm.history.records import record_of
    >>> sink = sink_of("influx:-")
    >>> found = {"decision": "worn", "P(worn)": 0.75, "id": "0f", "end": "2026-03-01 12:00"}
    >>> sink.write(record_of(found, unit="pump 3"))
    emacm,unit=pump\\ 3 decision="worn",P(worn)=0.75,complete=true 1772366400000000015
    """
    kind, _, rest = text.partition(":")
    if kind == "influx" and rest:
        return InfluxLines(rest)
    if kind == "prometheus" and rest.endswith(".prom"):
        return PrometheusFile(rest, history)
    if kind in ("mqtt", "mqtts"):
        return MqttSink(text, history)
    raise ValueError(f"a sink must be one of {_FORMS}; got {text!r}.")


class InfluxLines:
    """Records in the line protocol of InfluxDB [1]_, which Telegraf reads too.

    Measurement ``emacm`` has the unit as tag and decision, costs, typicality, probabilities and
    texts as fields; ``emacm_alarms`` has a point for each change of an alarm. The time is the end
    of the record in ns. As a point of the same tags and time replaces another one, up to 65,535 ns
    that follow from its `id` are added: another record of the same end is another point, and the
    same one is the same. Control characters, and backslashes of tags, are written as in a URL.

    Parameters
    ----------
    path : str
        File that lines are added to; "-" for the standard output.

    Raises
    ------
    OSError
        If the file cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._file = None if path == "-" else open(path, "ab", buffering=0)  # noqa: SIM115

    def write(self, record: Mapping[str, Any]) -> None:
        """Write the lines of a record and of its alarms."""
        names = ["decision", "expected_cost", "typicality", *_probabilities(record), "complete"]
        names += ["warnings", "outside_training", "error", "recording", "model"]
        time = _nanoseconds(record["end"], int(record["id"][:4], 16))
        fields = {name: record[name] for name in names}
        lines = _point("emacm", {"unit": record["unit"]}, fields, time)
        for alarm in record["alarms"]:
            tags = {name: alarm[name] for name in ("unit", "channel", "kind", "severity")}
            fields = {name: alarm[name] for name in ("state", "by", "text", "since")}
            lines += _point("emacm_alarms", tags, fields, _nanoseconds(alarm["time"]))
        if self._file is None:
            sys.stdout.write(lines)
            sys.stdout.flush()
        else:
            self._file.write(lines.encode())  # at once: a line is never half

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()


def _point(name: str, tags: Mapping[str, str], fields: Mapping[str, Any], time: str) -> str:
    """Return a line; tags that are empty, and fields without a value, are left out."""
    series = [name, *(f"{_escaped(tag)}={_escaped(value)}" for tag, value in tags.items() if value)]
    known = {field: value for field, value in fields.items() if value is not None and value != ""}
    values = [f"{_escaped(field)}={_field(value)}" for field, value in known.items()]
    return f"{','.join(series)} {','.join(values)} {time}".rstrip() + "\n"


def _nanoseconds(time: str | None, more: int = 0) -> str:
    return str(pd.Timestamp(time).value + more) if time else ""


def _escaped(text: str) -> str:
    """Return a tag or a name; a backslash at its end would escape the separator."""
    return re.sub(r"([,= ])", r"\\\1", _printable(text).replace("\\", "%5C"))


def _field(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return _quoted(value) if isinstance(value, str) else repr(float(value))


def _quoted(text: str) -> str:
    """Return a text in quotation marks, as a field of InfluxDB and as a label of Prometheus."""
    return '"' + re.sub(r'(["\\])', r"\\\1", _printable(text)) + '"'


def _printable(text: str) -> str:
    """Return a text in one line and of valid characters, other texts as other ones."""
    return _CONTROL.sub(lambda found: quote(found[0], safe="", errors="surrogatepass"), text)


def _probabilities(record: Mapping[str, Any]) -> list[str]:
    return [name for name in record if name.startswith("P(")]


class PrometheusFile:
    """The last record of each unit as a file of gauges [2]_, for the node exporter of Prometheus.

    The file is always whole. Units that are not written here keep their values: several processes
    may write one file. Gauges, all with the label `unit`: ``emacm_decision`` (1, with the
    label `decision`), ``emacm_expected_cost``, ``emacm_typicality``, ``emacm_probability`` (label
    `state`), ``emacm_open_alarms`` (those that are not cleared) and
    ``emacm_last_record_timestamp_seconds``. A value that is not known is left out.

    Parameters
    ----------
    path : str
        File, in the folder that the exporter reads (``--collector.textfile.directory``).
    history : History, optional
        The last records and open alarms from before.

    Raises
    ------
    OSError
        If the file cannot be written.
    """

    def __init__(self, path: str, history: History | None = None) -> None:
        self._path = Path(path)
        self._open: dict[str, set[str]] = {}
        for alarm in history.alarms(open_only=True) if history else ():
            self._open.setdefault(alarm["unit"], set()).add(alarm["id"])
        self._save(*(history.last_records() if history else ()))

    def write(self, record: Mapping[str, Any]) -> None:
        """Write the file with this record as the last one of its unit."""
        opened = self._open.setdefault(record["unit"], set())
        for alarm in record["alarms"]:
            (opened.discard if alarm["state"] == "cleared" else opened.add)(alarm["id"])
        self._save(record)

    def close(self) -> None:
        """Leave the file as it is."""

    def _values(self, record: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
        """Yield gauge, further label and value of all that is stated of a unit."""
        if record["decision"] is not None:
            yield "decision", f",decision={_quoted(record['decision'])}", 1
        yield "expected_cost", "", record["expected_cost"]
        yield "typicality", "", record["typicality"]
        for name in _probabilities(record):
            yield "probability", f",state={_quoted(name[2:-1])}", record[name]
        yield "open_alarms", "", len(self._open.get(record["unit"], ()))
        end = record["end"] and pd.Timestamp(record["end"]).timestamp()
        yield "last_record_timestamp_seconds", "", end

    def _save(self, *records: Mapping[str, Any]) -> None:
        """Write records, of different units; the lines of other units are kept."""
        of_units = {f"{{unit={_quoted(record['unit'])}" for record in records}
        self._path.touch()
        with locked(self._path, wait=True):
            known = self._path.read_bytes().decode(errors="replace").split("\n")
            kept = [line for line in known if not any(unit in line for unit in of_units)]
            lines: list[str] = []
            for gauge, about in _GAUGES.items():
                name = f"emacm_{gauge}"
                lines += [f"# HELP {name} {about}", f"# TYPE {name} gauge"]
                lines += [line for line in kept if line.startswith(f"{name}{{")]
                for record in records:
                    for own, label, value in self._values(record):
                        if own == gauge and value is not None:
                            labels = f"{{unit={_quoted(record['unit'])}{label}}}"
                            lines.append(f"{name}{labels} {float(value)!r}")
            write_whole(self._path, "\n".join([*lines, ""]).encode())


_GAUGES = {
    "decision": "Decision of least expected cost.",
    "expected_cost": "Expected cost of the decision.",
    "typicality": "Share of the training that is as far from all classes.",
    "probability": "Probability of a state.",
    "open_alarms": "Alarms that are not cleared.",
    "last_record_timestamp_seconds": "End of the last record.",
}


class MqttSink:
    """Records and changes of alarms as messages of MQTT 5 [3]_, which are sent at least once.

    Records are JSON messages of topic ``<topic>/records/<unit>``, changes of alarms of
    ``<topic>/alarms/<unit>``; the unit is written as in a URL ("pump 3": ``pump%203``). Quality of
    service 1: a record counts as sent when the broker acknowledges it and its alarms. Until then
    it is noted in the table `unsent` of the history. What was not acknowledged is sent when the
    broker is back, also by the next process. A receiver drops a message whose `id` it has.

    Parameters
    ----------
    url : str
        ``mqtt://[user@]host[:port]/topic``; ``mqtts:`` encrypts with TLS (port 8883). The password
        is taken from the environment variable EMACM_MQTT_PASSWORD.
    history : History
        To which each record is written before.
    at_once : int, default=100
        Messages that may wait for their acknowledgement at the same time.
    patience : float, default=5
        Seconds that `close` waits for acknowledgements.

    Raises
    ------
    ValueError
        If there is no history, or the URL has no host or topic, or a password.
    ImportError
        If paho-mqtt is not installed.

    Warns
    -----
    EmacmWarning
        By `write` and `close`, if the broker cannot be reached, or refuses the user or a message.
    """

    def __init__(
        self, url: str, history: History | None, *, at_once: int = 100, patience: float = 5.0
    ) -> None:
        if history is None:
            raise ValueError(
                f"{url}: MQTT needs a history, as --sink h.sqlite, for times without the broker."
            )
        self._url, self._history = url, history
        self._at_once, self._patience = at_once, patience
        self._notes: SimpleQueue[tuple[int, str]] = SimpleQueue()  # from the connection's thread
        self._client, self._topic = _connecting(url, self._notes)
        self._pending: dict[int, str] = {}  # identity of the record of each message
        self._refused: set[str] = set()  # left to the next process
        self._stated: set[str] = set()
        self._client.loop_start()
        history.send_to(url)  # noted with the record: a kill in between loses nothing

    def write(self, record: Mapping[str, Any]) -> None:
        """Send a record, or leave it noted in the history if the broker is away."""
        self._history.note_unsent(self._url, record["id"])
        self._settle()

    def close(self) -> None:
        """Wait for acknowledgements; what is not sent then is left noted in the history."""
        until = time.monotonic() + self._patience
        self._settle()
        while self._pending and time.monotonic() < until:
            time.sleep(0.02)
            self._settle()
        self._client.disconnect()
        self._client.loop_stop()

    def _settle(self) -> None:
        """Note in the history what is acknowledged, and send what is kept there."""
        while not self._notes.empty():
            number, problem = self._notes.get()
            identity = self._pending.pop(number, None)
            if problem and problem not in self._stated:
                self._stated.add(problem)
                text = f"{self._url}: {problem}. What it does not acknowledge is kept in"
                warn("not sent", f"{text} {self._history.path}.", stacklevel=3)
            if problem and identity:
                self._refused.add(identity)  # another message of this record does not make it sent
            elif identity and identity not in {*self._pending.values(), *self._refused}:
                self._history.note_sent(self._url, identity)
        if len(self._pending) < self._at_once:
            for record in self._history.unsent(self._url, self._at_once + len(self._refused)):
                if record["id"] not in {*self._pending.values(), *self._refused}:
                    self._publish(record)

    def _publish(self, record: Mapping[str, Any]) -> None:
        topics = [("alarms", alarm) for alarm in record["alarms"]] + [("records", record)]
        unit = quote(record["unit"], safe="", errors="surrogatepass")
        for kind, content in topics:
            topic = f"{self._topic}/{kind}/{unit}"
            sent = self._client.publish(topic, json.dumps(content), qos=1)
            self._pending[sent.mid] = record["id"]


def _connecting(url: str, notes: SimpleQueue[tuple[int, str]]) -> tuple[Any, str]:
    """Return a client of paho-mqtt that connects, again and again, when started; and the topic.

    It notes the number of each message (0: the connection), and what problem there was with it.
    """
    try:
        from paho.mqtt import client as mqtt
    except ImportError as error:
        raise ImportError("MQTT needs paho-mqtt; run pip install 'emacm[mqtt]'.") from error
    parts = urlsplit(url)
    topic = parts.path.strip("/")
    if not parts.hostname or not topic or re.search("[+#]", topic) or parts.password is not None:
        raise ValueError(
            f"{url} must be of the form mqtt://[user@]host[:port]/topic, where the topic has no + "
            f"or #, and the password is in the environment variable EMACM_MQTT_PASSWORD."
        )
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, protocol=mqtt.MQTTv5)
    if parts.scheme == "mqtts":
        client.tls_set()
    if parts.username is not None:
        client.username_pw_set(parts.username, os.environ.get("EMACM_MQTT_PASSWORD"))
    client.on_publish = lambda _, __, number, code, ___: notes.put((number, _problem(code)))
    client.on_connect = lambda _, __, ___, code, ____: notes.put((0, _problem(code)))
    client.on_connect_fail = lambda *_: notes.put((0, "the broker cannot be reached"))
    client.reconnect_delay_set(1, 30)
    client.connect_async(parts.hostname, parts.port or (8883 if parts.scheme == "mqtts" else 1883))
    return client, topic


def _problem(code: Any) -> str:
    return f"the broker answers: {code}" if code.is_failure else ""
