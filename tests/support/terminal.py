"""What a command prints on a terminal of a given width."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app

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
