"""Texts that are times: dates with a time of day, times of day, and durations, as seconds."""

import re
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

_DATE: Final = (
    r"(?:(?P<year>\d{4})[-/.](?P<month>\d\d?)[-/.](?P<day>\d\d?)"
    r"|(?P<first>\d\d?)(?P<sign>[-/.])(?P<second>\d\d?)[-/.](?P<late_year>\d{4}|\d\d)"
    r"|(?P<named_day>\d\d?)[- ](?P<name>[A-Za-z]{3})[A-Za-z]*[- ](?P<named_year>\d{4})"
    r"|(?P<basic>\d{8}(?=[T ]\d)))"
)
_CLOCK: Final = (
    r"(?P<hour>\d{1,2}):?(?P<minute>\d\d)(?::?(?P<whole>\d\d)(?:[.,:](?P<part>\d+))?)?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
)
_ZONE: Final = r"\s*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d)?"
_STAMP: Final = re.compile(rf"\s*(?:{_DATE})(?:(?:\s*[T,;_]\s*|\s+){_CLOCK}{_ZONE})?\s*")
_OF_DAY: Final = re.compile(
    r"\s*(?:(?P<days>\d+(?=\s*day)|\d{3}(?=:\d\d:\d\d:\d\d))(?:\s*days?,?\s*|:))?"  # IRIG: ddd:
    r"(?P<hour>\d{1,4}):(?P<minute>\d\d)"
    r"(?::(?P<whole>\d\d)(?:[.,:](?P<part>\d+))?)?"
    rf"\s*(?P<half>[AaPp]\.?[Mm]\.?)?{_ZONE}\s*"
)
_MINUTES: Final = re.compile(r"\s*(?P<minute>\d{1,4}):(?P<whole>\d\d)[.,](?P<part>\d+)\s*")
_MONTHS: Final = [
    "jan",
    "feb",
    "mar",
    "apr",
    "may",
    "jun",
    "jul",
    "aug",
    "sep",
    "oct",
    "nov",
    "dec",
]
_DAY: Final = 86400.0
#: A number of clock digits counts seconds, hundredths, milliseconds or microseconds.
_PARTS: Final = (1.0, 1e2, 1e3, 1e6)
#: Digits skipped from one minute to the next, less the rounding of a sum.
_ROLLED: Final = 39.9


def is_time(text: str) -> bool:
    """Return whether a text is a date, a time of day or a duration.

    >>> is_time("2024-03-12T14:22:10Z"), is_time("14:22:10.5"), is_time("12.5")
    (True, True, False)
    """
    return any(pattern.fullmatch(text) for pattern in (_STAMP, _MINUTES, _OF_DAY))


def seconds_of_texts(texts: "pd.Series[Any]") -> tuple[NDArray[np.float64], str] | None:
    """Return times (n,) [s] that texts say, and what they are in words; None where they say none.

    Dates count from 1970 in their own zone, else as UTC; times of day and durations from zero, and
    go on after midnight. Cells that say no time are NaN. Of ``03/12/2024`` the first number counts
    as the month where no cell excludes that; with dots it is the day.
    """
    sample = [str(each) for each in texts.dropna().head(50)]
    for pattern, what in (
        (_STAMP, "dates"),
        (_MINUTES, "minutes and seconds"),
        (_OF_DAY, "times of day"),
    ):
        if sample and sum(bool(pattern.fullmatch(each)) for each in sample) > 0.5 * len(sample):
            parts = texts.astype("string").str.extract(rf"^{pattern.pattern}$")
            seconds, said = _of_clock(parts), what
            if pattern is _STAMP:
                days, order = _days(parts)
                seconds = days * _DAY + np.nan_to_num(seconds)
                said = f"{what}{order}"
            elif pattern is _OF_DAY:
                seconds = _past_midnight(seconds)
            return (seconds, said) if np.isfinite(seconds).any() else None
    return None


def seconds_of_digits(values: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return times (n,) [s] of numbers whose digits are those of a clock, such as ``142210.5`` or
    ``142210500``; None for others.

    Such a number rises by 41 from the last second of a minute to the next: read as seconds, a log
    would have a gap of 40 s in every minute. Numbers that are as even as they stand are none:
    0, 50, 100 are milliseconds.

    >>> seconds_of_digits(np.array([145958.0, 145959.0, 150000.0, 150001.0]))
    array([53998., 53999., 54000., 54001.])
    """
    known = values[np.isfinite(values)]
    if known.size < 3 or known.min() < 0.0 or not np.all(np.diff(known) >= 0.0):
        return None
    for size in _PARTS:
        digits = values / size
        minute, second = digits // 100.0, digits % 100.0
        there = np.isfinite(digits)
        if digits[there].max() >= 240000.0 or not (minute[there] % 100.0 < 60.0).all():
            continue
        if not (second[there] < 60.0).all() or not np.any(np.diff(minute[there]) > 0.0):
            continue
        seconds = 3600.0 * (minute // 100.0) + 60.0 * (minute % 100.0) + second
        (usual, uneven), (as_digits, uneven_digits) = map(_steps, (seconds[there], digits[there]))
        if np.isclose(usual, as_digits) and uneven + _ROLLED < uneven_digits:
            return np.asarray(seconds, dtype=np.float64)
    return None


def _steps(times: NDArray[np.float64]) -> tuple[float, float]:
    """The usual step, and how much all differ from it, in sum."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    return usual, float(np.abs(steps - usual).sum())


def _column(parts: pd.DataFrame, name: str) -> NDArray[np.float64]:
    if name not in parts:
        return np.full(len(parts), np.nan)
    return np.asarray(
        pd.to_numeric(parts[name], errors="coerce").to_numpy(np.float64, na_value=np.nan)
    )


def _of_clock(parts: pd.DataFrame) -> NDArray[np.float64]:
    """Seconds of the time of day, its zone subtracted; NaN without one."""
    hour = _column(parts, "hour") if "hour" in parts else np.zeros(len(parts))
    whole = np.nan_to_num(_column(parts, "whole"))
    digits = parts["part"].fillna("").str.len().to_numpy(np.float64) if "part" in parts else 0.0
    part = np.nan_to_num(_column(parts, "part")) / 10.0 ** np.asarray(digits, np.float64)
    if "half" in parts:
        half = parts["half"].fillna("").str.lower().str[:1]
        is_half = half.isin(["a", "p"]).to_numpy(bool)
        hour = np.where(is_half, hour % 12 + 12 * (half == "p").to_numpy(bool), hour)
    minutes = 60.0 * hour + _column(parts, "minute")
    if "zone" in parts:
        zone = parts["zone"].fillna("").str.replace(":", "")
        sign = np.where(zone.str.startswith("-").to_numpy(bool), -1.0, 1.0)
        digits_of = pd.to_numeric(zone.str[1:], errors="coerce").to_numpy(np.float64, na_value=0.0)
        digits_of = np.nan_to_num(digits_of)
        minutes = minutes - sign * (digits_of // 100 * 60 + digits_of % 100)
    days = np.nan_to_num(_column(parts, "days"))
    return np.asarray(days * _DAY + minutes * 60.0 + whole + part, dtype=np.float64)


def _days(parts: pd.DataFrame) -> tuple[NDArray[np.float64], str]:
    """Days since 1970, and how the order of day and month was taken where the text leaves it
    open."""
    year, month, day = (_column(parts, each) for each in ("year", "month", "day"))
    first, second = _column(parts, "first"), _column(parts, "second")
    said = ""
    if np.isfinite(first).any():
        dotted = bool((parts["sign"] == ".").any())
        day_first = bool(np.nanmax(first) > 12 or (dotted and np.nanmax(second) <= 12))
        if not dotted and np.nanmax(first) <= 12 and np.nanmax(second) <= 12:
            said = " (the first number as the month)"
        late = _column(parts, "late_year")
        year = np.where(np.isnan(year), np.where(late < 100, late + 2000, late), year)
        month = np.where(np.isnan(month), second if day_first else first, month)
        day = np.where(np.isnan(day), first if day_first else second, day)
    named = parts["name"].fillna("").str.lower()
    number = named.map({text: k + 1.0 for k, text in enumerate(_MONTHS)}).to_numpy(np.float64)
    month = np.where(np.isnan(month), number, month)
    day = np.where(np.isnan(day), _column(parts, "named_day"), day)
    year = np.where(np.isnan(year), _column(parts, "named_year"), year)
    basic = _column(parts, "basic")
    year = np.where(np.isnan(year), basic // 10000, year)
    month = np.where(np.isnan(month), basic // 100 % 100, month)
    day = np.where(np.isnan(day), basic % 100, day)
    frame = pd.DataFrame({"year": year, "month": month, "day": day})
    dates = pd.to_datetime(frame, errors="coerce").to_numpy("datetime64[s]")
    days = dates.astype("datetime64[D]").astype(np.float64)
    return np.where(np.isnat(dates), np.nan, days), said


def _past_midnight(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times of day that go on after midnight instead of beginning again."""
    steps = np.diff(seconds, prepend=seconds[:1])
    return np.asarray(seconds + _DAY * np.cumsum(np.nan_to_num(steps) < -0.5 * _DAY), np.float64)
