"""A closed loop over long flights gives the same in a process that is forked for each core."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.workspace_settings import FILE
from aerodb.tasks.steps import close_loop
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

#: What differs between two runs.
OWN = ("run", "page", "report", "candidate", "label", "created_utc")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    return shared.ingested(tmp_path_factory.mktemp("made") / "w").root


def closed(made: Path, workspace: Path, flights: int, settings: str = "") -> dict[str, Any]:
    """The document of a loop over so many flights in a copy of a workspace."""
    shutil.copytree(made, workspace)
    if settings:
        (workspace / FILE).write_text(settings, encoding="utf-8")
    rows = asked(workspace, "flight", "list")[:flights]
    named = [word for row in rows for word in ("--flights", row["flight"])]
    document = asked(workspace, "close-loop", "--vehicle", NAME, "--direct", *named)
    return {name: value for name, value in document.items() if name not in OWN}


@pytest.mark.parametrize(
    "flights",
    [
        pytest.param(6, id="some held out"),
        pytest.param(4, id="each predicted from the others, by loops in forks"),
    ],
)
def test_the_result_is_the_same_in_a_process_of_its_own(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, flights: int
) -> None:
    begun, confined = [], close_loop.confined

    def counted(function: Any, *arguments: Any, **keywords: Any) -> Any:
        begun.append(arguments[0])
        return confined(function, *arguments, **keywords)

    monkeypatch.setattr(close_loop, "confined", counted)
    monkeypatch.setattr(close_loop, "_CORES", 1)
    here = closed(made, tmp_path / "here", flights)
    assert not begun  # short flights: a process would take longer to start
    monkeypatch.setattr(close_loop, "_WORTH", 0)
    apart = closed(made, tmp_path / "apart", flights)
    assert begun
    assert apart == here
    begun.clear()
    alone = closed(made, tmp_path / "unconfined", flights, "[work]\nconfined = false\n")
    assert alone == here
    assert not begun
