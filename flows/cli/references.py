"""What commands about versions have in common: which vehicle, version and point a user means, and a version as JSON."""

import math
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import channel
from aerodb.units import quantity
from storage.catalogue import Catalogue
from storage.rows import VersionRow

Vehicle = Annotated[str | None, typer.Option(help="The vehicle; not needed where there is only one.")]
AsOf = Annotated[str | None, typer.Option("--as-of", help="As it was at this date (ISO 8601, UTC).")]


def vehicle_of(catalogue: Catalogue, vehicle: str | None) -> str:
    """The vehicle that is meant: the one named, or the only one; UnknownNameError otherwise."""
    if vehicle is not None:
        return catalogue.vehicle(vehicle).name
    names = [row.name for row in catalogue.vehicles()]
    if len(names) != 1:
        raise UnknownNameError(
            "which vehicle?", remedy=f"--vehicle {' or '.join(names)}" if names else "add one: aerodb vehicle add"
        )
    return names[0]


def version_of(catalogue: Catalogue, reference: str, vehicle: str | None, as_of: str | None = None) -> VersionRow:
    """The version that is meant, now or as of a date in ISO 8601."""
    when = None
    if as_of is not None:
        try:
            when = datetime.fromisoformat(as_of)
        except ValueError as error:
            raise InputError(f"'{as_of}' is not a date", "--as-of", "for example 2026-05-31 or 2026-05-31T12:00") from error
        when = when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
    return catalogue.version(vehicle_of(catalogue, vehicle), reference, when)


def version_document(row: VersionRow) -> dict[str, Any]:
    """A version without its documents, for `--json`."""
    return {
        "version": row.id,
        "label": row.label,
        "vehicle": row.vehicle,
        "parent": row.parent,
        "content_sha256": row.content_sha256,
        "created_utc": row.created_utc.isoformat(),
    }


def point_of(text: str, inputs: tuple[str, ...]) -> dict[str, float]:
    """Channel -> value in SI of ``NAME=VALUE,...``; InputError for a name that is none of `inputs` and for no number."""
    point = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if not sign or name not in inputs:
            raise InputError(f"'{part}' is no input of this version", "--at", nearest(name, inputs))
        try:
            unit = channel(name).unit
        except UnknownNameError:
            unit = "1"  # a free input of an imported file: a bare number
        point[name] = quantity(value, unit)
        if not math.isfinite(point[name]):
            raise InputError(f"'{part}' is not a finite number", "--at", "give a number, with a unit or in SI")
    return point
