"""What a flight's page plots: channels over time, one over another, the track, and topics of the
log."""

import json
import struct
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from aerodb.flows.web import models
from aerodb.flows.web.console import Vehicle, access_of, document
from aerodb.flows.web.models import answers
from aerodb.tasks.view import (
    FEWEST_POINTS,
    MOST_POINTS,
    Series,
    log_document,
    logged_series,
    pair_of,
    record_of,
    series_of,
    topics_document,
    track_of,
)

router = APIRouter(tags=["flights"])

Start = Annotated[float, Query(alias="from", description="From this time [s].")]
End = Annotated[float, Query(alias="to", description="To this time [s].")]
Points = Annotated[
    int, Query(ge=FEWEST_POINTS, le=MOST_POINTS, description="Largest number of points per line.")
]
Channel = Annotated[str, Query(max_length=200, description="A channel or axis.")]


@router.get(
    "/api/flights/{flight}/channels",
    summary="Channels of a flight, decimated for plots",
    responses=answers(models.Record),
)
def channels(
    request: Request,
    flight: str,
    names: Annotated[
        str,
        Query(
            max_length=4000,
            description="Channels, axes and sigma_NAME, separated by commas; default: those shown"
            " first.",
        ),
    ] = "",
    logged: Annotated[
        list[str],
        Query(max_length=40, description="Fields of the log, each as TOPIC:FIELD, as recorded."),
    ] = [],  # noqa: B006  # FastAPI copies it
    start: Start = -1e12,
    end: End = 1e12,
    points: Points = 2000,
    format: Annotated[
        Literal["json", "binary"], Query(description="binary: float64 arrays after a JSON heading.")
    ] = "json",
    vehicle: Vehicle = None,
) -> Response:
    """Time [s] and values (SI) of each line, decimated for a screen; extremes are kept.

    A window with few samples is returned in full.
    """
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if not wanted and not logged:
        wanted = list(record_of(access, row).first)
    lines, ends = series_of(access, row, wanted, start, end, points)
    if logged:
        lines += logged_series(access, row, logged, start, end, points)
    heading = {"flight": row.id, "start": ends[0], "end": ends[1]}
    if format == "binary":
        return Response(_packed(heading, lines), media_type="application/octet-stream")
    arrays = [
        {**_heading(line), "time": line.time.tolist(), "values": line.values.tolist()}
        for line in lines
    ]
    return document({**heading, "series": arrays})


@router.get(
    "/api/flights/{flight}/pairs",
    summary="One channel of a flight over another, decimated",
    responses=answers(models.Pairs),
)
def pairs(
    request: Request,
    flight: str,
    x: Channel,
    y: Channel,
    start: Start = -1e12,
    end: End = 1e12,
    points: Points = 2000,
    vehicle: Vehicle = None,
) -> Response:
    """Time [s] and values (SI) of two channels at common samples; extremes of both are kept."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    over, under, found = pair_of(access, row, (x, y), start, end, points)
    looks = [
        {"name": c.name, "source": c.source, "unit": c.unit, "label": c.label, "factor": c.factor}
        for c in (over, under)
    ]
    axes = [
        {**look, "values": values.tolist()} for look, values in zip(looks, found[1:], strict=True)
    ]
    return document({"flight": row.id, "time": found[0].tolist(), "x": axes[0], "y": axes[1]})


@router.get(
    "/api/flights/{flight}/track",
    summary="Path of a flight over the ground, decimated",
    responses=answers(models.Track),
)
def track(
    request: Request,
    flight: str,
    start: Start = -1e12,
    end: End = 1e12,
    points: Points = 2000,
    vehicle: Vehicle = None,
) -> Response:
    """Time [s], north and east of the local origin, and altitude [m]; extremes are kept."""
    access = access_of(request)
    row = access.catalogue.flight(flight, vehicle)
    found = track_of(access, row, start, end, points)
    columns = {name: values.tolist() for name, values in vars(found).items()}
    return document({"flight": row.id, **columns})


@router.get(
    "/api/flights/{flight}/log",
    summary="What the log of a flight says",
    responses=answers(models.LogContent),
)
def log(request: Request, flight: str, vehicle: Vehicle = None) -> Response:
    """Firmware, information, parameters, and messages (time [s] on the log's clock)."""
    access = access_of(request)
    return document(log_document(access, access.catalogue.flight(flight, vehicle)))


@router.get(
    "/api/flights/{flight}/topics",
    summary="Topics of the log of a flight",
    responses=answers(list[models.LoggedTopic]),
)
def topics(request: Request, flight: str, vehicle: Vehicle = None) -> Response:
    """Every topic with its fields, mapped or not; `channels` takes them as logged=TOPIC:FIELD."""
    access = access_of(request)
    return document(topics_document(access, access.catalogue.flight(flight, vehicle)))


def _heading(line: Series) -> dict[str, Any]:
    return {
        "name": line.name,
        "source": line.source,
        "unit": line.unit,
        "label": line.label,
        "factor": line.factor,
        "flagged": [list(stretch) for stretch in line.flagged],
        "version": line.version,
    }


def _packed(lead: dict[str, Any], lines: Sequence[Series]) -> bytes:
    """Return the heading's length (uint32), the JSON heading padded to 8 bytes, then time and
    values.

    All numbers are little-endian.
    """
    heading = json.dumps(
        {**lead, "series": [{**_heading(line), "samples": len(line.time)} for line in lines]}
    ).encode("ascii")
    heading += b" " * (-(len(heading) + 4) % 8)
    arrays = (
        np.ascontiguousarray(values, "<f8").tobytes()
        for line in lines
        for values in (line.time, line.values)
    )
    return struct.pack("<I", len(heading)) + heading + b"".join(arrays)
