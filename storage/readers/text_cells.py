"""Cells of text tables as numbers: decimal commas, thousands, exponents of Fortran, the minus sign
of typography, units behind numbers, dates and durations."""

import re
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from aerodb.storage.readers.text_times import is_time, seconds_of_texts
from aerodb.units import is_spelled

_NUMBER: Final = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?")
_THOUSANDS: Final = re.compile(r"[+-]?\d{1,3}(([.' \u00a0\u202f]\d{3})+(,\d+)?|(,\d{3})+(\.\d+)?)")
_NOTHING: Final = frozenset(
    ["nan", "na", "n/a", "null", "none", "inf", "infinity", "-inf", "+inf", "-", "--", "#n/a"]
)
#: Longest cell that is looked at as a number.
_LONGEST: Final = 64
_WITH_UNIT: Final = re.compile(
    r"\s*([+-]?[\d.,]*\d(?:[eE][+-]?\d+)?)\s*([^\d\s.,;:/+-][^\d;:]*?)\s*"
)
_MINUSES: Final = str.maketrans({"\u2212": "-", "\u2013": "-", "\ufe63": "-", "\uff0d": "-"})
_TRUTHS: Final = {"true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0, "on": 1.0, "off": 0.0}
#: Share of the filled cells of a column that must be numbers, so that the column is one of numbers.
LEAST_NUMBERS: Final = 0.5


@dataclass(frozen=True)
class Cells:
    """A column of numbers (n,), NaN where a cell is none; its unit where the cells state it; how
    its texts were read, '' for plain numbers."""

    values: NDArray[np.float64]
    unit: str = ""
    read_as: str = ""
    is_time: bool = False


def is_number(cell: str) -> bool:
    """Return whether a cell is a number as any tool writes it, or says that there is none.

    >>> is_number("-1.5D+02"), is_number("1.234,5"), is_number("\\u22129,81"), is_number("alpha")
    (True, True, True, False)
    """
    text = cell.strip().translate(_MINUSES)
    return len(text) <= _LONGEST and (
        _NUMBER.fullmatch(text) is not None
        or _THOUSANDS.fullmatch(text) is not None
        or text.lower() in _NOTHING
    )


def is_filled_as_data(cell: str) -> bool:
    """Return whether a cell is a number, a date, a time of day or a number with its unit."""
    if len(cell) > _LONGEST:
        return False
    if is_number(cell) or is_time(cell):
        return True
    found = _WITH_UNIT.fullmatch(cell)
    return found is not None and is_spelled(found[2])


def numbers_of(series: "pd.Series[Any]", comma: bool) -> Cells | None:
    """Return a column of a table as numbers; None where it holds text or nothing.

    comma : whether a comma in the file's numbers is the decimal sign, where a cell leaves it open.

    >>> numbers_of(pd.Series(["1,5", "2,25"]), True).values
    array([1.5 , 2.25])
    """
    plain = pd.to_numeric(series, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    filled = series.notna().to_numpy(dtype=bool)
    if not filled.any():
        return None
    bad = filled & np.isnan(plain)
    if not bad.any() or series.dtype.kind in "fiub":
        return Cells(plain) if np.isfinite(plain).any() else None
    texts = series.astype("string").str.strip()
    texts = texts.mask(texts.str.lower().isin(list(_NOTHING)))
    filled = texts.notna().to_numpy(dtype=bool)
    found = Cells(plain)
    for attempt in (_written_otherwise, _times, _truths, _with_units):
        if np.isnan(found.values[filled]).sum() == 0:
            break
        other = attempt(texts, comma)
        if other and np.isfinite(other.values).sum() > np.isfinite(found.values).sum():
            found = other
    good = np.isfinite(found.values)
    is_text = filled.any() and good.sum() < LEAST_NUMBERS * filled.sum()
    return found if good.any() and not is_text else None


def _written_otherwise(texts: "pd.Series[Any]", comma: bool) -> Cells:
    """Numbers with decimal commas, thousands, exponents of Fortran and other minus signs."""
    plain = texts.str.translate(_MINUSES)
    plain = plain.str.replace(r"(?<=[\d.,])[dD](?=[+-]?\d)", "e", regex=True)
    both = plain.str.contains(r"\..*,|,.*\.", regex=True).fillna(False)
    comma_last = bool((both & (plain.str.rfind(",") > plain.str.rfind("."))).any())
    open_ = plain.str.fullmatch(r"[+-]?\d{1,3}(?:,\d{3})+").fillna(False)
    has_comma = plain.str.contains(",", regex=False).fillna(False)
    several = plain.str.count(",").fillna(0) > 1
    decimal = comma_last or (
        not (both.any() or several.any()) and (comma or bool((has_comma & ~open_).any()))
    )
    if decimal:
        plain = plain.str.replace(r"(?<=\d)[.' \u00a0\u202f](?=\d{3})", "", regex=True)
        plain = plain.str.replace(",", ".", regex=False)
    else:
        plain = plain.str.replace(r"(?<=\d)[,' \u00a0\u202f](?=\d{3})", "", regex=True)
    values = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    only_open = bool(open_.any()) and not bool((has_comma & ~open_).any()) and not both.any()
    said = ""
    if only_open and not several.any():
        said = f"a comma taken as the {'decimal sign' if decimal else 'mark of thousands'}"
    return Cells(values, read_as=said)


def _times(texts: "pd.Series[Any]", comma: bool) -> Cells | None:
    found = seconds_of_texts(texts)
    return None if found is None else Cells(found[0], "s", f"{found[1]} as seconds", True)


def _truths(texts: "pd.Series[Any]", comma: bool) -> Cells:
    lower = texts.str.lower()
    values = lower.map(_TRUTHS).to_numpy(dtype=np.float64, na_value=np.nan)
    return Cells(np.asarray(values, np.float64), read_as="true as 1, false as 0")


def _with_units(texts: "pd.Series[Any]", comma: bool) -> Cells | None:
    """Numbers with one unit behind all of them."""
    parts = texts.str.extract(rf"^{_WITH_UNIT.pattern}$")
    units = parts[1].dropna().unique()
    if len(units) != 1 or not is_spelled(str(units[0])):
        return None
    inner = _written_otherwise(parts[0], comma)
    return Cells(inner.values, str(units[0]), inner.read_as)
