"""``aerodb report``: reports as HTML or PDF."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.modes_beside import Beside, Flown, Method, beside_flights
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle
from aerodb.flows.cli.trimming import Thrust, steady_flight

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow

app = typer.Typer(
    name="report",
    cls=Commands,
    no_args_is_help=True,
    help="Reports as one self-contained HTML page, or as PDF.",
)

Output = Annotated[Path, typer.Option(help="The file to write: HTML, or PDF where it ends so.")]
Pdf = Annotated[
    bool, typer.Option("--pdf", help="As PDF whatever the file is called; needs the extra `pdf`.")
]
#: Lines of a version's report that are printed.
_SAID = 2
_KEY = re.compile(r"[0-9a-f]{64}")


@app.command()
def flight(
    context: typer.Context,
    flight: str,
    output: Output,
    against: Annotated[str, typer.Option(help="Version to compare with.")] = "released",
    vehicle: Vehicle = None,
    pdf: Pdf = False,
) -> None:
    """Write the report of a flight: verdict, consistency, time histories, coefficients, and the
    range that was flown.

    Example: aerodb report flight 1a2b3c --output flight.html
    """
    from aerodb.report import reasons_in_units
    from aerodb.tasks.view import flight_document

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    nothing_yet = against == "released" and catalogue.named(row.vehicle, against) is None
    version = "" if nothing_yet else catalogue.version(row.vehicle, against).id
    name = catalogue.flight_labels([row.id])[row.id]
    why = reasons_in_units(flight_document(row), session.units)
    _write(
        session,
        {"kind": "flight", "about": row.id, "version": version},
        output,
        pdf,
        f"{row.vehicle}: report of {name}",
        f"aerodb flight show {row.id[:12]} --vehicle {row.vehicle}",
        [("verdict", f"{row.verdict}{f': {session.fitting(why[0], 22)}' if why else ''}")],
    )


@app.command()
def update(
    context: typer.Context,
    version: Annotated[
        str, typer.Argument(help="The version that was made, or the key of a closed loop's report.")
    ],
    output: Output,
    vehicle: Vehicle = None,
    pdf: Pdf = False,
) -> None:
    """Write the report of an update or closed loop: findings, error before and after, open
    questions.

    Example: aerodb report update candidate --output update.html
    """
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    catalogue = session.catalogue()
    if _KEY.fullmatch(version) and catalogue.result(version) is not None:
        parameters = {"kind": "update", "about": version}
        _write(session, parameters, output, pdf, f"report of the closed loop {version[:12]}", "")
        return
    row = version_of(catalogue, version, vehicle)
    _write_of_version(session, row, {"kind": "update", "about": row.id}, output, pdf)


@app.command()
def version(
    context: typer.Context,
    version: str,
    output: Output,
    vehicle: Vehicle = None,
    pdf: Pdf = False,
    flown: Flown = None,
    method: Method = None,
    beside: Beside = None,
    speed: Annotated[
        str | None, typer.Option(help="Airspeed of the modes beside --flown.", show_default=False)
    ] = None,
    altitude: Annotated[
        str | None, typer.Option(help="Altitude of the modes beside --flown.", show_default=False)
    ] = None,
    thrust: Thrust = None,
) -> None:
    """Write the report of a version: its lineage, the differences from its parent, and with --flown
    its modes beside those of flights.

    Example: aerodb report version released --output version.html
    """
    from aerodb.errors import InputError
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    row = version_of(session.catalogue(), version, vehicle)
    parameters: dict[str, Any] = {"kind": "version", "about": row.id}
    if flown is not None:
        if speed is None or altitude is None:
            raise InputError(
                "--flown needs the flight of its modes", remedy="give --speed and --altitude"
            )
        flight = steady_flight(session, row, speed, altitude, None, False, None, None, thrust)
        parameters["modes"] = beside_flights(session, row, flight, flown, method, beside)
    _write_of_version(session, row, parameters, output, pdf)


def _write_of_version(
    session: Session,
    row: "VersionRow",
    parameters: dict[str, Any],
    output: Path,
    as_pdf: bool,
) -> None:
    """Write a report about a version; above it stands what the report says first."""
    from aerodb.report import version_lines
    from aerodb.tasks.view import version_details, waiting

    catalogue = session.catalogue()
    report = version_details(catalogue, row)["report"]
    told = [
        (label, texts[0].replace("\u2212", "-"))
        for label, texts in version_lines(report, row.label, session.units)[:_SAID]
    ]
    waits = row.id in {each.id for each in waiting(catalogue, row.vehicle)}
    then = "gate" if waits else "show"
    title = f"{row.vehicle}: report of {row.label}"
    next_one = f"aerodb version {then} {row.label} --vehicle {row.vehicle}"
    _write(session, parameters, output, as_pdf, title, next_one, told)


def _write(
    session: Session,
    parameters: dict[str, Any],
    output: Path,
    as_pdf: bool,
    title: str,
    then: str,
    told: Sequence[tuple[str, str]] = (),
) -> None:
    """Write a report and print what it is about, its first lines, and the command `then`."""
    from aerodb.flows.report import report_flow

    page: str = session.run(report_flow, parameters, direct=True)
    written, size = session.save_page(output, page, as_pdf)
    session.headlines(
        f"{title}: wrote {written.name} ({size / 1e3:.0f} kB)", told, then, [("file", str(written))]
    )
    session.answer(
        {
            "file": str(written),
            "kind": parameters["kind"],
            "about": parameters["about"],
            "size": size,
        }
    )
