"""The form of a drafted mapping on the console: each line with its plot, and the file that its
answers make."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import hash_of_token, new_token
from tests.support.command import asked
from tests.support.console_workspace import client_of
from tests.support.shared_workspace import SharedWorkspaces

LOG = "Time [s],Roll [deg],Elev,<b>x\n" + "".join(
    f"{k / 20:.2f},{(k % 37) - 18},{(k % 11) / 50:.3f},{k % 5}\n" for k in range(400)
)


@pytest.fixture
def workspace(shared: SharedWorkspaces, tmp_path: Path) -> Workspace:
    return shared.prepared(tmp_path / "workspace")


@pytest.fixture
def client(workspace: Workspace) -> Iterator[TestClient]:
    with client_of(workspace) as opened:
        opened.headers["x-csrf-token"] = opened.get("/api/session").json()["csrf"]
        yield opened


def drafted(client: TestClient, data: str = LOG, name: str = "strange.csv") -> str:
    answer = client.post(f"/api/drafted/logs?name={name}", content=data.encode())
    assert answer.status_code == 200, answer.text
    return str(answer.json()["page"])


def fields_of(text: str) -> dict[str, str]:
    """What the browser would send of the page's form."""
    sent = dict(re.findall(r'<input [^>]*name="([a-z.0-9]+)"[^>]*? value="([^"]*)"', text))
    for name, options in re.findall(r'<select name="([a-z.0-9]+)".*?>(.*?)</select>', text):
        chosen = re.search(r'value="(\d+)" selected', options)
        sent[name] = chosen[1] if chosen else ""
    return sent


def test_each_line_has_its_plot_and_says_how_sure_it_is(client: TestClient) -> None:
    page = client.get(drafted(client))
    assert page.status_code == 200
    assert page.text.count("<polyline") >= 2
    assert 'aria-label="phi over time, -0.3142 to 0.3142 rad"' in page.text
    assert "<strong>sure</strong>" in page.text
    assert "<b>x" not in page.text
    assert "default-src 'self'" in page.headers["content-security-policy"]
    assert "unsafe" not in page.headers["content-security-policy"]


def test_the_answers_give_a_mapping_that_reads_the_log(
    client: TestClient, workspace: Workspace, tmp_path: Path
) -> None:
    address = drafted(client)
    sent = fields_of(client.get(address).text)
    (roll,) = [k for k, value in sent.items() if value == "phi"]
    number = roll.removeprefix("channel.")
    sent[f"channel.{number}"], sent[f"scale.{number}"] = "theta", "2"
    checked = client.post(address, data=sent)
    assert checked.status_code == 200
    assert 'aria-label="theta over time, -0.6283 to 0.6283 rad"' in checked.text
    file = client.get(f"{address}/mapping.toml")
    assert 'filename="strange.mapping.toml"' in file.headers["content-disposition"]
    names = [each["name"] for each in tomllib.loads(file.text)["channel"]]
    assert "theta" in names
    assert "phi" not in names
    (tmp_path / "strange.csv").write_text(LOG)
    (tmp_path / "m.toml").write_text(file.text)
    log, mapping = str(tmp_path / "strange.csv"), str(tmp_path / "m.toml")
    seen = asked(tmp_path / "w", "log", "inspect", log, "--mapping", mapping)
    assert "theta" in str(seen["channels"])


def test_a_wrong_answer_is_said_on_the_page_and_kept_from_the_file(client: TestClient) -> None:
    address = drafted(client)
    before = client.get(f"{address}/mapping.toml").text
    sent = fields_of(client.get(address).text)
    (roll,) = [k for k, value in sent.items() if value == "phi"]
    sent[roll.replace("channel", "unit")] = "kg"
    refused = client.post(address, data=sent)
    assert refused.status_code == 200
    assert "No mapping yet" in refused.text
    assert 'value="kg"' in refused.text
    assert client.get(f"{address}/mapping.toml").text == before
    sent[roll.replace("channel", "scale")] = "two"
    assert "is no scale" in client.post(address, data=sent).text


def test_forms_of_others_and_of_strangers_are_refused(
    client: TestClient, workspace: Workspace
) -> None:
    address = drafted(client)
    sent = fields_of(client.get(address).text)
    assert client.post(address, data={**sent, "csrf": "no"}).status_code == 403
    assert client.get("/drafts/absent").status_code == 404
    assert client.post("/api/drafted/logs?name=a.ulg", content=b"ULog\x01").status_code == 422
    for _ in range(8):
        last = drafted(client)
    assert client.get(address).status_code == 404
    assert client.get(last).status_code == 200
    token = new_token()
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert not catalogue.flights()
        catalogue.add_user("reader", "read", hash_of_token(token), by="test")
    with client_of(workspace, token=token) as reader:
        csrf = {"x-csrf-token": reader.get("/api/session").json()["csrf"]}
        refused = reader.post("/api/drafted/logs?name=a.csv", content=b"x", headers=csrf)
        assert refused.status_code == 403
