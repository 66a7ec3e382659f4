"""``aerodb flight turbulence``: intensity and scale of the gusts that a flight met."""

from typing import Annotated, Any

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle


def turbulence(
    context: typer.Context,
    flight: str,
    form: Annotated[str, typer.Option(help="dryden or von_karman.")] = "dryden",
    since: Annotated[
        float | None, typer.Option("--from", help="Start [s] from the flight's first sample.")
    ] = None,
    until: Annotated[float | None, typer.Option("--to", help="End [s].")] = None,
    highest: Annotated[float, typer.Option(help="Highest frequency [Hz].")] = 2.0,
    vehicle: Vehicle = None,
) -> None:
    """Turbulence that a flight met: intensity and scale length of the gusts u, v and w.

    Example: aerodb flight turbulence 1a2b3c --form von_karman --from 20 --to 200
    """
    from aerodb.flows.turbulence import turbulence_flow

    session: Session = context.obj
    row = session.catalogue().flight(flight, vehicle)
    document = session.run(
        turbulence_flow,
        {"flight": row.id, "form": form, "since": since, "until": until, "highest": highest},
        direct=True,
    )
    session.say(
        f"{document['form']}, {document['duration']:.0f} s at {document['speed']:.1f} m/s, up to"
        f" {document['highest']:g} Hz"
    )
    session.table(
        ["gust", "intensity m/s", "95 %", "scale m", "95 %", "noise m/s"],
        [
            [
                each["name"],
                f"{each['intensity']['value']:.2f}",
                _range(each["intensity"], ".2f"),
                f"{each['scale']['value']:.0f}",
                _range(each["scale"], ".0f"),
                f"{each['noise']:.2f}",
            ]
            for each in document["components"]
        ],
        (1, 3, 5),
    )
    for note in document["notes"]:
        session.say(f"- {note}")
    session.answer(document)


def _range(limits: dict[str, Any], form: str) -> str:
    low, high = (limits[name] for name in ("low", "high"))
    if high is None:
        return "open" if low is None else f"from {low:{form}}"
    return f"{0.0 if low is None else low:{form}} to {high:{form}}"
