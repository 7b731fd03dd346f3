"""The command ``emacm example``: files with which the examples of README run."""

from __future__ import annotations

import argparse

from emacm.recordings.names import printable
from emacm.simulation.example_files import write_example


def run(options: argparse.Namespace) -> int:
    """Write the files, and list them.

    Returns
    -------
    int
        0.
    """
    for path in write_example(options.folder):
        print(printable(path))
    return 0
