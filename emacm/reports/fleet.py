"""The page of a fleet: one row for each unit, the most urgent first, and a page for each unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

from emacm.history.records import identity
from emacm.reports.written_pages import listed_pages, written_page

Record = Mapping[str, Any]


def write_fleet(
    folder: Path,
    records: Iterable[Record],
    alarms: Sequence[Record] = (),
    *,
    healthy: str | None = None,
    only: str | None = None,
) -> Path:
    """Write ``fleet.html``, and a page of each unit, from its last readings.

    Parameters
    ----------
    folder : Path
        Where reports are; a recording that has a page there is linked.
    records : iterable of mapping
        As from `record_of`.
    alarms : sequence of mapping
        Open alarms.
    healthy : str, optional
        Decision that is drawn as healthy. Default: healthy or normal.
    only : str, optional
        The unit whose page is written again, beside those without a page. Default: all.

    Returns
    -------
    Path
        The page of the fleet.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = ("healthy", "normal") if healthy is None else (healthy,)
    by_time = sorted(records, key=lambda record: (record["unit"], record["end"] or ""))
    links = {page["name"]: page["link"] for page in listed_pages(folder)}
    units = []
    for unit, own in groupby(by_time, itemgetter("unit")):
        readings = [{**record, "word": _word(record, names)} for record in [*own][-30:]]
        opened = [alarm for alarm in alarms if alarm["unit"] == unit]
        about = {"name": unit or "unit not stated", "last": readings[-1], "alarms": opened}
        about |= {"link": _file_of(unit), "bars": _bars(readings, names), "count": len(readings)}
        units.append(about)
        if only is None or only == unit or not (folder / _file_of(unit)).is_file():
            content = {"unit": about, "records": readings[::-1], "links": links}
            written_page(folder / _file_of(unit), "unit", **content)
    units.sort(key=_urgency)
    return written_page(folder / "fleet.html", "fleet", units=units, has_index=bool(links))


def _file_of(unit: str) -> str:
    """Return the name of the page of a unit, which is the same whatever other units there are."""
    return f"unit_{re.sub(r'[^a-zA-Z0-9.-]', '_', unit)[-60:]}_{identity([unit])[:8]}.html"


def _word(record: Record, healthy: Sequence[str]) -> str:
    if record["decision"] is None:
        return "undecided"
    if record["decision"] in healthy:
        return "healthy"
    if record["decision"] == "unknown":
        return "unknown"
    return "fault" if f"P({record['decision']})" in record else "uncertain"  # such as "inspect"


def _bars(readings: Iterable[Record], healthy: Sequence[str]) -> dict[str, str]:
    """Return for each word the path of its bars, as high as a fault is probable."""
    paths: dict[str, str] = {}
    for number, reading in enumerate(readings):
        word = reading["word"]
        known = [reading[f"P({name})"] for name in healthy if reading.get(f"P({name})") is not None]
        known_state = 1.0 - (reading.get("P(unknown)") or 0.0)
        fault = 1.0 - known[0] * known_state if known else float(word != "healthy")
        paths[word] = paths.get(word, "") + f"M{4 * number + 2} 24v-{2 + 22 * fault:.0f}"
    return paths


def _urgency(unit: Mapping[str, Any]) -> tuple[int, int, float]:
    """Return what units are sorted by: alarms that nobody takes care of are first."""
    grades = {("raised", "alarm"): 0, ("raised", "warning"): 1}
    grade = min((grades.get((a["state"], a["severity"]), 2) for a in unit["alarms"]), default=3)
    last = unit["last"]
    words = ("fault", "unknown", "uncertain", "undecided", "healthy")
    return grade, words.index(last["word"]), -(last["expected_cost"] or 0.0)
