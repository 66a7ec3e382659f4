"""Measured flights on a database that has nothing, by command: what ingest says, an update from two
short records, the third predicted beyond what they flew, and the responses."""

import csv

import pytest

from tests.support.command import aerodb, asked
from tests.support.paths import VEHICLES

EMPTY = """
name = "empty"
[reference]
area = "39.25 m^2"
chord = "1.98 m"
span = "19.81 m"
moment_reference = [0.0, 0.0, 0.0]
[derivatives.CZ]
"1" = 0.0
"""
MODEL = """
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
[[increment]]
axis = "CY"
terms = ["1", "beta", "abs(beta)", "r_hat"]
"""


@pytest.fixture(scope="module")
def workspace(measured, tmp_path_factory):
    """Root, the answers of ingest by record, and the document of the update without 9752ed20."""
    folder = tmp_path_factory.mktemp("empty")
    root = folder / "w"
    (folder / "empty.toml").write_text(EMPTY)
    (folder / "model.toml").write_text(MODEL)
    asked(root, "vehicle", "add", str(VEHICLES / "twin_otter.toml"))
    asked(root, "database", "import", str(folder / "empty.toml"), "--vehicle", "twin-otter")
    made = {}
    for name in ("f1_017", "demo", "9752ed20"):
        log = str(measured(f"twin_otter/totter_{name}_data.mat"))
        (made[name],) = asked(root, "flight", "ingest", log, "--vehicle", "twin-otter", "--direct")
    update = (
        "update",
        "--vehicle",
        "twin-otter",
        "--model",
        str(folder / "model.toml"),
        "--direct",
    )
    document = asked(root, *update, "--hold-out", made["9752ed20"]["flight"])
    return root, made, document


def test_no_lift_in_the_database_is_no_suspicion_and_the_list_agrees_with_ingest(workspace) -> None:
    root, made, _ = workspace
    listed = {row["flight"]: row["verdict"] for row in asked(root, "flight", "list")}
    for outcome in made.values():
        assert outcome["comparison"]["suspicions"] == []
        assert listed[outcome["flight"]] == outcome["consistency"]["verdict"]
    assert made["9752ed20"]["consistency"]["verdict"] == "good"


def test_slopes_continue_where_no_flight_has_been_and_there_is_nothing_to_fade_to(
    workspace,
) -> None:
    """From alpha below 1.2 deg to 7.2 deg: faded, the error was .51 of a CZ of .75."""
    _, _, document = workspace
    (beyond,) = (each for each in document["beyond"] if each["axis"] == "CZ")
    assert beyond["used"] == "continued"
    assert beyond["held_outside"] < 0.15
    assert beyond["share"] == 1.0
    said = " ".join(document["remarks"])
    assert "continued beyond its flown range, alpha by 3.92 deg" in said
    assert "with slopes continued and then held" in said
    assert len(document["flights"]["identified"]) == 2


def test_the_candidate_and_a_version_without_inputs_fly(workspace, tmp_path) -> None:
    root, made, document = workspace
    file = tmp_path / "qualification.csv"
    flight = made["9752ed20"]["flight"]
    for version, against in ((document["label"], "parent"), ("v0001", "none")):
        given = ("version", "validate", version, "--flight", flight, "--against", against)
        answer = aerodb(root, *given, "-v", "--table", str(file))
        assert answer.returncode == 4, answer.stderr  # judged, and outside the tolerances
        assert "rms error" in answer.stdout
        assert "not covered  2.c.1-" in answer.stdout
        rows = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))
        results = {row[f"{version}: result"] for row in rows}
        assert "not covered" in results
        assert any(name.startswith("v0001: open") for name in rows[0])
