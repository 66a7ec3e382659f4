"""Names of versions move by compare and swap, and every version has its lineage."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import GateRefusal, InputError, UnknownNameError
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.names import NameMovedError
from aerodb.storage.catalogue.rows import FlightRole
from tests.support.catalogue_samples import V, add_family, add_version, h


@pytest.fixture
def catalogue(kept_in: str, tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        yield opened


def test_a_name_moves_only_from_where_it_stands(catalogue: Catalogue) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b", h("a"))
    before = datetime.now(UTC)
    first = catalogue.move_name(V, "released", a, user="me", reason="import", expected=None)
    second = catalogue.move_name(V, "released", b, user="me", reason="proved", expected=a)
    for expected in (None, a):
        with pytest.raises(NameMovedError, match="was moved in the meantime") as error:
            catalogue.move_name(V, "released", a, user="me", reason="late", expected=expected)
        assert isinstance(error.value, GateRefusal)
    assert (
        catalogue.move_name(V, "released", b, user="me", reason="once more", expected=b) == second
    )
    assert catalogue.name_history(V) == catalogue.name_history(V, "released") == (first, second)
    assert (second.previous, catalogue.version(V, "released").id) == (a, b)
    assert catalogue.version(V, "released", as_of=first.at_utc).id == a
    assert catalogue.version(V, "released", as_of=datetime.now(UTC) + timedelta(days=1)).id == b
    with pytest.raises(UnknownNameError, match="as of"):
        catalogue.version(V, "released", as_of=before - timedelta(seconds=1))
    with pytest.raises(InputError, match="has no time zone"):
        catalogue.version(V, "released", as_of=datetime(2026, 1, 1))


def test_a_clock_set_back_does_not_reorder_the_history(
    catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b")
    first = catalogue.move_name(V, "released", a, user="me", reason="r", expected=None)
    monkeypatch.setattr("aerodb.storage.encoding.now", lambda: datetime(2001, 1, 1, tzinfo=UTC))
    second = catalogue.move_name(V, "released", b, user="me", reason="r", expected=a)
    assert timedelta(0) < second.at_utc - first.at_utc < timedelta(seconds=1)


@pytest.fixture
def family(catalogue: Catalogue) -> Catalogue:
    return add_family(catalogue)


def test_lineage_of_a_version(family: Catalogue) -> None:
    lineage = family.lineage(h("c"))
    assert [row.id for row in lineage.line] == [h(name) for name in ("c", "b", "a", "base")]
    assert lineage.version == lineage.line[0]
    assert lineage.roles == family.roles_in_line(h("c"))
    assert lineage.roles == {
        h("f1"): "identified",
        h("f2"): "held_out",
        h("f3"): "identified",
        h("f4"): "excluded",
    }
    assert lineage.logs == {flight: flight for flight in lineage.roles}
    assert lineage.inputs == {h("a"): (h("in"),)}
    assert [run.flow for run in lineage.runs] == ["update"]
    assert family.roles_in_line(None) == family.roles_in_line(h("base")) == {}
    assert family.version_flights(h("d")) == (FlightRole(h("f4"), "excluded"),)


def test_impact_of_a_flight(family: Catalogue) -> None:
    def names(flight: str) -> list[tuple[str, str]]:
        known = {h(name): name for name in ("base", "a", "b", "c", "d")}
        return [
            (known[i.version.id], f"{i.role} by {known[i.through]}")
            for i in family.impact(h(flight))
        ]

    by_a = "identified by a"
    assert names("f1") == [("a", by_a), ("b", by_a), ("c", by_a), ("d", by_a)]
    assert names("f3") == [("b", "identified by b"), ("c", "identified by b")]
    assert names("f2")[:2] == [("a", "held_out by a"), ("b", "held_out by b")]
    assert names("f4") == []


def test_a_retracted_flight_makes_exactly_its_versions_stale(family: Catalogue) -> None:
    assert not any(family.stale(row.id) for row in family.versions(V))
    family.retract_flight(h("f4"), "excluded anyway")
    family.retract_flight(h("f3"), "pitot blocked")
    reasons = {row.label: family.stale(row.id) for row in family.versions(V)}
    assert {label for label, why in reasons.items() if why} == {"v0003", "v0004"}
    assert reasons["v0004"][0].startswith("flight f3 (identified) was retracted on ")
    assert reasons["v0004"][0].endswith(": pitot blocked")


def test_a_flight_keeps_its_role_along_a_line(family: Catalogue) -> None:
    for flight, role in (("f1", "held_out"), ("f2", "identified")):
        with pytest.raises(InputError, match="keeps its role along a line"):
            add_version(family, "e", h("c"), flights=[FlightRole(h(flight), role)])
    add_version(
        family,
        "e",
        h("base"),
        flights=[FlightRole(h("f1"), "held_out"), FlightRole(h("f4"), "identified")],
    )
    assert family.roles_in_line(h("e")) == {h("f1"): "held_out", h("f4"): "identified"}
    with pytest.raises(InputError, match="unknown flight id"):
        add_version(family, "g", flights=[FlightRole(h("f9"), "identified")])
