"""The command ``emacm verify``: known answers computed on this computer."""

from __future__ import annotations

import argparse

from emacm._saved import written_whole
from emacm.verification.record import verify


def run(options: argparse.Namespace) -> int:
    """Compute the answers, and print or write the table.

    Returns
    -------
    int
        0 if all are within their tolerance, else 1.
    """
    found = verify()
    if options.out is None:
        print(found.to_json() if options.json else found)
    else:
        forms = {".json": found.to_json, ".html": found.to_html, ".txt": found.__str__}
        with written_whole(options.out) as unfinished:
            unfinished.write_text(forms[options.out.suffix](), encoding="utf-8")
        print(f"{found.summary}: {options.out}")
    return 0 if found.passed else 1
