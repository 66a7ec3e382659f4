"""JSON Schemas of the commands' answers, against real answers."""

from pathlib import Path
from typing import Any

import jsonschema
import pytest

from aerodb.errors import UnknownNameError
from aerodb.flows.answers import ANSWERS, schema_of
from tests.support.command import aerodb, asked, document
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

STEADY = ("--speed", "25", "--altitude", "0", "--glide")
SWEPT = ("--variable", "V", "--from", "24", "--to", "26", "--steps", "2")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> dict[str, Any]:
    """Command -> what it answers about the small glider after an update."""
    place = tmp_path_factory.mktemp("schemas")
    workspace, log = place / "workspace", str(shared.logs[0])
    shared.updated(workspace)
    flight = asked(workspace, "flight", "list")[0]["flight"]
    arguments: dict[str, tuple[str, ...]] = {
        "vehicle list": (),
        "vehicle show": (NAME,),
        "database inputs": ("released",),
        "log inspect": (log,),
        "log show": (log, "--output", str(place / "log.html")),
        "flight list": (),
        "flight show": (flight,),
        "flight compare": (flight, "candidate"),
        "version list": (),
        "version show": ("candidate",),
        "version history": (),
        "version impact": (flight,),
        "version diff": ("v0001", "candidate"),
        "version evaluate": ("candidate", "--at", "alpha=2deg"),
        "version trim": ("candidate", *STEADY),
        "version modes": ("candidate", *STEADY),
        "version sweep": ("candidate", *STEADY, *SWEPT),
        "update": ("--vehicle", NAME, "--model", str(Path(log).parent / "model.toml"), "--direct"),
        "close-loop": ("--vehicle", NAME, "--direct"),
        "status": (),
    }
    found = {name: asked(workspace, *name.split(), *more) for name, more in arguments.items()}
    gate = aerodb(workspace, "--json", "version", "gate", "candidate")  # exits with 1 if it refuses
    return {**found, "version gate": document(gate.stdout)}


@pytest.mark.parametrize("command", list(ANSWERS))
def test_a_real_answer_is_of_its_schema(answers: dict[str, Any], command: str) -> None:
    schema = schema_of(command)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(answers[command], schema)


def test_a_schema_refuses_an_answer_that_lacks_a_key(answers: dict[str, Any]) -> None:
    lacking = {k: v for k, v in answers["version trim"].items() if k != "channels"}
    with pytest.raises(jsonschema.ValidationError, match="channels"):
        jsonschema.validate(lacking, schema_of("version trim"))


def test_the_command_prints_a_schema_and_names_those_that_there_are(tmp_path: Path) -> None:
    printed = document(aerodb(tmp_path / "none", "schema", "version", "trim").stdout)
    assert printed == schema_of("version trim")
    assert printed["title"] == "aerodb version trim --json"
    assert aerodb(tmp_path / "none", "schema").stdout.splitlines() == list(ANSWERS)
    unknown = aerodb(tmp_path / "none", "schema", "version", "trm")
    assert unknown.returncode == 2
    assert "did you mean 'version trim'?" in unknown.stderr
    with pytest.raises(UnknownNameError):
        schema_of("web")
