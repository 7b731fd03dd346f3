"""The signals of the readings before an alarm, kept as files that can be decided on again."""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from emacm._saved import written_whole
from emacm.files.folder import open_recording
from emacm.files.layout import Layout
from emacm.history.records import record_of
from emacm.models.scoring import scored_rows


class Evidence:
    """The rows of the last readings of a stream, which are stored when an alarm is raised.

    For each reading, a CSV file has the rows as they were measured, below the header, and a JSON
    file of the same name the record, as ``emacm score`` makes it of this CSV file: another run with
    the same model and layout finds the same values. After a restart, only readings that began after
    it are stored.

    Parameters
    ----------
    folder : Path
        For the files.
    n_readings : int
        How many are stored for each alarm; the one that raised it is the last one.
    fs : float
        Rows per second [Hz].
    model : estimator
        The model.
    layout : Layout
        That of the user.
    """

    def __init__(
        self, folder: Path, n_readings: int, fs: float, model: Any, layout: Layout
    ) -> None:
        self._folder, self._fs, self._model, self._layout = folder, fs, model, layout
        self._blocks: deque[tuple[float, list[bytes]]] = deque()  # time of the first row [s]
        self._records: deque[Mapping[str, Any]] = deque(maxlen=n_readings)

    def add(self, start: float, rows: list[bytes]) -> None:
        """Add rows, the first of which was measured at a time of the stream [s]."""
        self._blocks.append((start, rows))

    def store(self, records: Sequence[Mapping[str, Any]], header: list[bytes]) -> None:
        """Store the last readings of each of these records that raises an alarm."""
        for record in records:
            if record["complete"]:
                self._records.append(record)
            for change in record["alarms"]:
                if change["state"] == "raised":
                    time = re.sub(r"[-:]|\.\d+", "", change["time"])
                    for number, reading in enumerate(self._records, 1):
                        self._store(reading, f"{time}_{change['id']}_{number}", header)
        if len(self._records) == self._records.maxlen:
            while self._blocks[0][0] + len(self._blocks[0][1]) / self._fs < self._first_needed():
                self._blocks.popleft()

    def _first_needed(self) -> float:
        return float(self._records[min(1, len(self._records) - 1)]["stream_start"])

    def _store(self, record: Mapping[str, Any], name: str, header: list[bytes]) -> None:
        first, after = (record[key] * self._fs - 0.5 for key in ("stream_start", "stream_end"))
        rows = [
            row
            for start, block in self._blocks
            for number, row in enumerate(block, round(start * self._fs))
            if first <= number < after
        ]
        if len(rows) < after - first - 1:  # it began before a restart
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{name}.csv"
        with written_whole(path) as unfinished:
            unfinished.write_bytes(b"".join([*header, *rows]))
        source = partial(open_recording, path, self._layout)
        (found,) = scored_rows(self._model, [source], [record["recording"]])
        with written_whole(path.with_suffix(".json")) as unfinished:
            unfinished.write_text(json.dumps(record_of({**record, **found}), indent=1))
