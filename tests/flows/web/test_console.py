"""The console: every page, the same documents as the commands, names as text, errors as sentences,
records with true extremes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import html
from pydantic import TypeAdapter
from starlette.testclient import TestClient

from aerodb.flows.answers import Evaluated, ListedFlight, Move, ShownFlight, Version
from aerodb.flows.web import models
from aerodb.flows.web.console import SECTIONS
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.locks import holding
from aerodb.storage.workspace import Workspace
from tests.support.catalogue_samples import h
from tests.support.command import asked
from tests.support.console_workspace import HOSTILE, LONG, Made, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console") / "workspace")


@pytest.fixture(scope="module")
def client(made: Made) -> Iterator[TestClient]:
    with client_of(made.workspace) as opened:
        yield opened


def pages(made: Made) -> dict[str, str]:
    """What each page says of this workspace: address -> words that stand on it."""
    version, flight, hostile = made.candidate, made.flight, h("hostile 0")
    return {
        "/": "1 vehicle",
        "/flights": "flights: 6 limited",
        "/logs": "A log needs no vehicle to be looked at",
        f"/flights?vehicle={NAME}&verdict=rejected&text=": "retracted",
        f"/flights/{flight}": "Kinematic consistency",
        f"/flights/{hostile}": "its channels are not stored",
        f"/flights/{flight}/impact": "1 version is based on",
        f"/versions?vehicle={NAME}": "v0002",
        f"/versions/{version}": "2 increments from flights",
        f"/versions/{version}?at=alpha%3D5deg%2CV%3D25": "inside data",
        f"/versions/{version}?at=alhpa%3D5deg": "did you mean",
        f"/versions/{version}?table=CZ0": "each value links to its lineage",
        f"/versions/{version}/lineage": "is based on 6 flights",
        f"/versions/{version}/lineage?node=CZ0%5B2%5D&at=": "1 increment from flights acts",
        f"/versions/{made.baseline}/lineage?at=alpha%3D5deg": "No increment acts",
        f"/diff?before={made.baseline}&after={version}": "v0002: 5 edits",
        "/diff?before=v0001&after=v0001": "no difference",
        f"/compare?before={made.baseline}&after={version}": "v0001 and v0002 side by side",
        f"/versions?vehicle={NAME}&search=v0001": "not held out",
        "/findings": "has increments on CZ and CX",
        f"/findings/{version}": "Estimated increments",
        f"/findings/{h('a loop')}": "nothing is proved yet; 1 suspicion",
        f"/history?vehicle={NAME}": "declared increments estimated",
        "/work": "v0002 of small-glider waits for a decision",
        f"/versions/{version}/promote": "Release v0002 of small-glider?",
        f"/versions/{version}/promote?name=simulator": "Move simulator of small-glider to v0002?",
        f"/versions/{made.baseline}/promote": "already points to v0001",
        "/rollback": "has no version to go back to",
        "/api": "/api/versions/{version}/evaluate",
    }


def test_every_page_says_what_it_is_about(client: TestClient, made: Made) -> None:
    for address, words in pages(made).items():
        answer = client.get(address)
        assert answer.status_code == 200, (address, answer.text)
        page = html.fromstring(answer.content)
        assert words in " ".join(page.text_content().split()), address
        assert len(page.xpath("//main//h1")) == 1
        assert page.xpath("//a[@class='skip']/@href") == ["#content"]
        assert page.xpath("//html/@lang") == ["en"]


def test_pages_carry_no_script_no_style_and_nothing_of_other_hosts(
    client: TestClient, made: Made
) -> None:
    for address in pages(made):
        answer = client.get(address)
        page = html.fromstring(answer.content)
        assert not page.xpath("//style | //script[not(@src)] | //*[@style]"), address
        attributes = [name for element in page.iter() for name in element.attrib]
        assert not [name for name in attributes if name.startswith("on")]
        for place in page.xpath("//@src | //link/@href | //form/@action"):
            assert place.startswith("/"), place
            assert not place.startswith("//"), place
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        assert "unsafe" not in answer.headers["content-security-policy"]


def test_every_table_has_a_caption_and_every_field_a_label(client: TestClient, made: Made) -> None:
    for address in pages(made):
        page = html.fromstring(client.get(address).content)
        for table in page.xpath("//table"):
            assert table.xpath("./caption[normalize-space()]"), address
            assert not table.xpath(".//thead//th[not(@scope)]"), address
        for field in page.xpath("//input[not(@type='hidden')] | //select | //textarea"):
            labelled = (
                field.xpath("ancestor::label")
                or field.get("aria-label")
                or page.xpath(f"//label[@for='{field.get('id')}']")
            )
            assert labelled, (address, html.tostring(field))


def test_a_page_answers_before_it_asks(client: TestClient, made: Made) -> None:
    """What to compare is chosen below what was compared, and a flight has a name."""
    sides = f"before={made.baseline}&after={made.candidate}"
    begins = {
        f"/diff?{sides}": ('class="lead"', 'action="/diff"'),
        f"/compare?{sides}": ('id="curves"', 'action="/compare"'),
        "/findings": ("small-glider: nothing is proved yet", "<table"),
        f"/flights/{made.flight}/impact": (".csv", "<table"),
    }
    for path, (answer, asks) in begins.items():
        shown = client.get(path).text.split("<main")[1]
        assert answer in shown.split(asks)[0], path
    begins_with = client.get(f"/compare?{sides}").text
    assert 'value="v0002"' in begins_with, "a version is called by its label"


def test_links_lead_somewhere(client: TestClient, made: Made) -> None:
    seen: set[str] = set()
    for address in pages(made):
        page = html.fromstring(client.get(address).content)
        seen |= {
            str(place)
            for place in page.xpath("//a/@href | //link/@href | //script/@src | //img/@src")
        }
    assert set(SECTIONS) <= seen
    checked = {
        place.partition("#")[0]
        for place in seen
        if "/report" not in place and "export" not in place
    } - {""}
    assert len(checked) > 40
    for place in sorted(checked):
        assert client.get(place).status_code == 200, place


def test_reports_bring_their_own_styles_and_nothing_else(client: TestClient, made: Made) -> None:
    for address in (
        f"/flights/{made.flight}/report",
        f"/versions/{made.candidate}/report",
        f"/versions/{made.candidate}/responses?fly=true",
        f"/findings/{made.candidate}/report",
    ):
        answer = client.get(address)
        assert answer.status_code == 200, answer.text
        assert "default-src 'none'" in answer.headers["content-security-policy"]
        assert not html.fromstring(answer.content).xpath("//script")


def test_the_api_answers_the_documents_of_the_commands(client: TestClient, made: Made) -> None:
    root = made.workspace.root
    version, flight = made.candidate, made.flight
    same = {
        f"/api/versions?vehicle={NAME}": ("version", "list"),
        f"/api/versions/{version}": ("version", "show", version),
        f"/api/versions/{version}/evaluate?at=alpha=5deg,V=25": (
            "version",
            "evaluate",
            version,
            "--at",
            "alpha=5deg,V=25",
        ),
        f"/api/versions/{version}/lineage": ("version", "lineage", version),
        f"/api/versions/{version}/lineage?node=CZ0[2]": (
            "version",
            "lineage",
            version,
            "--node",
            "CZ0[2]",
        ),
        f"/api/versions/{version}/lineage?at=alpha=5deg": (
            "version",
            "lineage",
            version,
            "--at",
            "alpha=5deg",
        ),
        f"/api/flights/{flight}": ("flight", "show", flight),
        f"/api/flights/{flight}/impact": ("version", "impact", flight),
        "/api/diff?before=v0001&after=v0002": ("version", "diff", "v0001", "v0002"),
        "/api/history": ("version", "history"),
        "/api/versions/released": ("version", "show", "released"),
        "/api/versions/candidate?as_of=2100-01-01": (
            "version",
            "show",
            "candidate",
            "--as-of",
            "2100-01-01",
        ),
    }
    for address, command in same.items():
        assert client.get(address).json() == asked(root, *command), address
    listed = asked(root, "flight", "list")
    by_id = {entry["flight"]: entry for entry in client.get("/api/flights").json()}
    assert by_id == {entry["flight"]: entry for entry in listed}
    own, status = client.get("/api/status").json(), asked(root, "status")
    assert {**own, "free_bytes": 0} == {**status, "free_bytes": 0}
    stored = client.get(f"/api/findings/{version}").json()
    assert stored == {name: value for name, value in made.document.items() if name in stored}
    assert stored["axes"]["CZ"]["outcome"] == made.document["axes"]["CZ"]["outcome"]


def test_documents_are_as_their_description_says(client: TestClient, made: Made) -> None:
    version, flight = made.candidate, made.flight
    described = {
        "/api/flights": list[ListedFlight],
        f"/api/flights/{flight}": ShownFlight,
        f"/api/flights/{flight}/channels?names=alpha,CZ": models.Record,
        "/api/vehicles": list[models.Vehicle],
        "/api/versions": list[Version],
        f"/api/versions/{version}/evaluate?at=alpha=5deg": Evaluated,
        f"/api/versions/{version}/sweep?over=alpha&from=0&to=0.1&points=3": models.Sweep,
        "/api/findings": list[models.Finding],
        "/api/history": list[Move],
        "/api/session": models.Session,
    }
    for address, model in described.items():
        TypeAdapter(model).validate_json(client.get(address).content, strict=True)
    TypeAdapter(models.Refusal).validate_json(
        client.get("/api/flights/nothing").content, strict=True
    )


def test_a_closed_loop_says_what_it_found_and_why_and_what_stays_open(client: TestClient) -> None:
    page = html.fromstring(client.get(f"/findings/{h('a loop')}").content)
    said = " ".join(page.text_content().split())
    for words in (
        "suspected not added",
        "Suspected: the best explanation, but too few independent flights",
        "−0.24 1/rad (95 %: −0.3 to −0.2)",
        "scale of angle of attack",
        "not excited",
    ):
        assert words in said, words
    assert page.xpath("//dt[.='Flights with an estimate']/following-sibling::dd[1]/text()") == ["2"]
    assert page.xpath("//tr[th/bdi='slope of CY with sideslip']/td[@class='n']/text()") == [
        "none",
        "–",
    ], "undecided, of an older document: no bound"
    (entry, *_) = client.get("/api/findings").json()
    assert (entry["reference"], entry["label"], entry["verdicts"]) == (
        h("a loop"),
        None,
        {"suspected": 1},
    )


def test_running_work_leads_to_the_server_that_runs_it(client: TestClient, made: Made) -> None:
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        run = catalogue.start_run("flight_flow", how="server", parameters={"vehicle": NAME})
        with (
            holding(made.workspace.lock("serve"), remove=True) as serving,
            holding(made.workspace.lock(f"run-{run.id}")),
        ):
            for url, links in (("http://127.0.0.1:4200/api", 1), ("javascript:alert(1)", 0)):
                serving.note({"pid": 1, "url": url})
                page = html.fromstring(client.get("/work").content)
                assert len(page.xpath(f"//a[@href='{url}/flow_runs/{run.id}']")) == links
                assert run.id[:12] in page.text_content()
        catalogue.end_run(run.id, "completed")
    assert "not running: aerodb serve" in " ".join(
        html.fromstring(client.get("/work").content).text_content().split()
    )


def test_a_sweep_passes_through_the_points_that_evaluate_gives(
    client: TestClient, made: Made
) -> None:
    address = f"/api/versions/{made.candidate}/sweep?over=alpha&from=2deg&to=6deg&points=5&at=V=25"
    line = client.get(address).json()
    assert np.rad2deg(line["values"]) == pytest.approx([2, 3, 4, 5, 6])
    point = client.get(f"/api/versions/{made.candidate}/evaluate?at=V=25,alpha=5deg").json()
    for axis, found in line["axes"].items():
        assert found["value"][3] == pytest.approx(point["coefficients"][axis], abs=1e-15)
        assert found["place"][3] == point["places"][axis]
    assert line["axes"]["CZ"]["standard_error"][3] == pytest.approx(point["standard_errors"]["CZ"])
    assert line["axes"]["Cn"]["standard_error"] == [None] * 5


def test_a_sweep_says_where_nothing_of_the_changes_is_left(client: TestClient, made: Made) -> None:
    own, parent = (
        client.get(
            f"/api/versions/{version}/sweep?over=alpha&from=-60deg&to=60deg&points=241"
        ).json()
        for version in (made.candidate, made.baseline)
    )
    values = np.array(own["values"])
    gone = (values <= own["faded_below"]) | (values >= own["faded_above"])
    changed = np.any(
        [
            np.abs(np.subtract(found["value"], parent["axes"][axis]["value"])) > 1e-12
            for axis, found in own["axes"].items()
        ],
        axis=0,
    )
    assert changed[np.flatnonzero(~gone)[[0, -1]]].all()
    assert not changed[gone].any()
    assert parent["faded_below"] is parent["faded_above"] is None


def test_a_table_is_shown_with_its_own_numbers(client: TestClient, made: Made) -> None:
    table = client.get(f"/api/versions/{made.candidate}/tables/CZ0").json()
    assert table["channels"] == ["alpha"]
    assert np.rad2deg(table["nodes"][0]) == pytest.approx([-4, 0, 4, 8, 12])
    assert table["values"] == [0.05, -0.3, -0.65, -1.0, -1.3]
    page = html.fromstring(client.get(f"/versions/{made.candidate}?table=CZ0").content)
    rows = page.xpath("//table[contains(caption, 'alpha [deg]')]//tr")
    assert [cell.text_content() for cell in rows[2].xpath("./*")] == ["0", "−0.3"]
    assert rows[2].xpath("./td/a/@href") == [f"/versions/{made.candidate}/lineage?node=CZ0%5B1%5D"]


def test_exports_are_the_files_of_the_command(
    client: TestClient, made: Made, tmp_path: Path
) -> None:
    for form in ("csv", "daveml"):
        answer = client.get(f"/api/versions/{made.candidate}/export?format={form}")
        assert answer.status_code == 200, answer.text
        said = asked(
            made.workspace.root,
            "version",
            "export",
            "candidate",
            "--format",
            form,
            "--output",
            str(tmp_path / form),
        )
        assert len(answer.content) == said["bytes"]
        assert answer.headers["x-checked"] == said["checked"]
        assert "check cases pass" in answer.headers["x-checked"]


def test_hostile_names_are_text_everywhere(client: TestClient, made: Made) -> None:
    hostile, long = h("hostile 0"), h("hostile 1")
    addresses = [
        *pages(made),
        f"/flights/{hostile}/impact",
        f"/flights/{long}",
        "/flights?text=%3Cscript%3E",
        "/flights/%3Cscript%3E",
    ]
    for address in [
        *addresses,
        f"/flights?text={'%F0%9F%92%A9' * 50}",
        "/versions/%E2%80%AE%3Cb%3E",
        "/diff?before=%3Cb%3E&after=x",
    ]:
        answer = client.get(address)
        assert answer.status_code in (200, 404, 422), (address, answer.status_code)
        page = html.fromstring(answer.content)
        assert not page.xpath(
            "//script[not(@src)] | //img[not(starts-with(@src, '/diff'))] | //b"
        ), address
        assert "\u202e" not in answer.text
        assert "\u2066" not in answer.text
    shown = html.fromstring(client.get(f"/flights/{hostile}").content).text_content()
    assert HOSTILE.replace("\u202e", "\\u202e").replace("\u2066", "\\u2066") in shown
    assert client.get(f"/api/flights/{hostile}").json()["log"]["name"] == HOSTILE
    assert (
        LONG not in client.get("/flights").text
    )  # a list is cut, the flight's own page holds all of it
    assert LONG in client.get(f"/flights/{long}").text


def test_errors_say_what_where_and_what_to_do(client: TestClient, made: Made) -> None:
    expected = {
        "/api/flights/nothing": (404, "unknown flight"),
        "/api/versions/v0099": (404, "unknown version"),
        f"/api/versions/{made.candidate}/evaluate?at=alhpa=3": (422, "is not an input"),
        f"/api/versions/{made.candidate}/evaluate?at=alpha=9**9**9": (422, "not a quantity"),
        f"/api/versions/{made.candidate}/sweep?over=alpha&from=3&to=1": (422, "is not an interval"),
        f"/api/versions/{made.candidate}/lineage?node=CZ0": (422, "is not a table node"),
        f"/api/versions/{made.candidate}/tables/CZ9": (404, "no table"),
        f"/api/versions/{made.candidate}/export?format=doc": (422, ""),
        "/api/flights?limit=0": (422, "greater than"),
        "/api/flights?after=x": (422, "not a position"),
        "/api/flights?vehicle=nobody": (404, "unknown vehicle"),
        f"/api/flights/{made.flight}/channels?names=Vv": (404, "no channel"),
        f"/api/flights/{h('hostile 0')}/channels": (422, "not stored"),
        f"/api/findings/{made.baseline}": (422, "was imported"),
        "/api/findings?after=2026-01-01T00:00:00~x": (422, "not a position"),
        "/api/nothing": (404, "no page at this address"),
    }
    for address, (status, words) in expected.items():
        answer = client.get(address)
        assert answer.status_code == status, (address, answer.text)
        error = answer.json()["error"]
        assert error["status"] == status
        assert words in error["what"], address
    page = html.fromstring(client.get("/flights/nothing").content)
    assert "What to do" in page.text_content()
    assert client.get("/nothing").status_code == 404


def test_a_catalogue_out_of_reach_is_said_and_passes(
    client: TestClient, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    from aerodb.errors import StoreBusyError

    def busy(*_: Any, **__: Any) -> Any:
        raise StoreBusyError(
            "another process has locked the catalogue", "catalogue.sqlite", "run again"
        )

    with monkeypatch.context() as patched:
        patched.setattr(Catalogue, "flight_page", busy)
        answer = client.get("/api/flights")
        assert answer.status_code == 503
        assert answer.headers["retry-after"] == "5"
        assert client.get("/flights").status_code == 503
    assert client.get("/api/flights").status_code == 200


def test_an_empty_workspace_has_every_list(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "empty")
    Catalogue.open(workspace.catalogue).close()
    with client_of(workspace) as client:
        for path in SECTIONS:
            assert client.get(path).status_code == 200, path
        for path in ("/api/flights", "/api/findings", "/api/vehicles"):
            assert client.get(path).json() == []
        assert client.get("/api/versions").status_code == 404  # which vehicle?
