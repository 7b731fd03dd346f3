"""The command ``emacm schema``: the JSON Schema of records."""

from __future__ import annotations

import argparse
import json

from emacm.history.records import SCHEMA


def run(options: argparse.Namespace) -> int:
    """Print the JSON Schema of the records of ``score`` and ``monitor``.

    Returns
    -------
    int
        0.
    """
    print(json.dumps(SCHEMA, indent=2))
    return 0
