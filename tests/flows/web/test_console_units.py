"""Units that a user chooses once and that every page of the console has; JSON stays SI."""

import re
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import html
from starlette.testclient import TestClient

from aerodb.remarks import MOVING_AIR, Remark
from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.console_workspace import Made, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console-units") / "workspace")


@pytest.fixture
def client(made: Made) -> Iterator[TestClient]:
    with client_of(made.workspace) as opened:
        yield opened


def choose(client: TestClient, units: str, back: str = "/", csrf: str | None = None) -> int:
    """Choose units as the form of a page does; return the status of the answer."""
    page = html.fromstring(client.get("/").text)
    (known,) = page.xpath("//form[@action='/units']/input[@name='csrf']/@value")
    given = {"units": units, "back": back, "csrf": known if csrf is None else csrf}
    return client.post("/units", data=given, follow_redirects=False).status_code


def airspeed(client: TestClient, made: Made) -> tuple[str, float, list[float]]:
    """The axis of the airspeed as a page draws it: its label, its factor, and its values (SI)."""
    record = client.get(f"/api/flights/{made.flight}/channels?names=V").json()["series"][0]
    return record["label"], record["factor"], record["values"]


def test_what_is_chosen_once_is_on_every_page_and_json_stays_si(
    client: TestClient, made: Made
) -> None:
    document = client.get(f"/api/flights/{made.flight}").json()
    label, factor, values = airspeed(client, made)
    assert (label.split("]")[0], factor) == ("V [m/s", 1.0)
    assert choose(client, "aero", back=f"/flights/{made.flight}") == 303
    label, factor, same = airspeed(client, made)
    assert label.startswith("V [kt]")
    assert factor == pytest.approx(3600.0 / 1852.0)
    assert same == values
    assert client.get(f"/api/flights/{made.flight}").json() == document
    for path in ("/", "/work", f"/versions/{made.candidate}"):
        page = html.fromstring(client.get(path).text)
        (chosen,) = page.xpath("//select[@name='units']/option[@selected]/@value")
        assert chosen == "aero", path
    drawn = pictures(client.get(f"/flights/{made.flight}/report").text)
    assert "V [kt]" in drawn
    assert "V [m/s]" not in drawn
    assert choose(client, "si") == 303
    assert airspeed(client, made)[0].startswith("V [m/s]")


def pictures(page: str) -> str:
    """The figures of a report as SVG."""
    found = re.findall(r"data:image/svg\+xml;base64,([\w+/=]+)", page)
    return "".join(b64decode(each).decode() for each in found)


def test_the_settings_say_what_is_shown_to_who_has_not_chosen(
    client: TestClient, made: Made
) -> None:
    settings = Path(made.workspace.root) / "settings.toml"
    before = settings.read_text(encoding="utf-8") if settings.exists() else None
    try:
        settings.write_text('[show]\nunits = "imperial"\n', encoding="utf-8")
        assert airspeed(client, made)[0].startswith("V [ft/s]")
        assert choose(client, "aero") == 303
        assert airspeed(client, made)[0].startswith("V [kt]")
    finally:
        if before is None:
            settings.unlink()
        else:
            settings.write_text(before, encoding="utf-8")


def test_another_site_chooses_nothing_and_leads_nowhere(client: TestClient) -> None:
    assert choose(client, "aero", csrf="0" * 64) == 403
    assert choose(client, "cubits") >= 400
    page = html.fromstring(client.get("/").text)
    (csrf,) = page.xpath("//form[@action='/units']/input[@name='csrf']/@value")
    for outside in ("//elsewhere.example/", "https://elsewhere.example/", "/\\elsewhere.example"):
        given = {"units": "si", "back": outside, "csrf": csrf}
        answer = client.post("/units", data=given, follow_redirects=False)
        assert answer.headers["location"] == "/"


def test_the_lists_of_flights_say_why_in_the_chosen_units(client: TestClient, made: Made) -> None:
    gusts = Remark(MOVING_AIR, ("V",), {"V": (5.0, "m/s")})
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        catalogue.judge_flight(made.flight, "limited", [gusts])
    assert choose(client, "aero") == 303
    for path in ("/flights", f"/flights/{made.flight}"):
        page = client.get(path).text
        assert "urbulence of 9.7 kt rms" in page, path
        assert "m/s rms" not in page, path
    listed = client.get(f"/api/flights/{made.flight}").json()
    assert listed["reasons"] == [gusts.sentence]
    assert choose(client, "si") == 303
    assert "urbulence of 5 m/s rms" in client.get("/flights").text


def test_lists_begin_with_what_the_names_point_to(client: TestClient) -> None:
    for path, said in (("/versions", "v0002 is candidate, v0001 is released"),
                       ("/history", "candidate points to v0002 since")):  # fmt: skip
        page = html.fromstring(client.get(path).text)
        (lead,) = page.xpath("//p[@class='lead']")
        assert said in lead.text_content()


def test_a_finding_states_its_estimate_once(client: TestClient) -> None:
    """Its sentence has none: that of the round in which it was found is not the last."""
    listed = client.get("/findings").text
    found = re.findall(r'href="/findings/([0-9a-f]+)"', listed)
    documents = {key: client.get(f"/api/findings/{key}").json() for key in found}
    (key,) = [key for key, document in documents.items() if document["findings"]]
    assert "CZ_alpha = -0.26" in documents[key]["findings"][0]["because"]
    page = client.get(f"/findings/{key}").text
    assert "Force that grows with alpha" in page
    assert "0.26" not in page
