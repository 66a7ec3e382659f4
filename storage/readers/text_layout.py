"""Layout of a text table: delimiter, header, units, title and closing lines, from its first lines.

Not guessed by a library: `csv.Sniffer` and `clevercsv` name a delimiter for quoted text, and know
neither decimal commas nor rows of units, titles, pipes and columns of blanks.
"""

import csv
import re
from collections import Counter
from dataclasses import dataclass
from itertools import accumulate
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.storage.readers.text_cells import is_filled_as_data, is_number
from aerodb.units import is_spelled

#: Lines of which the layout is learnt: titles of some tools are over a hundred lines long.
SAMPLE: Final = 500
#: Characters of these lines after which no more are looked at, beyond the first lines.
_SAMPLE_SIZE: Final = 100_000
_LEAST_LINES: Final = 50
#: Most closing lines without a number that are looked for.
_MOST_CLOSING: Final = 20
_DELIMITERS: Final = (";", "\t", "|", ",", " ")
SEP: Final = re.compile(rb'"?sep=(.)"?\s*', re.IGNORECASE)
_COMMENT: Final = "#%"
#: A line of these is a rule under a header.
_RULE: Final = "-=+:_"
#: What stands before a row of units in a comment.
_UNITS_ARE: Final = re.compile(r"^\s*units?\s*[:=]\s*", re.IGNORECASE)
#: Share of the names of a row that must be units, so that it is the row of units.
_LEAST_UNITS: Final = 0.5


@dataclass(frozen=True)
class Layout:
    """How a table is written.

    names : of the columns, None without a header. units : of the columns by number, '' where not
    stated. first : number of the first line of data, from 0. width : number of fields of a line.
    titles : number of lines above that are neither header nor comment. comma : whether more numbers
    have a decimal comma than a decimal point.
    """

    delimiter: str
    names: list[str] | None
    units: list[str]
    first: int
    width: int
    titles: int
    comma: bool


@dataclass(frozen=True)
class _Row:
    """A line of the sample, split at one delimiter."""

    line: int
    words: list[str]
    numbers: int
    comment: bool

    @property
    def filled(self) -> list[str]:
        return [word for word in self.words if word]


def text_layout(lines: list[bytes], where: str) -> Layout:
    """Return the layout of a table from its lines, of which the first are looked at.

    The delimiter is that which splits most lines into the same number of fields, most of which are
    numbers. Raises InputError for a header that does not fit the lines below it, and for a file
    without lines of numbers.
    """
    sizes = accumulate(len(line) for line in lines[:SAMPLE])
    enough = sum(k < _LEAST_LINES or size < _SAMPLE_SIZE for k, size in enumerate(sizes))
    sample = [_decoded(line) for line in lines[:enough]]
    skipped, only = 0, ""
    if sample and (sep := SEP.fullmatch(lines[0])):
        skipped, only = 1, sep[1].decode("latin-1")
    best: tuple[tuple[float, ...], str, list[_Row], list[_Row]] | None = None
    for order, delimiter in enumerate((only,) if only else _DELIMITERS):
        rows = [_row(k, text, delimiter) for k, text in enumerate(sample) if k >= skipped]
        rows = [row for row in rows if any(word.strip(_RULE) for word in row.filled)]
        for least in (0.5, 1e-9):
            data = [r for r in rows if not r.comment and r.numbers > least * len(r.filled) - 1e-9]
            while data and _is_units(data[0]) and not any(map(_has_digits, data[0].filled)):
                data = data[1:]  # dashes where there is no unit
            if data:
                break
        widths = Counter(len(row.words) for row in data)
        if not widths:
            continue
        width = max(widths, key=lambda w: (widths[w], w))
        alike = [row for row in data if len(row.words) == width]
        share = sum(row.numbers for row in alike) / sum(len(row.filled) for row in alike)
        found = sum(row.numbers >= 0.5 * len(row.filled) for row in alike)
        # one column of numbers with decimal commas is rarer than a line that does not fit
        score = (
            found * (1.0 if width > 1 else 0.5),
            round(share, 3),
            float(width > 1),
            -float(order),
        )
        if best is None or score > best[0]:
            best = (score, delimiter, rows, alike)
    if best is None:
        raise _without_numbers(sample[skipped:], where)
    return _with_header(best[2], best[3], best[1], where)


def _decoded(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def words_of(text: str, delimiter: str) -> list[str]:
    """Return the words of a line; quotes hold delimiters, and pipes at its ends are its frame."""
    if delimiter == " ":
        return text.split()
    if delimiter == "|":
        text = text.strip().removeprefix("|")
    if '"' not in text:
        return [word.strip() for word in text.split(delimiter)]
    return [
        word.strip()
        for word in next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
    ]


def _row(line: int, text: str, delimiter: str) -> _Row:
    comment = text.lstrip()[:1] in tuple(_COMMENT)
    words = words_of(
        _UNITS_ARE.sub("", text.lstrip(_COMMENT + " ")) if comment else text, delimiter
    )
    return _Row(line, words, sum(bool(w) and is_filled_as_data(w) for w in words), comment)


def _without_numbers(sample: list[str], where: str) -> InputError:
    """The refusal of a file of which no line holds a number."""
    filled = [text for text in sample if text.strip() and text.strip()[0] not in _COMMENT]
    if len(filled) < 2:
        what = "the file contains no rows of numbers"
        return InputError(what, where, "check that the log was written to its end")
    return InputError(
        "no column contains numbers", where, "check the delimiter and the decimal sign"
    )


def _with_header(rows: list[_Row], data: list[_Row], delimiter: str, where: str) -> Layout:
    """The layout with the names above the first row of data."""
    first, width = data[0], len(data[0].words)
    trails = width > 1 and not any(row.words[-1] for row in data)
    above = [row for row in rows if row.line < first.line]
    named = [row for row in above if _fits(row, width, trails) and _is_words(row)]
    units, names, header = [""] * width, None, []
    if named:
        header = _adjacent(named)
        of_units = sorted(filter(_is_units, header), key=_units_share, reverse=True)
        others = [row for row in header if row not in of_units[:1]]
        if len(header) > 1 and of_units and others:
            units = _padded(of_units[0].words, width)
            group = [row for row in named if row.line == header[0].line - 1]
            names = _joined([*group, others[-1]], width)
            header = [*group, of_units[0], others[-1]]
        elif header[-1].comment and not all(row.comment for row in header):
            names = _padded([row for row in header if not row.comment][-1].words, width)
        else:
            names = _joined(header, width)
    elif above and not above[-1].comment and len(above[-1].words) > 1 and delimiter != " ":
        row = above[-1]
        what = f"line {first.line + 1} has {width} fields, {len(row.words)} were expected"
        raise InputError(what, where, "repair that line, or quote texts that contain the delimiter")
    used = {row.line for row in header}
    titles = sum(row.line not in used and not row.comment for row in above)
    cells = [word for row in rows if row.line >= first.line for word in row.words]
    commas = sum("," in word and is_number(word) for word in cells)
    dots = sum("." in word and is_number(word) for word in cells)
    return Layout(delimiter, names, units, first.line, width, titles, commas > dots)


def _fits(row: _Row, width: int, trails: bool) -> bool:
    """Whether a row has a name for each field; lines or names may end with a delimiter."""
    own = len(row.words)
    return own == width or own == width - trails or (own == width + 1 and not row.words[-1])


def _is_words(row: _Row) -> bool:
    """Whether more than half of the words are not numbers: one damaged number makes no header."""
    return sum(not _has_digits(word) for word in row.filled) > 0.5 * len(row.filled)


def _has_digits(word: str) -> bool:
    """Whether a word is a number or a time, and no mark of nothing."""
    return is_filled_as_data(word) and any(each.isdigit() for each in word)


def _is_units(row: _Row) -> bool:
    return _units_share(row) >= _LEAST_UNITS and any(set(row.filled) - {"-"})


def _units_share(row: _Row) -> float:
    """Share of the words that are units."""
    return float(np.mean([is_spelled(word.strip("[]() ")) for word in row.filled]))


def _adjacent(named: list[_Row]) -> list[_Row]:
    """The last rows of names: at most two, of which the upper stands directly above the lower, and
    of as many words."""
    last = named[-1]
    upper = [row for row in named[:-1] if row.line == last.line - 1]
    alike = [row for row in upper if len(row.words) == len(last.words)]
    if alike and last.comment and not (_is_units(alike[0]) or _is_units(last)):
        return [last]  # above is a remark
    return [*alike, last]


def _joined(header: list[_Row], width: int) -> list[str]:
    """Names of columns; of two lines, the lower where its names differ, else both with a blank."""
    lower = _padded(header[-1].words, width)
    filled = [name for name in lower if name]
    if len(header) == 1 or header[0].comment or len(set(filled)) == len(filled) == width:
        return lower
    above = _padded(header[0].words, width)
    if len(set(filled)) == len(filled) and all(
        a for a, b in zip(above, lower, strict=True) if not b
    ):
        return [b or a for a, b in zip(above, lower, strict=True)]
    upper, last = [], ""
    for word in above:
        last = word or last
        upper.append(last)
    return [f"{a} {b}".strip() for a, b in zip(upper, lower, strict=True)]


def _padded(words: list[str], width: int) -> list[str]:
    return [*words[:width], *[""] * (width - len(words))]


def closing_lines(body: bytes, layout: Layout) -> int:
    """Return where in the data the last lines begin that hold no number, its length without any."""
    begin = end = len(body)
    for _ in range(_MOST_CLOSING):
        start = body.rfind(b"\n", 0, max(end - 1, 0)) + 1
        words = words_of(_decoded(body[start:end]).strip("\n"), layout.delimiter)
        if start == end or any(word and is_filled_as_data(word) for word in words):
            break
        begin, end = start if any(words) else begin, start
    return begin
