"""Pages of plain tables, for which no template is needed."""

from __future__ import annotations

import html


def plain_page(title: str, body: str) -> str:
    """Return a page in HTML that needs nothing else.

    Parameters
    ----------
    title : str
        Plain text.
    body : str
        Its content, in HTML.

    Returns
    -------
    str
        The page, readable on a narrow screen and in print.

    Examples
    --------
    >>> "<h1>Bearing &amp; gear</h1>" in plain_page("Bearing & gear", "<p>healthy</p>")
    True
    """
    title = html.escape(title)
    style = (
        "body{font:15px/1.4 system-ui,sans-serif;max-width:70rem;margin:0 auto;padding:1rem;"
        "overflow-x:auto}table{border-collapse:collapse;border:0;margin:.5rem 0}"
        "th,td{text-align:left;vertical-align:top;border:0;border-bottom:1px solid #ddd;"
        "padding:.15rem .6rem .15rem 0;overflow-wrap:anywhere}img{max-width:100%}"
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><title>{title}</title><style>{style}'
        f"</style></head>\n<body><h1>{title}</h1>\n{body}\n</body></html>\n"
    )
