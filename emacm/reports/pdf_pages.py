"""Pages as a PDF file: one page of A4 for each recording, drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from emacm.displays import _drawing
from emacm.reports.pages import Page, heading_of_warnings
from emacm.reports.pictures import bar_labels, description, draw, n_panels

_WIDTH, _HEIGHT = 8.27, 11.69  # inches: A4
_MARGIN = 0.6  # inches
_SIZE = 9.0  # points
_LEADING = 1.35
_PANEL = 1.85  # inches; height of a panel of the picture
_LEGEND, _NAMES = 0.35, 0.6  # inches above the first panel, for legend and predicted lines
_AXIS = 0.45  # inches below a panel, for its axis
_PRINTED_PICTURE = 3.5  # inches, with its caption
_PRINTED_MARGINS = 1.6  # inches, with those of the sections
_PRINTED_TEXT = 1.25  # of the height of the text in a PDF page, as lists and tables are wider
_SMALLEST = 0.5  # of the size of the text
_COLOURS = {"healthy": "#009E73", "fault": "#D55E00", "error": "#000000"}
_CAUTION, _ALARM = "#B27300", "#b00020"


class _Line(NamedTuple):
    """Text at one height: in columns that start at parts of the width; or the picture."""

    cells: tuple[tuple[float, str], ...] = ()
    size: float = 1.0
    bold: bool = False
    colour: str = "#1a1a1a"
    before: float = 0.0  # lines of space above
    picture: bool = False


def write_pdf(pages: Sequence[Page], path: Path) -> None:
    """Write pages into a PDF file.

    Parameters
    ----------
    pages : sequence of Page
        What is written; a long page has smaller letters.
    path : Path
        The file.
    """
    _drawing.pyplot()
    from matplotlib.backends.backend_pdf import PdfPages

    with PdfPages(path, metadata={"Title": "Maintenance report", "CreationDate": None}) as file:
        for page in pages:
            file.savefig(_figure(page))


def _figure(page: Page) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT))
    lines, panels = list(_lines(page)), n_panels(page)
    above = (_LEGEND + (_NAMES if page.parts is not None else 0.0)) if panels else 0.0
    picture = panels * _PANEL + above
    room = _HEIGHT - 2 * _MARGIN - picture
    scale = _fitting_scale(lines, lambda scale: room)
    placed = _wrapped(lines, scale)
    top = _HEIGHT - _MARGIN
    for line, height in placed:
        if line.picture:
            _place_picture(figure, page, top - above, panels)
            top -= picture
            continue
        top -= height
        for start, text in line.cells:
            place = (_MARGIN + start * (_WIDTH - 2 * _MARGIN)) / _WIDTH, top / _HEIGHT
            look: dict[str, Any] = {
                "size": _SIZE * scale * line.size,
                "color": line.colour,
                "parse_math": False,
            }
            figure.text(*place, text, weight="bold" if line.bold else "normal", **look)
    return figure


def print_scale(page: Page) -> float:
    """Return the size of letters and picture with which a printed HTML page fits on one sheet.

    Estimated by the height of the text in the PDF page.
    """
    picture = (_PRINTED_PICTURE if n_panels(page) else 0.0) + _PRINTED_MARGINS
    lines = list(_lines(page))
    return _fitting_scale(lines, lambda scale: (_HEIGHT - scale * picture) / _PRINTED_TEXT)


def _fitting_scale(lines: Sequence[_Line], room: Callable[[float], float]) -> float:
    """Return the size of letters with which lines fit into the room that is left [inches]."""
    scale = 1.0
    while scale > _SMALLEST:
        if sum(height for _, height in _wrapped(lines, scale)) <= room(scale):
            break
        scale *= 0.96
    return scale


def _place_picture(figure: Any, page: Page, top: float, panels: int) -> None:
    """Draw the panels below a height [inches]; they keep room for labels and names of lines."""
    letters = max((len(label) for label in bar_labels(page)), default=0)
    left = max(0.7, letters * _drawing.LETTER / 72 + 0.1)
    for number in range(panels):
        bottom = top - (number + 1) * _PANEL + _AXIS
        width, height = _WIDTH - 2 * _MARGIN - left, _PANEL - _AXIS - 0.1
        box = ((_MARGIN + left) / _WIDTH, bottom / _HEIGHT, width / _WIDTH, height / _HEIGHT)
        figure.add_axes(box)
    draw(page, figure.axes)


def _wrapped(lines: Sequence[_Line], scale: float) -> list[tuple[_Line, float]]:
    """Return lines that are as wide as the page at most, each with its height [inches]."""
    placed = []
    for line in lines:
        size = _SIZE * scale * line.size
        height = size * _LEADING / 72
        if line.picture:
            placed.append((line, 0.0))
            continue
        ends = [*(start for start, _ in line.cells[1:]), 1.0]
        columns = [
            (start, _broken(text, (end - start) * (_WIDTH - 2 * _MARGIN) * 72 - 4, size, line.bold))
            for (start, text), end in zip(line.cells, ends, strict=True)
        ]
        for k in range(max((len(texts) for _, texts in columns), default=0)):
            cells = tuple((start, texts[k]) for start, texts in columns if k < len(texts))
            space = line.before * height if k == 0 else 0.0
            placed.append((line._replace(cells=cells), height + space))
    return placed


def _broken(text: str, width: float, size: float, bold: bool) -> list[str]:
    """Break a text into lines of a width [points]."""
    room, space = width / size, _width(" ", bold)
    found, line, used = [], "", 0.0
    for word in text.split():
        length = _width(word, bold)
        while length > room:  # a path
            cut = _n_fitting(word, room, bold)
            found += [line] if line else []
            found, line, word, used = [*found, word[:cut]], "", word[cut:], 0.0
            length = _width(word, bold)
        if line and used + space + length > room:
            found, line, used = [*found, line], "", 0.0
        line, used = f"{line} {word}".strip(), used + (space if line else 0.0) + length
    return [*found, line]


def _n_fitting(word: str, room: float, bold: bool) -> int:
    """Return the number of letters of a word that fit into a width in units of the size."""
    ends = np.cumsum([_width(letter, bold) for letter in word])
    return max(1, int(np.count_nonzero(ends <= room)))


@lru_cache(maxsize=8192)
def _width(text: str, bold: bool) -> float:
    """Return the width of a text in units of the size of its letters."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=1, weight="bold" if bold else "normal")
    return float(text_to_path.get_text_width_height_descent(text, font, False)[0])


def _lines(page: Page) -> Iterator[_Line]:
    """Yield the text of a page, in the order of the HTML page."""
    yield _Line(((0, page.name),), 1.15, True)
    if page.first:
        colour = _ALARM if page.doubtful else _CAUTION
        yield _Line(((0, heading_of_warnings(page)),), 1.1, True, colour, 0.4)
        yield from _items(page.first)
    colour = _COLOURS.get(page.kind, _CAUTION)
    yield _Line(((0, f"Decision: {page.decision}"),), 1.8, True, colour, 0.3)
    for text in page.sentences:
        yield _Line(((0, text),))
    for name, text in (("", page.since), ("Recommended action: ", page.action)):
        if text:
            yield _Line(((0, name + text),), bold=True, before=0.2)
    if page.statements:
        yield _heading("What deviates from the training")
        yield from _items(page.statements)
    if page.findings is not None:
        yield _heading(f"Deviations from {page.reference!r}")
        starts = (0.0, 0.38, 0.58, 0.78)
        if page.rows:
            titles = ("Component", "Channel", "Orders", "Deviation")
            yield _Line(tuple(zip(starts, titles, strict=True)), 0.9, colour="#555555")
        else:
            yield _Line(((0, "No order band and no feature deviates."),))
        for row in page.rows:
            yield _Line(tuple(zip(starts, row, strict=True)))
    if n_panels(page):
        text = description(page)
        yield _heading(text[:1].upper() + text[1:])
        yield _Line(picture=True)
    if page.normal:
        yield _heading("Checked and found normal")
        yield from _items(page.normal)
    for name, facts in (("Recording", page.recording), ("Model", page.model_facts)):
        yield _heading(name)
        for title, text in facts:
            yield _Line(((0, title), (0.18, text)), 0.9)
    for note in page.notes:
        yield _Line(((0, note),), 0.85, colour="#444444", before=0.2)


def _heading(text: str) -> _Line:
    return _Line(((0, text),), 1.0, True, before=0.5)


def _items(texts: Sequence[str]) -> Iterator[_Line]:
    for text in texts:
        yield _Line(((0, "•"), (0.024, text)))
