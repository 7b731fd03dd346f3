"""The command ``emacm monitor``: a model applied to rows of numbers while they are measured."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from emacm._checks import located
from emacm.files.csv_files import text_table
from emacm.files.file_columns import FileColumns, recording_arguments
from emacm.files.layout import Layout
from emacm.models.model_files import load_model
from emacm.streams.order_monitor import OrderMonitor
from emacm.streams.packed_state import packed, unpacked
from emacm.streams.streamed_models import Reading

FAILED = 3  # exit status: rows were skipped
_DECIDED = ("decision", "expected_cost", "typicality", "posterior")
_PRINTED = ("start", "time", *_DECIDED, "alarms", "outside_training")


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
    if options.source == "-":
        return _Stream(model, layout, options, sys.stdin.buffer).follow()
    with open(options.source, "rb") as file:
        return _Stream(model, layout, options, file).follow()


def _growing_lines(file: BinaryIO, idle: float, poll: float = 0.1) -> Iterator[bytes]:
    """Yield the lines of a file that may grow, each as it is complete.

    The last line may be incomplete, where the file has not grown for `idle` seconds.
    """
    part, since = b"", time.monotonic()
    while True:
        text = file.readline()
        part += text
        if text:
            since = time.monotonic()
        elif time.monotonic() - since >= idle:
            break
        else:
            time.sleep(min(poll, idle))
        if part.endswith(b"\n"):
            yield part
            part = b""
    if part:
        yield part


class _Stream:
    """The rows of a stream, and the monitor that they are given to.

    Rows of `block` seconds are processed together; header and separator are found in the first
    `n_head` lines.
    """

    def __init__(
        self,
        model: Any,
        layout: Layout,
        options: argparse.Namespace,
        file: BinaryIO,
        *,
        n_head: int = 20,
        block: float = 0.1,
    ) -> None:
        self._layout, self._options, self._n_failed = layout, options, 0
        self._last = b""  # row before, so that gaps between blocks are noticed
        self._resumed: float | None = None  # time at which the stream goes on after an error [s]
        is_file = options.source != "-"
        self._lines = _growing_lines(file, options.idle if is_file else 0.0)
        head = list(islice(self._lines, n_head))
        with located(options.source if is_file else "the standard input"):
            self._table = text_table([line.decode().rstrip("\r\n") for line in head])
            self._rows = head[self._table.start :]
            arguments = self._arguments(self._rows)
            self._rates = arguments["fs"]
            self._monitor = OrderMonitor(
                model,
                fs=self._rates,
                shaft_fs=arguments["shaft_fs"],
                channels=list(self._rates),
                max_speed=options.max_speed,
                every=options.every,
                unit=options.unit,
                wrapped=options.wrapped,
            )
        self._at_once = max(2, round(block * max(self._rates.values())))
        self._head = b"".join(head)
        self._offset = sum(map(len, head[: self._table.start]))
        if options.state is not None and options.state.exists():
            with located(f"--state {options.state}"):
                self._restore(options.state.read_bytes(), file)

    def follow(self) -> int:
        """Process all lines, and return the exit status."""
        rows = self._rows
        for row in self._lines:
            rows.append(row)
            if len(rows) >= self._at_once:
                self._process(rows)
                rows = []
        self._process(rows)
        self._save()
        self._print(self._monitor.flush())
        return FAILED if self._n_failed else 0

    def _arguments(self, rows: Iterable[bytes]) -> dict[str, Any]:
        text = b"".join(rows).decode()
        content = FileColumns()
        self._table.add_columns(content, StringIO(text))
        return recording_arguments(content.without_units_in_names(), self._layout)

    def _process(self, rows: list[bytes]) -> None:
        """Print the readings that are complete with these rows, or why the rows are skipped."""
        n_before = 1 if self._last else 0
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
            readings = self._monitor.push(signals, **options)
            self._print(readings)
            self._last, self._resumed = rows[-1], None
            if readings:
                self._save()
        except (TypeError, ValueError) as error:
            self._fail(str(error), len(rows) / max(self._rates.values()))
            self._save()

    def _fail(self, error: str, duration: float) -> None:
        """State why rows are skipped; the reading up to them ends, and another one begins."""
        self._n_failed += 1
        self._last = b""
        time_of_error = self._monitor.time if self._resumed is None else self._resumed
        self._resumed = time_of_error + duration
        try:
            self._print(self._monitor.flush())
        except ValueError:
            self._monitor.reset()
        skipped = f"The samples from {time_of_error:.9g} s to {self._resumed:.9g} s are skipped."
        _write({"time": time_of_error, "error": f"{' '.join(error.split())} {skipped}"})

    def _print(self, readings: list[Reading]) -> None:
        for reading in readings:
            line = {name: getattr(reading, name) for name in _PRINTED}
            _write(line | {"posterior": {str(k): p for k, p in reading.posterior.items()}})

    def _restore(self, content: bytes, file: BinaryIO) -> None:
        """Restore a state, and go on in the file where it was written."""
        remedy = "Remove it or give another one to read the file from its beginning."
        try:
            state = unpacked(content)
            if "head" not in state:
                raise ValueError("it is no state of this command.")
            self._offset, source = state["offset"], self._options.source
            is_same = self._head.startswith(state["head"].tobytes())
            if not is_same or self._offset > os.path.getsize(source):
                raise ValueError(f"it was written for another file than {source}, or a longer one.")
            self._monitor.restore(state["monitor"].tobytes())
        except ValueError as error:
            raise ValueError(f"{error} {remedy}") from error
        self._last = state["last"].tobytes()
        self._resumed = state["resumed"]
        self._rows = []
        file.seek(self._offset)

    def _save(self) -> None:
        """Write the state, so that the file is complete at any time.

        It is written after readings: if the process is killed at any point, none is lost, and only
        readings of the last block may be printed twice.
        """
        file: Path | None = self._options.state
        if file is None:
            return
        parts = {"monitor": self._monitor.state(), "last": self._last, "head": self._head}
        state = {name: np.frombuffer(text, np.uint8) for name, text in parts.items()}
        part = file.with_name(f"{file.name}.part")
        part.write_bytes(packed(state | {"offset": self._offset, "resumed": self._resumed}))
        os.replace(part, file)


def _write(line: dict[str, Any]) -> None:
    print(json.dumps(line, default=str), flush=True)
