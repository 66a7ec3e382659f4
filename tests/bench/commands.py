"""Queries of the command line over many flights and versions: processor time of a whole process.

The catalogue is filled by its own functions: flights with verdicts, and versions each of which is a
real update with its content and report.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support import glider_runs
from tests.support.catalogue_samples import add_flight, h
from tests.support.small_glider import NAME, write_files

#: Flights and versions in the catalogue; runs of each command.
FLIGHTS, VERSIONS, RUNS = 5000, 300, 5
#: Command -> aim [s of processor time].
AIMS: Final = {
    "--help": 0.5,
    "version list": 0.5,
    "flight list": 0.5,
    "version show v0150": 0.5,
    "version history": 0.5,
    "version lineage v0150": 0.5,
}


def commands(folder: Path) -> None:
    """Print the least processor time [s] of each command of `AIMS`, beside its aim."""
    workspace = filled(folder)
    print(f"commands with {FLIGHTS} flights and {VERSIONS} versions, least of {RUNS} runs")
    for words, aim in AIMS.items():
        spent = min(_seconds(workspace.root, words.split()) for _ in range(RUNS))
        print(f"  {words:24} {spent:6.3f} s of processor time (aim {aim:g})")


def filled(folder: Path) -> Workspace:
    """A workspace of the small glider with `FLIGHTS` flights and `VERSIONS` versions."""
    logs = write_files(folder / "files")
    workspace = glider_runs.prepared(folder / "commands", folder / "files")
    flights = glider_runs.ingest(workspace, logs)
    update = glider_runs.update(workspace, flights)
    with Catalogue.open(workspace.catalogue) as catalogue:
        for k in range(FLIGHTS - len(flights)):
            flight = add_flight(catalogue, f"flight-{k}", NAME)
            catalogue.judge_flight(flight, "good" if k % 20 else "limited", [])
        made = catalogue.version_of_id(update["candidate"])
        documents = catalogue.version_documents(made.id)
        parent = made.id  # `candidate` points to it
        for k in range(VERSIONS - 2):
            row = catalogue.add_version(
                h(f"version-{k}"),
                vehicle=NAME,
                parent=parent,
                content=documents.content,
                content_sha256=made.content_sha256,
                settings=documents.settings,
                report=documents.report,
                flights=catalogue.version_flights(made.id),
            )
            catalogue.move_name(
                NAME, "candidate", row.id, user="bench", reason="bench", expected=parent
            )
            parent = row.id
    return workspace


def _seconds(root: Path, words: list[str]) -> float:
    """Processor time [s], own and of the system, of a command in a process of its own."""
    before = os.times()
    code = "from aerodb.flows.cli import main; main()"
    command = [sys.executable, "-c", code, "--workspace", str(root), *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])
