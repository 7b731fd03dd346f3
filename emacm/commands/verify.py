"""The command ``emacm verify``: known answers, or the evaluation of a model, computed again."""

from __future__ import annotations

import argparse

from emacm.files.folder import RecordingFolder
from emacm.files.layout import Layout
from emacm.models.model_files import model_description
from emacm.reports.written_pages import written_record
from emacm.verification.record import verify, verify_model


def run(options: argparse.Namespace) -> int:
    """Compute, compare, and print or write the table.

    Returns
    -------
    int
        0 if all values are within their tolerance, else 1.
    """
    if options.model is None:
        found = verify()
    else:
        evidence = model_description(options.model).get("evidence") or {}
        pattern = evidence.get("pattern") or "**/*"
        layout = Layout.from_toml(options.layout)
        found = verify_model(options.model, RecordingFolder(options.data, layout, pattern))
    text = written_record(found, options.out, as_json=options.json)
    print(text or f"{found.summary}: {options.out}")
    return 0 if found.passed else 1
