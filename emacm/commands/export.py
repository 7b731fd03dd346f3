"""The command ``emacm export``: a model as C99 sources."""

from __future__ import annotations

import argparse

from emacm.export.c_files import export_c
from emacm.models.model_files import load_model
from emacm.recordings.names import printable


def run(options: argparse.Namespace) -> None:
    """Write the sources, and print where they are and what they need."""
    exported = export_c(
        load_model(options.model),
        options.c,
        fs=options.fs,
        channels=None if options.channels is None else options.channels.split(","),
        max_speed=options.max_speed,
        every=options.every,
        precision=options.precision,
    )
    for file in exported.files:
        print(printable(file))
    print(
        f"RAM {exported.ram} bytes, tables {exported.constants} bytes; for each sample "
        f"{exported.operations} multiplications and additions on average, {exported.longest} where "
        f"a segment is complete"
    )
