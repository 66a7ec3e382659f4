"""How tests call the command line: as a process of its own, or through the runner of the library
that it is made with."""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import typer
from typer.testing import CliRunner

from aerodb.flows.answers import schema_of
from aerodb.flows.cli.main import app
from tests.support.forking import run_forked
from tests.support.paths import ROOT

_DIRECT = "--direct"


@cache
def commands() -> Any:
    """The tree of commands."""
    return typer.main.get_command(app)


def directly(arguments: tuple[str, ...]) -> list[str]:
    """The arguments with ``--direct`` where the command knows it: the start of Prefect's server
    costs five times the processor time of the flight. Guides are followed as they are typed, and
    what Prefect does is the subject of tests of its own."""
    place = commands()
    for number, word in enumerate(arguments):
        place = getattr(place, "commands", {}).get(word, place)
        if any(_DIRECT in option.opts for option in place.params) and _DIRECT not in arguments:
            return [*arguments[: number + 1], _DIRECT, *arguments[number + 1 :]]
    return list(arguments)


def aerodb(
    workspace: Path, *arguments: str, folder: Path | None = None, under_prefect: bool = False
) -> subprocess.CompletedProcess[str]:
    """The command as the shell runs it: in a process of its own, forked where the system forks;
    without Prefect (`directly`) unless `under_prefect`."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AERODB_")}
    environment = {**kept, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    given = ["--workspace", str(workspace), *(arguments if under_prefect else directly(arguments))]
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
    """The JSON answer of a command, through the runner and without Prefect (`directly`)."""
    given = ["--workspace", str(workspace), "--json", *directly(arguments)]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, (arguments, result.stderr, result.exception)
    return document(result.stdout)


def of_schema(command: str, answer: Any) -> Any:
    """The answer of a command; fails where it is not of the command's JSON Schema."""
    schema = schema_of(command)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(answer, schema)
    return answer
