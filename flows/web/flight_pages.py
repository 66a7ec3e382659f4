"""Flights: the list, and one flight with its record and report."""

from collections import Counter
from contextlib import suppress
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request
from pydantic import BeforeValidator
from starlette.responses import Response

from aerodb.errors import AeroError
from aerodb.flows.answers import ListedFlight, ShownFlight
from aerodb.flows.report import report_flow
from aerodb.flows.web.console import (
    PER_PAGE,
    Limit,
    Vehicle,
    Word,
    access_of,
    address,
    console_of,
    document,
    given,
    page_of,
    report,
)
from aerodb.flows.web.models import answers
from aerodb.flows.web.roll_pictures import drawn_rolls
from aerodb.report import for_people
from aerodb.storage.catalogue import RETRACTED, VERDICTS, FlightFilter, FlightRow
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.view import (
    envelopes_of,
    flight_details,
    flights_document,
    has_log_here,
    log_document,
    record_of,
)
from aerodb.tasks.workspace_access import WorkspaceAccess

router = APIRouter(tags=["flights"])
_MOST_ENVELOPES = 50

Verdict = Annotated[
    Literal["good", "limited", "rejected", "unchecked", "retracted"] | None,
    BeforeValidator(given),
    Query(description="Only flights with this verdict, or those that were retracted."),
]
Text = Annotated[
    str,
    Query(max_length=200, description="Part of a flight's name, of its log's name, or of its id."),
]
After = Annotated[
    str, Query(max_length=200, description="End of the previous page, from its header Link.")
]


@router.get("/flights", include_in_schema=False)
def flights_page(
    request: Request,
    vehicle: Vehicle = None,
    verdict: Verdict = None,
    text: Text = "",
    after: After = "",
) -> Response:
    """The list of flights, filtered and paged."""
    access = access_of(request)
    filters = {"vehicle": vehicle, "verdict": verdict, "text": text}
    page = access.catalogue.flight_page(FlightFilter(vehicle, verdict, text), PER_PAGE, after)
    listed = flights_document(access.catalogue, page.rows)
    words = (RETRACTED if each["retracted"] else each["verdict"] for each in listed)
    return page_of(
        request,
        "flights.html",
        "Flights",
        flights=listed,
        of_each=Counter(words).most_common(),
        asked=filters,
        after=after,
        further=address("/flights", **filters, after=page.further) if page.further else "",
        vehicles=[row.name for row in access.catalogue.vehicles()],
        verdicts=[*VERDICTS, RETRACTED],
    )


@router.get("/api/flights", summary="Flights, newest first", responses=answers(list[ListedFlight]))
def flights(
    request: Request,
    vehicle: Vehicle = None,
    verdict: Verdict = None,
    text: Text = "",
    after: After = "",
    limit: Limit = PER_PAGE,
) -> Response:
    """The documents of `aerodb flight list`, paged; a search reads a bounded number of flights per
    page."""
    access = access_of(request)
    page = access.catalogue.flight_page(FlightFilter(vehicle, verdict, text), limit, after)
    filters = {
        "vehicle": vehicle,
        "verdict": verdict,
        "text": text,
        "limit": limit,
        "after": page.further,
    }
    return document(
        flights_document(access.catalogue, page.rows),
        address("/api/flights", **filters) if page.further else "",
    )


@router.get(
    "/api/envelopes",
    summary="Ranges that flights have covered",
    responses=answers(dict[str, dict[str, list[float]]]),
)
def envelopes(
    request: Request, flight: Annotated[list[str], Query(max_length=_MOST_ENVELOPES)]
) -> Response:
    """Lowest and highest usable airspeed, flow angles and altitude (SI), by flight id."""
    access = access_of(request)
    return document(envelopes_of(access, list(access.catalogue.flights_by_id(flight).values())))


@router.get("/flights/{flight}", include_in_schema=False)
def flight_page(
    request: Request, flight: str, vehicle: Vehicle = None, fetch: bool = False
) -> Response:
    """One flight: its details, its record, and what is based on it; `fetch` its log from the object
    store."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    record, missing = None, ""
    try:
        record = record_of(access, row)
    except AeroError as error:
        missing = str(error)
    said = None
    if fetch or has_log_here(access, row):
        with suppress(AeroError):  # lost or damaged: the channels are there all the same
            said = log_document(access, row)
    details = flight_details(access, row)
    label = row.name or (details["log"] or {}).get("name") or row.label
    zero = record.start if record else 0.0
    return page_of(
        request,
        "flight.html",
        f"Flight of {row.vehicle}",
        flight=details,
        drawn_rolls=drawn_rolls(details["rolls"], zero, for_people("m/s")[0]),
        label=label,
        record=record,
        missing=missing,
        said=said,
        zero=zero,
        released=_released(access, row),
    )


@router.get("/api/flights/{flight}", summary="One flight", responses=answers(ShownFlight))
def flight(request: Request, flight: str, vehicle: Vehicle = None) -> Response:
    """The document of `aerodb flight show`."""
    access = access_of(request)
    return document(flight_details(access, access.catalogue.flight(flight, vehicle)))


@router.get("/flights/{flight}/report", include_in_schema=False)
def flight_report(
    request: Request, flight: str, vehicle: Vehicle = None, against: Word = None
) -> Response:
    """The report of a flight beside a version, as `aerodb report flight` writes it."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    version = (
        access.catalogue.version(row.vehicle, against).id if against else _released(access, row)
    )
    parameters = {"kind": "flight", "about": row.id, "version": version or "", "in_pieces": True}
    return report(request, console_of(request).run(report_flow, parameters))


def _released(access: WorkspaceAccess, row: FlightRow) -> str | None:
    return access.named(row.vehicle, RELEASED)
