"""The command ``emacm monitor``: a model applied to rows of numbers while they are measured."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from emacm._checks import located
from emacm.files.csv_files import TextTable, text_table
from emacm.files.file_columns import FileColumns, recording_arguments
from emacm.files.layout import Layout
from emacm.models.model_files import load_model
from emacm.streams.order_monitor import OrderMonitor
from emacm.streams.stream_settings import packed, unpacked
from emacm.streams.streamed_models import Reading

FAILED = 3  # exit status: rows were skipped
_HEAD = 20  # lines from which header and separator are known
_BLOCK = 0.1  # s of samples that are processed together
_POLL = 0.1  # s between two looks at a file that does not grow
_REPLACED = (
    "was cut, removed or replaced by another file. Start the command again, with another file for "
    "--state, to follow the new one."
)
_SAVE = 1.0  # s between two writings of the state, unless a reading was printed


def run(options: argparse.Namespace) -> int:
    """Print readings of a stream as JSON lines, and return the exit status.

    Returns
    -------
    int
        0; 3 if rows were invalid and skipped.
    """
    layout, model = Layout.from_toml(options.layout), load_model(options.model)
    if layout.tacho is not None:
        raise ValueError("a layout with tacho needs whole recordings; give velocity or angle.")
    if options.source == "-" and options.state is not None:
        raise ValueError("--state needs a file, as the standard input cannot be read again.")
    lines = _Lines(options.source, options.idle)
    return _Stream(model, layout, options).follow(lines)


class _Lines:
    """Lines of the standard input, or of a file that may grow, each as it is complete."""

    def __init__(self, source: str, idle: float) -> None:
        self._source, self._idle = source, idle
        self.skip_to: int | None = None  # byte at which to go on
        self.replaced = False  # whether the file was cut or another one took its place

    def __iter__(self) -> Iterator[bytes]:
        if self._source == "-":
            yield from sys.stdin.buffer
            return
        with open(self._source, "rb") as file:
            part, since, same = b"", time.monotonic(), os.fstat(file.fileno()).st_ino
            while True:
                text = file.readline()
                part += text
                if text:
                    since = time.monotonic()
                if part.endswith(b"\n"):
                    yield part
                    part = b""
                    if self.skip_to is not None:
                        file.seek(self.skip_to)
                        self.skip_to = None
                    continue
                if not text and self._replaced(file.tell(), same):
                    self.replaced = True
                    break
                if not text and time.monotonic() - since >= self._idle:
                    break
                if not text:
                    time.sleep(min(_POLL, self._idle))
            if part and not self.replaced:
                yield part

    def _replaced(self, place: int, inode: int) -> bool:
        try:
            status = os.stat(self._source)
        except FileNotFoundError:
            return True
        return status.st_ino != inode or status.st_size < place


class _Stream:
    """The rows of a stream, and the monitor that they are given to."""

    def __init__(self, model: Any, layout: Layout, options: argparse.Namespace) -> None:
        self._model, self._layout, self._options = model, layout, options
        self._last = b""  # row before, so that gaps between blocks are noticed
        self._resumed: float | None = None  # time at which the stream goes on after an error [s]
        self._n_failed = 0
        self._n_printed = 0
        self._saved = -np.inf  # when the state was written last [s]

    def follow(self, lines: _Lines) -> int:
        """Process all lines, and return the exit status."""
        source = iter(lines)
        head = [line for _, line in zip(range(_HEAD), source, strict=False)]
        name = "the standard input" if self._options.source == "-" else self._options.source
        with located(name):
            rows = self._begin(head)
        self._head = b"".join(head)
        place = self._restored()
        if place is not None:
            rows, self._offset = [], place
            lines.skip_to = place
        for row in source:
            rows.append(row)
            if len(rows) >= self._at_once:
                self._process(rows)
                rows = []
        if rows:
            self._process(rows)
        self._save(at_once=True)
        time_of_end = self._monitor.time
        self._print(self._monitor.flush())
        if lines.replaced:
            self._n_failed += 1
            _write({"time": time_of_end, "error": f"{self._options.source} {_REPLACED}"})
        return FAILED if self._n_failed else 0

    def _begin(self, head: list[bytes]) -> list[bytes]:
        """Find the header, make the monitor, and return the rows below the header."""
        self._table: TextTable = text_table([line.decode().rstrip("\r\n") for line in head])
        rows = head[self._table.start :]
        arguments = self._arguments(rows)
        self._rates = arguments["fs"]
        self._monitor = OrderMonitor(
            self._model,
            fs=self._rates,
            shaft_fs=arguments["shaft_fs"],
            channels=list(self._rates),
            max_speed=self._options.max_speed,
            every=self._options.every,
            unit=self._options.unit,
            wrapped=self._options.wrapped,
        )
        self._at_once = max(2, round(_BLOCK * max(self._rates.values())))
        self._offset = sum(map(len, head[: self._table.start]))
        return rows

    def _arguments(self, rows: Iterable[bytes]) -> dict[str, Any]:
        text = b"".join(rows).decode()
        content = FileColumns()
        self._table.add_columns(content, StringIO(text))
        return recording_arguments(content.without_units_in_names(), self._layout)

    def _process(self, rows: list[bytes]) -> None:
        """Print the readings that are complete with these rows, or why the rows are skipped."""
        n_before, n_printed = 1 if self._last else 0, self._n_printed
        self._offset += sum(map(len, rows))
        rows = [row for row in rows if row.strip()]
        if not rows:
            return
        try:
            arguments = self._arguments([self._last, *rows])
            if not np.allclose(list(arguments["fs"].values()), list(self._rates.values()), 1e-6):
                raise ValueError(f"the sampling rate changes to {arguments['fs']}.")
            signals = {name: s[n_before:] for name, s in arguments["signals"].items()}
            kind = "angle" if "angle" in arguments else "velocity"
            shaft = np.broadcast_to(arguments[kind], len(rows) + n_before)[n_before:]
            options: dict[str, Any] = {kind: shaft, "time": self._resumed}
            self._print(self._monitor.push(signals, **options))
            self._last, self._resumed = rows[-1], None
        except (TypeError, ValueError) as error:
            self._fail(str(error), len(rows) / max(self._rates.values()))
        self._save(at_once=self._n_printed > n_printed)

    def _fail(self, error: str, duration: float) -> None:
        """State why rows are skipped; the reading up to them ends, and another one begins."""
        self._n_failed += 1
        self._n_printed += 1
        self._last, time_of_error = b"", self._resumed
        if time_of_error is None:
            time_of_error = self._monitor.time
        self._resumed = time_of_error + duration
        try:
            self._print(self._monitor.flush())
        except ValueError:
            self._monitor.reset()
        skipped = f"The samples from {time_of_error:.9g} s to {self._resumed:.9g} s are skipped."
        _write({"time": time_of_error, "error": f"{' '.join(error.split())} {skipped}"})

    def _print(self, readings: list[Reading]) -> None:
        for reading in readings:
            self._n_printed += 1
            _write(
                {
                    "start": reading.start,
                    "time": reading.time,
                    "decision": reading.decision,
                    "expected_cost": reading.expected_cost,
                    "typicality": reading.typicality,
                    "posterior": {str(k): p for k, p in reading.posterior.items()},
                    "alarms": list(reading.alarms),
                    "outside_training": list(reading.outside_training),
                }
            )

    def _restored(self) -> int | None:
        """Restore the state, if there is one, and return the place of the next row."""
        file: Path | None = self._options.state
        if file is None or not file.exists():
            return None
        try:
            state = unpacked(file.read_bytes())
            if "head" not in state:
                raise ValueError("it is no state of this command.")
            if state["head"].tobytes() != self._head[: len(state["head"])]:
                raise ValueError(f"it was written for another file than {self._options.source}.")
            if int(state["offset"]) > os.path.getsize(self._options.source):
                raise ValueError(f"{self._options.source} is shorter than it was.")
            self._monitor.restore(state["monitor"].tobytes())
            self._last = state["last"].tobytes()
            self._resumed = float(state["resumed"]) if "resumed" in state else None
            return int(state["offset"])
        except ValueError as error:
            raise ValueError(
                f"--state {file}: {error} Remove it or give another one to read the file from its "
                f"beginning."
            ) from error

    def _save(self, *, at_once: bool) -> None:
        """Write the state, so that the file is complete at any time.

        After readings it is written at once: if the process is killed at any point, none is lost,
        and only readings of the last block may be printed twice.
        """
        file: Path | None = self._options.state
        if file is None or not (at_once or time.monotonic() - self._saved >= _SAVE):
            return
        self._saved = time.monotonic()
        parts = {"monitor": self._monitor.state(), "last": self._last, "head": self._head}
        state = {name: np.frombuffer(text, np.uint8) for name, text in parts.items()}
        part = file.with_name(f"{file.name}.part")
        part.write_bytes(packed(state | {"offset": self._offset, "resumed": self._resumed}))
        os.replace(part, file)


def _write(line: dict[str, Any]) -> None:
    print(json.dumps(line, default=str), flush=True)
