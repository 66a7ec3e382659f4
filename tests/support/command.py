"""How tests call the command line: as a process of its own, or through the runner of the library
that it is made with."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from tests.support.forking import run_forked
from tests.support.paths import ROOT


def aerodb(
    workspace: Path, *arguments: str, folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """The command as the shell runs it: in a process of its own, forked where the system forks."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AERODB_")}
    environment = {**kept, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    given = ["--workspace", str(workspace), *arguments]
    if hasattr(os, "fork"):
        return run_forked(given, environment, folder)
    command = [sys.executable, "-c", "from aerodb.flows.cli import main; main()", *given]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=folder, timeout=600
    )


def document(text: str) -> Any:
    """The one JSON document that `text` is; fails on anything beside it and on numbers that JSON
    does not know."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def asked(workspace: Path, *arguments: str) -> Any:
    """The JSON answer of a command, through the runner."""
    result = CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *arguments])
    assert result.exit_code == 0, (arguments, result.stderr, result.exception)
    return document(result.stdout)
