"""Reader of text files: the header is found below a preamble; separator and decimals are found."""

from __future__ import annotations

import csv
import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from statistics import mode
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm.files.file_columns import FileColumns, RefusedFileError
from emacm.recordings.names import is_time_name, split_unit

_SEPARATORS = (";", "\t", ",", "|")
_EXACT: dict[str, Any] = (  # from pandas 3 on, numbers are read exactly by default
    {"float_precision": "round_trip"} if int(pd.__version__.partition(".")[0]) < 3 else {}
)
_BESIDE = "\0"  # begins the names of blank columns at the right, which no header can have
_TOO_MANY = re.compile(r"Expected (\d+) fields in line (\d+), saw (\d+)")  # of pandas
_UNCLOSED = re.compile(r"EOF inside string starting at row (\d+)")
_QUOTED = re.compile(r'"\s*[+-]?\d+,\d+\s*"')  # a number with a decimal comma
_STATED = re.compile(  # as "Sampling rate: 2000 Hz", or "fs;2000;Hz"
    r"[#%\s]*([^\W\d][^:=;,\t]*?)\s*[:=;,\t]\s*([+-]?\d+(?:\.\d+)?)[;,\s]*"
    r"(?:[\[(]?([^\W\d_][^\s;,\])]*)[\])]?)?[;,\s]*"
)


class _Row(NamedTuple):
    """A line of the head that is not blank: its number, fields, and whether it is a comment."""

    number: int
    fields: list[str]
    is_comment: bool


def read_csv(path: Path, *, n_head: int = 200) -> FileColumns:
    """Return the columns of a text file, and the numbers that its preamble states.

    Parameters
    ----------
    path : Path
        The file. Lines above the header, and rows of units below it, may be of any kind.
    n_head : int
        Lines in which separator and header are looked for.

    Returns
    -------
    FileColumns

    Raises
    ------
    RefusedFileError
        If it has no rows of numbers, or no header that belongs to them.
    """
    encoding = _encoding(path, n_head)
    with open(path, encoding=encoding, newline=None) as file:
        head = [line.rstrip("\n") for line in itertools.islice(file, n_head)]
    table = text_table(head)
    return table.columns(path, skiprows=table.start, encoding=encoding)


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
    n_blank : int
        Number of columns without names and values at the right, of which there are several.
    """

    names: list[str]
    units: list[str]
    separator: str | None
    decimal: str
    start: int
    preamble: list[str]
    n_blank: int = 0

    def columns(self, source: Any, **options: Any) -> FileColumns:
        """Return the columns of rows of numbers, and the numbers that the preamble states.

        Parameters
        ----------
        source : path or file
            As for `pandas.read_csv`.
        **options
            Further options of `pandas.read_csv`.

        Returns
        -------
        FileColumns

        Raises
        ------
        RefusedFileError
            If a row has more values than there are names, or an open quotation mark.
        """
        beside = [f"{_BESIDE}{number}" for number in range(self.n_blank)]
        try:
            table = pd.read_csv(
                source,
                sep=self.separator or r"\s+",
                decimal=self.decimal,
                header=None,
                names=[*self.names, *beside],
                index_col=False,
                low_memory=False,
                **_EXACT,
                **options,
            )
        except pd.errors.ParserError as error:
            raise _refused_row(str(error), is_file=bool(options)) from error
        blank = table.isna().all(axis=1).to_numpy()[::-1]
        table = table.iloc[: len(table) - (int(blank.argmin()) if not blank.all() else 0)]
        _check_nothing_beside(table)
        unnamed = [name for name in self.names if not name and table[name].isna().all()]
        columns = {name: _numbers(table[name]) for name in self.names if name not in unnamed}
        content = FileColumns(columns, units=dict(zip(self.names, self.units, strict=False)))
        _add_stated_numbers(content, self.preamble)
        return content


def _refused_row(error: str, *, is_file: bool) -> ValueError:
    """Return what is wrong with a row that pandas refuses; rows of a stream have no line."""
    too_many, unclosed = _TOO_MANY.search(error), _UNCLOSED.search(error)
    if too_many:
        n_names, line, n_values = too_many.groups()
        what = f"has {n_values} values, but there are {n_names} columns"
    elif unclosed:
        line, what = int(unclosed[1]) + 1, "has a quotation mark that is not closed"
    else:
        return ValueError(error)
    where = f"line {line}" if is_file else "a row"
    return RefusedFileError(f"{where} {what}. Correct the line, or leave the file out.")


def _check_nothing_beside(table: pd.DataFrame) -> None:
    """Refuse numbers to the right of the named columns: their row was shifted, or cut wrongly."""
    for name in table:
        if name and not name.startswith(_BESIDE):
            continue
        places = np.flatnonzero(pd.to_numeric(table[name], errors="coerce").notna())
        if 0 < len(places) < len(table):
            raise RefusedFileError(
                f"sample {places[0]} has the number {table[name].iloc[places[0]]} in a column "
                f"without a name. Correct its row, or name the column."
            )


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
        If there are no rows of numbers, or no header that belongs to them.
    """
    filled = [(number, line) for number, line in enumerate(head) if line.strip(" \t;,|")]
    separator = next((s for s in _SEPARATORS if filled and s in filled[-1][1]), None)
    if filled and re.fullmatch(r'"?sep=.?"?', filled[0][1].strip(), re.IGNORECASE):
        del filled[0]  # of spreadsheets
    rows, n_blank = _without_blank_columns([_row(n, line, separator) for n, line in filled])
    comma = separator in (";", "\t", "|") or any(map(_QUOTED.search, head))
    names, units, start = _header(rows, comma=comma)
    first = next(row for row in rows if row.number >= start)
    if any(first.fields[len(names) :]):  # of which pandas would leave out what has no name
        raise RefusedFileError(
            f"line {first.number + 1} has {len(first.fields)} values, but there are {len(names)} "
            f"columns. Correct the line, or leave the file out."
        )
    data = [line for line in head[start:] if comma]
    decimal = "," if any(re.search(r"\d,\d", line) for line in data) else "."
    return TextTable(names, units, separator, decimal, start, list(head[:start]), n_blank)


def _encoding(path: Path, n_head: int) -> str:
    """Return UTF-8 or UTF-16, or the code page of Western Europe for what is not UTF-8."""
    with open(path, "rb") as file:
        start = b"".join(itertools.islice(file, n_head))
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in start:
        raise RefusedFileError(
            "it contains bytes 0: it is binary, or UTF-16 without a byte order mark. Save it as "
            "text in UTF-8."
        )
    try:
        start.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _row(number: int, line: str, separator: str | None) -> _Row:
    is_comment = line.startswith(("#", "%"))
    line = line.lstrip("#% \t") if is_comment else line
    fields = line.split(separator) if separator else line.split()
    if separator and '"' in line:
        fields = next(csv.reader([line], delimiter=separator))
    return _Row(number, [text.strip().strip('"').strip() for text in fields], is_comment)


def _without_blank_columns(rows: Sequence[_Row]) -> tuple[list[_Row], int]:
    """Leave one of several blank columns at the right, as spreadsheets write them; count others."""
    width = max((len(row.fields) for row in rows), default=0)
    wide = [row.fields[::-1] for row in rows if len(row.fields) == width]
    used = [next((k for k, text in enumerate(fields) if text), width) for fields in wide]
    n_blank = max(0, min(used, default=0) - 1)
    if not n_blank:
        return list(rows), 0
    return [row._replace(fields=row.fields[: width - n_blank]) for row in rows], n_blank


def _is_number(text: str, *, comma: bool) -> bool:
    try:
        float(text.replace(",", ".") if comma else text)
    except ValueError:
        return bool(re.match(r"\d{4}-\d\d-\d\d[T ]", text))  # nor is a date a name
    return True


def _header(rows: Sequence[_Row], *, comma: bool) -> tuple[list[str], list[str], int]:
    """Return names and units of the columns, and the number of lines above the first data."""
    numeric = [[_is_number(text, comma=comma) for text in row.fields] for row in rows]
    widths = [len(row.fields) for row in rows if not row.is_comment]
    width = mode(widths[-3:]) if widths else 0  # of the last rows, of which one may be incomplete
    first = _first_of_data(rows, numeric, width)
    above = [n for n in range(first) if len(rows[n].fields) == width and not any(numeric[n])]
    named = [n for n in above if all(rows[n].fields[:-1]) and any(rows[n].fields)]
    if not named:
        _check_no_other_header(rows[:first], width)
        return [f"x{i}" for i in range(width)], [], rows[first].number
    header = named[-1]
    if header - 1 in named and _is_row_of_units(rows[header].fields, rows[header - 1].fields):
        header -= 1
    names, units = rows[header].fields, []
    if header + 1 in above:
        units = [re.sub(r"^[\[(](.*)[\])]$", r"\1", text) for text in rows[header + 1].fields]
    if len(set(names)) < width:
        raise RefusedFileError(f"its columns must have different names, got {names}.")
    return names, units, rows[header + (2 if units else 1)].number


def _first_of_data(rows: Sequence[_Row], numeric: Sequence[list[bool]], width: int) -> int:
    """Return the first row of numbers; if all rows have texts, the first that is not all text."""
    wide = [n for n, row in enumerate(rows) if len(row.fields) == width and not row.is_comment]
    for n in wide:
        texts = [text for text, known in zip(rows[n].fields, numeric[n], strict=True) if not known]
        if not any(texts):  # each field is a number or blank
            return n
    for n in wide:
        if numeric[n][0] or numeric[n][-1]:
            return n
    begin = " ".join(rows[0].fields)[:40] if rows else ""
    raise RefusedFileError(
        f"it has no rows of numbers; it begins with {begin!r}. Save a row for each time, with "
        f"numbers such as 1.5e-3 separated by commas, semicolons, tabs, | or spaces."
    )


def _check_no_other_header(above: Sequence[_Row], width: int) -> None:
    """Refuse a header that has more or fewer names than the rows have values."""
    texts = [row.fields for row in above if not row.is_comment]
    if texts and len(texts[-1]) == width:
        raise RefusedFileError(
            f"its header {texts[-1]} has no name for a column. Name each column in the line above "
            f"the numbers."
        )
    if texts:
        raise RefusedFileError(
            f"its header has {len(texts[-1])} names {texts[-1]}, but its rows have {width} values. "
            "Correct the line above the numbers, or start all lines above them with #."
        )


def _is_row_of_units(fields: Sequence[str], above: Sequence[str]) -> bool:
    """Tell whether a row of texts has the units of the names above it, rather than names."""
    if any(split_unit(text)[1] for text in fields):
        return False
    return any(map(is_time_name, above)) or not any(map(is_time_name, fields))


def _numbers(column: pd.Series) -> NDArray[Any]:
    """Return a column as numbers where its cells are numbers."""
    values = column.to_numpy()
    if values.dtype.kind in "biuf":
        return values
    cells = column.astype(object).to_numpy()
    numbers = pd.to_numeric(column, errors="coerce").to_numpy(np.float64)
    return np.where(np.isnan(numbers), cells, numbers.astype(object))


def _add_stated_numbers(content: FileColumns, preamble: Sequence[str]) -> None:
    for line in preamble:
        found = _STATED.fullmatch(line)
        if found is None or found[1] in content.columns:
            continue
        content.numbers[found[1]] = float(found[2])
        if found[3]:
            content.units[found[1]] = found[3]
