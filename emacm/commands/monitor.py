"""The command ``emacm monitor``: a model applied to rows of numbers while they are measured."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from io import StringIO
from itertools import chain, islice
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from emacm._checks import located
from emacm._saved import locked, packed, unpacked, write_whole
from emacm._statements import warn
from emacm.commands.stream_records import Record, StreamRecords
from emacm.files.column_roles import recording_arguments, start_of, time_of_sample
from emacm.files.csv_files import text_table
from emacm.files.file_columns import FileColumns
from emacm.files.folder import open_recording
from emacm.files.layout import Layout
from emacm.files.shaft_references import angle_form
from emacm.history.records import record_of
from emacm.models.model_files import load_model
from emacm.models.scoring import scored_rows
from emacm.streams.order_monitor import OrderMonitor
from emacm.streams.streamed_models import Reading

FAILED = 3  # exit status: rows were skipped
_BYTES = ("last", "before", "head")  # of a state


def run(options: argparse.Namespace) -> int:
    """Print a record of each reading of a stream, and return the exit status.

    Returns
    -------
    int
        0; 3 if rows were invalid and skipped.
    """
    # Signals that are stored for an alarm have other names than the files of a folder.
    layout = replace(Layout.from_toml(options.layout), meta=None)
    model = load_model(options.model)
    _check_layout(layout)
    if options.source == "-" and options.state is not None:
        raise ValueError("--state needs a file, as the standard input cannot be read again.")
    file = None if options.source == "-" else _GrowingFile(options.source, options.idle)
    with (
        nullcontext() if options.state is None else locked(options.state),
        closing(_Stream(model, layout, options, file)) as stream,
    ):
        return stream.follow()


def _check_layout(layout: Layout) -> None:
    """Refuse a layout whose shaft angle cannot be found row by row."""
    form, angle = angle_form(layout.angle), layout.angle
    options = angle if isinstance(angle, Mapping) else {}
    reasons = {
        "tacho": layout.tacho is not None,
        "resample": layout.resample,
        "a second file": layout.of_second_file() is not None,
        "an angle from a vibration": form == "vibration",
        "an angle from currents": form == "currents",
        "a resolver of several pole pairs": options.get("pole_pairs", 1) > 1 and form == "resolver",
        "ratio and an angle that is wrapped": layout.ratio != 1 and _is_wrapped(layout),
    }
    for reason, needs_all in reasons.items():
        if needs_all:
            raise ValueError(
                f"a layout with {reason} needs whole recordings, as the rows before decide on the "
                f"angle of a row; give a column of FILE as velocity, angle, or position with lead."
            )


def _is_wrapped(layout: Layout) -> bool:
    """Tell whether the layout states an angle within one revolution."""
    angle = layout.angle if isinstance(layout.angle, Mapping) else {}
    return bool(angle.get("wrapped")) or angle_form(angle) == "resolver"


class _GrowingFile:
    """A file that grows, and that may be emptied, or replaced by another one of its name.

    It is opened whenever something is read. That the bytes before the place of reading are still
    the same is checked then.
    """

    def __init__(self, path: str, idle: float) -> None:
        self._path, self._idle = path, idle
        self._place, self._before, self._ended = 0, b"", False
        open(path, "rb").close()  # so that a missing file is an error

    def go_to(self, place: int, before: bytes) -> bool:
        """Go on at a place, and tell whether these bytes are before it."""
        self._place, self._before = place, before
        return self._read(0) is not None

    def contents(self) -> Iterator[Iterator[bytes]]:
        """Yield the lines of the content, and then those of each content that replaces it."""
        while not self._ended:
            yield self._lines()
            self._place, self._before = 0, b""

    def _lines(self) -> Iterator[bytes]:
        """Yield complete lines, until there is another content or none for `idle` seconds."""
        part, since = b"", time.monotonic()
        while (new := self._read()) is not None:
            if new:
                since = time.monotonic()
                *lines, part = (part + new).split(b"\n")
                yield from (line + b"\n" for line in lines)
            elif time.monotonic() - since >= self._idle:
                self._ended = True
                return
            else:
                time.sleep(min(0.1, self._idle))

    def _read(self, n_bytes: int = 1 << 16) -> bytes | None:
        """Return the next bytes, b"" if there are none yet; None if the content is another one."""
        n_before = len(self._before)
        try:
            with open(self._path, "rb") as file:
                file.seek(self._place - n_before)
                content = file.read(n_before + n_bytes)
        except FileNotFoundError:  # renamed, and not created again yet
            return b""
        if not content.startswith(self._before):
            return None
        self._place += len(content) - n_before
        self._before = content[-4096:]
        return content[n_before:]


class _Evidence:
    """The rows of the last readings of a stream, which are stored when an alarm is raised.

    For each reading, a CSV file has the rows as they were measured, below the header, and a JSON
    file of the same name the record, as ``emacm score`` makes it of this CSV file: another run with
    the same model and layout finds the same values. The names follow from the alarm and the number
    of the reading, of which the last one raised it: after a kill, they are the same again. Readings
    from before the file was replaced, or the clock set back, are not stored.

    Parameters
    ----------
    options : Namespace
        With `evidence`, the folder, and `keep_alarms`, how many readings are stored for each alarm.
    fs : float
        Rows per second [Hz].
    model : estimator
        The model.
    layout : Layout
        That of the user.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """

    def __init__(self, options: argparse.Namespace, fs: float, model: Any, layout: Layout) -> None:
        self._options, self._fs, self._model, self._layout = options, fs, model, layout
        # Time of the first row [s], rows, and their place in the file
        self._blocks: deque[tuple[float, list[bytes], int]] = deque()
        self._records: deque[Record] = deque(maxlen=options.keep_alarms)
        self._unwritten: list[tuple[Record, str, bytes]] = []
        options.evidence.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=options.evidence).close()

    def add(self, start: float, rows: list[bytes], place: int) -> None:
        """Add rows, the first of which was measured at a time of the stream [s]."""
        if self._blocks and start < self._blocks[-1][0]:  # the clock was set back
            self.forget()
        self._blocks.append((start, rows, place))

    def forget(self) -> None:
        """Forget the readings up to now; the times, or the header and the file, are others now."""
        self._blocks.clear()
        self._records.clear()

    def state(self) -> dict[str, Any]:
        """Return what `restore` needs; the rows are in the file."""
        blocks = [(start, len(rows), place) for start, rows, place in self._blocks]
        return {"records": [*self._records], "blocks": blocks}

    def restore(self, state: dict[str, Any], path: str) -> None:
        """Continue from a state, with the rows that the file still has."""
        self._records.extend(state["records"])
        with open(path, "rb") as file:
            for start, n_rows, place in state["blocks"]:
                file.seek(place)
                self.add(start, list(islice(filter(bytes.strip, file), n_rows)), place)

    def store(self, records: Sequence[Record], header: list[bytes]) -> None:
        """Store the last readings of each of these records that raises an alarm.

        What cannot be written is kept, and tried again with the next reading.
        """
        for record in records:
            if record["complete"]:
                self._records.append(record)
            for change in record["alarms"]:
                if change["state"] == "raised":
                    self._unwritten += self._signals(change, record, header)
        try:
            while self._unwritten:
                self._write(*self._unwritten[0])
                del self._unwritten[0]
        except OSError as error:
            del self._unwritten[: -self._options.keep_alarms]
            warn("evidence", f"{error}. It is tried again with the next reading.")
        if len(self._records) == self._records.maxlen:
            needed = self._records[min(1, len(self._records) - 1)]["stream_start"]
            while self._blocks and self._blocks[0][0] + len(self._blocks[0][1]) / self._fs < needed:
                self._blocks.popleft()

    def _signals(
        self, change: Record, record: Record, header: list[bytes]
    ) -> Iterator[tuple[Record, str, bytes]]:
        """Yield the last readings whose rows are known, the names of their files, and the rows."""
        time = re.sub(r"[-:]|\.\d+", "", change["time"])
        if record["times"] == "clock":  # another one after a kill
            time = f"{record['stream_end']:g}s"
        last = self._options.keep_alarms
        for number, reading in enumerate(self._records, last + 1 - len(self._records)):
            name = f"{time}_{change['id']}_{record['id'][:8]}_{number:0{len(str(last))}}"
            first, after = (reading[at] * self._fs - 0.5 for at in ("stream_start", "stream_end"))
            rows = [
                row
                for start, block, _ in self._blocks
                for place, row in enumerate(block, round(start * self._fs))
                if first <= place < after
            ]
            if len(rows) >= after - first - 1:  # all of them are known
                yield reading, name, b"".join([*header, *rows])

    def _write(self, record: Record, name: str, content: bytes) -> None:
        path = self._options.evidence / f"{name}.csv"
        write_whole(path, content)
        source = partial(open_recording, path, self._layout)
        (scored,) = scored_rows(self._model, [source], [record["recording"]])
        text = json.dumps(record_of({**record, **scored}), indent=1)
        write_whole(path.with_suffix(".json"), text.encode())


@dataclass
class _Position:
    """Where a stream has got to: what of it is processed, and at which time.

    Attributes
    ----------
    offset : int
        Bytes of the file that are processed.
    before : bytes
        The last of these bytes.
    last : bytes
        The row before, so that gaps between blocks are noticed.
    resumed : float or None
        Time at which the stream goes on after an error [s].
    ahead : float
        Of the clock of the rows, before that of the monitor [s].
    """

    offset: int = 0
    before: bytes = b""
    last: bytes = b""
    resumed: float | None = None
    ahead: float = 0.0

    def pass_over(self, lines: list[bytes]) -> None:
        """Note that lines are processed."""
        text = b"".join(lines)
        self.offset += len(text)
        self.before = (self.before + text)[-4096:]


class _Stream:
    """The rows of a stream, and the monitor that they are given to.

    Rows of 0.1 s are processed together; header and separator are found in the first 20 lines.
    """

    def __init__(
        self, model: Any, layout: Layout, options: argparse.Namespace, file: _GrowingFile | None
    ) -> None:
        self._layout, self._options = layout, options
        self._n_failed, self._position = 0, _Position()
        if file:
            self._contents = file.contents()
        else:  # the last line may be incomplete
            self._contents = iter([filter(lambda line: line.endswith(b"\n"), sys.stdin.buffer)])
        where = f"--state {options.state}, without which the file is read from its beginning"
        with located(where):
            state = self._saved_state()
        self._head = state["head"].splitlines(keepends=True) if state else self._peek()
        with located(options.source if file else "the standard input"):
            self._table = text_table(_decoded(self._head))
            content = self._content(self._head[self._table.start :])
            arguments = recording_arguments(content, layout)
        rates = arguments["fs"]
        self._fs = max(rates.values())
        if layout.fs is None:
            self._layout = replace(layout, fs=self._fs)
        self._monitor = OrderMonitor(
            model,
            fs=rates,
            channels=list(rates),
            max_speed=options.max_speed,
            shaft_fs=arguments["shaft_fs"],
            every=options.every,
            unit=options.unit,
            wrapped=_is_wrapped(layout),
        )
        has_dates = start_of(content, layout) is not None
        self._records = StreamRecords(model, has_dates, options)
        kept = (options, self._fs, model, layout)
        self._evidence = _Evidence(*kept) if options.keep_alarms else None
        if state and file:
            with located(where):
                self._restore(state, file)

    def close(self) -> None:
        """Close what records are written to."""
        self._records.close()

    def follow(self) -> int:
        """Process all lines, and return the exit status."""
        for number, lines in enumerate(self._contents):
            if number > 0:
                source = self._options.source
                self._position.offset, self._position.before = 0, b""
                if self._evidence:
                    self._evidence.forget()
                self._interrupt(f"{source} was emptied or replaced. It is read from its new start.")
            is_start = self._position.offset == 0
            rows = chain(self._rows_below_header(lines) if is_start else [], lines)
            while block := list(islice(rows, max(2, round(0.1 * self._fs)))):
                self._process(block)
        self._save()
        is_whole = self._options.every is None and not self._n_failed and not self._options.state
        self._records.write(self._records_of(self._monitor.flush(complete=is_whole)))
        return FAILED if self._n_failed else 0

    def _peek(self) -> list[bytes]:
        """Return the first lines, which will be read again."""
        lines = next(self._contents)
        head = list(islice(lines, 20))
        self._contents = chain([chain(head, lines)], self._contents)
        return head

    def _rows_below_header(self, lines: Iterator[bytes]) -> list[bytes]:
        """Return the rows in the first lines; the header may be lacking, if there was one before.

        Of a header without rows, nothing is processed, so that a next run begins with it.
        """
        head = list(islice(lines, 20))
        try:
            table = text_table(_decoded(head))
        except ValueError:  # the first row may be cut
            return head if len(head) == 20 else []
        if table.names[0] != "x0":  # the name where no header is found
            self._table, self._head = table, head
        self._position.pass_over(head[: table.start])
        return head[table.start :]

    def _content(self, rows: Iterable[bytes]) -> FileColumns:
        content, text = FileColumns(), b"".join(rows)
        if b"\0" in text or b"\r" in text.replace(b"\r\n", b""):
            raise ValueError("a row has bytes 0, or a line end inside: it was not written whole.")
        self._table.add_columns(content, StringIO(text.decode()))
        content.take_units_from_names()
        return content

    def _process(self, rows: list[bytes]) -> None:
        """Record the readings that are complete with these rows, or why the rows are skipped."""
        position = self._position
        n_before, place = (1 if position.last else 0), position.offset
        position.pass_over(rows)
        rows = [row for row in rows if row.strip()]
        if not rows:
            return
        try:
            content = self._content([position.last, *rows])
            arguments = recording_arguments(content, self._layout)
            start = time_of_sample(content, self._layout, n_before)
            if start is not None and n_before:
                position.ahead = start - self._monitor.time
            elif start is not None:
                position.ahead, position.resumed = 0.0, start
            signals = {name: s[n_before:] for name, s in arguments["signals"].items()}
            kind = "angle" if "angle" in arguments else "velocity"
            shaft = np.broadcast_to(arguments[kind], len(rows) + n_before)[n_before:]
            options: dict[str, Any] = {kind: shaft, "time": position.resumed}
            readings = self._monitor.push(signals, **options)
        except (TypeError, ValueError) as error:
            self._n_failed += 1
            self._interrupt(str(error), len(rows))
            return
        position.last, position.resumed = rows[-1], None
        if self._evidence:
            start = self._monitor.time + position.ahead - len(rows) / self._fs
            self._evidence.add(start, rows, place)
        self._save_and_write(self._records_of(readings))

    def _interrupt(self, error: str, n_skipped: int = 0) -> None:
        """State an error; the reading up to it ends, and another one begins."""
        position = self._position
        time = self._monitor.time + position.ahead
        ended = time if position.resumed is None else position.resumed
        try:
            readings = self._monitor.flush(complete=False)
        except ValueError:
            self._monitor.reset()
            readings = []
        records = self._records_of(readings)
        resumed = position.resumed = ended + n_skipped / self._fs
        position.last, position.ahead = b"", 0.0
        text = " ".join(error.split())
        if n_skipped:
            text += f" The {n_skipped} rows after {ended:.9g} s are skipped."
        skipped = {"error": text, "complete": False}
        records.append(self._records.record(skipped, ended, resumed, position.before))
        self._save_and_write(records)

    def _records_of(self, readings: list[Reading]) -> list[Record]:
        """Return the records of readings; the signals before their alarms are stored before them.

        A process that ends in between is continued before this reading, and stores them again.
        """
        known = self._position.ahead, self._position.before
        records = [self._records.of_reading(reading, *known) for reading in readings]
        if self._evidence:
            self._evidence.store(records, self._head[: self._table.start])
        return records

    def _save_and_write(self, records: list[Record]) -> None:
        """Write records, which are in the state before: if the process is killed, none is lost."""
        if records:
            self._save(records)
            self._records.write(records)

    def _saved_state(self) -> dict[str, Any]:
        """Return what `_save` wrote; empty if there is nothing."""
        file = self._options.state
        if file is None or not file.exists():
            return {}
        state = unpacked(file.read_bytes())
        if not isinstance(state.get("before"), str):
            raise ValueError("it is no state of this command, or of another version of emacm.")
        for name in _BYTES:
            state[name] = state[name].encode("latin-1")
        return state

    def _restore(self, state: dict[str, Any], file: _GrowingFile) -> None:
        """Restore a state, and go on in the file where it was written."""
        self._position = _Position(**{name: state[name] for name in asdict(self._position)})
        goes_on = file.go_to(self._position.offset, self._position.before)
        if not goes_on and state["source"] != os.path.abspath(self._options.source):
            raise ValueError(f"it was written for another file, {state['source']}.")
        self._monitor.restore(state["monitor"].tobytes())
        self._records.restore(state["records"])
        if goes_on and self._evidence and state["evidence"]:
            self._evidence.restore(state["evidence"], self._options.source)

    def _save(self, pending: Sequence[Record] = ()) -> None:
        """Write the state, with records that are to be written next: a file that is never half."""
        if self._options.state is None:
            return
        state = asdict(self._position) | {
            "monitor": np.frombuffer(self._monitor.state(), np.uint8),
            "records": self._records.state(pending),
            "evidence": self._evidence and self._evidence.state(),
            "source": os.path.abspath(self._options.source),
            "head": b"".join(self._head),
        }
        for name in _BYTES:
            state[name] = state[name].decode("latin-1")  # any bytes as a text of JSON
        write_whole(self._options.state, packed(state))


def _decoded(lines: list[bytes]) -> list[str]:
    if any(b"\0" in line for line in lines):
        raise ValueError("it contains bytes 0: it is binary, or UTF-16. Write it in UTF-8.")
    try:
        texts = [line.decode("utf-8-sig") for line in lines]
    except UnicodeDecodeError:  # as in files
        texts = [line.decode("cp1252") for line in lines]
    return [text.rstrip("\r\n") for text in texts]
