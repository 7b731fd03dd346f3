"""How the columns of a file become the channels and the shaft of a recording."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from math import isfinite
from numbers import Real
from pathlib import Path, PurePath
from string import Formatter
from typing import Any

import pandas as pd

from emacm._checks import check_number, located
from emacm.files.shaft_references import angle_columns, is_angle, sensitivity_of
from emacm.recordings.names import chosen_channels, printable, split_unit


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        The file, in UTF-8, with or without a byte order mark.

    Returns
    -------
    dict of str to object

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is too large, or not TOML.
    """
    largest, longest = 1 << 20, 30_000  # bytes of the file and of a line: deep keys take long
    lines = path.read_bytes().split(b"\n") if path.stat().st_size <= largest else []
    if not lines or max(map(len, lines)) > longest:
        raise ValueError(f"it has more than {largest} bytes, or {longest} in one line. Shorten it.")
    try:
        return tomllib.loads(b"\n".join(lines).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is not valid TOML: {error}.") from error


def read_table(path: str | Path, **options: Any) -> pd.DataFrame:
    """Return a table with a header; where it has semicolons, they separate, and commas are decimal.

    Parameters
    ----------
    path : path
        The file.
    **options
        As for `pandas.read_csv`.

    Raises
    ------
    ValueError
        If it is empty, or a row is longer than the header.
    """
    with located(printable(Path(path))):
        header = Path(path).read_text(encoding="utf-8-sig").partition("\n")[0]
        local: dict[str, Any] = {"sep": ";", "decimal": ","} if ";" in header else {}
        return pd.read_csv(path, encoding="utf-8-sig", **local, **options)


_SECOND = ("file", "column", "fs", "time")  # of the shaft in a second file
_NAMES = {"file", "column"}
_TACHO = ("column", "pulses", "pulses_per_rev", "threshold", "hysteresis", "edge")
_FIELDS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "": (r"[^/]+", str),
    "d": (r"[+-]?\d+", int),
    "g": (r"[+-]?\d+(?:\.\d+)?", float),
}


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a file becomes a recording: which columns are channels, time and shaft, in which unit.

    Columns are the columns of a table or the arrays of a file; a column "speed [rpm]" is "speed"
    with the unit rpm. A name may contain wildcards, as ``"*_DE_time"``, if one column matches.
    Where files differ, names may be alternatives, as ``"vibration|x0"``: the first that a file has.
    In text files, the names may stand below other lines, and above a row of units.

    Parameters
    ----------
    fs : float, str or mapping of str to float, optional
        Sampling rate [Hz], or the name of a number in the file; or either one for each column, as
        ``{"vibration": 10_000, "rpm": "fs_rpm"}``. Default: what the file states (a number "fs",
        or "fs_rpm" for the column "rpm"), or the rate of its column of times.
    time : str or False, optional
        Column with the time of each sample. Default: a column that is named like one. False: such
        a column is ignored.
    channels : sequence of str or mapping of str to str, optional
        Columns that are channels, or the column of each channel. Default: all columns but those of
        time and shaft, and (with a warning) those that count the samples or are named like a status
        of the samples and have a few whole numbers.
    velocity : float, str or mapping, optional
        Constant speed of the shaft; or the column (or the number in the file) that holds it. rad/s
        unless `units`, the name of the column or the file states another unit; a text with a
        number and a unit, as "1797 rpm", is a constant speed; "speed|1797 rpm" is one for files
        without a column "speed". In a second file: ``{"file": "{stem}_speed.csv", "column":
        "speed [rpm]"}``, where {stem} is the name of the first file without its suffix, and fields
        of `meta` may be used; "fs" (or "time") states its rate (or column of times). Both files
        are aligned by their times; where one has none, they must start at the same instant.
    angle : str or mapping, optional
        Column with the shaft angle, cumulative or wrapped; rad unless another unit is stated, such
        as deg, or "rev/4096" for counts of an encoder. Or one of

        - ``{"column": "angle", "unit": "deg", "wrapped": True}``,
        - ``{"column": "position", "lead": 5.0}``: position of the nut of a screw, and its travel
          per revolution in the unit of the column; see `emacm.angle_from_position`,
        - ``{"currents": ["ia", "ib", "ic"], "pole_pairs": 6}``: phase currents of a synchronous
          motor, see `emacm.angle_from_currents`; they are channels, too,
        - ``{"resolver": ["sin", "cos"]}``, with "pole_pairs" (default: 1), see
          `emacm.angle_from_resolver`,
        - ``{"vibration": "x0", "speeds": [20, 30]}``: no sensor of the shaft; lowest and highest
          possible speed in the "unit" rev/s (or rpm, ...), and "orders" of lines, see
          `emacm.angle_from_vibration`; it is a channel, too.

        The first two may be in a second file, as for `velocity`.
    tacho : str or mapping, optional
        Column of a tachometer (one pulse per revolution), or a mapping with "column", "pulses" (or
        "pulses_per_rev") and the other options of `emacm.angle_from_tacho`; in a second file: with
        "file", as for `velocity`.
    ratio : float
        Revolutions of the shaft of interest per revolution of the measured shaft, such as 2.5 for a
        gear between both. Angles, speeds and orders of the recording are those of the shaft of
        interest.
    units : mapping of str to str, or sequence of str, optional
        Units of columns or channels, as ``{"speed": "rpm"}`` or ``["speed [rpm]"]``; of a constant
        speed, ``{"velocity": "rpm"}``.
    scale : float, str, or mapping of str to float or str, optional
        By what the values of channels are multiplied to be in their unit, or of each channel: 4.0
        for a WAV file with a full scale of 4 g, ``{"x0": 10.0}`` for V of a sensor of 0.1 V/g. Or
        the sensitivity of the sensor, "100 mV/g": `units` or the file state the unit of the column
        then, such as V, and the channel is in g.
    resample : bool
        Whether channels with uneven times (jitter, gaps of up to two samples) are resampled to an
        even rate, by cubic splines; the error is stated. Default: they are refused, but for jitter
        below a tenth of the sampling interval, which is stated.
    meta : str, DataFrame or mapping, optional
        Pattern of the file names, as ``"{unit}_{state}_{run:d}.mat"`` (without a suffix, it is
        matched against the name without its suffix; ``:d`` makes an integer, ``:g`` a number; in
        names of new files {state}, or {label}, {class}, {condition}, {fault}, may be missing; a
        file that does not match has no meta, which is refused only where it is needed), or a table:
        a DataFrame whose index or column "file" has the names of the files, or a mapping from names
        to mappings. A text that ends with ".csv" is the path of such a table. Names may begin with
        folders, ``"bench/A_07.csv"``; of several that match, the longest path is taken.

    Raises
    ------
    TypeError, ValueError
        If an option is not of this form, or more than one shaft reference is given.

    See Also
    --------
    emacm.open_recording : Reads a file by a layout.
    emacm.RecordingFolder : Reads a folder by a layout.

    Examples
    --------
    >>> layout = Layout(channels=["vibration"], velocity="speed [rpm]", meta="{unit}_{run:d}")
    >>> layout.unit_of("speed"), layout.meta_of("bench/A_07.csv")
    ('rpm', {'unit': 'A', 'run': 7})
    """

    fs: Any = None
    time: Any = None
    channels: Any = None
    velocity: Any = None
    angle: Any = None
    tacho: Any = None
    ratio: Any = 1.0
    units: Any = None
    scale: Any = None
    resample: bool = False
    meta: Any = None

    def __post_init__(self) -> None:
        """Check the options that do not need a file."""
        given = [name for name in ("velocity", "angle", "tacho") if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"a layout has one shaft reference, got {' and '.join(given)}.")
        for name, (form, is_valid) in _FORMS.items():
            value = getattr(self, name)
            if value is not None and not is_valid(value):
                raise TypeError(f"{name} must be {form}, got {value!r}.")
        for option in ("fs", "scale"):
            given_numbers = getattr(self, option)
            pairs = given_numbers if isinstance(given_numbers, Mapping) else {"": given_numbers}
            for name, number in pairs.items():
                text = f"{option} of {name!r}" if name else option
                if option == "scale" and isinstance(number, str):
                    sensitivity_of(number, text)
                elif number is not None and not isinstance(number, str):
                    check_number(number, text, above=0, unit="Hz" if option == "fs" else "")
        check_number(self.ratio, "ratio", above=0)
        if not isinstance(self.channels, Mapping):
            chosen_channels(self.channels, ())
        object.__setattr__(self, "units", _checked_units(self.units))
        object.__setattr__(self, "meta", _checked_meta(self.meta))

    @classmethod
    def from_toml(cls, path: str | os.PathLike[str]) -> Layout:
        """Read a layout from a TOML file, whose keys are the parameters.

        Parameters
        ----------
        path : str or Path
            The file. A table of `meta` is found relative to its folder.

        Returns
        -------
        Layout

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        TypeError, ValueError
            If it is not TOML, or an option is invalid.
        """
        file = Path(path)
        with located(f"layout {printable(file)}"):
            options = read_toml(file)
            known = [item.name for item in fields(cls)]
            for name in options:
                if name not in known:
                    raise ValueError(f"{name!r} is not an option of a layout; these are {known}.")
            meta = options.get("meta")
            if isinstance(meta, str) and meta.endswith(".csv"):
                options["meta"] = str(file.parent / meta)
            return cls(**options)

    @property
    def key(self) -> str:
        """All options but `meta` as text: layouts with the same key read a file alike."""
        return repr([getattr(self, item.name) for item in fields(self) if item.name != "meta"])

    def unit_of(self, *names: str) -> str:
        """Return the unit that the layout states for the first of these names, or ""."""
        texts = (self.time, self.velocity, *angle_columns(self.angle), self.tacho_column)
        stated = [part for text in texts if isinstance(text, str) for part in text.split("|")]
        known = dict(map(split_unit, map(str.strip, stated))) | self.units
        return next((known[name] for name in names if known.get(name)), "")

    @property
    def tacho_column(self) -> str | None:
        """Column of the tachometer."""
        return self.tacho["column"] if isinstance(self.tacho, Mapping) else self.tacho

    @property
    def _second(self) -> str:
        """Which shaft reference is in a second file; "" if none."""
        given = {name: getattr(self, name) for name in ("velocity", "angle", "tacho")}
        return next((n for n, v in given.items() if isinstance(v, Mapping) and "file" in v), "")

    def of_second_file(self) -> Layout | None:
        """Return the layout of the second file, if the shaft is in one."""
        if not self._second:
            return None
        options = dict(getattr(self, self._second))
        del options["file"]
        others: dict[str, Any] = {key: options.pop(key, None) for key in ("fs", "time")}
        reference = options["column"] if self._second == "velocity" else options
        return replace(self, channels=None, meta=None, **(others | {self._second: reference}))

    def files_of(self, path: str | os.PathLike[str]) -> list[Path]:
        """Return a file, followed by the second one with the motion of its shaft, if there is one.

        Raises
        ------
        ValueError
            If the name of the second file has a field that is not known.

        Examples
        --------
        >>> speed = {"file": "{stem}_{run:02d}.csv", "column": "rpm"}
        >>> [path.name for path in Layout(velocity=speed, meta="A_{run:d}").files_of("A_7.wav")]
        ['A_7.wav', 'A_7_07.csv']
        """
        first = Path(path)
        if not self._second:
            return [first]
        pattern = getattr(self, self._second)["file"]
        known = {"stem": first.stem} | self.meta_of(path)
        try:
            return [first, first.parent / pattern.format_map(known)]
        except (KeyError, IndexError, ValueError, AttributeError) as error:
            raise ValueError(
                f"the second file {pattern!r} of the layout must be a name with fields of "
                f"{list(known)}, as in '{{stem}}_speed.csv'."
            ) from error

    def meta_of(self, path: str | os.PathLike[str]) -> dict[Any, Any]:
        """Return the meta of a file; empty if its name does not match, or is not in the table.

        Who needs a label that is missing refuses it: `find_faults` needs none.

        Raises
        ------
        ValueError
            If the name matches the pattern in several ways.
        """
        file = PurePath(printable(path))
        if isinstance(self.meta, str):
            return meta_from_name(file, self.meta)
        names = ["/".join(file.parts[first:]) for first in range(len(file.parts))]
        for key in (key for name in names for key in (name, name.removesuffix(file.suffix))):
            if key in (self.meta or {}):
                return dict(self.meta[key])
        return {}


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and bool(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)


def _is_column(value: Any, options: Iterable[str] = ()) -> bool:
    """Tell whether a value is a name, or maps these options or those of a second file."""
    if not isinstance(value, Mapping):
        return _is_name(value)
    known = {*options, *(_SECOND if "file" in value else ())}
    return known >= set(value) and all(_is_name(value.get(key)) for key in known & _NAMES)


def _are_names(value: Any) -> bool:
    """Tell whether a mapping has names, and is of names; other forms are checked elsewhere."""
    return not isinstance(value, Mapping) or (
        bool(value) and all(map(_is_name, (*value, *value.values())))
    )


_COLUMN = "the name of a column, or a mapping with 'file' and 'column' of a second file"
_FORMS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "time": ("the name of a column, or False", lambda value: value is False or _is_name(value)),
    "channels": ("names, or map names to names of columns", _are_names),
    "velocity": (f"a number, {_COLUMN}", lambda value: _is_column(value) or _is_number(value)),
    "angle": (
        "the name of a column, or a mapping with 'column' (and 'unit', 'wrapped' or 'lead'), "
        "'currents' and 'pole_pairs', 'resolver', or 'vibration' and 'speeds'",
        lambda value: is_angle(value, _SECOND),
    ),
    "resample": ("True or False", lambda value: isinstance(value, bool)),
    "tacho": (
        f"the name of a column, or a mapping with 'column' of {list(_TACHO)}",
        lambda value: _is_column(value, _TACHO),
    ),
}


def _checked_units(units: Any) -> dict[str, str]:
    pairs = units.items() if isinstance(units, Mapping) else map(split_unit, map(str, units or ()))
    found = {split_unit(str(name))[0]: unit for name, unit in pairs}
    if isinstance(units, str) or not all(map(_is_name, found.values())):
        raise TypeError(
            f"units must map names to units, as {{'speed': 'rpm'}}, or be texts such as "
            f"'speed [rpm]', got {units!r}."
        )
    return found


def _meta_table(path: str) -> pd.DataFrame:
    """Return a table in which texts such as 001 and None stay as they are."""
    table = read_table(path, dtype=str, keep_default_na=False, na_values=[""])
    if "file" not in table:
        raise ValueError(f"the table of meta {path!r} has no column 'file', only {[*table]}.")
    for name in table.columns.drop("file"):
        if not table[name].str.match(r"0\d", na=False).any():
            with suppress(ValueError):
                table[name] = pd.to_numeric(table[name])
    return table


def _checked_meta(meta: Any) -> Any:
    """Return a pattern, or a mapping from names of files to their meta."""
    if isinstance(meta, str) and meta.endswith(".csv") and "{" not in meta:
        meta = _meta_table(meta)
    if isinstance(meta, pd.DataFrame):
        table = meta.set_index("file") if "file" in meta.columns else meta
        if not table.index.is_unique:
            double = table.index[table.index.duplicated()][0]
            raise ValueError(f"the table of meta has several rows for {double!r}; one is needed.")
        meta = table.astype(object).to_dict("index")
    if isinstance(meta, str):
        _compiled_pattern(meta)
    if meta is None or isinstance(meta, str):
        return meta
    if not isinstance(meta, Mapping) or not all(isinstance(row, Mapping) for row in meta.values()):
        raise TypeError(
            f"meta must be a pattern of file names, a DataFrame or a mapping from file names to "
            f"mappings, got {meta!r}."
        )
    return {str(name): dict(row) for name, row in meta.items()}


def constant_speed(text: str) -> tuple[float, str] | None:
    """Return a speed such as "1797 rpm" as a number and its unit; None if it is a name.

    Examples
    --------
    >>> constant_speed("1797 rpm"), constant_speed("157"), constant_speed("speed")
    ((1797.0, 'rpm'), (157.0, 'rad/s'), None)
    """
    found = re.fullmatch(r"\s*([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*([^\d\s].*)?", text)
    return None if found is None else (float(found[1]), (found[2] or "rad/s").strip())


def meta_from_name(path: PurePath, pattern: str) -> dict[str, Any]:
    """Return what a pattern finds in the name of a file.

    Parameters
    ----------
    path : Path
        The file.
    pattern : str
        Such as "{unit}_{state}_{run:d}.mat": fields are texts; ``:d`` makes a field an integer,
        ``:g`` a number. Without a suffix it is matched against the name without its suffix; with
        "/" also against the folders. A state (label, class, condition, fault) may be missing.

    Returns
    -------
    dict of str to object
        Empty if the name does not match.

    Raises
    ------
    ValueError
        If it matches in several ways.

    Examples
    --------
    >>> meta_from_name(PurePath("data/A7_worn_03.mat"), "{unit}_{state}_{run:d}")
    {'unit': 'A7', 'state': 'worn', 'run': 3}
    """
    greedy, lazy, kinds = _compiled_pattern(pattern)
    n_parts = pattern.count("/") + 1
    name = "/".join(path.parts[-n_parts:])
    tried = name.removesuffix(path.suffix) if path.suffix not in pattern[-8:] else name
    longest, shortest = greedy.fullmatch(tried), lazy.fullmatch(tried)
    if longest is None or shortest is None:
        # A new file has no state in its name, but its unit: "A7_03" of "{unit}_{state}_{run:d}".
        label = r"\{(?:state|label|class|condition|fault|zustand)\}"
        rest = re.sub(rf"[-_ ]?{label}(?=\.|$)|{label}[-_ /]?", "", pattern, count=1)
        has_fields = rest != pattern and re.search(r"\{.*\}", rest) is not None
        return meta_from_name(path, rest) if has_fields else {}
    if longest.groups() != shortest.groups():
        raise ValueError(
            f"the file name {name!r} matches the pattern {pattern!r} of meta in several ways: "
            f"{longest.groupdict()} and {shortest.groupdict()}. Pass meta as a table."
        )
    return {field: kinds[field](text) for field, text in longest.groupdict().items()}


def _compiled_pattern(
    pattern: str,
) -> tuple[re.Pattern[str], re.Pattern[str], dict[str, Callable[[str], Any]]]:
    greedy = ""
    kinds: dict[str, Callable[[str], Any]] = {}
    try:
        for text, field, kind, _ in Formatter().parse(pattern):
            greedy += re.escape(text)
            if field is not None:
                expression, kinds[field] = _FIELDS[kind or ""]
                greedy += f"(?P<{field}>{expression})"
        compiled = re.compile(greedy), re.compile(greedy.replace("[^/]+", "[^/]+?"))
    except (ValueError, KeyError, re.error):
        kinds = {}
    if not kinds:
        raise ValueError(
            f"meta must be a pattern such as '{{unit}}_{{state}}_{{run:d}}.mat', with each field "
            f"once and ':d' or ':g' for numbers; got {pattern!r}."
        )
    return *compiled, kinds
