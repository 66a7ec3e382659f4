"""``aerodb flight compare``: what a version leaves unexplained of a flight, and what the released
one leaves."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import typer

from aerodb.flows.cli.findings import say_suspicions
from aerodb.flows.cli.ingested import erring_axes, say_comparison
from aerodb.flows.cli.output import Session, percent, visible
from aerodb.flows.cli.references import OfFlight

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aerodb.storage.catalogue import Catalogue, FlightRow, Impact, VersionRow

#: Most axes that the line of changes names.
_NAMED: Final = 3


def compare(
    context: typer.Context,
    flight: str,
    version: str = typer.Argument(
        "released", help="Any version of the flight's vehicle; without it, the released one."
    ),
    vehicle: OfFlight = None,
) -> None:
    """Compare a stored flight with any version: what is left per axis, and what the released
    version leaves.

    Example: aerodb flight compare 1a2b3c v0002
    """
    from aerodb.flows.flight import compare_flow

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    other = catalogue.version(row.vehicle, version)
    before = _before(catalogue, other)
    parameters = {
        "flight": row.id,
        "version": other.id,
        "before": before.id if before is not None else None,
    }
    document = session.run(compare_flow, parameters, direct=True)
    document = {**document, "version": other.id, "label": other.label}
    if before is not None and document["before"] is not None:
        document["before"] |= {"version": before.id, "label": before.label}
    _say(session, catalogue, row, other, document)
    session.answer(document)
    if document["key"] is None:
        raise typer.Exit(3)


def _before(catalogue: "Catalogue", version: "VersionRow") -> "VersionRow | None":
    """Return the version that one is judged beside: the released one, or the parent of that."""
    released = catalogue.names(version.vehicle).get("released")
    other = version.parent if released == version.id else released
    return None if other is None else catalogue.version_of_id(other)


def _say(
    session: Session,
    catalogue: "Catalogue",
    flight: "FlightRow",
    version: "VersionRow",
    document: Mapping[str, Any],
) -> None:
    """Print the verdict, what changes beside the other version, whether the flight proves anything,
    what to do next, and the table of axes."""
    from aerodb.tasks.view import waiting

    name = visible(catalogue.flight_labels({flight.id})[flight.id])
    beside = f"{flight.vehicle}: {name} beside {version.label}"
    if document["key"] is None:
        session.headlines(
            f"{beside}: no comparison",
            [("because", document["reason"])],
            f"aerodb flight show {flight.id[:12]}",
        )
        return
    erring = erring_axes([{"comparison": document}])
    waits = version.id in {row.id for row in waiting(catalogue, flight.vehicle)}
    released = catalogue.names(flight.vehicle).get("released") == version.id
    if waits:
        then = f"aerodb version gate {version.label} --vehicle {flight.vehicle}"
    elif erring and released:
        then = f"aerodb close-loop --vehicle {flight.vehicle}"
    else:
        then = f"aerodb report flight {flight.id[:12]}"
    suspicions = document["suspicions"]
    suspected = session.fitting(suspicions[0]["sentence"], 30) if suspicions else ""
    session.headlines(
        f"{beside}: {_erring(document, erring)}",
        [
            ("most", _most(erring)),
            ("change", _change(document)),
            ("proof", _proof(catalogue.impact(flight.id), version)),
        ],
        then,
        [("suspected", suspected)],
    )
    session.say()
    say_comparison(session, document)
    if [entry["sentence"] for entry in suspicions] != [suspected]:
        say_suspicions(session, suspicions)


def _erring(document: Mapping[str, Any], erring: Mapping[str, float]) -> str:
    """Return how many axes err by more than the sensors' noise."""
    if not erring:
        return "no axis errs beyond noise"
    return f"{len(erring)} of {len(document['axes'])} axes err beyond noise"


def _most(erring: Mapping[str, float]) -> str:
    """Return the axis that errs most of what was flown; empty where none does."""
    most = max(erring, key=lambda axis: erring[axis], default="")
    return f"{most} errs by {percent(erring[most])} of what was flown" if most else ""


def _change(document: Mapping[str, Any]) -> str:
    """Return in words the axes whose error differs most between the two versions, in per cent of
    what was flown; empty without another version."""
    before = document["before"]
    if before is None:
        return ""
    shares = {
        axis: (before["axes"][axis]["of_flown"], entry["of_flown"])
        for axis, entry in document["axes"].items()
        if axis in before["axes"]
        and None not in (entry["of_flown"], before["axes"][axis]["of_flown"])
    }
    said = {axis: [percent(old), percent(new)] for axis, (old, new) in shares.items()}
    differ = [axis for axis, (old, new) in said.items() if old != new]
    if not differ:
        return f"none: {before['label']} leaves as much on every axis"
    differ.sort(key=lambda axis: -abs(shares[axis][0] - shares[axis][1]))
    named = [f"{axis} {said[axis][0]} -> {said[axis][1]}" for axis in differ[:_NAMED]]
    if len(differ) > _NAMED:
        named.append(f"{len(differ) - _NAMED} more")
    return f"from {before['label']}: {', '.join(named)}"


def _proof(uses: "Sequence[Impact]", version: "VersionRow") -> str:
    """Return what the flight proves about a version: nothing where it was learnt from it."""
    role = next((use.role for use in uses if use.version.id == version.id), None)
    if role == "identified":
        return f"none: {version.label} was identified from this flight"
    if role == "held_out":
        return f"{version.label} was checked on this flight, and not identified from it"
    return f"{version.label} was made without this flight"
