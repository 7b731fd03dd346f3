"""Pages as one HTML file that contains its style and its pictures."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape
from io import BytesIO

from emacm.displays import _drawing
from emacm.reports.facts import Facts
from emacm.reports.pages import Page, heading_of_warnings
from emacm.reports.pdf_pages import print_scale
from emacm.reports.pictures import HEIGHT, description, draw, n_panels

_STYLE = """
body{font:16px/1.45 system-ui,sans-serif;color:#1a1a1a;background:#fff;margin:0}
article{max-width:48rem;margin:0 auto;padding:1rem 1.2rem 2rem}
h1{font-size:1.15rem;overflow-wrap:anywhere;margin:.2rem 0}
h2{font-size:1rem;margin:1.1rem 0 .3rem;border-bottom:1px solid #bbb}
p,ul{margin:.35rem 0}
.decision{border-left:.5rem solid #888;padding:.4rem .8rem;background:#f3f3f3}
.decision strong{font-size:1.5rem}
.healthy{border-color:#009E73}.fault{border-color:#D55E00}
.unknown,.other{border-color:#E69F00}.error{border-color:#000}
.first{border:2px solid #b00020;padding:.4rem .8rem;margin:.6rem 0}
.first.mild{border-color:#E69F00}
.scroll{overflow-x:auto}
table{border-collapse:collapse;width:100%}
th,td{text-align:left;vertical-align:top;padding:.2rem .6rem .2rem 0;border-bottom:1px solid #ddd}
.facts th{font-weight:600;width:6rem}
.facts td{overflow-wrap:anywhere}
figure{margin:.6rem 0}
img{width:100%;height:auto}
figcaption,.notes{font-size:.85rem;color:#444}
@media (min-width:44rem){.both{display:grid;grid-template-columns:1fr 1fr;gap:0 2rem}}
@media print{@page{size:A4;margin:11mm}
article{font-size:calc(8.5pt*var(--scale,1));line-height:1.25;max-width:none;padding:0;
break-after:page}article:last-child{break-after:auto}
h1{font-size:1.18em}h2{font-size:1.06em;margin:.9em 0 .25em;break-after:avoid}
p,ul{margin:.3em 0}ul{padding-left:2em}figcaption,.notes{font-size:.92em}
.decision,.first{padding:.4em .8em;margin:.5em 0}
.decision strong{font-size:1.53em}th,td{padding:.1em .5em .1em 0}.facts th{width:8em}
figure{margin:.3em 0}img{max-height:calc(78mm*var(--scale,1));width:auto;max-width:100%}
.both{display:grid;grid-template-columns:1fr 1fr;gap:0 1.5em}
.decision,figure,.first{break-inside:avoid}.decision,.first{print-color-adjust:exact}}
""".strip()


def html_of(pages: Sequence[Page], title: str = "Maintenance report") -> str:
    """Return an HTML document with one section for each page.

    Parameters
    ----------
    pages : sequence of Page
        What is written.
    title : str
        Title of the document.

    Returns
    -------
    str
        It refers to no other file.
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(map(_article, pages))
        + "\n</body>\n</html>\n"
    )


def index_of(entries: Sequence[tuple[Page, str]]) -> str:
    """Return an HTML document that lists pages, each with its file."""
    rows = "".join(
        f'<tr><td><a href="{escape(file, quote=True)}">{escape(page.name)}</a></td>'
        f"<td>{escape(page.decision)}{' (check the measurement)' if page.doubtful else ''}</td>"
        f"<td>{escape(page.since)}</td><td>{escape(page.action)}</td></tr>"
        for page, file in entries
    )
    head = "".join(f"<th>{name}</th>" for name in ("Recording", "Decision", "Since", "Action"))
    return html_of([], "Maintenance reports").replace(
        "<body>\n",
        f'<body>\n<article><h1>Maintenance reports</h1><div class="scroll"><table><thead><tr>{head}'
        f"</tr></thead><tbody>{rows}</tbody></table></div></article>",
    )


def _article(page: Page) -> str:
    style = f' style="--scale:{print_scale(page):.2f}"'
    parts = [f"<article{style}>", f"<h1>{escape(page.name)}</h1>", _first(page), _decision(page)]
    if page.statements:
        parts += ["<h2>What deviates from the training</h2>", _list(page.statements)]
    if page.rows:
        parts += [f"<h2>Deviations from {escape(repr(page.reference))}</h2>", _rows(page)]
    elif page.findings is not None:
        parts += [
            f"<h2>Deviations from {escape(repr(page.reference))}</h2>",
            "<p>No order band and no feature deviates.</p>",
        ]
    parts.append(_figure(page))
    if page.normal:
        parts += ["<h2>Checked and found normal</h2>", _list(page.normal)]
    both = (("Recording", page.recording), ("Model", page.model_facts))
    sections = [f"<section><h2>{name}</h2>{_facts(facts)}</section>" for name, facts in both]
    parts.append(f'<div class="both">{"".join(sections)}</div>')
    if page.notes:
        notes = "".join(f"<p>{escape(note)}</p>" for note in page.notes)
        parts.append(f'<div class="notes">{notes}</div>')
    return "\n".join([*filter(None, parts), "</article>"])


def _first(page: Page) -> str:
    if not page.first:
        return ""
    return (
        f'<div class="first{"" if page.doubtful else " mild"}" role="alert"><b>'
        f"{heading_of_warnings(page)}</b>{_list(page.first)}</div>"
    )


def _decision(page: Page) -> str:
    lines = [f"<p>Decision: <strong>{escape(page.decision)}</strong></p>"]
    lines += [f"<p>{escape(text)}</p>" for text in page.sentences]
    for name, text in (("", page.since), ("Recommended action: ", page.action)):
        if text:
            lines.append(f"<p><b>{name}{escape(text)}</b></p>")
    return f'<div class="decision {page.kind}">{"".join(lines)}</div>'


def _list(texts: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"


def _rows(page: Page) -> str:
    head = "".join(f"<th>{name}</th>" for name in ("Component", "Channel", "Orders", "Deviation"))
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in page.rows
    )
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="scroll">{table}</div>'


def _facts(facts: Facts) -> str:
    rows = "".join(f"<tr><th>{escape(n)}</th><td>{escape(text)}</td></tr>" for n, text in facts)
    return f'<table class="facts"><tbody>{rows}</tbody></table>'


def _figure(page: Page) -> str:
    panels = n_panels(page)
    if not panels:
        return ""
    figure, axes = _drawing.offscreen_panels(panels, height=HEIGHT if panels > 1 else 2.8)
    draw(page, list(axes[:, 0]))
    text, buffer = escape(description(page), quote=True), BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    source = b64encode(buffer.getvalue()).decode()
    return (
        f'<figure><img src="data:image/svg+xml;base64,{source}" alt="{text}">'
        f"<figcaption>{text[:1].upper()}{text[1:]}</figcaption></figure>"
    )
