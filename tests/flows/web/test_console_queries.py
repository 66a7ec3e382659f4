"""The questions behind the console's lists, on both databases: no gap between pages, searches find
what is meant."""

from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError, UnknownNameError
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.flight_pages import FlightFilter
from tests.support.catalogue_samples import V, add_family, add_flight, add_version, h


@pytest.fixture
def catalogue(kept_in: str, tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        opened.add_vehicle("other", "name = 'other'")
        yield opened


def _all(catalogue: Catalogue, asked: FlightFilter, limit: int) -> list[str]:
    found, after = [], ""
    while True:
        page = catalogue.flight_page(asked, limit, after)
        assert len(page.rows) <= limit
        found += [row.label for row in page.rows]
        if not page.further:
            return found
        after = page.further


def test_flights_are_paged_searched_and_judged_by_their_newest_verdict(
    catalogue: Catalogue,
) -> None:
    for k in range(7):
        add_flight(catalogue, f"f{k}", vehicle=V if k % 2 else "other")
    catalogue.judge_flight(h("f1"), "rejected")
    catalogue.judge_flight(h("f2"), "rejected")
    catalogue.judge_flight(h("f2"), "good")  # the newest counts
    catalogue.retract_flight(h("f3"), "pitot cover")
    everything = [f"f{k}" for k in reversed(range(7))]
    for limit in (1, 2, 3, 7, 8):
        assert _all(catalogue, FlightFilter(), limit) == everything
        assert _all(catalogue, FlightFilter(vehicle=V), limit) == ["f5", "f3", "f1"]
        assert _all(catalogue, FlightFilter(verdict="rejected"), limit) == ["f1"]
        assert _all(catalogue, FlightFilter(verdict="retracted"), limit) == ["f3"]
        assert _all(catalogue, FlightFilter(verdict="unchecked"), limit) == [
            "f6",
            "f5",
            "f4",
            "f3",
            "f0",
        ]
        assert _all(catalogue, FlightFilter(text=".ULG"), limit) == everything
        assert _all(catalogue, FlightFilter(text="f4"), limit)[0] == "f4"
        assert _all(catalogue, FlightFilter(text="%"), limit) == []
    assert catalogue.flight_page(FlightFilter(text=h("f0")[:10]), 5).rows[0].name == "f0"
    assert catalogue.flight_page(FlightFilter("other", "rejected", "f1"), 5).rows == ()
    with pytest.raises(UnknownNameError):
        catalogue.flight_page(FlightFilter(vehicle="nobody"), 5)
    for nonsense in ("x", "~", "2026~", f"\x00~{h('f1')}", "2026-01-01~a b"):
        with pytest.raises(InputError, match="not a position"):
            catalogue.flight_page(FlightFilter(), 5, nonsense)


def test_versions_and_moves_are_paged_from_the_newest(catalogue: Catalogue) -> None:
    add_family(catalogue)
    assert [row.number for row in catalogue.versions(V, 2)] == [4, 5]
    assert [row.number for row in catalogue.versions(V, 2, before=4)] == [2, 3]
    assert [row.number for row in catalogue.versions(V, 9, before=2)] == [1]
    for step, name in enumerate(("base", "a", "b")):
        expected = None if step == 0 else h(("base", "a", "b")[step - 1])
        catalogue.move_name(V, "released", h(name), user="me", reason="r", expected=expected)
    catalogue.move_name(V, "mine", h("c"), user="me", reason="r", expected=None)
    whole = catalogue.name_history(V)
    assert catalogue.name_history(V, None, 2, before=whole[-1].sequence) == whole[1:3]
    assert catalogue.name_history(V, "released", 9, before=whole[2].sequence) == whole[:2]


def test_runs_of_flows_with_what_they_made(catalogue: Catalogue) -> None:
    flows = ["update_flow", "close_loop_flow", "flight_flow", "update_flow"]
    runs = [catalogue.start_run(flow, how="direct", parameters={"vehicle": V}) for flow in flows]
    version = add_version(catalogue, "made", run=runs[3].id)
    catalogue.add_result(
        h("loop"),
        step="close_loop",
        kind="findings",
        path="results/x.json",
        result_version=1,
        run=runs[1].id,
    )
    catalogue.add_result(
        h("other"),
        step="compare",
        kind="comparison",
        path="results/y",
        result_version=1,
        run=runs[1].id,
    )
    asked = ("update_flow", "close_loop_flow")
    newest = catalogue.runs_of(asked, 2)
    assert [run.id for run in newest] == [runs[3].id, runs[1].id]
    rest = catalogue.runs_of(asked, 9, (newest[-1].started_utc, newest[-1].id))
    assert [run.id for run in rest] == [runs[0].id]
    made = catalogue.made_by([run.id for run in runs], "close_loop")
    assert made[runs[3].id] == ((version,), ())
    assert made[runs[1].id] == ((), (h("loop"),))
    assert made[runs[0].id] == ((), ())
    assert catalogue.reports_of([version, "none"]) == {version: {}}
