"""A workspace for the console's tests, and the console on it: in this process, or as a server for a
browser."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from starlette.testclient import TestClient

from aerodb.flight import Flight
from aerodb.flows.web.app import create_app
from aerodb.flows.web.guard import guard_of
from aerodb.flows.web.server import listening, server_of
from aerodb.remarks import said
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import FlightRole
from aerodb.storage.files.documents import write_document
from aerodb.storage.files.flights import write_flight
from aerodb.storage.workspace import Workspace
from aerodb.tasks.workspace_access import access_workspace
from tests.support.catalogue_samples import h
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

#: Text that would be markup, rearrange a line, or fill a page.
HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(2)>\u202egnp.\u2066'\"&{{7*7}}"
LONG = "a" * 10_000


@dataclass(frozen=True)
class Made:
    """A workspace with a handbook database, an update proved on flights, and flights whose logs
    have hostile names."""

    workspace: Workspace
    document: dict[str, Any]

    @property
    def candidate(self) -> str:
        return str(self.document["candidate"])

    @property
    def baseline(self) -> str:
        return str(self.document["baseline"])

    @property
    def flight(self) -> str:
        return str(self.document["flights"]["identified"][0])


def made_workspace(shared: SharedWorkspaces, root: Path) -> Made:
    """A copy in `root` of the small glider's workspace after an update, with what somebody hostile
    would leave beside it."""

    def build(place: Path) -> dict[str, Any]:
        made = Made(*shared.updated(place))
        for k, name in enumerate((HOSTILE, LONG)):
            add_named(made.workspace, h(f"hostile {k}"), name)
        add_loop(made.workspace, made)
        return made.document

    return Made(*shared.copy("glider-console", build, root))


def add_named(workspace: Workspace, id: str, log_name: str) -> None:
    """A flight without a file, of a log with any name; rejected and retracted for reasons that hold
    the name too."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_log(
            id, name=log_name, size=10, format="ulog", status="stored", reason=log_name
        )
        record: dict[str, Any] = {
            "mapping": log_name,
            "start_utc": None,
            "duration": 20.0,
            "samples": 1001,
            "step": 0.02,
        }
        catalogue.add_flight(id, vehicle=NAME, log_sha256=id, **record)
        catalogue.judge_flight(id, "rejected", [said(log_name)])
        catalogue.retract_flight(id, log_name)


TOKEN = "a token of some length"


def client_of(
    workspace: Workspace, host: str = "127.0.0.1", token: str | None = TOKEN
) -> TestClient:
    """The console in this process, with requests that carry `token` (None: none); an error that
    nobody turned into an answer is raised."""
    app = create_app(workspace.root, guard_of(host, 8050, (), {"AERODB_TOKEN": TOKEN}))
    headers = {"authorization": f"Bearer {token}"} if token else {}
    return TestClient(app, base_url="http://127.0.0.1:8050", headers=headers)


@contextmanager
def served(workspace: Workspace) -> Iterator[str]:
    """The console as a real server on a free port of this machine; its address."""
    with listening("127.0.0.1", 0) as place:
        server = server_of(workspace.root, guard_of("127.0.0.1", 0, (), {"AERODB_TOKEN": TOKEN}))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [place]})
        thread.start()
        try:
            until = time.monotonic() + 300
            while not server.started and time.monotonic() < until:
                time.sleep(0.02)
            assert server.started
            yield f"http://127.0.0.1:{place.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join(300)
        assert not thread.is_alive()


def add_long_flight(
    workspace: Workspace, seconds: float = 3600.0, rate: float = 100.0
) -> tuple[str, Flight]:
    """An hour of 12 channels in the product's own store, with one spike of a single sample; its id
    and channels."""
    rng = np.random.default_rng(7)
    t = np.arange(round(seconds * rate)) / rate
    slow = np.sin(2 * np.pi * t / 60.0)
    names = ("V", "alpha", "beta", "p", "q", "r", "ax", "ay", "az", "phi", "theta", "altitude")
    channels = {
        name: 0.1 * slow * (k + 1) + 0.01 * rng.standard_normal(len(t))
        for k, name in enumerate(names)
    }
    channels["alpha"][len(t) // 3] = 1.25
    id = h("an hour")
    flight = Flight(
        id,
        NAME,
        t,
        channels,
        {"flight": (t < 10.0).astype(np.uint8)},
        log_sha256=id,
        mapping="canonical",
    )
    access = access_workspace(str(workspace.root))
    path = workspace.flight_path(id)
    write_flight(path, flight)
    access.catalogue.add_log(id, name="hour.ulg", size=10, format="ulog", status="stored")
    record: dict[str, Any] = {
        "mapping": "canonical",
        "start_utc": None,
        "duration": float(t[-1]),
        "samples": len(t),
    }
    access.catalogue.add_flight(
        id, vehicle=NAME, log_sha256=id, step=1 / rate, name="hour", **record
    )
    access.keep_result(id, path, step="ingest", kind="flight", flight=id, result_version=1)
    return id, flight


def add_loop(workspace: Workspace, made: Made) -> str:
    """A closed loop that added nothing: its run, and its document with every part, whose words are
    hostile; its key."""
    access, key = access_workspace(str(workspace.root)), h("a loop")
    vote = {"flight": made.flight, "value": 0.1, "se": 0.02}
    finding = {
        "effect": "alpha_slope",
        "subject": "",
        "axis": ["CZ"],
        "hypothesis": f"alpha_slope@{HOSTILE}",
        "verdict": "suspected",
        "parameter": "CZ_alpha",
        "value": -0.24,
        "unit": "1/rad",
        "ci95": [-0.3, -0.2],
        "p_adjusted": 0.01,
        "votes": [vote, vote],
        "explanation_set": [f"alpha_slope@{HOSTILE}", "alpha_scale@all"],
        "fallen": {"beta_slope@CY": f"explains less {HOSTILE}"},
        "because": f"force that grows with alpha: CZ_alpha = -0.26, {HOSTILE}",
        "what": f"force that grows with alpha {HOSTILE}",
        "reasons": [f"no other effect explains it {HOSTILE}"],
    }
    missed = {
        "hypothesis": "beta_slope@CY",
        "effect": "beta_slope",
        "axis": ["CY"],
        "subject": "",
        "parameter": "CY_beta",
    }
    bounds = {
        "unit": "rad",
        "verdict": "not_excited",
        "upper_bound": None,
        "minimum_detectable": 0.1,
    }
    document = {
        **{
            name: made.document[name]
            for name in ("vehicle", "baseline", "flights", "validation", "axes")
        },
        "candidate": None,
        "increments": [],
        "findings": [finding],
        "added": [],
        "not_found": [{**missed, **bounds}],
        "next_flight": [f"move alpha on its own {HOSTILE}"],
        "remarks": [f"nothing entered {HOSTILE}"],
        "library": {"sha256": h("library"), "rounds": 1},
    }
    run = access.catalogue.start_run(
        "close_loop_flow", how="direct", parameters={"vehicle": NAME, "flights": [made.flight]}
    )
    path = workspace.result_path(key, ".json")
    write_document(path, document)
    access.keep_result(key, path, step="close_loop", kind="findings", result_version=1, run=run.id)
    access.catalogue.end_run(run.id, "completed")
    return key


def add_child(catalogue: Catalogue, parent: str, name: str, flights: list[str]) -> str:
    """A version below another that rests on flights and that no gate would let pass."""
    documents = catalogue.version_documents(parent)
    uses = [FlightRole(flight, "identified") for flight in flights]
    row = catalogue.add_version(
        h(name),
        vehicle=NAME,
        parent=parent,
        content=documents.content,
        content_sha256=catalogue.version_of_id(parent).content_sha256,
        settings={"name": name},
        report={},
        flights=uses,
    )
    return row.id
