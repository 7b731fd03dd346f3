"""The command ``emacm describe``: the model card of a model file."""

from __future__ import annotations

import argparse

from emacm.reports.model_cards import describe_model
from emacm.reports.written_pages import written_record


def run(options: argparse.Namespace) -> int:
    """Print or write the card.

    Returns
    -------
    int
        0.
    """
    card = describe_model(options.model)
    print(written_record(card, options.out, as_json=options.json) or f"Model card: {options.out}")
    return 0
