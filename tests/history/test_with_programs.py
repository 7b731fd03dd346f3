"""The sinks with the programs that they are for: mosquitto, sqlite3, Prometheus, InfluxDB.

Debian has all of them; a test whose program is not installed is skipped.
"""

import json
import shutil
import socket
import subprocess
import threading
import time
import warnings
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import quote, urlencode
from urllib.request import urlopen

import pytest

from emacm import EmacmWarning
from emacm.history.records import record_of
from emacm.history.sinks import MqttSink, sink_of
from emacm.history.sqlite_history import History

pytestmark = pytest.mark.slow
UNITS = ["pump 3", "fan/1", 'wheel "+#\\" ü']
FAST = "scrape_interval: 1s\n  evaluation_interval: 1s"
END = "2026-03-01T12:{:02d}:{:02d}.000Z"


def program(name):
    """Return the path of a program, or skip the test."""
    path = shutil.which(name) or shutil.which(name, path="/usr/sbin:/usr/local/sbin")
    return path or pytest.skip(f"{name} is not installed")


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def until(condition, seconds=30.0):
    """Wait until a condition holds, and return its value."""
    last = time.monotonic() + seconds
    while not (value := condition()) and time.monotonic() < last:
        time.sleep(0.02)
    assert value, "this did not happen in time"
    return value


def answers(port):
    with socket.socket() as s:
        return s.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def running(*command, port=None):
    """Run a program until the end of the block, where it is killed; wait for its port."""
    process = subprocess.Popen(
        list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        if port:
            until(lambda: answers(port) or process.poll() is not None)
        yield process
    finally:
        process.kill()
        process.wait()


class Broker:
    """Settings of a mosquitto that keeps what it acknowledged; each start of it is a context."""

    def __init__(self, folder, *lines):
        pytest.importorskip("paho.mqtt", reason="extra 'mqtt'")
        self.port, self.config, self._program = free_port(), folder / "m.conf", program("mosquitto")
        self.url = f"mqtt://127.0.0.1:{self.port}/plant/hall"
        kept = ["persistence true", f"persistence_location {folder}/", "user root"]
        kept += ["autosave_on_changes true", "autosave_interval 1"]
        self.config.write_text("\n".join([f"listener {self.port} 127.0.0.1", *kept, *lines]) + "\n")

    def started(self):
        return running(self._program, "-c", self.config, port=self.port)


@pytest.fixture
def broker(tmp_path):
    return Broker(tmp_path, "allow_anonymous true")


@contextmanager
def subscriber(broker, folder, *options):
    """Give a function that returns topics and messages which mosquitto_sub received up to now."""
    received = folder / "received.txt"
    command = [program("mosquitto_sub"), "-h", "127.0.0.1", "-p", broker.port, "-i", "reader"]
    command += ["-V", "5", "-x", "3600", "-c", "-q", "1", "-t", "plant/#", "-F", "%t %p", *options]
    with open(received, "wb") as file:
        process = subprocess.Popen(list(map(str, command)), stdout=file)

    def messages():
        lines = received.read_text().splitlines()
        return [(t, json.loads(text)) for t, _, text in (line.partition(" ") for line in lines)]

    try:
        time.sleep(0.5)  # it has subscribed
        yield messages
    finally:
        process.kill()
        process.wait()


def some_records(n, *, alarms=False):
    for i in range(n):
        end, unit = END.format(i // 60, i % 60), UNITS[i % 3]
        alarm = {"id": f"{i:012x}", "unit": unit, "channel": "", "kind": "decision", "by": ""}
        alarm |= {"severity": "alarm", "state": "raised", "since": end, "time": end, "text": "worn"}
        found = {"decision": "worn", "P(worn)": 0.75, "alarms": [alarm] if alarms else []}
        yield record_of(found, unit=unit, recording=f"{i}.csv", end=end)


def warned(sink, records):
    """Write records, close the sink, and return what it warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        for record in records:
            sink.write(record)
        sink.close()
    return [str(item.message) for item in caught if item.category is EmacmWarning]


def queried(history, sql):
    """Return what the program sqlite3 answers."""
    command = [program("sqlite3"), str(history), sql]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.filterwarnings("ignore:.*the broker cannot be reached")  # stated while it is away
def test_nothing_is_lost_when_the_broker_is_killed_and_started_again(broker, tmp_path):
    base = tmp_path / "h.sqlite"
    with broker.started() as first, subscriber(broker, tmp_path) as messages:
        records, history = list(some_records(300)), History(base)
        sinks = [history, MqttSink(broker.url, history, patience=60)]
        for number, record in enumerate(records):
            if number == 100:
                until(lambda: len(messages()) > 20)
                first.kill()
                first.wait()
            for sink in sinks:
                sink.write(record)
        assert int(queried(base, "SELECT count(*) FROM unsent")) >= 200
        with broker.started():
            until(lambda: answers(broker.port))
            for sink in reversed(sinks):
                sink.close()
            until(lambda: len({message["id"] for _, message in messages()}) == 300)
            found = {message["id"]: (topic, message) for topic, message in messages()}
    for record in records:
        topic = f"plant/hall/records/{quote(record['unit'], safe='')}"
        assert found[record["id"]] == (topic, record)
    assert queried(base, "SELECT count(*) FROM unsent") == "0"
    assert queried(base, "SELECT count(*), count(DISTINCT id) FROM records") == "300|300"


def test_records_of_an_outage_are_sent_by_the_next_process_in_their_order(broker, tmp_path):
    history, records = History(tmp_path / "h.sqlite"), list(some_records(40, alarms=True))
    history.write(*records)
    (text,) = warned(MqttSink(broker.url, history, at_once=10, patience=0.5), records)
    assert "cannot be reached" in text
    assert "h.sqlite" in text
    with broker.started(), subscriber(broker, tmp_path) as messages:
        MqttSink(broker.url, history, at_once=7).close()
        until(lambda: len(messages()) == 80)
        found = messages()
    assert [message["id"] for topic, message in found if "/records/" in topic] == [
        record["id"] for record in records
    ]
    changes = [message for topic, message in found if topic.startswith("plant/hall/alarms/")]
    assert changes == [record["alarms"][0] for record in records]
    assert not history.unsent(broker.url)
    history.close()


@pytest.mark.filterwarnings("ignore:unclosed.*SSLSocket:ResourceWarning")  # left by paho-mqtt
def test_a_broker_with_tls_is_sent_to_if_its_certificate_is_trusted(tmp_path, monkeypatch):
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    command = [program("openssl"), "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"]
    command += ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    command += ["-keyout", str(key), "-out", str(certificate)]
    subprocess.run(command, check=True, capture_output=True)
    broker = Broker(tmp_path, "allow_anonymous true", f"certfile {certificate}", f"keyfile {key}")
    url, history = f"mqtts://localhost:{broker.port}/plant", History(tmp_path / "h.sqlite")
    (record,) = some_records(1)
    history.write(record)
    with broker.started():
        (text,) = warned(MqttSink(url, history, patience=1.0), [record])
        assert "cannot be reached" in text
        assert history.unsent(url) == [record]
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
        MqttSink(url, history).close()
    assert not history.unsent(url)
    history.close()


def text_of(url):
    """Return a page; an empty text if the program is not ready yet."""
    try:
        with urlopen(url, timeout=10) as answer:
            return answer.read().decode()
    except HTTPError as error:
        error.close()
        return ""


@pytest.fixture
def exporter(tmp_path):
    port = free_port()
    command = [program("prometheus-node-exporter"), "--collector.disable-defaults"]
    command += ["--collector.textfile", f"--collector.textfile.directory={tmp_path}"]
    with running(*command, f"--web.listen-address=127.0.0.1:{port}", port=port):
        yield port


def test_the_node_exporter_reads_the_file_at_any_time_while_it_is_written(exporter, tmp_path):
    sink, ended = sink_of(f"prometheus:{tmp_path / 'a.prom'}"), threading.Event()

    def write_on():
        while not ended.is_set():
            for record in some_records(100):
                sink.write(record)

    writing = threading.Thread(target=write_on)
    writing.start()
    pages = [text_of(f"http://127.0.0.1:{exporter}/metrics") for _ in range(50)]
    ended.set()
    writing.join()
    assert all("node_textfile_scrape_error 0" in page for page in pages)
    assert 'emacm_decision{decision="worn",unit="wheel \\"+#\\\\\\" ü"} 1' in pages[-1]


PLANT = Path(__file__).parents[2] / "notebooks" / "plant"


def test_prometheus_answers_what_the_dashboard_asks_and_raises_its_alarm(exporter, tmp_path):
    sink, port = sink_of(f"prometheus:{tmp_path / 'a.prom'}"), free_port()
    for record in some_records(4, alarms=True):
        sink.write(record | {"expected_cost": 0.5, "typicality": 0.25})
    for name in ("prometheus.yml", "alarms.yml"):
        text = (PLANT / name).read_text(encoding="utf-8").replace("scrape_interval: 5s", FAST)
        (tmp_path / name).write_text(text.replace("localhost:9100", f"127.0.0.1:{exporter}"))
    command = [program("prometheus"), f"--storage.tsdb.path={tmp_path}"]
    command += [f"--config.file={tmp_path / 'prometheus.yml'}", "--log.level=error"]
    panels = json.loads((PLANT / "grafana_dashboard.json").read_text(encoding="utf-8"))["panels"]
    queries = [target["expr"] for panel in panels for target in panel["targets"]]
    with running(*command, f"--web.listen-address=127.0.0.1:{port}", port=port):

        def result(path, **query):
            page = text_of(f"http://127.0.0.1:{port}/api/v1/{path}?{urlencode(query)}")
            return json.loads(page or "{}").get("data", {})

        found = [
            until(lambda query=query: result("query", query=query).get("result"))
            for query in queries
        ]
        raised = until(lambda: result("alerts").get("alerts"))
    opened = {item["metric"]["unit"]: item["value"][1] for item in found[0]}
    assert opened == {UNITS[0]: "2", UNITS[1]: "1", UNITS[2]: "1"}
    assert all(len(items) == 3 for items in found)
    names = {alert["labels"]["alertname"] for alert in raised}
    assert names == {"OpenAlarm", "NoRecord"}  # the records are of March


def test_influxdb_answers_with_the_records_written_as_lines(tmp_path):
    sink, records = sink_of(f"influx:{tmp_path / 'points.txt'}"), list(some_records(9, alarms=True))
    for record in [*records, records[0]]:  # the same again is the same point
        sink.write(record)
    sink.close()
    http, own = free_port(), free_port()
    config = tmp_path / "influxdb.conf"
    config.write_text(
        f'bind-address = "127.0.0.1:{own}"\nreporting-disabled = true\n'
        f'[meta]\ndir = "{tmp_path}/meta"\n'
        f'[data]\ndir = "{tmp_path}/data"\nwal-dir = "{tmp_path}/wal"\n'
        f'[http]\nbind-address = "127.0.0.1:{http}"\n'
    )
    url = f"http://127.0.0.1:{http}"
    with running(program("influxd"), "-config", config, port=http):

        def answer(text):
            found = json.loads(text_of(f"{url}/query?{urlencode({'q': text, 'db': 'plant'})}"))
            return found["results"][0].get("series", [])

        def created():  # it listens before it can create a database
            create = urlencode({"q": "CREATE DATABASE plant"}).encode()
            urlopen(f"{url}/query", data=create, timeout=10).close()
            return answer("SHOW DATABASES")[0].get("values")

        until(lambda: ["plant"] in (created() or []))
        lines = Path(tmp_path / "points.txt").read_bytes()
        with urlopen(f"{url}/write?db=plant", data=lines, timeout=10) as written:
            assert written.status == 204
        series = answer("SELECT count(decision) FROM emacm GROUP BY unit")
        (changes,) = answer("SELECT count(state) FROM emacm_alarms")
        (first,) = answer("SELECT decision, \"P(worn)\" FROM emacm WHERE unit = 'pump 3' LIMIT 1")
    units = {item["tags"]["unit"]: item["values"][0][1] for item in series}
    assert units == {unit.replace("\\", "%5C"): 3 for unit in UNITS}
    assert changes["values"][0][1] == 9
    assert first["values"][0][1:] == ["worn", 0.75]
