"""The command ``emacm inspect``: what files contain, and a draft of their layout."""

from __future__ import annotations

import argparse
import sys

from emacm._checks import located
from emacm._saved import write_whole
from emacm.commands.result_tables import print_json
from emacm.files.drafts import FileContents, contents_of, contents_table, draft_layout, files_table
from emacm.files.folder import recording_files
from emacm.recordings.names import printable


def run(options: argparse.Namespace) -> int:
    """Print what a file contains, and write a draft of its layout if asked to.

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
    if options.draft is not None:
        if options.draft.exists():
            raise ValueError(f"{str(options.draft)!r} exists. Choose another name for --draft.")
        write_whole(options.draft, draft_layout(contents, path, options.meta).encode())
        to = sys.stderr if options.json else sys.stdout
        print(f"Draft of the layout: {printable(options.draft)}", file=to)
    return 3 if failed else 0


def _show(contents: FileContents) -> None:
    print(contents_table(contents).to_string())
    for name, number in contents.columns.numbers.items():
        print(f"{name} = {number:.9g} {contents.columns.units.get(name, '')}".rstrip())
    for name, reason in contents.unused.items():
        print(f"Not used: {name!r}, {reason}")
    for remark in contents.open:
        print(f"To be stated in the layout: {remark}")
