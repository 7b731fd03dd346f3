"""HTML documents that need no other file: from templates, and of plain tables."""

from __future__ import annotations

import html
import json
from base64 import b64encode
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from emacm._saved import write_whole


@cache
def templates() -> Any:
    """Return the environment of the templates, which escapes all texts.

    Raises
    ------
    ImportError
        If jinja2 is not installed (extra ``report``).
    """
    try:
        import jinja2
    except ImportError as error:
        raise ImportError(
            "reports need jinja2 and matplotlib; run pip install 'emacm[report]'."
        ) from error
    return jinja2.Environment(
        loader=jinja2.PackageLoader("emacm.reports"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )


def written_page(file: Path, template: str, **content: Any) -> Path:
    """Write an HTML document, whose texts are all escaped, and return its file."""
    html = templates().get_template(f"{template}.html.jinja2").render(**content)
    write_whole(file, html.encode("utf-8", "backslashreplace"))
    return file


LIST_OF_PAGES = "pages.json"


def listed_pages(folder: Path) -> list[dict[str, Any]]:
    """Return what the index of a folder of reports lists: name, link, decision and so on."""
    file = folder / LIST_OF_PAGES
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else []


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
        "padding:.15rem .6rem .15rem 0;overflow-wrap:break-word}img{max-width:100%}"
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><title>{title}</title><style>{style}'
        f"</style></head>\n<body><h1>{title}</h1>\n{body}\n</body></html>\n"
    )


def encoded_svg(figure: Any) -> str:
    """Return a figure as SVG in base64."""
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return b64encode(buffer.getvalue()).decode()


def written_record(record: Any, path: Path | None, *, as_json: bool = False) -> str:
    """Write a record into a file, in the form that the end of its name states.

    Parameters
    ----------
    record : object
        With `to_json` and `to_html`.
    path : Path or None
        A name that ends with .txt, .json or .html; None: nothing is written.
    as_json : bool
        Form of what is returned.

    Returns
    -------
    str
        The record as text or JSON, if it was not written; otherwise empty.
    """
    if path is None:
        return str(record.to_json() if as_json else record)
    forms = {".json": record.to_json, ".html": record.to_html, ".txt": record.__str__}
    write_whole(path, forms[path.suffix]().encode())
    return ""
