"""Mistyped commands: they are refused, whoever typed them is told, and nothing waits to be retried
after them."""

from pathlib import Path

import pytest

from aerodb.flows.run import run_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.command import aerodb, asked
from tests.support.console_workspace import client_of
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME

#: A command with a mistake -> what is said of it. FLIGHT: a stored flight; FOLDER: of the files.
MISTYPED = {
    "close-loop --accept-suspected fooo": "no effect 'fooo' is known",
    "close-loop --flights nosuch": "unknown flight 'nosuch'",
    "close-loop --hold-out nosuch": "unknown flight 'nosuch'",
    "close-loop --measured nosuch=3": "'nosuch' in [measured]",
    "close-loop --library deadbeef": "not deadbeef",
    "close-loop --effects FOLDER/database.toml": "5 mistakes\nunknown key 'name'; known names: effect\nunknown",
    "close-loop --on-ground": "no parameter of the database acts on the ground",
    "update --model FOLDER/model.toml --hold-out nosuch": "unknown flight 'nosuch'",
    "update --model FOLDER/odd.toml": "no channel 'nosuch'",
    "estimate --model FOLDER/odd.toml": "no channel 'nosuch'",
    "estimate --model FOLDER/odd.toml --methods all": "no channel 'nosuch'",
    "version fly v0002 --flight FLIGHT --wind nosuch": "wind 'nosuch' is not known",
    "version fly v0002 --flight FLIGHT --from 9 --to 5": "no sample from 9 to 5 s",
    "version fly v0002 --manoeuvre FOLDER/model.toml": "manoeuvre: unknown key",
    "version validate v0002 --tolerances FOLDER/model.toml": "tolerances: has no [[check]]",
    "version tabulate v0002 --over nosuch=1:2:3": "'nosuch' is not an input",
    "version gate v0002 --accept nosuch": "nothing to accept under nosuch",
    "version promote v0002 --reason x --accept nosuch": "nothing to accept under nosuch",
    "version rollback --reason x --name nosuch": "'nosuch' has no version to go back to",
    "flight turbulence FLIGHT --form nosuch": "unknown form 'nosuch'",
    "flight turbulence FLIGHT --highest -1": "--highest: -1 Hz",
    "flight wake FLIGHT --from 1e4": "no sample from 10000",
    "flight frequency-response FLIGHT --input nosuch --output q": "no channel 'nosuch'",
    "flight ingest FOLDER/nosuch.csv": "No such file",
    "flight ingest FOLDER/flight1.csv --mapping nosuch": "unknown mapping 'nosuch'",
    "database import FOLDER/model.toml": "unknown key",
    "recalibrate --reason x --valid-from 2030-01-01 --valid-until 2020-01-01": "it ends before",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    """A workspace with flights and a candidate, beside a model whose term nobody knows."""
    made = tmp_path_factory.mktemp("refused")
    shared.updated(made / "w")
    (made / "odd.toml").write_text('[[increment]]\naxis = "CZ"\nterms = ["nosuch"]\n', "utf-8")
    for name in ("model.toml", "database.toml", "flight1.csv"):
        (made / name).write_bytes((shared.logs[0].parent / name).read_bytes())
    return made


@pytest.mark.parametrize("typed", MISTYPED)
def test_a_mistyped_command_is_refused_and_leaves_nothing_to_retry(
    folder: Path, typed: str
) -> None:
    flight = asked(folder / "w", "flight", "list")[0]["flight"]
    words = typed.replace("FLIGHT", flight).replace("FOLDER", str(folder)).split()
    done = aerodb(folder / "w", *words)
    assert done.returncode in (2, 3), done.stdout
    assert MISTYPED[typed] in done.stderr
    assert asked(folder / "w", "status")["failed"] == []


def test_a_refused_run_that_nobody_waited_for_is_listed(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """The same mistake in a run of the service, which tells nobody; and in one of the console."""
    workspace, _ = shared.updated(tmp_path / "w")
    with Catalogue.open(workspace.catalogue) as catalogue:
        flights = [row.id for row in catalogue.flights(NAME)]
        baseline = catalogue.version(NAME, "released").id
    given = {"vehicle": NAME, "baseline": baseline, "flights": flights, "hold_out": ["nosuch"]}
    with pytest.raises(LookupError, match="unknown flight"):
        run_flow(update_flow, {**given, "model": MODEL}, workspace, "direct")
    (listed,) = asked(workspace.root, "status")["failed"]
    assert "nosuch" in listed["error"]
    with client_of(workspace) as client:
        moved = {"name": "released", "reason": "x", "accept": ["nosuch"]}
        answer = client.post(f"/api/versions/v0002/promote?vehicle={NAME}", json=moved)
        assert answer.status_code >= 400
    assert asked(workspace.root, "status")["failed"] == [listed]
