"""Rows that the tests of the catalogue share."""

from hashlib import sha256
from typing import Any

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import FlightRole

V = "twin-otter"


def h(text: object) -> str:
    return sha256(str(text).encode()).hexdigest()


def add_flight(
    catalogue: Catalogue, name: str, vehicle: str = V, named: bool = True, id: str = ""
) -> str:
    log = h(name)
    catalogue.add_log(log, name=f"{name}.ulg", size=10, format="ulog", status="stored")
    values: dict[str, Any] = {
        "mapping": "px4",
        "start_utc": None,
        "duration": 20.0,
        "samples": 1001,
        "step": 0.02,
    }
    return catalogue.add_flight(
        id or log, vehicle=vehicle, log_sha256=log, name=name if named else None, **values
    ).id


def add_version(
    catalogue: Catalogue, name: str, parent: str | None = None, vehicle: str = V, **more: Any
) -> str:
    documents = {
        "content": f'{{"name":"{name}"}}',
        "content_sha256": h(name),
        "settings": {"name": name},
        "report": {},
    }
    return catalogue.add_version(
        h(name), vehicle=vehicle, parent=parent, **{**documents, **more}
    ).id


def add_family(catalogue: Catalogue) -> Catalogue:
    """base <- a (f1 identifies, f2 held out, f4 excluded) <- b (f3 identifies, f2 held out) <- c;
    a <- d (f4 excluded)."""
    for name in ("f1", "f2", "f3", "f4"):
        add_flight(catalogue, name)
    run = catalogue.start_run("update", how="direct")
    add_version(catalogue, "base")
    roles = [
        FlightRole(h("f1"), "identified"),
        FlightRole(h("f2"), "held_out"),
        FlightRole(h("f4"), "excluded", "rejected"),
    ]
    add_version(catalogue, "a", h("base"), flights=roles, inputs=[h("in")], run=run.id)
    add_version(
        catalogue,
        "b",
        h("a"),
        flights=[FlightRole(h("f3"), "identified"), FlightRole(h("f2"), "held_out")],
    )
    add_version(catalogue, "c", h("b"))
    add_version(catalogue, "d", h("a"), flights=[FlightRole(h("f4"), "excluded")])
    return catalogue
