"""The command ``emacm inspect``: what files contain, a plot, and a draft of their layout."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from emacm._checks import located
from emacm._saved import write_whole
from emacm.commands.result_tables import print_json, save_picture
from emacm.files.drafts import FileContents, contents_of, contents_table, draft_layout, files_table
from emacm.files.folder import recording_files
from emacm.recordings.names import printable


def run(options: argparse.Namespace) -> int:
    """Print what a file contains; write a draft of its layout and draw it if asked to.

    Of a folder, print a row for each file, and what the first that can be read contains.

    Returns
    -------
    int
        0; 3 if a file of a folder cannot be read.
    """
    path, failed, files = options.file, False, []
    if path.is_dir():
        paths = recording_files([path], None, options.pattern)
        table = files_table(paths)
        is_read = table["duration [s]"] != ""
        path, failed, files = paths[is_read.argmax()], not is_read.all(), table.to_dict("records")
        if not options.json:
            print(f"{table.to_string(index=False)}\n\n{printable(path)}:")
    with located(printable(path)):
        contents = contents_of(path)
    if options.json:
        numbers = contents.columns.numbers
        others = {"file": printable(path), "numbers": numbers, "to_be_stated": contents.open}
        columns = contents_table(contents).rename_axis("column").reset_index()
        print_json(columns, files=files, not_used=contents.unused, **others)
    else:
        _show(contents)
    to = sys.stderr if options.json else sys.stdout
    if options.draft is not None:
        if options.draft.exists():
            raise ValueError(f"{str(options.draft)!r} exists. Choose another name for --draft.")
        write_whole(options.draft, draft_layout(contents, path, options.meta).encode())
        print(f"Draft of the layout: {printable(options.draft)}", file=to)
    if options.plot is not None:
        _plot(contents, options.plot)
        print(f"Plot: {printable(options.plot)}", file=to)
    return 3 if failed else 0


def _show(contents: FileContents) -> None:
    print(contents_table(contents).to_string())
    for name, number in contents.columns.numbers.items():
        print(f"{name} = {number:.9g} {contents.columns.units.get(name, '')}".rstrip())
    for name, reason in contents.unused.items():
        print(f"Not used: {name!r}, {reason}")
    for remark in contents.open:
        print(f"To be stated in the layout: {remark}")


def _plot(contents: FileContents, path: Path) -> None:
    """Draw the first 12 columns over time, or over the number of the sample, into a picture."""
    from emacm.displays import drawing

    columns = [column for column in contents.numbers.items() if column[0] != contents.times][:12]
    axes = drawing.panel_axes(None, len(columns), height=1.3)
    timed = all(name in contents.rates for name, _ in columns)
    for panel, (name, values) in zip(axes, columns, strict=True):
        rate = contents.rates[name] if timed else 1.0
        panel.plot(np.arange(len(values)) / rate, values, color=drawing.PLAIN, linewidth=0.8)
        drawing.label_y(panel, name, contents.columns.units.get(name, "unit"))
    drawing.label_x(axes, "time [s]" if timed else "sample")
    save_picture(axes[0].figure, path)
