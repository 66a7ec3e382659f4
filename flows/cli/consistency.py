"""Print the consistency of a flight: the verdict, a table per channel, and the corrections."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import typer

from aerodb.flows.cli.output import Session, plus_minus, visible
from aerodb.nomenclature import CHANNELS

if TYPE_CHECKING:
    from aerodb.units import UnitSystem

#: Origin of a channel's values -> its words in a column.
_ORIGINS: Final = {
    "sensor": "corrected sensor",
    "sensor_and_motion": "smoothed",
    "motion": "smoothed",
    "motion_alone": "smoothed",
    "not_given": "not given",
}


def say_consistency(
    session: Session, document: Mapping[str, Any], indent: str = "", verbose: bool = True
) -> None:
    """Print verdict and reasons, the mismatch of each channel before and after, and the
    corrections; without `verbose` their number."""
    from aerodb.report import reasons_in_units

    session.say(f"{indent}consistency: {document['verdict']}")
    for reason in reasons_in_units(document, session.units):
        session.say(f"{indent}  {reason}")
    for remark in document.get("remarks", []):
        session.say(f"{indent}  {remark}")
    used = document.get("used", {}) | {
        name: _ORIGINS[origin] for name, origin in document.get("origins", {}).items()
    }
    rows = [_channel(entry, used, session.units) for entry in document["channels"]]
    if rows:
        columns = [
            f"{indent}channel",
            "mismatch before",
            "after",
            "limit",
            "unit",
            "verdict",
            "used",
        ]
        session.table(columns, [[f"{indent}{row[0]}", *row[1:]] for row in rows], numbers=(1, 2, 3))
        beyond = [
            c for c in document["channels"] if c["limit"] is not None and c["after"] > c["limit"]
        ]
        if any(channel["verdict"] == "good" for channel in beyond):
            session.say(f"{indent}mismatches hold gusts; the verdict leaves them out")
    applied = [entry for entry in document.get("estimates", []) if entry["applied"]]
    if applied and not verbose:
        session.say(f"{indent}corrected: {len(applied)} errors of sensors")
    elif applied:
        session.say(
            f"{indent}corrected: {', '.join(_estimate(entry, session.units) for entry in applied)}"
        )
    for sentence in document.get("drift", []):
        typer.echo(visible(f"{indent}{sentence}"), err=True)


def scale_of(name: str, units: "UnitSystem") -> tuple[float, str]:
    """Return factor and unit to show a channel, or a parameter of its sensor; empty without
    dimension."""
    subject, _, kind = name.rpartition("_")
    if kind == "scale":
        return 1.0, ""
    if kind == "delay":
        return 1.0, "s"
    unit = (
        CHANNELS[subject].unit
        if kind == "bias" and subject in CHANNELS
        else CHANNELS[name].unit
        if name in CHANNELS
        else ""
    )
    factor, shown = units.scale(unit)
    return factor, "" if shown == "-" else shown


def _channel(entry: Mapping[str, Any], used: Mapping[str, str], units: "UnitSystem") -> list[str]:
    factor, unit = scale_of(entry["channel"], units)
    limit = entry["limit"]
    shown = "-" if limit is None or math.isnan(limit) else f"{factor * limit:.3g}"
    return [
        entry["channel"],
        f"{factor * entry['before']:.3g}",
        f"{factor * entry['after']:.3g}",
        shown,
        unit,
        entry["verdict"],
        used.get(entry["channel"], ""),
    ]


def _estimate(entry: Mapping[str, Any], units: "UnitSystem") -> str:
    factor, unit = scale_of(entry["parameter"], units)
    size = plus_minus(entry["value"], entry["standard_error"], 3, factor)
    return f"{entry['parameter']} {size} {unit}".rstrip()
