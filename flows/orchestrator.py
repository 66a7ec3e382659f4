"""Requests of `aerodb serve` to the Prefect server: health, events, and states of runs.

Uses HTTP; Prefect itself is not imported.
"""

import base64
import json
import time
import urllib.request
import uuid
from datetime import UTC, datetime, timedelta
from http import HTTPStatus
from http.client import HTTPException
from typing import Any, Final
from urllib.error import HTTPError

from aerodb.storage.locks import is_held
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import authorization

#: Event: logs wait in the inbox. Nothing depends on it; without it, they wait for the night.
ARRIVED: Final = "aerodb.inbox.arrived"
#: The deployment that the event starts.
ARRIVAL: Final = "arrival"
_SECONDS: Final = 10.0
_BETWEEN_REQUESTS: Final = 0.2
#: Time from the submission of a run until its process must hold its lock.
_TO_BEGIN: Final = timedelta(seconds=90)
_MOST: Final = 200


class OrchestratorClient:
    """HTTP client of the server at `url`; requests raise OSError (HTTP errors included) on
    failure."""

    def __init__(self, url: str, token: str) -> None:
        self.url = url
        self._headers = {"Content-Type": "application/json"}
        if token:
            self._headers["Authorization"] = "Basic " + base64.b64encode(
                authorization(token).encode()
            ).decode("ascii")

    def healthy(self) -> bool:
        """Return whether the server answers."""
        try:
            with urllib.request.urlopen(f"{self.url}/health", timeout=_SECONDS) as response:
                return bool(response.status == 200)
        except (OSError, HTTPException):
            return False

    def post(self, path: str, document: Any) -> Any:
        """Post a document and return the answer.

        The server answers 503 while its database is locked. As Prefect's own client does, the
        request is then repeated, for as long as an answer may take.
        """
        data = json.dumps(document).encode("utf-8")
        request = urllib.request.Request(f"{self.url}{path}", data, self._headers, method="POST")
        until = time.monotonic() + _SECONDS
        while True:
            try:
                with urllib.request.urlopen(request, timeout=_SECONDS) as response:
                    text = response.read()
                return json.loads(text) if text else None
            except HTTPError as error:
                if error.code != HTTPStatus.SERVICE_UNAVAILABLE or time.monotonic() > until:
                    raise
                time.sleep(_BETWEEN_REQUESTS)
            except (HTTPException, ValueError) as error:
                raise OSError(
                    f"{self.url}{path} gave no valid answer: {type(error).__name__}"
                ) from error


def emit_arrival(client: OrchestratorClient, vehicles: dict[str, int]) -> None:
    """Tell the server that logs wait; vehicles : number of logs by vehicle."""
    document = {
        "id": str(uuid.uuid4()),
        "occurred": datetime.now(UTC).isoformat(),
        "event": ARRIVED,
        "resource": {"prefect.resource.id": "aerodb.inbox"},
        "payload": {"vehicles": vehicles},
    }
    client.post("/events", [document])


def is_awaited(client: OrchestratorClient) -> bool:
    """Return whether a run that will read the inbox is scheduled, pending or running."""
    waiting = {"state": {"type": {"any_": ["SCHEDULED", "PENDING", "RUNNING"]}}}
    return bool(
        client.post(
            "/flow_runs/count", {"flow_runs": waiting, "deployments": {"name": {"any_": [ARRIVAL]}}}
        )
    )


def clear_up(client: OrchestratorClient, workspace: Workspace, at_start: bool) -> int:
    """Mark runs as crashed whose process is gone, and return the number of changed runs.

    at_start : also cancel scheduled runs that were missed; the next run does their work. A live run
    holds its lock (`aerodb.storage.locks`).
    """
    wanted = {"state": {"type": {"any_": ["RUNNING", "PENDING", "CANCELLING"]}}}
    count = 0
    for run in client.post("/flow_runs/filter", {"flow_runs": wanted, "limit": _MOST}):
        since = datetime.fromisoformat(run["state"]["timestamp"])
        age = (
            datetime.now(UTC) - since
        )  # below zero: the clock was set back, and the run is from before that
        begun = at_start or not -_TO_BEGIN < age <= _TO_BEGIN
        if begun and not is_held(workspace.lock(f"run-{_catalogue_id(run)}")):
            _set_state(
                client, run["id"], "CRASHED", "Crashed", "its process ended without a message"
            )
            count += 1
    if at_start:
        now = datetime.now(UTC).isoformat()
        missed = {
            "state": {"type": {"any_": ["SCHEDULED"]}},
            "expected_start_time": {"before_": now},
        }
        for run in client.post("/flow_runs/filter", {"flow_runs": missed, "limit": _MOST}):
            _set_state(
                client,
                run["id"],
                "CANCELLED",
                "Missed",
                "no runner was there to start it; a later run does its work",
            )
            count += 1
    return count


def _catalogue_id(run: dict[str, Any]) -> str:
    """Return the id of a flow run in the catalogue: a deployment's own id, otherwise its tag
    ``run:ID``."""
    tagged = [str(tag).removeprefix("run:") for tag in run["tags"] if str(tag).startswith("run:")]
    return tagged[0] if tagged and not run["deployment_id"] else str(run["id"])


def _set_state(client: OrchestratorClient, run: str, type: str, name: str, message: str) -> None:
    state = {"type": type, "name": name, "message": message}
    client.post(f"/flow_runs/{run}/set_state", {"state": state, "force": True})
