"""What a command prints on a terminal of a given width."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app

#: Most lines of a command until the answer, on a terminal of so many columns.
MOST_LINES, NARROW = 5, 80
_STYLE = re.compile(r"\x1b\[[0-9;]*m")


def on_terminal(workspace: Path, columns: int, *words: str) -> tuple[int, list[str]]:
    """Exit code and lines of a command on a terminal of so many columns."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FORCE_COLOR", "1")
        patch.setenv("COLUMNS", str(columns))
        done = CliRunner().invoke(app, ["--workspace", str(workspace), *words])
    return done.exit_code, plain(done.stdout).splitlines()


def plain(text: str) -> str:
    """What was printed, without its style."""
    return _STYLE.sub("", text)


def answered(workspace: Path, words: tuple[str, ...], *answers: str, code: int = 0) -> list[str]:
    """The lines of a command; each answer (regular expression) stands in its first lines, where a
    narrow terminal may have divided it."""
    ended, lines = on_terminal(workspace, NARROW, *words)
    assert ended == code, lines
    first = lines[:MOST_LINES]
    for answer in answers:
        read = (" ".join(map(str.strip, first[: k + 1])) for k in range(len(first)))
        places = [k for k, text in enumerate(read, 1) if re.search(answer, text)]
        assert places, (answer, "\n".join(first))
        print(f"{' '.join(w for w in words[:2] if w[0] != '-')}: {answer!r} by line {places[0]}")
    return lines
