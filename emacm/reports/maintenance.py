"""Maintenance reports of recordings: one page for each decision."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from hashlib import sha256
from itertools import takewhile
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import pandas as pd

from emacm._saved import write_whole
from emacm.machine.fault_orders import fault_series
from emacm.models.model_files import load_model
from emacm.models.scoring import check_model
from emacm.recordings.inputs import as_list
from emacm.recordings.meta import read_meta
from emacm.recordings.names import printable
from emacm.reports.facts import decisions_of, healthy_label, model_facts, when
from emacm.reports.pages import URGENCIES, Further, Page, Settings, Source, page_of
from emacm.reports.pictures import drawn
from emacm.reports.written_pages import (
    LIST_OF_PAGES,
    encoded_svg,
    listed_pages,
    templates,
    written_page,
)


def maintenance_report(
    model: Any,
    recordings: Any,
    path: str | os.PathLike[str],
    *,
    actions: Mapping[Any, str] | None = None,
    parts: Any = None,
    healthy: Any = None,
    background: Any = None,
    history: pd.DataFrame | None = None,
    unit: Any = None,
    time: Any = None,
) -> list[Path]:
    """Write a report for maintenance staff: one page for each decision, as HTML.

    A page states, in this order: what is wrong with the measurement, if anything is; the decision
    and its confidence; since when; the recommended action; which orders of which component are
    raised by how many dB, with a picture; what was checked and found normal; the recording, the
    model and the versions. A recording that cannot be decided on has a page with the reason.

    Parameters
    ----------
    model : estimator, or path of a model file
        Fitted classifier of recordings, as for `score`. Of a file of `save_model`, note and digest
        are stated.
    recordings : sequence of Recording
        Such as a `RecordingFolder`.
    path : str or Path
        A file that ends with .html, with all pages; or a folder, in which each recording has a
        file, and "index.html" lists them. The folder is made if needed. Printed from a browser,
        each recording starts a new sheet.
    actions : mapping of label to str, optional
        Recommended action for each decision.
    parts : part, or sequence of parts, optional
        `Bearing`, `Gear` and so on, or mappings of fault names to orders: the components whose
        orders are looked for. Default: those of a `FaultLines` step of the model.
    healthy : label, optional
        The healthy state. Default: that stated to `save_model`, or else "healthy" or "normal".
        Deviations are from its mean; without such a state, from that of the most probable other
        one.
    background : list of Recording, optional
        Healthy recordings, above which the rise of each line is measured. Default: the least rise
        is stated, from the healthy power of its bin. Needed where the features are projections
        (PCA, LDA).
    history : DataFrame, optional
        Earlier results, as from `score`, with the columns "decision" and "time", and "unit" if this
        is given.
    unit : key of meta, tuple of keys, callable or array-like, optional
        The unit of each recording. Default: with `history`, all are of the same unit.
    time : key of meta, callable or array-like, optional
        Time of each recording: dates, or numbers such as cycles. The recordings of a unit count as
        earlier results of each other. Needed with `history`.

    Returns
    -------
    list of Path
        The files that were written.

    Raises
    ------
    ImportError
        If matplotlib or jinja2 is not installed (extra ``report``).
    TypeError, ValueError
        If `model` is not a fitted classifier, an action is given for something that is not a
        decision, a part, the history or a time is invalid, or `path` is a file of another type.

    See Also
    --------
    emacm.score : A table of decisions.
    emacm.explain_decision : Numbers behind a page.

    Notes
    -----
    Where the model computes order spectra, a line is listed if it is 6 dB above its local
    background and rose by 3 dB and 4 standard deviations above the healthy recordings, with the
    nearest line of a component. If fewer than half of the first three lines of that component are
    above the background, it is a single line at this order. Other bins and features are listed as
    ranges from the same limits on.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from emacm import CostSensitiveGaussianBayes, OrderPSD, OrderResampler, Recording
    >>> from emacm import maintenance_report
    >>> from sklearn.pipeline import make_pipeline
    >>> rng = np.random.default_rng(0)
    >>> runs = [
    ...     Recording({"vibration": level * rng.normal(size=4000)}, 1000, velocity=100.0)
    ...     for level in (1.0, 1.1, 0.9, 3.0, 3.3, 2.7)
    ... ]
    >>> bayes = CostSensitiveGaussianBayes(covariance="diag", shrinkage=0.1)
    >>> model = make_pipeline(OrderResampler(2 * np.pi / 16), OrderPSD(0.25), bayes)
    >>> model = model.fit(runs, ["healthy"] * 3 + ["worn"] * 3)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = maintenance_report(model, runs[4:5], folder, actions={"worn": "Grease it."})
    ...     [file.name for file in files], "Grease it." in files[0].read_text(encoding="utf-8")
    (['recording_0.html', 'index.html'], True)
    """
    reports = Reports(read_settings(model, actions, parts, healthy, background), path)
    entries = as_list(recordings)
    units = None if unit is None else read_meta(entries, unit, role="unit", arrays=True)
    times = None if time is None else read_meta(entries, time, role="time", arrays=True)
    names = [printable(getattr(x, "path", f"recording {n}")) for n, x in enumerate(entries)]
    sources = [partial(entries.__getitem__, n) for n in range(len(entries))]
    pages = reports.pages(sources, names)
    add_since(pages, history, units, times, time if isinstance(time, str) else "")
    return reports.write(pages)


class Reports:
    """Pages in a file or in a folder.

    Parameters
    ----------
    settings : Settings
        What is the same for all pages.
    path : str or Path
        As for `maintenance_report`.
    """

    def __init__(self, settings: Settings, path: str | os.PathLike[str]) -> None:
        templates()  # a missing jinja2 is stated before hours of work
        self._settings = settings
        self.healthy = None if settings.healthy is None else str(settings.healthy)
        self._target = target = Path(path)
        self.is_file = target.suffix == ".html" and not target.is_dir()
        if target.suffix == ".pdf" or (target.is_file() and not self.is_file):
            raise ValueError(
                f"path must end with .html, or be a folder; got {str(path)!r}. For a PDF file, "
                f"print the HTML page from a browser."
            )
        if not self.is_file:
            target.mkdir(parents=True, exist_ok=True)

    def pages(
        self, sources: Sequence[Source], names: Sequence[str], facts: Further = None
    ) -> list[Page]:
        """Return the pages of recordings that functions open, as `page_of` does."""
        pairs = zip(sources, names, strict=True)
        return [page_of(self._settings, source, name, facts) for source, name in pairs]

    def missing(self, names: Sequence[str], digests: Sequence[str]) -> list[bool]:
        """Return for each recording whether a folder has no page of it, of this digest."""
        listed = listed_pages(self._target)
        known = {(entry["link"], entry["name"], entry["digest"]) for entry in listed}
        rows = zip(_links(names), names, digests, strict=True)
        return [row not in known or not (self._target / unquote(row[0])).is_file() for row in rows]

    def write(
        self, pages: Sequence[Page], before: Sequence[str] = (), *, has_fleet: bool = False
    ) -> list[Path]:
        """Write pages, and return the files; in a folder, the index is the last one.

        Parameters
        ----------
        pages : sequence of Page
            What is written.
        before : sequence of str
            Names of other recordings; those that have a page stay in the index, as they were.
        has_fleet : bool
            Whether the index links the page of the fleet.
        """
        if self.is_file:
            return [written_page(self._target, "maintenance", pages=map(_with_picture, pages))]
        links = _links([*before, *(page.name for page in pages)])
        entries = [e for e in listed_pages(self._target) if e["link"] in links[: len(before)]]
        links = links[len(before) :]
        shown = ("name", "unit", "date", "decision", "doubtful", "since", "action", "digest")
        for page, link in zip(pages, links, strict=True):
            entry = {"link": link, "word": page.urgency}
            entries.append(entry | {name: getattr(page, name) for name in shown})
        entries.sort(key=lambda entry: URGENCIES.index(entry["word"]))
        files = [
            written_page(self._target / unquote(link), "maintenance", pages=[_with_picture(page)])
            for page, link in zip(pages, links, strict=True)
        ]
        # The list is last: pages that are missing, as after a kill, are written by the next run.
        write_whole(self._target / LIST_OF_PAGES, json.dumps(entries, indent=1).encode())
        index = self._target / "index.html"
        return [*files, written_page(index, "index", entries=entries, has_fleet=has_fleet)]


def _links(names: Sequence[str]) -> list[str]:
    """Return the link of the page of each recording, in an index."""
    return [f"./{quote(stem)}.html" for stem in file_stems(names)]


def _with_picture(page: Page) -> tuple[Page, str, str]:
    """Return a page, its picture as SVG in base64, and what it shows; empty if there is none."""
    figure, description = drawn(page)
    return page, "" if figure is None else encoded_svg(figure), description


def read_settings(
    model: Any, actions: Any = None, parts: Any = None, healthy: Any = None, background: Any = None
) -> Settings:
    """Check and return what is the same for all pages, see `maintenance_report`."""
    file = None
    if isinstance(model, str | os.PathLike):
        file, model = Path(model), load_model(model)
    classes = check_model(model)
    stated = getattr(model, "healthy_", None) if healthy is None else healthy
    healthy = healthy_label(classes, stated, "healthy", required=False)
    if parts is not None:
        fault_series(parts, 1)  # raises if one is invalid
    facts = model_facts(model, file)
    return Settings(model, facts, _actions(actions, model), parts, healthy, background)


def _actions(actions: Any, model: Any) -> dict[str, str] | None:
    if actions is None:
        return None
    if not isinstance(actions, Mapping):
        raise TypeError(f"actions must map decisions to texts, got {type(actions).__name__}.")
    decisions = [str(label) for label in decisions_of(model)]
    for label, text in actions.items():
        if str(label) not in decisions or not isinstance(text, str):
            raise ValueError(
                f"the action for {label!r}, {text!r}, must be a text for one of {decisions}."
            )
    return {str(label): text for label, text in actions.items()}


def add_since(
    pages: Sequence[Page],
    history: Any,
    units: list[Any] | None,
    times: list[Any] | None,
    counter: str = "",
) -> None:
    """Write into each page since when its decision has been made.

    Parameters
    ----------
    pages : sequence of Page
        The pages.
    history : DataFrame, optional
        Earlier results, as `score` returns them, with "time" added, and "unit" if it is known.
    units, times : list, optional
        Of the pages.
    counter : str
        Name of times that are numbers, such as "cycle".

    Raises
    ------
    ValueError
        If the history is not a table, a column is missing, or a time is invalid.
    """
    for page, unit in zip(pages, units or [], strict=False):
        page.unit = str(unit)
    for page, time in zip(pages, times or [], strict=False):
        page.date = page.date or when(time, counter)
    if history is None and (units is None or times is None):
        return
    if times is None:
        raise ValueError("history needs the time of each recording; give time, as time='cycle'.")
    columns = ["decision", "time", *["unit"] * (units is not None)]
    history = pd.DataFrame(columns=columns) if history is None else history
    missing = [name for name in columns if name not in getattr(history, "columns", ())]
    if missing:
        raise ValueError(
            f"history must be a table of earlier results, as from score, with the columns "
            f"{columns}; it has no {missing[0]!r}."
        )
    earlier = history[columns].reindex(columns=["unit", "decision", "time"], fill_value="")
    made = ["" if page.kind == "undecided" else page.decision for page in pages]
    new = pd.DataFrame({"unit": units or "", "decision": made, "time": times}, dtype=object)
    results = pd.concat([earlier.astype(object), new], ignore_index=True).fillna({"decision": ""})
    results["time"] = _as_times(results["time"].tolist())
    results = results.astype({"decision": str, "unit": str})
    for page, own in zip(pages, results[len(earlier) :].itertuples(), strict=True):
        before = (results["unit"] == own.unit) & (results["time"] < own.time)
        before = results[before & (results["decision"] != "")].sort_values("time", kind="stable")
        if own.decision:
            page.since = _since(own.decision, before, counter)


def _as_times(values: list[Any]) -> list[Any]:
    """Return texts and dates as pandas Timestamps without a time zone; numbers are unchanged."""
    numbers = [value for value in values if isinstance(value, int | float)]
    if len(numbers) == len(values):
        return values
    with suppress(ValueError, TypeError):
        if not numbers:
            return [pd.Timestamp(value).tz_localize(None) for value in values]
    raise ValueError(
        f"times of recordings and history must all be numbers, or all be dates such as "
        f"'2024-05-01 22:10'; got {values[0]!r} and others."
    )


def _since(decision: str, earlier: pd.DataFrame, counter: str) -> str:
    """Say since when a decision has been made without interruption."""
    if earlier.empty:
        return "No earlier result of this unit is known."
    times = [when(time, counter) for time in earlier["time"]]
    rows = list(zip(earlier["decision"], times, strict=True))
    same = list(takewhile(lambda row: row[0] == decision, reversed(rows)))
    before = ""
    if len(same) < len(rows):
        other, time = rows[-1 - len(same)]
        before = f"{other!r} ({time})."
    if not same:
        return f"New: the recording before, of this unit, was {before}"
    rest = f"; before that, {before}" if before else ": in all that are known of this unit."
    return f"Since {same[-1][1]}, in {len(same) + 1} recordings in a row{rest}"


def file_stems(names: Sequence[str]) -> list[str]:
    """Return names of files without suffix; where files have the same name, with their folder.

    Only letters, digits and ``_.-`` are kept. Those that are then equal, or "index", have a digest
    of the whole name, so that the order of the recordings does not matter.

    Examples
    --------
    >>> file_stems(["a/run.npz", "b/run.npz", "b/new.npz", "recording 3"])
    ['a_run', 'b_run', 'new', 'recording_3']
    >>> file_stems(["run 1.csv", "run_1.csv", "index.csv"])
    ['run_1_edb3a055', 'run_1_1b69dfb6', 'index_d9f9d495']
    >>> len({*file_stems(["run.csv", "run.csv"])})  # two excerpts of a file
    2
    """
    paths = [Path(name) for name in names]
    n_folders = Counter(stem for stem, _ in {(path.stem, path.parent) for path in paths})
    stems = [f"{p.parent.name}_{p.stem}" if n_folders[p.stem] > 1 else p.stem for p in paths]
    stems = [re.sub(r"[^\w.-]", "_", stem)[-75:] for stem in stems]  # a name has 255 bytes
    counts = Counter(stem.casefold() for stem in [*stems, "index"])
    same: Counter[str] = Counter()
    for k, name in enumerate(names):
        same[name] += 1
        if counts[stems[k].casefold()] > 1:
            stems[k] += "_" + sha256(f"{name}{same[name]}".encode()).hexdigest()[:8]
    return stems
