"""Reader of text files: the header is found below a preamble; separator and decimals are found."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from statistics import mode
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._statements import warn
from emacm.files.file_columns import FileColumns, RefusedFileError
from emacm.recordings.names import is_time_name, printable, split_unit

_SEPARATORS = (";", "\t", ",", "|")
_BLANK = "\0"  # begins the names of blank columns at the right, which no header can have
_DATE = re.compile(r"\d{4}-\d\d?-\d\d?\b|\d\d?\.\d\d?\.\d{4}\b|\d\d?:\d\d:\d\d")  # at its start
_QUOTED = re.compile(r'"\s*[+-]?\d+,\d+\s*"')  # a number with a decimal comma
_STATED = re.compile(  # as "Sampling rate: 2000 Hz", or "fs;2000;Hz"; *+: in linear time
    r"[#%\s]*+([^\W\d][^:=;,\t]*+)[:=;,\t][:=\s]*+([+-]?\d+(?:\.\d+)?)[;,\s]*+"
    r"(?:[\[(]?([^\W\d_][^\s;,\])]*)[\])]?)?[;,\s]*"
)


class _Row(NamedTuple):
    """A line of the head that is not blank: its number, fields, and whether it is a comment."""

    number: int
    fields: list[str]
    is_comment: bool


def read_csv(path: Path, content: FileColumns) -> None:
    """Add the columns of a text file, and the numbers that its preamble states.

    Parameters
    ----------
    path : Path
        The file. Lines above the header, and rows of units below it, may be of any kind.
    content : FileColumns
        What is added to.

    Warns
    -----
    EmacmWarning
        If the last row has no line end, and is left out: its last number may be incomplete.

    Raises
    ------
    RefusedFileError
        If it has no rows of numbers, or no header that belongs to them.
    """
    stored = _in_utf8(path.read_bytes())
    rows, line_end, last = stored.rpartition(b"\n")
    head = (rows or last).split(b"\n", 200)[:200]
    table = text_table([line.decode(errors="replace") for line in head])
    if last.strip():
        warn(
            "incomplete row",
            f"{printable(path)}: its last row has no line end, so that its last number may be "
            f"incomplete; it is left out. Copy the file again, or add a line end.",
        )
    table.add_columns(content, BytesIO(rows + line_end), skiprows=table.start)


def _in_utf8(stored: bytes) -> bytes:
    """Return a text in UTF-8, UTF-16 or the code page of Western Europe in UTF-8, with "\\n"."""
    if stored.startswith((b"\xff\xfe", b"\xfe\xff")):
        stored = stored.decode("utf-16").encode()
    stored = stored.rstrip(b"\0")  # of loggers that lost their supply
    if b"\0" in stored[:100_000]:
        raise RefusedFileError(
            "it contains bytes 0: it is binary, or UTF-16 without a mark. Save it in UTF-8."
        )
    try:
        stored.decode()
    except UnicodeDecodeError:
        stored = stored.decode("cp1252", errors="replace").encode()
    stored = stored.removeprefix(b"\xef\xbb\xbf")
    return stored.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


class TextTable(NamedTuple):
    """How the rows of a text file are read.

    Attributes
    ----------
    names, units : list of str
        Of the columns; no units if there is no row of units.
    separator : str or None
        Between two values; None for white space.
    decimal : str
        Decimal point or comma.
    start : int
        Number of lines above the rows of numbers.
    preamble : list of str
        These lines.
    """

    names: list[str]
    units: list[str]
    separator: str | None
    decimal: str
    start: int
    preamble: list[str]

    def add_columns(self, content: FileColumns, source: Any, **options: Any) -> None:
        """Add the columns of rows of numbers, and the numbers that the preamble states.

        Parameters
        ----------
        content : FileColumns
            What is added to.
        source : path or file
            As for `pandas.read_csv`.
        **options
            Further options of `pandas.read_csv`.

        Raises
        ------
        RefusedFileError
            If a row has more values than there are names, or an open quotation mark.
        """
        names = [name or f"{_BLANK}{number}" for number, name in enumerate(self.names)]
        options |= {"sep": self.separator or r"\s+", "decimal": self.decimal}
        if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1):
            options |= {"float_precision": "round_trip"}  # as later versions read numbers
        try:
            table = pd.read_csv(
                source, header=None, names=names, index_col=False, low_memory=False, **options
            )
        except pd.errors.ParserError as error:
            text = str(error).strip().rpartition(": ")[2]
            text = text if "skiprows" in options else re.sub(r" in line \d+", "", text)
            raise RefusedFileError(
                f"a row does not fit the {len(names)} columns: {text}. Correct this line."
            ) from error
        blank = table.isna().all(axis=1).to_numpy()[::-1]
        table = table.iloc[: len(table) - (int(blank.argmin()) if not blank.all() else 0)]
        for name in table.columns[table.columns.str.startswith(_BLANK)]:
            values = pd.to_numeric(table.pop(name), errors="coerce").dropna()
            if len(values):
                raise RefusedFileError(
                    f"sample {values.index[0]} has {values.iloc[0]} in a column without a name."
                )
        for name in table:
            content.columns[name] = _numbers(table[name], self.decimal)
            texts = ((n, x) for n, x in enumerate(content.columns[name]) if isinstance(x, str))
            place, text = next(texts, (0, "")) if self.decimal == "," else (0, "")
            if re.fullmatch(r"[+-]?\d*\.\d+(e[+-]?\d+)?", text, re.IGNORECASE):
                content.defects[name] = (
                    f"has {text!r} at sample {place}, with a decimal point, though other numbers "
                    f"of the file have decimal commas. Write all in one way"
                )
        content.units |= {n: u for n, u in zip(self.names, self.units, strict=False) if u}
        # Beside decimal commas, 51.200 is fifty-one thousand.
        dots = r"\d\.\d{3}\b" if self.decimal == "," else r"$^"
        _add_stated_numbers(content, [x for x in self.preamble if not re.search(dots, x)])


def text_table(head: Sequence[str]) -> TextTable:
    """Find header, separator and decimals in the first lines of a text file.

    Parameters
    ----------
    head : sequence of str
        The lines.

    Returns
    -------
    TextTable

    Raises
    ------
    RefusedFileError
        If there are no rows of numbers, or no header that belongs to them, or a line is longer.
    """
    for number, line in enumerate(head, 1):
        if len(line) > 100_000:
            raise RefusedFileError(
                f"line {number} has more than 100000 characters. Save a row for each time."
            )
    filled = [(number, line) for number, line in enumerate(head) if line.strip(" \t;,|")]
    separator = next((s for s in _SEPARATORS if filled and s in filled[-1][1]), None)
    if filled and re.fullmatch(r'"?sep=.?"?', filled[0][1].strip(), re.IGNORECASE):
        del filled[0]  # of spreadsheets
    rows = [_row(number, line, separator) for number, line in filled]
    comma = separator in (";", "\t", "|") or any(map(_QUOTED.search, head))
    names, units, start = _header(rows, comma=comma, separator=separator)
    first = next(row for row in rows if row.number >= start)
    header = re.split(r"[;\t,|]", names[0]) if len(names) == 1 else names
    if len(header) > len(names) or any(first.fields[len(names) :]):  # pandas would leave these out
        raise RefusedFileError(
            f"line {first.number + 1} has {len(first.fields)} values, but the header has "
            f"{len(header)} names. Write a value for each."
        )
    decimal = "," if comma and re.search(r"\d,\d", "\n".join(head[start:])) else "."
    return TextTable(names, units, separator, decimal, start, list(head[:start]))


def _row(number: int, line: str, separator: str | None) -> _Row:
    is_comment = line.startswith(("#", "%"))
    line = line.lstrip("#% \t") if is_comment else line
    plain = re.sub(r"(?<!\s)\s++(?=[\[(])", "", line)  # "speed [rpm]" is one name
    fields = line.split(separator) if separator else plain.split()
    if separator and '"' in line:
        fields = next(csv.reader([line], delimiter=separator))
    return _Row(number, [text.strip().strip('"').strip() for text in fields], is_comment)


def _is_number(text: str, *, comma: bool) -> bool:
    try:
        float(text.replace(",", ".") if comma else text)
    except ValueError:
        return bool(_DATE.match(text))  # nor is a date a name
    return True


def _header(
    rows: Sequence[_Row], *, comma: bool, separator: str | None
) -> tuple[list[str], list[str], int]:
    """Return names and units of the columns, and the number of lines above the first data."""
    numeric = [[_is_number(text, comma=comma) for text in row.fields] for row in rows]
    widths = [len(row.fields) for row in rows if not row.is_comment]
    width = mode(widths[-3:]) if widths else 0  # of the last rows, of which one may be incomplete
    first = _first_of_data(rows, numeric, width)
    above = [n for n in range(first) if len(rows[n].fields) == width and not any(numeric[n])]
    named = [n for n in above if all(_filled(rows[n])) and any(_filled(rows[n]))]
    if not named:
        others = [n for n in range(first) if not rows[n].is_comment]
        others.sort(key=lambda n: any(numeric[n]))
        padded = any(re.fullmatch(r"0\d+", text) for row in rows for text in row.fields)
        if separator == "," and padded:  # as of 0,001
            raise RefusedFileError(
                f"its commas are both decimal and between values, as in line {rows[-1].number + 1} "
                f"{rows[-1].fields}. Write decimal points, or semicolons between values."
            )
        if others:
            raise RefusedFileError(
                f"its header {rows[others[0]].fields} does not name the {width} columns: the rows "
                f"have {width} values. Name each of them."
            )
        return [f"x{i}" for i in range(width)], [], rows[first].number
    header = named[-1]
    if header - 1 in named and _is_row_of_units(rows[header].fields, rows[header - 1].fields):
        header -= 1
    names, units = rows[header].fields, []
    if header + 1 in above:
        units = [re.sub(r"^[\[(](.*)[\])]$", r"\1", text) for text in rows[header + 1].fields]
    if len(set(filter(None, names))) < len(_filled(rows[header])):
        raise RefusedFileError(f"its columns must have different names, got {names}.")
    return names, units, rows[header + (2 if units else 1)].number


def _filled(row: _Row) -> list[str]:
    """Return the fields of a row without blank ones at the right, as spreadsheets write them."""
    used = [number for number, text in enumerate(row.fields) if text]
    return row.fields[: used[-1] + 1] if used else []


def _first_of_data(rows: Sequence[_Row], numeric: Sequence[list[bool]], width: int) -> int:
    """Return the first row of numbers; if all rows have texts, the first that is not all text."""
    wide = [n for n, row in enumerate(rows) if len(row.fields) == width and not row.is_comment]
    filled = [n for n in wide if any(rows[n].fields)]
    for n in filled:  # each field is a number or blank
        if all(known or not text for text, known in zip(rows[n].fields, numeric[n], strict=True)):
            return n
    for n in filled:
        if numeric[n][0] or numeric[n][len(_filled(rows[n])) - 1]:
            return n
    begin = " ".join(rows[0].fields)[:40] if rows else ""
    raise RefusedFileError(
        f"it has no rows of numbers; it begins with {begin!r}. Save a row for each time."
    )


def _is_row_of_units(fields: Sequence[str], above: Sequence[str]) -> bool:
    """Tell whether a row of texts has the units of the names above it, rather than names."""
    if any(split_unit(text)[1] for text in fields):
        return False
    return any(map(is_time_name, above)) or not any(map(is_time_name, fields))


def _numbers(column: pd.Series, decimal: str) -> NDArray[Any]:
    """Return a column as numbers where its cells are numbers."""
    values = column.to_numpy()
    if values.dtype.kind in "biuf":
        return values
    cells = column.astype(object).to_numpy()
    if decimal == ",":  # then points separate thousands
        column = column.astype(str).str.replace(".", "?").str.replace(",", ".")
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(np.float64)
    return np.where(np.isnan(numbers), cells, numbers.astype(object))


def _add_stated_numbers(content: FileColumns, preamble: Sequence[str]) -> None:
    for found in filter(None, map(_STATED.fullmatch, preamble)):
        name = found[1].rstrip()
        if name not in content.columns:
            content.numbers[name] = float(found[2])
            content.units |= {name: found[3]} if found[3] else {}
