"""JSON Schemas of the commands' answers, against real answers."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from aerodb.errors import UnknownNameError
from aerodb.flows.answers import ANSWERS, schema_of
from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.command import aerodb, asked, commands, document, of_schema
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import DATABASE, NAME, VEHICLE

STEADY = ("--speed", "25", "--altitude", "0", "--glide")
MANOEUVRE = """\
duration = 2.0
[trim]
V = "25 m/s"
altitude = 0.0
glide = true
[[input]]
target = "delta_elevator"
shape = "step"
start = 0.5
amplitude = "1 deg"
"""
LINEAR = """\
[flight]
mass = "20 kg"
Ixx = 1.6
Iyy = 7.5
Izz = 7.2
Ixz = -0.5
area = 1.37
chord = 0.76
span = 1.96
pressure = 1050
V = 42
[derivatives]
Lp = [-5.5, 0.3]
Np = -1.6
"""
EXPANDED = ("--variable", "V", "--from", "25", "--to", "23", "--step", "1", "--growth-rate", "10")
DESIGNED = ("--limit", "alpha=-2deg:9deg", "--duration", "10")
#: Commands whose answers are checked where the tests have what they need.
ELSEWHERE = {
    "demo",
    "estimate-online",
    "version back-out",
    "store push",
    "store pull",
    "store trim",
}
SWEPT = ("--variable", "V", "--from", "24", "--to", "26", "--steps", "2")


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> dict[str, Any]:
    """Command -> what it answers about the small glider after an update."""
    place = tmp_path_factory.mktemp("schemas")
    workspace, log = place / "workspace", str(shared.logs[0])
    shared.updated(workspace)
    flight = asked(workspace, "flight", "list")[0]["flight"]
    model = str(Path(log).parent / "model.toml")
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
        "version design": ("released", *STEADY, "--model", model, *DESIGNED),
        "version tabulate": ("released", "--over", "alpha=-2deg:8deg:3", "--at", "V=25"),
        "update": ("--vehicle", NAME, "--model", model, "--direct"),
        "close-loop": ("--vehicle", NAME, "--direct"),
        "status": (),
    }
    found = {name: asked(workspace, *name.split(), *more) for name, more in arguments.items()}
    found |= kept_answers(place, workspace, log, flight)
    moves = {
        "version lineage": ("candidate",),
        "version export": ("candidate", "--format", "csv", "--output", str(place / "v.csv")),
        "version expand": ("candidate", *STEADY, *EXPANDED),
        "version promote": ("candidate", "--reason", "proved"),
        "version rollback": ("--reason", "not yet"),
    }
    gate = aerodb(workspace, "--json", "version", "gate", "candidate")  # exits with 1 if it refuses
    found["version gate"] = document(gate.stdout)
    found |= {name: asked(workspace, *name.split(), *more) for name, more in moves.items()}
    return found | flown_answers(place / "flown", shared)


def kept_answers(place: Path, workspace: Path, log: str, flight: str) -> dict[str, Any]:
    """What commands answer that keep, check or note something."""
    page, copy, other = (str(place / each) for each in ("v.html", "copy", "other"))
    vehicle, database = place / "vehicle.toml", place / "database.toml"
    vehicle.write_text(VEHICLE.replace(f'"{NAME}"', '"second"'), encoding="utf-8")
    database.write_text(DATABASE, encoding="utf-8")
    (place / "linear.toml").write_text(LINEAR, encoding="utf-8")
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        run = catalogue.start_run("update_flow", how="direct", parameters={"vehicle": NAME}).id
        catalogue.end_run(run, "failed", "no room on the disk")
    mine = ("--vehicle", NAME)
    of_version = ("report", "version", "candidate", *mine, "--output", page)
    found = {
        "retry": asked(workspace, "retry", flight, "--direct"),
        "dismiss": asked(workspace, "dismiss", run, "--reason", "a larger disk is in"),
        "version tag": asked(workspace, "version", "tag", "candidate", "flown", *mine),
        "version comment": asked(workspace, "version", "comment", "candidate", "good", *mine),
        "report flight": asked(workspace, "report", "flight", flight, "--output", page),
        "report update": asked(workspace, "report", "update", "candidate", *mine, "--output", page),
        "report version": asked(workspace, *of_version),
        "mapping init": asked(workspace, "mapping", "init", log, "--output", str(place / "m.toml")),
        "verify": asked(workspace, "verify"),
        "nightly": asked(workspace, "nightly", "--direct"),
        "derivatives": asked(workspace, "derivatives", str(place / "linear.toml")),
        "backup": asked(workspace, "backup", copy),
    }
    found["restore"] = asked(Path(other), "restore", copy)
    spare = Path(other)
    found |= {
        "vehicle add": asked(spare, "vehicle", "add", str(vehicle)),
        "database import": asked(spare, "database", "import", str(database), "--vehicle", "second"),
        "flight retract": asked(spare, "flight", "retract", flight, "--reason", "pitot cover"),
        "user add": asked(spare, "user", "add", "anna", "--role", "release"),
    }
    found |= {
        "user list": asked(spare, "user", "list"),
        "user token": asked(spare, "user", "token", "anna"),
        "user remove": asked(spare, "user", "remove", "anna"),
    }
    return found


def flown_answers(place: Path, shared: SharedWorkspaces) -> dict[str, Any]:
    """The same of commands that need a flight with attitude: the glider of the guide."""
    workspace, files = place / "w", shared.guide
    log, model = str(files / "flight-1.ulg"), place / "model.toml"
    vehicle = ("--vehicle", "my-glider")
    asked(workspace, "vehicle", "add", str(files / "my-glider.toml"))
    asked(workspace, "database", "import", str(files / "handbook.toml"), *vehicle)
    model.write_text('[[increment]]\naxis = "CZ"\nterms = ["1", "alpha"]\n', encoding="utf-8")
    ask = ("flight", "frequency-response", "flight-1", "--input", "delta_elevator", "--output", "q")
    flown = ("released", "--flight", "flight-1")
    drafted = ("--json", "vehicle", "init", "third")
    return {
        "vehicle init": document(aerodb(workspace, *drafted, folder=place).stdout),
        "flight ingest": asked(workspace, "flight", "ingest", log, *vehicle, "--direct"),
        "flight frequency-response": asked(workspace, *ask),
        "flight wake": asked(workspace, "flight", "wake", "flight-1", "--to", "10"),
        "flight turbulence": asked(workspace, "flight", "turbulence", "flight-1"),
        "estimate": asked(workspace, "estimate", *vehicle, "--model", str(model)),
        "version fly": asked(workspace, "version", "fly", *flown),
        "version validate": document(
            aerodb(workspace, "--json", "version", "validate", *flown, "--against", "none").stdout
        ),
        "recalibrate": asked(workspace, "recalibrate", *vehicle, "--reason", "r", "--direct"),
        "calibration list": asked(workspace, "calibration", "list", *vehicle),
        "calibration show": asked(workspace, "calibration", "show", "c0001", *vehicle),
    }


@pytest.mark.parametrize("command", [each for each in ANSWERS if each not in ELSEWHERE])
def test_a_real_answer_is_of_its_schema(answers: dict[str, Any], command: str) -> None:
    of_schema(command, answers[command])


def test_every_command_that_answers_has_a_schema() -> None:
    def names(command: Any, path: tuple[str, ...] = ()) -> Iterator[str]:
        for word, below in getattr(command, "commands", {}).items():
            yield from names(below, (*path, word))
        if not hasattr(command, "commands"):
            yield " ".join(path)

    assert set(names(commands())) - set(ANSWERS) == {"serve", "web", "schema"}


def test_a_schema_refuses_an_answer_that_lacks_a_key(answers: dict[str, Any]) -> None:
    lacking = {k: v for k, v in answers["version trim"].items() if k != "channels"}
    with pytest.raises(jsonschema.ValidationError, match="channels"):
        jsonschema.validate(lacking, schema_of("version trim"))


def test_a_refused_log_and_a_described_manoeuvre_are_of_their_schemas(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace = shared.prepared(tmp_path / "w").root
    torn = tmp_path / "torn.csv"
    torn.write_text("no,numbers\nhere,at all\n", encoding="utf-8")
    refused = aerodb(workspace, "--json", "flight", "ingest", str(torn), "--direct")
    assert refused.returncode == 3
    answer = document(refused.stdout)
    assert answer[0]["flight"] is None
    of_schema("flight ingest", answer)
    file = tmp_path / "doublet.toml"
    file.write_text(MANOEUVRE, encoding="utf-8")
    of_schema(
        "version fly", asked(workspace, "version", "fly", "released", "--manoeuvre", str(file))
    )


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
