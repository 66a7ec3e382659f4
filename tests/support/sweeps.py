"""Sweeps of an inbox in this process, and what they leave."""

from typing import Any

from aerodb.flows.inbox import sweep_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.small_glider import NAME

#: Per-flight steps in the process of the test, for tests that make a function fail there.
HERE = "[work]\nconfined = false\n"
QUICK = '[inbox]\nsettle = "0.2 s"\n[loop]\nrun = []\n'


def swept(workspace: Workspace) -> dict[str, Any]:
    """The document of a sweep without the orchestrator."""
    document: dict[str, Any] = run_flow(sweep_flow, {}, workspace, "direct")
    return document


def kinds(document: dict[str, Any]) -> dict[str, str]:
    """File of the glider -> how it ended, of a sweep's document."""
    return {entry["file"].removeprefix(f"{NAME}/"): entry["kind"] for entry in document["files"]}


def events(workspace: Workspace, kind: Any) -> list[str]:
    """Paths of which the catalogue noted `kind`."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        return sorted(event.path for event in catalogue.inbox_events(kind, limit=10_000))


def left(workspace: Workspace) -> list[str]:
    """What still lies in the inbox."""
    return sorted(
        path.relative_to(workspace.inbox).as_posix()
        for path in workspace.inbox.rglob("*")
        if not path.is_dir()
    )
