"""The columns of a file, and how a layout makes a recording of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from emacm._statements import Statement
from emacm.files.layout import constant_speed
from emacm.files.sample_times import Times
from emacm.recordings.names import is_shaft_name, is_time_name, split_unit

_RATES = {"fs", "sfreq", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"}
_RATES |= {"abtastrate"}


class RefusedFileError(ValueError):
    """A file that is read correctly, but holds nothing that can be used."""


@dataclass
class FileColumns:
    """What a file contains.

    Attributes
    ----------
    columns : dict of str to ndarray of shape (n_times,)
        Arrays by name.
    rates : dict of str to float
        Sampling rates that the file states [Hz], by column.
    units : dict of str to str
        Units that the file states, by column.
    numbers : dict of str to float
        Single numbers by name.
    ignored : dict of str to str
        What is in the file but no column, with the reason.
    start : Timestamp or None
        When the recording started, if the file states it other than by a column of times.
    starts : dict of str to float
        When columns start, where the file states it, from any common instant [s].
    times : dict of str to ndarray of shape (n_times,)
        Times of the samples of columns that have times of their own, from 0 [s].
    defects : dict of str to str
        Why columns cannot be used, as "has ...".
    is_relative : bool
        Whether values are parts of a full scale that is not stated.
    statements : tuple of Statement
        What is known about the shaft, once a recording was made: repairs of a tachometer.
    """

    columns: dict[str, NDArray[Any]] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    numbers: dict[str, float] = field(default_factory=dict)
    ignored: dict[str, str] = field(default_factory=dict)
    start: pd.Timestamp | None = None
    starts: dict[str, float] = field(default_factory=dict)
    times: dict[str, Times] = field(default_factory=dict)
    defects: dict[str, str] = field(default_factory=dict)
    is_relative: bool = False
    statements: tuple[Statement, ...] = ()

    def put(self, name: str, values: NDArray[Any]) -> None:
        """Add a column; one of the same name would be lost, and is refused."""
        if name in self.columns:
            raise RefusedFileError(f"two arrays would be the column {name!r}. Rename one of them.")
        self.columns[name] = values

    def take_units_from_names(self) -> None:
        """Take the units out of the names of columns, as in "speed [rpm]"."""
        parts = {name: split_unit(name) for name in (*self.columns, *self.numbers)}
        plain = {name: short for name, (short, _) in parts.items()}
        if len(set(plain.values())) < len(plain):
            return
        self.units = {short: unit for short, unit in parts.values() if unit} | self.units
        for kind in ("columns", "rates", "units", "numbers", "starts", "times", "defects"):
            values = getattr(self, kind).items()
            setattr(self, kind, {plain.get(name, name): value for name, value in values})

    def take_units_from_groups(self) -> None:
        """Give the unit of a group or structure to the only array that it holds."""
        names = [*self.columns, *self.numbers]
        for place in self.units.keys() - set(names):
            group = re.escape(re.sub(r"[/.]$", "", place))
            within = [name for name in names if re.match(rf"{group}[/.]", name)]
            if len(within) == 1:
                self.units.setdefault(within[0], self.units[place])

    def like_shaft(self) -> list[str]:
        """Return the columns and numbers with name or unit of the motion of a shaft."""
        names = (*self.columns, *self.numbers)
        shafts = [name for name in names if is_shaft_name(name, self.units.get(name, ""))]
        return [name for name in shafts if not any(map(is_rate_name, name.split("_")))]  # as fs_rpm

    def find(self, wanted: str, *, numbers: bool = False) -> str:
        """Return the full name of a column (or of a number) that a layout names.

        Raises
        ------
        ValueError
            If there is none, or several match.
        """
        known = [*self.columns, *(self.numbers if numbers else ())]
        wanted = self.chosen(wanted)
        found = _matching(wanted, known)
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"{wanted!r} matches several columns: {found}. Name one.")
        plain = split_unit(wanted)[0]
        if plain in self.ignored:
            raise ValueError(f"{plain!r} {self.ignored[plain]}; store it as numbers, one per time.")
        other = next((name for name in known if not is_time_name(name)), wanted)
        raise ValueError(
            f"it has no column {wanted!r}; its columns are {known}. Where files differ, a "
            f"layout may give several names: {f'{wanted}|{other}'!r}."
        )

    def has(self, wanted: str) -> bool:
        """Tell whether a name of a layout is that of one column or number."""
        return len(_matching(wanted, [*self.columns, *self.numbers])) == 1

    def chosen(self, wanted: str) -> str:
        """Return the first of alternative names that the file has, or that is a constant speed.

        Examples
        --------
        >>> FileColumns({"x0": [0.0, 1.0]}).chosen("vibration|x0")
        'x0'
        """
        names = (wanted, *map(str.strip, wanted.split("|")))
        return next((name for name in names if self.has(name) or constant_speed(name)), wanted)


def _matching(wanted: str, known: Sequence[str]) -> list[str]:
    """Return the names that a name of a layout means, which may have wildcards and a unit."""
    plain = split_unit(wanted)[0]
    exact = [name for name in (wanted, plain) if name in known]
    found = exact[:1] or [name for name in known if fnmatchcase(name, plain)]
    return found or [name for name in known if re.split(r"[/.]", name)[-1] == plain]


def is_rate_name(name: str) -> bool:
    """Tell whether a name is that of a sampling rate."""
    return re.sub("[^a-z]", "", name.lower()) in _RATES


def missing_codes(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which samples are codes for missing values, far from all others.

    Parameters
    ----------
    values : ndarray of shape (n_times,)
        Finite numbers.

    Returns
    -------
    ndarray of shape (n_times,)

    Examples
    --------
    >>> missing_codes(np.array([0.5, -9999.0, 1.0]))
    array([False,  True, False])
    """
    # Limits of 16, 24 and 32 bits, nines, and beyond 1e18 fill values of netCDF, NaN of SCPI,
    # limits of floats and of 64 bits, which nothing that is measured has.
    codes = [2.0**bits - n for bits in (15, 16, 23, 31, 32) for n in (0, 1)]
    codes += [999.25, *(10.0**digits - 1 for digits in (2, 3, 4, 5, 6))]
    ends = np.abs([values.min(), values.max()], dtype=np.float64)
    if np.isin(ends, codes).any() or ends.max() > 1e18:
        sizes = np.abs(values.astype(np.float64))
        is_code = np.isin(sizes, codes) | (sizes > 1e18)
        others, stated = values[~is_code].astype(np.float64), values[is_code].astype(np.float64)
        if len(others):
            apart = np.maximum(others.min() - stated, stated - others.max())
            if apart.min() > 1.5 * np.ptp(others):
                return is_code
    return np.zeros(len(values), dtype=bool)


def no_channel(name: str, values: NDArray[Any]) -> str:
    """Say what a column is by its name and whole numbers: status or number of samples; else "".

    Examples
    --------
    >>> no_channel("vib_quality", np.array([192, 0])), no_channel("oil quality", np.ones(2) / 2)
    ('is named like a status of the samples', '')
    """
    is_number = values.dtype.kind in "biuf"
    if not is_number or not np.isfinite(values).all() or np.any(values != np.rint(values)):
        return ""
    if len(values) > 99 and (np.diff(values.astype(np.float64)) == 1).all():
        return "counts the samples"
    words = set(re.split(r"[^a-z]+", name.lower()))
    is_named = words & {"status", "state", "quality", "flag", "flags", "valid", "validity", "ok"}
    is_status = bool(is_named) and len(np.unique(values)) <= 16
    return "is named like a status of the samples" if is_status else ""


def without_signal(content: FileColumns) -> str:
    """Say what a file without any column contains."""
    rest = f"only {list(content.numbers)}" if content.numbers else "no array of numbers"
    reasons = [f"{name!r} {reason}" for name, reason in list(content.ignored.items())[:3]]
    return f"it contains no signal, {'; '.join([rest, *reasons])}. Store an array for each channel."
