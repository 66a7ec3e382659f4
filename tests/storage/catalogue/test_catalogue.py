"""The catalogue: round trip of what is added, idempotence, and resolution of references."""

from dataclasses import replace
from datetime import UTC, datetime
from math import nan
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError, UnknownNameError
from aerodb.recording import Damage
from aerodb.remarks import CONTRADICTS, SUSPECTED, Remark, said
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.chain import broken_links
from aerodb.storage.catalogue.row_links import broken_rows
from tests.support.catalogue_samples import V, add_flight, add_version, h
from tests.support.postgresql import by_hand


@pytest.fixture
def catalogue(kept_in: str, tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        yield opened


def test_vehicles_keep_every_text(catalogue: Catalogue) -> None:
    first = catalogue.vehicle(V)
    catalogue.add_vehicle(V, "new text")
    catalogue.add_vehicle(V, "new text")
    assert (first.text, catalogue.vehicle(V).text) == ("name = 'twin-otter'", "new text")
    assert catalogue.vehicle(V).sha256 == h("new text")
    assert catalogue.vehicle(V, first.sha256) == first
    assert [row.name for row in catalogue.vehicles()] == [V]
    with pytest.raises(UnknownNameError, match="did you mean 'twin-otter'"):
        catalogue.vehicle("twinotter")


def test_logs_are_added_once_and_only_quarantine_is_left_again(catalogue: Catalogue) -> None:
    damage = (Damage("lost_tail", "7 bytes \ud800", bytes_lost=7),)
    assert catalogue.add_log(
        h(1),
        name="\ud800';--",
        size=2**40,
        format="ulog",
        status="quarantined",
        reason="no topic",
        damage=damage,
    )
    log = catalogue.log(h(1))
    assert log is not None
    assert (log.name, log.size, log.reason, log.damage[0].bytes_lost) == (
        "\\ud800';--",
        2**40,
        "no topic",
        7,
    )
    assert not catalogue.add_log(
        h(1), name="other", size=1, format="ulog", status="damaged", damage=damage
    )
    assert [(row.status, row.name) for row in catalogue.logs()] == [("damaged", "\\ud800';--")]
    catalogue.add_log(h(1), name="other", size=1, format="ulog", status="quarantined")
    assert catalogue.logs("quarantined") == ()
    assert catalogue.log(h(2)) is None


def test_a_flight_with_verdict_and_retraction(catalogue: Catalogue) -> None:
    id = add_flight(catalogue, "f1")
    assert (catalogue.flight("f1").verdict, catalogue.flight("f1").duration) == ("unchecked", 20.0)
    catalogue.judge_flight(id, "limited", [said("alpha: bias 0.7 deg")])
    catalogue.judge_flight(id, "limited", [said("alpha: bias 0.7 deg")])
    catalogue.judge_flight(id, "good")
    assert (catalogue.flight(id).verdict, catalogue.flight(id).reasons) == ("good", ())
    first = catalogue.retract_flight(id, "pitot blocked")
    again = catalogue.retract_flight(id, "another reason")
    assert (again.retract_reason, again.retracted_utc) == ("pitot blocked", first.retracted_utc)
    with pytest.raises(InputError, match="requires a reason"):
        catalogue.retract_flight(id, "  ")
    with pytest.raises(UnknownNameError):
        catalogue.retract_flight("nobody", "x")


def test_the_same_flight_again_changes_nothing_and_a_better_mapping_adds_a_record(
    catalogue: Catalogue, tmp_path: Path
) -> None:
    id = add_flight(catalogue, "f1")
    assert add_flight(catalogue, "f1") == id
    assert add_flight(catalogue, "f1", named=False) == id
    start = datetime(2026, 5, 1, 12, tzinfo=UTC)
    values: dict[str, Any] = {
        "mapping": "px4 + rudder",
        "start_utc": start,
        "duration": 1.0,
        "samples": 51,
        "step": 0.02,
    }
    row = catalogue.add_flight(id, vehicle=V, log_sha256=id, **values)
    assert (row.mapping, row.samples, row.start_utc, row.name) == ("px4 + rudder", 51, start, "f1")
    raw = by_hand(tmp_path / "catalogue.sqlite")
    assert raw.execute(
        "SELECT (SELECT count(*) FROM flights), (SELECT count(*) FROM flight_records)"
    ).fetchone() == (1, 2)
    raw.close()


def test_a_flight_that_contradicts_a_stored_one_is_refused(catalogue: Catalogue) -> None:
    add_flight(catalogue, "f1")
    catalogue.add_vehicle("other", "")
    with pytest.raises(InputError, match="already stored for vehicle 'twin-otter' as 'f1'"):
        add_flight(catalogue, "f1", vehicle="other")
    catalogue.add_log(h("z"), name="z", size=1, format="ulog", status="stored")
    values: dict[str, Any] = {
        "mapping": "",
        "start_utc": None,
        "duration": 1.0,
        "samples": 2,
        "step": 1.0,
    }
    with pytest.raises(InputError, match="already has a flight named 'f1'"):
        catalogue.add_flight(h("z"), vehicle=V, log_sha256=h("z"), name="f1", **values)
    with pytest.raises(InputError, match="log is not stored"):
        catalogue.add_flight(h("y"), vehicle=V, log_sha256=h("y"), **values)
    assert [row.name for row in catalogue.flights()] == ["f1"]


def test_results_are_added_once_with_their_inputs_and_runs(catalogue: Catalogue) -> None:
    flight = add_flight(catalogue, "f1")
    run = catalogue.start_run("flight", how="direct", parameters={"log": "a.ulg"})
    values: dict[str, Any] = {
        "step": "coefficients",
        "kind": "table",
        "path": "results/ab/x.parquet",
        "result_version": 1,
    }
    more = {
        "flight": flight,
        "settings": {"bandwidth": 4.0},
        "inputs": [h("in2"), h("in1")],
        "run": run.id,
    }
    assert catalogue.add_result(h("r"), **values, **more)
    assert not catalogue.add_result(
        h("r"),
        **{**values, "path": "elsewhere"},
        run=catalogue.start_run("flight", how="direct").id,
    )
    row = catalogue.result(h("r"))
    assert row is not None
    assert (row.path, row.settings, row.inputs) == (
        "results/ab/x.parquet",
        {"bandwidth": 4},
        tuple(sorted([h("in1"), h("in2")])),
    )
    assert catalogue.results_of(flight) == catalogue.results_of(flight, "coefficients") == (row,)
    assert catalogue.results_of(flight, "compare") == ()
    assert catalogue.result(h("nothing")) is None
    for path in ("/etc/passwd", "../x", "a/../../b", "", "a\\b", "a\nb"):
        with pytest.raises(InputError, match="inside the workspace"):
            catalogue.add_result(h(path), **{**values, "path": path})


def test_a_run_ends_once(catalogue: Catalogue) -> None:
    run = catalogue.start_run("nightly", how="server", id="b9c0a4c2-0000-4000-8000-000000000000")
    assert catalogue.start_run("nightly", how="server", id=run.id) == run
    assert catalogue.runs("running") == (run,)
    ended = catalogue.end_run(run.id, "crashed", "killed")
    assert catalogue.end_run(run.id, "completed") == ended
    assert (ended.state, ended.error, catalogue.runs("running")) == ("crashed", "killed", ())
    with pytest.raises(UnknownNameError):
        catalogue.end_run("nobody", "completed")


# References


def test_a_version_is_found_by_id_prefix_label_and_name(catalogue: Catalogue) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b", h("a"))
    assert add_version(catalogue, "b", h("a")) == b
    catalogue.move_name(V, "released", a, user="me", reason="first", expected=None)
    for ref in (a, a[:12], "v0001", "v1", "released"):
        assert catalogue.version(V, ref).id == a, ref
    assert [row.label for row in catalogue.versions(V)] == ["v0001", "v0002"]
    assert catalogue.version_documents(b).content == '{"name":"b"}'
    with pytest.raises(UnknownNameError, match="did you mean 'released'"):
        catalogue.version(V, "relaesed")
    with pytest.raises(UnknownNameError, match="unknown version 'v0003'"):
        catalogue.version(V, "v0003")


def test_labels_count_per_vehicle(catalogue: Catalogue) -> None:
    catalogue.add_vehicle("other", "")
    add_version(catalogue, "a")
    assert catalogue.version("other", add_version(catalogue, "x", vehicle="other")).label == "v0001"
    with pytest.raises(UnknownNameError):
        catalogue.version("other", h("a"))
    with pytest.raises(UnknownNameError, match="unknown version id"):
        add_version(catalogue, "y", parent=h("a"), vehicle="other")


def test_an_ambiguous_prefix_says_how_to_go_on(catalogue: Catalogue) -> None:
    for end in ("aa", "ab"):
        add_flight(catalogue, end, named=False, id="c0ffee" + end)
    with pytest.raises(
        UnknownNameError, match=r"(?s)not unique.*give more digits: c0ffeeaa\.\.\., c0ffeeab"
    ):
        catalogue.flight("c0ff")
    assert catalogue.flight("c0ffeeaa").id == "c0ffeeaa"
    with pytest.raises(UnknownNameError, match="unknown flight 'c0'"):
        catalogue.flight("c0")


def test_a_flight_name_of_two_vehicles_needs_the_vehicle(catalogue: Catalogue) -> None:
    catalogue.add_vehicle("other", "")
    mine, theirs = (
        add_flight(catalogue, "f1", id="id-1"),
        add_flight(catalogue, "f1", vehicle="other", id="id-2"),
    )
    assert (catalogue.flight("f1", V).id, catalogue.flight("f1", "other").id) == (mine, theirs)
    with pytest.raises(UnknownNameError, match="several vehicles"):
        catalogue.flight("f1")
    assert [row.id for row in catalogue.flights("other")] == [theirs]


def test_a_flight_is_found_by_the_file_and_the_time_that_lists_show(catalogue: Catalogue) -> None:
    for id, name, hour in (("one", "a_1.ulg", 9), ("two", "a_2.ulg", 10)):
        catalogue.add_log(h(name), name=name, size=1, format="ulog", status="stored")
        catalogue.add_flight(
            id, vehicle=V, log_sha256=h(name), mapping="m", duration=1.0, samples=2, step=1.0,
            start_utc=datetime(2026, 5, hour, hour, 30, tzinfo=UTC),
        )  # fmt: skip
    for ref in ("a_1.ulg", "a_1", "a_1.ulg (2026-05-09)", "2026-05-09", "2026-05-09 09:30"):
        assert catalogue.flight(ref).id == catalogue.flight(ref, V).id == "one", ref
    for ref in ("a%1", "a_1.ulg (2026-05-10)", "2026-05-1", "2026-05-11", "a_1."):
        with pytest.raises(UnknownNameError, match=r"(?s)unknown flight.*ulg \(2026-05-"):
            catalogue.flight(ref)
    catalogue.add_flight(
        "late", vehicle=V, log_sha256=h("a_2.ulg"), mapping="m", duration=1.0, samples=2, step=1.0,
        start_utc=datetime(2026, 5, 10, 12, tzinfo=UTC),
    )  # fmt: skip
    for ref in ("a_2", "2026-05-10"):
        with pytest.raises(UnknownNameError, match=r"(?s)several flights.*late or two"):
            catalogue.flight(ref)
    assert catalogue.flight("2026-05-10T12").id == "late"


HOSTILE = [
    "",
    "../../x",
    "'; DROP TABLE flights;--",
    "%",
    "_",
    "\ud800",
    "\0",
    "ä",
    "a\n",
    "x" * 100_000,
    "v" + "9" * 400,
    "a b",
]


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_are_refused_and_harmless(catalogue: Catalogue, name: str) -> None:
    flight, version = add_flight(catalogue, "f1"), add_version(catalogue, "a")
    for ask in (catalogue.vehicle, catalogue.flight, lambda ref: catalogue.version(V, ref)):
        with pytest.raises(UnknownNameError) as error:
            ask(name)
        assert len(str(error.value)) < 400
    with pytest.raises(InputError):
        catalogue.add_vehicle(name, "text")
    with pytest.raises(InputError):
        catalogue.move_name(V, name, version, user="me", reason="r", expected=None)
    with pytest.raises(InputError):
        add_flight(catalogue, "new", id=name or " ")
    with pytest.raises(InputError):
        catalogue.add_result(name, step="s", kind="k", path="p", result_version=1)
    catalogue.retract_flight(flight, f"because {name}")
    catalogue.move_name(V, "released", version, user=name, reason=f"because {name}", expected=None)
    assert len(catalogue.flights()) == len(catalogue.versions(V)) == len(catalogue.vehicles()) == 1


def test_a_name_that_looks_like_a_label_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(InputError, match="is not allowed as a name for versions"):
        catalogue.move_name(
            V, "v0001", add_version(catalogue, "a"), user="me", reason="r", expected=None
        )


def test_reasons_are_kept_as_data_and_those_of_before_are_read_once(
    catalogue: Catalogue, kept_in: str, tmp_path: Path
) -> None:
    reasons = (
        Remark("residual_beyond_limit", ("V",), {"rms": (2.0, "m/s"), "limit": (nan, "m/s")}),
        Remark(CONTRADICTS, ("v0001",), text="lift: none"),
        Remark(SUSPECTED, ("v0001",), text="a mass: \0"),
    )
    words = (
        "V remains 2 m/s from the reconstructed motion; limit nan m/s ([accuracy] qbar_fraction, [sensors.V] noise)",
        "beside version v0001: lift: none",
        "suspected beside version v0001: a mass: \\x00",
    )
    id = add_flight(catalogue, "f1")
    catalogue.judge_flight(id, "limited", reasons)
    catalogue.judge_flight(id, "limited", reasons)
    stored = catalogue.flight(id)
    assert stored.reasons == words
    assert [each.kind for each in stored.remarks] == [each.kind for each in reasons]
    assert stored.remarks[0].values["rms"] == (2.0, "m/s")
    assert stored.remarks[1] == reasons[1]
    catalogue.close()
    raw = by_hand(tmp_path / "catalogue.sqlite")
    for table in ("verdict_remarks", "row_links", "version_notes", "run_dismissals"):
        raw.execute(f"DROP TABLE {table}")
    raw.execute("UPDATE alembic_version SET version_num = 'r0008'")
    raw.commit()
    (count,) = raw.execute("SELECT count(*) FROM flight_events").fetchone()
    raw.close()
    with Catalogue.open(tmp_path / "catalogue.sqlite") as migrated:
        assert count == 1
        assert migrated.flight(id).reasons == words
        assert migrated.flight(id).remarks == (
            said(words[0]),
            reasons[1],
            replace(reasons[2], text="a mass: \\x00"),
        )
        with migrated._database.reading() as connection:
            assert [*broken_rows(connection), *broken_links(connection)] == []
