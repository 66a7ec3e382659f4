"""TOML from people and from strangers: no text stops the program or takes its memory."""

import re
import tomllib
from typing import Any, Final

from aerodb.errors import InputError

#: Most characters of a text: far more than any file of this program needs, as are the next two.
MOST_CHARACTERS: Final = 50_000_000
#: Most parts of a dotted key: tomllib takes memory with their square.
MOST_PARTS: Final = 64
#: Most arrays and tables inside each other: tomllib recurses into values.
DEEPEST: Final = 64
#: Most characters of a line that an error quotes: a name and the beginning of its value.
_BEGINNING: Final = 40
_LINE: Final = re.compile(r"at line (\d+),")
_PART: Final = r"(?:[A-Za-z0-9_-]++|\"[^\"\n]*+\"|'[^'\n]*+')"
_LONG_KEY: Final = re.compile(
    rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{MOST_PARTS},}}+"
)


def _line_of(error: ValueError, text: str) -> str:
    """How the line of the text begins that an error names; empty where it names none."""
    named = _LINE.search(str(error))
    lines = text.splitlines()
    if named is None or not 0 < int(named[1]) <= len(lines):
        return ""
    return f"line {named[1]} begins with: {lines[int(named[1]) - 1].strip()[:_BEGINNING]}"


def parsed_toml(text: str, where: str) -> dict[str, Any]:
    """Return the document of a TOML text.

    Raises InputError for text that is not TOML, is too long, or nests too deeply.

    Limits: `MOST_CHARACTERS`, `MOST_PARTS`, `DEEPEST`.
    """
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"{len(text)} characters", where, f"at most {MOST_CHARACTERS}")
    key = _LONG_KEY.search(text)
    if key is not None:
        line = text.count("\n", 0, key.start()) + 1
        raise InputError(f"a key of more than {MOST_PARTS} parts in line {line}", where)
    try:
        document = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"values nest deeper than {DEEPEST} levels", where) from error
    except ValueError as error:  # also a number of more digits than Python reads
        raise InputError(f"not valid TOML: {error}", where, _line_of(error, text)) from error
    layer: list[Any] = [document]
    for _ in range(DEEPEST):
        inside = [
            item
            for value in layer
            if isinstance(value, (dict, list))
            for item in (value.values() if isinstance(value, dict) else value)
            if isinstance(item, (dict, list))
        ]
        if not inside:
            return document
        layer = inside
    raise InputError(f"values nest deeper than {DEEPEST} levels", where)
