"""``aerodb calibration`` and ``aerodb recalibrate``: sensor calibrations of a vehicle,
versioned."""

from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.consistency import say_consistency, scale_of
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.ingested import say_flights
from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import Direct, Vehicle, Verbose
from aerodb.support import counted

if TYPE_CHECKING:
    from aerodb.storage.catalogue import CalibrationRow
    from aerodb.units import UnitSystem

app = typer.Typer(
    name="calibration",
    cls=Commands,
    no_args_is_help=True,
    help="Calibrations: sensor errors from flights, as versions.",
)

#: Most errors of sensors that a line names.
_BEST: Final = 3

Since = Annotated[
    str | None,
    typer.Option("--valid-from", help="Only for flights that start then or later (ISO 8601, UTC)."),
]
Until = Annotated[
    str | None, typer.Option("--valid-until", help="Only for flights that start before then.")
]


@app.command("list")
def list_calibrations(context: typer.Context, vehicle: Vehicle = None) -> None:
    """List calibrations, oldest first, with the flights that are bound to each.

    Example: aerodb calibration list --vehicle my-glider
    """
    from aerodb.tasks.references import vehicle_of

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    rows = catalogue.calibrations(owner)
    bound = {row.id: catalogue.flights_bound_to(row.id) for row in rows}
    if not rows:
        session.headlines(
            f"{owner}: no calibration; each flight is corrected by itself",
            (),
            f'aerodb recalibrate --vehicle {owner} --reason "..."',
        )
        session.answer([])
        return
    newest = rows[-1]
    session.headlines(
        f"{owner}: {counted(len(rows), 'calibration')}; the newest is {newest.label}",
        [("corrects", _corrects(newest, len(bound[newest.id])))],
        f"aerodb calibration show {newest.label} --vehicle {owner}",
    )
    session.say()
    session.table(
        ["calibration", "id", "made", "parameters", "from flights", "bound", "reason"],
        [
            [
                row.label,
                row.id[:12],
                f"{row.created_utc:%Y-%m-%d %H:%M}",
                str(len(row.content["order"])),
                str(len(row.content["flights"])),
                str(len(bound[row.id])),
                row.reason,
            ]
            for row in rows
        ],
        numbers=(3, 4, 5),
    )
    session.answer([{**_document(row), "bound": list(bound[row.id])} for row in rows])


@app.command()
def show(context: typer.Context, calibration: str, vehicle: Vehicle = None) -> None:
    """Show a calibration: each parameter with its standard error, and the flights it was made from.

    Example: aerodb calibration show c0001
    """
    from aerodb.tasks.references import vehicle_of

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.calibration(vehicle_of(catalogue, vehicle), calibration)
    bound, parameters = list(catalogue.flights_bound_to(row.id)), _parameters(row)
    begin, end = row.content["valid_from"], row.content["valid_until"]
    session.headlines(
        f"{row.vehicle}: {row.label} corrects {_corrects(row, len(bound))}",
        [
            ("known best", _known_best(parameters, session.units)),
            ("valid", f"from {begin or 'the first flight'}{f' until {end}' if end else ' on'}"),
            ("why", row.reason),
        ],
    )
    session.say()
    _say_parameters(session, parameters)
    labels = catalogue.flight_labels(row.content["flights"])
    session.say(f"made {row.created_utc:%Y-%m-%d %H:%M} UTC from {', '.join(labels.values())}")
    session.answer({**_document(row), "bound": bound})


def recalibrate(
    context: typer.Context,
    reason: Annotated[str, typer.Option(help="Reason; it is stored with the calibration.")],
    vehicle: Vehicle = None,
    flights: Annotated[
        list[str] | None,
        typer.Option(help="Flights to calibrate from; default: all of the vehicle."),
    ] = None,
    valid_from: Since = None,
    valid_until: Until = None,
    direct: Direct = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate sensors jointly from several flights, and recompute what depends on these flights.

    Example: aerodb recalibrate --vehicle my-glider --reason "new boom"
    """
    from aerodb.flows.recalibrate import recalibrate_flow
    from aerodb.tasks.references import vehicle_of
    from aerodb.tasks.view import rebuilds

    session: Session = context.obj
    catalogue = session.catalogue()
    owner = vehicle_of(catalogue, vehicle)
    if not reason.strip():
        raise InputError("a calibration requires a reason", f"vehicle {owner}", "add --reason TEXT")
    chosen = (
        [catalogue.flight(ref, owner).id for ref in flights]
        if flights
        else [row.id for row in catalogue.flights(owner)]
    )
    if not chosen:
        raise InputError(
            "no flight is stored",
            f"vehicle {owner}",
            "ingest one: aerodb flight ingest LOG --vehicle " + owner,
        )
    since, until = _when(valid_from, "--valid-from"), _when(valid_until, "--valid-until")
    if since and until and since >= until:
        raise InputError("it ends before it begins", "--valid-until", "a date after --valid-from")
    span = {"valid_from": since, "valid_until": until}
    parameters = {"vehicle": owner, "flights": chosen, "reason": reason, **span}
    former = Counter[str](catalogue.flight(flight).verdict for flight in chosen)
    document = session.run(recalibrate_flow, parameters, direct)
    based = {
        use.version.id: use for flight in document["flights"] for use in catalogue.impact(flight)
    }
    stale = sorted(use.version.label for use in based.values())
    again = [each["command"] for each in rebuilds(catalogue, list(based.values()))]
    then = next(filter(None, again), f"aerodb close-loop --vehicle {owner}")
    names = catalogue.flight_labels(chosen)
    _say_calibration(session, owner, document, former, stale, then, names)
    session.say()
    outcomes = [_outcome(names[each], each, document) for each in document["consistency"]]
    say_flights(session, outcomes)
    if not verbose:
        session.say("channels and corrections of each flight: -v")
    for flight, consistency in document["consistency"].items() if verbose else ():
        session.say()
        session.say(f"flight {names[flight]}:")
        say_consistency(session, consistency, "  ")
    session.answer({**document, "rests_on_earlier": stale})


def _say_calibration(
    session: Session,
    vehicle: str,
    document: Mapping[str, Any],
    former: Counter[str],
    stale: Sequence[str],
    then: str,
    names: Mapping[str, str],
) -> None:
    """Print what a calibration found: verdicts on its flights now and `former` ones, the errors
    that are known best, what rests on the earlier one, and the next command; then all errors."""
    now = Counter(each["verdict"] for each in document["consistency"].values())
    counted = _counted(now) if now == former else f"{_counted(now)}; before {_counted(former)}"
    parameters = document["parameters"]
    groups = [
        f"{group['label']} for {len(group['flights'])} flights that share more"
        for group in document["groups"]
    ]
    session.headlines(
        f"{vehicle}: calibration {document['label']} from {len(document['flights'])} flights"
        f" ({counted})",
        [
            ("known best", _known_best(parameters, session.units)),
            ("groups", "; ".join(groups)),
            ("skipped", _skipped(document["skipped"], names)),
            ("by the earlier", ", ".join(stale)),
        ],
        then,
    )
    session.say()
    _say_parameters(session, parameters)
    for group in document["groups"]:
        own = {name: entry for name, entry in group["parameters"].items() if name not in parameters}
        session.say()
        session.say(
            f"calibration {group['label']} of"
            f" {', '.join(names[flight] for flight in group['flights'])}:"
        )
        _say_parameters(session, own or group["parameters"])


def _corrects(row: "CalibrationRow", flights: int) -> str:
    """Return how many errors a calibration corrects, and on how many flights."""
    errors = counted(len(row.content["order"]), "error")
    return f"{errors} of sensors on {counted(flights, 'flight')}"


def _known_best(parameters: Mapping[str, Mapping[str, float]], units: "UnitSystem") -> str:
    """Return the errors that are known best beside their size."""
    known = sorted(parameters, key=lambda name: -_significance(parameters[name]))
    return "; ".join(_error(name, parameters[name], units) for name in known[:_BEST])


def _counted(verdicts: Counter[str]) -> str:
    return ", ".join(f"{verdicts[name]} {name}" for name in sorted(verdicts))


def _significance(entry: Mapping[str, float]) -> float:
    return abs(entry["value"]) / (entry["standard_error"] or 1.0)


def _error(name: str, entry: Mapping[str, float], units: "UnitSystem") -> str:
    """Return a parameter +- half of its 95 % interval."""
    factor, unit = scale_of(name, units)
    size = plus_minus(entry["value"], entry["standard_error"], 3, factor)
    return f"{name} {size} {unit}".rstrip()


def _skipped(skipped: Sequence[Mapping[str, str]], names: Mapping[str, str]) -> str:
    first = [f"{names[each['flight']]}: {each['reason']}" for each in skipped[:1]]
    return f"{first[0]}{f' (and {len(skipped) - 1} more)' * (len(skipped) > 1)}" if first else ""


def _outcome(label: str, flight: str, document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a calibrated flight as `say_flights` takes it."""
    nothing: dict[str, Any] = {"repeats": [], "suspicions": [], "damage": [], "coefficients": None}
    consistency, comparison = document["consistency"][flight], document["comparison"].get(flight)
    return nothing | {
        "log": label,
        "flight": flight,
        "consistency": consistency,
        "comparison": comparison,
    }


def _when(text: str | None, option: str) -> str | None:
    if text is None:
        return None
    try:
        when = datetime.fromisoformat(text)
    except ValueError as error:
        raise InputError(
            f"'{text}' is not a date", option, "for example 2026-05-31 or 2026-05-31T12:00"
        ) from error
    return (when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)).isoformat()


def _say_parameters(session: Session, parameters: dict[str, dict[str, float]]) -> None:
    rows = []
    for name, entry in parameters.items():
        factor, unit = scale_of(name, session.units)
        rows.append(
            [
                name,
                f"{factor * entry['value']:.4g}",
                f"{factor * entry['standard_error']:.2g}",
                unit,
            ]
        )
    session.table(["parameter", "value", "standard error", "unit"], rows, numbers=(1, 2))


def _parameters(row: "CalibrationRow") -> dict[str, dict[str, float]]:
    names, spread = row.content["order"], row.content["covariance"]
    values = row.content["parameters"]
    return {
        name: {"value": values[name], "standard_error": spread[k][k] ** 0.5}
        for k, name in enumerate(names)
    }


def _document(row: "CalibrationRow") -> dict[str, Any]:
    return {
        "calibration": row.id,
        "label": row.label,
        "vehicle": row.vehicle,
        "parent": row.parent,
        "reason": row.reason,
        "created_utc": row.created_utc.isoformat(),
        "flights": row.content["flights"],
        "valid_from": row.content["valid_from"],
        "valid_until": row.content["valid_until"],
        "parameters": _parameters(row),
    }
