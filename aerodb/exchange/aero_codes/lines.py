"""Text files of aerodynamic codes: lines that know their file and number, numbers as Fortran writes
them."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NoReturn

from aerodb.errors import InputError

#: Longest file that is read as text of a code; the largest polars have some hundred kilobytes.
MAX_BYTES: Final = 20_000_000
_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+|[+-]\d+)?")
_SHORT: Final = re.compile(r"(.*\d\.?\d*)([+-]\d+)")


@dataclass(frozen=True)
class Line:
    """A line of a text: its file, its number from 1, and its text."""

    file: str
    number: int
    text: str

    @property
    def where(self) -> str:
        return f"{self.file}, line {self.number}"

    def refuse(self, what: str, remedy: str = "write the file again with the code") -> NoReturn:
        """Raise InputError at this line."""
        raise InputError(what, self.where, remedy)

    def value(self, text: str, name: str) -> float:
        """Return a number of this line, as Fortran or C writes it (``1.5D-3``, ``1.5-103``).

        Raises InputError for asterisks (a number wider than its field) and anything not finite.
        """
        plain = text.strip().replace("\N{MINUS SIGN}", "-")
        if plain and not plain.strip("*"):
            self.refuse(f"{name} is '{plain}': the number was too wide for its field")
        if _NUMBER.fullmatch(plain) is None:
            self.refuse(f"{name} is '{plain[:40]}', which is no number")
        plain = plain.upper().replace("D", "E")
        short = None if "E" in plain else _SHORT.fullmatch(plain)
        number = float(f"{short[1]}E{short[2]}" if short else plain)
        if not math.isfinite(number):
            self.refuse(f"{name} is '{text.strip()[:40]}', which is not finite")
        return number

    def values(self, names: Sequence[str]) -> dict[str, float]:
        """Return one number per name from columns that blanks or commas separate. Raises InputError
        for another count."""
        cells = [cell for cell in re.split(r"[\s,;]+", self.text.strip()) if cell]
        if len(cells) != len(names):
            self.refuse(f"{len(cells)} columns below a header of {len(names)}")
        return {name: self.value(cell, name) for name, cell in zip(names, cells, strict=True)}


def lines_of(files: Sequence[tuple[str, bytes]]) -> Iterator[Line]:
    """Iterate over the lines of files (name, content). Raises InputError for a file that is no text
    or longer than `MAX_BYTES`."""
    for name, data in files:
        if len(data) > MAX_BYTES:
            raise InputError(f"{len(data)} bytes", name, f"at most {MAX_BYTES}")
        if b"\0" in data:
            raise InputError("not a text", name, "give the text file that the code writes")
        text = data.decode("utf-8-sig", "replace")
        for number, line in enumerate(text.splitlines(), 1):
            yield Line(name, number, line)
