"""Where a number comes from, and what a flight stands behind; lineage as PROV-JSON, read by the
package's own reader."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from prov.model import (
    ProvActivity,
    ProvAgent,
    ProvDerivation,
    ProvDocument,
    ProvEntity,
    ProvGeneration,
)
from typer.testing import CliRunner

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.cli.main import app
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import FlightRole
from aerodb.storage.writers.prov import prov_json
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.view.lineage_documents import rebuilds
from tests.support.catalogue_samples import V, add_family, add_flight, add_version, h
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, TRUTH
from tests.support.terminal import answered

SECOND_MODEL = '[[increment]]\naxis = "Cm"\nterms = ["alpha"]\n'


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Path, list[dict[str, Any]]]:
    """A line of three versions: the handbook, increments on CZ and CX, and one on Cm on top; the
    updates' documents."""
    workspace, first = shared.updated(tmp_path_factory.mktemp("made") / "w")
    second = tmp_path_factory.mktemp("files") / "second.toml"
    second.write_text(SECOND_MODEL, encoding="utf-8")
    again = ("--model", str(second), "--baseline", "candidate", "--direct")
    return workspace.root, [first, asked(workspace.root, "update", "--vehicle", NAME, *again)]


def test_from_a_table_node_to_log_hashes_settings_steps_and_run(
    made: tuple[Path, list[dict[str, Any]]],
) -> None:
    workspace, (first, _) = made
    answer = asked(workspace, "version", "lineage", "v0003", "--node", "CZ0[2]")
    (entry,) = answer["increments"]
    # Node 2 is at 4 deg: there the flown glider has -0.02 - 0.5 alpha beyond its handbook.
    planted = TRUTH["CZ"]["1"] + TRUTH["CZ"]["alpha"] * np.deg2rad(4.0)
    assert abs(entry["value"] - planted) < 4 * entry["standard_error"]
    assert (entry["axis"], entry["made_by"], entry["label"]) == ("CZ", first["candidate"], "v0002")
    assert [flight["flight"] for flight in entry["flights"]] == first["flights"]["identified"]
    assert all(flight["name"].startswith("flight") for flight in entry["flights"])
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        for flight in entry["flights"]:
            assert catalogue.flight(flight["flight"]).log_sha256 == flight["log_sha256"]
        run = catalogue.run(entry["run"])
    assert (run.flow, run.state, run.code_version) == (
        "update_flow",
        "completed",
        entry["code_version"],
    )
    assert entry["settings"]["model"] == MODEL
    steps = {
        step: [RESULT_VERSION[step]]
        for step in ("ingest", "consistency", "coefficients", "compare", "update")
    }
    assert entry["step_versions"] == steps


def test_from_a_point_to_all_increments_that_act_there(
    made: tuple[Path, list[dict[str, Any]]],
) -> None:
    workspace, (first, second) = made
    point = ("version", "lineage", "v0003", "--at", "alpha=5deg,V=25")
    lines = answered(workspace, point, "by v0002, v0003", r"CZ +-?\S+ \+- \S+ \(constant, alpha")
    flown = [line for line in lines if "flight1.csv" in line]
    assert len(flown) == 1, "each flight once, by its log"
    answer = asked(workspace, *point)
    makers = {entry["axis"]: entry["made_by"] for entry in answer["increments"]}
    assert makers == {"CZ": first["candidate"], "CX": first["candidate"], "Cm": second["candidate"]}
    assert (
        asked(workspace, "version", "lineage", "v0003", "--at", "alpha=80deg,V=25")["increments"]
        == []
    )
    assert asked(workspace, "version", "lineage", "v0001", "--node", "CZ0[2]")["increments"] == []


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        (["--node", "CZ0[9]"], InputError, "CZ0"),
        (["--node", "CZ0[1,1]"], InputError, "CZ0"),
        (["--node", "CZO[1]"], UnknownNameError, "did you mean 'CZ0'"),
        (["--node", "__import__('os')[0]"], InputError, "is not a table node"),
        (["--node", "CZ0[99999999999999]"], InputError, "is not a table node"),
        (["--node", "CZ0[1]", "--at", "alpha=1"], InputError, "exclude each other"),
        (["--at", "alhpa=1"], InputError, "did you mean 'alpha'"),
    ],
)
def test_a_node_or_point_that_is_none_is_refused(
    made: tuple[Path, list[dict[str, Any]]], arguments: list[str], kind: type[Exception], words: str
) -> None:
    result = CliRunner().invoke(
        app, ["--workspace", str(made[0]), "version", "lineage", "v0003", *arguments]
    )
    assert isinstance(result.exception, kind)
    assert words in str(result.exception)


def test_lists_are_paged_and_a_diff_names_flights_and_draws(
    made: tuple[Path, list[dict[str, Any]]], tmp_path: Path
) -> None:
    workspace, (first, second) = made
    assert [row["label"] for row in asked(workspace, "version", "list", "--limit", "2")] == [
        "v0002",
        "v0003",
    ]
    assert len(asked(workspace, "version", "list", "--all")) == 3
    assert [move["to"] for move in asked(workspace, "version", "history", "--limit", "1")] == [
        second["candidate"]
    ]
    answer = asked(
        workspace, "version", "diff", "v0001", "v0003", "--figure", str(tmp_path / "d.svg")
    )
    assert (answer["before"], answer["after"]) == (first["baseline"], second["candidate"])
    terms = {(term["axis"], term["name"]): term for term in answer["terms"]}
    assert set(terms) == {
        ("CZ", "1"),
        ("CZ", "alpha"),
        ("CZ", "q_hat"),
        ("CX", "1"),
        ("CX", "alpha"),
        ("Cm", "alpha"),
    }
    slope = terms["CZ", "alpha"]
    assert abs(slope["change"] - TRUTH["CZ"]["alpha"]) < 4 * slope["sigma"]
    assert slope["flights"] == first["flights"]["identified"]
    (table,) = answer["nodes"]
    assert (table["table"], table["axis"]) == ("CZ0", "CZ")
    assert [node["inside_data"] for node in table["nodes"]] == [False, False, True, False, False]
    assert (tmp_path / "d.svg").read_text(encoding="utf-8").lstrip().startswith("<?xml")
    nothing = asked(workspace, "version", "diff", "v0002", "v0002")
    assert nothing["terms"] == nothing["nodes"] == []
    refused = CliRunner().invoke(
        app,
        [
            "--workspace",
            str(workspace),
            "version",
            "diff",
            "v0001",
            "v0002",
            "--figure",
            str(tmp_path / "d.exe"),
        ],
    )
    assert isinstance(refused.exception, InputError)
    assert not (tmp_path / "d.exe").exists()


# PROV


def _edges(
    document: ProvDocument, kind: type[Any], first: str, second: str
) -> set[tuple[str, str]]:
    records = (record.formal_attributes for record in document.get_records(kind))
    named = ({str(name): str(value) for name, value in attributes} for attributes in records)
    return {(entry[f"prov:{first}"], entry[f"prov:{second}"]) for entry in named}


def test_prov_json_says_what_the_catalogue_says(
    made: tuple[Path, list[dict[str, Any]]], tmp_path: Path
) -> None:
    workspace, _ = made
    lineage = asked(workspace, "version", "lineage", "v0003", "--prov", str(tmp_path / "p.json"))
    document = ProvDocument.deserialize(str(tmp_path / "p.json"), format="json")
    ids = {str(record.identifier) for record in document.get_records(ProvEntity)}
    versions = [f"version:{row['version']}" for row in lineage["line"]]
    flights = {f"flight:{use['flight']}": f"log:{use['log_sha256']}" for use in lineage["flights"]}
    assert ids == {*versions, *flights, *flights.values()}
    derived = _edges(document, ProvDerivation, "generatedEntity", "usedEntity")
    assert derived == {
        (versions[0], versions[1]),
        (versions[1], versions[2]),
        *flights.items(),
        *((versions[0], flight) for flight in flights),
    }
    made_by = dict(_edges(document, ProvGeneration, "entity", "activity"))
    assert set(made_by) == set(versions)
    activities = {str(record.identifier) for record in document.get_records(ProvActivity)}
    assert set(made_by.values()) <= activities
    labels = {
        str(value)
        for record in document.get_records(ProvAgent)
        for value in record.get_attribute("prov:label")
    }
    assert "aerodb" in labels
    assert len(labels) == 2  # and the user who moved the names
    raw = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    assert {"entity", "activity", "agent", "wasDerivedFrom", "wasGeneratedBy"} <= set(raw)


def test_hostile_users_and_reasons_are_text_in_prov(tmp_path: Path) -> None:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "text")
        add_family(catalogue)
        user, reason = 'x" onclick="\u202e\x1b[31m', "'; DROP TABLE versions; --\n{}"
        catalogue.move_name(V, "released", h("c"), user=user, reason=reason, expected=None)
        data = prov_json(catalogue.lineage(h("c")), {}, catalogue.moves_to(V, [h("c")]))
    document = ProvDocument.deserialize(content=data, format="json")
    agents = {
        str(value)
        for record in document.get_records(ProvAgent)
        for value in record.get_attribute("prov:label")
    }
    assert user in agents
    reasons = {
        str(v)
        for record in document.get_records(ProvActivity)
        for v in record.get_attribute("aerodb:reason")
    }
    assert reason in reasons


# From a flight


@pytest.fixture
def branched(tmp_path: Path) -> Any:
    """base <- a (f1) <- b (f3) <- c, a <- d; a, b and d were made by updates, c by none."""
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "text")
        for name in ("f1", "f3"):
            add_flight(catalogue, name)
        settings: Mapping[str, Any] = {"model": "text"}
        add_version(catalogue, "base")
        add_version(
            catalogue,
            "a",
            h("base"),
            flights=[FlightRole(h("f1"), "identified")],
            settings=settings,
        )
        add_version(
            catalogue,
            "b",
            h("a"),
            flights=[FlightRole(h("f3"), "identified")],
            settings={**settings, "name": "b"},
        )
        add_version(catalogue, "c", h("b"))
        add_version(catalogue, "d", h("a"), settings={**settings, "name": "d"})
        yield catalogue


def test_what_to_make_again_comes_in_order_and_with_the_command(branched: Catalogue) -> None:
    again = rebuilds(branched, branched.impact(h("f1")))
    assert [(entry["label"], entry["command"].partition("--like ")[2]) for entry in again] == [
        ("v0002", "v0002 --baseline v0001"),
        ("v0003", "v0003 --baseline candidate"),
        ("v0004", ""),
        ("v0005", "v0005 --baseline NEW-v0002"),
    ]
    assert [entry["label"] for entry in rebuilds(branched, branched.impact(h("f3")))] == [
        "v0003",
        "v0004",
    ]
    assert rebuilds(branched, ()) == []


def test_the_nearest_use_of_a_flight_counts_for_a_descendant(branched: Catalogue) -> None:
    add_version(branched, "e", h("c"), flights=[FlightRole(h("f1"), "identified")])
    add_version(branched, "f", h("e"))
    through = {impact.version.id: impact.through for impact in branched.impact(h("f1"))}
    assert through == {
        h("a"): h("a"),
        h("b"): h("a"),
        h("c"): h("a"),
        h("d"): h("a"),
        h("e"): h("e"),
        h("f"): h("e"),
    }
