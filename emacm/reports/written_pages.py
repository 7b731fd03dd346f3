"""HTML documents from templates; each refers to no other file than those it links."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from emacm._saved import written_whole


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
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def written_page(file: Path, template: str, **content: Any) -> Path:
    """Write an HTML document, whose texts are all escaped, and return its file."""
    html = templates().get_template(f"{template}.html.jinja2").render(**content)
    with written_whole(file) as unfinished:
        unfinished.write_text(html, encoding="utf-8", errors="backslashreplace")
    return file
